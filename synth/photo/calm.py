"""Calm water: a clear shallow over pebbles, a bay with rocks, a lake that mirrors its far shore.

Two seas of waves, one turned against the other and of another scale, so that no repeat shows. All repeat after T.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import ndimage

from synth import opencl
from synth.photo import rock
from synth.photo.carried import sampled
from synth.photo.clip import Clip, eight_bit, film
from synth.photo.sea import sea
from synth.photo.surface import lit_along, reflected
from synth.photo.tiles import noise, rng, smooth_step

TILE = 192
HORIZON = 1.12  # height of a lake's horizon, shares of the picture's height


class Waves(NamedTuple):
    """slopes (2, T, Y, X) float32 along x and y of the plane; travel (2,): their pattern's velocity, pixels a frame."""

    slopes: np.ndarray
    travel: np.ndarray


def waves(places: np.ndarray, frames: int, seed: int, *, direction: float, length: float, gravity: float,
          slope: float, spread: float = 3.0) -> Waves:
    """Slopes of waves at places (Y, X, 2: x, y) of the plane, pixels.

    direction  they travel, radians; the other arguments as `sea.sea`, in pixels of the plane
    """
    y, x = np.mgrid[: places.shape[0], : places.shape[1]]
    displacement = opencl.to_device((places - np.stack([x, y], -1)).astype(np.float32))
    total = np.zeros((2, frames, *places.shape[:2]), np.float32)
    travel = np.zeros(2)
    for k, (turn, scale, share) in enumerate(((0.3, 0.9, 0.75), (-0.4, 0.55, 0.66))):
        c, s = np.cos(turn), np.sin(turn)
        A = scale * np.array([[c, s], [-s, c]])
        tile = sea(TILE, frames, rng(seed, k), length=length, wind=direction - turn, gravity=gravity * scale,
                   slope=slope * share, spread=spread)
        phases = np.zeros((frames, 1, 3), np.float32)
        phases[..., 2] = 1
        both = np.stack([tile.slopes(t) for t in range(frames)], 1)
        along, across = (sampled(opencl.to_device(part), displacement, phases, np.arange(frames), A)
                         for part in both)
        # a height seen in turned axes has its slopes turned back
        total[0] += np.float32(c) * along - np.float32(s) * across
        total[1] += np.float32(s) * along + np.float32(c) * across
        travel += share**2 * np.linalg.solve(A, tile.travel())
    return Waves(total, travel / (0.75**2 + 0.66**2))


def shallow(seed: int, frames: int, size: tuple[int, int], *, direction: float = 0.4, length: float = 46.0,
            pebble: float = 24.0, depth: float = 14.0) -> Clip:
    """A clear shallow from above: pebbles about `pebble` pixels wide, bent by waves `depth` pixels above them."""
    shape = size[1], size[0]
    scale = shape[0] / 240
    y, x = np.mgrid[: shape[0], : shape[1]].astype(np.float32)
    sea_ = waves(np.stack([x, y], -1), frames, seed + 1, direction=direction, length=length * scale,
                 gravity=0.22 * scale, slope=0.11)
    bed = rock.pebbles(shape, rng(seed, 31), pebble * scale)
    bed = bed * (1 + 0.12 * noise(shape, rng(seed, 32), 90 * scale, falloff=1.5))
    luma = np.empty((frames, *shape), np.uint8)
    deep = depth * scale
    for t in range(frames):
        sx, sy = sea_.slopes[:, t]
        bent = 0.25 * deep * sx, 0.25 * deep * sy
        seen = ndimage.map_coordinates(bed, [y - bent[1], x - bent[0]], order=1, mode="nearest")
        focus = ndimage.gaussian_filter(np.gradient(sx, axis=1) + np.gradient(sy, axis=0), 1.2 * scale)
        light = 1 / np.clip(1 + 0.9 * deep * focus, 0.35, 3)
        mirrored = reflected(sx, sy, 0.10, lit_along(direction))
        luma[t] = eight_bit(film(1.1 * seen * (0.55 + 0.45 * light) + 0.35 * (mirrored - 0.02)))
    return Clip(luma, np.broadcast_to(sea_.travel, (*shape, 2)).astype(np.float32), np.ones(shape, np.float32))


