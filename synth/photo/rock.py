"""What stands still: rock faces, stones in the water, pebbles on the bed. Display-encoded grey, (Y, X) float32.

The light comes from the upper left, as on most photographs that are looked at.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import ndimage, spatial

from synth.photo.tiles import cells, noise, smooth_step

LIGHT = np.array([-0.45, 0.6, 0.66])


def lit(height: np.ndarray) -> np.ndarray:
    """How bright a matt surface of this height (Y, X), pixels, is under LIGHT: 0 in shadow, about 0.66 where level."""
    slope_y, slope_x = np.gradient(height)
    facing = LIGHT[2] - LIGHT[0] * slope_x - LIGHT[1] * slope_y
    return np.maximum(facing, 0) / np.sqrt(1 + slope_x**2 + slope_y**2)


def face(shape: tuple[int, int], random: np.random.Generator, tone: float = 0.25) -> np.ndarray:
    """A face of wet rock: broken layers, cracks and lichen; `tone` is its mean."""
    scale = shape[0] / 240
    rows, columns = np.mgrid[: shape[0], : shape[1]] / scale
    bend = 8 * noise(shape, random, 90 * scale, falloff=1.5)
    tilt = random.uniform(-0.25, 0.25)
    layers = (rows + tilt * columns + bend) / random.uniform(14, 26)
    steps = 2.2 * (layers - np.floor(layers)) ** 3  # each layer stands out over the one below
    first, second = cells(shape, random, 70)
    cracks = -1.2 * np.exp(-(second - first) / (1.6 * scale))
    rough = 1.3 * noise(shape, random, 40 * scale, falloff=0.95, finest=2)
    blocks = 0.28 * noise(shape, random, 70 * scale, falloff=0.7)
    light = lit(scale * (steps + cracks + rough)) * (1 + blocks) * (1 + 0.08 * noise(shape, random, 9 * scale))
    light = light / light.mean() * tone
    return np.clip(light, 0.02, 0.85).astype(np.float32)


class Stones(NamedTuple):
    """Stones in the water: distance (Y, X) to the nearest, pixels, negative inside; grey (Y, X) as they look."""

    distance: np.ndarray
    grey: np.ndarray


def stones(shape: tuple[int, int], random: np.random.Generator, centres: np.ndarray, radii: np.ndarray) -> Stones:
    """Rounded, broken stones at centres (n, 2: x, y), pixels, about `radii` (n,) wide, wet at the rim."""
    y, x = np.mgrid[: shape[0], : shape[1]].astype(np.float32)
    away = np.full(shape, np.hypot(*shape), np.float32)
    height = np.zeros(shape, np.float32)
    for (cx, cy), radius in zip(centres, radii, strict=True):
        wobble = noise(shape, random, 1.6 * radius, falloff=1.2)
        flat = random.uniform(0.65, 1.0)
        turn = random.uniform(0, np.pi)
        along = (x - cx) * np.cos(turn) + (y - cy) * np.sin(turn)
        across = ((y - cy) * np.cos(turn) - (x - cx) * np.sin(turn)) / flat
        distance = (np.hypot(along, across) - radius) * flat + 0.12 * radius * wobble
        inside = np.clip(-distance / radius, 0, 1)
        dome = radius * (0.9 * np.sqrt(inside * (2 - inside)))
        height = np.maximum(height, dome + (dome > 0) * 0.03 * radius * wobble)
        away = np.minimum(away, distance)
    rough = noise(shape, random, 12, falloff=0.6, finest=1.5)
    light = lit(height + 0.5 * rough) * (0.75 + 0.1 * noise(shape, random, 20, falloff=0.7))
    wet = smooth_step(1.0, 5.0, -away)  # the rim is wet, and dark
    return Stones(away, np.clip(light * (0.32 + 0.5 * wet), 0.02, 0.9).astype(np.float32))


def pebbles(shape: tuple[int, int], random: np.random.Generator, size: float) -> np.ndarray:
    """A bed of pebbles about `size` pixels wide, each of its own grey."""
    total = np.full(shape, 0.12, np.float32)
    for scale in (0.4, 1.0):
        count = max(4, round(shape[0] * shape[1] / (scale * size) ** 2))
        box = np.array(shape[::-1], float)
        points = random.random((count, 2)) * box
        greys = random.uniform(0.2, 0.75, count)
        y, x = np.mgrid[: shape[0], : shape[1]]
        bent = noise(shape, random, 1.2 * size, falloff=1.0)
        where = np.stack([x + 1.2 * bent, y - 1.2 * bent], -1).reshape(-1, 2) % box
        d, nearest = spatial.cKDTree(points, boxsize=box).query(where, k=2)
        gap = (d[:, 1] - d[:, 0]).reshape(shape).astype(np.float32)
        body = smooth_step(0.06 * size, 0.3 * size, gap)
        dome = 0.5 * scale * size * np.sqrt(np.clip(gap / (scale * size), 0, 1))
        grey = greys[nearest[:, 0]].reshape(shape) * (0.45 + 0.85 * lit(ndimage.gaussian_filter(dome, 0.7)))
        chosen = body if scale < 1 else body * (random.random(count)[nearest[:, 0]].reshape(shape) < 0.6)
        total = total * (1 - chosen) + chosen * grey
    grain = 1 + 0.04 * noise(shape, random, 4, falloff=0.3, finest=1.2)
    return np.clip(total * grain, 0.03, 0.95).astype(np.float32)
