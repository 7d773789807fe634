"""Motion exemplars I: the small fields whose detail the synthesis spreads (ma09 §4, figures 1, 2, 4 and 9).

Every function but one returns an (N, N, 2) float32 array: components x, y; row 0 is the bottom (y up); the longest
vector has length 1; the tile is sampled toroidally by the synthesis. Only arrays come in, bottom row first:
files are read elsewhere.

    exemplar      circle, square, heart, stripes, sinusoid by procedure
    from_bitmap   the curl of grey values
    from_drawing  along the strokes of an image          from_svg   along the paths of a vector drawing
    from_field    a field made elsewhere                 from_clip  optical flow of a film clip
    from_volume   a 3-D field made elsewhere, (N, N, N, 3), for synthesis from 3-D to 3-D

The procedural kinds are curls of a potential, v = curl ψ = (∂ψ/∂y, -∂ψ/∂x), so their flow lines are the level
sets of ψ and they have no sources or sinks. The potential of a closed motif is a smooth bump of the shape's
gauge function ρ (ρ(p) = 1 on the outline, ρ(s p) = s ρ(p)), so the flow runs counter-clockwise along scaled
copies of the outline and is zero outside it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from synth.motion import strokes
from synth.optical_flow import optical_flow, tones

Array = NDArray[np.float32]
Floats = NDArray[np.float64]
Gauge = Callable[[Floats, Floats], Floats]
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


def _mean_curl(potential: Gauge, size: int) -> Floats:
    """Mean of curl ψ over each cell of the tile [0, 1)²: by Stokes' theorem differences of ψ's edge means."""
    corners = np.arange(size + 1) / size
    along = (np.arange(size * EDGE_SAMPLES) + 0.5) / (size * EDGE_SAMPLES)
    rows = potential(along[None, :], corners[:, None]).reshape(size + 1, size, EDGE_SAMPLES).mean(2)
    columns = potential(corners[:, None], along[None, :]).reshape(size + 1, size, EDGE_SAMPLES).mean(2).T
    return np.stack([rows[1:] - rows[:-1], columns[:, :-1] - columns[:, 1:]], axis=-1)


def _motif(gauge: Gauge) -> Gauge:
    """ψ = (1 - ρ³)³ inside the outline ρ = 1, zero outside: fastest at ρ = 0.63, C¹ at the rim."""

    def potential(x: Floats, y: Floats) -> Floats:
        # the gauges take outlines that span [-1, 1] in their larger extent, round the tile's centre
        rho = gauge((x - 0.5) * 2 / MOTIF_EXTENT, (y - 0.5) * 2 / MOTIF_EXTENT)
        return np.clip(1 - rho**3, 0, None) ** 3

    return potential


def _circle(x: Floats, y: Floats) -> Floats:
    return np.hypot(x, y)


def _square(x: Floats, y: Floats) -> Floats:
    return np.maximum(np.abs(x), np.abs(y))


def _heart(x: Floats, y: Floats) -> Floats:
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


def _stripes(x: Floats, y: Floats) -> Floats:
    """Two bands forth, two back: v_x = sin(4π y)."""
    return np.broadcast_to(-np.cos(4 * np.pi * y), np.broadcast_shapes(x.shape, y.shape))


def _sinusoid(x: Floats, y: Floats) -> Floats:
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


def from_bitmap(grey: ArrayLike, size: int, blur: float = 1.0) -> Array:
    """The curl of an image's grey values: the flow runs along its edges, bright on the left (ma09 §4).

    grey: (Y, X), bottom row first, any range. The central square is taken and made toroidal by Moisan's
    decomposition: the smooth part that carries the jumps across the border is left out, an image with a
    plain border stays as it is. It is then resampled and differentiated in Fourier space, smoothed by a
    Gaussian of standard deviation `blur`, in cells of the exemplar or of the image, whichever are larger.

    Returns (size, size, 2) float32, no sources. Raises ValueError for a blank, non-finite or tiny image.
    """
    _check_size(size)
    image = _square_crop(_checked(grey, 2, "the bitmap"))
    span = np.ptp(image)
    if span == 0:
        raise ValueError("the bitmap is blank: all its grey values are the same")
    if not 0 <= blur <= size / 4:
        raise ValueError(f"blur = {blur} is not between 0 and a quarter of the exemplar's {size} cells")
    return _unit(_fourier_curl(_periodic(image / span), size, blur))


def _fourier_curl(psi: Floats, size: int, blur: float) -> Floats:
    """curl ψ of a toroidal (S, S) array at the cells of a (size, size) one, band-limited and blurred."""
    side = psi.shape[0]
    band = (min(size, side) - 1) // 2  # the frequencies that both grids hold
    k = np.arange(-band, band + 1)
    spectrum = np.fft.fft2(psi)[np.ix_(k, k)] * (size / side) ** 2
    sigma = blur / min(size, side)
    k_y, k_x = np.meshgrid(k, k, indexing="ij")
    spectrum *= np.exp(-2 * (np.pi * sigma) ** 2 * (k_x**2 + k_y**2))
    # cell centres lie half a cell inside the tile on both grids
    spectrum *= np.exp(1j * np.pi * (k_x + k_y) * (1 / size - 1 / side))
    v = np.zeros((2, size, size), np.complex128)
    v[0][np.ix_(k, k)] = 2j * np.pi * k_y * spectrum
    v[1][np.ix_(k, k)] = -2j * np.pi * k_x * spectrum
    return np.moveaxis(np.fft.ifft2(v).real, 0, -1)


def _periodic(u: Floats) -> Floats:
    """The periodic part of u (Y, X) or (Z, Y, X): u less the smoothest function with u's jumps across the border.

    L. Moisan, "Periodic plus smooth image decomposition", J. Math. Imaging Vision 39 (2011), eq. 10 to 12.
    """
    jump = np.zeros_like(u)
    for axis in range(u.ndim):
        first, last = (np.moveaxis(jump, axis, 0)[end] for end in (0, -1))  # views: jump itself is added to
        step = np.take(u, 0, axis) - np.take(u, -1, axis)
        first += step
        last -= step
    laplacian = sum(
        2 * np.cos(2 * np.pi * np.fft.fftfreq(n)).reshape([-1 if a == axis else 1 for a in range(u.ndim)]) - 2
        for axis, n in enumerate(u.shape)
    )
    spectrum = np.fft.fftn(jump)
    laplacian[(0,) * u.ndim] = 1
    spectrum[(0,) * u.ndim] = 0
    return u + np.fft.ifftn(spectrum / laplacian).real


def from_field(values: ArrayLike, size: int, toroidal: bool = False) -> Array:
    """A field made elsewhere as an exemplar: its central square, resampled (linear; area means when smaller).

    values: (Y, X, 2), components x, y, bottom row first, any unit. With `toroidal` the jumps across the
    border are taken out (as in `from_bitmap`); without, the field is taken for a tile already.

    Returns (size, size, 2) float32. Raises ValueError for a field that is blank, not finite or tiny.
    """
    cv2 = strokes.opencv()

    _check_size(size)
    v = _square_crop(_checked(values, 3, "the field"))
    if v.shape[2] != 2:
        raise ValueError(f"the field has {v.shape[2]} components; an exemplar has 2")
    if toroidal:
        v = np.stack([_periodic(v[..., 0]), _periodic(v[..., 1])], axis=-1)
    if v.shape[0] != size:
        smaller = v.shape[0] > size
        v = cv2.resize(v, (size, size), interpolation=cv2.INTER_AREA if smaller else cv2.INTER_LINEAR)
    return _unit(v)


def from_volume(values: ArrayLike, size: int, toroidal: bool = False) -> Array:
    """A 3-D field made elsewhere: its central cube, resampled (linear; means of volume when smaller).

    values: (Z, Y, X, 3), components x, y, z, any unit; `toroidal` as in `from_field`.

    Returns (size, size, size, 3) float32. Raises ValueError for a field that is blank, not finite or tiny.
    """
    _check_size(size)
    v = _checked(values, 4, "the field")
    if v.shape[3] != 3:
        raise ValueError(f"the field has {v.shape[3]} components; an exemplar in space has 3")
    side = min(v.shape[:3])
    if side < SMALLEST:
        raise ValueError(f"the field is {side} cells thin; at least {SMALLEST} a side")
    z, y, x = ((n - side) // 2 for n in v.shape[:3])
    v = v[z : z + side, y : y + side, x : x + side]
    if toroidal:
        v = np.stack([_periodic(v[..., c]) for c in range(3)], axis=-1)
    weights = _resampling(side, size)
    for axis in range(3):
        v = np.moveaxis(np.tensordot(weights, v, (1, axis)), 0, axis)
    return _unit(v)


def _resampling(side: int, size: int) -> Floats:
    """(size, side) weights of the cells of one axis in those of another of the same extent."""
    if size >= side:
        return np.stack([np.interp((np.arange(size) + 0.5) * side / size - 0.5, np.arange(side), cell)
                         for cell in np.eye(side)], axis=1)
    edges, cells = np.arange(size + 1)[:, None] * side / size, np.arange(side)
    covered = np.clip(edges, cells, cells + 1)
    return np.diff(covered, axis=0) * size / side


def from_clip(frames: Iterable[ArrayLike], size: int) -> Array:
    """The mean optical flow of a clip, made toroidal (ma09 §1, "captured data").

    frames: grey images (Y, X) of one size, bottom row first, uint8 or float from 0 to 1, two or more.
    The flow between neighbours is `synth.optical_flow`.

    Returns (size, size, 2) float32. Raises ValueError for fewer than two frames, frames of different or too
    small a size, non-finite values, or a clip in which nothing moves.
    """
    total: Any = 0.0
    for flow in optical_flow(frames):
        total = total + flow
    return from_field(total, size, toroidal=True)


def from_drawing(image: ArrayLike, size: int) -> Array:
    """A hand drawing: the flow runs along its strokes and dies away beside them (ma09 §1, "manual art").

    image: (Y, X), (Y, X, 3) or (Y, X, 4), bottom row first, uint8 or float from 0 to 1. The paper is its
    median tone, ink what differs from it by a quarter of the range. The strokes are thinned to lines
    and followed, straight on through crossings. An open stroke starts at its red dot; without one it runs
    to the right, or upwards if it is more upright than level. A closed stroke runs counter-clockwise.
    A image that is not square is widened with paper.

    Returns (size, size, 2) float32. Raises ValueError for an image without strokes, non-finite or tiny.
    """
    _check_size(size)
    drawn = tones(image)
    drawn = _checked(drawn[..., None] if drawn.ndim == 2 else drawn, 3, "the drawing")
    lines, half_width = strokes.traced(*strokes.ink(drawn))
    if not lines:
        raise ValueError("the drawing is blank: no stroke is found in it")
    return _unit(strokes.flow_along(lines, size, max(strokes.STROKE_REACH, 2 * half_width)))


def from_svg(text: str, size: int) -> Array:
    """A vector drawing: the flow runs along its paths, in the direction in which each was drawn (ma09 §1).

    text: the SVG document. Paths, lines, polylines, polygons, rectangles, circles and ellipses count,
    transforms are applied; styles, text and images are ignored and no reference is opened. The
    viewBox is fitted into the tile, or the drawing with a margin where there is none.

    Returns (size, size, 2) float32. Raises ValueError for a document that is not SVG, has a document type
    (entities), more than 1,000,000 characters or 20,000 segments, or nothing drawn in it.
    """
    _check_size(size)
    return _unit(strokes.flow_along(strokes.svg_strokes(text), size, strokes.STROKE_REACH))


def _checked(values: ArrayLike, dimensions: int, name: str) -> Floats:
    array = np.asarray(values, np.float64)
    if array.ndim != dimensions:
        raise ValueError(f"{name} has {array.ndim} dimensions instead of {dimensions}")
    if min(array.shape[:2]) < SMALLEST:
        y, x = array.shape[:2]
        raise ValueError(f"{name} of {x} x {y} is too small; at least {SMALLEST} a side")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} has values that are not finite")
    return array


def _square_crop(array: Floats) -> Floats:
    """The central square of (Y, X, …)."""
    side = min(array.shape[:2])
    y, x = ((n - side) // 2 for n in array.shape[:2])
    return array[y : y + side, x : x + side]


def _check_size(size: int) -> None:
    if size < SMALLEST:
        raise ValueError(f"an exemplar of {size} cells is too small; at least {SMALLEST}")


def _unit(v: NDArray[np.floating]) -> Array:
    """v scaled so that its longest vector has length 1, float32. Raises ValueError if nothing moves."""
    longest = np.sqrt((v.astype(np.float64) ** 2).sum(-1).max())
    if not longest > 1e-9:
        raise ValueError("the exemplar is blank: nothing moves in it")
    return np.ascontiguousarray(v / longest, dtype=np.float32)
