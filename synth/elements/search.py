"""The search step (ma13 §4.1, §4.2): for each output sample the N exemplar samples with the nearest neighbourhoods.

The distance is Eq. 9, over tied samples by their offsets and over the others by the Hungarian algorithm. A sample
without a partner counts as if its partner were the nearest point on the rim of the neighbourhood. So neighbourhoods of
different sizes can be compared, and the distance does not jump when a sample enters across the rim (§4.2 names that
jump as a cause of jitter).

`Searcher.nearest` compares with all of a small exemplar, or with the candidates of k-coherence [Tong et al. 2002]; both
in OpenCL. `nearest_reference` is the specification of the kernel in NumPy and SciPy.

Hot: the kernel `nearest` takes a quarter (points) to three fifths (threads) of an optimization; 1,000 particles over 60
frames converge in 17 s on 2 CPU cores. It is bound by arithmetic: a cost matrix and the Hungarian algorithm, cubic in
the number of neighbours, for each candidate. `python -m bench elements` shows it.
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
CANDIDATES = 24  # of k-coherence for one sample, at most
SIMILAR = 3  # exemplar samples most similar to each that k-coherence adds
DESCRIPTOR = 12  # numbers in which the exemplar's own neighbourhoods are first compared
FIRST_FOUND = 16  # samples that the descriptor preselects; the distance itself picks SIMILAR of them


@dataclass(frozen=True)
class Exemplar:
    """An exemplar, ready for the search: the neighbourhoods of its M samples, M = T·E·S, in local axes.

    neighbors  (M, B·K) int32, -1 for none: the other samples, in the order of the arrays below
    other      (M, B·K, D) float32: their û; falloff (M, B·K) κ; unmatched (M, B·K) cost of having no partner
    others     (M, B) int32: how many there are in each of the B frames
    tied       (M, F, D) float32: û of the tied samples; tie (M, F) int8: which are there
    detail     (M, D) float32: q
    control    (M,) float32, label (M,) int32 with one bit set: compared with the control map and the allowed kinds
    """

    elements: Elements
    shape: Shape
    axes: np.ndarray | None
    offsets: np.ndarray
    neighbors: np.ndarray
    other: np.ndarray
    falloff: np.ndarray
    unmatched: np.ndarray
    others: np.ndarray
    tied: np.ndarray
    tie: np.ndarray
    detail: np.ndarray
    control: np.ndarray
    label: np.ndarray

    @property
    def anchored(self) -> bool:
        """Whether the elements have coarse positions, so that q itself can be compared."""
        return self.elements.coarse is not None


def exemplar(elements: Elements, shape: Shape, axes: np.ndarray | None = None, period: np.ndarray | None = None,
             control: np.ndarray | None = None) -> Exemplar:
    """The neighbourhoods of all samples of an exemplar.

    axes     (T·E·S, D, D) local axes R, None: those of the domain
    period   (D,) of a toroidal exemplar, 0 along axes that do not repeat
    control  (E,) of each element, for a control map; default 0
    Its label is the bit of its elements' kind.
    """
    offsets = neighborhood.tied(shape, elements.grid)
    found = found_others(elements, shape, np.arange(elements.frames), period)
    position = elements.positions.reshape(-1, elements.dimensions)
    away = difference(position[np.maximum(found, 0)] - position[:, None], period)
    if axes is not None:
        away = np.einsum("nji,nkj->nki", axes, away)
    there = found >= 0
    squared = np.sum(away**2, axis=-1)
    time = np.repeat(np.array(shape.times, np.float32), shape.most)
    falloff = np.where(there, shape.falloff(squared, time), 0).astype(np.float32)
    unmatched = falloff * np.maximum(0, shape.radius - np.sqrt(squared)) ** 2
    detail = neighborhood.details(elements, axes)
    at = neighborhood.at_offsets(elements, offsets)
    tied = np.where((at >= 0)[..., None], detail[np.maximum(at, 0)] - detail[:, None], 0)
    controls = np.zeros(elements.count) if control is None else control
    return Exemplar(
        elements, shape, axes, offsets, found, np.where(there[..., None], away, 0).astype(np.float32), falloff,
        unmatched.astype(np.float32), there.reshape(len(found), -1, shape.most).sum(axis=2).astype(np.int32),
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
    """The shortest offset between two points of a toroidal domain: `away` (…, D) less whole periods."""
    if period is None:
        return away
    with np.errstate(divide="ignore", invalid="ignore"):
        periods = np.where(period > 0, np.rint(away / period), 0)
    return (away - periods * period).astype(np.float32)


@dataclass(frozen=True)
class Output:
    """The part of the output that the search reads, M = T·E·S samples.

    positions  (T, E, S, D) float32
    detail     (M, D) float32: q, or for elements without coarse positions their motion less that of the flow
    axes       (M, D, D) float32 or None
    known      number of frames that are synthesized so far; later ones are ignored
    period     (D,) or None
    control    (M,) float32: the control map where each sample is
    allowed    (M,) int32: bits of the labels it may match
    """

    positions: np.ndarray
    detail: np.ndarray
    axes: np.ndarray | None
    known: int
    period: np.ndarray | None
    control: np.ndarray
    allowed: np.ndarray


@dataclass
class Matches:
    """The N matches of each of M output samples, the nearest first.

    sample  (M, N) int32, -1 for none yet; distance (M, N) float32: their squared distances
    slot    (M, N, B·K) int32: the place in the match's own list to which each other sample is matched, -1: none
    neighbors  (M, B·K) int32: those other samples
    """

    sample: np.ndarray
    distance: np.ndarray
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
    coherent   k-coherence; else every sample of the exemplar is compared
    centre     weight of the difference of q itself, where the exemplar is anchored
    control    weight of the control map's difference
    """

    def __init__(self, exemplar: Exemplar, n: int, coherent: bool, centre: float = 0.0, control: float = 0.0):
        self.exemplar, self.n, self.coherent = exemplar, n, coherent
        self.centre = centre if exemplar.anchored else 0.0
        self.control = control
        # the cost of a tied sample that one side lacks: the square of half a spacing
        self.missing = 0.25 * neighborhood_spacing(exemplar) ** 2
        self._arrays = [opencl.to_device(a) for a in (
            exemplar.other, exemplar.falloff, exemplar.unmatched, exemplar.others, exemplar.tied, exemplar.tie,
            exemplar.detail, exemplar.control, exemplar.label)]
        if coherent:
            self._similar = opencl.to_device(similar(exemplar))
            self._in_neighbors = opencl.to_device(exemplar.neighbors)

    def nearest(self, output: Output, active: np.ndarray, matches: Matches) -> None:
        """Update the matches of the samples in the frames `active`, in place.

        matches.neighbors of other frames stay as they were when those frames were last searched.
        """
        shape, size = self.exemplar.shape, output.positions.shape[1] * output.positions.shape[2]
        samples = (active[:, None] * size + np.arange(size)).ravel().astype(np.int32)
        elements = Elements(output.positions[: output.known], self.exemplar.elements.grid)
        many = CANDIDATES if self.coherent else 0
        program = self._program(output.positions.shape, many)
        candidates = opencl.empty((len(samples), max(many, 1)), np.int32)
        offsets = opencl.to_device(np.vstack([self.exemplar.offsets, [[0, 0, 0]]]).astype(np.int32))
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
            opencl.to_device(np.zeros(1, np.float32) if output.axes is None else output.axes),
            np.int32(output.axes is not None), np.int32(output.known),
            opencl.to_device(np.zeros(dims, np.float32) if output.period is None else
                             output.period.astype(np.float32)),
            opencl.to_device(matches.neighbors[samples]), offsets,
            opencl.to_device(np.array(shape.times, np.int32)), opencl.to_device(tied_weight(self.exemplar)),
            opencl.to_device(output.control[samples].astype(np.float32)),
            opencl.to_device(output.allowed[samples].astype(np.int32)),
            np.float32(shape.radius), np.float32(shape.sigma),
            opencl.to_device(shape.falloff(0.0, np.array(shape.times)).astype(np.float32)),
            np.float32(self.centre), np.float32(self.control), np.float32(self.missing), *self._arrays, candidates,
            *found)
        for name, values in zip(("sample", "distance", "slot"), found, strict=True):
            getattr(matches, name)[samples] = values.get()

    def _program(self, output: tuple[int, ...], candidates: int) -> opencl.Program:
        frames, count, samples, dims = self.exemplar.elements.positions.shape
        columns = self.exemplar.elements.grid[-1] if self.exemplar.elements.grid else 1
        return opencl.program(
            SOURCE, D=dims, K=self.exemplar.shape.most, B=len(self.exemplar.shape.times), F=len(self.exemplar.offsets),
            N=self.n, C=candidates, SIMILAR=SIMILAR, ROWS=samples // columns, COLUMNS=columns, SAMPLES=samples,
            FRAMES=output[0], COUNT=output[1], IN_FRAMES=frames, IN_COUNT=count)


