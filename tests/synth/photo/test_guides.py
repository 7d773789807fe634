"""Strokes and what lies between them."""

import numpy as np
import pytest

from synth.photo.guides import orientation, speeds, stroke_points

SHAPE = (60, 80)


def test_points_lie_on_a_stroke_and_their_tangents_along_it():
    points, tangents = stroke_points([np.array([[10.0, 5.0], [10.0, 45.0], [50.0, 45.0]])])
    assert len(points) == 10
    assert ((np.abs(points[:, 0] - 10) < 1e-9) | (np.abs(points[:, 1] - 45) < 1e-9)).all()
    np.testing.assert_allclose(np.hypot(*tangents.T), 1)
    np.testing.assert_allclose(tangents[0], [0, 1])
    np.testing.assert_allclose(tangents[-1], [1, 0])


def test_a_point_that_stands_twice_changes_nothing():
    one = stroke_points([np.array([[0.0, 0.0], [40.0, 0.0]])])
    two = stroke_points([np.array([[0.0, 0.0], [20.0, 0.0], [20.0, 0.0], [40.0, 0.0]])])
    for a, b in zip(one, two, strict=True):
        np.testing.assert_allclose(a, b)


def test_one_stroke_gives_one_direction():
    field = orientation([np.array([[20.0, 20.0], [50.0, 40.0]])], SHAPE)
    expected = np.array([30.0, 20.0]) / np.hypot(30, 20)
    np.testing.assert_allclose(field, np.broadcast_to(expected, field.shape), atol=1e-6)


def test_the_field_follows_the_strokes_and_turns_between_them():
    field = orientation([np.array([[5.0, 30.0], [15.0, 30.0]]), np.array([[70.0, 25.0], [70.0, 35.0]])], SHAPE)
    np.testing.assert_allclose(np.hypot(field[..., 0], field[..., 1]), 1, atol=1e-5)
    assert field[30, 10] @ [1, 0] > 0.99
    assert field[30, 70] @ [0, 1] > 0.99
    along = np.degrees(np.arctan2(field[30, 10:71, 1], field[30, 10:71, 0]))
    assert (np.diff(along) > -0.5).all(), "it turns one way"
    assert 30 < along[30] < 60


def test_strokes_round_a_centre_make_a_vortex():
    angle = np.arange(8) * np.pi / 4
    strokes = [np.array([[40 + 20 * np.cos(a) + 3 * np.sin(a), 30 + 20 * np.sin(a) - 3 * np.cos(a)],
                         [40 + 20 * np.cos(a) - 3 * np.sin(a), 30 + 20 * np.sin(a) + 3 * np.cos(a)]]) for a in angle]
    field = orientation(strokes, SHAPE)
    y, x = np.mgrid[:60, :80]
    dx, dy = x - 40, y - 30
    away = np.hypot(dx, dy)
    ring = (away > 12) & (away < 28)
    cosine = ((-dy * field[..., 0] + dx * field[..., 1]) / np.maximum(away, 1))[ring]
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean() < 6


def test_what_stands_still_parts_the_strokes():
    frozen = np.zeros(SHAPE, bool)
    frozen[:, 38:42] = True
    strokes = [np.array([[5.0, 30.0], [30.0, 30.0]]), np.array([[60.0, 10.0], [60.0, 50.0]])]
    parted, free = orientation(strokes, SHAPE, frozen), orientation(strokes, SHAPE)
    np.testing.assert_allclose(parted[:, :38], np.broadcast_to([1, 0], (60, 38, 2)), atol=1e-4)
    np.testing.assert_allclose(parted[:, 42:], np.broadcast_to([0, 1], (60, 38, 2)), atol=1e-4)
    assert np.abs(free[30, 36] - [1, 0]).max() > 0.1


def test_speeds_lie_between_those_of_the_strokes_and_are_theirs_on_them():
    strokes = [np.array([[10.0, 5.0], [10.0, 55.0]]), np.array([[70.0, 5.0], [70.0, 55.0]])]
    found = speeds(strokes, [1.0, 4.0], SHAPE)
    assert found.min() >= 1 and found.max() <= 4
    np.testing.assert_allclose(found[10:50, 10], 1, atol=0.1)
    np.testing.assert_allclose(found[10:50, 70], 4, atol=0.1)
    assert (np.diff(found[30]) >= -1e-3).all()


def test_a_speed_is_not_heard_behind_what_stands_still():
    frozen = np.zeros(SHAPE, bool)
    frozen[:, 38:42] = True
    found = speeds([np.array([[20.0, 5.0], [20.0, 55.0]]), np.array([[60.0, 5.0], [60.0, 55.0]])], [1, 4], SHAPE,
                   frozen)
    np.testing.assert_allclose(found[:, :38], 1, atol=1e-3)
    np.testing.assert_allclose(found[:, 42:], 4, atol=1e-3)


def test_each_stroke_has_one_speed():
    with pytest.raises(ValueError, match="1 strokes need 1 speeds, not 2"):
        speeds([np.array([[10.0, 5.0], [10.0, 55.0]])], [1.0, 2.0], SHAPE)


def test_strokes_that_cancel_leave_no_hole():
    field = orientation([np.array([[10.0, 30.0], [20.0, 30.0]]), np.array([[70.0, 30.0], [60.0, 30.0]])], SHAPE)
    np.testing.assert_allclose(np.hypot(field[..., 0], field[..., 1]), 1, atol=1e-5)


@pytest.mark.parametrize(("strokes", "told"), [
    ([], "at least one stroke"), ([[[3.0, 4.0]]], "stroke 0 is not two"), ([[[3.0, 4.0], [3.0, 4.0]]], "no length"),
    ([[[0.0, 1.0], [9.0, 9.0]], [[0.0, np.nan], [9.0, 9.0]]], "stroke 1 has no length"),
    ([[[-50.0, 4.0], [-20.0, 4.0]]], "outside the picture of 80 x 60")])
def test_strokes_that_say_nothing_are_refused(strokes, told):
    with pytest.raises(ValueError, match=told):
        orientation([np.array(stroke) for stroke in strokes], SHAPE)
