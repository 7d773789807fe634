"""Initialization (ma09 §3.4) of the first frame, at the coarsest level."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

RELAXATIONS = 25
# tiles laid per exemplar area: squares that turn do not pack without gaps, and some tiles die out
CROWDING = 1.1
NEAREST = 8


def random_pixels(exemplar: np.ndarray, shape: tuple[int, int], random: np.random.Generator) -> np.ndarray:
    """Pixels copied at random from the exemplar (N, M, 2), as the paper does: (Y, X, 2)."""
    pixels = exemplar.reshape(-1, 2)
    return pixels[random.integers(len(pixels), size=shape)]


def mosaic(exemplar: np.ndarray, frame: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Whole exemplars laid as tiles of a mosaic that follows the frame (Y, X, 2): (Y, X, 2).

    The tiles' centres relax as in Hausner 2001 (centroidal Voronoi cells of squares turned with the frame), so
    that each cell of the mosaic is about one exemplar large and a closed motif in its middle stays whole.
    """
    size = exemplar.shape[0]
    rows, columns = frame.shape[:2]
    cells = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2).astype(np.float32)
    count = max(1, round(CROWDING * rows * columns / size**2))
    centres = random.random((count, 2), dtype=np.float32) * np.float32([columns - 1, rows - 1])
    nearest, offset = _owners(cells, centres, frame)
    for _ in range(RELAXATIONS):
        members = np.bincount(nearest, minlength=count)
        sums = np.stack([np.bincount(nearest, cells[:, i], minlength=count) for i in (0, 1)], axis=-1)
        centres = np.where(members[:, None] > 0, sums / np.maximum(members, 1)[:, None], centres).astype(np.float32)
        nearest, offset = _owners(cells, centres, frame)
    at = np.rint(offset + (size - 1) / 2).astype(int) % size
    return exemplar[at[:, 1], at[:, 0]].reshape(rows, columns, 2)


def _owners(cells: np.ndarray, centres: np.ndarray, frame: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """For each of cells (P, 2) the centre whose turned square holds it best, and the offset in that square's frame."""
    _, index = cKDTree(centres).query(cells, k=min(NEAREST, len(centres)))
    index = index.reshape(len(cells), -1)
    at = np.rint(centres).astype(int)
    e = frame[np.clip(at[:, 1], 0, frame.shape[0] - 1), np.clip(at[:, 0], 0, frame.shape[1] - 1)][index]
    way = cells[:, None] - centres[index]
    offset = np.stack([e[..., 0] * way[..., 0] + e[..., 1] * way[..., 1],
                       e[..., 0] * way[..., 1] - e[..., 1] * way[..., 0]], axis=-1)
    choice = np.abs(offset).max(axis=-1).argmin(axis=1)
    rows = np.arange(len(cells))
    return index[rows, choice], offset[rows, choice]