def neighborhood_spacing(exemplar: Exemplar) -> float:
    """The median length of û of the tied samples: the unit for the cost of a missing one."""
    tied = np.linalg.norm(exemplar.tied, axis=-1)[exemplar.tie > 0]
    return float(np.median(tied)) if tied.size and tied.any() else exemplar.shape.radius / 2


def tied_weight(exemplar: Exemplar) -> np.ndarray:
    """Weights of the tied samples, (F,) float32 (at least one): κ by time alone, since an offset along an element is
    not a distance in space, and for samples tied in time a factor that makes motion count.

    A sample's displacement over a few frames is small beside the distances to its neighbours, and would hardly matter.
    So its square is divided by the mean square of such displacements in the exemplar, and multiplied by shape.motion
    times the squared radius: with shape.motion = 1, a typical difference of motion counts as much as a neighbour one
    radius away. Elements of an exemplar of one frame should only follow the flow: their factor is shape.at_rest.
    """
    shape, offsets = exemplar.shape, exemplar.offsets
    weight = np.ones(len(offsets) + 1)
    weight[:-1] = shape.falloff(0.0, offsets[:, 0])
    trail = offsets[:, 0] != 0
    there = exemplar.tie[:, trail] > 0
    motions = np.sum(exemplar.tied[:, trail].astype(np.float64) ** 2, axis=-1)[there]
    typical = float(motions.mean()) if motions.size else 0.0
    if typical > 0:
        weight[:-1][trail] *= max(1.0, shape.motion * shape.radius**2 / typical)
    elif exemplar.elements.frames == 1:
        weight[:-1][trail] *= shape.at_rest
    return weight.astype(np.float32)


