"""Surfaces of elements: threads as tubes, sheets as shells, fish that bend, and solids for particles in the plane.

    tubes     threads, round and smooth, with rounded ends
    sheets    sheets of one layer; shells: with a thickness
    swimming  which way fish look on their tracks, where their tail is in its beat, how they turn
    fish      bodies with fins and eyes, bent by their beat and their turns
    solids    particles of the plane as beads, discs, stars and leaves that lie on it

Each makes the surfaces of all elements in one frame as one mesh. Which vertex is which depends on the shape of the
arrays only, so an animation is one mesh that moves. World units; y is up.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from scipy.interpolate import CubicSpline, PchipInterpolator

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
STEEPEST = 0.9  # rise of a fish's heading over its run, at most: it is drawn upright
LEAN = 0.55  # roll into a turn, radians per radian that the body bends
LEAN_MOST = 0.6
BEND_MOST = 1.3  # radians from nose to tail
STRIDE = 0.7  # lengths that a fish swims in a beat of its tail
CALM = 0.06  # seconds over which a track is smoothed before its heading is read

# solids: profiles of (share of the outline, height over the radius), from the plane to the top
DOME = np.array([[np.cos(a), 1 + np.sin(a)] for a in np.linspace(-0.45, 0.47, 9) * np.pi])
TILE = np.array([[0.95, 0.0], [1.0, 0.05], [1.0, 0.24], [0.985, 0.29], [0.95, 0.325], [0.90, 0.34], [0.5, 0.345]])
KINDS = ("bead", "disc", "star", "leaf")


@dataclass(frozen=True)
class Mesh:
    """Surfaces of elements, one after the other.

    vertices  (N, 3) float32, world units
    faces     (M, 3) int32, counter-clockwise seen from outside
    colours   (N, 3) uint8, sRGB
    element   (N,) int32: whose vertex it is
    """

    vertices: np.ndarray
    faces: np.ndarray
    colours: np.ndarray
    element: np.ndarray


def _assembled(vertices: np.ndarray, faces: np.ndarray, colours: np.ndarray) -> Mesh:
    """The mesh of E elements of the same faces (M, 3): vertices (E, V, 3), colours (E, 3) or (E, V, 3) in [0, 1]."""
    count, points = vertices.shape[:2]
    colours = np.broadcast_to(colours if colours.ndim == 3 else colours[:, None], vertices.shape)
    all_faces = faces[None] + (np.arange(count) * points)[:, None, None]
    return Mesh(vertices.reshape(-1, 3).astype(np.float32), all_faces.reshape(-1, 3).astype(np.int32),
                np.rint(np.clip(colours, 0, 1) * 255).astype(np.uint8).reshape(-1, 3),
                np.repeat(np.arange(count, dtype=np.int32), points))


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)


@functools.cache
def _spline(samples: int, fine: int, smoothing: float) -> tuple[np.ndarray, np.ndarray]:
    """What `samples` points in a row are multiplied with to get ((samples - 1) fine + 1) points of a smooth curve,
    and its derivative: (points, samples) float64 each.

    smoothing  0: through the samples (natural cubic spline); 1: near them and without overshoot (cubic B-spline)
    Both start at the first sample and end at the last.
    """
    at = np.arange((samples - 1) * fine + 1) / fine
    if samples < 3:
        weights = np.stack([1 - at, at], 1) if samples == 2 else np.ones((1, 1))
        return weights, np.tile([[-1.0, 1.0]], (len(at), 1)) if samples == 2 else np.zeros((1, 1))
    control = np.eye(samples)
    if smoothing > 0:
        # the natural spline through these values is the B-spline of the samples
        near = np.eye(samples)
        for k in range(1, samples - 1):
            near[k, k - 1:k + 2] = np.array([1, 4, 1]) / 6
        control = (1 - smoothing) * control + smoothing * near
    curve = CubicSpline(np.arange(samples), control, bc_type="natural")
    return curve(at), curve(at, 1)


def tubes(positions: np.ndarray, radius: np.ndarray, colour: np.ndarray, sides: int = 12, fine: int = 4,
          smoothing: float = 1.0) -> Mesh:
    """Threads as closed tubes with round ends.

    positions  (E, S, 3), S ≥ 2: samples along each thread
    radius     (E,), colour (E, 3) sRGB in [0, 1]
    sides      points of a cross section; fine: rings from one sample to the next
    smoothing  of the curve, see `_spline`
    """
    count, samples = positions.shape[:2]
    if samples < 2:
        raise ValueError("a thread has two samples or more")
    weights, slopes = _spline(samples, fine, smoothing)
    curve = np.einsum("ns,esc->enc", weights, positions, optimize=True)
    tangent = _unit(np.einsum("ns,esc->enc", slopes, positions, optimize=True))
    side = carried_along(curve, tangent)
    up = np.cross(tangent, side)

    # each end: rings that shrink on a half sphere, and a pole
    rings = max(2, sides // 4)
    bow = 0.5 * np.pi * np.arange(rings, 0, -1) / (rings + 1)
    last = len(weights) - 1
    station = np.concatenate([np.zeros(rings, int), np.arange(last + 1), np.full(rings, last)])
    ahead = np.concatenate([-np.sin(bow), np.zeros(last + 1), np.sin(bow)[::-1]])
    wide = np.concatenate([np.cos(bow), np.ones(last + 1), np.cos(bow)[::-1]])
    turn = 2 * np.pi * np.arange(sides) / sides
    r = np.asarray(radius, float)[:, None, None]
    centre = curve[:, station] + r * ahead[:, None] * tangent[:, station]
    spoke = (np.cos(turn)[:, None] * side[:, station, None] + np.sin(turn)[:, None] * up[:, station, None])
    ring = centre[:, :, None] + (r * wide[:, None])[..., None] * spoke
    poles = curve[:, [0, last]] + r * np.array([[-1.0], [1.0]]) * tangent[:, [0, last]]
    vertices = np.concatenate([ring.reshape(count, -1, 3), poles], 1)
    return _assembled(vertices, _tube_faces(len(station), sides), np.asarray(colour))


def carried_along(curve: np.ndarray, tangent: np.ndarray) -> np.ndarray:
    """Unit vectors (E, n, 3) across the tangents (E, n, 3) of curves (E, n, 3) that turn about them as little as they
    can, by double reflection [Wang et al. 2008]."""
    side = np.empty_like(tangent)
    # an odd direction: threads that run along it are rare
    here = np.array([0.36, 0.48, 0.80]) - (tangent[:, 0] @ [0.36, 0.48, 0.80])[:, None] * tangent[:, 0]
    side[:, 0] = here = _unit(here)
    for k in range(1, curve.shape[1]):
        step = curve[:, k] - curve[:, k - 1]
        here, ahead = _reflected(here, step), _reflected(tangent[:, k - 1], step)
        here = _reflected(here, tangent[:, k] - ahead)
        # rounding adds up along a thread
        here = here - (here * tangent[:, k]).sum(-1, keepdims=True) * tangent[:, k]
        side[:, k] = here = _unit(here)
    return side


def _reflected(vectors: np.ndarray, across: np.ndarray) -> np.ndarray:
    """Vectors (E, 3) mirrored in the planes at right angles to `across` (E, 3); as they are where that is zero."""
    square = (across**2).sum(-1, keepdims=True)
    share = 2 * (vectors * across).sum(-1, keepdims=True) / np.where(square > 1e-20, square, np.inf)
    return vectors - share * across


def _tube_faces(rings: int, sides: int) -> np.ndarray:
    """Triangles of `rings` rings, one after the other along a tube, and of its two poles, which come last."""
    ring, point = (index.ravel() for index in np.meshgrid(np.arange(rings - 1), np.arange(sides), indexing="ij"))
    here, beside = ring * sides + point, ring * sides + (point + 1) % sides
    body = np.stack([here, beside, beside + sides, here, beside + sides, here + sides], 1).reshape(-1, 3)
    around = np.arange(sides)
    first, final = rings * sides, rings * sides + 1
    start = np.stack([np.full(sides, first), (around + 1) % sides, around], 1)
    top = (rings - 1) * sides
    end = np.stack([np.full(sides, final), top + around, top + (around + 1) % sides], 1)
    return np.concatenate([body, start, end])


def sheets(positions: np.ndarray, colour: np.ndarray, fine: int = 4) -> Mesh:
    """Sheets of one layer, to be drawn from both sides, through a bicubic spline of their samples.

    positions  (E, R, C, 3), R and C ≥ 2: samples of each sheet, by rows and columns
    colour     (E, 3) sRGB in [0, 1]
    fine       points from one sample to the next
    """
    middle, _ = _fitted(positions, fine)
    return _assembled(middle.reshape(len(middle), -1, 3), _grid_faces(*middle.shape[1:3]), np.asarray(colour))


def shells(positions: np.ndarray, thickness: np.ndarray, colour: np.ndarray, fine: int = 4) -> Mesh:
    """Sheets with two sides and a rim; positions, colour and fine as for `sheets`, thickness (E,).

    The rim has vertices of its own, so that its edges are sharp; where they coincide the shell is closed.
    """
    middle, normal = _fitted(positions, fine)
    count, rows, columns = middle.shape[:3]
    half = 0.5 * np.asarray(thickness, float)[:, None, None, None] * normal
    upper, lower = ((middle + way * half).reshape(count, -1, 3) for way in (1, -1))
    loop = _border(rows, columns)
    vertices = np.concatenate([upper, lower, lower[:, loop], upper[:, loop]], 1)
    return _assembled(vertices, _shell_faces(rows, columns), np.asarray(colour))


def _fitted(positions: np.ndarray, fine: int) -> tuple[np.ndarray, np.ndarray]:
    """Points (E, rows, columns, 3) of smooth sheets, and the unit normals there."""
    if min(positions.shape[1:3]) < 2:
        raise ValueError("a sheet has two rows and two columns or more")
    down, down_slope = _spline(positions.shape[1], fine, 0.0)
    along, along_slope = _spline(positions.shape[2], fine, 0.0)

    def product(by_row: np.ndarray, by_column: np.ndarray) -> np.ndarray:
        return np.einsum("rp,epqc,sq->ersc", by_row, positions, by_column, optimize=True)

    return product(down, along), _unit(np.cross(product(down_slope, along), product(down, along_slope)))


def _border(rows: int, columns: int) -> np.ndarray:
    """Indices of a grid's points round its border, counter-clockwise about rows × columns."""
    index = np.arange(rows * columns).reshape(rows, columns)
    return np.concatenate([index[:-1, 0], index[-1, :-1], index[:0:-1, -1], index[0, :0:-1]])


