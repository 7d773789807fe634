"""Light through a slab of smoke: layers, slanted lights, a sky; kernels in smoke_slab.cl.

The NumPy functions are the specification; `light` runs the kernels and must equal `light_reference`. A slab
is given by two arrays (Y, X) float32: `depth`, its optical depth where its thickness is 2, and `relief`, half
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
SOFT_LAYERS = 2.5  # layers over which the faces of the slab fade, so that no steps are visible
# Multiple scattering carries light deeper than one exponential (Wrenninge 2013): one share is attenuated with the
# full extinction, the other with a quarter of it.
FIRST, DEEP = 0.6, 0.4


@dataclass(frozen=True)
class Lamp:
    """A distant light that passes through the slab at an angle.

    towards  unit vectors (x, y) in the plane of the slab towards the light, several for a soft shadow
    slope    pixels in the plane per pixel of depth
    density  factor on the smoke's optical depth
    behind   whether it shines from the back
    """

    towards: tuple[tuple[float, float], ...]
    slope: float
    density: float
    behind: bool = False


@dataclass(frozen=True)
class Seen:
    """What the eye sees (Y, X): transmittance of the slab, the light of each lamp, the light of the sky."""

    passed: np.ndarray
    lamps: tuple[np.ndarray, ...]
    sky: np.ndarray


def directions(angle: float, spread: float, count: int) -> tuple[tuple[float, float], ...]:
    """`count` unit vectors (x, y) from `angle` - `spread` to `angle` + `spread`, degrees counter-clockwise from +x."""
    angles = np.deg2rad(np.linspace(angle - spread, angle + spread, count))
    return tuple((float(np.cos(a)), float(np.sin(a))) for a in angles)


def depth_towards(sigma: np.ndarray, towards: tuple[float, float]) -> np.ndarray:
    """Optical depth (Y, X) from each cell to the border along the unit vector `towards` = (x, y).

    sigma: (Y, X) float32, extinction per cell
    One sweep over the rows (or columns), away from the light; linear interpolation between rows makes shadows softer
    with distance, as those of a large light.
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
    """`values` (Y, X) at (x + dx, y + dy): linear interpolation, `outside` beyond the border."""
    (ix, fx), (iy, fy) = _split(dx), _split(dy)
    rim = max(abs(ix), abs(iy)) + 2
    (h, w), padded = values.shape, np.pad(values, rim, constant_values=outside)
    window = padded[rim + iy:rim + iy + h + 1, rim + ix:rim + ix + w + 1]
    across = window[:, :-1] * (1 - fx) + window[:, 1:] * fx
    return across[:-1] * (1 - fy) + across[1:] * fy


def _split(offset: float) -> tuple[int, np.float32]:
    """Integer and fractional part."""
    pixels = int(np.floor(offset))
    return pixels, np.float32(offset - pixels)


def _steps(lamp: Lamp, layer: float) -> tuple[list[tuple[float, float]], np.float32]:
    """(dx, dy) from layer to layer for each direction of a lamp, and the factor on optical depth."""
    offsets = [(x * layer * lamp.slope, y * layer * lamp.slope) for x, y in lamp.towards]
    return offsets, np.float32(lamp.density * np.hypot(1.0, lamp.slope))


def split_reference(depth: np.ndarray, relief: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Optical depth of each layer and its weight for the eye, (LAYERS, Y, X) each; transmittance of all (Y, X)."""
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
    """What the eye sees of a slab under lamps and a sky of radiance 1.

    depth, relief  (Y, X) float32
    layer          pixels from one layer to the next
    cone           pixels by which the light of the sky spreads on each side from layer to layer
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
