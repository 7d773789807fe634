"""Measures of a picture that flows (okabe11): what of its look is kept, how it moves, whether pieces show, its loop.

Frames are (T, Y, X) and the target (Y, X), float, display-encoded grey in 0..1, row 0 the lowest; the matte is (Y, X)
in 0..1. Blurs read the fluid alone, and means are weighted by the matte: the shore counts nowhere. A measure of nothing
(an empty matte, a target without detail, frames that do not move) is nan, which meets no target.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import ndimage

from synth.photo.checks import seen
from synth.photo.clip import Clip

BLUR = 8.0
"""σ, pixels, of the blur below which the mean of the frames is compared with the target."""
SIGMAS = (1.0, 2.0, 4.0)
"""σ, pixels, of the bands: what a blur of the first removes, and what each of the others removes of the one before."""
AROUND = 4.0
"""σ, pixels, within which a place is looked at for detail."""
VISIBLE = 2.0
"""Grey levels of 255: where the target's detail is less, no motion can be seen."""
STILL = 0.05
"""Pixels per frame: what is slower has no direction."""
NEAR = 1 / 8
"""Of the way from a piece to the next: what is nearer to a centre, or to the middle between two, counts as there."""


def levels(frames: np.ndarray) -> np.ndarray:
    """Frames as grey levels, uint8."""
    return np.rint(255 * np.clip(frames, 0, 1)).astype(np.uint8)


def low_pass(frames: np.ndarray, target: np.ndarray, matte: np.ndarray) -> float:
    """The mean difference of the mean frame and the target, both blurred by BLUR, in grey levels of 255."""
    away = _blurred(frames.mean(axis=0, dtype=np.float64) - target, matte, BLUR)
    return 255 * _mean(np.abs(away), matte)


def contrast(frames: np.ndarray, target: np.ndarray, matte: np.ndarray) -> tuple[float, ...]:
    """The deviation of each band (SIGMAS) of the frames, over the target's: root means of squares, of all frames."""
    ours = np.mean([_powers(frame, matte) for frame in frames], axis=0)
    theirs = _powers(target, matte)
    return tuple(np.sqrt(np.where(theirs > 0, ours, np.nan) / np.where(theirs > 0, theirs, 1)).tolist())


def mean_flow(frames: np.ndarray) -> np.ndarray:
    """The optical flow of frames, averaged over time: (Y, X, 2) float32, pixels per frame (§4, fig. 5).

    That by which the clips of the database are checked: the faster one that the method itself uses is a few degrees
    further from the true velocity of clips.
    """
    nothing = np.zeros(frames.shape[1:], np.float32)
    return seen(Clip(levels(frames), np.stack([nothing, nothing], axis=-1), nothing), len(frames) - 1)


def visible(target: np.ndarray, matte: np.ndarray) -> np.ndarray:
    """Where the target has so much detail that its motion can be seen: (Y, X) bool. It does not depend on frames, so
    that a place which is left still is not left out."""
    detail = target - _blurred(target, matte, AROUND)
    return np.sqrt(_blurred(detail * detail, matte, AROUND)) * 255 >= VISIBLE


def angle(flow: np.ndarray, wanted: np.ndarray, where: np.ndarray) -> float:
    """The mean angle between a flow and the wanted directions, both (Y, X, 2), in degrees, 0 to 180.

    where  (Y, X): weights of the places. A place that does not move (STILL) is 90 degrees off; one where nothing is
           wanted has no weight
    """
    away = np.degrees(np.abs(np.arctan2(flow[..., 0] * wanted[..., 1] - flow[..., 1] * wanted[..., 0],
                                        (flow * wanted).sum(axis=-1))))
    away = np.where(np.hypot(flow[..., 0], flow[..., 1]) < STILL, 90, away)
    return _mean(away, np.where((wanted != 0).any(axis=-1), where, 0))


class Lattice(NamedTuple):
    """How much the pieces show; 1: not at all.

    deviation  over time, between the centres of pieces over at the centres
    gradient   across the lines where pieces begin and end, over all other places
    """

    deviation: float
    gradient: float


