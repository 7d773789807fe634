"""The motion of a volume as the camera sees it, in pixels: the truth for motion that is estimated from pictures."""

from __future__ import annotations

import numpy as np

from render import march, studio
from synth import opencl

THIN = 1e-3  # extinction per cell: so thin that what is behind counts as what is in front
LEAST = 0.02  # of the most that is seen at a pixel: where less is seen, nothing moves


def screen_motion(density: np.ndarray, velocity: np.ndarray, voxel_size: float, origin: tuple[float, float, float],
                  camera: studio.Camera, width: int, height: int) -> np.ndarray:
    """Mean velocity along the ray of each pixel, weighted by density: (height, width, 2) float32, pixels per frame.

    density   (Z, Y, X) float32; velocity (Z, Y, X, 3), cells per frame
    origin    centre of cell (0, 0, 0), world units; voxel_size: edge of a cell
    Top row first; components to the right and upwards. Zero where hardly anything is seen. The whole volume is taken
    to be at the distance of the camera's target.
    """
    right, up, _ = camera.axes
    across = np.stack([velocity @ right, velocity @ up], -1) * density[..., None]
    source = np.concatenate([across, density[..., None], np.full((*density.shape, 1), THIN)], -1).astype(np.float32)
    rays = camera.rays(width, height).reshape(-1, 3)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    start = (np.array(camera.position) - np.array(origin)) / voxel_size
    ends = np.full(len(rays), 2 * camera.distance / voxel_size)
    found = march.radiance(opencl.to_device(source), density.shape, np.column_stack([rays, ends]), start)
    seen = found[:, 2]
    pixels = height * voxel_size / (2 * camera.distance * np.tan(np.radians(camera.fov) / 2))  # of a cell
    motion = pixels * found[:, :2] / np.maximum(seen, 1e-12)[:, None]
    return np.where((seen > LEAST * seen.max())[:, None], motion, 0).astype(np.float32).reshape(height, width, 2)
