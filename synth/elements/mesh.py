"""Surfaces of elements: threads as tubes, sheets as shells, particles in 2-D as solid shapes (fish: `fish`).

    tubes   threads, round and smooth, with rounded ends
    sheets  sheets of one layer; shells: with a thickness
    solids  particles in 2-D as beads, discs, stars and leaves that lie on the plane

Each makes the surfaces of all elements in one frame as one mesh. The vertices' order depends on the shape of the
arrays only, so an animation is one mesh that moves. World units; y is up.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

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


def assembled(vertices: np.ndarray, faces: np.ndarray, colours: np.ndarray) -> Mesh:
    """The mesh of E elements of the same faces (M, 3): vertices (E, V, 3), colours (E, 3) or (E, V, 3) in [0, 1]."""
    count, points = vertices.shape[:2]
    colours = np.broadcast_to(colours if colours.ndim == 3 else colours[:, None], vertices.shape)
    all_faces = faces[None] + (np.arange(count) * points)[:, None, None]
    return Mesh(vertices.reshape(-1, 3).astype(np.float32), all_faces.reshape(-1, 3).astype(np.int32),
                np.rint(np.clip(colours, 0, 1) * 255).astype(np.uint8).reshape(-1, 3),
                np.repeat(np.arange(count, dtype=np.int32), points))


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)


@functools.cache
def _spline(samples: int, fine: int, smoothing: float) -> tuple[np.ndarray, np.ndarray]:
    """The matrices that map `samples` points of a curve to ((samples - 1) fine + 1) points of a smooth curve,
    and to its derivative: (points, samples) float64 each.

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
    tangent = unit(np.einsum("ns,esc->enc", slopes, positions, optimize=True))
    side = carried_along(curve, tangent)
    up = np.cross(tangent, side)

    # each end: rings that shrink on a half sphere, and a pole
    rings = max(2, sides // 4)
    bow = 0.5 * np.pi * np.arange(rings, 0, -1) / (rings + 1)
    last = len(weights) - 1
    station = np.concatenate([np.zeros(rings, int), np.arange(last + 1), np.full(rings, last)])
    ahead = np.concatenate([-np.sin(bow), np.zeros(last + 1), np.sin(bow)[::-1]])
    wide = np.concatenate([np.cos(bow), np.ones(last + 1), np.cos(bow)[::-1]])
    around = 2 * np.pi * np.arange(sides) / sides
    r = np.asarray(radius, float)[:, None, None]
    centre = curve[:, station] + r * ahead[:, None] * tangent[:, station]
    spoke = (np.cos(around)[:, None] * side[:, station, None] + np.sin(around)[:, None] * up[:, station, None])
    ring = centre[:, :, None] + (r * wide[:, None])[..., None] * spoke
    poles = curve[:, [0, last]] + r * np.array([[-1.0], [1.0]]) * tangent[:, [0, last]]
    vertices = np.concatenate([ring.reshape(count, -1, 3), poles], 1)
    return assembled(vertices, tube_faces(len(station), sides), np.asarray(colour))


def carried_along(curve: np.ndarray, tangent: np.ndarray) -> np.ndarray:
    """Unit vectors (E, n, 3) across the tangents (E, n, 3) of curves (E, n, 3), with the least
    rotation about them, by double reflection [Wang et al. 2008]."""
    side = np.empty_like(tangent)
    # an arbitrary direction: threads along it are rare
    here = np.array([0.36, 0.48, 0.80]) - (tangent[:, 0] @ [0.36, 0.48, 0.80])[:, None] * tangent[:, 0]
    side[:, 0] = here = unit(here)
    for k in range(1, curve.shape[1]):
        step = curve[:, k] - curve[:, k - 1]
        here, ahead = _reflected(here, step), _reflected(tangent[:, k - 1], step)
        here = _reflected(here, tangent[:, k] - ahead)
        # remove the rounding that accumulates along a thread
        here = here - (here * tangent[:, k]).sum(-1, keepdims=True) * tangent[:, k]
        side[:, k] = here = unit(here)
    return side


def _reflected(vectors: np.ndarray, across: np.ndarray) -> np.ndarray:
    """Vectors (E, 3) mirrored in the planes at right angles to `across` (E, 3); as they are where that is zero."""
    square = (across**2).sum(-1, keepdims=True)
    share = 2 * (vectors * across).sum(-1, keepdims=True) / np.where(square > 1e-20, square, np.inf)
    return vectors - share * across


def tube_faces(rings: int, sides: int) -> np.ndarray:
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
    return assembled(middle.reshape(len(middle), -1, 3), grid_faces(*middle.shape[1:3]), np.asarray(colour))


def shells(positions: np.ndarray, thickness: np.ndarray, colour: np.ndarray, fine: int = 4) -> Mesh:
    """Sheets with two sides and a rim; positions, colour and fine as for `sheets`, thickness (E,).

    The rim has vertices of its own, so that its edges are sharp; where they coincide the shell is closed.
    """
    middle, normal = _fitted(positions, fine)
    count, rows, columns = middle.shape[:3]
    half = 0.5 * np.asarray(thickness, float)[:, None, None, None] * normal
    upper, lower = ((middle + sign * half).reshape(count, -1, 3) for sign in (1, -1))
    loop = _border(rows, columns)
    vertices = np.concatenate([upper, lower, lower[:, loop], upper[:, loop]], 1)
    return assembled(vertices, _shell_faces(rows, columns), np.asarray(colour))


def _fitted(positions: np.ndarray, fine: int) -> tuple[np.ndarray, np.ndarray]:
    """Points (E, rows, columns, 3) of smooth sheets, and the unit normals there."""
    if min(positions.shape[1:3]) < 2:
        raise ValueError("a sheet has two rows and two columns or more")
    down, down_slope = _spline(positions.shape[1], fine, 0.0)
    along, along_slope = _spline(positions.shape[2], fine, 0.0)

    def product(by_row: np.ndarray, by_column: np.ndarray) -> np.ndarray:
        return np.einsum("rp,epqc,sq->ersc", by_row, positions, by_column, optimize=True)

    return product(down, along), unit(np.cross(product(down_slope, along), product(down, along_slope)))


def _border(rows: int, columns: int) -> np.ndarray:
    """Indices of a grid's points round its border, counter-clockwise about rows × columns."""
    index = np.arange(rows * columns).reshape(rows, columns)
    return np.concatenate([index[:-1, 0], index[-1, :-1], index[:0:-1, -1], index[0, :0:-1]])


def grid_faces(rows: int, columns: int) -> np.ndarray:
    """Triangles of a grid of points, counter-clockwise about rows × columns."""
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    below = corner + columns
    return np.stack([corner, below, below + 1, corner, below + 1, corner + 1], 1).reshape(-1, 3)


def _shell_faces(rows: int, columns: int) -> np.ndarray:
    """Triangles of the upper grid, the lower grid, and the rim between two rows of its own vertices."""
    side = grid_faces(rows, columns)
    points, border = rows * columns, 2 * (rows + columns - 2)
    low, following = 2 * points + np.arange(border), 2 * points + (np.arange(border) + 1) % border
    rim = np.stack([low, following, following + border, low, following + border, low + border], 1).reshape(-1, 3)
    return np.concatenate([side, points + side[:, ::-1], rim])


def solids(position: np.ndarray, radius: np.ndarray, colour: np.ndarray, kind: np.ndarray | None = None,
           angle: np.ndarray | None = None, detail: int = 32) -> Mesh:
    """Particles in 2-D as solid shapes that lie on the plane: x, y in it, z up.

    position  (E, 2); radius (E,): of the circle round each; colour (E, 3) sRGB in [0, 1]
    kind      (E,) int, an index into KINDS; beads if none is given
    angle     (E,) radians, its rotation, counter-clockwise
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
        rotated = np.stack([c * points[:, 0] - s * points[:, 1], s * points[:, 0] + c * points[:, 1],
                           np.broadcast_to(points[:, 2], (len(who), len(points)))], -1)
        place = np.column_stack([np.asarray(position, float)[who], np.zeros(len(who))])
        mesh = assembled(place[:, None] + np.asarray(radius, float)[who, None, None] * rotated, faces,
                          np.asarray(colour, float)[who])
        parts.append(Mesh(mesh.vertices, mesh.faces, mesh.colours, who[mesh.element].astype(np.int32)))
    return joined(parts)


def joined(parts: list[Mesh]) -> Mesh:
    """Meshes as one; their elements keep their numbers."""
    if not parts:
        return assembled(np.zeros((0, 1, 3)), np.zeros((0, 3), int), np.zeros((0, 3)))
    starts = np.cumsum([0] + [len(part.vertices) for part in parts[:-1]]).astype(np.int32)
    return Mesh(np.concatenate([part.vertices for part in parts]),
                np.concatenate([part.faces + start for part, start in zip(parts, starts, strict=True)]),
                np.concatenate([part.colours for part in parts]), np.concatenate([part.element for part in parts]))


@functools.cache
def _solid(kind: int, detail: int) -> tuple[np.ndarray, np.ndarray]:
    """A solid of radius 1 on the plane z = 0: points (V, 3) and faces (M, 3)."""
    around = 2 * np.pi * np.arange(detail) / detail
    reach = {"bead": np.ones(detail), "disc": np.ones(detail), "star": 0.74 + 0.26 * np.cos(5 * around),
             "leaf": np.ones(detail)}[KINDS[kind]]
    outline = np.stack([reach * np.cos(around), reach * np.sin(around)], 1)
    if KINDS[kind] == "leaf":
        # pointed at both ends
        outline = np.stack([np.cos(around), 0.46 * np.sign(np.sin(around)) * np.abs(np.sin(around)) ** 1.5], 1)
    profile = DOME if KINDS[kind] == "bead" else TILE
    ring = np.concatenate([np.column_stack([wide * outline, np.full(detail, high)]) for wide, high in profile])
    poles = np.array([[0.0, 0.0, profile[0, 1]], [0.0, 0.0, profile[-1, 1] + (0.006 if KINDS[kind] == "bead" else 0)]])
    return np.concatenate([ring, poles]), tube_faces(len(profile), detail)
