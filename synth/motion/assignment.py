"""Assignment (ma09 §3.1): every output cell becomes the weighted average of the matches that cover it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from synth import opencl

# exponent of the robust error |x - z|^r that Kwatra 2005 §3.3 minimises by reweighting: r = 0.8
ROBUST = 0.8
# matches this close, as a share of the exemplar's rms, count as exact
EXACT = 0.05
# the weight of a match falls to this at the middle of its edges, so that no seam stands where it ends
EDGE = 0.1
# cells of Catmull-Rom's weights beyond a point
CARRY_BORDER = 2


def robust_weights_reference(squared: np.ndarray, length: int, rms: float) -> np.ndarray:
    """Specification of `robust_weights`; arguments as there."""
    floor = length * (EXACT * rms) ** 2
    return ((1 + squared / floor) ** (ROBUST / 2 - 1)).astype(np.float32)


def falloff(radius: int) -> float:
    """g in exp(-g |o|^2), the weight of a match at offset o from its centre."""
    return -float(np.log(EDGE)) / max(radius, 1) ** 2


def catmull_rom(t: np.ndarray) -> np.ndarray:
    """Weights (..., 4) of the cells at -1, 0, 1, 2 for a point at t in [0, 1); float32."""
    t = np.asarray(t, np.float32)
    weights = [((2 - t) * t - 1) * t, (3 * t - 5) * t * t + 2, ((4 - 3 * t) * t + 1) * t, (t - 1) * t * t]
    return np.float32(0.5) * np.stack(weights, axis=-1)


def sample_reference(field: np.ndarray, at: np.ndarray, toroidal: bool) -> np.ndarray:
    """Specification of `sample`: Catmull-Rom of field (N, M, K) at points (P, 2) as x, y; edges wrap or repeat."""
    low = np.floor(at).astype(int)
    weights = catmull_rom((at - low).astype(np.float32))
    index = low[:, :, None] + np.arange(-1, 3)
    size = np.array(field.shape[1::-1])[:, None]
    index = index % size if toroidal else np.clip(index, 0, size - 1)
    cells = field[index[:, 1, :, None], index[:, 0, None, :]]
    return np.einsum("pj,pi,pjic->pc", weights[:, 1], weights[:, 0], cells).astype(np.float32)


def average_reference(exemplar: np.ndarray, position: np.ndarray, weight: np.ndarray, axis: np.ndarray,
                      grid: tuple[int, int], radius: int, spacing: int, prior: np.ndarray,
                      coherence: np.ndarray) -> np.ndarray:
    """Specification of `average`: each site adds its match, every cell divides by its weights; arguments as there."""
    rows, columns = prior.shape[:2]
    sums, totals = np.zeros(prior.shape), np.zeros(prior.shape[:2])
    for s in range(len(position)):
        site = np.array([s % grid[1], s // grid[1]]) * spacing + spacing // 2
        offset_x, offset_y = np.arange(columns) - site[0], (np.arange(rows) - site[1])[:, None]
        e = axis[s]
        offset = np.stack([e[0] * offset_x + e[1] * offset_y, e[0] * offset_y - e[1] * offset_x], axis=-1)
        covered = np.abs(offset).max(axis=-1) <= radius + 0.001
        o = offset[covered].astype(np.float32)
        g = weight[s] * np.exp(-falloff(radius) * (o**2).sum(axis=-1))
        sums[covered] += g[:, None] * sample_reference(exemplar, position[s] + o, toroidal=True)
        totals[covered] += g
    mean = sums / np.where(totals > 0, totals, 1)[..., None]
    held = (mean + coherence[..., None] * prior) / (1 + coherence[..., None])
    return np.where(totals[..., None] > 0, held, prior).astype(np.float32)


def carry_reference(field: np.ndarray, displacement: np.ndarray) -> np.ndarray:
    """Specification of `carry`; arguments as there."""
    rows, columns = field.shape[:2]
    cells = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1)
    at = np.clip(cells.astype(np.float32) + displacement, 0, np.array([columns - 1, rows - 1], np.float32))
    return sample_reference(field, at.reshape(-1, 2), toroidal=False).reshape(field.shape)


def robust_weights(squared: Any, length: int, rms: float) -> Any:
    """Weights (S,) in (0, 1] of matches at squared distances (S,) over `length` numbers; one for an exact match.

    rms is the exemplar's. Device array in, device array out.
    """
    weight = opencl.empty(squared.shape)
    _bare(1).robust(squared.shape, None, squared, np.float32(1 / (length * (EXACT * rms) ** 2)),
                    np.float32(ROBUST / 2 - 1), weight)
    return weight


def _bare(channels: int) -> Any:
    """The program for kernels without neighbourhoods."""
    return opencl.program(Path(__file__).with_suffix(".cl"), RADIUS=0, SPACING=1, FIRST=0, REACH=0,
                          BORDER=CARRY_BORDER, CHANNELS=channels)


@dataclass(frozen=True)
class Assigner:
    """Assigns the matches in an exemplar (N, M, K), K = 2 (of a potential 1), of sites at distances of `spacing`."""

    exemplar: np.ndarray
    radius: int
    spacing: int

    @property
    def _border(self) -> int:
        return self.radius + 3

    @property
    def _reach(self) -> int:
        return int(np.ceil(np.sqrt(2) * self.radius))

    @cached_property
    def _program(self) -> Any:
        return opencl.program(Path(__file__).with_suffix(".cl"), RADIUS=self.radius, SPACING=self.spacing,
                              FIRST=self.spacing // 2, REACH=self._reach, BORDER=self._border,
                              CHANNELS=self.exemplar.shape[2])

    @cached_property
    def _continued(self) -> tuple[Any, np.int32]:
        """The exemplar continued toroidally on each side, and its width."""
        border = (self._border, self._border)
        padded = np.pad(self.exemplar, (border, border, (0, 0)), mode="wrap")
        return opencl.to_device(padded), np.int32(padded.shape[1])

    @cached_property
    def _falloff(self) -> Any:
        away = np.arange(self._reach + 1)
        return opencl.to_device(np.exp(-falloff(self.radius) * away**2).astype(np.float32))

    def average(self, position: Any, weight: Any, axis: Any, grid: tuple[int, int], prior: Any, coherence: Any) -> Any:
        """Least squares (Eq. 1), cell by cell: the minimum over x of sum_p w_p |x_p - z_p|^2 + O(x).

        O(x) = w |x - prior|^2 with w = coherence * (sum of w_p there), the frame coherence of [Kwatra 2005 §5].
        position (S, 2), where the matches' centres lie in the exemplar; weight (S,); axis (S, 2), the local x axis
        of each site; grid (rows, columns) of sites; prior (Y, X, K), coherence (Y, X). Device arrays in, device
        array (Y, X, K) out.
        """
        out = opencl.empty(prior.shape)
        self._program.average(prior.shape[1::-1], None, *self._continued, self._falloff, position, weight, axis,
                              np.array(grid[::-1], np.int32), prior, coherence, out)
        return out


def carry(field: np.ndarray, displacement: np.ndarray) -> np.ndarray:
    """The frame before, moved by the flow (§3.4): field (Y, X, K) at each cell + displacement (Y, X, 2) in cells.

    Catmull-Rom, clamped at the border; displacement as `synth.advect.departure` gives it.
    """
    border = CARRY_BORDER
    out = opencl.empty(field.shape)
    padded = np.pad(field, ((border, border), (border, border), (0, 0)), mode="edge")
    _bare(field.shape[2]).carry(field.shape[1::-1], None, opencl.to_device(padded), np.int32(padded.shape[1]),
                                opencl.to_device(displacement), out)
    return out.get()
