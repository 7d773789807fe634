"""Local axes R(s): which direction is along, across and up for a sample.

"Directions, such as left and up, are determined by user-specified orientation fields" (ma13 §3.2).
"""

from __future__ import annotations

import numpy as np

TINY = 1e-12


def along_threads(coarse: np.ndarray) -> np.ndarray:
    """Axes (T·E·S, 3, 3) float32 of threads at the coarse positions (T, E, S, 3).

    Columns of R: across, beside, along the thread from its first sample. At the first sample of the first frame
    `across` is as near to x as possible; from there the axes are carried along the thread, and from frame to frame at
    the first sample, by the smallest rotation (no twist and no flip).
    """
    tangent = _unit(np.gradient(coarse.astype(np.float64), axis=2))
    frames, count, samples = coarse.shape[:3]
    across = np.empty_like(tangent)
    first = np.broadcast_to(np.array([1.0, 0.0, 0.0]), (count, 3))
    # where a thread starts along x, y is taken instead
    first = np.where(np.abs(tangent[0, :, 0, :1]) > 0.9, np.array([0.0, 1.0, 0.0]), first)
    across[0, :, 0] = _unit(first - _dot(first, tangent[0, :, 0]) * tangent[0, :, 0])
    for t in range(1, frames):
        across[t, :, 0] = _carried(across[t - 1, :, 0], tangent[t - 1, :, 0], tangent[t, :, 0])
    for s in range(1, samples):
        across[:, :, s] = _carried(across[:, :, s - 1], tangent[:, :, s - 1], tangent[:, :, s])
    beside = np.cross(tangent, across)
    return np.stack([across, beside, tangent], axis=-1).reshape(-1, 3, 3).astype(np.float32)


def on_sheets(coarse: np.ndarray, grid: tuple[int, ...]) -> np.ndarray:
    """Axes (T·E·S, 3, 3) float32 of sheets of grid (rows, columns) at the coarse positions (T, E, S, 3).

    Columns of R: along the columns' direction, the rows' (made orthogonal), and the normal.
    """
    surface = coarse.astype(np.float64).reshape(*coarse.shape[:2], *grid, 3)
    right = _unit(np.gradient(surface, axis=3))
    up = np.gradient(surface, axis=2)
    up = _unit(up - _dot(up, right) * right)
    return np.stack([right, up, np.cross(right, up)], axis=-1).reshape(-1, 3, 3).astype(np.float32)


def along(coarse: np.ndarray, grid: tuple[int, ...]) -> np.ndarray:
    """Axes (T·E·S, 3, 3) float32 of threads, or of sheets, by their grid, at the coarse positions (T, E, S, 3)."""
    return along_threads(coarse) if len(grid) == 1 else on_sheets(coarse, grid)


def along_directions(direction: np.ndarray) -> np.ndarray:
    """Axes (N, D, D) float32 whose first column is `direction` (N, D), x where it is zero.

    In 3-D the third column is as upright (+y) as it can be, so that nothing rolls.
    """
    count, dims = direction.shape
    length = np.linalg.norm(direction, axis=1, keepdims=True)
    axis = np.zeros(dims)
    axis[0] = 1.0
    ahead = np.where(length > TINY, direction / np.maximum(length, TINY), axis)
    if dims == 2:
        left = np.stack([-ahead[:, 1], ahead[:, 0]], axis=-1)
        return np.stack([ahead, left], axis=-1).astype(np.float32)
    up = np.broadcast_to(np.array([0.0, 1.0, 0.0]), (count, 3))
    up = np.where(np.abs(ahead[:, 1:2]) > 0.999, np.array([1.0, 0.0, 0.0]), up)
    up = _unit(up - _dot(up, ahead) * ahead)
    return np.stack([ahead, up, np.cross(ahead, up)], axis=-1).astype(np.float32)


def _carried(across: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """`across`, orthogonal to `before`, after the smallest rotation that takes `before` to `after`."""
    axis = np.cross(before, after)
    cosine = _dot(before, after)
    rotated = (across * cosine + np.cross(axis, across)
              + axis * _dot(axis, across) / np.maximum(1.0 + cosine, 1e-6))
    return _unit(rotated - _dot(rotated, after) * after)


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.sum(a * b, axis=-1, keepdims=True)


def _unit(v: np.ndarray) -> np.ndarray:
    return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), TINY)
