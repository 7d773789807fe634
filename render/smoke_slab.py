"""Light through a sheet of smoke that has a thickness: layers, slanted lights, a sky; kernels in sheet.cl.

The NumPy functions are the specification; `light` runs the kernels and must equal `light_reference`. A sheet
is given by two pictures (Y, X) float32: `depth`, its optical depth where it is 2 thick, and `relief`, half
its thickness. y is up, layers are counted from the front.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy import ndimage

from synth import opencl
from synth.advect import ROW

LAYERS = 20
SOFT_LAYERS = 2.5  # over which the faces of the sheet fade, so that they show no steps
# Scattered again and again, light reaches deeper than one exponential says (Wrenninge 2013): this share of it
# dies by the full extinction, this by a quarter.
FIRST, DEEP = 0.6, 0.4


@dataclass(frozen=True)
class Lamp:
    """A distant light that shines through the sheet aslant.

    towards: unit vectors (x, y) in the plane to it, several for a soft shadow; slope: pixels across per pixel
    of depth; density: factor on the smoke's optical depth; behind: whether it shines from the back.
    """

    towards: tuple[tuple[float, float], ...]
    slope: float
    density: float
    behind: bool = False


@dataclass(frozen=True)
class Seen:
    """What the eye sees (Y, X): the share of light that passes the sheet, each lamp's light, the sky's."""

    passed: np.ndarray
    lamps: tuple[np.ndarray, ...]
    sky: np.ndarray


def directions(angle: float, spread: float, count: int) -> tuple[tuple[float, float], ...]:
    """`count` unit vectors (x, y) round `angle`, `spread` each way; degrees, counter-clockwise from +x."""
    angles = np.deg2rad(np.linspace(angle - spread, angle + spread, count))
    return tuple((float(np.cos(a)), float(np.sin(a))) for a in angles)


def depth_towards(sigma: np.ndarray, towards: tuple[float, float]) -> np.ndarray:
    """Optical depth (Y, X) from each cell to the border along the unit vector `towards` = (x, y).

    sigma: (Y, X) float32, extinction per cell. One sweep over the rows (or columns), away from the light; the
    linear interpolation between rows softens the shadow with distance, as a large light does.
    """
    if abs(towards[0]) > abs(towards[1]):
        return depth_towards(sigma.T, (towards[1], towards[0])).T
    if towards[1] < 0.0:
        return depth_towards(sigma[::-1], (towards[0], -towards[1]))[::-1]
    step = np.float32(1.0 / towards[1])
    slope = np.float32(towards[0] * step)  # columns per row, at most 1
    side, share = (1, slope) if slope >= 0.0 else (-1, -slope)
    depth = np.zeros((sigma.shape[0], sigma.shape[1] + 2), np.float32)
    half = np.pad(sigma, ((0, 0), (1, 1))) * (np.float32(0.5) * step)
    inner, beside = slice(1, -1), slice(1 + side, sigma.shape[1] + 1 + side)
    for row in range(sigma.shape[0] - 2, -1, -1):
        passed = depth[row + 1] + half[row + 1]
        depth[row, inner] = (1 - share) * passed[inner] + share * passed[beside] + half[row, inner]
    return depth[:, inner]


def moved(values: np.ndarray, dx: float, dy: float, outside: float) -> np.ndarray:
    """`values` (Y, X) read at (x + dx, y + dy), linear, `outside` beyond the border."""
    (ix, fx), (iy, fy) = _split(dx), _split(dy)
    rim = max(abs(ix), abs(iy)) + 2
    (h, w), padded = values.shape, np.pad(values, rim, constant_values=outside)
    window = padded[rim + iy:rim + iy + h + 1, rim + ix:rim + ix + w + 1]
    across = window[:, :-1] * (1 - fx) + window[:, 1:] * fx
    return across[:-1] * (1 - fy) + across[1:] * fy


def _split(offset: float) -> tuple[int, np.float32]:
    """Whole pixels and the share of the next one."""
    whole = int(np.floor(offset))
    return whole, np.float32(offset - whole)


def _steps(lamp: Lamp, layer: float) -> tuple[list[tuple[float, float]], np.float32]:
    """(dx, dy) from layer to layer for each direction of a lamp, and the factor on optical depth."""
    offsets = [(x * layer * lamp.slope, y * layer * lamp.slope) for x, y in lamp.towards]
    return offsets, np.float32(lamp.density * np.hypot(1.0, lamp.slope))


def split_reference(depth: np.ndarray, relief: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Optical depth of each layer and the weight with which the eye sees it, (LAYERS, Y, X); what passes all."""
    z = np.abs(2.0 * (np.arange(LAYERS, dtype=np.float32) + 0.5) / LAYERS - 1.0)[:, None, None]
    layers = depth / LAYERS * np.clip((relief - z) * (LAYERS / SOFT_LAYERS) + 0.5, 0.0, 1.0)
    after = np.exp(-np.cumsum(layers, axis=0))
    return layers, np.concatenate([1.0 - after[:1], after[:-1] - after[1:]]), after[-1]


