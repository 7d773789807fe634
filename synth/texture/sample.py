"""The sample: its colour, what of it searches compare, its main direction, and its rotated copies (wang05 §2.1).

"The main direction of the sample texture is determined using the algorithm of Tamura et al." It is the direction along
which stripes run, and known modulo 180° only. A sample with heads and tails needs its direction given.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy import ndimage

LEAST = 8
"""Pixels: the least width and height of a sample."""
BINS = 36
"""Of the histogram of directions, over 180°."""
THRESHOLD = 12 / 255
"""Least magnitude of a gradient that counts, as in Tamura et al. §III-C; never more than a quarter of the largest."""
REFINEMENT = np.deg2rad(12)
"""How far round the peak of the histogram gradients count in the mean that refines it."""
SHARE_WITHIN = np.deg2rad(15)
DIRECTED = 0.4
"""Greatest share of gradient energy round the peak of a sample that has no main direction."""
SAME = 1 / 255
"""Colours that differ by no more are one colour."""


@dataclass(frozen=True, eq=False)
class Sample:
    """A sample of H by W pixels, row 0 the lowest.

    colour     (H, W, 3) float32, linear light, Rec.709
    luminance  (H, W) float32, display-encoded, 0..1: what searches and measures compare
    direction  radians, counter-clockwise from x: where the sample's stripes, or its heads, point
    share      of the energy of its gradients, what lies within 15° of `direction` modulo 180°: 1/6 where all
               directions are alike
    white      linear luminance that is 1 in `luminance`: 1, more for a sample of high dynamic range
    opaque     (H, W) bool, or None where all are: pixels that may be shown. The others hold the colour of the nearest
               opaque one
    """

    colour: np.ndarray
    luminance: np.ndarray
    direction: float
    share: float
    white: float = 1.0
    opaque: np.ndarray | None = field(default=None, repr=False)

    @property
    def shape(self) -> tuple[int, int]:
        return self.luminance.shape[0], self.luminance.shape[1]

    @property
    def has_direction(self) -> bool:
        """Whether its gradients show `direction`; where not, Tamura's value means nothing, and one should be given."""
        return self.share > DIRECTED


@dataclass(frozen=True, eq=False)
class Rotations:
    """n rotated copies of a sample, each a square of side S that holds all of it.

    colour     (n, S, S, 3) float32, linear light
    luminance  (n, S, S) float32
    valid      (n, S, S) bool: pixels wholly inside the sample and opaque
    angles     (n,) float64, radians: where the main direction of each copy points, 2πk/n
    """

    colour: np.ndarray
    luminance: np.ndarray
    valid: np.ndarray
    angles: np.ndarray


def sample(colour: np.ndarray, alpha: np.ndarray | None = None, direction: float | None = None) -> Sample:
    """The sample of a picture.

    colour     (H, W, 3), linear light, not multiplied by alpha
    alpha      (H, W) in 0..1: pixels of less than one half are not shown
    direction  radians in [0, 2π), for samples with heads and tails; None: by Tamura's measure, in [0, π)
    Raises ValueError for a picture that is not (H, W, 3), less than 8 pixels wide or high, not finite, nowhere opaque,
    of one colour, or of one brightness.
    """
    colour = np.asarray(colour)
    if colour.ndim != 3 or colour.shape[2] != 3:
        raise ValueError(f"a sample is a picture (H, W, 3), not of shape {colour.shape}")
    height, width = colour.shape[:2]
    if min(height, width) < LEAST:
        raise ValueError(f"a sample is at least {LEAST} x {LEAST} pixels, not {width} x {height}")
    opaque = None
    if alpha is not None:
        alpha = np.asarray(alpha)
        if alpha.shape != (height, width):
            raise ValueError(f"alpha is of the picture's size {(height, width)}, not {alpha.shape}")
        if not np.isfinite(alpha).all():
            raise ValueError("the sample's alpha holds NaN or infinity")
        opaque = alpha >= 0.5
        if not opaque.any():
            raise ValueError("the sample is transparent everywhere (alpha 0)" if not alpha.any() else
                             "the sample is transparent everywhere (alpha below one half)")
        nearest = ndimage.distance_transform_edt(~opaque, return_distances=False, return_indices=True)
        colour = colour[tuple(nearest)]
        opaque = None if opaque.all() else opaque
    if not np.isfinite(colour).all():
        raise ValueError("the sample holds NaN or infinity")
    if direction is not None and not 0 <= direction < 2 * np.pi:
        raise ValueError(f"a direction is in [0, 2π) radians, not {direction}")
    colour = np.ascontiguousarray(colour, np.float32)
    if np.ptp(colour, axis=(0, 1)).max() <= SAME * max(1.0, float(np.abs(colour).max())):
        raise ValueError("the sample is of one colour")
    white = max(1.0, float(np.quantile(_linear_luminance(colour), 0.999)))
    brightness = luminance(colour, white)
    if np.ptp(brightness) <= SAME:
        raise ValueError("the sample is of one brightness, and brightness is what searches compare")
    if direction is None:
        direction = main_direction(brightness, opaque)
    return Sample(colour, brightness, float(direction), share(brightness, direction, opaque), white, opaque)


