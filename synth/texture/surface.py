"""A texture of carried coordinates on a surface: the patches of `carry`, each in a chart of its own.

A patch is a place on the mesh, an axis t along the field there and n = normal × t; its two bends are how the field's
angle changes along and across. Its radius is in pixels of the sample, `scale` world units each. What it covers and
shows, how it is born, matched, grown and faded, is as in the plane.

What it does not do: repair seams that the field has torn, and more than one resolution.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from synth import opencl
from synth.texture import bake, measures
from synth.texture.anchors import Anchors
from synth.texture.atlas import LANES, Texels
from synth.texture.carry import FEWEST, TURN, Settings
from synth.texture.charts import Centres, Pieces, charts, pieces
from synth.texture.kept import Kept
from synth.texture.mesh import Mesh, continued, dot, length, turning, unit, walked
from synth.texture.patches import (
    AX,
    AY,
    BEND_N,
    BEND_T,
    BIAS,
    FIELDS,
    INVERSE,
    MATCHED,
    RADIUS,
    STEEP,
    Painter,
    Query,
)
from synth.texture.sample import Sample, luminance

SPACING = 6.0
"""Pixels: longest edge of the triangles in whose middles births are tried."""
TOGETHER = 512
"""Sites that are asked at once whether they bear."""
STENCILS = 2048
"""Places at which the gradient of the first frame is measured, in fours."""


@dataclass(frozen=True, eq=False)
class State(Kept):
    """All that the next frame and the picture need: P living patches, in order of birth, and the use of the sample.

    frame, born  number of this frame, from 1; patches born so far, which numbers the next
    blend        share of the blend that preserves variance
    face         (P,) int64: the triangle that the centre lies in
    place        (P, 3) float64: its barycentric coordinates
    anchor       (P, 2) float32: the place in the sample that lies at the centre, pixels
    weight       (P,) float32, 0..1: how much of a patch has grown
    age          (P,) int32, frames
    fading       (P,) bool: it shrinks, and is gone when its weight is 0
    id           (P,) int64, ascending
    usage        (H, W) int32: patches whose anchors are near each pixel of the sample
    """

    frame: int
    born: int
    blend: float
    face: np.ndarray
    place: np.ndarray
    anchor: np.ndarray
    weight: np.ndarray
    age: np.ndarray
    fading: np.ndarray
    id: np.ndarray
    usage: np.ndarray


PATCHES = ("face", "place", "anchor", "weight", "age", "fading", "id")
"""The arrays of a state with one row for each patch."""


class Turned(NamedTuple):
    """How patches lie at M places.

    normal, axis  (M, 3) float64, unit vectors
    bend          (M, 2) float32: κ_t and κ_n, radians per pixel
    radius        (M,) float32, pixels
    """

    normal: np.ndarray
    axis: np.ndarray
    bend: np.ndarray
    radius: np.ndarray


@dataclass(frozen=True, eq=False)
class Ground:
    """What a frame goes by.

    v       (V, 3) float64, world units per frame
    facing  (V, 3) float64: unit tangent vectors along it, continued where it rests
    turn    (V, 3) float64: the gradient of their angle, radians per world unit
    radius  (S,) float32, pixels: of patches at the sites
    """

    v: np.ndarray
    facing: np.ndarray
    turn: np.ndarray
    radius: np.ndarray


class Synthesis:
    """Draws a sample on a surface, frame by frame.

    sample; mesh; settings, all lengths in pixels of the sample; seed of what is random: the order of births;
    scale, world units in a pixel. Raises ValueError for a sample that has no room for a patch of 2 pixels, and for a
    mesh that is much finer than the patches.
    """

    def __init__(self, sample: Sample, mesh: Mesh, settings: Settings, seed: int, scale: float):
        self.sample, self.mesh, self.settings, self.seed, self.scale = sample, mesh, settings, seed, scale
        # it draws no picture of its own: its shape does not matter
        painter = Painter(sample, (1, 1), settings.window, settings.elongation, settings.radius[1])
        # an anchor must have room in the sample
        most = min(settings.radius[1], float(painter.room.max()) / float(painter.needs(np.ones(1))[0]))
        if most < 2:
            raise ValueError(f"a sample of {sample.shape[1]} x {sample.shape[0]} pixels has no room for a patch")
        self.radius = min(settings.radius[0], most), most
        self.painter = replace(painter, largest=most)
        self.anchors = Anchors(self.painter, settings.usage, seed)
        self.charts = charts(mesh, scale * float(painter.extent(np.array(most))))
        self.sites = _sites(mesh, SPACING * scale)
        self._laid: tuple[np.ndarray, Turned, Pieces] | None = None
        self._last: Ground | None = None

    def frame(self, v: np.ndarray, state: State | None) -> State:
        """The state after a frame of a field v (V, 3), world units per frame; state is None before the first.

        1. Follow: patches move with the field, grow or fade; some are gone.
        2. Crowd: of two that are too near the younger fades.
        3. Bear: newborns where no patch is near.
        4. Match: each newborn takes the place of the sample that best continues the picture where it lies.
        5. In the first frame, choose the blend.
        """
        ground = self._ground(v)
        # 1. follow
        now = self._empty() if state is None else self._followed(state, ground)
        # 2. crowd
        now = self._crowded(now, ground)
        # 3. bear
        now = self._born(now, ground)
        # 4. match
        now = self._matched(now, ground)
        # 5. blend
        return self._blended(now, ground) if state is None else now

    def picture(self, state: State, v: np.ndarray, texels: Texels, shape: tuple[int, int]) -> np.ndarray:
        """The atlas (rows, columns, 3) float32 of a frame, linear light, row 0 the lowest; zero beside the texels.

        v  the field of that frame
        """
        flat = np.zeros((shape[0] * shape[1], 3), np.float32)
        near, values = self._tables(state, self._ground(v))
        flat[texels.number] = bake.bake(self.painter, values, near, texels, state.blend)
        return flat.reshape(*shape, 3)

    # what a frame goes by

    def _ground(self, v: np.ndarray) -> Ground:
        if self._last is None or not np.array_equal(self._last.v, v):
            if v.shape != self.mesh.vertices.shape or not np.isfinite(v).all():
                raise ValueError(f"a field has a finite vector at each of {len(self.mesh.vertices)} vertices")
            facing = continued(self.mesh, v)
            facing = np.where(length(facing)[:, None] > 0, facing, self.mesh.bases[:, 0])
            ground = Ground(v, facing, turning(self.mesh, facing), np.zeros(0, np.float32))
            self._last = replace(ground, radius=self._turned(*self.sites, ground).radius)
        return self._last

    def _turned(self, face: np.ndarray, place: np.ndarray, ground: Ground) -> Turned:
        """How patches at places (M,), (M, 3) lie."""
        at = self.mesh.at
        normal, axis = unit(at(self.mesh.normals, face, place)), at(ground.facing, face, place)
        axis = unit(axis - dot(axis, normal)[:, None] * normal)
        # opposite directions have no mean
        lost = np.flatnonzero(dot(axis, axis) == 0)
        other = self.mesh.bases[self.mesh.faces[face[lost], 0], 0]
        axis[lost] = unit(other - dot(other, normal[lost])[:, None] * normal[lost])
        gradient = at(ground.turn, face, place) * self.scale
        bend = np.stack([dot(gradient, axis), dot(gradient, np.cross(normal, axis))], axis=-1)
        bent = self.scale * np.sqrt(at(self.mesh.curvature[:, None], face, place)[:, 0])
        most_bent = np.maximum(np.hypot(bend[:, 0], bend[:, 1]), bent)
        least, most = self.radius
        radius = np.clip(TURN / np.maximum(most_bent, TURN / most), least, most).astype(np.float32)
        limit = (np.float32(TURN) / radius)[:, None]
        return Turned(normal, axis, np.clip(bend.astype(np.float32), -limit, limit), radius)

    def _pieces(self, face: np.ndarray, place: np.ndarray, lie: Turned) -> Pieces:
        """The triangles in the charts of patches."""
        return pieces(self.charts, Centres(face, place, lie.normal, lie.axis), self.scale,
                      self.settings.window * lie.radius, self.settings.elongation)

    def _tables(self, now: State, ground: Ground) -> tuple[Pieces, np.ndarray]:
        """The triangles in the charts of a state's patches, and the patches as the kernels read them (P, FIELDS).

        The charts of the last places are kept.
        """
        if self._laid is None or self._laid[0] is not now.place:
            lie = self._turned(now.face, now.place, ground)
            self._laid = now.place, lie, self._pieces(now.face, now.place, lie)
        s, (_, lie, near) = self.settings, self._laid
        values = np.zeros((len(now.id), FIELDS), np.float32)
        values[:, [BEND_T, BEND_N]], values[:, [AX, AY]] = lie.bend, now.anchor
        values[:, INVERSE] = np.float32(1) / (lie.radius * lie.radius)
        values[:, STEEP] = np.float32(s.sharpness) * lie.radius
        values[:, BIAS] = values[:, STEEP] * np.float32(s.head_start) * (np.float32(1) - now.weight)
        values[:, RADIUS] = lie.radius
        return near, values

    def _empty(self) -> State:
        blend = 0.0 if self.settings.blend == "auto" else float(self.settings.blend)
        row = np.zeros(0, np.float32)
        return State(1, 0, blend, row.astype(np.int64), np.zeros((0, 3)), np.zeros((0, 2), np.float32), row,
                     row.astype(np.int32), row.astype(bool), row.astype(np.int64),
                     np.zeros(self.sample.shape, np.int32))

    # 1. follow

    def _followed(self, state: State, ground: Ground) -> State:
        """The patches one frame later: moved, grown or faded, without those that have faded or left by the border."""
        face, place, left = walked(self.mesh, ground.v, state.face, state.place)
        by = np.float32(1 / self.settings.growth)
        weight = np.where(state.fading, state.weight - by, np.minimum(state.weight + by, 1)).astype(np.float32)
        stays = ~left & ~(state.fading & (weight <= 0))
        now = replace(state, frame=state.frame + 1, face=face, place=place, weight=weight,
                      age=state.age + np.int32(1),
                      usage=self.anchors.used(state.usage, state.anchor[~stays], -1))
        return replace(now, **{name: getattr(now, name)[stays] for name in PATCHES})

    # 2. crowd

    def _crowded(self, now: State, ground: Ground) -> State:
        """Fades the younger of two patches that are too near, older ones first."""
        near, values = self._tables(now, ground)
        radius = values[:, RADIUS].astype(np.float64)
        younger, older, away = self._away(near, now.face, now.place)
        close = (older < younger) & (away < self.settings.death * (radius[older] + radius[younger]) / 2)
        fading = now.fading.copy()
        order = np.lexsort([younger[close], older[close]])
        for a, b in zip(older[close][order].tolist(), younger[close][order].tolist(), strict=True):
            fading[b] |= not fading[a]
        return replace(now, fading=fading)

    def _away(self, of: Pieces, face: np.ndarray, place: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of places (M,), (M, 3) and the patches whose charts they are in all pairs: place, patch, and how far apart,
        in the measure of an elongated patch, pixels."""
        count = of.starts[face + 1] - of.starts[face]
        which = np.repeat(np.arange(len(face)), count)
        at = np.arange(len(which)) + np.repeat(of.starts[face] - np.cumsum(count) + count, count)
        c, u, v = of.corners[at].astype(np.float64), place[which, 1], place[which, 2]
        s, m = c[:, 0] + u * c[:, 2] + v * c[:, 4], c[:, 1] + u * c[:, 3] + v * c[:, 5]
        e = self.settings.elongation
        return which, of.patch[at], np.sqrt(s * s / e + m * m * e)

    # 3. bear

    def _born(self, now: State, ground: Ground) -> State:
        """The patches with newborns wherever no living one is near.

        1. The sites from which no living patch is near.
        2. In an order at random, each that is still bare bears a patch, which covers those round it. Those far from all
           earlier ones bear together.
        """
        s, first = self.settings, now.born == 0
        face, place = self.sites
        # 1. bare sites
        near, values = self._tables(now, ground)
        site, patch, away = self._away(near, face, place)
        close = away <= s.birth * np.minimum(values[patch, RADIUS], ground.radius[site])
        bare = np.ones(len(face), bool)
        bare[site[close & ~now.fading[patch]]] = False
        # 2. births
        random = np.random.Generator(np.random.Philox(key=[self.seed, now.frame]))
        turn = random.permutation(len(face))
        covering, births = s.spacing if first else s.birth, [np.zeros(0, np.int64)]
        while bare.any():
            born = self._first(np.flatnonzero(bare), turn, covering * self.radius[1])
            births.append(born)
            bare[born] = False
            rest = np.flatnonzero(bare)
            lie = self._turned(face[born], place[born], ground)
            site, patch, away = self._away(self._pieces(face[born], place[born], lie), face[rest], place[rest])
            bare[rest[site[away <= covering * np.minimum(lie.radius[patch], ground.radius[rest[site]])]]] = False
        every = np.concatenate(births)
        return self._with_newborns(now, every[np.argsort(turn[every])])

    def _first(self, bare: np.ndarray, turn: np.ndarray, distance: float) -> np.ndarray:
        """Some of sites whose turn comes before that of all bare ones that could cover them."""
        earliest = bare[np.argpartition(turn[bare], min(TOGETHER, len(bare)) - 1)[:TOGETHER]]
        points = self.mesh.at(self.mesh.vertices, *(part[earliest] for part in self.sites)) / self.scale
        pairs = cKDTree(points).query_pairs(1.05 * distance * np.sqrt(self.settings.elongation), output_type="ndarray")
        a, b = earliest[pairs].reshape(-1, 2).T
        return np.setdiff1d(earliest, np.where(turn[a] < turn[b], b, a))

    def _with_newborns(self, now: State, sites: np.ndarray) -> State:
        """The patches and newborns at sites (B,), without an anchor yet; full-grown in the first frame."""
        count, first = len(sites), now.frame == 1
        newborn: dict[str, Any] = {
            "face": self.sites[0][sites], "place": self.sites[1][sites], "anchor": np.full((count, 2), -1, np.float32),
            "weight": np.full(count, float(first), np.float32),
            "age": np.full(count, self.settings.growth if first else 0, np.int32), "fading": np.zeros(count, bool),
            "id": now.born + np.arange(count)}
        joined: dict[str, Any] = {name: np.concatenate([getattr(now, name), newborn[name]]) for name in PATCHES}
        return replace(now, born=now.born + count, **joined)

    # 4. match

    def _matched(self, now: State, ground: Ground) -> State:
        """The patches with an anchor for each newborn, as if one after the other, as in `carry`."""
        new = np.flatnonzero(now.anchor[:, 0] < 0)
        if not len(new):
            return now
        painter, places = self.painter, self.painter.places
        near, values = self._tables(now, ground)
        radius = values[:, RADIUS]
        rank = np.zeros(len(now.id), np.int32)
        order = self._order(now, new)
        points = self.mesh.at(self.mesh.vertices, now.face[order], now.place[order]) / self.scale
        rank[order] = self.anchors.rounds(points, radius[order])
        usage = now.usage
        for number in range(1, int(rank.max()) + 1):
            who = np.flatnonzero(rank == number).astype(np.int32)
            found = bake.locate(painter, values, near, who)
            without = np.full(len(found.query), -1, np.int32)
            wanted = np.zeros((len(who), places.padded, 2), np.float32)
            wanted.reshape(-1, 2)[found.texels.number] = bake.show(painter, values, near, found.texels, without, rank,
                                                                   number)
            end = places.count(MATCHED * radius[who])
            query = Query(who, np.full(len(who), -1, np.int32), np.zeros(len(who), np.int32), end)
            anchors = painter.match(opencl.to_device(wanted), query, radius[who], self.anchors.dear(usage))
            there = wanted[:, :len(places.radii), 1] * (np.arange(len(places.radii)) < end[:, None])
            for k in np.flatnonzero(there.sum(axis=1) < FEWEST):
                anchors[k] = self.anchors.anywhere(radius[who[k:k + 1]], now.frame, int(now.id[who[k]]))
            values[who[:, None], [AX, AY]] = anchors
            usage = self.anchors.used(usage, anchors, 1)
        return replace(now, anchor=values[:, [AX, AY]], usage=usage)

    def _order(self, now: State, new: np.ndarray) -> np.ndarray:
        """Newborns `new` in the order in which they are matched: outwards from the first, so that each has neighbours
        on one side."""
        points = self.mesh.at(self.mesh.vertices, now.face[new], now.place[new])
        return np.asarray(new[np.argsort(length(points - points[0]), kind="stable")])

    # 5. blend

    def _blended(self, now: State, ground: Ground) -> State:
        """The state with the share of the variance-preserving blend that gives the sample's gradient.

        The root of the mean squared gradient is taken as linear between the two blends.
        """
        if self.settings.blend != "auto":
            return now
        stencils = _stencils(self.mesh, self.scale)
        near, values = self._tables(now, ground)
        roots = []
        for blend in (0.0, 1.0):
            shown = luminance(bake.bake(self.painter, values, near, stencils, blend), self.sample.white)
            right, left, above, below = shown.astype(np.float64).reshape(-1, 4).T
            roots.append(np.sqrt((((right - left) / 2) ** 2 + ((above - below) / 2) ** 2).mean()))
        wanted = np.sqrt(measures.Reference(self.sample).gradient)
        share = float(np.clip((wanted - roots[0]) / max(roots[1] - roots[0], 1e-6), 0, 1))
        return replace(now, blend=share)


