"""Speed as colour over a texture: a perceptually even map of colours, what it does to a picture, and its legend.

The map goes from dark blue over sea green to pale sand. It is made in Oklab (Ottosson 2020): its lightness rises
throughout, so that it reads in grey and without red or green too, and equal steps of speed are equal steps of colour.
"""

from __future__ import annotations

import functools

import numpy as np
from scipy.interpolate import PchipInterpolator

from render import tonemap
from render.layout import INK, LEGIBLE, lettering

ANCHORS = ((0.34, 0.110, 278.0), (0.46, 0.105, 248.0), (0.59, 0.095, 208.0), (0.73, 0.100, 158.0), (0.90, 0.090, 100.0))
"""Oklab lightness, chroma and hue (degrees) of the colours between which the map runs."""
STEPS = 512
"""Of the table that the map is read from."""
RELIEF = 0.75
"""Of the texture's lightness, what stays over the map's."""
TICKS = 5
"""Most spaces between the numbers of a legend."""


@functools.cache
def table() -> np.ndarray:
    """The map's colours (STEPS, 3) float64, Oklab: curves through ANCHORS, passed at an even pace."""
    lightness, chroma, hue = np.array(ANCHORS).T
    angle = np.radians(hue)
    anchors = np.stack([lightness, chroma * np.cos(angle), chroma * np.sin(angle)], axis=-1)
    fine = PchipInterpolator(np.linspace(0, 1, len(anchors)), anchors)(np.linspace(0, 1, 16 * STEPS))
    way = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(fine, axis=0), axis=1))])
    even = np.linspace(0, way[-1], STEPS)
    return np.stack([np.interp(even, way, fine[:, c]) for c in range(3)], axis=-1)


def colours(share: np.ndarray) -> np.ndarray:
    """The map's colours (..., 3) float64, Oklab, at shares (...) of its range; beyond 0 and 1 as there."""
    at = np.linspace(0, 1, STEPS)
    return np.stack([np.interp(share, at, table()[:, c]) for c in range(3)], axis=-1)


def tinted(light: np.ndarray, share: np.ndarray, mean: float) -> np.ndarray:
    """A texture (h, w, 3), linear light, in the colours of its speed: (h, w, 3) float32.

    share  (h, w), of the map's range
    mean   Oklab lightness that the texture has on the whole: where it is lighter, so is the map, by RELIEF of that
    The texture's own hue and chroma are lost: colour is speed.
    """
    lab = colours(share)
    relief = RELIEF * (tonemap.linear_to_oklab(np.maximum(light, 0))[..., 0] - mean)
    shaded = np.clip(lab[..., 0] + relief, 0, 1)
    # towards black and white there is less colour to be had
    room = np.minimum(1, np.minimum(shaded / lab[..., 0], (1 - shaded) / (1 - lab[..., 0])))
    lab = np.concatenate([shaded[..., None], lab[..., 1:] * room[..., None]], axis=-1)
    return np.clip(tonemap.oklab_to_linear(lab), 0, 1).astype(np.float32)


def ticks(least: float, greatest: float) -> list[float]:
    """Round numbers within a range, at most TICKS + 1 of them, 1, 2 or 5 times a power of ten apart."""
    power = 10.0 ** np.floor(np.log10((greatest - least) / TICKS))
    step = next(m * power for m in (1, 2, 5, 10) if (greatest - least) / (m * power) <= TICKS)
    return [float(n * step) for n in range(int(np.ceil(least / step)), int(np.floor(greatest / step)) + 1)]


def legend(least: float, greatest: float, unit: str, width: int) -> np.ndarray:
    """The map as a bar, with its least and greatest value, round numbers between, and the unit: display values
    (h, width, 3) float32 on white.

    Letters are as large as the labels of a figure, and it is wider than `width` where they need it. Raises ValueError
    unless least < greatest.
    """
    if not least < greatest:
        raise ValueError(f"a legend goes from less to more, not from {least:g} to {greatest:g}")
    size = max(LEGIBLE, round(width / 22))
    name = lettering(unit, size)
    marks = [(0.0, lettering(f"{least:.3g}", size)), (1.0, lettering(f"{greatest:.3g}", size))]
    margin = max(text.shape[1] for _, text in marks) // 2 + 2
    width = max(width, name.shape[1] + 4, 4 * margin + size)
    length = width - 2 * margin
    for value in ticks(least, greatest):
        share, text = (value - least) / (greatest - least), lettering(f"{value:g}", size)
        if all(abs(share - other) * length > (text.shape[1] + one.shape[1] + size) / 2 for other, one in marks):
            marks.append((share, text))
    line, bar, tick, stroke = len(name), round(0.9 * size), size // 3, max(1, size // 12)
    page = np.ones((line + bar + tick + line, width, 3), np.float32)
    _write(page, name, 0, (width - name.shape[1]) // 2)
    page[line:line + bar, margin:-margin] = tonemap.to_srgb(tonemap.oklab_to_linear(colours(np.linspace(0, 1, length))))
    for share, text in marks:
        place = margin + share * (length - stroke)
        page[line + bar:line + bar + tick, round(place):round(place) + stroke] = INK
        _write(page, text, line + bar + tick, round(place + (stroke - text.shape[1]) / 2))
    return page


def _write(page: np.ndarray, text: np.ndarray, top: int, left: int) -> None:
    """Put letters on a page."""
    height, width = text.shape
    page[top:top + height, left:left + width] -= (1 - INK) * np.minimum(text, 1)[..., None]
