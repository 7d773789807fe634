"""Falls: water that leaves a lip, falls over ledges, and ends in a pool.

The water of a section, from a lip or a ledge down to the next, leaves it in lumps and threads given by a tile of
place along the lip and time, which repeats after T frames. A pixel shows what left the lip as long ago as the fall
takes, so lumps grow longer as the water gains speed. Droplets and spray fly on their own.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import ndimage

from synth import opencl
from synth.photo import drops, rock
from synth.photo.carried import sampled
from synth.photo.clip import Clip, eight_bit
from synth.photo.tiles import enlarged, lace, noise, normal, rng, smooth_step

PER_FRAME = 4  # rows of a tile of emission in a frame
COLUMNS = 256  # of such a tile, and of the pool's
START = 0.45  # speed at a lip, in terminal speeds
COVERED = 0.05  # where water covers less, nothing is said to move
SHUTTER = 0.6  # frames
POOL = 0.9  # speed of foam in the pool, pixels per frame at a picture 240 high
NEARER = 0.02  # growth of foam for each pixel that it comes nearer, at a picture 240 high
FLAT = 2.5  # the pool is seen from so low that it is this much shorter than wide


class Motion(NamedTuple):
    """Falling from a lip: gravity (pixels per frame^2), drag (share of the velocity lost a frame), terminal speed."""

    gravity: float
    drag: float
    terminal: float

    def table(self, longest: float) -> tuple[np.ndarray, np.ndarray]:
        """Times, frames, and the heights fallen then, pixels, up to `longest` pixels."""
        times = np.linspace(0, longest / (START * self.terminal), 2048)
        decayed = (1 - np.exp(-self.drag * times)) / self.drag
        return times, self.terminal * times - (1 - START) * self.terminal * decayed

    def speed(self, time: np.ndarray) -> np.ndarray:
        """Speed `time` frames after the lip, pixels per frame."""
        return self.terminal * (1 - (1 - START) * np.exp(-self.drag * time))


class Bed(NamedTuple):
    """Where the water falls, by place s along the lip (W,) and by pixel (Y, X).

    tops     (K + 1, W) height where section k begins at s, pixels; where `wets[k]` is False it is passed over
    wets     (K + 1, W) bool
    foot     height of the pool's surface below the fall
    s        (Y, X) place along the lip of the water at a pixel
    section  (Y, X) int, the section that a pixel lies in
    fallen   (Y, X) pixels below the top of that section; negative above the first
    """

    tops: np.ndarray
    wets: np.ndarray
    foot: float
    s: np.ndarray
    section: np.ndarray
    fallen: np.ndarray


def bed(shape: tuple[int, int], random: np.random.Generator, ledges: int, lip: float, foot: float,
        lean: float) -> Bed:
    """A rock with a lip at height `lip` and a foot at `foot` (shares of the picture's height), and ledges between."""
    height, width = shape
    line = 0.012 * height * noise((4, width), random, (width / 5, 4), falloff=0.7, finest=1)[0]
    tops, wets = [lip * height + line], [np.ones(width, bool)]
    levels = np.linspace(lip, max(foot, 0.0), ledges + 2)[1:-1]
    for level in levels:
        level += random.uniform(-0.25, 0.25) * (lip - foot) / (ledges + 1)
        ragged = noise((4, width), random, (width / 4, 4), falloff=0.5, finest=1)[0]
        tops.append(level * height + 0.03 * height * ragged)
        wets.append(noise((4, width), random, (width / 3, 4), falloff=1.0)[0] > random.uniform(-0.7, 0.3))
    y, x = np.mgrid[:height, :width].astype(np.float32)
    wobble = 0.010 * width * noise(shape, random, (width / 4, height / 2), falloff=2.0)
    s = x - lean * (lip * height - y) - wobble
    place = np.clip(np.rint(s), 0, width - 1).astype(int)
    section, top = np.zeros(shape, int), tops[0][place]
    for k in range(1, len(tops)):
        below = wets[k][place] & (y < tops[k][place])
        section[below], top = k, np.where(below, tops[k][place], top)
    return Bed(np.array(tops), np.array(wets), foot * height, s, section, top - y)


def fall(seed: int, frames: int, size: tuple[int, int], *, width: float = 0.8, speed: float = 5.0, ledges: int = 2,
         density: float = 0.5, lean: float = 0.0, lip: float = 1.05, foot: float = 0.12,
         tone: float = 0.22) -> Clip:
    """A fall.

    width    of the water, share of the picture's; its middle is in the picture's, where the fall does not lean
    speed    terminal, pixels per frame at a picture 240 high
    ledges   that it meets on its way
    density  of the water: 0.2 threads on dark rock, 0.8 a white curtain
    lean     pixels to the right for each pixel down
    lip, foot  heights of the first edge and of the pool, shares of the picture's height
    tone     mean grey of the rock
    """
    shape = size[1], size[0]
    scale = shape[0] / 240
    random = rng(seed, 1)
    motion = Motion(speed * scale / 11, 1 / 11, speed * scale)
    ground = bed(shape, random, ledges, lip, foot, lean)
    envelope = _envelope(shape[1], random, width, lean * shape[0] * 0.5)
    times, distances = motion.table(1.5 * shape[0])
    tau = np.interp(ground.fallen, distances, times).astype(np.float32)
    cover = envelope[np.clip(np.rint(ground.s), 0, shape[1] - 1).astype(int)]
    cover = cover + 0.25 * noise(shape, random, (14 * scale, 60 * scale), falloff=0.8)
    cover[ground.fallen < 0] = -9
    cover -= 9 * smooth_step(-3, 5, ground.foot - np.arange(shape[0], dtype=np.float32))[:, None]

    alpha, light = _sheets(ground, motion, tau, cover + 1.6 * (density - 0.5), seed, frames)
    front = _emission((frames * PER_FRAME, COLUMNS), rng(seed, 2, 1), scale)  # of the sheet in front
    flying = _droplets(ground, motion, front, _starts(ground, rng(seed, 3, 1), len(front)), envelope, rng(seed, 4),
                       frames, density, lean)
    shot = drops.streaks(flying, frames, shape, SHUTTER)
    thrown = drops.streaks(_splashes(ground, motion, envelope, rng(seed, 5), frames, density, lean),
                           frames, shape, SHUTTER)
    back = _ground(ground, envelope, rng(seed, 6), tone, frames)
    mist = _mist(ground, motion, envelope, rng(seed, 7), frames, shape, density, lean)
    luma = np.empty((frames, *shape), np.uint8)
    coverage = np.zeros(shape, np.float32)
    for t in range(frames):
        grain = 1 - np.exp(-0.9 * shot[t])
        spray = 1 - np.exp(-ndimage.gaussian_filter(thrown[t], 0.5))
        grey = back[t] * (1 - alpha[t]) + light[t]
        grey += (0.93 - grey) * np.minimum(grain, 0.95)
        grey += (0.88 - grey) * mist[t]
        grey += (0.95 - grey) * spray
        luma[t] = eight_bit(grey)
        coverage += 1 - (1 - alpha[t]) * (1 - grain) * (1 - spray)
    coverage = np.where(np.arange(shape[0])[:, None] < ground.foot, 1, coverage / frames).astype(np.float32)
    return Clip(luma, _velocity(ground, motion.speed(tau), coverage, frames), coverage)


def _sheets(ground: Bed, motion: Motion, tau: np.ndarray, cover: np.ndarray, seed: int,
            frames: int) -> tuple[np.ndarray, np.ndarray]:
    """Two sheets of water, one before the other: opacity and light (T, Y, X) float32 each.

    tau    (Y, X) frames since the water at a pixel left its lip
    cover  (Y, X) how much water falls there: 0 the mean, below -1 none
    """
    shape = tau.shape
    thinned = cover - 0.35 * np.log(motion.speed(tau) / motion.speed(np.zeros(1)))
    alpha, light = np.zeros((frames, *shape), np.float32), np.zeros((frames, *shape), np.float32)
    phases = np.zeros((frames, 1, 3), np.float32)
    phases[:, 0, 1] = np.arange(frames) * PER_FRAME
    phases[:, 0, 2] = 1
    for layer, (most, grey) in enumerate(((0.75, 0.66), (0.9, 0.76))):
        tile = _emission((frames * PER_FRAME, COLUMNS), rng(seed, 2, layer), shape[0] / 240)
        places = opencl.to_device(_places(ground, tau, _starts(ground, rng(seed, 3, layer), len(tile))))
        water, shade = (sampled(opencl.to_device(one[None]), places, phases, np.zeros(frames))
                        for one in (tile, _side_lit(tile)))
        sheet = most * smooth_step(-0.35, 1.3, 0.75 * water + thinned.astype(np.float32))
        light = light * (1 - sheet) + sheet * (grey + 0.17 * shade)
        alpha += sheet * (1 - alpha)
    return alpha, light


def _velocity(ground: Bed, speed: np.ndarray, coverage: np.ndarray, frames: int) -> np.ndarray:
    """Along the paths of falling water, on which s is the same, and towards the viewer in the pool."""
    slope_y, slope_x = np.gradient(ground.s)
    velocity = np.stack([speed * slope_y / slope_x, -speed], -1).astype(np.float32)
    y, x = np.mgrid[: speed.shape[0], : speed.shape[1]]
    near = _near(ground, y)
    towards = _turns(frames, speed.shape[0]) * COLUMNS / frames / FLAT
    drawn_apart = (x - 0.5 * speed.shape[1]) / near * NEARER * towards * 240 / speed.shape[0]
    velocity = np.where((y < ground.foot)[..., None], np.stack([drawn_apart, -towards * near], -1), velocity)
    velocity[(coverage < COVERED) | (ground.fallen < 0)] = 0
    return velocity.astype(np.float32)


def _near(ground: Bed, y: np.ndarray) -> np.ndarray:
    """How much larger foam looks at height y of the pool than at the foot of the fall."""
    return 1 + NEARER * np.clip(ground.foot - y, -4, None) * 240 / len(ground.s)


def _turns(frames: int, height: int) -> int:
    """How often the pool's tile of foam passes in T frames: a whole number, so that it repeats."""
    return max(1, round(POOL * height / 240 * FLAT * frames / COLUMNS))


def _envelope(width: int, random: np.random.Generator, share: float, shift: float) -> np.ndarray:
    """How much water leaves the lip at each place (W,): 0 is the mean, below -1 none."""
    x = np.arange(width)
    middle = 0.5 * width - shift
    inside = smooth_step(0.0, 0.16 * share * width, 0.5 * share * width - np.abs(x - middle))
    parts = noise((4, width), random, (width / 7, 4), falloff=0.5, finest=1.5)[0]
    return (0.55 * parts - 5 * (1 - inside)).astype(np.float32)


def _emission(shape: tuple[int, int], random: np.random.Generator, scale: float) -> np.ndarray:
    """What leaves a lip: lumps, threads and grain, (rows of time, place), mean 0 and deviation 1."""
    lumps = noise(shape, random, (15 * scale, 12 * PER_FRAME), falloff=0.8, finest=2)
    threads = noise(shape, random, (4 * scale, 9 * PER_FRAME), falloff=0.5, finest=1.6)
    grain = noise(shape, random, (2.2 * scale, 3 * PER_FRAME), falloff=0.3, finest=1.3)
    return normal(0.7 * lumps + 0.8 * threads + 0.6 * grain)


def _side_lit(tile: np.ndarray) -> np.ndarray:
    """Light from the left on the threads of a tile, about -1 to 1."""
    smooth = ndimage.gaussian_filter(tile, (2, 0.7), mode="wrap")
    slope = 0.5 * (np.roll(smooth, -1, 1) - np.roll(smooth, 1, 1))
    return np.tanh(slope / slope.std() * 0.7).astype(np.float32)


def _starts(ground: Bed, random: np.random.Generator, rows: int) -> np.ndarray:
    """Where in a tile of emission each section begins, (K + 1, 2: place, row of time): each has its own part."""
    return np.asarray(random.integers(0, (COLUMNS, rows), (len(ground.tops), 2)))


def _places(ground: Bed, tau: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """From each pixel to its place in a tile of emission in frame 0, (Y, X, 2) float32."""
    y, x = np.mgrid[: tau.shape[0], : tau.shape[1]]
    start = starts[ground.section]
    return np.stack([ground.s + start[..., 0] - x, start[..., 1] - tau * PER_FRAME - y], -1).astype(np.float32)


def _ends(ground: Bed, k: int, place: np.ndarray) -> np.ndarray:
    """The height at which water from section k at places along the lip meets the next ledge, or the pool."""
    end = np.full(place.shape, max(ground.foot, -20.0))
    for j in range(k + 1, len(ground.tops)):
        end = np.maximum(end, np.where(ground.wets[j][place], ground.tops[j][place], -np.inf))
    return end


def _droplets(ground: Bed, motion: Motion, tile: np.ndarray, starts: np.ndarray, envelope: np.ndarray,
              random: np.random.Generator, frames: int, density: float, lean: float) -> drops.Drops:
    """Droplets in the falling water, thick where the sheet of this tile is thick."""
    height, width = ground.s.shape
    groups = []
    times, distances = motion.table(1.5 * height)
    for k, (top, wet) in enumerate(zip(ground.tops, ground.wets, strict=True)):
        count = round(0.9 * width * frames * (0.4 + density))
        place = random.integers(0, width, count)
        birth = random.uniform(0, frames, count)
        e = tile[(birth * PER_FRAME + starts[k, 1]).astype(int) % len(tile), (place + starts[k, 0]) % COLUMNS]
        kept = wet[place] & (random.random(count) < smooth_step(-1.2, 1.5, envelope[place] + 0.8 * e + density - 0.5))
        place, birth = place[kept], birth[kept]
        deep = top[place] - _ends(ground, k, place)
        n = len(place)
        life = np.interp(deep, distances, times)
        along = lean * motion.gravity
        groups.append(drops.made(
            n, x=place + random.uniform(-0.5, 0.5, n) + lean * (ground.tops[0][place] - top[place]), y=top[place],
            vx=lean * START * motion.terminal + random.normal(0, 0.07 * motion.terminal, n),
            vy=-START * motion.terminal * random.uniform(0.6, 1.6, n), gx=along, gy=-motion.gravity, drag=motion.drag,
            birth=birth, life=life * random.uniform(0.6, 1.05, n), weight=random.gamma(1.2, 0.5, n), fade=0.15))
    return drops.joined(groups)


def _splashes(ground: Bed, motion: Motion, envelope: np.ndarray, random: np.random.Generator, frames: int,
              amount: float, lean: float) -> drops.Drops:
    """Spray that water throws up where it meets a ledge or the pool."""
    width = ground.s.shape[1]
    groups = []
    lines = [*zip(ground.tops[1:], ground.wets[1:], strict=True), (np.full(width, ground.foot), np.ones(width, bool))]
    for line, wet in lines:
        count = round(3.0 * width * frames * amount)
        place = random.integers(0, width, count)
        kept = wet[place] & (random.random(count) < smooth_step(-1.0, 1.0, envelope[place]))
        place = place[kept]
        n = len(place)
        up = np.abs(random.normal(0, 0.28 * motion.terminal, n))
        groups.append(drops.made(
            n, x=place + lean * (ground.tops[0][place] - line[place]) + random.normal(0, 1.5, n), y=line[place] - 1,
            vx=random.normal(0, 0.22 * motion.terminal, n), vy=up, gx=0, gy=-motion.gravity, drag=motion.drag,
            birth=random.uniform(0, frames, n), life=2.2 * up / motion.gravity + 1, weight=random.gamma(1.0, 0.4, n),
            fade=0.5))
    return drops.joined(groups)


def _mist(ground: Bed, motion: Motion, envelope: np.ndarray, random: np.random.Generator, frames: int,
          shape: tuple[int, int], amount: float, lean: float) -> np.ndarray:
    """Mist above the pool, (T, Y, X): drops too fine to see, drifting; at a quarter of the resolution."""
    width = shape[1]
    n = round(1.2 * width * frames * amount / 4)
    place = random.integers(0, width, n)
    place = place[random.random(n) < smooth_step(-1.0, 1.0, envelope[place])]
    n = len(place)
    puffs = drops.made(
        n, x=(place + lean * (ground.tops[0][place] - ground.foot)) / 4, y=ground.foot / 4,
        vx=random.normal(0, 0.05 * motion.terminal, n), vy=np.abs(random.normal(0, 0.05 * motion.terminal, n)), gx=0,
        gy=0, drag=0.12, birth=random.uniform(0, frames, n), life=random.uniform(8, 20, n), weight=0.8, fade=1.0)
    coarse = (-(-shape[0] // 4) + 1, -(-shape[1] // 4) + 1)
    light = ndimage.gaussian_filter(drops.streaks(puffs, frames, coarse, SHUTTER), (1.0, 1.5, 1.5),
                                    mode=("wrap", "nearest", "nearest"))
    out = np.empty((frames, *shape), np.float32)
    for t in range(frames):
        out[t] = 0.75 * (1 - np.exp(-enlarged(light[t], 4, shape)))
    return out


def _ground(ground: Bed, envelope: np.ndarray, random: np.random.Generator, tone: float, frames: int) -> np.ndarray:
    """Behind the water, (T, Y, X): wet rock, its ledges, and the pool with foam that drifts towards the viewer."""
    shape = ground.s.shape
    scale = shape[0] / 240
    still = rock.face(shape, random, tone)
    still = still * (1 + 0.5 * np.exp(-np.abs(ground.fallen) / 2.5) * (ground.section > 0))
    if ground.foot <= 1:
        return np.broadcast_to(still, (frames, *shape))
    y, x = np.mgrid[: shape[0], : shape[1]].astype(np.float32)
    shore = ground.foot + 2.5 * scale * noise((4, shape[1]), random, (30 * scale, 4), falloff=0.6, finest=4)[0]
    near = _near(ground, y)
    tile = lace(COLUMNS, random, 22 * scale)
    places = np.stack([0.5 * shape[1] + (x - 0.5 * shape[1]) / near - x, -FLAT * scale * np.log(near) / NEARER - y], -1)
    phases = np.zeros((frames, 1, 3), np.float32)
    phases[:, 0, 1] = np.arange(frames) * _turns(frames, shape[0]) * COLUMNS / frames
    phases[:, 0, 2] = 1
    walls = sampled(opencl.to_device(tile[None]), opencl.to_device(places.astype(np.float32)), phases,
                    np.zeros(frames))
    landing = np.clip(np.rint(ground.s[int(ground.foot)]), 0, shape[1] - 1).astype(int)
    fed = ndimage.gaussian_filter1d(smooth_step(-1.5, 0.5, envelope[landing]), 20 * scale)
    dense = (3.4 * np.exp(-(near - 1) / NEARER / 22) + 0.6) * fed - 1.6
    foam = 0.95 * smooth_step(-0.2, 1.6, 0.7 * walls + dense)
    water = 0.15 + 0.04 * noise(shape, random, (50 * scale, 5 * scale), falloff=0.6)
    pool = water + foam * (0.85 - water)
    below = smooth_step(-1.0, 1.0, shore - y)
    return np.asarray(still * (1 - below) + pool * below, np.float32)
