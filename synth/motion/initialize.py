"""Initialization (ma09 §3.4) of the first axes, at the coarsest level."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from synth import opencl
from synth.motion.local_axes import block_means

RELAXATIONS = 15
# tiles laid per exemplar area: rotated squares do not pack without gaps, and some tiles vanish
CROWDING = 1.1
# deep blocks have many neighbours
NEAREST_BLOCKS = 16
# a place with less than this share of the exemplar's mean square is empty; a lattice of points has 0.83 at least
EMPTY = 0.55


def random_pixels(exemplar: np.ndarray, shape: tuple[int, int], random: np.random.Generator) -> np.ndarray:
    """Pixels copied at random from the exemplar (N, M, K), as the paper does: (Y, X, K)."""
    pixels = exemplar.reshape(-1, exemplar.shape[-1])
    return pixels[random.integers(len(pixels), size=shape)]


def mosaics(exemplar: np.ndarray, axes: np.ndarray, randoms: Sequence[np.random.Generator]) -> list[np.ndarray]:
    """Whole exemplars laid as tiles of a mosaic that follows the axes (Y, X, 2): (Y, X, K) for each of `randoms`.

    The tiles' centres relax as in Hausner 2001 (centroidal Voronoi cells of squares rotated with the axes), so
    that each cell of the mosaic is about one exemplar large and a closed motif in its middle stays whole.
    """
    size = exemplar.shape[0]
    rows, columns = axes.shape[:2]
    cells = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).astype(np.float32)
    count = max(1, round(CROWDING * rows * columns / size**2))
    last = np.array([columns - 1, rows - 1], np.float32)
    centres = np.stack([random.random((count, 2), dtype=np.float32) for random in randoms]) * last
    # to find the middle of a tile, 8 x 8 of its cells are enough
    stride = max(1, size // 8)
    some = np.ascontiguousarray(cells[::stride, ::stride]).reshape(-1, 2)
    first = count * np.arange(len(centres))[:, None]
    for _ in range(RELAXATIONS):
        tile = (owners(some, centres, axes, size)[0] + first).ravel()
        members = np.bincount(tile, minlength=centres.size // 2)
        sums = np.stack([np.bincount(tile, np.tile(some[:, i], len(centres)), minlength=len(members))
                         for i in (0, 1)], axis=-1)
        middles = (sums / np.maximum(members, 1)[:, None]).astype(np.float32).reshape(centres.shape)
        centres = np.where(members.reshape(-1, count, 1) > 0, middles, centres)
    offset = owners(cells.reshape(-1, 2), centres, axes, size)[1]
    at = np.rint(offset + (size - 1) / 2).astype(int) % size
    return list(exemplar[at[..., 1], at[..., 0]].reshape(-1, rows, columns, exemplar.shape[-1]))


def owners_reference(cells: np.ndarray, centres: np.ndarray, axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Specification of `owners`; arguments as there."""
    e = _axes(centres, axes)[:, None]
    from_centre = cells[:, None] - centres[:, None]
    offset = np.stack([np.sum(e * from_centre, -1),
                       e[..., 0] * from_centre[..., 1] - e[..., 1] * from_centre[..., 0]], axis=-1)
    owner = np.abs(offset).max(axis=-1).argmin(axis=-1)
    return owner, np.take_along_axis(offset, owner[..., None, None], axis=2)[:, :, 0]


