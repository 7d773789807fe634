"""Search (ma09 §3.1 and §3.7): the best match of each output neighbourhood among the exemplar's own.

Exact search compares with every neighbourhood that a bound cannot exclude; k-coherence only with those that the
neighbouring sites suggest.

Hot: `exact` takes about a third of a 2-D frame (0.18 s for a later frame of 256² from a 64² exemplar, on 2 CPU cores).
It is bound by arithmetic, since each load of the exemplar serves QUERIES_TOGETHER queries. `python -m bench synthesis`
times the frame, `python -m bench search` the kernel alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from synth import opencl
from synth.motion.neighborhood import Space

QUERIES_TOGETHER = 12
POINTS_TOGETHER = 32
# dimensions in which a block of points has a box: the first, which vary most
BOX = 8
# of the sub-cell step, as a share of its matrix's trace
DAMPING = 1e-3


def exact_reference(points: np.ndarray, queries: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Specification of `exact`: nearest of points (E, D) to each of queries (S, D); (S,) index and squared distance."""
    norms = (queries.astype(np.float64) ** 2).sum(1)[:, None] + (points.astype(np.float64) ** 2).sum(1)
    squared = norms - 2 * queries.astype(np.float64) @ points.T.astype(np.float64)
    best = squared.argmin(axis=1)
    return best, np.maximum(squared[np.arange(len(best)), best], 0)


