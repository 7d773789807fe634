"""Motion exemplars I: the small fields whose detail the synthesis spreads (ma09 §4, figures 1, 2, 4 and 9).

Every function but one returns an (N, N, 2) float32 array: components x, y; row 0 is the bottom (y up); the longest
vector has length 1; the tile is sampled toroidally by the synthesis. Only arrays come in, bottom row first:
files are read elsewhere.

    exemplar      circle, square, heart, stripes, sinusoid by procedure
    from_bitmap   the curl of grey values
    from_drawing  along the strokes of a picture         from_svg   along the paths of a vector drawing
    from_field    a field made elsewhere                 from_clip  optical flow of a film clip
    from_volume   a field in space made elsewhere, (N, N, N, 3), for synthesis from 3-D to 3-D

The procedural kinds are curls of a potential, v = curl ψ = (∂ψ/∂y, -∂ψ/∂x), so their flow lines are the level
sets of ψ and they have no sources or sinks. The potential of a closed motif is a smooth bump of the shape's
gauge function ρ (ρ(p) = 1 on the outline, ρ(s p) = s ρ(p)), so the flow runs counter-clockwise round scaled
copies of the outline and rests outside it.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float32]
Floats = NDArray[np.float64]
Gauge = Callable[[Floats, Floats], Floats]
SMALLEST = 8
MOTIF_EXTENT = 0.78  # of the tile; the margin keeps neighbouring motifs apart
EDGE_SAMPLES = 16  # quadrature points on each cell edge
STROKE_REACH = 0.08  # of the tile: where the flow beside a thin stroke has died away
DRAWING_PIXELS = 1024  # a drawing with a longer side is reduced to it: more shows no finer strokes
INK = 0.25  # how far a pixel's tone, 0 to 1, is from the paper's to count as ink
SVG_CHARACTERS, SVG_SEGMENTS = 1_000_000, 20_000  # more is an attack or a mistake


def _opencv() -> Any:
    """OpenCV, imported when needed. Its import appends an empty entry to LD_LIBRARY_PATH, with which child processes
    would load libraries from their working directory: the variable is put back."""
    before = os.environ.get("LD_LIBRARY_PATH")
    import cv2

    if before is None:
        os.environ.pop("LD_LIBRARY_PATH", None)
    else:
        os.environ["LD_LIBRARY_PATH"] = before
    return cv2


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
    """The curl of a picture's grey values: the flow runs along its edges, bright on the left (ma09 §4).

    grey: (Y, X), bottom row first, any range. The central square is taken and made toroidal by Moisan's
    decomposition: the smooth part that carries the jumps across the border is left out, a picture with a
    plain border stays as it is. It is then resampled and differentiated in Fourier space, smoothed by a
    Gaussian of standard deviation `blur`, in cells of the exemplar or of the picture, whichever are larger.

    Returns (size, size, 2) float32, no sources. Raises ValueError for a blank, non-finite or tiny picture.
    """
    _check_size(size)
    picture = _square_crop(_checked(grey, 2, "the bitmap"))
    span = np.ptp(picture)
    if span == 0:
        raise ValueError("the bitmap is blank: all its grey values are the same")
    if not 0 <= blur <= size / 4:
        raise ValueError(f"blur = {blur} is not between 0 and a quarter of the exemplar's {size} cells")
    return _unit(_fourier_curl(_periodic(picture / span), size, blur))


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
    cv2 = _opencv()

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
    """A field in space made elsewhere: its central cube, resampled (linear; means of volume when smaller).

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

    frames: grey pictures (Y, X) of one size, bottom row first, uint8 or float from 0 to 1, two or more.
    The flow between neighbours is OpenCV's dense inverse search (Kroeger 2016).

    Returns (size, size, 2) float32. Raises ValueError for fewer than two frames, frames of different or too
    small a size, non-finite values, or a clip in which nothing moves.
    """
    cv2 = _opencv()

    flow = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    total: Any = 0.0
    previous = None
    for number, frame in enumerate(frames):
        tone = _checked(_tones(frame), 2, f"frame {number + 1} of the clip")
        grey = np.ascontiguousarray(np.rint(np.clip(tone, 0, 1) * 255), dtype=np.uint8)
        if previous is not None:
            if grey.shape != previous.shape:
                raise ValueError(f"frame {number + 1} of the clip is not of the size of the one before it")
            total = total + flow.calc(previous, grey, None)  # rows go up, so its y component does too
        previous = grey
    if np.ndim(total) == 0:
        raise ValueError("a clip needs two frames or more to show motion")
    return from_field(total, size, toroidal=True)


def from_drawing(picture: ArrayLike, size: int) -> Array:
    """A hand drawing: the flow runs along its strokes and dies away beside them (ma09 §1, "manual art").

    picture: (Y, X), (Y, X, 3) or (Y, X, 4), bottom row first, uint8 or float from 0 to 1. The paper is its
    median tone, ink what differs from it by a quarter of the range. The strokes are thinned to lines
    and followed, straight on through crossings. An open stroke starts at its red dot; without one it runs
    to the right, or upwards if it is more upright than level. A closed stroke runs counter-clockwise.
    A picture that is not square is widened with paper.

    Returns (size, size, 2) float32. Raises ValueError for a picture without strokes, non-finite or tiny.
    """
    _check_size(size)
    ink, red = _ink(picture)
    strokes, half_width = _traced(ink, red)
    if not strokes:
        raise ValueError("the drawing is blank: no stroke is found in it")
    return _unit(_along(strokes, size, max(STROKE_REACH, 2 * half_width)))


def from_svg(text: str, size: int) -> Array:
    """A vector drawing: the flow runs along its paths, in the direction in which each was drawn (ma09 §1).

    text: the SVG document. Paths, lines, polylines, polygons, rectangles, circles and ellipses count,
    transforms are applied; styles, text and pictures are ignored and nothing it refers to is opened. The
    viewBox is fitted into the tile, or the drawing with a margin where there is none.

    Returns (size, size, 2) float32. Raises ValueError for a document that is not SVG, has a document type
    (entities), more than 1,000,000 characters or 20,000 segments, or nothing drawn in it.
    """
    _check_size(size)
    strokes, corner, extent = _svg_drawn(text)
    offset = (extent.max() - extent) / 2 - corner
    flip = np.array([1.0, -1.0])  # SVG's y points down
    strokes = [((s + offset) / extent.max() - 0.5) * flip + 0.5 for s in strokes]
    return _unit(_along(strokes, size, STROKE_REACH))


def svg_outlines(text: str) -> tuple[list[Floats], float]:
    """The closed paths of a vector drawing, as contours of obstacles (ma09 figure 8: "object contours").

    text: the SVG document, as `from_svg`. Returns polygons (n, 2) of x, y, y upwards, where the viewBox, or
    the drawing where there is none, is 1 high; and how wide it is. Raises ValueError as `from_svg`, and where no
    path is closed.
    """
    strokes, corner, extent = _svg_drawn(text)
    if not extent.min() > 0:
        raise ValueError("the SVG encloses nothing: its viewBox has no area")
    closed = [s for s in strokes if np.linalg.norm(s[0] - s[-1]) < 1e-3 * extent.max()]
    if not closed:
        raise ValueError("the SVG encloses nothing: none of its paths is closed")
    return [(s - corner) / extent[1] * np.array([1.0, -1.0]) + np.array([0.0, 1.0]) for s in closed], float(
        extent[0] / extent[1])


def _svg_drawn(text: str) -> tuple[list[Floats], Floats, Floats]:
    """The paths of a document in its own units, y downwards; lower corner and extent of what it shows."""
    if len(text) > SVG_CHARACTERS:
        raise ValueError(f"the SVG has {len(text)} characters; at most {SVG_CHARACTERS}")
    if re.search(r"<!\s*(DOCTYPE|ENTITY)", text, re.IGNORECASE):
        raise ValueError("the SVG has a document type or entities; save it as plain SVG")
    strokes, box = _svg_strokes(text)
    if not strokes:
        raise ValueError("the SVG is blank: no path is found in it")
    corner, extent = box if box else _bounds(strokes)
    if not (np.isfinite(extent).all() and extent.max() > 0):
        raise ValueError("the SVG's extent is not a positive number")
    return strokes, corner, extent


def _svg_strokes(text: str) -> tuple[list[Floats], tuple[Floats, Floats] | None]:
    """The paths as (n, 2) polylines in user units and the viewBox as (corner, extent), or None."""
    import svgpathtools

    try:
        document = svgpathtools.Document.from_svg_string(text)
        paths = [part for path in document.paths() for part in path.continuous_subpaths()]
        view = document.root.get("viewBox")
        numbers = [float(n) for n in view.replace(",", " ").split()] if view else []
    except Exception as error:  # the parser raises whatever a broken document makes it stumble over
        raise ValueError(f"the SVG cannot be read: {error}") from error
    if sum(len(path) for path in paths) > SVG_SEGMENTS:
        raise ValueError(f"the SVG has more than {SVG_SEGMENTS} path segments")
    strokes = []
    for path in paths:
        parts = (
            [segment.point(t) for t in np.linspace(0, 1, 2 if isinstance(segment, svgpathtools.Line) else 33)]
            for segment in path
        )
        points = np.array([p for part in parts for p in part])
        if not np.isfinite(points).all():
            raise ValueError("the SVG has coordinates that are not finite")
        if np.ptp(points.real) + np.ptp(points.imag) > 0:
            strokes.append(np.stack([points.real, points.imag], axis=-1))
    box = (np.array(numbers[:2]), np.array(numbers[2:])) if len(numbers) == 4 else None
    return strokes, box


def _bounds(strokes: Sequence[Floats]) -> tuple[Floats, Floats]:
    """Corner and extent of the strokes' box with an eighth of it as margin on each side."""
    points = np.concatenate(strokes)
    corner, extent = points.min(0), np.ptp(points, axis=0)
    margin = extent.max() / 8
    return corner - margin, extent + 2 * margin


