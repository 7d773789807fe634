"""Targets of the photo part on which the method was not tuned: a photograph, and pictures from clips of which the
database has none.

Of a clip the whole truth is known: how it moves, and what its other frames are.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy import ndimage

from pipeline.photo.target import read_target
from pipeline.scene import load
from synth.photo.animate import Target
from synth.photo.assign import Wanted
from synth.photo.clip import Clip
from synth.photo.clips import clip
from synth.photo.guides import orientation

SEED = 9001
"""Of the clips: one that no clip of the catalogue has."""
CLIPS: dict[str, tuple[str, dict[str, Any]]] = {
    "fall": ("fall", {}), "white water": ("white-water", {}), "river": ("river", {}), "fire": ("fire", {}),
    "smoke": ("smoke", {}), "clouds": ("cloud", {}), "bay": ("bay", {}), "shallow": ("shallow", {}),
    "lake": ("lake", {}), "fall over ledges": ("fall", {"ledges": 4, "lean": 0.35, "foot": 0.2}),
    "white water, rising": ("white-water", {"direction": 1.9, "stones": 3}),
    "river, to the left": ("river", {"direction": 2.6, "stones": 8})}
"""Each a family and its variation."""
PHOTOGRAPH = Path(__file__).parents[1] / "scenes/okabe11-fig01.toml"
COVERED = 0.05
"""Share of the time in which fluid is seen at a place that does not stand still."""
SHORE = 1.5
"""σ, pixels, of the matte's border."""
SPECK = 2
"""Pixels: what stands still and is no wider than two of them is not drawn into the freeze mask."""
ACROSS, ALONG = 4, 3
"""Strokes from left to right, and one over the other."""
STROKE = 0.15
"""Length of a stroke, of the height of the picture."""
SLOWEST = 0.3
"""Pixels per frame: slower fluid gets no stroke, and its direction is not compared."""


@dataclass(frozen=True, eq=False)
class Subject:
    """A target without wishes, the orientation map (Y, X, 2) that strokes along its flow give, and the clip that it is
    a frame of; None: it is a photograph."""

    target: Target
    orientation: np.ndarray
    truth: Clip | None = None

    @property
    def guided(self) -> Target:
        """The target with the wish that it flows along the strokes."""
        return replace(self.target, wanted=Wanted(self.orientation))

    @property
    def frames(self) -> np.ndarray:
        """The clip's (T, Y, X) float32 grey, 0..1."""
        assert self.truth is not None, "a photograph has no other frames"
        shown = self.truth.luma if self.truth.chroma is None else self.truth.chroma.mean(axis=3)
        return (shown / 255).astype(np.float32)

    @property
    def flows(self) -> np.ndarray:
        """Where the clip's true velocity has a direction: (Y, X) bool."""
        assert self.truth is not None, "a photograph has no known velocity"
        return (self.truth.coverage > 2 * COVERED) & (np.hypot(*np.moveaxis(self.truth.velocity, -1, 0)) > SLOWEST)


def photograph(width: int) -> Subject:
    """The stream of scenes/okabe11-fig01.toml, `width` pixels wide."""
    scene = load(PHOTOGRAPH).variants[""]
    guided = read_target(scene.model_copy(update={"photo": scene.photo.model_copy(update={"width": width})}))
    return Subject(replace(guided, wanted=Wanted()), guided.wanted.orientation)


def of_clip(name: str, length: int, size: tuple[int, int]) -> Subject:
    """The middle frame of a clip of CLIPS, `length` frames of `size` (width, height).

    The matte is where fluid is seen, with what stands still in it, which is frozen.
    """
    family, variation = CLIPS[name]
    truth = clip(family, SEED, length, size, **variation)
    wet = truth.coverage > COVERED
    whole = ndimage.binary_fill_holes(wet)
    matte = ndimage.gaussian_filter(whole.astype(np.float32), SHORE)
    frozen = ndimage.binary_opening(whole & ~wet, iterations=SPECK)
    middle = length // 2
    grey = np.repeat(truth.luma[middle][..., None], 3, axis=2)
    picture = grey if truth.chroma is None else truth.chroma[middle]
    target = Target((picture / 255).astype(np.float32), matte, frozen=frozen if frozen.any() else None)
    return Subject(target, orientation(strokes(truth.velocity, whole), whole.shape, target.frozen), truth)


def strokes(velocity: np.ndarray, where: np.ndarray) -> list[np.ndarray]:
    """Strokes along a velocity (Y, X, 2), as a user would draw them: each (K, 2) points x, y.

    where  (Y, X) bool: the fluid. Of each cell of a lattice of ACROSS × ALONG one, which begins where fluid flows
           nearest to the cell's middle, and ends where the fluid does. Raises ValueError if nothing flows.
    """
    speed = np.where(where, np.hypot(velocity[..., 0], velocity[..., 1]), 0)
    rows, columns = (np.array_split(np.arange(n), parts) for n, parts in zip(speed.shape, (ALONG, ACROSS), strict=True))
    found = []
    for row in rows:
        for column in columns:
            y, x = np.nonzero(speed[np.ix_(row, column)] > SLOWEST)
            if not len(y):
                continue
            nearest = np.hypot(y - len(row) / 2, x - len(column) / 2).argmin()
            line = _along(velocity, speed, float(column[x[nearest]]), float(row[y[nearest]]))
            if len(line) > 1:
                found.append(line)
    if not found:
        raise ValueError(f"nothing flows at {SLOWEST} pixels per frame")
    return found


def _along(velocity: np.ndarray, speed: np.ndarray, x: float, y: float) -> np.ndarray:
    """Points a pixel apart on a streamline from (x, y), STROKE long at most."""
    points = []
    for _ in range(round(STROKE * len(speed))):
        row, column = round(y), round(x)
        if not (0 <= row < speed.shape[0] and 0 <= column < speed.shape[1]) or speed[row, column] < SLOWEST:
            break
        points.append([x, y])
        u, v = velocity[row, column] / speed[row, column]
        x, y = x + float(u), y + float(v)
    return np.array(points).reshape(-1, 2)
