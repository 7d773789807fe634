"""Grey values as eight bits."""

import numpy as np

from synth.photo.clip import eight_bit


def test_grey_is_rounded_and_kept_in_range():
    grey = np.array([-0.2, 0, 0.5 / 255 - 1e-6, 0.5, 1, 1.4])
    np.testing.assert_array_equal(eight_bit(grey), [0, 0, 0, 128, 255, 255])
