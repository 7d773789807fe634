"""Noise out of path-traced smoke: each window of the picture is fitted to guides that have no noise.

The guides are a plain march through the same grid (how much is seen, how much of each light arrives after one
scattering) and what the studio looks like without smoke. Within a small window path-traced light is close to
a linear function of them, so a weighted least-squares fit keeps every edge the guides know and averages the
rest (first-order regression: Moon et al. 2014, Bitterli et al. 2016). It is an approximation: a pattern that
no guide shows, such as the shadow of one wisp deep inside the smoke, is blurred to the size of the window.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from render import studio

SMOKE_WINDOW = 6.0  # standard deviation of the window where smoke is seen, pixels, at WINDOW_SPP paths
WINDOW_SPP = 8  # with more paths per pixel windows shrink: the picture tends to the path-traced one
SMALLEST_WINDOW = 2.0
FLOOR_WINDOW = 16.0  # where only the floor and its soft shadows are
BOWL_WINDOW = 3.0  # on the empty stage near the bowl, whose own shadow no guide knows
LAMPS = (studio.KEY, studio.RIM)
RIDGE = 1e-3  # of a guide's variance in the whole picture


def depth_towards(sigma: np.ndarray, towards: tuple[float, float, float]) -> np.ndarray:
    """Optical depth (Z, Y, X) from each cell to the border of the grid along the unit vector (x, y, z).

    sigma: (Z, Y, X) float32, extinction per cell. As `sheet.depth_towards`, one dimension up.
    """
    main = int(np.argmax(np.abs(towards)))
    axis = 2 - main  # of the array: its axes are z, y, x
    along = np.moveaxis(sigma, axis, 0)
    forward = towards[main] > 0.0
    along = along if forward else along[::-1]
    step = 1.0 / abs(towards[main])
    slopes = [towards[2 - a] * step for a in range(3) if a != axis]
    depth = np.zeros_like(along)
    for row in range(len(along) - 2, -1, -1):
        passed = depth[row + 1] + 0.5 * step * along[row + 1]
        moved = ndimage.shift(passed, [-s for s in slopes], order=1, mode="grid-constant",
                               prefilter=False)
        depth[row] = moved + 0.5 * step * along[row]
    return np.moveaxis(depth if forward else depth[::-1], 0, axis)


def _towards(box: studio.Softbox, centre: np.ndarray) -> tuple[float, float, float]:
    away = np.array(box.position) - centre
    x, y, z = away / np.linalg.norm(away)
    return float(x), float(y), float(z)


def view_rays(camera: studio.Camera, width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    """Origin (3,) and directions (height, width, 3), not unit vectors, of the rays through the pixels."""
    position = np.array(camera.position, np.float64)
    ahead = np.array(camera.target) - position
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    up = np.cross(right, ahead)
    half = np.tan(np.radians(camera.fov) / 2)
    y = half * (1.0 - 2.0 * (np.arange(height) + 0.5) / height)
    x = half * (2.0 * (np.arange(width) + 0.5) / width - 1.0) * (width / height)
    return position, ahead + x[None, :, None] * right + y[:, None, None] * up


@dataclass(frozen=True)
class Grid:
    """sigma: (Z, Y, X) float32, extinction per cell; origin: centre of cell (0, 0, 0), order x, y, z."""

    sigma: np.ndarray
    voxel_size: float
    origin: np.ndarray

    def crossed(self, start: np.ndarray, rays: np.ndarray) -> np.ndarray:
        """Which rays (N, 3) from `start` (N, 3) enter the grid's box; bool (N,)."""
        low = self.origin - self.voxel_size
        high = self.origin + self.voxel_size * np.array(self.sigma.shape[::-1])
        safe = np.where(rays == 0.0, 1e-12, rays)
        to_low, to_high = (low - start) / safe, (high - start) / safe
        entry = np.minimum(to_low, to_high).max(axis=1)
        leave = np.maximum(to_low, to_high).min(axis=1)
        return leave > np.maximum(entry, 0.0)


