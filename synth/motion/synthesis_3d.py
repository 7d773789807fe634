"""Synthesis in 3-D (ma09 §3.2, §3.7, pseudocode 1 and 2): H in three dimensions from exemplars of two, or of three.

As in 2-D (`detail`), from coarse to fine and from frame to frame: search and assign. New are the views (`views`),
each of which matches and contributes only the components of the field that it sees; the hot kernels are there too.
`python -m bench solid` times a frame.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy import ndimage

from synth import opencl, pyramid
from synth.advect import Grid
from synth.motion import initialize, neighborhood
from synth.motion.assignment import catmull_rom, robust_weights
from synth.motion.boundary import Constraint, walls
from synth.motion.detail import COHERENCE, DEFORMED
from synth.motion.local_axes import axes_3d
from synth.motion.views import SITES_AT_ONCE, View, ViewSearch, contributions, on_device, site_grid

# each level is synthesized on the domain grown by the radius of a 9² neighbourhood, as in 2-D
MARGIN = 4
# mosaics tried for the first frame
STARTS = 4
# how much deeper than wide a block of a dominating view is: its motif is extruded along the view's normal
DEEPER = 4


@dataclass(frozen=True)
class Settings:
    """As `detail.Settings`; neighbourhoods of 9² alone (§4: "fix the neighborhood size to 9² for 3D synthesis").

    search "exact" averages all matches that cover a cell; "k-coherence" is pseudocode 2: k candidates from each
    adjacent site, and in each cell the match nearest to the average.
    """

    levels: int
    neighborhoods: tuple[int, ...] = (9,)
    iterations: int = 4
    search: str = "k-coherence"
    k: int = 4
    along: str = "x"

    @property
    def few(self) -> int:
        """Half the iterations, as `detail.Settings.few`."""
        return (self.iterations + 1) // 2


@dataclass(frozen=True)
class Level:
    """What one level needs in every frame: for each width of neighbourhoods, one search per view."""

    searches: dict[int, list[ViewSearch]]
    settings: Settings

    @property
    def any_searches(self) -> list[ViewSearch]:
        """The searches of the first width, for what is the same at any width."""
        return next(iter(self.searches.values()))

    def optimize(self, H: np.ndarray, axes: np.ndarray, iterations: int, coherence: np.ndarray | None = None,
                 boundary: Constraint | None = None) -> tuple[np.ndarray, float]:
        """Search and assign, `iterations` times with each width; H (Z, Y, X, 3), axes (Z, Y, X, 3, 3).

        coherence (Z, Y, X) holds the result to H as it came; boundary is the E_n of Eq. 3. Returns
        H and the mean distance of the last matches over the views, as a share of their exemplars' rms.
        """
        x = on_device(H)
        prior = x
        held = opencl.zeros(H.shape[:3]) if coherence is None else opencl.to_device(coherence)
        distance = 0.0
        for width, searches in self.searches.items():
            sites = axes[site_grid(H.shape[:3], width)]
            bases, grid = [search.basis_at(sites) for search in searches], sites.shape[:3]
            matches: list[Any] = [None] * len(searches)
            for left in reversed(range(iterations)):
                x, matches, distance = self._iteration(x, searches, bases, grid, matches, left == 0)
                if coherence is not None:
                    _program().hold((held.size,), None, x, prior, held)
                if boundary is not None:
                    boundary.impose(x, held)
        return np.ascontiguousarray(x.get()[..., :3]), distance

    def _iteration(self, x: Any, searches: list[ViewSearch], bases: list[Any], grid: tuple[int, ...],
                   matches: list[Any], last: bool) -> tuple[Any, list[Any], float]:
        """One search and one assignment: x, the matches, and their mean distance.

        1. Every view searches the best match of each site. The first iteration of a width searches exactly, since
           k-coherence needs matches to begin with.
        2. Every view adds its average over those matches (Eq. 2).
        3. With k-coherence, choose in each cell the match that is nearest to the average (pseudocode 2).

        The last iteration of a width keeps the average: for motion "low frequency noise or blur is usually better than
        high frequency discontinuity" (§3.1), and choosing in each cell leaves steps.
        """
        coherent = self.settings.search == "k-coherence"
        found, laid, distance, average = [], [], 0.0, opencl.empty(x.shape)
        for i, search in enumerate(searches):
            # 1. search
            match, position, squared = search.search(x, bases[i], grid, matches[i] if coherent else None)
            length = search.matcher.space.length
            # 2. average
            weight = robust_weights(squared, length, search.rms)
            search.average(position, weight, bases[i], grid, x, average, coherent, i == 0)
            distance += float(np.mean(np.sqrt(squared.get() / length))) / search.rms / len(searches)
            found.append(match)
            laid.append(position)
        if last or not coherent:
            return average, found, distance
        # 3. choose
        chosen = opencl.empty(x.shape)
        for i, search in enumerate(searches):
            search.nearest(laid[i], bases[i], grid, average, chosen, i == 0)
        return chosen, found, distance


@dataclass(frozen=True)
class State:
    """All that the next frame needs: H of each level, coarsest first, with margins; the coarsest local axes."""

    H: list[np.ndarray]
    axes: list[np.ndarray]


class Synthesis:
    """Synthesizes H frame by frame.

    views; shape (Z, Y, X) of the output; distance (Z, Y, X) to the wall of an obstacle, cells, whose boundary H is to
    observe (§3.6). Raises ValueError for views that do not span space.
    """

    def __init__(self, views: Sequence[View], shape: tuple[int, int, int], settings: Settings, seed: int,
                 distance: np.ndarray | None = None):
        matrices = contributions(views)
        total = sum(view.weight for view in views)
        self.shape, self.settings, self.seed = shape, settings, seed
        self.walls = None if distance is None else walls(distance, settings.levels, MARGIN)
        pyramids = [pyramid.pyramid(v.exemplar, settings.levels, toroidal=True, dimension=v.dimension) for v in views]
        self.levels = [Level({width: [ViewSearch(view, levels[i], matrix, width, 2 * view.weight > total, settings.k)
                                      for view, levels, matrix in zip(views, pyramids, matrices, strict=True)]
                              for width in settings.neighborhoods}, settings) for i in range(settings.levels)]
        # the mean square of an H as strong as the exemplars, for each level: by it `_reseeded` finds empty places
        self.mean_squares = [sum(float(np.mean(np.sum((search.exemplar @ search.matrix.T.astype(np.float32)) ** 2, -1)))
                                 for search in level.any_searches) for level in self.levels]

    def frame(self, L: np.ndarray, towards: np.ndarray, state: State | None) -> State:
        """The state after the frame with coarse motion L (Z, Y, X, 3) cells per frame; None before the first.

        towards (Z, Y, X, 3), any unit: the direction of the third local axis (§3.3).
        """
        count = len(self.levels)
        motions = [_grown(motion / np.float32(2 ** (count - 1 - i)))
                   for i, motion in enumerate(pyramid.pyramid(L, count, toroidal=False, dimension=3))]
        directions = [_grown(d) for d in pyramid.pyramid(towards, count, toroidal=False, dimension=3)]
        coarsest = axes_3d(motions[0], directions[0], self.settings.along)
        if state is None:
            return State(self._first(motions, directions, coarsest), [coarsest])
        return State(self._next(motions, directions, coarsest, state), [coarsest])

    def visible(self, state: State) -> np.ndarray:
        """H (Z, Y, X, 3) of a state, in local coordinates, without its margin."""
        inside = (slice(MARGIN, -MARGIN),) * 3
        return np.ascontiguousarray(state.H[-1][inside])

    def _first(self, motions: list[np.ndarray], directions: list[np.ndarray], coarsest: np.ndarray) -> list[np.ndarray]:
        """H of each level of the first frame: the coarsest from a mosaic of blocks, each other from the one before."""
        done = [self._start(coarsest)]
        for i, level in enumerate(self.levels[1:], 1):
            axes = axes_3d(motions[i], directions[i], self.settings.along)
            H = self._reseeded(i, _finer(done[-1], motions[i].shape[:3]), axes)
            done.append(level.optimize(H, axes, self.settings.iterations, boundary=self._constraint(i, axes))[0])
        return done

    def _next(self, motions: list[np.ndarray], directions: list[np.ndarray], coarsest: np.ndarray,
              state: State) -> list[np.ndarray]:
        """H of each level of a later frame (pseudocode 1, §3.4).

        1. From the deformation on the coarsest level, choose how strongly to hold to the frame before.
        Then for each level, coarsest first:
        2. Carry the frame before along L.
        3. Add what the coarser level has changed.
        4. Place a whole motif wherever the detail has run empty, then search and assign.
        """
        # 1. hold
        bent = deformation(Grid(coarsest.shape[:3], "clamp").departure(opencl.to_device(motions[0])).get(),
                           state.axes[0], coarsest) / DEFORMED
        held = COHERENCE / (1 + bent**2)
        before = list(state.H)
        done: list[np.ndarray] = []
        warped_before: np.ndarray | None = None
        for i, level in enumerate(self.levels):
            # 2. carry
            warped = carry(before[i], motions[i])
            H = warped
            # 3. correct by the coarser level
            if i > 0:
                H = H + _finer(done[-1] - warped_before, H.shape[:3])
                held = np.maximum(_finer(held, H.shape[:3]), 0)
                axes = axes_3d(motions[i], directions[i], self.settings.along)
            else:
                axes = coarsest
            # 4. reseed, search and assign
            done.append(level.optimize(self._reseeded(i, H, axes), axes, self.settings.few, held,
                                       self._constraint(i, axes))[0])
            warped_before = warped
        return done

    def _start(self, axes: np.ndarray) -> np.ndarray:
        """The coarsest level of the first frame: the best of several mosaics; steps as `detail.Synthesis._start`."""
        level, boundary = self.levels[0], self._constraint(0, axes)
        best, least = None, np.inf
        for start in range(STARTS):
            random = np.random.Generator(np.random.Philox(key=[self.seed, start]))
            H, distance = level.optimize(self._mosaic(level, axes, random), axes, self.settings.few, None, boundary)
            inside = H[(slice(MARGIN, -MARGIN),) * 3]
            # the distance alone would choose the emptiest
            score = distance + abs(float(np.sqrt(np.mean(np.sum(inside**2, -1)) / self.mean_squares[0])) - 1)
            if score < least:
                best, least = H, score
        assert best is not None
        return level.optimize(self._reseeded(0, best, axes), axes, self.settings.iterations, None, boundary)[0]

    def _constraint(self, level: int, axes: np.ndarray) -> Constraint | None:
        """E_n on a level with these local axes; None where there is no wall."""
        return None if self.walls is None else Constraint(self.walls[level], axes)

    def _mosaic(self, level: Level, axes: np.ndarray, random: np.random.Generator) -> np.ndarray:
        """Blocks of the size of the heaviest view's exemplar, each with a whole motif for every view: (Z, Y, X, 3)."""
        basis, edges = self._block(level)
        return self._motif(level, initialize.blocks(axes @ basis.T, edges, random) @ basis)

    def _block(self, level: Level) -> tuple[np.ndarray, tuple[int, int, int]]:
        """The basis (3, 3) of the heaviest view, and the edges of a block along it, cells of the level."""
        heaviest = max(level.any_searches, key=lambda search: search.view.weight)
        edge = heaviest.exemplar.shape[0]
        return heaviest.view.basis.astype(np.float32), (edge, edge, edge * (DEEPER if heaviest.dominant else 1))

    def _motif(self, level: Level, offset: np.ndarray) -> np.ndarray:
        """What all views together show at offsets (..., 3) in local coordinates from the middle of their exemplars."""
        H = np.zeros(offset.shape, np.float32)
        for search in level.any_searches:
            size = np.array(search.exemplar.shape[-2::-1])
            seen = offset @ search.view.projection.T.astype(np.float32)
            at = np.rint(seen + (size - 1) / 2).astype(int) % size
            H += search.exemplar[tuple(np.moveaxis(at, -1, 0)[::-1])] @ search.matrix.T.astype(np.float32)
        return H

    def _reseeded(self, number: int, H: np.ndarray, axes: np.ndarray) -> np.ndarray:
        """H (Z, Y, X, 3) of a level with a whole motif placed wherever it has run empty, as by `reseed`."""
        level = self.levels[number]
        basis, edges = self._block(level)
        H = H.copy()
        for box, offset in initialize.empty_blocks(H, axes, basis, edges, self.mean_squares[number]):
            inside = (np.abs(offset @ basis.T) < np.array(edges) / 2).all(-1)
            motif, there = self._motif(level, offset), H[box]
            # what is stronger there already stays
            stronger = inside & (np.sum(motif**2, -1) > np.sum(there**2, -1))
            there[stronger] = motif[stronger]
        return H


