"""What stands still: light on it, and where stones lie."""

import numpy as np
import pytest

from synth.photo.rock import LIGHT, face, lit, pebbles, stones
from synth.photo.tiles import rng

SHAPE = (60, 84)


def test_level_ground_is_as_bright_as_the_light_is_high():
    np.testing.assert_allclose(lit(np.full((5, 7), 3.0)), LIGHT[2])
    y, x = np.mgrid[:5, :7]
    towards, away = lit(-0.5 * y + 0.4 * x), lit(0.5 * y - 0.4 * x)
    assert (towards > LIGHT[2]).all() and (away < LIGHT[2] / 2).all()


def test_a_face_has_its_tone_and_detail():
    rock = face(SHAPE, rng(1), 0.3)
    assert rock.mean() == pytest.approx(0.3, abs=0.02) and rock.std() > 0.05
    assert rock.min() >= 0.02 and rock.max() <= 0.85


def test_stones_lie_where_they_are_put():
    standing = stones(SHAPE, rng(2), np.array([[20.0, 30.0], [60.0, 15.0]]), np.array([12.0, 9.0]))
    assert standing.distance[30, 20] < -3 and standing.distance[15, 60] < -3
    assert standing.distance[50, 70] > 10
    area = (standing.distance < 0).sum()
    assert 0.4 < area / (np.pi * (12**2 + 9**2)) < 1.1, "flattened, never larger"


def test_no_stones_leave_only_water():
    assert (stones(SHAPE, rng(3), np.zeros((0, 2)), np.zeros(0)).distance > 50).all()


def test_pebbles_have_greys_of_their_own():
    bed = pebbles((96, 96), rng(4), 16.0)
    assert bed.min() >= 0.03 and bed.max() <= 0.95 and bed.std() > 0.1
    blocks = bed.reshape(12, 8, 12, 8).std((1, 3))
    assert np.median(blocks) < bed.std(), "a pebble varies less than the bed"