def march(grid: Grid, start: np.ndarray, rays: np.ndarray, end: np.ndarray,
          lights: Sequence[np.ndarray] = ()) -> np.ndarray:
    """Follows rays through a grid: (N, 1 + lights) float32: the share of light passed, then each light seen.

    start, rays: (N, 3), world units, no ray parallel to the z-planes; end: (N,), where a ray meets a surface,
    in lengths of `rays`; lights: (Z, Y, X) each, the light that arrives in a cell. The rays step from one
    z-plane to the next.
    """
    result = np.zeros((len(rays), 1 + len(lights)), np.float32)
    result[:, 0] = 1.0
    inside = grid.crossed(start, rays)
    start, rays, end = start[inside], rays[inside], end[inside]
    passed, seen = np.ones(len(rays)), np.zeros((len(rays), len(lights)))
    stretch = np.linalg.norm(rays, axis=1) / np.abs(rays[:, 2])
    order = range(len(grid.sigma))
    for number in order if not len(rays) or rays[0, 2] > 0.0 else reversed(order):
        if not grid.sigma[number].any():
            continue
        way = (grid.origin[2] + number * grid.voxel_size - start[:, 2]) / rays[:, 2]
        at = [(start[:, a] + way * rays[:, a] - grid.origin[a]) / grid.voxel_size for a in (1, 0)]
        depth = stretch * ndimage.map_coordinates(grid.sigma[number], at, order=1, prefilter=False)
        through = np.exp(-depth * ((way > 0.0) & (way < end)))
        absorbed = passed * (1.0 - through)
        for channel, light in enumerate(lights):
            there = ndimage.map_coordinates(light[number], at, order=1, prefilter=False, mode="nearest")
            seen[:, channel] += absorbed * there
        passed *= through
    result[inside] = np.column_stack([passed, seen])
    return result


@dataclass(frozen=True)
class Stage:
    """The studio without smoke, as the camera sees it: light (h, w, 3), distance (h, w) to its surfaces."""

    light: np.ndarray
    distance: np.ndarray


def guides(grid: Grid, camera: studio.Camera, stage: Stage) -> np.ndarray:
    """What the smoke looks like but for its multiple scattering: (h, w, 9) float32, without noise.

    Share of light that passes the smoke; key, rim and sky after one scattering in it; the stage seen through
    it, in three colours, and in the smoke's shadow from key and from rim.
    """
    height, width = stage.distance.shape
    position, rays = view_rays(camera, width, height)
    rays = rays.reshape(-1, 3)
    start = np.broadcast_to(position, rays.shape)
    end = stage.distance.reshape(-1) / np.linalg.norm(rays, axis=1)
    centre = grid.origin + 0.5 * grid.voxel_size * (np.array(grid.sigma.shape[::-1]) - 1)
    # scattered light reaches deeper than unscattered: half, for the sky a quarter, of the extinction
    key, rim = (np.exp(-0.5 * depth_towards(grid.sigma, _towards(box, centre))) for box in LAMPS)
    sky = np.exp(-0.25 * depth_towards(grid.sigma, (0.0, 1.0, 0.0)))
    smoke = march(grid, start, rays, end, (key, rim, sky))
    behind = smoke[:, :1] * stage.light.reshape(-1, 3)
    surface = start + end[:, None] * rays
    brightness = behind.mean(axis=1)
    shadows = [brightness * march(grid, surface, np.array(box.position) - surface, np.ones(len(rays)))[:, 0]
               for box in LAMPS]
    return np.column_stack([smoke, behind, *shadows]).reshape(height, width, -1).astype(np.float32)


