"""Local axes of the coarse motion, and the coordinate transformation (ma09 §3.1 figure 2, §3.3).

In 2-D the axes are completely defined by L. In 3-D L gives one axis and a second direction, `towards`, the others:
from the density (`outward`) or from vectors placed by hand (`interpolated_directions`). Where that direction runs
along L it determines nothing, so neighbouring values are spread there, on a lattice coarser than the field.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy import ndimage
from scipy.interpolate import RBFInterpolator

from synth import opencl

# Below this share of the field's rms the direction of L is noise; the axes go over to the fallback smoothly.
STILL = 1e-3
X_AXIS = np.array([1, 0], np.float32)
# The second direction lives on a lattice of about this many cells along the longest side: at every level of a
# pyramid the same one, so that the levels agree.
LATTICE = 32
# how far, in cells of the lattice, a second direction spreads to where there is none
SPREAD = 6.0
SPREADINGS = 64
# widths of the smoothed density whose slope is `outward`, as shares of the longest side
NARROW, WIDE = 1 / 24, 1 / 4
# share of the smoke that counts as near everywhere: far outside, `outward` is away from its centroid
FAR = 1e-6


def axes_2d(L: np.ndarray, along: str = "x") -> np.ndarray:
    """The local x axis of the exemplar in each cell of L (Y, X, 2): unit vectors (Y, X, 2) float32.

    The x axis follows L and the y axis is 90 degrees counter-clockwise from it (§3.3). With along = "y" the y axis
    follows L, so that upright motifs stay upright. Where L rests the axes fall back to those of the domain.
    """
    L = L if along == "x" else np.stack([L[..., 1], -L[..., 0]], axis=-1)
    rms = float(np.sqrt(np.mean(np.sum(L.astype(np.float64) ** 2, axis=-1))))
    if rms == 0.0:
        return np.broadcast_to(X_AXIS, L.shape).copy()
    axes = L / rms + np.float32(STILL) * X_AXIS
    length = np.linalg.norm(axes, axis=-1, keepdims=True)
    return np.where(length > 1e-12, axes / np.maximum(length, 1e-12), X_AXIS).astype(np.float32)


def axes_3d(L: np.ndarray, towards: np.ndarray, along: str = "x") -> np.ndarray:
    """Local axes of L (Z, Y, X, 3): rotations R (Z, Y, X, 3, 3) float32, R[..., :, k] the local axis k (§3.3).

    along    the axis, "x" or "y", that follows L
    towards  (Z, Y, X, 3), any unit, longer where it is more certain: axis 2 is its part across L
    Continuous where L rests (the axes fall back to the domain's) and where `towards` vanishes or runs along L (they
    follow the surroundings). No rule can avoid singular points, round which L takes all directions, and singular lines,
    round which the part of `towards` across L winds: there the axes flip from one voxel to the next (in a plume at one
    pair of neighbours in a thousand).
    """
    scale, lattice, stride = _prepared(L, towards, along)
    out = opencl.empty((*L.shape[:-1], 3, 3))
    program = opencl.program(Path(__file__).with_suffix(".cl"), ALONG="xy".index(along))
    size = np.array([*lattice.shape[2::-1], 0], np.int32)
    program.axes_3d(L.shape[2::-1], None, opencl.to_device(np.asarray(L, np.float32)), scale, np.float32(STILL),
                        opencl.to_device(lattice), size, np.float32(stride), out)
    return out.get()


def axes_3d_reference(L: np.ndarray, towards: np.ndarray, along: str = "x") -> np.ndarray:
    """Specification of the kernel `axes_3d`; arguments as there."""
    scale, lattice, stride = _prepared(L, towards, along)
    e = _follow(L * scale, along)
    n = _finer(lattice, L.shape[:-1], stride)
    n -= np.sum(n * e, -1, keepdims=True) * e
    steep = np.abs(e[..., 2:]) >= 0.9
    other = np.where(steep, np.array([1, 0, 0], np.float32), np.array([0, 0, 1], np.float32))
    other -= np.sum(other * e, -1, keepdims=True) * e
    n = np.where(np.linalg.norm(n, axis=-1, keepdims=True) < 1e-6, other, n)
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    n -= np.sum(n * e, -1, keepdims=True) * e
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    axes = [e, np.cross(n, e), n] if along == "x" else [np.cross(e, n), e, n]
    return np.stack(axes, axis=-1).astype(np.float32)


def _per_rms(v: np.ndarray) -> np.float32:
    """One over the rms length of v (..., 3); 0 for a field of zeros."""
    rms = float(np.sqrt(np.mean(np.square(v), dtype=np.float64) * v.shape[-1]))
    return np.float32(1 / rms if rms > 0 else 0)


def _follow(L: np.ndarray, along: str) -> np.ndarray:
    """Unit vectors (Z, Y, X, 3) along L (Z, Y, X, 3) of rms 1; along the domain's axis `along` where it rests."""
    rest = np.eye(3, dtype=np.float32)["xy".index(along)]
    e = L + np.float32(STILL) * rest
    length = np.linalg.norm(e, axis=-1, keepdims=True)
    return np.where(length > 1e-12, e / np.maximum(length, 1e-12), rest).astype(np.float32)