def lattice(frames: np.ndarray, matte: np.ndarray, stride: int) -> Lattice:
    """How much the lattice of pieces shows, whose corners are at multiples of `stride` pixels, and which are two
    strides wide: their centres are where others begin and end.

    Each value is over the mean of its surroundings, two strides wide, so that the picture's own strong and weak places
    do not count.
    """
    deviation = _even(frames.std(axis=0, dtype=np.float64), matte, stride)
    rows, columns = (_from_centres(n, stride) for n in matte.shape)
    centre = np.logical_and.outer(rows <= NEAR, columns <= NEAR)
    between = np.logical_or.outer(rows >= 0.5 - NEAR, columns >= 0.5 - NEAR)
    steps, weights, lines = [], [], []
    for turned, of in ((frames, matte), (frames.transpose(0, 2, 1), matte.T)):
        across = np.abs(np.diff(turned, axis=2)).mean(axis=0, dtype=np.float64)
        both = np.minimum(of[:, 1:], of[:, :-1])
        steps.append(_even(across, both, stride).ravel())
        weights.append(both.ravel())
        lines.append(np.broadcast_to(np.arange(1, of.shape[1]) % stride == 0, both.shape).ravel())
    step, weight, line = (np.concatenate(parts) for parts in (steps, weights, lines))
    return Lattice(_mean(deviation, matte * between) / _mean(deviation, matte * centre),
                   _mean(step, weight * line) / _mean(step, weight * ~line))


def edges(frames: np.ndarray, target: np.ndarray, frozen: np.ndarray) -> float:
    """The correlation of the gradients of the mean frame and of the target where the picture should stand still: -1..1.

    frozen  (Y, X) bool: the freeze mask. Gradients are differences of neighbours that both lie in it
    """
    ours, theirs = [], []
    for axis in (0, 1):
        inside = np.take(frozen, range(1, frozen.shape[axis]), axis) & np.take(frozen, range(frozen.shape[axis] - 1),
                                                                               axis)
        ours.append(np.diff(frames.mean(axis=0, dtype=np.float64), axis=axis)[inside])
        theirs.append(np.diff(target.astype(np.float64), axis=axis)[inside])
    mine, its = np.concatenate(ours), np.concatenate(theirs)
    power = float((mine * mine).sum() * (its * its).sum())
    return float((mine * its).sum() / np.sqrt(power)) if power > 0 else float("nan")


def loop(frames: np.ndarray, matte: np.ndarray) -> float:
    """The difference of the last frame and the first, over the median of those of successive frames: root means of
    squares over the fluid."""
    steps = [np.sqrt(_mean((after.astype(np.float64) - before) ** 2, matte))
             for before, after in zip(frames, np.roll(frames, -1, axis=0), strict=True)]
    usual = float(np.median(steps[:-1]))
    return float(steps[-1]) / usual if usual > 0 else float("nan")


def spectrum(frames: np.ndarray, matte: np.ndarray) -> np.ndarray:
    """The temporal power of the grey level at 1, 2 … T / 2 cycles in T frames, mean over the fluid: (T // 2,), in
    squares of grey levels of 255. The power that eight bits' rounding has is added: no frequency has none."""
    count = len(frames)
    power = np.abs(np.fft.rfft(255 * frames.astype(np.float64), axis=0)[1:] / count) ** 2
    return np.array([_mean(of, matte) for of in power]) + 1 / (12 * count)


def spectrum_distance(ours: np.ndarray, theirs: np.ndarray) -> float:
    """The mean distance of the decimal logarithms of two spectra (`spectrum`): 0.3 is a factor of two."""
    return float(np.abs(np.log10(ours / theirs)).mean())


def _mean(values: np.ndarray, weight: np.ndarray) -> float:
    total = float(weight.sum(dtype=np.float64))
    return float((values * weight).sum(dtype=np.float64) / total) if total > 0 else float("nan")


def _blurred(values: np.ndarray, matte: np.ndarray, sigma: float) -> np.ndarray:
    """values (Y, X) blurred, each place by the fluid round it alone."""
    share = ndimage.gaussian_filter(matte.astype(np.float64), sigma, mode="constant")
    sums = ndimage.gaussian_filter(values.astype(np.float64) * matte, sigma, mode="constant")
    return np.asarray(sums / np.maximum(share, 1e-9))


def _powers(picture: np.ndarray, matte: np.ndarray) -> np.ndarray:
    """The mean square of each band of the fluid: (len(SIGMAS),)."""
    before, found = picture.astype(np.float64), []
    for sigma in SIGMAS:
        after = _blurred(picture, matte, sigma)
        found.append(_mean((before - after) ** 2, matte))
        before = after
    return np.array(found)


def _from_centres(count: int, stride: int) -> np.ndarray:
    """How far each of `count` pixels is from the nearest centre of a piece, in strides: (count,), 0 to 0.5."""
    at = ((np.arange(count) + 0.5) / stride) % 1
    return np.minimum(at, 1 - at)


def _even(values: np.ndarray, matte: np.ndarray, stride: int) -> np.ndarray:
    """values (Y, X) over their mean within two strides."""
    return values / np.maximum(_blurred(values, matte, 2.0 * stride), 1e-12)
