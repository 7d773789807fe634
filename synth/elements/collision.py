"""Collisions between elements, the extra solver step of the hybrid (ma13 §4.1, figure 5).

`resolved` pushes points apart, frame by frame. Threads that have passed through each other cannot be separated like
that: one frame would push them to the left and the next to the right. `followed` moves them from frame to frame
instead, in steps so small that none can pass through another.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from synth.elements.neighborhood import wrapped
from synth.elements.search import difference

ROUNDS = 20  # of pushing apart, at most
SLACK = 0.02  # of the radii, by which elements are pushed farther apart than needed: otherwise many would still touch

# threads
BETWEEN = 5  # balls of a thread from one sample to the next
FIRST_STEPS = 120  # from the coarse threads to the first frame
STEP = 0.7  # radii by which the quantile NEARLY_ALL of samples moves in a step from frame to frame, at most
NEARLY_ALL = 0.99
FEWEST = 8  # steps from frame to frame
SETTLE = 4  # rounds of pushing apart in a step
OVERSHOOT = 1.3  # times the push that would separate a pair if there were no other
CLEARANCE = 0.06  # what SLACK is for points
FIRST_PULL = 0.15  # radii in a step, towards the first frame
PULL, FASTEST = 0.25, 0.2  # share of the distance by which a step pulls a free sample; the most, radii
CARRIED = 0.5  # share of the coarse motion in that of samples that touch
LISTED = 0.8  # radii: how much farther away than touching are the balls that a list of neighbours holds


def overlaps(points: np.ndarray, radius: np.ndarray, element: np.ndarray, period: np.ndarray | None = None,
             ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pairs of samples of different elements that interpenetrate: two arrays of indices, and the depths.

    points (M, D), radius (M,) and element (M,) of each sample; period (D,) of a toroidal domain, 0 where it ends.
    """
    inside = wrapped(points, period)
    pairs = cKDTree(inside, boxsize=period).query_pairs(2 * float(radius.max()), output_type="ndarray")
    pairs = pairs[element[pairs[:, 0]] != element[pairs[:, 1]]]
    pairs = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
    away = difference(points[pairs[:, 1]] - points[pairs[:, 0]], period)
    depth = radius[pairs[:, 0]] + radius[pairs[:, 1]] - np.linalg.norm(away, axis=1)
    deep = depth > 0
    return pairs[deep, 0], pairs[deep, 1], depth[deep]


