"""Particles: exact paths, never inside a stone, evenly spread, the same every time."""

import numpy as np
import pytest

from synth import obstacle, wake
from synth.particles import CLEAR, Particles, moved, sampled, start


def constant(shape, *v):
    return np.broadcast_to(np.float32(v), (*shape, len(v))).copy()


def placed(*points):
    position = np.float32(points)
    return Particles(position, np.zeros_like(position), np.zeros(len(points), np.int32))


@pytest.mark.parametrize(("shape", "v"), [((9, 12), (1.5, -0.25)), ((5, 9, 12), (1.5, -0.25, 0.5))])
def test_a_steady_wind_carries_by_what_it_says(shape, v):
    F = constant(shape, *v)
    particles = placed([4.0] * len(shape), [3.25] * len(shape))
    after = moved(particles, F, F, 50, 2, 1)
    np.testing.assert_allclose(after.position, particles.position + np.float32(v), atol=1e-5)
    np.testing.assert_allclose(after.velocity, np.broadcast_to(v, after.velocity.shape), atol=1e-6)
    assert (after.age == 1).all() and after.position.dtype == np.float32


def test_no_flow_is_the_identity():
    particles = placed([1.3, 2.7], [5.0, 5.0])
    still = constant((9, 12), 0, 0)
    assert np.array_equal(moved(particles, still, still, 9, 2, 1).position, particles.position)


def test_a_rotation_closes_its_circle():
    y, x = np.mgrid[:41, :41].astype(np.float32) - 20
    turn = 2 * np.pi / 40
    F = np.stack([-turn * y, turn * x], -1)  # linear: sampled exactly
    particles = placed([32.0, 20.0], [20.0, 26.0])
    first = particles.position
    for frame in range(2, 42):
        particles = moved(particles, F, F, 1000, frame, 1)
    np.testing.assert_allclose(particles.position, first, atol=1e-3)


def test_a_motion_that_changes_is_integrated_through_the_frame():
    shape = (9, 30)
    after = moved(placed([4.0, 4.0]), constant(shape, 0, 0), constant(shape, 3, 0), 50, 2, 1)
    np.testing.assert_allclose(after.position, [[5.5, 4.0]], atol=1e-5)


def test_they_fill_the_flow_evenly_and_stay_so():
    F = constant((20, 30), 1.2, 0.0)
    particles = start(F, 6000, 40, 1)
    for frame in range(2, 40):
        particles = moved(particles, F, F, 40, frame, 1)
        count, *_ = np.histogram2d(*particles.position.T, bins=(6, 4), range=((-0.5, 29.5), (-0.5, 19.5)))
        assert count.sum() == 6000 and np.abs(count - 250).max() < 100  # six sigma
    assert particles.age.max() < 40 and len(np.unique(particles.age)) > 15


def test_one_that_leaves_comes_in_where_the_flow_does():
    F = constant((20, 30), -2.0, 0.0)
    after = moved(placed([0.2, 10.0], [15.0, 10.0]), F, F, 50, 2, 1)
    assert after.position[0, 0] > 27 and after.age[1] == 1 and 0 <= after.age[0] < 50
    still = constant((20, 30), 0.0, 0.0)  # nothing comes in: anywhere
    assert np.isfinite(moved(placed([-3.0, 10.0]), still, still, 50, 2, 1).position).all()


@pytest.mark.parametrize("through", [False, True])
def test_none_is_ever_inside_the_stone(through):
    """Past it in its wake, and with a wind that blows right through it."""
    shape = (48, 64)
    distance = obstacle.ball(shape, (1 / 30, 0.5), 0.12).distance
    flow = [constant(shape, -2.0, 0.3)] * 12 if through else list(wake.wake(shape, 12, seed=1, step=0.2))
    particles = start(flow[0], 3000, 30, 1, distance)
    for frame in range(2, 13):
        assert sampled(distance, particles.position).min() >= CLEAR - 0.12
        particles = moved(particles, flow[frame - 2], flow[frame - 1], 30, frame, 1, distance)


def test_in_space_too_none_is_inside():
    shape = (10, 16, 12)
    distance = obstacle.ball(shape, (0.0, 0.5, 0.0), 0.2).distance
    F = constant(shape, 0.7, 0.5, -0.2)
    particles = start(F, 500, 30, 1, distance)
    for frame in range(2, 8):
        particles = moved(particles, F, F, 30, frame, 1, distance)
        assert sampled(distance, particles.position).min() > 0
        assert (particles.position >= -0.5).all() and (particles.position <= np.array([11.5, 15.5, 9.5])).all()


def test_the_seed_and_the_frame_decide():
    F = constant((20, 30), 1.2, 0.0)
    one, same, other = (start(F, 50, 40, seed) for seed in (1, 1, 2))
    assert np.array_equal(one.position, same.position) and not np.array_equal(one.position, other.position)
    a, b, c = (moved(one, F, F, 10, frame, 1) for frame in (2, 2, 3))
    assert np.array_equal(a.position, b.position) and not np.array_equal(a.position, c.position)
