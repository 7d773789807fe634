"""A photograph: what lens and film make of light, and what a photograph of a fluid holds beside it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from render import tonemap

BLOOM = ((0.008, 0.06), (0.05, 0.035))  # light scattered in the lens: radius in heights of the picture, and share
GRAIN = 0.012  # of display values


@dataclass(frozen=True, eq=False)
class Photograph:
    """A picture of a fluid, and what is known of it; float32, top row first, display light: linear Rec.709 in 0..1.

    picture     (h, w, 3) the fluid and what is round it
    matte       (h, w) in 0..1: where the fluid is
    background  (h, w, 3) the same without the fluid before it, lit as in the picture
    """

    picture: np.ndarray
    matte: np.ndarray
    background: np.ndarray


def developed(light: np.ndarray, seed: int) -> np.ndarray:
    """A photograph (h, w, 3) float32 of light (h, w, 3): bloom of the lens, filmic tone curve, grain. The same seed
    gives the same grain."""
    height = light.shape[0]
    bloom = sum(share * ndimage.gaussian_filter(light, (radius * height, radius * height, 0))
                for radius, share in BLOOM)
    display = tonemap.to_display(light + bloom, "filmic")
    random = np.random.Generator(np.random.Philox(key=[seed, 81]))
    grain = ndimage.gaussian_filter(random.standard_normal(light.shape[:2]), 0.6)[..., None]
    return tonemap.from_srgb(np.clip(display + GRAIN * grain, 0, 1)).astype(np.float32)
