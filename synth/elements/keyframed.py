"""Keyframed exemplars (ma13 figures 10d and 13b): motion that no physics would make. Each loops.

    jagged     noodles in zigzags that open and close like an accordion
    folded     sheets that are creased and fold up and open again
    fluttering sheets along which waves run

Threads and sheets keep their lengths exactly: only the angles of their parts are animated.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from synth.elements.bundle import section, straight
from synth.elements.samples import Elements

FINE = 48  # points of a sheet's profile from one sample to the next
STEEPEST = 40.0  # degrees: neighbours in a bundle, 1 apart, are then 0.77 apart


def jagged(count: int = 14, frames: int = 60, *, samples: int = 40, length: float = 80.0, spacing: float = 1.0,
           radius: float = 0.33, leg: int = 3, angle: float = 34.0, rate: float = 24.0, seed: int = 0) -> Elements:
    """A bundle of zigzag noodles along +z from sample 0 ("jagged", ma13 figure 10d); the last frame leads to the first.

    leg    samples from one corner to the next; corners lie on samples, so they stay sharp
    angle  angle of a leg to z on average, degrees, up to STEEPEST; it swings by a seventh of that, in a wave
           that runs along the bundle, and the plane of the zigzag rotates to and fro
    length, spacing, radius  of a noodle and of the bundle's section, world units
    All noodles of the bundle zigzag together, since neighbours would cross otherwise; each has only a slight lag of its
    own. `coarse`: straight threads, spaced as the samples are on average.
    Raises ValueError for an angle out of range, legs that do not fit, or noodles too thick for their spacing.
    """
    _check(count, frames, rate)
    if samples < 4 or not 1 <= leg <= samples // 2:
        raise ValueError(f"legs of {leg} do not make a zigzag of {samples} samples")
    if not 0 < angle * 8 / 7 <= STEEPEST:
        raise ValueError(f"angle = {angle:g} is not above 0 and up to {STEEPEST * 7 / 8:g} degrees")
    if not (length > 0 and 0 < 2 * radius <= 0.72 * spacing):
        raise ValueError(f"zigzag noodles of radius {radius:g} need a spacing of {2 * radius / 0.72:g} or more")
    rng = np.random.Generator(np.random.Philox(key=seed))
    places = section(count, spacing)
    part = np.arange(samples - 1)
    loop = 2 * np.pi * np.arange(frames)[:, None, None] / frames
    lag = 0.05 * np.sin(places @ rng.normal(size=2) / spacing + rng.uniform(0, 2 * np.pi))[:, None]
    begin, other = rng.uniform(0, 2 * np.pi, 2)
    lean = np.radians(angle) * (1 + np.sin(loop - 2 * np.pi * part / (samples - 1) - lag + begin) / 7)
    lean = lean * np.where(part // leg % 2 == 0, 1, -1)
    plane = 0.5 * np.sin(loop - np.pi * part / (samples - 1) - lag + other) + rng.uniform(0, 2 * np.pi)
    step = np.stack([np.sin(lean) * np.cos(plane), np.sin(lean) * np.sin(plane), np.cos(lean)], -1)
    curve = np.concatenate([np.zeros((frames, count, 1, 3)), np.cumsum(step, 2)], 2) * (length / (samples - 1))
    # the middle of a zigzag, not its beginning, is on the section
    curve[..., :2] -= curve[:, :, : 2 * leg, :2].mean(2, keepdims=True).mean(0, keepdims=True)
    coarse = np.broadcast_to(straight(places, samples, curve[:, :, -1, 2].mean()), curve.shape)
    curve[..., :2] += places[:, None]
    colour = np.clip(np.array([0.95, 0.74, 0.36]) * np.exp(rng.normal(0, 0.04, (count, 1))), 0, 1)
    return Elements(curve.astype(np.float32), (samples,), rate, size=np.full(count, radius), coarse=coarse,
                    colour=colour)


def folded(count: int = 9, frames: int = 60, *, side: int = 7, spacing: float = 1.0, thickness: float = 0.02,
           angle: float = 62.0, rate: float = 24.0, seed: int = 0) -> Elements:
    """Sheets that are creased and fold and open (ma13 figure 13b); the last frame leads to the first.

    angle  largest slope of a part, degrees, from 5 to 80
    Alternately a fan of six pleats, a letter of three parts, and a card of two, each along its columns or its rows; all
    out of phase. Creases lie on samples where side - 1 is a multiple of six. Sheets lie side by side as those of
    `simulation.sheets`; the middle of each rests. `coarse`: the same sheets, flat.
    Raises ValueError for another angle, fewer than one sheet or two frames, or a side of fewer than 3 samples.
    """
    if not 5 <= angle <= 80:
        raise ValueError(f"angle = {angle:g} is not between 5 and 80 degrees")
    rng = np.random.Generator(np.random.Philox(key=seed))
    phase = 2 * np.pi * (np.arange(max(count, 0)) + rng.uniform(0, 0.5)) / max(count, 1) * 2

    def lean(sheet: int, along: np.ndarray, time: float) -> np.ndarray:
        parts = (6, 3, 2)[sheet % 3]
        closed = 0.55 - 0.45 * np.cos(time + phase[sheet])  # never quite flat: the creases stay visible
        number = np.minimum((along * parts).astype(int), parts - 1)
        return np.radians(angle) * closed * (1 - 2 * (number % 2))

    directions = np.where(np.arange(max(count, 0)) // 3 % 2 == 0, 0.0, np.pi / 2)
    return _sheets(count, frames, side, spacing, thickness, rate, directions, lean, rng)


def fluttering(count: int = 9, frames: int = 60, *, side: int = 7, spacing: float = 1.0, thickness: float = 0.02,
               angle: float = 48.0, waves: float = 1.0, rate: float = 24.0, seed: int = 0) -> Elements:
    """Sheets along which a wave runs once while the clip lasts (ma13 figure 13b); the last frame leads to the first.

    angle  largest slope of a part, degrees, from 5 to 80
    waves  on a sheet, from 0.25 to 2
    Each sheet's wave runs in a direction of its own. The rest as `folded`.
    """
    if not 5 <= angle <= 80 or not 0.25 <= waves <= 2:
        raise ValueError(f"angle = {angle:g} is not between 5 and 80 degrees, or waves = {waves:g} not 0.25 to 2")
    rng = np.random.Generator(np.random.Philox(key=seed))
    phase = rng.uniform(0, 2 * np.pi, max(count, 0))
    directions = rng.uniform(0, 2 * np.pi, max(count, 0))

    def lean(sheet: int, along: np.ndarray, time: float) -> np.ndarray:
        swing = 0.75 + 0.25 * np.sin(time + phase[sheet] * 3)
        return np.radians(angle) * swing * np.sin(2 * np.pi * waves * along - time + phase[sheet])

    return _sheets(count, frames, side, spacing, thickness, rate, directions, lean, rng)


def _check(count: int, frames: int, rate: float) -> None:
    if count < 1 or frames < 2 or not (np.isfinite(rate) and rate > 0):
        raise ValueError("an exemplar has one element or more, 2 frames or more and a rate above 0, "
                         f"not {count}, {frames} and {rate}")


def _sheets(count: int, frames: int, side: int, spacing: float, thickness: float, rate: float, directions: np.ndarray,
            lean: Callable[[int, np.ndarray, float], np.ndarray], rng: np.random.Generator) -> Elements:
    """Sheets bent as parts of cylinders, each across its own direction.

    directions  (E,) radians from +x to the direction along which a sheet's profile changes
    lean        slope of a sheet's profile, radians, at positions from 0 to 1 along it, at a time from 0 to 2π
    """
    _check(count, frames, rate)
    if side < 3 or not (spacing > 0 and thickness > 0):
        raise ValueError(f"a sheet has 3 samples or more a side and a spacing and a thickness above 0, not {side}, "
                         f"{spacing} and {thickness}")
    across = np.arange(side) - (side - 1) / 2
    x, y = (axis.ravel() for axis in np.meshgrid(across, across))
    columns = int(np.ceil(np.sqrt(count)))
    coarse, bent = np.empty((frames, count, side * side, 3)), np.empty((frames, count, side * side, 3))
    for sheet, direction in enumerate(directions):
        place = np.array([sheet % columns, sheet // columns, 0]) * (side + 1.0)
        coarse[:, sheet] = np.stack([x, y, np.zeros_like(x)], -1) + place
        c, s = np.cos(direction), np.sin(direction)
        ahead, aside = x * c + y * s, y * c - x * s
        half = np.abs(ahead).max()
        steps = int(np.ceil(2 * half * FINE / 6)) * 6  # creases at halves, thirds and sixths fall between steps
        at = np.linspace(-half, half, steps + 1)
        for frame in range(frames):
            rise = lean(sheet, (np.arange(steps) + 0.5) / steps, 2 * np.pi * frame / frames)
            profile = np.stack([np.cos(rise), np.sin(rise)]).cumsum(1) * (2 * half / steps)
            along, up = (np.interp(ahead, at, np.concatenate([[0.0], axis])) for axis in profile)
            along -= along.mean()
            bent[frame, sheet] = place + np.stack([along * c - aside * s,
                                                   along * s + aside * c, up - up.mean()], -1)
    colour = np.clip(0.93 * np.exp(rng.normal(0, 0.03, (count, 1))) * [1.0, 0.99, 0.96], 0, 1)
    return Elements((bent * spacing).astype(np.float32), (side, side), rate, size=np.full(count, thickness),
                    colour=colour, coarse=coarse * spacing)
