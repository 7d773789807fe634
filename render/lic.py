"""Pictures of vector fields: line integral convolution (Cabral and Leedom 1993), direction and divergence as colour.

As in ma09 figure 4, LIC shows zero vectors as white noise that is not integrated, with reduced amplitude.
Fields have y up (row 0 is the bottom); the pictures have their top row first.
"""

from __future__ import annotations

import functools

import numpy as np
from scipy import ndimage, sparse

from render import tonemap
from synth.projection import divergence as _divergence

OVERSAMPLING = 2  # the last pass runs on a grid this much finer and is averaged down: no jagged streaks
STREAK = 0.13  # length of the convolution kernel as a share of the picture's larger side
FINISH = 5  # length of the last, short kernel on the finer grid
GRAIN = 1.25  # grain size of the noise where the field is zero, pixels of the picture
LINE_GRAIN = 0.5  # and of the noise that is convolved; the passes and their sampling make it coarser
CONTRAST = 0.24  # standard deviation of integrated lines about mid grey
STILL_CONTRAST = 0.055  # of the noise where the field is zero: the "reduced amplitude"
STILL, MOVING = 0.004, 0.03  # magnitudes, relative to the largest, between which lines fade in
FULL = 0.6  # divergence, relative to the field's rms gradient, of the most saturated colour
SPLINE_BORDER = 12  # cells over which a spline coefficient's influence falls below float32 precision


