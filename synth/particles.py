"""Particles carried by the final motion F (ma09 figure 7: "direct rendering from the final motion fields F").

A particle lives a fixed number of frames and is then placed anywhere in the flow, so that the flow stays evenly filled
whatever its divergence; one that leaves is placed where the flow enters. None is ever inside an obstacle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from synth.obstacle import outward

# steps of the Runge-Kutta integration in a frame: in one frame a particle covers much of a small swirl
STEPS = 2
# a particle is kept at least this far from a wall, cells
CLEAR = 0.3


@dataclass(frozen=True)
class Particles:
    """position (N, D) float32, cells, components x, y[, z]; velocity (N, D) float32, cells per frame; age (N,) int32,
    frames since it was born."""

    position: np.ndarray
    velocity: np.ndarray
    age: np.ndarray


def sampled(field: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Linear samples of field (*shape[, D]) at positions (N, D), cells; edges repeat. (N[, D]) float32."""
    at = position.T[::-1]
    if field.ndim == position.shape[1]:
        return ndimage.map_coordinates(field, at, order=1, mode="nearest").astype(np.float32)
    return np.stack([ndimage.map_coordinates(field[..., c], at, order=1, mode="nearest")
                     for c in range(field.shape[-1])], axis=-1).astype(np.float32)


def start(F: np.ndarray, count: int, life: int, seed: int, distance: np.ndarray | None = None) -> Particles:
    """`count` particles anywhere in the flow of the first frame F (*shape, D), of all ages below `life` frames.

    distance  cells to the wall of an obstacle, negative inside
    """
    random = np.random.Generator(np.random.Philox(key=[seed, 0]))
    position = _anywhere(count, F.shape[:-1], distance, random)
    age = random.integers(0, life, count).astype(np.int32)
    return Particles(position, sampled(F, position), age)


def moved(particles: Particles, before: np.ndarray, after: np.ndarray, life: int, frame: int, seed: int,
          distance: np.ndarray | None = None) -> Particles:
    """The particles a frame later, when the motion has gone from F `before` to F `after` (*shape, D), cells per frame.

    Runge-Kutta of fourth order in STEPS steps, F linear in time and space. `frame` is the number of the frame after;
    the random numbers are counted by it. The others as `start`.
    """
    shape = after.shape[:-1]
    position = particles.position
    for step in range(STEPS):
        times = (step / STEPS, (step + 0.5) / STEPS, (step + 1) / STEPS)
        motions = [(np.float32((1 - t) / STEPS) * before + np.float32(t / STEPS) * after) for t in times]
        k1 = sampled(motions[0], position)
        k2 = sampled(motions[1], position + k1 / 2)
        k3 = sampled(motions[1], position + k2 / 2)
        k4 = sampled(motions[2], position + k3)
        position = position + (k1 + 2 * k2 + 2 * k3 + k4) / 6
        position = _kept_out(position, distance)
    random = np.random.Generator(np.random.Philox(key=[seed, frame]))
    age = particles.age + 1
    last = np.array(shape[::-1]) - 0.5
    left = ((position < -0.5) | (position > last)).any(axis=-1)
    if distance is not None:  # pushed from one wall into another
        left |= sampled(distance, position) < 0
    old = ~left & (age >= life)
    position = position.copy()
    position[left] = _coming_in(int(left.sum()), after, distance, random)
    position[old] = _anywhere(int(old.sum()), shape, distance, random)
    age[old] = 0
    age[left] = random.integers(0, life, int(left.sum()))  # as if they had entered from outside
    return Particles(position.astype(np.float32), sampled(after, position), age.astype(np.int32))


def _kept_out(position: np.ndarray, distance: np.ndarray | None) -> np.ndarray:
    """Positions no nearer to a wall than CLEAR: pushed out along the slope of the distance."""
    if distance is None:
        return position
    near = sampled(distance, position) < CLEAR
    if near.any():
        position = position.copy()
        normal = outward(distance)
        for _ in range(3):  # the distance is only nearly linear
            inside = position[near]
            missing = np.maximum(CLEAR - sampled(distance, inside), 0)
            position[near] = inside + missing[:, None] * sampled(normal, inside)
    return position


def _anywhere(count: int, shape: tuple[int, ...], distance: np.ndarray | None,
              random: np.random.Generator) -> np.ndarray:
    """Positions (count, D) float32, even over the domain outside the obstacle."""
    found = np.zeros((0, len(shape)), np.float32)
    while len(found) < count:
        tried = (random.random((max(64, 2 * count), len(shape))) * shape[::-1] - 0.5).astype(np.float32)
        if distance is not None:
            tried = tried[sampled(distance, tried) > CLEAR]
        found = np.concatenate([found, tried])
    return found[:count]


def _coming_in(count: int, F: np.ndarray, distance: np.ndarray | None, random: np.random.Generator) -> np.ndarray:
    """Positions (count, D) float32 just inside the border, in proportion to the inflow there.

    Anywhere if there is no inflow.
    """
    shape = F.shape[:-1]
    dimension = len(shape)
    cells = np.indices(shape).reshape(dimension, -1).T[:, ::-1]  # x, y[, z] of each
    velocity = F.reshape(-1, dimension)
    free = np.ones(len(cells), bool) if distance is None else distance.ravel() > CLEAR + 0.7
    inflow, places, sides = [], [], []
    for component in range(dimension):
        for side, inward in ((0, 1), (shape[::-1][component] - 1, -1)):
            there = np.flatnonzero((cells[:, component] == side) & free)
            inflow.append(np.maximum(inward * velocity[there, component], 0))
            places.append(there)
            sides.append(np.full(len(there), component))
    amount, place, side_of = (np.concatenate(parts) for parts in (inflow, places, sides))
    if amount.sum() <= 0:
        return _anywhere(count, shape, distance, random)
    summed = np.cumsum(amount, dtype=np.float64)
    chosen = np.searchsorted(summed, random.random(count) * summed[-1], side="right")
    chosen = np.minimum(chosen, len(place) - 1)
    # from the border, as far inside as the flow carries it in the time since it crossed
    position = cells[place[chosen]] + random.random((count, dimension)) - 0.5
    rows, across = np.arange(count), side_of[chosen]
    since, v = random.random(count), velocity[place[chosen]]
    position[rows, across] = np.where(v[rows, across] > 0, -0.5, np.array(shape[::-1])[across] - 0.5)
    position = position + since[:, None] * v
    return np.clip(position, -0.5, np.array(shape[::-1]) - 0.5).astype(np.float32)
