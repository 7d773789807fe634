"""Detail at samples that move with the flow instead of on a grid (ma09 §5: "our method is equally applicable to
Lagrangian particles", as texture synthesis over meshes [Turk 2001; Wei and Levoy 2001] is to that over pixels).

Each level of the pyramid has its own samples, about one to a cell. They are carried by L and keep their detail
unchanged, so nothing is resampled or blurred from frame to frame; where the flow crowds them some are removed, where it
thins them new ones are added. Search and assignment are those of `synth.motion.detail`: neighbourhoods are centred at
some of the samples, interpolate between the samples by moving least squares, and find their best match by the same
search; each sample becomes the weighted average of the matches that cover it.

    p  sample, at `at` cells of its level      e  local x axis      o  offset along local axes, in cells
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from synth import opencl
from synth.advect import departure
from synth.motion import detail, initialize, neighborhood
from synth.motion.assignment import falloff, robust_weights, sample_reference
from synth.motion.detail import COHERENCE, DEFORMED, MARGIN, Level, Settings, deformation, distance_inland

# how far samples see each other, in cells of their level; nearer ones weigh more, within sqrt(NEAR) all the same
REACH = 1.6
NEAR = 0.02
# of two samples nearer than CROWDED one is removed; a cell with no sample within THIN gets one
CROWDED = 0.4
THIN = 0.8
# the kernel reads eight samples at a time: so many of padding follow the last
TOGETHER = 8


@dataclass(frozen=True)
class Bins:
    """Points of a domain of `shape` (Y, X) cells sorted into square bins of `edge` cells.

    order (P,) is the order of the points by bin, `first` (bins + 1,) int32 where each bin begins in it.
    """

    order: np.ndarray
    first: np.ndarray
    count: tuple[int, int]

    @property
    def size(self) -> np.ndarray:
        return np.array(self.count[::-1], np.int32)


def bins(at: np.ndarray, shape: tuple[int, int], edge: float) -> Bins:
    """The bins of points at (P, 2) as x, y; points of one bin stay in their order."""
    count = (max(1, int(np.ceil(shape[0] / edge))), max(1, int(np.ceil(shape[1] / edge))))
    cell = np.clip((at / np.float32(edge)).astype(int), 0, np.array(count[::-1]) - 1)
    number = cell[:, 1] * count[1] + cell[:, 0]
    first = np.zeros(count[0] * count[1] + 1, np.int32)
    np.cumsum(np.bincount(number, minlength=len(first) - 1), out=first[1:])
    return Bins(np.argsort(number, kind="stable"), first, count)


def gather_reference(at: np.ndarray, value: np.ndarray, sites: np.ndarray, axis: np.ndarray, radius: int,
                     shape: tuple[int, int]) -> np.ndarray:
    """Specification of `Cloud.gather`: samples at (P, 2) of value (P, 2); the rest as there, (S, (2r+1)^2 * 2)."""
    span = np.arange(-radius, radius + 1)
    j, i = (grid.reshape(-1) for grid in np.meshgrid(span, span, indexing="ij"))
    out = np.zeros((len(sites), len(i), 2))
    for s, (centre, e) in enumerate(zip(sites, axis, strict=True)):
        points = np.clip(centre + np.stack([e[0] * i - e[1] * j, e[1] * i + e[0] * j], -1), 0,
                         np.array(shape[::-1]) - 1)
        for n, point in enumerate(points):
            offset = (at - point).astype(np.float64)
            squared = (offset**2).sum(-1)
            w = np.maximum(1 - squared / REACH**2, 0) ** 2 / (squared + NEAR)
            if w.sum() == 0:
                continue
            w = w / w.sum()
            mean, middle = w @ value, w @ offset
            spread = (offset - middle).T @ (w[:, None] * (offset - middle)) + NEAR * np.eye(2)
            slopes = np.linalg.solve(spread, (offset - middle).T @ (w[:, None] * (value - mean)))
            out[s, n] = mean - middle @ slopes
    return out.reshape(len(sites), -1).astype(np.float32)


def assign_reference(exemplar: np.ndarray, radius: int, sites: np.ndarray, position: np.ndarray, weight: np.ndarray,
                     axis: np.ndarray, at: np.ndarray, prior: np.ndarray, coherence: np.ndarray) -> np.ndarray:
    """Specification of `assign`; arguments as there."""
    sums, totals = np.zeros(prior.shape), np.zeros(len(at))
    for s in range(len(sites)):
        offset, e = at - sites[s], axis[s]
        o = np.stack([e[0] * offset[:, 0] + e[1] * offset[:, 1], e[0] * offset[:, 1] - e[1] * offset[:, 0]], -1)
        covered = np.abs(o).max(axis=-1) <= radius
        g = weight[s] * np.exp(-falloff(radius) * (o[covered] ** 2).sum(-1))
        sums[covered] += g[:, None] * sample_reference(exemplar, position[s] + o[covered], toroidal=True)
        totals[covered] += g
    mean = sums / np.where(totals > 0, totals, 1)[:, None]
    held = (mean + coherence[:, None] * prior) / (1 + coherence[:, None])
    return np.where(totals[:, None] > 0, held, prior).astype(np.float32)


def _program(radius: int, edge: float) -> Any:
    return opencl.program(Path(__file__).with_suffix(".cl"), RADIUS=radius, BORDER=radius + 3, BIN=f"{edge}f",
                          REACH=f"{REACH}f", NEAR=f"{NEAR}f")


@dataclass(frozen=True)
class Cloud:
    """Samples at (P, 2) float32, x, y in cells of a domain of `shape` (Y, X), sorted by bins of REACH: see `cloud`."""

    at: np.ndarray
    sorted: Bins
    shape: tuple[int, int]

    @cached_property
    def _device(self) -> tuple[Any, Any]:
        return opencl.to_device(_followed(self.at)), opencl.to_device(self.sorted.first)

    def gather(self, value: Any, sites: np.ndarray, axis: np.ndarray, radius: int) -> Any:
        """Oriented neighbourhoods of the samples' value (P, 2) at sites (S, 2), their x axes along axis (S, 2).

        The planes of moving least squares. value (P + TOGETHER, 2) on the device, device array (S, (2r+1)^2 * 2) out;
        rows are added as by `Space.gather`.
        """
        count, together = len(sites), neighborhood.SITES_TOGETHER
        out = opencl.empty((-(-count // together) * together, 2 * (2 * radius + 1) ** 2))
        at, first = self._device
        _program(radius, REACH).gather(
            (count,), (1,), at, value, first, self.sorted.size, np.array(self.shape[::-1], np.int32),
            opencl.to_device(sites), opencl.to_device(axis), out)
        return out

    def values_at(self, value: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Value (P, 2) of the samples at points (Q, 2): (Q, 2) float32."""
        ahead = np.broadcast_to(np.array([1, 0], np.float32), points.shape)
        return self.gather(opencl.to_device(_followed(value)), points.astype(np.float32), ahead, 0).get()[:len(points)]

    def on_grid(self, value: np.ndarray) -> np.ndarray:
        """Value (P, 2) of the samples at the cells of the domain: (Y, X, 2) float32."""
        return self.values_at(value, _cells(self.shape)).reshape(*self.shape, 2)


