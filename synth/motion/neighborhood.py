"""Neighbourhoods: where their centres are, how they are sampled, and the PCA space in which they are compared.

The output is covered by a sparse grid of neighbourhoods, one every quarter of their width [Kwatra 2005 §3.2].
Each is sampled along the local axes of the coarse motion (ma09 §3.3) and projected on the principal components
of the exemplar's own neighbourhoods, where its best match is searched (ma09 §3.1).
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import eigh
from threadpoolctl import ThreadpoolController

from synth import opencl

VARIANCE_KEPT = 0.995
MOST_DIMS = 64
SITES_TOGETHER = 12


def spacing(width: int) -> int:
    """Cells from one neighbourhood of a width to the next."""
    return max(1, width // 4)


def site_grid(shape: tuple[int, int], width: int) -> tuple[np.ndarray, tuple[int, int]]:
    """Centres of the neighbourhoods: ((S, 2) int32 as x, y, row by row; grid size (rows, columns))."""
    step = spacing(width)
    ys = np.arange(step // 2, shape[0], step)
    xs = np.arange(step // 2, shape[1], step)
    return np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2).astype(np.int32), (len(ys), len(xs))


def exemplar_patches(exemplar: np.ndarray, radius: int) -> np.ndarray:
    """All toroidal neighbourhoods of an exemplar (N, M, K): (N * M, (2r+1)^2 * K) float32, row by row."""
    rows, columns = exemplar.shape[:2]
    padded = np.pad(exemplar, ((radius, radius), (radius, radius), (0, 0)), mode="wrap")
    windows = np.lib.stride_tricks.sliding_window_view(padded, (2 * radius + 1, 2 * radius + 1), axis=(0, 1))
    return np.ascontiguousarray(windows.transpose(0, 1, 3, 4, 2)).reshape(rows * columns, -1)


def gather_reference(field: np.ndarray, sites: np.ndarray, axis: np.ndarray, radius: int) -> np.ndarray:
    """Specification of the kernel `gather`: field sampled bilinearly, clamped, at site + R(axis) (i, j).

    field (Y, X, K) float32; sites (S, 2) int32 as x, y; axis (S, 2) float32 -> (S, (2r+1)^2 * K) float32.
    """
    span = np.arange(-radius, radius + 1, dtype=np.float32)
    j, i = np.meshgrid(span, span, indexing="ij")
    e = axis[:, :, None, None]
    x = np.clip(sites[:, 0, None, None] + e[:, 0] * i - e[:, 1] * j, 0, field.shape[1] - 1).astype(np.float32)
    y = np.clip(sites[:, 1, None, None] + e[:, 1] * i + e[:, 0] * j, 0, field.shape[0] - 1).astype(np.float32)
    x0 = np.minimum(x.astype(int), max(field.shape[1] - 2, 0))
    y0 = np.minimum(y.astype(int), max(field.shape[0] - 2, 0))
    x1, y1 = np.minimum(x0 + 1, field.shape[1] - 1), np.minimum(y0 + 1, field.shape[0] - 1)
    tx, ty = (x - x0)[..., None], (y - y0)[..., None]
    low = (1 - tx) * field[y0, x0] + tx * field[y0, x1]
    high = (1 - tx) * field[y1, x0] + tx * field[y1, x1]
    return ((1 - ty) * low + ty * high).reshape(len(sites), -1).astype(np.float32)


@dataclass(frozen=True)
class Space:
    """The PCA space of an exemplar's neighbourhoods of one radius.

    mean (C,), basis (C, D) with C = (2r+1)^2 * K, K the channels (2 of a vector, 1 of a potential), and D a multiple
    of 16 (zero columns fill it up); points (N * M, D): the exemplar's own neighbourhoods in it. All float32.
    """

    radius: int
    mean: np.ndarray
    basis: np.ndarray
    points: np.ndarray

    @property
    def dims(self) -> int:
        return self.basis.shape[1]

    @property
    def length(self) -> int:
        """C, the numbers in one neighbourhood."""
        return self.basis.shape[0]

    @property
    def channels(self) -> int:
        """K, the numbers in one cell."""
        return self.length // (2 * self.radius + 1) ** 2

    @cached_property
    def _program(self) -> Any:
        return opencl.program(Path(__file__).with_suffix(".cl"), RADIUS=self.radius, DIMS=self.dims,
                              SITES=SITES_TOGETHER, CHANNELS=self.channels)

    @cached_property
    def _basis_and_mean(self) -> tuple[Any, Any]:
        """The basis, and the mean neighbourhood projected on it."""
        mean = self.mean.astype(np.float64) @ self.basis
        return opencl.to_device(self.basis), opencl.to_device(mean.astype(np.float32))

    def gather(self, field: Any, sites: Any, axis: Any) -> Any:
        """Oriented neighbourhoods of field (Y, X, K) at sites (S, 2) int32, their x axes along axis (S, 2).

        Device arrays in, device array (S, C) out, as `gather_reference`; rows of padding make their number a
        multiple of SITES_TOGETHER.
        """
        count = sites.shape[0]
        patches = opencl.empty((-(-count // SITES_TOGETHER) * SITES_TOGETHER, self.length))
        self._program.gather((count,), (1,), field, np.array(field.shape[1::-1], np.int32), sites, axis, patches)
        return patches

    def project(self, field: Any, sites: Any, axis: Any) -> Any:
        """The oriented neighbourhoods, as in `gather`, in this space: device array (S, D)."""
        return self.compare(self.gather(field, sites, axis), sites.shape[0])

    def compare(self, patches: Any, count: int) -> Any:
        """The first `count` of patches (S, C), S a multiple of SITES_TOGETHER, in this space: device (count, D)."""
        out = opencl.empty((count, self.dims))
        self._program.project((self.dims // 16, len(patches) // SITES_TOGETHER), (1, 1), patches,
                              *self._basis_and_mean, np.int32(count), out)
        return out

    def project_reference(self, patches: np.ndarray) -> np.ndarray:
        """Specification of the kernel `project`: patches (S, C) -> (S, D) float32."""
        return ((patches - self.mean) @ self.basis).astype(np.float32)


@functools.cache  # it searches the process's libraries
def _blas() -> ThreadpoolController:
    return ThreadpoolController()


def space(exemplar: np.ndarray, radius: int) -> Space:
    """Principal components of the toroidal neighbourhoods of exemplar (N, M, K), ordered by variance."""
    return space_of(exemplar_patches(exemplar, radius), radius, _scatter(exemplar, radius))


def _scatter(exemplar: np.ndarray, radius: int) -> np.ndarray:
    """X^T X of all toroidal neighbourhoods, their mean taken away, (C, C): from the exemplar's autocorrelation.

    Two numbers of a neighbourhood at offsets i and j, summed over the whole torus, depend on j - i alone.
    """
    rows, columns, channels = exemplar.shape
    spectrum = np.fft.rfft2(exemplar - exemplar.mean(axis=(0, 1), dtype=np.float64), axes=(0, 1))
    correlation = np.fft.irfft2(spectrum.conj()[..., :, None] * spectrum[..., None, :], (rows, columns), axes=(0, 1))
    span = np.arange(2 * radius + 1)
    lag = span - span[:, None]
    pairs = correlation[(lag % rows)[:, None, :, None], (lag % columns)[None, :, None, :]]  # iy, ix, jy, jx, k, l
    length = len(span) ** 2 * channels
    return np.ascontiguousarray(pairs.transpose(0, 1, 4, 2, 3, 5)).reshape(length, length)


def space_of(patches: np.ndarray, radius: int, scatter: np.ndarray | None = None) -> Space:
    """Principal components of neighbourhoods (E, C) of a radius, ordered by variance.

    Keeps as many as hold 99.5 % of the variance, 64 at most; scatter (C, C), X^T X of them without their mean, where
    it is known. One thread of BLAS: the sums, and with them the basis, would otherwise depend on their number.
    """
    mean = patches.mean(axis=0, dtype=np.float64).astype(np.float32)
    centred = patches - mean
    with _blas().limit(limits=1):
        # the smaller of the two Gram matrices has the same spectrum
        tall = len(centred) >= centred.shape[1]
        if tall:
            gram = centred.T.astype(np.float64) @ centred if scatter is None else scatter
        else:
            gram = centred.astype(np.float64) @ centred.T
        most = min(MOST_DIMS, len(gram))
        values, vectors = eigh(gram, subset_by_index=(len(gram) - most, len(gram) - 1))
        values, vectors = np.maximum(values[::-1], 0), vectors[:, ::-1]
        share = np.cumsum(values) / max(np.trace(gram), np.finfo(float).tiny)
        kept = min(most, int(np.searchsorted(share, VARIANCE_KEPT)) + 1)
        vectors = vectors[:, :kept]
        if not tall:
            vectors = centred.T.astype(np.float64) @ vectors
            vectors /= np.maximum(np.linalg.norm(vectors, axis=0), np.finfo(float).tiny)
        dims = -(-kept // 16) * 16
        basis = np.zeros((patches.shape[1], dims), np.float32)
        basis[:, :kept] = vectors
        points = centred @ basis
    return Space(radius, mean, basis, points)
