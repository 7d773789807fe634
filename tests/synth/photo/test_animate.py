"""The whole: motion as the user wants it, frames that keep the picture, what is frozen, loops."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage

from synth.photo.animate import Look, Target, composed, matte_displaced, mattes_mixed, motion, over_background
from synth.photo.assign import Shown, Wanted, nodes
from synth.photo.index import CELLS
from synth.photo.integrate import Differences, bands
from synth.photo.pieces import Cut

SHAPE, CUT, FRAMES = (48, 64), Cut(16), 12


def target():
    grain = ndimage.gaussian_filter(np.random.Generator(np.random.Philox(1)).random((*SHAPE, 3)), (1, 1, 0))
    picture = (0.3 + 0.4 * (grain - grain.min()) / np.ptp(grain)).astype(np.float32)
    matte = np.zeros(SHAPE, np.float32)
    matte[8:40, 8:56] = 1
    return Target(picture, ndimage.gaussian_filter(matte, 1.5))


def shown(of, velocity):
    count = len(of.corner)
    return Shown(np.zeros(count, int), np.zeros(count, int), np.zeros((count, 2), int),
                 np.broadcast_to(np.float32(velocity), (count, CELLS, CELLS, 2)), np.zeros(count, int))


def differences(strength=12.0):
    random = np.random.Generator(np.random.Philox(2))
    noise = ndimage.gaussian_filter(random.standard_normal((FRAMES, *SHAPE)), (0, 1, 1)).astype(np.float32)
    noise -= noise.mean(axis=0)
    return Differences(np.stack(bands(strength * noise / noise.std())))


def moves(of=None):
    one = of or target()
    return motion(one, nodes(one.fluid, CUT), shown(nodes(one.fluid, CUT), (1.0, 0.0)), CUT)


def test_without_wishes_it_is_the_pieces_motion_inside_the_fluid():
    found, one = moves(), target()
    np.testing.assert_allclose(found[20:30, 20:40], np.broadcast_to([1.0, 0.0], (10, 20, 2)), atol=1e-3)
    assert not found[one.matte == 0].any()


def test_a_wanted_direction_turns_it_and_a_wanted_speed_is_its_speed():
    up = np.broadcast_to(np.float32([0, 1]), (*SHAPE, 2))
    found = moves(replace(target(), wanted=Wanted(up, np.full(SHAPE, 2.5, np.float32))))[24, 32]
    assert np.hypot(*found) == pytest.approx(2.5, abs=1e-3)
    assert np.degrees(np.arctan2(found[0], found[1])) < 10


def test_what_is_frozen_does_not_move_and_is_the_pictures():
    frozen = np.zeros(SHAPE, bool)
    frozen[16:24, 16:30] = True
    one = replace(target(), frozen=frozen)
    assert not moves(one)[frozen].any()
    frame = over_background(one, np.ones_like(one.picture), one.matte)
    np.testing.assert_array_equal(frame[frozen], one.picture[frozen])
    assert frame[30, 40].min() > 0.99


def composed_all(one, look):
    shown_at = composed(one, differences(), moves(), look, 3)
    return np.stack([shown_at(frame) for frame in range(FRAMES)])


@pytest.mark.parametrize("look", [Look(), Look(carried=0), Look(carried=1, strength=0), Look(carried=0,
                                  matching="histograms"), Look(matching="none")])
def test_frames_keep_the_pictures_mean_and_move(look):
    one = target()
    frames = composed_all(one, look)
    assert frames.shape == (FRAMES, *SHAPE, 3)
    assert frames.min() >= 0 and frames.max() <= 1
    inside = np.s_[:, 14:34, 14:50]
    assert abs(frames[inside].mean() - one.picture[14:34, 14:50].mean()) < 0.03
    steps = np.sqrt(((np.roll(frames, -1, axis=0) - frames)[inside] ** 2).mean(axis=(1, 2, 3)))
    assert steps.min() > 0.002
    assert steps[-1] < 1.3 * np.median(steps)


def test_more_strength_moves_more():
    def change(strength):
        frames = composed_all(target(), Look(carried=0, strength=strength))
        return np.abs(np.diff(frames, axis=0))[:, 14:34, 14:50].mean()

    assert change(0.0) < 1e-6
    assert 1.5 < change(1.0) / change(0.5) < 2.2


def test_a_matte_moves_with_the_fluid_it_cuts_out():
    y, x = np.mgrid[:SHAPE[0], :SHAPE[1]]
    rising = np.stack([np.uint8(128 + 60 * np.sin((y - 2 * k) / 24 * 2 * np.pi) * np.cos(x / 5)) for k in range(12)])
    one = target()
    found = mattes_mixed(one, rising, 0.8)
    assert np.abs(np.diff(found, axis=0)).max() > 1e-3
    np.testing.assert_allclose(found.sum(axis=(1, 2)), one.matte.sum(), rtol=1e-2)
    by = np.broadcast_to(np.float32([3, 1]), (*SHAPE, 2)).copy()
    assert matte_displaced(one, by).sum() == pytest.approx(one.matte.sum(), rel=1e-2)
    np.testing.assert_allclose(matte_displaced(one, 0 * by), one.matte, atol=1e-3)


@pytest.mark.parametrize("wrong", [{"carried": 1.1}, {"carried": -0.1}, {"strength": -1.0}])
def test_looks_that_make_no_sense(wrong):
    with pytest.raises(ValueError, match="carried share"):
        Look(**wrong)


def test_of_a_soft_matte_the_fluids_own_colours_are_taken():
    """A picture that is the fluid over a background is again that, when nothing moves."""
    x = np.mgrid[:SHAPE[0], :SHAPE[1]][1]
    alpha = np.clip((x - 10) / (SHAPE[1] - 20), 0, 1).astype(np.float32)
    fluid, behind = np.float32([0.9, 0.5, 0.1]), np.float32([0.1, 0.2, 0.3])
    picture = (alpha[..., None] * fluid + (1 - alpha[..., None]) * behind).astype(np.float32)
    target = Target(picture, alpha, np.broadcast_to(behind, picture.shape).copy())
    np.testing.assert_allclose(target.foreground, np.broadcast_to(fluid, picture.shape), atol=1e-5)
    np.testing.assert_allclose(over_background(target, target.foreground, alpha), picture, atol=1e-5)
    np.testing.assert_array_equal(Target(picture, np.ones_like(alpha)).foreground, picture)
