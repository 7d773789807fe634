"""Visual words (okabe11 §4): SIFT descriptors on a regular grid, a codebook of them by repeated bisection, histograms
of words with a spatial pyramid, and how much two histograms have in common (Eq. 1).

"We extract SIFT features … at each point on a regular grid of 9×9 over the 48×48 pixel resolution image." One grid is
laid over a whole picture, GRID points to the edge of a piece, and pieces that overlap share its points.

Descriptors and words are whole numbers, 0..255, so that all sums are exact: the same bits at any number of threads.

Hot: `common`, a byte minimum and an addition for each word of a piece of the target and each piece of the database;
bound by arithmetic.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from synth import opencl

GRID = 8
"""Steps of the grid along the edge of a piece: 9 × 9 points (§4)."""
WORDS = 200
"""k, the words of a codebook (§4)."""
SAMPLES = 20000
"""Descriptors that the codebook is made from, at most."""
ROUNDS = 12
"""Steps of Lloyd's iteration in a bisection, at most."""
QUADRANTS = 4
TOTAL = 2 * (GRID + 1) ** 2
"""What two equal histograms have in common: each point counts on both levels of the pyramid."""
TILE = 64
"""Histograms that a work-item compares with."""
CONTEXT = 0.5
"""Edge of a descriptor's window over that of a piece. A larger one would see more than its piece."""


def descriptors(picture: np.ndarray, step: float) -> np.ndarray:
    """SIFT on a grid: (rows, columns, 128) uint8, of a picture (Y, X) uint8, at 0, step, 2 step … pixels.

    The window is CONTEXT pieces wide, a piece having GRID steps. OpenCV's keypoint of size s spans 6 s pixels: four
    bins of 1.5 s. Row 0 of the grid is row 0 of the picture. Raises ValueError for a picture that is not uint8 in two
    dimensions.
    """
    import cv2

    if picture.ndim != 2 or picture.dtype != np.uint8:
        raise ValueError(f"descriptors are of a picture (Y, X) uint8, not of {picture.dtype} {picture.shape}")
    rows, columns = (int((n - 1) / step) + 1 for n in picture.shape)
    size = CONTEXT * GRID * step / 6
    points = [cv2.KeyPoint(float(x * step), float(y * step), size, 0.0) for y in range(rows) for x in range(columns)]
    _, found = cv2.SIFT_create().compute(np.ascontiguousarray(picture), points)
    return np.clip(np.rint(found), 0, 255).astype(np.uint8).reshape(rows, columns, 128)


def codebook(samples: np.ndarray, words: int = WORDS, seed: int = 1) -> np.ndarray:
    """Words by repeated bisection [Zhao et al. 2005]: (words, 128) uint8, of descriptors (N, 128) uint8.

    1. At most SAMPLES of the descriptors, at random.
    2. The cluster with the largest sum of squared distances from its mean is split in two, until there are enough.
    3. The words are the means, rounded.
    Fewer words, if the descriptors have no more distinct values. Raises ValueError without descriptors.
    """
    if not len(samples):
        raise ValueError("a codebook needs descriptors")
    random = np.random.Generator(np.random.Philox(key=[seed, 0]))
    # 1. a sample
    if len(samples) > SAMPLES:
        samples = samples[np.sort(random.permutation(len(samples))[:SAMPLES])]
    values = samples.astype(np.float64)
    # 2. bisect
    clusters, spread = [np.arange(len(values))], [_spread(values)]
    while len(clusters) < words and max(spread) > 0:
        widest = int(np.argmax(spread))
        members, _ = clusters.pop(widest), spread.pop(widest)
        second = _bisected(values[members], random)
        for part in (members[~second], members[second]):
            clusters.append(part)
            spread.append(_spread(values[part]))
    # 3. means
    return np.rint([values[members].mean(axis=0) for members in clusters]).astype(np.uint8)


def _spread(values: np.ndarray) -> float:
    return float(((values - values.mean(axis=0)) ** 2).sum())


