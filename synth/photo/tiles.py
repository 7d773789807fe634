"""Tiles: textures that continue on their other side, from which clips take what is carried, emitted or stands still.

A tile is (N, M) float32, row 0 the lowest. Noise has mean 0 and standard deviation 1.
"""

from __future__ import annotations

import numpy as np
from scipy import fft, ndimage, spatial


def rng(*key: int) -> np.random.Generator:
    """Random numbers of a key of up to four integers, the same on every machine."""
    words = [k & 0xFFFFFFFF for k in key] + [0] * (4 - len(key))
    return np.random.Generator(np.random.Philox(key=[words[0] << 32 | words[1], words[2] << 32 | words[3]]))


def noise(shape: tuple[int, int], random: np.random.Generator, size: tuple[float, float] | float, *,
          falloff: float = 1.0, finest: float = 2.0) -> np.ndarray:
    """Gaussian noise of octaves: flat up to the largest features, falling with frequency beyond them.

    size     of the largest features along (x, y), texels
    falloff  power of the frequency by which amplitudes of octaves fall: 0 all alike, 1 like clouds, 2 smooth
    finest   features below this many texels are left out
    """
    along_x, along_y = (size, size) if isinstance(size, (int, float)) else size
    fx = np.fft.rfftfreq(shape[1]) * along_x
    fy = np.fft.fftfreq(shape[0])[:, None] * along_y
    f = np.hypot(fx, fy)
    absolute = np.hypot(np.fft.rfftfreq(shape[1]), np.fft.fftfreq(shape[0])[:, None])
    # an octave holds f^2 frequencies, so amplitude f^-(1 + falloff) gives it f^-falloff
    gain = np.maximum(f, 1.0) ** -(1 + falloff) * np.exp(-((absolute * finest) ** 4))
    gain[0, 0] = 0
    spectrum = fft.rfft2(random.standard_normal(shape)) * gain
    tile = fft.irfft2(spectrum, s=shape)
    return np.ascontiguousarray(tile / tile.std(), np.float32)


def cells(shape: tuple[int, int], random: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Distances, in texels, from each texel to the nearest and second nearest of `count` random points."""
    box = np.array(shape[::-1], float)
    tree = spatial.cKDTree(random.random((count, 2)) * box, boxsize=box)
    y, x = np.mgrid[: shape[0], : shape[1]]
    d, _ = tree.query(np.stack([x + 0.5, y + 0.5], -1).reshape(-1, 2), k=2)
    first, second = d.T.reshape(2, *shape).astype(np.float32)
    return first, second


def lace(n: int, random: np.random.Generator, size: float) -> np.ndarray:
    """Foam as it lies on water: walls between holes of three sizes, (n, n), mean 0 and deviation 1.

    size  of the largest holes, texels; high values lie on the walls, so a threshold that rises thins the foam
    """
    bent = 0.16 * size * np.stack([noise((n, n), random, 1.6 * size, falloff=1.2) for _ in range(2)])
    total = np.zeros((n, n), np.float32)
    for octave, gain in enumerate((1.0, 0.7, 0.45)):
        scale = size / 2**octave
        first, second = cells((n, n), random, round((n / scale) ** 2))
        total += gain * np.exp(-(second - first) / (0.16 * scale))
    bent_walls = _moved(total, bent)
    return normal(bent_walls + 0.25 * noise((n, n), random, 3 * size, falloff=0.6))


def normal(tile: np.ndarray) -> np.ndarray:
    """The tile with mean 0 and deviation 1, float32."""
    return np.ascontiguousarray((tile - tile.mean()) / tile.std(), np.float32)


def _moved(tile: np.ndarray, by: np.ndarray) -> np.ndarray:
    """The tile at each texel plus by (2: x, y), bilinear."""
    y, x = np.mgrid[: tile.shape[0], : tile.shape[1]]
    return ndimage.map_coordinates(tile, [y + by[1], x + by[0]], order=1, mode="grid-wrap").astype(np.float32)


def smooth_step(low: float, high: float, x: np.ndarray) -> np.ndarray:
    """From 0 at `low` to 1 at `high`, level beyond, with level ends."""
    t = np.clip((x - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


def enlarged(values: np.ndarray, factor: int, shape: tuple[int, int]) -> np.ndarray:
    """Values (..., y, x) float32 of every factor-th pixel on all pixels of `shape` (Y, X), bilinear."""
    for axis, n in ((-2, shape[0]), (-1, shape[1])):
        old = values.shape[axis]
        position = np.clip((np.arange(n) + 0.5) / factor - 0.5, 0, old - 1)
        base = np.minimum(position.astype(int), max(old - 2, 0))
        part = (position - base).astype(np.float32)
        part = part[:, None] if axis == -2 else part
        values = values.take(base, axis) * (1 - part) + values.take(base + (old > 1), axis) * part
    return values
