"""Statistics by which an output is compared with its exemplar: pair correlation, motion spectrum, nearest distance, and
jitter (ma13 §4.2).

All take positions (T, E, S, D), world units, and treat an element as the mean of its samples.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from synth.elements.neighborhood import wrapped

BINS = 24  # of the pair correlation, up to REACH
REACH = 3.0  # nearest distances
SMOOTH = 0.75  # bins, by which it is smoothed: small exemplars have few pairs
FRAMES = 12  # of an animation that are measured, at most


@dataclass(frozen=True)
class Statistics:
    """What is compared.

    correlation  (BINS,) g at radii up to REACH nearest distances: 1 where elements are independent of each other
    spectrum     power of the velocity by frequency, (T // 2,); empty of what does not move
    nearest      mean distance to the nearest element
    """

    correlation: np.ndarray
    spectrum: np.ndarray
    nearest: float


def statistics(positions: np.ndarray, spacing: float, period: np.ndarray | None = None,
               depth: Callable[[np.ndarray], np.ndarray] | None = None, carried: np.ndarray | None = None,
               ) -> Statistics:
    """Of an exemplar or an output.

    spacing  the exemplar's nearest distance, by which radii are measured
    period   (D,) of what repeats, 0 along axes that end
    depth    of points (M, D) in their domain; those nearer to its border than REACH are left out,
             so that the border does not count as empty space. None: all are used
    carried  like positions: how far a global flow has carried each, which is not its own motion
    """
    points = positions.mean(axis=2).astype(np.float64)
    reach = REACH * spacing
    counts, measured, nearest, density = np.zeros(BINS), 0, [], []
    for t in np.unique(np.linspace(0, len(points) - 1, FRAMES).astype(int)):
        now = wrapped(points[t], period)
        tree = cKDTree(_repeated(now, period, reach))
        inner = np.arange(len(now)) if depth is None else np.flatnonzero(depth(now) > reach)
        if not len(inner):
            continue
        distance = tree.query(now[inner], k=2)[0][:, 1]
        nearest.append(distance)
        pairs = tree.sparse_distance_matrix(cKDTree(now[inner]), reach, output_type="coo_matrix")
        distances = pairs.data[pairs.data > 0]
        counts += np.histogram(distances, bins=BINS, range=(0, reach))[0]
        density.append(len(distances) / len(inner))
        measured += len(inner)
    if not measured:
        raise ValueError("no element lies deep enough in the domain to be measured")
    edges = np.linspace(0, reach, BINS + 1)
    counts = ndimage.gaussian_filter1d(counts, SMOOTH, mode="nearest")
    shell = np.diff(edges ** points.shape[2])
    # normalized by the number within REACH: density is compared separately
    correlation = counts / measured / shell * reach ** points.shape[2] / max(float(np.mean(density)), 1e-9)
    return Statistics(correlation, spectrum(positions if carried is None else positions - carried),
                      float(np.mean(np.concatenate(nearest))))


def _repeated(points: np.ndarray, period: np.ndarray | None, reach: float) -> np.ndarray:
    """The points (M, D) of one period, and their copies in all directions as far as `reach` (even many periods)."""
    for axis in np.flatnonzero(period) if period is not None else ():
        unit = float(period[axis])  # type: ignore[index]
        many = int(np.ceil(reach / unit))
        along = np.eye(points.shape[1])[axis] * unit
        points = np.concatenate([points + n * along for n in range(-many, many + 1)])
        points = points[(points[:, axis] >= -reach) & (points[:, axis] <= unit + reach)]
    return points


def spectrum(positions: np.ndarray) -> np.ndarray:
    """Power of the elements' own velocity by frequency, (T // 2,), without the mean motion."""
    if len(positions) < 4:
        return np.zeros(0)
    velocity = np.diff(positions.mean(axis=2).astype(np.float64), axis=0)
    velocity -= velocity.mean(axis=(0, 1))
    window = np.hanning(len(velocity) + 2)[1:-1, None, None]
    return np.mean(np.sum(np.abs(np.fft.rfft(velocity * window, axis=0)) ** 2, axis=2), axis=1)


def difference(one: np.ndarray, other: np.ndarray) -> float:
    """The difference of two functions: the mean absolute difference over the mean of the first; 0 for empty ones.

    Functions of different lengths are compared at the length of the first: both are spectra over the same frequencies.
    """
    if not len(one) or not len(other):
        return 0.0
    if len(one) != len(other):
        other = np.interp(np.linspace(0, 1, len(one)), np.linspace(0, 1, len(other)), other) * len(one) / len(other)
    return float(np.abs(one - other).mean() / max(float(np.abs(one).mean()), 1e-30))


def jitter(positions: np.ndarray) -> float:
    """Mean squared acceleration of the samples, world units² per frame⁴ (§4.2)."""
    if len(positions) < 3:
        return 0.0
    return float(np.mean(np.sum(np.diff(positions.astype(np.float64), n=2, axis=0) ** 2, axis=-1)))
