"""Neighbourhoods n(s) of samples in space and time (ma13 §3.2): which samples, and their offsets from s.

A neighbourhood has two parts. Samples that topology or time ties to s, those beside it along its thread or on its
sheet and itself in the frames before and after, stand at fixed offsets and are matched by these ("topological
constraints precede the Hungarian algorithm"). Samples of other elements within the radius are matched by it.

For the tied samples û is the difference of details q, where q(s) = R(s)ᵀ (p(s) - C(s)) is the part of the position
that C(s) does not explain, along the local axes R(s): a bend of C then makes no difference. For the others û is the
difference of positions along the local axes of s.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from synth.elements.samples import Elements

THREADS = min(8, os.cpu_count() or 1)  # each has a frame's neighbours in memory
AT_REST = 100.0  # default weight of the motion of an exemplar that has none
NEAREST_QUANTILE = 0.1  # of the distances to the nearest sample: the spacing of an exemplar


@dataclass(frozen=True)
class Shape:
    """The shape of a neighbourhood (figure 3, Table 2).

    radius   spatial extent, world units
    before   frames before that of s
    after    frames after it: 0 makes the neighbourhood temporally causal
    whole    other samples in all those frames; else (compact) only s itself is
    along    samples on each side along a thread, or in each direction on a sheet: 3 is 7 and 7×7
    most     number of other samples, at most; the nearest are taken
    motion   weight of the motion, the samples tied in time, against the arrangement; see `search.tied_weight`
    sigma    σ_p of Eq. 10, world units (it divides the square of a distance, as printed: length²); inf: no falloff
    sigma_t  σ_t of Eq. 10, frames²
    at_rest  weight of the motion of an exemplar of one frame, which has none; see `search.tied_weight`
    """

    radius: float
    before: int = 0
    after: int = 0
    whole: bool = False
    along: int = 3
    most: int = 24
    motion: float = 0.1
    sigma: float = np.inf
    sigma_t: float = np.inf
    at_rest: float = AT_REST

    def __post_init__(self) -> None:
        if not self.radius > 0 or min(self.before, self.after, self.along) < 0 or not 1 <= self.most <= 32:
            raise ValueError("a neighbourhood has a radius above 0, 0 or more frames, and 1 to 32 other samples")

    @property
    def times(self) -> tuple[int, ...]:
        """Frames, from that of s, in which other samples count."""
        return tuple(range(-self.before, self.after + 1)) if self.whole else (0,)

    def falloff(self, squared: np.ndarray | float, frames: np.ndarray | float = 0.0) -> np.ndarray:
        """κ (Eq. 10) at a squared distance and a distance in frames."""
        return np.exp(-np.asarray(squared) / self.sigma - np.square(frames) / self.sigma_t)


def tied(shape: Shape, grid: tuple[int, ...]) -> np.ndarray:
    """Offsets (F, 3) int32 of the samples tied to s: frames, rows, columns; along a thread only columns."""
    reach = range(-shape.along, shape.along + 1)
    rows = reach if len(grid) == 2 else (0,)
    columns = reach if grid else (0,)
    beside = [(0, v, u) for v in rows for u in columns if (v, u) != (0, 0)]
    trail = [(t, 0, 0) for t in range(-shape.before, shape.after + 1) if t]
    return np.array(beside + trail, np.int32).reshape(-1, 3)


def at_offsets(elements: Elements, offsets: np.ndarray) -> np.ndarray:
    """Index of the sample at each offset (F, 3) from each of the M = T·E·S samples, (M, F), -1 where there is none."""
    frames, count, samples = elements.positions.shape[:3]
    columns = elements.grid[-1] if elements.grid else 1
    rows = samples // columns
    time, _, row, column = np.unravel_index(np.arange(frames * count * samples), (frames, count, rows, columns))
    dt, dv, du = offsets.T if len(offsets) else np.zeros((3, 0), int)
    if frames == 1:
        dt = np.zeros_like(dt)  # an exemplar of one frame stands for all times
    to = [axis[:, None] + step for axis, step in ((time, dt), (row, dv), (column, du))]
    inside = np.ones(to[0].shape, bool)
    for axis, length in zip(to, (frames, rows, columns), strict=True):
        inside &= (axis >= 0) & (axis < length)
    step = dt * count * samples + dv * columns + du
    return np.where(inside, np.arange(len(time))[:, None] + step, -1)


def details(elements: Elements, axes: np.ndarray | None) -> np.ndarray:
    """q(s) = R(s)ᵀ (p(s) - C(s)), (T·E·S, D) float32; axes (T·E·S, D, D) are the R(s), None: the domain's."""
    moved = elements.positions if elements.coarse is None else elements.positions - elements.coarse
    flat = moved.reshape(-1, elements.dimensions)
    return flat.copy() if axes is None else np.einsum("nji,nj->ni", axes, flat)


