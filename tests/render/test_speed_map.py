"""Speed as colour: an even map, a texture that stays visible in it, and a legend that says what it shows."""

import itertools

import numpy as np
import pytest

from render import lic, speed_map, tonemap


def test_lightness_rises_throughout_and_steps_are_even() -> None:
    lab = speed_map.colours(np.linspace(0, 1, 101))
    steps = np.diff(lab, axis=0)
    assert (steps[:, 0] > 0.004).all()  # a hundredth of its lightness is 0.0056
    assert np.allclose(np.linalg.norm(steps, axis=1), np.linalg.norm(steps, axis=1).mean(), rtol=0.01)
    assert lab[0, 0] < 0.35 and lab[-1, 0] > 0.89


def test_every_colour_is_one_that_a_display_has() -> None:
    light = tonemap.oklab_to_linear(speed_map.table())
    assert light.min() > 0 and light.max() < 1


def test_beyond_its_range_the_map_stays() -> None:
    ends = speed_map.colours(np.array([0.0, 1.0]))
    np.testing.assert_array_equal(speed_map.colours(np.array([-3.0, 2.0])), ends)


def test_colours_differ_for_eyes_without_red_or_green() -> None:
    """In lightness and in blue against yellow alone, which all eyes see."""
    lab = speed_map.colours(np.linspace(0, 1, 11))[:, [0, 2]]
    distance = np.linalg.norm(lab[:, None] - lab[None], axis=-1)
    assert distance[~np.eye(11, dtype=bool)].min() > 0.05


def textured(mean: float, deviation: float) -> np.ndarray:
    """Grey noise (40, 60, 3), linear light, of this mean Oklab lightness."""
    lightness = np.random.default_rng(1).normal(mean, deviation, (40, 60))
    lightness += mean - lightness.mean()
    return tonemap.oklab_to_linear(np.stack([lightness, 0 * lightness, 0 * lightness], -1))


@pytest.mark.parametrize("share", [0.0, 0.3, 0.6, 1.0])
def test_a_texture_keeps_its_relief_in_the_colour_of_its_speed(share: float) -> None:
    light = textured(0.5, 0.06)
    lab = tonemap.linear_to_oklab(speed_map.tinted(light, np.full((40, 60), share), 0.5))
    wanted = speed_map.colours(np.array(share))
    assert np.abs(lab.mean((0, 1)) - wanted).max() < 0.02
    assert lab[..., 0].std() == pytest.approx(0.06 * speed_map.RELIEF, rel=0.2)
    grey = tonemap.linear_to_oklab(light)[..., 0]
    assert np.corrcoef(lab[..., 0].ravel(), grey.ravel())[0, 1] > 0.97


def test_light_over_one_and_none_at_all_have_colours_of_a_display() -> None:
    light = np.stack([np.full((4, 4), value) for value in (0.0, 9.0, 0.5)], axis=-1)
    shown = speed_map.tinted(light, np.linspace(-1, 2, 16).reshape(4, 4), 0.5)
    assert shown.shape == (4, 4, 3) and shown.dtype == np.float32
    assert np.isfinite(shown).all() and shown.min() >= 0 and shown.max() <= 1


@pytest.mark.parametrize(("least", "greatest", "expected"), [
    (0, 14.8, [0, 5, 10]), (0.034, 0.0712, [0.04, 0.05, 0.06, 0.07]), (0, 1, [0, 0.2, 0.4, 0.6, 0.8, 1.0]),
    (-3, 3, [-2, 0, 2]), (1200, 5100, [2000, 3000, 4000, 5000])])
def test_the_numbers_between_are_round_and_few(least: float, greatest: float, expected: list[float]) -> None:
    assert np.allclose(speed_map.ticks(least, greatest), expected)


@pytest.mark.parametrize("width", [96, 300, 480, 1200])
def test_a_legend_is_a_bar_over_its_numbers_as_wide_as_asked(width: int) -> None:
    page = speed_map.legend(0.0, 14.83, "m/s", width)
    assert page.shape[1:] == (width, 3) and page.min() >= 0 and page.max() <= 1
    coloured = np.ptp(page, axis=2) > 0.05
    rows, columns = np.flatnonzero(coloured.any(1)), np.flatnonzero(coloured.any(0))
    bar = page[rows[0] + 1, columns[0]:columns[-1] + 1]
    meant = tonemap.to_srgb(tonemap.oklab_to_linear(speed_map.colours(np.linspace(0, 1, len(bar)))))
    np.testing.assert_allclose(bar, meant, atol=0.02)
    assert len(bar) > 0.7 * width and len(rows) >= 10
    below, above = page[rows[-1] + 1:], page[:rows[0]]
    assert (below.min(axis=(1, 2)) < 0.5).any() and (above.min(axis=(1, 2)) < 0.5).any()
    # letters do not reach the border, where they would be cut
    assert below[:, [0, -1]].min() > 0.9 and below[-1].min() > 0.9


@pytest.mark.parametrize(("greatest", "count"), [(14.83, 4), (15.2, 4), (10.0, 6), (8.2, 5)])
def test_numbers_of_a_legend_stand_apart(greatest: float, count: int) -> None:
    """0, 5, 10 and 14.8; of 15.2 there is no 15 beside it; 0, 2 … 10; 0, 2 … 6, 8.2 without 8."""
    page = speed_map.legend(0.0, greatest, "m/s", 480)
    letters = page[-round(1.2 * 22):].min(axis=(0, 2)) < 0.6
    gaps = [len(list(run)) for ink, run in itertools.groupby(letters) if not ink]
    assert sum(gap > 12 for gap in gaps[1:-1]) + 1 == count


def test_a_narrow_legend_is_as_wide_as_its_letters() -> None:
    page = speed_map.legend(0.0, 0.01234, "heights per second", 32)
    assert 60 < page.shape[1] < 200 and page[:, [0, -1]].min() > 0.9


def test_a_legend_of_nothing_is_refused() -> None:
    for least, greatest in ((1.0, 1.0), (2.0, 1.0), (np.nan, 1.0)):
        with pytest.raises(ValueError, match="from less to more"):
            speed_map.legend(least, greatest, "m/s", 100)


def test_its_pale_end_is_no_land() -> None:
    """Land is plain grey: the map's grey value passes it, its colour does not."""
    land = tonemap.linear_to_oklab(tonemap.from_srgb(np.full(3, lic.SOLID)))
    assert np.linalg.norm(speed_map.table() - land, axis=1).min() > 0.07
