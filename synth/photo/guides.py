"""What a user says of the motion: strokes, interpolated to an orientation map, and a speed map (okabe11 §5, fig. 8).

"The user draws using strokes and generates an orientation map by interpolating the sparsely drawn strokes using a
radial basis function." Strokes have a sense: from their first point to their last. The function is the distance r,
with a constant: it knows no scale, does not overshoot between strokes, and far from all of them it tends to a mean.

Points are x, y in pixels, rows from the lowest; velocities are pixels per frame.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy import ndimage
from scipy.interpolate import RBFInterpolator

Interpolation = Callable[[np.ndarray, np.ndarray, tuple[int, int]], np.ndarray]
SPACING = 8.0
"""Pixels between the points at which a stroke is read."""
MOST = 2000
"""Points of all strokes together, at most: the spline solves for each of them."""
SMOOTHING = 1e-3
"""Of the spline, so that strokes that cross at an angle do not make it swing."""
COARSE = 8
"""The map is found at every so manieth pixel, and in between bilinear."""


def stroke_points(strokes: Sequence[np.ndarray], spacing: float = SPACING) -> tuple[np.ndarray, np.ndarray]:
    """Points on the strokes and the unit tangent at each: (M, 2) float64 each.

    strokes  each (K, 2), K >= 2, x and y along it. Raises ValueError for a stroke of one point or of no length.
    """
    points, tangents = [], []
    for number, stroke in enumerate(strokes):
        stroke = np.asarray(stroke, np.float64)
        if stroke.ndim != 2 or stroke.shape[1] != 2 or len(stroke) < 2:
            raise ValueError(f"stroke {number} is not two or more points x, y")
        steps = np.diff(stroke, axis=0)
        lengths = np.hypot(*steps.T)
        whole = np.concatenate([[0], np.cumsum(lengths)])
        if not whole[-1] > 0 or not np.isfinite(whole[-1]):
            raise ValueError(f"stroke {number} has no length")
        at = (np.arange(max(1, round(whole[-1] / spacing))) + 0.5) * (whole[-1] / max(1, round(whole[-1] / spacing)))
        segment = np.clip(np.searchsorted(whole, at, side="right") - 1, 0, len(steps) - 1)
        # a segment of no length is passed over
        part = (at - whole[segment]) / np.where(lengths[segment] > 0, lengths[segment], 1)
        points.append(stroke[segment] + part[:, None] * steps[segment])
        tangents.append(steps[segment] / np.where(lengths[segment] > 0, lengths[segment], 1)[:, None])
    return np.concatenate(points), np.concatenate(tangents)


def orientation(strokes: Sequence[np.ndarray], shape: tuple[int, int], frozen: np.ndarray | None = None) -> np.ndarray:
    """The orientation map: (Y, X, 2) float32 unit vectors, interpolated from strokes on a picture of `shape` (Y, X).

    frozen  (Y, X) bool: what stands still. A stroke is not heard behind it: each connected part of the rest that has
            strokes of its own is interpolated from these alone
    Where the interpolated vectors cancel, the direction of the nearest stroke is taken.
    Raises ValueError without strokes, for strokes that are none (`stroke_points`), or all outside the picture.
    """
    if not len(strokes):
        raise ValueError("an orientation map needs at least one stroke")
    points, tangents = _inside(*_thinned(*stroke_points(strokes)), shape)
    return _by_part(points, tangents, shape, frozen, _directions)


def speeds(strokes: Sequence[np.ndarray], given: Sequence[float], shape: tuple[int, int],
           frozen: np.ndarray | None = None) -> np.ndarray:
    """The speed map: (Y, X) float32, interpolated from one speed of each stroke; in their unit and range.

    So a fall may be fast and its pool slow. strokes, frozen and errors as in `orientation`; ValueError too for another
    number of speeds than of strokes.
    """
    if len(strokes) != len(given):
        raise ValueError(f"{len(strokes)} strokes need {len(strokes)} speeds, not {len(given)}")
    each = [stroke_points([stroke])[0] for stroke in strokes]
    values = np.concatenate([np.full((len(points), 1), speed) for points, speed in zip(each, given, strict=True)])
    points, values = _inside(*_thinned(np.concatenate(each), values), shape)
    found = _by_part(points, values, shape, frozen, _values)[..., 0]
    return np.clip(found, min(given), max(given)).astype(np.float32)


def _inside(points: np.ndarray, values: np.ndarray, shape: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """The points in the picture, with their values."""
    inside = ((points >= -0.5) & (points <= np.array(shape[::-1]) - 0.5)).all(axis=1)
    if not inside.any():
        raise ValueError(f"all strokes lie outside the picture of {shape[1]} x {shape[0]} pixels")
    return points[inside], values[inside]


def _by_part(points: np.ndarray, values: np.ndarray, shape: tuple[int, int], frozen: np.ndarray | None,
             interpolated: Interpolation) -> np.ndarray:
    """Values (M, C) at points interpolated on a picture, in each part that `frozen` leaves from its own points."""
    found = interpolated(points, values, shape)
    if frozen is not None and frozen.any():
        parts, count = ndimage.label(~frozen)
        x, y = np.rint(points).astype(int).T
        of = parts[y, x]
        for part in range(1, count + 1):
            if (of == part).any() and (of != part).any():
                alone = interpolated(points[of == part], values[of == part], shape)
                found = np.where((parts == part)[..., None], alone, found)
    return found


def _thinned(points: np.ndarray, tangents: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """At most MOST points, evenly taken; of several at one place the first."""
    every = -(-len(points) // MOST)
    points, tangents = points[::every], tangents[::every]
    _, first = np.unique(np.round(points, 3), axis=0, return_index=True)
    first = np.sort(first)
    return points[first], tangents[first]


def _directions(points: np.ndarray, tangents: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Unit vectors (Y, X, 2) float32 through tangents (M, 2) at points (M, 2)."""
    at = _coarse(shape)
    coarse = _spline(points, tangents, at, max(shape))
    nearest = tangents[((at[:, None] - points) ** 2).sum(axis=2).argmin(axis=1)]
    size = np.hypot(*coarse.T)
    fine = _fine(np.where(size[:, None] > 1e-2, coarse / np.maximum(size, 1e-2)[:, None], nearest), shape)
    size = np.hypot(fine[..., 0], fine[..., 1])[..., None]
    return np.where(size > 1e-6, fine / np.maximum(size, 1e-6), [1.0, 0.0]).astype(np.float32)