def owners(cells: np.ndarray, centres: np.ndarray, axes: np.ndarray, edge: float) -> tuple[np.ndarray, np.ndarray]:
    """The centre whose rotated square holds a cell best, and the cell's offset along that square's sides.

    cells (P, 2), centres (S, N, 2) of S mosaics, float32 as x, y inside axes (Y, X, 2); `edge`, about the distance
    of the centres, bears on speed alone. Returns (S, P) int32 and (S, P, 2) float32.
    """
    program = opencl.program(Path(__file__).with_suffix(".cl"))
    many, count = centres.shape[:2]
    grid = np.array([-(-axes.shape[1] // edge), -(-axes.shape[0] // edge)], np.int32)
    at = np.clip((centres / np.float32(edge)).astype(int), 0, grid - 1)
    bucket = at[..., 1] * grid[0] + at[..., 0]
    order = np.argsort(bucket, axis=1, kind="stable")
    every = np.arange(grid.prod() + 1)
    starts = np.stack([np.searchsorted(row, every) for row in np.take_along_axis(bucket, order, 1)])
    sorted_centres, sorted_axes = (np.take_along_axis(values, order[..., None], 1)
                                   for values in (centres, _axes(centres, axes)))
    owner, offset = opencl.empty((many, len(cells)), np.int32), opencl.empty((many, len(cells), 2))
    program.owners((len(cells), many), None, *map(opencl.to_device, (
        cells, sorted_centres, sorted_axes, order.astype(np.int32), starts.astype(np.int32))),
        np.int32(count), grid, np.float32(edge), owner, offset)
    return owner.get(), offset.get()


def _axes(centres: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """The local x axis at centres (S, N, 2)."""
    at = np.rint(centres).astype(int)
    return axes[np.clip(at[..., 1], 0, axes.shape[0] - 1), np.clip(at[..., 0], 0, axes.shape[1] - 1)]


def reseed(H: np.ndarray, exemplar: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """H (Y, X, K) with a whole exemplar (N, M, K) placed wherever the detail has run empty.

    A place is empty where the mean square of H over an exemplar's area is below EMPTY of the exemplar's own. A
    flow that shears and stretches makes motifs fade; least squares alone never restores one.
    """
    size = exemplar.shape[0]
    spread = size / np.sqrt(2 * np.pi)  # a Gaussian of the exemplar's area
    mean = float(np.mean(np.sum(exemplar.astype(np.float64) ** 2, axis=-1)))
    H = H.copy()
    rows, columns = H.shape[:2]
    for _ in range(max(1, rows * columns // size**2)):
        energy = ndimage.gaussian_filter(np.sum(H**2, axis=-1), spread, mode="reflect")
        y, x = np.unravel_index(int(energy.argmin()), energy.shape)
        if energy[y, x] >= EMPTY * mean:
            break
        reach = size - 1
        window = np.mgrid[max(y - reach, 0):min(y + reach + 1, rows), max(x - reach, 0):min(x + reach + 1, columns)]
        from_y, from_x = window[0] - y, window[1] - x
        e = axes[y, x]
        offset_x, offset_y = e[0] * from_x + e[1] * from_y, e[0] * from_y - e[1] * from_x
        inside = np.maximum(np.abs(offset_x), np.abs(offset_y)) < size / 2
        at_x, at_y = (np.rint(o + (size - 1) / 2).astype(int) % size for o in (offset_x, offset_y))
        place = window[0][inside], window[1][inside]
        tile = exemplar[at_y[inside], at_x[inside]]
        # what is stronger there already stays
        stronger = np.sum(tile**2, axis=-1, keepdims=True) > np.sum(H[place] ** 2, axis=-1, keepdims=True)
        H[place] = np.where(stronger, tile, H[place])
    return H


def blocks(axes: np.ndarray, edges: tuple[int, int, int], random: np.random.Generator) -> np.ndarray:
    """The mosaic in three dimensions: blocks rotated with the local axes (Z, Y, X, 3, 3) fill the domain.

    edges are theirs along the local axes, cells. Returns for each cell its offset from the middle of the block that
    holds it, along that block's axes: (Z, Y, X, 3) float32. The blocks' centres relax as in `mosaics`.
    """
    shape = axes.shape[:3]
    # x, y, z
    cells = np.stack(np.meshgrid(*(np.arange(n, dtype=np.float32) for n in shape), indexing="ij")[::-1], axis=-1)
    count = max(1, round(CROWDING * cells[..., 0].size / np.prod(edges)))
    centres = random.random((count, 3), dtype=np.float32) * (np.array(shape[::-1], np.float32) - 1)
    stride = max(1, min(edges) // 8)
    some = cells[::stride, ::stride, ::stride].reshape(-1, 3)
    half = np.array(edges, np.float32) / 2
    for _ in range(RELAXATIONS):
        nearest, _ = _block_owners(some, centres, axes, half)
        members = np.bincount(nearest, minlength=count)
        sums = np.stack([np.bincount(nearest, some[:, i], minlength=count) for i in range(3)], axis=-1)
        centres = np.where(members[:, None] > 0, sums / np.maximum(members, 1)[:, None], centres).astype(np.float32)
    return _block_owners(cells.reshape(-1, 3), centres, axes, half)[1].reshape(*shape, 3)


def _block_owners(cells: np.ndarray, centres: np.ndarray, axes: np.ndarray,
                  half: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """For each of cells (P, 3) the centre whose rotated block holds it best, and the offset along that block's axes."""
    _, index = cKDTree(centres).query(cells, k=min(NEAREST_BLOCKS, len(centres)))
    index = index.reshape(len(cells), -1)
    x, y, z = np.rint(centres).astype(int).T
    offset = np.einsum("pkd,pkde->pke", cells[:, None] - centres[index], axes[z, y, x][index])
    nearest = np.abs(offset / half).max(axis=-1).argmin(axis=1)
    rows = np.arange(len(cells))
    return index[rows, nearest], offset[rows, nearest].astype(np.float32)


def empty_blocks(H: np.ndarray, axes: np.ndarray, basis: np.ndarray, edges: tuple[int, int, int],
                 mean: float) -> Iterator[tuple[tuple[slice, ...], np.ndarray]]:
    """The places where H (Z, Y, X, 3) has run empty, one after the other: the caller fills each before the next.

    A place is as large as a block of `edges` along `basis` (3, 3), the rows in local coordinates; it is empty where the
    mean square of H over it is below EMPTY of `mean`. Yields the box of cells round the block and their offsets from
    its middle along its local axes (z, y, x, 3).
    """
    shape = np.array(H.shape[:3])
    stride = max(1, min(edges) // 8)
    spread = np.cbrt(np.prod(edges)) / stride / np.sqrt(2 * np.pi)
    reach = int(np.ceil(np.linalg.norm(edges) / 2))
    for _ in range(max(1, int(np.prod(shape) / np.prod(edges)))):
        energy = ndimage.gaussian_filter(block_means(np.sum(H**2, axis=-1), stride), spread, mode="reflect")
        place = np.unravel_index(int(energy.argmin()), energy.shape)
        if energy[place] >= EMPTY * mean:
            return
        middle = np.minimum(np.array(place) * stride + stride // 2, shape - 1)
        low, high = np.maximum(middle - reach, 0), np.minimum(middle + reach + 1, shape)
        ranges = [np.arange(a, b, dtype=np.float32) - m for a, b, m in zip(low, high, middle, strict=True)]
        offset = np.stack(np.meshgrid(*ranges, indexing="ij")[::-1], axis=-1)
        yield tuple(slice(a, b) for a, b in zip(low, high, strict=True)), offset @ axes[tuple(middle)]
