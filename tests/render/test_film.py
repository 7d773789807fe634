"""Lens and film."""

import numpy as np

from render.film import GRAIN, developed


def test_light_blooms_round_what_is_bright() -> None:
    light = np.zeros((80, 80, 3), np.float32)
    light[38:42, 38:42] = 50.0
    seen = developed(light, 1).mean(axis=2)
    assert seen[40, 48] > 0.02 > seen[2:10, 2:10].mean()
    assert seen.min() >= 0 and seen.max() <= 1


def test_grain_is_faint_and_of_the_seed() -> None:
    light = np.full((60, 60, 3), 0.18, np.float32)
    first = developed(light, 1)
    np.testing.assert_array_equal(first, developed(light, 1))
    assert 0 < np.abs(first - developed(light, 2)).mean() < GRAIN
