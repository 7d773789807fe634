"""How near a frame is to its sample, and how well it moves with the flow.

    of one frame     contrast, gradient, laplacian, histogram, distances, direction: together `of_frame`
    of two frames    residual, correlation: together `of_pair`
    of a sequence    drift

All on luminance, 0..1, display-encoded. A frame is (Y, X) float32, larger than 2 · MARGIN; a Reference holds what of
the sample they compare with: make one for all frames. Numbers near one of two frames alone say little: while a picture
fades to the dullest part of its sample, its forward distance falls. The histogram shows it first.

What they do not do: leave out parts of a frame (land, obstacles).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import ndimage

from synth.texture import flow
from synth.texture.sample import Sample, read, turned

TURNS = np.deg2rad((0, 13, 29, 45, 61))
"""Turns of the sample over which the reference is a mean: a turned picture is a little softer."""
MARGIN = 12
"""Pixels: places nearer to the frame's border are not measured."""
RADIUS = 4
"""Of the patches that are compared: 9 by 9 pixels."""
PLACES = 8192
"""Patches of the frame."""
BACKWARD = 4096
"""Patches of the sample that look for their nearest in the frame."""
MOST_PATCHES = 1 << 16
"""Of a sample: of a larger one the patches are taken on a lattice, every second, third, ... pixel."""
TOGETHER = 512
"""Patches of the frame in one matrix product."""
BLOCK = 16
RANKS = 1 << 14
TENSOR = (1.0, 6.0)
"""σ of the Gaussian gradient and of the mean of its structure tensor, in pixels."""
DRIFTING = ("std", "grad", "hist", "bwd", "used")


