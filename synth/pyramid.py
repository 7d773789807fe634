"""Image pyramids of fields whose cell centres stand at integers; values are kept, sizes change by a factor of two.

Level 0 is the coarsest. A coarse cell i stands at the fine position 2 i + 0.5.
"""

from __future__ import annotations

import numpy as np

# the binomial filter centred between two cells
KERNEL = np.array([1, 3, 3, 1], np.float32) / 8


def reduce(field: np.ndarray, toroidal: bool, dimension: int = 2) -> np.ndarray:
    """The next coarser level: ([Z, ]Y, X[, C]) float32 -> half of each, rounded up; edges wrap or repeat.

    dimension  2 or 3, the axes there are before those of components
    """
    for axis in range(dimension):
        size = field.shape[axis]
        half = -(-size // 2)
        coarse = np.arange(half)
        out = np.zeros_like(field, shape=(*field.shape[:axis], half, *field.shape[axis + 1:]))
        for tap, weight in enumerate(KERNEL):
            index = 2 * coarse + tap - 1
            index = index % size if toroidal else np.clip(index, 0, size - 1)
            out += weight * np.take(field, index, axis=axis)
        field = out
    return field


def pyramid(field: np.ndarray, levels: int, toroidal: bool, dimension: int = 2) -> list[np.ndarray]:
    """The levels of a field of so many dimensions, coarsest first; the last is the field itself."""
    fields = [field]
    for _ in range(levels - 1):
        fields.append(reduce(fields[-1], toroidal, dimension))
    return fields[::-1]


def resample(field: np.ndarray, shape: tuple[int, ...], offset: tuple[float, ...], scale: float) -> np.ndarray:
    """Linear samples of field ([Z, ]Y, X[, C]) at cell * scale + offset for each cell of `shape`; edges repeat."""
    for axis in range(len(shape)):
        size = field.shape[axis]
        at = np.clip(np.arange(shape[axis], dtype=np.float32) * scale + offset[axis], 0, size - 1)
        low = np.minimum(at.astype(int), max(size - 2, 0))
        t = (at - low).astype(np.float32).reshape([-1 if a == axis else 1 for a in range(field.ndim)])
        high = np.minimum(low + 1, size - 1)
        field = (1 - t) * np.take(field, low, axis=axis) + t * np.take(field, high, axis=axis)
    return field
