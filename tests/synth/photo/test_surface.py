"""Running water: stones stand, the velocity is the current's, foam follows `white`, light shows slopes."""

import numpy as np
import pytest

from synth.photo.surface import lit_along, reflected, river, white_water

FRAMES, SIZE = 32, (160, 120)


@pytest.fixture(scope="module")
def flowing():
    return river(5, FRAMES, SIZE, direction=2.0, speed=3.0, stones=5)


def test_stones_stand_still_and_show_no_water(flowing):
    stone = flowing.coverage < 0.01
    assert 200 < stone.sum() < 0.4 * stone.size
    assert not flowing.velocity[stone].any()
    assert np.median(flowing.luma[:, stone].std(0)) < 1


def test_the_velocity_is_that_of_the_current(flowing):
    """3 pixels per frame at 240 rows are 1.5 at 120."""
    v = flowing.velocity[flowing.coverage > 0.99]
    np.testing.assert_allclose(v.mean(0), 1.5 * np.array([np.cos(2.0), np.sin(2.0)]), atol=0.2)


def test_white_water_is_brighter_the_more_of_it_foams():
    little, much = (white_water(6, FRAMES, SIZE, stones=0, white=white).luma.mean() for white in (0.2, 0.9))
    assert much > 1.15 * little


def test_what_faces_the_light_is_brighter():
    slope = np.linspace(-0.6, 0.6, 9)
    grey = reflected(-slope, 0 * slope, 0.15, 0.0)  # light from the right; a surface that falls to the right faces it
    assert (np.diff(grey) >= 0).all() and grey[-1] > 3 * grey[0]
    assert grey.min() > 0 and grey.max() < 1.1


@pytest.mark.parametrize("direction", np.linspace(-3, 3, 7))
def test_the_light_comes_from_above_and_along_the_waves(direction):
    towards = lit_along(direction)
    assert np.sin(towards) >= 0 and abs(np.cos(towards - direction)) > 0.9
