"""Integration of the assigned pieces (okabe11 §6, fig. 9): their differences from their averages, blended band by
band, and the motion field of the animation.

"Our strategy for seamless integration is to decompose a video example piece into its average image and differences. …
We apply an image pyramid [BA83] and perform alpha blending for each sub-band."

Weights of a pixel have squares that add up to one, not sums as in the paper: differences of two clips have nothing in
common, and a mean of two of them has 0.7 of their deviation. Fine bands change hands over a short way, coarse ones over
a long one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from synth.photo.assign import Nodes, Shown
from synth.photo.motion import optical_flow
from synth.photo.pieces import FITS, VERSIONS, Cut, pixels, scaled

BANDS = 3
"""Of the differences: below 1, 2 and 4 pixels of σ, the last with all that is coarser."""
FEATHER = (0.25, 0.5, 1.0)
"""Of each band, over the overlap of two pieces: the way on which its weight falls to zero."""

SMOOTHER = 8
"""Of a piece's edge the part that is the σ by which its changing motion is smoothed."""
Blending = Literal["roots", "shares"]
Frames = Callable[[int], np.ndarray]
"""Of each clip of the database its frames (T, Y, X) uint8."""


@dataclass(frozen=True, eq=False)
class Differences:
    """bands (BANDS, T, Y, X) float32: what the pieces add to an average, grey levels; together over all time 0."""

    bands: np.ndarray


def differences(of: Nodes, shown: Shown, frames: Frames, shape: tuple[int, int], cut: Cut, length: int, seed: int,
                blending: Blending = "roots") -> Differences:
    """The differences of the assigned pieces on a target of `shape` (Y, X), `length` frames that loop.

    1. Of each node: its piece's frames less their average. A clip that is shorter repeats, one that is longer is cut
       and its end mixed into its beginning. Pieces begin at phases at random, but a piece that continues a neighbour's
       does so in time too.
    2. Its bands, each with the weight that belongs to it.
    """
    total = np.zeros((BANDS, length, *shape), np.float32)
    share = weights(of, shape, cut, blending)
    start = phases(of, shown, seed)
    for p, piece in read(shown, frames, cut):
        # 1. differences
        moves = looped(piece - piece.mean(axis=0), length, int(start[p]))
        # 2. bands
        inside, part = _visible(int(of.corner[p, 0]), int(of.corner[p, 1]), shape, cut)
        for band, values in enumerate(bands(moves)):
            total[(band, slice(None), *inside)] += share[p][band][part] * values[(slice(None), *part)]
    return Differences(total)


def motion_changes(of: Nodes, shown: Shown, frames: Frames, shape: tuple[int, int], cut: Cut, length: int,
                   seed: int) -> np.ndarray:
    """What the motion of each frame differs from its mean, M_i - M: (length, Y, X, 2) float32, a loop.

    In pixels per frame. The optical flow of the assigned pieces, at the phases of their differences, blended as their
    coarsest band is.
    """
    import cv2

    total = np.zeros((length, *shape, 2), np.float32)
    share = weights(of, shape, cut)[:, -1, ..., None]
    start = phases(of, shown, seed)
    for p, piece in read(shown, frames, cut):
        flow = optical_flow(piece.astype(np.uint8))
        smooth = [cv2.GaussianBlur(frame, (0, 0), cut.size / SMOOTHER) for frame in flow - flow.mean(axis=0)]
        inside, part = _visible(int(of.corner[p, 0]), int(of.corner[p, 1]), shape, cut)
        total[(slice(None), *inside)] += share[p][part] * looped(np.stack(smooth), length, int(start[p]))[
            (slice(None), *part)]
    return total


def read(shown: Shown, frames: Frames, cut: Cut) -> Iterator[tuple[int, np.ndarray]]:
    """The nodes and the frames (T, size, size) float32 of their pieces."""
    for p, small, shape in by_clip(shown, frames):
        corner = (int(shown.corner[p, 0]), int(shown.corner[p, 1]))
        found = pixels(small, shape, corner, cut, VERSIONS[int(shown.version[p])], FITS[int(shown.fit[p])])
        yield p, found.astype(np.float32)


def by_clip(shown: Shown, frames: Frames) -> Iterator[tuple[int, np.ndarray, tuple[int, int]]]:
    """The nodes, so that each clip is scaled once: their clip at the scale of their version, and its whole shape."""
    scales = np.array([version.scale for version in VERSIONS])[shown.version]
    last, small = (-1, 0.0), np.empty(0)
    for p in np.lexsort((scales, shown.clip)).tolist():
        clip = frames(int(shown.clip[p]))
        if last != (last := (int(shown.clip[p]), float(scales[p]))):
            small = scaled(clip, float(scales[p]))
        yield p, small, (clip.shape[1], clip.shape[2])


def bands(values: np.ndarray) -> list[np.ndarray]:
    """`values` (T, Y, X) float32 as BANDS that add up to it, from fine to coarse."""
    import cv2

    stacked = np.ascontiguousarray(np.moveaxis(values, 0, -1))
    found, before = [], stacked
    for band in range(BANDS - 1):
        sigma = 1.0 if band == 0 else np.sqrt(3.0) * 2 ** (band - 1)
        after = np.concatenate([cv2.GaussianBlur(before[..., k:k + 4], (0, 0), sigma, borderType=cv2.BORDER_REFLECT)
                                .reshape(*before.shape[:2], -1) for k in range(0, before.shape[2], 4)], axis=2)
        found.append(before - after)
        before = after
    return [np.moveaxis(band, -1, 0) for band in (*found, before)]


