"""Minimizers of a pairwise energy over labels (okabe11 §5, Eq. 4):

    E(l) = Σ_p V_p(l_p) + λ Σ_(p,q) W_pq(l_p, l_q)

`sequential_messages` (TRW-S, Kolmogorov 2006) is the default: it asks nothing of W and gives a lower bound.
`alpha_expansion` is the paper's ("the graph-cut method with a-expansion [BVZ01]"). The paper's W is a squared
distance of different pieces, no metric: a third of its terms must be truncated for a cut to exist, and what it finds
is no better than that of `conditional_modes`, the simplest.

All are sequential and in double precision: the same bits at any number of threads. Of equal labels the first is
taken.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

CAPACITY = 1 << 24
"""The largest capacity of a cut, which has whole numbers: energies are rounded to the largest term over this."""


@dataclass(frozen=True, eq=False)
class Energy:
    """P nodes with L labels each.

    data    (P, L) float64: V; infinite where a node has fewer labels
    edges   (E, 2) int: p < q, each pair once
    smooth  (E, L, L) float: λ W, by the label of p, then of q; finite
    """

    data: np.ndarray
    edges: np.ndarray
    smooth: np.ndarray

    def __post_init__(self) -> None:
        nodes, labels = self.data.shape
        if self.smooth.shape != (len(self.edges), labels, labels):
            raise ValueError(f"{len(self.edges)} edges of {labels} labels need {(len(self.edges), labels, labels)} "
                             f"terms, not {self.smooth.shape}")
        p, q = self.edges.reshape(-1, 2).T
        if not ((p >= 0) & (p < q) & (q < nodes)).all():
            raise ValueError(f"an edge joins nodes p < q of 0 to {nodes - 1}")
        if not np.isfinite(self.data).any(axis=1).all():
            raise ValueError("a node has no label of finite energy")

    def of(self, labels: np.ndarray) -> float:
        """E of labels (P,) int."""
        p, q = self.edges.reshape(-1, 2).T
        terms = self.smooth[np.arange(len(p)), labels[p], labels[q]]
        return float(self.data[np.arange(len(self.data)), labels].sum() + terms.sum(dtype=np.float64))

    @cached_property
    def neighbours(self) -> list[list[tuple[int, int, bool]]]:
        """Of each node: the edge, the node at its other end, and whether that one comes later."""
        found: list[list[tuple[int, int, bool]]] = [[] for _ in self.data]
        for edge, (p, q) in enumerate(self.edges.tolist()):
            found[p].append((edge, q, True))
            found[q].append((edge, p, False))
        return found


class Minimum(NamedTuple):
    """labels (P,) int64, their energy, and a bound below which no labels are: -inf where none is known."""

    labels: np.ndarray
    energy: float
    bound: float = -np.inf


def by_data(energy: Energy) -> Minimum:
    """The label of least data term of each node."""
    labels = energy.data.argmin(axis=1)
    return Minimum(labels, energy.of(labels))


def conditional_modes(energy: Energy, most: int = 50) -> Minimum:
    """Iterated conditional modes: node by node the best label while its neighbours keep theirs, until none changes."""
    labels = by_data(energy).labels
    for _ in range(most):
        before = labels.copy()
        for p, around in enumerate(energy.neighbours):
            total = energy.data[p].copy()
            for edge, q, later in around:
                total += energy.smooth[edge, :, labels[q]] if later else energy.smooth[edge, labels[q]]
            labels[p] = total.argmin()
        if (labels == before).all():
            break
    return Minimum(labels, energy.of(labels))


def sequential_messages(energy: Energy, iterations: int = 25) -> Minimum:
    """Sequential tree-reweighted message passing (TRW-S, Kolmogorov 2006, fig. 3): exact on chains and trees.

    1. Forward through the nodes, then backward: each sends what it knows to those that come after it.
    2. In the forward pass, the label of a node goes by those already chosen and the messages of the others.
    3. The best labels of all passes; the bound is the sum of what normalizing took from the messages.
    """
    labels = len(energy.data[0])
    messages = np.zeros((len(energy.edges), 2, labels))  # to p, to q
    # an infinite energy would come back as a difference of infinities
    finite = np.where(np.isfinite(energy.data), energy.data, _beyond(energy))
    share = [1 / max(sum(later for _, _, later in around), sum(not later for _, _, later in around), 1)
             for around in energy.neighbours]
    best, bound = by_data(energy), -np.inf
    for _ in range(iterations):
        # 1. forward, and 2. labels
        chosen = np.zeros(len(finite), np.int64)
        _pass(energy, finite, messages, share, True, chosen)
        found = energy.of(chosen)
        if found < best.energy:
            best = Minimum(chosen, found)
        bound = max(bound, _pass(energy, finite, messages, share, False, None))
    # 3. the best
    return Minimum(best.labels, best.energy, bound)


def _beyond(energy: Energy) -> float:
    """A data term that no minimum can have."""
    worst = float(energy.smooth.max(initial=0)) - float(energy.smooth.min(initial=0))
    values = energy.data[np.isfinite(energy.data)]
    return float(values.max()) + (float(values.max()) - float(values.min()) + 1) + 8 * worst


def _pass(energy: Energy, data: np.ndarray, messages: np.ndarray, share: list[float], forward: bool,
          chosen: np.ndarray | None) -> float:
    """One pass: updates the messages in its direction, and the labels `chosen` if given. The bound."""
    order = range(len(data)) if forward else range(len(data) - 1, -1, -1)
    bound = 0.0
    for p in order:
        around = energy.neighbours[p]
        total = data[p].copy()
        for edge, _, later in around:
            total += messages[edge, 0 if later else 1]
        if chosen is not None:
            local = data[p].copy()
            for edge, q, later in around:
                local += messages[edge, 0] if later else energy.smooth[edge, chosen[q]]
            chosen[p] = local.argmin()
        least = total.min()
        bound += least
        total -= least
        for edge, _, later in around:
            if later != forward:
                continue
            terms = energy.smooth[edge] if later else energy.smooth[edge].T
            own = share[p] * total - messages[edge, 0 if later else 1]
            sent = (own[:, None] + terms).min(axis=0)
            least = sent.min()
            bound += least
            messages[edge, 1 if later else 0] = sent - least
    return bound


class Expansion(NamedTuple):
    """labels and energy as in `Minimum`, and the share of the pair terms that had to be truncated."""

    labels: np.ndarray
    energy: float
    truncated: float


def alpha_expansion(energy: Energy, most: int = 5) -> Expansion:
    """α-expansion [Boykov et al. 2001] with truncated terms: label by label, each node keeps its own or takes α.

    Sweeps over all labels, `most` times or until none lowers the energy. A move that does not lower it is not made.
    """
    labels, found = by_data(energy).labels, by_data(energy).energy
    truncated, terms = 0, 0
    for _ in range(most):
        before = found
        for alpha in range(energy.data.shape[1]):
            takes, bad = _move(energy, labels, alpha)
            truncated, terms = truncated + bad, terms + len(energy.edges)
            moved = np.where(takes & np.isfinite(energy.data[:, alpha]), alpha, labels)
            value = energy.of(moved)
            if value < found:
                labels, found = moved, value
        if found >= before:
            break
    return Expansion(labels, found, truncated / max(terms, 1))


def _move(energy: Energy, labels: np.ndarray, alpha: int) -> tuple[np.ndarray, int]:
    """Which nodes take α (P,) bool in the best move, and how many pair terms were truncated.

    With keep = 0, take = 1, a pair term is A (0, 0), B (0, 1), C (1, 0), D (1, 1). A cut needs A + D <= B + C; where
    it is not so A is lowered: keeping both then seems better than it is, and `alpha_expansion` looks at the true value.
    """
    nodes, edge = len(labels), np.arange(len(energy.edges))
    p, q = energy.edges.reshape(-1, 2).T
    a = energy.smooth[edge, labels[p], labels[q]].astype(np.float64)
    b = energy.smooth[edge, labels[p], alpha].astype(np.float64)
    c = energy.smooth[edge, alpha, labels[q]].astype(np.float64)
    d = energy.smooth[edge, alpha, alpha].astype(np.float64)
    over = a + d - b - c
    bad = int((over > 0).sum())
    a -= np.maximum(over, 0)
    # A + (C - A) x_p + (D - C) x_q + (B + C - A - D) (1 - x_p) x_q
    finite = np.where(np.isfinite(energy.data), energy.data, _beyond(energy))
    cost = finite[:, alpha] - finite[np.arange(nodes), labels]
    np.add.at(cost, p, c - a)
    np.add.at(cost, q, d - c)
    return _cut(nodes, cost, p, q, b + c - a - d), bad


def _cut(nodes: int, cost: np.ndarray, p: np.ndarray, q: np.ndarray, pair: np.ndarray) -> np.ndarray:
    """Minimizer (P,) bool of Σ cost x_p + Σ pair (1 - x_p) x_q, pair >= 0, by a minimum cut.

    What the source reaches in the rest of the flow is 0.
    """
    scale = CAPACITY / max(float(np.abs(cost).max(initial=0)), float(pair.max(initial=0)), 1e-300)
    source, sink = nodes, nodes + 1
    up, down = np.flatnonzero(cost > 0), np.flatnonzero(cost < 0)
    # x = 1 costs what leads from the source; x = 0 what leads to the sink
    start = np.concatenate([np.full(len(up), source), down, p])
    end = np.concatenate([up, np.full(len(down), sink), q])
    capacity = np.rint(scale * np.concatenate([cost[up], -cost[down], pair])).astype(np.int32)
    graph = sparse.csr_matrix((capacity, (start, end)), shape=(nodes + 2, nodes + 2), dtype=np.int32)
    flow = csgraph.maximum_flow(graph, source, sink).flow
    left = graph - flow
    left.data = np.maximum(left.data, 0)
    left.eliminate_zeros()
    reached = csgraph.breadth_first_order(left, source, return_predecessors=False)
    takes = np.ones(nodes + 2, bool)
    takes[reached] = False
    return takes[:nodes]


MINIMIZERS: dict[str, Callable[[Energy], Minimum | Expansion]] = {
    "messages": sequential_messages, "expansion": alpha_expansion, "modes": conditional_modes, "data": by_data}
