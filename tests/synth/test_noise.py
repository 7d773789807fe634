"""Curl noise: free of divergence, seeded, continuous in time."""

import numpy as np
import pytest

from synth.noise import curl, curl_noise, gradient_noise
from synth.projection import divergence


def test_lattice_points_are_zero_and_the_rest_is_bounded_and_smooth():
    lattice = np.arange(-5.0, 6.0)
    np.testing.assert_array_equal(gradient_noise([lattice, lattice[:, None]], 1), 0.0)
    x = np.linspace(-7, 7, 14001)
    n = gradient_noise([x, np.full(1, 0.3)], 1)
    assert 0.15 < n.std() < 0.4 and np.abs(n).max() <= 1.0
    assert np.abs(np.diff(n)).max() < 4e-3  # no jump at a lattice line
    assert np.abs(np.diff(n, 2)).max() < 4e-5  # and no kink


def test_the_known_values_of_seed_7():
    """The hash must not change under a new NumPy or machine: pictures hang on it."""
    points = [np.array([0.25, -3.6, 1000.5]), np.array([0.5, 2.1, -7.75])]
    known = [-0.32028939038834975, 0.28968646294522504, -0.21847745130308815]
    np.testing.assert_allclose(gradient_noise(points, 7), known, rtol=1e-9)


def test_seeds_and_dimensions_are_independent():
    x = np.arange(20000) / 7.3
    a, b = gradient_noise([x], 1), gradient_noise([x], 2)
    assert abs(np.corrcoef(a, b)[0, 1]) < 0.05
    p = (x[:200], x[:200, None])
    swapped = gradient_noise([p[1], p[0]], 1)
    assert abs(np.corrcoef(gradient_noise(list(p), 1).ravel(), swapped.ravel())[0, 1]) < 0.1


@pytest.mark.parametrize("shape", [(32, 48), (12, 16, 9)])
def test_the_flow_is_divergence_free_has_the_speed_and_moves_slowly(shape):
    first, second = curl_noise(shape, 2, seed=5, speed=1.5)
    assert first.shape == (*shape, len(shape)) and first.dtype == np.float32
    inner = (slice(1, -1),) * len(shape)
    assert np.abs(divergence(first)[inner]).max() < 1e-6
    assert np.sqrt((first**2).sum(-1).mean()) == pytest.approx(1.5, rel=1e-5)
    change = np.abs(second - first).max()
    assert 0 < change < 0.5


def test_frames_repeat_bit_for_bit_and_differ_by_seed():
    a, b = (list(curl_noise((16, 16), 3, seed=1)) for _ in range(2))
    np.testing.assert_array_equal(a, b)
    assert not np.array_equal(a[0], next(curl_noise((16, 16), 1, seed=2)))


def test_the_curl_of_a_bowl_is_a_rotation():
    y, x = np.mgrid[-3:4, -4:5].astype(float)
    v = curl(-0.5 * (x * x + y * y)[None])
    np.testing.assert_allclose(v[..., 0], -y[1:-1, 1:-1])
    np.testing.assert_allclose(v[..., 1], x[1:-1, 1:-1])
    volume = np.zeros((3, 5, 7, 9))
    volume[2] = -0.5 * (x * x + y * y)
    np.testing.assert_allclose(curl(volume)[1], np.concatenate([v, 0 * v[..., :1]], -1))


@pytest.mark.parametrize("wrong", [{"octaves": 0}, {"length": 0.0}, {"period": -1.0}])
def test_refusals(wrong):
    with pytest.raises(ValueError, match="curl noise needs"):
        next(curl_noise((8, 8), 1, seed=0, **wrong))
