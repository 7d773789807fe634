"""Exact Helmholtz-Hodge projection of a velocity field onto its divergence-free part (ma09 §3.6,
Incompressibility).

Velocities and pressure lie at cell centres, and derivatives are central differences (ghost cells carry the
border condition), so `project` is an orthogonal projection for `divergence` itself: a cosine, sine or
Fourier transform solves the pressure equation to rounding, without iterations. Central differences do not
see the checkerboard mode; they leave it in the field.
"""

from __future__ import annotations

import numpy as np
from scipy import fft

from synth.advect import velocity_field

BORDERS = ("wall", "open", "toroidal")
"""No flow through the border (mirrored), free flow through it (zero pressure), or the other side."""

# ghost cell = sign * the outermost cell: (of the velocity along its own axis, of the pressure)
_GHOST = {"wall": (-1.0, 1.0), "open": (1.0, -1.0)}


def divergence(v: np.ndarray, border: str = "wall") -> np.ndarray:
    """Divergence by central differences: (Y, X, 2) or (Z, Y, X, 3) -> (Y, X) or (Z, Y, X) float64, per
    frame."""
    v = velocity_field(v).astype(np.float64)
    _require(border)
    return _divergence(v, border)


def project(v: np.ndarray, border: str = "wall") -> np.ndarray:
    """The divergence-free part of `v`: v minus the gradient of the pressure p that solves div grad p = div v.

    v       (Y, X, 2) or (Z, Y, X, 3) float32, cells per frame
    border  "wall": nothing flows through the border; "open": it flows freely; "toroidal"
    Returns the same shape, float32; its `divergence` at the same border is zero to rounding. A gradient
    becomes zero, a divergence-free field is returned unchanged, a second projection changes nothing (all to
    rounding).
    """
    v = velocity_field(v).astype(np.float64)
    _require(border)
    p = _pressure(_divergence(v, border), border)
    for axis in range(p.ndim):
        v[..., _component(axis, p.ndim)] -= _slope(p, axis, border, of_pressure=True)
    return v.astype(np.float32)


def _require(border: str) -> None:
    if border not in BORDERS:
        raise ValueError(f"border {border!r} is none of {', '.join(BORDERS)}")


def _component(axis: int, dimension: int) -> int:
    """The vector component (x = 0) that runs along an array axis (last = x)."""
    return dimension - 1 - axis


def _slope(a: np.ndarray, axis: int, border: str, of_pressure: bool) -> np.ndarray:
    """Central difference of `a` along an axis, with the border's ghost cells."""
    first, last = np.take(a, [0], axis), np.take(a, [-1], axis)
    if border == "toroidal":
        before, after = last, first
    else:
        sign = _GHOST[border][of_pressure]
        before, after = sign * first, sign * last
    n = a.shape[axis]
    padded = np.concatenate([before, a, after], axis)
    return 0.5 * (np.take(padded, range(2, n + 2), axis) - np.take(padded, range(n), axis))


def _divergence(v: np.ndarray, border: str) -> np.ndarray:
    dimension = v.ndim - 1
    total = np.zeros(v.shape[:-1])
    for axis in range(dimension):
        total += _slope(v[..., _component(axis, dimension)], axis, border, of_pressure=False)
    return total


def _pressure(source: np.ndarray, border: str) -> np.ndarray:
    """Solve div grad p = source, mode by mode; modes that no difference sees stay zero."""
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
    # differencing twice multiplies a mode that turns by `angle` from cell to cell by -sin(angle)^2
    eigenvalue = np.zeros(source.shape)
    for axis, angle in enumerate(angles):
        eigenvalue -= (np.sin(angle) ** 2).reshape([-1 if a == axis else 1 for a in axes])
    unseen = eigenvalue > -1e-12
    spectrum[unseen] = 0.0
    eigenvalue[unseen] = 1.0
    spectrum /= eigenvalue
    if border == "toroidal":
        return fft.ifftn(spectrum, axes=axes).real
    inverse = fft.idctn if border == "wall" else fft.idstn
    return inverse(spectrum, type=2, axes=axes)
