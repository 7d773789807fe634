"""Smoke density carried by the motion: naive and windowed (ma09 supplement A, pseudocode 3 and 4).

    O_i = naive(L)_i                                          the smoke under the coarse motion alone
    D_i = O_{i-m}, then m times: inject, advect by F_{i-m+j}   the smoke that is shown

Each frame injects first and advects then. A source holds the density at its own pattern p where its mask is
1, less strongly towards its soft edge: mask p <= D <= 1 - mask (1 - p). So smoke never accumulates, the
pattern stays sharp where smoke flows through the source, and the result does not depend on the frame rate.

Pseudocode 4 restarts each D_i and does m steps for it. Here the m windows that are open advance side
by side, one step per frame: the same numbers, bit for bit, with one departure map, no history of fields,
and memory that does not grow with the frames. Cells that no smoke can reach are left out. `window` is one
frame alone, as the pseudocode writes it, for a farm.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from synth import opencl
from synth.advect import (
    BORDERS,
    ROW,
    Grid,
    Region,
    departure_reference,
    displaced_reference,
    velocity_field,
)
from synth.field import domain_origin
from synth.motion.coarse import upsample
from synth.noise import gradient_noise

SUBSTEPS = 4
"""Steps in which smoke is traced along the detail of a frame."""

MOTIONS = 24
"""Vector fields on their own cells held in memory at once, as measured, including what the allocator keeps."""

THINNEST = 1e-5
"""Thinner smoke is set to zero: it is invisible, and interpolation would spread it over the whole grid."""


@dataclass(frozen=True)
class Source:
    """Where smoke enters. World units: the domain is 1 high, its floor at y = 0, centred on x and z.

    kind           "ball" (a disc in 2-D) or "box"
    centre         (x, y) or (x, y, z); z = 0 if left out
    radius         of the ball or half the box's edge: a number, or one per axis (z as x if left out)
    softness       share of the radius over which the edge fades, 0 to 1 (at least a cell's width)
    level          density injected, 0 to 1
    streaks        contrast of a seeded pattern across x and z, 0 (even) to 1; it draws the paths
    streak_size    width of a streak
    streak_period  frames in which the streaks change
    period, duty   smoke enters during the share `duty` of every `period` frames (puffs); duty 1 is always
    seed           of the streaks
    """

    centre: tuple[float, ...]
    radius: float | tuple[float, ...]
    kind: str = "ball"
    softness: float = 0.3
    level: float = 1.0
    streaks: float = 0.0
    streak_size: float = 0.02
    streak_period: float = 40.0
    period: int = 1
    duty: float = 1.0
    seed: int = 0

    def __post_init__(self) -> None:
        radii = self.radius if isinstance(self.radius, tuple) else (self.radius,)
        if self.kind not in ("ball", "box"):
            raise ValueError(f"source kind {self.kind!r} is neither ball nor box")
        if len(self.centre) not in (2, 3) or not all(np.isfinite(self.centre)):
            raise ValueError(f"a source's centre is (x, y) or (x, y, z), not {self.centre}")
        if not all(r > 0 for r in radii):
            raise ValueError(f"a source's radius must be positive, not {self.radius}")
        for name in ("softness", "level", "streaks", "duty"):
            if not 0 <= getattr(self, name) <= 1:
                raise ValueError(f"a source's {name} lies between 0 and 1, not at {getattr(self, name)}")
        for name in ("streak_size", "streak_period", "period"):
            if not getattr(self, name) > 0:
                raise ValueError(f"a source's {name} must be positive, not {getattr(self, name)}")

    def bounds(self, shape: tuple[int, ...], frame: int) -> tuple[tuple[slice, ...], np.ndarray, np.ndarray]:
        """What the density is held between before frame `frame` (from 1) is advected.

        shape is the density grid's, (Y, X) or (Z, Y, X) cells. Returns the box of cells the source touches,
        and there the lowest and the highest density, float32 in [0, 1].
        """
        voxel = 1.0 / shape[-2]
        radii = self.radius if isinstance(self.radius, tuple) else (self.radius,) * 3
        radii = (*radii, radii[0])[:3]
        distances, box = [], []
        for component, (origin, n) in enumerate(zip(domain_origin(shape), shape[::-1], strict=True)):
            centre = self.centre[component] if component < len(self.centre) else 0.0
            radius = radii[component]
            first = int(np.clip(np.floor((centre - radius - origin) / voxel), 0, n - 1))
            last = int(np.clip(np.ceil((centre + radius - origin) / voxel), first, n - 1))
            box.append(slice(first, last + 1))
            position = origin + voxel * np.arange(first, last + 1)
            distances.append(np.abs(position - centre) / radius)
        grid = np.meshgrid(*distances[::-1], indexing="ij", sparse=True)
        far = np.sqrt(sum(g * g for g in grid)) if self.kind == "ball" else np.maximum.reduce(
            np.broadcast_arrays(*grid))
        edge = max(self.softness, min(1.0, voxel / min(radii)))
        inside = np.clip((1 - far) / edge, 0, 1)
        mask = inside * inside * (3 - 2 * inside)
        if (frame - 1) % self.period >= self.duty * self.period:
            mask = np.zeros_like(mask)
        lowest = mask * self.level * self._streaks(shape, box, frame)
        return tuple(box[::-1]), lowest.astype(np.float32), (1 - mask + lowest).astype(np.float32)

    def _streaks(self, shape: tuple[int, ...], box: list[slice], frame: int) -> np.ndarray | float:
        """Factor 1 - streaks to 1, constant along y, over the box's cells."""
        if self.streaks == 0:
            return 1.0
        origin, voxel = domain_origin(shape), 1.0 / shape[-2]
        axes = [(origin[c] + voxel * np.arange(box[c].start, box[c].stop)) / self.streak_size
                for c in range(len(shape)) if c != 1]
        points = [*np.meshgrid(*axes[::-1], indexing="ij", sparse=True)[::-1], np.full((1,) * len(axes),
                                                                                 frame / self.streak_period)]
        lit = np.clip(0.5 + 2.0 * gradient_noise(points, self.seed), 0, 1)
        return np.expand_dims(1 - self.streaks * (1 - lit), -2)


@dataclass(frozen=True)
class Carried:
    """One frame of F whose detail moves along with L during the frame, instead of standing still.

    Smoke in a swirl that L carries then follows the swirl's own paths. With F standing still the edges of the swirl
    would cut it anew in each frame, in teeth as long as L's step.
    F  (Y, X, 2) or (Z, Y, X, 3) float32, cells per frame;  L  on F's grid or a coarser one, as it went into F
    """

    F: np.ndarray
    L: np.ndarray

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of F."""
        return self.F.shape


Motion = np.ndarray | Carried


def naive(F_frames: Iterable[Motion], sources: Sequence[Source], *, scale: float = 1.0,
          border: str = "zero") -> Iterator[np.ndarray]:
    """Pseudocode 3: D_i = (D_{i-1} with the sources) advected by F_i, from an empty D_0.

    F_frames  F_1, F_2, … (Y, X, 2) or (Z, Y, X, 3) float32, cells per frame, or Carried
    sources   what enters, one after the other
    scale     cells of the density grid per cell of the field, along each axis; F is then interpolated
              smoothly (Catmull and Rom)
    border    beyond the grid "zero" (no smoke comes in), "clamp" or "toroidal"
    Yields D_1, D_2, …: float32 in [0, 1], a new array per frame, with no value between 0 and THINNEST.
    """
    density = None
    for i, F in enumerate(F_frames, 1):
        if density is None:
            density = _Lanes(density_shape(F.shape[:-1], scale), 1, border)
        density.inject(sources, i)
        density.advance(F, F.shape[:-1])
        yield density.q.get()


def windowed(L_frames: Iterable[np.ndarray], F_frames: Iterable[Motion], sources: Sequence[Source],
             m: int, *, scale: float = 1.0, border: str = "zero") -> Iterator[np.ndarray]:
    """Pseudocode 4: D_i is O_{i-m} = naive(L)_{i-m}, carried on through the last m frames of F.

    L_frames  L_1, L_2, … on F's grid or a coarser one (then upsampled linearly to F's, as F was made)
    m         length of the window, frames
    The rest as in `naive`. The pseudocode begins at i = m; frames i < m are yielded too, as windows of
    length i, which is naive(F)_i. With F = L every m gives naive(F); with m the number of frames so does
    every F.
    """
    if m < 1:
        raise ValueError(f"the window m must be at least 1 frame, not {m}")
    coarse: _Lanes | None = None
    windows: list[_Lanes] = []
    for i, (L, F) in enumerate(zip(L_frames, F_frames, strict=True), 1):
        if coarse is None:
            coarse = _Lanes(density_shape(F.shape[:-1], scale), 1, border)
            lanes = min(16, 1 << (m - 1).bit_length())
            windows = [_Lanes(coarse.shape, lanes, border) for _ in range(-(-m // lanes))]
            visible = opencl.empty(coarse.shape)
        # the window that began at O_s lives in lane s mod m; frame i shows s = i - m, or 0 while i < m, and
        # O_i begins the next one, in the lane that has just been shown (or was never used)
        shown, begun = max(i - m, 0) % m, i % m
        coarse.inject(sources, i)
        coarse.advance(L, F.shape[:-1])
        flow = coarse.flow(F, F.shape[:-1])
        visible.fill(0)
        for first, group in zip(range(0, m, lanes), windows, strict=True):
            group.inject(sources, i)
            group.step(flow, coarse, visible, shown - first, begun - first)
        yield visible.get()


def window(O: np.ndarray | None, F_frames: Iterable[Motion], sources: Sequence[Source], first: int, *,
           scale: float = 1.0, border: str = "zero") -> np.ndarray:
    """One D_i of pseudocode 4 alone: the frame `windowed` yields as its i-th, bit for bit.

    O         O_{i-m} on the density grid, or None for the empty O_0
    F_frames  F_{i-m+1} … F_i, m of them (i of them from O_0), of which one at a time is held; at least one
    first     the number i - m + 1 of the first of them
    """
    density: _Lanes | None = None
    for j, F in enumerate(F_frames, first):
        if density is None:
            density = _Lanes(density_shape(F.shape[:-1], scale), 1, border)
            if O is not None:
                density.begin(O)
        density.inject(sources, j)
        density.advance(F, F.shape[:-1])
    if density is None:
        raise ValueError("a window needs at least one frame of motion")
    return density.q.get()


def memory_needed(shape: tuple[int, ...], m: int, scale: float = 1.0) -> float:
    """Bytes that `windowed` takes on cells of `shape`, host and device together; an estimate from above."""
    cells = float(np.prod([float(n) for n in shape]))
    lanes = min(16, 1 << (m - 1).bit_length())
    fine = 8 * (lanes * -(-m // lanes) + 1) + 4 + 12 * len(shape) + 2 * MOTIONS * len(shape)
    return cells * (scale ** len(shape) * fine + MOTIONS * len(shape) * 4)


def density_shape(shape: tuple[int, ...], scale: float) -> tuple[int, ...]:
    """The density's cells over a field's, `scale` of them to one along each axis."""
    if not (np.isfinite(scale) and scale > 0):
        raise ValueError(f"the density's scale must be positive, not {scale}")
    return tuple(max(1, round(n * scale)) for n in shape)


Box = tuple[tuple[int, int], ...]
"""First cell and end along x, y, z; with an end before the first there is nothing in it."""

NOWHERE: Box = ((1 << 30, 0),) * 3


def _around(*boxes: Box) -> Box:
    """The smallest box round all of them."""
    return tuple((min(b[c][0] for b in boxes), max(b[c][1] for b in boxes)) for c in range(3))


class _Flow:
    """The displacements of one frame on the density grid, computed for a region on request.

    reach  no displacement is longer along any axis, cells
    """

    def __init__(self, v: Motion, field_shape: tuple[int, ...], grid: Grid, buffers: list[Any]):
        """v on its own cells goes linearly to the field's, from there smoothly to the density's. buffers: arrays of
        displacements, one, or three for `Carried`; they hold the results."""
        self._grid, self._buffers = grid, buffers
        if isinstance(v, Carried):
            L = _finer(v.L, v.shape[:-1], grid)
            detail = _finer(v.F, v.shape[:-1], grid) - L
            self._motions = [opencl.to_device(detail), opencl.to_device(L)]
            self.reach = _longest(L) + _longest(detail)
        else:
            fine = _finer(v, field_shape, grid)
            self._motions = [opencl.to_device(fine)]
            self.reach = _longest(fine)

    def displacements(self, region: Region) -> Any:
        """The displacements, on the device, valid in `region`."""
        if len(self._motions) == 1:
            return self._grid.departure(self._motions[0], out=self._buffers[0], region=region)
        inside = Grid(self._grid.shape, "toroidal" if self._grid.border == "toroidal" else "clamp")
        near = self._near(region)
        displacement, detail, coarse = self._buffers
        inside.departure(self._motions[0], 1 / SUBSTEPS, detail, near)
        inside.departure(self._motions[1], out=coarse, region=near)
        dimension = len(self._grid.shape)
        program = opencl.program(Path(__file__).with_suffix(".cl"), DIMS=dimension, CHANNELS=dimension,
                                 BORDER=BORDERS[inside.border], THINNEST=f"{THINNEST}f")
        program.ride(region.size, (ROW, 1, 1), detail, coarse, displacement, np.int32(SUBSTEPS), *self._grid.cells,
                     offset=region.first)
        return displacement

    def _near(self, region: Region) -> Region:
        """The cells that a path which begins in `region` can cross."""
        if self._grid.border == "toroidal":
            return self._grid.whole
        grown = [(max(first - self.reach, 0), min(first + size + self.reach, n))
                 for first, size, n in zip(region.first, region.size, self._grid.whole.size, strict=True)]
        return _rows(grown)


def _rows(box: Sequence[tuple[int, int]]) -> Region:
    """A box of cells as a region: along x in whole work-groups."""
    (x, x_end), (y, y_end), (z, z_end) = box
    x -= x % ROW
    return Region((x, y, z), (-(-(x_end - x) // ROW) * ROW, y_end - y, z_end - z))


def riding_reference(L: np.ndarray, detail: np.ndarray, border: str = "zero") -> np.ndarray:
    """Specification of the kernel `ride`: displacements of one frame of L and F - L, both (Y, X, 2) or (Z, Y, X, 3)."""
    inside = "toroidal" if border == "toroidal" else "clamp"
    substep = departure_reference(detail, 1 / SUBSTEPS, inside)
    displacement = substep
    for _ in range(SUBSTEPS - 1):
        displacement = displacement + displaced_reference(substep, displacement, inside)
    return displacement + displaced_reference(departure_reference(L, 1, inside), displacement, inside)


def _longest(v: np.ndarray) -> int:
    """A bound, in whole cells, of each component of v, and of what interpolation and rounding make of it."""
    return int(np.ceil(max(v.max(), -v.min()))) + 1


def _finer(v: np.ndarray, field_shape: tuple[int, ...], grid: Grid) -> np.ndarray:
    """`v` on the density grid: linearly to the field's cells, smoothly on to the density's."""
    return upsample(upsample(velocity_field(v), field_shape), grid.shape, "cubic")


class _Lanes:
    """Densities of several windows on one grid, interleaved: `q` is (*shape, lanes) on the device.

    box  holds all smoke of all lanes, none at first; beyond it q is zero
    """

    def __init__(self, shape: tuple[int, ...], lanes: int, border: str):
        self.shape, self.lanes = shape, lanes
        self.grid = Grid(shape, border)
        self.q, self._next = (opencl.zeros((*shape, lanes) if lanes > 1 else shape) for _ in range(2))
        self.box = self._next_box = NOWHERE
        self._displacements: list[Any] = []
        self._extents = opencl.empty((*shape[:-1], 2), np.int32)
        self._program = opencl.program(Path(__file__).with_suffix(".cl"), DIMS=len(shape), CHANNELS=lanes,
                                       BORDER=BORDERS[border], THINNEST=f"{THINNEST}f")

    def begin(self, density: np.ndarray) -> None:
        """Take over a density (*shape); of a single lane only."""
        if density.shape != self.shape:
            raise ValueError(f"O has shape {density.shape}, the density grid {self.shape}")
        self.q = opencl.to_device(np.asarray(density, np.float32))
        self.box = tuple((0, n) for n in self._size())

    def inject(self, sources: Sequence[Source], frame: int) -> None:
        """Every source in turn, into every lane."""
        for source in sources:
            cells, lowest, highest = source.bounds(self.shape, frame)
            box = tuple((s.start, s.stop) for s in cells[::-1]) + ((0, 1),) * (3 - len(cells))
            size = [end - first for first, end in box]
            sizes = [np.int32(n) for n in (*(first for first, _ in box), size[0], *self._size()[:2])]
            self._program.inject((-(-size[0] // ROW) * ROW, *size[1:]), (ROW, 1, 1), self.q,
                                 opencl.to_device(lowest), opencl.to_device(highest), *sizes)
            self.box = _around(self.box, box)

    def flow(self, v: Motion, field_shape: tuple[int, ...]) -> _Flow:
        """The flow of one frame on this grid; the one before it is no longer valid."""
        for _ in range(len(self._displacements), 3 if isinstance(v, Carried) else 1):
            self._displacements.append(opencl.empty((*self.shape, len(self.shape))))
        return _Flow(v, field_shape, self.grid, self._displacements)

    def advance(self, v: Motion, field_shape: tuple[int, ...]) -> None:
        """A step along v of every lane."""
        self.step(self.flow(v, field_shape), self, self.q, -1, -1)

    def step(self, flow: _Flow, fresh: _Lanes, taken: Any, take: int, put: int) -> None:
        """Advect every lane; then copy lane `take` to `taken`, and begin lane `put` anew from `fresh`."""
        own = [np.int32(n if 0 <= n < self.lanes else -1) for n in (take, put)]
        # where the smoke may go, what `fresh` brings, and what the older buffer still holds and must lose
        box = _around(self._reached(flow.reach), fresh.box, self._next_box)
        region = self._region(box)
        if min(region.size) > 0:
            self._program.step_lanes(region.size, (ROW, 1, 1), self.q, flow.displacements(region), self._next,
                                     fresh.q, taken, *own, *self.grid.cells, offset=region.first)
        self.q, self._next, self._next_box = self._next, self.q, self.box
        self.box = self._occupied(region)

    def _size(self) -> tuple[int, ...]:
        """Cells along x, y, z."""
        return (*self.shape[::-1], 1)[:3]

    def _reached(self, reach: int) -> Box:
        """The box that this frame's smoke can reach: `reach` cells further on each side."""
        grown = []
        for (first, end), n in zip(self.box, self._size(), strict=True):
            wraps = self.grid.border == "toroidal" and first < end and (first < reach or end + reach > n)
            grown.append((0, n) if wraps else (first - reach, end + reach))
        return tuple(grown)

    def _region(self, box: Box) -> Region:
        """The cells of the grid in `box`, along x in whole work-groups; of no size if there are none."""
        (x, x_end), (y, y_end), (z, z_end) = (
            (max(first, 0), min(end, n)) for (first, end), n in zip(box, self._size(), strict=True))
        if x >= x_end or y >= y_end or z >= z_end:
            return Region((0, 0, 0), (0, 0, 0))
        return _rows(((x, x_end), (y, y_end), (z, z_end)))

    def _occupied(self, region: Region) -> Box:
        """The smallest box of all smoke, which is known to lie in `region`."""
        (x, y, z), (width, rows, layers) = region
        if min(region.size) == 0:
            return NOWHERE
        self._program.extent((rows, layers), None, self.q, self._extents, np.int32(x),
                             np.int32(min(x + width, self.shape[-1])), *self.grid.cells[:2], offset=(y, z))
        extents = self._extents.get().reshape(-1, self.shape[-2], 2)[z : z + layers, y : y + rows]
        smoky = extents[..., 0] <= extents[..., 1]
        if not smoky.any():
            return NOWHERE
        along_y, along_z = (np.flatnonzero(smoky.any(axis)) + first for axis, first in ((0, y), (1, z)))
        return ((int(extents[..., 0][smoky].min()), int(extents[..., 1][smoky].max()) + 1),
                (int(along_y[0]), int(along_y[-1]) + 1), (int(along_z[0]), int(along_z[-1]) + 1))
