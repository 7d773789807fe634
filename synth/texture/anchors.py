"""Which places of the sample patches may take: what of it is in use, and what makes a place dear."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import ndimage

from synth.texture.patches import MATCHED, SPREAD, Painter, pairs_within

LIVELY = 8.0
"""σ, in pixels, of the round in which the sample's variance counts."""


@dataclass(frozen=True, eq=False)
class Anchors:
    """The anchors of patches of a painter's sample.

    usage  how strongly places of the sample that are in use are avoided (λ): 0, not at all
    seed   of what is random
    """

    painter: Painter
    usage: float
    seed: int

    def used(self, usage: np.ndarray, anchors: np.ndarray, change: int) -> np.ndarray:
        """usage (H, W) with `change` added round each of anchors (M, 2)."""
        usage = usage.copy()
        height, width = usage.shape
        for x, y in anchors.astype(np.int64):
            low, left = max(y - SPREAD, 0), max(x - SPREAD, 0)
            part = usage[low:min(y + SPREAD + 1, height), left:min(x + SPREAD + 1, width)]
            part += change * _DISC[low - y + SPREAD:, left - x + SPREAD:][:part.shape[0], :part.shape[1]]
        return usage

    def dear(self, usage: np.ndarray) -> np.ndarray:
        """By what share the error at each anchor counts more, or less if negative: (H, W) float32.

        1. λ times the use of each place of the sample over the mean use.
        2. Divided by how lively the sample is there: the least squares alone prefer its dull parts, since of two
           pictures that have nothing in common the difference is the sum of their variances.
        """
        mean = usage.mean()
        used = self.usage * usage / mean if mean > 0 else np.zeros(usage.shape)
        return ((1 + used) / self._lively - 1).astype(np.float32)

    @cached_property
    def _lively(self) -> np.ndarray:
        """Variance of the sample round each pixel plus that of the whole, over twice the latter: (H, W) float64."""
        picture = self.painter.sample.luminance.astype(np.float64)
        squared = (picture - picture.mean()) ** 2
        return 0.5 + 0.5 * ndimage.gaussian_filter(squared, LIVELY, mode="mirror") / squared.mean()

    def rounds(self, points: np.ndarray, radius: np.ndarray) -> np.ndarray:
        """The round, from 1, in which each newborn at points (B, D), pixels, of radius (B,) is matched: (B,) int32.

        After those of all earlier ones that may reach it, so that all of a round are matched at once, as if in order.
        """
        later, earlier = pairs_within(points, points, MATCHED * np.sqrt(self.painter.elongation) * radius,
                                      self.painter.extent(radius))
        starts = np.searchsorted(later, np.arange(len(points) + 1))
        rounds = np.zeros(len(points), np.int32)
        for k in range(len(points)):
            # those not yet numbered are later ones: 0
            rounds[k] = 1 + rounds[earlier[starts[k]:starts[k + 1]]].max(initial=0)
        return rounds

    def anywhere(self, radius: np.ndarray, frame: int, number: int) -> np.ndarray:
        """An anchor (2,) at random for a patch of radius (1,), by the frame it is born in and its number."""
        fits = np.argwhere(self.painter.room >= self.painter.needs(radius)[0])
        random = np.random.Philox(key=[self.seed, frame], counter=[0, 0, 0, 1 + number])
        return fits[np.random.Generator(random).integers(len(fits))][::-1]


_DISC = np.hypot(*np.mgrid[-SPREAD:SPREAD + 1, -SPREAD:SPREAD + 1]) <= SPREAD
