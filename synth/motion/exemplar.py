"""Motion exemplars I: the small fields whose detail the synthesis spreads (ma09 §4, figures 1, 2 and 4).

Every function returns an (N, N, 2) float32 array: components x, y; row 0 is the bottom (y up); the longest
vector has length 1; the tile repeats (the synthesis samples it toroidally). Only arrays come in: files are
read elsewhere.

The procedural kinds are curls of a potential, v = curl ψ = (∂ψ/∂y, -∂ψ/∂x), so their flow lines are the level
sets of ψ and they have no sources or sinks. The potential of a closed motif is a smooth bump of the shape's
gauge function ρ (ρ(p) = 1 on the outline, ρ(s p) = s ρ(p)), so the flow runs counter-clockwise round scaled
copies of the outline and rests outside it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float32]
Gauge = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]
SMALLEST = 8
MOTIF_EXTENT = 0.78  # of the tile; the margin keeps neighbouring motifs apart
EDGE_SAMPLES = 16  # quadrature points on each cell edge


def exemplar(kind: str, size: int) -> Array:
    """The procedural exemplar `kind`, one of KINDS, as (size, size, 2) float32 (ma09 §4, figures 1, 2, 4, 9).

    circle, square and heart are one upright motif on a resting background; stripes are parallel bands of
    alternating direction along x; sinusoid is the same bands along wavy flow lines. Each cell holds the exact
    mean of the analytic curl over its area, so a sharp corner or cusp stays as sharp as the grid allows.

    Raises ValueError for an unknown kind or a size below 8.
    """
    if kind not in _POTENTIALS:
        raise ValueError(f"unknown exemplar kind {kind!r}; known: {', '.join(KINDS)}")
    _check_size(size)
    return _unit(_mean_curl(_POTENTIALS[kind], size))


def _mean_curl(potential: Gauge, size: int) -> NDArray[np.float64]:
    """Mean of curl ψ over each cell of the tile [0, 1)²: by Stokes' theorem differences of ψ's edge means."""
    corners = np.arange(size + 1) / size
    along = (np.arange(size * EDGE_SAMPLES) + 0.5) / (size * EDGE_SAMPLES)
    rows = potential(along[None, :], corners[:, None]).reshape(size + 1, size, EDGE_SAMPLES).mean(2)
    columns = potential(corners[:, None], along[None, :]).reshape(size + 1, size, EDGE_SAMPLES).mean(2).T
    return np.stack([rows[1:] - rows[:-1], columns[:, :-1] - columns[:, 1:]], axis=-1)


def _motif(gauge: Gauge) -> Gauge:
    """ψ = (1 - ρ³)³ inside the outline ρ = 1, zero outside: fastest at ρ = 0.63, C¹ at the rim."""

    def potential(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        # the gauges take outlines that span [-1, 1] in their larger extent, round the tile's centre
        rho = gauge((x - 0.5) * 2 / MOTIF_EXTENT, (y - 0.5) * 2 / MOTIF_EXTENT)
        return np.clip(1 - rho**3, 0, None) ** 3

    return potential


def _circle(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.hypot(x, y)


def _square(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.maximum(np.abs(x), np.abs(y))


def _heart(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Gauge of a heart of two discs and the two tangents that meet in its tip, about a point on its axis.

    Both the notch and the tip are corners, not cusps of zero angle: the speed at a point of the outline goes
    with one over the distance from the gauge's centre to the tangent there, so it stays within 1 : 2.1.
    """
    lobe, tip, centre = 0.74, -2.1, -0.72  # discs of radius 1 round (±lobe, 0); the rest on the axis
    half = lobe + 1.0
    x, y = np.abs(x) * half, y * half + (1 + tip) / 2 - centre  # symmetric; the bounding box is centred

    reach = np.hypot(lobe, tip)
    tilt = np.arctan2(lobe, -tip) + np.arcsin(1 / reach)  # of the side, from the axis
    normal = np.cos(tilt), -np.sin(tilt)
    touch = lobe + normal[0], normal[1] - centre  # where the side becomes the disc
    side = (x * normal[0] + y * normal[1]) / ((tip - centre) * normal[1])

    # far root s = 1/ρ of |s p - q| = 1, q the disc's centre
    on_disc = touch[0] * y > touch[1] * x
    q = lobe, -centre
    squared, projected = x * x + y * y, x * q[0] + y * q[1]
    root = np.sqrt(np.clip(projected**2 - squared * (q[0] ** 2 + q[1] ** 2 - 1), 0, None))
    disc = squared / np.where(on_disc, projected + root, 1)
    return np.where(on_disc, disc, side)


def _stripes(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Two bands forth, two back: v_x = sin(4π y)."""
    return np.broadcast_to(-np.cos(4 * np.pi * y), np.broadcast_shapes(x.shape, y.shape))


def _sinusoid(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same bands, their flow lines y = y₀ + 0.08 sin(2π x)."""
    return -np.cos(4 * np.pi * (y - 0.08 * np.sin(2 * np.pi * x)))


_POTENTIALS: dict[str, Gauge] = {
    "circle": _motif(_circle),
    "square": _motif(_square),
    "heart": _motif(_heart),
    "stripes": _stripes,
    "sinusoid": _sinusoid,
}
KINDS = tuple(_POTENTIALS)


def _check_size(size: int) -> None:
    if size < SMALLEST:
        raise ValueError(f"an exemplar of {size} cells is too small; at least {SMALLEST}")


def _unit(v: NDArray[np.floating]) -> Array:
    """v scaled so that its longest vector has length 1, float32. Raises ValueError if nothing moves."""
    longest = np.sqrt((v.astype(np.float64) ** 2).sum(-1).max())
    if not longest > 1e-12:
        raise ValueError("the exemplar is blank: nothing moves in it")
    return np.ascontiguousarray(v / longest, dtype=np.float32)
