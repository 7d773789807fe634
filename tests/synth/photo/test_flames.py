"""Flames: where there is light, and where it is hot."""

import numpy as np
import pytest

from synth.photo.flames import GROUND, Flames, flames


@pytest.fixture(scope="module")
def fire() -> Flames:
    return flames(1, 120)


def test_flames_taper_and_the_bed_is_hottest(fire: Flames) -> None:
    light = fire.glow.sum(axis=(0, 2))
    height = (np.arange(len(light)) + 0.5) / len(light)
    low, high = (height > GROUND) & (height < 0.3), height > 0.6
    assert light[low].mean() > 4 * light[high].mean()
    assert light[height < 0.6 * GROUND].max() < 0.02 * light.max()
    hot = (fire.glow * fire.heat).sum(axis=(0, 2)) / np.maximum(light, 1e-9)
    assert hot[low].mean() > 1.3 * hot[(height > 0.45) & (light > 1)].mean()


def test_glow_and_heat_are_what_they_say(fire: Flames) -> None:
    assert fire.glow.shape == fire.heat.shape == fire.risen.age.shape
    assert fire.glow.min() == 0 and fire.heat.min() >= 0 and fire.heat.max() <= 1
    assert not fire.heat[fire.risen.age >= fire.risen.oldest].any(), "air that never was in the fire is cold"


def test_a_seed_is_a_fire(fire: Flames) -> None:
    np.testing.assert_array_equal(fire.glow, flames(1, 120).glow)
    assert np.abs(fire.glow - flames(2, 120).glow).max() > 0.5
