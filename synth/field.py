"""A field on a regular grid of cells: it knows where it is in the world and refuses to be mixed with another.

Inside the methods arrays travel bare, in cells per frame; a `Field` is what enters from and leaves for files,
in world units per second. The domain is one world unit high, centred on x and z, with its floor at y = 0.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Field:
    """Values at the cell centres of a regular grid.

    values      (Y, X[, 2]) or (Z, Y, X[, 3]) float32, C order; vector components x, y, z; row 0 is the lowest
    voxel_size  edge of a cell, world units
    origin      centre of the first cell, world units, components (x, y) or (x, y, z); its length is the
                field's dimension, which tells a 2-D vector field (Y, X, 2) from a 3-D scalar one

    Raises ValueError for another number of axes or components, a voxel size that is not positive, an empty
    grid, and NaN or infinity anywhere.
    """

    values: np.ndarray
    voxel_size: float
    origin: tuple[float, ...]

    def __post_init__(self) -> None:
        values = np.ascontiguousarray(self.values, dtype=np.float32)
        object.__setattr__(self, "values", values)
        object.__setattr__(self, "voxel_size", float(self.voxel_size))
        object.__setattr__(self, "origin", tuple(float(c) for c in self.origin))
        if self.dimension not in (2, 3):
            raise ValueError(f"a field has 2 or 3 dimensions, its origin has {self.dimension} components")
        scalar = values.ndim == self.dimension
        vector = values.ndim == self.dimension + 1 and values.shape[-1] == self.dimension
        if not (scalar or vector):
            raise ValueError(f"values of shape {values.shape} are no {self.dimension}-D field")
        if 0 in values.shape:
            raise ValueError(f"a field of shape {values.shape} is empty")
        if not (math.isfinite(self.voxel_size) and self.voxel_size > 0):
            raise ValueError(f"the voxel size must be positive, not {self.voxel_size}")
        if not all(math.isfinite(c) for c in self.origin):
            raise ValueError(f"the origin must be finite, not {self.origin}")
        if not np.isfinite(values).all():
            raise ValueError("the field holds NaN or infinity")

    @classmethod
    def centred(cls, values: np.ndarray, dimension: int) -> Field:
        """The field on the scene's domain: height 1, floor at y = 0, centred on x (and z)."""
        shape = values.shape[:dimension]
        return cls(values, 1.0 / shape[-2], domain_origin(shape))

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return len(self.origin)

    @property
    def is_vector(self) -> bool:
        """Whether the values are vectors of `dimension` components."""
        return self.values.ndim == self.dimension + 1

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of cells, (Y, X) or (Z, Y, X)."""
        return self.values.shape[: self.dimension]

    def require_same_grid(self, other: Field) -> None:
        """Raise ValueError unless `other` has this field's shape, voxel size and origin."""
        for name in ("shape", "voxel_size", "origin"):
            mine, theirs = getattr(self, name), getattr(other, name)
            if mine != theirs:
                raise ValueError(f"the fields lie on different grids: {name} {mine} and {theirs}")

    def with_values(self, values: np.ndarray) -> Field:
        """Other values on this grid (scalar or vector); ValueError if their shape is not the grid's."""
        if values.shape[: self.dimension] != self.shape:
            raise ValueError(f"values of shape {values.shape} do not fit a grid of {self.shape}")
        return Field(values, self.voxel_size, self.origin)

    def __add__(self, other: Field) -> Field:
        self.require_same_grid(other)
        if self.is_vector != other.is_vector:
            raise ValueError("a scalar and a vector field cannot be added")
        return self.with_values(self.values + other.values)

    def __mul__(self, factor: float) -> Field:
        return self.with_values(self.values * np.float32(factor))

    def __eq__(self, other: object) -> bool:
        """Same grid and same values, bit for bit."""
        if not isinstance(other, Field):
            return NotImplemented
        return (self.voxel_size, self.origin) == (other.voxel_size, other.origin) and np.array_equal(
            self.values, other.values)

    __hash__ = None  # type: ignore[assignment]  # it holds an array

    def per_second(self, fps: float) -> Field:
        """A velocity in cells per frame, as world units per second."""
        return self * (self.voxel_size * _rate(fps))

    def per_frame(self, fps: float) -> Field:
        """A velocity in world units per second, as cells per frame: the inverse of `per_second`."""
        return self * (1.0 / (self.voxel_size * _rate(fps)))


def domain_origin(shape: Sequence[int]) -> tuple[float, ...]:
    """World position (x, y[, z]) of the first cell's centre, for (Y, X) or (Z, Y, X) cells one unit high."""
    voxel = 1.0 / shape[-2]
    x, y = 0.5 * voxel - 0.5 * shape[-1] * voxel, 0.5 * voxel
    return (x, y) if len(shape) == 2 else (x, y, 0.5 * voxel - 0.5 * shape[0] * voxel)


def _rate(fps: float) -> float:
    if not (math.isfinite(fps) and fps > 0):
        raise ValueError(f"fps must be positive, not {fps}")
    return fps
