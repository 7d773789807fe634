"""Dynamic boundaries of fire and smoke (okabe11 §6, fig. 10).

"We repeatedly synthesize the time-varying alpha matte B_i: B_{i+1} = τ W_i(B_i) + (1 - τ) α, where B_1 is equal to α
and τ controls the dynamics of B_i. We also apply an area-preserving adjustment each time B_i is computed."

A matte that is mixed so becomes soft, and stands where the motion is steady (`mixed`). Ours is displaced (`displaced`),
and the fluid with it: by what the motion of the clips differs from its mean, carried along that mean, so that a flame
licks and a wave of smoke rises:

    D_{i+1} = τ W(D_i + M_i - M)    B_i = α(x - D_i)
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

FORGOTTEN = 0.05
"""What may be left of the start of a loop."""
NEAR = 5
"""Pixels round a hidden one from which the background is made up."""
ROUNDS = 30
"""Halvings that find the shift which keeps the area."""


def mixed(matte: np.ndarray, motion: np.ndarray, dynamics: float) -> np.ndarray:
    """The matte in each frame of a loop: (T, Y, X) float32 in 0..1, all of one area.

    matte     (Y, X) in 0..1, α
    motion    (T, Y, X, 2), pixels per frame: of each frame, a loop
    dynamics  τ, 0..1: 0 stands still
    Raises ValueError unless 0 <= τ < 1.
    """
    if not 0 <= dynamics < 1:
        raise ValueError(f"the dynamics of a matte are in [0, 1), not {dynamics}")
    alpha = matte.astype(np.float32)
    area = float(alpha.sum(dtype=np.float64))
    found = _loop(alpha, motion, dynamics, lambda now, velocity: with_area(
        dynamics * _moved(now, velocity) + (1 - np.float32(dynamics)) * alpha, area))
    return np.stack([with_area(frame, area) for frame in found])


def displacements(mean: np.ndarray, changes: np.ndarray, dynamics: float) -> np.ndarray:
    """How far the fluid is from its place in each frame of a loop: D (T, Y, X, 2) float32, pixels.

    mean      (Y, X, 2), pixels per frame: the motion that carries waves on, M
    changes   (T, Y, X, 2), pixels per frame: what the motion of each frame differs from its mean, M_i - M, a loop
    dynamics  τ, 0..1: how long a displacement lasts, 1 / (1 - τ) frames
    Raises ValueError unless 0 <= τ < 1.
    """
    if not 0 <= dynamics < 1:
        raise ValueError(f"the dynamics of a matte are in [0, 1), not {dynamics}")
    tau = np.float32(dynamics)
    start = np.zeros(mean.shape, np.float32)
    return _loop(start, changes, dynamics, lambda now, change: tau * _moved(now + change, mean))


def displaced(values: np.ndarray, by: np.ndarray) -> np.ndarray:
    """values (Y, X[, C]) float32 where they are when displaced by D (Y, X, 2), pixels."""
    return _moved(values, by)


def _loop(start: np.ndarray, steps: np.ndarray, dynamics: float, following: Callable[..., np.ndarray]) -> np.ndarray:
    """The states of a recursion through a loop of steps (T, …), as a loop: (T, …).

    As many laps as it takes until the start is forgotten, of which `dynamics` is left in each step; what is left of the
    difference is mixed away over the last.
    """
    length = len(steps)
    laps = 2 if dynamics == 0 else max(2, 1 + int(np.ceil(np.log(FORGOTTEN) / (length * np.log(dynamics)))))
    now, lap = start, np.empty((length, *start.shape), np.float32)
    for _ in range(laps):
        for number, step in enumerate(steps):
            lap[number] = now
            now = following(now, step)
    part = (np.arange(length) / length).astype(np.float32).reshape(-1, *(1,) * start.ndim)
    # after the lap comes `now` where `lap[0]` should be
    return np.asarray(lap + part * (lap[0] - now))


def _moved(values: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """values (Y, X[, C]) moved by a velocity (Y, X, 2)."""
    import cv2

    y, x = np.mgrid[:values.shape[0], :values.shape[1]].astype(np.float32)
    u, v = (np.ascontiguousarray(velocity[..., c], np.float32) for c in (0, 1))
    return np.asarray(cv2.remap(values, x - u, y - v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))


def with_area(values: np.ndarray, area: float) -> np.ndarray:
    """values (Y, X) shifted and cut to 0..1 so that their sum is `area`, where a shift of its edges can do that."""
    soft = (values > 1e-3) & (values < 1 - 1e-3)
    if not soft.any():
        return np.clip(values, 0, 1)
    low, high = -1.0, 1.0
    for _ in range(ROUNDS):
        shift = (low + high) / 2
        if np.clip(np.where(soft, values + np.float32(shift), values), 0, 1).sum(dtype=np.float64) < area:
            low = shift
        else:
            high = shift
    return np.clip(np.where(soft, values + np.float32((low + high) / 2), values), 0, 1).astype(np.float32)


def inpainted(picture: np.ndarray, matte: np.ndarray) -> np.ndarray:
    """A background for a picture (Y, X, 3) float32 in 0..1: what the matte (Y, X) hides is made up from its borders.

    By the method of Telea 2004. Where the matte covers all there is nothing to go by, and the picture is returned. The
    paper's was painted by hand, "less than 10 min".
    """
    import cv2

    hidden = matte > 0.02
    if hidden.all() or not hidden.any():
        return picture
    bytes_ = np.ascontiguousarray(np.rint(255 * np.clip(picture, 0, 1)), np.uint8)
    found = cv2.inpaint(bytes_, hidden.astype(np.uint8), NEAR, cv2.INPAINT_TELEA)
    return np.where(hidden[..., None], found.astype(np.float32) / 255, picture)
