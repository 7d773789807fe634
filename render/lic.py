"""Pictures of vector fields: line integral convolution (Cabral and Leedom 1993) and direction as colour.

As in ma09 figure 4, LIC leaves zero vectors as white noise that is not integrated, with reduced amplitude.
Fields have y up (row 0 is the bottom); the pictures have their top row first.
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from render import film

OVERSAMPLING = 2  # lines are drawn on a grid this much finer and averaged down: no jagged streaks
STREAK = 0.13  # length of the convolution kernel as a share of the picture's larger side
GRAIN = 1.25  # size of a grain of the noise in pixels of the picture
CONTRAST = 0.24  # standard deviation of integrated lines about mid grey
STILL_CONTRAST = 0.055  # of the noise where the field is zero: the "reduced amplitude"
STILL, MOVING = 0.004, 0.03  # magnitudes, as shares of the largest, between which lines fade in


def slice_of(v: np.ndarray, index: int | None = None) -> np.ndarray:
    """The x, y components (Y, X, 2) of a 3-D field (Z, Y, X, 3) in the plane z = index (the middle one)."""
    if v.ndim != 4 or v.shape[3] != 3:
        raise ValueError(f"expected a field (Z, Y, X, 3), got {v.shape}")
    return v[v.shape[0] // 2 if index is None else index, :, :, :2]


def _checked(v: np.ndarray) -> np.ndarray:
    if v.ndim != 3 or v.shape[2] != 2 or min(v.shape[:2]) < 2:
        raise ValueError(f"expected a field (Y, X, 2) of at least 2 x 2 cells, got {v.shape}")
    if not np.isfinite(v).all():
        raise ValueError("the field holds NaN or infinity")
    return np.asarray(v, np.float32)


def height_for(shape: tuple[int, ...], width: int) -> int:
    """Rows of a picture `width` pixels wide of a field or density of `shape` (Y, X, ...)."""
    return max(1, round(width * shape[0] / shape[1]))


def resampled(values: np.ndarray, height: int, width: int, order: int = 1) -> np.ndarray:
    """`values` (Y, X[, C]) at (height, width[, C]) by linear (or, order 3, cubic) interpolation.

    Cells are little squares: the borders of the two grids coincide, and border cells are extended.
    """
    rows = (np.arange(height) + 0.5) * (values.shape[0] / height) - 0.5
    columns = (np.arange(width) + 0.5) * (values.shape[1] / width) - 0.5
    where = np.meshgrid(rows, columns, indexing="ij")
    planes = values[..., None] if values.ndim == 2 else values
    result = np.stack(
        [ndimage.map_coordinates(planes[..., c], where, order=order, mode="nearest", output=np.float32)
         for c in range(planes.shape[2])], axis=-1)
    return result[..., 0] if values.ndim == 2 else result


def averaged(values: np.ndarray, factor: int) -> np.ndarray:
    """`values` (h, w[, C]) averaged over blocks of `factor` x `factor` pixels."""
    h, w = values.shape[0] // factor, values.shape[1] // factor
    return values.reshape(h, factor, w, factor, *values.shape[2:]).mean(axis=(1, 3))


def _noise(height: int, width: int, seed: int) -> np.ndarray:
    """Noise (height, width), positive, of deviation 1, its grain a little larger than an output pixel."""
    white = np.random.Generator(np.random.Philox(key=seed)).standard_normal((height, width), dtype=np.float32)
    soft = ndimage.gaussian_filter(white, GRAIN * OVERSAMPLING / 2.355, mode="wrap")
    return (soft - soft.min()) / soft.std()  # positive: rlic refuses a texture below zero


def _moving(magnitude: np.ndarray) -> np.ndarray:
    """0 where the field stands still, 1 where it moves, a smooth step between."""
    largest = float(magnitude.max())
    if largest == 0.0:
        return np.zeros_like(magnitude)
    t = np.clip((magnitude / largest - STILL) / (MOVING - STILL), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def lines(v: np.ndarray, width: int, seed: int = 1) -> np.ndarray:
    """LIC of `v` (Y, X, 2), any unit, y up: grey display values (h, width) float32 in [0, 1], top row first.

    Two passes over noise at twice the resolution, brought to one contrast; zero vectors keep dim noise.
    """
    import rlic

    v = _checked(v)
    rows, columns = height_for(v.shape, width) * OVERSAMPLING, width * OVERSAMPLING
    fine = resampled(v, rows, columns, order=3)
    noise = _noise(rows, columns, seed)
    length = int(STREAK * max(rows, columns)) // 4 * 2 + 1  # odd: as far forward as back; two passes
    kernel = np.hanning(length + 2)[1:-1].astype(np.float32)
    streaks = rlic.convolve(noise, np.ascontiguousarray(fine[..., 0]), np.ascontiguousarray(fine[..., 1]),
                            kernel=kernel / kernel.sum(), iterations=2)
    moving = averaged(_moving(np.hypot(fine[..., 0], fine[..., 1])), OVERSAMPLING)
    grey = 0.5 + moving * _contrast(averaged(streaks, OVERSAMPLING), moving, CONTRAST)
    grey += (1.0 - moving) * _contrast(averaged(noise, OVERSAMPLING), 1.0 - moving, STILL_CONTRAST)
    return np.clip(grey, 0.0, 1.0)[::-1].astype(np.float32)


def _contrast(values: np.ndarray, weight: np.ndarray, deviation: float) -> np.ndarray:
    """`values` shifted and scaled to mean 0 and `deviation`, both measured under `weight`."""
    total = float(weight.sum())
    if total == 0.0:
        return np.zeros_like(values)
    mean = float((weight * values).sum()) / total
    spread = float(np.sqrt((weight * (values - mean) ** 2).sum() / total))
    return (values - mean) * (deviation / max(spread, 1e-12))


def _strength(v: np.ndarray) -> np.ndarray:
    """Magnitude (Y, X) in [0, 1]: 1 is the 99.5th percentile of what moves, so that one peak dims nothing."""
    magnitude = np.hypot(v[..., 0], v[..., 1])
    moving = magnitude[magnitude > STILL * magnitude.max()]
    # the root lifts the weak part of a field, which a linear scale would leave white
    return np.sqrt(np.clip(magnitude / np.percentile(moving, 99.5), 0.0, 1.0)) if moving.size else magnitude


def _hued(lightness: np.ndarray, chroma: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Display values (..., 3) of Oklab lightness, chroma and hue (0 = +x is red, counter-clockwise)."""
    hue = angle + np.deg2rad(29.0)  # Oklab's red
    lab = np.stack([lightness, chroma * np.cos(hue), chroma * np.sin(hue)], axis=-1)
    return film.encoded(film.oklab_to_linear(lab)).astype(np.float32)


