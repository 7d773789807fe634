"""Constraints of the output, Θ of Eq. 5 (ma13 §4.1): the domain of elements, and hard positions.

Each kind adds anchors to the assignment step (soft) and may correct positions after it (hard).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from synth.elements.assignment import Anchors
from synth.elements.neighborhood import wrapped

CORNERS = 4  # times that a sample is moved to the nearest border: in a corner it is then beyond another
PULL = 4.0  # weight of a sample that is out of its domain, in terms of Eq. 7


@dataclass(frozen=True)
class Domain:
    """Where samples may be: a signed distance on a grid, positive inside.

    inside  (Y, X) or (Z, Y, X) float32, world units; cell centres at origin + cell * (x, y[, z])
    cell    edge of a cell, world units
    origin  (D,) position of the first cell's centre
    period  (D,) along axes where the grid repeats, 0 along those where it ends; None: it ends along all
    """

    inside: np.ndarray
    cell: float
    origin: np.ndarray
    period: np.ndarray | None = None

    def wrapped(self, points: np.ndarray) -> np.ndarray:
        """The points wrapped into the period that the grid covers."""
        low = self.origin - self.cell / 2
        return low + wrapped(points - low, self.period)

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Signed distance to the border at points (M, D), positive inside."""
        return self._sampled(self.inside, points) - self._beyond(points)

    def slope(self, points: np.ndarray) -> np.ndarray:
        """Unit vectors towards the inside at points, (M, D)."""
        gradient = [self._sampled(g, points) for g in list(np.gradient(self.inside.astype(np.float64)))][::-1]
        direction = np.stack(gradient, axis=-1)
        return direction / np.maximum(np.linalg.norm(direction, axis=-1, keepdims=True), 1e-9)

    def _sampled(self, values: np.ndarray, points: np.ndarray) -> np.ndarray:
        at = ((self.wrapped(points) - self.origin) / self.cell)[:, ::-1].T
        return ndimage.map_coordinates(values, at, order=1, mode="nearest")

    def _beyond(self, points: np.ndarray) -> np.ndarray:
        """How far points lie beyond the outermost cells' centres, (M,)."""
        at = (self.wrapped(points) - self.origin) / self.cell
        last = np.array(self.inside.shape[::-1]) - 1
        away = at - np.clip(at, 0, last)
        if self.period is not None:
            away[:, self.period > 0] = 0.0
        return self.cell * np.linalg.norm(away, axis=1)

    def outside(self, points: np.ndarray, margin: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Indices of the points nearer than `margin` to the border or beyond it, and where each would be inside."""
        distance = self.distance(points)
        out = np.nonzero(distance < margin)[0]
        return out, points[out] + (margin - distance[out])[:, None] * self.slope(points[out])


@dataclass(frozen=True)
class Pins:
    """Hard positions: in `frame` (P,) int the sample `sample` (P,) int of that frame is at `position` (P, D)."""

    frame: np.ndarray
    sample: np.ndarray
    position: np.ndarray


@dataclass(frozen=True)
class Constraints:
    """All constraints of an output.

    domain   where samples stay; obstacles are holes in it
    margin   distance from its border that samples keep, world units
    pins     hard positions
    hard     samples outside after an assignment are moved to the border; else they are only pulled
    """

    domain: Domain | None = None
    margin: float = 0.0
    pins: Pins | None = None
    hard: bool = True

    def anchors(self, positions: np.ndarray, first: int) -> Anchors:
        """Soft terms for the samples (M, D) whose first has the index `first`."""
        if self.domain is None:
            return Anchors.none(positions.shape[1])
        out, target = self.domain.outside(positions, self.margin)
        return Anchors(out + first, target, np.full(len(out), PULL))

    def enforced(self, positions: np.ndarray) -> np.ndarray:
        """Positions (M, D), those outside moved to the border if the constraint is hard."""
        if self.domain is None or not self.hard:
            return positions
        result = positions.copy()
        for _ in range(CORNERS):
            out, target = self.domain.outside(result, self.margin)
            if not len(out):
                break
            result[out] = target
        return result