@dataclass(frozen=True, eq=False)
class Reference:
    """What of a sample the measures compare with; each part is computed when it is first asked for."""

    sample: Sample

    @cached_property
    def s(self) -> float:
        """Standard deviation of the luminance of opaque pixels."""
        return float(self._values.std())

    @cached_property
    def _values(self) -> np.ndarray:
        luminance, opaque = self.sample.luminance, self.sample.opaque
        return (luminance if opaque is None else luminance[opaque]).ravel().astype(np.float64)

    @cached_property
    def quantiles(self) -> np.ndarray:
        return _quantiles(self._values)

    @cached_property
    def _turned(self) -> list[np.ndarray]:
        """The largest square that stays inside the sample at every turn, turned: 88² of a sample of 128²."""
        side = max(int(min(self.sample.shape) / np.sqrt(2)) - 2, 3)
        return [turned(self.sample.luminance, angle, side) for angle in TURNS]

    @cached_property
    def contrast(self) -> float:
        return float(np.mean([picture.astype(np.float64).std() for picture in self._turned]))

    @cached_property
    def gradient(self) -> float:
        return float(np.mean([_gradient(picture) for picture in self._turned]))

    @cached_property
    def laplacian(self) -> float:
        return float(np.mean([_laplacian(picture) for picture in self._turned]))

    @cached_property
    def patches(self) -> np.ndarray:
        """All 9 by 9 patches of the sample that lie inside it and are opaque: (E, 81) float32.

        Raises ValueError where there is none.
        """
        width = 2 * RADIUS + 1
        if min(self.sample.shape) < width:
            raise ValueError(f"a sample of {self.sample.shape} pixels holds no patch of {width} x {width}")
        step = 1
        while np.prod([-(-(n - width + 1) // step) for n in self.sample.shape]) > MOST_PATCHES:
            step += 1

        def windows(picture: np.ndarray) -> np.ndarray:
            view = np.lib.stride_tricks.sliding_window_view(picture, (width, width))
            return view[::step, ::step].reshape(-1, width * width)

        patches = np.ascontiguousarray(windows(self.sample.luminance))
        if self.sample.opaque is not None:
            patches = patches[windows(self.sample.opaque).all(axis=1)]
        if not len(patches):
            raise ValueError("no patch of the sample is opaque")
        return patches


def contrast(frame: np.ndarray, reference: Reference) -> float:
    """std: standard deviation over the sample's; 1 is right, less is faded."""
    return float(frame.astype(np.float64).std()) / reference.contrast


def gradient(frame: np.ndarray, reference: Reference) -> float:
    """grad: mean squared central difference over the sample's; less than 1 is blurred."""
    return _gradient(frame) / reference.gradient


def laplacian(frame: np.ndarray, reference: Reference) -> float:
    """lap: mean squared Laplacian of four neighbours over the sample's; more sensitive to blur than `gradient`."""
    return _laplacian(frame) / reference.laplacian


def histogram(frame: np.ndarray, reference: Reference) -> float:
    """hist: mean difference of values of equal rank, over s (the Wasserstein-1 distance of the histograms)."""
    return float(np.abs(_quantiles(frame.astype(np.float64)) - reference.quantiles).mean()) / reference.s


def distances(frame: np.ndarray, theta: np.ndarray, reference: Reference, seed: int = 1) -> tuple[float, float, float]:
    """fwd, bwd, used: how like the sample the frame is, how much of the sample it shows, and what share of it.

    theta  (Y, X), direction of the flow, radians
    1. PLACES random places at least MARGIN pixels inside; at each a patch of 9 by 9 pixels, read at the angle that
       turns the sample's main direction to θ there, bicubic.
    2. fwd: mean distance to the nearest of all the sample's patches, rms over the patch over s.
    3. bwd: mean distance of BACKWARD patches of the sample to the nearest of the frame's.
    4. used: distinct nearest patches over all the sample's. It grows with PLACES: compare equal numbers only.

    Exhaustive: about 1 s on 2 cores for a sample of 128². Raises ValueError for a frame too small to hold a place.
    """
    ours, theirs = _oriented_patches(frame, theta, reference.sample.direction, seed), reference.patches
    random = np.random.Generator(np.random.Philox(key=seed + 1))
    looking = np.sort(random.choice(len(theirs), min(BACKWARD, len(theirs)), replace=False))
    # |a - b|² = |a|² + |b|² - 2 a·b; without the mean less is lost to rounding
    mean = theirs.mean(axis=0)
    a, b = ours - mean, theirs - mean
    half_a, half_b = 0.5 * (a * a).sum(1), 0.5 * (b * b).sum(1)
    nearest = np.empty(len(a), np.intp)
    back, least = np.zeros(len(looking), np.intp), np.full(len(looking), np.inf, np.float32)
    for start in range(0, len(a), TOGETHER):
        stop = min(start + TOGETHER, len(a))
        # half the squared distance, but for |a|²
        half = half_b - a[start:stop] @ b.T
        nearest[start:stop] = half.argmin(axis=1)
        half = half[:, looking] + half_a[start:stop, None]
        row = half.argmin(axis=0)
        value = half[row, np.arange(len(looking))]
        back = np.where(value < least, start + row, back)
        least = np.minimum(least, value)

    def mean_distance(one: np.ndarray, other: np.ndarray) -> float:
        return float(np.sqrt(((one - other).astype(np.float64) ** 2).mean(1)).mean()) / reference.s

    used = len(np.unique(nearest)) / len(theirs)
    return mean_distance(ours, theirs[nearest]), mean_distance(theirs[looking], ours[back]), used


def direction(frame: np.ndarray, theta: np.ndarray) -> tuple[float, float]:
    """dir: median and 90 % of the angle between stripes and flow, modulo 180°, in radians.

    Stripes by the structure tensor, weighted by its coherence. It means something only for a sample that
    `has_direction`. theta (Y, X), direction of the flow. NaN for a frame without any gradient.
    """
    fine, coarse = TENSOR
    gy, gx = (ndimage.gaussian_filter(frame.astype(np.float64), fine, order=order) for order in ((1, 0), (0, 1)))
    xx, xy, yy = (ndimage.gaussian_filter(product, coarse) for product in (gx * gx, gx * gy, gy * gy))
    along = 0.5 * np.arctan2(2 * xy, xx - yy) + np.pi / 2
    anisotropy, trace = np.hypot(xx - yy, 2 * xy), xx + yy
    coherence = np.where(trace > 1e-12, anisotropy / np.maximum(trace, 1e-12), 0)
    inside = _inside(frame)
    error = np.abs((along - theta + np.pi / 2) % np.pi - np.pi / 2)[inside].ravel()
    weight = coherence[inside].ravel()
    if weight.sum() == 0:
        return float("nan"), float("nan")
    order = np.argsort(error, kind="stable")
    sums = np.cumsum(weight[order])
    median, most = (error[order[np.searchsorted(sums, share * sums[-1])]] for share in (0.5, 0.9))
    return float(median), float(most)


def departures(shape: tuple[int, ...], velocities: Sequence[np.ndarray]) -> np.ndarray:
    """Where each pixel of the last frame was in the first: (Y, X, 2) float64, x and y, by the midpoint rule.

    velocities  one flow (Y, X, 2) for each step from a frame to the next, in order of time
    """
    y, x = np.mgrid[:shape[0], :shape[1]]
    points = np.stack([x.ravel(), y.ravel()], axis=-1).astype(np.float64)
    for v in reversed(velocities):
        points = flow.midpoint(-v, points)
    return points.reshape(*shape[:2], 2)


def carried(earlier: np.ndarray, velocities: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """A frame (Y, X) moved along the flow: (Y, X) float32, bicubic; and where its source lies inside, (Y, X) bool."""
    source = departures(earlier.shape, velocities)
    x, y = source[..., 0], source[..., 1]
    spline = ndimage.spline_filter(earlier.astype(np.float64), mode="mirror")
    inside = (x >= 0) & (x <= earlier.shape[1] - 1) & (y >= 0) & (y <= earlier.shape[0] - 1)
    return read(spline, np.stack([y, x]), earlier), inside


def residual(earlier: np.ndarray, later: np.ndarray, v: np.ndarray, reference: Reference) -> np.ndarray:
    """What of the next frame is not the frame before moved along v: rms in blocks of 16 by 16 pixels over s, (B,).

    Blocks whose source lies inside; none where the flow is that fast. A picture that moves perfectly has some, since
    to read between pixels blurs: state beside it what an ideal motion gives.
    """
    moved, inside = carried(earlier, [v])
    rows, columns = (n // BLOCK for n in later.shape)

    def blocks(picture: np.ndarray) -> np.ndarray:
        cut = picture[:rows * BLOCK, :columns * BLOCK].reshape(rows, BLOCK, columns, BLOCK)
        return cut.transpose(0, 2, 1, 3).reshape(rows * columns, -1)

    squared = blocks((later.astype(np.float64) - moved) ** 2)
    return np.sqrt(squared.mean(axis=1))[blocks(inside).all(axis=1)] / reference.s


def correlation(earlier: np.ndarray, later: np.ndarray, velocities: Sequence[np.ndarray]) -> float:
    """corr10 over ten steps: correlation of a frame with an earlier one moved along the flow of each step between.

    Over pixels whose source lies inside. Boiling in one number: 1 is none. NaN where no pixel or no contrast is left.
    """
    moved, inside = carried(earlier, velocities)
    a, b = (picture[inside].astype(np.float64) for picture in (moved, later))
    if not a.size or a.std() == 0 or b.std() == 0:
        return float("nan")
    return float(((a - a.mean()) * (b - b.mean())).mean() / (a.std() * b.std()))


def drift(first: Mapping[str, float], last: Mapping[str, float]) -> dict[str, float]:
    """|last - first| of those numbers of `of_frame` that a sequence should keep."""
    return {name: abs(last[name] - first[name]) for name in DRIFTING}


def of_frame(frame: np.ndarray, theta: np.ndarray, reference: Reference) -> dict[str, float]:
    """std, grad, lap, hist, fwd, bwd, used; and for a sample with a main direction dir_50, dir_90 (radians).

    theta  (Y, X), direction of the flow, radians
    """
    fwd, bwd, used = distances(frame, theta, reference)
    numbers = {"std": contrast(frame, reference), "grad": gradient(frame, reference),
               "lap": laplacian(frame, reference), "hist": histogram(frame, reference),
               "fwd": fwd, "bwd": bwd, "used": used}
    if reference.sample.has_direction:
        numbers["dir_50"], numbers["dir_90"] = direction(frame, theta)
    return numbers


def of_pair(earlier: np.ndarray, later: np.ndarray, v: np.ndarray, reference: Reference) -> dict[str, float]:
    """residual_50, residual_95, worst: median, 95 % and largest of the blocks of `residual`; NaN without any block.

    Of a sequence take the median over its frames, of `worst` the largest.
    """
    blocks = residual(earlier, later, v, reference)
    if not len(blocks):
        return dict.fromkeys(("residual_50", "residual_95", "worst"), float("nan"))
    median, most = np.quantile(blocks, (0.5, 0.95))
    return {"residual_50": float(median), "residual_95": float(most), "worst": float(blocks.max())}


def _quantiles(values: np.ndarray) -> np.ndarray:
    """Values at RANKS evenly spaced ranks: (RANKS,)."""
    return np.quantile(values, (np.arange(RANKS) + 0.5) / RANKS, method="hazen")


def _gradient(picture: np.ndarray) -> float:
    p = picture.astype(np.float64)
    return float((((p[1:-1, 2:] - p[1:-1, :-2]) / 2) ** 2 + ((p[2:, 1:-1] - p[:-2, 1:-1]) / 2) ** 2).mean())


def _laplacian(picture: np.ndarray) -> float:
    p = picture.astype(np.float64)
    return float(((p[1:-1, 2:] + p[1:-1, :-2] + p[2:, 1:-1] + p[:-2, 1:-1] - 4 * p[1:-1, 1:-1]) ** 2).mean())


def _inside(frame: np.ndarray) -> tuple[slice, slice]:
    if min(frame.shape) <= 2 * MARGIN:
        raise ValueError(f"a frame of {frame.shape[1]} x {frame.shape[0]} pixels is too small to be measured: "
                         f"it needs more than {2 * MARGIN} each way")
    return slice(MARGIN, -MARGIN), slice(MARGIN, -MARGIN)


def _oriented_patches(frame: np.ndarray, theta: np.ndarray, main: float, seed: int) -> np.ndarray:
    """Patches at PLACES random places, turned back so that the flow runs along `main`: (PLACES, 81) float32."""
    rows, columns = (np.arange(n)[part] for n, part in zip(frame.shape, _inside(frame), strict=True))
    random = np.random.Generator(np.random.Philox(key=seed))
    y, x = random.choice(rows, PLACES), random.choice(columns, PLACES)
    j, i = (offset.ravel() for offset in np.mgrid[-RADIUS:RADIUS + 1, -RADIUS:RADIUS + 1])
    turn = (theta[y, x].astype(np.float64) - main)[:, None]
    places = np.stack([y[:, None] + np.sin(turn) * i + np.cos(turn) * j,
                       x[:, None] + np.cos(turn) * i - np.sin(turn) * j])
    spline = ndimage.spline_filter(frame.astype(np.float64), mode="mirror")
    return read(spline, places, frame)
