"""The search step (ma13 §4.1, §4.2): for each output sample the N exemplar samples with the nearest neighbourhoods.

The distance is Eq. 9, over tied samples by their offsets and over the others by the Hungarian algorithm. A sample that
is left without a partner counts as if its partner stood on the rim of the neighbourhood, as far out as it is from it:
so neighbourhoods of different numbers compare, and the distance does not jump when a sample comes in over the rim
(§4.2 names that jump as a cause of jitter).

`Searcher.nearest` asks all of a small exemplar, or the candidates of k-coherence [Tong et al. 2002]; both in OpenCL.
`nearest_reference` says in NumPy and SciPy what the kernel computes.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree

from synth import opencl
from synth.elements import neighborhood
from synth.elements.neighborhood import Shape
from synth.elements.samples import Elements

SOURCE = Path(__file__).with_suffix(".cl")
CANDIDATES = 24  # of k-coherence, at most
SIMILAR = 3  # of the exemplar's samples most like each
DESCRIPTOR = 12  # numbers in which the exemplar's own neighbourhoods are first compared
FIRST_FOUND = 16  # of these, by the descriptor, the most similar are taken by the distance itself


@dataclass(frozen=True)
class Exemplar:
    """An exemplar, ready for the search: the neighbourhoods of its M samples, M = T·E·S, in local frames.

    neighbors  (M, B·K) int32, -1 for none: the other samples, in the order of the arrays below
    other      (M, B·K, D) float32: their û; falloff (M, B·K) κ; alone (M, B·K) cost of having no partner
    others     (M, B) int32: how many there are in each of the B frames
    tied       (M, F, D) float32: û of the tied samples; tie (M, F) int8: which are there
    detail     (M, D) float32: q
    control    (M,) float32, label (M,) int32 with one bit set: what maps of the output choose by
    """

    elements: Elements
    shape: Shape
    axes: np.ndarray | None
    offsets: np.ndarray
    neighbors: np.ndarray
    other: np.ndarray
    falloff: np.ndarray
    alone: np.ndarray
    others: np.ndarray
    tied: np.ndarray
    tie: np.ndarray
    detail: np.ndarray
    control: np.ndarray
    label: np.ndarray

    @property
    def anchored(self) -> bool:
        """Whether details stand on a coarse position of their own, so that q itself can be compared."""
        return self.elements.coarse is not None


def exemplar(elements: Elements, shape: Shape, frames: np.ndarray | None = None, period: np.ndarray | None = None,
             control: np.ndarray | None = None) -> Exemplar:
    """The neighbourhoods of all samples of an exemplar.

    frames   (T·E·S, D, D) local frames R, None: not turned
    period   (D,) of a toroidal exemplar, 0 along axes that do not repeat
    control  (E,) of each element, for a control map; default 0
    Its label is the bit of its elements' kind.
    """
    offsets = neighborhood.tied(shape, elements.grid)
    found = found_others(elements, shape, np.arange(elements.frames), period)
    position = elements.positions.reshape(-1, elements.dimensions)
    away = difference(position[np.maximum(found, 0)] - position[:, None], period)
    if frames is not None:
        away = np.einsum("nji,nkj->nki", frames, away)
    there = found >= 0
    squared = np.sum(away**2, axis=-1)
    time = np.repeat(np.array(shape.times, np.float32), shape.most)
    falloff = np.where(there, shape.falloff(squared, time), 0).astype(np.float32)
    alone = falloff * np.maximum(0, shape.radius - np.sqrt(squared)) ** 2
    detail = neighborhood.details(elements, frames)
    at = neighborhood.at_offsets(elements, offsets)
    tied = np.where((at >= 0)[..., None], detail[np.maximum(at, 0)] - detail[:, None], 0)
    controls = np.zeros(elements.count) if control is None else control
    return Exemplar(
        elements, shape, frames, offsets, found, np.where(there[..., None], away, 0).astype(np.float32), falloff,
        alone.astype(np.float32), there.reshape(len(found), -1, shape.most).sum(axis=2).astype(np.int32),
        tied.astype(np.float32), (at >= 0).astype(np.int8), detail.astype(np.float32),
        _of_samples(elements, controls).astype(np.float32),
        _of_samples(elements, 1 << (elements.kind % 31)).astype(np.int32))


def _of_samples(elements: Elements, values: np.ndarray) -> np.ndarray:
    """Values of elements (E,) as values of their samples (T·E·S,)."""
    return np.tile(np.repeat(values, elements.positions.shape[2]), elements.frames)


def found_others(elements: Elements, shape: Shape, active: np.ndarray, period: np.ndarray | None) -> np.ndarray:
    """`neighborhood.others`, but none on sheets: "we forgo our element-based neighborhood collection" (§3.2)."""
    if elements.topology == "sheet":
        size = elements.positions.shape[1] * elements.positions.shape[2]
        return np.full((len(active) * size, len(shape.times) * shape.most), -1, np.int32)
    return neighborhood.others(elements.positions, shape, active, period)


def difference(away: np.ndarray, period: np.ndarray | None) -> np.ndarray:
    """The shortest way between two points of a toroidal domain: `away` (…, D) with whole periods taken out."""
    if period is None:
        return away
    with np.errstate(divide="ignore", invalid="ignore"):
        turns = np.where(period > 0, np.rint(away / period), 0)
    return (away - turns * period).astype(np.float32)


@dataclass(frozen=True)
class Output:
    """What the search looks at in the output, M = T·E·S samples.

    positions  (T, E, S, D) float32
    detail     (M, D) float32: q, or for elements without coarse positions the way not explained by the flow
    frames     (M, D, D) float32 or None
    known      frames from the first that are synthesized; later ones are not looked at
    period     (D,) or None
    control    (M,) float32: the control map where each sample is
    allowed    (M,) int32: bits of the labels it may match
    """

    positions: np.ndarray
    detail: np.ndarray
    frames: np.ndarray | None
    known: int
    period: np.ndarray | None
    control: np.ndarray
    allowed: np.ndarray


@dataclass
class Matches:
    """Of each of the M output samples, N matches, the nearest first.

    sample  (M, N) int32, -1 for none yet; apart (M, N) float32: their squared distances
    slot    (M, N, B·K) int32: to which place in the match's own list each other sample is matched, -1: to none
    neighbors  (M, B·K) int32: those other samples
    """

    sample: np.ndarray
    apart: np.ndarray
    slot: np.ndarray
    neighbors: np.ndarray

    @staticmethod
    def none(count: int, n: int, shape: Shape) -> Matches:
        """No match yet."""
        many = len(shape.times) * shape.most
        return Matches(np.full((count, n), -1, np.int32), np.full((count, n), np.inf, np.float32),
                       np.full((count, n, many), -1, np.int32), np.full((count, many), -1, np.int32))


class Searcher:
    """The search in one exemplar, on the device.

    n          how many matches (§4.2: 2)
    coherent   k-coherence; else every sample of the exemplar is looked at
    centre     weight of the difference of q itself, where the exemplar is anchored
    control    weight of the control map's difference
    """

    def __init__(self, within: Exemplar, n: int, coherent: bool, centre: float = 0.0, control: float = 0.0):
        self.within, self.n, self.coherent = within, n, coherent
        self.centre = centre if within.anchored else 0.0
        self.control = control
        # a tied sample that one side lacks counts as one spacing's half away
        self.missing = 0.25 * neighborhood_spacing(within) ** 2
        self._arrays = [opencl.to_device(a) for a in (
            within.other, within.falloff, within.alone, within.others, within.tied, within.tie, within.detail,
            within.control, within.label)]
        if coherent:
            self._similar = opencl.to_device(similar(within))
            self._in_neighbors = opencl.to_device(within.neighbors)

    def nearest(self, output: Output, active: np.ndarray, matches: Matches) -> None:
        """Find anew the matches of the samples in the frames `active`, in place.

        matches.neighbors of all frames that have been searched before are those of then.
        """
        shape, size = self.within.shape, output.positions.shape[1] * output.positions.shape[2]
        samples = (active[:, None] * size + np.arange(size)).ravel().astype(np.int32)
        elements = Elements(output.positions[: output.known], self.within.elements.grid)
        many = CANDIDATES if self.coherent else 0
        program = self._program(output.positions.shape, many)
        candidates = opencl.empty((len(samples), max(many, 1)), np.int32)
        offsets = opencl.to_device(np.vstack([self.within.offsets, [[0, 0, 0]]]).astype(np.int32))
        device_samples = opencl.to_device(samples)
        if self.coherent:
            program.coherent((len(samples),), None, device_samples, opencl.to_device(matches.neighbors),
                             opencl.to_device(matches.sample), opencl.to_device(matches.slot), offsets,
                             self._in_neighbors, self._similar, candidates)
        matches.neighbors[samples] = found_others(elements, shape, active, output.period)
        dims = output.positions.shape[3]
        found = [opencl.empty((len(samples), self.n), np.int32), opencl.empty((len(samples), self.n)),
                 opencl.empty((len(samples), self.n, matches.slot.shape[2]), np.int32)]
        program.nearest(
            (len(samples),), None, device_samples, opencl.to_device(output.positions),
            opencl.to_device(output.detail),
            opencl.to_device(np.zeros(1, np.float32) if output.frames is None else output.frames),
            np.int32(output.frames is not None), np.int32(output.known),
            opencl.to_device(np.zeros(dims, np.float32) if output.period is None else
                             output.period.astype(np.float32)),
            opencl.to_device(matches.neighbors[samples]), offsets,
            opencl.to_device(np.array(shape.times, np.int32)), opencl.to_device(tied_weight(self.within)),
            opencl.to_device(output.control[samples].astype(np.float32)),
            opencl.to_device(output.allowed[samples].astype(np.int32)),
            np.float32(shape.radius), np.float32(shape.sigma),
            opencl.to_device(shape.falloff(0.0, np.array(shape.times)).astype(np.float32)),
            np.float32(self.centre), np.float32(self.control), np.float32(self.missing), *self._arrays, candidates,
            *found)
        for name, values in zip(("sample", "apart", "slot"), found, strict=True):
            getattr(matches, name)[samples] = values.get()

    def _program(self, output: tuple[int, ...], candidates: int) -> opencl.Program:
        frames, count, samples, dims = self.within.elements.positions.shape
        columns = self.within.elements.grid[-1] if self.within.elements.grid else 1
        return opencl.program(
            SOURCE, D=dims, K=self.within.shape.most, B=len(self.within.shape.times), F=len(self.within.offsets),
            N=self.n, C=candidates, SIMILAR=SIMILAR, ROWS=samples // columns, COLUMNS=columns, SAMPLES=samples,
            FRAMES=output[0], COUNT=output[1], IN_FRAMES=frames, IN_COUNT=count)


def neighborhood_spacing(within: Exemplar) -> float:
    """The typical û² of neighbours, as a length: what a missing one is measured by."""
    tied = np.linalg.norm(within.tied, axis=-1)[within.tie > 0]
    return float(np.median(tied)) if tied.size and tied.any() else within.shape.radius / 2


def tied_weight(within: Exemplar) -> np.ndarray:
    """Weights of the tied samples, (F,) float32 (at least one): κ by time, since an offset along an element is not a
    distance in space; and in time what makes a motion count.

    The way of a sample in a few frames is small beside the distances to its neighbours, and would say nothing beside
    them. So its square is measured by the exemplar's own mean square of such ways, and that of a neighbourhood's radius
    by shape.motion: at 1 a motion as unlike as two of the exemplar's counts as a neighbour that is a radius away.
    Elements of an exemplar at rest should only go with the flow: shape.at_rest.
    """
    shape, offsets = within.shape, within.offsets
    weight = np.ones(len(offsets) + 1)
    weight[:-1] = shape.falloff(0.0, offsets[:, 0])
    trail = offsets[:, 0] != 0
    there = within.tie[:, trail] > 0
    ways = np.sum(within.tied[:, trail].astype(np.float64) ** 2, axis=-1)[there]
    typical = float(ways.mean()) if ways.size else 0.0
    if typical > 0:
        weight[:-1][trail] *= max(1.0, shape.motion * shape.radius**2 / typical)
    elif within.elements.frames == 1:
        weight[:-1][trail] *= shape.at_rest
    return weight.astype(np.float32)


def similar(within: Exemplar) -> np.ndarray:
    """Of each exemplar sample the SIMILAR others with the nearest neighbourhoods, (M, SIMILAR) int32.

    Found among the FIRST_FOUND nearest by a short descriptor: the tied û, the others sorted by distance, and q, thrown
    onto DESCRIPTOR random directions.
    """
    shape, count = within.shape, len(within.detail)
    distance = np.where(within.falloff > 0, np.linalg.norm(within.other, axis=-1), shape.radius)
    numbers = np.concatenate([within.tied.reshape(count, -1), distance, within.detail if within.anchored else
                              np.zeros((count, 0))], axis=1)
    rng = np.random.Generator(np.random.Philox(key=count))
    # einsum, not a BLAS: the same bits at any number of threads
    thrown = np.einsum("mn,nd->md", numbers, rng.normal(size=(numbers.shape[1], DESCRIPTOR)))
    _, found = cKDTree(thrown).query(thrown, k=min(FIRST_FOUND + 1, count))
    found = np.asarray(found).reshape(count, -1)
    result = np.full((count, SIMILAR), -1, np.int32)
    apart = np.full(found.shape, np.inf)
    for c in range(found.shape[1]):
        other = found[:, c]
        apart[:, c] = np.sum((within.tied - within.tied[other]) ** 2, axis=(1, 2)) + np.sum(
            (distance - distance[other]) ** 2, axis=1)
    apart[found == np.arange(count)[:, None]] = np.inf
    order = np.argsort(apart, axis=1, kind="stable")[:, :SIMILAR]
    nearest = np.where(np.isfinite(np.take_along_axis(apart, order, axis=1)),
                       np.take_along_axis(found, order, axis=1), -1)
    result[:, : nearest.shape[1]] = nearest
    return result


def matched(cost: np.ndarray, alone: np.ndarray, lone: np.ndarray) -> tuple[float, np.ndarray]:
    """The least cost of matching n points with m by SciPy, and the column of each row or -1.

    cost (n, m); alone (n,) and lone (m,): what rows and columns without a partner cost.
    """
    n, m = cost.shape
    square = np.zeros((n + m, n + m))
    square[:n, :m] = cost
    square[:n, m:] = np.where(np.eye(n, dtype=bool), alone[:, None], np.inf)
    square[n:, :m] = np.where(np.eye(m, dtype=bool), lone[None, :], np.inf)
    rows, columns = linear_sum_assignment(square)
    partner = np.where(columns[:n] < m, columns[:n], -1)
    return float(square[rows, columns].sum()), partner


def nearest_reference(within: Exemplar, output: Output, samples: np.ndarray, neighbors: np.ndarray, n: int,
                      candidates: np.ndarray | None = None, centre: float = 0.0, control: float = 0.0,
                      missing: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What the kernel `nearest` computes, in NumPy and SciPy: matches, distances and slots of `samples`."""
    shape = within.shape
    count = output.positions.shape[1] * output.positions.shape[2]
    position = output.positions.reshape(-1, output.positions.shape[3])
    at = neighborhood.at_offsets(Elements(output.positions, within.elements.grid), within.offsets)
    kappa = tied_weight(within)
    blocks = len(shape.times)
    result = (np.full((len(samples), n), -1), np.full((len(samples), n), np.inf),
              np.full((len(samples), n, blocks * shape.most), -1))
    for i, s in enumerate(samples):
        frame = s // count
        turn = np.eye(position.shape[1]) if output.frames is None else output.frames[s]
        asked = np.arange(len(within.detail)) if candidates is None else candidates[i][candidates[i] >= 0]
        found = []
        for c in asked:
            if not output.allowed[s] & within.label[c]:
                continue
            sum_ = control * (output.control[s] - within.control[c]) ** 2
            sum_ += centre * np.sum((output.detail[s] - within.detail[c]) ** 2)
            for f, offset in enumerate(within.offsets):
                if not 0 <= frame + offset[0] < output.known:
                    continue
                if (at[s, f] >= 0) != within.tie[c, f]:
                    sum_ += kappa[f] * missing
                elif at[s, f] >= 0:
                    away = output.detail[at[s, f]] - output.detail[s] - within.tied[c, f]
                    sum_ += kappa[f] * np.sum(away**2)
            slot = np.full(blocks * shape.most, -1)
            for b, time in enumerate(shape.times):
                if not 0 <= frame + time < output.known:
                    continue
                part = slice(b * shape.most, (b + 1) * shape.most)
                mine = neighbors[i, part][neighbors[i, part] >= 0]
                away = difference(position[mine] - position[s], output.period) @ turn
                squared = np.sum(away**2, axis=1)
                falloff = shape.falloff(squared, time)
                alone = falloff * np.maximum(0, shape.radius - np.sqrt(squared)) ** 2
                m = within.others[c, b]
                theirs = np.arange(part.start, part.start + m)
                apart = np.sum((away[:, None] - within.other[c, theirs]) ** 2, axis=2)
                pair = 0.5 * (falloff[:, None] + within.falloff[c, theirs]) * apart
                cost, partner = matched(pair, alone, within.alone[c, theirs])
                sum_ += cost
                slot[part.start: part.start + len(mine)] = partner
            found.append((sum_, c, slot))
        found.sort(key=lambda row: row[0])
        for j, (sum_, c, slot) in enumerate(found[:n]):
            result[0][i, j], result[1][i, j], result[2][i, j] = c, sum_, slot
    return result