def looped(values: np.ndarray, length: int, start: int) -> np.ndarray:
    """`length` frames of a loop (T, …) from frame `start` on.

    A shorter loop repeats as often as is nearest to a whole number of times, a little faster or slower: its frames are
    mixed by the root of their shares. A longer one is cut, and what follows the cut is mixed into its beginning.
    """
    count = len(values)
    if length % count == 0:
        return values[(start + np.arange(length)) % count]
    if length > count:
        times = max(1, round(length / count))
        at = start + np.arange(length) * (times * count / length)
        low, part = np.floor(at).astype(int), (at - np.floor(at)).astype(np.float32)
        shape = (-1,) + (1,) * (values.ndim - 1)
        return _mixed(values[low % count], values[(low + 1) % count], part.reshape(shape))
    over = min(max(1, length // 4), count - length)
    whole = values[(start + np.arange(length + over)) % count]
    part = ((np.arange(over) + 0.5) / over).astype(np.float32).reshape((-1,) + (1,) * (values.ndim - 1))
    return np.concatenate([_mixed(whole[length:], whole[:over], part), whole[over:length]])


def _mixed(before: np.ndarray, after: np.ndarray, part: np.ndarray) -> np.ndarray:
    """From `before` to `after` as `part` goes from 0 to 1; the squares of the weights add up to one."""
    return np.cos(part * (np.pi / 2)) * before + np.sin(part * (np.pi / 2)) * after


def phases(of: Nodes, shown: Shown, seed: int) -> np.ndarray:
    """The frame at which each node's piece begins: (P,) int64. Nodes that show one clip as it is begin together."""
    random = np.random.Generator(np.random.Philox(key=[seed, 0]))
    group = np.arange(len(of.corner))
    for p, q in of.edges.tolist():
        moved = shown.corner[q] - shown.corner[p]
        if (shown.clip[p] == shown.clip[q] and shown.version[p] == shown.version[q]
                and (moved == of.corner[q] - of.corner[p]).all()):
            group[group == group[q]] = group[p]
    start = random.integers(0, 1 << 16, len(group))
    return np.asarray(start[group], np.int64)


def weights(of: Nodes, shape: tuple[int, int], cut: Cut, blending: Blending = "roots") -> np.ndarray:
    """The weight of each node in each band: (P, BANDS, size, size) float32. By `blending`, "roots": their squares add
    up to 1 at each pixel; "shares": they do, as in the paper.

    A product of two ramps, which are 0 at a piece's border and 1 half of FEATHER's way past the middle of an overlap.
    """
    power = 2 if blending == "roots" else 1
    ramps = np.stack([_ramp(cut, feather) for feather in FEATHER])
    window = ramps[:, :, None] * ramps[:, None, :]
    total = np.zeros((BANDS, *shape))
    for y, x in of.corner.tolist():
        inside, part = _visible(y, x, shape, cut)
        total[(slice(None), *inside)] += window[(slice(None), *part)] ** power
    found = np.zeros((len(of.corner), *window.shape), np.float32)
    for p, (y, x) in enumerate(of.corner.tolist()):
        inside, part = _visible(y, x, shape, cut)
        found[(p, slice(None), *part)] = window[(slice(None), *part)] / np.maximum(
            total[(slice(None), *inside)], 1e-12) ** (1 / power)
    return found


def _ramp(cut: Cut, feather: float) -> np.ndarray:
    """Rises round the middle of the overlap with the piece before, and falls in the one after: (size,) float64."""
    at = (np.arange(cut.size) + 0.5) / cut.stride
    rise = np.clip((np.minimum(at, cut.size / cut.stride - at) - 0.5) / feather + 0.5, 1e-3, 1)
    return np.sin(rise * (np.pi / 2))


def _visible(y: int, x: int, shape: tuple[int, int], cut: Cut) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Of a piece at row y, column x: where it lies on a target of `shape`, and which part of it that is."""
    whole = tuple(slice(max(at, 0), max(min(at + cut.size, n), 0)) for at, n in zip((y, x), shape, strict=True))
    part = tuple(slice(s.start - at, max(s.stop - at, s.start - at)) for s, at in zip(whole, (y, x), strict=True))
    return (whole[0], whole[1]), (part[0], part[1])


def motion_field(of: Nodes, shown: Shown, shape: tuple[int, int], cut: Cut) -> np.ndarray:
    """The mean motion of the assigned pieces: (Y, X, 2) float32, pixels per frame; zero where there are none.

    "We compute a motion field over the target image, based on the motion fields of assigned video pieces."
    """
    import cv2

    total, share = np.zeros((*shape, 2)), np.zeros(shape)
    window = np.multiply.outer(_ramp(cut, 1.0), _ramp(cut, 1.0))
    for p, (y, x) in enumerate(of.corner.tolist()):
        inside, part = _visible(y, x, shape, cut)
        fine = cv2.resize(shown.motion[p], (cut.size, cut.size), interpolation=cv2.INTER_LINEAR)
        total[inside] += (window[..., None] * fine)[part]
        share[inside] += window[part]
    return (total / np.maximum(share, 1e-12)[..., None]).astype(np.float32)
