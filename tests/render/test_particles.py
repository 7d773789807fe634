"""The river: position and opacity of foam, stones and their shadows."""

import numpy as np
import pytest

from render import particles
from synth import obstacle

DOMAIN = (4 / 3, 1.0)
CLEAR = np.ones((60, 80), np.float32)
DARK = np.zeros((60, 80, 3), np.float32)


def drawn(position, velocity, age=30, back=DARK, open_water=CLEAR, streak=0.0):
    """One or more particles on a picture of 80 x 60."""
    position, velocity = np.float32(np.atleast_2d(position)), np.float32(np.atleast_2d(velocity))
    ages = np.full(len(position), age, np.int32)
    return particles.river(position, velocity, ages, 60, back, open_water, DOMAIN, streak, 0.5)


@pytest.mark.parametrize(("at", "row", "column"), [
    ((0.0, 0.5), 30, 40), ((-0.6, 0.1), 54, 4), ((0.5, 0.9), 6, 70),
])
def test_a_particle_is_drawn_at_its_position(at, row, column):
    light = drawn(at, (0.3, 0.0)).sum(-1)
    y, x = np.mgrid[:60, :80] + 0.5
    assert light.sum() > 0
    assert (light * y).sum() / light.sum() == pytest.approx(row, abs=0.05)
    assert (light * x).sum() / light.sum() == pytest.approx(column, abs=0.05)


def test_a_streak_lies_behind_its_particle():
    light = drawn((0.0, 0.5), (0.5, 0.25), streak=0.5).sum(-1)
    rows, columns = np.nonzero(light > 0.02 * light.max())
    assert columns.max() <= 41 and columns.min() < 30  # it came from the left
    assert rows.min() >= 29 and rows.max() > 33  # and from below


def test_it_appears_and_vanishes_softly_and_faster_is_whiter():
    of_age = [drawn((0.0, 0.5), (0.3, 0.0), age).sum() for age in (0, 3, 30, 56, 59)]
    assert of_age[0] < of_age[1] < of_age[2] > of_age[3] > of_age[4] > 0
    slow, fast = particles.foam_colour(np.array([0.1, 1.0]))
    assert fast.min() > 0.85 and slow.max() < 0.3 and slow[2] > 2 * slow[0]
    np.testing.assert_allclose(particles.foam_colour(np.array(7.0)), fast)


def test_nothing_is_drawn_over_a_stone_and_shadow_falls_on_foam():
    behind = np.where(np.arange(80) < 40, 1.0, 0.0)[None] * CLEAR
    many = np.stack(np.meshgrid(np.linspace(-0.6, 0.6, 60), np.linspace(0.05, 0.95, 40)), -1).reshape(-1, 2)
    light = drawn(many, np.full((len(many), 2), 0.4), open_water=behind.astype(np.float32))
    assert light[4:-4, 6:39].min() > 0 and not light[:, 41:].any()
    shaded = np.full((60, 80, 3), 0.05, np.float32)
    shaded[20:40] = 0.0
    foam = drawn(many, np.full((len(many), 2), 0.4), back=shaded)
    assert foam[22:38].mean() < 0.5 * foam[:18].mean()


def test_no_particle_leaves_the_river_as_it_was():
    back = np.random.Generator(np.random.Philox(key=1)).random((60, 80, 3), np.float32)
    assert np.array_equal(drawn((9.0, 9.0), (0.1, 0.0), back=back), back)


def test_a_stone_covers_its_share_of_each_pixel():
    distance = obstacle.ball((30, 40), (0.1, 0.6), 0.2).distance
    open_water = particles.shown(distance, 80)
    assert open_water.shape == (60, 80)
    assert (1 - open_water).sum() == pytest.approx(np.pi * 12**2, rel=0.02)
    assert open_water[24, 46] == 0 and open_water[50, 46] == 1  # y up: it is above the middle


def test_a_stone_rises_from_its_waterline():
    depth = np.array([[0.0, 0.001, 0.02, 0.06, 0.1]])
    height = particles.relief(depth, np.zeros((1, 5)), np.zeros((1, 5)), 1)
    assert height[0, 0] == 0 and (np.diff(height[0]) > 0).all()


def test_the_riverbed_shows_a_lit_stone_its_shadow_and_dark_water():
    distance = obstacle.ball((30, 40), (0.0, 0.5), 0.2).distance
    back = particles.riverbed(distance, 40, 16, 1)
    assert back.shape == (30, 40, 3) and np.isfinite(back).all() and back.min() >= 0
    grey = back.mean(-1)
    water, stone = grey[2:6, 2:6].mean(), grey[12:18, 17:23].mean()
    assert stone > 3 * water
    lower_right, upper_left = grey[20:22, 24:26].mean(), grey[8:10, 14:16].mean()
    assert lower_right < 0.7 * upper_left  # away from the sun
    assert np.array_equal(back, particles.riverbed(distance, 40, 16, 1))
