"""What a user says of the motion: strokes, interpolated to an orientation map, and a speed map (okabe11 §5, fig. 8).

"The user draws using strokes and generates an orientation map by interpolating the sparsely drawn strokes using a
radial basis function." Strokes have a sense: from their first point to their last. The function is the distance r,
with a constant: it knows no scale, does not overshoot between strokes, and far from all of them it tends to a mean.

Points are x, y in pixels, rows from the lowest; velocities are pixels per frame.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import ndimage
from scipy.interpolate import RBFInterpolator

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
    points, tangents = _thinned(*stroke_points(strokes))
    inside = ((points >= -0.5) & (points <= np.array(shape[::-1]) - 0.5)).all(axis=1)
    if not inside.any():
        raise ValueError(f"all strokes lie outside the picture of {shape[1]} x {shape[0]} pixels")
    points, tangents = points[inside], tangents[inside]
    found = _interpolated(points, tangents, shape)
    if frozen is not None and frozen.any():
        parts, count = ndimage.label(~frozen)
        x, y = np.rint(points).astype(int).T
        of = parts[y, x]
        for part in range(1, count + 1):
            if (of == part).any() and (of != part).any():
                alone = _interpolated(points[of == part], tangents[of == part], shape)
                found = np.where((parts == part)[..., None], alone, found)
    return found


def _thinned(points: np.ndarray, tangents: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """At most MOST points, evenly taken; of several at one place the first."""
    every = -(-len(points) // MOST)
    points, tangents = points[::every], tangents[::every]
    _, first = np.unique(np.round(points, 3), axis=0, return_index=True)
    first = np.sort(first)
    return points[first], tangents[first]


def _interpolated(points: np.ndarray, tangents: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Unit vectors (Y, X, 2) float32 through tangents (M, 2) at points (M, 2)."""
    rows, columns = (max(2, -(-n // COARSE) + 1) for n in shape)
    at = np.stack(np.meshgrid(np.arange(columns) * COARSE, np.arange(rows) * COARSE), axis=-1).reshape(-1, 2)
    if len(points) == 1:
        coarse = np.broadcast_to(tangents, (len(at), 2))
    else:
        scale = float(max(shape))
        spline = RBFInterpolator(points / scale, tangents, kernel="linear", degree=0, smoothing=SMOOTHING)
        coarse = spline(at / scale)
    nearest = tangents[((at[:, None] - points) ** 2).sum(axis=2).argmin(axis=1)]
    size = np.hypot(*coarse.T)
    coarse = np.where(size[:, None] > 1e-2, coarse / np.maximum(size, 1e-2)[:, None], nearest).reshape(rows, columns, 2)
    y, x = np.mgrid[:shape[0], :shape[1]] / COARSE
    fine = np.stack([ndimage.map_coordinates(coarse[..., c], [y, x], order=1, mode="nearest") for c in (0, 1)], axis=-1)
    size = np.hypot(fine[..., 0], fine[..., 1])[..., None]
    return np.where(size > 1e-6, fine / np.maximum(size, 1e-6), [1.0, 0.0]).astype(np.float32)
