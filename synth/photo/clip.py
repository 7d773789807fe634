"""A clip: frames of one fluid that repeat, with the true velocity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Clip:
    """Frames of a fixed camera; after the last comes the first. Row 0 is the lowest, y points up.

    luma      (T, Y, X) uint8, display-encoded grey
    velocity  (Y, X, 2) float32, pixels per frame: the mean true velocity of what moves there, 0 where nothing does
    coverage  (Y, X) float32 in [0, 1]: the share of a pixel that shows fluid, mean over time
    chroma    (T, Y, X, 3) uint8 sRGB, for fire; None: grey
    """

    luma: np.ndarray
    velocity: np.ndarray
    coverage: np.ndarray
    chroma: np.ndarray | None = None


KNEE = 0.75


def film(grey: np.ndarray) -> np.ndarray:
    """Display values that approach white above KNEE and never reach it, as on film: glints keep their shape."""
    above = np.maximum(grey - KNEE, 0) / (1 - KNEE)
    return np.minimum(grey, KNEE) + (1 - KNEE) * above / (1 + above)


def eight_bit(grey: np.ndarray) -> np.ndarray:
    """Display values in [0, 1] as uint8, rounded."""
    return np.clip(np.rint(grey * 255), 0, 255).astype(np.uint8)
