"""Pictures of inner steps: the right way up, mid grey for nothing, outlines and arrows where they belong."""

import numpy as np
import pytest

from render import arrows, steps


def test_grey_values_keep_their_level_and_their_lowest_row_is_below() -> None:
    values = np.full((12, 16), 60.0, np.float32)
    values[:4] = 200
    shown = steps.grey(values, 64)
    assert shown.shape == (48, 64, 3)
    assert shown[:20].mean() == pytest.approx(60 / 255, abs=0.01)
    assert shown[-8:].mean() == pytest.approx(200 / 255, abs=0.01)


def test_no_difference_is_mid_grey_and_signs_go_apart() -> None:
    values = np.zeros((8, 12), np.float32)
    values[:, :4], values[:, 8:] = -steps.REACH, steps.REACH
    shown = steps.difference(values, 120)
    np.testing.assert_allclose(shown[:, [5, 60, 115], 0], np.tile([0, 0.5, 1], (80, 1)), atol=0.02)


def test_strengths_are_blocks_in_a_common_scale() -> None:
    shown = steps.strength(np.array([[1.0, 2.0], [3.0, 4.0]]), 4.0, 20)
    np.testing.assert_allclose(shown[[15, 15, 4, 4], [4, 15, 4, 15], 0], [0.25, 0.5, 0.75, 1])
    assert len(np.unique(shown)) == 4


def test_what_is_masked_out_is_plain() -> None:
    used = np.zeros((8, 8), bool)
    used[:, 4:] = True
    shown = steps.masked(np.full((8, 8), 50.0, np.float32), used, 80)
    np.testing.assert_allclose(shown[:, :20], np.broadcast_to(steps.UNUSED, (80, 20, 3)), atol=0.01)
    np.testing.assert_allclose(shown[:, 60:], 50 / 255, atol=0.01)


def test_motion_has_arrows_along_it_and_rest_is_white() -> None:
    v = np.zeros((24, 24, 2), np.float32)
    np.testing.assert_array_equal(steps.motion(v, 96), np.ones((96, 96, 3), np.float32))
    v[:, 12:] = [0, 2]
    shown = steps.motion(v, 96)
    np.testing.assert_allclose(shown[:, :40], 1, atol=1e-6)
    assert (shown[:, 52:].min(axis=2) < 0.2).any()


def test_strokes_are_orange_where_they_were_drawn() -> None:
    picture = np.zeros((30, 60, 3), np.float32)
    shown = steps.strokes(picture, [np.array([[10.0, 5.0], [40.0, 5.0]])], 240)
    assert shown.shape == (120, 240, 3)
    rows, columns = np.nonzero(np.abs(shown - arrows.ORANGE).max(axis=2) < 0.05)
    assert 95 <= rows.mean() <= 100  # row 5 from below, in pixels of four
    assert columns.min() == pytest.approx(42, abs=3) and columns.max() == pytest.approx(162, abs=3)


def test_orientation_has_arrows_in_the_fluid_alone_and_is_pale_outside() -> None:
    v = np.broadcast_to(np.float32([1, 0]), (40, 60, 2))
    fluid = np.zeros((40, 60), np.float32)
    fluid[:, 30:] = 1
    shown = steps.orientation(v, fluid, 180, 1)
    assert shown.shape == (120, 180, 3)
    assert shown[:, :80].min() > 0.65 > shown[:, 100:].min()
    assert (shown[:, 100:].max(axis=2) < 0.2).any()


def test_outlines_are_where_their_corners_are() -> None:
    shown = steps.outlined(np.zeros((40, 60, 3), np.float32), np.array([[4, 8]]), 16, [arrows.ORANGE], 240)
    rows, columns = np.nonzero(shown.max(axis=2) > 0.5)
    assert (columns.min(), columns.max() + 1) == (32, 96)
    assert (160 - rows.max() - 1, 160 - rows.min()) == (16, 80)
    assert not shown[100:120, 50:80].any()


def test_an_outline_over_the_border_is_cut() -> None:
    shown = steps.outlined(np.zeros((40, 60, 3), np.float32), np.array([[-8, 50]]), 16, [arrows.ORANGE], 120)
    rows, columns = np.nonzero(shown.max(axis=2) > 0.5)
    assert rows.min() == 80 - 16 and columns.min() == 100