def _pushed(points: np.ndarray, one: np.ndarray, other: np.ndarray, depth: np.ndarray,
            period: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """The displacement (M, D) by which each point is pushed by its pairs, and how many pairs it has (M,)."""
    away = difference(points[other] - points[one], period).astype(np.float64)
    length = np.linalg.norm(away, axis=1, keepdims=True)
    along_x = np.eye(points.shape[1])[0]  # of two in one place
    axis = np.where(length > 1e-9, away / np.maximum(length, 1e-9), along_x)
    push = 0.5 * depth[:, None] * axis
    by = np.stack([np.bincount(other, push[:, d], len(points)) - np.bincount(one, push[:, d], len(points))
                   for d in range(points.shape[1])], axis=-1)
    hits = np.bincount(one, minlength=len(points)) + np.bincount(other, minlength=len(points))
    # the mean push converges slowly with few pairs, the sum overshoots with many
    return by / np.maximum(1.0, hits / 2)[:, None], hits


def resolved(points: np.ndarray, radius: np.ndarray, element: np.ndarray, period: np.ndarray | None = None,
             ) -> np.ndarray:
    """The points (M, D) pushed apart until no two elements interpenetrate, or ROUNDS are over.

    All pairs of a round push at once; a sample moves by about the mean of the pushes of its pairs.
    """
    result = points.astype(np.float64)
    for _ in range(ROUNDS):
        one, other, depth = overlaps(result, (1 + SLACK) * radius, element, period)
        if not len(one):
            break
        result += _pushed(result, one, other, depth, period)[0]
    return result


def followed(coarse: np.ndarray, target: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Threads that follow `target` without passing through each other: (T, E, S, D) float64.

    coarse  (T, E, S, D): threads side by side, which do not interpenetrate; target (T, E, S, D); radius (E,)
    The first frame grows out of the coarse threads, and each frame out of the one before: position-based dynamics
    [Müller et al. 2007], whose constraints are contacts and the lengths of segments, those of the coarse threads.
    What touches moves partly as the coarse threads do, which keep their places in the bundle; what is free is pulled
    to its target, so that it comes back after a contact.
    """
    frames = len(target)
    coarse, target = coarse.astype(np.float64), target.astype(np.float64)
    threads = _Threads(coarse[0], radius, np.linalg.norm(np.diff(coarse, axis=2), axis=-1, keepdims=True).mean(axis=0))
    for step in range(1, FIRST_STEPS + 1):
        threads.pulled(coarse[0] + (target[0] - coarse[0]) * step / FIRST_STEPS, 1.0, FIRST_PULL)
        threads.settle()
    result = np.empty_like(target)
    result[0] = threads.positions
    for t in range(1, frames):
        there, bundle = target[t] - target[t - 1], coarse[t] - coarse[t - 1]
        furthest = float(np.quantile(np.linalg.norm(there, axis=-1), NEARLY_ALL))
        steps = max(FEWEST, int(np.ceil(furthest / (STEP * threads.thick))))
        there, bundle = there / steps, bundle / steps
        for step in range(1, steps + 1):
            threads.positions += np.where(threads.touching, CARRIED * bundle + (1 - CARRIED) * there, there)
            threads.pulled(target[t - 1] + step * there, PULL, FASTEST)
            threads.settle()
        result[t] = threads.positions
    return result


def crossings(threads: np.ndarray, radius: np.ndarray, deep: float = 0.02) -> int:
    """How many pairs of threads (E, S, D) of radius (E,) interpenetrate by more than a share `deep` of a diameter."""
    element = np.repeat(np.arange(len(threads)), (threads.shape[1] - 1) * BETWEEN)
    one, other, depth = overlaps(_balls(threads), radius[element], element)
    through = depth > deep * 2 * radius.mean()
    return len({tuple(sorted(pair)) for pair in zip(element[one[through]], element[other[through]], strict=True)})


def _balls(threads: np.ndarray) -> np.ndarray:
    """Threads (E, S, D) as rows of balls, BETWEEN from one sample to the next: their middles (E·(S - 1)·BETWEEN, D)."""
    share = (np.arange(BETWEEN) / BETWEEN)[:, None]
    balls: np.ndarray = threads[:, :-1, None] * (1 - share) + threads[:, 1:, None] * share
    return balls.reshape(-1, threads.shape[2])


class _Threads:
    """Threads (E, S, D) as they are pushed; `touching` (E, S, 1) bool says which samples have been in the last round.

    Between samples a thread is a row of BETWEEN balls.
    """

    def __init__(self, positions: np.ndarray, radius: np.ndarray, lengths: np.ndarray) -> None:
        count, samples = positions.shape[:2]
        self.positions = positions.copy()
        self.touching = np.zeros((count, samples, 1), bool)
        self.lengths = lengths
        self.thick = float(radius.mean())
        self.element = np.repeat(np.arange(count), (samples - 1) * BETWEEN)
        self.radius = radius[self.element] * (1 + CLEARANCE)
        self.pairs = np.zeros((0, 2), np.intp)
        self.listed: np.ndarray | None = None  # where the balls were when `pairs` was made

    def pulled(self, target: np.ndarray, share: float, most: float) -> None:
        """Move free samples towards `target` by a share of the distance, at most by `most` radii."""
        offset = np.where(self.touching, 0.0, target - self.positions)
        length = np.linalg.norm(offset, axis=-1, keepdims=True)
        self.positions += offset * np.minimum(share, most * self.thick / np.maximum(length, 1e-12))

    def settle(self) -> None:
        """Bring segments back to their lengths and push threads apart."""
        for _ in range(2):
            segment = np.diff(self.positions, axis=1)
            length = np.linalg.norm(segment, axis=-1, keepdims=True)
            change = 0.25 * (1 - self.lengths / np.maximum(length, 1e-12)) * segment
            self.positions[:, :-1] += change
            self.positions[:, 1:] -= change
        for _ in range(SETTLE):
            if not self._push_apart():
                break

    def _push_apart(self) -> bool:
        """One round: the push on each ball is shared by the samples on both sides. Returns whether any touch."""
        count, samples, dims = self.positions.shape
        share = (np.arange(BETWEEN) / BETWEEN)[:, None]
        balls = _balls(self.positions)
        one, other = self._near(balls).T
        away = balls[other] - balls[one]
        depth = self.radius[one] + self.radius[other] - np.sqrt(np.einsum("nd,nd->n", away, away))
        deep = depth > 0
        given, weight = np.zeros_like(self.positions), np.zeros((count, samples, 1))
        if deep.any():
            by, hits = _pushed(balls, one[deep], other[deep], OVERSHOOT * depth[deep])
            by = by.reshape(count, samples - 1, BETWEEN, dims)
            hit = (hits > 0).reshape(count, samples - 1, BETWEEN, 1)
            for at, part in ((slice(0, -1), 1 - share), (slice(1, None), share)):
                given[:, at] += (by * part).sum(axis=2)
                weight[:, at] += (hit * part).sum(axis=2)
        self.positions += given / np.maximum(weight, 0.5)
        self.touching = weight > 0
        return bool(deep.any())

    def _near(self, balls: np.ndarray) -> np.ndarray:
        """Pairs (P, 2) of balls of different threads that may touch: listed anew when a ball has come far enough."""
        margin = LISTED * self.thick
        if self.listed is None or 2 * np.sqrt(((balls - self.listed) ** 2).sum(axis=-1).max()) > margin:
            pairs = cKDTree(balls).query_pairs(2 * float(self.radius.max()) + margin, output_type="ndarray")
            self.pairs = pairs[self.element[pairs[:, 0]] != self.element[pairs[:, 1]]]
            self.listed = balls
        return self.pairs
