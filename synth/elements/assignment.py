"""The assignment step (ma13 §4.1, Eqs. 6 and 7; §4.2, Eqs. 11 and 12): positions from the matches' predictions.

Each neighbour s' of an output sample s is predicted by what the matches of s say: p(s') - p(s) = p̂(s', s). `solved`
minimizes Eq. 7 over all positions at once, a sparse positive definite system by conjugate gradients; `relaxed` is the
parallel variant, in which the neighbours are taken as constants and each sample goes to the mean of what is said of it.
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
    """Terms of Eq. 7: p(to) - p(of) = way, with weights; to, of (Q,) int; way (Q, D); weight (Q,)."""

    to: np.ndarray
    of: np.ndarray
    way: np.ndarray
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
        """All terms of several."""
        parts = [Anchors.none(dims), *parts]
        return Anchors(*(np.concatenate([getattr(p, name) for p in parts]) for name in ("sample", "target", "weight")))


def match_weights(apart: np.ndarray) -> np.ndarray:
    """ω_j (Eq. 12) of N matches at squared distances (M, N): 1 where there is one match alone."""
    there = np.isfinite(apart)
    distance = np.where(there, apart, 0.0).astype(np.float64)
    total = distance.sum(axis=1, keepdims=True)
    several = there.sum(axis=1, keepdims=True) > 1
    weight = np.where(several & (total > 0), 1.0 - distance / np.where(total > 0, total, 1.0), 1.0)
    return np.where(there, weight, 0.0)


def predictions(within: Exemplar, output: Output, coarse: np.ndarray | None, matches: Matches, active: np.ndarray,
                ) -> Predictions:
    """What the matches of the samples in the frames `active` say of their neighbours (Eqs. 6, 11).

    coarse (M, D): C, or of samples that a flow carries how far it has carried them; None: nothing
    """
    dims, size = output.positions.shape[3], output.positions.shape[1] * output.positions.shape[2]
    samples = (active[:, None] * size + np.arange(size)).ravel()
    found = matches.sample[samples]
    omega = match_weights(matches.apart[samples])
    # in order, so that any number of threads says the same
    with ThreadPoolExecutor(THREADS) as pool:
        terms = list(pool.map(
            lambda part: _of_others(within, output, matches, samples[part], found[part], omega[part]),
            np.array_split(np.arange(len(samples)), THREADS)))
        terms += pool.map(_of_tied(within, output, coarse, samples, found, omega), _near(within.offsets))
    return Predictions(np.concatenate([t.to for t in terms]), np.concatenate([t.of for t in terms]),
                       np.concatenate([t.way for t in terms]).reshape(-1, dims),
                       np.concatenate([t.weight for t in terms]))


def _of_others(within: Exemplar, output: Output, matches: Matches, samples: np.ndarray, found: np.ndarray,
               omega: np.ndarray) -> Predictions:
    """Of the samples that the Hungarian algorithm has matched."""
    shape = within.shape
    neighbors, slots = matches.neighbors[samples], matches.slot[samples]
    dims = within.other.shape[2]
    block = np.repeat(np.arange(len(shape.times)) * shape.most, shape.most)
    way = np.zeros((*neighbors.shape, dims))
    total, falloff = np.zeros(neighbors.shape), np.zeros(neighbors.shape)
    for n in range(found.shape[1]):
        there = (slots[:, n] >= 0) & (neighbors >= 0) & (found[:, n, None] >= 0)
        row, column = np.nonzero(there)
        place = block[column] + slots[row, n, column]
        weight = omega[row, n]
        way[row, column] += weight[:, None] * within.other[found[row, n], place]
        falloff[row, column] += weight * within.falloff[found[row, n], place]
        total[row, column] += weight
    row, column = np.nonzero(total > 0)
    said = way[row, column] / total[row, column][:, None]
    if output.frames is not None:
        said = np.einsum("nij,nj->ni", output.frames[samples[row]], said)
    return _with_shift(output, samples[row], neighbors[row, column], said,
                       falloff[row, column] / total[row, column])


def _with_shift(output: Output, of: np.ndarray, to: np.ndarray, way: np.ndarray, weight: np.ndarray) -> Predictions:
    """Terms between samples whose shortest way leads over the border of a toroidal domain, in plain positions."""
    if output.period is not None:
        position = output.positions.reshape(-1, output.positions.shape[3])
        plain = position[to] - position[of]
        with np.errstate(divide="ignore", invalid="ignore"):
            turns = np.where(output.period > 0, np.rint(plain / output.period), 0)
        way = way + turns * output.period
    return Predictions(to, of, way, weight)


def _of_tied(within: Exemplar, output: Output, coarse: np.ndarray | None, samples: np.ndarray, found: np.ndarray,
             omega: np.ndarray) -> Callable[[int], Predictions]:
    """Of the samples tied by topology and time, those at the f-th offset.

    Of anchored details p̂ = C(s') + R(s') q(s_i') - C(s) - R(s) q(s_i): details turn with the coarse shape. Else the
    way is turned as a whole.
    """
    at = at_offsets(Elements(output.positions, within.elements.grid), within.offsets)[samples]
    kappa = tied_weight(within)

    def of_offset(f: int) -> Predictions:
        to = at[:, f]
        row = np.nonzero((to >= 0) & (to < output.known * _size(output)))[0]
        way, total = np.zeros((len(row), within.detail.shape[1])), np.zeros(len(row))
        for n in range(found.shape[1]):
            match = found[row, n]
            weight = np.where((match >= 0) & (within.tie[match, f] > 0), omega[row, n], 0.0)
            q, step = within.detail[match], within.tied[match, f]
            if output.frames is not None:
                here = output.frames[samples[row]]
                if within.anchored:
                    there = output.frames[to[row]]
                    said = (np.einsum("nij,nj->ni", there, q + step) - np.einsum("nij,nj->ni", here, q))
                else:
                    said = np.einsum("nij,nj->ni", here, step)
            else:
                said = step
            way += weight[:, None] * said
            total += weight
        good = total > 0
        row = row[good]
        away = way[good] / total[good][:, None]
        if coarse is not None:
            away = away + coarse[to[row]] - coarse[samples[row]]
        return Predictions(to[row], samples[row], away, np.full(len(row), float(kappa[f])))

    return of_offset


def _size(output: Output) -> int:
    return output.positions.shape[1] * output.positions.shape[2]


def _near(offsets: np.ndarray) -> list[int]:
    """The tied samples whose predictions are used: on a sheet those next to s, which carry what the farther ones say,
    and all along a thread or in time."""
    return [f for f, (_, v, u) in enumerate(offsets) if v == 0 or max(abs(v), abs(u)) <= 1]


def centred(within: Exemplar, output: Output, coarse: np.ndarray, matches: Matches, active: np.ndarray,
            weight: float) -> Anchors:
    """Anchored details where the matches themselves say that the sample lies: C(s) + R(s) q(s_i)."""
    size = _size(output)
    samples = (active[:, None] * size + np.arange(size)).ravel()
    samples = samples[matches.sample[samples, 0] >= 0]
    omega = match_weights(matches.apart[samples])
    q = np.sum(omega[..., None] * within.detail[matches.sample[samples]], axis=1) / omega.sum(axis=1)[:, None]
    if output.frames is not None:
        q = np.einsum("nij,nj->ni", output.frames[samples], q)
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
        """Along one axis, from where the samples are: of what does not move it is then zero."""
        residual = terms.way[:, d] - (base[terms.to, d] - base[terms.of, d])
        right = np.zeros(unknowns)
        for side, known, sign in sides:
            right += np.bincount(side[known], sign * weight[known] * residual[known], unknowns)
        pull = anchors.weight * (anchors.target[:, d] - base[anchors.sample, d])
        right += np.bincount(held[anchored], pull[anchored], unknowns)
        found: np.ndarray = cg(matrix, right, rtol=TOLERANCE, maxiter=MOST_ITERATIONS, M=diags(1.0 / diagonal))[0]
        return found

    result = base.copy()
    # sums of a BLAS depend on how many threads share them; the axes share nothing
    with threadpool_limits(1), ThreadPoolExecutor(dims) as pool:
        result[free] += np.stack(list(pool.map(step, range(dims))), axis=-1)
    return result


def relaxed(positions: np.ndarray, terms: Predictions, anchors: Anchors, free: np.ndarray) -> np.ndarray:
    """One parallel step: each free sample goes to the weighted mean of where its neighbours, as constants, and the
    anchors say it is [Lefebvre and Hoppe 2005]."""
    count, dims = positions.shape
    base = positions.astype(np.float64)
    total = np.full(count, STAY)
    where = STAY * base
    said = ((terms.to, base[terms.of] + terms.way, terms.weight), (terms.of, base[terms.to] - terms.way, terms.weight),
            (anchors.sample, anchors.target, anchors.weight))
    for sample, target, weight in said:
        total += np.bincount(sample, weight, count)
        for d in range(dims):
            where[:, d] += np.bincount(sample, weight * target[:, d], count)
    return np.where(free[:, None], where / total[:, None], base)
