"""Bundles of threads: their section, and one thread's motion duplicated to all (ma13 §6.2)."""

from __future__ import annotations

import numpy as np


def section(count: int, spacing: float) -> np.ndarray:
    """Places (count, 2) of threads in a bundle's section, world units: the innermost of a hexagonal grid round 0."""
    reach = int(np.ceil(np.sqrt(count))) + 2
    column, row = (axis.ravel() for axis in np.meshgrid(np.arange(-reach, reach + 1), np.arange(-reach, reach + 1)))
    grid = np.stack([column + 0.5 * (row % 2), row * np.sqrt(3) / 2], 1)
    # off the grid's symmetries, so that no two are as near the middle
    order = np.argsort(((grid - [0.23, 0.16]) ** 2).sum(1), kind="stable")[:count]
    return (grid[order] - grid[order].mean(0)) * spacing


def straight(places: np.ndarray, samples: int, length: float) -> np.ndarray:
    """Straight threads (E, samples, 3) along +z from places (E, 2), samples equally far apart."""
    z = np.broadcast_to(np.linspace(0, length, samples)[None, :, None], (len(places), samples, 1))
    return np.concatenate([np.broadcast_to(places[:, None], (len(places), samples, 2)), z], -1)
