"""Helmholtz-Hodge projection of a velocity field onto its divergence-free part (ma09 §3.6, Incompressibility).

Velocities and pressure lie at cell centres, and derivatives are central differences (ghost cells carry the
border condition), so `project` is an orthogonal projection for `divergence` itself: a cosine, sine or
Fourier transform solves the pressure equation to rounding, without iterations. Central differences
are blind to the checkerboard mode and leave it in the field.

With an obstacle the divergence of a cell is what flows out through the open parts of its faces [Batty et al. 2007],
the velocity on a face being the mean of its two cells: central differences wherever all is open. The pressure's
gradient is the negative transpose of that in the inner product that weights cells by how open they are, so the
projection stays orthogonal; conjugate gradients solve for the pressure, preconditioned by the exact solution
without the obstacle.
"""

from __future__ import annotations

import numpy as np
from scipy import fft, ndimage
from scipy.sparse.linalg import LinearOperator, cg

from synth.advect import velocity_field
from synth.obstacle import outward

BORDERS = ("wall", "open", "toroidal")
"""No flow through the border (mirrored), free flow through it (zero pressure), or the other side."""

# with an obstacle, the rms of the divergence that may remain, as a share of the rms gradient of the field
REMAINING = 2e-5
MOST_ITERATIONS = 3000
# a face less open than this counts as closed: slivers would make the pressure equation stiff
SLIVER = 0.15
# modes invisible to central differences have this eigenvalue in the preconditioner
UNSEEN = 1e-3

# ghost cell = sign * the outermost cell: (of the velocity along its own axis, of the pressure)
_GHOST = {"wall": (-1.0, 1.0), "open": (1.0, -1.0)}


def divergence(v: np.ndarray, border: str = "wall", distance: np.ndarray | None = None) -> np.ndarray:
    """Divergence by central differences: (Y, X, 2) or (Z, Y, X, 3) -> (Y, X) or (Z, Y, X) float64, per frame.

    distance  cells to the wall of an obstacle, negative inside (`Obstacle.distance`): its faces let nothing through
    """
    v = velocity_field(v).astype(np.float64)
    _require(border)
    if distance is None:
        return _divergence(v, border)
    return _outflow(v, openings(_fitting(distance, v), border), border)


def project(v: np.ndarray, border: str = "wall", distance: np.ndarray | None = None) -> np.ndarray:
    """The divergence-free part of `v`: v minus the gradient of the pressure p that solves div grad p = div v.

    v         (Y, X, 2) or (Z, Y, X, 3) float32, cells per frame
    border    "wall": nothing flows through the border; "open": it flows freely; "toroidal"
    distance  (Y, X) or (Z, Y, X) float32, cells to the wall of an obstacle, negative inside; none: no obstacle
    Returns the same shape, float32; its `divergence` with the same border and obstacle is zero: to rounding without
    an obstacle, else to REMAINING of the rms gradient of v. A gradient becomes zero, a divergence-free field is
    returned unchanged, a second projection changes nothing. Inside an obstacle v becomes the motion along its
    wall, so that what is sampled close to the wall does not move through it. Raises ValueError for a distance of
    another shape, ArithmeticError if the pressure is not found.
    """
    v = velocity_field(v).astype(np.float64)
    _require(border)
    if distance is not None:
        return _past(v, border, _fitting(distance, v))
    p = _pressure(_divergence(v, border), border)
    for axis in range(p.ndim):
        v[..., _component(axis, p.ndim)] -= _slope(p, axis, border, of_pressure=True)
    return v.astype(np.float32)


def _fitting(distance: np.ndarray, v: np.ndarray) -> np.ndarray:
    if distance.shape != v.shape[:-1]:
        raise ValueError(f"an obstacle on {distance.shape} cells does not fit a velocity on {v.shape[:-1]}")
    return distance.astype(np.float64)


def _require(border: str) -> None:
    if border not in BORDERS:
        raise ValueError(f"border {border!r} is none of {', '.join(BORDERS)}")


def _component(axis: int, dimension: int) -> int:
    """The vector component (x = 0) that runs along an array axis (last = x)."""
    return dimension - 1 - axis


def _slope(a: np.ndarray, axis: int, border: str, of_pressure: bool) -> np.ndarray:
    """Central difference of `a` along an axis, with the border's ghost cells."""
    padded = _continued(a, axis, border, of_pressure)
    return 0.5 * (_part(padded, axis, 2, None) - _part(padded, axis, None, -2))


def _divergence(v: np.ndarray, border: str) -> np.ndarray:
    dimension = v.ndim - 1
    total = np.zeros(v.shape[:-1])
    for axis in range(dimension):
        total += _slope(v[..., _component(axis, dimension)], axis, border, of_pressure=False)
    return total


def openings(distance: np.ndarray, border: str) -> list[np.ndarray]:
    """For each array axis the open share of the faces across it: n + 1 of them along the axis, float64 in [0, 1].

    distance  cells to the wall; at the corners of the faces it is the mean of the cells round them
    """
    axes = range(distance.ndim)
    corners = np.pad(distance, 1, mode="wrap" if border == "toroidal" else "edge")
    for axis in axes:
        corners = 0.5 * _paired(corners, axis)
    shares = []
    for axis in axes:
        free, all_of_it = np.maximum(corners, 0), np.abs(corners)
        for other in axes:
            if other != axis:
                free, all_of_it = _paired(free, other), _paired(all_of_it, other)
        share = free / np.maximum(all_of_it, 1e-12)
        share[share < SLIVER] = 0
        shares.append(share)
    return shares


