"""A matte that moves: its area stays, its loop closes, and τ says how much of it moves."""

import numpy as np
import pytest
from scipy import ndimage

from synth.photo.boundary import displaced, displacements, inpainted, mixed, with_area

SHAPE, FRAMES = (60, 80), 12


def flame():
    y, x = np.mgrid[:SHAPE[0], :SHAPE[1]]
    return ndimage.gaussian_filter(np.float32(np.hypot((x - 40) / 14, (y - 28) / 20) < 1), 2)


def licking():
    """Upwards, and from side to side in waves that rise; a loop."""
    y, x = np.mgrid[:SHAPE[0], :SHAPE[1]]
    phase = 2 * np.pi * (y / 20 - np.arange(FRAMES)[:, None, None] / FRAMES)
    return np.stack([1.5 * np.sin(phase) + 0 * x, np.full_like(phase, 1.0) + 0 * x], axis=-1).astype(np.float32)


def test_the_area_stays():
    found = mixed(flame(), licking(), 0.8)
    assert found.shape == (FRAMES, *SHAPE)
    assert found.min() >= 0 and found.max() <= 1
    np.testing.assert_allclose(found.sum(axis=(1, 2)), flame().sum(), rtol=1e-3)


def test_without_dynamics_it_stands():
    for frame in mixed(flame(), licking(), 0.0):
        np.testing.assert_allclose(frame, flame(), atol=2e-3)


def test_more_dynamics_move_it_farther():
    def farthest(dynamics):
        return np.abs(mixed(flame(), licking(), dynamics) - flame()).mean()

    assert 0.001 < farthest(0.4) < farthest(0.7) < farthest(0.9)


def test_the_loop_closes():
    found = mixed(flame(), licking(), 0.8)
    steps = np.sqrt(((np.roll(found, -1, axis=0) - found) ** 2).mean(axis=(1, 2)))
    assert steps[-1] <= 1.2 * np.median(steps)


@pytest.mark.parametrize("matte", [np.zeros(SHAPE, np.float32), np.ones(SHAPE, np.float32)])
def test_an_empty_and_a_full_matte_stay_so(matte):
    for frame in mixed(matte, licking(), 0.8):
        np.testing.assert_allclose(frame, matte, atol=1e-3)


@pytest.mark.parametrize("dynamics", [-0.1, 1.0, np.nan])
def test_dynamics_outside_their_range_are_refused(dynamics):
    with pytest.raises(ValueError, match=r"\[0, 1\)"):
        mixed(flame(), licking(), dynamics)


def changes():
    """Round in a circle, in a loop."""
    turn = 2 * np.pi * np.arange(FRAMES) / FRAMES
    found = np.zeros((FRAMES, *SHAPE, 2), np.float32)
    found[..., 0], found[..., 1] = np.cos(turn)[:, None, None], np.sin(turn)[:, None, None]
    return found


def rising(speed):
    return np.broadcast_to(np.float32([0, speed]), (*SHAPE, 2)).copy()


def test_a_displacement_is_what_the_changes_add_up_to_and_fades():
    """Of one change at frame 0, in a flow that stands: τ, τ², …"""
    once = np.zeros((FRAMES, *SHAPE, 2), np.float32)
    once[0, ..., 0] = 1
    found = displacements(rising(0), once, 0.5)[..., 0]
    np.testing.assert_allclose(found[1:6, 30, 40], 0.5 ** np.arange(1, 6), atol=2e-3)


def test_a_displacement_is_carried_along_the_mean():
    here = np.zeros((FRAMES, *SHAPE, 2), np.float32)
    here[0, 10, :, 0] = 1
    found = displacements(rising(3), here, 0.9)[..., 0]
    assert found[4, :, 40].argmax() == 10 + 3 * 4


def test_displacements_close_their_loop():
    found = displacements(rising(2), changes(), 0.9)
    steps = np.hypot(*(np.roll(found, -1, axis=0) - found).transpose(3, 0, 1, 2)).mean(axis=(1, 2))
    assert steps[-1] <= 1.2 * np.median(steps)


def test_a_displaced_matte_has_its_shape_elsewhere_and_its_area():
    by = np.broadcast_to(np.float32([4, 0]), (*SHAPE, 2)).copy()
    np.testing.assert_allclose(displaced(flame(), by)[:, 10:70], np.roll(flame(), 4, axis=1)[:, 10:70], atol=1e-5)
    found = with_area(displaced(flame(), by), float(flame().sum()) * 0.98)
    assert found.sum() == pytest.approx(flame().sum() * 0.98, rel=1e-3)


@pytest.mark.parametrize("dynamics", [-0.1, 1.0, np.nan])
def test_displacements_outside_their_range_are_refused(dynamics):
    with pytest.raises(ValueError, match=r"\[0, 1\)"):
        displacements(rising(1), changes(), dynamics)


def test_a_background_goes_on_behind_what_hides_it():
    y, x = np.mgrid[:SHAPE[0], :SHAPE[1]]
    wall = np.stack([0.2 + 0.005 * x, 0.3 + 0 * x, 0.5 + 0 * x], axis=-1).astype(np.float32)
    hidden = np.float32(np.hypot(x - 40, y - 30) < 9)
    seen = np.where(hidden[..., None] > 0, np.float32(1), wall)
    np.testing.assert_allclose(inpainted(seen, hidden), wall, atol=0.03)
    np.testing.assert_array_equal(inpainted(seen, hidden)[hidden == 0], wall[hidden == 0])
    np.testing.assert_array_equal(inpainted(seen, np.ones(SHAPE)), seen)
