"""Dynamic boundaries of fire and smoke (okabe11 §6, fig. 10).

"We repeatedly synthesize the time-varying alpha matte B_i: B_{i+1} = τ W_i(B_i) + (1 - τ) α, where B_1 is equal to α
and τ controls the dynamics of B_i. We also apply an area-preserving adjustment each time B_i is computed."
"""

from __future__ import annotations

import numpy as np

NEAR = 5
"""Pixels round a hidden one from which the background is made up."""
ROUNDS = 30
"""Halvings that find the shift which keeps the area."""


def dynamic_matte(matte: np.ndarray, motion: np.ndarray, dynamics: float) -> np.ndarray:
    """The matte in each frame of a loop: (T, Y, X) float32 in 0..1, all of one area.

    matte     (Y, X) in 0..1, α
    motion    (T, Y, X, 2), pixels per frame: of each frame, a loop
    dynamics  τ, 0..1: 0 stands still
    Two laps: the second begins as the first ended, and what is left of the difference is mixed away over the lap.
    Raises ValueError unless 0 <= τ < 1.
    """
    if not 0 <= dynamics < 1:
        raise ValueError(f"the dynamics of a matte are in [0, 1), not {dynamics}")
    alpha = matte.astype(np.float32)
    area = float(alpha.sum(dtype=np.float64))
    laps, now = [], alpha
    for _ in range(2):
        lap = []
        for velocity in motion:
            lap.append(now)
            now = _with_area(dynamics * _moved(now, velocity) + (1 - np.float32(dynamics)) * alpha, area)
        laps.append(np.stack(lap))
    first, second = laps[1], now
    part = (np.arange(len(first)) / len(first)).astype(np.float32)[:, None, None]
    # after the lap comes `second` where `first[0]` should be
    return np.stack([_with_area(frame, area) for frame in first + part * (first[0] - second)])


def _moved(values: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """values (Y, X) one frame later."""
    import cv2

    y, x = np.mgrid[:values.shape[0], :values.shape[1]].astype(np.float32)
    u, v = (np.ascontiguousarray(velocity[..., c], np.float32) for c in (0, 1))
    return np.asarray(cv2.remap(values, x - u, y - v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))


def _with_area(values: np.ndarray, area: float) -> np.ndarray:
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
