"""Local frames of the coarse motion, and the coordinate transformation (ma09 §3.1 figure 2, §3.3)."""

from __future__ import annotations

import numpy as np

# Below this share of the field's rms the direction of L is noise; the frame turns to the fallback smoothly.
STILL = 1e-3
X_AXIS = np.array([1, 0], np.float32)


def local_frame(L: np.ndarray, along: str = "x") -> np.ndarray:
    """The local x axis of the exemplar in each cell of L (Y, X, 2): unit vectors (Y, X, 2) float32.

    In 2D the frame is completely defined by L: the x axis follows it and the y axis stands 90 degrees on (§3.3).
    With along = "y" the y axis follows it, so that upright motifs rise upright. Where L rests the frame falls back
    on the axes of the domain.
    """
    L = L if along == "x" else np.stack([L[..., 1], -L[..., 0]], axis=-1)
    rms = float(np.sqrt(np.mean(np.sum(L.astype(np.float64) ** 2, axis=-1))))
    if rms == 0.0:
        return np.broadcast_to(X_AXIS, L.shape).copy()
    frame = L / rms + np.float32(STILL) * X_AXIS
    length = np.linalg.norm(frame, axis=-1, keepdims=True)
    return np.where(length > 1e-12, frame / np.maximum(length, 1e-12), X_AXIS).astype(np.float32)


def to_world(H: np.ndarray, frame: np.ndarray) -> np.ndarray:
    """H' = R H: detail (Y, X, 2) from exemplar coordinates to those of the domain (§3.1, CoordinateTransform)."""
    x = frame[..., 0] * H[..., 0] - frame[..., 1] * H[..., 1]
    y = frame[..., 1] * H[..., 0] + frame[..., 0] * H[..., 1]
    return np.stack([x, y], axis=-1)