def similar(exemplar: Exemplar) -> np.ndarray:
    """For each exemplar sample the SIMILAR others with the nearest neighbourhoods, (M, SIMILAR) int32.

    Found among the FIRST_FOUND nearest by a short descriptor: the tied û, the others sorted by distance, and q,
    projected on DESCRIPTOR random directions.
    """
    shape, count = exemplar.shape, len(exemplar.detail)
    distance = np.where(exemplar.falloff > 0, np.linalg.norm(exemplar.other, axis=-1), shape.radius)
    numbers = np.concatenate([exemplar.tied.reshape(count, -1), distance, exemplar.detail if exemplar.anchored else
                              np.zeros((count, 0))], axis=1)
    rng = np.random.Generator(np.random.Philox(key=count))
    # einsum, not a BLAS: the same bits at any number of threads
    projected = np.einsum("mn,nd->md", numbers, rng.normal(size=(numbers.shape[1], DESCRIPTOR)))
    _, found = cKDTree(projected).query(projected, k=min(FIRST_FOUND + 1, count))
    found = np.asarray(found).reshape(count, -1)
    result = np.full((count, SIMILAR), -1, np.int32)
    distances = np.full(found.shape, np.inf)
    for c in range(found.shape[1]):
        other = found[:, c]
        distances[:, c] = np.sum((exemplar.tied - exemplar.tied[other]) ** 2, axis=(1, 2)) + np.sum(
            (distance - distance[other]) ** 2, axis=1)
    distances[found == np.arange(count)[:, None]] = np.inf
    order = np.argsort(distances, axis=1, kind="stable")[:, :SIMILAR]
    nearest = np.where(np.isfinite(np.take_along_axis(distances, order, axis=1)),
                       np.take_along_axis(found, order, axis=1), -1)
    result[:, : nearest.shape[1]] = nearest
    return result