def luminance(colour: np.ndarray, white: float = 1.0) -> np.ndarray:
    """Display-encoded luminance 0..1 of linear Rec.709 `colour` (..., 3): float32, by the sRGB curve; `white` is 1."""
    linear = np.clip(_linear_luminance(colour) / white, 0, 1)
    curve = 1.055 * np.maximum(linear, 0.0031308) ** (1 / 2.4) - 0.055
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, curve)
    return np.ascontiguousarray(encoded, np.float32)


def _linear_luminance(colour: np.ndarray) -> np.ndarray:
    return colour.astype(np.float64) @ np.array([0.2126, 0.7152, 0.0722])


def main_direction(luminance: np.ndarray, opaque: np.ndarray | None = None) -> float:
    """The main direction of a picture (H, W), radians in [0, π), by Tamura et al. 1978, §III-C (wang05 §2.1).

    1. Gradients ΔH, ΔV in windows of 3 by 3; magnitude (|ΔH| + |ΔV|) / 2; stripes run at right angles to them.
    2. Histogram of directions where the magnitude reaches THRESHOLD.
    3. Its peak; then twice the mean within REFINEMENT of it, weighted with energy, since a bin is 5° wide.
    One mask is not theirs: Prewitt's sees stripes of 9 pixels up to 1.3° wrong, Scharr's 0.1°.
    """
    horizontal, vertical = _gradients(luminance, opaque)
    magnitude = (np.abs(horizontal) + np.abs(vertical)) / 2
    strong = (magnitude >= min(THRESHOLD, magnitude.max() / 4)) & (magnitude > 0)
    if not strong.any():
        return 0.0
    horizontal, vertical = horizontal[strong], vertical[strong]
    angle = (np.arctan2(vertical, horizontal) + np.pi / 2) % np.pi
    counts = np.bincount((angle * (BINS / np.pi)).astype(int) % BINS, minlength=BINS)
    # the mean of three bins: a direction between two bins is no less a peak
    smooth = counts + np.roll(counts, 1) + np.roll(counts, -1)
    peak = (int(smooth.argmax()) + 0.5) * np.pi / BINS
    energy = horizontal**2 + vertical**2
    for _ in range(2):
        off = _modulo_half_turn(angle - peak)
        near = np.abs(off) <= REFINEMENT
        peak += float((energy * off)[near].sum() / max(energy[near].sum(), 1e-30))
    return peak % np.pi


def share(luminance: np.ndarray, direction: float, opaque: np.ndarray | None = None) -> float:
    """Share of the energy of gradients of a picture (H, W) whose stripes lie within 15° of `direction` modulo 180°."""
    horizontal, vertical = _gradients(luminance, opaque)
    energy = horizontal**2 + vertical**2
    off = _modulo_half_turn(np.arctan2(vertical, horizontal) + np.pi / 2 - direction)
    return float(energy[np.abs(off) <= SHARE_WITHIN].sum() / max(energy.sum(), 1e-30))