def bay(seed: int, frames: int, size: tuple[int, int], *, direction: float = 0.8, length: float = 60.0,
        slope: float = 0.26, stones: int = 3) -> Clip:
    """Water of a bay from above, with glints, rocks, and lanes where the wind leaves it smooth."""
    shape = size[1], size[0]
    scale = shape[0] / 240
    random = rng(seed, 33)
    y, x = np.mgrid[: shape[0], : shape[1]].astype(np.float32)
    sea_ = waves(np.stack([x, y], -1), frames, seed + 1, direction=direction, length=length * scale,
                 gravity=0.25 * scale, slope=slope, spread=2.0)
    lanes = smooth_step(-1.2, 0.4, noise(shape, random, (110 * scale, 50 * scale), falloff=1.6))
    centres = random.random((stones, 2)) * shape[::-1]
    standing = rock.stones(shape, random, centres, random.uniform(12, 34, stones) * scale)
    wash = 3.0 * scale * noise(shape, random, 18 * scale, falloff=0.8)
    weed = 0.042 * noise(shape, random, 26 * scale, falloff=0.7, finest=3)  # on the bed, seen through the water
    shoal = weed + 0.08 * smooth_step(12 * scale, 0, standing.distance)
    luma = np.empty((frames, *shape), np.uint8)
    wet = np.zeros(shape, np.float32)
    for t in range(frames):
        sx, sy = sea_.slopes[:, t] * (0.35 + 0.65 * lanes)
        water = reflected(sx, sy, 0.2, lit_along(direction)) + shoal
        rise = ndimage.gaussian_filter(sx * np.cos(direction) + sy * np.sin(direction), 2) * 8 * scale
        reach = standing.distance - wash * 0.3 - rise
        foam = 0.7 * np.exp(-np.abs(reach) / (1.6 * scale)) * smooth_step(-0.5, 1.0, wash / (3 * scale))
        dry = smooth_step(0.8, -0.8, reach)
        grey = water + (0.9 - water) * foam
        luma[t] = eight_bit(film(grey + (standing.grey - grey) * dry))
        wet += 1 - dry
    coverage = wet / frames
    return Clip(luma, (sea_.travel * (coverage > 0.5)[..., None]).astype(np.float32), coverage)


def lake(seed: int, frames: int, size: tuple[int, int], *, direction: float = -1.2, length: float = 34.0,
         slope: float = 0.05) -> Clip:
    """A lake seen from its shore, which mirrors trees and the sky above them."""
    shape = size[1], size[0]
    scale = shape[0] / 240
    # two samples in each pixel, one over the other: the mirror image is drawn apart along y
    y, x = np.mgrid[: 2 * shape[0], : shape[1]].astype(np.float32)
    y = (y - 0.5) / 2
    places = _plane(x - shape[1] / 2, HORIZON * shape[0] - y, scale)
    sea_ = waves(places, frames, seed + 1, direction=direction, length=length * scale, gravity=0.2 * scale,
                 slope=slope, spread=2.0)
    stretch = 2 * np.abs(np.gradient(places[..., 1], axis=0))
    calmed = np.minimum(1, 2.5 / stretch)  # waves finer than the pixels that see them cancel
    shore = ndimage.gaussian_filter(_shore(shape, rng(seed, 34)), 0.7, mode="wrap")
    row, column = 2.2 * shape[0], 0.5 * shape[1]
    luma = np.empty((frames, *shape), np.uint8)
    for t in range(frames):
        sx, sy = sea_.slopes[:, t] * calmed
        # a facet that leans towards the viewer mirrors what stands higher
        up = np.clip((HORIZON - 0.02) * shape[0] - y + row * sy, 0, len(shore) - 1.01)
        seen = ndimage.map_coordinates(shore, [up, x + column * sx], order=1, mode="grid-wrap")
        grey = 0.05 + seen * np.clip(0.75 + 0.25 * y / shape[0] - 2.0 * sy, 0.4, 1)
        luma[t] = eight_bit(0.5 * (grey[::2] + grey[1::2]))
    by_row, by_column = (np.gradient(places, axis=axis) for axis in (0, 1))
    jacobian = np.stack([by_column, 2 * by_row], -1)[::2]  # of the plane by the picture
    velocity = np.linalg.solve(jacobian, np.broadcast_to(sea_.travel, (*shape, 2))[..., None])[..., 0]
    return Clip(luma, velocity.astype(np.float32), np.ones(shape, np.float32))


def _plane(x: np.ndarray, below: np.ndarray, scale: float) -> np.ndarray:
    """Where on a lake the viewer looks, (Y, X, 2: across, away), pixels of the plane.

    x, below  pixels from the middle of the picture, and under the horizon; 160 scales under it a pixel of the plane is
              as wide as one of the picture
    """
    return np.stack([x * 160 * scale / below, 21120 * scale**2 / below], -1)


def _shore(shape: tuple[int, int], random: np.random.Generator) -> np.ndarray:
    """A far shore (2 Y, X), row 0 at the water: trunks, crowns, gaps, and a bright sky above."""
    rows, columns = 2 * shape[0], shape[1]
    scale = shape[0] / 240
    y = np.arange(rows)[:, None] / shape[0]
    tops = 0.45 + 0.13 * noise((4, columns), random, (60 * scale, 4), falloff=0.8, finest=1)[0]
    crowns = noise((rows, columns), random, 26 * scale, falloff=0.7)
    trunks = noise((4, columns), random, (16 * scale, 4), falloff=0.2, finest=1)[0]
    gaps = smooth_step(0.5, 1.6, trunks) * smooth_step(0.5, 0.1, y)
    wood = 0.13 + 0.05 * crowns + 0.06 * trunks + 0.35 * gaps
    sky = 0.62 + 0.25 * np.clip(y - 0.4, 0, 1) + 0.05 * noise((rows, columns), random, 80 * scale, falloff=1.5)
    above = smooth_step(-0.04, 0.04, y + 0.03 * crowns - tops)
    return np.clip(wood * (1 - above) + sky * above, 0.02, 0.95).astype(np.float32)
