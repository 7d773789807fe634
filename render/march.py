"""Smoke rendered without noise: light transport on a grid, then one ray per pixel; kernels in march.cl.

    arriving   the light of the lamps that reaches each cell, by a sweep away from each point of a lamp
    scattered  the light that the cells then scatter to each other, at half the resolution: discrete ordinates
               with the 24 directions of S4 [Carlson and Lathrop 1965], along short characteristics on which
               the source function is linear in optical depth, up to a fixed number of bounces
    source     both together: the light that each cell scatters to the eye
    radiance   integrated front to back along the rays of the picture
    shade      the share of a lamp's light that passes the smoke and falls on the surfaces around it
    seen       all of it, in a studio

Three approximations: after its first scattering, light is treated as scattering isotropically in thinner
smoke (similarity relation: extinction times 1 - albedo * forward); multiple scattering follows 24 directions;
and the smoke does not light the surfaces. All else is what a path tracer converges to. The NumPy functions
named *_reference are the specification of the kernels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy import ndimage

from synth import opencl
from synth.advect import ROW

STEP = 1.0  # of the rays, in cells
LEAST = 1e-3  # transmittance at which a ray ends
ACROSS = 3  # sample points along each edge of a lamp, for its light in the smoke
SHADE_ACROSS = 5  # and for the shadow of the smoke on surfaces
BOUNCES = (2, 16)  # of `scattered`, on cells twice and four times as large; two more change little
MU, ETA = 0.3500212, 0.8688903  # S4: its directions are (+-MU, +-MU, +-ETA) in every order
SLOPE, HALF_STEP = MU / ETA, 0.5 / ETA  # of a direction, from one plane of cells to the next


@dataclass(frozen=True)
class Grid:
    """sigma: (Z, Y, X) float32, extinction per cell; voxel_size: edge of a cell, world units; origin: (x, y, z),
    centre of cell (0, 0, 0), world units."""

    sigma: np.ndarray
    voxel_size: float
    origin: np.ndarray

    def cells(self, points: np.ndarray) -> np.ndarray:
        """World points (..., 3) in cells of this grid, x, y, z; float32."""
        return ((points - self.origin) / self.voxel_size).astype(np.float32)


@dataclass(frozen=True)
class Medium:
    """albedo: scattered share of the extinction, in three colours; forward: mean cosine of the scattering
    angle (Henyey and Greenstein)."""

    albedo: tuple[float, float, float]
    forward: float

    @property
    def reduced(self) -> float:
        """Share of the extinction that is left when forward scattering counts as no scattering."""
        return 1.0 - float(np.mean(self.albedo)) * self.forward

    @property
    def even_albedo(self) -> np.ndarray:
        """Albedo (3,) of the isotropic smoke that replaces this one after the first scattering."""
        return np.array(self.albedo) * (1.0 - self.forward) / (1.0 - np.array(self.albedo) * self.forward)


@dataclass(frozen=True)
class Lamp:
    """A rectangular light: corner and edges (3,) in world units, radiance in three colours."""

    corner: np.ndarray
    edges: tuple[np.ndarray, np.ndarray]
    radiance: tuple[float, float, float]

    @property
    def normal(self) -> np.ndarray:
        """Its unit normal (3,)."""
        across = np.cross(*self.edges)
        return np.asarray(across / np.linalg.norm(across))

    @property
    def area(self) -> float:
        """In world units squared."""
        return float(np.linalg.norm(np.cross(*self.edges)))

    def points(self, across: int) -> np.ndarray:
        """The centres (across^2, 3) of its across x across tiles."""
        share = (np.arange(across) + 0.5) / across
        u, v = np.meshgrid(share, share, indexing="ij")
        return np.asarray(self.corner + u.reshape(-1, 1) * self.edges[0] + v.reshape(-1, 1) * self.edges[1])


def directions() -> np.ndarray:
    """The unit vectors (6, 4, 3), x, y, z, towards which S4 looks for light, in the order of `border`."""
    made = np.empty((6, 4, 3), np.float32)
    for group in range(6):
        main, sign = _group(group)
        a, b = (axis for axis in range(3) if axis != main)
        for quadrant in range(4):
            made[group, quadrant, 2 - main] = sign * ETA
            made[group, quadrant, 2 - a] = MU if quadrant >> 1 else -MU
            made[group, quadrant, 2 - b] = MU if quadrant & 1 else -MU
    return made


def _group(group: int) -> tuple[int, int]:
    """(axis of the array, sign) along which a group of four directions crosses the planes of cells."""
    return group // 2, 1 if group % 2 else -1


def _program() -> opencl.Program:
    return opencl.program(Path(__file__).with_suffix(".cl"), LEAST=f"{LEAST}f")


def _rows(count: int) -> int:
    return -(-count // ROW) * ROW


def _int32(*values: int) -> list[np.int32]:
    return [np.int32(value) for value in values]


def _float32(*values: float) -> list[np.float32]:
    return [np.float32(value) for value in values]


# -- light from lamps ------------------------------------------------------------------------------------------


def _main_axis(shape: tuple[int, ...], point: np.ndarray) -> tuple[int, int]:
    """(axis of the array, sign) along which planes lead to `point` (x, y, z, cells), which is outside the grid."""
    offset = (point - 0.5 * (np.array(shape[::-1]) - 1))[::-1]
    main = int(np.argmax(np.abs(offset)))
    if -1.0 < point[2 - main] < shape[main]:
        raise ValueError("a lamp is inside the smoke")
    return main, 1 if offset[main] > 0 else -1


def arriving_reference(sigma: np.ndarray, point: np.ndarray, facing: np.ndarray, area: float, eye: np.ndarray,
                       medium: Medium) -> tuple[np.ndarray, np.ndarray]:
    """The light of one point of a lamp in cells with smoke: (seen, spread), each (Z, Y, X), for a radiance of 1.

    seen    scattered once, to the eye; spread: the mean over all directions, in the isotropic smoke
    point   of the lamp; facing: its normal; eye: (3,) each, x, y, z, in cells
    area    of the lamp, cells squared, divided by 4 pi
    """
    main, sign = _main_axis(sigma.shape, point)
    turned = np.moveaxis(sigma, main, 0)
    order = [main, *(axis for axis in range(3) if axis != main)]
    point, facing, eye = (np.asarray(vector, np.float64)[::-1][order] for vector in (point, facing, eye))
    cells = np.stack(np.meshgrid(*(np.arange(n) for n in turned.shape), indexing="ij"), -1)
    offset = point - cells
    distance = np.linalg.norm(offset, axis=-1)
    depth = np.zeros(turned.shape)
    count = len(turned)
    for m in range(count - 2, -1, -1) if sign > 0 else range(1, count):
        step = 1.0 / np.abs(offset[m, ..., 0])
        at = [cells[m, ..., 1] + offset[m, ..., 1] * step, cells[m, ..., 2] + offset[m, ..., 2] * step]
        before, there = (ndimage.map_coordinates(values[m + sign], at, order=1, mode="grid-constant", prefilter=False)
                         for values in (depth, turned))
        depth[m] = before + 0.5 * distance[m] * step * (there + turned[m])
    to_eye = eye - cells
    cosine = -(offset * to_eye).sum(-1) / (distance * np.linalg.norm(to_eye, axis=-1))
    g = medium.forward
    phase = (1 - g * g) / (1 + g * g - 2 * g * cosine) ** 1.5
    angle = (turned > 0.0) * area * np.abs(offset @ facing) / distance**3  # solid angle over 4 pi
    passed, passed_reduced = np.exp(-depth), np.exp(-medium.reduced * depth)
    both = (angle * (phase * passed + passed_reduced - passed), angle * passed_reduced)
    return (np.moveaxis(both[0], 0, main).astype(np.float32), np.moveaxis(both[1], 0, main).astype(np.float32))


def arriving(sigma: Any, shape: tuple[int, ...], points: np.ndarray, facing: np.ndarray, area: float,
             eye: np.ndarray, medium: Medium) -> tuple[Any, Any]:
    """`arriving_reference` summed over all points (P, 3) of a lamp; sigma and the results are on the device."""
    seen, spread, depth = opencl.zeros(shape), opencl.zeros(shape), opencl.empty(shape)
    strides = (shape[1] * shape[2], shape[2], 1)
    for point in points:
        main, sign = _main_axis(shape, point)
        order = [main, *(axis for axis in range(3) if axis != main)]
        vectors = [vector[::-1][order] for vector in (point, facing, eye)]
        counts, steps = [shape[axis] for axis in order], [strides[axis] for axis in order]
        given = [*_int32(*counts, *steps), *_float32(*np.concatenate(vectors), area / len(points), medium.forward,
                                                  medium.reduced)]
        for m in range(counts[0])[:: -sign]:
            _program().arrive((_rows(counts[2]), counts[1]), (ROW, 1), sigma, depth, seen, spread,
                              *_int32(m, sign), *given)
    return seen, spread


# -- from cells to cells twice as large, and back ---------------------------------------------------------------


def halved_reference(sigma: np.ndarray, light: np.ndarray, share: float) -> tuple[np.ndarray, np.ndarray]:
    """Extinction per cell, times `share`, and light (Z, Y, X, C) on cells twice as large; the light is the
    mean weighted by extinction."""
    odd = [(0, n % 2) for n in sigma.shape]
    blocks = [n for size in sigma.shape for n in (-(-size // 2), 2)]

    def means(values: np.ndarray) -> np.ndarray:
        return np.pad(values, odd).reshape(blocks).mean(axis=(1, 3, 5))

    depth = means(sigma)
    lights = [means(sigma * light[..., c]) / np.maximum(depth, 1e-30) for c in range(light.shape[-1])]
    return (2 * share * depth).astype(np.float32), np.stack(lights, -1).astype(np.float32)


def _halved(sigma: Any, shape: tuple[int, ...], light: Any, share: float) -> tuple[Any, Any, tuple[int, ...]]:
    """`halved_reference` on the device, and the shape of its grid."""
    half = hz, hy, hx = tuple(-(-n // 2) for n in shape)
    half_sigma, half_light = opencl.empty(half), opencl.empty((*half, 4))
    _program().halve((_rows(hx), hy, hz), (ROW, 1, 1), sigma, light, half_sigma, half_light,
                     *_int32(hx, hy, *shape[::-1]), *_float32(share))
    return half_sigma, half_light, half


def refined_reference(coarse: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """`coarse` (Z, Y, X, C) on cells half as large, by linear interpolation: (*shape, C)."""
    where = np.stack(np.meshgrid(*(0.5 * np.arange(n) - 0.25 for n in shape), indexing="ij"))
    return np.stack([_at(coarse[..., c], where) for c in range(coarse.shape[-1])], -1)


def _refined(coarse: Any, half: tuple[int, ...], shape: tuple[int, ...]) -> Any:
    """`refined_reference` on the device."""
    fine = opencl.empty((*shape, 4))
    _program().refine((_rows(shape[2]), *shape[1::-1]), (ROW, 1, 1), coarse, fine, *_int32(*shape[:0:-1], *half[::-1]))
    return fine


def _at(values: np.ndarray, where: np.ndarray) -> np.ndarray:
    """`values` (Z, Y, X) at `where` (3, ...), z, y, x: linear, clamped at the border."""
    return np.asarray(ndimage.map_coordinates(values, where, order=1, mode="nearest", prefilter=False))


# -- multiple scattering ----------------------------------------------------------------------------------------


def scattered_reference(sigma: np.ndarray, direct: np.ndarray, albedo: np.ndarray, border: np.ndarray,
                        bounces: Sequence[int]) -> np.ndarray:
    """Mean over all directions of the light that reaches each cell from others and from outside, (Z, Y, X, 3).

    sigma    (Z, Y, X) extinction per cell
    direct   (Z, Y, X, 3) the mean light from lamps
    albedo   (3,)
    border   (6, 4, 3) the light from outside, from each of `directions`
    bounces  how many to compute here, starting from the result of the remaining numbers on cells twice as large
    """
    if len(bounces) > 1:
        coarse = scattered_reference(*halved_reference(sigma, direct, 1.0), albedo, border, bounces[1:])
        arrived = refined_reference(coarse, sigma.shape)
    else:
        arrived = np.zeros((*sigma.shape, 3))
    for _ in range(bounces[0]):
        sent = np.concatenate([albedo * (direct + arrived), np.ones((*sigma.shape, 1))], -1) * sigma[..., None]
        arrived = np.zeros_like(arrived)
        for group in range(6):
            main, sign = _group(group)
            planes, total = np.moveaxis(sent, main, 0), np.moveaxis(arrived, main, 0)
            for quadrant in range(4):
                da, db = (1 if quadrant >> 1 else -1), (1 if quadrant & 1 else -1)
                light = np.broadcast_to(border[group, quadrant], (*planes.shape[1:3], 3))
                for m in range(len(planes))[:: -sign]:
                    if 0 <= m + sign < len(planes):
                        arriving_light = _shifted(light, da, db, border[group, quadrant])
                        here, there = planes[m], _shifted(planes[m + sign], da, db, np.zeros(4))
                        depth = HALF_STEP * (here[..., 3:] + there[..., 3:])
                        passed = np.exp(-depth)
                        mean = np.where(depth > 1e-3, (1 - passed) / np.maximum(depth, 1e-30), 1 - 0.5 * depth)
                        light = passed * arriving_light
                        for end, other, share in ((here, there, 1 - mean), (there, here, mean - passed)):
                            weight = np.where(other[..., 3:] > 0, share, 1 - passed)
                            light = light + weight * end[..., :3] / np.maximum(end[..., 3:], 1e-30)
                    total[m] += light / 24
    return arrived.astype(np.float32)


def _shifted(values: np.ndarray, da: int, db: int, outside: np.ndarray) -> np.ndarray:
    """`values` (A, B, C) read at an offset of SLOPE * (da, db) cells, linear; `outside` beyond the border."""
    padded = np.empty((values.shape[0] + 2, values.shape[1] + 2, values.shape[2]))
    padded[:] = outside
    padded[1:-1, 1:-1] = values

    def part(a: int, b: int) -> np.ndarray:
        return padded[1 + a:1 + a + values.shape[0], 1 + b:1 + b + values.shape[1]]

    s = SLOPE
    return (1 - s) * ((1 - s) * part(0, 0) + s * part(0, db)) + s * ((1 - s) * part(da, 0) + s * part(da, db))


def scattered(sigma: Any, shape: tuple[int, ...], direct: Any, albedo: np.ndarray, border: np.ndarray,
              bounces: Sequence[int]) -> Any:
    """`scattered_reference` on the device, (Z, Y, X, 4) with an unused last component; so are sigma and direct."""
    count = int(np.prod(shape))
    if len(bounces) > 1:
        half_sigma, half_direct, half = _halved(sigma, shape, direct, 1.0)
        arrived = _refined(scattered(half_sigma, half, half_direct, albedo, border, bounces[1:]), half, shape)
    else:
        arrived = opencl.zeros((*shape, 4))
    sent = opencl.empty((*shape, 4))
    largest = max(shape[0] * shape[1], shape[1] * shape[2], shape[0] * shape[2])
    before, after = (opencl.empty((4, largest, 4)) for _ in range(2))
    strides = (shape[1] * shape[2], shape[2], 1)
    outside = [opencl.to_device(np.pad(light, ((0, 0), (0, 1))).astype(np.float32)) for light in border]
    for _ in range(bounces[0]):
        _program().send((_rows(count),), (ROW,), sigma, direct, arrived, sent, *_int32(count), *_float32(*albedo))
        arrived.fill(0)
        for group in range(6):
            main, sign = _group(group)
            order = [main, *(axis for axis in range(3) if axis != main)]
            counts, steps = [shape[axis] for axis in order], [strides[axis] for axis in order]
            given = [*_int32(*counts, *steps), *_float32(SLOPE, HALF_STEP, 1 / 24)]
            for m in range(counts[0])[:: -sign]:
                _program().sweep((_rows(counts[2]), counts[1]), (ROW, 1), sent, before, after, arrived,
                                 outside[group], *_int32(m, sign), *given)
                before, after = after, before
    return arrived


# -- source function --------------------------------------------------------------------------------------------


def source_reference(grid: Grid, lamps: Sequence[Lamp], eye: np.ndarray, medium: Medium,
                     border: np.ndarray) -> np.ndarray:
    """The specification of `source`."""
    seen, spread = np.zeros((2, *grid.sigma.shape, 3))
    for lamp in lamps:
        points = lamp.points(ACROSS)
        for point in points:
            light = arriving_reference(grid.sigma, grid.cells(point), lamp.normal, _area(lamp, grid) / len(points),
                                       grid.cells(eye), medium)
            seen += light[0][..., None] * np.array(lamp.radiance)
            spread += light[1][..., None] * np.array(lamp.radiance)
    half, direct = halved_reference(grid.sigma, spread, medium.reduced)
    arrived = scattered_reference(half, direct, medium.even_albedo, border, BOUNCES)
    light = np.array(medium.albedo) * (seen + refined_reference(arrived, grid.sigma.shape))
    return (grid.sigma[..., None] * np.concatenate([light, np.ones((*grid.sigma.shape, 1))], -1)).astype(np.float32)


def _area(lamp: Lamp, grid: Grid) -> float:
    """Cells squared over 4 pi."""
    return lamp.area / grid.voxel_size**2 / (4 * np.pi)


def source(grid: Grid, lamps: Sequence[Lamp], eye: np.ndarray, medium: Medium, border: np.ndarray) -> Any:
    """Light that each cell scatters to the eye, times extinction, and extinction: (Z, Y, X, 4) on the device.

    eye: (3,) world units; border: (6, 4, 3) the light from outside, without the lamps', from each of `directions`
    """
    shape = grid.sigma.shape
    sigma = opencl.to_device(grid.sigma.astype(np.float32))
    seen, spread = opencl.zeros((*shape, 4)), opencl.zeros((*shape, 4))
    count = grid.sigma.size
    for lamp in lamps:
        lights = arriving(sigma, shape, grid.cells(lamp.points(ACROSS)), lamp.normal, _area(lamp, grid),
                          grid.cells(eye), medium)
        for light, total in zip(lights, (seen, spread), strict=True):
            _program().tint((_rows(count),), (ROW,), light, total, *_int32(count), *_float32(*lamp.radiance))
    half_sigma, direct, half = _halved(sigma, shape, spread, medium.reduced)
    arrived = scattered(half_sigma, half, direct, medium.even_albedo, border, BOUNCES)
    made = spread  # its values are no longer needed
    _program().send((_rows(count),), (ROW,), sigma, seen, _refined(arrived, half, shape), made, *_int32(count),
                    *_float32(*medium.albedo))
    return made


# -- rays -----------------------------------------------------------------------------------------------------


def _crossing(shape: tuple[int, ...], start: np.ndarray, rays: np.ndarray,
              end: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(entry, exit) (N,) of rays (N, 3), x, y, z, in a grid, whose border is half a cell outside the centres."""
    safe = np.where(np.abs(rays) < 1e-12, 1e-12, rays)
    low, high = (-0.5 - start) / safe, (np.array(shape[::-1]) - 0.5 - start) / safe
    entry = np.maximum(np.minimum(low, high).max(axis=-1), 0.0)
    return entry, np.minimum(np.maximum(low, high).min(axis=-1), end)