def _grid_faces(rows: int, columns: int) -> np.ndarray:
    """Triangles of a grid of points, counter-clockwise about rows × columns."""
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    below = corner + columns
    return np.stack([corner, below, below + 1, corner, below + 1, corner + 1], 1).reshape(-1, 3)


def _shell_faces(rows: int, columns: int) -> np.ndarray:
    """Triangles of the upper grid, the lower grid, and the rim between two rows of its own vertices."""
    side = _grid_faces(rows, columns)
    points, border = rows * columns, 2 * (rows + columns - 2)
    low, following = 2 * points + np.arange(border), 2 * points + (np.arange(border) + 1) % border
    rim = np.stack([low, following, following + border, low, following + border, low + border], 1).reshape(-1, 3)
    return np.concatenate([side, points + side[:, ::-1], rim])


@dataclass(frozen=True)
class Gait:
    """How fish swim on their tracks, of T frames and E fish.

    heading  (T, E, 3), unit: which way they look
    phase    (T, E), radians: where the tail is in its beat; grows, the faster they swim the faster
    turn     (T, E), radians per length, positive to the left: how their bodies are bent
    """

    heading: np.ndarray
    phase: np.ndarray
    turn: np.ndarray


def swimming(track: np.ndarray, length: np.ndarray, rate: float, seed: int = 1) -> Gait:
    """How fish swim on tracks (T, E, 3), T ≥ 2, world units, at `rate` frames per second; length (E,), world units.

    A fish that rests looks the way it looked, and beats slowly. Fish beat out of step, as `seed` tells.
    """
    frames, count = track.shape[:2]
    smooth = ndimage.gaussian_filter1d(np.asarray(track, float), CALM * rate, axis=0, mode="nearest")
    velocity = np.gradient(smooth, 1 / rate, axis=0)
    speed = np.linalg.norm(velocity, axis=-1)
    size = np.asarray(length, float)
    heading = _unit(velocity)
    rest = 0.05 * size  # per second: what is slower is noise
    awake = np.clip(speed / rest, 0, 1)[..., None]
    first = np.argmax(speed > rest, axis=0)
    before = heading[first, np.arange(count)]
    before = np.where(np.linalg.norm(before, axis=-1, keepdims=True) > 0.5, before, [1.0, 0.0, 0.0])
    for t in range(frames):
        heading[t] = before = _unit(awake[t] * heading[t] + (1 - awake[t]) * before)
    level = np.arctan2(-heading[..., 2], heading[..., 0])
    turned = np.gradient(np.unwrap(level, axis=0), 1 / rate, axis=0)
    turn = size * turned / np.maximum(speed, 0.5 * size)
    turn = ndimage.gaussian_filter1d(turn, CALM * rate, axis=0, mode="nearest")
    beats = np.maximum(speed / (STRIDE * size), 0.4)
    start = np.random.Generator(np.random.Philox(key=seed)).uniform(0, 2 * np.pi, count)
    phase = start + 2 * np.pi * np.cumsum(beats, axis=0) / rate
    return Gait(heading, phase, np.clip(turn, -BEND_MOST, BEND_MOST))


