"""The families of clips, and the catalogue of 150 that a database is made of."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from synth.photo.calm import bay, lake, shallow
from synth.photo.clip import Clip
from synth.photo.falls import fall
from synth.photo.fumes import cloud, fire, smoke
from synth.photo.surface import river, white_water

FAMILIES: dict[str, Callable[..., Clip]] = {
    "fall": fall, "white-water": white_water, "river": river, "fire": fire, "smoke": smoke, "cloud": cloud,
    "bay": bay, "shallow": shallow, "lake": lake}
"""Each family's function: seed, frames T, size (width, height), and its own variation by keyword."""

SHARES = {"fall": 40, "white-water": 30, "river": 25, "fire": 13, "smoke": 11, "cloud": 11, "bay": 8, "shallow": 7,
          "lake": 5}
"""How many of 150 clips are of each family."""
PLACES = 1000
"""Seeds of a family."""


def clip(family: str, seed: int, frames: int = 96, size: tuple[int, int] = (320, 240), **variation: Any) -> Clip:
    """A clip of a family of FAMILIES: `frames` frames of `size` (width, height), even numbers.

    The same arguments give the same bits, at any number of threads. Raises ValueError for an unknown family, or a size
    or a length that a clip cannot have.
    """
    if family not in FAMILIES:
        raise ValueError(f"family {family!r} is none of {', '.join(FAMILIES)}")
    if frames < 16 or frames % 8 or min(size) < 64 or size[0] % 2 or size[1] % 2:
        raise ValueError(f"a clip has at least 16 frames, a multiple of 8, and at least 64 x 64 pixels, even numbers; "
                         f"not {frames} frames of {size[0]} x {size[1]}")
    return FAMILIES[family](seed, frames, size, **variation)


@dataclass(frozen=True)
class Recipe:
    """What a clip is made from."""

    family: str
    seed: int
    variation: Mapping[str, Any]

    @property
    def name(self) -> str:
        """Of the catalogue: its family and its number there, from 1."""
        return f"{self.family}-{self.seed % PLACES + 1:02d}"

    def clip(self, frames: int = 96, size: tuple[int, int] = (320, 240)) -> Clip:
        """The clip."""
        return clip(self.family, self.seed, frames, size, **self.variation)


def catalogue(count: int = 150) -> list[Recipe]:
    """The first `count` of a fixed list of recipes: the nine families once each, then in their SHARES.

    Within a family the variations cover their ranges evenly, and so do directions where water or cloud may flow
    anywhere: the clips of a longer list fill the gaps of a shorter one.
    """
    made = dict.fromkeys(SHARES, 0)
    recipes = []
    for _ in range(count):
        # nobody goes twice before all went once; then whoever is furthest behind its share is next
        family = min(SHARES, key=lambda name: (made[name] > 0, (made[name] + 0.5) / SHARES[name]))
        seed = PLACES * list(SHARES).index(family) + made[family]
        recipes.append(Recipe(family, seed, VARIATIONS[family](_spread(made[family]))))
        made[family] += 1
    return recipes


def _spread(index: int) -> np.ndarray:
    """Seven numbers in [0, 1): for index 0, 1, 2 ... they fill the cube evenly (an additive recurrence)."""
    # the root of g^8 = g + 1 gives the steps that stay furthest from any repeat
    g = 1.0969815577985598
    return (0.5 + (index + 1) * g ** -np.arange(1.0, 8)) % 1


def _between(low: float, high: float, u: float) -> float:
    return round(float(low + (high - low) * u), 4)


def _fall(u: np.ndarray) -> dict[str, Any]:
    return {"width": _between(0.45, 1.6, u[0]), "speed": _between(3.0, 6.5, u[1]), "ledges": int(5 * u[2]),
            "density": _between(0.35, 0.8, u[3]), "lean": _between(-0.45, 0.45, u[4]),
            "lip": 1.05 if u[5] < 0.7 else _between(0.8, 0.95, (u[5] - 0.7) / 0.3),
            "foot": -0.1 if u[6] < 0.4 else _between(0.08, 0.25, (u[6] - 0.4) / 0.6),
            "tone": _between(0.14, 0.34, (u[0] + u[3]) % 1)}


def _running(low: float, high: float, stones: tuple[int, int], white: tuple[float, float]) -> Callable[..., dict]:
    def variation(u: np.ndarray) -> dict[str, Any]:
        return {"direction": _between(-np.pi, np.pi, u[0]), "speed": _between(low, high, u[1]),
                "stones": stones[0] + int((stones[1] + 1 - stones[0]) * u[2]), "white": _between(*white, u[3]),
                "tone": _between(0.08, 0.24, u[4])}

    return variation


VARIATIONS: dict[str, Callable[[np.ndarray], dict[str, Any]]] = {
    "fall": _fall,
    "white-water": _running(2.4, 4.5, (0, 3), (0.4, 0.9)),
    "river": _running(1.4, 3.0, (2, 8), (0.04, 0.2)),
    "fire": lambda u: {"width": _between(0.4, 1.0, u[0]), "speed": _between(3.2, 4.8, u[1]),
                       "life": _between(28, 42, u[2]), "wind": _between(-0.8, 0.8, u[3]),
                       "closeness": _between(0.9, 1.9, u[4])},
    "smoke": lambda u: {"width": _between(0.16, 0.45, u[0]), "speed": _between(1.5, 3.0, u[1]),
                        "wind": _between(-1.2, 1.2, u[2]), "dark": max(0.0, _between(-0.7, 0.9, u[3]))},
    "cloud": lambda u: {"direction": _between(-np.pi, np.pi, u[0]), "speed": _between(0.7, 2.0, u[1]),
                        "cover": _between(0.35, 0.7, u[2]), "mountains": _between(0.12, 0.4, u[3])},
    "bay": lambda u: {"direction": _between(-np.pi, np.pi, u[0]), "length": _between(35, 80, u[1]),
                      "slope": _between(0.18, 0.3, u[2]), "stones": 2 + int(5 * u[3])},
    "shallow": lambda u: {"direction": _between(-np.pi, np.pi, u[0]), "length": _between(35, 70, u[1]),
                          "pebble": _between(16, 32, u[2]), "depth": _between(9, 18, u[3])},
    "lake": lambda u: {"direction": _between(-2.4, -0.7, u[0]), "length": _between(22, 48, u[1]),
                       "slope": _between(0.03, 0.06, u[2])}}
"""Each family's variation from seven numbers in [0, 1)."""
