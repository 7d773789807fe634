"""Droplets fly as stated; the kernel is its reference; the bits do not depend on order."""

import numpy as np
import pytest

from synth.photo.drops import MOST, UNIT, Drops, joined, made, streaks, streaks_reference
from synth.photo.tiles import rng

SHAPE = (31, 45)
FRAMES = 12


def some(n=40, seed=1):
    random = rng(seed)
    return made(n, x=random.uniform(-3, 48, n), y=random.uniform(-3, 34, n), vx=random.normal(0, 2, n),
                vy=random.normal(0, 3, n), gx=0.02, gy=-0.4, drag=0.1, birth=random.uniform(-20, 40, n),
                life=random.uniform(1, 20, n), weight=random.gamma(1, 1, n), fade=0.5)


def one(**values):
    still = {"vx": 0, "vy": 0, "gx": 0, "gy": 0, "drag": 1e-4, "birth": 0, "life": 12, "weight": 1, "fade": 1e-6}
    return made(1, **still | values)


def centre(light):
    y, x = np.mgrid[: light.shape[0], : light.shape[1]]
    return np.array([(light * x).sum(), (light * y).sum()]) / light.sum()


def test_the_kernel_is_the_reference():
    # a sample of a streak may round to the other side of a step of light
    close = 4 * MOST / UNIT
    np.testing.assert_allclose(streaks(some(), FRAMES, SHAPE, 0.6), streaks_reference(some(), FRAMES, SHAPE, 0.6),
                               atol=close, rtol=0)


def test_a_droplet_moves_at_its_velocity():
    """Without gravity and drag: its centre moves by the velocity, and half an exposure behind it."""
    light = streaks(one(x=5, y=20, vx=2.5, vy=-1.25), FRAMES, SHAPE, 0.5)
    for t in range(2, 10):
        np.testing.assert_allclose(centre(light[t]), [5 + 2.5 * (t - 0.25), 20 - 1.25 * (t - 0.25)], atol=0.03)
        assert light[t].sum() == pytest.approx(1, abs=0.05), "its light is its weight"


def test_a_droplet_reaches_its_terminal_speed():
    falling = one(x=3, y=0, gy=-0.5, drag=0.25)
    assert falling.velocity(np.float32(40))[1] == pytest.approx(-2, rel=1e-3)
    ages = np.linspace(0, 30, 301)
    heights = np.array([falling.path(age)[1][0] for age in ages])
    speeds = np.array([falling.velocity(age)[1][0] for age in ages])
    np.testing.assert_allclose(np.gradient(heights, ages)[1:-1], speeds[1:-1], atol=1e-3)


def test_births_a_loop_apart_are_one():
    late = some()._replace(birth=some().birth + np.float32(3 * FRAMES))
    np.testing.assert_allclose(streaks(some(), FRAMES, SHAPE, 0.6), streaks(late, FRAMES, SHAPE, 0.6), atol=0.05)


def test_a_life_longer_than_the_loop_is_seen_twice():
    light = streaks(one(x=10, y=10, vx=0.5, life=20), FRAMES, SHAPE, 0.1)
    assert light[5].sum() == pytest.approx(2, abs=0.05) and light[10].sum() == pytest.approx(1, abs=0.05)


def test_the_order_of_droplets_does_not_matter():
    backwards = Drops(*(column[::-1] for column in some()))
    np.testing.assert_array_equal(streaks(some(), FRAMES, SHAPE, 0.6), streaks(backwards, FRAMES, SHAPE, 0.6))


def test_groups_are_joined():
    both = streaks(joined([some(seed=1), some(seed=2)]), FRAMES, SHAPE, 0.6)
    np.testing.assert_array_equal(both, streaks(some(seed=1), FRAMES, SHAPE, 0.6)
                                  + streaks(some(seed=2), FRAMES, SHAPE, 0.6))