def _followed(values: np.ndarray) -> np.ndarray:
    """Values (P, 2) of samples, and TOGETHER zeros."""
    return np.pad(values, ((0, TOGETHER), (0, 0)))


def cloud(at: np.ndarray, shape: tuple[int, int]) -> tuple[Cloud, np.ndarray]:
    """The samples at (P, 2), sorted, and their order: what belongs to them is to be sorted alike."""
    sorted_ = bins(at, shape, REACH)
    return Cloud(np.ascontiguousarray(at[sorted_.order], np.float32), sorted_, shape), sorted_.order


def assign(exemplar: np.ndarray, radius: int, sites: np.ndarray, position: Any, weight: Any, axis: np.ndarray,
           shape: tuple[int, int], samples: Cloud, prior: Any, coherence: Any) -> Any:
    """Least squares (Eq. 1) at the samples: the minimum over x of sum_p w_p |x_p - z_p|^2 + O(x), as on a grid.

    exemplar (N, M, 2); sites (S, 2) sorted by `site_bins`; position (S, 2) of their matches in the exemplar, weight
    (S,), axis (S, 2); prior (P + TOGETHER, 2), coherence (P,) of the samples. position, weight, prior and coherence are
    device arrays; a device array like prior out.
    """
    border = radius + 3
    padded = np.pad(exemplar, ((border, border), (border, border), (0, 0)), mode="wrap")
    standing = site_bins(sites, shape, radius)
    out = opencl.zeros(prior.shape)
    _program(radius, _site_edge(radius)).assign(
        (len(samples.at),), None, opencl.to_device(padded), np.int32(padded.shape[1]), np.float32(falloff(radius)),
        opencl.to_device(sites), position, weight, opencl.to_device(axis), opencl.to_device(standing.first),
        standing.size, opencl.to_device(samples.at), prior, coherence, out)
    return out


