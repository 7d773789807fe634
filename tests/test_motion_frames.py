"""Local frames: unit vectors along L, one fallback where it rests, and the coordinate transformation of figure 2."""

import numpy as np
import pytest

from synth.motion.frames import local_frame, to_world

SHAPES = [(5, 7), (2, 2), (1, 9), (1, 1)]


def flow(shape, seed=0):
    return np.random.default_rng(seed).normal(size=(*shape, 2)).astype(np.float32)


@pytest.mark.parametrize("shape", SHAPES)
def test_the_x_axis_is_a_unit_vector_along_the_flow(shape):
    L = flow(shape)
    frame = local_frame(L)
    assert frame.dtype == np.float32 and frame.shape == L.shape
    np.testing.assert_allclose(np.linalg.norm(frame, axis=-1), 1, atol=1e-6)
    speed = np.linalg.norm(L, axis=-1)
    strong = speed > 0.1 * np.sqrt(np.mean(speed**2))
    assert (np.sum(frame * L, -1)[strong] > 0.9999 * speed[strong]).all()


@pytest.mark.parametrize("angle", np.linspace(-np.pi, np.pi, 9))
def test_every_direction_of_a_constant_flow(angle):
    direction = np.float32([np.cos(angle), np.sin(angle)])
    frame = local_frame(np.broadcast_to(3 * direction, (4, 5, 2)).astype(np.float32))
    np.testing.assert_allclose(frame, np.broadcast_to(direction, (4, 5, 2)), atol=2e-3)


@pytest.mark.parametrize("shape", SHAPES)
def test_a_resting_field_has_the_axes_of_the_domain(shape):
    np.testing.assert_array_equal(local_frame(np.zeros((*shape, 2), np.float32)),
                                  np.broadcast_to(np.float32([1, 0]), (*shape, 2)))


def test_the_frame_does_not_depend_on_speed():
    """Nor on the unit: a flow a million times slower gives the same frames."""
    L = flow((9, 8))
    np.testing.assert_allclose(local_frame(L * np.float32(1e-6)), local_frame(L), atol=1e-5)


def test_noise_of_a_resting_part_turns_no_frame():
    L = flow((9, 8)) * np.float32(1e-6)
    L[:, 4:] = 1, 1
    assert (local_frame(L)[:, :4, 0] > 0.999).all()


def test_opposing_the_fallback_exactly_is_no_division_by_zero():
    L = np.full((3, 3, 2), (0, 1), np.float32)
    L[1, 1] = -1e-3 * np.sqrt(np.mean(np.sum(L**2, -1))), 0
    frame = local_frame(L)
    assert np.isfinite(frame).all()
    np.testing.assert_allclose(np.linalg.norm(frame, axis=-1), 1, atol=1e-5)


def test_along_x_the_transformation_is_the_identity():
    H = flow((5, 7))
    np.testing.assert_array_equal(to_world(H, np.broadcast_to(np.float32([1, 0]), H.shape)), H)


def test_along_y_what_pointed_right_points_up():
    H = np.broadcast_to(np.float32([2, 1]), (2, 3, 2))
    world = to_world(H, np.broadcast_to(np.float32([0, 1]), H.shape))
    np.testing.assert_array_equal(world, np.broadcast_to(np.float32([-1, 2]), H.shape))


def test_figure_2_a_swirl_on_a_diagonal_flow_turns_with_it():
    """Detail that runs along the exemplar's x axis runs along the flow in the domain, at its own speed."""
    L = flow((6, 6))
    frame = local_frame(L)
    H = np.zeros_like(L)
    H[..., 0] = 0.7
    np.testing.assert_allclose(to_world(H, frame), 0.7 * frame, atol=1e-6)


def test_lengths_and_angles_are_kept():
    H, other, frame = flow((9, 8), 1), flow((9, 8), 2), local_frame(flow((9, 8), 3))
    a, b = to_world(H, frame), to_world(other, frame)
    np.testing.assert_allclose(np.linalg.norm(a, axis=-1), np.linalg.norm(H, axis=-1), rtol=1e-5)
    np.testing.assert_allclose(np.sum(a * b, -1), np.sum(H * other, -1), atol=1e-5)


def test_the_frame_turned_back_undoes_it():
    H, frame = flow((9, 8), 1), local_frame(flow((9, 8), 3))
    np.testing.assert_allclose(to_world(to_world(H, frame), frame * np.float32([1, -1])), H, atol=1e-6)


def test_with_the_y_axis_along_the_flow_what_is_upright_rises_with_it():
    """A flow straight up leaves the exemplar as it is; any other turns it by as much as the flow is off that."""
    np.testing.assert_array_equal(local_frame(np.full((2, 3, 2), (0, 1.5), np.float32), "y"),
                                  local_frame(np.full((2, 3, 2), (1.5, 0), np.float32), "x"))
    L = flow((6, 5))
    x, y = local_frame(L, "x"), local_frame(L, "y")
    strong = np.linalg.norm(L, axis=-1) > 0.3
    np.testing.assert_allclose((y[..., 0] * x[..., 0] + y[..., 1] * x[..., 1])[strong], 0, atol=0.01)
    np.testing.assert_allclose((y[..., 0] * x[..., 1] - y[..., 1] * x[..., 0])[strong], 1, atol=0.01)
    np.testing.assert_array_equal(local_frame(np.zeros((2, 2, 2), np.float32), "y"),
                                  np.full((2, 2, 2), (1, 0), np.float32))
