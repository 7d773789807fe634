"""The motion in a clip, between each frame and the next: dense inverse search [Kroeger et al. 2016], as OpenCV has it.

What it does not do: it sees what differs in brightness. Where a clip is plain, the motion is that of what surrounds it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import ArrayLike
from scipy import ndimage

from synth.motion.strokes import opencv

SMALLEST = 8
"""Pixels: the least width and height of a frame."""


def optical_flow(frames: Iterable[ArrayLike]) -> Iterator[np.ndarray]:
    """How the picture moves from each frame to the next: (Y, X, 2) float32, pixels per frame, one fewer than frames.

    frames  grey images (Y, X) of one size, row 0 the lowest, integers or floats from 0 to 1, two or more
    Raises ValueError for fewer than two frames, for one of another size than that before it, less than 8 pixels wide or
    high, or not finite.
    """
    dense = opencv().DISOpticalFlow_create(opencv().DISOPTICAL_FLOW_PRESET_MEDIUM)
    previous, number = None, 0
    for number, frame in enumerate(frames, start=1):
        grey = _grey(tones(frame), f"frame {number} of the clip")
        if previous is not None:
            if grey.shape != previous.shape:
                raise ValueError(f"frame {number} of the clip is not of the size of the one before it")
            yield dense.calc(previous, grey, None)  # rows go up, so its y component does too
        previous = grey
    if number < 2:
        raise ValueError("a clip needs two frames or more to show motion")


def coarse_flow(frames: Iterable[ArrayLike], shape: tuple[int, ...], smoothing: float = 0.0, cyclic: bool = False,
                ) -> np.ndarray:
    """The flow of a clip on the cells `shape` (Y, X): (N - 1, Y, X, 2) float32, cells per frame of the clip.

    frames     as `optical_flow` takes them, N of them
    smoothing  standard deviation of a Gaussian over time, frames
    cyclic     whether the first follows the last, for that Gaussian
    The cells cover the clip's largest part of their proportions, in its middle. Each is the mean of its pixels, or
    linear between them where the cells are the smaller ones. Raises ValueError where `optical_flow` does, and where
    nothing moves.
    """
    flows = np.stack([_on(flow, shape) for flow in optical_flow(frames)])
    if not flows.any():
        raise ValueError("nothing moves in the clip")
    if smoothing > 0:
        flows = ndimage.gaussian_filter1d(flows, smoothing, axis=0, mode="wrap" if cyclic else "nearest")
    return flows


def tones(image: ArrayLike) -> np.ndarray:
    """Integer images to 0 … 1, others as they are; float64."""
    array = np.asarray(image)
    top = np.iinfo(array.dtype).max if np.issubdtype(array.dtype, np.integer) else 1
    return array.astype(np.float64) / top


def _grey(tone: np.ndarray, name: str) -> np.ndarray:
    """A frame in 8 bits."""
    if tone.ndim != 2:
        raise ValueError(f"{name} has {tone.ndim} dimensions instead of 2")
    if min(tone.shape) < SMALLEST:
        raise ValueError(f"{name} of {tone.shape[1]} x {tone.shape[0]} is too small; at least {SMALLEST} a side")
    if not np.isfinite(tone).all():
        raise ValueError(f"{name} has values that are not finite")
    return np.ascontiguousarray(np.rint(np.clip(tone, 0, 1) * 255), dtype=np.uint8)


def _on(flow: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """The middle of a flow, pixels per frame, on the cells `shape`, cells per frame."""
    cv2 = opencv()
    rows, columns = shape
    height, width = flow.shape[:2]
    pixels = min(height / rows, width / columns)  # a cell's edge
    tall, wide = max(1, round(rows * pixels)), max(1, round(columns * pixels))
    bottom, left = (height - tall) // 2, (width - wide) // 2
    way = cv2.INTER_AREA if pixels > 1 else cv2.INTER_LINEAR
    middle = flow[bottom:bottom + tall, left:left + wide]
    return np.asarray(cv2.resize(middle, (columns, rows), interpolation=way) / np.float32(pixels))
