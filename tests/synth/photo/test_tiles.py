"""Tiles: they repeat, they are normal, their features have the stated size."""

import numpy as np
import pytest

from synth.photo.tiles import cells, enlarged, lace, noise, rng, smooth_step


@pytest.mark.parametrize("tile", [noise((48, 80), rng(1), 12.0), noise((48, 80), rng(1), (20.0, 6.0), falloff=2),
                                  lace(64, rng(2), 14.0)])
def test_a_tile_is_normal_and_has_no_seam(tile):
    assert tile.dtype == np.float32 and abs(tile.mean()) < 1e-5 and abs(tile.std() - 1) < 1e-4
    for axis in (0, 1):
        steps = np.abs(np.roll(tile, -1, axis) - tile).mean(1 - axis)
        assert steps[-1] < 1.7 * steps[:-1].mean(), "its two sides do not meet"


def test_large_features_are_as_large_as_stated():
    """Along x four times those along y: so are the slopes along y."""
    tile = noise((256, 256), rng(3), (64.0, 16.0), falloff=3)
    slope_y, slope_x = np.gradient(tile)
    assert slope_y.std() / slope_x.std() == pytest.approx(4, rel=0.3)


def test_the_key_decides():
    same, other = noise((32, 32), rng(4, 1), 8.0), noise((32, 32), rng(4, 2), 8.0)
    np.testing.assert_array_equal(same, noise((32, 32), rng(4, 1), 8.0))
    assert np.abs(same - other).mean() > 0.3


def test_cells_are_those_of_the_nearest_points_across_the_border():
    first, second = cells((9, 14), rng(5), 6)
    points = rng(5).random((6, 2)) * (14, 9)
    y, x = np.mgrid[:9, :14] + 0.5
    d = np.abs(np.stack([x, y], -1)[..., None, :] - points)
    d = np.minimum(d, (14, 9) - d)
    nearest = np.sort(np.hypot(d[..., 0], d[..., 1]), -1)
    np.testing.assert_allclose(first, nearest[..., 0], atol=1e-5)
    np.testing.assert_allclose(second, nearest[..., 1], atol=1e-5)


def test_the_walls_of_lace_are_bright_and_thin():
    """Less lies above the mean than below, and farther from it; noise is the same both ways."""
    laces = np.mean([(lace(128, rng(seed), 16.0) ** 3).mean() for seed in range(8)])
    noises = np.mean([(noise((128, 128), rng(seed), 8.0) ** 3).mean() for seed in range(8)])
    assert laces > 0.1 > 3 * abs(noises)


def test_what_is_enlarged_keeps_constants_and_slopes():
    np.testing.assert_array_equal(enlarged(np.full((2, 3, 5), 1.5, np.float32), 4, (11, 19)), np.full((2, 11, 19), 1.5))
    ramp = np.broadcast_to(np.arange(6, dtype=np.float32), (3, 6))
    np.testing.assert_allclose(np.diff(enlarged(ramp, 2, (6, 12)), axis=1)[:, 1:-1], 0.5, atol=1e-6)


def test_a_smooth_step_is_level_at_its_ends():
    np.testing.assert_allclose(smooth_step(1, 3, np.array([0, 1, 2, 3, 4])), [0, 0, 0.5, 1, 1])
    assert smooth_step(1, 3, np.array(1.02)) < 0.001