def _segments(shape: tuple[int, ...], start: np.ndarray, rays: np.ndarray, end: np.ndarray, step: float) -> Any:
    """For each step of all rays at once: (lengths (N,), midpoints (3, N), z, y, x)."""
    entry, leave = _crossing(shape, start, rays, end)
    crossed = leave > entry
    if not crossed.any():
        return
    for k in range(int(entry[crossed].min() / step), int(np.ceil(leave[crossed].max() / step))):
        begin, until = np.maximum(k * step, entry), np.minimum((k + 1) * step, leave)
        yield np.maximum(until - begin, 0.0), (start + (0.5 * (begin + until))[:, None] * rays).T[::-1]


def radiance_reference(source: np.ndarray, rays: np.ndarray, start: np.ndarray, step: float = STEP) -> np.ndarray:
    """Light in three colours and transmittance, (N, 4), along rays (N, 4) from `start` (3,).

    source: (Z, Y, X, 4) as of `source`; rays: unit vectors x, y, z and the length of each, cells
    """
    light, passed = np.zeros((len(rays), 3)), np.ones(len(rays))
    for length, where in _segments(source.shape[:3], start, rays[:, :3], rays[:, 3], step):
        there = np.stack([_at(source[..., c], where) for c in range(4)], -1)
        through = np.exp(-there[:, 3] * length)
        going = passed > LEAST
        light[going] += (passed * (1 - through) / np.maximum(there[:, 3], 1e-30))[going, None] * there[going, :3]
        passed[going] *= through[going]
    return np.column_stack([light, passed]).astype(np.float32)