def deformation(displacement: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """How far the flow bends the detail out of its local axes in one frame: (Z, Y, X) float32, 0 for a rigid one.

    As `detail.deformation`: |R_after^T G R_before - 1| (Frobenius); displacement (Z, Y, X, 3) leads back to the
    departure point; before, after (Z, Y, X, 3, 3) are the local axes.
    """
    forward = -displacement
    gradient = np.stack([np.gradient(forward, axis=axis) for axis in (2, 1, 0)], axis=-1)  # [..., component, along]
    cells = np.stack(np.meshgrid(*(np.arange(n) for n in displacement.shape[:3]), indexing="ij"))
    at = cells + np.moveaxis(displacement, -1, 0)[::-1]
    old = np.stack([ndimage.map_coordinates(before[..., i, j], at, order=1, mode="nearest")
                    for i in range(3) for j in range(3)], axis=-1).reshape(before.shape)
    moved = np.swapaxes(after, -1, -2) @ (np.eye(3, dtype=np.float32) + gradient) @ old
    return np.asarray(np.linalg.norm(moved - np.eye(3, dtype=np.float32), axis=(-2, -1)), np.float32)


def carry(H: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """The frame before, moved by the flow (§3.4): H and motion (Z, Y, X, 3), cells per frame. Catmull-Rom, clamped."""
    shape = H.shape[:3]
    displacement = Grid(shape, "clamp").departure(opencl.to_device(np.ascontiguousarray(motion)))
    out = opencl.empty((*shape, 4))
    _program().carry_3d(shape[::-1], None, on_device(H), displacement, out)
    return np.ascontiguousarray(out.get()[..., :3])


def _program() -> Any:
    return opencl.program(Path(__file__).with_suffix(".cl"))


def _grown(field: np.ndarray) -> np.ndarray:
    return np.pad(field, ((MARGIN, MARGIN),) * 3 + ((0, 0),), mode="edge")


def _finer(H: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """H of one level, with margin, at the cells of the next finer one of `shape`, with margin."""
    return pyramid.resample(H, shape, (MARGIN / 2 - 0.25,) * 3, 0.5)


def synthesize(views: Sequence[View], motion: Iterable[tuple[np.ndarray, np.ndarray]], shape: tuple[int, int, int],
               settings: Settings, seed: int) -> Iterator[np.ndarray]:
    """H (Z, Y, X, 3) in local coordinates for each frame of (L, towards), as `Synthesis.frame` takes them."""
    synthesis = Synthesis(views, shape, settings, seed)
    state = None
    for L, towards in motion:
        state = synthesis.frame(L, towards, state)
        yield synthesis.visible(state)


def memory_needed(views: Sequence[View], shape: tuple[int, int, int], settings: Settings) -> int:
    """Bytes that a frame takes at its peak, on host and device together; an estimate from above."""
    cells = float(np.prod([n + 2 * MARGIN for n in shape]))
    step = min(neighborhood.spacing(width) for width in settings.neighborhoods)
    sites = cells / step**3
    # per cell: the local axes twice, L, towards and their like, and on the device five fields of four components;
    # per site and view: basis, match, position, distance, weight
    per_cell = 2 * 36 + 6 * 12 + 5 * 16 + 4 * 12
    per_site = len(views) * (48 + 4 + 16 + 8) + 36
    exemplars = sum(4.0 * v.exemplar.size // v.dimension * (64 * 2 + (2 * 4 + 1) ** v.dimension * v.dimension * 3)
                    for v in views)
    return int(cells * 8 / 7 * per_cell + sites * per_site + exemplars + SITES_AT_ONCE * 4 * 800)


def carry_reference(H: np.ndarray, displacement: np.ndarray) -> np.ndarray:
    """Specification of `carry_3d`: H (Z, Y, X, 3) at each cell + displacement (Z, Y, X, 3), Catmull-Rom, clamped."""
    cells = np.stack(np.meshgrid(*(np.arange(n) for n in H.shape[:3]), indexing="ij")[::-1], -1)
    last = np.array(H.shape[2::-1], np.float32) - 1
    at = np.clip(cells + displacement, 0, last).astype(np.float32)
    low = np.floor(at).astype(int)
    weights = catmull_rom(at - low)
    out = np.zeros(H.shape)
    for i, j, k in np.ndindex(4, 4, 4):
        x, y, z = (np.clip(low[..., c] + (i, j, k)[c] - 1, 0, H.shape[2 - c] - 1) for c in range(3))
        out += (weights[..., 0, i] * weights[..., 1, j] * weights[..., 2, k])[..., None] * H[z, y, x]
    return out.astype(np.float32)
