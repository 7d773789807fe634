"""The photograph carried along the motion (beyond okabe11): what the viewer knows of the picture, its streaks and the
shape of its edges, moves instead of being averaged away.

Carried for long, a picture is torn. So two copies are carried, half a lifetime apart; each begins where it lies in
the photograph, moves for a lifetime of LIFE frames at most, and has no weight when it begins and when it ends. The
lifetimes of different places begin at different times, a smooth noise apart: nothing pulses. After a whole number of
lifetimes all is as it was, so a clip of that length is a loop.

Squares of the weights add up to one. What stands still (`held`) is not carried, and nothing is read from it.
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage

LIFE = 20
"""Frames that a copy lives, about: a whole number of lifetimes fills the loop."""
SCATTER = 24.0
"""σ, pixels, of the noise by which lifetimes begin at different times."""
DETAIL = 8.0
"""σ, pixels: what is coarser than this stays where it is."""
STEPS_A_PIXEL = 1.0
"""Steps of a path for each pixel of the fastest motion."""


def lifetime(length: int) -> int:
    """The frames of a lifetime, so that a loop of `length` frames holds a whole number of them."""
    times = max(1, round(length / LIFE))
    divisors = [k for k in range(1, length + 1) if length % k == 0]
    return length // min(divisors, key=lambda k: (abs(k - times), k))


def paths(motion: np.ndarray, life: int) -> np.ndarray:
    """Where what lies at a pixel was, 0 to `life` frames ago: (life + 1, Y, X, 2) float32, x and y in pixels.

    motion (Y, X, 2), pixels per frame. Backward along the motion by the midpoint rule; within the picture.
    """
    import cv2

    height, width = motion.shape[:2]
    y, x = np.mgrid[:height, :width].astype(np.float32)
    u, v = (np.ascontiguousarray(motion[..., c], np.float32) for c in (0, 1))
    steps = max(1, int(np.ceil(np.hypot(u, v).max() * STEPS_A_PIXEL)))
    h = np.float32(1 / steps)

    def at(field: np.ndarray, px: np.ndarray, py: np.ndarray) -> np.ndarray:
        return np.asarray(cv2.remap(field, px, py, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))

    found = [np.stack([x, y], axis=-1)]
    for _ in range(life):
        for _ in range(steps):
            mx, my = x - h / 2 * at(u, x, y), y - h / 2 * at(v, x, y)
            x, y = x - h * at(u, mx, my), y - h * at(v, mx, my)
        np.clip(x, 0, width - 1, out=x)
        np.clip(y, 0, height - 1, out=y)
        found.append(np.stack([x, y], axis=-1))
    return np.stack(found)


def ages(shape: tuple[int, int], life: int, seed: int) -> np.ndarray:
    """At frame 0, how old the first copy is at each pixel: (Y, X) float32 in [0, life), smooth but for the turn."""
    random = np.random.Generator(np.random.Philox(key=[seed, 1]))
    # a smooth angle, from two smooth numbers: each age is as frequent as any other
    one, other = (ndimage.gaussian_filter(random.standard_normal(shape), SCATTER, mode="nearest") for _ in range(2))
    turn = np.arctan2(one - one.mean(), other - other.mean()) / (2 * np.pi)
    return (life * (turn % 1)).astype(np.float32) % np.float32(life)


def carried(picture: np.ndarray, motion: np.ndarray, length: int, seed: int, held: np.ndarray | None = None,
            ) -> np.ndarray:
    """Frames of a picture (Y, X, C) float32 carried along motion (Y, X, 2): (length, Y, X, C) float32, a loop.

    held  (Y, X) bool: what stands still. It is shown as it is, and no path leads through it

    1. The detail of the picture, what is finer than DETAIL.
    2. For each frame the ages of the two copies, where they come from, and their weights.
    3. The coarse picture and the weighted details.
    """
    import cv2

    # 1. detail
    coarse = _smooth(picture, held)
    detail = np.ascontiguousarray(picture - coarse)
    if held is not None:
        motion = np.where(held[..., None], 0, motion)
        detail[held] = 0
    life = lifetime(length)
    where = paths(motion, life)
    first = ages((picture.shape[0], picture.shape[1]), life, seed)
    frames = np.empty((length, *picture.shape), np.float32)
    rows, columns = np.mgrid[:picture.shape[0], :picture.shape[1]]
    for frame in range(length):
        total = np.zeros_like(picture)
        for half in (0.0, 0.5):
            # 2. ages
            age = (first + np.float32(frame + half * life)) % np.float32(life)
            low = np.minimum(age.astype(int), life - 1)
            part = (age - low.astype(np.float32))[..., None]
            source = where[low, rows, columns] * (1 - part) + where[low + 1, rows, columns] * part
            moved = cv2.remap(detail, source[..., 0], source[..., 1], cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)
            weight = np.sin(np.pi * age / np.float32(life))
            total += weight[..., None] * moved.reshape(picture.shape)
        # 3. together: sin² and cos² add up to one
        frames[frame] = coarse + total
        if held is not None:
            frames[frame][held] = picture[held]
    return frames


def _smooth(picture: np.ndarray, held: np.ndarray | None) -> np.ndarray:
    """picture (Y, X, C) without its detail, read only where it is not held: (Y, X, C) float32."""
    free = np.ones(picture.shape[:2], np.float32) if held is None else (~held).astype(np.float32)
    share = ndimage.gaussian_filter(free, DETAIL, mode="nearest")
    sums = np.stack([ndimage.gaussian_filter(picture[..., c] * free, DETAIL, mode="nearest")
                     for c in range(picture.shape[2])], axis=-1)
    smooth = sums / np.maximum(share, 1e-3)[..., None]
    return np.where(share[..., None] > 1e-3, smooth, picture).astype(np.float32)
