"""Fire, smoke and clouds: what rises or drifts in air, lit or glowing, in a few layers one behind the other.

What rises from a source carries two labels, where and how long ago it left. A tile of place and time, which repeats
after T frames, says what left there then. One layer alone betrays that it is flat: of a fire three add their light,
of smoke two hide each other.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from scipy import ndimage

from synth import opencl
from synth.advect import Grid
from synth.photo import drops, rock
from synth.photo.carried import carried, sampled
from synth.photo.clip import Clip, eight_bit
from synth.photo.current import Current, eddies
from synth.photo.tiles import enlarged, noise, normal, rng, smooth_step

BLACK_BODY = ((3.4, 1.0), (1.6, 1.3), (0.55, 1.9))  # red, green, blue: rate and power with which heat saturates
NIGHT = 0.0005  # light that is left where no fire is seen
COLUMNS = 256  # of a tile of what leaves a source
WIDENING = 1.1  # of a plume over the picture's height, in widths


def labels(velocity: Callable[[int], np.ndarray], frames: int, source: float,
           oldest: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """For each frame, where what is at a pixel left its source, less where it is, pixels, and how many frames ago.

    velocity  frame -> (Y, X, 2) float32, pixels per frame, upward at the source, the same again after T
    source    height of the source, pixels; below it ages are negative
    oldest    frames: ages up to here are right, what is older has this age
    Yields (Y, X) float32 each.
    """
    shape = velocity(0).shape[:-1]
    grid = Grid(shape, "clamp")
    y = np.arange(shape[0], dtype=np.float32)[:, None]
    below = np.broadcast_to(y <= source, shape)
    state = np.zeros((*shape, 2), np.float32)
    state[..., 1] = oldest
    for t in range(-oldest, frames):
        v = velocity(t % frames)
        departure = grid.departure(opencl.to_device(v))
        state = grid.gather(opencl.to_device(state), departure).get()
        state[..., 0] += departure.get()[..., 0]
        state[..., 1] = np.minimum(state[..., 1] + 1, oldest)
        state[below, 0] = 0
        state[..., 1] = np.where(below, (y - source) / v[..., 1], state[..., 1])
        if t >= 0:
            yield state[..., 0].copy(), state[..., 1].copy()


def left(tile: np.ndarray, from_x: np.ndarray, age: np.ndarray, frame: int, frames: int) -> np.ndarray:
    """What a tile (S, T * rows, COLUMNS) on the device says of what left at these labels: (S, Y, X) float32."""
    per_frame = tile.shape[1] / frames
    y = np.arange(age.shape[0], dtype=np.float32)[:, None]
    displacement = np.stack([from_x, (frame - age) * per_frame - y], -1).astype(np.float32)
    phases = np.zeros((tile.shape[0], 1, 3), np.float32)
    phases[..., 2] = 1
    return sampled(tile, opencl.to_device(displacement), phases, np.arange(tile.shape[0]))


def rising(shape: tuple[int, int], frames: int, slow: float, fast: float, over: float, narrowing: float,
           eddying: float, size: float, wind: float, random: np.random.Generator) -> Current:
    """Air that rises at `slow` at the ground and at `fast` from the height `over` (pixels) on, pixels per frame.

    narrowing  share of the speed-up that draws air in from the sides: 1 where nothing diverges
    eddying    rms speed of eddies at the top, `size` pixels wide; they rise with the air
    wind       sideways speed where the air is fastest
    """
    y, x = np.mgrid[: shape[0], : shape[1]].astype(np.float32)
    share = smooth_step(0, over, y)
    up = slow + (fast - slow) * share
    slope = np.gradient(up, axis=0)
    steady = np.stack([wind * share - narrowing * slope * (x - shape[1] / 2), up], -1)
    strength = 0.25 + 0.75 * np.minimum(y / over, 1.5)
    return Current(steady.astype(np.float32),
                   eddies(shape, frames, np.array([0, 0.8 * fast]), size, eddying, strength, random))


def fire(seed: int, frames: int, size: tuple[int, int], *, width: float = 0.5, speed: float = 4.5,
         life: float = 34.0, wind: float = 0.0, closeness: float = 1.0) -> Clip:
    """A wood fire in the dark, with sparks.

    width      of the fire, share of the picture's
    speed      of its flames, pixels per frame at a picture 240 high
    life       frames after which the hottest have burnt out
    wind       sideways speed, pixels per frame
    closeness  of the camera: flames and their speeds look that much larger
    """
    shape = size[1], size[0]
    scale = shape[0] / 240 * closeness
    source = 0.07 * shape[0] * closeness
    life = min(life, 0.9 * frames) * (shape[0] / 240) ** 0.5
    x = np.arange(shape[1], dtype=np.float32)
    half = (-(-shape[0] // 2), -(-shape[1] // 2))
    heat = np.zeros((frames, *shape), np.float32)
    velocity = np.zeros((*shape, 2), np.float32)
    for layer in range(3):
        random = rng(seed, 41, layer)
        air = rising(half, frames, 0.23 * speed * scale, 0.5 * speed * scale, 45 * scale, 0.5,
                     0.065 * speed * scale, 24 * scale, 0.5 * wind * scale, random)
        velocity += 2 / 3 * np.moveaxis(enlarged(np.moveaxis(air.mean(), -1, 0), 2, shape), 0, -1)
        rows = 4 * frames
        fuel = (0.8 * noise((rows, COLUMNS), random, (38 * scale, 4 * 10), falloff=1.0)
                + 0.5 * noise((rows, COLUMNS), random, (13 * scale, 4 * 5), falloff=1.0, finest=3))
        folds = np.exp(-np.abs(noise((rows, COLUMNS), random, (20 * scale, 4 * 9), falloff=0.9, finest=2.5)) * 2.2)
        tile = opencl.to_device(np.stack([fuel, folds]).astype(np.float32))
        place = np.abs(x - shape[1] / 2 + random.normal(0, 0.04) * shape[1]) / (0.5 * width * shape[1])
        beds = 0.5 * noise((4, shape[1]), random, (50 * scale, 4), falloff=0.8, finest=1)[0] + 0.9 - 1.1 * place**2
        for t, label in enumerate(labels(air.velocity, frames, 0.5 * source, round(life) + 6)):
            from_x, age = 2 * enlarged(label[0], 2, shape), enlarged(label[1], 2, shape)
            fuelled, folded = left(tile, from_x, age, t, frames)
            there = np.interp(np.arange(shape[1]) + from_x, x, beds).astype(np.float32)
            lasts = life * np.clip(0.55 * (there + 0.6 * fuelled), 0.01, 1.0)
            left_over = 1 - np.maximum(age + 1, 1) / lasts
            flame = smooth_step(0, 0.22, left_over) * smooth_step(-3.5, 1.0, age)
            heat[t] += flame * (0.16 + 0.85 * folded**1.5) * (0.35 + 0.65 * left_over)
    return _fire_pictures(seed, frames, heat, velocity, width, source, speed * scale)


def _fire_pictures(seed: int, frames: int, heat: np.ndarray, velocity: np.ndarray, width: float, source: float,
                   speed: float) -> Clip:
    """Colours of the heat (T, Y, X), with its glow, sparks and logs; heights in pixels, speed in pixels per frame."""
    shape = heat.shape[1:]
    sparks = drops.streaks(_sparks(rng(seed, 42), frames, shape, width, source, speed), frames, shape, 0.7)
    logs, grey = _logs(shape, rng(seed, 43), width, source)
    chroma = np.empty((frames, *shape, 3), np.uint8)
    coverage = np.zeros(shape, np.float32)
    for t in range(frames):
        near = enlarged(ndimage.gaussian_filter(heat[t][::4, ::4], shape[0] / 40), 4, shape)
        seen = heat[t] * (1 - logs) + 0.35 * near * grey + 0.06 * near + NIGHT + 1.2 * np.minimum(sparks[t], 1)
        # the hotter, the whiter: each colour of a black body saturates later than the one before
        light = np.stack([1 - np.exp(-rate * seen**power) for rate, power in BLACK_BODY], -1)
        chroma[t] = eight_bit(np.clip(light, 0, 1) ** (1 / 1.8))
        coverage += 1 - np.exp(-4 * heat[t] * (1 - logs))
    red, green, blue = np.moveaxis(chroma.astype(np.float32) / 255, -1, 0)
    luma = eight_bit(0.2126 * red + 0.7152 * green + 0.0722 * blue)
    coverage /= frames
    return Clip(luma, velocity * (coverage > 0.03)[..., None], coverage, chroma)


def _sparks(random: np.random.Generator, frames: int, shape: tuple[int, int], width: float, source: float,
            speed: float) -> drops.Drops:
    n = max(1, round(0.9 * frames))
    return drops.made(n, x=shape[1] / 2 + random.normal(0, 0.2 * width * shape[1], n), y=source,
                      vx=random.normal(0, 0.3 * speed, n), vy=speed * random.uniform(0.6, 1.3, n),
                      gx=random.normal(0, 0.03 * speed, n), gy=0.03 * speed, drag=0.05,
                      birth=random.uniform(0, frames, n), life=random.uniform(10, 45, n), weight=0.8, fade=0.7)


def _logs(shape: tuple[int, int], random: np.random.Generator, width: float,
          source: float) -> tuple[np.ndarray, np.ndarray]:
    """Logs across the foot of the fire: what they hide, and how they take its light, (Y, X) each."""
    y, x = np.mgrid[: shape[0], : shape[1]].astype(np.float32)
    hidden = smooth_step(0.55 * source, 0.35 * source, y + 1.5 * noise(shape, random, 30, falloff=0.8))
    bark = 1 + 0.35 * noise(shape, random, (14, 5), falloff=0.4)
    grey = (0.25 + 0.15 * bark) * np.ones(shape, np.float32)
    for _ in range(5):
        turn = random.uniform(-0.5, 0.5)
        cx = shape[1] / 2 + random.uniform(-0.45, 0.45) * width * shape[1]
        cy = source * random.uniform(0.5, 1.1)
        along = (x - cx) * np.cos(turn) + (y - cy) * np.sin(turn)
        across = ((y - cy) * np.cos(turn) - (x - cx) * np.sin(turn)) / (0.5 * source * random.uniform(0.6, 1))
        end = np.abs(along) / (0.32 * width * shape[1]) + 0.02 * across**2  # sawn, and seen a little from its end
        inside = smooth_step(1.05, 0.9, np.abs(across)) * smooth_step(1.01, 0.98, end)
        hidden = np.maximum(hidden, inside)
        grey = grey * (1 - inside) + inside * bark * (0.15 + 0.55 * np.clip(0.2 + 0.8 * across, 0, 1))
    return hidden.astype(np.float32), np.clip(grey, 0, 1.2).astype(np.float32)


def _period(frames: int, longest: int) -> int:
    """Frames after which carrying begins again: the longest divisor of T that is no longer than that."""
    return max(d for d in range(1, longest + 1) if frames % d == 0)


def billows(shape: tuple[int, int], random: np.random.Generator, size: tuple[float, float],
            octaves: int) -> np.ndarray:
    """Rounded heads with creases between them, as on a cumulus: mean 0 and deviation 1."""
    total = np.zeros(shape, np.float32)
    for k in range(octaves):
        octave = noise(shape, random, (size[0] / 2**k, size[1] / 2**k), falloff=3.0, finest=2)
        total += 0.55**k * np.sqrt(octave**2 + 0.05)
    return normal(total)


def shaded(density: np.ndarray, heads: np.ndarray, scale: float) -> np.ndarray:
    """Light on smoke (T, Y, X), 0 to 1, from the upper left: less behind other smoke, and on heads that face away.

    density  (T, Y, X) optical depth at a pixel
    heads    (T, Y, X) how far the smoke bulges towards the viewer, deviation about 1
    """
    coarse = ndimage.gaussian_filter(density[:, ::4, ::4], (0, 1, 1))
    behind = np.zeros_like(coarse)
    for k in range(1, 13):
        behind += ndimage.shift(coarse, (0, -1.1 * k * scale, 0.8 * k * scale), order=1) / 12
    shadow = enlarged(np.exp(-1.5 * behind), 4, density.shape[1:])
    surface = ndimage.gaussian_filter(heads + 0.7 * np.minimum(density, 2.5), (0, 1.2, 1.2)) * 6 * scale
    slope_y, slope_x = np.gradient(surface, axis=(1, 2))
    facing = (0.66 + 0.45 * slope_x - 0.6 * slope_y) / np.sqrt(1 + slope_x**2 + slope_y**2)
    return (0.30 + 0.70 * shadow) * (0.45 + 0.55 * np.clip(0.35 + 0.65 * facing, 0, 1))


def smoke(seed: int, frames: int, size: tuple[int, int], *, width: float = 0.22, speed: float = 2.2,
          wind: float = 0.6, dark: float = 0.0) -> Clip:
    """A plume that rises from behind a ridge.

    width  of the plume at the ridge, share of the picture's
    speed  pixels per frame at a picture 240 high
    wind   sideways speed, pixels per frame
    dark   0 white smoke, 1 black
    """
    shape = size[1], size[0]
    scale = shape[0] / 240
    random = rng(seed, 51)
    y, x = np.mgrid[: shape[0], : shape[1]].astype(np.float32)
    sky = 0.26 + 0.3 * dark + 0.16 * y / shape[0] + 0.015 * noise(shape, random, 120 * scale, falloff=1.8)
    crest = shape[0] * (0.13 + 0.02 * noise((4, shape[1]), random, (shape[1] / 3, 4), falloff=1.0, finest=1)[0])
    ridge = smooth_step(-0.8, 0.8, crest - y)
    foot = 0.08 * shape[0]
    # the plume widens as it rises, and the air moves apart with it
    share = np.maximum(y - foot, 0) / (shape[0] - foot)
    half = 0.5 * width * shape[1] * (0.45 + WIDENING * share)
    middle = 0.5 * shape[1] + shape[0] * (wind / speed) * (share**1.5 - 0.45)
    off = (x - middle) / half
    up = speed * scale * (1.1 - 0.25 * share)
    lean = np.gradient(middle, axis=0) + off * np.gradient(half, axis=0)
    steady = np.stack([up * lean * (np.abs(off) < 2), up], -1).astype(np.float32)
    drift = np.array([wind, 0.9 * speed]) * scale
    grey, through = np.zeros((frames, *shape), np.float32), np.ones((frames, *shape), np.float32)
    velocity = np.zeros((*shape, 2), np.float32)
    for layer, size_of_heads in enumerate((64, 44)):
        random = rng(seed, 52, layer)
        air = Current(steady, eddies(shape, frames, drift, 70 * scale, 0.2 * speed * scale, 0.4 + share, random))
        velocity += air.mean() / 2
        tiles = [opencl.to_device(tile[None]) for tile in (
            billows((512, 512), random, (size_of_heads * scale, size_of_heads * scale), 4),
            noise((512, 512), random, 90 * scale, falloff=1.2))]
        density, heads = np.empty((2, frames, *shape), np.float32)
        for state in carried(air.velocity, frames, _period(frames, 32)):
            heads[state.frame] = state.picture(tiles[0], seed + layer)
            gust = state.picture(tiles[1], seed + 9 + layer)
            edge = 1.1 - off**2 + 0.42 * heads[state.frame] + 0.35 * gust
            density[state.frame] = 2.8 * smooth_step(0.0, 1.3, edge) * (1 - 0.55 * share)
        alpha = 1 - np.exp(-(0.7 + layer) * density)
        light = (0.16 + 0.84 * shaded(density, heads, scale)) * (1 - 0.72 * dark)
        grey = grey * (1 - alpha) + light * alpha
        through *= 1 - alpha
    pictures = (sky * through + grey) * (1 - ridge) + rock.face(shape, random, 0.16) * ridge
    coverage = ((1 - through) * (1 - ridge)).mean(0).astype(np.float32)
    return Clip(eight_bit(pictures), velocity * (coverage > 0.03)[..., None], coverage)


def cloud(seed: int, frames: int, size: tuple[int, int], *, direction: float = 0.1, speed: float = 1.2,
          cover: float = 0.5, mountains: float = 0.25) -> Clip:
    """Clouds that drift before a blue sky, over mountains.

    cover      share of the sky that they hide
    mountains  mean height of the mountains, share of the picture's
    """
    shape = size[1], size[0]
    scale = shape[0] / 240
    random = rng(seed, 61)
    U = speed * scale * np.array([np.cos(direction), np.sin(direction)])
    air = Current(np.array(np.broadcast_to(U.astype(np.float32), (*shape, 2))),
                  eddies(shape, frames, U, 90 * scale, 0.18 * speed * scale, np.ones(shape, np.float32), random))
    tiles = [opencl.to_device(tile[None]) for tile in (
        noise((512, 512), random, (150 * scale, 100 * scale), falloff=1.25),
        billows((512, 512), random, (60 * scale, 50 * scale), 4))]
    y = np.arange(shape[0], dtype=np.float32)[:, None]
    stays = 0.5 * noise(shape, random, (120 * scale, 60 * scale), falloff=1.5) + 3.0 * (cover - 0.5) + 0.35
    density, heads = np.empty((2, frames, *shape), np.float32)
    for state in carried(air.velocity, frames, _period(frames, 48)):
        large = state.picture(tiles[0], seed + 1)
        heads[state.frame] = state.picture(tiles[1], seed + 2)
        density[state.frame] = 2.6 * smooth_step(-0.3, 1.6, large + stays + 0.38 * heads[state.frame])
    alpha = 1 - np.exp(-1.3 * density)
    light = 0.36 + 0.6 * shaded(density, heads, scale)
    sky = np.broadcast_to(0.46 - 0.12 * y / shape[0], shape)
    grey = sky * (1 - alpha) + light * alpha
    skyline = noise((4, shape[1]), random, (shape[1] / 2.5, 4), falloff=1.3, finest=1)[0]
    crest = shape[0] * mountains * (1 + 0.5 * skyline)
    land = smooth_step(-0.8, 0.8, crest - y)
    veil = 0.5 * alpha * smooth_step(0.3, 1.1, y / np.maximum(crest, 1))  # clouds hang before the tops
    grey = grey * (1 - land) + (rock.face(shape, random, 0.2) * (1 - veil) + light * veil) * land
    coverage = (alpha * (1 - land) + veil * land).mean(0).astype(np.float32)
    return Clip(eight_bit(grey), air.mean() * (coverage > 0.05)[..., None], coverage)
