"""Potential synthesis in 2-D (ma09 §3.6, "Discussion"): the stream function ψ is synthesized, not the motion.

The exemplar's ψ is a scalar, synthesized like a texture of one channel: only its neighbourhoods are rotated by the
local axes, its values need no coordinate transformation. H' = curl ψ has no divergence by construction, whatever the
axes do, and ψ ramped down to zero at a wall lets nothing through it [Bridson et al. 2007, §2.4]. What that costs:
a match weighs by the size of ψ, so wide features count for more and edges for less; and where matches disagree, the
seam in ψ becomes a jet along it.

    ψ  potential, in cells times the exemplar's unit      curl ψ = (∂ψ/∂y, -∂ψ/∂x)
"""

from __future__ import annotations

import numpy as np

from synth.motion import detail
from synth.motion.detail import MARGIN, Settings, State
from synth.wake import ramp

# the potential is zero where the exemplar is slower than this share of its rms
RESTING = 0.1
# modes that nearly alternate from cell to cell, whose slopes central differences see at less than this share, are left
# out: their potential would be all noise
UNSEEN = 0.1
# ψ is ramped down to a wall within these cells, half the width of the narrowest neighbourhood, and to zero one cell
# before it, so that the differences at the wall see nothing else
WALL = 4.0


def potential(exemplar: np.ndarray) -> tuple[np.ndarray, float]:
    """ψ (N, M, 1) float32 with curl ψ = exemplar (N, M, 2), toroidal, and the share of its rms that has no ψ.

    The exact projection on the motions that are curls by central differences. Lost are sources and sinks, the mean
    motion (its ψ is no tile) and what alternates from cell to cell. ψ is zero where the exemplar rests. Raises
    ValueError if less than a tenth of the exemplar's rms is left.
    """
    values = exemplar.astype(np.float64)
    rows, columns = values.shape[:2]
    spectrum = np.fft.fft2(values, axes=(0, 1))
    angle_y, angle_x = 2 * np.pi * np.fft.fftfreq(rows)[:, None], 2 * np.pi * np.fft.fftfreq(columns)[None, :]
    slope_y, slope_x = 1j * np.sin(angle_y), 1j * np.sin(angle_x)
    squared = np.abs(slope_x) ** 2 + np.abs(slope_y) ** 2
    seen = squared > UNSEEN**2 * (angle_x**2 + angle_y**2)
    psi = (np.conj(slope_y) * spectrum[..., 0] - np.conj(slope_x) * spectrum[..., 1]) / np.where(seen, squared, 1)
    psi = np.fft.ifft2(np.where(seen, psi, 0)).real
    rms = np.sqrt(np.mean(values**2))
    around = np.stack([np.roll(psi, -1, 0) - np.roll(psi, 1, 0), np.roll(psi, 1, 1) - np.roll(psi, -1, 1)], -1) / 2
    lost = float(np.sqrt(np.mean((values - around) ** 2)) / rms)
    if np.sqrt(np.mean(around**2)) < 0.1 * rms:
        raise ValueError("the exemplar has next to no curl: there is no potential to synthesize")
    rest = 1 / (np.sum(values**2, axis=-1) + (RESTING * rms) ** 2)
    psi -= np.sum(psi * rest) / np.sum(rest)
    return psi[..., None].astype(np.float32), lost


def curl(psi: np.ndarray) -> np.ndarray:
    """(∂ψ/∂y, -∂ψ/∂x) of ψ (Y, X, 1), per cell, by central differences, one-sided at the border: (Y, X, 2).

    Its divergence by central differences is zero to rounding inside.
    """
    dy, dx = np.gradient(psi[..., 0], axis=(0, 1))
    return np.stack([dy, -dx], axis=-1)


class Synthesis(detail.Synthesis):
    """Synthesizes ψ frame by frame, as `synth.motion.detail` does H; a State's H is ψ (Y, X, 1), with its margin.

    exemplar (N, M, 2) float32; shape (Y, X) of the output; distance (Y, X) to the wall of an obstacle, cells, negative
    inside. `lost` is the share of the exemplar's rms that has no potential.
    """

    def __init__(self, exemplar: np.ndarray, shape: tuple[int, int], settings: Settings, seed: int,
                 distance: np.ndarray | None = None):
        psi, self.lost = potential(exemplar)
        super().__init__(psi, shape, settings, seed)
        self.open = None
        if distance is not None:
            self.open = np.maximum(ramp((np.pad(distance, MARGIN, mode="edge") - 1) / WALL), 0)[..., None]

    def visible(self, state: State) -> np.ndarray:
        """H (Y, X, 2) of a state, without its margin: curl ψ, rotated back from the domain to the local axes."""
        inside = np.s_[MARGIN:-MARGIN, MARGIN:-MARGIN]
        psi = state.H[-1] if self.open is None else state.H[-1] * self.open
        world, e = curl(psi)[inside].astype(np.float32), state.axes[-1][inside]
        return np.stack([e[..., 0] * world[..., 0] + e[..., 1] * world[..., 1],
                         e[..., 0] * world[..., 1] - e[..., 1] * world[..., 0]], axis=-1)
