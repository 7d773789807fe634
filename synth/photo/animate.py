"""A photograph begins to flow (okabe11 §3, fig. 2): assignment, differences, the look of the target, dynamic
boundaries.

The paper's frame is the average image and the differences. Ours mixes in the photograph itself, carried along the
motion, by one number from 0, the paper's, to 1: it keeps the streaks and edges by which the viewer knows the picture,
and the differences add what the picture does not have.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from synth.photo import photograph
from synth.photo.appearance import added, average, evened, evening, extended, gains, matched
from synth.photo.assign import Nodes, Shown, Wanted
from synth.photo.boundary import displaced, mixed, with_area
from synth.photo.integrate import Differences, motion_field
from synth.photo.motion import optical_flow
from synth.photo.pieces import Cut

CALMED = 0.5
"""What of the differences is left, of their full strength, where the photograph is carried in full: it moves itself."""
SAMPLES = 4
"""Frames whose bands are measured."""
REGION = 64
"""Pixels of a region in which histograms are matched."""
THIN = 0.2
"""The least matte by which the fluid can be told from what is behind it."""
SHORE = 2.0
"""Pixels at the edge of a matte that are seldom the fluid alone."""
TOWARDS = 0.9
"""Share of the wanted direction in the motion that the photograph is carried by; the rest is that of the pieces."""


@dataclass(frozen=True)
class Look:
    """How frames are composed.

    carried   0..1: the photograph carried along the motion, in place of the blurred average
    feature   size of what moves, as streaks, ripples and billows, pixels: what is larger stands
    strength  of the differences
    matching  "gains": by the strength of bands, over all time; "histograms": frame by frame, in regions that overlap;
              "regions": as in the paper, differences added as they are, regions side by side; "none"
    """

    carried: float = 1.0
    feature: float = 10.0
    strength: float = 1.0
    matching: Literal["gains", "histograms", "regions", "none"] = "gains"

    def __post_init__(self) -> None:
        if not 0 <= self.carried <= 1 or self.strength < 0 or self.feature < 1:
            raise ValueError(f"the carried share is in 0..1, the strength not negative, a feature of a pixel or more, "
                             f"not {self.carried}, {self.strength} and {self.feature}")


@dataclass(frozen=True, eq=False)
class Target:
    """A picture that shall flow.

    picture     (Y, X, 3) float32, display-encoded, 0..1, row 0 the lowest
    matte       (Y, X) float32 in 0..1: where the fluid is
    background  (Y, X, 3) float32: what is seen where the matte leaves; None: the picture
    frozen      (Y, X) bool: what stands still in the fluid; None: nothing
    wanted      the user's orientation and speed
    """

    picture: np.ndarray
    matte: np.ndarray
    background: np.ndarray | None = None
    frozen: np.ndarray | None = None
    wanted: Wanted = field(default_factory=Wanted)

    @property
    def fluid(self) -> np.ndarray:
        """The matte without what stands still: (Y, X) float32."""
        return self.matte if self.frozen is None else np.where(self.frozen, np.float32(0), self.matte)

    def box(self, margin: int) -> tuple[slice, slice]:
        """The rows and columns of the matte, and `margin` pixels round it."""
        rows, columns = (np.flatnonzero((self.matte > 0).any(axis=axis)) for axis in (1, 0))
        return (slice(max(int(rows[0]) - margin, 0), int(rows[-1]) + 1 + margin),
                slice(max(int(columns[0]) - margin, 0), int(columns[-1]) + 1 + margin))

    def part(self, box: tuple[slice, slice]) -> Target:
        """The target of a box alone: what is far from the fluid takes no time."""
        def cut(values: np.ndarray | None) -> Any:
            return None if values is None else np.ascontiguousarray(values[box])

        return Target(cut(self.picture), cut(self.matte), cut(self.background), cut(self.frozen),
                      Wanted(*(cut(values) for values in self.wanted)))

    @property
    def shows(self) -> np.ndarray:
        """Where the picture shows enough of the fluid to read it: (Y, X) bool. With a background it is known what else
        a soft matte shows; without, pixels at the shore are left out, which show some of it, but for narrow parts."""
        if self.background is not None:
            return np.asarray(self.fluid > THIN)
        sure = self.fluid > 0.5
        inner = photograph.inland(sure) > SHORE
        return np.asarray(inner | (sure & (photograph.inland(~inner) > 2 * SHORE)))

    @property
    def foreground(self) -> np.ndarray:
        """The fluid's own colours (Y, X, 3) float32, everywhere: the picture without what is behind it, and beyond the
        fluid those that are nearest."""
        if self.background is None:
            return extended(self.picture, self.shows)
        alpha = np.maximum(self.matte, THIN)[..., None]
        return extended(np.clip((self.picture - (1 - alpha) * self.background) / alpha, 0, 1), self.shows)

    @property
    def grey(self) -> np.ndarray:
        """(Y, X) uint8, what descriptors see."""
        return np.rint(255 * np.clip(self.picture.mean(axis=2), 0, 1)).astype(np.uint8)


def motion(target: Target, of: Nodes, shown: Shown, cut: Cut) -> np.ndarray:
    """The motion (Y, X, 2) float32, pixels per frame: the pieces', turned towards what the user wants, at the wanted
    speed; zero outside the fluid."""
    found = motion_field(of, shown, target.matte.shape, cut)
    speed = np.hypot(found[..., 0], found[..., 1]) if target.wanted.speed is None else target.wanted.speed
    turned = found
    if target.wanted.orientation is not None:
        turned = TOWARDS * speed[..., None] * target.wanted.orientation + (1 - TOWARDS) * found
    size = np.hypot(turned[..., 0], turned[..., 1])
    scaled = turned * (speed / np.maximum(size, 1e-6))[..., None]
    return np.where(target.fluid[..., None] > 0, scaled, 0).astype(np.float32)


def composed(target: Target, more: Differences, moves: np.ndarray, look: Look, seed: int,
             ) -> Callable[[int], np.ndarray]:
    """Of a frame 0, 1 … the fluid (Y, X, 3) float32, everywhere: §6, "Recovery of Color Appearance", "Appearance
    Matching".

    moves  the motion (Y, X, 2) as `motion` gives it

    1. The ground: the average, and the photograph carried.
    2. The differences, matched to the target.
    3. Bands of all of it as strong as the target's, by gains over all time.
    """
    length = more.bands.shape[1]
    fluid = target.foreground
    # 1. ground
    still = average(fluid, moves) if look.carried < 1 else fluid
    moving = photograph.flowing(fluid, moves, length, seed, look.feature, target.shows) if look.carried > 0 else None
    grey = fluid.mean(axis=2)
    strength = look.strength * (1 - look.carried * (1 - CALMED))
    # 2. differences
    as_they_are = look.matching in ("none", "regions")
    scale = (np.full_like(more.bands[:, 0], 1 / 255) if as_they_are else gains(grey, more.bands, target.fluid))

    def mixed_in(frame: int) -> np.ndarray:
        ground = still if moving is None else (1 - look.carried) * still + look.carried * moving(frame)
        change = (scale * more.bands[:, frame]).sum(axis=0) * strength
        return np.clip(ground + change[..., None], 0, 1) if look.matching == "regions" else added(ground, change)

    def matched_to_target(frame: int) -> np.ndarray:
        shown = mixed_in(frame)
        wanted = matched(shown.mean(axis=2), grey, target.fluid, REGION, look.matching == "histograms")
        return added(shown, wanted - shown.mean(axis=2))

    if look.matching == "none":
        return mixed_in
    if look.matching in ("histograms", "regions"):
        return matched_to_target
    # 3. bands
    samples = [mixed_in(length * k // SAMPLES).mean(axis=2) for k in range(SAMPLES)]
    even = evening(samples, grey, target.fluid)
    return lambda frame: evened(mixed_in(frame), even)


def mattes_mixed(target: Target, fluid: np.ndarray, dynamics: float) -> np.ndarray:
    """The matte of each frame as in the paper: (T, Y, X) float32, moved with `dynamics` (τ of §6).

    fluid  (T, Y, X) uint8, grey: the frames of `composed`, whose optical flow is "the motion field M_i of the
           synthesized animation"
    """
    return mixed(target.matte, optical_flow(fluid), dynamics)


def matte_displaced(target: Target, by: np.ndarray) -> np.ndarray:
    """The matte (Y, X) float32 displaced by D (Y, X, 2), with its area."""
    return with_area(displaced(target.matte, by), float(target.matte.sum(dtype=np.float64)))


def over_background(target: Target, shown: np.ndarray, matte: np.ndarray) -> np.ndarray:
    """A frame (Y, X, 3) of the fluid over what is behind it, by a matte (Y, X): float32. What is frozen is the
    picture's."""
    cover = matte if target.frozen is None else np.where(target.frozen, np.float32(0), matte)
    behind = target.picture if target.background is None else target.background
    return (cover[..., None] * shown + (1 - cover[..., None]) * behind).astype(np.float32)
