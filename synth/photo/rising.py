"""What rises from a source, in space: where and when each part of it left the ground, carried along a simulated plume.

The motion is `synth.smoke`'s. A few coarse cells say how the air moves; what burns or hides light is finer than they
are. So each cell keeps labels, as in `synth.photo.fumes`, which are smooth, can be enlarged, and say by textures of
place and time what left there then. `flames` and `plume` read them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import fft, ndimage

from synth import opencl
from synth.advect import Grid
from synth.photo.tiles import smooth_step
from synth.smoke import simulate

TILE = 96  # edge of a texture, texels
LARGEST = 24.0  # its largest features, texels
FINEST = 3.5  # smaller ones are left out
DRAUGHT = 0.25  # radius of the updraught, heights


@dataclass(frozen=True, eq=False)
class Rising:
    """One moment of what rises, on cells (Z, Y, X); the domain is 1 high, its floor at y = 0, centred on x and z.

    place     (2, Z, Y, X) float32: x and z where it left the ground, in heights
    age       (Z, Y, X) float32: frames since then
    oldest    the age of air that never was there
    density   (Z, Y, X) float32 in 0..1: how much of it there is
    usual     (Z, Y, X) float32 in 0..1: how much of it there has been, the mean of the last frames
    velocity  (Z, Y, X, 3) float32: the mean of what there has been, cells per frame
    """

    place: np.ndarray
    age: np.ndarray
    oldest: float
    density: np.ndarray
    usual: np.ndarray
    velocity: np.ndarray

    def enlarged(self, factor: int) -> Rising:
        """The same on cells `factor` times as many along each axis, linear between the centres; velocities in the new
        cells."""
        def finer(values: np.ndarray) -> np.ndarray:
            return np.asarray(ndimage.zoom(values, factor, order=1, mode="nearest", grid_mode=True), np.float32)

        velocity = np.stack([factor * finer(self.velocity[..., c]) for c in range(3)], -1)
        return Rising(np.stack([finer(along) for along in self.place]), finer(self.age), self.oldest,
                      finer(self.density), finer(self.usual), velocity)


def simulated(cells: tuple[int, int, int], rows: int) -> tuple[int, int, int]:
    """The cells that suffice for a picture of `rows` rows, where `cells` (Z, Y, X) do for 480 and more: half as
    many along each axis at least, since a coarser plume does not rise."""
    share = min(1.0, max(rows / 480, 0.5))
    z, y, x = (2 * round(0.5 * share * n) for n in cells)
    return z, y, x


def rising(shape: tuple[int, int, int], seed: int, *, frames: int, ground: float, draught: float = 0.0,
           averaged: int = 24, **plume: Any) -> Rising:
    """What has risen after `frames` frames.

    shape     (Z, Y, X) cells
    ground    height of what it leaves, in heights of the domain
    draught   speed of the steady updraught of a gas that expands as it burns, heights per frame: the simulation
              alone draws in air and narrows to a thread
    averaged  the last frames, of which `usual` and `velocity` are means
    plume     of `synth.smoke.simulate`: the source and how it rises
    Raises ValueError for a simulation that cannot be.
    """
    grid, height = Grid(shape, "clamp"), np.float32(shape[1])
    z, y, x = np.meshgrid(*(np.arange(n, dtype=np.float32) for n in shape), indexing="ij", sparse=True)
    below = np.broadcast_to(y < ground * shape[1], shape)
    state = np.zeros((*shape, 4), np.float32)  # offsets to the place along x and z, age, one more for the kernel
    state[..., 2] = frames
    weight, moved = np.zeros(shape, np.float32), np.zeros((*shape, 3), np.float32)
    up = np.float32(draught) * height * (0.35 + 0.65 * smooth_step(0.0, 0.4, y / height)) * np.exp(
        -((x - 0.5 * (shape[2] - 1)) ** 2 + (z - 0.5 * (shape[0] - 1)) ** 2) / (DRAUGHT * height) ** 2)
    for frame, (v, density) in enumerate(simulate(shape, frames, seed=seed, **plume)):
        v[..., 1] += up
        departure = grid.departure(opencl.to_device(v))
        state = grid.gather(opencl.to_device(state), departure).get()
        state[..., :2] += departure.get()[..., ::2]
        state[..., 2] = np.minimum(state[..., 2] + 1, frames)
        state[below] = 0
        if frame >= frames - averaged:
            weight += density
            moved += density[..., None] * v
    place = np.stack([(x + state[..., 0] - 0.5 * (shape[2] - 1)) / height,
                      (z + state[..., 1] - 0.5 * (shape[0] - 1)) / height])
    return Rising(place, state[..., 2].copy(), float(frames), density, weight / averaged,
                  moved / np.maximum(weight, 1e-6)[..., None])


class Texture:
    """Noise of place and time, which repeats: what it says of what left the ground there and then."""

    def __init__(self, random: np.random.Generator, size: float, lasts: float, *, falloff: float = 1.0):
        """
        size     of its largest features, heights of the domain
        lasts    how long they last, frames
        falloff  power of the frequency by which amplitudes of octaves fall
        """
        f = np.sqrt(sum(axis**2 for axis in np.meshgrid(
            np.fft.fftfreq(TILE), np.fft.fftfreq(TILE), np.fft.rfftfreq(TILE), indexing="ij", sparse=True)))
        gain = np.maximum(f * LARGEST, 1.0) ** -(1.5 + falloff) * np.exp(-((f * FINEST) ** 4))
        gain[0, 0, 0] = 0
        tile = fft.irfftn(fft.rfftn(random.standard_normal((TILE,) * 3)) * gain, s=(TILE,) * 3)
        self.tile = np.asarray(tile / tile.std(), np.float32)
        self.texels = LARGEST / size, LARGEST / lasts

    def left(self, risen: Rising) -> np.ndarray:
        """(Z, Y, X) float32 of mean 0 and deviation 1: its value where and when each part left the ground."""
        per_height, per_frame = self.texels
        at = np.stack([per_height * risen.place[1], -per_frame * risen.age, per_height * risen.place[0]])
        return ndimage.map_coordinates(self.tile, at, order=1, mode="grid-wrap").astype(np.float32)
