"""Patches of a sample that lie on a picture: what they cover, what they show, and which place of the sample continues
what is there.

A patch is a centre, an axis t along the flow, two bends, an anchor in the sample and a radius r. At x = c + s t + m n
it shows the sample at a + Rot(θ_s) (U, V), where

    U = s + κ_t s m + κ_n m² / 2        V = m - κ_t s² / 2 - κ_n s m

so that V = 0 is the streamline through its centre, to second order. Each pixel belongs to the patch that is least
remote,

    e = steepness (ρ + head_start (1 - w)) + t⁴ / (1 - t)
    ρ = (s² / elongation + m² elongation) / r²        t = ρ / reach²

which is a power diagram where t is small; beyond t = 1 a patch shows nothing. Others have a share where they are less
than 4 more remote, by (1 - Δe / 4)⁴, which is near exp(-Δe).

Hot: `draw` is half of a frame (about 14 CPU ms for 512² pixels in colour). It is bound by the reads of the sample, four
for each patch that has a share in one of 16 pixels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from synth import opencl
from synth.texture import flow
from synth.texture.sample import Sample

TILE = 16
FINE = 3
"""The sample is enlarged so many times, by a cubic spline, and then read by linear interpolation."""
FX, FY, TX, TY, BEND_T, BEND_N, AX, AY, INVERSE, STEEP, BIAS, BEFORE, RADIUS, NEAR = range(14)
"""What the floats of a patch's table are; the kernels know them by the same names."""
FIELDS = 16
NEVER = np.float32(1e30)
NEED = 1.25
"""Radii round an anchor in which no pixel of the sample may be transparent."""
EDGE = 0.6
"""Radii from an anchor to the sample's edge, at least. Farther out a patch may show the sample mirrored; were more
asked for, the sample's middle would be seen more often than its edges."""
MATCHED = 1.15
"""Radius of the disc in which a newborn patch is compared with the picture, over the patch's radius."""
SPREAD = 12
"""Pixels round an anchor that count as used."""
LEAST_ERROR = 1e-3
"""Of the mean squared difference over the sample's variance: below, only use decides."""
UNLIKE = 4.0
"""Over how far patches differ in colour: where they differ by the sample's deviation over the root of this, or by more,
the blend preserves all of the variance. Where they are alike it must add none: their seam would show."""
TOGETHER = 16
"""Work-items of a group of `directions`. All sizes of groups are given: some devices compile a kernel anew for each."""
STEP = 2.0
"""Pixels to each side over which the flow's angle is differenced."""


class Lists(NamedTuple):
    """Which patches reach which tile (or query), in order: tile k has members[starts[k]:starts[k + 1]]."""

    starts: np.ndarray
    members: np.ndarray


class Table(NamedTuple):
    """Patches as kernels read them: cells (P, 2) int32, the pixel before each centre; values (P, FIELDS) float32."""

    cells: np.ndarray
    values: np.ndarray

    @property
    def centres(self) -> np.ndarray:
        """(P, 2) float64, pixels."""
        return self.cells + self.values[:, [FX, FY]].astype(np.float64)


