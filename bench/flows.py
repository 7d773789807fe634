"""The coarse motions of the tables: a constant diagonal, and a curved one."""

from __future__ import annotations

import numpy as np


def diagonal(n: int) -> np.ndarray:
    """A constant flow, 31 degrees up: (n, n, 2) float32, cells per frame."""
    return np.broadcast_to(np.float32([1, 0.6]), (n, n, 2)).copy()


def wave(n: int) -> np.ndarray:
    """A flow along x that swings up and down by 39 degrees, once over the domain: (n, n, 2) float32."""
    swing = 0.8 * np.sin(2 * np.pi * np.arange(n) / n)
    return np.stack([np.ones((n, n)), np.broadcast_to(swing, (n, n))], axis=-1).astype(np.float32)


FLOWS = {"diagonal": diagonal, "wave": wave}