def radiance(source: Any, shape: tuple[int, ...], rays: np.ndarray, start: np.ndarray,
             step: float = STEP) -> np.ndarray:
    """`radiance_reference` on the device, where source is."""
    result = opencl.empty((len(rays), 4))
    _program().radiance((_rows(len(rays)),), (ROW,), source, opencl.to_device(rays.astype(np.float32)), result,
                        *_int32(len(rays), *shape[::-1]), *_float32(*start, step))
    return np.asarray(result.get())


def shade_reference(sigma: np.ndarray, places: np.ndarray, points: np.ndarray, step: float = STEP) -> np.ndarray:
    """Share (N,) of the light of `points` (P, 3) that reaches `places` (N, 3); in cells, x, y, z."""
    shares = np.zeros(len(places))
    for point in points:
        offset = point - places
        distance = np.linalg.norm(offset, axis=-1)
        depth = np.zeros(len(places))
        for length, where in _segments(sigma.shape, places, offset / distance[:, None], distance, step):
            depth += length * _at(sigma, where)
        shares += np.exp(-depth) / len(points)
    return shares.astype(np.float32)


def shade(sigma: Any, shape: tuple[int, ...], places: np.ndarray, points: np.ndarray, step: float = STEP) -> np.ndarray:
    """`shade_reference` on the device, where sigma is."""
    result = opencl.empty(len(places))
    four = [opencl.to_device(np.pad(values, ((0, 0), (0, 1))).astype(np.float32)) for values in (places, points)]
    _program().shade((_rows(len(places)),), (ROW,), sigma, *four, result,
                     *_int32(len(places), len(points), *shape[::-1]), *_float32(step))
    return np.asarray(result.get())


