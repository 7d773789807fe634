"""Running water from above: white water and rivers past stones, in any direction.

Waves that stand over the bed stay where they are, and break; foam is born there and round stones, is carried along
and fades; ripples and the foam's holes are carried by the current. All repeat after T frames.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import ndimage

from synth import opencl
from synth.advect import Grid
from synth.photo import drops, rock
from synth.photo.carried import carried
from synth.photo.clip import Clip, eight_bit, film
from synth.photo.current import Current, eddies, past_stones
from synth.photo.sea import sea
from synth.photo.tiles import enlarged, lace, noise, rng, smooth_step

TILE = 192
BOTTOM = 0.05  # deviation of grey that the bed shows through the water


def lit_along(direction: float) -> float:
    """The direction of a light that shows waves which travel along `direction`: upward on the picture, radians."""
    nearly = direction + 0.4
    return nearly if np.sin(nearly) >= 0 else nearly + np.pi


def running(seed: int, frames: int, size: tuple[int, int], *, direction: float, speed: float, stones: int,
            white: float, tone: float, relief: float, ripples: float, eddying: float) -> Clip:
    """Running water.

    direction  of the current, radians counter-clockwise from x
    speed      pixels per frame at a picture 240 high
    stones     that stand in it
    white      how much of it foams: 0 hardly any, 0.5 half, 1 nearly all
    tone       grey of the deep water
    relief     steepness of the standing waves, rms slope
    ripples    steepness of the carried ripples, rms slope
    eddying    rms speed of eddies, speeds of the current
    """
    shape = size[1], size[0]
    scale = shape[0] / 240
    random = rng(seed, 11)
    U = speed * scale * np.array([np.cos(direction), np.sin(direction)])
    standing = _stones(shape, random, stones, scale)
    current = _current(shape, frames, U, standing, speed * eddying * scale, rng(seed, 12), scale)
    bed = _standing_waves(shape, rng(seed, 13), direction, scale)
    breaking = _breaking(bed, standing.distance, U, white, scale)
    density = _foam(current, breaking, frames, rng(seed, 14), scale)

    foam_tile, boil_tile, *slope_tiles = _tiles(seed, frames, direction, ripples, scale)
    # along the current foam is drawn out
    c, s = np.cos(direction), np.sin(direction)
    A = np.diag([0.75, 1.1]) @ np.array([[c, s], [-s, c]])
    bottom = BOTTOM * noise(shape, rng(seed, 19), 22 * scale, falloff=0.9, finest=4)  # stones seen through the water
    relief_y, relief_x = (relief * part for part in np.gradient(bed / _steepness(bed)))
    splashes = drops.streaks(_thrown(breaking, U, rng(seed, 18), frames, white, scale), frames, shape, 0.6)
    dry = smooth_step(0.0, -1.5, standing.distance)
    rim = np.exp(-np.maximum(standing.distance, 0) / (2.5 * scale))
    luma = np.empty((frames, *shape), np.uint8)
    for state in carried(current.velocity, frames, _period(frames)):
        t = state.frame
        walls = state.picture(foam_tile, seed + 1, A)
        lumps = state.picture(boil_tile, seed + 2)
        moving = [state.picture(tile, seed + 3, part=t) for tile in slope_tiles]
        water = reflected(relief_x + moving[0], relief_y + moving[1], tone, lit_along(direction))
        water = np.maximum(water + bottom, 0.02) * (1 - 0.35 * rim)
        foam = smooth_step(0.1, 1.6, (0.8 - 0.5 * density[t]) * walls + 0.3 * lumps + 2.8 * density[t] - 0.8)
        shade = 0.73 + 0.12 * lumps + 0.06 * walls + 0.8 * np.clip(relief_x * -0.45 + relief_y * 0.6, -0.4, 0.4)
        grey = water + foam * (np.clip(shade, 0.35, 1.1) - water)
        grey += (standing.grey - grey) * dry
        grey += (0.95 - grey) * (1 - np.exp(-ndimage.gaussian_filter(splashes[t], 0.5)))
        luma[t] = eight_bit(film(grey))
    coverage = (1 - dry).astype(np.float32)
    velocity = current.mean() * (coverage > 0.5)[..., None]
    return Clip(luma, velocity, coverage)


def _tiles(seed: int, frames: int, direction: float, ripples: float, scale: float) -> list[Any]:
    """On the device: walls of foam, light on boiling foam, and the slopes of ripples along x and y, T slices each."""
    foam = lace(256, rng(seed, 15), 20 * scale)
    boil = _lit(noise((256, 256), rng(seed, 16), 15 * scale, falloff=1.0, finest=1.5))
    waves = sea(TILE, frames, rng(seed, 17), length=44 * scale, wind=direction + 0.6, gravity=0.12 * scale,
                slope=ripples, spread=0.3, shortest=4.0)
    slopes = np.stack([waves.slopes(t) for t in range(frames)], 1)
    return [opencl.to_device(tile) for tile in (foam[None], boil[None], *slopes)]


def white_water(seed: int, frames: int, size: tuple[int, int], *, direction: float = -0.4, speed: float = 3.5,
                stones: int = 1, white: float = 0.6, tone: float = 0.14) -> Clip:
    """Rapids: standing waves that break; parameters as `running`."""
    return running(seed, frames, size, direction=direction, speed=speed, stones=stones, white=white, tone=tone,
                   relief=0.23, ripples=0.15, eddying=0.12)


def river(seed: int, frames: int, size: tuple[int, int], *, direction: float = 0.2, speed: float = 2.2,
          stones: int = 4, white: float = 0.12, tone: float = 0.14) -> Clip:
    """A river past stones; parameters as `running`."""
    return running(seed, frames, size, direction=direction, speed=speed, stones=stones, white=white, tone=tone,
                   relief=0.06, ripples=0.14, eddying=0.1)


def reflected(slope_x: np.ndarray, slope_y: np.ndarray, tone: float, towards: float) -> np.ndarray:
    """Display grey of a water surface of these slopes under a sky that is bright in the direction `towards`, radians.

    What faces away reflects dark trees, what faces the light a bright sky, and steep facets the sun.
    """
    facing = -np.float32(np.cos(towards)) * slope_x - np.float32(np.sin(towards)) * slope_y
    sky = smooth_step(-0.3, 0.5, facing)
    return 0.5 * tone + (0.42 + 0.5 * tone) * sky + 0.4 * smooth_step(0.32, 0.5, facing)


def _period(frames: int) -> int:
    """Frames after which carrying begins again: a divisor of T near 16."""
    return min((d for d in range(8, frames + 1) if frames % d == 0), key=lambda d: abs(d - 16))


def _stones(shape: tuple[int, int], random: np.random.Generator, count: int, scale: float) -> rock.Stones:
    """Stones of 8 to 30 pixels, scattered with gaps between them."""
    centres: list[np.ndarray] = []
    radii: list[float] = []
    for _ in range(40 * count):
        if len(centres) == count:
            break
        radius = scale * random.uniform(8, 30)
        centre = random.uniform(0, 1, 2) * shape[::-1]
        if all(np.hypot(*(centre - other)) > 1.2 * (radius + r) for other, r in zip(centres, radii, strict=True)):
            centres.append(centre)
            radii.append(radius)
    return rock.stones(shape, random, np.array(centres).reshape(-1, 2), np.array(radii))


def _current(shape: tuple[int, int], frames: int, U: np.ndarray, standing: rock.Stones, speed: float,
             random: np.random.Generator, scale: float) -> Current:
    steady = past_stones(U, standing.distance)
    strength = (0.6 + 1.2 * _lee(standing.distance, U, 70 * scale)) * smooth_step(0, 8 * scale, standing.distance)
    return Current(steady, eddies(shape, frames, U, 70 * scale, speed, strength, random))


def _lee(distance: np.ndarray, U: np.ndarray, length: float) -> np.ndarray:
    """How far each pixel lies in the lee of a stone, 1 behind it to 0 after `length` pixels: (Y, X)."""
    lee = (distance < 3).astype(np.float32)
    step = U / np.hypot(*U)
    total = lee.copy()
    for k in range(1, int(length)):
        moved = ndimage.shift(lee, (k * step[1], k * step[0]), order=1)
        total = np.maximum(total, moved * (1 - k / length))
    return ndimage.gaussian_filter(total, 3)


def _standing_waves(shape: tuple[int, int], random: np.random.Generator, direction: float, scale: float) -> np.ndarray:
    """Height of the waves that stand over the bed, crests across the current, deviation 1."""
    n = 512
    tile = noise((n, n), random, (34 * scale, 70 * scale), falloff=2.2) * (
        1 + 0.6 * noise((n, n), random, 120 * scale, falloff=2))
    y, x = np.mgrid[: shape[0], : shape[1]]
    c, s = np.cos(direction), np.sin(direction)
    rotated = ndimage.map_coordinates(tile, [c * y - s * x, c * x + s * y], order=1, mode="grid-wrap")
    return (rotated / rotated.std()).astype(np.float32)


def _steepness(height: np.ndarray) -> float:
    slope_y, slope_x = np.gradient(height)
    return float(np.sqrt((slope_x**2 + slope_y**2).mean()))


def _breaking(bed: np.ndarray, distance: np.ndarray, U: np.ndarray, white: float, scale: float) -> np.ndarray:
    """Where foam is born, (Y, X) float32 from 0 to 1: the crests that are highest, and round stones."""
    crest = np.quantile(bed, 1 - min(0.85, 0.55 * white + 0.02))
    broken = smooth_step(crest, crest + 0.8, bed)
    ahead = U / np.hypot(*U)
    slope_y, slope_x = np.gradient(ndimage.gaussian_filter(distance, 2))
    sides = np.abs(slope_x * ahead[1] - slope_y * ahead[0])
    rims = 0.7 * np.exp(-np.abs(distance) / (2.5 * scale)) * sides**2
    return np.clip(broken + rims, 0, 1).astype(np.float32)


def _foam(current: Current, breaking: np.ndarray, frames: int, random: np.random.Generator,
          scale: float) -> np.ndarray:
    """Density of foam in each frame, (T, Y, X): born where waves break, carried, fading; on every second pixel."""
    life = min(30.0, frames / 5)  # of what was two loops ago less than a ten thousandth is left
    coarse = breaking[::2, ::2]
    grid = Grid(coarse.shape, "clamp")
    gusts = [noise(coarse.shape, random, 24 * scale, falloff=1.2) for _ in range(4)]
    turn = 2 * np.pi / frames
    density = opencl.to_device(coarse * 0.5)
    out = np.empty((frames, *breaking.shape), np.float32)
    for t in range(-2 * frames, frames):
        v = current.velocity(t % frames)[::2, ::2] / 2
        moved = grid.gather(density, grid.departure(opencl.to_device(v))).get()
        a, b = turn * t * round(frames / 32), turn * t * round(frames / 14)
        gust = 1 + 0.6 * (np.cos(a) * gusts[0] + np.sin(a) * gusts[1] + np.cos(b) * gusts[2] + np.sin(b) * gusts[3])
        now = moved * np.float32(np.exp(-1 / life)) + coarse * np.maximum(gust, 0).astype(np.float32) * 0.13
        now = np.minimum(now, 1)
        density = opencl.to_device(now.astype(np.float32))
        if t >= 0:
            out[t] = enlarged(now, 2, breaking.shape)
    return out


def _thrown(breaking: np.ndarray, U: np.ndarray, random: np.random.Generator, frames: int, white: float,
            scale: float) -> drops.Drops:
    """Drops that breaking waves throw up and along; what rises is seen from above as moving up the picture."""
    n = round(breaking.size * frames * 0.004 * white)
    share = breaking.ravel().astype(np.float64)
    places = random.choice(breaking.size, n, p=share / share.sum())
    y, x = np.unravel_index(places, breaking.shape)
    up = np.abs(random.normal(0, 1.3 * scale, n))
    gravity = 0.3 * scale
    return drops.made(n, x=x + random.random(n), y=y + random.random(n),
                      vx=U[0] * 0.7 + random.normal(0, 0.6, n) * scale, vy=U[1] * 0.7 + up, gx=0, gy=-gravity,
                      drag=0.03, birth=random.uniform(0, frames, n), life=2 * up / gravity + 1,
                      weight=random.gamma(1.0, 0.45, n), fade=0.4)


def _lit(tile: np.ndarray) -> np.ndarray:
    """Light from the upper left on a tile taken as a height, mean 0 and deviation 1."""
    slope_y = 0.5 * (np.roll(tile, -1, 0) - np.roll(tile, 1, 0))
    slope_x = 0.5 * (np.roll(tile, -1, 1) - np.roll(tile, 1, 1))
    light = 0.6 * slope_x - 0.8 * slope_y
    return (light / light.std()).astype(np.float32)
