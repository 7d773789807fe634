"""Fish: how they swim along their tracks, and their surfaces.

    swimming  headings, phases of the tail beat and bends of fish along their tracks
    bodies    one mesh of all fish in a frame, with fins and eyes, bent by their beats and turns

World units; y is up. Lengths of a body are shares of the fish's.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from scipy.interpolate import PchipInterpolator

from synth.elements import mesh

# a fish, in its lengths: from the nose s = 0 to the end of its tail fin s = 1
STATIONS = np.array([0.0, 0.03, 0.08, 0.16, 0.26, 0.38, 0.50, 0.62, 0.73, 0.81, 0.86])
BACK = np.array([0.003, 0.024, 0.046, 0.072, 0.092, 0.100, 0.090, 0.070, 0.046, 0.027, 0.023])  # above the spine
BELLY = np.array([0.003, 0.022, 0.048, 0.082, 0.106, 0.112, 0.098, 0.070, 0.041, 0.024, 0.021])  # below it
FLANK = np.array([0.003, 0.022, 0.040, 0.055, 0.062, 0.060, 0.050, 0.035, 0.020, 0.010, 0.007])  # beside it
AROUND = 12  # points of a cross section
EYE = (0.085, 0.014, 0.017)  # where it is: s, height over the spine; its radius
PIVOT = 0.36  # s of the point that a track moves
JOINTS = 33  # points of the spine
WAVES = 0.95  # of the body's bend, from nose to tail
SWAY = (0.020, -0.065, 0.135)  # how far a point sways: c0 + c1 s + c2 s², for a carangiform swimmer [Videler 1993]
STEEPEST = 0.9  # slope of a fish's heading, at most: it is drawn upright
LEAN = 0.55  # roll into a turn, radians per radian that the body bends
LEAN_MOST = 0.6
BEND_MOST = 1.3  # radians from nose to tail
STRIDE = 0.7  # lengths that a fish swims per beat of its tail
CALM = 0.06  # seconds over which a track is smoothed to find its heading


@dataclass(frozen=True)
class Gait:
    """How fish swim on their tracks, of T frames and E fish.

    heading  (T, E, 3) unit directions
    phase    (T, E) of the tail beat, radians; grows faster at higher speed
    turn     (T, E) bend of the body, radians per length, positive to the left
    """

    heading: np.ndarray
    phase: np.ndarray
    turn: np.ndarray


def swimming(track: np.ndarray, length: np.ndarray, rate: float, seed: int = 1) -> Gait:
    """How fish swim on tracks (T, E, 3), T ≥ 2, world units, at `rate` frames per second; length (E,), world units.

    A fish at rest keeps its heading, and beats slowly. The beats are out of phase, drawn by `seed`.
    """
    frames, count = track.shape[:2]
    smooth = ndimage.gaussian_filter1d(np.asarray(track, float), CALM * rate, axis=0, mode="nearest")
    velocity = np.gradient(smooth, 1 / rate, axis=0)
    speed = np.linalg.norm(velocity, axis=-1)
    size = np.asarray(length, float)
    heading = mesh.unit(velocity)
    rest = 0.05 * size  # per second: what is slower is noise
    awake = np.clip(speed / rest, 0, 1)[..., None]
    first = np.argmax(speed > rest, axis=0)
    before = heading[first, np.arange(count)]
    before = np.where(np.linalg.norm(before, axis=-1, keepdims=True) > 0.5, before, [1.0, 0.0, 0.0])
    for t in range(frames):
        heading[t] = before = mesh.unit(awake[t] * heading[t] + (1 - awake[t]) * before)
    level = np.arctan2(-heading[..., 2], heading[..., 0])
    turned = np.gradient(np.unwrap(level, axis=0), 1 / rate, axis=0)
    turn = size * turned / np.maximum(speed, 0.5 * size)
    turn = ndimage.gaussian_filter1d(turn, CALM * rate, axis=0, mode="nearest")
    beats = np.maximum(speed / (STRIDE * size), 0.4)
    start = np.random.Generator(np.random.Philox(key=seed)).uniform(0, 2 * np.pi, count)
    phase = start + 2 * np.pi * np.cumsum(beats, axis=0) / rate
    return Gait(heading, phase, np.clip(turn, -BEND_MOST, BEND_MOST))


def bodies(position: np.ndarray, heading: np.ndarray, length: np.ndarray, colour: np.ndarray, phase: np.ndarray,
         turn: np.ndarray, detail: int = 1) -> mesh.Mesh:
    """Fish that swim upright: bodies with fins and eyes, bent by a wave that runs to the tail and by their turn.

    position  (E, 3): of the point PIVOT behind the nose; heading (E, 3), need not be unit
    length    (E,), colour (E, 3) sRGB in [0, 1]: of the flanks
    phase     (E,) radians: of the tail's beat
    turn      (E,) radians from nose to tail, positive to the left
    detail    1 for a school; 2 and more for close-ups
    """
    shape = _template(detail)
    ahead, left, up = _upright(np.asarray(heading, float), np.asarray(turn, float))
    spine, aside = _bent(np.asarray(phase, float), np.asarray(turn, float))
    along = shape.points[:, 0] * (JOINTS - 1)
    low = np.minimum(along.astype(int), JOINTS - 2)
    share = (along - low)[None, :, None]
    middle = spine[:, low] * (1 - share) + spine[:, low + 1] * share
    across = aside[:, low] * (1 - share) + aside[:, low + 1] * share
    # in the fish's own axes: ahead, left, up
    own = np.concatenate([middle + across * shape.points[None, :, 2:3],
                          np.broadcast_to(shape.points[None, :, 1:2], (*middle.shape[:2], 1))], -1)
    axes = np.stack([ahead, left, up], 1)
    size = np.asarray(length, float)[:, None, None]
    vertices = np.asarray(position, float)[:, None] + size * np.einsum("evk,ekc->evc", own, axes, optimize=True)
    return mesh.assembled(vertices, shape.faces, _painted(shape.paint, np.asarray(colour, float)))


def _upright(heading: np.ndarray, turn: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Axes (E, 3) of fish: ahead, left, up; no steeper than STEEPEST, leaning into their turns."""
    flat = np.linalg.norm(heading[:, [0, 2]], axis=1)
    level = np.where(flat > 1e-9, heading[:, [0, 2]].T / np.maximum(flat, 1e-9), [[1.0], [0.0]])
    rise = STEEPEST * np.tanh(heading[:, 1] / np.maximum(flat, 1e-9) / STEEPEST)
    ahead = mesh.unit(np.stack([level[0], rise, level[1]], 1))
    left = mesh.unit(np.cross([0.0, 1.0, 0.0], ahead))
    up = np.cross(ahead, left)
    roll = LEAN_MOST * np.tanh(LEAN * turn / LEAN_MOST)[:, None]
    return ahead, np.cos(roll) * left - np.sin(roll) * up, np.cos(roll) * up + np.sin(roll) * left