def _ink(picture: ArrayLike) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Where the drawing has ink and where that is red, both (S, S), the picture centred on square paper."""
    cv2 = _opencv()

    tones = _tones(picture)
    tones = _checked(tones[..., None] if tones.ndim == 2 else tones, 3, "the drawing")
    if tones.shape[2] not in (1, 3, 4):
        raise ValueError(f"the drawing has {tones.shape[2]} channels; 1, 3 or 4 are known")
    largest = max(tones.shape[:2])
    if largest > DRAWING_PIXELS:
        share = DRAWING_PIXELS / largest
        tones = cv2.resize(tones, None, fx=share, fy=share, interpolation=cv2.INTER_AREA)
        tones = tones.reshape(*tones.shape[:2], -1)  # OpenCV drops a single channel's axis
    opacity = tones[..., 3:] if tones.shape[2] == 4 else 1.0
    colour = np.broadcast_to(tones[..., :3] * opacity + (1 - opacity), (*tones.shape[:2], 3))
    red = colour[..., 0] - colour[..., 1:].max(-1) > 2 * INK
    tone = colour @ [0.2126, 0.7152, 0.0722]
    ink = (np.abs(tone - np.median(tone)) > INK) | red
    padding = [((max(ink.shape) - n) // 2, (max(ink.shape) - n + 1) // 2) for n in ink.shape]
    return np.pad(ink, padding), np.pad(red, padding)


def _traced(ink: NDArray[np.bool_], red: NDArray[np.bool_]) -> tuple[list[Floats], float]:
    """The strokes as directed (n, 2) polylines x, y in the unit tile, and half their mean width."""
    cv2 = _opencv()
    from scipy.ndimage import gaussian_filter1d

    mask = ink.astype(np.uint8) * 255
    thin = cv2.ximgproc.thinning(mask) > 0
    if not thin.any():
        return [], 0.0
    side = ink.shape[0]
    half_width = float(cv2.distanceTransform(mask, cv2.DIST_L2, 5)[thin].mean())
    dots = cv2.connectedComponentsWithStats(red.astype(np.uint8))[3][1:] if red.any() else np.empty((0, 2))
    strokes = []
    for line in _walks(thin, gap=2 * half_width + 2):
        points = np.array(line, np.float64)[:, ::-1]
        if len(points) < max(0.03 * side, 3 * half_width):
            continue  # a spur of the thinning, or a dot
        gap = np.hypot(*(points[0] - points[-1]))
        closed = gap <= 2 * half_width + 2 and len(points) > 6 * half_width + 6
        smooth = gaussian_filter1d(points, max(2.0, half_width), axis=0, mode="wrap" if closed else "nearest")
        if closed:
            smooth = np.vstack([smooth, smooth[:1]])
        if _runs_backwards(smooth, closed, dots, near=2 * half_width + 0.05 * side):
            smooth = smooth[::-1]
        strokes.append((smooth + 0.5) / side)
    return strokes, half_width / side


def _runs_backwards(points: Floats, closed: bool, dots: Floats, near: float) -> bool:
    """Whether a traced stroke has to be reversed to run as `from_drawing` says."""
    x, y = points.T
    if closed:
        return bool((x[:-1] * y[1:] - x[1:] * y[:-1]).sum() < 0)
    if len(dots):
        first, last = (np.hypot(*(dots - end).T).min() for end in (points[0], points[-1]))
        if min(first, last) <= near:
            return bool(last < first)
    across, up = points[-1] - points[0]
    return bool(across < 0 if abs(across) >= abs(up) else up < 0)


def _walks(thin: NDArray[np.bool_], gap: float) -> list[list[tuple[int, int]]]:
    """The lines of a thinned picture as chains of (y, x) pixels: from free ends first, then the loops.

    At a junction the walk goes the straightest way; it crosses up to `gap` pixels that another walk has
    taken, so that two strokes that cross stay two strokes.
    """
    left = {(int(y), int(x)) for y, x in np.argwhere(thin)}

    def neighbours(y: int, x: int) -> list[tuple[int, int]]:
        ring = [(y + dy, x + dx) for dy in (-1, 0, 1) for dx in (-1, 0, 1) if dy or dx]
        return [p for p in ring if p in left]

    ends = sorted(p for p in left if len(neighbours(*p)) == 1)
    walks = []
    for start in [*ends, *sorted(left)]:
        if start not in left:
            continue
        left.remove(start)
        line = [start]
        while True:
            step = _straightest(line, neighbours(*line[-1]), least=-2.0)
            if step is None and len(line) > gap:
                y, x = line[-1]
                reach = int(gap)
                ahead = [
                    (y + dy, x + dx)
                    for dy in range(-reach, reach + 1)
                    for dx in range(-reach, reach + 1)
                    if (y + dy, x + dx) in left and dy * dy + dx * dx <= gap * gap
                ]
                step = _straightest(line, ahead, least=0.8)
            if step is None:
                break
            left.remove(step)
            line.append(step)
        walks.append(line)
    return walks


def _straightest(
    line: list[tuple[int, int]], choices: list[tuple[int, int]], least: float
) -> tuple[int, int] | None:
    """The choice that best keeps the line's direction, if its cosine is `least` or more."""
    if not choices:
        return None
    y, x = line[-1]
    back_y, back_x = line[-min(len(line), 8)]
    dy, dx = y - back_y, x - back_x

    def cosine(p: tuple[int, int]) -> float:
        lengths = np.hypot(dy, dx) * np.hypot(p[0] - y, p[1] - x)
        return float(((p[0] - y) * dy + (p[1] - x) * dx) / lengths) if lengths else 0.0

    best = max(choices, key=lambda p: (cosine(p), p))
    return best if cosine(best) >= least else None