def _site_edge(radius: int) -> float:
    """The edge of a bin of sites: no neighbourhood, however rotated, reaches beyond the adjacent bins."""
    return float(np.ceil(np.sqrt(2) * radius))


def site_bins(sites: np.ndarray, shape: tuple[int, int], radius: int) -> Bins:
    """The bins in which `assign` looks for sites (S, 2)."""
    return bins(sites, shape, _site_edge(radius))


def _cells(shape: tuple[int, int]) -> np.ndarray:
    """The cells of `shape` as x, y, row by row: (Y X, 2) float32."""
    return np.stack(np.meshgrid(np.arange(shape[1]), np.arange(shape[0])), -1).reshape(-1, 2).astype(np.float32)


def _at_points(field: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Linear samples of field (Y, X[, C]) at points (P, 2), clamped: (P[, C]) float32."""
    where = [points[:, 1], points[:, 0]]
    if field.ndim == 2:
        return ndimage.map_coordinates(field, where, np.float32, order=1, mode="nearest")
    return np.stack([_at_points(field[..., c], points) for c in range(field.shape[-1])], -1)


def seeded(shape: tuple[int, int], random: np.random.Generator) -> np.ndarray:
    """One sample to each cell of `shape`, anywhere in its middle half: (Y X, 2) float32."""
    cells = _cells(shape)
    return np.clip(cells + random.uniform(-0.25, 0.25, cells.shape), 0, np.array(shape[::-1]) - 1).astype(np.float32)


def chosen(at: np.ndarray, rank: np.ndarray, spacing: int) -> np.ndarray:
    """Samples at which neighbourhoods are centred, about one in spacing^2: of the lowest rank nearby. Indices (S,).

    Ranks stay with their samples, so the neighbourhoods move with the flow too.
    """
    if spacing == 1:
        return np.arange(len(at))
    pairs = cKDTree(at).query_pairs(spacing / np.sqrt(np.pi), output_type="ndarray")
    lower = rank[pairs[:, 0]] < rank[pairs[:, 1]]
    stands = np.ones(len(at), bool)
    stands[np.where(lower, pairs[:, 1], pairs[:, 0])] = False
    return np.flatnonzero(stands)


def crowded(at: np.ndarray, rank: np.ndarray) -> np.ndarray:
    """Which samples (P,) have another of lower rank nearer than CROWDED."""
    pairs = cKDTree(at).query_pairs(CROWDED, output_type="ndarray")
    lower = rank[pairs[:, 0]] < rank[pairs[:, 1]]
    crowds = np.zeros(len(at), bool)
    crowds[np.where(lower, pairs[:, 1], pairs[:, 0])] = True
    return crowds


def thin(at: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """The cells of `shape`, as x, y, that have no sample nearer than THIN: (Q, 2) float32."""
    cells = _cells(shape)
    return cells[cKDTree(at).query(cells)[0] > THIN]


@dataclass(frozen=True)
class State:
    """All that the next frame needs, of each level, coarsest first: its samples, with their margins.

    at (P, 2) float32, cells of the level and its margin; H (P, 2) float32; rank (P,) float64; axes (Y, X, 2), the
    local axes of its grid; `number` holds the number of the frame once.
    """

    at: list[np.ndarray]
    H: list[np.ndarray]
    rank: list[np.ndarray]
    axes: list[np.ndarray]
    number: list[np.ndarray]


class Synthesis(detail.Synthesis):
    """Synthesizes H at moving samples, frame by frame; arguments as `detail.Synthesis`, search "exact" only."""

    def __init__(self, exemplar: np.ndarray, shape: tuple[int, int], settings: Settings, seed: int):
        if settings.search != "exact":
            raise ValueError("moving samples have no fixed neighbours, which k-coherence needs: use search = \"exact\"")
        super().__init__(exemplar, shape, settings, seed)

    def frame(self, L: np.ndarray, state: State | None) -> State:  # type: ignore[override]
        """The state after the frame with coarse motion L (Y, X, 2) cells per frame; None before the first."""
        motions, axes = self.motions(L)
        number = 1 if state is None else int(state.number[0]) + 1
        # counter-based: what is drawn depends on seed, frame and level only
        randoms = [np.random.Generator(np.random.Philox(key=[self.seed, (number << 8) + 128 + level]))
                   for level in range(len(self.levels))]
        levels = self._first_samples(axes, randoms) if state is None else self._moved(motions, axes, state, randoms)
        at, H, rank = (list(parts) for parts in zip(*levels, strict=True))
        return State(at, H, rank, axes, [np.array(number)])

    def _first_samples(self, axes: list[np.ndarray],
                       randoms: list[np.random.Generator]) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """at, H and rank of each level of the first frame: the coarsest from a mosaic, each other from the last."""
        coarser: tuple[Cloud, np.ndarray] | None = None
        for level, local, random in zip(self.levels, axes, randoms, strict=True):
            samples, _ = cloud(seeded(local.shape[:2], random), local.shape[:2])
            rank = random.random(len(samples.at))
            if coarser is None:
                H = _at_points(self._start(local), samples.at)
            else:
                H = coarser[0].values_at(coarser[1], _coarser(samples.at))
            H = _reseeded(samples, H, level, local)
            H = optimize(level, samples, H, rank, local, level.settings.iterations)
            coarser = samples, H
            yield samples.at, H, rank

    def _moved(self, motions: list[np.ndarray], axes: list[np.ndarray], state: State,
               randoms: list[np.random.Generator]) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """at, H and rank of each level of a later frame, by the steps of `detail.Synthesis._next`."""
        coarser: tuple[Cloud, np.ndarray, np.ndarray] | None = None
        for i, level in enumerate(self.levels):
            local, offset = axes[i], departure(motions[i])
            samples, H, rank = carried(state.at[i], state.H[i], state.rank[i], motions[i], randoms[i])
            inland = _at_points(np.minimum(distance_inland(offset), MARGIN), samples.at)
            flowed = H
            if coarser is not None:  # add what the coarser level changed; where content flowed in, take all of it
                above, whole, change = coarser
                at = _coarser(samples.at)
                H = np.where(inland[:, None] < 1, above.values_at(whole, at), H + above.values_at(change, at))
            H = _reseeded(samples, H, level, local)
            bent = _at_points(deformation(offset, state.axes[i], local), samples.at) / DEFORMED
            hold = COHERENCE / (1 + bent**2) * (inland / MARGIN)
            H = optimize(level, samples, H, rank, local, level.settings.few, hold)
            coarser = samples, H, H - flowed
            yield samples.at, H, rank

    def visible(self, state: State) -> np.ndarray:  # type: ignore[override]
        """H (Y, X, 2) of a state at the cells of the output."""
        samples, order = cloud(state.at[-1], (self.shape[0] + 2 * MARGIN, self.shape[1] + 2 * MARGIN))
        return samples.values_at(state.H[-1][order], _cells(self.shape) + np.float32(MARGIN)).reshape(*self.shape, 2)

    def samples(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        """The samples of the output: where, (P, 2) in its cells as x, y, and H there (P, 2)."""
        at = state.at[-1] - np.float32(MARGIN)
        inside = ((at >= -0.5) & (at <= np.array(self.shape[::-1]) - 0.5)).all(axis=1)
        return at[inside], state.H[-1][inside]


def carried(at: np.ndarray, H: np.ndarray, rank: np.ndarray, motion: np.ndarray,
            random: np.random.Generator) -> tuple[Cloud, np.ndarray, np.ndarray]:
    """Samples at (P, 2) with H (P, 2) and rank (P,) after a frame of motion (Y, X, 2), cells; evenly spread again.

    By the midpoint rule. Samples that leave the domain or are crowded are removed; thin places are filled, their H
    fitted to the samples around (at an inflow, where there are none, the nearest sample's).
    """
    shape = (motion.shape[0], motion.shape[1])
    moved = at + _at_points(motion, at + 0.5 * _at_points(motion, at))
    last = np.array(shape[::-1], np.float32) - 1
    stays = ((moved >= -0.5) & (moved <= last + 0.5)).all(axis=1)
    moved, H, rank = moved[stays], H[stays], rank[stays]
    uncrowded = ~crowded(moved, rank)
    moved, H, rank = moved[uncrowded], H[uncrowded], rank[uncrowded]
    new = thin(moved, shape)
    new = np.clip(new + random.uniform(-0.25, 0.25, new.shape), 0, last).astype(np.float32)
    before, order = cloud(moved, shape)
    nearest, index = cKDTree(moved).query(new)
    filled = np.where((nearest < 0.9 * REACH)[:, None], before.values_at(H[order], new), H[index])
    samples, order = cloud(np.concatenate([moved, new]), shape)
    return samples, np.concatenate([H, filled])[order], np.concatenate([rank, random.random(len(new))])[order]


def optimize(level: Level, samples: Cloud, H: np.ndarray, rank: np.ndarray, axes: np.ndarray, iterations: int,
             coherence: np.ndarray | None = None) -> np.ndarray:
    """Search and assign at the samples, `iterations` times with each width of neighbourhoods, as `Level.optimize`.

    H (P, 2), rank (P,) and coherence (P,) of the samples, axes (Y, X, 2) of the grid. Returns H (P, 2).
    """
    x = prior = opencl.to_device(_followed(H))
    hold = opencl.to_device(np.zeros(len(H), np.float32) if coherence is None else coherence.astype(np.float32))
    for width, matcher, _ in level.steps:
        radius = width // 2
        sites = samples.at[chosen(samples.at, rank, neighborhood.spacing(width))]
        sites = sites[site_bins(sites, samples.shape, radius).order]
        axis = _axes(axes, sites)
        for _ in range(iterations):
            queries = matcher.space.compare(samples.gather(x, sites, axis, radius), len(sites))
            z, squared = matcher.exact(queries)
            weights = robust_weights(squared, matcher.space.length, level.rms)
            x = assign(level.exemplar, radius, sites, matcher.refine(queries, z), weights, axis, samples.shape,
                       samples, prior, hold)
    return np.asarray(x.get()[:len(H)])


def _axes(axes: np.ndarray, points: np.ndarray) -> np.ndarray:
    """The local x axes (P, 2) at points (P, 2) of the grid's (Y, X, 2); of the nearest cell where they cancel."""
    e = _at_points(axes, points)
    length = np.linalg.norm(e, axis=-1, keepdims=True)
    cell = np.clip(np.rint(points).astype(int), 0, np.array(axes.shape[1::-1]) - 1)
    return np.where(length > 0.1, e / np.maximum(length, 0.1), axes[cell[:, 1], cell[:, 0]]).astype(np.float32)


def _coarser(at: np.ndarray) -> np.ndarray:
    """Points (P, 2) of one level, with margin, in the cells of the next coarser one, with margin."""
    return at * np.float32(0.5) + np.float32(MARGIN / 2 - 0.25)


def _reseeded(samples: Cloud, H: np.ndarray, level: Level, axes: np.ndarray) -> np.ndarray:
    """H (P, 2) with a whole exemplar placed wherever it has run empty, as by `initialize.reseed`."""
    grid = samples.on_grid(H)
    # interpolation flattens the finest waves; that does not make a place empty
    grid *= np.sqrt(np.mean(H**2) / max(float(np.mean(grid**2)), 1e-12))
    sown = initialize.reseed(grid, level.exemplar, axes)
    changed = (sown != grid).any(axis=-1)
    if not changed.any():
        return H
    new = _at_points(changed.astype(np.float32), samples.at) > 0.5
    return np.where(new[:, None], _at_points(sown, samples.at), H)
