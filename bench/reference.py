"""Kwatra's texture optimization as one would write it with NumPy and SciPy, to be measured against.

The first frame of `synth.motion.detail` step for step: the same starts, levels, sites, widths, iterations,
projection and kind of weights, with `map_coordinates` to sample, a `cKDTree` on all cores to search and `bincount`
to add up.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import eigh
from scipy.ndimage import map_coordinates, zoom
from scipy.spatial import cKDTree

from synth.motion import initialize

ROBUST, EXACT, EDGE = 0.8, 0.05, 0.1
VARIANCE_KEPT, MOST_DIMS = 0.995, 64
MARGIN, STARTS, NEAREST = 8, 8, 8


def sampled(field: np.ndarray, x: np.ndarray, y: np.ndarray, mode: str) -> np.ndarray:
    return np.stack([map_coordinates(field[..., c], [y, x], order=1, mode=mode) for c in (0, 1)], axis=-1)


def turned(axis: np.ndarray, i: np.ndarray, j: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Offsets (i, j) of a window, turned by each site's axis (S, 2)."""
    e = axis[:, :, None]
    return e[:, 0] * i - e[:, 1] * j, e[:, 1] * i + e[:, 0] * j


class Neighborhoods:
    """Principal components of the toroidal neighbourhoods of an exemplar, and a tree of them."""

    def __init__(self, exemplar: np.ndarray, radius: int):
        padded = np.pad(exemplar, ((radius, radius), (radius, radius), (0, 0)), mode="wrap")
        windows = np.lib.stride_tricks.sliding_window_view(padded, (2 * radius + 1, 2 * radius + 1), axis=(0, 1))
        patches = windows.transpose(0, 1, 3, 4, 2).reshape(exemplar.shape[0] * exemplar.shape[1], -1)
        self.mean = patches.mean(0)
        centred = patches - self.mean
        covariance = centred.T @ centred
        values, vectors = eigh(covariance, subset_by_index=(len(covariance) - MOST_DIMS, len(covariance) - 1))
        kept = int(np.searchsorted(np.cumsum(values[::-1]) / np.trace(covariance), VARIANCE_KEPT)) + 1
        self.basis = vectors[:, ::-1][:, :kept]
        self.tree = cKDTree(centred @ self.basis)


