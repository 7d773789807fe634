"""Curves as an SVG: y logarithmic, x logarithmic or linear."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import NamedTuple

import numpy as np

WIDTH, HEIGHT = 560, 360
LEFT, RIGHT, TOP, BOTTOM = 70, 530, 40, 305  # edges of the plot, pixels
COLOURS = ("#aa3333", "#3366aa", "#228833", "#885599")
MOST_MARKS = 12  # points of a curve that are drawn as dots; longer ones are lines alone


class Curve(NamedTuple):
    """Points (N,) of a curve, with one label a point or none."""

    x: np.ndarray
    y: np.ndarray
    labels: Sequence[str] = ()


def log_ticks(low: float, high: float) -> list[float]:
    """Numbers 1, 2, 5 × 10^k from low to high; powers of ten alone where those are many."""
    exponents = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    for steps in ((1, 2, 5), (1,)):
        ticks = [float(f"{step}e{k}") for k in exponents for step in steps]
        ticks = [tick for tick in ticks if low <= tick <= high]
        if len(ticks) <= 8:
            break
    return ticks or [low, high]


def linear_ticks(low: float, high: float) -> list[float]:
    """At most seven multiples of 1, 2 or 5 × 10^k from low to high."""
    rough = (high - low) / 6
    power = 10 ** np.floor(np.log10(rough))
    step = next(s * power for s in (1, 2, 5, 10) if s * power >= rough)
    return [float(f"{n * step:.6g}") for n in range(int(np.ceil(low / step)), int(np.floor(high / step)) + 1)]


def limits(values: Sequence[np.ndarray], log: bool) -> tuple[float, float]:
    """Least and largest of all values, widened where they are equal. ValueError for a logarithm of 0 or less."""
    low, high = min(float(v.min()) for v in values), max(float(v.max()) for v in values)
    if log and not low > 0:
        raise ValueError(f"a logarithmic axis needs numbers above 0, not {low:g}")
    if low < high:
        return low, high
    return (low / 2, high * 2) if log else (low - 1, high + 1)


def svg(title: str, x_label: str, y_label: str, curves: Mapping[str, Curve], *, log_x: bool) -> str:
    """An SVG document with the curves by name; a name "" has no entry in the legend.

    Where the first curve has labels, they mark its points along x instead of round numbers.
    """
    first = next(iter(curves.values()))
    x_low, x_high = limits([c.x for c in curves.values()], log_x)
    y_low, y_high = limits([c.y for c in curves.values()], True)
    scale = np.log10 if log_x else np.asarray

    def across(x: np.ndarray | float) -> np.ndarray:
        return np.interp(scale(x), scale([x_low, x_high]), [LEFT + 10, RIGHT - 10])

    def up(y: np.ndarray | float) -> np.ndarray:
        return np.interp(np.log10(y), np.log10([y_low, y_high]), [BOTTOM - 10, TOP + 10])

    if first.labels:
        x_ticks = dict(zip(map(float, first.x), first.labels, strict=True))
    else:
        x_ticks = {tick: f"{tick:g}" for tick in (log_ticks if log_x else linear_ticks)(x_low, x_high)}
    drawn = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" '
        'font-size="12">',
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
        f'<text x="{LEFT}" y="22" font-size="14">{escape(title)}</text>',
        f'<path d="M{LEFT},{TOP}V{BOTTOM}H{RIGHT}" fill="none" stroke="black"/>',
        f'<text x="{(LEFT + RIGHT) / 2:g}" y="{HEIGHT - 12}" text-anchor="middle">{escape(x_label)}</text>',
        f'<text transform="translate(18,{(TOP + BOTTOM) / 2:g}) rotate(-90)" text-anchor="middle">'
        f'{escape(y_label)}</text>']
    for tick, label in x_ticks.items():
        at = across(tick)
        drawn.append(f'<path d="M{at:.1f},{BOTTOM}v5" stroke="black"/>'
                     f'<text x="{at:.1f}" y="{BOTTOM + 19}" text-anchor="middle">{escape(label)}</text>')
    for tick in log_ticks(y_low, y_high):
        drawn.append(f'<path d="M{LEFT},{up(tick):.1f}h-5" stroke="black"/>'
                     f'<text x="{LEFT - 8}" y="{up(tick) + 4:.1f}" text-anchor="end">{tick:g}</text>')
    for number, (name, curve) in enumerate(curves.items()):
        colour = COLOURS[number % len(COLOURS)]
        places = list(zip(across(curve.x), up(curve.y), strict=True))
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in places)
        drawn.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.5"/>')
        if len(places) <= MOST_MARKS:
            drawn += [f'<circle cx="{a:.1f}" cy="{b:.1f}" r="3" fill="{colour}"/>' for a, b in places]
        if name:
            drawn.append(f'<text x="{RIGHT}" y="{TOP + 16 * number}" text-anchor="end" fill="{colour}">'
                         f'{escape(name)}</text>')
    return "\n".join([*drawn, "</svg>", ""])