def _along(strokes: Sequence[Floats], size: int, reach: float) -> Floats:
    """Flow along polylines in the unit tile: their tangents, weighted by (1 - (d / reach)²)² at distance d.

    Distances are toroidal, so a stroke near the border acts across it. Where strokes meet their tangents
    are averaged by their weights, so opposite ones make a calm.
    """
    reach = max(reach, 2 / size)  # a line thinner than a cell would fall between the cells
    points, tangents = [], []
    for stroke in strokes:
        arc = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(stroke, axis=0).T))])
        at = np.linspace(0, arc[-1], max(3, int(np.ceil(arc[-1] * size * 2)) + 1))
        dense = np.stack([np.interp(at, arc, stroke[:, 0]), np.interp(at, arc, stroke[:, 1])], axis=-1)
        step = np.diff(dense, axis=0)
        length = np.hypot(*step.T)[:, None]
        points.append((dense[1:] + dense[:-1])[length[:, 0] > 0] / 2)
        tangents.append((step / np.where(length > 0, length, 1))[length[:, 0] > 0])
    point, tangent = np.concatenate(points), np.concatenate(tangents)
    x = (np.arange(size) + 0.5) / size
    v = np.empty((size, size, 2))
    across = np.abs((x[:, None] - point[:, 0] + 0.5) % 1 - 0.5) ** 2
    for row, y in enumerate(x):
        squared = across + ((y - point[:, 1] + 0.5) % 1 - 0.5) ** 2
        weight = np.clip(1 - squared / reach**2, 0, None) ** 2
        total = weight.sum(1, keepdims=True)
        v[row] = weight.max(1, keepdims=True) * (weight @ tangent) / np.where(total > 0, total, 1)
    return v


def _tones(picture: ArrayLike) -> Floats:
    """Integer pictures to 0 … 1, others as they are; float64."""
    array = np.asarray(picture)
    top = np.iinfo(array.dtype).max if np.issubdtype(array.dtype, np.integer) else 1
    return array.astype(np.float64) / top


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