def light_reference(depth: np.ndarray, relief: np.ndarray, layer: float, lamps: tuple[Lamp, ...],
                    cone: int) -> Seen:
    """The specification of `light`."""
    layers, seen, passed = split_reference(depth, relief)
    shown = []
    for lamp in lamps:
        offsets, slant = _steps(lamp, layer)
        total = np.zeros_like(depth)
        for dx, dy in offsets:
            first, deep = np.full_like(total, FIRST), np.full_like(total, DEEP)
            for k in range(LAYERS)[:: -1 if lamp.behind else 1]:
                arrived, arrived_deep = moved(first, dx, dy, FIRST), moved(deep, dx, dy, DEEP)
                half = np.exp(-0.5 * slant * layers[k])
                half_deep = np.sqrt(np.sqrt(half))
                total += seen[k] * (arrived * half + arrived_deep * half_deep)
                first, deep = arrived * half * half, arrived_deep * half_deep * half_deep
        shown.append(total / len(offsets))
    sky, arrived = np.zeros_like(depth), np.ones_like(depth)
    for k in range(LAYERS):
        sky += seen[k] * arrived * np.exp(-0.35 * layers[k])
        arrived = ndimage.uniform_filter(arrived * np.exp(-0.7 * layers[k]), 2 * cone + 1, mode="nearest")
    return Seen(passed, tuple(shown), sky)


def light(depth: np.ndarray, relief: np.ndarray, layer: float, lamps: tuple[Lamp, ...], cone: int) -> Seen:
    """What the eye sees of a sheet under lamps and a sky of 1.

    depth, relief: (Y, X) float32; layer: pixels from one layer to the next; cone: pixels by which the light of
    the sky spreads each way from layer to layer.
    """
    height, width = depth.shape
    pad = 2 + int(layer * max((lamp.slope for lamp in lamps), default=0.0))
    pitch = -(-width // 16) * 16 + 16
    program = opencl.program(Path(__file__).with_suffix(".cl"), WIDTH=width, HEIGHT=height, LAYERS=LAYERS,
                             SOFT_LAYERS=f"{SOFT_LAYERS}f", PAD=pad, CONE=cone, PITCH=pitch)
    size, row = (-(-width // ROW) * ROW, height), (ROW, 1)
    vectors = (pitch // 16, height)

    def on_device(values: np.ndarray) -> Any:
        return opencl.to_device(np.pad(values, ((0, 0), (0, pitch - width))))

    layers, seen = (opencl.empty((LAYERS, height, pitch)) for _ in range(2))
    passed = opencl.empty((height, pitch))
    program.split(vectors, None, on_device(depth), on_device(relief), layers, seen, passed)
    full = np.ones((height + 2 * pad, width + 2 * pad), np.float32)
    start, *spare = ([opencl.to_device(np.float32(share) * full) for share in (FIRST, DEEP)] for _ in range(3))
    shown = []
    for lamp in lamps:
        offsets, slant = _steps(lamp, layer)
        total = opencl.zeros((height, pitch))
        for dx, dy in offsets:
            (ix, fx), (iy, fy) = _split(dx), _split(dy)
            source = start
            for number, k in enumerate(range(LAYERS)[:: -1 if lamp.behind else 1]):
                target = spare[number % 2]
                program.traverse(size, row, layers, seen, *source, *target, total, np.int32(k), np.int32(ix),
                                 np.int32(iy), fx, fy, slant)
                source = target
        shown.append(total.get()[:, :width] / np.float32(len(offsets)))
    sky, across = opencl.zeros((height, pitch)), opencl.empty((height, pitch))
    arrived = on_device(np.ones_like(depth))
    for k in range(LAYERS):
        program.sink(size, row, layers, seen, arrived, sky, np.int32(k))
        program.spread_x(vectors, None, arrived, across)
        program.spread_y(vectors, None, across, arrived)
    return Seen(passed.get()[:, :width].copy(), tuple(shown), sky.get()[:, :width].copy())
