"""Detail synthesis (ma09 §3.1, §3.4, §4 "Parameters", pseudocode 1 and 2): exemplar and coarse motion to H.

Multi-resolution: at each level of a pyramid, from coarse to fine, neighbourhoods of 17², then of 9², are searched
and assigned a few times over. Frames after the first start from the frame before, advected by L.

    I  exemplar                 L  coarse motion           H  detail, in the exemplar's own coordinates
    z  match of a neighbourhood x  output                  k  candidates a neighbour offers in k-coherence
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from synth import opencl, pyramid
from synth.advect import departure
from synth.motion import assignment, initialize, neighborhood
from synth.motion.assignment import Assigner
from synth.motion.boundary import Constraint, walls
from synth.motion.local_axes import axes_2d
from synth.motion.search import Matcher

# each level is synthesized on the domain grown by this many cells, the radius of the widest neighbourhood, so
# that neighbourhoods at its border are whole and what flows in is synthesized before it is seen
MARGIN = 8
# the coarsest exemplar level is no smaller than this: there a 17² neighbourhood sees a whole motif
COARSEST = 8
# mosaics tried for the first frame
STARTS = 8
# how strongly a frame holds to the one before, advected; 1 is as much as all matches together
COHERENCE = 6.0
# the deformation in one frame, relative to the local axes, that halves this hold
DEFORMED = 0.02


@dataclass(frozen=True)
class Settings:
    """How a field is synthesized (§4, "Parameters").

    levels         of the pyramid
    neighborhoods  their widths, in the order in which they are used
    iterations     of search and assignment with each width
    search         "exact" or "k-coherence"
    k              candidates that each neighbour offers in k-coherence
    along          the axis of the exemplar, "x" or "y", that follows L
    """

    levels: int
    neighborhoods: tuple[int, ...] = (17, 9)
    iterations: int = 4
    search: str = "exact"
    k: int = 4
    along: str = "x"

    @property
    def few(self) -> int:
        """Half the iterations: for a frame that starts from the one before, and to compare starts."""
        return (self.iterations + 1) // 2


def enough_levels(size: int) -> int:
    """The number of levels that brings an exemplar of `size` cells down to 8.

    With fewer, the coarsest neighbourhoods see less than a whole motif on an empty background, and the empty field
    becomes the best match everywhere.
    """
    return max(1, int(np.log2(size / COARSEST)) + 1)


@dataclass(frozen=True)
class Level:
    """What one level needs in every frame: its exemplar (N, M, 2) and a matcher for each neighbourhood."""

    exemplar: np.ndarray
    rms: float
    settings: Settings

    @cached_property
    def steps(self) -> list[tuple[int, Matcher, Assigner]]:
        """For each width of the neighbourhoods in order: what searches and what assigns."""
        return [(width, Matcher(neighborhood.space(self.exemplar, width // 2), self.exemplar.shape[:2],
                                self.settings.k), Assigner(self.exemplar, width // 2, neighborhood.spacing(width)))
                for width in self.settings.neighborhoods]

    def prepare(self) -> None:
        """Build the search structures now instead of at the first search."""
        for _, matcher, _ in self.steps:
            matcher.prepare()

    def optimize(self, H: np.ndarray, axes: np.ndarray, iterations: int,
                 coherence: np.ndarray | None = None, boundary: Constraint | None = None) -> tuple[Any, Any]:
        """Search and assign, `iterations` times with each width of neighbourhoods.

        H, axes (Y, X, 2); `coherence` (Y, X) holds the result to H as it came, the frame before, warped: the O(x)
        of Eq. 1; `boundary` is the E_n of Eq. 3. Returns H (Y, X, 2) and the squared distances (S,) of its last
        matches; both are device arrays, and the device may still be computing them.
        """
        if coherence is None:
            coherence = np.zeros(axes.shape[:2], np.float32)
        x = prior = opencl.to_device(H)
        hold = opencl.to_device(coherence)
        for width, matcher, assigner in self.steps:
            at, grid = neighborhood.site_grid(H.shape[:2], width)
            sites, axis = opencl.to_device(at), opencl.to_device(axes[at[:, 1], at[:, 0]])
            z: Any = None
            for _ in range(iterations):
                queries = matcher.space.project(x, sites, axis)
                # k-coherence needs a match to begin with: the first round of each width searches exactly
                if self.settings.search == "exact" or z is None:
                    z, squared = matcher.exact(queries)
                else:
                    z, squared = matcher.coherent(queries, sites, axis, grid, z)
                weights = assignment.robust_weights(squared, matcher.space.length, self.rms)
                x = assigner.average(matcher.refine(queries, z), weights, axis, grid, prior, hold)
                if boundary is not None:
                    boundary.impose(x, hold)
        return x, squared

    def distance(self, squared: Any) -> float:
        """The mean distance of the last matches, as a share of the exemplar's rms; squared (S,) as optimize gives."""
        length = self.steps[-1][1].space.length
        return float(np.mean(np.sqrt(squared.get() / length))) / self.rms


