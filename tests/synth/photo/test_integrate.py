"""Differences that are blended: nothing is lost where pieces meet, loops close, and neighbours that continue do so."""

import numpy as np
import pytest

from synth.photo.assign import Shown, nodes
from synth.photo.index import CELLS
from synth.photo.integrate import BANDS, bands, differences, looped, motion_field, phases, weights
from synth.photo.pieces import VERSIONS, Cut

CUT, SHAPE = Cut(32), (64, 96)
STRAIGHT = VERSIONS.index((1.0, 0.0, False))


def shown(corners, clips, velocity=(0.0, 0.0)):
    count = len(corners)
    return Shown(np.array(clips), np.full(count, STRAIGHT), np.array(corners),
                 np.broadcast_to(np.float32(velocity), (count, CELLS, CELLS, 2)), np.zeros(count, int))


def noise(seed, frames=12, shape=(80, 112)):
    return np.random.Generator(np.random.Philox(seed)).integers(0, 256, (frames, *shape)).astype(np.uint8)


@pytest.mark.parametrize(("blending", "power"), [("roots", 2), ("shares", 1)])
def test_weights_add_up_to_one_where_the_matte_is(blending, power):
    matte = np.ones(SHAPE)
    matte[:, 70:] = 0
    of = nodes(matte, CUT)
    total = np.zeros((BANDS, *SHAPE))
    for p, (y, x) in enumerate(of.corner):
        low, left = max(y, 0), max(x, 0)
        part = weights(of, SHAPE, CUT, blending)[p][:, low - y:SHAPE[0] - y, left - x:SHAPE[1] - x]
        total[:, low:low + part.shape[1], left:left + part.shape[2]] += part**power
    np.testing.assert_allclose(total[:, :, :70], 1, atol=1e-5)


def test_fine_bands_change_hands_sooner():
    of = nodes(np.ones((64, 200)), CUT)
    p = int(np.flatnonzero((of.corner == [16, 80]).all(axis=1))[0])
    fine, _, coarse = weights(of, (64, 200), CUT)[p][:, 16]
    assert ((fine > 0.05) & (fine < 0.95)).sum() < ((coarse > 0.05) & (coarse < 0.95)).sum()


def test_bands_add_up():
    values = noise(1, 5, (32, 32)).astype(np.float32)
    found = bands(values)
    assert len(found) == BANDS
    np.testing.assert_allclose(np.sum(found, axis=0), values, atol=1e-3)
    assert found[0].std() > found[1].std() > found[2].std()


@pytest.mark.parametrize(("blending", "kept"), [("roots", 1.0), ("shares", 0.6)])
def test_the_deviation_between_pieces_and_at_their_middles(blending, kept):
    """The same, and less with weights that add up to one."""
    of = nodes(np.ones(SHAPE), CUT)
    count = len(of.corner)
    random = np.random.Generator(np.random.Philox(7))
    corners = [(int(y), int(x)) for y, x in random.integers(0, [48, 80], (count, 2))]
    clips = {k: noise(k, 24) for k in range(count)}
    found = differences(of, shown(corners, range(count)), clips.__getitem__, SHAPE, CUT, 24, 1, blending)
    deviation = found.bands.sum(axis=0).std(axis=0)
    y, x = (np.mgrid[:64, :96] % 16)
    # pieces begin at multiples of 16, and their middles lie there too
    between, middle = (np.abs(y - 8) < 2) & (np.abs(x - 8) < 2), (y < 1) & (x < 1)
    assert deviation[between].mean() / deviation[middle].mean() == pytest.approx(kept, abs=0.1)
    np.testing.assert_allclose(found.bands.sum(axis=0).mean(axis=0), 0, atol=1e-2)


def test_pieces_that_continue_give_the_clip_back():
    """All nodes show one clip as it lies: the differences are its own, at one phase."""
    clip = noise(3, 12, SHAPE)
    inner = np.zeros(SHAPE)
    inner[24:40, 24:72] = 1
    of = nodes(inner, CUT)
    kept = ((of.corner >= 0) & (of.corner + 32 <= SHAPE)).all(axis=1)
    assert kept.all()
    all_of_it = shown(of.corner, [0] * len(of.corner))
    start = phases(of, all_of_it, 5)
    assert len(set(start.tolist())) == 1
    found = differences(of, all_of_it, lambda _: clip, SHAPE, CUT, 12, 5)
    expected = np.roll(clip.astype(np.float32) - clip.mean(axis=0, dtype=np.float32), -int(start[0]), axis=0)
    middle = np.s_[:, 28:36, 32:64]
    # weights of equal differences add up to more than one between pieces
    ratio = (found.bands.sum(axis=0)[middle] * expected[middle]).sum(axis=0) / (expected[middle] ** 2).sum(axis=0)
    assert 0.9 < np.median(ratio) < 1.5
    correlation = np.corrcoef(found.bands.sum(axis=0)[middle].ravel(), expected[middle].ravel())[0, 1]
    assert correlation > 0.9


def test_pieces_that_do_not_continue_begin_at_phases_of_their_own():
    of = nodes(np.ones(SHAPE), CUT)
    start = phases(of, shown([(0, 0)] * len(of.corner), range(len(of.corner))), 5)
    assert len(set(start.tolist())) > 0.9 * len(start)


@pytest.mark.parametrize(("count", "length"), [(12, 12), (12, 24), (12, 30), (40, 24), (25, 24), (12, 13)])
def test_a_loop_of_any_length_closes(count, length):
    """White in time: mixed frames are nearer to each other, but the last is no farther from the first than others."""
    values = noise(4, count, (30, 30)).astype(np.float32) - 127.5
    found = looped(values, length, 5)
    assert found.shape == (length, 30, 30)
    steps = np.sqrt(((np.roll(found, -1, axis=0) - found) ** 2).mean(axis=(1, 2)))
    assert steps[-1] <= 1.05 * steps[:-1].max()
    assert found.std() / values.std() == pytest.approx(1, abs=0.12)


def test_a_slow_clip_stays_slow():
    angle = 2 * np.pi * np.arange(40) / 40
    values = np.cos(angle)[:, None, None].astype(np.float32) * np.ones((40, 2, 2), np.float32)
    for length in (40, 60, 80, 30):
        found = looped(values, length, 0)[:, 0, 0]
        assert np.abs(np.diff(np.append(found, found[0]))).max() < 0.5


def test_the_motion_field_is_that_of_the_pieces_and_none_without():
    matte = np.zeros(SHAPE)
    matte[20:44, 20:50] = 1
    of = nodes(matte, CUT)
    found = motion_field(of, shown([(0, 0)] * len(of.corner), [0] * len(of.corner), (1.5, -0.5)), SHAPE, CUT)
    np.testing.assert_allclose(found[20:44, 20:50], np.broadcast_to([1.5, -0.5], (24, 30, 2)), atol=1e-3)
    assert not found[:, 90:].any()