# -- the picture ------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class EmptyStudio:
    """The surroundings of the smoke, as the camera sees them without smoke.

    eye       (3,) position of the camera, world units
    rays      (h, w, 3) from it through the pixels, of any length
    distance  (h, w) to the surface that a ray meets
    layers    (lamps + 1, h, w, 3) the picture by the light of each lamp, then by all other light
    border    (6, 4, 3) the light that reaches the middle of the studio from each of `directions`, without
              what comes straight from the lamps
    """

    eye: np.ndarray
    rays: np.ndarray
    distance: np.ndarray
    layers: np.ndarray
    border: np.ndarray

    @property
    def light(self) -> np.ndarray:
        """The sum of the layers (h, w, 3)."""
        return np.asarray(self.layers.sum(axis=0))


@dataclass(frozen=True)
class Seen:
    """What the camera sees of smoke.

    smoke   (h, w, 3) the light that the smoke scatters to the camera
    passed  (h, w) transmittance of the smoke in front of the surfaces
    shares  (lamps, h, w) share of each lamp's light that reaches the surface behind a pixel
    """

    smoke: np.ndarray
    passed: np.ndarray
    shares: np.ndarray

    def picture(self, empty: EmptyStudio) -> np.ndarray:
        """The smoke in the studio, linear light (h, w, 3) float32."""
        lit = (self.shares[..., None] * empty.layers[:-1]).sum(axis=0) + empty.layers[-1]
        return np.asarray(self.passed[..., None] * lit + self.smoke, np.float32)