def colour(v: np.ndarray, width: int) -> np.ndarray:
    """`v` (Y, X, 2), y up, as colour (h, width, 3) float32 display values, top row first.

    Hue is the direction, as `wheel` shows; the larger the magnitude, the deeper the colour; zero is white.
    """
    fine = resampled(_checked(v), height_for(v.shape, width), width, order=3)
    strength = _strength(fine)
    angle = np.arctan2(fine[..., 1], fine[..., 0])
    return _hued(1.0 - 0.30 * strength, 0.19 * strength, angle)[::-1].copy()


def picture(v: np.ndarray, width: int, seed: int = 1, tint: bool = False) -> np.ndarray:
    """LIC of `v` (Y, X, 2), y up: (h, width, 3) float32 display values, top row first.

    Grey as in the paper; with `tint` the lines carry the colours of `colour`.
    """
    grey = lines(v, width, seed)
    if not tint:
        return np.repeat(grey[..., None], 3, axis=2)
    fine = resampled(_checked(v), height_for(v.shape, width), width, order=3)[::-1]
    strength = _strength(fine)
    room = 1.0 - np.abs(2.0 * grey - 1.0) ** 2  # no chroma at black and white: it would be clipped
    return _hued(0.25 + 0.75 * grey, 0.15 * strength * room, np.arctan2(fine[..., 1], fine[..., 0]))


def wheel(size: int) -> np.ndarray:
    """The legend of `colour`: a disc (size, size, 4) float32 display values and coverage, top row first."""
    at = (np.arange(4 * size) + 0.5) / (2 * size) - 1.0
    x, y = np.meshgrid(at, -at)
    radius = np.hypot(x, y)
    strength = np.clip(radius / 0.97, 0.0, 1.0)
    disc = _hued(1.0 - 0.30 * strength, 0.19 * strength, np.arctan2(y, x))
    return averaged(np.concatenate([disc, (radius <= 0.97)[..., None].astype(np.float32)], axis=2), 4)
