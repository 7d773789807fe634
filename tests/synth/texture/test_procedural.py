"""Samples by procedure: the same bits, the right direction, nothing that a sample may not be."""

import numpy as np
import pytest

from synth.texture import procedural
from synth.texture.sample import main_direction, sample

PROCEDURES = (procedural.canes, procedural.straw, procedural.scales)


@pytest.mark.parametrize("procedure", PROCEDURES)
def test_a_seed_gives_one_picture_and_another_seed_another(procedure):
    picture = procedure(40, 3)
    assert picture.shape == (40, 40, 3) and picture.dtype == np.float32 and picture.flags.c_contiguous
    np.testing.assert_array_equal(picture, procedure(40, 3))
    assert np.abs(picture - procedure(40, 4)).mean() > 0.01


@pytest.mark.parametrize("procedure", PROCEDURES)
def test_a_picture_uses_the_range_of_a_display(procedure):
    picture = procedure()
    assert picture.min() >= 0 and 0.5 < picture.max() <= 1
    made = sample(picture, direction=procedural.DIRECTION)
    assert made.luminance.std() > 0.1, "it is faint"
    assert 0.3 < made.luminance.mean() < 0.7


@pytest.mark.parametrize("procedure", PROCEDURES)
def test_no_corner_differs_from_the_others(procedure):
    """Patches from anywhere must go together: no part is darker or plainer."""
    luminance = sample(procedure()).luminance
    parts = [luminance[y:y + 64, x:x + 64] for y in (0, 64) for x in (0, 64)]
    # a quarter holds seven canes, each of another tone
    assert np.ptp([p.mean() for p in parts]) < 0.5 * luminance.std()
    assert np.ptp([p.std() for p in parts]) < 0.3 * luminance.std()


@pytest.mark.parametrize("procedure", [procedural.canes, procedural.straw])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_canes_and_straw_run_upward(procedure, seed):
    made = sample(procedure(seed=seed))
    assert made.direction == pytest.approx(procedural.DIRECTION, abs=np.deg2rad(1.5))
    assert made.has_direction and made.share > 0.8


def test_scales_have_a_head_and_no_direction_to_be_measured():
    made = sample(procedural.scales(), direction=procedural.DIRECTION)
    assert not made.has_direction
    # upward a scale grows dark into the shadow of the next; down across its rim it is suddenly dark: heads are up
    steps = np.diff(made.luminance.astype(float), axis=0)
    assert (steps**3).mean() > 0.5 * (steps**2).mean() ** 1.5


def test_a_sample_of_seven_pixels_is_refused():
    with pytest.raises(ValueError, match="8 pixels"):
        procedural.canes(7)


def test_a_turned_sample_is_measured_turned():
    picture = sample(np.ascontiguousarray(procedural.straw().transpose(1, 0, 2)))
    assert abs((main_direction(picture.luminance) + np.pi / 2) % np.pi - np.pi / 2) < np.deg2rad(1.5)
