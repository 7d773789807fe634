"""The assignment step (ma13 §4.1, Eqs. 6 and 7; §4.2, Eqs. 11 and 12): positions from the matches' predictions.

The matches of an output sample s predict the position of each neighbour s': p(s') - p(s) = p̂(s', s). `solved`
minimizes Eq. 7 over all positions at once, a sparse positive definite system by conjugate gradients; `relaxed` is the
parallel variant, in which neighbours are constants and each sample moves to the mean of its predicted positions.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix, diags
from scipy.sparse.linalg import cg
from threadpoolctl import threadpool_limits

from synth.elements.neighborhood import THREADS, at_offsets
from synth.elements.samples import Elements
from synth.elements.search import Exemplar, Matches, Output, tied_weight

TOLERANCE = 1e-4  # relative residual of the conjugate gradients
MOST_ITERATIONS = 200
STAY = 1e-3  # weight that holds each sample where it is: makes the system definite where nothing else fixes it


@dataclass(frozen=True)
class Predictions:
    """Terms of Eq. 7: p(to) - p(of) = offset, with weights; to, of (Q,) int; offset (Q, D); weight (Q,)."""

    to: np.ndarray
    of: np.ndarray
    offset: np.ndarray
    weight: np.ndarray


@dataclass(frozen=True)
class Anchors:
    """Terms of Θ: sample (A,) should be at target (A, D), with weight (A,)."""

    sample: np.ndarray
    target: np.ndarray
    weight: np.ndarray

    @staticmethod
    def none(dims: int) -> Anchors:
        return Anchors(np.zeros(0, np.int64), np.zeros((0, dims)), np.zeros(0))

    @staticmethod
    def all(parts: list[Anchors], dims: int) -> Anchors:
        """The terms of several anchors, concatenated."""
        parts = [Anchors.none(dims), *parts]
        return Anchors(*(np.concatenate([getattr(p, name) for p in parts]) for name in ("sample", "target", "weight")))


def match_weights(squared: np.ndarray) -> np.ndarray:
    """ω_j (Eq. 12) of N matches at squared distances (M, N): 1 where there is only one match."""
    there = np.isfinite(squared)
    distance = np.where(there, squared, 0.0).astype(np.float64)
    total = distance.sum(axis=1, keepdims=True)
    several = there.sum(axis=1, keepdims=True) > 1
    weight = np.where(several & (total > 0), 1.0 - distance / np.where(total > 0, total, 1.0), 1.0)
    return np.where(there, weight, 0.0)


def predictions(exemplar: Exemplar, output: Output, coarse: np.ndarray | None, matches: Matches, active: np.ndarray,
                ) -> Predictions:
    """What the matches of the samples in the frames `active` predict for their neighbours (Eqs. 6, 11).

    coarse (M, D): C, or for samples carried by a flow the distance carried; None: nothing is subtracted
    """
    dims, size = output.positions.shape[3], output.positions.shape[1] * output.positions.shape[2]
    samples = (active[:, None] * size + np.arange(size)).ravel()
    found = matches.sample[samples]
    omega = match_weights(matches.distance[samples])
    # in order, so that the result does not depend on the number of threads
    with ThreadPoolExecutor(THREADS) as pool:
        terms = list(pool.map(
            lambda part: _of_others(exemplar, output, matches, samples[part], found[part], omega[part]),
            np.array_split(np.arange(len(samples)), THREADS)))
        terms += pool.map(_of_tied(exemplar, output, coarse, samples, found, omega), _near(exemplar.offsets))
    return Predictions(np.concatenate([t.to for t in terms]), np.concatenate([t.of for t in terms]),
                       np.concatenate([t.offset for t in terms]).reshape(-1, dims),
                       np.concatenate([t.weight for t in terms]))


def _of_others(exemplar: Exemplar, output: Output, matches: Matches, samples: np.ndarray, found: np.ndarray,
               omega: np.ndarray) -> Predictions:
    """Predictions for the samples that the Hungarian algorithm has matched."""
    shape = exemplar.shape
    neighbors, slots = matches.neighbors[samples], matches.slot[samples]
    dims = exemplar.other.shape[2]
    block = np.repeat(np.arange(len(shape.times)) * shape.most, shape.most)
    offset = np.zeros((*neighbors.shape, dims))
    total, falloff = np.zeros(neighbors.shape), np.zeros(neighbors.shape)
    for n in range(found.shape[1]):
        there = (slots[:, n] >= 0) & (neighbors >= 0) & (found[:, n, None] >= 0)
        row, column = np.nonzero(there)
        place = block[column] + slots[row, n, column]
        weight = omega[row, n]
        offset[row, column] += weight[:, None] * exemplar.other[found[row, n], place]
        falloff[row, column] += weight * exemplar.falloff[found[row, n], place]
        total[row, column] += weight
    row, column = np.nonzero(total > 0)
    predicted = offset[row, column] / total[row, column][:, None]
    if output.axes is not None:
        predicted = np.einsum("nij,nj->ni", output.axes[samples[row]], predicted)
    return _with_shift(output, samples[row], neighbors[row, column], predicted,
                       falloff[row, column] / total[row, column])


def _with_shift(output: Output, of: np.ndarray, to: np.ndarray, offset: np.ndarray, weight: np.ndarray) -> Predictions:
    """The terms for positions that are not wrapped: offsets across the border of a toroidal domain, plus periods."""
    if output.period is not None:
        position = output.positions.reshape(-1, output.positions.shape[3])
        plain = position[to] - position[of]
        with np.errstate(divide="ignore", invalid="ignore"):
            periods = np.where(output.period > 0, np.rint(plain / output.period), 0)
        offset = offset + periods * output.period
    return Predictions(to, of, offset, weight)


def _of_tied(exemplar: Exemplar, output: Output, coarse: np.ndarray | None, samples: np.ndarray, found: np.ndarray,
             omega: np.ndarray) -> Callable[[int], Predictions]:
    """Predictions for the samples tied by topology or time, those at the f-th offset.

    With anchored details p̂ = C(s') + R(s') q(s_i') - C(s) - R(s) q(s_i): details rotate with the coarse shape.
    Otherwise the offset is rotated as a whole.
    """
    at = at_offsets(Elements(output.positions, exemplar.elements.grid), exemplar.offsets)[samples]
    kappa = tied_weight(exemplar)

    def of_offset(f: int) -> Predictions:
        to = at[:, f]
        row = np.nonzero((to >= 0) & (to < output.known * _size(output)))[0]
        offset, total = np.zeros((len(row), exemplar.detail.shape[1])), np.zeros(len(row))
        for n in range(found.shape[1]):
            match = found[row, n]
            weight = np.where((match >= 0) & (exemplar.tie[match, f] > 0), omega[row, n], 0.0)
            q, step = exemplar.detail[match], exemplar.tied[match, f]
            if output.axes is not None:
                here = output.axes[samples[row]]
                if exemplar.anchored:
                    there = output.axes[to[row]]
                    predicted = (np.einsum("nij,nj->ni", there, q + step) - np.einsum("nij,nj->ni", here, q))
                else:
                    predicted = np.einsum("nij,nj->ni", here, step)
            else:
                predicted = step
            offset += weight[:, None] * predicted
            total += weight
        good = total > 0
        row = row[good]
        away = offset[good] / total[good][:, None]
        if coarse is not None:
            away = away + coarse[to[row]] - coarse[samples[row]]
        return Predictions(to[row], samples[row], away, np.full(len(row), float(kappa[f])))

    return of_offset


def _size(output: Output) -> int:
    return output.positions.shape[1] * output.positions.shape[2]


def _near(offsets: np.ndarray) -> list[int]:
    """The tied samples whose predictions are used: on a sheet those adjacent to s, which pass on the effect of farther
    ones; along a thread and in time all."""
    return [f for f, (_, v, u) in enumerate(offsets) if v == 0 or max(abs(v), abs(u)) <= 1]


def centred(exemplar: Exemplar, output: Output, coarse: np.ndarray, matches: Matches, active: np.ndarray,
            weight: float) -> Anchors:
    """Anchors of samples with anchored details, at the position that their own matches give: C(s) + R(s) q(s_i)."""
    size = _size(output)
    samples = (active[:, None] * size + np.arange(size)).ravel()
    samples = samples[matches.sample[samples, 0] >= 0]
    omega = match_weights(matches.distance[samples])
    q = np.sum(omega[..., None] * exemplar.detail[matches.sample[samples]], axis=1) / omega.sum(axis=1)[:, None]
    if output.axes is not None:
        q = np.einsum("nij,nj->ni", output.axes[samples], q)
    return Anchors(samples, coarse[samples] + q, np.full(len(samples), weight))


def solved(positions: np.ndarray, terms: Predictions, anchors: Anchors, free: np.ndarray) -> np.ndarray:
    """The positions (M, D) float64 that minimize Eq. 7 and the anchors; only the samples `free` (M,) bool move."""
    count, dims = positions.shape
    variable = np.full(count, -1)
    variable[free] = np.arange(int(free.sum()))
    unknowns = int(free.sum())
    to, of = variable[terms.to], variable[terms.of]
    weight = np.where((to >= 0) | (of >= 0), terms.weight, 0.0)
    base = positions.astype(np.float64)
    sides = [(side, side >= 0, sign) for side, sign in ((to, 1.0), (of, -1.0))]
    held = variable[anchors.sample]
    anchored = held >= 0
    diagonal = np.full(unknowns, STAY)
    for side, known, _ in sides:
        diagonal += np.bincount(side[known], weight[known], unknowns)
    diagonal += np.bincount(held[anchored], anchors.weight[anchored], unknowns)
    both = (to >= 0) & (of >= 0)
    coupling = csr_matrix((weight[both], (to[both], of[both])), (unknowns, unknowns))
    matrix = diags(diagonal) - coupling - coupling.T

    def step(d: int) -> np.ndarray:
        """The change of the positions along one axis; zero where nothing moves."""
        residual = terms.offset[:, d] - (base[terms.to, d] - base[terms.of, d])
        right = np.zeros(unknowns)
        for side, known, sign in sides:
            right += np.bincount(side[known], sign * weight[known] * residual[known], unknowns)
        pull = anchors.weight * (anchors.target[:, d] - base[anchors.sample, d])
        right += np.bincount(held[anchored], pull[anchored], unknowns)
        found: np.ndarray = cg(matrix, right, rtol=TOLERANCE, maxiter=MOST_ITERATIONS, M=diags(1.0 / diagonal))[0]
        return found

    result = base.copy()
    # the sums of a BLAS depend on its number of threads; the axes are independent
    with threadpool_limits(1), ThreadPoolExecutor(dims) as pool:
        result[free] += np.stack(list(pool.map(step, range(dims))), axis=-1)
    return result


def relaxed(positions: np.ndarray, terms: Predictions, anchors: Anchors, free: np.ndarray) -> np.ndarray:
    """One parallel step: each free sample moves to the weighted mean of the positions predicted by its neighbours, held
    constant, and by the anchors [Lefebvre and Hoppe 2005]."""
    count, dims = positions.shape
    base = positions.astype(np.float64)
    total = np.full(count, STAY)
    where = STAY * base
    predicted = ((terms.to, base[terms.of] + terms.offset, terms.weight),
                 (terms.of, base[terms.to] - terms.offset, terms.weight),
                 (anchors.sample, anchors.target, anchors.weight))
    for sample, target, weight in predicted:
        total += np.bincount(sample, weight, count)
        for d in range(dims):
            where[:, d] += np.bincount(sample, weight * target[:, d], count)
    return np.where(free[:, None], where / total[:, None], base)