def spacing(positions: np.ndarray, period: np.ndarray | None = None) -> float:
    """The distance between nearest samples of different elements, the unit of the radii in Table 2.

    positions (T, E, S, D); period (D,) of a toroidal domain. It is a low quantile of the distances of samples to their
    nearest, so that one close pair does not decide.
    """
    frames, count, samples, dims = positions.shape
    if count < 2:
        raise ValueError("one element alone has no spacing")
    found = []
    for frame in np.unique(np.linspace(0, frames - 1, 8).astype(int)):
        points = positions[frame].reshape(-1, dims)
        tree = _tree(points, period)
        distance, index = tree.query(wrapped(points, period), k=min(samples + 1, len(points)))
        others = np.asarray(index) // samples != (np.arange(len(points)) // samples)[:, None]
        nearest = np.where(others, distance, np.inf).min(axis=1)
        found.append(nearest[np.isfinite(nearest)])
    return float(np.quantile(np.concatenate(found), NEAREST_QUANTILE))


def others(positions: np.ndarray, shape: Shape, active: np.ndarray, period: np.ndarray | None = None,
           stretch: float = 1.0) -> np.ndarray:
    """Samples of other elements within the radius, the nearest first: (len(active)·E·S, B·most) int32, -1 for none.

    positions  (T, E, S, D) float32
    active     the frames whose samples are considered; others are searched in the B frames `shape.times` from each
    period     (D,) of a toroidal domain
    stretch    of the radius
    An element counts once, by its nearest sample, where it has several: a neighbouring thread is one neighbour.
    """
    frames, count, samples, dims = positions.shape
    size = count * samples
    found = np.full((len(active), size, len(shape.times), shape.most), -1, np.int32)
    centres = {int(t): positions[t].reshape(-1, dims) for frame in active for t in frame + np.array(shape.times)
               if 0 <= t < frames}

    def find(n: int) -> None:
        for b, time in enumerate(shape.times):
            other = int(active[n]) + time
            if other in trees:
                centre = wrapped(centres[int(active[n])], period)
                found[n, :, b] = _nearest_others(trees[other], centre, shape.radius * stretch, shape.most, samples,
                                                 size)
                found[n, :, b][found[n, :, b] >= 0] += other * size

    # frames are independent: the result does not depend on the number of threads
    with ThreadPoolExecutor(THREADS) as pool:
        trees = dict(zip(centres, pool.map(lambda points: _tree(points, period), centres.values()), strict=True))
        list(pool.map(find, range(len(active))))
    return found.reshape(-1, len(shape.times) * shape.most)


def wrapped(points: np.ndarray, period: np.ndarray | None) -> np.ndarray:
    """Points (M, D) float64 wrapped into one period of a domain; `period` (D,) is 0 along axes that do not repeat."""
    inside = points.astype(np.float64)
    for axis in np.flatnonzero(period) if period is not None else ():
        inside[:, axis] = np.mod(inside[:, axis], period[axis])  # type: ignore[index]
        inside[inside[:, axis] >= period[axis], axis] = 0.0  # type: ignore[index]
    return inside


def _tree(points: np.ndarray, period: np.ndarray | None) -> cKDTree:
    # SciPy: an axis with a box of size 0 does not repeat
    return cKDTree(wrapped(points, period), boxsize=period)


def _nearest_others(tree: cKDTree, centre: np.ndarray, radius: float, most: int, samples: int, size: int) -> np.ndarray:
    """The nearest sample of each of the `most` nearest other elements within the radius, (size, most), -1 for none."""
    queried = min(size, (most + 1) * (1 if samples == 1 else min(samples, 6)) + 1)
    distance, index = tree.query(centre, k=queried, distance_upper_bound=radius)
    distance, index = distance.reshape(size, -1), index.reshape(size, -1)
    own = np.arange(size) // samples
    good = np.isfinite(distance) & (index // samples != own[:, None])
    if samples > 1:
        # of the samples of one element only the first, the nearest, stays
        element = np.where(good, index // samples, -1)
        order = np.argsort(element, axis=1, kind="stable")
        ordered = np.take_along_axis(element, order, axis=1)
        again = np.zeros_like(good)
        np.put_along_axis(again, order[:, 1:], ordered[:, 1:] == ordered[:, :-1], axis=1)
        good &= ~again
    first = np.argsort(~good, axis=1, kind="stable")[:, :most]
    picked = np.where(np.take_along_axis(good, first, axis=1), np.take_along_axis(index, first, axis=1), -1)
    result = np.full((size, most), -1, np.int32)
    result[:, : picked.shape[1]] = picked
    return result
