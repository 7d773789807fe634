"""The flow: direction where it moves and where it rests, limits, gradients, motion along it."""

import numpy as np
import pytest

from synth.texture import flow


def uniform(angle, speed=1.0, shape=(12, 15)):
    return np.broadcast_to(np.array([np.cos(angle), np.sin(angle)]) * speed, (*shape, 2)).astype(np.float32)


def vortex(shape=(31, 37), centre=(18.0, 15.0), omega=0.1):
    y, x = np.mgrid[:shape[0], :shape[1]].astype(np.float64)
    return (omega * np.stack([centre[1] - y, x - centre[0]], axis=-1)).astype(np.float32)


def turn(a, b):
    return np.abs((a - b + np.pi) % (2 * np.pi) - np.pi)


def test_the_angle_is_counter_clockwise_from_x():
    for angle in (0, 1, np.pi / 2, 3, -2):
        np.testing.assert_allclose(flow.angles(uniform(angle)), angle, atol=1e-6)
    assert flow.angles(uniform(1)).dtype == np.float32


def test_where_all_rests_the_fallback_counts():
    np.testing.assert_allclose(flow.angles(np.zeros((4, 5, 2), np.float32), 0.7), 0.7, rtol=1e-6)


@pytest.mark.parametrize("rest", [0.0, np.nan, np.inf])
def test_a_hole_in_an_even_flow_closes_exactly(rest):
    v = uniform(2.5, 3.0).copy()
    v[3:9, 0:11] = rest
    np.testing.assert_allclose(flow.angles(v), 2.5, atol=1e-6)


def test_the_direction_is_continuous_where_the_flow_rests():
    """Two streams, 103° apart across ±π, and still water between: the direction turns the short way, evenly."""
    v = uniform(0.0, shape=(20, 60)).copy()
    v[:, :20], v[:, 40:] = uniform(np.pi - 0.9, shape=(20, 20)), uniform(-np.pi + 0.9, shape=(20, 20))
    v[:, 20:40] = 0
    theta = flow.angles(v)
    assert turn(theta[:, 1:], theta[:, :-1]).max() < 0.2  # spread evenly it would be 0.09, at one step 1.8
    assert turn(theta[:, 30], np.pi).max() < 0.2, "it turned the long way round"
    np.testing.assert_allclose(theta[:, :20], np.pi - 0.9, atol=1e-6)


def test_a_resting_disc_continues_what_flows_round_it():
    v = vortex((64, 64), (31.5, 31.5))
    y, x = np.mgrid[:64, :64] - 31.5
    v[(x - 15) ** 2 + y**2 < 36] = 0
    assert turn(flow.angles(v), flow.angles(vortex((64, 64), (31.5, 31.5)))).max() < 0.2


def test_the_middle_of_a_vortex_has_some_direction():
    theta = flow.angles(vortex())
    assert np.isfinite(theta).all()
    np.testing.assert_array_equal(theta, flow.angles(vortex()))


def test_limits_hold_and_keep_the_direction():
    v = vortex(omega=0.2)
    within = flow.limited(v, 0.3, 2.2)
    speed = np.hypot(within[..., 0], within[..., 1])
    moving = np.hypot(v[..., 0], v[..., 1]) > 0
    assert speed[moving].min() == pytest.approx(0.3) and speed.max() == pytest.approx(2.2)
    assert within.dtype == np.float32
    np.testing.assert_allclose(flow.angles(within)[moving], flow.angles(v)[moving], atol=1e-6)
    between = moving & (np.hypot(v[..., 0], v[..., 1]) < 2.2) & (np.hypot(v[..., 0], v[..., 1]) > 0.3)
    assert between.any()
    np.testing.assert_allclose(within[between], v[between], rtol=1e-6)


def test_what_rests_stays_at_rest():
    """No flow gives no motion, whatever the least speed."""
    assert not flow.limited(np.zeros((5, 6, 2), np.float32), 0.3, 2.2).any()
    v = uniform(1.0).copy()
    v[2, 3] = np.nan
    assert not flow.limited(v, 0.3, 2.2)[2, 3].any()
    assert not flow.normalized(np.zeros((5, 6, 2), np.float32), 1.5).any()


def test_normalized_has_one_speed_even_for_speeds_of_thousands_and_none():
    v = np.concatenate([uniform(1.0, 1e-20), uniform(1.0, 1e6)])
    np.testing.assert_allclose(flow.normalized(v, 1.5), np.concatenate([uniform(1.0, 1.5)] * 2), rtol=1e-5)