def regressed(noisy: np.ndarray, guides: np.ndarray, window: float) -> np.ndarray:
    """`noisy` (h, w, 3), near each pixel, as a linear function of `guides` (h, w, G); (h, w, 3) float32.

    One fit for the whole picture, then, of what that leaves over, one by least squares over a Gaussian
    window (its deviation in pixels) about each pixel. RIDGE holds the second to zero where a guide hardly
    changes, so that it finds no pattern in noise. A guide's own noise would pass on: it must have none.
    """
    height, width, count = guides.shape
    spread = guides.std(axis=(0, 1), dtype=np.float64)
    scaled = ((guides - guides.mean(axis=(0, 1))) / np.maximum(spread, 1e-12)).astype(np.float64)
    # einsum, not matmul: a BLAS adds up in another order on another number of threads
    gram = np.einsum("hwi,hwj->ij", scaled, scaled) / (height * width) + 1e-6 * np.eye(count)
    global_slopes = np.linalg.solve(gram, np.einsum("hwi,hwc->ic", scaled, noisy) / (height * width))
    whole = np.einsum("hwi,ic->hwc", scaled, global_slopes)
    left = noisy - whole

    def near(values: np.ndarray) -> np.ndarray:
        return ndimage.gaussian_filter(values, window, mode="nearest", truncate=2.5)

    mean = np.stack([near(scaled[..., i]) for i in range(count)], axis=-1)
    level = np.stack([near(left[..., c]) for c in range(3)], axis=-1)
    square = np.empty((height, width, count, count))
    mixed = np.empty((height, width, count, 3))
    for i in range(count):
        for j in range(i, count):
            product = near(scaled[..., i] * scaled[..., j])
            square[..., i, j] = square[..., j, i] = product - mean[..., i] * mean[..., j]
        for c in range(3):
            mixed[..., i, c] = near(scaled[..., i] * left[..., c]) - mean[..., i] * level[..., c]
    square[..., range(count), range(count)] += RIDGE
    slopes = np.linalg.solve(square, mixed)
    fitted = whole + level + np.einsum("hwi,hwic->hwc", scaled - mean, slopes)
    return np.maximum(fitted, 0.0).astype(np.float32)


def quiet_stage(noisy: np.ndarray, distance: np.ndarray, bowl: np.ndarray) -> Stage:
    """The empty stage from its path-traced light (h, w, 3), distance (h, w) and bowl (h, w, 3).

    bowl: the bowl's normals, zero where the backdrop is seen.
    """
    guides = np.dstack([bowl, np.abs(bowl).sum(axis=2) > 0.0, np.log(distance)])
    share = _near(guides[..., 3], 8 * BOWL_WINDOW)
    light = share * regressed(noisy, guides, BOWL_WINDOW)
    light += (1.0 - share) * regressed(noisy, guides, FLOOR_WINDOW)
    return Stage(light, distance)


def _near(mask: np.ndarray, reach: float) -> np.ndarray:
    """1 (h, w, 1) where `mask` (h, w) is set or nearly so within `reach` pixels, fading to 0 beyond."""
    spread = ndimage.maximum_filter(mask, int(reach))
    return ndimage.gaussian_filter((spread > 0.01).astype(np.float32), 0.5 * reach)[..., None]


def denoised(noisy: np.ndarray, spp: int, grid: Grid, camera: studio.Camera, stage: Stage) -> np.ndarray:
    """`noisy` (h, w, 3), a grid on a stage traced with `spp` paths per pixel, without its noise; float32.

    Small windows where smoke is seen, large ones on the floor, whose shadows are soft and its noise coarse.
    """
    known = guides(grid, camera, stage)
    shrunk = (WINDOW_SPP / max(spp, WINDOW_SPP)) ** 0.25  # half as wide for a quarter of the variance
    smoke = regressed(noisy, known, max(SMOKE_WINDOW * shrunk, SMALLEST_WINDOW))
    share = _near(1.0 - known[..., 0], 2 * SMOKE_WINDOW)
    return share * smoke + (1.0 - share) * regressed(noisy, known[..., 4:], FLOOR_WINDOW * shrunk)
