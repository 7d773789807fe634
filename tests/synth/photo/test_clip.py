"""Grey values as eight bits."""

import numpy as np
import pytest

from synth.photo.clip import KNEE, eight_bit, film


def test_grey_is_rounded_and_kept_in_range():
    grey = np.array([-0.2, 0, 0.5 / 255 - 1e-6, 0.5, 1, 1.4])
    np.testing.assert_array_equal(eight_bit(grey), [0, 0, 0, 128, 255, 255])


def test_film_keeps_what_is_below_its_knee_and_never_reaches_white():
    below = np.linspace(0, KNEE, 9)
    np.testing.assert_array_equal(film(below), below)
    above = film(np.linspace(KNEE, 20, 400))
    assert (np.diff(above) > 0).all() and above[-1] < 1
    assert film(np.array(KNEE + 1e-4)) - KNEE == pytest.approx(1e-4, rel=1e-2), "its slope has no step"