@dataclass(frozen=True)
class State:
    """All that the next frame needs: H and the local axes of each level, coarsest first, with their margins."""

    H: list[np.ndarray]
    axes: list[np.ndarray]


class Synthesis:
    """Synthesizes H frame by frame.

    exemplar (N, M, 2) float32; shape (Y, X) of the output; distance (Y, X) to the wall of an obstacle, cells, whose
    boundary H is to observe (§3.6).
    """

    def __init__(self, exemplar: np.ndarray, shape: tuple[int, int], settings: Settings, seed: int,
                 distance: np.ndarray | None = None):
        rms = float(np.sqrt(np.mean(exemplar.astype(np.float64) ** 2)))
        if rms == 0.0:
            raise ValueError("the exemplar is zero everywhere")
        self.levels = [Level(I, rms, settings) for I in pyramid.pyramid(exemplar, settings.levels, toroidal=True)]
        self.shape, self.seed, self.along = shape, seed, settings.along
        self.walls = None if distance is None else walls(distance, settings.levels, MARGIN)

    def frame(self, L: np.ndarray, state: State | None) -> State:
        """The state after the frame with coarse motion L (Y, X, 2) cells per frame; None before the first."""
        motions, axes = self.motions(L)
        return State(self._first(axes) if state is None else self._next(motions, axes, state), axes)

    def motions(self, L: np.ndarray) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """L (Y, X, 2) and its local axes on each level, coarsest first, continued over the margin."""
        motions = [motion / np.float32(2 ** (len(self.levels) - 1 - i))
                   for i, motion in enumerate(pyramid.pyramid(L, len(self.levels), toroidal=False))]
        # before the margins: these are the axes that rotate H into H' afterwards
        axes = [_margin(axes_2d(motion, self.along)) for motion in motions]
        return [_margin(motion) for motion in motions], axes

    def _first(self, axes: list[np.ndarray]) -> list[np.ndarray]:
        """H of each level of the first frame: the coarsest from a mosaic, each other from the one before."""
        done = [self._start(axes[0])]
        for i, (level, local) in enumerate(zip(self.levels[1:], axes[1:], strict=True), start=1):
            H = initialize.reseed(_finer(done[-1], local.shape[:2]), level.exemplar, local)
            done.append(level.optimize(H, local, level.settings.iterations,
                                       boundary=self._boundary(i, local))[0].get())
        return done

    def _next(self, motions: list[np.ndarray], axes: list[np.ndarray], state: State) -> list[np.ndarray]:
        """H of each level of a later frame (pseudocode 1, §3.4).

        1. Carry each level of the frame before along L.
        Then for each level, coarsest first:
        2. Add what the coarser level has changed to what was carried here. Cells whose content flowed in across the
           border during this frame take all of the coarser level's H.
        3. Place a whole exemplar wherever the detail has run empty.
        4. Choose how strongly to hold to the result: less where the flow deforms the detail, not at all at an inflow.
        5. Search and assign.
        """
        # 1. carry
        displacements = [departure(motion) for motion in motions]
        warped = [assignment.carry(H, displacement) for H, displacement in zip(state.H, displacements, strict=True)]
        done: list[np.ndarray] = []
        for i, level in enumerate(self.levels):
            # 2. correct by the coarser level
            H = warped[i]
            inland = distance_inland(displacements[i])
            if i > 0:
                H = np.where(inland[..., None] < 1, _finer(done[-1], H.shape[:2]),
                             H + _finer(done[-1] - warped[i - 1], H.shape[:2]))
            # 3. reseed
            H = initialize.reseed(H, level.exemplar, axes[i])
            # 4. hold; what flowed in has no earlier frame to hold to, and takes shape while it crosses the margin
            bent = deformation(displacements[i], state.axes[i], axes[i]) / DEFORMED
            hold = COHERENCE / (1 + bent**2) * np.minimum(inland / MARGIN, 1)
            # 5. search and assign
            done.append(level.optimize(H, axes[i], level.settings.few, hold,
                                       self._boundary(i, axes[i]))[0].get())
        return done

    def _boundary(self, level: int, axes: np.ndarray) -> Constraint | None:
        """E_n of a level with these local axes."""
        return None if self.walls is None else Constraint(self.walls[level], axes)

    def visible(self, state: State) -> np.ndarray:
        """H (Y, X, 2) of a state, without its margin."""
        return np.ascontiguousarray(state.H[-1][MARGIN:-MARGIN, MARGIN:-MARGIN])

    def _start(self, axes: np.ndarray) -> np.ndarray:
        """The coarsest level of the first frame.

        1. Lay STARTS mosaics of whole exemplars, each with its own random numbers.
        2. Optimize each with half the iterations.
        3. Keep the one with the best score: the distance to its matches, plus how far its rms is from the exemplar's.
        4. Place a whole exemplar wherever the best has run empty, and optimize it with all iterations.
        """
        level = self.levels[0]
        rms = np.sqrt(np.mean(level.exemplar**2))
        boundary = self._boundary(0, axes)
        randoms = [np.random.Generator(np.random.Philox(key=[self.seed, start])) for start in range(STARTS)]
        # 1. and 2.; the device works on one after the other, the host waits for none
        trials = [level.optimize(mosaic, axes, level.settings.few, boundary=boundary)
                  for mosaic in initialize.mosaics(level.exemplar, axes, randoms)]
        for finer in self.levels[1:]:  # while the device works
            finer.prepare()
        best, least = None, np.inf
        for optimized, squared in trials:
            H = optimized.get()
            inside = H[MARGIN:-MARGIN, MARGIN:-MARGIN]
            # 3. the distance alone would choose the emptiest
            score = level.distance(squared) + abs(np.sqrt(np.mean(inside**2)) / rms - 1)
            if score < least:
                best, least = H, score
        assert best is not None
        # 4.
        best = initialize.reseed(best, level.exemplar, axes)
        return level.optimize(best, axes, level.settings.iterations, boundary=boundary)[0].get()


