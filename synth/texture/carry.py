"""A texture of carried coordinates: patches of the sample that live for many frames, ride and bend with the flow, and
are drawn anew from the sample in each.

The paper carries colours (wang05 §2.2): cells leave holes, holes are filled and blended, blended cells are synthesised
again. Here nothing blends twice, so nothing blurs; what is synthesised anew is what the flow opens. It departs from the
paper in all but its aim: the direction of the flow, coherence from frame to frame, and the sample's look throughout.

What it does not do: more than one resolution. A feature longer than two radii is cut.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
from scipy.spatial import cKDTree

from synth import opencl
from synth.texture import flow, measures
from synth.texture.anchors import Anchors
from synth.texture.kept import Kept
from synth.texture.patches import (
    AX,
    AY,
    BEFORE,
    BEND_N,
    BEND_T,
    BIAS,
    FIELDS,
    FX,
    FY,
    INVERSE,
    MATCHED,
    NEAR,
    NEVER,
    RADIUS,
    STEEP,
    TILE,
    TX,
    TY,
    Lists,
    Painter,
    Query,
    Table,
    sees_reference,
)
from synth.texture.sample import Sample, luminance

GRID = float(1 << 20)
"""Centres are multiples of 1 / GRID pixels, so that a flow of whole pixels moves them without rounding."""
TURN = 0.5
"""A patch turns by no more than this from its centre to its edge: bends are at most TURN / r, r at most TURN / |∇θ|."""
SWAY = 2.0
"""Pixels by which turning, or bending, may move the picture at a patch's edge in a frame. A patch whose radius goes by
the flow's curvature needs TURN times the speed: 1.1 at 2.2 pixels a frame. Where the direction leaps, in saddles and
sinks, patches of the least radius would turn by any angle at once, and pop; with 1 they would lag behind the flow."""
INFLOW = 12.0
"""Pixels outside the picture in which patches are born, so that what flows in has grown when it is seen."""
FIRST_SITES = 2
"""Pixels between the places that are tried for a birth in the first frame; later TILE / 4."""
FEWEST = 8
"""Places with a picture that a newborn must have to be matched; with fewer its anchor is drawn at random."""
RING = (0.6, 0.8)
"""Radii between which a patch is compared with its neighbours."""
BESIDE = 0.5
"""Radii from a patch that is replaced to the newborn that replaces it."""
WORN = 1.5
"""A seam is repaired where its error has grown so many times since the patch was full-grown."""


@dataclass(frozen=True)
class Settings:
    """How patches live and are drawn.

    radius      least and greatest radius of a patch, pixels; between them it goes by the curvature of the flow
    elongation  a patch's extent along the flow over that across it
    spacing     least distance of patches in the first frame, radii
    birth       a patch is born where the nearest living centre is farther than so many radii
    death       of two patches nearer than so many radii the younger fades
    usage       how strongly places of the sample that are in use are avoided (λ): 0, not at all
    growth      frames in which a patch grows, or fades
    sharpness   of the seams: steepness per pixel of radius
    head_start  what a patch without weight lacks, in squared radii. A seam is 4 wide in steepness times these: where a
                newborn grows as another fades, 2 · 20 · sharpness · head_start / growth = 1.3 of them change hands in a
                frame. At 2.6 blocks of 16 pixels popped
    window      radii from its centre beyond which a patch shows nothing
    blend       share of the blend that preserves variance, 0..1; "auto": so that the first frame's gradient is the
                sample's
    repair      share of the patches whose seams are tested in a frame; 0: none are repaired
    torn        rms difference of a patch from its neighbours, over the sample's deviation, above which it is replaced
    repairs     most patches that are replaced in a frame
    """

    radius: tuple[float, float] = (6.0, 20.0)
    elongation: float = 1.5
    spacing: float = 1.0
    birth: float = 1.12
    death: float = 0.7
    usage: float = 0.6
    growth: int = 12
    sharpness: float = 0.3
    head_start: float = 1.3
    window: float = 1.7
    blend: float | Literal["auto"] = "auto"
    repair: float = 0.125
    torn: float = 0.9
    repairs: int = 4

    def __post_init__(self) -> None:
        least, most = self.radius
        if not 2 <= least <= most <= 40:
            raise ValueError(f"radii are limited to 2 <= least <= most <= 40 pixels, not {least} and {most}")
        if not 1 <= self.elongation <= 4:
            raise ValueError(f"the elongation is in 1..4, not {self.elongation}")
        if not 0 < self.death < self.spacing <= self.birth:
            raise ValueError("distances of patches are 0 < death < spacing <= birth, not "
                             f"{self.death}, {self.spacing} and {self.birth}")
        if self.window < self.birth + 3 / least:
            raise ValueError(f"a window of {self.window} radii leaves gaps: patches of {least} pixels that are born "
                             f"{self.birth} radii apart need {self.birth + 3 / least:.2f}")
        if self.growth < 1:
            raise ValueError(f"patches grow for at least 1 frame, not {self.growth}")
        if self.usage < 0 or self.sharpness <= 0 or self.head_start < 0 or self.torn < 0 or self.repairs < 0:
            raise ValueError("usage, head_start, torn and repairs are not negative, sharpness is positive")
        if self.blend != "auto" and (not isinstance(self.blend, int | float) or not 0 <= self.blend <= 1):
            raise ValueError(f'blend is "auto" or in 0..1, not {self.blend!r}')
        if not 0 <= self.repair <= 1:
            raise ValueError(f"repair is a share of the patches, not {self.repair}")


@dataclass(frozen=True, eq=False)
class State(Kept):
    """All that the next frame and the picture need: P living patches, in order of birth, and the use of the sample.

    frame, born  number of this frame, from 1; patches born so far, which numbers the next
    blend        share of the blend that preserves variance
    centre       (P, 2) float64, pixels: x, y
    axis         (P, 2) float32: cosine and sine of the flow's direction at the centre
    bend         (P, 2) float32: κ_t and κ_n, its change along and across, radians per pixel
    anchor       (P, 2) float32: the place in the sample that lies at the centre, pixels
    radius       (P,) float32, pixels
    weight       (P,) float32, 0..1: how much of a patch has grown
    age          (P,) int32, frames
    fading       (P,) bool: it shrinks, and is gone when its weight is 0
    id           (P,) int64, ascending
    seam         (P,) float32: error of its seams when it was full-grown; -1 before
    usage        (H, W) int32: patches whose anchors are near each pixel of the sample
    mask         (Y, X) bool: where texture is; empty if everywhere
    """

    frame: int
    born: int
    blend: float
    centre: np.ndarray
    axis: np.ndarray
    bend: np.ndarray
    anchor: np.ndarray
    radius: np.ndarray
    weight: np.ndarray
    age: np.ndarray
    fading: np.ndarray
    id: np.ndarray
    seam: np.ndarray
    usage: np.ndarray
    mask: np.ndarray = field(default_factory=lambda: np.zeros((0, 0), bool))


PATCHES = ("centre", "axis", "bend", "anchor", "radius", "weight", "age", "fading", "id", "seam")
"""The arrays of a state with one row for each patch."""


@dataclass(frozen=True, eq=False)
class Ground:
    """What a frame goes by.

    v       (Y, X, 2) float64, pixels per frame: zero where the flow is no number, or masked
    facing  device (Y, X, 2) float32: a vector along the flow, continued where it rests
    open    (Y, X) bool: where texture is; None if everywhere
    clear   (Y, X) float32: pixels to the nearest without texture; None likewise
    """

    v: np.ndarray
    facing: Any
    open: np.ndarray | None
    clear: np.ndarray | None

    def is_open(self, points: np.ndarray) -> np.ndarray:
        """Whether texture is at the pixels nearest to points (M, 2): (M,) bool."""
        return np.ones(len(points), bool) if self.open is None else self.open[_nearest(self.open, points)]

    def free(self, points: np.ndarray) -> np.ndarray:
        """How far round points (M, 2) there is texture only: (M,) float64, pixels, at least 0."""
        if self.clear is None:
            return np.full(len(points), np.inf)
        rows, columns = _nearest(self.clear, points)
        away = np.hypot(points[:, 0] - columns, points[:, 1] - rows)
        # 2: the pixels a line passes lie up to one beside it
        return np.maximum(self.clear[rows, columns] - away - 2, 0)


class Synthesis:
    """Draws a sample on a flow, frame by frame.

    sample; shape (Y, X) of the picture; settings; seed of what is random: the order and place of births.
    Raises ValueError for a sample that has no room for a patch of 2 pixels.
    """

    def __init__(self, sample: Sample, shape: tuple[int, int], settings: Settings, seed: int):
        self.sample, self.shape, self.settings, self.seed = sample, shape, settings, seed
        painter = Painter(sample, shape, settings.window, settings.elongation, settings.radius[1])
        # an anchor must have room in the sample
        most = min(settings.radius[1], float(painter.room.max()) / float(painter.needs(np.ones(1))[0]))
        if most < 2:
            raise ValueError(f"a sample of {sample.shape[1]} x {sample.shape[0]} pixels has no room for a patch")
        self.radius = min(settings.radius[0], most), most
        self.painter = replace(painter, largest=most)
        self.anchors = Anchors(self.painter, settings.usage, seed)
        self._tiled: tuple[State, Table, Lists] | None = None

    def frame(self, v: np.ndarray, state: State | None, mask: np.ndarray | None = None) -> State:
        """The state after a frame of flow v (Y, X, 2), pixels per frame; state is None before the first.

        mask  (Y, X) bool: False where there is no texture; patches do not reach across. None: everywhere

        1. Follow: patches move with the flow, turn and bend with it, grow or fade; some are gone.
        2. Crowd: of two that are too near the younger fades; so does one that is about to leave the mask.
        3. Wear: some whose seams the flow has torn fade, each with a newborn in its place.
        4. Bear: newborns where no patch is near.
        5. Match: each newborn takes the place of the sample that best continues the picture where it lies.
        6. In the first frame, choose the blend.
        """
        ground = self._ground(v, mask)
        number = 1 if state is None else state.frame + 1
        # 1. follow
        now = self._empty(number, ground) if state is None else self._followed(state, ground)
        # 2. crowd
        now = self._crowded(now, ground)
        # 3. wear
        now, replaced = self._worn(now, ground)
        # 4. bear
        now = self._born(now, ground)
        # 5. match
        now = self._matched(now, replaced, ground)
        # 6. blend
        return self._blended(now) if state is None else now

    def picture(self, state: State) -> np.ndarray:
        """(Y, X, 3) float32, linear light; zero where there is no texture."""
        table, lists = self._tables(state)
        return self.painter.draw(table, lists, state.blend, _open(state))

    def maps(self, state: State) -> np.ndarray:
        """(Y, X, 6) float32: u, v, weight of each pixel's strongest patch, then of the next.

        u and v are 0 at the left and lower edge of the sample and 1 at the others; weights of all patches of a pixel
        together are 1, so what the two lack belongs to others.
        """
        table, lists = self._tables(state)
        return self.painter.strongest(table, lists, _open(state))

    def renewed(self, state: State) -> float:
        """Share of the pixels that this frame drew anew: another patch took them over, since it grew or one faded."""
        table, lists = self._tables(state)
        now = self.painter.owners(table, lists, _open(state))
        before = self.painter.owners(table, lists, _open(state), BEFORE)
        textured = state.mask.sum() if state.mask.size else now.size
        return float((now != before).sum() / max(int(textured), 1))

    # what a frame goes by

    def _ground(self, v: np.ndarray, mask: np.ndarray | None) -> Ground:
        """The flow without what is no number, its direction continued, and the mask."""
        if v.shape != (*self.shape, 2):
            raise ValueError(f"a flow of shape {v.shape} on a picture of {self.shape}: it is (Y, X, 2)")
        if mask is not None and mask.shape != self.shape:
            raise ValueError(f"a mask of shape {mask.shape} on a picture of {self.shape}")
        open_ = None if mask is None or mask.all() else np.ascontiguousarray(mask, bool)
        v = np.asarray(v, np.float32)
        size = np.abs(v[..., 0]) + np.abs(v[..., 1])
        # false for what is no number
        moving = (size > 0) & (size < np.inf)
        if open_ is not None:
            moving &= open_
        if moving.all():
            return Ground(v, opencl.to_device(v), None, None)
        v = np.where(moving[..., None], v, np.float32(0))
        walls = None if open_ is None else self.painter.walls(open_)
        if walls is not None and (moving == open_).all():
            facing = v[walls.nearest]
        else:
            facing = self._continued(v)
        return Ground(v, opencl.to_device(facing), open_, None if walls is None else walls.clear)

    def _continued(self, v: np.ndarray) -> np.ndarray:
        """Unit vectors along v, continued where it rests: (Y, X, 2) float32. Those of the last flow are kept."""
        if self._last_flow is None or not np.array_equal(self._last_flow[0], v):
            angle = flow.angles(v)
            self._last_flow = v, np.stack([np.cos(angle), np.sin(angle)], axis=-1).astype(np.float32)
        return self._last_flow[1]

    _last_flow: tuple[np.ndarray, np.ndarray] | None = None

    def _turned(self, centre: np.ndarray, ground: Ground) -> dict[str, np.ndarray]:
        """Axis, bend and radius of patches at centres (M, 2)."""
        found = self.painter.directions(ground.facing, centre)
        curvature = np.hypot(found[:, 2], found[:, 3])
        least, most = self.radius
        radius = np.clip(TURN / np.maximum(curvature, TURN / most), least, most).astype(np.float32)
        limit = (np.float32(TURN) / radius)[:, None]
        return {"axis": found[:, :2].copy(), "bend": np.clip(found[:, 2:], -limit, limit), "radius": radius}

    def _table(self, now: State, ground: Ground | None) -> Table:
        """The patches of a state as the kernels read them. Without a ground, masks are as the state has them."""
        s, count = self.settings, len(now.id)
        cells = np.floor(now.centre)
        values = np.zeros((count, FIELDS), np.float32)
        values[:, [FX, FY]] = now.centre - cells
        values[:, [TX, TY]], values[:, [BEND_T, BEND_N]], values[:, [AX, AY]] = now.axis, now.bend, now.anchor
        values[:, INVERSE] = np.float32(1) / (now.radius * now.radius)
        values[:, STEEP] = np.float32(s.sharpness) * now.radius
        step = np.where(now.fading, 1, -1).astype(np.float32) / np.float32(s.growth)
        earlier = np.where(now.fading | (now.age <= s.growth), np.clip(now.weight + step, 0, 1), now.weight)
        for column, weight in ((BIAS, now.weight), (BEFORE, earlier)):
            values[:, column] = values[:, STEEP] * np.float32(s.head_start) * (np.float32(1) - weight)
        values[now.age == 0, BEFORE] = NEVER
        values[:, RADIUS] = now.radius
        if ground is None and now.mask.size:
            ground = Ground(np.zeros(0), None, now.mask, self.painter.walls(now.mask).clear)
        values[:, NEAR] = NEVER
        if ground is not None:
            free = ground.free(now.centre)
            values[:, NEAR] = np.where(free < self.painter.extent(now.radius), free * free, NEVER)
        return Table(cells.astype(np.int32), values)

    def _tables(self, state: State) -> tuple[Table, Lists]:
        """The patches of a state and the tiles they reach; those of the last state are kept."""
        if self._tiled is None or self._tiled[0] is not state:
            table = self._table(state, None)
            self._tiled = state, table, self.painter.reaching(table)
        return self._tiled[1:]

    def _empty(self, number: int, ground: Ground) -> State:
        none = np.zeros((0, 2), np.float32)
        blend = 0.0 if self.settings.blend == "auto" else float(self.settings.blend)
        row = np.zeros(0, np.float32)
        return State(number, 0, blend, np.zeros((0, 2)), none, none, none, row, row, row.astype(np.int32),
                     row.astype(bool), row.astype(np.int64), row, np.zeros(self.sample.shape, np.int32),
                     _kept(ground))

    # 1. follow

    def _followed(self, state: State, ground: Ground) -> State:
        """The patches one frame later.

        1. Centres move by the midpoint rule, to the grid.
        2. What has faded, lies too far outside, or has left the mask is gone.
        3. Axis, bend and radius go over to the flow's there; weights grow or fade.
        """
        # 1. what a patch moves is rounded, not where it is: every patch of a uniform flow moves alike
        step = flow.midpoint(ground.v, state.centre) - state.centre
        centre = state.centre + np.rint(step * GRID) / GRID
        # 2. gone
        by = np.float32(1 / self.settings.growth)
        weight = np.where(state.fading, state.weight - by, np.minimum(state.weight + by, 1))
        outside = np.maximum(-centre, centre - (np.array(self.shape[::-1]) - 1)).max(axis=1, initial=-np.inf)
        far = max(float(self.painter.extent(np.array(self.radius[1]))), INFLOW) + 6
        stays = ~(state.fading & (weight <= 0)) & (outside < far) & ground.is_open(centre)
        # 3. turn
        now = replace(state, frame=state.frame + 1, centre=centre, weight=weight.astype(np.float32),
                      age=state.age + np.int32(1), mask=_kept(ground))
        now = replace(chosen(now, stays), usage=self.anchors.used(state.usage, state.anchor[~stays], -1))
        return replace(now, **self._eased(now, self._turned(now.centre, ground)))

    def _eased(self, now: State, turned: dict[str, np.ndarray]) -> dict[str, Any]:
        """Axis, bend and radius as `_turned` gave them; axis and bend no farther from those of `now` than SWAY allows.

        Only where the flow's direction leaps, in saddles and sinks or from frame to frame, do they lag behind.
        """
        radius = turned["radius"]
        old, new = now.axis.astype(np.float64), turned["axis"].astype(np.float64)
        angle = np.arctan2(old[:, 0] * new[:, 1] - old[:, 1] * new[:, 0], (old * new).sum(axis=1))
        by = np.clip(angle, -SWAY / radius, SWAY / radius)
        cos, sin = np.cos(by), np.sin(by)
        behind = np.stack([old[:, 0] * cos - old[:, 1] * sin, old[:, 0] * sin + old[:, 1] * cos], axis=-1)
        # a bend of κ moves what lies r away by κ r² / 2
        most = (2 * SWAY / (radius * radius))[:, None]
        limit = (np.float32(TURN) / radius)[:, None]
        bend = np.clip(now.bend + np.clip(turned["bend"] - now.bend, -most, most), -limit, limit)
        return {"axis": np.where((by == angle)[:, None], turned["axis"], behind.astype(np.float32)),
                "bend": bend.astype(np.float32), "radius": radius}

    # 2. crowd

    def _crowded(self, now: State, ground: Ground) -> State:
        """Fades the younger of two patches that are too near, older ones first, and what is about to leave the mask."""
        fading = now.fading.copy()
        if ground.open is not None and len(now.id):
            ahead = now.centre + self.settings.growth * flow.at(ground.v, now.centre)
            fading |= ~ground.is_open(ahead)
        living = np.flatnonzero(~fading)
        e, most = self.settings.elongation, self.settings.death * self.radius[1]
        pairs = living[cKDTree(now.centre[living]).query_pairs(most * np.sqrt(e), output_type="ndarray")]
        pairs = pairs[np.lexsort([pairs[:, 0], pairs[:, 1]])] if len(pairs) else np.zeros((0, 2), np.intp)
        older, younger = pairs.T
        offset, axis = now.centre[younger] - now.centre[older], now.axis[older].astype(np.float64)
        s = offset[:, 0] * axis[:, 0] + offset[:, 1] * axis[:, 1]
        m = offset[:, 1] * axis[:, 0] - offset[:, 0] * axis[:, 1]
        least = self.settings.death * (now.radius[older] + now.radius[younger]) / 2
        near = s * s / e + m * m * e < least * least
        if ground.open is not None:
            by_wall = np.flatnonzero(near)
            by_wall = by_wall[ground.free(now.centre[older[by_wall]]) < np.hypot(*offset[by_wall].T)]
            near[by_wall] = sees_reference(ground.open, now.centre[younger[by_wall]], now.centre[older[by_wall]])
        for a, b in zip(older[near].tolist(), younger[near].tolist(), strict=True):
            fading[b] |= not fading[a]
        return replace(now, fading=fading)

    # 3. wear

    def _worn(self, now: State, ground: Ground) -> tuple[State, dict[int, int]]:
        """The patches, some fading with a newborn each in their place; which newborn (its row) replaces which patch.

        1. A share of the patches, in turn, is compared with what its neighbours show on a ring round its centre.
        2. What is tested for the first time since it grew is recorded.
        3. The worst of those that are torn, and were better once, are replaced.
        """
        s = self.settings
        if s.repair == 0 or not len(now.id):
            return now, {}
        # 1. compare
        full = (now.weight == 1) & ~now.fading & _inside(now.centre, self.shape)
        tested = np.flatnonzero(full & ((now.id + now.frame) % round(1 / s.repair) == 0)).astype(np.int32)
        if not len(tested):
            return now, {}
        error = self._seams(now, tested, ground)
        # 2. record
        seam = now.seam.copy()
        fresh = (seam[tested] < 0) & (error >= 0)
        seam[tested[fresh]] = error[fresh]
        now = replace(now, seam=seam)
        # 3. replace
        torn = np.flatnonzero((error > s.torn) & (error > WORN * seam[tested]) & ~fresh)
        worst = tested[torn[np.lexsort([tested[torn], -error[torn]])][:s.repairs]]
        fading = now.fading.copy()
        fading[worst] = True
        count = len(now.id)
        now = self._with_newborns(replace(now, fading=fading), self._beside(now, worst, ground), ground)
        return now, {count + k: int(old) for k, old in enumerate(worst)}

    def _seams(self, now: State, who: np.ndarray, ground: Ground) -> np.ndarray:
        """rms difference of patches `who` from what the others show on a ring round them, over the sample's deviation.

        (Q,) float32; -1 where no other patch reaches the ring.
        """
        painter, places = self.painter, self.painter.places
        table, radius = self._table(now, ground), now.radius[who]
        query = Query(who, who, places.count(RING[0] * radius), places.count(RING[1] * radius))
        shown = painter.rectify(table, painter.around(table, who, RING[1] * radius), query,
                                np.zeros(len(now.id), np.int32), 1, ground.open).get()[:, :len(places.radii)]
        margin = int(np.abs(places.offsets).max(initial=0))
        x, y = np.moveaxis(now.anchor[who][:, None].astype(np.int64) + places.offsets + margin, -1, 0)
        own = painter.mirrored(margin)[y, x]
        index = np.arange(len(places.radii))
        asked = (index >= query.first[:, None]) & (index < query.end[:, None]) & (shown[..., 1] > 0)
        squared = np.where(asked, (shown[..., 0] - own).astype(np.float64) ** 2, 0).sum(axis=1)
        count = asked.sum(axis=1)
        error = np.sqrt(squared / np.maximum(count, 1) / painter.variance)
        return np.where(count > 0, error, -1).astype(np.float32)

    def _beside(self, now: State, who: np.ndarray, ground: Ground) -> np.ndarray:
        """A place BESIDE radii from the centres of patches `who` (Q,), at random: (Q, 2) float64; no such place in a
        mask. Of two patches with one centre the whole cell would change hands at once."""
        random = np.random.Generator(np.random.Philox(key=[self.seed, now.frame], counter=[0, 0, 1, 0]))
        angle = random.uniform(0, 2 * np.pi, len(who))
        offset = BESIDE * now.radius[who].astype(np.float64)[:, None] * np.stack([np.cos(angle), np.sin(angle)], -1)
        beside = now.centre[who] + np.rint(offset * GRID) / GRID
        return np.where(ground.is_open(beside)[:, None], beside, now.centre[who])

    # 4. bear

    def _born(self, now: State, ground: Ground) -> State:
        """The patches with newborns wherever no living one is near.

        1. Sites on a lattice, to a little outside the picture, from which no living patch is near.
        2. In an order at random, each that is still bare bears a patch, shifted a little, and covers those round it.
        3. Where a mask hides all patches from a pixel, one is born there.
        """
        s, first = self.settings, now.born == 0
        spacing = FIRST_SITES if first else TILE // 4
        # 1. bare sites, by row and column
        rows, columns = (n * TILE // spacing for n in self.painter.tiles)
        place = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1) * spacing - TILE
        turned = {name: values.reshape(rows, columns, -1)
                  for name, values in self._turned(place.reshape(-1, 2), ground).items()}
        radii = turned["radius"][..., 0]
        bare = (place >= -INFLOW).all(axis=2) & (place <= np.array(self.shape[::-1]) - 1 + INFLOW).all(axis=2)
        bare &= ground.is_open(place.reshape(-1, 2)).reshape(rows, columns)
        if len(now.id):
            bare &= self._without(now, radii, ground)
        # 2. births
        random = np.random.Generator(np.random.Philox(key=[self.seed, now.frame])).random((rows, columns, 3))
        candidates = np.flatnonzero(bare)
        candidates = candidates[np.argsort(random[..., 0].ravel()[candidates], kind="stable")]
        covering, births = s.spacing if first else s.birth, []
        for k in candidates.tolist():
            j, i = divmod(k, columns)
            if bare[j, i]:
                centre = place[j, i] + np.rint((random[j, i, 1:] - 0.5) * GRID) / GRID * (spacing / 2)
                if not ground.is_open(centre[None])[0]:
                    centre = place[j, i].astype(np.float64)
                births.append(centre)
                self._cover(bare, place, radii, (j, i), centre, turned["axis"][j, i], covering, ground)
        now = self._with_newborns(now, np.array(births).reshape(-1, 2), ground)
        # 3. what is hidden from all
        return now if ground.open is None else self._uncovered(now, ground.open, ground)

    def _without(self, now: State, radii: np.ndarray, ground: Ground) -> np.ndarray:
        """Sites (rows, columns) of later frames that no living patch is near."""
        painter = self.painter
        table = self._table(now, ground)
        rows, columns = painter.tiles
        by_tile = radii.reshape(rows, 4, columns, 4).transpose(0, 2, 1, 3).reshape(-1, 16)
        bare = painter.bare(table, painter.reaching(table), ~now.fading, by_tile, self.settings.birth, ground.open)
        return bare.reshape(rows, columns, 4, 4).transpose(0, 2, 1, 3).reshape(rows * 4, columns * 4)

    def _cover(self, bare: np.ndarray, place: np.ndarray, radii: np.ndarray, site: tuple[int, int], centre: np.ndarray,
               axis: np.ndarray, distance: float, ground: Ground) -> None:
        """Marks the sites near a newborn at `centre` (2,), born of a site (row, column), as no longer bare."""
        (j, i), own, (cos, sin), e = site, radii[site], axis.astype(np.float64), self.settings.elongation
        reach = int(distance * own * np.sqrt(e) / (place[0, 1, 0] - place[0, 0, 0])) + 2
        part = np.s_[max(j - reach, 0):j + reach + 1, max(i - reach, 0):i + reach + 1]
        offset = place[part] - centre
        s, m = offset[..., 0] * cos + offset[..., 1] * sin, offset[..., 1] * cos - offset[..., 0] * sin
        limit = distance * np.minimum(radii[part], own)
        near = s * s / e + m * m * e <= limit * limit
        if ground.open is not None:
            asked = near & (np.hypot(offset[..., 0], offset[..., 1]) > ground.free(centre[None]))
            near[asked] = sees_reference(ground.open, place[part][asked].astype(np.float64),
                                         np.broadcast_to(centre, (asked.sum(), 2)))
        bare[part] &= ~near

    def _uncovered(self, now: State, open_: np.ndarray, ground: Ground) -> State:
        """Adds patches until each pixel with texture has one that reaches it: at the first pixel, then the next."""
        while True:
            table = self._table(now, ground)
            owner = self.painter.owners(table, self.painter.reaching(table), open_)
            missing = np.argwhere((owner < 0) & open_)[:, ::-1].astype(np.float64)
            if not len(missing):
                return now
            births = []
            while len(missing):
                births.append(missing[0])
                near = np.hypot(*(missing - missing[0]).T) <= self.radius[0]
                near &= sees_reference(open_, missing, np.broadcast_to(missing[0], missing.shape))
                near[0] = True
                missing = missing[~near]
            now = self._with_newborns(now, np.array(births), ground)

    def _with_newborns(self, now: State, centre: np.ndarray, ground: Ground) -> State:
        """The patches and newborns at centres (B, 2), without an anchor yet; full-grown in the first frame."""
        count, first = len(centre), now.frame == 1
        newborn: dict[str, Any] = {
            "centre": centre, "anchor": np.full((count, 2), -1, np.float32),
            "weight": np.full(count, float(first), np.float32),
            "age": np.full(count, self.settings.growth if first else 0, np.int32), "fading": np.zeros(count, bool),
            "id": now.born + np.arange(count), "seam": np.full(count, -1, np.float32), **self._turned(centre, ground)}
        joined: dict[str, Any] = {name: np.concatenate([getattr(now, name), newborn[name]]) for name in PATCHES}
        return replace(now, born=now.born + count, **joined)

    # 5. match

    def _matched(self, now: State, replaced: dict[int, int], ground: Ground) -> State:
        """The patches with an anchor for each newborn, as if one after the other.

        1. Rounds: a newborn is in the first round after those of all earlier newborns that may reach it.
        2. Each round: the picture so far, laid out in the axes of each newborn; the anchor that continues it best,
           dearer where the sample is in use; at random where there is no picture yet.
        """
        new = np.flatnonzero(now.anchor[:, 0] < 0)
        if not len(new):
            return now
        painter, places = self.painter, self.painter.places
        # 1. rounds
        order = self._order(now, new)
        rank = np.zeros(len(now.id), np.int32)
        rank[new[order]] = self.anchors.rounds(now.centre[new[order]], now.radius[new[order]])
        radius = now.radius[new]
        table = self._table(now, ground)
        lists = painter.around(table, new, MATCHED * radius)
        without = np.array([replaced.get(int(k), -1) for k in new], np.int32)
        end = places.count(MATCHED * radius)
        usage = now.usage
        # 2. each round
        for number in range(1, int(rank.max()) + 1):
            turn = np.flatnonzero(rank[new] == number)
            query = Query(new[turn].astype(np.int32), without[turn], np.zeros(len(turn), np.int32), end[turn])
            wanted = painter.rectify(table, _part(lists, turn), query, rank, number, ground.open)
            anchors = painter.match(wanted, query, radius[turn], self.anchors.dear(usage))
            there = wanted.get()[:, :len(places.radii), 1]
            few = (there * (np.arange(len(places.radii)) < query.end[:, None])).sum(axis=1) < FEWEST
            for k in np.flatnonzero(few):
                anchors[k] = self.anchors.anywhere(radius[turn[k:k + 1]], now.frame, int(now.id[query.who[k]]))
            table.values[query.who[:, None], [AX, AY]] = anchors
            usage = self.anchors.used(usage, anchors, 1)
        return replace(now, anchor=table.values[:, [AX, AY]].copy(), usage=usage)

    def _order(self, now: State, new: np.ndarray) -> np.ndarray:
        """The order in which newborns are matched: from the middle of the picture outwards, so that each has
        neighbours on one side."""
        away = now.centre[new] - (np.array(self.shape[::-1]) - 1) / 2
        return np.argsort((away * away).sum(axis=1), kind="stable")

    # 6. blend

    def _blended(self, now: State) -> State:
        """The state with the share of the variance-preserving blend that gives the sample's gradient.

        The root of the mean squared gradient is taken as linear between the two blends. A picture of less than 3 x 3
        pixels has none.
        """
        if self.settings.blend != "auto" or min(self.shape) < 3:
            return now
        plain, full = (np.sqrt(measures.gradient(luminance(self.picture(replace(now, blend=b)), self.sample.white),
                                                 self._reference)) for b in (0.0, 1.0))
        return replace(now, blend=float(np.clip((1 - plain) / max(full - plain, 1e-6), 0, 1)))

    @cached_property
    def _reference(self) -> measures.Reference:
        return measures.Reference(self.sample)


def _nearest(field: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Row and column of the pixel of field (Y, X) that is nearest to each of points (M, 2)."""
    x, y = np.rint(points).astype(np.int64).T
    return np.clip(y, 0, field.shape[0] - 1), np.clip(x, 0, field.shape[1] - 1)


def _inside(centre: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    return np.asarray(((centre >= 0) & (centre <= np.array(shape[::-1]) - 1)).all(axis=1))


def _kept(ground: Ground) -> np.ndarray:
    return np.zeros((0, 0), bool) if ground.open is None else ground.open


def _open(state: State) -> np.ndarray | None:
    return state.mask if state.mask.size else None


def chosen(state: State, rows: np.ndarray) -> State:
    """The state with some of its patches: rows, an index or a mask."""
    return replace(state, **{name: getattr(state, name)[rows] for name in PATCHES})


def _part(lists: Lists, which: np.ndarray) -> Lists:
    """The lists of some queries."""
    starts = np.concatenate([[0], np.cumsum(lists.starts[which + 1] - lists.starts[which])]).astype(np.int32)
    pieces = [lists.members[lists.starts[k]:lists.starts[k + 1]] for k in which]
    return Lists(starts, np.concatenate(pieces))