@dataclass(frozen=True, eq=False)
class Painter:
    """Draws and matches patches of `sample` on a picture of `shape` (Y, X).

    reach       radii from a centre beyond which a patch shows nothing
    elongation  a patch's extent along the flow over that across it
    largest     radius that will be asked for, pixels
    """

    sample: Sample
    shape: tuple[int, int]
    reach: float
    elongation: float
    largest: float
    _walls: list[Walls] = field(default_factory=list, init=False, repr=False)

    # what the sample is to the kernels

    @cached_property
    def colour(self) -> np.ndarray:
        """The sample enlarged: (3 (H - 1) + 1, 3 (W - 1) + 1, channels) float32; one channel where it is grey."""
        colour = self.sample.colour
        grey = np.ptp(colour, axis=2).max() == 0
        return enlarged(colour[..., :1] if grey else colour)

    @cached_property
    def luminance(self) -> np.ndarray:
        """What is matched, enlarged in the same way: (rows, columns, 1) float32."""
        return enlarged(self.sample.luminance[..., None])

    @cached_property
    def tones(self) -> np.ndarray:
        """Mean, least and greatest of the sample's colours, and UNLIKE over their variance: (4, channels) float32."""
        colour = self.sample.colour[..., :self.colour.shape[2]]
        if self.sample.opaque is not None:
            colour = colour[self.sample.opaque]
        colour = colour.reshape(-1, colour.shape[-1])
        mean = colour.mean(axis=0, dtype=np.float64)
        variance = max(float(((colour - mean) ** 2).mean(axis=0).sum()), 1e-12)
        return np.stack([mean, colour.min(axis=0), colour.max(axis=0),
                         np.full(len(mean), UNLIKE / variance)]).astype(np.float32)

    @cached_property
    def variance(self) -> float:
        """Of the luminance."""
        return float(self.sample.luminance.astype(np.float64).var())

    @cached_property
    def turn(self) -> np.ndarray:
        """Cosine and sine of the sample's direction: float32."""
        return np.array([np.cos(self.sample.direction), np.sin(self.sample.direction)], np.float32)

    @cached_property
    def last(self) -> np.ndarray:
        """The sample's last column and row: float32."""
        return np.array([self.sample.shape[1] - 1, self.sample.shape[0] - 1], np.float32)

    @cached_property
    def room(self) -> np.ndarray:
        """Pixels from each pixel to a transparent one, or NEED / EDGE times those to the edge: (H, W) float32."""
        height, width = self.sample.shape
        y, x = np.mgrid[:height, :width]
        room = np.minimum(np.minimum(x, width - 1 - x), np.minimum(y, height - 1 - y)) * (NEED / EDGE)
        if self.sample.opaque is not None:
            room = np.minimum(room, ndimage.distance_transform_edt(self.sample.opaque) - 1)
        return room.astype(np.float32)

    def mirrored(self, margin: int) -> np.ndarray:
        """The luminance with `margin` pixels on each side, mirrored as `draw` mirrors it."""
        return np.pad(self.sample.luminance, margin, mode="reflect")

    @cached_property
    def places(self) -> Places:
        return Places.within(MATCHED * self.largest, float(self.sample.direction), self.elongation)

    def needs(self, radius: np.ndarray) -> np.ndarray:
        """Room that patches of these radii need: float32, pixels."""
        return (NEED * np.sqrt(self.elongation) * radius).astype(np.float32)

    def extent(self, radius: np.ndarray) -> np.ndarray:
        """How far from its centre a patch of this radius shows anything: float64, pixels."""
        return np.asarray(radius, np.float64) * (self.reach * np.sqrt(self.elongation))

    # which patches are where

    @cached_property
    def tiles(self) -> tuple[int, int]:
        """Rows and columns of tiles; one row and column of them lies outside on each side."""
        return -(-self.shape[0] // TILE) + 2, -(-self.shape[1] // TILE) + 2

    def reaching(self, table: Table) -> Lists:
        """The patches that reach each tile."""
        rows, columns = self.tiles
        centre, extent = table.centres, self.extent(table.values[:, RADIUS]) + 0.01
        low = np.maximum(np.floor((centre - extent[:, None]) / TILE).astype(np.int64) + 1, 0)
        high = np.minimum(np.floor((centre + extent[:, None]) / TILE).astype(np.int64) + 1, [columns - 1, rows - 1])
        count = np.maximum(high - low + 1, 0)
        each = count[:, 0] * count[:, 1]
        patch = np.repeat(np.arange(len(each)), each)
        index = np.arange(len(patch)) - np.repeat(np.cumsum(each) - each, each)
        tile = low[patch] + np.stack(np.divmod(index, count[patch, 0])[::-1], axis=-1)
        corner = (tile - 1) * TILE
        away = np.maximum(np.maximum(corner - centre[patch], centre[patch] - (corner + TILE - 1)), 0)
        near = (away * away).sum(axis=1) <= extent[patch] ** 2
        key, patch = (tile[:, 1] * columns + tile[:, 0])[near], patch[near]
        order = np.argsort(key.astype(np.int16) if rows * columns < 1 << 15 else key, kind="stable")
        return _lists(key, patch[order], rows * columns)

    def around(self, table: Table, who: np.ndarray, radius: np.ndarray) -> Lists:
        """For each of the patches `who` (Q,) all that reach a place within `radius` (Q,) of its centre."""
        centre, extent = table.centres, self.extent(table.values[:, RADIUS])
        # a bent place lies farther away than it would unbent
        own = 1.6 * np.sqrt(self.elongation) * radius + 1
        query, patch = pairs_within(centre[who], centre, own, extent)
        return _lists(query, patch, len(who))

    # the kernels

    def _program(self, open_: np.ndarray | None) -> opencl.Program:
        return self.program(Path(__file__).with_suffix(".cl"), masked=open_ is not None)

    def program(self, source: Path, masked: bool = False, **defines: Any) -> opencl.Program:
        """The kernels of `source`, which are those of patches.cl or include them."""
        return opencl.program(source, CHANNELS=self.colour.shape[2], FINE=FINE, TILE=TILE,
                              MASKED=int(masked), FIELDS=FIELDS, REACH2=_literal(self.reach**2),
                              ALONG=_literal(1 / self.elongation), ACROSS=_literal(self.elongation), **defines)

    @cached_property
    def colour_on_device(self) -> tuple[Any, np.ndarray]:
        """What is drawn, and its columns and rows."""
        return opencl.to_device(self.colour), np.array(self.colour.shape[1::-1], np.int32)

    @cached_property
    def luminance_on_device(self) -> tuple[Any, np.ndarray]:
        """What is matched, and its columns and rows."""
        return opencl.to_device(self.luminance), np.array(self.luminance.shape[1::-1], np.int32)

    def walls(self, open_: np.ndarray) -> Walls:
        """What is known of a mask (Y, X) bool, False where no texture is; that of the last mask is kept."""
        if not self._walls or not np.array_equal(self._walls[0].open, open_):
            self._walls[:] = [Walls.of(open_)]
        return self._walls[0]

    def _mask(self, open_: np.ndarray | None) -> tuple[Any, np.ndarray]:
        clear = opencl.zeros(1) if open_ is None else self.walls(open_).on_device
        return clear, np.array(self.shape[::-1], np.int32)

    def _over_pixels(self) -> tuple[tuple[int, int], tuple[int, int]]:
        rows, columns = self.tiles
        return (columns - 2, (rows - 2) * TILE), (1, TILE)

    def draw(self, table: Table, lists: Lists, blend: float, open_: np.ndarray | None) -> np.ndarray:
        """The picture (Y, X, 3) float32, linear light; `draw_reference` says what it is."""
        channels = self.colour.shape[2]
        out = opencl.empty((*self.shape, channels))
        self._program(open_).draw(*self._over_pixels(), *_uploaded(lists), *_uploaded(table), *self.colour_on_device,
                                  self.turn, self.last, opencl.to_device(self.tones), np.float32(blend),
                                  *self._mask(open_), out)
        picture = out.get()
        return picture if channels == 3 else np.repeat(picture, 3, axis=2)

    def strongest(self, table: Table, lists: Lists, open_: np.ndarray | None) -> np.ndarray:
        """The two strongest patches: (Y, X, 6) float32; `strongest_reference` says what they are."""
        out = opencl.empty((*self.shape, 6))
        self._program(open_).strongest(*self._over_pixels(), *_uploaded(lists), *_uploaded(table), self.turn, self.last,
                                       *self._mask(open_), out)
        return out.get()

    def owners(self, table: Table, lists: Lists, open_: np.ndarray | None, when: int = BIAS) -> np.ndarray:
        """The nearest patch of each pixel, -1 where none reaches: (Y, X) int32; `when` as of now or a frame before."""
        out = opencl.empty(self.shape, np.int32)
        self._program(open_).owners(*self._over_pixels(), *_uploaded(lists), *_uploaded(table), np.int32(when),
                                    *self._mask(open_), out)
        return out.get()

    def bare(self, table: Table, lists: Lists, living: np.ndarray, radii: np.ndarray, distance: float,
             open_: np.ndarray | None) -> np.ndarray:
        """Sites that no living patch is near: (tiles, 16) bool; `bare_reference` says which."""
        rows, columns = self.tiles
        out = opencl.empty((rows * columns, 16), np.uint8)
        self._program(open_).bare((rows * columns,), (1,), *_uploaded(lists), *_uploaded(table),
                                  opencl.to_device(living.astype(np.uint8)), opencl.to_device(radii),
                                  np.float32(distance), np.int32(columns), *self._mask(open_), out)
        return out.get().astype(bool)

    def rectify(self, table: Table, lists: Lists, query: Query, rank: np.ndarray, below: int,
                open_: np.ndarray | None) -> Any:
        """The picture's luminance at the places of each query: device (Q, places, 2); see `rectify_reference`."""
        places = self.places
        out = opencl.zeros((len(query.who), places.padded, 2))
        self._program(open_).rectify((places.padded // 16, len(query.who)), (1, 1), *_uploaded(query),
                                     *places.on_device, *_uploaded(lists), opencl.to_device(rank), np.int32(below),
                                     *_uploaded(table),
                                     *self.luminance_on_device, self.turn, self.last, *self._mask(open_), out)
        return out

    @cached_property
    def _grid(self) -> tuple[Any, Any, np.int32, np.int32, np.int32, Any]:
        """Offsets of the places in a luminance with a margin; that luminance; where it begins; its stride; its columns
        in whole steps of 32; the room in it."""
        height, width = self.sample.shape
        margin = int(np.abs(self.places.offsets).max(initial=0)) + 1
        columns = -(-width // 32) * 32
        stride = columns + 2 * margin
        padded = np.zeros((height + 2 * margin, stride), np.float32)
        padded[:, :width + 2 * margin] = self.mirrored(margin)
        room = np.full((height, stride), -1, np.float32)
        room[:, :width] = self.room
        offsets = np.zeros(self.places.padded, np.int32)
        offsets[:len(self.places.offsets)] = self.places.offsets @ np.array([1, stride])
        return (opencl.to_device(offsets), opencl.to_device(padded), np.int32(margin * stride + margin),
                np.int32(stride), np.int32(columns), opencl.to_device(room))

    def match(self, wanted: Any, query: Query, radius: np.ndarray, dear: np.ndarray) -> np.ndarray:
        """The best anchor of each query: (Q, 2) int64, x and y; `match_reference` says which."""
        offsets, luminance, origin, stride, columns, room = self._grid
        height, width = self.sample.shape
        padded = np.zeros((height, int(stride)), np.float32)
        padded[:, :width] = dear
        count = len(query.who)
        best = opencl.empty((count, height, 2))
        self._program(None).match((height, count), (1, 1), wanted, opencl.to_device(query.first),
                                  opencl.to_device(query.end), offsets, np.int32(self.places.padded), luminance,
                                  origin, stride, columns, room, opencl.to_device(padded),
                                  opencl.to_device(self.needs(radius)), np.float32(LEAST_ERROR * self.variance), best)
        found = best.get()
        row = found[..., 0].argmin(axis=1)
        return np.stack([found[np.arange(count), row, 1].astype(np.int64), row], axis=-1)

    def directions(self, v: Any, points: np.ndarray) -> np.ndarray:
        """Axis, change of angle along and across: (M, 4) float32; see `directions_reference`. v is on the device."""
        out = opencl.empty((len(points), 4))
        if len(points):
            self._program(None).directions((-(-len(points) // TOGETHER) * TOGETHER,), (TOGETHER,), v,
                                           np.array(self.shape[::-1], np.int32),
                                           opencl.to_device(points.astype(np.float32)), np.int32(len(points)),
                                           np.float32(STEP), out)
        return out.get()


@dataclass(frozen=True, eq=False)
class Walls:
    """A mask, and what follows from it.

    open     (Y, X) bool: where texture is
    clear    (Y, X) float32: pixels to the nearest that is masked
    nearest  row and column, (Y, X) each, of the nearest that is not masked
    """

    open: np.ndarray
    clear: np.ndarray
    nearest: tuple[np.ndarray, ...]

    @classmethod
    def of(cls, open_: np.ndarray) -> Walls:
        nearest = ndimage.distance_transform_edt(~open_, return_distances=False, return_indices=True)
        return cls(open_.copy(), ndimage.distance_transform_edt(open_).astype(np.float32), tuple(nearest))

    @cached_property
    def on_device(self) -> Any:
        return opencl.to_device(self.clear)


class Query(NamedTuple):
    """Patches whose surroundings are asked for.

    who, without  (Q,) int32: the patch in whose axes places are laid, and the patch that is left out
    first, end    (Q,) int32: which of the places
    """

    who: np.ndarray
    without: np.ndarray
    first: np.ndarray
    end: np.ndarray


@dataclass(frozen=True, eq=False)
class Places:
    """Where a patch is compared with the picture: every second pixel of the sample round the anchor, from inside out.

    offsets  (P, 2) int64: x and y from the anchor, pixels of the sample
    along    (P, 2) float32: U and V, the same in the axes of the patch
    radii    (P,) float64: in the measure of an elongated patch, ascending
    """

    offsets: np.ndarray
    along: np.ndarray
    radii: np.ndarray

    @classmethod
    def within(cls, radius: float, direction: float, elongation: float) -> Places:
        n = int(radius * np.sqrt(elongation)) // 2 + 1
        j, i = (2 * a.ravel() for a in np.mgrid[-n:n + 1, -n:n + 1])
        cos, sin = np.cos(direction), np.sin(direction)
        u, v = cos * i + sin * j, cos * j - sin * i
        radii = np.sqrt(u * u / elongation + v * v * elongation)
        # rounded, so that the order of equals is that of the rows
        order = np.argsort(np.round(radii, 6), kind="stable")
        order = order[radii[order] <= radius]
        return cls(np.stack([i, j], -1)[order], np.stack([u, v], -1)[order].astype(np.float32), radii[order])

    @property
    def padded(self) -> int:
        return -(-len(self.radii) // 16) * 16

    def count(self, radius: np.ndarray) -> np.ndarray:
        """How many places lie within `radius`: int32."""
        return np.searchsorted(self.radii, radius, side="right").astype(np.int32)

    @cached_property
    def on_device(self) -> tuple[Any, Any]:
        spread = np.zeros((2, self.padded), np.float32)
        spread[:, :len(self.radii)] = self.along.T
        return opencl.to_device(spread[0]), opencl.to_device(spread[1])


def _literal(value: float) -> str:
    return f"{np.float32(value)!s}f"


def pairs_within(queries: np.ndarray, points: np.ndarray, own: np.ndarray,
                 extent: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """All pairs (query, point) no farther apart than own[query] + extent[point], by query, then by point: int64 each.

    queries (Q, 2), points (P, 2) float64; the memory grows with the pairs found, not with Q times P.
    """
    if not len(queries) or not len(points):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    # the tree rounds in its own way: it proposes a little more, and the test below decides
    found = cKDTree(points).query_ball_point(queries, (own + extent.max()) * (1 + 1e-9) + 1e-9, return_sorted=True)
    query = np.repeat(np.arange(len(queries)), [len(near) for near in found])
    point = np.concatenate(found).astype(np.int64)
    offset, reach = queries[query] - points[point], own[query] + extent[point]
    near = (offset * offset).sum(axis=1) <= reach * reach
    return query[near], point[near]


def _lists(key: np.ndarray, members: np.ndarray, count: int) -> Lists:
    starts = np.zeros(count + 1, np.int32)
    np.cumsum(np.bincount(key, minlength=count), out=starts[1:])
    return Lists(starts, members.astype(np.int32))


def _uploaded(arrays: Table | Lists | Query) -> tuple[Any, ...]:
    return tuple(opencl.to_device(a if a.size else np.zeros((1, *a.shape[1:]), a.dtype)) for a in arrays)


def enlarged(picture: np.ndarray) -> np.ndarray:
    """picture (H, W, C) with FINE places a pixel: (FINE (H - 1) + 1, FINE (W - 1) + 1, C) float32, by the cubic spline
    through its pixels, mirrored at its edges as `draw` mirrors it.

    Every FINE-th place is a pixel of the picture; none is outside the picture's range. A spline keeps fine detail alike
    at all places between pixels; Catmull-Rom blurs it there, and a moving patch then flickers between sharp and soft.
    """
    values = picture.astype(np.float64)
    for axis in (0, 1):
        values = np.moveaxis(values, axis, 0)
        n = len(values)
        fine = np.empty((FINE * (n - 1) + 1, *values.shape[1:]))
        fine[::FINE] = values
        if n > 1:
            spline = ndimage.spline_filter1d(values, axis=0, mode="mirror")
            padded = np.concatenate([spline[1:2], spline, spline[-2:-1]])
            for k in range(1, FINE):
                f = k / FINE
                weights = ((1 - f)**3 / 6, (4 - 6 * f * f + 3 * f**3) / 6, (1 + 3 * f * (1 + f - f * f)) / 6, f**3 / 6)
                fine[k::FINE] = sum(w * padded[i:i + n - 1] for i, w in enumerate(weights))
        values = np.moveaxis(fine, 0, axis)
    low, high = picture.min(axis=(0, 1)), picture.max(axis=(0, 1))
    return np.ascontiguousarray(np.clip(values, low, high), np.float32)


# The specification, in NumPy.


def sees_reference(open_: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Whether no masked pixel of open_ (Y, X) lies between places start and end (M, 2), x and y: (M,) bool.

    Half-pixel steps from start to end, each at its nearest pixel; a step over a corner needs both pixels beside it.
    Beyond the picture its border's pixels go on.
    """
    def at(i: np.ndarray, j: np.ndarray) -> np.ndarray:
        # much faster than np.clip for the few points of a newborn
        return open_[np.minimum(np.maximum(j, 0), open_.shape[0] - 1), np.minimum(np.maximum(i, 0), open_.shape[1] - 1)]

    way = (end - start).astype(np.float32)
    cell = np.rint(start).astype(np.int64)
    rest = (start - cell).astype(np.float32)
    steps = 2 * (np.abs(way).max(axis=1, initial=0).astype(np.int64) + 1)
    before = cell + np.floor(rest + np.float32(0.5)).astype(np.int64)
    clear = at(*before.T)
    for k in range(1, int(steps.max(initial=0)) + 1):
        f = (np.float32(k) / steps.astype(np.float32))[:, None]
        now = cell + np.floor(rest + way * f + np.float32(0.5)).astype(np.int64)
        corner = (now != before).all(axis=1)
        free = at(*now.T) & (~corner | (at(before[:, 0], now[:, 1]) & at(now[:, 0], before[:, 1])))
        clear &= free | (k > steps)
        before = now
    return clear


def remoteness(painter: Painter, s: np.ndarray, m: np.ndarray, p: np.ndarray, bias: np.ndarray) -> np.ndarray:
    """How remote places (s, m) in the axes of patch p (FIELDS,) are; NEVER out of reach."""
    along, across = np.float32(1 / painter.elongation), np.float32(painter.elongation)
    rho = (s * s * along + m * m * across) * p[INVERSE]
    t = rho * (np.float32(1) / np.float32(painter.reach**2))
    inside = t < 1
    left = np.where(inside, np.float32(1) - t, np.float32(1))
    return np.where(inside, p[STEEP] * rho + bias + t * t * (t * t) / left, NEVER)


def weight(behind: np.ndarray) -> np.ndarray:
    """The weight of a patch that is `behind` the nearest by so much."""
    left = np.maximum(np.float32(1) - np.float32(0.25) * behind, np.float32(0))
    return left * left * (left * left)


def unbent(U: np.ndarray, V: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where (U, V) lies in the axes (s, m) of a patch: the inverse of its bend, by four steps."""
    s, m, half = U, V, np.float32(0.5)
    for _ in range(4):
        s, m = (U - p[BEND_T] * s * m - half * p[BEND_N] * m * m,
                V + half * p[BEND_T] * s * s + p[BEND_N] * s * m)
    return s, m


def place(painter: Painter, s: np.ndarray, m: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The place in the sample that a patch shows at (s, m), pixels, folded back at its edges."""
    half, (cos, sin), last = np.float32(0.5), painter.turn, painter.last
    u = s + p[BEND_T] * s * m + half * p[BEND_N] * m * m
    v = m - half * p[BEND_T] * s * s - p[BEND_N] * s * m
    i, j = np.abs(p[AX] + (cos * u - sin * v)), np.abs(p[AY] + (sin * u + cos * v))
    zero = np.float32(0)
    return np.maximum(last[0] - np.abs(last[0] - i), zero), np.maximum(last[1] - np.abs(last[1] - j), zero)


def read(fine: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The enlarged sample at places in pixels of the sample: bilinear."""
    fx, fy = x * np.float32(FINE), y * np.float32(FINE)
    i, j = np.minimum(fx.astype(np.int32), fine.shape[1] - 2), np.minimum(fy.astype(np.int32), fine.shape[0] - 2)
    u, v = (fx - i.astype(np.float32))[..., None], (fy - j.astype(np.float32))[..., None]
    low = fine[j, i] + u * (fine[j, i + 1] - fine[j, i])
    high = fine[j + 1, i] + u * (fine[j + 1, i + 1] - fine[j + 1, i])
    return low + v * (high - low)


class Pixels(NamedTuple):
    """Of each patch that lies on some pixels: how remote it is there, and where they lie in its axes."""

    e: np.ndarray
    s: np.ndarray
    m: np.ndarray


def _on_pixels(painter: Painter, table: Table, open_: np.ndarray | None, when: int) -> list[Pixels]:
    y, x = np.mgrid[:painter.shape[0], :painter.shape[1]]
    found = []
    for (cx, cy), p in zip(table.cells, table.values, strict=True):
        dx, dy = (x - cx).astype(np.float32) - p[FX], (y - cy).astype(np.float32) - p[FY]
        s, m = dx * p[TX] + dy * p[TY], dy * p[TX] - dx * p[TY]
        e = remoteness(painter, s, m, p, p[when])
        if open_ is not None and p[NEAR] < NEVER:
            start = np.stack([x, y], -1).reshape(-1, 2).astype(np.float64)
            way = np.stack([dx, dy], -1).reshape(-1, 2)
            clear = sees_reference(open_, start, start - way).reshape(painter.shape)
            e = np.where(clear, e, NEVER)
        found.append(Pixels(e, s, m))
    return found


def draw_reference(painter: Painter, table: Table, blend: float, open_: np.ndarray | None) -> np.ndarray:
    """Specification of `draw`: the picture (Y, X, 3) of all patches, in order.

    1. How remote each patch is, and the least.
    2. Sums of weights, of their squares, and of weighted colours less the sample's mean.
    3. The mean plus the mean weighted difference, times a gain: blend = 0: 1; blend = 1: 1 / √Σw², Σw = 1, which
       keeps the variance of uncorrelated colours; nearer to 1 where the patches are alike.
    4. Within the sample's own range; zero where masked.
    """
    pixels = _on_pixels(painter, table, open_, BIAS)
    picture, covered = blend_reference(painter, pixels, table.values, blend, painter.shape)
    picture = np.where((covered if open_ is None else covered & open_)[..., None], picture, np.float32(0))
    return picture if picture.shape[2] == 3 else np.repeat(picture, 3, axis=2)


def blend_reference(painter: Painter, pixels: Sequence[Pixels], values: np.ndarray, blend: float,
                    shape: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Specification of blend.h: the colours (..., channels) of pixels of `shape` on which patches with `values` (P,
    FIELDS) lie, in order; and which are covered."""
    nearest = np.min([q.e for q in pixels], axis=0, initial=NEVER)
    total = np.zeros(shape, np.float32)
    squares, power, colour = total.copy(), total.copy(), np.zeros((*shape, painter.colour.shape[2]), np.float32)
    mean, low, high, scale = painter.tones
    for (e, s, m), p in zip(pixels, values, strict=True):
        w = np.where(e < NEVER, weight(e - nearest), np.float32(0))
        total, squares = total + w, squares + w * w
        beyond = read(painter.colour, *place(painter, s, m, p)) - mean
        colour = colour + w[..., None] * beyond
        for c in range(len(mean)):
            power = power + w * (beyond[..., c] * beyond[..., c])
    covered = total > 0
    total, squares = np.where(covered, total, np.float32(1)), np.where(covered, squares, np.float32(1))
    colour, unlike, one = colour / total[..., None], power / total, np.float32(1)
    for c in range(len(mean)):
        unlike = unlike - colour[..., c] * colour[..., c]
    unlike = np.clip(unlike * scale[0] / np.maximum(one - squares / (total * total), np.float32(1e-6)), 0, 1)
    gain = one + np.float32(blend) * unlike * (total / np.sqrt(squares) - one)
    return np.clip(mean + gain[..., None] * colour, low, high), covered


def mean_reference(painter: Painter, pixels: Sequence[Pixels], values: np.ndarray,
                   shape: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Specification of mean.h: the weighted mean luminance of places of `shape`, and which are covered."""
    nearest = np.min([q.e for q in pixels], axis=0, initial=NEVER)
    total, light = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    for (e, s, m), p in zip(pixels, values, strict=True):
        w = np.where(e < NEVER, weight(e - nearest), np.float32(0))
        total, light = total + w, light + w * read(painter.luminance, *place(painter, s, m, p))[..., 0]
    return light / np.where(total > 0, total, np.float32(1)), total > 0


def strongest_reference(painter: Painter, table: Table, open_: np.ndarray | None) -> np.ndarray:
    """Specification of `strongest`: (Y, X, 6) u, v, weight of the patch of most weight, then of the next.

    u and v are 0 at the sample's left and lower edge, 1 at the others; all weights of a pixel together are 1. Of equal
    weights the earlier patch is first; zero where there is none, or no texture.
    """
    pixels = _on_pixels(painter, table, open_, BIAS)
    nearest = np.min([q.e for q in pixels], axis=0, initial=NEVER)
    total, found = np.zeros(painter.shape, np.float32), np.zeros((2, *painter.shape, 3), np.float32)
    for (e, s, m), p in zip(pixels, table.values, strict=True):
        w = np.where(e < NEVER, weight(e - nearest), np.float32(0))
        total = total + w
        x, y = place(painter, s, m, p)
        this = np.stack([(x + np.float32(0.5)) / (painter.last[0] + np.float32(1)),
                         (y + np.float32(0.5)) / (painter.last[1] + np.float32(1)), w], axis=-1)
        best, second = (w > found[0, ..., 2])[..., None], (w > found[1, ..., 2])[..., None]
        found[1] = np.where(best, found[0], np.where(second, this, found[1]))
        found[0] = np.where(best, this, found[0])
    found[..., 2] /= np.where(total > 0, total, np.float32(1))
    maps = np.concatenate([found[0], found[1]], axis=-1)
    return maps if open_ is None else np.where(open_[..., None], maps, np.float32(0))


def owners_reference(painter: Painter, table: Table, open_: np.ndarray | None, when: int = BIAS) -> np.ndarray:
    """Specification of `owners`: (Y, X) index of the least remote patch, the first of equals; -1 where none reaches."""
    remote = np.stack([np.full(painter.shape, NEVER)] + [q.e for q in _on_pixels(painter, table, open_, when)])
    return (remote.argmin(axis=0) - 1).astype(np.int32)


def bare_reference(painter: Painter, table: Table, living: np.ndarray, radii: np.ndarray, distance: float,
                   open_: np.ndarray | None) -> np.ndarray:
    """Specification of `bare`: (tiles, 16) bool: sites from which no living patch is within `distance` radii and seen.

    radii (tiles, 16) float32, of the sites; the smaller of a patch's and the site's radius counts.
    """
    site = sites(painter)
    missing = np.ones(site.shape[:2], bool)
    for (cx, cy), p, alive in zip(table.cells, table.values, living, strict=True):
        if not alive:
            continue
        dx, dy = (site[..., 0] - cx).astype(np.float32) - p[FX], (site[..., 1] - cy).astype(np.float32) - p[FY]
        s, m = dx * p[TX] + dy * p[TY], dy * p[TX] - dx * p[TY]
        limit = np.minimum(radii, p[RADIUS]) * np.float32(distance)
        near = s * s * np.float32(1 / painter.elongation) + m * m * np.float32(painter.elongation) <= limit * limit
        if open_ is not None and p[NEAR] < NEVER:
            start = site.reshape(-1, 2).astype(np.float64)
            near &= sees_reference(open_, start, start - np.stack([dx, dy], -1).reshape(-1, 2)).reshape(near.shape)
        missing &= ~near
    return missing


def sites(painter: Painter) -> np.ndarray:
    """Where the kernel `bare` looks: (tiles, 16, 2) int64, x and y."""
    rows, columns = painter.tiles
    tile = np.stack(np.divmod(np.arange(rows * columns), columns)[::-1], axis=-1)
    step = np.stack(np.divmod(np.arange(16), 4)[::-1], axis=-1) * (TILE // 4)
    return (tile[:, None, :] - 1) * TILE + step


def rectify_reference(painter: Painter, table: Table, query: Query, rank: np.ndarray, below: int,
                      open_: np.ndarray | None) -> np.ndarray:
    """Specification of `rectify`: (Q, places, 2) luminance, and 1 where there is any; zero outside [first, end).

    1. Each place (U, V) in the axes (s, m) of its patch: the inverse of the bend, by four steps.
    2. There the weighted mean of the patches of rank below `below`, without one of them, with weights as in `draw`.
    """
    places = painter.places
    out = np.zeros((len(query.who), places.padded, 2), np.float32)
    for k, (who, without, first, end) in enumerate(zip(*query, strict=True)):
        own, home = table.values[who], table.cells[who]
        U, V = places.along[first:end].T
        a, b = unbent(U, V, own)
        x, y = a * own[TX] - b * own[TY], a * own[TY] + b * own[TX]
        start = np.stack([own[FX] + x, own[FY] + y], -1).astype(np.float64)
        visible = np.ones(len(x), bool)
        if open_ is not None:
            visible = sees_from(open_, home, start, np.stack([x, y], -1))
        found, values = [], []
        for j, ((cx, cy), p) in enumerate(zip(table.cells, table.values, strict=True)):
            if rank[j] >= below or j == without:
                continue
            dx = x + (np.float32(home[0] - cx) + (own[FX] - p[FX]))
            dy = y + (np.float32(home[1] - cy) + (own[FY] - p[FY]))
            s, m = dx * p[TX] + dy * p[TY], dy * p[TX] - dx * p[TY]
            e = remoteness(painter, s, m, p, p[BIAS])
            if open_ is not None and p[NEAR] < NEVER:
                e = np.where(visible & sees_from(open_, home, start, np.stack([dx, dy], -1)), e, NEVER)
            found.append(Pixels(e, s, m))
            values.append(p)
        light, covered = mean_reference(painter, found, np.array(values), x.shape)
        there = covered & visible
        out[k, first:end, 0] = np.where(there, light, np.float32(0))
        out[k, first:end, 1] = there
    return out


def sees_from(open_: np.ndarray, cell: np.ndarray, offset: np.ndarray, way: np.ndarray) -> np.ndarray:
    """`sees_reference` from cell + offset (M, 2) back along way (M, 2), by a mask shifted so that the cell is 0."""
    return sees_reference(open_, cell + offset, cell + offset - way)


def match_reference(painter: Painter, wanted: np.ndarray, query: Query, radius: np.ndarray,
                    dear: np.ndarray) -> np.ndarray:
    """Specification of `match`: for each query the anchor (x, y) of least (E + LEAST_ERROR · variance) · (1 + dear).

    E is the mean squared difference over the places that are there, the sample mirrored at its edges. Anchors whose
    room is less than the patch needs are left out; of equals the lowest row, then the leftmost. wanted (Q, places, 2)
    as `rectify` gives it; dear (H, W), more than -1.
    """
    height, width = painter.sample.shape
    margin = int(np.abs(painter.places.offsets).max(initial=0))
    mirrored = painter.mirrored(margin)
    found = np.zeros((len(query.who), 2), np.int64)
    for k, (first, end) in enumerate(zip(query.first, query.end, strict=True)):
        error: np.ndarray = np.zeros((height, width), np.float32)
        count = np.float32(0)
        for i in range(first, end):
            value, there = wanted[k, i]
            if there:
                x, y = painter.places.offsets[i] + margin
                shifted = mirrored[y:y + height, x:x + width]
                error, count = error + (shifted - value) * (shifted - value), count + np.float32(1)
        least = np.float32(LEAST_ERROR * painter.variance)
        error = (error / max(count, np.float32(1)) + least) * (np.float32(1) + dear)
        error = np.where(painter.room >= painter.needs(radius)[k], error, NEVER)
        found[k] = np.divmod(int(error.argmin()), width)[::-1]
    return found


def directions_reference(v: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Specification of `directions`, to rounding: cos θ, sin θ, ∂θ/∂s, ∂θ/∂n at points (M, 2): (M, 4) float64.

    v is read bilinearly; the angle is differenced over STEP pixels to each side, without a jump from π to -π. Where
    the flow rests, θ is 0.
    """
    def turned(dx: float, dy: float) -> np.ndarray:
        step = np.array([dx, dy])
        a, b = flow.at(v, points - step).astype(np.float64), flow.at(v, points + step).astype(np.float64)
        return np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], (a * b).sum(axis=1)) / (2 * STEP)

    here = flow.at(v, points).astype(np.float64)
    speed = np.linalg.norm(here, axis=1, keepdims=True)
    t = np.where(speed > 0, here / np.where(speed > 0, speed, 1), [1.0, 0.0])
    x, y = turned(STEP, 0), turned(0, STEP)
    return np.stack([t[:, 0], t[:, 1], x * t[:, 0] + y * t[:, 1], y * t[:, 0] - x * t[:, 1]], axis=-1)
