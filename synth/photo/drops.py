"""Droplets: each flies through the air on its own, with gravity and drag, again and again after T frames.

With drag proportional to the velocity the path has a closed form, so any frame can be made alone and frame T is
frame 0. A droplet leaves a streak as long as the shutter is open.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from synth import opencl

UNIT = 1024.0  # steps of light in a weight of 1
MOST = 16  # samples along a streak


class Drops(NamedTuple):
    """Droplets (n,) float32 each; pixels and frames, y up.

    x, y     where each is born                  birth   frame, any number: what counts is birth modulo T
    vx, vy   velocity there                      life    frames
    gx, gy   gravity, pixels per frame^2         weight  light that it leaves in a frame, in pixels of white
    drag     share of the velocity lost a frame  fade    last share of its life in which it fades out
    """

    x: np.ndarray
    y: np.ndarray
    vx: np.ndarray
    vy: np.ndarray
    gx: np.ndarray
    gy: np.ndarray
    drag: np.ndarray
    birth: np.ndarray
    life: np.ndarray
    weight: np.ndarray
    fade: np.ndarray

    def path(self, age: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Where each is `age` frames after its birth, x and y."""
        decayed = (1 - np.exp(-self.drag * age)) / self.drag
        tx, ty = self.gx / self.drag, self.gy / self.drag
        return self.x + tx * age + (self.vx - tx) * decayed, self.y + ty * age + (self.vy - ty) * decayed

    def velocity(self, age: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How fast each moves `age` frames after its birth, x and y, pixels per frame."""
        kept = np.exp(-self.drag * age)
        tx, ty = self.gx / self.drag, self.gy / self.drag
        return tx + (self.vx - tx) * kept, ty + (self.vy - ty) * kept


def made(count: int, **values: np.ndarray | float) -> Drops:
    """Droplets from arrays (count,) and numbers."""
    return Drops(*(np.broadcast_to(np.asarray(values[name], np.float32), (count,)) for name in Drops._fields))


def joined(groups: Sequence[Drops]) -> Drops:
    """All droplets of several groups."""
    return Drops(*(np.concatenate(column) for column in zip(*groups, strict=True)))


def streaks(drops: Drops, frames: int, shape: tuple[int, int], shutter: float) -> np.ndarray:
    """The light of droplets, (T, Y, X) float32, in pixels of white.

    shutter  frames for which it is open; a streak is what a droplet passed in that time
    """
    table = np.stack(drops, -1).astype(np.float32)
    light = opencl.zeros((frames, *shape), np.int32)
    opencl.program(Path(__file__).with_suffix(".cl"), UNIT=f"{UNIT}f", MOST=MOST).streaks(
        (len(table), frames), None, opencl.to_device(table), light, np.int32(len(table)), np.int32(frames),
        np.float32(shutter), np.int32(shape[1]), np.int32(shape[0]))
    return light.get().astype(np.float32) / np.float32(UNIT)


def streaks_reference(drops: Drops, frames: int, shape: tuple[int, int], shutter: float) -> np.ndarray:
    """`streaks` in NumPy, droplet by droplet."""
    light = np.zeros((frames, *shape), np.int64)
    for i in range(len(drops.x)):
        one = Drops(*(np.asarray(column[i], np.float64) for column in drops))
        for t in range(frames):
            age = (t - one.birth) % frames
            while age < one.life:
                x0, y0 = one.path(np.maximum(age - shutter, 0))
                x1, y1 = one.path(age)
                samples = min(1 + int(max(abs(x1 - x0), abs(y1 - y0)) * 1.5), MOST)
                share = one.weight * min(1, (one.life - age) / (one.fade * one.life)) * UNIT / samples
                for s in (np.arange(samples) + 0.5) / samples:
                    x, y = x0 + s * (x1 - x0), y0 + s * (y1 - y0)
                    column, row = int(np.floor(x)), int(np.floor(y))
                    for r, c in ((row, column), (row, column + 1), (row + 1, column), (row + 1, column + 1)):
                        if 0 <= r < shape[0] and 0 <= c < shape[1]:
                            light[t, r, c] += int(share * (1 - abs(x - c)) * (1 - abs(y - r)) + 0.5)
                age += frames
    return (light / UNIT).astype(np.float32)
