"""render.lic: fields whose picture is known in advance."""

import itertools

import numpy as np
import pytest
from scipy import ndimage

from render import lic


def uniform(x: float, y: float, rows: int = 24, columns: int = 32) -> np.ndarray:
    return np.broadcast_to(np.array([x, y], np.float32), (rows, columns, 2)).copy()


def roughness(grey: np.ndarray, axis: int) -> float:
    """Root mean square step from pixel to pixel, away from the borders."""
    inner = grey[20:-20, 20:-20]
    return float(np.sqrt((np.diff(inner, axis=axis) ** 2).mean()))


@pytest.mark.parametrize(("x", "y", "along"), [(1.0, 0.0, 1), (0.0, -3.0, 0)])
def test_lines_of_a_uniform_flow_are_constant_along_it(x: float, y: float, along: int) -> None:
    grey = lic.lines(uniform(x, y, 32, 32), 320)
    assert roughness(grey, along) < 0.15 * roughness(grey, 1 - along)


def test_lines_follow_a_diagonal_the_right_way_up() -> None:
    """A flow to the upper right: in a picture with its top row first, lines rise to the right."""
    grey = lic.lines(uniform(1.0, 1.0, 32, 32), 320)[20:-20, 20:-20]
    rising = np.abs(grey[1:, :-1] - grey[:-1, 1:]).mean()
    falling = np.abs(grey[:-1, :-1] - grey[1:, 1:]).mean()
    assert rising < 0.35 * falling


def test_zero_vectors_stay_noise_of_reduced_amplitude() -> None:
    """ma09 figure 4: the still half is noise that no direction smooths, much dimmer than the lines."""
    field = uniform(1.0, 0.0, 32, 64)
    field[:, :32] = 0.0
    grey = lic.lines(field, 256)
    still, moving = grey[:, 10:110], grey[:, 146:246]
    assert still.std() == pytest.approx(lic.STILL_CONTRAST, rel=0.1)
    assert moving.std() == pytest.approx(lic.CONTRAST, rel=0.15)
    assert roughness(still, 1) == pytest.approx(roughness(still, 0), rel=0.1)


def test_a_field_that_is_zero_everywhere_is_dim_noise() -> None:
    grey = lic.lines(uniform(0.0, 0.0), 96)
    assert grey.std() == pytest.approx(lic.STILL_CONTRAST, rel=0.02)
    assert grey.mean() == pytest.approx(0.5, abs=1e-3)


def test_the_step_from_still_to_moving_is_smooth() -> None:
    field = uniform(0.0, 0.0, 8, 512)
    field[..., 0] = np.linspace(0.0, 0.05, 512)
    field[0, 0, 0] = 1.0  # the largest magnitude, far from the ramp's middle
    grey = lic.lines(field, 1024)
    spread = [grey[:, c:c + 64].std() for c in range(64, 900, 64)]
    assert spread[0] < 0.4 * spread[-1]
    assert max(b / a for a, b in itertools.pairwise(spread)) < 2.0


def test_same_seed_same_bits_other_seed_other_noise() -> None:
    field = np.random.Generator(np.random.Philox(key=5)).standard_normal((9, 7, 2)).astype(np.float32)
    assert np.array_equal(lic.picture(field, 64, 3), lic.picture(field, 64, 3))
    assert not np.array_equal(lic.picture(field, 64, 3), lic.picture(field, 64, 4))


def test_hue_is_direction_as_the_wheel_shows() -> None:
    """The colour of a flow equals the wheel's at the place that lies in the flow's direction."""
    wheel = lic.wheel(101)
    for angle in np.deg2rad([0.0, 90.0, 200.0, 315.0]):
        flow = lic.colour(uniform(float(np.cos(angle)), float(np.sin(angle))), 8)[3, 4]
        row, column = round(50 - 46 * np.sin(angle)), round(50 + 46 * np.cos(angle))
        assert wheel[row, column, :3] == pytest.approx(flow, abs=0.06)


def test_colours_of_four_directions() -> None:
    """Right is red, up is green-yellow, left is cyan-green, down is blue-violet: no two alike."""
    colours = [lic.colour(uniform(x, y), 4)[0, 0] for x, y in ((1, 0), (0, 1), (-1, 0), (0, -1))]
    assert colours[0].argmax() == 0
    assert colours[3].argmax() == 2
    assert min(np.abs(a - b).max() for i, a in enumerate(colours) for b in colours[:i]) > 0.2


def test_zero_is_white_and_magnitude_deepens_the_colour() -> None:
    field = uniform(0.0, 0.0, 4, 300)
    field[..., 0] = np.linspace(0.0, 1.0, 300)
    colours = lic.colour(field, 300)[2]
    assert colours[0] == pytest.approx(1.0, abs=0.02)
    assert (np.diff(colours[:, 2]) <= 1e-6).all()


