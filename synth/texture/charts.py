"""Charts of a surface: round each vertex, and round any place, the vertices near it in the plane.

A chart is an approximate exponential map (Schmidt, Grimm, Wyvill 2006): a vertex lies where the way to it leads, edge
by edge, each laid into the plane of the chart by the shortest rotation of normals; where several ways arrive, at their
mean. It is exact on a plane. The chart of a place in a triangle is the mean of those of its corners, by barycentric
coordinates, which is exact on a plane too; so it changes smoothly while the place moves.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from synth import opencl
from synth.texture.mesh import Mesh, aligned, dot, length, unit

DETOUR = 1.1
"""How much longer ways along edges, and across two triangles, may be than straight ones; measured on grids: 1.09."""
TOGETHER = 1 << 22
"""Sources of charts times vertices of the mesh that are computed in one go."""
MOST = 60_000_000
"""Vertices in all charts together, 12 bytes each."""
DISTORTED = 4.0
"""A triangle is in a chart where its area there is, over its own, between this and one over this."""


@dataclass(frozen=True, eq=False)
class Charts:
    """The charts of all vertices of a mesh.

    keys    (E,) int64, ascending: number of the chart's vertex times V, plus that of the vertex in it
    places  (E, 2) float32: where it lies, world units, in the axes `mesh.bases`
    starts  (V + 1,) int64: chart k has keys[starts[k]:starts[k + 1]]
    """

    mesh: Mesh
    keys: np.ndarray
    places: np.ndarray
    starts: np.ndarray


class Pieces(NamedTuple):
    """Triangles in the charts of patches, by triangle, then by patch: triangle k has those from starts[k] to
    starts[k + 1].

    starts   (F + 1,) int32
    patch    (N,) int32
    corners  (N, 6) float32, pixels: s and m of the first corner; from it to the second; from it to the third
    """

    starts: np.ndarray
    patch: np.ndarray
    corners: np.ndarray

    @property
    def face(self) -> np.ndarray:
        """(N,) int64."""
        return np.repeat(np.arange(len(self.starts) - 1), np.diff(self.starts))


def charts(of: Mesh, reach: float) -> Charts:
    """The charts of all vertices, as far as `reach`, world units, and an edge more.

    Raises ValueError where they would hold more than MOST vertices.
    """
    require_coarse(of, reach)
    within = DETOUR * (reach + of.longest)
    along, count = ways(of), len(of.vertices)
    size = max(1, TOGETHER // count)
    parts = []
    for start in range(0, count, size):
        sources = np.arange(start, min(start + size, count))
        what = ordered(along, sources, within)
        keys = np.repeat(sources, np.diff(what.first)) * count + what.vertex
        order = np.argsort(keys, kind="stable")
        parts.append((keys[order], lay(of, along, what)[order]))
    keys = np.concatenate([keys for keys, _ in parts])
    starts = np.searchsorted(keys, np.arange(count + 1) * count)
    return Charts(of, keys, np.concatenate([places for _, places in parts]), starts)


def require_coarse(of: Mesh, reach: float) -> None:
    """ValueError where the charts of a mesh, as far as `reach`, would hold more than MOST vertices."""
    within = DETOUR * (reach + of.longest)
    expected = len(of.vertices) ** 2 * min(1.0, np.pi * within**2 / float(of.areas.sum()))
    if expected > MOST:
        raise ValueError(f"the mesh of {len(of.vertices)} vertices is finer than its texture needs: simplify it, or "
                         "give the texture a smaller scale")


class Ways(NamedTuple):
    """From each vertex to those beside it and to those across an edge.

    graph   (V, V): the lengths
    beside  (V, n) int32: the vertices; V where there are less than n
    to      (V, n, 3) float32: from each of them to the vertex, in the plane of `normal`, as long as in space
    normal  (V, n, 3) float32: unit vectors, the mean of both ends'
    size    (V, n) float32: the lengths, 1 where there is no vertex
    """

    graph: sparse.csr_array
    beside: np.ndarray
    to: np.ndarray
    normal: np.ndarray
    size: np.ndarray


def ways(of: Mesh) -> Ways:
    """The ways of a mesh."""
    across, count = np.argwhere(of.beside >= 0), len(of.vertices)
    face, corner = across[:, 0], across[:, 1]
    other = of.beside[face, corner]
    far = np.take_along_axis(of.faces[other], (of.beside[other] == face[:, None]).argmax(axis=1)[:, None], 1)[:, 0]
    pairs = np.concatenate([of.edges, of.edges[:, ::-1], np.stack([of.faces[face, corner], far], -1)])
    pairs = np.unique(pairs[pairs[:, 0] != pairs[:, 1]], axis=0)
    end, start = pairs.T
    middle = of.normals[start] + of.normals[end]
    normal, straight = unit(middle), of.vertices[end] - of.vertices[start]
    to = unit(straight - dot(straight, normal)[:, None] * normal) * length(straight)[:, None]
    # round a fold, or straight up, a way has no direction in the plane
    good = (dot(middle, middle) > 0.5) & to.any(axis=1)
    end, start, normal, to = end[good], start[good], normal[good], to[good]
    slot = np.arange(len(end)) - np.searchsorted(end, end)
    shape = count, int(slot.max()) + 1
    beside, size = np.full(shape, count, np.int32), np.ones(shape, np.float32)
    all_to, all_normal = np.zeros((*shape, 3), np.float32), np.zeros((*shape, 3), np.float32)
    beside[end, slot], all_to[end, slot], all_normal[end, slot], size[end, slot] = start, to, normal, length(to)
    return Ways(sparse.csr_array((length(to), (end, start)), shape=(count, count)), beside, all_to, all_normal, size)


class Ordered(NamedTuple):
    """The vertices of some charts, by chart, the nearest first.

    first   (charts + 1,) int32: where each chart begins
    vertex  (E,) int32
    away    (E,) float32: how far along the ways, world units
    entry   (charts, V + 1) int32: where in this list each vertex is, -1 where it is not
    """

    first: np.ndarray
    vertex: np.ndarray
    away: np.ndarray
    entry: np.ndarray


def ordered(of: Ways, sources: np.ndarray, within: float) -> Ordered:
    """The vertices that are no farther than `within` from some vertices."""
    far = csgraph.dijkstra(of.graph, directed=False, indices=sources, limit=within)
    chart, vertex = np.nonzero(np.isfinite(far))
    away = far[chart, vertex].astype(np.float32)
    order = np.lexsort([vertex, away, chart])
    chart, vertex, away = chart[order], vertex[order], away[order]
    first = np.searchsorted(chart, np.arange(len(sources) + 1)).astype(np.int32)
    entry = np.full((len(sources), far.shape[1] + 1), -1, np.int32)
    entry[chart, vertex] = np.arange(len(chart), dtype=np.int32)
    return Ordered(first, vertex.astype(np.int32), away, entry)


def lay(of: Mesh, along: Ways, what: Ordered) -> np.ndarray:
    """Where the vertices of charts lie in them, world units: (E, 2) float32; `lay_reference` says where."""
    program = opencl.program(Path(__file__).with_suffix(".cl"), WAYS=along.beside.shape[1])
    out = opencl.empty((len(what.vertex), 2))
    arrays = (what.first, what.vertex, what.away, what.entry, along.beside, along.to, along.normal, along.size)
    program.lay((len(what.first) - 1,), (1,), *map(opencl.to_device, arrays), np.int32(len(of.vertices)),
                opencl.to_device(of.bases.astype(np.float32)), opencl.to_device(of.normals.astype(np.float32)), out)
    return np.asarray(out.get())


def lay_reference(of: Mesh, along: Ways, what: Ordered) -> np.ndarray:
    """Specification of `lay`: each vertex lies at the mean of the ways from nearer ones of its chart, each turned into
    the chart's plane, with the fourth power of the share of its length by which it leads away."""
    places = np.zeros((len(what.vertex), 2), np.float32)
    bases, normals = of.bases.astype(np.float32), of.normals.astype(np.float32)
    source = what.vertex[what.first[:-1]]
    for k in range(1, int(np.diff(what.first).max())):
        chart = np.flatnonzero(np.diff(what.first) > k)
        here = what.first[chart] + k
        vertex, up = what.vertex[here], normals[source[chart]]
        total, sums = np.zeros(len(chart), np.float32), np.zeros((len(chart), 2), np.float32)
        for j in range(along.beside.shape[1]):
            from_ = what.entry[chart, along.beside[vertex, j]]
            known = (from_ >= 0) & (from_ < here)
            e, n = along.to[vertex, j], along.normal[vertex, j]
            middle = n + up
            share = _dot(e, middle) / np.maximum(1 + _dot(n, up), np.float32(0.05))
            turned = e - share[:, None] * middle
            gain = (what.away[here] - what.away[from_]) / along.size[vertex, j]
            w = np.where(known, gain * gain * (gain * gain), np.float32(0))
            flat = np.stack([_dot(turned, bases[source[chart], axis]) for axis in (0, 1)], axis=-1)
            sums, total = sums + w[:, None] * (places[from_] + flat), total + w
        places[here] = sums / np.where(total > 0, total, np.float32(1))[:, None]
    return places


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """In the kernel's order."""
    return np.asarray(a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2])