def slice_of(v: np.ndarray, plane: str = "front") -> np.ndarray:
    """The middle slice of a 3-D field (Z, Y, X, 3) with the two components in its plane: (x, y) as (Y, X, 2)
    from the front, (z, y) as (Y, Z, 2) from the side, (x, z) as (Z, X, 2) from the top."""
    if v.ndim != 4 or v.shape[3] != 3:
        raise ValueError(f"expected a field (Z, Y, X, 3), got {v.shape}")
    z, y, x = (n // 2 for n in v.shape[:3])
    match plane:
        case "front":
            return v[z][..., [0, 1]]
        case "side":
            return v[:, :, x].swapaxes(0, 1)[..., [2, 1]]
        case "top":
            return v[:, y][..., [0, 2]]
    raise ValueError(f"plane {plane!r} is none of front, side, top")


def _checked(v: np.ndarray) -> np.ndarray:
    if v.ndim != 3 or v.shape[2] != 2 or min(v.shape[:2]) < 2:
        raise ValueError(f"expected a field (Y, X, 2) of at least 2 x 2 cells, got {v.shape}")
    if not np.isfinite(v).all():
        raise ValueError("the field holds NaN or infinity")
    return np.asarray(v, np.float32)


SOLID = 0.80  # display grey of an obstacle
OUTLINE = 1.6  # width of its outline, pixels


def with_solids(picture: np.ndarray, distance: np.ndarray) -> np.ndarray:
    """Display values (h, w, 3) of a field's picture with obstacles over it: plain grey with a dark outline.

    distance  (Y, X), cells to the boundary of the obstacles, negative inside
    """
    height, width = picture.shape[:2]
    pixels = resampled(distance.astype(np.float32), height, width)[::-1] * (height / distance.shape[0])
    inside = np.clip(0.5 - pixels, 0, 1)[..., None]
    line = np.clip(OUTLINE - np.abs(pixels), 0, 1)[..., None]
    return (picture * (1 - inside) + SOLID * inside) * (1 - 0.85 * line)


def height_for(shape: tuple[int, ...], width: int) -> int:
    """Rows of a picture `width` pixels wide of a field or density of `shape` (Y, X, ...)."""
    return max(1, round(width * shape[0] / shape[1]))


def resampled(values: np.ndarray, height: int, width: int, order: int = 1) -> np.ndarray:
    """`values` (Y, X[, C]) at (height, width[, C]) by linear (or, order 3, cubic) interpolation.

    Cells are squares: the borders of the two grids coincide, and border cells are extended.
    """
    rows, columns, *channels = values.shape
    if order == 3:  # B-spline coefficients, on a grid padded so far that its border has no influence
        border = ((SPLINE_BORDER,) * 2, (SPLINE_BORDER,) * 2, *((0, 0) for _ in channels))
        values = np.pad(values, border, mode="edge")
        for axis in (0, 1):
            values = ndimage.spline_filter1d(values, order, axis)
    across = np.moveaxis(values, 1, 0).astype(np.float32)  # columns first, while the rows are few
    across = (_weights(columns, width, order) @ across.reshape(len(across), -1)).reshape(width, *across.shape[1:])
    along = np.ascontiguousarray(np.moveaxis(across, 0, 1))
    result = _weights(rows, height, order) @ along.reshape(len(along), -1)
    return np.asarray(result.reshape(height, width, *channels))


def _weights(cells: int, pixels: int, order: int) -> sparse.csr_matrix:
    """Weight of each cell for each pixel along one axis, (pixels, cells) float32; order 3: of cells and border."""
    at = (np.arange(pixels) + 0.5) * (cells / pixels) - 0.5
    if order == 1:
        at = np.clip(at, 0, cells - 1)
    low = np.floor(at).astype(int)
    t = at - low
    if order == 1:
        first, taps = low, np.stack([1 - t, t])
    else:
        first = low - 1 + SPLINE_BORDER
        taps = np.stack([(1 - t)**3, (3 * t - 6) * t**2 + 4, ((3 - 3 * t) * t + 3) * t + 1, t**3]) / 6
        cells += 2 * SPLINE_BORDER
    column = np.minimum(first + np.arange(len(taps))[:, None], cells - 1)
    row = np.broadcast_to(np.arange(pixels), column.shape)
    return sparse.csr_matrix((taps.astype(np.float32).ravel(), (row.ravel(), column.ravel())), (pixels, cells))


def averaged(values: np.ndarray, factor: int) -> np.ndarray:
    """`values` (h, w[, C]) averaged over blocks of `factor` x `factor` pixels."""
    h, w = values.shape[0] // factor, values.shape[1] // factor
    return values.reshape(h, factor, w, factor, *values.shape[2:]).mean(axis=(1, 3))


@functools.lru_cache(maxsize=4)  # the same in every frame
def _noise(height: int, width: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Noise for a picture (height, width): the positive texture that is convolved, and the one for zero vectors."""
    fine = (height * OVERSAMPLING, width * OVERSAMPLING)
    white = np.random.Generator(np.random.Philox(key=seed)).standard_normal(fine, dtype=np.float32)
    still, texture = (
        averaged(ndimage.gaussian_filter(white, grain * OVERSAMPLING / 2.355, mode="wrap"), OVERSAMPLING)
        for grain in (GRAIN, LINE_GRAIN))
    return texture - texture.min(), still  # rlic rejects negative textures


def _moving(magnitude: np.ndarray) -> np.ndarray:
    """0 where the field is zero, 1 where it moves, a smooth step between."""
    largest = float(magnitude.max())
    if largest == 0.0:
        return np.zeros_like(magnitude)
    t = np.clip((magnitude / largest - STILL) / (MOVING - STILL), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def lines(v: np.ndarray, width: int, seed: int = 1) -> np.ndarray:
    """LIC of `v` (Y, X, 2), any unit, y up: grey display values (h, width) float32 in [0, 1], top row first.

    Two long passes over white noise at the picture's resolution make the streaks; a short third one at twice the
    resolution, averaged down, removes jagged edges. The contrast is normalized; zero vectors keep dim noise.
    """
    v = _checked(v)
    height = height_for(v.shape, width)
    fine = resampled(v, height * OVERSAMPLING, width * OVERSAMPLING, order=3)
    texture, still = _noise(height, width, seed)
    length = int(STREAK * max(height, width)) // 4 * 2 + 1  # odd, so symmetric; half of it for each of two passes
    streaks = convolved(texture, averaged(fine, OVERSAMPLING), length, 2)
    finer = resampled(streaks, height * OVERSAMPLING, width * OVERSAMPLING)
    streaks = averaged(convolved(finer, fine, FINISH, 1), OVERSAMPLING)
    moving = averaged(_moving(np.hypot(fine[..., 0], fine[..., 1])), OVERSAMPLING)
    grey = 0.5 + moving * _contrast(streaks, moving, CONTRAST)
    grey += (1.0 - moving) * _contrast(still, 1.0 - moving, STILL_CONTRAST)
    return np.clip(grey, 0.0, 1.0)[::-1].astype(np.float32)


def convolved(texture: np.ndarray, v: np.ndarray, length: int, passes: int) -> np.ndarray:
    """A positive texture (h, w) averaged along v (h, w, 2) with a Hann window of `length` pixels, `passes` times."""
    import rlic

    kernel = np.hanning(length + 2)[1:-1].astype(np.float32)
    return rlic.convolve(np.maximum(texture, 0), np.ascontiguousarray(v[..., 0]), np.ascontiguousarray(v[..., 1]),
                         kernel=kernel / kernel.sum(), iterations=passes)


def _contrast(values: np.ndarray, weight: np.ndarray, deviation: float) -> np.ndarray:
    """`values` shifted and scaled to mean 0 and standard deviation `deviation`, both weighted by `weight`."""
    total = float(weight.sum())
    if total == 0.0:
        return np.zeros_like(values)
    mean = float((weight * values).sum()) / total
    spread = float(np.sqrt((weight * (values - mean) ** 2).sum() / total))
    return (values - mean) * (deviation / max(spread, 1e-12))


def _strength(v: np.ndarray) -> np.ndarray:
    """Magnitude (Y, X) in [0, 1]: 1 is the 99.5th percentile where the field moves, so that a peak dims nothing."""
    magnitude = np.hypot(v[..., 0], v[..., 1])
    moving = magnitude[magnitude > STILL * magnitude.max()]
    # the square root lifts the weak part of a field, which a linear scale would leave white
    return np.sqrt(np.clip(magnitude / np.percentile(moving, 99.5), 0.0, 1.0)) if moving.size else magnitude


def _hued(lightness: np.ndarray, chroma: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Display values (..., 3) of Oklab lightness, chroma and hue (0 = +x is red, counter-clockwise)."""
    hue = angle + np.deg2rad(29.0)  # Oklab's red
    lab = np.stack([lightness, chroma * np.cos(hue), chroma * np.sin(hue)], axis=-1)
    return tonemap.to_srgb(tonemap.oklab_to_linear(lab)).astype(np.float32)


def colour(v: np.ndarray, width: int) -> np.ndarray:
    """`v` (Y, X, 2), y up, as colour (h, width, 3) float32 display values, top row first.

    Hue is the direction, as `wheel` shows; saturation grows with the magnitude; zero is white.
    """
    fine = resampled(_checked(v), height_for(v.shape, width), width, order=3)
    strength = _strength(fine)
    angle = np.arctan2(fine[..., 1], fine[..., 0])
    return _hued(1.0 - 0.30 * strength, 0.19 * strength, angle)[::-1].copy()


def divergence(v: np.ndarray, width: int) -> np.ndarray:
    """The divergence of `v` (Y, X, 2), y up: (h, width, 3) float32 display values, top row first.

    Sources are red and sinks blue, with a saturation relative to the rms gradient of `v`; zero is white.
    """
    v = _checked(v)
    gradient = np.sqrt(sum(np.mean(np.gradient(v[..., c], axis=axis) ** 2) for c in (0, 1) for axis in (0, 1)))
    # border cells copy their neighbours: a central difference would need values outside
    found = np.pad(_divergence(v)[1:-1, 1:-1], 1, mode="edge") if min(v.shape[:2]) > 2 else np.zeros(v.shape[:2])
    share = found / max(float(gradient), 1e-12) / FULL
    fine = np.clip(resampled(share.astype(np.float32), height_for(v.shape, width), width, order=3), -1, 1)
    strength = np.abs(fine)
    return _hued(1.0 - 0.42 * strength, 0.2 * strength, np.where(fine > 0, 0.0, np.deg2rad(235.0)))[::-1].copy()


def picture(v: np.ndarray, width: int, seed: int = 1, tint: bool = False) -> np.ndarray:
    """LIC of `v` (Y, X, 2), y up: (h, width, 3) float32 display values, top row first.

    Grey as in the paper; with `tint` the lines carry the colours of `colour`.
    """
    grey = lines(v, width, seed)
    if not tint:
        return np.repeat(grey[..., None], 3, axis=2)
    fine = resampled(_checked(v), height_for(v.shape, width), width, order=3)[::-1]
    strength = _strength(fine)
    chroma = 0.15 * strength * (1.0 - np.abs(2.0 * grey - 1.0) ** 2)  # none at black and white, where it would clip
    return _hued(0.25 + 0.75 * grey, chroma, np.arctan2(fine[..., 1], fine[..., 0]))


@functools.lru_cache(maxsize=4)  # the same in every frame
def wheel(size: int) -> np.ndarray:
    """The legend of `colour`: a disc (size, size, 4) float32, display values and coverage, top row first."""
    at = (np.arange(4 * size) + 0.5) / (2 * size) - 1.0
    x, y = np.meshgrid(at, -at)
    radius = np.hypot(x, y)
    strength = np.clip(radius / 0.97, 0.0, 1.0)
    disc = _hued(1.0 - 0.30 * strength, 0.19 * strength, np.arctan2(y, x))
    return averaged(np.concatenate([disc, (radius <= 0.97)[..., None].astype(np.float32)], axis=2), 4)
