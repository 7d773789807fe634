"""Assignment: a target made of the clips themselves gets its own pieces back; wishes are kept, or widened and said."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage

from synth.photo.assign import AGAIN, Database, Settings, Wanted, _between, _limited, _printed, assign, nodes
from synth.photo.index import exposures, index
from synth.photo.pieces import VERSIONS, Cut
from synth.photo.words import codebook, descriptors

CUT, SHAPE, FRAMES = Cut(32), (80, 112), 8
FEW = Settings(candidates=20)


def clip(seed, sigma, velocity, low=40, high=210):
    grain = ndimage.gaussian_filter(np.random.Generator(np.random.Philox(seed)).random(SHAPE), sigma, mode="wrap")
    grain = np.uint8(low + (high - low) * (grain - grain.min()) / np.ptp(grain))
    frames = np.stack([np.roll(grain, (round(velocity[1] * k), round(velocity[0] * k)), axis=(0, 1))
                       for k in range(FRAMES)])
    return frames, np.broadcast_to(np.float32(velocity), (*SHAPE, 2))


CLIPS = [clip(1, (3.0, 1.0), (0, -2)), clip(2, (1.0, 3.0), (2, 0)), clip(3, 2.0, (-1, 1), 10, 90)]


@pytest.fixture(scope="module")
def database():
    words = codebook(np.concatenate([descriptors(e, CUT.step).reshape(-1, 128) for frames, _ in CLIPS
                                     for e in exposures(frames)]), 40)
    return Database.joined([index(frames, words, CUT, velocity) for frames, velocity in CLIPS], words)


def full(shape=SHAPE):
    return np.ones(shape, np.float32)


def test_nodes_cover_the_matte_and_neighbours_are_pairs():
    matte = full()
    matte[:, 60:] = 0
    of = nodes(matte, CUT)
    count = np.zeros(SHAPE, int)
    for y, x in of.corner:
        count[max(y, 0):y + 32, max(x, 0):x + 32] += 1
    assert (count[:, :59] == 4).all()
    assert (count[:, 80:] == 0).all()
    for (p, q), across in zip(of.edges, of.across, strict=True):
        assert p < q
        np.testing.assert_array_equal(of.corner[q] - of.corner[p], [0, 16] if across else [16, 0])
    rows, columns = (len(set(of.corner[:, axis].tolist())) for axis in (0, 1))
    assert len(of.edges) == rows * (columns - 1) + columns * (rows - 1)


def test_an_empty_matte_is_refused():
    with pytest.raises(ValueError, match="matte is empty"):
        nodes(np.zeros(SHAPE), CUT)


@pytest.mark.parametrize("which", range(3))
def test_a_frame_of_a_clip_gets_pieces_of_that_clip(database, which):
    frames, _ = CLIPS[which]
    of, found = assign(exposures(frames)[2], full(), database, CUT, Wanted(), replace(FEW, of_one_clip=1.0))
    inner = ((of.corner >= 0) & (of.corner + 32 <= SHAPE)).all(axis=1)
    assert (database.clip[found.piece[inner]] == which).mean() > 0.9


def test_two_clips_side_by_side_get_their_own():
    words = codebook(np.concatenate([descriptors(frames[0], CUT.step).reshape(-1, 128) for frames, _ in CLIPS]), 40)
    database = Database.joined([index(frames, words, CUT, velocity) for frames, velocity in CLIPS], words)
    target = np.concatenate([CLIPS[0][0][0][:, :56], CLIPS[1][0][0][:, :56]], axis=1)
    of, found = assign(target, full(), database, CUT, Wanted(), FEW)
    left, right = of.corner[:, 1] + 32 <= 56, of.corner[:, 1] >= 56
    assert (database.clip[found.piece[left]] == 0).mean() > 0.8
    assert (database.clip[found.piece[right]] == 1).mean() > 0.8


def test_the_wanted_direction_is_kept(database):
    orientation = np.broadcast_to(np.float32([1.0, 0.0]), (*SHAPE, 2))
    _, found = assign(CLIPS[0][0][0], full(), database, CUT, Wanted(orientation), FEW)
    assert (found.angle == 45).all()
    mean = database.pieces.features[found.piece][..., :2].astype(float).mean(axis=(1, 2))
    assert (mean[:, 0] >= np.cos(np.pi / 4) * np.hypot(*mean.T) - 1e-3).all()


def test_a_direction_that_no_clip_has_is_widened_and_said(database):
    """The fixture's clips move down, right, up left, and mirrored and turned; straight up there are few."""
    down_only = np.flatnonzero(database.clip == 0)
    parts = {name: getattr(database.pieces, name)[down_only]
             for name in ("version", "corner", "histogram", "brightness", "features")}
    few = Database(database.clip[down_only], type(database.pieces)(**parts), database.words)
    up = np.broadcast_to(np.float32([0.0, 1.0]), (*SHAPE, 2))
    _, found = assign(CLIPS[0][0][0], full(), few, CUT, Wanted(up), FEW)
    assert (found.angle == 180).all()
    assert np.isfinite(found.energies).all()


