"""A body for smoke in the plane: known sections, the pattern from the front, symmetry, limits."""

import numpy as np
import pytest

from synth.motion.inflate import inflate, layers


def strip(width, shape=(40, 201)):
    D = np.zeros(shape, np.float32)
    middle = shape[1] // 2
    D[:, middle - width // 2 : middle + width // 2 + 1] = 1.0
    return D


@pytest.mark.parametrize("width", [5, 9, 21, 41])
def test_a_thread_is_about_as_deep_as_wide_whatever_its_width(width):
    section = inflate(strip(width, (400, 301)), 0.25)[:, 200]
    assert section.sum(0).max() == pytest.approx(0.8 * width, abs=0.05 * width + 0.5)
    profile = section.sum(0)[150 : 150 + width // 2 + 1]
    assert (np.diff(profile) < 0).all()  # it thins out towards its edge
    assert profile[-1] < 0.5 * profile[0]


def test_wide_smoke_levels_off_within_the_layers():
    volume = inflate(np.ones((64, 64), np.float32), 0.1)
    assert len(volume) == layers(64, 0.1)
    assert not volume[0].any() and not volume[-1].any()
    np.testing.assert_allclose(volume.sum(0), 2 * 6.4, atol=0.15)


def test_thin_smoke_has_a_body_and_hardly_any_has_none():
    depths = [np.count_nonzero(inflate(np.full((64, 64), level, np.float32), 0.1)[:, 0, 0])
              for level in (1.0, 0.3, 0.01)]
    assert depths[1] > 0.6 * depths[0] and depths[2] <= 3


def test_from_the_front_it_is_the_picture_itself():
    D = np.random.default_rng(0).random((32, 48)).astype(np.float32)
    volume = inflate(D, 0.1)
    assert volume.dtype == np.float32 and volume.shape == (layers(32, 0.1), 32, 48)
    np.testing.assert_array_equal(volume[len(volume) // 2], D)
    np.testing.assert_array_equal(volume, volume[::-1])
    np.testing.assert_array_equal(volume.max(0), D)
    assert not inflate(np.zeros((8, 8), np.float32), 0.3).any()


def test_refusals():
    with pytest.raises(ValueError, match="two cells"):
        inflate(np.zeros((16, 16), np.float32), 0.1)
    with pytest.raises(ValueError, match="and 0"):
        inflate(np.zeros((16, 16), np.float32), 0.6)
    with pytest.raises(ValueError, match="plane"):
        inflate(np.zeros((4, 4, 4), np.float32), 0.5)