def _gradients(luminance: np.ndarray, opaque: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """Horizontal and vertical differences where all eight neighbours are inside and opaque: (M,) each.

    Over two pixels, and summed over three rows or columns as in Tamura's masks, but with Scharr's weights.
    """
    picture = luminance.astype(np.float64)
    whole = np.ones(picture.shape, bool) if opaque is None else opaque
    counts = ndimage.binary_erosion(whole, np.ones((3, 3)))
    step, across = (-1.0, 0.0, 1.0), np.array([3.0, 10.0, 3.0]) * 3 / 16
    horizontal, vertical = (ndimage.correlate1d(ndimage.correlate1d(picture, step, along), across, 1 - along)
                            for along in (1, 0))
    return horizontal[counts], vertical[counts]


def _modulo_half_turn(angle: np.ndarray) -> np.ndarray:
    """The same directions of stripes in [-π/2, π/2)."""
    return (angle + np.pi / 2) % np.pi - np.pi / 2


def rotated(sample: Sample, n: int) -> Rotations:
    """"We compute and store n (n = 24 or 48) rotated copies of the sample texture" (wang05 §2.1).

    In copy k the main direction points to 2πk/n; its middle is the sample's middle. Bicubic.
    Raises ValueError for n < 1.
    """
    if n < 1:
        raise ValueError(f"a sample has at least one rotated copy, not {n}")
    height, width = sample.shape
    # of the width's parity: quarter turns of a square sample then are exact
    side = int(np.ceil(np.hypot(height, width)))
    side += (side - width) % 2
    angles = 2 * np.pi * np.arange(n) / n
    colour = np.empty((n, side, side, 3), np.float32)
    brightness = np.empty((n, side, side), np.float32)
    valid = np.empty((n, side, side), bool)
    channels = [*np.moveaxis(sample.colour, -1, 0), sample.luminance]
    splines = [ndimage.spline_filter(c.astype(np.float64), mode="mirror") for c in channels]
    opaque = np.ones(sample.shape, bool) if sample.opaque is None else sample.opaque
    for k in range(n):
        places = turned_places(sample.shape, angles[k] - sample.direction, side)
        copies = [read(spline, places, c) for spline, c in zip(splines, channels, strict=True)]
        colour[k], brightness[k] = np.stack(copies[:3], axis=-1), copies[3]
        # none of the four pixels round the place is missing
        valid[k] = ndimage.map_coordinates(opaque.astype(np.float32), places, order=1, cval=-1.0) > 1 - 1e-4
    return Rotations(colour, brightness, valid, angles)


def turned(picture: np.ndarray, angle: float, side: int) -> np.ndarray:
    """A square of the picture (H, W), turned counter-clockwise by `angle` round its middle: (side, side) float32.

    Bicubic. It holds mirrored pixels where it reaches beyond the picture.
    """
    spline = ndimage.spline_filter(picture.astype(np.float64), mode="mirror")
    return read(spline, turned_places(picture.shape, angle, side), picture)


def turned_places(shape: tuple[int, ...], angle: float, side: int) -> np.ndarray:
    """Where a turned square reads a picture of `shape` (H, W): (2, side, side) float64, y first, in pixels."""
    v, u = np.mgrid[:side, :side] - (side - 1) / 2
    # exact at quarter turns
    cos, sin = (np.round(f, 15) for f in (np.cos(angle), np.sin(angle)))
    places = np.stack([cos * v - sin * u + (shape[0] - 1) / 2, cos * u + sin * v + (shape[1] - 1) / 2])
    near = np.rint(places * 2) / 2
    return np.where(np.abs(places - near) < 1e-9, near, places)


def read(spline: np.ndarray, places: np.ndarray, picture: np.ndarray) -> np.ndarray:
    """The picture at places (2, ...), y first: float32, bicubic, within the picture's own range; mirrored outside.

    spline  the picture's coefficients, by `ndimage.spline_filter(picture, mode="mirror")`
    """
    values = ndimage.map_coordinates(spline, places, order=3, prefilter=False, mode="mirror")
    return np.clip(values, picture.min(), picture.max()).astype(np.float32)
