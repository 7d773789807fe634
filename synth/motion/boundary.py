"""The soft boundary condition (ma09 §3.6, Eq. 3): E_n(x) = sum_p lambda_p |n . x_p - b_p|^2.

Of H only the component along the wall's normal n is drawn to b, in the assignment: where m is the least-squares
average of the matches, the minimum of E_t + E_n is m + lambda / (1 + lambda) (b - n . m) n. lambda is a Gaussian of
the distance to the wall, wide and soft on coarse levels, sharp and strong on fine ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from synth import opencl
from synth.obstacle import outward
from synth.pyramid import pyramid

# lambda on the wall at the finest level, in units of all matches' weights; each coarser level has 1 / SOFTER of it
PEAK = 300.0
SOFTER = 8.0
# standard deviation of lambda at the finest level, in its cells, and how many of its own cells each coarser one adds
WIDTH = 0.8
WIDER = 0.5
# below this lambda changes nothing that could be seen
LEAST = 1e-3


@dataclass(frozen=True)
class Walls:
    """The K cells of one level near a wall.

    cells (K,) int32, flat indices into the level's grid; normal (K, D) float32, domain coordinates;
    target (K,) float32, b; weight (K,) float32, lambda in units of the weight of all matches of the cell
    """

    cells: np.ndarray
    normal: np.ndarray
    target: np.ndarray
    weight: np.ndarray


def walls(distance: np.ndarray, levels: int, margin: int, target: np.ndarray | None = None) -> list[Walls]:
    """The walls of each level of the synthesis, coarsest first, on the level's grid grown by `margin` cells.

    distance  (Y, X) or (Z, Y, X) float32, cells of the finest level, negative inside (`Obstacle.distance`)
    target    b: what n . H is to be, of the same shape; none: 0 everywhere, nothing flows through a wall
    """
    dimension = distance.ndim
    targets = np.zeros_like(distance) if target is None else target
    found = []
    for number, (away, b) in enumerate(zip(pyramid(distance, levels, False, dimension),
                                           pyramid(targets, levels, False, dimension), strict=True)):
        coarser = levels - 1 - number
        away = np.pad(away, margin, mode="edge") / np.float32(2**coarser)
        weight = PEAK / SOFTER**coarser * np.exp(-0.5 * (away / (WIDTH + WIDER * coarser)) ** 2)
        cells = np.flatnonzero(weight > LEAST).astype(np.int32)
        found.append(Walls(cells, outward(away).reshape(-1, dimension)[cells],
                           np.pad(b, margin, mode="edge").ravel()[cells], weight.ravel()[cells].astype(np.float32)))
    return found


def into_local(normal: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """R^T n: normals (K, D) of the domain in the exemplar's coordinates.

    axes   (K, 2) the local x axes in 2-D (`synth.motion.local_axes`), or matrices (K, D, D) whose columns are the
           local axes
    """
    if axes.ndim == 3:
        return np.einsum("kij,ki->kj", axes, normal)
    along = axes[:, 0] * normal[:, 0] + axes[:, 1] * normal[:, 1]
    across = axes[:, 0] * normal[:, 1] - axes[:, 1] * normal[:, 0]
    return np.stack([along, across], axis=-1)


def impose_reference(x: np.ndarray, walls: Walls, normal: np.ndarray, hold: np.ndarray) -> np.ndarray:
    """Specification of `Constraint.impose`; normal (K, D) in the exemplar's coordinates."""
    flat = x.reshape(-1, x.shape[-1]).copy()
    held = 1 + hold.ravel()[walls.cells]
    near = flat[walls.cells]
    missing = walls.target - np.sum(near * normal, axis=-1)
    flat[walls.cells] = near + (walls.weight / (held + walls.weight) * missing)[:, None] * normal
    return flat.reshape(x.shape)


class Constraint:
    """Eq. 3 on one level in one axes, on the device.

    axes   (*shape, 2) local x axes or (*shape, D, D) matrices of the level's cells, margins and all
    """

    def __init__(self, walls: Walls, axes: np.ndarray):
        dimension = walls.normal.shape[1]
        self._count = len(walls.cells)
        if not self._count:
            return
        at = axes.reshape(-1, *axes.shape[dimension:])[walls.cells]
        self._walls = [opencl.to_device(a) for a in (
            walls.cells, into_local(walls.normal, at).astype(np.float32), walls.target, walls.weight)]
        self._dimension = dimension

    def impose(self, x: Any, hold: Any) -> None:
        """Add E_n to the minimum x (*shape, D) of E_t + O(x), whose weights are 1 and hold (*shape); device arrays.

        x is changed in place; a cell of it may have a last component that is not used.
        """
        if self._count:
            program = opencl.program(Path(__file__).with_suffix(".cl"), DIMENSION=self._dimension, STRIDE=x.shape[-1])
            program.impose((self._count,), None, *self._walls, hold, x)