@pytest.mark.parametrize("least, most", [(-1, 2), (3, 2), (0, 0), (0, np.inf), (np.nan, 1), (0, np.nan)])
def test_limits_that_are_none_are_refused(least, most):
    with pytest.raises(ValueError, match="least"):
        flow.limited(uniform(0), least, most)


def test_a_flow_has_two_components():
    with pytest.raises(ValueError, match=r"\(Y, X, 2\)"):
        flow.angles(np.zeros((4, 5, 3)))


def test_the_gradient_of_a_vortex_is_exact():
    """θ = atan2(y, x) + π/2: ∂θ = (-y, x) / r², with no jump where θ passes from π to -π."""
    y, x = np.mgrid[:31, :37].astype(np.float64)
    x, y = x - 18, y - 15
    squared = np.where(x**2 + y**2 == 0, np.inf, x**2 + y**2)
    np.testing.assert_allclose(flow.gradient_of_angle(vortex()), np.stack([-y, x], -1) / squared[..., None], atol=1e-6)


def test_the_gradient_knows_no_speed_and_no_jump():
    """θ = 3 + 0.02 x - 0.01 y passes π; the speed varies."""
    y, x = np.mgrid[:40, :50]
    theta = 3 + 0.02 * x - 0.01 * y
    v = (np.stack([np.cos(theta), np.sin(theta)], -1) * (1 + 0.3 * np.sin(0.2 * x))[..., None]).astype(np.float32)
    # central differences of sin are 2e-4 of their value short; where the speed varies too, at the border, one-sided
    gradient = flow.gradient_of_angle(v)[1:-1, 1:-1]
    np.testing.assert_allclose(gradient[..., 0], 0.02, rtol=0.02)
    np.testing.assert_allclose(gradient[..., 1], -0.01, rtol=0.001)
    assert not flow.gradient_of_angle(np.zeros((4, 4, 2), np.float32)).any()


def test_a_field_of_one_row_has_no_gradient():
    with pytest.raises(ValueError, match="2 x 2"):
        flow.gradient_of_angle(np.ones((1, 5, 2), np.float32))


def test_a_linear_field_is_read_exactly_and_held_beyond_its_border():
    y, x = np.mgrid[:9, :12]
    field = np.stack([2.0 * x - y + 1, 0.5 * y + 3], axis=-1).astype(np.float32)
    points = np.random.default_rng(0).uniform(-4, 15, (200, 2))
    px, py = np.clip(points[:, 0], 0, 11), np.clip(points[:, 1], 0, 8)
    np.testing.assert_allclose(flow.at(field, points), np.stack([2 * px - py + 1, 0.5 * py + 3], -1), atol=1e-5)
    np.testing.assert_allclose(flow.at(field[..., 0], points), 2 * px - py + 1, atol=1e-5)


def test_pixel_centres_are_at_integers():
    field = np.random.default_rng(0).normal(size=(5, 7)).astype(np.float32)
    y, x = np.mgrid[:5, :7]
    np.testing.assert_array_equal(flow.at(field, np.stack([x.ravel(), y.ravel()], -1)), field.ravel())
    assert flow.at(field[:1, :1], np.array([[3.0, -2.0]])) == field[0, 0]


def test_no_flow_and_an_even_flow_move_points_exactly():
    points = np.random.default_rng(0).uniform(0, 10, (50, 2))
    np.testing.assert_array_equal(flow.midpoint(np.zeros((12, 15, 2), np.float32), points), points)
    v = np.broadcast_to(np.array([2.0, -1.0], np.float32), (12, 15, 2))
    np.testing.assert_allclose(flow.midpoint(v, points), points + np.array([2, -1]), atol=1e-12)


def test_the_midpoint_rule_keeps_to_its_circle():
    """One step of a rigid turn by ω multiplies the radius with √(1 + ω⁴/4): 1 + 1.25e-5 here; Euler's 1 + 5e-3."""
    points = np.array([[18.0 + 9, 15.0], [18, 15 + 4]])
    moved = flow.midpoint(vortex(), points) - [18, 15]
    np.testing.assert_allclose(np.hypot(*moved.T) / [9, 4], np.sqrt(1 + 0.1**4 / 4), rtol=1e-6)
    np.testing.assert_allclose(np.arctan2(*moved.T[::-1]), np.array([0, np.pi / 2]) + 0.1, atol=2e-3 / 6 + 1e-4)


def test_minus_v_leads_back():
    points = np.random.default_rng(0).uniform(8, 22, (50, 2))
    # forth and back each err by ω³/6 of the radius, in opposite senses up to the next order
    np.testing.assert_allclose(flow.midpoint(-vortex(), flow.midpoint(vortex(), points)), points, atol=20 * 0.1**4 / 2)
