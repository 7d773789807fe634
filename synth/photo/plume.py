"""A plume of smoke or steam that leaves a stack in a wind, in space."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from synth.photo.rising import Rising, Texture, rising, simulated
from synth.photo.tiles import rng, smooth_step

CELLS = (72, 144, 72)
"""Of the simulation, (Z, Y, X), for pictures of 480 rows and more."""
DETAIL = 2
"""Cells of the plume for each of the simulation's, along each axis."""
FRAMES = 125
MOUTH = 0.05
"""Height of the mouth of the stack, in heights of the domain."""
RADIUS = 0.06
LEAN = 0.5
"""How far the wind has carried it at the top of the domain, heights."""


@dataclass(frozen=True, eq=False)
class Plume:
    """Smoke on cells (Z, Y, X) of a domain 1 high, its floor at y = 0; the middle of the stack is at x = z = 0.

    density   (Z, Y, X) float32 in 0..1
    usual     (Z, Y, X) float32: its mean over some time
    velocity  (Z, Y, X, 3) float32: of that, cells per frame
    left      x of the first column of cells, heights
    """

    density: np.ndarray
    usual: np.ndarray
    velocity: np.ndarray
    left: float


def plume(seed: int, rows: int) -> Plume:
    """A plume at one moment, for a picture of `rows` rows, on DETAIL times as many cells along each axis as are
    simulated."""
    risen = rising(simulated(CELLS, rows), seed, frames=FRAMES, ground=MOUTH, draught=0.003, radius=RADIUS,
                   height=MOUTH, buoyancy=1.7e-3, cooling=0.006, confinement=0.7, sway=0.8,
                   sway_period=18.0).enlarged(DETAIL)
    heads = Texture(rng(seed, 75), 0.09, 24.0, falloff=0.7).left(risen)
    there = risen.density + 0.22 * heads * np.sqrt(np.clip(risen.density, 0, 1))
    return _leaning(smooth_step(0.04, 0.55, there), risen)


def _leaning(density: np.ndarray, risen: Rising) -> Plume:
    """The plume bent by a wind: each layer shifted, with more cells along x, and the velocity that goes with it."""
    depth, height, width = density.shape
    more = int(np.ceil(LEAN * height))
    up = np.clip((np.arange(height) / height - MOUTH) / (1 - MOUTH), 0, 1)
    shift = LEAN * height * up**1.5
    slope = np.gradient(shift).astype(np.float32)
    velocity = risen.velocity.copy()
    velocity[..., 0] += slope[:, None] * velocity[..., 1]

    def bent(values: np.ndarray) -> np.ndarray:
        made = np.zeros((depth, height, width + more), np.float32)
        made[..., :width] = values
        for y in range(height):
            made[:, y] = ndimage.shift(made[:, y], (0, shift[y]), order=1)
        return made

    return Plume(bent(density), bent(risen.usual), np.stack([bent(velocity[..., c]) for c in range(3)], -1),
                 -0.5 * (width - 1) / height)
