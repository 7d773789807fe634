"""A wood fire in space: how much light its flames give off, and of what colour.

What leaves the bed of the fire burns for a while, longer where there is more fuel, and is the cooler the longer ago it
left. The flame is a thin, folded sheet between fuel and air, and soot in it shines like a black body.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from synth.photo.rising import Rising, Texture, rising, simulated
from synth.photo.tiles import rng, smooth_step

CELLS = (64, 144, 96)
"""Of the simulation, (Z, Y, X), for pictures of 480 rows and more."""
DETAIL = 2
"""Cells of the flames for each of the simulation's, along each axis."""
FRAMES = 84
GROUND = 0.06
"""Height of the bed, in heights of the domain."""
RADIUS = 0.19
"""Of the bed."""
LIFE = 34.0
"""Frames for which the most fuel burns."""


@dataclass(frozen=True, eq=False)
class Flames:
    """Light of flames on cells (Z, Y, X) of a domain 1 high, its floor at y = 0, centred on x and z.

    glow    (Z, Y, X) float32: how much soot there is that shines
    heat    (Z, Y, X) float32: its temperature, 0 where it is all but dark to 1 at its hottest
    risen   what rises there, with its mean velocity
    """

    glow: np.ndarray
    heat: np.ndarray
    risen: Rising


def flames(seed: int, rows: int) -> Flames:
    """A fire at one moment, for a picture of `rows` rows, on DETAIL times as many cells along each axis as are
    simulated."""
    risen = rising(simulated(CELLS, rows), seed, frames=FRAMES, ground=GROUND, draught=0.02, radius=0.20, height=0.02,
                   buoyancy=1.5e-3, cooling=0.02, confinement=0.4, sway=1.2, sway_period=12.0).enlarged(DETAIL)
    fuel = Texture(rng(seed, 72), 0.10, 26.0, falloff=0.6).left(risen)
    fold = Texture(rng(seed, 73), 0.12, 30.0, falloff=0.5).left(risen)
    off = np.hypot(*risen.place) / RADIUS
    lasts = LIFE * np.clip(0.62 * (1.1 - off**2 + 0.65 * fuel), 0.01, 1.0)
    left = 1 - risen.age / lasts
    sheets = np.exp(-2.4 * np.abs(fold))
    burning = smooth_step(0.0, 0.16, left) * smooth_step(0.0, 3.0, risen.age)
    # the cells of the simulation must not show
    glow = ndimage.gaussian_filter(burning * (0.08 + sheets**2), 0.7)
    return Flames(glow, np.clip(left, 0, 1) * (0.75 + 0.25 * sheets), risen)