def matched(cost: np.ndarray, row_unmatched: np.ndarray, column_unmatched: np.ndarray,
            ) -> tuple[float, np.ndarray]:
    """The least cost of matching n points with m by SciPy, and the column of each row or -1.

    cost (n, m); row_unmatched (n,), column_unmatched (m,): the cost of a row or column without a partner.
    """
    n, m = cost.shape
    square = np.zeros((n + m, n + m))
    square[:n, :m] = cost
    square[:n, m:] = np.where(np.eye(n, dtype=bool), row_unmatched[:, None], np.inf)
    square[n:, :m] = np.where(np.eye(m, dtype=bool), column_unmatched[None, :], np.inf)
    rows, columns = linear_sum_assignment(square)
    partner = np.where(columns[:n] < m, columns[:n], -1)
    return float(square[rows, columns].sum()), partner


def nearest_reference(exemplar: Exemplar, output: Output, samples: np.ndarray, neighbors: np.ndarray, n: int,
                      candidates: np.ndarray | None = None, centre: float = 0.0, control: float = 0.0,
                      missing: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Specification of the kernel `nearest`, in NumPy and SciPy: matches, distances and slots of `samples`."""
    shape = exemplar.shape
    count = output.positions.shape[1] * output.positions.shape[2]
    position = output.positions.reshape(-1, output.positions.shape[3])
    at = neighborhood.at_offsets(Elements(output.positions, exemplar.elements.grid), exemplar.offsets)
    kappa = tied_weight(exemplar)
    blocks = len(shape.times)
    result = (np.full((len(samples), n), -1), np.full((len(samples), n), np.inf),
              np.full((len(samples), n, blocks * shape.most), -1))
    for i, s in enumerate(samples):
        frame = s // count
        R = np.eye(position.shape[1]) if output.axes is None else output.axes[s]
        compared = np.arange(len(exemplar.detail)) if candidates is None else candidates[i][candidates[i] >= 0]
        found = []
        for c in compared:
            if not output.allowed[s] & exemplar.label[c]:
                continue
            sum_ = control * (output.control[s] - exemplar.control[c]) ** 2
            sum_ += centre * np.sum((output.detail[s] - exemplar.detail[c]) ** 2)
            for f, offset in enumerate(exemplar.offsets):
                if not 0 <= frame + offset[0] < output.known:
                    continue
                if (at[s, f] >= 0) != exemplar.tie[c, f]:
                    sum_ += kappa[f] * missing
                elif at[s, f] >= 0:
                    away = output.detail[at[s, f]] - output.detail[s] - exemplar.tied[c, f]
                    sum_ += kappa[f] * np.sum(away**2)
            slot = np.full(blocks * shape.most, -1)
            for b, time in enumerate(shape.times):
                if not 0 <= frame + time < output.known:
                    continue
                part = slice(b * shape.most, (b + 1) * shape.most)
                mine = neighbors[i, part][neighbors[i, part] >= 0]
                away = difference(position[mine] - position[s], output.period) @ R
                squared = np.sum(away**2, axis=1)
                falloff = shape.falloff(squared, time)
                unmatched = falloff * np.maximum(0, shape.radius - np.sqrt(squared)) ** 2
                m = exemplar.others[c, b]
                theirs = np.arange(part.start, part.start + m)
                squares = np.sum((away[:, None] - exemplar.other[c, theirs]) ** 2, axis=2)
                pair = 0.5 * (falloff[:, None] + exemplar.falloff[c, theirs]) * squares
                cost, partner = matched(pair, unmatched, exemplar.unmatched[c, theirs])
                sum_ += cost
                slot[part.start: part.start + len(mine)] = partner
            found.append((sum_, c, slot))
        found.sort(key=lambda row: row[0])
        for j, (sum_, c, slot) in enumerate(found[:n]):
            result[0][i, j], result[1][i, j], result[2][i, j] = c, sum_, slot
    return result
