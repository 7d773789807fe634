"""Triangle meshes that a texture lies on: their topology, tangent fields on them, motion over them.

Vertices are in world units, triangles counter-clockwise seen from outside. A place on a mesh is a triangle and
barycentric coordinates (M, 3) of it. A field is a vector at each vertex, (V, 3) float64; between vertices it is linear,
and only its part in the triangle's plane moves anything.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

CROSSINGS = 256
"""Edges that a place crosses in one step, at most; then it rests."""
SMALLEST = 1e-7
"""Height of a triangle over its longest edge, below which it counts as a line."""
PASSES = 24
"""Of halving edges, at most."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """A surface of triangles, with or without a border.

    vertices  (V, 3) float64, world units
    faces     (F, 3) int64, counter-clockwise seen from outside
    normals   (V, 3) float64, unit vectors
    """

    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray

    @cached_property
    def corners(self) -> np.ndarray:
        """(F, 3, 3) float64: the corners of each triangle."""
        return self.vertices[self.faces]

    @cached_property
    def area_vectors(self) -> np.ndarray:
        """(F, 3) float64: normals as long as twice the areas."""
        return area_vectors(self.vertices, self.faces)

    @cached_property
    def areas(self) -> np.ndarray:
        """(F,) float64."""
        return np.asarray(length(self.area_vectors) / 2)

    @cached_property
    def slopes(self) -> np.ndarray:
        """(F, 3, 3) float64: the gradient of each barycentric coordinate, in the triangle's plane."""
        normal, opposite = self.area_vectors, np.roll(self.corners, -2, axis=1) - np.roll(self.corners, -1, axis=1)
        return np.cross(normal[:, None], opposite) / dot(normal, normal)[:, None, None]

    @cached_property
    def beside(self) -> np.ndarray:
        """(F, 3) int64: the triangle across the edge that corner k does not touch; -1 at the border."""
        edges, order = self._half_edges
        same = (edges[order][1:] == edges[order][:-1]).all(axis=1)
        one, other = order[:-1][same], order[1:][same]
        beside = np.full(self.faces.size, -1)
        beside[one], beside[other] = other // 3, one // 3
        return beside.reshape(-1, 3)

    @cached_property
    def _half_edges(self) -> tuple[np.ndarray, np.ndarray]:
        """Ends (3 F, 2) of the edge opposite to each corner, the lower first; the order that puts equals together."""
        ends = np.stack([np.roll(self.faces, -1, axis=1), np.roll(self.faces, -2, axis=1)], axis=-1)
        edges = np.sort(ends, axis=-1).reshape(-1, 2)
        return edges, np.lexsort(edges.T[::-1])

    @cached_property
    def edges(self) -> np.ndarray:
        """(E, 2) int64: both ends of each edge, the lower first."""
        return np.unique(self._half_edges[0], axis=0)

    @cached_property
    def longest(self) -> float:
        """Of all edges, world units."""
        return float(length(self.vertices[self.edges[:, 0]] - self.vertices[self.edges[:, 1]]).max())

    @cached_property
    def bases(self) -> np.ndarray:
        """(V, 2, 3) float64: two unit vectors at each vertex that are with its normal a right-handed system."""
        axis = np.eye(3)[np.abs(self.normals).argmin(axis=1)]
        first = unit(axis - dot(axis, self.normals)[:, None] * self.normals)
        return np.stack([first, np.cross(self.normals, first)], axis=1)

    @cached_property
    def curvature(self) -> np.ndarray:
        """(V,) float64: the size of the Gaussian curvature, per square of world units, from the sums of angles round
        each vertex; the mean of its surroundings, 0 at the border."""
        missing = 2 * np.pi - self._sum_at_vertices(angles(self.corners))
        inner = np.ones(len(self.vertices), bool)
        inner[np.roll(self.faces, -1, axis=1)[self.beside < 0]] = False
        inner[np.roll(self.faces, -2, axis=1)[self.beside < 0]] = False
        missing = np.where(inner, missing, 0)
        area = self._sum_at_vertices(np.repeat(self.areas[:, None] / 3, 3, axis=1))
        for _ in range(2):
            missing, area = (self._sum_at_vertices(np.repeat(values[self.faces].sum(axis=1)[:, None], 3, axis=1))
                             for values in (missing, area))
        return np.abs(missing) / area

    def _sum_at_vertices(self, values: np.ndarray) -> np.ndarray:
        """Sums (V,) of values (F, 3) at the corners of triangles."""
        return np.bincount(self.faces.ravel(), values.ravel(), len(self.vertices))

    def at(self, field: np.ndarray, face: np.ndarray, place: np.ndarray) -> np.ndarray:
        """A field (V, C) at places (M, C)."""
        return np.asarray((field[self.faces[face]] * place[..., None]).sum(axis=1))


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Products (...) of vectors (..., 3); no matrix product, whose rounding may depend on the number of threads."""
    return np.asarray((a * b).sum(axis=-1))


def length(vectors: np.ndarray) -> np.ndarray:
    """(...) of vectors (..., 3)."""
    return np.sqrt(dot(vectors, vectors))


def unit(vectors: np.ndarray) -> np.ndarray:
    """Unit vectors along vectors (..., 3); zero stays zero."""
    size = length(vectors)[..., None]
    return np.asarray(vectors / np.where(size > 0, size, 1))


def area_vectors(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Normals (F, 3) of triangles, as long as twice their areas."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def angles(corners: np.ndarray) -> np.ndarray:
    """Angles (F, 3) of triangles at their corners (F, 3, 3), radians."""
    to_next, to_last = (unit(np.roll(corners, -k, axis=1) - corners) for k in (1, 2))
    return np.arccos(np.clip(dot(to_next, to_last), -1, 1))


def aligned(vectors: np.ndarray, normal: np.ndarray, to: np.ndarray) -> np.ndarray:
    """Vectors (..., 3) turned by the rotation that takes unit `normal` to unit `to` the shortest way.

    Of opposite normals there is no such rotation: then the result is short.
    """
    middle, both = normal + to, np.maximum(1 + dot(normal, to), 0.05)
    turned = vectors - (dot(vectors, middle) / both)[..., None] * middle
    return np.asarray(turned + (2 * dot(vectors, normal))[..., None] * to)


def mesh(vertices: np.ndarray, faces: np.ndarray) -> Mesh:
    """The mesh of vertices (V, 3), world units, and triangles (F, 3) of indices into them; vertices that no triangle
    has are left out.

    Raises ValueError: other shapes, no triangle, NaN or infinity, an index that is no vertex, a triangle without area,
    an edge of more than two triangles, neighbours that are turned different ways round.
    """
    vertices, faces = np.asarray(vertices, np.float64), np.asarray(faces, np.int64)
    if vertices.ndim != 2 or faces.ndim != 2 or vertices.shape[1] != 3 or faces.shape[1] != 3 or not len(faces):
        raise ValueError(f"a mesh has vertices (V, 3) and triangles (F, 3), not {vertices.shape} and {faces.shape}")
    if not np.isfinite(vertices).all():
        raise ValueError("the vertices hold NaN or infinity")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise ValueError(f"a triangle names a vertex that does not exist (0 to {len(vertices) - 1})")
    used, faces = np.unique(faces, return_inverse=True)
    vertices, faces = vertices[used], faces.reshape(-1, 3)
    _require_surface(vertices, faces)
    # weighted by angle: on the rim of a thin plate the normal leads out of it, however large its sides are
    weighted = unit(area_vectors(vertices, faces))[:, None] * angles(vertices[faces])[..., None]
    sums = [np.bincount(faces.ravel(), along.ravel(), len(vertices)) for along in np.moveaxis(weighted, -1, 0)]
    return Mesh(vertices, faces, unit(np.stack(sums, axis=-1)))


def _require_surface(vertices: np.ndarray, faces: np.ndarray) -> None:
    corners = vertices[faces]
    longest = length(np.roll(corners, -1, axis=1) - corners).max(axis=1)
    flat = length(area_vectors(vertices, faces)) <= SMALLEST * longest**2
    if flat.any():
        raise ValueError(f"{flat.sum()} triangles have no area, the first is number {int(flat.argmax())}")
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    edges, count = np.unique(np.sort(np.stack([start, end], -1), axis=1), axis=0, return_counts=True)
    if count.max() > 2:
        x, y, z = vertices[edges[count.argmax()]].mean(axis=0)
        raise ValueError(f"an edge at ({x:.3g}, {y:.3g}, {z:.3g}) has {count.max()} triangles; a surface has one or "
                         "two at each")
    turned, times = np.unique(np.stack([start, end], -1), axis=0, return_counts=True)
    if times.max() > 1:
        x, y, z = vertices[turned[times.argmax()]].mean(axis=0)
        raise ValueError(f"two triangles at ({x:.3g}, {y:.3g}, {z:.3g}) are turned different ways round; orient them "
                         "alike")


def refined(of: Mesh, fields: np.ndarray, longest: float) -> tuple[Mesh, np.ndarray]:
    """The mesh with edges halved until none is longer than `longest`, world units; and values (V, C) at its vertices.

    The surface stays the same. Normals and values at new vertices are the mean of both ends'.
    """
    vertices, faces = of.vertices, of.faces
    carried = np.concatenate([of.normals, fields], axis=1)
    for _ in range(PASSES):
        pair = np.stack([np.roll(faces, -1, axis=1), np.roll(faces, -2, axis=1)], axis=-1)
        edges, which = np.unique(np.sort(pair.reshape(-1, 2), axis=1), axis=0, return_inverse=True)
        long = length(vertices[edges[:, 0]] - vertices[edges[:, 1]]) > longest
        if not long.any():
            break
        number = np.where(long, len(vertices) + np.cumsum(long) - 1, -1)
        a, b = edges[long].T
        vertices = np.concatenate([vertices, (vertices[a] + vertices[b]) / 2])
        carried = np.concatenate([carried, (carried[a] + carried[b]) / 2])
        faces = _split(faces, number[which.reshape(-1, 3)])
    return Mesh(vertices, faces, unit(carried[:, :3])), carried[:, 3:]


def _split(faces: np.ndarray, halves: np.ndarray) -> np.ndarray:
    """Triangles (F, 3) split at the new vertices (F, 3) in the middle of the edges opposite to their corners, -1 where
    an edge stays whole."""
    count = (halves >= 0).sum(axis=1)
    kept = [faces[count == 0]]
    for k in range(3):
        a, b, c = (np.roll(faces, -k, axis=1)[:, j] for j in range(3))
        p, q, r = (np.roll(halves, -k, axis=1)[:, j] for j in range(3))  # middles of bc, ca, ab
        one = (count == 1) & (p >= 0)
        kept += [np.stack(t, -1)[one] for t in ((a, b, p), (a, p, c))]
        two = (count == 2) & (p < 0)
        kept += [np.stack(t, -1)[two] for t in ((a, r, q), (r, b, c), (r, c, q))]
        if k == 0:
            all_ = count == 3
            kept += [np.stack(t, -1)[all_] for t in ((a, r, q), (r, b, p), (q, p, c), (p, q, r))]
    return np.concatenate(kept)


def continued(of: Mesh, field: np.ndarray) -> np.ndarray:
    """Unit tangent vectors (V, 3) along a field, where it rests that of what moves around it, smoothly."""
    tangent = unit(field - dot(field, of.normals)[:, None] * of.normals)
    rests = np.asarray(~tangent.any(axis=1))
    if not rests.any() or rests.all():
        return tangent
    ends = np.concatenate([of.edges, of.edges[:, ::-1]])
    sums = sparse.csr_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(len(rests),) * 2)
    for _ in range(len(rests)):
        spread = np.asarray(sums @ tangent)
        spread = unit(spread - dot(spread, of.normals)[:, None] * of.normals)
        filled = rests & spread.any(axis=1)
        fresh = filled & ~tangent.any(axis=1)
        tangent[filled] = spread[filled]
        if not fresh.any():
            break
    return tangent


def turning(of: Mesh, facing: np.ndarray) -> np.ndarray:
    """(V, 3) float64: the gradient of the angle of unit tangent vectors `facing` (V, 3), radians per world unit.

    In each triangle the vectors of its corners are laid into its plane; vertices have the mean of their triangles,
    weighted by area.
    """
    plane = unit(of.area_vectors)
    laid = aligned(facing[of.faces], of.normals[of.faces], plane[:, None])
    first, side = laid[:, 0], np.cross(plane, laid[:, 0])
    angle = np.arctan2(dot(laid, side[:, None]), dot(laid, first[:, None]))
    gradient = (angle[..., None] * of.slopes).sum(axis=1) * of.areas[:, None]
    area = np.bincount(of.faces.ravel(), np.repeat(of.areas, 3), len(of.vertices))
    sums = [np.bincount(of.faces.ravel(), np.repeat(along, 3), len(of.vertices)) for along in gradient.T]
    return np.asarray(np.stack(sums, axis=-1) / area[:, None])


def walked(of: Mesh, v: np.ndarray, face: np.ndarray, place: np.ndarray,
           ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places (M,) and (M, 3) after one step along a field v, world units per step; and which have left by the border.

    In each triangle by the midpoint rule, up to its edge; where the field of the next one leads straight back, along
    the edge.
    """
    face, place, left = face.copy(), place.copy(), np.zeros(len(face), bool)
    remaining, before = np.ones(len(face)), np.full(len(face), -1)
    going = np.flatnonzero(v[of.faces[face]].any(axis=(1, 2)))
    for _ in range(CROSSINGS):
        if not len(going):
            break
        f, b = face[going], place[going]
        rate = _rate(of, v, f, b)
        # where the way back is the way out, what leads out of the edge is left out
        back = np.where(before[going] >= 0, (of.beside[f] == before[going, None]).argmax(axis=1), 0)
        stuck = (before[going] >= 0) & (np.take_along_axis(rate, back[:, None], 1)[:, 0] < 0)
        rate[stuck] = _along_edge(of, f[stuck], back[stuck], rate[stuck])
        step = np.minimum(remaining[going], _until_edge(b, rate))
        middle = _rate(of, v, f, b + rate * (step / 2)[:, None])
        middle[stuck] = rate[stuck]
        until = _until_edge(b, middle)
        step = np.minimum(remaining[going], until)
        edge = np.where(middle < 0, b / np.where(middle < 0, -middle, 1), np.inf).argmin(axis=1)
        b = np.maximum(b + middle * step[:, None], 0)
        crosses = until < remaining[going]
        remaining[going] -= step
        place[going] = b / b.sum(axis=1)[:, None]
        over = going[crosses]
        e, old = edge[crosses], face[over]
        new = of.beside[old, e]
        gone = new < 0
        left[over[gone]] = True
        over, e, old, new = over[~gone], e[~gone], old[~gone], new[~gone]
        known = of.faces[new][:, :, None] == of.faces[old][:, None, :]
        known &= (np.arange(3) != e[:, None])[:, None, :]
        moved = np.where(known, place[over][:, None, :], 0.0).sum(axis=2)
        place[over], before[over], face[over] = moved / moved.sum(axis=1)[:, None], old, new
        going = over
    return face, place, left


def _rate(of: Mesh, v: np.ndarray, face: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Change of barycentric coordinates (M, 3) per step."""
    return dot(of.slopes[face], of.at(v, face, place)[:, None])


def _until_edge(place: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Steps until the first coordinate is 0: (M,)."""
    out = rate < 0
    return np.asarray(np.where(out, place / np.where(out, -rate, 1), np.inf).min(axis=1))


def _along_edge(of: Mesh, face: np.ndarray, edge: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """What of rates (M, 3) leads along the edges opposite to corners `edge` (M,)."""
    slope = np.take_along_axis(of.slopes[face], edge[:, None, None], 1)[:, 0]
    out = np.take_along_axis(rate, edge[:, None], 1)
    # the velocity less its part along the slope, in barycentric rates
    along = rate - dot(of.slopes[face], slope[:, None]) * out / dot(slope, slope)[:, None]
    np.put_along_axis(along, edge[:, None], 0.0, 1)
    return along
