"""The checks: a good clip passes, and each fault that is put into it is named."""

import dataclasses

import numpy as np
import pytest
from scipy import ndimage

from synth.photo import checks, clips
from synth.photo.clip import Clip, eight_bit
from synth.photo.tiles import noise, rng

FRAMES = 32
STILL = 0.5 + 0.08 * noise((96, 128), rng(1), 10.0)


def drifting():
    """Noise that moves to the right, once round in FRAMES frames of 4 pixels, over a ground that stays."""
    moving = 0.08 * noise((96, 128), rng(2), 10.0, falloff=1.5)
    frames = np.stack([np.roll(moving, 4 * t, axis=1) for t in range(FRAMES)])
    velocity = np.broadcast_to(np.float32([4, 0]), (96, 128, 2))
    return Clip(eight_bit(0.7 * STILL + 0.15 + frames), velocity, np.ones((96, 128), np.float32))


GOOD = drifting()


def test_a_good_clip_has_no_faults():
    assert checks.faults(GOOD) == []


def spoilt(**parts):
    return dataclasses.replace(GOOD, **parts)


SPOILT = {
    "moves:": spoilt(luma=np.repeat(GOOD.luma[:1], FRAMES, axis=0)),
    "is clipped:": spoilt(luma=np.where(np.arange(128) < 8, np.uint8(255), GOOD.luma)),
    "changes:": spoilt(luma=eight_bit(GOOD.luma / 255 + 0.1 * (np.arange(FRAMES) >= FRAMES // 2)[:, None, None])),
    "jumps from": spoilt(luma=np.concatenate([GOOD.luma[: FRAMES - 5], np.roll(GOOD.luma[FRAMES - 5 :], 21, axis=2)])),
    "has a flat mean:": spoilt(luma=eight_bit(0.5 + (GOOD.luma - GOOD.luma.mean(0)) / 255)),
    "moves otherwise": spoilt(velocity=GOOD.velocity[..., ::-1]),
}


@pytest.mark.parametrize("fault", SPOILT)
def test_a_fault_is_named(fault):
    assert any(line.startswith(fault) for line in checks.faults(SPOILT[fault]))


def test_optical_flow_sees_a_known_motion():
    flow = checks.seen(GOOD, 8)[20:-20, 30:-30].reshape(-1, 2)
    assert np.median(flow[:, 0]) == pytest.approx(4, abs=1.6) and abs(np.median(flow[:, 1])) < 0.2
    assert checks.turn(GOOD) < 10


def test_a_loop_jumps_by_a_step():
    assert checks.jump(GOOD) == pytest.approx(1, abs=0.05)


def test_where_nothing_moves_no_direction_is_right():
    assert checks.turn(spoilt(velocity=0 * GOOD.velocity)) == 180


def grain(seed, shape=(96, 128)):
    values = ndimage.gaussian_filter(np.random.Generator(np.random.Philox(seed)).random(shape), 2, mode="wrap")
    return (values - values.min()) / np.ptp(values)


def test_a_camera_that_pans_is_told_from_a_fluid():
    """Water that falls in the middle of a wall, and one that fills the picture and boils, are no camera."""
    pan = np.stack([np.roll(grain(3, (96, 256)), 2 * k, axis=1)[:, :128] for k in range(12)])
    inside = (np.arange(128) > 47) & (np.arange(128) < 80)
    falling = np.stack([np.where(inside, np.roll(grain(2), 3 * k, axis=0), grain(1)) for k in range(12)])
    boiling = np.stack([0.4 * grain(k) + 0.6 * grain(99) for k in range(12)])
    pan, falling, boiling = (np.uint8(255 * frames) for frames in (pan, falling, boiling))
    assert checks.camera(pan) == pytest.approx(2, abs=0.1)
    assert checks.camera(falling) < checks.SHAKEN
    assert checks.camera(boiling) < checks.SHAKEN


def test_a_cut_is_told_from_water_and_from_a_frame_that_was_lost():
    """Between a river and a cloud, of which the river changes the more from frame to frame."""
    river, cloud = (clips.clip(family, 5, 24, (96, 64)).luma for family in ("river", "cloud"))
    for whole in (river, cloud, np.delete(river, 9, axis=0)):
        assert checks.cut(whole) == 0
    for at in (4, 12, 20):
        assert checks.cut(np.concatenate([river[:at], cloud[at:]])) == at
        assert checks.cut(np.concatenate([cloud[:at], river[at:]])) == at
