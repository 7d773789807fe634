"""A current past stones that repeats after T frames: a steady flow and eddies that it carries.

The steady one is a uniform flow, projected. The eddies are the curl of a potential [Bridson et al. 2007], a tile of
noise that drifts with the flow and changes on its way; it drifts by whole tiles in T frames.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from synth import opencl
from synth.noise import curl
from synth.photo.carried import sampled
from synth.photo.tiles import enlarged, noise
from synth.projection import project

CELLS = 9000  # few enough that no library splits the solver's sums between threads, which would round otherwise
MARGIN = 8
SMOOTH = 0.03


@dataclass(frozen=True, eq=False)
class Current:
    """steady (Y, X, 2) float32, pixels per frame; eddies: potentials of each frame, (T, Y + 2, X + 2) float32."""

    steady: np.ndarray
    eddies: np.ndarray

    def velocity(self, frame: int) -> np.ndarray:
        """The velocity in a frame, (Y, X, 2) float32."""
        return (self.steady + curl(self.eddies[frame][None])).astype(np.float32)

    def mean(self) -> np.ndarray:
        """The mean of all frames, (Y, X, 2) float32."""
        return (self.steady + curl(self.eddies.mean(0)[None])).astype(np.float32)


def past_stones(U: np.ndarray, distance: np.ndarray) -> np.ndarray:
    """A uniform flow U (2: x, y) past what lies where distance (Y, X) is negative: (Y, X, 2) float32.

    The flow without eddies that does not pass through walls, found on at most CELLS cells and smoothed over SMOOTH of
    the picture's height: what lies on the water is turned aside early, as the layer at a wall slows it.
    """
    U = np.asarray(U, np.float32)
    factor = 1
    while np.prod([-(-n // factor) + 2 * MARGIN for n in distance.shape]) > CELLS:
        factor += 1
    coarse = np.ascontiguousarray(distance[::factor, ::factor] / factor, np.float32)
    if not (coarse < 0).any():
        return np.array(np.broadcast_to(U, (*distance.shape, 2)))
    # a margin, since the flow through the border is free to turn
    wider = np.pad(coarse, MARGIN, mode="edge")
    v = project(np.broadcast_to(U, (*wider.shape, 2)), "open", wider)[MARGIN:-MARGIN, MARGIN:-MARGIN]
    v = ndimage.gaussian_filter(v, (SMOOTH * len(v), SMOOTH * len(v), 0), mode="nearest")
    return np.ascontiguousarray(np.moveaxis(enlarged(np.moveaxis(v, -1, 0), factor, distance.shape), 0, -1))


def eddies(shape: tuple[int, int], frames: int, U: np.ndarray, size: float, speed: float, strength: np.ndarray,
           random: np.random.Generator) -> np.ndarray:
    """Potentials (T, Y + 2, X + 2) float32 of eddies that drift with U and change.

    size      of the eddies, about, pixels
    speed     rms, pixels per frame, where strength (Y, X) is 1
    """
    travelled = np.abs(U) * frames
    # a tile of about 256 pixels along each axis, passed a whole number of times
    turns = np.maximum(np.rint(travelled / 256), (travelled > 64) * 1.0)
    pixels = np.where(turns > 0, travelled / np.maximum(turns, 1), 256)
    A = np.diag(256 / pixels)
    two = np.stack([noise((256, 256), random, size, falloff=2.0) for _ in range(2)])
    phases = np.zeros((frames, 2, 3), np.float32)
    turn = 2 * np.pi * np.arange(frames) / frames * max(1, round(frames / 48))
    drift = -np.arange(frames)[:, None] * np.sign(U) * turns * 256 / frames
    phases[:, 0, :2] = phases[:, 1, :2] = drift
    phases[:, 0, 2], phases[:, 1, 2] = np.cos(turn), np.sin(turn)
    padded = (shape[0] + 2, shape[1] + 2)
    psi = np.zeros((frames, *padded), np.float32)
    for k in range(2):
        psi += sampled(opencl.to_device(two[k][None]), opencl.zeros((*padded, 2)), phases[:, k : k + 1],
                       np.zeros(frames, np.int32), A)
    scale = np.sqrt(np.mean(np.square(curl(psi[0][None])).sum(-1)))
    return psi * np.float32(speed / scale) * np.pad(strength, 1, mode="edge").astype(np.float32)
