"""Bundles of threads: their section, and one thread's motion duplicated to all (ma13 §6.2)."""

from __future__ import annotations

import numpy as np

from synth.elements.mesh import carried_along
from synth.elements.samples import Elements

TIGHTEST = 0.8  # share by which the innermost thread of a bent bundle may be shorter than the middle


def section(count: int, spacing: float) -> np.ndarray:
    """Places (count, 2) of threads in a bundle's section, world units: the innermost of a hexagonal grid round 0."""
    reach = int(np.ceil(np.sqrt(count))) + 2
    column, row = (axis.ravel() for axis in np.meshgrid(np.arange(-reach, reach + 1), np.arange(-reach, reach + 1)))
    grid = np.stack([column + 0.5 * (row % 2), row * np.sqrt(3) / 2], 1)
    # off the grid's symmetries, so that no two are equally near the middle
    order = np.argsort(((grid - [0.23, 0.16]) ** 2).sum(1), kind="stable")[:count]
    return (grid[order] - grid[order].mean(0)) * spacing


def straight(places: np.ndarray, samples: int, length: float) -> np.ndarray:
    """Straight threads (E, samples, 3) along +z from places (E, 2), samples at equal distances."""
    z = np.broadcast_to(np.linspace(0, length, samples)[None, :, None], (len(places), samples, 1))
    return np.concatenate([np.broadcast_to(places[:, None], (len(places), samples, 2)), z], -1)


def duplicated(curve: np.ndarray, count: int, spacing: float = 1.0, radius: float = 0.38, rate: float = 24.0
               ) -> Elements:
    """One thread's motion given to all of a bundle (ma13 §6.2: "simply duplicate the motion to all the other output
    noodles to get the coarse control").

    curve    (T, S, 3), S ≥ 3, world units; its samples are at equal distances
    spacing  of the threads in the bundle's section, radius of a thread, world units
    The section is carried along the curve with the least rotation, so that threads neither cross nor spread where the
    curve bends, while its radius of curvature exceeds the bundle's thickness; in sharper bends they are drawn together,
    no nearer than half their spacing. Positions are their own `coarse`.
    Raises ValueError for a curve of another shape, that is not finite or stands still in a point, or count < 1.
    """
    middle = np.asarray(curve, np.float64)
    if middle.ndim != 3 or middle.shape[2] != 3 or middle.shape[1] < 3:
        raise ValueError(f"the motion of a thread is (frames, samples, 3) of 3 samples or more, not {middle.shape}")
    if count < 1 or not (spacing > 0 and radius > 0):
        raise ValueError("a bundle has one thread or more, and a spacing and a radius above 0, "
                         f"not {count}, {spacing} and {radius}")
    bad = np.argwhere(~np.isfinite(middle))
    if len(bad):
        raise ValueError(f"the motion of the thread: frame {bad[0][0] + 1}, sample {bad[0][1] + 1} is not finite")
    tangent = np.gradient(middle, axis=1)
    length = np.linalg.norm(tangent, axis=2, keepdims=True)
    if not (length > 0).all():
        raise ValueError("the motion of the thread: two of its samples are in one place")
    tangent /= length
    side = carried_along(middle, tangent)
    other = np.cross(tangent, side)
    places = section(count, spacing)
    offset = places[:, 0, None, None] * side[:, None] + places[:, 1, None, None] * other[:, None]
    # curvature × offset towards its centre is the share by which a thread is shorter there; at 1 it would reverse
    bend = np.gradient(tangent, axis=1) / length
    shorter = (offset * bend[:, None]).sum(-1).max(1)[:, None, :, None]
    drawn = np.minimum(1, TIGHTEST / np.maximum(shorter, 1e-9))
    positions = (middle[:, None] + offset * np.maximum(drawn, 0.5)).astype(np.float32)
    return Elements(positions, (middle.shape[1],), rate, size=np.full(count, radius),
                    colour=np.tile([0.93, 0.80, 0.54], (count, 1)), coarse=positions)
