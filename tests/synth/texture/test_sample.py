"""The sample: main direction, what is compared, rotated copies, and what is refused."""

import numpy as np
import pytest

from synth.texture.sample import (
    DIRECTED,
    luminance,
    main_direction,
    rotated,
    sample,
    share,
    turned,
    turned_places,
)


def stripes(angle, size=64, period=9.0):
    """Grey stripes that run along `angle`: (size, size, 3)."""
    y, x = np.mgrid[:size, :size]
    grey = 0.5 + 0.4 * np.sin(2 * np.pi / period * (-np.sin(angle) * x + np.cos(angle) * y))
    return np.repeat(grey[..., None], 3, axis=-1).astype(np.float32)


def noise(shape=(48, 40), seed=0):
    return np.random.default_rng(seed).random((*shape, 3), dtype=np.float32)


def between(a, b):
    """The angle between two directions of stripes, modulo 180°."""
    return abs((a - b + np.pi / 2) % np.pi - np.pi / 2)


@pytest.mark.parametrize("degrees", [0, 1, 2.5, 30, 45, 77, 90, 133, 177.5, 179])
def test_the_main_direction_of_stripes_is_theirs(degrees):
    made = sample(stripes(np.deg2rad(degrees)))
    assert between(made.direction, np.deg2rad(degrees)) < np.deg2rad(0.3)
    assert 0 <= made.direction < np.pi
    assert made.share > 0.95 and made.has_direction


def test_strong_stripes_win_over_noise_and_over_weaker_ones():
    mixed = 0.8 * stripes(0.5) + 0.08 * stripes(2.0) + 0.1 * noise((64, 64))
    assert between(main_direction(luminance(mixed)), 0.5) < np.deg2rad(3)


def test_a_faint_sample_has_the_direction_of_its_strong_copy():
    faint = 0.5 + 0.01 * (stripes(0.8) - 0.5)
    assert between(sample(faint).direction, 0.8) < np.deg2rad(0.7)


def test_noise_has_no_direction_and_shares_its_energy_evenly():
    made = sample(noise((128, 128)))
    assert made.share == pytest.approx(1 / 6, abs=0.04)
    assert not made.has_direction and made.share < DIRECTED
    shares = [share(made.luminance, np.deg2rad(15 + 30 * k)) for k in range(6)]
    assert sum(shares) == pytest.approx(1, abs=1e-6)  # six sectors of ±15° cover the half turn


def test_a_given_direction_is_kept_modulo_360():
    made = sample(stripes(np.pi / 2), direction=3 * np.pi / 2)
    assert made.direction == 3 * np.pi / 2 and made.has_direction
    assert not sample(stripes(np.pi / 2), direction=0.0).has_direction, "share is of what was given"


def test_luminance_is_what_a_display_is_given():
    grey = luminance(np.array([0.0, 0.001, 0.21404114, 1.0, 3.0, -1.0])[:, None] * np.ones(3))
    np.testing.assert_allclose(grey, [0, 0.01292, 0.5, 1, 1, 0], atol=1e-6)
    weights = luminance(np.eye(3))
    np.testing.assert_allclose(weights, luminance(np.array([0.2126, 0.7152, 0.0722])[:, None] * np.ones(3)))
    assert luminance(np.full(3, 2.0), white=2.0) == pytest.approx(1)


def test_a_sample_of_high_range_keeps_its_contrast():
    bright = sample(stripes(0.3) * 20)
    assert bright.white == pytest.approx(18, rel=0.01)
    np.testing.assert_allclose(bright.luminance, luminance(stripes(0.3), 0.9), atol=0.005)


def test_transparent_pixels_take_the_nearest_opaque_colour():
    picture, alpha = stripes(0.3), np.ones((64, 64))
    alpha[20:40, 30:64] = 0
    picture[20:40, 30:64] = np.nan
    made = sample(picture, alpha)
    np.testing.assert_array_equal(made.opaque, alpha > 0)
    np.testing.assert_array_equal(made.colour[25, 30], picture[25, 29])
    assert between(made.direction, 0.3) < np.deg2rad(0.7), "the filled pixels count"
    assert sample(stripes(0.3), np.ones((64, 64))).opaque is None


@pytest.mark.parametrize("colour, arguments, reason", [
    (np.full((16, 16, 3), 0.3), {}, "one colour"),
    (np.full((16, 16, 3), (0.1, 0.5, 0.9)), {}, "one colour"),
    (noise((7, 30)), {}, "at least 8 x 8 pixels, not 30 x 7"),
    (noise((1, 1)), {}, "at least 8 x 8"),
    (np.where(np.arange(48)[:, None, None] == 5, np.nan, noise()), {}, "NaN or infinity"),
    (np.where(np.arange(48)[:, None, None] == 5, np.inf, noise()), {}, "NaN or infinity"),
    (noise(), {"alpha": np.zeros((48, 40))}, "transparent everywhere"),
    (noise(), {"alpha": np.full((48, 40), 0.3)}, "below one half"),
    (noise(), {"alpha": np.ones((40, 48))}, "picture's size"),
    (noise(), {"alpha": np.full((48, 40), np.nan)}, "alpha holds NaN"),
    (noise()[..., 0], {}, r"\(H, W, 3\)"),
    (np.zeros((16, 16, 4)), {}, r"\(H, W, 3\)"),
    (noise(), {"direction": 2 * np.pi}, r"\[0, 2π\)"),
    (noise(), {"direction": float("nan")}, r"\[0, 2π\)"),
])
def test_what_is_no_sample_is_refused_in_one_sentence(colour, arguments, reason):
    with pytest.raises(ValueError, match=reason) as error:
        sample(colour, **arguments)
    assert "\n" not in str(error.value)


