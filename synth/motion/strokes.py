"""Strokes: the lines of a hand drawing or a vector drawing, and the flow along them (ma09 §1, "manual art").

A stroke is a directed polyline, (n, 2) float64 points x, y; in the unit tile, y upwards, unless stated otherwise.

    ink           where an image has ink          svg_strokes   the paths of an SVG document
    traced        the strokes of that ink          svg_outlines  its closed paths, as contours of obstacles
    flow_along    the field that follows strokes
"""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
STROKE_REACH = 0.08  # of the tile: where the flow beside a thin stroke has died away
DRAWING_PIXELS = 1024  # a drawing with a longer side is reduced to it: more shows no finer strokes
INK = 0.25  # how far a pixel's tone, 0 to 1, is from the paper's to count as ink
SVG_CHARACTERS, SVG_SEGMENTS = 1_000_000, 20_000  # more is an attack or a mistake


def opencv() -> Any:
    """OpenCV, imported when needed. Its import appends an empty entry to LD_LIBRARY_PATH, with which child processes
    would load libraries from their working directory: the variable is put back."""
    before = os.environ.get("LD_LIBRARY_PATH")
    import cv2

    if before is None:
        os.environ.pop("LD_LIBRARY_PATH", None)
    else:
        os.environ["LD_LIBRARY_PATH"] = before
    return cv2


def svg_strokes(text: str) -> list[Floats]:
    """The paths of a vector drawing as strokes, each in the direction in which it was drawn.

    text: the SVG document, as `exemplar.from_svg` takes it. The viewBox is centred in the unit tile, or the drawing
    with a margin where there is none. Raises ValueError as `exemplar.from_svg`.
    """
    strokes, corner, extent = _svg_drawn(text)
    offset = (extent.max() - extent) / 2 - corner
    flip = np.array([1.0, -1.0])  # SVG's y points down
    return [((s + offset) / extent.max() - 0.5) * flip + 0.5 for s in strokes]


def svg_outlines(text: str) -> tuple[list[Floats], float]:
    """The closed paths of a vector drawing, as contours of obstacles (ma09 figure 8: "object contours").

    text: the SVG document, as `exemplar.from_svg` takes it. Returns polygons (n, 2) of x, y, y upwards, where the
    viewBox, or the drawing where there is none, is 1 high; and how wide it is. Raises ValueError as
    `exemplar.from_svg`, and where no path is closed.
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
    strokes, box = _svg_paths(text)
    if not strokes:
        raise ValueError("the SVG is blank: no path is found in it")
    corner, extent = box if box else _bounds(strokes)
    if not (np.isfinite(extent).all() and extent.max() > 0):
        raise ValueError("the SVG's extent is not a positive number")
    return strokes, corner, extent


def _svg_paths(text: str) -> tuple[list[Floats], tuple[Floats, Floats] | None]:
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


def ink(tones: Floats) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Where an image (Y, X, channels), tones 0 to 1, has ink, and where that is red: both (S, S), square paper.

    The paper is the median tone; an image that is not square is centred on more paper. Raises ValueError for a number
    of channels other than 1, 3 or 4.
    """
    cv2 = opencv()

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
    inked = (np.abs(tone - np.median(tone)) > INK) | red
    padding = [((max(inked.shape) - n) // 2, (max(inked.shape) - n + 1) // 2) for n in inked.shape]
    return np.pad(inked, padding), np.pad(red, padding)


def traced(inked: NDArray[np.bool_], red: NDArray[np.bool_]) -> tuple[list[Floats], float]:
    """The strokes as directed (n, 2) polylines x, y in the unit tile, and half their mean width."""
    cv2 = opencv()
    from scipy.ndimage import gaussian_filter1d

    mask = inked.astype(np.uint8) * 255
    thin = cv2.ximgproc.thinning(mask) > 0
    if not thin.any():
        return [], 0.0
    side = inked.shape[0]
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
    """Whether a traced stroke has to be reversed to run as `exemplar.from_drawing` promises."""
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
    """The lines of a thinned image as chains of (y, x) pixels: from free ends first, then the loops.

    At a junction the walk takes the straightest branch; it crosses up to `gap` pixels that another walk has
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


def flow_along(strokes: Sequence[Floats], size: int, reach: float) -> Floats:
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
