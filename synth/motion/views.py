"""Views: how a 2-D exemplar is seen in a 3-D field, and the search from a view (ma09 §3.2, figure 3, pseudocode 2).

A view is a plane in local coordinates. Neighbourhoods are projected on it before the search, and a match contributes
only the components in that plane (Eq. 2, figure 3).

    I_i  exemplar of view i     P_i  its projection, the rows right and up      w_i  its weight
    mu   match of a site        R    local axes                                 M_i  what its match makes of a voxel

Hot: the kernels `gather`, `average` and `nearest` take about three fifths of a later frame in 3-D (9.4 s for 256²×64
voxels, on 2 CPU cores). They are bound by scattered reads along the local axes: of the field in `gather`, of the
exemplar in the others. `python -m bench solid` shows it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from scipy import ndimage

from synth import opencl
from synth.motion import neighborhood, search
from synth.motion.assignment import sample_reference
from synth.motion.search import Matcher

# sites compared together: their neighbourhoods are what takes most memory
SITES_AT_ONCE = 49152
# the numbers in all neighbourhoods of a volume that is an exemplar, at most: they are held together once
MOST_NUMBERS = 2**28
# unit vectors closer than this to a plane lie in it
FLAT = 1e-3

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class View:
    """One exemplar and the plane of the local axes in which it is seen.

    exemplar  (N, M, 2) float32, a 2-D field; or (K, N, M, 3), a volume (3D to 3D)
    right, up directions of the exemplar's x and y axis in local coordinates, made unit and perpendicular
    weight    how much its matches count against those of other views, per unit
    Raises ValueError for directions that are parallel or zero, a weight that is not positive, an exemplar of
    another shape or without motion.
    """

    exemplar: np.ndarray
    right: Triple = (1.0, 0.0, 0.0)
    up: Triple = (0.0, 1.0, 0.0)
    weight: float = 1.0

    def __post_init__(self) -> None:
        dimension = self.exemplar.ndim - 1
        if dimension not in (2, 3) or self.exemplar.shape[-1] != dimension:
            raise ValueError(f"an exemplar is (N, M, 2) or (K, N, M, 3), not {self.exemplar.shape}")
        if not self.exemplar.any():
            raise ValueError("the exemplar is zero everywhere")
        if not self.weight > 0:
            raise ValueError(f"a view's weight must be positive, not {self.weight}")
        right, up = np.array(self.right, float), np.array(self.up, float)
        if not (np.linalg.norm(right) > 0 and np.linalg.norm(np.cross(right, up)) > FLAT * np.linalg.norm(up)):
            raise ValueError(f"a view's right {self.right} and up {self.up} span no plane")

    @property
    def basis(self) -> np.ndarray:
        """Right, up and normal in local coordinates: (3, 3) float64, orthonormal rows."""
        right = np.array(self.right, float) / np.linalg.norm(self.right)
        up = np.array(self.up, float)
        up = up - (up @ right) * right
        up /= np.linalg.norm(up)
        return np.stack([right, up, np.cross(right, up)])

    @property
    def dimension(self) -> int:
        """Of the exemplar: 2 or 3."""
        return self.exemplar.ndim - 1

    @property
    def projection(self) -> np.ndarray:
        """P: (2, 3) right and up; of a volume (3, 3), right, up and normal."""
        return self.basis[: self.dimension]


def contributions(views: Sequence[View]) -> list[np.ndarray]:
    """M_i (3, 2 or 3) of each view: a voxel is the sum of M_i mu_i, the weighted least squares of all views.

    The least of sum_i w_i |P_i s - mu_i|² over s is (sum w_i P_i^T P_i)^-1 sum w_i P_i^T mu_i: with the three planes of
    the axes and equal weights, Eq. 2. Raises ValueError if the views leave a direction unseen.
    """
    seen = sum((v.weight * v.projection.T @ v.projection for v in views), np.zeros((3, 3)))
    values, directions = np.linalg.eigh(seen)
    if values[0] < FLAT * values[-1] * min(v.weight for v in views) / max(v.weight for v in views):
        direction = ", ".join(f"{c:.2g}" for c in directions[:, 0])
        raise ValueError(f"the views do not span space: none sees the direction ({direction}) of the local axes")
    return [np.linalg.solve(seen, v.weight * v.projection.T) for v in views]


def exemplar_blocks(exemplar: np.ndarray, radius: int) -> np.ndarray:
    """All toroidal neighbourhoods of a volume (K, N, M, 3): (K * N * M, (2r+1)³ * 3) float32.

    Raises ValueError where they would not fit: a volume of 32³ holds 71 million numbers at radius 4.
    """
    width = 2 * radius + 1
    numbers = exemplar.size * width**3
    if numbers > MOST_NUMBERS:
        raise ValueError(f"a volume of {exemplar.shape[2]}×{exemplar.shape[1]}×{exemplar.shape[0]} is too large an "
                         f"exemplar: its neighbourhoods are {numbers / 2**30:.1f} G numbers")
    padded = np.pad(exemplar, ((radius, radius),) * 3 + ((0, 0),), mode="wrap")
    windows = np.lib.stride_tricks.sliding_window_view(padded, (width,) * 3, axis=(0, 1, 2))
    return np.ascontiguousarray(windows.transpose(0, 1, 2, 4, 5, 6, 3)).reshape(exemplar.size // 3, -1)


def site_grid(shape: tuple[int, ...], width: int) -> tuple[slice, ...]:
    """The sites of neighbourhoods of a width among cells (Z, Y, X): a slice for each axis."""
    step = neighborhood.spacing(width)
    return tuple(slice(min(step // 2, n - 1), None, step) for n in shape)


@dataclass(frozen=True)
class ViewSearch:
    """Search and assignment for one view, at one level, with one width of neighbourhoods.

    view, exemplar  the view, and its exemplar at this level
    matrix          M_i, see `contributions`
    width           of the neighbourhoods, cells
    dominant        whether this view weighs more than all others together
    k               candidates that each neighbour offers in k-coherence
    """

    view: View
    exemplar: np.ndarray
    matrix: np.ndarray
    width: int
    dominant: bool = False
    k: int = 4

    @property
    def slab(self) -> np.float32:
        """The depth of a match's footprint in front of and behind its plane, cells.

        If the view is dominant this is half the neighbourhood, since no other view connects its motifs across planes.
        """
        return np.float32(self.width // 2 if self.dominant else neighborhood.spacing(self.width))

    @cached_property
    def matcher(self) -> Matcher:
        radius = self.width // 2
        space = (neighborhood.space(self.exemplar, radius) if self.view.dimension == 2 else
                 neighborhood.space_of(exemplar_blocks(self.exemplar, radius), radius))
        return Matcher(space, (self.exemplar.shape[0], self.exemplar.shape[1]), self.k)

    @cached_property
    def rms(self) -> float:
        return float(np.sqrt(np.mean(self.view.exemplar.astype(np.float64) ** 2)))

    @cached_property
    def _defines(self) -> dict[str, Any]:
        step = neighborhood.spacing(self.width)
        return {"VOLUME": self.view.dimension - 2, "RADIUS": self.width // 2, "FOOT": step, "SPACING": step,
                "FIRST": step // 2, "BORDER": self._border,
                **search.defines(self.matcher.space.dims, self.k)}

    def _program(self, eight: bool) -> Any:
        return opencl.program(Path(__file__).with_suffix(".cl"), SEEN=int(eight), **self._defines)

    @property
    def _border(self) -> int:
        # a match's offset reaches the corner of its footprint or of the cube of eight sites, its position half a cell
        # beyond, Catmull-Rom two more
        return int(np.ceil(np.sqrt(3) * neighborhood.spacing(self.width))) + 4

    @cached_property
    def _continued(self) -> tuple[Any, np.ndarray]:
        """The exemplar as the kernels read it, and its size there."""
        if self.view.dimension == 3:
            cells = np.zeros((*self.exemplar.shape[:3], 4), np.float32)
            cells[..., :3] = self.exemplar
            return opencl.to_device(cells), np.array([*self.exemplar.shape[2::-1], 1], np.int32)
        padded = np.pad(self.exemplar, ((self._border,) * 2,) * 2 + ((0, 0),), mode="wrap")
        return opencl.to_device(padded), np.array([padded.shape[1], padded.shape[0], 1, 1], np.int32)

    @cached_property
    def _columns(self) -> tuple[np.ndarray, ...]:
        """right, up, and the columns of M_i, for the kernels."""
        right, up = (np.array([*row, 0], np.float32) for row in self.view.basis[:2])
        columns = np.zeros((3, 4), np.float32)
        columns[: self.matrix.shape[1], :3] = self.matrix.T
        return right, up, *columns

    def basis_at(self, axes: np.ndarray) -> Any:
        """Right, up and normal in the domain at each site, for local axes (K, J, I, 3, 3): device (S, 3, 4)."""
        basis = np.zeros((axes[..., 0, 0].size, 3, 4), np.float32)
        basis[..., :3] = np.einsum("lk,sdk->sld", self.view.basis.astype(np.float32), axes.reshape(-1, 3, 3))
        return opencl.to_device(basis)

    def queries(self, field: Any, basis: Any, grid: tuple[int, ...], first: int, count: int) -> Any:
        """Neighbourhoods of `count` sites from `first` on, as the view sees them (§3.2, Project): (count, D).

        field (Z, Y, X, 4), basis as from `basis_at`, grid (K, J, I) of sites.
        """
        rows = -(-count // neighborhood.SITES_TOGETHER) * neighborhood.SITES_TOGETHER
        patches = opencl.empty((rows, self.matcher.space.length))
        self._program(True).gather(
            (count,), (1,), field, np.array([*field.shape[2::-1], 1], np.int32), basis,
            np.array([*grid[::-1], 1], np.int32), np.int32(first), *self._columns[:2], self.slab, patches)
        return self.matcher.space.compare(patches, count)

    def search(self, field: Any, basis: Any, grid: tuple[int, ...], match: Any) -> tuple[Any, Any, Any]:
        """Matches of all sites: device index (S,), position in the exemplar (S, 2 or 4), squared distance (S,).

        match (S,) of the last search, for k-coherence; None: exact.
        """
        count = basis.shape[0]
        best, distance = opencl.empty(count, np.int32), opencl.empty(count)
        positions = []
        cells = np.array([*grid[::-1], 1], np.int32)
        exemplar = np.array([*self.exemplar.shape[-2::-1], 1, 1][:4], np.int32)
        program = self._program(True)
        for first in range(0, count, SITES_AT_ONCE):
            some = min(SITES_AT_ONCE, count - first)
            queries = self.queries(field, basis, grid, first, some)
            if match is None:
                best[first:first + some], distance[first:first + some] = self.matcher.exact(queries)
            else:
                program.coherent_3d((some,), (1,), self.matcher.points, self.matcher.similar, exemplar, queries,
                                       basis, cells, np.int32(first), match, best, distance)
            if self.view.dimension == 2:
                positions.append(self.matcher.refine(queries, best[first:first + some].copy()))
        if self.view.dimension == 2:
            return best, _joined(positions), distance
        x, y = exemplar[:2]
        index = best.get()
        place = np.stack([index % x, index // x % y, index // (x * y), np.zeros_like(index)], -1)
        return best, opencl.to_device(place.astype(np.float32)), distance

    def average(self, position: Any, weight: Any, basis: Any, grid: tuple[int, ...], field: Any, out: Any, eight: bool,
                begin: bool) -> None:
        """Eq. 2: add this view's contribution to `out` (Z, Y, X, 4); with `begin`, overwrite it."""
        self._program(eight).average(
            field.shape[2::-1], None, *self._continued, position, weight, basis, np.array([*grid[::-1], 1], np.int32),
            *self._columns, self.slab, np.int32(begin), field, out)

    def nearest(self, position: Any, basis: Any, grid: tuple[int, ...], average: Any, out: Any, begin: bool) -> None:
        """Pseudocode 2, Assign: the same with, in each cell, the match that is nearest to the average."""
        self._program(True).nearest(
            average.shape[2::-1], None, *self._continued, position, basis, np.array([*grid[::-1], 1], np.int32),
            *self._columns, np.int32(begin), average, out)