def test_two_colours_of_one_brightness_are_refused():
    red_and_green = np.where(np.arange(16)[:, None, None] % 2 == 0, (1.0, 0.0, 0.0), (0.0, 0.2126 / 0.7152, 0.0))
    with pytest.raises(ValueError, match="one brightness"):
        sample(np.broadcast_to(red_and_green, (16, 16, 3)))


def test_turning_moves_a_dot_counter_clockwise():
    picture = np.zeros((33, 33), np.float32)
    picture[16, 26] = 1  # 10 to the right of the middle
    for degrees, (y, x) in ((0, (16, 26)), (90, (26, 16)), (180, (16, 6)), (270, (6, 16))):
        found = turned(picture, np.deg2rad(degrees), 33)
        assert np.unravel_index(found.argmax(), found.shape) == (y, x)
    oblique = turned(picture, np.deg2rad(45), 33)
    y, x = np.unravel_index(oblique.argmax(), oblique.shape)
    assert (y - 16, x - 16) == (7, 7)  # 10 / √2 = 7.07


def test_quarter_turns_are_exact_and_return():
    picture = noise((40, 40))[..., 0]
    np.testing.assert_allclose(turned(picture, 0.0, 40), picture, atol=1e-6)
    np.testing.assert_allclose(turned(picture, np.pi / 2, 40), np.rot90(picture, -1), atol=1e-6)  # row 0 is lowest


@pytest.mark.parametrize("shape", [(48, 48), (41, 60)])
def test_each_copy_points_to_its_angle(shape):
    made = sample(stripes(0.4, 64)[:shape[0], :shape[1]])
    copies = rotated(made, 24)
    assert copies.colour.shape[:3] == copies.luminance.shape == copies.valid.shape
    assert copies.colour.dtype == copies.luminance.dtype == np.float32
    np.testing.assert_allclose(copies.angles, 2 * np.pi * np.arange(24) / 24)
    for k in range(24):
        assert between(main_direction(copies.luminance[k], copies.valid[k]), copies.angles[k]) < np.deg2rad(0.5)
        # the inside of a turned rectangle of (H - 1) by (W - 1)
        assert copies.valid[k].sum() == pytest.approx((shape[0] - 1) * (shape[1] - 1), rel=0.07)
        assert not copies.valid[k][[0, -1]].any() or k % 6 == 0


def test_heads_point_to_the_angle_and_not_away():
    """One bright end: in copy k it lies from the middle towards 2πk/n, not opposite."""
    picture = np.full((41, 41, 3), 0.2, np.float32)
    picture[32:36, 18:23] = 0.9
    copies = rotated(sample(picture, direction=np.pi / 2), 8)
    middle = (copies.luminance.shape[1] - 1) / 2
    for k in range(8):
        weight = np.where(copies.valid[k], copies.luminance[k] - copies.luminance[k].min(), 0) ** 4
        rows, columns = np.mgrid[:weight.shape[0], :weight.shape[1]] - middle
        y, x = (float((place * weight).sum() / weight.sum()) for place in (rows, columns))
        assert np.cos(np.arctan2(y, x) - copies.angles[k]) > 0.995
        assert np.hypot(x, y) == pytest.approx(13.5, abs=0.7)


def test_quarter_copies_hold_the_sample_itself():
    made = sample(noise((40, 40)), direction=0.0)
    copies = rotated(made, 4)
    for k in range(4):
        np.testing.assert_allclose(copies.luminance[k][copies.valid[k]].reshape(40, 40), np.rot90(made.luminance, -k),
                                   atol=1e-5)
        np.testing.assert_allclose(copies.colour[k][copies.valid[k]].reshape(40, 40, 3), np.rot90(made.colour, -k),
                                   atol=1e-5)


def test_copies_stay_within_the_range_of_the_sample():
    copies = rotated(sample(noise((20, 20)).round(), direction=0.0), 7)
    assert copies.colour.min() >= 0 and copies.colour.max() <= 1
    assert copies.luminance.min() >= 0 and copies.luminance.max() <= 1


def test_what_is_transparent_is_not_valid():
    alpha = np.ones((40, 40))
    alpha[10:20, 10:20] = 0
    copies = rotated(sample(noise((40, 40)), alpha, 0.0), 4)
    assert copies.valid[0].sum() == 1500
    assert 1300 < rotated(sample(noise((40, 40)), alpha, 0.0), 7).valid[3].sum() < 1450


def test_valid_is_wholly_inside():
    """Where bicubic interpolation has pixels on all sides, and nowhere else."""
    copies = rotated(sample(noise((30, 44)), direction=0.7), 9)
    for k in range(9):
        y, x = turned_places((30, 44), copies.angles[k] - 0.7, copies.valid.shape[1])
        np.testing.assert_array_equal(copies.valid[k], (x >= 0) & (x <= 43) & (y >= 0) & (y <= 29))


def test_no_copies_are_refused():
    with pytest.raises(ValueError, match="at least one"):
        rotated(sample(noise()), 0)
