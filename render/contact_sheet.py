"""Clips on one sheet, to be looked at: three frames of each and the mean of all, or a small picture of each."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from render.layout import Panel, figure, fitted

GAP = 2
"""Pixels between thumbnails."""


def panels(name: str, frames: np.ndarray, width: int) -> list[Panel]:
    """Frames 0, T / 3 and 2 T / 3 of a clip and the mean of its frames, `width` pixels wide; the first has the name.

    frames  (T, Y, X) grey or (T, Y, X, 3) sRGB, uint8, row 0 the lowest
    """
    length = len(frames)
    mean = np.rint(frames.mean(0, dtype=np.float64)).astype(np.uint8)
    chosen = [frames[0], frames[length // 3], frames[2 * length // 3], mean]
    # row 0 of a clip is the lowest, of a picture the highest
    pictures = [np.broadcast_to(frame.reshape(*frame.shape[:2], -1), (*frame.shape[:2], 3))[::-1] for frame in chosen]
    return [Panel(fitted(np.ascontiguousarray(picture), width), label)
            for picture, label in zip(pictures, (name, "", "", "mean"), strict=True)]


def contact_sheet(clips: Iterable[tuple[str, np.ndarray]], width: int = 160, beside: int = 2) -> np.ndarray:
    """All clips with their names on one sheet, (h, w, 3) uint8 sRGB.

    clips   names and frames, as of `panels`, one at a time in memory
    width   of each panel, pixels
    beside  clips in a row of the sheet
    """
    strips = [panels(name, clip, width) for name, clip in clips]
    rows = [[panel for strip in strips[first : first + beside] for panel in strip]
            for first in range(0, len(strips), beside)]
    return figure(rows, letter=12, gap=4, margin=10)


def thumbnails(frames: Sequence[np.ndarray], width: int, aspect: float) -> np.ndarray:
    """One frame of each clip on a sheet (h, width, 3) float32, display values on white (okabe11 fig. 3).

    frames  each (Y, X) uint8 grey, row 0 the lowest
    aspect  width over height of the sheet that is aimed at
    By rows from the upper left; the first says their proportions. Of the two numbers of columns next to the aim the one
    that leaves fewer places empty is taken.
    """
    rows, columns = frames[0].shape
    aim = math.sqrt(len(frames) * aspect * rows / columns)
    near = [min(max(1, count), len(frames)) for count in (math.ceil(aim), math.floor(aim))]
    beside = min(near, key=lambda count: -len(frames) % count)
    edges = np.rint(np.linspace(0, width + GAP, beside + 1)).astype(int)
    height = max(1, round(((width + GAP) / beside - GAP) * rows / columns))
    page = np.ones((-(-len(frames) // beside) * (height + GAP) - GAP, width, 3), np.float32)
    for number, frame in enumerate(frames):
        row, column = divmod(number, beside)
        wide = int(edges[column + 1] - edges[column] - GAP)
        shown = fitted(np.repeat(frame[::-1, :, None], 3, axis=2), wide)
        shown = shown[np.arange(height) * len(shown) // height]
        top = row * (height + GAP)
        page[top:top + height, edges[column]:edges[column] + wide] = shown
    return page