def _joined(parts: list[Any]) -> Any:
    """Device arrays one below the other."""
    if len(parts) == 1:
        return parts[0]
    whole = opencl.empty((sum(len(part) for part in parts), *parts[0].shape[1:]))
    first = 0
    for part in parts:
        whole[first:first + len(part)] = part
        first += len(part)
    return whole


def on_device(H: np.ndarray) -> Any:
    """(Z, Y, X, 3) on the device as (Z, Y, X, 4)."""
    padded = np.zeros((*H.shape[:3], 4), np.float32)
    padded[..., :3] = H
    return opencl.to_device(padded)


# The specification of the kernels, in NumPy. Sites are cells (S, 3) as x, y, z; basis is (S, 3, 3).


def gather_reference(field: np.ndarray, sites: np.ndarray, basis: np.ndarray, view: View, radius: int,
                     slab: float, spacing: int) -> np.ndarray:
    """Specification of `gather`: field (Z, Y, X, 3) as the view sees it round each site, (S, C) float32."""
    span = np.arange(-radius, radius + 1)
    offsets = np.stack(np.meshgrid(*[span] * view.dimension, indexing="ij")[::-1], -1).reshape(-1, view.dimension)
    at = sites[:, None] + np.einsum("pl,sld->spd", offsets, basis[:, : view.dimension])
    planes = [0.0]
    if view.dimension == 2 and slab > spacing:
        planes = [0.0, 0.5 * slab, -0.5 * slab]
    seen = sum(_sampled(field, at + plane * basis[:, None, 2]) for plane in planes) / len(planes)
    return (seen @ view.projection.T).reshape(len(sites), -1).astype(np.float32)


