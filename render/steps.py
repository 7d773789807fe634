"""The inner steps of a photograph that flows: pieces of clips and what is known of them (okabe11 figs. 5 to 7, 9), and
what a user says of the motion (fig. 8).

Pictures come with their lowest row first, grey levels in 0..255, and are given as display values (h, width, 3) float32,
top row first.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from render import arrows, lic
from render.layout import fitted

REACH = 110.0
"""Grey levels of a difference that are shown black or white."""
ACROSS = 9
"""Arrows across a picture of motion."""
UNUSED = (0.93, 0.91, 0.86)
"""Display values of what is masked out."""


def grey(values: np.ndarray, width: int) -> np.ndarray:
    """A grey picture (Y, X), smoothly enlarged."""
    return _colourless(np.clip(_resampled(values / np.float32(255), width), 0, 1))


def difference(values: np.ndarray, width: int) -> np.ndarray:
    """Differences (Y, X), grey levels: mid grey is none."""
    return _colourless(np.clip(0.5 + _resampled(values, width) / (2 * REACH), 0, 1))


def strength(values: np.ndarray, most: float, width: int) -> np.ndarray:
    """Strengths (R, C) of cells, each a block: black is none, white is `most`."""
    rows, columns = (np.arange(n) * cells // n for n, cells in zip(
        (lic.height_for(values.shape, width), width), values.shape, strict=True))
    return _colourless(np.clip(values[rows][:, columns] / most, 0, 1))


def masked(values: np.ndarray, used: np.ndarray, width: int) -> np.ndarray:
    """A grey picture (Y, X) where `used` (Y, X) bool holds; the rest is plain."""
    cover = lic.resampled(used.astype(np.float32), lic.height_for(used.shape, width), width)[::-1, :, None]
    return (cover * grey(values, width) + (1 - cover) * np.array(UNUSED, np.float32)).astype(np.float32)


def motion(v: np.ndarray, width: int) -> np.ndarray:
    """A motion (Y, X, 2), y up, in colour with arrows: hue is the direction, as `lic.wheel` shows it."""
    # blocks first: a spline would swing at the border of what moves
    block = -(-width // v.shape[1])
    shown = lic.colour(np.repeat(np.repeat(v, block, axis=0), block, axis=1), width)
    rows, columns, places = arrows.grid(v.shape[:2], shown.shape[:2], ACROSS)
    vectors = v[rows, columns]
    length = 0.9 * width / ACROSS
    middle = vectors * (length / 2 / max(float(np.hypot(*vectors.T).max()), 1e-9))
    return arrows.drawn(shown, places - middle, vectors, length, arrows.INK)


def orientation(v: np.ndarray, fluid: np.ndarray, width: int, seed: int) -> np.ndarray:
    """An orientation map (Y, X, 2) of unit vectors (fig. 8 b): its lines in the colours of `lic.wheel`, with arrows;
    outside `fluid` (Y, X) in 0..1 it is pale."""
    lines = lic.picture(v, width, seed, tint=True)
    shown = _inside(lines, fluid, 1 - 0.3 * (1 - lines))
    rows, columns, places = arrows.grid(v.shape[:2], shown.shape[:2], 2 * ACROSS)
    vectors = v[rows, columns] * (fluid[rows, columns] >= 0.5)[:, None]
    length = 0.75 * width / (2 * ACROSS)
    return arrows.drawn(shown, places - vectors * (length / 2), vectors, length, arrows.INK)


def strokes(picture: np.ndarray, drawn: Sequence[np.ndarray], width: int) -> np.ndarray:
    """A picture (Y, X, 3), display values 0..1, with the strokes a user has drawn on it as arrows (fig. 8 a).

    drawn  each (K, 2): x, y of its points in pixels of the picture, whose lowest left is 0, 0
    """
    scale = width / picture.shape[1]
    return arrows.along(reduced(picture, width), [(stroke + 0.5) * scale for stroke in drawn], max(2.0, width / 210),
                        arrows.ORANGE)


def reduced(picture: np.ndarray, width: int) -> np.ndarray:
    """A picture (Y, X, 3), display values 0..1, `width` pixels wide."""
    if width <= picture.shape[1]:
        return fitted(np.ascontiguousarray(picture[::-1]), width)
    return np.clip(_resampled(picture, width)[::-1], 0, 1)


def outlined(picture: np.ndarray, corners: np.ndarray, size: int, colours: Sequence[arrows.Colour], width: int,
             ) -> np.ndarray:
    """A picture (Y, X, 3), display values 0..1, with the outlines of square pieces of `size` pixels.

    corners  (N, 2): row and column of the lowest left pixel of each
    """
    shown, scale = reduced(picture, width), width / picture.shape[1]
    stroke = max(2, round(width / 120))
    for (y, x), colour in zip(corners.tolist(), colours, strict=True):
        left, right = (round(at * scale) for at in (x, x + size))
        top, bottom = (len(shown) - round(at * scale) for at in (y + size, y))
        for rows, columns in (((top, top + stroke), (left, right)), ((bottom - stroke, bottom), (left, right)),
                              ((top, bottom), (left, left + stroke)), ((top, bottom), (right - stroke, right))):
            shown[max(rows[0], 0):max(rows[1], 0), max(columns[0], 0):max(columns[1], 0)] = colour
    return shown


def _resampled(values: np.ndarray, width: int) -> np.ndarray:
    return lic.resampled(values.astype(np.float32), lic.height_for(values.shape, width), width, order=3)


def _colourless(values: np.ndarray) -> np.ndarray:
    """(Y, X), lowest row first, as (h, w, 3), top row first."""
    return np.repeat(values[::-1, :, None], 3, axis=2).astype(np.float32)


def _inside(shown: np.ndarray, fluid: np.ndarray, outside: np.ndarray) -> np.ndarray:
    """A picture (h, w, 3) where there is fluid (Y, X), `outside` elsewhere."""
    cover = np.clip(lic.resampled(fluid.astype(np.float32), *shown.shape[:2]), 0, 1)[::-1, :, None]
    return (cover * shown + (1 - cover) * outside).astype(np.float32)
