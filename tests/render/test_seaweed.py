"""Seaweed under water: bits repeat, and blades fade with distance."""

import numpy as np
import pytest

from render import seaweed, studio

CAMERA = studio.Camera(position=(0.0, 0.5, 3.0), target=(0.0, 0.5, 0.0), fov=30.0)
SMALL = studio.Shot(width=32, height=24, spp=8, camera=CAMERA)


def board(z: float, size: float = 0.3) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """An upright white square at z."""
    corners = np.array([[-1, 0, 0], [1, 0, 0], [1, 2, 0], [-1, 2, 0]], np.float32) * size + [0, 0.2, z]
    return corners.astype(np.float32), np.array([[0, 1, 2], [0, 2, 3]]), np.full((4, 3), 255, np.uint8)


def test_a_picture_repeats_and_the_distance_fades_into_the_water() -> None:
    near = seaweed.picture(*board(1.0), shot=SMALL)
    assert near.shape == (24, 32, 3) and np.isfinite(near).all() and near.min() >= 0
    assert np.array_equal(near, seaweed.picture(*board(1.0), shot=SMALL))
    nothing = seaweed.picture(*board(-60.0), shot=SMALL)
    far = seaweed.picture(*board(-20.0, 3.0), shot=SMALL)
    middle = np.s_[8:12, 14:18]
    assert np.abs(near[middle] - nothing[middle]).max() > 0.05
    # paths to another mesh draw other numbers, so pixels of few paths agree on average only
    assert far[middle].mean((0, 1)) == pytest.approx(nothing[middle].mean((0, 1)), rel=0.1)
    red, blue = (near[middle].mean((0, 1)) / nothing[middle].mean((0, 1)))[[0, 2]]
    assert red > blue  # the water is blue, the board is white
