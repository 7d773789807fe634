"""Cells (wang05 §2.1 and §2.2.1): squares of 32 down to 4 pixels, each as large as a constraint allows.

A picture is cut into squares of the largest size, from its lower left corner. A square larger than the smallest size
that does not satisfy the constraint is cut into four. Squares at the right and upper border reach beyond a picture
that is no multiple of them; only the pixels of the picture count.

What it does not do: cells of the smallest size need not satisfy the constraint, as in the paper.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np

LARGEST, SMALLEST = 32, 4
Spread = Literal["vectors", "speeds"]


class Cells(NamedTuple):
    """Squares in the order in which they are synthesized, "from left to right and bottom to top" (§2.1): (N,) int32.

    Row and column of the lower left pixel (y, x), and the pixels along a side. Sorted by y, then x.
    """

    x: np.ndarray
    y: np.ndarray
    size: np.ndarray


def by_direction(angles: np.ndarray, n: int, largest: int = LARGEST, smallest: int = SMALLEST) -> Cells:
    """§2.1, direction constraint: |a_i − a_j| < 2π/n on the circle, for all pixels i, j of a cell.

    angles (Y, X) in radians. From one pixel of a cell all others lie less than 2π/n, a right angle at most (so n ≥ 4),
    to either side; the largest difference on the circle is then the range of those differences.
    """
    if n < 4:
        raise ValueError(f"n = {n}: the direction constraint needs four directions at least")

    def satisfied(blocks: np.ndarray) -> np.ndarray:
        turn = blocks[..., 0] - blocks[:, :1, :1, 0]
        turn -= 2 * np.pi * np.rint(turn / (2 * np.pi))
        return np.ptp(turn, axis=(1, 2)) < 2 * np.pi / n

    return _subdivided(angles.astype(np.float64)[..., None], satisfied, largest, smallest)


def by_velocity(v: np.ndarray, factor: float = 2.0, spread: Spread = "vectors", largest: int = LARGEST,
                smallest: int = SMALLEST) -> Cells:
    """§2.2.1, velocity constraint: the velocities of a cell differ by `factor` times its least speed at most.

    v (Y, X, 2) in pixels per frame. The paper: "do not differ much, i.e. below some threshold (for example, twice of
    the minimal velocity in the cell)". What differs is the text's to say and it does not:
    "vectors"  the diagonal of the box that holds the cell's vectors (the default)
    "speeds"   the greatest speed less the least
    """
    speed = np.hypot(v[..., 0], v[..., 1], dtype=np.float64)

    def satisfied(blocks: np.ndarray) -> np.ndarray:
        least, ranges = blocks[..., 2].min(axis=(1, 2)), np.ptp(blocks, axis=(1, 2))
        differ = ranges[:, 2] if spread == "speeds" else np.hypot(ranges[:, 0], ranges[:, 1])
        return differ <= factor * least

    return _subdivided(np.dstack([v, speed]), satisfied, largest, smallest)


def _subdivided(values: np.ndarray, satisfied: Callable[[np.ndarray], np.ndarray], largest: int,
                smallest: int) -> Cells:
    """Squares of `values` (Y, X, C) from largest to smallest; satisfied: (N, size, size, C) -> (N,) bool."""
    if smallest < 1 or largest % smallest or (ratio := largest // smallest) & (ratio - 1):
        raise ValueError(f"cells from {largest} to {smallest} pixels: the largest must be the smallest doubled, or so")
    shape = np.array(values.shape[:2])
    # beyond the border its pixels are repeated: they are those of the same cell
    padded = np.pad(values, [*((0, -n % largest) for n in shape), (0, 0)], mode="edge")
    y, x = (g.ravel() * largest for g in np.mgrid[: padded.shape[0] // largest, : padded.shape[1] // largest])
    found, size = [], largest
    while True:
        blocks = padded.reshape(padded.shape[0] // size, size, padded.shape[1] // size, size, -1)
        good = satisfied(blocks[y // size, :, x // size]) if size > smallest else np.ones(len(y), bool)
        found.append((x[good], y[good], np.full(good.sum(), size)))
        if good.all():
            break
        size //= 2
        y = np.add.outer(y[~good], [0, 0, size, size]).ravel()
        x = np.add.outer(x[~good], [0, size, 0, size]).ravel()
        inside = (y < shape[0]) & (x < shape[1])
        y, x = y[inside], x[inside]
    x, y, sizes = (np.concatenate(part).astype(np.int32) for part in zip(*found, strict=True))
    order = np.lexsort((x, y))
    return Cells(x[order], y[order], sizes[order])


def index(cells: Cells, shape: tuple[int, int]) -> np.ndarray:
    """Which cell each pixel of a picture of `shape` (Y, X) lies in: (Y, X) int32."""
    smallest = int(cells.size.min())
    reach = [-(-n // int(cells.size.max())) * int(cells.size.max()) // smallest for n in shape]
    coarse = np.empty(reach, np.int32)
    for size in np.unique(cells.size):
        of = np.flatnonzero(cells.size == size)
        side = np.arange(size // smallest)
        rows = cells.y[of, None, None] // smallest + side[:, None]
        columns = cells.x[of, None, None] // smallest + side
        coarse[rows, columns] = of[:, None, None]
    return coarse.repeat(smallest, axis=0).repeat(smallest, axis=1)[: shape[0], : shape[1]]
