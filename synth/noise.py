"""Curl noise [Bridson et al. 2007]: a divergence-free flow from the curl of a smooth random potential.

The random numbers are a hash of lattice point, seed and octave (counter-based), so any frame can be
computed alone and no order of evaluation matters.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

import numpy as np


def gradient_noise(points: Sequence[np.ndarray], seed: int) -> np.ndarray:
    """Gradient noise at `points`: one coordinate array per dimension (1 to 4), in lattice units, broadcast together.

    Returns float64 within [-1, 1], twice differentiable, zero at lattice points, features about one unit wide.
    """
    cells = [np.floor(p).astype(np.int64) for p in points]
    fraction = [p - c for p, c in zip(points, cells, strict=True)]
    fade = [t * t * t * (t * (t * 6 - 15) + 10) for t in fraction]
    total = np.zeros(np.broadcast_shapes(*(p.shape for p in points)))
    for corner in itertools.product((0, 1), repeat=len(points)):
        key = _hash([c + step for c, step in zip(cells, corner, strict=True)], seed)
        gradient = [_uniform(key, axis) for axis in range(len(points))]
        length = np.sqrt(sum(g * g for g in gradient)) + 1e-12
        weight = 1.0
        slope = 0.0
        for t, f, step, g in zip(fraction, fade, corner, gradient, strict=True):
            weight = weight * (f if step else 1 - f)
            slope = slope + g * (t - step)
        total += weight * slope / length
    return total


def curl_noise(shape: tuple[int, ...], frames: int, *, seed: int, octaves: int = 3, length: float = 0.5,
               gain: float = 0.6, speed: float = 1.0, period: float = 60.0) -> Iterator[np.ndarray]:
    """Frames of a divergence-free, slowly changing random flow [Bridson et al. 2007, §2].

    shape    (Y, X) or (Z, Y, X) cells
    octaves  number of octaves; each has half the size and `gain` times the speed of the one before
    length   size of the largest features, world units (the domain is 1 high)
    speed    rms speed of the first frame, cells per frame
    period   frames in which the largest features change completely; it halves with each octave, as the size does
    Yields (*shape, D) float32, cells per frame. The curl is of central differences, so the divergence by
    central differences (`projection.divergence`) vanishes to rounding everywhere but in the outermost cells.
    """
    if octaves < 1 or not length > 0 or not period > 0:
        raise ValueError("curl noise needs octaves >= 1, length > 0 and period > 0, "
                         f"not {octaves}, {length} and {period}")
    scale = None
    for frame in range(frames):
        v = _curl(shape, frame, seed, octaves, length, gain, period)
        if scale is None:
            scale = speed / max(float(np.sqrt((v * v).sum(-1).mean())), 1e-30)
        yield (v * scale).astype(np.float32)


def _curl(shape: tuple[int, ...], frame: int, seed: int, octaves: int, length: float, gain: float,
          period: float) -> np.ndarray:
    """The curl of the octaves' potentials, (*shape, D) float64, in units of their own."""
    dimension = len(shape)
    # a margin of one cell on every side, for central differences
    axes = [(np.arange(-1, n + 1) + 0.5) / shape[-2] for n in shape]
    grid = np.meshgrid(*axes, indexing="ij", sparse=True)[::-1]
    potentials = 1 if dimension == 2 else 3
    psi = np.zeros((potentials, *(n + 2 for n in shape)))
    for octave in range(octaves):
        size = length / 2**octave
        points = [g / size for g in grid] + [np.full((1,) * dimension, frame * 2**octave / period)]
        for p in range(potentials):
            # a potential of amplitude gain**octave * size has a curl of about gain**octave
            psi[p] += gain**octave * size * gradient_noise(points, _mix(seed, octave, p))
    return curl(psi)


def curl(psi: np.ndarray) -> np.ndarray:
    """Curl by central differences of a potential with a margin of one cell on every side.

    psi  (1, Y+2, X+2): v = (d psi/dy, -d psi/dx); or (3, Z+2, Y+2, X+2): the curl of the vector potential
    Returns (Y, X, 2) or (Z, Y, X, 3), per cell.
    """
    dimension = psi.ndim - 1

    def slope(p: np.ndarray, component: int) -> np.ndarray:
        axis = dimension - 1 - component
        inner = [slice(1, -1)] * dimension
        after, before = list(inner), list(inner)
        after[axis], before[axis] = slice(2, None), slice(0, -2)
        return 0.5 * (p[tuple(after)] - p[tuple(before)])

    if dimension == 2:
        return np.stack([slope(psi[0], 1), -slope(psi[0], 0)], -1)
    x, y, z = psi
    return np.stack([slope(z, 1) - slope(y, 2), slope(x, 2) - slope(z, 0), slope(y, 0) - slope(x, 1)], -1)


def _mix(*numbers: int) -> int:
    """One seed from several numbers."""
    return int(_hash([np.array(n, np.int64) for n in numbers], 0))


def _hash(counters: Sequence[np.ndarray], seed: int) -> np.ndarray:
    """A 64-bit hash of integer arrays (broadcast), by the finaliser of SplitMix64 after each."""
    with np.errstate(over="ignore"):
        h = _finalise(np.array(seed & 0xFFFFFFFFFFFFFFFF, np.uint64))  # near seeds must lie far apart
        for c in counters:
            h = _finalise((h + np.uint64(0x9E3779B97F4A7C15)) ^ c.astype(np.int64).view(np.uint64))
    return h


def _finalise(h: np.ndarray) -> np.ndarray:
    h = (h ^ (h >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    h = (h ^ (h >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return h ^ (h >> np.uint64(31))


def _uniform(key: np.ndarray, stream: int) -> np.ndarray:
    """Numbers uniform in [-1, 1), one per key; streams are independent."""
    with np.errstate(over="ignore"):
        bits = _finalise(key + np.uint64(stream + 1) * np.uint64(0x9E3779B97F4A7C15)) >> np.uint64(11)
    return bits.astype(np.float64) * 2.0**-52 - 1.0
