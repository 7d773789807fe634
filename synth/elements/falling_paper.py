"""Scraps of paper tossed by a gust: the coarse motion C of sheets (ma13 figure 13c), each flat and moving as a whole.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial import cKDTree

from synth.elements.samples import Elements

STEPS = 4  # simulation steps per frame at 24 frames per second
REACH = 1.15  # distance that scraps keep from one another, in their widths
RESPONSE = 0.22  # seconds in which a scrap takes on the wind's velocity
FALL = 1.6  # widths per second that a scrap sinks in still air
PUSH = 30.0  # widths per s²: of two scraps in one place
RISE, WHIRL = 9.0, 11.0  # widths per second of the gust, upwards and around
GUSTY = 2.0  # of its eddies, rms
TUMBLE = 2.4  # radians per second about each axis in the gust, rms
LULL = 0.9  # share of the clip after which the gust is over


def tossed(count: int = 300, frames: int = 60, *, side: int = 7, spacing: float = 1.0, thickness: float = 0.02,
           rate: float = 24.0, seed: int = 0) -> Elements:
    """A loose heap of scraps that a whirlwind lifts, carries round and lets sink again.

    count      scraps, 1 to 5000; they lie in a round heap on y = 0, y up, its axis x = z = 0
    side       samples in a row and in a column of a scrap; spacing of them, and thickness, world units
    Scraps follow the wind with a lag, are pushed away from one another and from the ground, and tumble, more in
    stronger wind. The wind is a rising, rotating column, as wide as the heap, with eddies; it starts and ends
    smoothly. Positions are those of flat sheets, row by row, and are their own `coarse`; colours are of paper. Raises
    ValueError for numbers out of these ranges.
    """
    if not 1 <= count <= 5000 or frames < 2 or side < 2:
        raise ValueError("1 to 5000 scraps of 2 × 2 samples or more are tossed over 2 frames or more, not "
                         f"{count} of {side} × {side} over {frames}")
    if not (spacing > 0 and thickness > 0 and np.isfinite(rate) and rate > 0):
        raise ValueError(f"spacing, thickness and rate are above 0, not {spacing}, {thickness} and {rate}")
    rng = np.random.Generator(np.random.Philox(key=seed))
    width = spacing * (side - 1)
    centre, axes = _flight(count, frames, rate, rng)
    along = (np.arange(side) - (side - 1) / 2) * spacing
    x, y = (axis.ravel() for axis in np.meshgrid(along, along))
    flat = np.stack([x, y, np.zeros_like(x)], -1)
    positions = (centre[:, :, None] * width + np.einsum("sk,teck->tesc", flat, axes)).astype(np.float32)
    tint = np.array([[0.95, 0.93, 0.87], [0.93, 0.93, 0.93], [0.88, 0.91, 0.95], [0.96, 0.88, 0.80]])
    colour = tint[rng.integers(len(tint), size=count)] * np.exp(rng.normal(0, 0.03, (count, 1)))
    return Elements(positions, (side, side), rate, size=np.full(count, thickness), colour=colour.clip(0, 1),
                    coarse=positions)


def _flight(count: int, frames: int, rate: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Centres (frames, E, 3), widths, and axes (frames, E, 3, 3) of the scraps, as columns."""
    place = _heap(count, rng)
    broad = np.linalg.norm(place[:, [0, 2]], axis=1).max() + 1
    velocity = np.zeros_like(place)
    rotation = _flat_or_so(count, rng)
    pace, phase = 2 * np.pi * rng.uniform(0.2, 0.7, (2, count, 3)), rng.uniform(0, 2 * np.pi, (2, count, 3))
    eddies = _eddies(rng, broad)
    steps = max(1, int(np.ceil(STEPS * 24 / rate)))
    step, last = 1 / (rate * steps), (frames - 1) / rate
    centres, axes = np.empty((frames, count, 3)), np.empty((frames, count, 3, 3))
    for k in range((frames - 1) * steps + 1):
        if k % steps == 0:
            centres[k // steps], axes[k // steps] = place, _matrices(rotation)
        time = k * step
        begun = _smooth(time / min(0.6, last))  # the heap lies as it is until then
        blows = begun * (1 - _smooth((time / last - 0.45) / (LULL - 0.45)))
        wind = blows * (_column(place, broad) + eddies(place, time))
        wind[:, 1] -= FALL * begun
        push = begun * _repulsion(place)
        push[:, 1] += begun * PUSH * np.clip(0.7 - place[:, 1], 0, None) / 0.7
        velocity += step * ((wind - velocity) / RESPONSE + push)
        place = place + step * velocity
        # in the air a scrap tumbles freely; near the ground it settles
        aloft = _smooth((place[:, 1] - 0.4) / 1.5)[:, None] * (0.25 + 0.75 * blows)
        spin = TUMBLE * aloft * np.sin(pace * time + phase).sum(0)
        spin[:, 1] -= blows * aloft[:, 0] * WHIRL / broad
        rotation = _rotated(rotation, spin * step)
    return centres, axes


def _smooth(share: np.ndarray | float) -> np.ndarray:
    """0 to 1 over shares 0 to 1, with two continuous derivatives."""
    s = np.clip(share, 0, 1)
    return s**3 * (10 + s * (6 * s - 15))


def _heap(count: int, rng: np.random.Generator) -> np.ndarray:
    """Centres (E, 3) in a flat heap: a grid, disturbed, those places that are nearest to its middle."""
    reach = int(np.ceil((count / 2) ** (1 / 3))) + 2
    grid = np.stack(np.meshgrid(*[np.arange(-2 * reach, 2 * reach + 1)] * 2, np.arange(reach), indexing="ij"), -1)
    x, z, y = grid.reshape(-1, 3).T * 1.1
    x, z = x + 0.55 * (np.rint(y / 1.1) % 2), z + 0.55 * (np.rint(y / 1.1) % 2)
    place = np.stack([x, 0.7 + 0.75 * y, z], 1)
    nearest = np.argsort(((place * [1, 3.2, 1]) ** 2).sum(1), kind="stable")[:count]
    return place[nearest] + rng.uniform(-0.12, 0.12, (count, 3)) * [1, 0.5, 1]


def _flat_or_so(count: int, rng: np.random.Generator) -> np.ndarray:
    """Rotations (E, 4), as quaternions, of scraps that lie on the heap: normals within some 25 degrees of up."""
    upright = _quaternions(np.tile([-np.pi / 2, 0.0, 0.0], (count, 1)))  # from +z to +y
    spun = _quaternions(np.stack([np.zeros(count), rng.uniform(0, 2 * np.pi, count), np.zeros(count)], 1))
    return _product(_quaternions(rng.normal(0, 0.25, (count, 3)) * [1, 0, 1]), _product(spun, upright))


def _column(place: np.ndarray, broad: float) -> np.ndarray:
    """The gust (E, 3), widths per second: it rises in the middle, rotates around it, and flows in below."""
    r = np.linalg.norm(place[:, [0, 2]], axis=1, keepdims=True) / broad
    core = np.exp(-1.2 * r * r)
    out = place[:, [0, 2]] / broad
    draw = -2.5 * np.exp(-place[:, 1:2] / (0.6 * broad)) * core
    swirl = WHIRL * core
    return np.concatenate([draw * out[:, :1] + swirl * out[:, 1:], RISE * core * np.exp(-place[:, 1:2] / (2 * broad)),
                           draw * out[:, 1:] - swirl * out[:, :1]], 1)


def _eddies(rng: np.random.Generator, broad: float) -> Callable[[np.ndarray, float], np.ndarray]:
    """Velocities (E, 3) at places (E, 3) and a time, of rms GUSTY: travelling waves across their directions."""
    size = np.geomspace(1.5 * broad, 2.5, 8)
    wave = rng.normal(size=(8, 3))
    wave *= (2 * np.pi / size / np.linalg.norm(wave, axis=1))[:, None]
    across = np.cross(wave, rng.normal(size=(8, 3)))
    across *= GUSTY / 2 / np.linalg.norm(across, axis=1, keepdims=True)
    pace, phase = 2 * np.pi * rng.uniform(0.2, 0.6, 8), rng.uniform(0, 2 * np.pi, 8)
    return lambda place, time: np.sin(place @ wave.T - pace * time + phase) @ across


def _repulsion(place: np.ndarray) -> np.ndarray:
    """Accelerations (E, 3) of scraps away from those that are near."""
    pairs = cKDTree(place).query_pairs(REACH, output_type="ndarray")
    pairs = pairs[np.lexsort(pairs.T)]  # one order of the sums
    between = place[pairs[:, 0]] - place[pairs[:, 1]]
    distance = np.maximum(np.linalg.norm(between, axis=1, keepdims=True), 1e-6)
    force = PUSH * (1 - distance / REACH) * between / distance
    push = np.zeros_like(place)
    np.add.at(push, pairs[:, 0], force)
    np.add.at(push, pairs[:, 1], -force)
    return push


def _quaternions(vectors: np.ndarray) -> np.ndarray:
    """Quaternions (E, 4), scalar first, of rotation vectors (E, 3)."""
    angle = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.concatenate([np.cos(angle / 2), np.sinc(angle / (2 * np.pi)) / 2 * vectors], 1)


def _product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Products (E, 4) of quaternions: first b, then a."""
    return np.concatenate([a[:, :1] * b[:, :1] - (a[:, 1:] * b[:, 1:]).sum(1, keepdims=True),
                           a[:, :1] * b[:, 1:] + b[:, :1] * a[:, 1:] + np.cross(a[:, 1:], b[:, 1:])], 1)


def _rotated(rotation: np.ndarray, by: np.ndarray) -> np.ndarray:
    """Quaternions (E, 4) rotated by rotation vectors (E, 3), world axes."""
    rotation = _product(_quaternions(by), rotation)
    return rotation / np.linalg.norm(rotation, axis=1, keepdims=True)


def _matrices(rotation: np.ndarray) -> np.ndarray:
    """Rotation matrices (E, 3, 3) of quaternions (E, 4)."""
    w, x, y, z = rotation.T
    return np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
                     2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                     2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], -1).reshape(-1, 3, 3)