def test_row_zero_is_the_bottom_of_the_picture() -> None:
    field = uniform(1.0, 0.0, 16, 16)
    field[:8] = 0.0
    colours = lic.colour(field, 32)
    assert colours[-4:].min() > 0.99
    assert colours[:4, :, 2].max() < 0.9


def test_pictures_keep_the_shape_of_the_field() -> None:
    assert lic.picture(uniform(1.0, 0.0, 10, 20), 64).shape == (32, 64, 3)
    assert lic.picture(uniform(1.0, 0.0, 10, 20), 64, tint=True).shape == (32, 64, 3)


def test_linear_resampling_is_exact_on_a_ramp_and_the_identity_at_its_own_size() -> None:
    ramp = np.add.outer(np.arange(6.0), 10.0 * np.arange(5.0)).astype(np.float32)
    assert np.array_equal(lic.resampled(ramp, 6, 5), ramp)
    twice = lic.resampled(ramp, 12, 10)
    assert twice[3, 4] == pytest.approx(1.25 + 10.0 * 1.75)


@pytest.mark.parametrize(("shape", "height", "width"), [
    ((9, 7, 2), 31, 20), ((2, 2), 5, 3), ((30, 40, 3), 17, 23),
])
@pytest.mark.parametrize("order", [1, 3])
def test_resampling_is_spline_interpolation(shape: tuple[int, ...], height: int, width: int,
                                            order: int) -> None:
    values = np.random.Generator(np.random.Philox(key=2)).standard_normal(shape).astype(np.float32)
    sizes = ((height, shape[0]), (width, shape[1]))
    where = np.meshgrid(*((np.arange(n) + 0.5) * (m / n) - 0.5 for n, m in sizes), indexing="ij")
    planes = values.reshape(*shape[:2], -1)
    expected = np.stack([ndimage.map_coordinates(planes[..., c], where, order=order, mode="nearest")
                         for c in range(planes.shape[2])], axis=-1)
    got = lic.resampled(values, height, width, order)
    assert got.dtype == np.float32
    np.testing.assert_allclose(got, expected.reshape(got.shape), atol=5e-6)


def test_slice_of_a_volume() -> None:
    volume = np.arange(5 * 3 * 4 * 3, dtype=np.float32).reshape(5, 3, 4, 3)
    assert np.array_equal(lic.slice_of(volume), volume[2, :, :, :2])
    side, top = lic.slice_of(volume, "side"), lic.slice_of(volume, "top")
    assert (side.shape, top.shape) == ((3, 5, 2), (5, 4, 2))
    assert side[2, 4].tolist() == volume[4, 2, 2, [2, 1]].tolist()  # y up, z to the right
    assert top[4, 3].tolist() == volume[4, 1, 3, [0, 2]].tolist()
    with pytest.raises(ValueError, match="plane"):
        lic.slice_of(volume, "back")


@pytest.mark.parametrize("bad", [np.zeros((4, 4)), np.zeros((4, 4, 3)), np.full((4, 4, 2), np.nan)])
def test_what_is_no_field_is_refused(bad: np.ndarray) -> None:
    with pytest.raises(ValueError, match="field"):
        lic.picture(bad, 32)


def test_a_solid_is_plain_and_has_a_line_round_it():
    y, x = np.mgrid[:20, :30]
    distance = np.hypot(x - 14.5, y - 12.5) - 5
    shown = lic.with_solids(np.full((60, 90, 3), 0.5, np.float32), distance)
    assert np.allclose(shown[60 - 39, 45], lic.SOLID) and np.allclose(shown[50, 80], 0.5)  # y up
    assert shown.min() < 0.2


def test_divergence_is_red_in_a_source_blue_in_a_sink_and_white_in_a_curl():
    y, x = np.mgrid[:24, :24] - 11.5
    bump = np.exp(-(x**2 + y**2) / 30)
    source = np.stack([x * bump, y * bump], -1).astype(np.float32)
    centre = np.s_[20:28, 20:28]
    red, blue = (lic.divergence(sign * source, 48)[centre].mean(axis=(0, 1)) for sign in (1, -1))
    assert red[0] > 0.8 > 0.6 > red[2] and blue[2] > 0.8 > 0.6 > blue[0]
    dy, dx = np.gradient(bump)
    np.testing.assert_allclose(lic.divergence(np.stack([dy, -dx], -1), 48), 1, atol=1e-3)
    assert lic.divergence(np.zeros((2, 5, 2)), 10).shape == (4, 10, 3)