def _stride(shape: tuple[int, ...]) -> int:
    """Cells of the field to a cell of the lattice, along each axis."""
    return max(1, -(-max(shape) // LATTICE))


def block_means(field: np.ndarray, stride: int) -> np.ndarray:
    """Means of field (Z, Y, X[, C]) over cubes of `stride` cells; the last of an axis may be cut short."""
    for axis in range(3):
        starts = np.arange(0, field.shape[axis], stride)
        counts = np.diff(np.append(starts, field.shape[axis]))
        sums = np.add.reduceat(field, starts, axis=axis, dtype=np.float32)
        field = sums / counts.astype(np.float32).reshape([-1 if a == axis else 1 for a in range(field.ndim)])
    return field


def _finer(lattice: np.ndarray, shape: tuple[int, ...], stride: int) -> np.ndarray:
    """Linear samples of a lattice (z, y, x, 3) at the cells of `shape`; edges repeat."""
    field = lattice
    for axis in range(3):
        size = lattice.shape[axis]
        at = np.clip((np.arange(shape[axis], dtype=np.float32) + np.float32(0.5)) / np.float32(stride) -
                     np.float32(0.5), 0, size - 1)
        low = np.minimum(at.astype(int), max(size - 2, 0))
        t = (at - low).astype(np.float32).reshape([-1 if a == axis else 1 for a in range(4)])
        high = np.minimum(low + 1, size - 1)
        field = (1 - t) * np.take(field, low, axis=axis) + t * np.take(field, high, axis=axis)
    return field


def _prepared(L: np.ndarray, towards: np.ndarray, along: str) -> tuple[np.float32, np.ndarray, int]:
    """The factor that brings L to rms 1; `towards` across L on the lattice (z, y, x, 3); the lattice's stride.

    It is spread to places where it has no part across L: the minimum over w of
    sum |w - P w'|^2 + |w - P t|^2 / SPREAD^2, P the projection across L, w' the six neighbours. That is linear in t and
    as smooth as t; only its direction may flip, where it vanishes.
    """
    scale, stride = _per_rms(L), _stride(L.shape[:-1])
    e = _follow(block_means(L, stride) * scale, along)
    t = block_means(towards, stride) * _per_rms(towards)
    t = t / np.maximum(np.linalg.norm(t, axis=-1, keepdims=True), 1) + np.array([0, 0, STILL], np.float32)
    t -= np.sum(t * e, -1, keepdims=True) * e
    own = np.float32(1 / (1 + SPREAD**2))
    w = t
    for _ in range(SPREADINGS):
        padded = np.pad(w, ((1, 1), (1, 1), (1, 1), (0, 0)), mode="edge")
        around = (padded[2:, 1:-1, 1:-1] + padded[:-2, 1:-1, 1:-1] + padded[1:-1, 2:, 1:-1] +
                  padded[1:-1, :-2, 1:-1] + padded[1:-1, 1:-1, 2:] + padded[1:-1, 1:-1, :-2]) / np.float32(6)
        w = (1 - own) * around + own * t
        w -= np.sum(w * e, -1, keepdims=True) * e
    return scale, w.astype(np.float32), stride


def outward(density: np.ndarray) -> np.ndarray:
    """The direction out of the smoke, -grad of the smoothed density (Z, Y, X): (Z, Y, X, 3) float32, length up to 1.

    Smoothed by a Gaussian of width s, -s^2 grad D / D is the vector to the voxel from the centroid of the smoke within
    about s (§3.3). It is defined inside the body and far outside, and short where it is ambiguous, on the body's axis.
    Two widths are added: the narrow one follows the surface, the wide one the body. Zero without smoke.
    """
    shape = density.shape
    stride = _stride(shape)
    D = block_means(np.asarray(density, np.float32), stride)
    total = float(D.sum(dtype=np.float64))
    if not total > 0:
        return np.zeros((*shape, 3), np.float32)
    longest = max(D.shape)
    cells = np.stack(np.meshgrid(*(np.arange(n, dtype=np.float32) for n in D.shape), indexing="ij")[::-1], -1)
    moments = D[..., None] * cells
    centroid = moments.sum((0, 1, 2), dtype=np.float64) / total
    direction = np.zeros_like(cells)
    for width in (NARROW, WIDE):
        sigma = max(width * longest, 0.5)
        # truncated far out, so that distant smoke is still seen
        near = ndimage.gaussian_filter(D, sigma, mode="constant", truncate=4)
        around = ndimage.gaussian_filter(moments, (sigma, sigma, sigma, 0), mode="constant", truncate=4)
        far = FAR * total / D.size
        direction += cells - (around + far * centroid.astype(np.float32)) / (near + far)[..., None]
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True) + np.float32(NARROW * longest)
    return _finer(direction.astype(np.float32), shape, stride)


def interpolated_directions(at: np.ndarray, vectors: np.ndarray, shape: tuple[int, int, int]) -> np.ndarray:
    """Vectors (K, 3) placed at (K, 3), cells as x, y, z, interpolated over the domain: (Z, Y, X, 3) unit (§3.3).

    By radial basis functions |r|, biharmonic in space, on their directions [as for surfaces in Turk 2001]. Raises
    ValueError for no vectors, a vector of zero length or two at one place.
    """
    at, vectors = np.asarray(at, np.float64), np.asarray(vectors, np.float64)
    if at.ndim != 2 or at.shape[1:] != (3,) or at.shape != vectors.shape or len(at) == 0:
        raise ValueError(f"directions need as many places as vectors, (K, 3) each, not {at.shape} and {vectors.shape}")
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    if not (np.isfinite(lengths).all() and np.isfinite(at).all() and (lengths > 0).all()):
        raise ValueError("a direction is a finite vector that is not zero")
    if len(np.unique(at, axis=0)) < len(at):
        raise ValueError("two directions are given at one place")
    stride = _stride(shape)
    axes = (np.minimum((np.arange(-(-n // stride)) + 0.5) * stride - 0.5, n - 1) for n in shape)
    cells = np.stack(np.meshgrid(*axes, indexing="ij")[::-1], -1)
    if len(at) == 1:
        values = np.broadcast_to(vectors / lengths, (cells[..., 0].size, 3))
    else:
        spline = RBFInterpolator(at, vectors / lengths, kernel="linear", degree=0)
        values = spline(cells.reshape(-1, 3))
    field = _finer(values.reshape(cells.shape).astype(np.float32), shape, stride)
    # where opposite vectors cancel, the mean of all decides
    field += np.float32(STILL) * (vectors / lengths).mean(axis=0).astype(np.float32)
    return field / np.maximum(np.linalg.norm(field, axis=-1, keepdims=True), np.float32(1e-12))


def largest_turn(a: np.ndarray, b: np.ndarray) -> float:
    """The largest angle, in degrees, between the rotations a and b, (..., 3, 3) each."""
    trace = np.einsum("...ij,...ij->...", a, b)
    return float(np.degrees(np.arccos(np.clip((np.min(trace) - 1) / 2, -1, 1))))


def to_world(H: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """H' = R H: detail from exemplar coordinates to those of the domain (§3.1, CoordinateTransform).

    H (Y, X, 2) with the local x axes (Y, X, 2), or H (Z, Y, X, 3) with rotations (Z, Y, X, 3, 3).
    """
    if H.shape[-1] == 3:
        return np.einsum("...ij,...j->...i", axes, H)
    x = axes[..., 0] * H[..., 0] - axes[..., 1] * H[..., 1]
    y = axes[..., 1] * H[..., 0] + axes[..., 0] * H[..., 1]
    return np.stack([x, y], axis=-1)