def fish(position: np.ndarray, heading: np.ndarray, length: np.ndarray, colour: np.ndarray, phase: np.ndarray,
         turn: np.ndarray, detail: int = 1) -> Mesh:
    """Fish that swim upright: bodies with fins and eyes, bent by a wave that runs to the tail and by their turn.

    position  (E, 3): of the point PIVOT behind the nose; heading (E, 3), need not be unit
    length    (E,), colour (E, 3) sRGB in [0, 1]: of the flanks
    phase     (E,) radians: of the tail's beat
    turn      (E,) radians from nose to tail, positive to the left
    detail    1 for a shoal; 2 and more for fish that are looked at
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
    return _assembled(vertices, shape.faces, _painted(shape.paint, np.asarray(colour, float)))


def _upright(heading: np.ndarray, turn: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Axes (E, 3) of fish: ahead, left, up; no steeper than STEEPEST, leaning into their turns."""
    flat = np.linalg.norm(heading[:, [0, 2]], axis=1)
    level = np.where(flat > 1e-9, heading[:, [0, 2]].T / np.maximum(flat, 1e-9), [[1.0], [0.0]])
    rise = STEEPEST * np.tanh(heading[:, 1] / np.maximum(flat, 1e-9) / STEEPEST)
    ahead = _unit(np.stack([level[0], rise, level[1]], 1))
    left = _unit(np.cross([0.0, 1.0, 0.0], ahead))
    up = np.cross(ahead, left)
    roll = LEAN_MOST * np.tanh(LEAN * turn / LEAN_MOST)[:, None]
    return ahead, np.cos(roll) * left - np.sin(roll) * up, np.cos(roll) * up + np.sin(roll) * left


