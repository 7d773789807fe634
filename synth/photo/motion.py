"""The motion of a clip, and what of it pieces are compared by (okabe11 §4, §5).

"We compute optical flow between neighboring frames to obtain an average through all of the frames. … Only a pixel
position with a significant averaged motion is used; other pixels are masked out" (§4, fig. 5). The paper's flow is
TV-L1 [Zach et al. 2007]; ours is DIS [Kroeger et al. 2016], a tenth of its time. A clip that was simulated brings its
own mean velocity, which DIS underestimates in foam.

Eq. 2 compares power spectra of the motion. The power of the mean forgets its sign: half of the pairs of pieces
nearest by it flow apart by more than a right angle. So the mean stays a vector, and only the rest are powers, in
BANDS octaves.

Velocities are pixels per frame; pictures (Y, X), row 0 the lowest.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

CELL = 4
"""Pixels of a clip's cell, over which its motion and texture are averaged."""
BANDS = 5
SIGNIFICANT = 0.15
"""Pixels per frame: the least mean motion of a pixel that is used (fig. 5 d)."""
LEVELS = 4
"""Of the Laplacian pyramid that textureness is read from (§5)."""


class Motion(NamedTuple):
    """Of a clip, on cells of CELL pixels.

    mean    (R, C, 2) float32: the mean velocity
    bands   (R, C, BANDS) float32: root of the power of the velocity in octaves of its frequency, from slow to fast
    moving  (R, C) float32: share of a cell's pixels whose mean motion is significant
    """

    mean: np.ndarray
    bands: np.ndarray
    moving: np.ndarray


def optical_flow(frames: np.ndarray) -> np.ndarray:
    """From each frame of a loop (T, Y, X) uint8 to the next, from the last to the first: (T, Y, X, 2) float32."""
    import cv2

    dis = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_FAST)
    found = np.empty((*frames.shape, 2), np.float32)
    for k, frame in enumerate(frames):
        found[k] = dis.calc(frame, frames[(k + 1) % len(frames)], None)
    return found


def motion(flow: np.ndarray, mean: np.ndarray | None = None) -> Motion:
    """What is compared of a flow (T, Y, X, 2), pixels per frame.

    mean  (Y, X, 2): the mean velocity, where it is known; None: that of the flow
    """
    average = flow.mean(axis=0) if mean is None else mean
    speed = np.hypot(average[..., 0], average[..., 1])
    power = _power(flow)
    bands = np.sqrt(np.stack([2 * power[low:high].sum(axis=(0, 3)) for low, high in octaves(len(flow))], axis=-1))
    return Motion(in_cells(average), bands.astype(np.float32), in_cells((speed >= SIGNIFICANT).astype(np.float32)))


def spectrum(flow: np.ndarray, mean: np.ndarray | None = None) -> np.ndarray:
    """Amplitude of the motion at each frequency (fig. 6): (T // 2 + 1,) float64, pixels per frame, of a flow
    (T, Y, X, 2) in pixels per frame.

    The root of the power of Eq. 2, positive and negative frequency together, averaged over the cells. f = 0 is the mean
    motion: `mean` (Y, X, 2) where it is known, else that of the flow.
    """
    power = _power(flow).sum(axis=3).mean(axis=(1, 2))
    power[1:(len(flow) + 1) // 2] *= 2
    if mean is not None:
        power[0] = (in_cells(mean).astype(np.float64) ** 2).sum(axis=2).mean()
    return np.sqrt(power)


def _power(flow: np.ndarray) -> np.ndarray:
    """The power of both components of a flow (T, Y, X, 2) at each frequency: (T // 2 + 1, R, C, 2) on cells."""
    cells = np.stack([in_cells(frame) for frame in flow])
    return np.asarray(np.abs(np.fft.rfft(cells, axis=0) / len(flow)) ** 2)


def octaves(frames: int) -> list[tuple[int, int]]:
    """First and past-last frequency of each of the BANDS, 1 to frames / 2 in whole numbers of a clip's length."""
    last = frames // 2 + 1
    edges = np.unique(np.rint(np.geomspace(1, last, BANDS + 1)).astype(int))
    while len(edges) <= BANDS:  # of a short clip the last bands are empty
        edges = np.append(edges, last)
    return list(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True))


def in_cells(values: np.ndarray) -> np.ndarray:
    """Means of values (Y, X[, C]) over cells of CELL pixels: (Y // CELL, X // CELL[, C]) float32. The rest is left."""
    rows, columns = values.shape[0] // CELL, values.shape[1] // CELL
    whole = values[:rows * CELL, :columns * CELL].reshape(rows, CELL, columns, CELL, *values.shape[2:])
    return whole.mean(axis=(1, 3), dtype=np.float64).astype(np.float32)


def textureness(frames: np.ndarray) -> np.ndarray:
    """Strength of texture at LEVELS scales: (R, C, LEVELS) float32 on cells, in grey levels of frames (T, Y, X) uint8.

    "We describe the textureness of each frame of a video example piece using a four-level scale-space Laplacian
    pyramid, and sum the texture through all frames" (§5). Here the root of the mean of squares, over frames and cell.
    """
    total = None
    for frame in frames:
        squares = np.stack([level * level for level in laplacians(frame.astype(np.float32))], axis=-1)
        cells = in_cells(squares).astype(np.float64)
        total = cells if total is None else total + cells
    assert total is not None, "a clip has frames"
    return np.sqrt(total / len(frames)).astype(np.float32)


def laplacians(picture: np.ndarray, levels: int = LEVELS) -> list[np.ndarray]:
    """Differences of Gaussians of σ 0, 1, 2, 4 … of a picture (Y, X) float32, of its own size each.

    `picture` is their sum and what is left, the last Gaussian.
    """
    from scipy import ndimage

    found, before = [], picture
    for level in range(levels):
        # in steps: the next Gaussian from the one before
        sigma = 1.0 if level == 0 else np.sqrt(3.0) * 2 ** (level - 1)
        after = ndimage.gaussian_filter(before, sigma, mode="nearest", truncate=3)
        found.append(before - after)
        before = after
    return found