def distance_inland(displacement: np.ndarray) -> np.ndarray:
    """Cells upstream from each cell to the border, (Y, X) float32, 0 where its content flowed in during this frame.

    Measured straight back along displacement (Y, X, 2), which leads to the departure point.
    """
    frames = np.full(displacement.shape[:2], np.inf, np.float32)
    for component, position in enumerate(np.ogrid[:displacement.shape[0], :displacement.shape[1]][::-1]):
        speed = displacement[..., component]
        room = np.where(speed < 0, position, displacement.shape[1 - component] - 1 - position).astype(np.float32)
        np.minimum(frames, np.divide(room, np.abs(speed), out=np.full_like(frames, np.inf), where=speed != 0),
                   out=frames)
    length = np.maximum(np.linalg.norm(displacement, axis=-1), np.float32(1e-6))
    return np.where(frames < 1, np.float32(0), frames * length)


def deformation(displacement: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """How far the flow bends the detail out of its local axes in one step: (Y, X) float32, 0 for a rigid one.

    |R_after^T G R_before - 1| (Frobenius), G the gradient of the motion that ends in each cell; displacement (Y, X, 2)
    leads back to the departure point; before, after (Y, X, 2) are the local axes.
    """
    forward = -displacement
    # G = 1 + grad(u), to first order in one frame's displacement u
    flat = min(displacement.shape[:2]) == 1
    dy, dx = (np.zeros_like(displacement),) * 2 if flat else np.gradient(forward, axis=(0, 1))
    old = assignment.carry(before, displacement)
    old /= np.maximum(np.linalg.norm(old, axis=-1, keepdims=True), 1e-6)
    # the columns of G R_before
    columns = [np.stack([old[..., 0], old[..., 1]], -1), np.stack([-old[..., 1], old[..., 0]], -1)]
    total = np.zeros(displacement.shape[:2], np.float32)
    for i, axis in enumerate(columns):
        moved = axis + axis[..., :1] * dx + axis[..., 1:] * dy
        along = np.sum(after * moved, -1) - (i == 0)
        across = after[..., 0] * moved[..., 1] - after[..., 1] * moved[..., 0] - (i == 1)
        total += along**2 + across**2
    return np.sqrt(total)


def _margin(field: np.ndarray) -> np.ndarray:
    """A field (Y, X, 2) continued over the margin."""
    return np.pad(field, ((MARGIN, MARGIN), (MARGIN, MARGIN), (0, 0)), mode="edge")


def _finer(H: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """H of one level, with margin, at the cells of the next finer one of `shape`, with margin."""
    return pyramid.resample(H, shape, (MARGIN / 2 - 0.25,) * 2, 0.5)


def synthesize(exemplar: np.ndarray, motion: Iterable[np.ndarray], shape: tuple[int, int], settings: Settings,
               seed: int, distance: np.ndarray | None = None) -> Iterator[np.ndarray]:
    """H (Y, X, 2) for each frame of coarse motion L (Y, X, 2), cells per frame at the output's resolution."""
    synthesis = Synthesis(exemplar, shape, settings, seed, distance)
    state = None
    for L in motion:
        state = synthesis.frame(L, state)
        yield synthesis.visible(state)