def _bent(phase: np.ndarray, turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The spine (E, JOINTS, 2) ahead and left of the pivot, in lengths, and the directions (E, JOINTS, 2) to its left.

    Its segments keep their length: only directions are bent.
    """
    s = (np.arange(JOINTS - 1) + 0.5) / (JOINTS - 1)
    c0, c1, c2 = SWAY
    wave = phase[:, None] - 2 * np.pi * WAVES * s
    slope = ((c1 + 2 * c2 * s) * np.sin(wave) - (c0 + c1 * s + c2 * s**2) * 2 * np.pi * WAVES * np.cos(wave))
    bend = np.clip(turn, -BEND_MOST, BEND_MOST)[:, None]
    angle = np.arctan(slope) + bend * (s - PIVOT)
    step = np.stack([-np.cos(angle), np.sin(angle)], -1) / (JOINTS - 1)
    spine = np.concatenate([np.zeros((len(step), 1, 2)), np.cumsum(step, 1)], 1)
    at = PIVOT * (JOINTS - 1)
    low = int(at)
    spine -= (spine[:, low] + (at - low) * (spine[:, low + 1] - spine[:, low]))[:, None]
    # the wave moves the pivot too
    spine[..., 1] += ((c0 + c1 * PIVOT + c2 * PIVOT**2) * np.sin(phase - 2 * np.pi * WAVES * PIVOT))[:, None]
    joint = np.concatenate([angle[:, :1], 0.5 * (angle[:, :-1] + angle[:, 1:]), angle[:, -1:]], 1)
    return spine, np.stack([np.sin(joint), np.cos(joint)], -1)


@dataclass(frozen=True)
class _Template:
    """A fish at rest, in its lengths: points (V, 3) of s, height over the spine, distance to its left; faces (M, 3);
    paint (V, 5): shares of back, flank, belly, fin and eye; an eye's share is 1 for its pupil, -1 for its ring."""

    points: np.ndarray
    faces: np.ndarray
    paint: np.ndarray


@functools.cache
def _template(detail: int) -> _Template:
    parts = [_body(detail), *_fins(detail), _eye(detail, 1), _eye(detail, -1)]
    starts = np.cumsum([0] + [len(part.points) for part in parts[:-1]])
    return _Template(np.concatenate([part.points for part in parts]),
                     np.concatenate([part.faces + start for part, start in zip(parts, starts, strict=True)]),
                     np.concatenate([part.paint for part in parts]))


def _step(low: float, high: float, x: np.ndarray) -> np.ndarray:
    share = np.clip((x - low) / (high - low), 0, 1)
    return share * share * (3 - 2 * share)


def _outline(profile: np.ndarray, s: np.ndarray) -> np.ndarray:
    return np.asarray(PchipInterpolator(STATIONS, profile)(s))


def _half_width(s: float, y: float) -> float:
    """Half the width of a body at a height over the spine."""
    half, high, low = (float(np.interp(s, STATIONS, profile)) for profile in (FLANK, BACK, BELLY))
    return half * float(np.sqrt(max(1 - (y / (high if y > 0 else low)) ** 2, 0.05)))


def _body(detail: int) -> _Template:
    """A closed tube of ellipses, higher than wide."""
    sides = AROUND * detail
    rings = np.arange((len(STATIONS) - 1) * detail + 1) / detail
    s = np.interp(rings, np.arange(len(STATIONS)), STATIONS)
    # from the left over the back: clockwise, seen along the spine
    turn = 2 * np.pi * np.arange(sides) / sides
    y = np.where(np.sin(turn) > 0, _outline(BACK, s)[:, None], _outline(BELLY, s)[:, None]) * np.sin(turn)
    z = _outline(FLANK, s)[:, None] * np.cos(turn)
    ring = np.stack([np.broadcast_to(s[:, None], y.shape), y, z], -1).reshape(-1, 3)
    points = np.concatenate([ring, [[0.0, 0.0, 0.0], [s[-1] + 0.01, 0.0, 0.0]]])
    high = np.concatenate([np.tile(np.sin(turn), len(s)), [0.0, 0.0]])
    return _Template(points, mesh.tube_faces(len(s), sides)[:, ::-1], _countershaded(high, points[:, 0]))


def _countershaded(high: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Paint (V, 5) of a body: dark above, light below; high: -1 at the belly to 1 at the back."""
    back = _step(0.05, 0.75, high + 0.10 * np.sin(14 * s))
    belly = _step(0.15, 0.85, -high)
    none = np.zeros_like(back)
    return np.stack([back, 1 - back - belly, belly, none, none], 1)


def _fin(edge: np.ndarray, outer: np.ndarray, rows: int) -> _Template:
    """A fin of one layer from its edge (n, 3) on the body to its outer edge (n, 3), in `rows` rows."""
    share = np.linspace(0, 1, rows + 1)[:, None, None]
    grid = edge + share * (outer - edge)
    points = grid.reshape(-1, 3)
    paint = np.zeros((len(points), 5))
    paint[:, 3] = np.repeat(0.55 + 0.45 * share.ravel(), len(edge))
    paint[:, 1] = 1 - paint[:, 3]
    return _Template(points, mesh.grid_faces(rows + 1, len(edge)), paint)


def _fins(detail: int) -> list[_Template]:
    """Tail, dorsal, anal, and the pairs of pectoral and pelvic fins."""
    across = np.linspace(-1, 1, 4 * detail + 1)
    zero = np.zeros_like(across)
    tail = _fin(np.stack([zero + 0.84, 0.020 * across, zero], 1),
                np.stack([0.915 + 0.085 * np.abs(across) ** 1.3, 0.125 * across, zero], 1), 2 * detail)
    return [tail, _median(0.36, 0.60, BACK, 1, 0.056, 0.055, detail),
            _median(0.63, 0.76, BELLY, -1, 0.045, 0.035, detail),
            *(_paired(0.235, -0.030, side, (0.115, -0.045, 0.060), detail) for side in (1, -1)),
            *(_paired(0.43, -0.085, side, (0.070, -0.040, 0.018), detail) for side in (1, -1))]


def _median(start: float, end: float, profile: np.ndarray, sign: int, height: float, sweep: float,
            detail: int) -> _Template:
    """A fin that stands on the back (sign 1) or hangs from the belly (-1), swept back, high in front."""
    share = np.linspace(0, 1, 4 * detail + 1)
    s = start + share * (end - start)
    foot = _outline(profile, s)
    rise = height * np.minimum(1, share / 0.2) ** 0.7 * (1 - 0.78 * _step(0.15, 1.0, share))
    zero = np.zeros_like(s)
    return _fin(np.stack([s, sign * (foot - 0.012), zero], 1),
                np.stack([s + sweep * np.minimum(1, share / 0.2), sign * (foot + rise), zero], 1), detail)


def _paired(s: float, y: float, side: int, reach: tuple[float, float, float], detail: int) -> _Template:
    """A fin beside the body that points back, down and out by `reach`."""
    half = _half_width(s, y)
    share = np.linspace(0, 1, 2 * detail + 1)
    root = np.stack([s + 0.01 * share, y - 0.030 * share, np.full_like(share, side * (half - 0.006))], 1)
    tip = root + np.array([reach[0], reach[1], side * reach[2]]) * (1 - 0.45 * share**1.5)[:, None]
    return _fin(root, tip, detail)


def _eye(detail: int, side: int) -> _Template:
    """A low dome on the head: a dark pupil in a bright ring."""
    s, y, radius = EYE
    sides = 8 * detail
    half = _half_width(s, y)
    turn = 2 * np.pi * np.arange(sides) / sides
    circle = np.stack([np.cos(turn), np.sin(turn)], 1)
    rings = [(1.0, -0.35), (0.85, 0.22), (0.60, 0.42), (0.52, 0.46)]
    points = [np.column_stack([s + radius * wide * circle[:, 0], y + radius * wide * circle[:, 1],
                               np.full(sides, side * (half + radius * high))]) for wide, high in rings]
    points.append(np.array([[s, y, side * (half + 0.62 * radius)]]))
    ring, point = (index.ravel() for index in np.meshgrid(np.arange(len(rings) - 1), np.arange(sides), indexing="ij"))
    here, beside = ring * sides + point, ring * sides + (point + 1) % sides
    body = np.stack([here, beside, beside + sides, here, beside + sides, here + sides], 1).reshape(-1, 3)
    top = (len(rings) - 1) * sides
    cap = np.stack([np.full(sides, top + sides), top + np.arange(sides), top + (np.arange(sides) + 1) % sides], 1)
    faces = np.concatenate([body, cap])
    paint = np.zeros((top + sides + 1, 5))
    paint[:top, 4], paint[top:, 4] = -1.0, 1.0
    return _Template(np.concatenate(points), faces if side > 0 else faces[:, ::-1], paint)


def _painted(paint: np.ndarray, colour: np.ndarray) -> np.ndarray:
    """Colours (E, V, 3) sRGB of fish whose flanks are `colour` (E, 3)."""
    grey = colour.mean(1, keepdims=True)
    back = 0.32 * colour + 0.04 * (grey + np.array([0.0, 0.6, 1.0]))
    belly = np.clip(0.35 * colour + 0.66, 0, 0.97)
    fin = np.clip(0.60 * colour + 0.04, 0, 1)
    palette = np.stack([back, colour, belly, fin], 1)
    painted = np.einsum("vk,ekc->evc", paint[:, :4], palette, optimize=True)
    eye = paint[:, 4]
    painted[:, eye > 0] = 0.02
    painted[:, eye < 0] = np.array([0.86, 0.82, 0.66])
    return painted