def test_a_small_database_keeps_the_direction_with_fewer_candidates(database):
    """As many candidates as there are pieces: those of the other clips flow elsewhere."""
    orientation = np.broadcast_to(np.float32([1.0, 0.0]), (*SHAPE, 2))
    _, found = assign(CLIPS[0][0][0], full(), database, CUT, Wanted(orientation), replace(FEW, candidates=1000))
    assert (found.angle == 45).all()


def test_the_wanted_speed_is_kept(database):
    slow = np.full(SHAPE, 0.75, np.float32)
    _, found = assign(CLIPS[0][0][0], full(), database, CUT, Wanted(None, slow), FEW)
    speed = np.hypot(*database.pieces.features[found.piece][..., :2].astype(float).mean(axis=(1, 2)).T)
    assert (speed[found.angle == 45] <= 1.5 + 1e-3).all()
    assert (speed[found.angle == 45] >= 0.375 - 1e-3).all()
    assert (found.angle == 45).mean() > 0.9


def test_neighbours_that_continue_cost_nothing_and_the_same_piece_again_costs_more(database):
    pieces = database.pieces
    straight = VERSIONS.index((1.0, 0.0, False))
    mine = np.flatnonzero((pieces.version == straight) & (database.clip == 0))
    here = next(n for n in mine if (pieces.corner[n] == [16, 16]).all())
    beside = next(n for n in mine if (pieces.corner[n] == [16, 32]).all())
    of = nodes(full((32, 48)), CUT)
    edge = int(np.flatnonzero(of.across)[0])
    labels = np.tile([here, beside], (len(of.corner), 1))
    found = _between(of, labels, database, FEW)[edge]
    assert found[0, 1] == pytest.approx(0, abs=2e-2)
    assert found[1, 0] > 0.05
    assert found[0, 0] >= AGAIN


def test_as_printed_the_least_similar_candidate_is_preferred_and_powers_are_compared(database):
    """Eq. 5 adds a similarity to what is minimized; the power of the mean (Eq. 2) knows no direction."""
    printed = replace(FEW, energy="printed", weight=0.0)
    target = exposures(CLIPS[0][0])[0]
    (_, mended), (_, found) = (assign(target, full(), database, CUT, Wanted(), of)
                               for of in (replace(FEW, weight=0.0, texture=0.0, brightness=0.0), printed))
    assert 1 - mended.energies[1] / len(mended.piece) > found.energies[1] / len(found.piece)
    pieces = database.pieces
    rows = [next(n for n in np.flatnonzero(database.clip == 1) if VERSIONS[pieces.version[n]] == (1.0, 0.0, flipped)
                 and (pieces.corner[n] == [16, 16]).all()) for flipped in (False, True)]
    of = nodes(full((32, 48)), CUT)
    edge, labels = int(np.flatnonzero(of.across)[0]), np.tile(rows, (len(of.corner), 1))
    only_mean = replace(printed, sigma=0.0, rho=0.0)
    assert _between(of, labels, database, replace(FEW, sigma=0.0, rho=0.0))[edge][0, 1] > 0.5
    assert _printed(of, labels, database, only_mean)[edge][0, 1] == pytest.approx(0, abs=1e-2)


def test_of_one_clip_come_no_more_than_its_share_unless_there_are_no_others():
    value, clip = np.arange(12.0), np.array([0] * 8 + [1] * 4)
    assert _limited(value, clip, 8, 0.5).tolist() == [0, 1, 2, 3, 8, 9, 10, 11]
    assert _limited(value, np.zeros(12, int), 6, 0.5).tolist() == [0, 1, 2, 3, 4, 5]


@pytest.mark.parametrize("minimizer", ["messages", "expansion", "modes"])
def test_the_energy_is_no_higher_than_by_the_data_term_alone(database, minimizer):
    _, found = assign(CLIPS[2][0][0], full(), database, CUT, Wanted(), replace(FEW, minimizer=minimizer, weight=1.0))
    before, after = found.energies
    assert after <= before
    assert after < before or minimizer == "expansion"


@pytest.mark.parametrize(("wrong", "told"), [
    ({"candidates": 0}, "one candidate"), ({"of_one_clip": 0.0}, "one candidate"), ({"rho": -1.0}, "not negative"),
    ({"minimizer": "luck"}, "no minimizer 'luck'")])
def test_settings_that_make_no_sense(wrong, told):
    with pytest.raises(ValueError, match=told):
        Settings(**wrong)


def test_a_database_without_pieces_is_refused(database):
    frames, _ = CLIPS[0]
    still = index(np.repeat(frames[:1], 4, axis=0), database.words, CUT, np.zeros((*SHAPE, 2), np.float32))
    with pytest.raises(ValueError, match="no clip of the database"):
        Database.joined([still], database.words)