def _sites(of: Mesh, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Where patches may be born: triangles (S,) and barycentric coordinates (S, 3), the middles of smaller triangles
    with edges of `spacing` at most, world units."""
    edge = length(np.roll(of.corners, -1, axis=1) - of.corners).max(axis=1)
    parts = np.maximum(np.ceil(edge / spacing).astype(np.int64), 1)
    face: list[np.ndarray] = []
    place: list[np.ndarray] = []
    for n in np.unique(parts):
        j, i = (a.ravel() for a in np.mgrid[:n, :n])
        upright, turned = i + j < n, i + j < n - 1
        middles = np.concatenate([np.stack([i, j], -1)[upright] + 1 / 3, np.stack([i, j], -1)[turned] + 2 / 3]) / n
        those = np.flatnonzero(parts == n)
        face.append(np.repeat(those, len(middles)))
        place.append(np.tile(middles, (len(those), 1)))
    u, v = np.concatenate(place).T
    every, order = np.concatenate(face), np.argsort(np.concatenate(face), kind="stable")
    return every[order], np.stack([1 - u - v, u, v], axis=-1)[order]


def _stencils(of: Mesh, scale: float) -> Texels:
    """Fours of places, a pixel of the sample to each side of one: evenly over the area; four fours in a triangle."""
    count = max(STENCILS // 4, 1)
    middles = (np.arange(count) + 0.5) / count * of.areas.sum()
    face = np.searchsorted(np.cumsum(of.areas), middles).clip(max=len(of.faces) - 1)
    along = unit(of.corners[face, 1] - of.corners[face, 0])
    across = unit(np.cross(of.area_vectors[face], along))
    sides = scale * np.stack([along, -along, across, -across], axis=1)
    steps = np.stack([dot(sides, of.slopes[face, k][:, None]) for k in (1, 2)], axis=-1)
    middle = np.array([[1 / 3, 1 / 3], [2 / 3, 1 / 6], [1 / 6, 2 / 3], [1 / 6, 1 / 6]])
    place = (middle[:, None] + steps[:, None]).reshape(-1, 2).astype(np.float32)
    texels = Texels.blocks(np.arange(count).repeat(LANES), np.arange(len(place)), place)
    return texels.of(face[texels.face])