def _part(a: np.ndarray, axis: int, start: int | None, stop: int | None) -> np.ndarray:
    """The view of `a` from start to stop along an axis."""
    return a[(slice(None),) * axis + (slice(start, stop),)]


def _paired(a: np.ndarray, axis: int) -> np.ndarray:
    """The sums of neighbours along an axis, one fewer."""
    return _part(a, axis, 1, None) + _part(a, axis, None, -1)


def _continued(a: np.ndarray, axis: int, border: str, of_pressure: bool) -> np.ndarray:
    """`a` with the border's ghost cell at each end of an axis."""
    first, last = _part(a, axis, 0, 1), _part(a, axis, -1, None)
    if border == "toroidal":
        return np.concatenate([last, a, first], axis)
    sign = _GHOST[border][of_pressure]
    return np.concatenate([sign * first, a, sign * last], axis)


def _outflow(v: np.ndarray, shares: list[np.ndarray], border: str) -> np.ndarray:
    """What flows out of each cell through the open parts of its faces."""
    total = np.zeros(v.shape[:-1])
    for axis, share in enumerate(shares):
        along = _continued(v[..., _component(axis, total.ndim)], axis, border, of_pressure=False)
        total += np.diff(0.5 * share * _paired(along, axis), axis=axis)
    return total


def _push(p: np.ndarray, shares: list[np.ndarray], border: str) -> np.ndarray:
    """The pressure gradient that acts on cells: the mean of its differences over the open parts of their faces.

    With cells weighted by their open share it is -1 times the transpose of `_outflow`.
    """
    felt = []
    for axis, share in enumerate(shares):
        forces = share * np.diff(_continued(p, axis, border, of_pressure=True), axis=axis)
        felt.append(_paired(forces, axis) / np.maximum(_paired(share, axis), SLIVER))
    return np.stack(felt[::-1], axis=-1)


def _past(v: np.ndarray, border: str, distance: np.ndarray) -> np.ndarray:
    """`project` with an obstacle."""
    shape, size = distance.shape, distance.size
    shares = openings(distance, border)
    source = _outflow(v, shares, border)
    slopes = [np.gradient(v, axis=axis) for axis in range(v.ndim - 1) if shape[axis] > 1]
    scale = np.sqrt(max(np.mean(np.square(slopes)) if slopes else 0.0, np.mean(source**2)))
    p, failed = cg(
        LinearOperator((size, size), matvec=lambda x: -_outflow(_push(x.reshape(shape), shares, border), shares,
                                                                border).ravel()),
        -source.ravel(), rtol=0, atol=REMAINING * scale * np.sqrt(size), maxiter=MOST_ITERATIONS,
        M=LinearOperator((size, size), matvec=lambda x: -_pressure(x.reshape(shape), border, UNSEEN).ravel()))
    if failed:
        raise ArithmeticError(f"no pressure past the obstacle was found in {MOST_ITERATIONS} iterations")
    v = v - _push(p.reshape(shape), shares, border)
    closed = np.ones(shape, bool)
    for axis, share in enumerate(shares):
        closed &= (_part(share, axis, None, -1) == 0) & (_part(share, axis, 1, None) == 0)
    closed &= distance < 0
    return _along_walls(v, closed, distance).astype(np.float32)


def _along_walls(v: np.ndarray, closed: np.ndarray, distance: np.ndarray) -> np.ndarray:
    """`v` with the motion of the nearest other cell in `closed` ones, less what of it goes through the wall."""
    if not closed.any() or closed.all():
        return v
    nearest = ndimage.distance_transform_edt(closed, return_distances=False, return_indices=True)
    moved = v[tuple(nearest)][closed]
    normal = outward(distance)[closed]
    v = v.copy()
    v[closed] = moved - np.sum(moved * normal, -1, keepdims=True) * normal
    return v


def _pressure(source: np.ndarray, border: str, unseen_as: float = 0.0) -> np.ndarray:
    """Solve div grad p = source, mode by mode; modes invisible to differences stay zero.

    With `unseen_as`, eigenvalues are at most minus that, and all modes are solved for.
    """
    axes = tuple(range(source.ndim))
    if border == "toroidal":
        spectrum = fft.fftn(source, axes=axes)
        angles = [2 * np.pi * np.arange(n) / n for n in source.shape]
    elif border == "wall":
        spectrum = fft.dctn(source, type=2, axes=axes)
        angles = [np.pi * np.arange(n) / n for n in source.shape]
    else:
        spectrum = fft.dstn(source, type=2, axes=axes)
        angles = [np.pi * np.arange(1, n + 1) / n for n in source.shape]
    # differencing twice multiplies a mode whose phase changes by `angle` from cell to cell by -sin(angle)^2
    eigenvalue = np.zeros(source.shape)
    for axis, angle in enumerate(angles):
        eigenvalue -= (np.sin(angle) ** 2).reshape([-1 if a == axis else 1 for a in axes])
    if unseen_as:
        spectrum /= np.minimum(eigenvalue, -unseen_as)
    else:
        unseen = eigenvalue > -1e-12
        spectrum[unseen] = 0.0
        eigenvalue[unseen] = 1.0
        spectrum /= eigenvalue
    if border == "toroidal":
        return fft.ifftn(spectrum, axes=axes).real
    inverse = fft.idctn if border == "wall" else fft.idstn
    return inverse(spectrum, type=2, axes=axes)
