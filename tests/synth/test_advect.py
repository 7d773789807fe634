"""Advection: invariants, then the kernel against its NumPy reference, bit for bit."""

import numpy as np
import pytest

from synth.advect import BORDERS, advect, advect_reference, departure, departure_reference

SHAPES = [(5, 7), (2, 2), (1, 9), (3, 67), (3, 5, 7), (2, 2, 2), (1, 4, 65), (5, 7, 3)]


def case(shape, channels=(), speed=2.5, seed=0):
    rng = np.random.default_rng(seed)
    q = rng.normal(size=(*shape, *channels)).astype(np.float32)
    v = (speed * rng.normal(size=(*shape, len(shape)))).astype(np.float32)
    return q, v


@pytest.mark.parametrize("border", BORDERS)
@pytest.mark.parametrize("shape", SHAPES)
def test_nothing_moves_in_zero_flow_or_zero_time(shape, border):
    q, v = case(shape)
    np.testing.assert_array_equal(advect(q, np.zeros_like(v), border=border), q)
    np.testing.assert_array_equal(advect(q, v, dt=0.0, border=border), q)


@pytest.mark.parametrize("shape", [(5, 7), (5, 6, 7)])
@pytest.mark.parametrize("component", [0, 1, 2])
@pytest.mark.parametrize("cells", [1, -2])
def test_whole_cells_move_exactly(shape, component, cells):
    if component >= len(shape):
        component = 0
    q, v = case(shape)
    v[...] = 0
    v[..., component] = cells
    axis = len(shape) - 1 - component
    rolled = np.roll(q, cells, axis)
    np.testing.assert_array_equal(advect(q, v, border="toroidal"), rolled)

    entered = np.arange(shape[axis])
    entered = (entered < cells) | (entered >= shape[axis] + cells)
    vacated = entered.reshape([-1 if a == axis else 1 for a in range(len(shape))])
    np.testing.assert_array_equal(advect(q, v, border="zero"), np.where(vacated, 0, rolled))
    edge = np.take(q, [0 if cells > 0 else -1], axis)
    np.testing.assert_array_equal(advect(q, v, border="clamp"), np.where(vacated, edge, rolled))


def test_half_a_cell_is_the_mean_of_two():
    q, v = case((4, 6))
    v[...] = 0.5, 0.0
    np.testing.assert_array_equal(advect(q, v, border="toroidal"), 0.5 * q + 0.5 * np.roll(q, 1, 1))


def test_the_backtrace_is_of_second_order():
    """In a rigid rotation by angle a the departure point is off by O(a^3); Euler's step: O(a^2)."""
    y, x = np.mgrid[-16:17, -16:17].astype(np.float32)
    errors = []
    for angle in (0.1, 0.05):
        c, s = np.cos(angle), np.sin(angle)
        exact = np.stack([c * x + s * y - x, c * y - s * x - y], -1)
        d = departure(np.stack([-angle * y, angle * x], -1))
        errors.append(np.abs(d - exact)[8:-8, 8:-8].max())
    assert errors[0] < 0.1**3 * 8
    assert 7.0 < errors[0] / errors[1] < 9.0


@pytest.mark.parametrize("border", BORDERS)
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("channels", [(), (1,), (2,), (3,), (5,)])
def test_the_kernel_equals_the_reference(shape, border, channels):
    q, v = case(shape, channels)
    np.testing.assert_array_equal(departure(v, 0.7, border), departure_reference(v, 0.7, border))
    np.testing.assert_array_equal(advect(q, v, 0.7, border), advect_reference(q, v, 0.7, border))


def test_far_flights_leave_or_wrap():
    q, v = case((6, 6), speed=1e5)
    np.testing.assert_array_equal(advect(q, v, border="zero"), advect_reference(q, v, border="zero"))
    np.testing.assert_array_equal(advect(q, v, border="toroidal"), advect_reference(q, v, border="toroidal"))


def test_refusals():
    q, v = case((4, 4))
    with pytest.raises(ValueError, match="velocity field is"):
        advect(q, v[..., :1])
    with pytest.raises(ValueError, match="does not lie"):
        advect(q[:3], v)
    with pytest.raises(ValueError, match="border"):
        advect(q, v, border="mirror")
    for bad in (np.nan, np.inf, -np.inf, 3e6):
        v[1, 2, 0] = bad
        with pytest.raises(ValueError, match="NaN, infinity"):
            advect(q, v)
