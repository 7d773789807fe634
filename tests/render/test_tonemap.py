"""render.tonemap: values known in advance."""

import numpy as np
import pytest

from render import tonemap


def test_srgb_values_of_the_standard() -> None:
    """IEC 61966-2-1: middle grey and the ends; what lies outside is clipped."""
    values = tonemap.to_srgb(np.array([-1.0, 0.0, 0.0031308, 0.2140411, 1.0, 7.0]))
    assert values == pytest.approx([0.0, 0.0, 0.0404482, 0.5, 1.0, 1.0], abs=2e-6)


def test_light_with_alpha_lies_on_white() -> None:
    """Its colours are multiplied by alpha: black that covers a half leaves half of the white."""
    light = np.array([[[0.2, 0.1, 0.0, 1.0], [0.0, 0.0, 0.0, 0.5], [0.0, 0.0, 0.0, 0.0]]])
    shown = tonemap.from_srgb(tonemap.to_display(light, "straight"))
    np.testing.assert_allclose(shown, [[[0.2, 0.1, 0.0], [0.5, 0.5, 0.5], [1.0, 1.0, 1.0]]], atol=1e-6)


def test_filmic_never_decreases_and_leaves_room_above_one() -> None:
    curve = tonemap.filmic(np.linspace(0.0, 10.0, 2001))
    assert curve[0] == 0.0
    assert (np.diff(curve) >= 0.0).all()
    assert tonemap.filmic(np.array([1.0]))[0] < 0.9


def test_straight_keeps_white_paper_white() -> None:
    assert tonemap.to_display(np.ones((2, 3, 3)), "straight") == pytest.approx(1.0)


def test_dither_keeps_the_mean_of_a_value_between_two_steps_and_hides_the_step() -> None:
    page = tonemap.eight_bit(np.full((200, 200, 3), 100.3 / 255.0))
    assert page.dtype == np.uint8
    assert abs(page.mean() - 100.3) < 0.02
    assert len(np.unique(page)) >= 3


def test_dither_leaves_black_and_white_alone_and_repeats() -> None:
    ends = np.zeros((8, 8, 3))
    ends[4:] = 1.0
    assert np.array_equal(np.unique(tonemap.eight_bit(ends)), [0, 255])
    ramp = np.linspace(0.0, 1.0, 8 * 9 * 3).reshape(8, 9, 3)
    assert np.array_equal(tonemap.eight_bit(ramp, 3), tonemap.eight_bit(ramp, 3))


def test_oklab_white_is_white_and_red_is_red() -> None:
    """Ottosson 2020: (1, 0, 0) is white; Rec.709 red is (0.62796, 0.22486, 0.12585)."""
    colours = tonemap.oklab_to_linear(np.array([[1.0, 0.0, 0.0], [0.62796, 0.22486, 0.12585]]))
    assert colours == pytest.approx(np.array([[1.0, 1.0, 1.0], [1.0, 0.0, 0.0]]), abs=1e-3)


def test_oklab_there_and_back_and_its_known_values() -> None:
    """White is 1, 0, 0; red is as Ottosson gives it."""
    light = np.random.default_rng(1).random((50, 3))
    np.testing.assert_allclose(tonemap.oklab_to_linear(tonemap.linear_to_oklab(light)), light, atol=1e-7)
    np.testing.assert_allclose(tonemap.linear_to_oklab(np.array([[1.0, 1, 1], [1, 0, 0]])),
                               [[1, 0, 0], [0.628, 0.225, 0.126]], atol=1e-3)
