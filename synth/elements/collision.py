"""Collisions between elements, the extra solver step of the hybrid (ma13 §4.1, figure 5)."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from synth.elements.neighborhood import wrapped
from synth.elements.search import difference

ROUNDS = 8  # of pushing apart, at most
SLACK = 0.02  # of the radii, by which elements are pushed farther apart than needed: else many would still touch


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


def resolved(points: np.ndarray, radius: np.ndarray, element: np.ndarray, period: np.ndarray | None = None,
             ) -> np.ndarray:
    """The points (M, D) pushed apart until no two elements interpenetrate, or ROUNDS are over.

    All pairs of a round push at once; a sample goes by the mean of what its pairs ask.
    """
    result = points.astype(np.float64)
    for _ in range(ROUNDS):
        one, other, depth = overlaps(result, (1 + SLACK) * radius, element, period)
        if not len(one):
            break
        away = difference(result[other] - result[one], period).astype(np.float64)
        length = np.linalg.norm(away, axis=1, keepdims=True)
        axis = np.zeros(points.shape[1])
        axis[0] = 1.0
        push = 0.5 * depth[:, None] * np.where(length > 1e-9, away / np.maximum(length, 1e-9), axis)
        count = np.bincount(one, minlength=len(points)) + np.bincount(other, minlength=len(points))
        for d in range(points.shape[1]):
            moved = (np.bincount(other, push[:, d], len(points)) - np.bincount(one, push[:, d], len(points)))
            # a mean over few pairs is too timid, a sum over many too bold
            result[:, d] += moved / np.maximum(1, count / 2)
    return result
