"""Arrows on a picture: values of a vector field at a few points, as in ma09 figure 2; strokes, as in okabe11 figure 1.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

Colour = tuple[float, float, float]
RED: Colour = (0.80, 0.10, 0.08)  # the correct value
GREEN: Colour = (0.10, 0.52, 0.16)  # the value without the coordinate transformation
ORANGE: Colour = (0.96, 0.49, 0.02)  # what a user has drawn
INK: Colour = (0.10, 0.10, 0.10)

HEAD = 0.42  # length of the head as a share of the arrow's
WIDTH = 0.085  # of the shaft, as a share of the longest arrow's length
HEAD_LENGTH, HEAD_WIDTH = 3.8, 3.6  # of an arrow along a stroke, over the width of its shaft


def drawn(picture: np.ndarray, tails: np.ndarray, vectors: np.ndarray, length: float, colour: Colour,
          ) -> np.ndarray:
    """`picture` (h, w, 3) display values with an antialiased arrow for each vector, with a light outline.

    tails    (N, 2) x, y in pixels from the lower left corner
    vectors  (N, 2), y up; one shorter than a tenth of the longest is left out
    length   of the longest arrow, pixels
    """
    result = picture.copy()
    longest = float(np.hypot(vectors[:, 0], vectors[:, 1]).max(initial=0.0))
    if longest == 0.0:
        return result
    half = WIDTH * length / 2
    for tail, vector in zip(tails, vectors * (length / longest), strict=True):
        if np.hypot(*vector) < 0.1 * length:
            continue
        rim = _coverage(result.shape[:2], tail, vector, half, half * 0.9)
        ink = _coverage(result.shape[:2], tail, vector, half, 0.0)
        for (rows, columns, cover), paint in ((rim, (1.0, 1.0, 1.0)), (ink, colour)):
            part = result[rows, columns]
            part += cover[..., None] * (np.array(paint, np.float32) - part)
    return result


def grid(shape: Sequence[int], picture: Sequence[int], count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A regular grid of points, `count` of them across: rows and columns of the cells (Y, X) they lie in, and
    their positions (N, 2) x, y in a picture (h, w), pixels from the lower left corner."""
    down = max(1, round(count * shape[0] / shape[1]))
    y, x = np.meshgrid((np.arange(down) + 0.5) / down, (np.arange(count) + 0.5) / count, indexing="ij")
    rows, columns = (y * shape[0]).astype(int).ravel(), (x * shape[1]).astype(int).ravel()
    places = np.stack([(columns + 0.5) * picture[1] / shape[1], (rows + 0.5) * picture[0] / shape[0]], axis=-1)
    return rows, columns, places


def _coverage(shape: Sequence[int], tail: np.ndarray, vector: np.ndarray, half: float, grown: float,
              ) -> tuple[slice, slice, np.ndarray]:
    """Rows (from the top) and columns of the window that an arrow touches, and its coverage of each pixel there."""
    length = float(np.hypot(*vector))
    margin = 4 * half + grown + 2
    x0, y0 = np.floor(np.minimum(tail, tail + vector) - margin).astype(int)
    x1, y1 = np.ceil(np.maximum(tail, tail + vector) + margin).astype(int)
    x0, x1 = np.clip([x0, x1], 0, shape[1])
    y0, y1 = np.clip([y0, y1], 0, shape[0])
    y = (np.arange(y1 - 1, y0 - 1, -1) + 0.5 - tail[1])[:, None]
    x = (np.arange(x0, x1) + 0.5 - tail[0])[None, :]
    along, across = (x * vector[0] + y * vector[1]) / length, np.abs(x * vector[1] - y * vector[0]) / length
    neck = max(length * (1 - HEAD), length - 7 * half)
    shaft = np.maximum(across - half, np.maximum(-along, along - neck))
    slope = 3 * half / (length - neck)  # half width of the head per pixel of its length
    head = np.maximum((across - (length - along) * slope) / np.hypot(1.0, slope), neck - along)
    distance = np.minimum(shaft, head)
    cover = np.clip(0.5 - (distance - grown), 0.0, 1.0).astype(np.float32)
    return slice(shape[0] - y1, shape[0] - y0), slice(x0, x1), cover


def along(picture: np.ndarray, strokes: Sequence[np.ndarray], width: float, colour: Colour) -> np.ndarray:
    """`picture` (h, w, 3) display values with an antialiased arrow along each stroke, with a light outline.

    strokes  each (K, 2), K >= 2: x, y in pixels from the lower left corner, from its first point to its last
    width    of the shaft, pixels; a stroke shorter than a head is a head alone, which ends where the stroke does
    """
    result = picture.copy()
    y, x = np.mgrid[:picture.shape[0], :picture.shape[1]]
    at = np.stack([x + 0.5, picture.shape[0] - y - 0.5], axis=-1)
    for stroke in strokes:
        distance = _along(at, np.asarray(stroke, np.float64), width)
        for grown, paint in ((0.5 * width, (1.0, 1.0, 1.0)), (0.0, colour)):
            cover = np.clip(0.5 + grown - distance, 0.0, 1.0).astype(np.float32)
            result += cover[..., None] * (np.array(paint, np.float32) - result)
    return result


def _along(at: np.ndarray, stroke: np.ndarray, width: float) -> np.ndarray:
    """Distance (h, w) of points (h, w, 2) to an arrow along a stroke, negative inside."""
    head, half = HEAD_LENGTH * width, HEAD_WIDTH * width / 2
    way = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(stroke, axis=0).T))])
    neck_at = np.array([np.interp(max(way[-1] - head, 0), way, stroke[:, c]) for c in (0, 1)])
    shaft = np.concatenate([stroke[way < way[-1] - head], neck_at[None]])
    distance = np.full(at.shape[:2], np.inf)
    for start, end in itertools.pairwise(shaft):
        step = end - start
        share = np.clip(((at - start) @ step) / max(step @ step, 1e-12), 0, 1)
        away = at - start - share[..., None] * step
        distance = np.minimum(distance, np.hypot(away[..., 0], away[..., 1]) - width / 2)
    tip, ahead = stroke[-1], stroke[-1] - neck_at
    ahead = ahead / np.hypot(*ahead)
    behind = (tip - at) @ ahead
    aside = np.abs((at - tip) @ np.array([-ahead[1], ahead[0]]))
    slope = half / head
    return np.minimum(distance, np.maximum((aside - behind * slope) / np.hypot(1.0, slope), behind - head))
