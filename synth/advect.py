"""Semi-Lagrangian advection [Stam 1999], in 2-D and 3-D, of scalars and vectors.

`advect` runs on the OpenCL device; `advect_reference` is its specification in NumPy, equal bit for bit. A
step is split in two, so that one backtrace can serve many quantities: `departure` finds where the content of
each cell comes from, and the gather interpolates there.

Hot: the backtrace and the gather are more than half of the density window of ma09 (0.39 s a frame for 256×256×64 cells
and m = 16, on 2 CPU cores). They are bound by memory: a cell reads 4 or 8 cells at its departure point for a few
multiplications. `python -m bench density` shows it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from synth import opencl

BORDERS = {"clamp": 0, "zero": 1, "toroidal": 2}
"""What lies beyond the last cell: that cell again, nothing, or the other side."""

ROW = 64  # work-items of a group, along x: contiguous, so that a CPU device can vectorise them
FASTEST = float(1 << 20)  # cells per frame; anything above is a mistake, and far below where int32 ends


def departure(v: np.ndarray, dt: float = 1.0, border: str = "clamp") -> np.ndarray:
    """Displacement from each cell centre back to its departure point, by the midpoint rule (RK2).

    v       (Y, X, 2) or (Z, Y, X, 3) float32, cells per frame
    dt      frames
    border  "clamp" and "zero" read the velocity beyond the border from the nearest cell, "toroidal" wraps
    Returns the same shape, float32, in cells: the departure point of cell x is x + departure[x].
    Raises ValueError for a shape, a border or a speed that makes no sense.
    """
    v = velocity_field(v)
    grid = Grid(v.shape[:-1], border)
    return grid.departure(opencl.to_device(v), dt).get()


def advect(q: np.ndarray, v: np.ndarray, dt: float = 1.0, border: str = "clamp") -> np.ndarray:
    """Carry `q` along `v` for `dt` frames: out(x) = q(departure point of x), linearly interpolated.

    q  (Y, X[, C]) or (Z, Y, X[, C]) float32, any C; v as in `departure`, on the same cells.
    Returns q's shape. Zero flow and dt = 0 return q exactly, a flow of whole cells moves it exactly.
    It does not conserve the sum of q, and each call that ends between cells blurs a little.
    """
    v = velocity_field(v)
    q = np.ascontiguousarray(q, dtype=np.float32)
    shape = v.shape[:-1]
    if q.shape[: len(shape)] != shape or q.ndim > v.ndim:
        raise ValueError(f"a quantity of shape {q.shape} does not lie on the cells {shape} of the velocity")
    grid = Grid(shape, border)
    displacements = grid.departure(opencl.to_device(v), dt)
    channels = q.reshape(*shape, -1)
    out = np.empty_like(channels)
    for first in range(0, channels.shape[-1], 4):
        out[..., first : first + 4] = grid.gather(opencl.to_device(channels[..., first : first + 4]),
                                                  displacements).get()
    return out.reshape(q.shape)


def velocity_field(v: np.ndarray) -> np.ndarray:
    """`v` as contiguous float32 (Y, X, 2) or (Z, Y, X, 3); ValueError for another shape, NaN, wild speed."""
    v = np.ascontiguousarray(v, dtype=np.float32)
    if v.ndim not in (3, 4) or v.shape[-1] != v.ndim - 1 or v.size == 0:
        raise ValueError(f"a velocity field is (Y, X, 2) or (Z, Y, X, 3), not {v.shape}")
    if not (v.min() > -FASTEST and v.max() < FASTEST):
        raise ValueError("the velocity holds NaN, infinity, or more than 2^20 cells per frame")
    return v


class Region(NamedTuple):
    """A box of cells that a kernel runs over, in x, y, z order; along x in whole work-groups."""

    first: tuple[int, int, int]
    size: tuple[int, int, int]


class Grid:
    """The advection kernels on cells of `shape`, (Y, X) or (Z, Y, X), with arrays that stay on the device."""

    def __init__(self, shape: tuple[int, ...], border: str):
        if border not in BORDERS:
            raise ValueError(f"border {border!r} is none of {', '.join(BORDERS)}")
        self.shape, self.border = shape, border
        x, y, z = shape[-1], shape[-2], shape[0] if len(shape) == 3 else 1
        self.cells = tuple(np.int32(n) for n in (x, y, z))
        self.whole = Region((0, 0, 0), (-(-x // ROW) * ROW, y, z))

    def _program(self, channels: int) -> opencl.Program:
        return opencl.program(Path(__file__).with_suffix(".cl"), DIMS=len(self.shape), CHANNELS=channels,
                              BORDER=BORDERS[self.border])

    def departure(self, v: Any, dt: float = 1.0, out: Any = None, region: Region | None = None) -> Any:
        """Displacements (shape, D) of the velocities (shape, D), both on the device; into `out` if given.

        Only the cells of `region` are computed, if given; the others of `out` stay as they were.
        """
        out = opencl.empty(v.shape) if out is None else out
        region = region or self.whole
        self._program(1).departure(region.size, (ROW, 1, 1), v, out, np.float32(dt), *self.cells,
                                   offset=region.first)
        return out

    def gather(self, q: Any, displacements: Any, out: Any = None) -> Any:
        """q (shape, 1, 2, 3, 4, 8 or 16 channels) at the departure points; into `out` if given."""
        out = opencl.empty(q.shape) if out is None else out
        channels = q.size // int(np.prod(self.shape))
        self._program(channels).advect(self.whole.size, (ROW, 1, 1), q, displacements, out, *self.cells)
        return out


# The specification, in NumPy.


def departure_reference(v: np.ndarray, dt: float = 1.0, border: str = "clamp") -> np.ndarray:
    """`departure` in NumPy: d = -dt v(x - dt/2 v(x))."""
    step = np.float32(dt)
    half_way = np.float32(-0.5) * step * v
    return -step * displaced_reference(v, half_way, "clamp" if border == "zero" else border)


def advect_reference(q: np.ndarray, v: np.ndarray, dt: float = 1.0, border: str = "clamp") -> np.ndarray:
    """`advect` in NumPy."""
    channels = q.reshape(*v.shape[:-1], -1)
    return displaced_reference(channels, departure_reference(v, dt, border), border).reshape(q.shape)


def displaced_reference(q: np.ndarray, displacement: np.ndarray, border: str) -> np.ndarray:
    """q (cells, C) at each cell plus its displacement (cells, D): linear along x, then y, then z."""
    shape = displacement.shape[:-1]
    axes = range(len(shape) - 1, -1, -1)  # the array axis of component 0, 1(, 2)
    base, fraction = [], []
    for component, axis in enumerate(axes):
        floor = np.floor(displacement[..., component])
        cell = np.arange(shape[axis]).reshape([-1 if a == axis else 1 for a in range(len(shape))])
        base.append(cell + floor.astype(np.int64))
        fraction.append((displacement[..., component] - floor)[..., None])

    def corner(*step: int) -> np.ndarray:
        index: list[Any] = [None] * len(shape)
        outside = np.zeros(shape, bool)
        for component, axis in enumerate(axes):
            i, n = base[component] + step[component], shape[axis]
            outside |= (i < 0) | (i >= n)
            index[axis] = i % n if border == "toroidal" else np.clip(i, 0, n - 1)
        value = q[tuple(index)]
        return np.where(outside[..., None], np.float32(0), value) if border == "zero" else value

    def along(component: int, *step: int) -> np.ndarray:
        if component < 0:
            return corner(*step)
        t = fraction[component]
        return (np.float32(1) - t) * along(component - 1, 0, *step) + t * along(component - 1, 1, *step)

    return along(len(shape) - 1)
