"""Tiles carried along a flow that repeats after T frames, so that the picture repeats too.

Each pixel follows the flow back to where its content was when the carrying began. Carrying begins again every `period`
frames, in three phases a third of a period apart, each fading in and out [Max and Becker 1995; Neyret 2003]. Each
beginning has its place in the tile, given by phase and number modulo T, so frame T is frame 0. The weights are such
that noise of deviation 1 keeps it.

Hot: `sampled` is half of a river (3.3 of 6.4 s of two CPU cores for 96 frames of 320×240) and two fifths of a fall, a
bay or a cloud. It is bound by scattered reads: a pixel reads 4 texels for each phase.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from synth import opencl
from synth.advect import Grid
from synth.photo.tiles import rng

ROW = 64
PHASES = 3


@dataclass(frozen=True, eq=False)
class Carried:
    """The state of a frame: displacement (Y, X, 2 P) on the device, pixels; weight and number of the beginning of
    each of P phases."""

    frame: int
    displacement: Any
    weights: np.ndarray
    beginnings: tuple[int, ...]

    def picture(self, tile: Any, seed: int, A: np.ndarray | None = None, part: int = 0) -> np.ndarray:
        """The tile as it lies on this frame, (Y, X) float32.

        tile  (S, N, M) float32 on the device; slice `part` is taken
        seed  of the places in the tile where carrying begins
        A     (2, 2) texels per pixel; none: one
        """
        phases = np.empty((1, len(self.weights), 3), np.float32)
        for i, (weight, beginning) in enumerate(zip(self.weights, self.beginnings, strict=True)):
            phases[0, i, :2] = rng(seed, i, beginning).random(2) * tile.shape[:0:-1]
            phases[0, i, 2] = weight
        return sampled(tile, self.displacement, phases, np.array([part], np.int32), A)[0]


def carried(velocity: Callable[[int], np.ndarray], frames: int, period: int) -> Iterator[Carried]:
    """The frames 0 to T - 1 of what a flow carries.

    velocity  frame -> (Y, X, 2) float32, pixels per frame; the motion from the frame before to this one, the same
              again after T = `frames`
    period    frames after which carrying begins again; it divides T
    """
    if frames % period:
        raise ValueError(f"a period of {period} frames does not divide a clip of {frames}")
    first = velocity(0)
    grid = Grid(first.shape[:-1], "clamp")
    starts = [round(i * period / PHASES) for i in range(PHASES)]
    total = opencl.zeros((*first.shape[:-1], 2 * PHASES))
    for t in range(-period, frames):
        departure = grid.departure(opencl.to_device(velocity(t % frames))).get()
        total = _followed(grid, total, departure)
        for i, start in enumerate(starts):
            if (t - start) % period == 0:
                total[..., 2 * i : 2 * i + 2] = 0
        if t >= 0:
            ages = np.array([(t - start) % period for start in starts])
            weights = np.sin(np.pi * (ages + 0.5) / period) ** 2
            number = tuple((t - start) // period % (frames // period) for start in starts)
            yield Carried(t, opencl.to_device(total), weights / np.sqrt((weights**2).sum()), number)


def _followed(grid: Grid, total: Any, departure: np.ndarray) -> np.ndarray:
    """Displacements (Y, X, 2 n) of all phases one frame later: the departure, and the displacement there."""
    padded = np.zeros((*total.shape[:-1], 8), np.float32)
    padded[..., : total.shape[-1]] = total if isinstance(total, np.ndarray) else total.get()
    moved = grid.gather(opencl.to_device(padded), opencl.to_device(departure)).get()[..., : total.shape[-1]]
    return moved + np.tile(departure, total.shape[-1] // 2)


def sampled(tile: Any, displacement: Any, phases: np.ndarray, slices: np.ndarray,
            A: np.ndarray | None = None) -> np.ndarray:
    """Frames (F, Y, X) float32 of tiles at A (pixel + displacement) + offset, summed over phases with weights.

    tile          (S, N, M) float32 on the device, repeated without end
    displacement  (Y, X, 2 P) float32 on the device, pixels: x, y of each of P phases
    phases        (F, P, 3) float32: offset x, y in texels, and weight
    slices        (F,) int32: which tile of the stack each frame takes
    """
    height, width = displacement.shape[:2]
    out = opencl.empty((len(phases), height, width))
    opencl.program(Path(__file__).with_suffix(".cl"), PHASES=phases.shape[1]).sampled(
        (-(-width // ROW) * ROW, height, len(phases)), (ROW, 1, 1), tile, displacement,
        opencl.to_device(phases.astype(np.float32)), opencl.to_device(slices.astype(np.int32)), out,
        *np.ravel(np.eye(2) if A is None else A).astype(np.float32),
        np.int32(tile.shape[1]), np.int32(tile.shape[2]), np.int32(width), np.int32(height))
    return out.get()


def sampled_reference(tile: np.ndarray, displacement: np.ndarray, phases: np.ndarray, slices: np.ndarray,
                      A: np.ndarray | None = None) -> np.ndarray:
    """`sampled` in NumPy."""
    rows, columns = tile.shape[1:]
    y, x = np.mgrid[: displacement.shape[0], : displacement.shape[1]].astype(np.float32)
    (a, b), (c, d) = np.asarray(np.eye(2) if A is None else A, np.float32)
    out = np.zeros((len(phases), *x.shape), np.float32)
    for f, part in enumerate(slices):
        for i, (offset_x, offset_y, weight) in enumerate(phases[f].astype(np.float32)):
            px, py = x + displacement[..., 2 * i], y + displacement[..., 2 * i + 1]
            u, v = a * px + b * py + offset_x, c * px + d * py + offset_y
            x0, y0 = np.floor(u), np.floor(v)
            tx, ty = u - x0, v - y0
            c0, r0 = x0.astype(int) % columns, y0.astype(int) % rows
            c1, r1 = (c0 + 1) % columns, (r0 + 1) % rows
            t = tile[int(part)]
            low, high = (1 - tx) * t[r0, c0] + tx * t[r0, c1], (1 - tx) * t[r1, c0] + tx * t[r1, c1]
            out[f] += weight * ((1 - ty) * low + ty * high)
    return out