def _bent(phase: np.ndarray, turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The spine (E, JOINTS, 2) ahead and left of the pivot, in lengths, and the directions (E, JOINTS, 2) to its left.

    Its steps keep their length: the bend is one of directions.
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
    # a wave sways the pivot too
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
    """How far a body's side is from the middle, at a height over the spine."""
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
    return _Template(points, _tube_faces(len(s), sides)[:, ::-1], _countershaded(high, points[:, 0]))


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
    return _Template(points, _grid_faces(rows + 1, len(edge)), paint)


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


def _median(start: float, end: float, profile: np.ndarray, way: int, height: float, sweep: float,
            detail: int) -> _Template:
    """A fin that stands on the back (way 1) or hangs from the belly (-1), swept back, high in front."""
    share = np.linspace(0, 1, 4 * detail + 1)
    s = start + share * (end - start)
    foot = _outline(profile, s)
    rise = height * np.minimum(1, share / 0.2) ** 0.7 * (1 - 0.78 * _step(0.15, 1.0, share))
    zero = np.zeros_like(s)
    return _fin(np.stack([s, way * (foot - 0.012), zero], 1),
                np.stack([s + sweep * np.minimum(1, share / 0.2), way * (foot + rise), zero], 1), detail)


def _paired(s: float, y: float, side: int, way: tuple[float, float, float], detail: int) -> _Template:
    """A fin beside the body that points back, down and out by `way`."""
    half = _half_width(s, y)
    share = np.linspace(0, 1, 2 * detail + 1)
    root = np.stack([s + 0.01 * share, y - 0.030 * share, np.full_like(share, side * (half - 0.006))], 1)
    tip = root + np.array([way[0], way[1], side * way[2]]) * (1 - 0.45 * share**1.5)[:, None]
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


def solids(position: np.ndarray, radius: np.ndarray, colour: np.ndarray, kind: np.ndarray | None = None,
           angle: np.ndarray | None = None, detail: int = 32) -> Mesh:
    """Particles of the plane as solids that lie on it: x, y of the plane, z up out of it.

    position  (E, 2); radius (E,): of the circle round each; colour (E, 3) sRGB in [0, 1]
    kind      (E,) int, an index into KINDS; beads if none is given
    angle     (E,) radians, how far each is turned counter-clockwise
    detail    points round an outline, a multiple of 20
    """
    count = len(position)
    kind = np.zeros(count, int) if kind is None else np.asarray(kind)
    angle = np.zeros(count) if angle is None else np.asarray(angle, float)
    if len(kind) and not 0 <= kind.min() <= kind.max() < len(KINDS):
        raise ValueError(f"a kind of solid is 0 to {len(KINDS) - 1} ({', '.join(KINDS)})")
    parts = []
    for k in np.unique(kind):
        who = np.flatnonzero(kind == k)
        points, faces = _solid(int(k), detail)
        c, s = np.cos(angle[who])[:, None], np.sin(angle[who])[:, None]
        turned = np.stack([c * points[:, 0] - s * points[:, 1], s * points[:, 0] + c * points[:, 1],
                           np.broadcast_to(points[:, 2], (len(who), len(points)))], -1)
        place = np.column_stack([np.asarray(position, float)[who], np.zeros(len(who))])
        mesh = _assembled(place[:, None] + np.asarray(radius, float)[who, None, None] * turned, faces,
                          np.asarray(colour, float)[who])
        parts.append(Mesh(mesh.vertices, mesh.faces, mesh.colours, who[mesh.element].astype(np.int32)))
    return joined(parts)


def joined(parts: list[Mesh]) -> Mesh:
    """Meshes as one; their elements keep their numbers."""
    if not parts:
        return _assembled(np.zeros((0, 1, 3)), np.zeros((0, 3), int), np.zeros((0, 3)))
    starts = np.cumsum([0] + [len(part.vertices) for part in parts[:-1]]).astype(np.int32)
    return Mesh(np.concatenate([part.vertices for part in parts]),
                np.concatenate([part.faces + start for part, start in zip(parts, starts, strict=True)]),
                np.concatenate([part.colours for part in parts]), np.concatenate([part.element for part in parts]))


@functools.cache
def _solid(kind: int, detail: int) -> tuple[np.ndarray, np.ndarray]:
    """A solid of radius 1 on the plane z = 0: points (V, 3) and faces (M, 3)."""
    turn = 2 * np.pi * np.arange(detail) / detail
    reach = {"bead": np.ones(detail), "disc": np.ones(detail), "star": 0.74 + 0.26 * np.cos(5 * turn),
             "leaf": np.ones(detail)}[KINDS[kind]]
    outline = np.stack([reach * np.cos(turn), reach * np.sin(turn)], 1)
    if KINDS[kind] == "leaf":
        # pointed at both ends
        outline = np.stack([np.cos(turn), 0.46 * np.sign(np.sin(turn)) * np.abs(np.sin(turn)) ** 1.5], 1)
    profile = DOME if KINDS[kind] == "bead" else TILE
    ring = np.concatenate([np.column_stack([wide * outline, np.full(detail, high)]) for wide, high in profile])
    poles = np.array([[0.0, 0.0, profile[0, 1]], [0.0, 0.0, profile[-1, 1] + (0.006 if KINDS[kind] == "bead" else 0)]])
    return np.concatenate([ring, poles]), _tube_faces(len(profile), detail)
