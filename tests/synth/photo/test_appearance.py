"""The look of the target: blur along the motion, strength of detail, sums that do not clip, histograms."""

import numpy as np
import pytest
from scipy import ndimage

from synth.photo.appearance import EVENED, added, average, evened, evening, extended, gains, matched, octaves
from synth.photo.integrate import bands

SHAPE = (80, 96)


def grain(seed=1, sigma=1.5, shape=SHAPE):
    values = ndimage.gaussian_filter(np.random.Generator(np.random.Philox(seed)).standard_normal(shape), sigma)
    return (values / values.std()).astype(np.float32)


def test_the_shores_colours_are_left_out():
    picture = np.full((*SHAPE, 3), 0.3, np.float32)
    picture[:, 60:] = [0.0, 1.0, 0.0]
    fluid = np.ones(SHAPE, bool)
    fluid[:, 58:] = False
    assert (extended(picture, fluid) == np.float32(0.3)).all()
    np.testing.assert_array_equal(extended(picture, np.ones(SHAPE, bool)), picture)


def test_the_average_is_blurred_along_the_motion_and_not_across():
    picture = (0.5 + 0.1 * grain(sigma=1.0))[..., None].repeat(3, axis=2)
    motion = np.broadcast_to(np.float32([2, 0]), (*SHAPE, 2)).copy()
    found = average(picture, motion)[8:-8, 16:-16, 0]
    along, across = np.diff(found, axis=1).std(), np.diff(found, axis=0).std()
    assert along < 0.5 * across
    assert found.mean() == pytest.approx(picture[8:-8, 16:-16].mean(), abs=0.01)
    still = average(picture, np.zeros_like(motion))
    assert np.diff(still[..., 0], axis=1).std() > 2 * along


def test_one_colour_stays_one_colour():
    picture = np.full((*SHAPE, 3), 0.4, np.float32)
    y, x = np.mgrid[:SHAPE[0], :SHAPE[1]]
    motion = np.stack([y - 40, 48 - x], axis=-1).astype(np.float32) / 12
    np.testing.assert_allclose(average(picture, motion), picture, atol=1e-5)


@pytest.mark.parametrize("strength", [0.02, 0.1])
def test_gains_give_differences_the_targets_strength(strength):
    target = 0.5 + strength * grain()
    shown = np.stack([20 * grain(seed) for seed in range(2, 14)])
    split = np.stack(bands(shown - shown.mean(axis=0)))
    found = gains(target, split, np.ones(SHAPE, np.float32))
    for band in (0, 1):
        ours = (found[band] * split[band])[:, 12:-12, 12:-12].std()
        theirs = bands(target[None])[band][0][12:-12, 12:-12].std()
        assert ours / theirs == pytest.approx(1, abs=0.2)


def test_a_flat_target_gets_no_differences():
    target = np.full(SHAPE, 0.5, np.float32)
    target[:, :40] += 0.1 * grain()[:, :40]
    split = np.stack(bands(np.stack([20 * grain(seed) for seed in range(2, 8)])))
    found = gains(target, split, np.ones(SHAPE, np.float32))
    assert not found[0][:, 90:].any()
    assert found[0][:, :20].min() > 0


def test_gains_are_bounded_where_clips_show_nothing():
    split = np.full((3, 4, *SHAPE), 1e-4, np.float32)
    assert gains(0.5 + 0.1 * grain(), split, np.ones(SHAPE, np.float32)).max() <= 3 / 255 + 1e-6


def test_sums_stay_within_black_and_white_and_keep_their_order():
    ground = np.linspace(0.0, 1.0, 21, dtype=np.float32)[:, None, None].repeat(3, axis=2)
    for more in (-0.6, -0.1, 0.1, 0.6):
        found = added(ground, np.full((21, 1), more, np.float32))
        assert found.min() >= 0 and found.max() <= 1
        assert abs(more) > 0.1 or (np.diff(found[:, 0, 0]) >= -1e-6).all()
        assert ((found - ground)[3:-3, 0, 0] * more > 0).all()
    np.testing.assert_allclose(added(ground, np.zeros((21, 1))), ground, atol=2e-4)


def test_a_small_change_of_a_middle_grey_is_what_was_asked_for():
    ground = np.full((1, 1, 3), 0.5, np.float32)
    assert added(ground, np.full((1, 1), 0.02))[0, 0, 0] == pytest.approx(0.52, abs=1e-3)


def test_a_darker_colour_is_deeper_and_a_brighter_one_whiter():
    ground = np.float32([[[0.8, 0.4, 0.2]]])
    darker, brighter = (added(ground, np.full((1, 1), more))[0, 0] for more in (-0.1, 0.1))
    assert darker.mean() < ground.mean() < brighter.mean()
    assert darker[2] / darker[0] < 0.25 < brighter[2] / brighter[0]
    assert (np.diff(darker) < 0).all() and (np.diff(brighter) < 0).all()


def test_a_matched_frame_has_the_targets_values_and_no_lattice():
    frame, target = 0.5 + 0.02 * grain(2), 0.4 + 0.1 * grain(3)
    found = matched(frame, target, np.ones(SHAPE, np.float32), 32)
    assert found.mean() == pytest.approx(target.mean(), abs=0.02)
    assert found.std() / target.std() == pytest.approx(1, abs=0.15)
    step = np.abs(np.diff(found, axis=1))
    lines = step[:, 15::16].mean() / np.delete(step, np.s_[15::16], axis=1).mean()
    assert lines == pytest.approx(1, abs=0.1)


@pytest.mark.parametrize(("factor", "gain"), [(0.8, 1.25), (1.1, 1 / 1.1), (0.1, EVENED)])
def test_bands_of_frames_get_the_targets_strength(factor, gain):
    target = 0.5 + 0.05 * grain(4)
    frame = (0.5 + factor * 0.05 * grain(5)).astype(np.float32)
    found = evening([frame], target, np.ones(SHAPE))
    np.testing.assert_allclose(found, gain, rtol=0.1)
    shown = evened(frame[..., None].repeat(3, axis=2), found)[..., 0]
    for ours, before in zip(octaves(shown), octaves(frame), strict=True):
        assert ours.std() / before.std() == pytest.approx(gain, rel=0.15)


def test_regions_side_by_side_show_a_lattice():
    ramp = np.linspace(-0.2, 0.2, SHAPE[1], dtype=np.float32)
    found = matched(0.5 + ramp + 0.02 * grain(2), 0.4 + 0.1 * grain(3), np.ones(SHAPE, np.float32), 32, False)
    step = np.abs(np.diff(found, axis=1))
    assert step[:, 31::32].mean() / np.delete(step, np.s_[31::32], axis=1).mean() > 1.2


def test_what_lies_outside_the_matte_is_not_matched():
    matte = np.zeros(SHAPE, np.float32)
    matte[:, :40] = 1
    frame = 0.5 + 0.02 * grain(2)
    found = matched(frame, 0.4 + 0.1 * grain(3), matte, 32)
    np.testing.assert_allclose(found[:, 60:], frame[:, 60:], atol=1e-6)