class Around(NamedTuple):
    """The vertices of the charts of patches, by patch, then by vertex.

    keys    (E,) int64, ascending: number of the patch times V, plus that of the vertex
    places  (E, 2) float64: s and m, world units
    """

    keys: np.ndarray
    places: np.ndarray


def around(of: Charts, face: np.ndarray, place: np.ndarray, normal: np.ndarray, axis: np.ndarray) -> Around:
    """The charts of patches at places (P,), (P, 3), in their axes t = axis and n = normal × axis, (P, 3) each, where
    all three corners have them."""
    mesh, count = of.mesh, len(of.mesh.vertices)
    corner, side = mesh.faces[face], np.cross(normal, axis)
    which, at = _expanded(of.starts, corner[:, 0])
    vertex = of.keys[at] - corner[which, 0] * count
    places, whole = np.zeros((len(at), 2)), np.ones(len(at), bool)
    for k in range(3):
        if k:
            key = corner[which, k] * count + vertex
            at = np.minimum(np.searchsorted(of.keys, key), len(of.keys) - 1)
            whole &= of.keys[at] == key
        turned = aligned(mesh.bases[corner[:, k]], mesh.normals[corner[:, k]][:, None], normal[:, None])
        for row, direction in enumerate((axis, side)):
            share = dot(turned, direction[:, None]) * place[:, k, None]
            places[:, row] += share[which, 0] * of.places[at, 0] + share[which, 1] * of.places[at, 1]
    return Around((which * count + vertex)[whole], places[whole])