def iteration(H: np.ndarray, exemplar: np.ndarray, frame: np.ndarray, near: Neighborhoods, radius: int,
              rms: float) -> tuple[np.ndarray, float]:
    """One search and one assignment: H (Y, X, 2), and the mean distance of the matches."""
    rows, columns = H.shape[:2]
    spacing = max(1, (2 * radius + 1) // 4)
    x, y = (g.ravel() for g in np.meshgrid(np.arange(spacing // 2, columns, spacing),
                                           np.arange(spacing // 2, rows, spacing)))
    axis = frame[y, x]
    span = np.arange(-radius, radius + 1)
    j, i = (g.ravel() for g in np.meshgrid(span, span, indexing="ij"))
    at_x, at_y = turned(axis, i, j)
    patches = sampled(H, x[:, None] + at_x, y[:, None] + at_y, "nearest").reshape(len(x), -1)
    distance, match = near.tree.query((patches - near.mean) @ near.basis, workers=-1)
    weight = (1 + distance**2 / patches.shape[1] / (EXACT * rms) ** 2) ** (ROBUST / 2 - 1)

    extent = int(np.ceil(np.sqrt(2) * radius))
    span = np.arange(-extent, extent + 1)
    offset_y, offset_x = (g.ravel() for g in np.meshgrid(span, span, indexing="ij"))
    # a cell's offset in the site's frame: the turn undone
    o_x, o_y = turned(axis * [1, -1], offset_x, offset_y)
    cell_x, cell_y = x[:, None] + offset_x, y[:, None] + offset_y
    covered = ((np.maximum(np.abs(o_x), np.abs(o_y)) <= radius + 1e-3) & (cell_x >= 0) & (cell_x < columns)
               & (cell_y >= 0) & (cell_y < rows))
    site = np.nonzero(covered)[0]
    o_x, o_y = o_x[covered], o_y[covered]
    laid = sampled(exemplar, match[site] % exemplar.shape[1] + o_x, match[site] // exemplar.shape[1] + o_y,
                   "grid-wrap")
    w = weight[site] * np.exp(np.log(EDGE) * (o_x**2 + o_y**2) / radius**2)
    cell = cell_y[covered] * columns + cell_x[covered]
    total = np.bincount(cell, w, rows * columns)
    mean = [np.bincount(cell, w * laid[:, c], rows * columns) / np.maximum(total, 1e-12) for c in (0, 1)]
    assigned = np.where(total[:, None] > 0, np.stack(mean, axis=-1), H.reshape(-1, 2)).reshape(H.shape)
    return assigned, float(distance.mean()) / np.sqrt(patches.shape[1]) / rms


def optimized(H: np.ndarray, exemplar: np.ndarray, frame: np.ndarray, near: dict[int, Neighborhoods],
              iterations: int, rms: float) -> tuple[np.ndarray, float]:
    """Search and assign, `iterations` times with each width."""
    distance = 0.0
    for width in near:
        for _ in range(iterations):
            H, distance = iteration(H, exemplar, frame, near[width], width // 2, rms)
    return H, distance


def owners(cells: np.ndarray, centres: np.ndarray, frame: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """For each of cells (P, 2) the one of the eight nearest centres whose turned square holds it best, and the
    offset in that square's frame."""
    _, index = cKDTree(centres).query(cells, k=min(NEAREST, len(centres)))
    index = index.reshape(len(cells), -1)
    at = np.rint(centres).astype(int)
    e = frame[np.clip(at[:, 1], 0, frame.shape[0] - 1), np.clip(at[:, 0], 0, frame.shape[1] - 1)][index]
    displacement = (cells[:, None] - centres[index]).reshape(-1, 2, 1)
    offset = np.stack(turned(e.reshape(-1, 2) * [1, -1], displacement[:, 0], displacement[:, 1]), axis=-1)
    offset = offset.reshape(*index.shape, 2)
    nearest = np.abs(offset).max(axis=-1).argmin(axis=1)
    rows = np.arange(len(cells))
    return index[rows, nearest], offset[rows, nearest]


def mosaic(exemplar: np.ndarray, frame: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Whole exemplars as the tiles of a mosaic that follows the frame: `initialize.mosaics` in plain NumPy."""
    size = exemplar.shape[0]
    rows, columns = frame.shape[:2]
    cells = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1)
    count = max(1, round(initialize.CROWDING * rows * columns / size**2))
    centres = random.random((count, 2), dtype=np.float32) * [columns - 1, rows - 1]
    stride = max(1, size // 8)
    some = cells[::stride, ::stride].reshape(-1, 2)
    for _ in range(initialize.RELAXATIONS):
        tile, _ = owners(some, centres, frame)
        members = np.bincount(tile, minlength=count)
        sums = np.stack([np.bincount(tile, some[:, i], minlength=count) for i in (0, 1)], axis=-1)
        centres = np.where(members[:, None] > 0, sums / np.maximum(members, 1)[:, None], centres)
    _, offset = owners(cells.reshape(-1, 2), centres, frame)
    at = np.rint(offset + (size - 1) / 2).astype(int) % size
    return exemplar[at[:, 1], at[:, 0]].reshape(rows, columns, 2)


def start(exemplar: np.ndarray, frame: np.ndarray, near: dict[int, Neighborhoods], iterations: int, rms: float,
          seed: int) -> np.ndarray:
    """The mosaic that promises most after half the iterations."""
    best, least = exemplar, np.inf
    for trial in range(STARTS):
        random = np.random.Generator(np.random.Philox(key=[seed, trial]))
        H, distance = optimized(mosaic(exemplar, frame, random), exemplar, frame, near, (iterations + 1) // 2, rms)
        inside = H[MARGIN:-MARGIN, MARGIN:-MARGIN]
        score = distance + abs(np.sqrt(np.mean(inside**2) / np.mean(exemplar**2)) - 1)
        if score < least:
            best, least = H, score
    return best


def synthesize(exemplar: np.ndarray, L: np.ndarray, levels: int, widths: tuple[int, ...] = (17, 9),
               iterations: int = 4, seed: int = 1) -> np.ndarray:
    """H (Y, X, 2) of a first frame, float64; exemplar (N, N, 2), coarse motion L (Y, X, 2)."""
    rms = float(np.sqrt(np.mean(exemplar**2)))
    exemplars, motions = [exemplar.astype(float)], [L.astype(float)]
    for _ in range(levels - 1):
        exemplars.append(zoom(exemplars[-1], (0.5, 0.5, 1), order=1, mode="grid-wrap", grid_mode=True))
        motions.append(zoom(motions[-1], (0.5, 0.5, 1), order=1, mode="nearest", grid_mode=True))
    H = None
    for I, motion in zip(exemplars[::-1], motions[::-1], strict=True):
        grown = np.pad(motion, ((MARGIN, MARGIN), (MARGIN, MARGIN), (0, 0)), mode="edge")
        frame = grown / np.maximum(np.linalg.norm(grown, axis=-1, keepdims=True), 1e-12)
        near = {width: Neighborhoods(I, width // 2) for width in widths}
        if H is None:
            H = start(I, frame, near, iterations, rms, seed)
        else:
            inner = H[MARGIN // 2:-MARGIN // 2, MARGIN // 2:-MARGIN // 2]
            H = zoom(inner, (2, 2, 1), order=1, mode="nearest", grid_mode=True)
        H, _ = optimized(initialize.reseed(H, I, frame), I, frame, near, iterations, rms)
    return H[MARGIN:-MARGIN, MARGIN:-MARGIN]