def coherent_reference(points: np.ndarray, similar: np.ndarray, exemplar: tuple[int, int], queries: np.ndarray,
                       sites: np.ndarray, axis: np.ndarray, grid: tuple[int, int],
                       match: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Specification of `coherent`; arguments as in `Matcher.coherent`, exemplar and grid as (rows, columns)."""
    rows, columns = grid
    best, distance = np.zeros(len(sites), int), np.zeros(len(sites))
    for s in range(len(sites)):
        gy, gx = divmod(s, columns)
        candidates: set[int] = set()
        for n in (y * columns + x for y in range(max(gy - 1, 0), min(gy + 2, rows))
                  for x in range(max(gx - 1, 0), min(gx + 2, columns))):
            offset = (sites[s] - sites[n]).astype(np.float32)
            i = int(np.rint(axis[s, 0] * offset[0] + axis[s, 1] * offset[1]))
            j = int(np.rint(axis[s, 0] * offset[1] - axis[s, 1] * offset[0]))
            y, x = divmod(int(match[n]), exemplar[1])
            candidates.update(similar[(y + j) % exemplar[0] * exemplar[1] + (x + i) % exemplar[1]].tolist())
        choice = np.array(sorted(candidates))
        squared = ((queries[s] - points[choice]).astype(np.float64) ** 2).sum(1)
        best[s], distance[s] = choice[squared.argmin()], squared.min()
    return best, distance


def refine_reference(points: np.ndarray, exemplar: tuple[int, int], queries: np.ndarray,
                     best: np.ndarray) -> np.ndarray:
    """Specification of `refine`; exemplar as (rows, columns), best (S,) indices -> (S, 2) float32 as x, y."""
    rows, columns = exemplar
    y, x = np.divmod(best, columns)

    def at(i: int, j: int) -> np.ndarray:
        return points[(y + j) % rows * columns + (x + i) % columns].astype(np.float64)

    slopes = np.stack([at(1, 0) - at(-1, 0), at(0, 1) - at(0, -1)], axis=-1) / 2
    matrix = slopes.transpose(0, 2, 1) @ slopes
    matrix += DAMPING * np.trace(matrix, axis1=1, axis2=2)[:, None, None] * np.eye(2)
    flat = np.linalg.det(matrix) == 0
    matrix[flat] = np.eye(2)
    toward = np.einsum("sd,sdi->si", queries - at(0, 0), slopes)
    shift = np.linalg.solve(matrix, toward[..., None])[..., 0] * ~flat[:, None]
    return (np.stack([x, y], axis=-1) + np.clip(shift, -0.5, 0.5)).astype(np.float32)


def defines(dims: int, candidates: int) -> dict[str, Any]:
    """What search.cl is built with."""
    return {"DIMS": dims, "BLOCK": QUERIES_TOGETHER, "CANDIDATES": candidates, "BOX": BOX, "DAMPING": f"{DAMPING}f"}


@dataclass(frozen=True)
class Matcher:
    """Searches the space of an exemplar of size `exemplar` (rows, columns) on the device."""

    space: Space
    exemplar: tuple[int, int]
    candidates: int

    @cached_property
    def _program(self) -> Any:
        return opencl.program(Path(__file__).with_suffix(".cl"), **defines(self.space.dims, self.candidates))

    @cached_property
    def points(self) -> Any:
        return opencl.to_device(self.space.points)

    @cached_property
    def _blocks(self) -> tuple[Any, Any, Any, Any, np.int32]:
        """The points in blocks of 32 that lie close together, side by side: (blocks, D, 32); half their squared norms
        and their indices (blocks, 32); the blocks' boxes (blocks, 2, BOX); how many blocks."""
        order = close_together(self.space.points[:, :BOX])
        blocks = -(-len(order) // POINTS_TOGETHER)
        filled = np.concatenate([order, np.full(blocks * POINTS_TOGETHER - len(order), order[-1])])
        points = self.space.points[filled]
        half = 0.5 * (points.astype(np.float64) ** 2).sum(1)
        half[len(order):] = 1e30
        side_by_side = points.reshape(blocks, POINTS_TOGETHER, -1).transpose(0, 2, 1)
        boxes = np.stack([side_by_side[:, :BOX].min(2), side_by_side[:, :BOX].max(2)], axis=1)
        return (opencl.to_device(side_by_side), opencl.to_device(half.astype(np.float32)),
                opencl.to_device(filled.astype(np.int32)), opencl.to_device(boxes), np.int32(blocks))

    @cached_property
    def similar(self) -> Any:
        return opencl.to_device(similar_sets(self.space.points, self.candidates))

    @property
    def _size(self) -> np.ndarray:
        return np.array(self.exemplar[::-1], np.int32)

    def prepare(self) -> None:
        """Upload now what `exact` would upload at its first call."""
        _ = self._blocks

    def exact(self, queries: Any) -> tuple[Any, Any]:
        """Nearest neighbourhoods to device queries (S, D): device (S,) int32 index, (S,) float32 squared distance."""
        count = queries.shape[0]
        best, distance = opencl.empty(count, np.int32), opencl.empty(count)
        self._program.exact((-(-count // QUERIES_TOGETHER),), (1,), *self._blocks, queries, np.int32(count), best,
                            distance)
        return best, distance

    def coherent(self, queries: Any, sites: Any, axis: Any, grid: tuple[int, int], match: Any) -> tuple[Any, Any]:
        """Best k-coherent candidates; match (S,) int32 is the last search's result on the same sites."""
        count = queries.shape[0]
        best, distance = opencl.empty(count, np.int32), opencl.empty(count)
        self._program.coherent(grid[::-1], None, self.points, self.similar, self._size, queries, sites, axis,
                               np.array(grid[::-1], np.int32), match, best, distance)
        return best, distance

    def refine(self, queries: Any, best: Any) -> Any:
        """Sub-cell positions (S, 2) float32 (x, y) of matches in the exemplar."""
        position = opencl.empty((queries.shape[0], 2))
        self._program.refine((queries.shape[0],), None, self.points, self._size, queries, best, position)
        return position


def close_together(points: np.ndarray) -> np.ndarray:
    """An order of points (E, D) in which each block of POINTS_TOGETHER is a leaf of a k-d tree: (E,) indices.

    Split at the middle of the widest dimension; identical points stay in order of index.
    """
    def split(index: np.ndarray) -> list[np.ndarray]:
        if len(index) <= POINTS_TOGETHER:
            return [index]
        inside = points[index]
        widest = inside[:, np.ptp(inside, axis=0).argmax()]
        index = index[np.argsort(widest, kind="stable")]
        middle = -(-len(index) // (2 * POINTS_TOGETHER)) * POINTS_TOGETHER
        return split(index[:middle]) + split(index[middle:])

    return np.concatenate(split(np.arange(len(points))))


def similar_sets(points: np.ndarray, k: int) -> np.ndarray:
    """For each of points (E, D) the k nearest, itself first: (E, k) int32; equal distances in order of index."""
    from scipy.spatial import cKDTree

    _, index = cKDTree(points).query(points, k=min(k, len(points)), workers=-1)
    index = index.reshape(len(points), -1).astype(np.int32)
    own = np.arange(len(points), dtype=np.int32)[:, None]
    # among identical neighbourhoods the tree may name another one first
    others = np.where(index == own, index[:, :1], index)
    return np.ascontiguousarray(np.concatenate([own, others[:, 1:]], axis=1)) if k > 1 else own
