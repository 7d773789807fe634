"""Collisions between elements, the extra solver step of the hybrid (ma13 §4.1, figure 5)."""

from __future__ import annotations

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from synth.elements.neighborhood import wrapped
from synth.elements.search import difference

ROUNDS = 20  # of pushing apart, at most
THREAD_ROUNDS = 24
BETWEEN = 5  # balls of a thread from one sample to the next
CALM = 1.0  # frames
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


def _pushed(points: np.ndarray, one: np.ndarray, other: np.ndarray, depth: np.ndarray,
            period: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """The way by which each point (M, D) is pushed by its pairs, and how many these are (M,)."""
    away = difference(points[other] - points[one], period).astype(np.float64)
    length = np.linalg.norm(away, axis=1, keepdims=True)
    along_x = np.eye(points.shape[1])[0]  # of two in one place
    axis = np.where(length > 1e-9, away / np.maximum(length, 1e-9), along_x)
    push = 0.5 * depth[:, None] * axis
    by = np.stack([np.bincount(other, push[:, d], len(points)) - np.bincount(one, push[:, d], len(points))
                   for d in range(points.shape[1])], axis=-1)
    hits = np.bincount(one, minlength=len(points)) + np.bincount(other, minlength=len(points))
    # a mean over few pairs is too timid, a sum over many too bold
    return by / np.maximum(1.0, hits / 2)[:, None], hits


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
        result += _pushed(result, one, other, depth, period)[0]
    return result


def parted(positions: np.ndarray, radius: np.ndarray, grid: tuple[int, ...], calm: float = CALM) -> np.ndarray:
    """Threads (T, E, S, D) pushed apart until none interpenetrate, or THREAD_ROUNDS are over; radius (E,).

    Between samples a thread is a row of BETWEEN balls. What they are pushed by goes to the samples on both sides, and
    is low-passed over `calm` frames (standard deviation): a push that comes and goes with a frame would be jitter.
    """
    result = positions.astype(np.float64)
    frames, count, samples = positions.shape[:3]
    share = np.arange(BETWEEN) / BETWEEN
    balls = np.repeat(radius, (samples - 1) * BETWEEN)
    element = np.repeat(np.arange(count), (samples - 1) * BETWEEN)
    for _ in range(THREAD_ROUNDS):
        push = np.zeros_like(result)
        touched = 0
        for t in range(frames):
            line = result[t]
            points = line[:, :-1, None] * (1 - share)[:, None] + line[:, 1:, None] * share[:, None]
            flat = points.reshape(-1, positions.shape[3])
            one, other, depth = overlaps(flat, balls * (1 + SLACK), element)
            touched += len(one)
            by, hits = _pushed(flat, one, other, depth)
            by = by.reshape(count, samples - 1, BETWEEN, -1)
            given = np.zeros((count, samples, positions.shape[3]))
            weight = np.full((count, samples, 1), 1e-9)
            hit = (hits > 0).reshape(count, samples - 1, BETWEEN, 1)
            for at, part in ((slice(0, -1), 1 - share), (slice(1, None), share)):
                given[:, at] += (by * part[:, None]).sum(axis=2)
                weight[:, at] += (hit * part[:, None]).sum(axis=2)
            push[t] = given / np.maximum(weight, 0.5)
        if not touched:
            break
        if frames > 1:
            push = ndimage.gaussian_filter1d(push, calm, axis=0, mode="nearest")
        result += push
    return result