def _sampled(field: np.ndarray, at: np.ndarray) -> np.ndarray:
    """field (Z, Y, X, 3) at points (..., 3) as x, y, z: linear, clamped."""
    where = np.moveaxis(np.clip(at, 0, np.array(field.shape[2::-1]) - 1), -1, 0)[::-1]
    return np.stack([ndimage.map_coordinates(field[..., c], where, order=1) for c in range(3)], -1)


def coherent_reference(points: np.ndarray, similar: np.ndarray, exemplar: tuple[int, ...], queries: np.ndarray,
                       sites: np.ndarray, basis: np.ndarray, grid: tuple[int, int, int],
                       match: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Specification of `coherent_3d`; exemplar (rows, columns) or (layers, rows, columns), grid (K, J, I)."""
    best, distance = np.zeros(len(sites), int), np.zeros(len(sites))
    for s in range(len(sites)):
        here = np.array(np.unravel_index(s, grid))
        candidates: set[int] = set()
        for step in np.concatenate([np.zeros((1, 3), int), np.eye(3, dtype=int), -np.eye(3, dtype=int)]):
            there = here + step
            if (there < 0).any() or (there >= grid).any():
                continue
            n = int(np.ravel_multi_index(tuple(there), grid))
            offset = np.rint(basis[s] @ (sites[s] - sites[n]))[: len(exemplar)].astype(int)
            cell = (np.array(np.unravel_index(int(match[n]), exemplar)) + offset[::-1]) % exemplar
            candidates.update(similar[np.ravel_multi_index(tuple(cell), exemplar)].tolist())
        choice = np.array(sorted(candidates))
        squared = ((queries[s] - points[choice]).astype(np.float64) ** 2).sum(1)
        best[s], distance[s] = choice[squared.argmin()], squared.min()
    return best, distance


def shown_reference(exemplar: np.ndarray, at: np.ndarray) -> np.ndarray:
    """The exemplar at points (P, 2 or 3), toroidal: Catmull-Rom in 2-D, linear in a volume."""
    if exemplar.ndim == 3:
        return sample_reference(exemplar, at[:, :2], toroidal=True)
    return np.stack([ndimage.map_coordinates(exemplar[..., c], at.T[::-1], order=1, mode="grid-wrap")
                     for c in range(3)], -1)


def average_reference(search: ViewSearch, position: np.ndarray, weight: np.ndarray, sites: np.ndarray,
                      basis: np.ndarray, field: np.ndarray, eight: bool) -> np.ndarray:
    """Specification of `average`: one view's contribution to each voxel (Z, Y, X, 3), site by site."""
    step = neighborhood.spacing(search.width)
    sums, totals = np.zeros((*field.shape[:3], search.view.dimension)), np.zeros(field.shape[:3])
    for s, (offset, o) in enumerate(_offsets(sites, basis, field.shape[:3])):
        share = 1 - o**2 / (step + 1) ** 2
        volume = search.view.dimension == 3
        depth = share[..., 2] if volume else 1 - np.abs(o[..., 2]) / float(search.slab)
        if eight:
            w = np.maximum(share[..., 0], 0.1) * np.maximum(share[..., 1], 0.1) * np.maximum(depth, 0.1)
            w *= _among_eight(offset, sites[s], sites, step)
        else:
            w = share[..., 0] * share[..., 1] * depth
            w *= (np.abs(o[..., : 3 if volume else 2]).max(-1) <= step + 0.001) & (depth > 0)
        w = w * weight[s]
        at = position[s, : search.view.dimension] + o[..., : search.view.dimension]
        shown = shown_reference(search.exemplar, at.reshape(-1, search.view.dimension)).reshape(sums.shape)
        sums += w[..., None] * shown
        totals += w
    there = field @ search.view.projection.T
    mean = np.where(totals[..., None] > 0, sums / np.maximum(totals, 1e-30)[..., None], there)
    return (mean @ search.matrix.T).astype(np.float32)


def nearest_reference(search: ViewSearch, position: np.ndarray, sites: np.ndarray, basis: np.ndarray,
                      average: np.ndarray) -> np.ndarray:
    """Specification of `nearest`: of the eight matches round a voxel the one most similar to the average there."""
    step, dimension = neighborhood.spacing(search.width), search.view.dimension
    mean = average @ search.view.projection.T
    best, least = np.zeros_like(mean), np.full(average.shape[:3], np.inf)
    for s, (offset, o) in enumerate(_offsets(sites, basis, average.shape[:3])):
        at = position[s, :dimension] + o[..., :dimension]
        shown = shown_reference(search.exemplar, at.reshape(-1, dimension)).reshape(mean.shape)
        d = np.where(_among_eight(offset, sites[s], sites, step), np.sum((shown - mean) ** 2, -1), np.inf)
        best = np.where((d < least)[..., None], shown, best)
        least = np.minimum(d, least)
    return (best @ search.matrix.T).astype(np.float32)


def _offsets(sites: np.ndarray, basis: np.ndarray,
             shape: tuple[int, ...]) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """For each site the offset (Z, Y, X, 3) from it to every cell, in the domain's axes and in its basis."""
    cells = np.stack(np.meshgrid(*(np.arange(n) for n in shape), indexing="ij")[::-1], -1)
    for site, row in zip(sites, basis, strict=True):
        yield cells - site, (cells - site) @ row.T


def _among_eight(offset: np.ndarray, site: np.ndarray, sites: np.ndarray, step: int) -> np.ndarray:
    """Which cells (Z, Y, X) have this site at a corner of the cube of sites that holds them, or lie beyond the last."""
    first, last = sites.min(0), sites.max(0)
    near = np.abs(offset) < step
    beyond = ((site == first) & (offset <= 0)) | ((site == last) & (offset >= 0))
    # a cell on a plane of sites counts for the cube in front of it too
    behind = (offset == -step) & (site > first)
    return np.all(near | beyond | behind, axis=-1)
