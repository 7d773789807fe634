"""Curves over axes, as papers print them: for panels that show numbers (okabe11 figs. 6 and 9)."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from render.arrows import Colour
from render.layout import INK, LEGIBLE, lettering
from render.speed_map import ticks

BLUE: Colour = (0.13, 0.35, 0.66)
RED: Colour = (0.80, 0.22, 0.12)
PALE: Colour = (0.74, 0.74, 0.74)
RULE = 0.90
"""Display grey of the lines at the numbers of the y axis."""


class Curve(NamedTuple):
    """x and y (N,) of a curve, its colour, and its name, listed in the upper right corner; "" for none."""

    x: np.ndarray
    y: np.ndarray
    colour: Colour
    name: str = ""


def plot(curves: Sequence[Curve], x_label: str, y_label: str, width: int, top: float,
         bottom: float = 0.0) -> np.ndarray:
    """Curves over axes from 0 to the greatest x and to `top`: display values (h, width, 3) float32 on white, 3 : 2.

    bottom  where the y axis begins: at 0 it is linear, above it is logarithmic
    The last curve is drawn above the others. What is beyond the axes is cut. Labels may hold *italics*. Raises
    ValueError unless top > bottom >= 0 and some x > 0.
    """
    height = round(width * 2 / 3)
    right_end = max(float(curve.x.max()) for curve in curves)
    if not (top > bottom >= 0 and right_end > 0):
        raise ValueError(f"axes go from less to more, not from 0 to {right_end:g} and from {bottom:g} to {top:g}")
    letter = max(LEGIBLE, round(width / 24))
    page = np.ones((height, width, 3), np.float32)
    marks = {value: lettering(f"{value:g}", letter) for value in (_powers(bottom, top) if bottom else ticks(0.0, top))}
    line = len(lettering("0", letter))
    left = max(text.shape[1] for text in marks.values()) + letter
    inside = (line + letter // 2, height - 2 * line - letter // 2, left, width - letter)
    upper, lower, first, last = inside
    stroke = max(1, round(letter / 14))
    # axes and their numbers
    for value, text in marks.items():
        row = round(lower - float(_share(np.array(value), bottom, top)) * (lower - upper))
        page[row:row + stroke, first:last] = RULE
        _write(page, text, row - line // 2, first - letter // 2 - text.shape[1])
    for value in ticks(0.0, right_end):
        column = round(first + value / right_end * (last - first))
        text = lettering(f"{value:g}", letter)
        page[lower:lower + letter // 3, column:column + stroke] = INK
        _write(page, text, lower + letter // 3, min(column - text.shape[1] // 2, width - text.shape[1]))
    page[lower:lower + stroke, first:last] = INK
    page[upper:lower + stroke, first:first + stroke] = INK
    name = lettering(x_label, letter)
    _write(page, name, height - line, (first + last - name.shape[1]) // 2)
    _write(page, lettering(y_label, letter), 0, max(0, first - letter))
    # curves
    for curve in curves:
        x = first + np.asarray(curve.x, np.float64) / right_end * (last - first)
        y = lower - _share(np.asarray(curve.y, np.float64), bottom, top) * (lower - upper)
        _draw(page[upper:lower], x, y - upper, 2.2 * stroke, curve.colour)
    names = [curve for curve in curves if curve.name]
    for number, curve in enumerate(names):
        text = lettering(curve.name, letter)
        _write(page, text, upper + number * line, last - text.shape[1] - letter // 2, curve.colour)
    return page


def _share(values: np.ndarray, bottom: float, top: float) -> np.ndarray:
    """Where values lie between the ends of the y axis, 0..1."""
    if bottom == 0:
        return values / top
    return np.asarray(np.log(np.maximum(values, bottom * 1e-3) / bottom) / np.log(top / bottom))


def _powers(bottom: float, top: float) -> list[float]:
    """The powers of ten from `bottom` to `top`."""
    first, last = np.ceil(np.log10(bottom) - 1e-9), np.floor(np.log10(top) + 1e-9)
    return [float(10.0**n) for n in np.arange(first, last + 1)]


def _draw(page: np.ndarray, x: np.ndarray, y: np.ndarray, width: float, colour: Colour) -> None:
    """A line of `width` pixels through points x, y, pixels from the upper left corner, onto a page."""
    cover = np.zeros(page.shape[:2], np.float32)
    for (x0, y0), (x1, y1) in itertools.pairwise(zip(x.tolist(), y.tolist(), strict=True)):
        low, high = max(0, int(min(x0, x1) - width - 1)), int(max(x0, x1) + width + 2)
        part = cover[:, low:high]
        rows, columns = np.mgrid[:part.shape[0], low:low + part.shape[1]] + 0.5
        step = max((x1 - x0) ** 2 + (y1 - y0) ** 2, 1e-12)
        share = np.clip(((columns - x0) * (x1 - x0) + (rows - y0) * (y1 - y0)) / step, 0, 1)
        away = np.hypot(columns - x0 - share * (x1 - x0), rows - y0 - share * (y1 - y0))
        np.maximum(part, np.clip(0.5 + width / 2 - away, 0, 1), out=part, casting="same_kind")
    page += cover[..., None] * (np.array(colour, np.float32) - page)


def _write(page: np.ndarray, text: np.ndarray, top: int, left: int, colour: Colour = (INK, INK, INK)) -> None:
    """Put letters on a page; what lies beyond it is cut."""
    shown = text[max(0, -top):len(page) - top, max(0, -left):page.shape[1] - left]
    part = page[max(0, top):max(0, top) + shown.shape[0], max(0, left):max(0, left) + shown.shape[1]]
    part += np.minimum(shown, 1)[..., None] * (np.array(colour, np.float32) - part)
