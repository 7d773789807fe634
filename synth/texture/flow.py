"""The flow that a texture follows: its direction, its speed within limits, and motion along it (wang05 §2.2, §3).

Velocities v are (Y, X, 2) float32, pixels per frame. A pixel rests where its speed is zero, or no number.
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage

RELAXATIONS = 16
"""Steps of smoothing of the direction where v rests."""


def angles(v: np.ndarray, fallback: float = 0.0) -> np.ndarray:
    """Direction of v at each pixel: (Y, X) float32, radians in (-π, π].

    Where v rests, the direction of what moves around it, smoothly; `fallback` where nothing moves at all.
    """
    u, moving = _unit(v)
    if not moving.any():
        return np.full(v.shape[:2], fallback, np.float32)
    if not moving.all():
        u = _continued(u, moving)
    return np.arctan2(u[..., 1], u[..., 0]).astype(np.float32)


def limited(v: np.ndarray, least: float, most: float) -> np.ndarray:
    """v with its speed brought into [least, most] and its direction kept: (Y, X, 2) float32.

    "We limit the velocity of every pixel within a range ... to make sure that the texture cannot move too fast or too
    slow" (wang05 §3). A pixel at rest has no direction to keep, and rests. Raises ValueError unless
    0 <= least <= most, most positive.
    """
    if not (0 <= least <= most and 0 < most < np.inf):
        raise ValueError(f"speeds are limited to 0 <= least <= most, not {least} and {most}")
    u, moving = _unit(v)
    speed = np.hypot(v[..., 0], v[..., 1], dtype=np.float64)
    speed = np.where(moving, np.clip(speed, least, most), 0)
    return (u * speed[..., None]).astype(np.float32)


def normalized(v: np.ndarray, speed: float) -> np.ndarray:
    """v with one speed wherever it moves (wang05 §3, "normalized velocity"): (Y, X, 2) float32, pixels per frame.

    Raises ValueError unless the speed is positive and finite.
    """
    return limited(v, speed, speed)


def gradient_of_angle(v: np.ndarray) -> np.ndarray:
    """∂θ/∂x, ∂θ/∂y of the direction θ of v: (Y, X, 2) float32, radians per pixel.

    From v itself, ∂θ = (v_x ∂v_y - v_y ∂v_x) / |v|², which knows no jump from π to -π; zero where v rests. Differences
    are central, at the border one-sided; a flow linear in x and y is exact. Raises ValueError for a field of less than
    2 x 2 pixels.
    """
    if min(v.shape[:2]) < 2:
        raise ValueError(f"the gradient of a direction needs 2 x 2 pixels, not {v.shape[1]} x {v.shape[0]}")
    moving = _unit(v)[1]
    w = np.where(moving[..., None], v, 0).astype(np.float64)
    squared = np.where(moving, (w * w).sum(-1), 1)
    along: tuple[np.ndarray, np.ndarray] = (np.gradient(w, axis=1), np.gradient(w, axis=0))
    gradient = np.stack([(w[..., 0] * d[..., 1] - w[..., 1] * d[..., 0]) / squared for d in along], axis=-1)
    return np.where(moving[..., None], gradient, 0).astype(np.float32)


def at(v: np.ndarray, points: np.ndarray) -> np.ndarray:
    """A field (Y, X) or (Y, X, C) at points (M, 2), x and y in pixels: (M,) or (M, C) float32.

    Bilinear; pixel centres are at integers; a point outside has the value of the nearest place inside.
    """
    height, width = v.shape[:2]
    x = np.clip(points[:, 0].astype(np.float64), 0, width - 1)
    y = np.clip(points[:, 1].astype(np.float64), 0, height - 1)
    i, j = np.minimum(x.astype(int), max(width - 2, 0)), np.minimum(y.astype(int), max(height - 2, 0))
    right, up = np.minimum(i + 1, width - 1), np.minimum(j + 1, height - 1)
    shape = (-1, *(1,) * (v.ndim - 2))
    fx, fy = (x - i).reshape(shape), (y - j).reshape(shape)
    below = v[j, i] * (1 - fx) + v[j, right] * fx
    above = v[up, i] * (1 - fx) + v[up, right] * fx
    return (below * (1 - fy) + above * fy).astype(np.float32)


def midpoint(v: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Points (M, 2) one frame later, by the midpoint rule: (M, 2) float64. With -v, one frame earlier."""
    half = points + 0.5 * at(v, points).astype(np.float64)
    return points + at(v, half).astype(np.float64)


def _unit(v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """v over its speed (Y, X, 2) float64, zero where it rests; and where it moves (Y, X) bool."""
    if v.ndim != 3 or v.shape[2] != 2:
        raise ValueError(f"a flow is (Y, X, 2), not of shape {v.shape}")
    speed = np.hypot(v[..., 0], v[..., 1], dtype=np.float64)
    moving = np.isfinite(speed) & (speed > 0)
    u = np.where(moving[..., None], v, 0) / np.where(moving, speed, 1)[..., None]
    return u, moving


def _continued(u: np.ndarray, moving: np.ndarray) -> np.ndarray:
    """Directions u (Y, X, 2), given where `moving`, for every pixel.

    1. Coarser and coarser means of what moves, until no pixel is without.
    2. Back, level by level: a pixel that rests takes the coarser level's direction, bilinear.
    3. Relaxation, so that the seam between levels vanishes.
    """
    nearest = ndimage.distance_transform_edt(~moving, return_distances=False, return_indices=True)
    levels = [(u, moving.astype(np.float64))]
    while (levels[-1][1] == 0).any() and min(levels[-1][1].shape) > 1:
        sums, weight = levels[-1]
        padded = np.pad(np.concatenate([sums, weight[..., None]], -1), [(0, n % 2) for n in weight.shape] + [(0, 0)])
        halved = padded[::2, ::2] + padded[1::2, ::2] + padded[::2, 1::2] + padded[1::2, 1::2]
        levels.append((halved[..., :2], halved[..., 2]))
    filled = levels[-1][0] / np.maximum(levels[-1][1], 1)[..., None]
    for sums, weight in levels[-2::-1]:
        y, x = np.mgrid[:weight.shape[0], :weight.shape[1]]
        points = np.stack([(x.ravel() - 0.5) / 2, (y.ravel() - 0.5) / 2], axis=-1)
        coarse = at(filled, points).reshape(*weight.shape, 2)
        filled = np.where(weight[..., None] > 0, sums / np.maximum(weight, 1)[..., None], coarse)
    for _ in range(RELAXATIONS):
        mean = sum(np.roll(np.pad(filled, ((1, 1), (1, 1), (0, 0)), mode="edge"), s, a)[1:-1, 1:-1]
                   for s in (1, -1) for a in (0, 1)) / 4
        filled = np.where(moving[..., None], u, mean)
    # in the middle of a vortex the directions cancel: there any will do
    return np.where(np.linalg.norm(filled, axis=-1, keepdims=True) > 1e-4, filled, u[tuple(nearest)])
