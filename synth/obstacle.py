"""Obstacles in the flow, as a signed distance field and its normals (ma09 §3.6, figures 7 and 8).

Basic shapes have their exact distance. All others (an image, a drawing, a mesh as voxels, a level set) are sampled on
a grid finer than the domain's cells, where an exact distance transform gives the distance. World units: the domain is
1 high, its floor at y = 0, centred on x and z.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import ndimage

from synth.field import Field, domain_origin

# samples along each axis of a cell, in 2-D and in 3-D; one in 3-D where that exceeds MOST_SAMPLES
FINE = {2: 4, 3: 2}
MOST_SAMPLES = 2**25
# a tone is ink where it differs from the paper's by this share of the image's range
INK = 0.25


@dataclass(frozen=True)
class Obstacle:
    """distance (Y, X) or (Z, Y, X) float32: cells to the nearest wall, negative inside."""

    distance: np.ndarray

    @property
    def shape(self) -> tuple[int, ...]:
        """Cells of the domain, (Y, X) or (Z, Y, X)."""
        return self.distance.shape

    @cached_property
    def normal(self) -> np.ndarray:
        """Unit vectors away from the solid, (*shape, D) float32; zero where no wall is nearest."""
        return outward(self.distance)

    @cached_property
    def solid(self) -> np.ndarray:
        """The cells whose centres lie inside, (*shape) bool."""
        return self.distance < 0


def outward(distance: np.ndarray) -> np.ndarray:
    """The normals of a signed distance (Y, X) or (Z, Y, X): unit vectors (..., D) float32, or zero."""
    slope = np.stack([np.gradient(distance.astype(np.float64), axis=axis) for axis in reversed(range(distance.ndim))],
                     axis=-1)
    length = np.linalg.norm(slope, axis=-1, keepdims=True)
    return np.where(length > 1e-3, slope / np.maximum(length, 1e-3), 0).astype(np.float32)


def ball(shape: tuple[int, ...], centre: Sequence[float], radius: float) -> Obstacle:
    """A disc, or in 3-D a ball; centre and radius in world units."""
    squared = sum(away**2 for away in _away(shape, centre))
    return Obstacle(((np.sqrt(squared) - radius) * shape[-2]).astype(np.float32))


def box(shape: tuple[int, ...], centre: Sequence[float], half: Sequence[float], angle: float = 0.0) -> Obstacle:
    """A box of half edges `half` (D of them), rotated by `angle` degrees in the x-y plane; world units."""
    if len(half) != len(shape):
        raise ValueError(f"a box of {len(shape)} dimensions has so many half edges, not {len(half)}")
    x, y, *rest = _away(shape, centre)
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    rotated = (c * x + s * y, c * y - s * x, *rest)
    beyond = np.broadcast_arrays(*(np.abs(away) - edge for away, edge in zip(rotated, half, strict=True)))
    outside = np.sqrt(sum(np.maximum(b, 0) ** 2 for b in beyond))
    inside = np.minimum(np.maximum.reduce(beyond), 0)
    return Obstacle(((outside + inside) * shape[-2]).astype(np.float32))


def _away(shape: tuple[int, ...], centre: Sequence[float]) -> list[np.ndarray]:
    """For each component x, y[, z] the offset of each cell from `centre`, world units, ready to broadcast."""
    if len(centre) != len(shape):
        raise ValueError(f"a centre in {len(shape)} dimensions has so many coordinates, not {len(centre)}")
    axes = [origin + np.arange(n) / shape[-2] - middle
            for origin, n, middle in zip(domain_origin(shape), shape[::-1], centre, strict=True)]
    return list(np.meshgrid(*axes[::-1], indexing="ij", sparse=True)[::-1])


def picture(shape: tuple[int, ...], solid: np.ndarray, centre: Sequence[float], height: float) -> Obstacle:
    """A mask (rows, columns), lowest row first, solid above 0.5, as high as `height` round `centre` (x, y).

    In 3-D it is a prism along z.
    """
    rows, columns = solid.shape
    pixel = height / rows
    corner = (centre[0] - 0.5 * pixel * (columns - 1), centre[1] - 0.5 * pixel * (rows - 1))
    plane = level_set(shape[-2:], Field(0.5 - np.asarray(solid, np.float32), pixel, corner))
    return Obstacle(np.ascontiguousarray(np.broadcast_to(plane.distance, shape)))


def drawn(tones: np.ndarray) -> np.ndarray:
    """The solids of a drawing (rows, columns), 0 to 1, as a mask for `picture`: ink, and what ink encloses.

    The paper is the median tone of the image's edge. Raises ValueError for an image without ink.
    """
    edge = np.concatenate([tones[0], tones[-1], tones[:, 0], tones[:, -1]])
    difference = np.abs(tones - np.median(edge))
    if difference.max() < 0.1:
        raise ValueError("the drawing is blank: nothing differs from its paper")
    return ndimage.binary_fill_holes(difference > INK * difference.max()).astype(np.float32)


def outlines(polygons: Sequence[np.ndarray], shape: tuple[int, int]) -> np.ndarray:
    """What closed polygons (N, 2) of x, y enclose, as a mask of `shape` (rows, columns) for `picture`.

    It reaches from 0 to 1 along y, and a pixel is 1 / rows wide too.
    """
    rows, columns = shape
    inside = np.zeros((rows, columns), bool)
    for polygon in polygons:
        ahead = np.roll(polygon, -1, axis=0)
        low, high = np.minimum(polygon[:, 1], ahead[:, 1]), np.maximum(polygon[:, 1], ahead[:, 1])
        for row in range(rows):
            y = (row + 0.5) / rows
            crossed = (low <= y) & (y < high)
            (x0, y0), (x1, y1) = polygon[crossed].T, ahead[crossed].T
            borders = np.sort(x0 + (y - y0) / (y1 - y0) * (x1 - x0))
            inside[row] |= np.searchsorted(borders, (np.arange(columns) + 0.5) / rows) % 2 == 1
    return inside.astype(np.float32)


def level_set(shape: tuple[int, ...], field: Field) -> Obstacle:
    """The obstacle where a scalar field is negative; the field has any voxel size and origin.

    Only its zero level matters, so a narrow band is enough. Outside the field there is no obstacle. Of a 3-D field a
    2-D domain takes the section at z = 0.
    """
    if field.is_vector or field.dimension < len(shape):
        raise ValueError("a level set is a scalar field of the domain's dimension")
    full = (1,) * (field.dimension - len(shape)) + tuple(shape)
    fine = FINE[len(shape)]
    if len(shape) == 3 and np.prod(shape) * fine**3 > MOST_SAMPLES:
        fine = 1
    voxel = 1.0 / shape[-2]
    counts = [n if axis < field.dimension - len(shape) else n * fine for axis, n in enumerate(full)]
    first = [o if n == 1 else o - 0.5 * voxel + 0.5 * voxel / fine
             for o, n in zip(domain_origin(shape) + (0.0,) * (field.dimension - len(shape)), counts[::-1],
                             strict=True)]
    scale = np.full(field.dimension, voxel / fine / field.voxel_size)
    offset = (np.array(first) - np.array(field.origin))[::-1] / field.voxel_size
    beyond = max(float(np.abs(field.values).max()), 1e-12)
    inside = ndimage.affine_transform(np.pad(field.values, 1, constant_values=beyond), scale, offset + 1,
                                      tuple(counts), order=1, mode="constant", cval=beyond) < 0
    return Obstacle(_measured(inside.reshape([n * fine for n in shape]), fine))


def voxels(shape: tuple[int, ...], filled: np.ndarray, pitch: float, origin: Sequence[float]) -> Obstacle:
    """The obstacle of voxels (Z, Y, X) bool that a surface touches or encloses, of edge `pitch`, the first at `origin`.

    Its surface lies half a voxel inside them, on average. A 2-D domain takes the section at z = 0.
    """
    grown = np.pad(filled, 3)
    away = ndimage.distance_transform_edt(~grown) - ndimage.distance_transform_edt(grown)
    away = away - 0.5 * np.sign(away) + 0.5
    return level_set(shape, Field(away.astype(np.float32) * pitch, pitch, tuple(o - 3 * pitch for o in origin)))


def _measured(inside: np.ndarray, fine: int) -> np.ndarray:
    """Signed distance, in cells, of a mask with `fine` samples along each axis of a cell."""
    if not inside.any() or inside.all():
        everywhere = sum(inside.shape) / fine
        return np.full([n // fine for n in inside.shape], -everywhere if inside.any() else everywhere, np.float32)
    away = ndimage.distance_transform_edt(~inside).astype(np.float32)
    away -= ndimage.distance_transform_edt(inside).astype(np.float32)
    away -= 0.5 * np.sign(away)  # the wall is midway between two samples
    away = ndimage.gaussian_filter(away, 0.5 * fine, mode="nearest")  # over half a cell: the steps of the samples
    split = [size for n in inside.shape for size in (n // fine, fine)]
    return away.reshape(split).mean(axis=tuple(range(1, 2 * away.ndim, 2))) / np.float32(fine)


def union(obstacles: Sequence[Obstacle]) -> Obstacle:
    """Several obstacles as one.

    Raises ValueError for one that no cell lies in, and where together they leave no cell free.
    """
    for number, obstacle in enumerate(obstacles, start=1):
        if not obstacle.solid.any():
            raise ValueError(f"obstacle {number} lies outside the domain, or is smaller than a cell")
    nearest = np.minimum.reduce([obstacle.distance for obstacle in obstacles])
    if (nearest < 0.5).all():
        raise ValueError("the obstacles fill the domain")
    return Obstacle(nearest)
