"""Solid synthesis (ma09 §3.2, §3.7, pseudocode 1 and 2): H in three dimensions from exemplars of two, or of three.

As in the plane (`detail`), from coarse to fine and from frame to frame: search and assign. What is new are the
views. A view sees a plane of the local frame; neighbourhoods are projected on it before the match, and a match
contributes only what the view can see (Eq. 2, figure 3).

    I_i  exemplar of view i     P_i  its projection, the rows right and up      w_i  its weight
    mu   match of a site        R    local frame                                M_i  what its match makes of a voxel
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from scipy import ndimage

from synth import opencl, pyramid
from synth.advect import Grid
from synth.motion import initialize, neighborhood, search
from synth.motion.assignment import catmull_rom, robust_weights, sample_reference
from synth.motion.boundary import Constraint, walls
from synth.motion.detail import COHERENCE, DEFORMED
from synth.motion.local_axes import solid_frame
from synth.motion.search import Matcher

# each level is synthesized on the domain grown by the radius of a 9² neighbourhood, as in the plane
MARGIN = 4
# mosaics tried for the first frame
STARTS = 4
# sites compared together: their neighbourhoods are what takes most memory
SITES_AT_ONCE = 49152
# how much deeper than wide a block is that a dominating view sees: a motif goes on behind itself
DEEPER = 4
# the numbers in all neighbourhoods of a volume that is an exemplar, at most: they are held together once
MOST_NUMBERS = 2**28
# unit vectors closer than this to a plane lie in it
FLAT = 1e-3

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class View:
    """One exemplar and how it looks at the local frame.

    exemplar  (N, M, 2) float32, a field of the plane; or (K, N, M, 3), a volume's (3D to 3D)
    right, up directions of the exemplar's x and y axis in the local frame, made unit and perpendicular
    weight    how much its matches count against those of other views, per unit
    Raises ValueError for directions that are parallel or zero, a weight that is not positive, an exemplar of
    another shape or without motion.
    """

    exemplar: np.ndarray
    right: Triple = (1.0, 0.0, 0.0)
    up: Triple = (0.0, 1.0, 0.0)
    weight: float = 1.0

    def __post_init__(self) -> None:
        dimension = self.exemplar.ndim - 1
        if dimension not in (2, 3) or self.exemplar.shape[-1] != dimension:
            raise ValueError(f"an exemplar is (N, M, 2) or (K, N, M, 3), not {self.exemplar.shape}")
        if not self.exemplar.any():
            raise ValueError("the exemplar is zero everywhere")
        if not self.weight > 0:
            raise ValueError(f"a view's weight must be positive, not {self.weight}")
        right, up = np.array(self.right, float), np.array(self.up, float)
        if not (np.linalg.norm(right) > 0 and np.linalg.norm(np.cross(right, up)) > FLAT * np.linalg.norm(up)):
            raise ValueError(f"a view's right {self.right} and up {self.up} span no plane")

    @property
    def legs(self) -> np.ndarray:
        """Right, up and normal in the local frame: (3, 3) float64, orthonormal rows."""
        right = np.array(self.right, float) / np.linalg.norm(self.right)
        up = np.array(self.up, float)
        up = up - (up @ right) * right
        up /= np.linalg.norm(up)
        return np.stack([right, up, np.cross(right, up)])

    @property
    def dimension(self) -> int:
        """Of the exemplar: 2 or 3."""
        return self.exemplar.ndim - 1

    @property
    def projection(self) -> np.ndarray:
        """P: (2, 3) right and up; of a volume (3, 3), right, up and normal."""
        return self.legs[: self.dimension]


def contributions(views: Sequence[View]) -> list[np.ndarray]:
    """M_i (3, 2 or 3) of each view: a voxel is the sum of M_i mu_i, the weighted least squares of all views.

    The least of sum_i w_i |P_i s - mu_i|² over s is (sum w_i P_i^T P_i)^-1 sum w_i P_i^T mu_i: with the three planes of
    the axes and equal weights, Eq. 2. Raises ValueError if the views leave a direction unseen.
    """
    seen = sum((v.weight * v.projection.T @ v.projection for v in views), np.zeros((3, 3)))
    values, directions = np.linalg.eigh(seen)
    if values[0] < FLAT * values[-1] * min(v.weight for v in views) / max(v.weight for v in views):
        way = ", ".join(f"{c:.2g}" for c in directions[:, 0])
        raise ValueError(f"the views do not span space: none sees the direction ({way}) of the local frame")
    return [np.linalg.solve(seen, v.weight * v.projection.T) for v in views]


@dataclass(frozen=True)
class Settings:
    """As `detail.Settings`; neighbourhoods of 9² alone (§4: "fix the neighborhood size to 9² for 3D synthesis").

    search "exact" averages all matches that cover a cell; "k-coherence" is pseudocode 2: k candidates of each site
    beside, and in each cell the match nearest to the average.
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