def seen(grid: Grid, lamps: Sequence[Lamp], medium: Medium, empty: EmptyStudio) -> Seen:
    """What a camera sees of smoke in a studio; shadows are soft, from many points of each lamp."""
    height, width = empty.distance.shape
    shape = grid.sigma.shape
    length = np.linalg.norm(empty.rays, axis=-1, keepdims=True)
    unit = (empty.rays / length).reshape(-1, 3)
    rays = np.column_stack([unit, empty.distance.reshape(-1) / grid.voxel_size])
    marched = radiance(source(grid, lamps, empty.eye, medium, empty.border), shape, rays, grid.cells(empty.eye))
    surface = (empty.eye + empty.distance[..., None] * empty.rays / length).reshape(-1, 3)
    # shadows of large lamps are soft: half the resolution is enough
    sigma, _, half = _halved(opencl.to_device(grid.sigma), shape, opencl.zeros((*shape, 4)), 1.0)
    coarse = Grid(grid.sigma, 2 * grid.voxel_size, grid.origin + 0.5 * grid.voxel_size)
    shares = [shade(sigma, half, coarse.cells(surface), coarse.cells(lamp.points(SHADE_ACROSS))) for lamp in lamps]
    marched = marched.reshape(height, width, 4)
    return Seen(marched[..., :3], marched[..., 3], np.array(shares, np.float32).reshape(len(lamps), height, width))
