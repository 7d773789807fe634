"""The motion of a volume in pixels."""

import numpy as np

from render.screen_motion import screen_motion
from render.studio import Camera

CAMERA = Camera((0.0, 0.0, 20.0), (0.0, 0.0, 0.0), 6.0)


def test_a_ball_moves_as_the_camera_sees_it() -> None:
    """One cell a frame to the right and two up, away from the camera too, which shows nothing."""
    z, y, x = np.mgrid[:16, :16, :16] - 7.5
    ball = (x**2 + y**2 + z**2 < 25).astype(np.float32)
    velocity = np.broadcast_to(np.float32([1, 2, -3]), (*ball.shape, 3))
    found = screen_motion(ball, velocity, 0.05, (-0.375, -0.375, -0.375), CAMERA, 64, 48)
    pixels = 48 * 0.05 / (2 * 20 * np.tan(np.radians(3)))
    np.testing.assert_allclose(found[24, 32], [pixels, 2 * pixels], rtol=1e-3)
    assert not found[2, 2].any()


def test_what_is_denser_counts_for_more() -> None:
    density = np.ones((2, 8, 8), np.float32)
    density[0] = 3.0
    velocity = np.zeros((2, 8, 8, 3), np.float32)
    velocity[0, ..., 0] = 1.0
    found = screen_motion(density, velocity, 0.1, (-0.35, -0.35, -0.05), CAMERA, 40, 30)
    alone = screen_motion(density, np.full((2, 8, 8, 3), np.float32(1.0)), 0.1, (-0.35, -0.35, -0.05), CAMERA, 40, 30)
    # on a ray that ends in both layers three quarters are of the dense one
    assert abs(found[15, 20, 0] / alone[15, 20, 0] - 0.75) < 0.1
