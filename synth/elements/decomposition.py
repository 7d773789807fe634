"""The coarse shape and motion C of elements, and their details D = I - C (ma13 §5, figures 6 and 7)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from synth.elements.orientation import along_threads
from synth.elements.samples import Elements

SHARE = 0.25  # of the frames, and of the samples along an element, on each side of the filter's centre


def coarse(positions: np.ndarray, grid: tuple[int, ...], frames: int, along: int) -> np.ndarray:
    """C: samples (T, E, S, D) low-passed over `frames` on each side in time and `along` samples on each side along
    the element, the same shape, float32.

    Each filter is a mean over a window that shrinks towards the ends, so that it stays symmetric and adds no bias.
    """
    shape = positions.shape
    lines = positions.astype(np.float64).reshape(*shape[:2], *(grid or (1,)), shape[3])
    result = _mean(lines, 0, frames)
    for axis in range(2, 2 + len(grid)):
        result = _mean(result, axis, along)
    return result.reshape(shape).astype(np.float32)


def _mean(values: np.ndarray, axis: int, reach: int) -> np.ndarray:
    """The mean of the values within `reach` on each side along an axis, or within what there is on both sides."""
    count = values.shape[axis]
    place = np.arange(count)
    side = np.minimum(reach, np.minimum(place, count - 1 - place))
    sums = np.concatenate([np.zeros_like(np.take(values, [0], axis)), np.cumsum(values, axis)], axis)
    total = np.take(sums, place + side + 1, axis) - np.take(sums, place - side, axis)
    return total / (2 * side + 1).reshape([-1 if n == axis else 1 for n in range(values.ndim)])


def with_coarse(elements: Elements) -> Elements:
    """Threads or sheets that were made elsewhere, with a C of their own: a filter of SHARE of their extent."""
    longest = max(elements.grid) if elements.grid else 1
    return replace(elements, coarse=coarse(elements.positions, elements.grid, round(SHARE * elements.frames),
                                           max(1, round(SHARE * longest))))


def following(threads: Elements, frames: int, along: int) -> Elements:
    """A bundle whose C is the motion common to its threads, so that details hold only what differs.

    threads   with a C whose first samples are their places in the section of the bundle, x and y
    frames, along   reach of the filter on the mean thread, as for `coarse`
    """
    if threads.coarse is None or threads.topology != "thread":
        raise ValueError("only threads side by side in a bundle have a common motion")
    middle = coarse(threads.positions.mean(axis=1, keepdims=True), threads.grid, frames, along).astype(np.float64)
    beside = threads.coarse[0, :, 0] - threads.coarse[0, :, 0].mean(axis=0)
    axes = along_threads(middle).reshape(*middle.shape[:1], *threads.grid, 3, 3)
    shared = middle + np.einsum("tsij,ej->tesi", axes, beside.astype(np.float64))
    return replace(threads, coarse=shared)