def _bisected(values: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Which of values (N, 128), not all equal, belong to the second of two clusters: (N,) bool, neither empty."""
    first = values[random.integers(len(values))]
    # far from the first, and from each other
    one = values[((values - first) ** 2).sum(axis=1).argmax()]
    other = values[((values - one) ** 2).sum(axis=1).argmax()]
    second = np.zeros(len(values), bool)
    for _ in range(ROUNDS):
        # einsum, not a product of matrices: BLAS rounds by the number of its threads
        side = np.einsum("ni,i->n", values - (one + other) / 2, other - one) > 0
        if side.all() or not side.any() or (side == second).all():
            break
        second = side
        one, other = values[~second].mean(axis=0), values[second].mean(axis=0)
    return second


def nearest_words(found: np.ndarray, words: np.ndarray) -> np.ndarray:
    """The nearest word of each descriptor (..., 128): (...,) int16; of equals the first.

    Products of whole numbers below 2⁸ in sums of 128 are exact in single precision, in any order.
    """
    flat, centres = found.reshape(-1, 128), words.astype(np.float32)
    squares = (words.astype(np.int64) ** 2).sum(axis=1)
    nearest = np.empty(len(flat), np.int16)
    for start in range(0, len(flat), 1 << 16):
        products = flat[start:start + (1 << 16)].astype(np.float32) @ centres.T
        nearest[start:start + (1 << 16)] = (squares - 2 * products.astype(np.int64)).argmin(axis=1)
    return nearest.reshape(found.shape[:-1])


def histograms(nearest: np.ndarray, corners: np.ndarray, words: int) -> np.ndarray:
    """Histograms of words of the pieces at corners (N, 2), row and column of the grid: (N, 5 words) uint8.

    nearest  (rows, columns) int: the word at each point of the grid
    A spatial pyramid of two levels [Lazebnik et al. 2006]: the whole piece, then its quadrants from the lowest left;
    of GRID + 1 points the first half has one more.
    """
    count = len(corners)
    steps = np.arange(GRID + 1)
    half = (steps > GRID // 2).astype(int)
    found = nearest[corners[:, 0, None, None] + steps[:, None], corners[:, 1, None, None] + steps].astype(np.int64)
    quadrant = 1 + 2 * half[:, None] + half
    piece = np.arange(count)[:, None, None] * (1 + QUADRANTS)
    total = np.zeros(count * (1 + QUADRANTS) * words, np.int64)
    for level in (np.zeros_like(quadrant), quadrant):
        total += np.bincount(((piece + level) * words + found).ravel(), minlength=len(total))
    return total.reshape(count, -1).astype(np.uint8)


def common(ours: np.ndarray, theirs: np.ndarray) -> np.ndarray:
    """Eq. 1, I = Σ min: points that histograms ours (P, C) and theirs (N, C) uint8 have in common: (P, N) uint8.

    Of TOTAL; I is that share. Only the words that a histogram has are looked at, a tenth of all.
    """
    count, words = theirs.shape
    tiles = -(-count // TILE)
    tiled = np.zeros((tiles * TILE, words), np.uint8)
    tiled[:count] = theirs
    tiled = np.ascontiguousarray(tiled.reshape(tiles, TILE, words).swapaxes(1, 2))
    node, word = np.nonzero(ours)
    first = np.searchsorted(node, np.arange(len(ours) + 1)).astype(np.int32)
    out = opencl.empty((len(ours), tiles * TILE), np.uint8)
    opencl.program(Path(__file__).with_suffix(".cl"), TILE=TILE).common(
        (tiles,), None, opencl.to_device(first), opencl.to_device(word.astype(np.uint16)),
        opencl.to_device(ours[node, word]), opencl.to_device(tiled), np.int32(words), np.int32(len(ours)), out)
    return np.ascontiguousarray(out.get()[:, :count])


def common_reference(ours: np.ndarray, theirs: np.ndarray) -> np.ndarray:
    """Specification of `common`."""
    return np.stack([np.minimum(row, theirs).sum(axis=1, dtype=np.int64) for row in ours]).astype(np.uint8)