def _values(points: np.ndarray, values: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Numbers (Y, X, C) float32 through values (M, C) at points (M, 2)."""
    return _fine(_spline(points, values, _coarse(shape), max(shape)), shape).astype(np.float32)


def _coarse(shape: tuple[int, int]) -> np.ndarray:
    """Every COARSE-th point of a picture, and those beyond its end: (N, 2) x, y."""
    rows, columns = (max(2, -(-n // COARSE) + 1) for n in shape)
    return np.stack(np.meshgrid(np.arange(columns) * COARSE, np.arange(rows) * COARSE), axis=-1).reshape(-1, 2)


def _spline(points: np.ndarray, values: np.ndarray, at: np.ndarray, scale: float) -> np.ndarray:
    """Values (N, C) at points `at` of the radial basis function through values (M, C)."""
    if len(points) == 1:
        return np.broadcast_to(values, (len(at), values.shape[1]))
    return np.asarray(RBFInterpolator(points / scale, values, kernel="linear", degree=0, smoothing=SMOOTHING)(
        at / scale))


def _fine(coarse: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Values (N, C) at the points of `_coarse`, bilinear at each pixel: (Y, X, C) float64."""
    rows, columns = (max(2, -(-n // COARSE) + 1) for n in shape)
    y, x = np.mgrid[:shape[0], :shape[1]] / COARSE
    planes = coarse.reshape(rows, columns, -1)
    return np.stack([ndimage.map_coordinates(planes[..., c], [y, x], order=1, mode="nearest")
                     for c in range(planes.shape[2])], axis=-1)