def _expanded(starts: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """For each of the lists `rows` all its members: the number of the row, and where the member is."""
    count = starts[rows + 1] - starts[rows]
    which = np.repeat(np.arange(len(rows)), count)
    return which, np.arange(len(which)) + np.repeat(starts[rows] - np.cumsum(count) + count, count)


class Centres(NamedTuple):
    """Where patches are, and their axes.

    face          (P,) int64: the triangle that the centre lies in
    place         (P, 3) float64: its barycentric coordinates
    normal, axis  (P, 3) float64, unit vectors
    """

    face: np.ndarray
    place: np.ndarray
    normal: np.ndarray
    axis: np.ndarray


def pieces(of: Charts, centres: Centres, scale: float, reach: np.ndarray, elongation: float) -> Pieces:
    """The triangles that are whole in the charts of patches and within their reach (P,), pixels, the measure of an
    elongated patch; without those that the chart turns over or distorts. That of its centre each patch has.

    scale  world units in a pixel
    """
    near = around(of, *centres)
    mesh, count = of.mesh, len(of.mesh.vertices)
    by_first = np.argsort(mesh.faces[:, 0], kind="stable")
    starts = np.searchsorted(mesh.faces[by_first, 0], np.arange(count + 1))
    patch, vertex = np.divmod(near.keys, count)
    which, at = _expanded(starts, vertex)
    patch, face = patch[which], by_first[at]
    s, m = (near.places / scale).T
    corner, whole = [which], np.ones(len(which), bool)
    for k in (1, 2):
        key = patch * count + mesh.faces[face, k]
        found = np.minimum(np.searchsorted(near.keys, key), len(near.keys) - 1)
        whole &= near.keys[found] == key
        corner.append(found)
    patch, face = patch[whole], face[whole]
    places = np.stack([np.stack([s[c[whole]], m[c[whole]]], -1) for c in corner], axis=1)
    b, c = places[:, 1] - places[:, 0], places[:, 2] - places[:, 0]
    area = (b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0]) / (2 * mesh.areas[face] / scale**2)
    stretch = np.array([1 / elongation, elongation])
    nearest = np.sqrt((places**2 * stretch).sum(axis=-1).min(axis=1))
    edge = np.sqrt(np.max([(v**2 * stretch).sum(axis=-1) for v in (b, c, c - b)], axis=0))
    stays = (area > 1 / DISTORTED) & (area < DISTORTED) & (nearest - edge < reach[patch])
    flat = np.concatenate([places[:, 0], b, c], axis=1)[stays].astype(np.float32)
    patch, face = patch[stays], face[stays]
    bare = np.setdiff1d(np.arange(len(centres.face)), patch[face == centres.face[patch]])
    patch, face = np.concatenate([patch, bare]), np.concatenate([face, centres.face[bare]])
    flat = np.concatenate([flat, _flat(mesh, Centres(*(part[bare] for part in centres)), scale)])
    order = np.lexsort([patch, face])
    return Pieces(np.searchsorted(face[order], np.arange(len(mesh.faces) + 1)).astype(np.int32),
                  patch[order].astype(np.int32), flat[order])


def _flat(of: Mesh, centres: Centres, scale: float) -> np.ndarray:
    """The triangles of centres, each in its own plane, as `Pieces.corners` has them."""
    plane = unit(of.area_vectors[centres.face])
    axis = aligned(centres.axis, centres.normal, plane)
    offset = (of.corners[centres.face] - of.at(of.vertices, centres.face, centres.place)[:, None]) / scale
    places = np.stack([dot(offset, axis[:, None]), dot(offset, np.cross(plane, axis)[:, None])], axis=-1)
    flat = [places[:, 0], places[:, 1] - places[:, 0], places[:, 2] - places[:, 0]]
    return np.concatenate(flat, axis=1).astype(np.float32)
