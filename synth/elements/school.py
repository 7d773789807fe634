"""Schools: exemplars of fish that swim together (ma13 figures 9 and 11).

    homogeneous  one school, everywhere alike (figure 9a)
    crossing     groups side by side, between which some fish dart (9c, "temporally heterogeneous")
    mixed        a few large fish among small ones (9e, "spatially heterogeneous")
    tracked      fish whose tracks were taken from a film (11a)

Each returns its elements and the school's speed, world units per second. The school swims along +x; positions are
relative to its mean motion, so that fish only drift. To see them swim, add speed × time to x. No simulated fish drifts
back faster than that speed: none swims backwards (§7). y is up.

The first three are simulated in a box that repeats, so that every fish has neighbours on all sides. A fish seeks a
velocity of its own that changes slowly, is carried by a slow flow common to all, and avoids fish that are near, ahead
or behind from farther than beside. All these forces are continuous: tracks are smooth.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import ndimage, signal
from scipy.spatial import cKDTree

from synth.elements.samples import Elements

LENGTH = 0.8  # of a small fish, in spacings
AHEAD = 1.35  # how much more distance fish keep ahead than beside
DENSITY = 0.5  # small fish in a cubic spacing
STEPS = 4  # of the simulation in a frame
BEFORE = 6.0  # seconds simulated before the first frame
RESPONSE = 0.45  # seconds in which a fish takes on the velocity that it seeks
YIELD = 14.0  # spacings per s²: push between two fish at one place
CONFINE = 8.0  # spacings per s², one radius outside of a group
DARTS = 0.15  # increase of a fish's room, as a share, per spacing per second of its dart
CLOSE, DRAWS = 0.4, 10  # spacings: darts are drawn anew, up to DRAWS times, while fish pass nearer than CLOSE
WANDER = np.array([0.26, 0.13, 0.30])  # rms of a fish's own velocity x, y, z, spacings per second
CARRY = 0.26  # rms of the shared flow, spacings per second
SILVER, AMBER = (0.55, 0.66, 0.74), (0.88, 0.56, 0.26)


@dataclass(frozen=True)
class _School:
    """What is simulated, in spacings and seconds.

    extent  (3,) of the box; start (E, 3); room (E,): distance that a fish keeps is the sum of two; calm (E,): its
    share of wandering
    centre  of each fish's group at a time, its velocity and acceleration, (3, E, 3); and the group's radii (3,)
    """

    extent: np.ndarray
    start: np.ndarray
    room: np.ndarray
    calm: np.ndarray
    centre: Callable[[float], np.ndarray] | None = None
    radii: np.ndarray | None = None


def homogeneous(count: int = 40, frames: int = 60, *, spacing: float = 1.0, speed: float = 2.2, rate: float = 24.0,
                seed: int = 0) -> tuple[Elements, float]:
    """A school that is everywhere alike (ma13 figure 9a): count fish in a box that repeats.

    spacing  about the distance of a fish from its nearest neighbour, world units; speed in spacings per second
    Raises ValueError for fewer than 8 fish, fewer than 2 frames, or a speed at which fish may swim backwards.
    """
    _check(count, frames, spacing, speed, rate)
    rng = np.random.Generator(np.random.Philox(key=seed))
    extent = _box(count / DENSITY)
    school = _School(extent, rng.uniform(0, 1, (count, 3)) * extent, np.full(count, 0.55), np.ones(count))
    length = LENGTH * rng.normal(1, 0.05, count).clip(0.85, 1.15)
    return _shown(school, frames, spacing, speed, rate, rng, length, np.zeros(count, int))


def crossing(count: int = 32, frames: int = 60, *, groups: int = 2, crossers: int = 8, crossing_time: float = 1.2,
             spacing: float = 1.0, speed: float = 3.0, rate: float = 24.0, seed: int = 0) -> tuple[Elements, float]:
    """Groups side by side along z, some fish of which dart to the next one (ma13 figure 9c).

    crossers       how many dart, one after the other from each group in turn, so that groups keep their number
    crossing_time  seconds that a fish needs; while it crosses it also surges ahead
    The rest as `homogeneous`. Raises ValueError too for a group of fewer than 6, more crossers than half of all,
    or a clip shorter than a crossing.
    """
    _check(count, frames, spacing, speed, rate, slowest=2.5)
    if groups < 2 or count < 6 * groups:
        raise ValueError(f"{count} fish do not make {groups} groups: at least 2 of 6 or more")
    if not 0 <= crossers <= count // 2:
        raise ValueError(f"crossers = {crossers} is not between 0 and half of {count} fish")
    if not 0 < crossing_time <= (frames - 1) / rate:
        raise ValueError(f"a crossing of {crossing_time:g} s does not fit into {frames} frames at {rate:g} a second")
    rng = np.random.Generator(np.random.Philox(key=seed))
    group = np.arange(count) % groups
    radius = (count / groups / DENSITY / (4 / 3 * np.pi * 1.9 * 0.85)) ** (1 / 3)
    radii = radius * np.array([1.9, 0.85, 1.0])
    extent = np.array([2 * radii[0] + 1.5, 2 * radii[1] + 1.5, groups * (2 * radii[2] + 1.3)])
    middle = np.stack([np.full(groups, extent[0] / 2), np.full(groups, extent[1] / 2),
                       (np.arange(groups) + 0.5) * extent[2] / groups], 1)[group]
    displacement = np.array([speed * crossing_time * 0.35, 0.0, extent[2] / groups])
    # to the next group and, of two, back
    side = np.where((group == 1) & (groups == 2), -1.0, 1.0)[:, None] * np.array([0, 0, 1]) + np.array([1, 1, 0])
    drawn: list[tuple[Elements, float]] = []
    clearances: list[float] = []
    while len(drawn) < DRAWS and max(clearances, default=0) < CLOSE:
        start = middle + rng.uniform(-0.6, 0.6, (count, 3)) * radii
        # fish that cross start anywhere in their group
        leaves = np.full(count, np.inf)
        leaves[:crossers] = (rng.permutation(crossers) + rng.uniform(0.2, 0.8, crossers)) / max(crossers, 1)
        leaves = leaves * ((frames - 1) / rate - crossing_time * 0.9) - crossing_time * 0.05
        school = _School(extent, start, np.full(count, 0.55), np.ones(count),
                         functools.partial(_crossed, middle, leaves, side * displacement, crossing_time), radii)
        length = LENGTH * rng.normal(1, 0.05, count).clip(0.85, 1.15)
        drawn.append(_shown(school, frames, spacing, speed, rate, rng, length, np.zeros(count, int)))
        clearances.append(_nearest(drawn[-1][0]) / spacing)
    return drawn[int(np.argmax(clearances))]


def _nearest(elements: Elements) -> float:
    """The least distance of two fish in all frames, world units, on the torus."""
    points = elements.positions[:, :, 0].astype(np.float64)
    period = np.asarray(elements.period, np.float64)
    inside = points % period
    inside[inside >= period] = 0
    return min(float(cKDTree(frame, boxsize=period).query(frame, k=2)[0][:, 1].min()) for frame in inside)


def mixed(count: int = 44, large: int = 3, frames: int = 60, *, size: float = 3.0, spacing: float = 1.0,
          speed: float = 2.2, rate: float = 24.0, seed: int = 0) -> tuple[Elements, float]:
    """Fish of two sizes (ma13 figure 9e): `large` of kind 1, and small ones of kind 0, count in all.

    size  length of a large fish over that of a small one, from 1 to 5
    The rest as `homogeneous`; the spacing is that of small fish. Raises ValueError too unless 1 to a quarter are large.
    """
    _check(count, frames, spacing, speed, rate)
    if not 1 <= large <= count // 4:
        raise ValueError(f"large = {large} of {count} fish is not between 1 and a quarter of them")
    if not 1 <= size <= 5:
        raise ValueError(f"size = {size:g} times a small fish is not between 1 and 5")
    rng = np.random.Generator(np.random.Philox(key=seed))
    kind = (np.arange(count) < large).astype(int)
    room = np.where(kind == 1, 0.55 + 0.5 * LENGTH * (size - 1) * 0.75, 0.55)
    extent = _box(((2 * room) ** 3 / 1.1**3 / DENSITY * np.where(kind == 1, 0.75, 1)).sum())
    start = rng.uniform(0, 1, (count, 3)) * extent
    start[:large] = (np.arange(large)[:, None] / large + [0, 0.25, 0.5] + rng.uniform(0, 0.1, (large, 3))) % 1 * extent
    length = LENGTH * rng.normal(1, 0.05, count).clip(0.85, 1.15) * np.where(kind == 1, size, 1)
    school = _School(extent, start, room, np.where(kind == 1, 0.5, 1.0))
    return _shown(school, frames, spacing, speed, rate, rng, length, kind)


def _check(count: int, frames: int, spacing: float, speed: float, rate: float, slowest: float = 1.5) -> None:
    if count < 8 or frames < 2:
        raise ValueError(f"a school has 8 fish or more over 2 frames or more, not {count} over {frames}")
    for name, value in (("spacing", spacing), ("rate", rate)):
        if not (np.isfinite(value) and value > 0):
            raise ValueError(f"{name} = {value} is not above 0")
    if not (np.isfinite(speed) and speed >= slowest):
        raise ValueError(f"speed = {speed} spacings per second: below {slowest} fish may swim backwards")


def _box(volume: float) -> np.ndarray:
    """The extents (3,) of a box of this volume, longer along x, flatter along y."""
    return volume ** (1 / 3) * np.array([1.35, 0.8, 1 / (1.35 * 0.8)])


def _shown(school: _School, frames: int, spacing: float, speed: float, rate: float, rng: np.random.Generator,
           length: np.ndarray, kind: np.ndarray) -> tuple[Elements, float]:
    """The simulated school as elements, in world units."""
    tracks = _simulated(school, frames, rate, rng)
    # subtract the mean velocity, which is constant; the tracks then start in the box
    drift = (tracks[-1] - tracks[0]).mean(0) / (frames - 1)
    tracks -= np.arange(frames)[:, None, None] * drift
    tracks -= school.extent * np.floor(tracks[0] / school.extent)
    colour = np.where(kind[:, None] == 1, AMBER, SILVER) * np.exp(rng.normal(0, 0.07, (len(kind), 1)))
    box = np.stack([np.zeros(3), school.extent])
    return Elements((tracks * spacing)[:, :, None].astype(np.float32), rate=rate, size=length * spacing, kind=kind,
                    colour=colour.clip(0, 1), box=box * spacing), speed * spacing


def _simulated(school: _School, frames: int, rate: float, rng: np.random.Generator) -> np.ndarray:
    """Tracks (frames, E, 3) float64 of the school, spacings; symplectic Euler, STEPS a frame."""
    wander, carry = _wandering(rng, len(school.start)), _carrying(rng, school.extent)
    place, velocity = school.start.copy(), np.zeros_like(school.start)
    step = 1 / (rate * STEPS)
    before = int(np.ceil(BEFORE / step))
    tracks = np.empty((frames, *place.shape))
    for k in range(before + (frames - 1) * STEPS + 1):
        if k >= before and (k - before) % STEPS == 0:
            tracks[(k - before) // STEPS] = place
        time = (k - before) * step
        sought = school.calm[:, None] * (wander(time) + carry(place, time))
        room, push = school.room, np.zeros_like(place)
        if school.centre is not None:
            centre, moved, quickened = school.centre(time)
            sought += moved
            push += quickened + _confining(place - centre, school.radii)
            # fish avoid one that darts from farther away
            room = room * (1 + DARTS * np.linalg.norm(moved, axis=1))
        push += _yielding(place, school.extent, room)
        velocity += step * ((sought - velocity) / RESPONSE + push)
        place = place + step * velocity
    return tracks


def _yielding(place: np.ndarray, extent: np.ndarray, room: np.ndarray) -> np.ndarray:
    """Accelerations (E, 3) away from fish that are nearer than the sum of both rooms (E,); one ahead counts as nearer
    than one beside."""
    squeezed = np.array([AHEAD, 1.0, 1.0])
    box = extent / squeezed
    # rounding may give the length of the box, which is the same as 0
    inside = (place / squeezed) % box
    inside[inside >= box] = 0
    tree = cKDTree(inside, boxsize=box)
    pairs = tree.query_pairs(2 * room.max(), output_type="ndarray")
    one, other = pairs[np.lexsort(pairs.T)].T  # one order of the sums
    between = inside[one] - inside[other]
    between -= box * np.rint(between / box)
    distance = np.maximum(np.linalg.norm(between, axis=1), 1e-6)
    force = YIELD * (np.clip(1 - distance / (room[one] + room[other]), 0, None) / distance)[:, None] * between
    return np.stack([np.bincount(one, force[:, axis], len(place)) - np.bincount(other, force[:, axis], len(place))
                     for axis in range(3)], 1)


def _confining(offset: np.ndarray, radii: np.ndarray | None) -> np.ndarray:
    """Accelerations (E, 3) back into the ellipsoid of these radii, of fish at an offset (E, 3) from its centre."""
    scaled = offset / (1.0 if radii is None else radii)
    reach = np.linalg.norm(scaled, axis=1, keepdims=True)
    return -CONFINE * np.clip(reach - 1, 0, None) / np.maximum(reach, 1e-6) * scaled


def _crossed(middle: np.ndarray, leaves: np.ndarray, displacement: np.ndarray, lasts: float, time: float
             ) -> np.ndarray:
    """Centres of the fish's groups (E, 3), their velocities and accelerations, stacked.

    From its time in `leaves` (E,) on a fish moves by its displacement (E, 3) with minimum jerk, within `lasts` seconds.
    """
    s = np.clip((time - leaves) / lasts, 0, 1)[:, None]
    return np.stack([middle + displacement * s**3 * (10 + s * (6 * s - 15)),
                     displacement / lasts * 30 * (s * (1 - s)) ** 2,
                     displacement / lasts**2 * 60 * s * (1 - s) * (1 - 2 * s)])


def _wandering(rng: np.random.Generator, count: int) -> Callable[[float], np.ndarray]:
    """The velocities (E, 3) that the fish seek at a time: three slow sines along each axis."""
    pace = 2 * np.pi * rng.uniform(0.10, 0.42, (3, count, 3))
    phase = rng.uniform(0, 2 * np.pi, (3, count, 3))
    return lambda time: WANDER * np.sqrt(2 / 3) * np.sin(pace * time + phase).sum(0)


def _carrying(rng: np.random.Generator, extent: np.ndarray) -> Callable[[np.ndarray, float], np.ndarray]:
    """Velocities (E, 3), at places (E, 3) and a time, of a flow common to all: four travelling transverse waves.

    So it is free of divergence; each has a whole number of wavelengths in the box.
    """
    number = np.array([[1, 0, 0], [1, 0, 1], [0, 1, 1], [1, 1, -1]]) * rng.choice([-1, 1], (4, 1))
    wave = 2 * np.pi * number / extent
    along = rng.normal(size=(4, 3)) * np.array([0.6, 0.5, 1.0])
    along -= wave * (along * wave).sum(1, keepdims=True) / (wave * wave).sum(1, keepdims=True)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    pace, phase = 2 * np.pi * rng.uniform(0.1, 0.25, 4), rng.uniform(0, 2 * np.pi, 4)
    return lambda place, time: CARRY / np.sqrt(2) * np.sin(place @ wave.T - pace * time + phase) @ along


def tracked(tracks: np.ndarray, rate: float, *, spacing: float = 1.0, length: float = LENGTH,
            smoothing: int = 9) -> tuple[Elements, float]:
    """Fish tracked in a film as an exemplar (ma13 §6.4, figure 11a).

    tracks     (T, E, 2): x to the right and y down, pixels, as trackers number them
    rate       frames per second
    spacing    world units: tracks are scaled so that the median distance of a fish from its nearest is this
    length     of a fish, in spacings
    smoothing  frames, odd, of the window in which a track is a cubic polynomial (Savitzky and Golay)
    A tracker's steps of a pixel are smoothed, and the mean motion is removed: positions are relative to the school's
    middle and heading, x ahead and y to the left.
    Raises ValueError for tracks of one fish, of fewer frames than the window, with gaps, or of a school at rest.
    """
    pixels = np.asarray(tracks, np.float64)
    if pixels.ndim != 3 or pixels.shape[2] != 2 or pixels.shape[1] < 2:
        raise ValueError(f"tracks are (frames, fish, 2) of two fish or more, not {pixels.shape}")
    if smoothing % 2 == 0 or smoothing < 5:
        raise ValueError(f"smoothing = {smoothing} is not an odd number of frames, 5 or more")
    if len(pixels) < smoothing:
        raise ValueError(f"tracks of {len(pixels)} frames are shorter than the {smoothing} of their smoothing")
    if not (np.isfinite(rate) and rate > 0 and np.isfinite(spacing) and spacing > 0 and length > 0):
        raise ValueError(f"rate, spacing and length are above 0, not {rate}, {spacing} and {length}")
    gap = np.argwhere(~np.isfinite(pixels))
    if len(gap):
        raise ValueError(f"frame {gap[0][0] + 1}, element {gap[0][1] + 1} is not finite")
    smooth = signal.savgol_filter(pixels * [1, -1], smoothing, 3, axis=0)
    middle = smooth.mean(1)
    # the heading is that of the school as a whole, not of each swerve
    velocity = ndimage.gaussian_filter1d(np.gradient(middle, axis=0), smoothing / 2, axis=0, mode="nearest")
    pace = np.linalg.norm(velocity, axis=1)
    if not pace.mean() > 1e-3:
        raise ValueError("the tracked school is at rest: it has no direction in which it swims")
    ahead = velocity / np.maximum(pace, 1e-9)[:, None]
    offset = smooth - middle[:, None]
    own = np.stack([(offset * ahead[:, None]).sum(-1),
                    offset[..., 1] * ahead[:, None, 0] - offset[..., 0] * ahead[:, None, 1]], -1)
    nearest = np.concatenate([cKDTree(frame).query(frame, k=2)[0][:, 1] for frame in own])
    if not np.median(nearest) > 0:
        raise ValueError("the tracked fish are all in one place")
    scale = spacing / np.median(nearest)
    speed = float(pace.mean() * rate * scale)
    return Elements((own * scale)[:, :, None].astype(np.float32), rate=rate,
                    size=np.full(own.shape[1], length * spacing), colour=np.tile(SILVER, (own.shape[1], 1))), speed
