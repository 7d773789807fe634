"""The final motion F = upsample(L) + omega H' (ma09 §3.5, pseudocode 1: Combine).

It needs no re-synthesis: omega is tuned on H' that is already there.
"""

from __future__ import annotations

import numpy as np

from synth.motion.coarse import upsample
from synth.projection import project
from synth.smoke import vorticity

WEIGHTS = ("kinetic-energy", "vorticity")
"""What omega may follow: |L|^2 / 2 [Kim et al. 2008] or |curl L| [Fedkiw et al. 2001]."""


def combine(L: np.ndarray, H: np.ndarray, omega: float, weight: str | None = None,
            projection: str | None = None, distance: np.ndarray | None = None) -> np.ndarray:
    """F = upsample(L) + omega * weight * H.

    L           (Y, X, 2) or (Z, Y, X, 3) float32, cells per frame of its own, coarser grid
    H           H' of the paper: the detail in world axes, after the coordinate transform, on the output grid (its
                magnitude is the exemplar's, at most about 1)
    omega       cells per frame of the output grid where |H| = 1
    weight      None: omega everywhere; "kinetic-energy" or "vorticity": in proportion to that of L, with mean omega
                over the domain (zero where L is zero throughout)
    projection  None, or the border ("wall", "open", "toroidal") of the projection of F (§3.6)
    distance    cells to the wall of an obstacle, negative inside, that the projection lets nothing flow through
    Returns F, H's shape, float32, cells per frame of the output grid.
    """
    shape = H.shape[:-1]
    coarse = upsample(L, shape)
    if coarse.shape != H.shape:
        raise ValueError(f"a coarse motion of shape {L.shape} and a detail of shape {H.shape} do not combine")
    if not np.isfinite(omega):
        raise ValueError(f"omega must be finite, not {omega}")
    F = coarse + np.float32(omega) * H if weight is None else (
        coarse + np.float32(omega) * weight_of(coarse, weight)[..., None] * H)
    return F if projection is None else project(F, projection, distance)


def weight_of(v: np.ndarray, weight: str) -> np.ndarray:
    """Kinetic energy or vorticity magnitude of v, divided by its mean over the domain: (Y, X) or (Z, Y, X)."""
    if weight not in WEIGHTS:
        raise ValueError(f"weight {weight!r} is none of {', '.join(WEIGHTS)}")
    if weight == "kinetic-energy":
        value = 0.5 * (v * v).sum(-1)
    else:
        curl = vorticity(v)
        value = np.abs(curl) if v.ndim == 3 else np.linalg.norm(curl, axis=-1)
    mean = value.mean(dtype=np.float64)
    return (value / mean).astype(np.float32) if mean > 0 else np.zeros_like(value)