def exemplar_blocks(exemplar: np.ndarray, radius: int) -> np.ndarray:
    """All toroidal neighbourhoods of a volume (K, N, M, 3): (K * N * M, (2r+1)³ * 3) float32.

    Raises ValueError where they would not fit: a volume of 32³ holds 71 million numbers at radius 4.
    """
    width = 2 * radius + 1
    numbers = exemplar.size * width**3
    if numbers > MOST_NUMBERS:
        raise ValueError(f"a volume of {exemplar.shape[2]}×{exemplar.shape[1]}×{exemplar.shape[0]} is too large an "
                         f"exemplar: its neighbourhoods are {numbers / 2**30:.1f} G numbers")
    padded = np.pad(exemplar, ((radius, radius),) * 3 + ((0, 0),), mode="wrap")
    windows = np.lib.stride_tricks.sliding_window_view(padded, (width,) * 3, axis=(0, 1, 2))
    return np.ascontiguousarray(windows.transpose(0, 1, 2, 4, 5, 6, 3)).reshape(exemplar.size // 3, -1)


def site_grid(shape: tuple[int, ...], width: int) -> tuple[slice, ...]:
    """The sites of neighbourhoods of a width among cells (Z, Y, X): a slice for each axis."""
    step = neighborhood.spacing(width)
    return tuple(slice(min(step // 2, n - 1), None, step) for n in shape)


@dataclass(frozen=True)
class Eye:
    """One view at one level with one width of neighbourhoods: it searches and lays down."""

    view: View
    exemplar: np.ndarray
    matrix: np.ndarray
    width: int
    settings: Settings
    dominant: bool

    @property
    def slab(self) -> np.float32:
        """How far a match reaches to the front and to the back of its plane, cells.

        Where one view dominates nothing else would hold its motifs together across its planes.
        """
        return np.float32(self.width // 2 if self.dominant else neighborhood.spacing(self.width))

    @cached_property
    def matcher(self) -> Matcher:
        radius = self.width // 2
        space = (neighborhood.space(self.exemplar, radius) if self.view.dimension == 2 else
                 neighborhood.space_of(exemplar_blocks(self.exemplar, radius), radius))
        return Matcher(space, (self.exemplar.shape[0], self.exemplar.shape[1]), self.settings.k)

    @cached_property
    def rms(self) -> float:
        return float(np.sqrt(np.mean(self.view.exemplar.astype(np.float64) ** 2)))

    @cached_property
    def _defines(self) -> dict[str, Any]:
        step = neighborhood.spacing(self.width)
        return {"VOLUME": self.view.dimension - 2, "RADIUS": self.width // 2, "FOOT": step, "SPACING": step,
                "FIRST": step // 2, "BORDER": self._border,
                **search.defines(self.matcher.space.dims, self.settings.k)}

    def _program(self, eight: bool) -> Any:
        return opencl.program(Path(__file__).with_suffix(".cl"), SEEN=int(eight), **self._defines)

    @property
    def _border(self) -> int:
        # a match's offset reaches the corner of its foot or of the eight sites' cube, its position half a cell beyond;
        # Catmull-Rom two more
        return int(np.ceil(np.sqrt(3) * neighborhood.spacing(self.width))) + 4

    @cached_property
    def _continued(self) -> tuple[Any, np.ndarray]:
        """The exemplar as the kernels read it, and its size there."""
        if self.view.dimension == 3:
            cells = np.zeros((*self.exemplar.shape[:3], 4), np.float32)
            cells[..., :3] = self.exemplar
            return opencl.to_device(cells), np.array([*self.exemplar.shape[2::-1], 1], np.int32)
        padded = np.pad(self.exemplar, ((self._border,) * 2,) * 2 + ((0, 0),), mode="wrap")
        return opencl.to_device(padded), np.array([padded.shape[1], padded.shape[0], 1, 1], np.int32)

    @cached_property
    def _basis(self) -> tuple[np.ndarray, ...]:
        """right, up, and the columns of M_i, for the kernels."""
        right, up = (np.array([*leg, 0], np.float32) for leg in self.view.legs[:2])
        columns = np.zeros((3, 4), np.float32)
        columns[: self.matrix.shape[1], :3] = self.matrix.T
        return right, up, *columns

    def legs(self, frame: np.ndarray) -> Any:
        """Right, up and normal in the domain at each site, for local frames (K, J, I, 3, 3): device (S, 3, 4)."""
        legs = np.zeros((frame[..., 0, 0].size, 3, 4), np.float32)
        legs[..., :3] = np.einsum("lk,sdk->sld", self.view.legs.astype(np.float32), frame.reshape(-1, 3, 3))
        return opencl.to_device(legs)

    def queries(self, field: Any, legs: Any, grid: tuple[int, ...], first: int, count: int) -> Any:
        """Neighbourhoods of `count` sites from `first` on, as the view sees them (§3.2, Project): (count, D).

        field (Z, Y, X, 4), legs as `legs` gives them, grid (K, J, I) of sites.
        """
        rows = -(-count // neighborhood.SITES_TOGETHER) * neighborhood.SITES_TOGETHER
        patches = opencl.empty((rows, self.matcher.space.length))
        self._program(True).gather(
            (count,), (1,), field, np.array([*field.shape[2::-1], 1], np.int32), legs,
            np.array([*grid[::-1], 1], np.int32), np.int32(first), *self._basis[:2], self.slab, patches)
        return self.matcher.space.compare(patches, count)

    def search(self, field: Any, legs: Any, grid: tuple[int, ...], match: Any) -> tuple[Any, Any, Any]:
        """Matches of all sites: device index (S,), position in the exemplar (S, 2 or 4), squared distance (S,).

        match (S,) of the last search, for k-coherence; None: exact.
        """
        count = legs.shape[0]
        best, distance = opencl.empty(count, np.int32), opencl.empty(count)
        positions = []
        cells = np.array([*grid[::-1], 1], np.int32)
        exemplar = np.array([*self.exemplar.shape[-2::-1], 1, 1][:4], np.int32)
        program = self._program(True)
        for first in range(0, count, SITES_AT_ONCE):
            some = min(SITES_AT_ONCE, count - first)
            queries = self.queries(field, legs, grid, first, some)
            if match is None:
                best[first:first + some], distance[first:first + some] = self.matcher.exact(queries)
            else:
                program.coherent_solid((some,), (1,), self.matcher.points, self.matcher.similar, exemplar, queries,
                                       legs, cells, np.int32(first), match, best, distance)
            if self.view.dimension == 2:
                positions.append(self.matcher.refine(queries, best[first:first + some].copy()))
        if self.view.dimension == 2:
            return best, _joined(positions), distance
        x, y = exemplar[:2]
        index = best.get()
        place = np.stack([index % x, index // x % y, index // (x * y), np.zeros_like(index)], -1)
        return best, opencl.to_device(place.astype(np.float32)), distance

    def average(self, position: Any, weight: Any, legs: Any, grid: tuple[int, ...], field: Any, out: Any, eight: bool,
                begin: bool) -> None:
        """Eq. 2: adds to `out` (Z, Y, X, 4) what this view says; `begin`: the first to do so."""
        self._program(eight).average(
            field.shape[2::-1], None, *self._continued, position, weight, legs, np.array([*grid[::-1], 1], np.int32),
            *self._basis, self.slab, np.int32(begin), field, out)

    def nearest(self, position: Any, legs: Any, grid: tuple[int, ...], average: Any, out: Any, begin: bool) -> None:
        """Pseudocode 2, Assign: adds to `out` the match, as this view sees it, that is nearest to the average."""
        self._program(True).nearest(
            average.shape[2::-1], None, *self._continued, position, legs, np.array([*grid[::-1], 1], np.int32),
            *self._basis, np.int32(begin), average, out)

    def hold(self, x: Any, prior: Any, coherence: Any) -> None:
        """The O(x) of Eq. 1: x (Z, Y, X, 4) held to `prior` by `coherence` (Z, Y, X), in place."""
        self._program(True).hold((coherence.size,), None, x, prior, coherence)


def _joined(parts: list[Any]) -> Any:
    """Device arrays one below the other."""
    if len(parts) == 1:
        return parts[0]
    whole = opencl.empty((sum(len(part) for part in parts), *parts[0].shape[1:]))
    first = 0
    for part in parts:
        whole[first:first + len(part)] = part
        first += len(part)
    return whole


@dataclass(frozen=True)
class Level:
    """What one level needs in every frame: for each width of neighbourhoods, its eyes."""

    eyes: dict[int, list[Eye]]
    settings: Settings

    @property
    def any_eyes(self) -> list[Eye]:
        """The eyes of one width, for what does not depend on it."""
        return next(iter(self.eyes.values()))

    def optimize(self, H: np.ndarray, frame: np.ndarray, iterations: int, coherence: np.ndarray | None = None,
                 boundary: Constraint | None = None) -> tuple[np.ndarray, float]:
        """Search and assign, `iterations` times with each width; H (Z, Y, X, 3), frame (Z, Y, X, 3, 3).

        coherence (Z, Y, X) holds the result to H as it came; boundary is the E_n of Eq. 3. Returns
        H and the mean distance of the last matches over the views, as a share of their exemplars' rms.
        """
        x = on_device(H)
        prior = x
        held = opencl.zeros(H.shape[:3]) if coherence is None else opencl.to_device(coherence)
        distance = 0.0
        for width, eyes in self.eyes.items():
            sites = frame[site_grid(H.shape[:3], width)]
            legs, grid = [eye.legs(sites) for eye in eyes], sites.shape[:3]
            matches: list[Any] = [None] * len(eyes)
            for left in reversed(range(iterations)):
                x, matches, distance = self._iteration(x, eyes, legs, grid, matches, left == 0)
                if coherence is not None:
                    eyes[0].hold(x, prior, held)
                if boundary is not None:
                    boundary.impose(x, held)
        return np.ascontiguousarray(x.get()[..., :3]), distance

    def _iteration(self, x: Any, eyes: list[Eye], legs: list[Any], grid: tuple[int, ...],
                   matches: list[Any], last: bool) -> tuple[Any, list[Any], float]:
        """One search and one assignment: x, the matches, and their mean distance.

        The last one keeps the average: for motion "low frequency noise or blur is usually better than high frequency
        discontinuity" (§3.1), and choosing in each cell leaves steps.
        """
        coherent = self.settings.search == "k-coherence"
        found, laid, distance, average = [], [], 0.0, opencl.empty(x.shape)
        for i, eye in enumerate(eyes):
            # k-coherence needs a match to begin with: the first round of each width searches exactly
            match, position, squared = eye.search(x, legs[i], grid, matches[i] if coherent else None)
            length = eye.matcher.space.length
            weight = robust_weights(squared, length, eye.rms)
            eye.average(position, weight, legs[i], grid, x, average, coherent, i == 0)
            distance += float(np.mean(np.sqrt(squared.get() / length))) / eye.rms / len(eyes)
            found.append(match)
            laid.append(position)
        if last or not coherent:
            return average, found, distance
        chosen = opencl.empty(x.shape)
        for i, eye in enumerate(eyes):
            eye.nearest(laid[i], legs[i], grid, average, chosen, i == 0)
        return chosen, found, distance


def on_device(H: np.ndarray) -> Any:
    """(Z, Y, X, 3) on the device as (Z, Y, X, 4)."""
    padded = np.zeros((*H.shape[:3], 4), np.float32)
    padded[..., :3] = H
    return opencl.to_device(padded)


@dataclass(frozen=True)
class State:
    """All that the next frame needs: H of each level, coarsest first, with margins; the coarsest local frame."""

    H: list[np.ndarray]
    frame: list[np.ndarray]


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
        self.levels = [Level({width: [Eye(view, stages[i], matrix, width, settings, 2 * view.weight > total)
                                      for view, stages, matrix in zip(views, pyramids, matrices, strict=True)]
                              for width in settings.neighborhoods}, settings) for i in range(settings.levels)]
        # what a synthesized H has where it is as lively as the exemplars: in each level, for whether it runs empty
        self.mean_squares = [sum(float(np.mean(np.sum((eye.exemplar @ eye.matrix.T.astype(np.float32)) ** 2, -1)))
                                 for eye in level.any_eyes) for level in self.levels]

    def frame(self, L: np.ndarray, towards: np.ndarray, state: State | None) -> State:
        """The state after the frame with coarse motion L (Z, Y, X, 3) cells per frame; None before the first.

        towards (Z, Y, X, 3), any unit: where the third axis of the local frames points (§3.3).
        """
        count = len(self.levels)
        motions = [_grown(motion / np.float32(2 ** (count - 1 - i)))
                   for i, motion in enumerate(pyramid.pyramid(L, count, toroidal=False, dimension=3))]
        directions = [_grown(d) for d in pyramid.pyramid(towards, count, toroidal=False, dimension=3)]
        coarsest = solid_frame(motions[0], directions[0], self.settings.along)
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
            frame = solid_frame(motions[i], directions[i], self.settings.along)
            H = self._sown(i, _finer(done[-1], motions[i].shape[:3]), frame)
            done.append(level.optimize(H, frame, self.settings.iterations, boundary=self._constraint(i, frame))[0])
        return done

    def _next(self, motions: list[np.ndarray], directions: list[np.ndarray], coarsest: np.ndarray,
              state: State) -> list[np.ndarray]:
        """H of each level of a later frame: what flowed here, corrected, held the more the less it was deformed."""
        bent = deformation(Grid(coarsest.shape[:3], "clamp").departure(opencl.to_device(motions[0])).get(),
                           state.frame[0], coarsest) / DEFORMED
        held = COHERENCE / (1 + bent**2)
        before = list(state.H)
        done: list[np.ndarray] = []
        warped_before: np.ndarray | None = None
        for i, level in enumerate(self.levels):
            warped = carry(before[i], motions[i])
            H = warped
            if i > 0:  # what the coarser level changed, on top of what flowed here
                H = H + _finer(done[-1] - warped_before, H.shape[:3])
                held = np.maximum(_finer(held, H.shape[:3]), 0)
                frame = solid_frame(motions[i], directions[i], self.settings.along)
            else:
                frame = coarsest
            done.append(level.optimize(self._sown(i, H, frame), frame, self.settings.few, held,
                                       self._constraint(i, frame))[0])
            warped_before = warped
        return done

    def _start(self, frame: np.ndarray) -> np.ndarray:
        """The coarsest level of the first frame: of several mosaics the one that promises most, optimized."""
        level, boundary = self.levels[0], self._constraint(0, frame)
        best, least = None, np.inf
        for start in range(STARTS):
            random = np.random.Generator(np.random.Philox(key=[self.seed, start]))
            H, distance = level.optimize(self._mosaic(level, frame, random), frame, self.settings.few, None, boundary)
            inside = H[(slice(MARGIN, -MARGIN),) * 3]
            # the distance alone would choose the emptiest
            score = distance + abs(float(np.sqrt(np.mean(np.sum(inside**2, -1)) / self.mean_squares[0])) - 1)
            if score < least:
                best, least = H, score
        assert best is not None
        return level.optimize(self._sown(0, best, frame), frame, self.settings.iterations, None, boundary)[0]

    def _constraint(self, level: int, frame: np.ndarray) -> Constraint | None:
        """E_n on a level in a frame with these local frames; None where there is no wall."""
        return None if self.walls is None else Constraint(self.walls[level], frame)

    def _mosaic(self, level: Level, frame: np.ndarray, random: np.random.Generator) -> np.ndarray:
        """Blocks as large as the exemplar that weighs most, each with a whole motif for every view: (Z, Y, X, 3)."""
        legs, edges = self._block(level)
        return self._motif(level, initialize.blocks(frame @ legs.T, edges, random) @ legs)

    def _block(self, level: Level) -> tuple[np.ndarray, tuple[int, int, int]]:
        """Of the view that weighs most: its legs (3, 3), and the edges of a block along them, cells of the level."""
        weighty = max(level.any_eyes, key=lambda eye: eye.view.weight)
        edge = weighty.exemplar.shape[0]
        return weighty.view.legs.astype(np.float32), (edge, edge, edge * (DEEPER if weighty.dominant else 1))

    def _motif(self, level: Level, offset: np.ndarray) -> np.ndarray:
        """What all views together show at offsets (..., 3) in local coordinates from the middle of their exemplars."""
        H = np.zeros(offset.shape, np.float32)
        for eye in level.any_eyes:
            size = np.array(eye.exemplar.shape[-2::-1])
            seen = offset @ eye.view.projection.T.astype(np.float32)
            at = np.rint(seen + (size - 1) / 2).astype(int) % size
            H += eye.exemplar[tuple(np.moveaxis(at, -1, 0)[::-1])] @ eye.matrix.T.astype(np.float32)
        return H

    def _sown(self, number: int, H: np.ndarray, frame: np.ndarray) -> np.ndarray:
        """H (Z, Y, X, 3) of a level with a whole motif laid into each place that has run empty, as `reseed` does."""
        level = self.levels[number]
        legs, edges = self._block(level)
        H = H.copy()
        for box, offset in initialize.empty_blocks(H, frame, legs, edges, self.mean_squares[number]):
            inside = (np.abs(offset @ legs.T) < np.array(edges) / 2).all(-1)
            motif, there = self._motif(level, offset), H[box]
            # what stands at the edge of the place stays whole
            stronger = inside & (np.sum(motif**2, -1) > np.sum(there**2, -1))
            there[stronger] = motif[stronger]
        return H


def deformation(way: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """How far the flow bends the detail out of its local frame in one step: (Z, Y, X) float32, 0 for a rigid one.

    As `detail.deformation`: |R_after^T G R_before - 1| (Frobenius); way (Z, Y, X, 3), the displacement back to the
    departure point, before and after (Z, Y, X, 3, 3).
    """
    forward = -way
    gradient = np.stack([np.gradient(forward, axis=axis) for axis in (2, 1, 0)], axis=-1)  # [..., component, along]
    cells = np.stack(np.meshgrid(*(np.arange(n) for n in way.shape[:3]), indexing="ij"))
    at = cells + np.moveaxis(way, -1, 0)[::-1]
    old = np.stack([ndimage.map_coordinates(before[..., i, j], at, order=1, mode="nearest")
                    for i in range(3) for j in range(3)], axis=-1).reshape(before.shape)
    moved = np.swapaxes(after, -1, -2) @ (np.eye(3, dtype=np.float32) + gradient) @ old
    return np.asarray(np.linalg.norm(moved - np.eye(3, dtype=np.float32), axis=(-2, -1)), np.float32)


def carry(H: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """The frame before, moved by the flow (§3.4): H and motion (Z, Y, X, 3), cells per frame. Catmull-Rom, clamped."""
    shape = H.shape[:3]
    displacement = Grid(shape, "clamp").departure(opencl.to_device(np.ascontiguousarray(motion)))
    out = opencl.empty((*shape, 4))
    _program_without_views().carry_solid(shape[::-1], None, on_device(H), displacement, out)
    return np.ascontiguousarray(out.get()[..., :3])


def _program_without_views() -> Any:
    return opencl.program(Path(__file__).with_suffix(".cl"), VOLUME=0, RADIUS=0, FOOT=0, SPACING=1, FIRST=0, BORDER=0,
                          SEEN=0, **search.defines(16, 1))


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
    # per cell: the local frame twice, L, towards and their likes, and on the device five fields of four components;
    # per site and view: legs, match, position, distance, weight
    per_cell = 2 * 36 + 6 * 12 + 5 * 16 + 4 * 12
    per_site = len(views) * (48 + 4 + 16 + 8) + 36
    exemplars = sum(4.0 * v.exemplar.size // v.dimension * (64 * 2 + (2 * 4 + 1) ** v.dimension * v.dimension * 3)
                    for v in views)
    return int(cells * 8 / 7 * per_cell + sites * per_site + exemplars + SITES_AT_ONCE * 4 * 800)


# The specification of the kernels, in NumPy. Sites are given by their cells (S, 3) as x, y, z; legs are (S, 3, 3).


def gather_reference(field: np.ndarray, sites: np.ndarray, legs: np.ndarray, view: View, radius: int,
                     slab: float, spacing: int) -> np.ndarray:
    """Specification of `gather`: field (Z, Y, X, 3) as the view sees it round each site, (S, C) float32."""
    span = np.arange(-radius, radius + 1)
    ways = np.stack(np.meshgrid(*[span] * view.dimension, indexing="ij")[::-1], -1).reshape(-1, view.dimension)
    at = sites[:, None] + np.einsum("pl,sld->spd", ways, legs[:, : view.dimension])
    planes = [0.0]
    if view.dimension == 2 and slab > spacing:
        planes = [0.0, 0.5 * slab, -0.5 * slab]
    seen = sum(_sampled(field, at + plane * legs[:, None, 2]) for plane in planes) / len(planes)
    return (seen @ view.projection.T).reshape(len(sites), -1).astype(np.float32)


def _sampled(field: np.ndarray, at: np.ndarray) -> np.ndarray:
    """field (Z, Y, X, 3) at points (..., 3) as x, y, z: linear, clamped."""
    where = np.moveaxis(np.clip(at, 0, np.array(field.shape[2::-1]) - 1), -1, 0)[::-1]
    return np.stack([ndimage.map_coordinates(field[..., c], where, order=1) for c in range(3)], -1)


def coherent_reference(points: np.ndarray, similar: np.ndarray, exemplar: tuple[int, ...], queries: np.ndarray,
                       sites: np.ndarray, legs: np.ndarray, grid: tuple[int, int, int],
                       match: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Specification of `coherent_solid`; exemplar (rows, columns) or (layers, rows, columns), grid (K, J, I)."""
    best, distance = np.zeros(len(sites), int), np.zeros(len(sites))
    for s in range(len(sites)):
        here = np.array(np.unravel_index(s, grid))
        candidates: set[int] = set()
        for step in np.concatenate([np.zeros((1, 3), int), np.eye(3, dtype=int), -np.eye(3, dtype=int)]):
            there = here + step
            if (there < 0).any() or (there >= grid).any():
                continue
            n = int(np.ravel_multi_index(tuple(there), grid))
            way = np.rint(legs[s] @ (sites[s] - sites[n]))[: len(exemplar)].astype(int)
            cell = (np.array(np.unravel_index(int(match[n]), exemplar)) + way[::-1]) % exemplar
            candidates.update(similar[np.ravel_multi_index(tuple(cell), exemplar)].tolist())
        choice = np.array(sorted(candidates))
        squared = ((queries[s] - points[choice]).astype(np.float64) ** 2).sum(1)
        best[s], distance[s] = choice[squared.argmin()], squared.min()
    return best, distance


def shown_reference(exemplar: np.ndarray, at: np.ndarray) -> np.ndarray:
    """What an exemplar holds at points (P, 2 or 3), toroidal: Catmull-Rom of a picture, linear of a volume."""
    if exemplar.ndim == 3:
        return sample_reference(exemplar, at[:, :2], toroidal=True)
    return np.stack([ndimage.map_coordinates(exemplar[..., c], at.T[::-1], order=1, mode="grid-wrap")
                     for c in range(3)], -1)


def average_reference(eye: Eye, position: np.ndarray, weight: np.ndarray, sites: np.ndarray, legs: np.ndarray,
                      field: np.ndarray, eight: bool) -> np.ndarray:
    """Specification of `average`: what one view makes of each voxel (Z, Y, X, 3), site by site."""
    step = neighborhood.spacing(eye.width)
    sums, totals = np.zeros((*field.shape[:3], eye.view.dimension)), np.zeros(field.shape[:3])
    for s, (way, o) in enumerate(_offsets(sites, legs, field.shape[:3])):
        share = 1 - o**2 / (step + 1) ** 2
        volume = eye.view.dimension == 3
        depth = share[..., 2] if volume else 1 - np.abs(o[..., 2]) / float(eye.slab)
        if eight:
            w = np.maximum(share[..., 0], 0.1) * np.maximum(share[..., 1], 0.1) * np.maximum(depth, 0.1)
            w *= _among_eight(way, sites[s], sites, step)
        else:
            w = share[..., 0] * share[..., 1] * depth
            w *= (np.abs(o[..., : 3 if volume else 2]).max(-1) <= step + 0.001) & (depth > 0)
        w = w * weight[s]
        at = position[s, : eye.view.dimension] + o[..., : eye.view.dimension]
        shown = shown_reference(eye.exemplar, at.reshape(-1, eye.view.dimension)).reshape(sums.shape)
        sums += w[..., None] * shown
        totals += w
    there = field @ eye.view.projection.T
    mean = np.where(totals[..., None] > 0, sums / np.maximum(totals, 1e-30)[..., None], there)
    return (mean @ eye.matrix.T).astype(np.float32)


def nearest_reference(eye: Eye, position: np.ndarray, sites: np.ndarray, legs: np.ndarray,
                      average: np.ndarray) -> np.ndarray:
    """Specification of `nearest`: of the eight matches round a voxel the one most similar to the average there."""
    step, dimension = neighborhood.spacing(eye.width), eye.view.dimension
    mean = average @ eye.view.projection.T
    best, least = np.zeros_like(mean), np.full(average.shape[:3], np.inf)
    for s, (way, o) in enumerate(_offsets(sites, legs, average.shape[:3])):
        at = position[s, :dimension] + o[..., :dimension]
        shown = shown_reference(eye.exemplar, at.reshape(-1, dimension)).reshape(mean.shape)
        d = np.where(_among_eight(way, sites[s], sites, step), np.sum((shown - mean) ** 2, -1), np.inf)
        best = np.where((d < least)[..., None], shown, best)
        least = np.minimum(d, least)
    return (best @ eye.matrix.T).astype(np.float32)


def _offsets(sites: np.ndarray, legs: np.ndarray,
             shape: tuple[int, ...]) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """For each site the way (Z, Y, X, 3) from it to every cell, and the same along its legs."""
    cells = np.stack(np.meshgrid(*(np.arange(n) for n in shape), indexing="ij")[::-1], -1)
    for site, leg in zip(sites, legs, strict=True):
        yield cells - site, (cells - site) @ leg.T


def _among_eight(way: np.ndarray, site: np.ndarray, sites: np.ndarray, step: int) -> np.ndarray:
    """Which cells (Z, Y, X) have this site at a corner of the cube of sites that holds them, or lie beyond the last."""
    first, last = sites.min(0), sites.max(0)
    near = np.abs(way) < step
    beyond = ((site == first) & (way <= 0)) | ((site == last) & (way >= 0))
    # a cell on a plane of sites looks forward too
    behind = (way == -step) & (site > first)
    return np.all(near | beyond | behind, axis=-1)


def carry_reference(H: np.ndarray, displacement: np.ndarray) -> np.ndarray:
    """Specification of `carry_solid`: H (Z, Y, X, 3) at each cell + displacement (Z, Y, X, 3), Catmull-Rom, clamped."""
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
