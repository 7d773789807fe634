"""The steps of a piece whose motion is known, and of two neighbours that have nothing in common."""

import numpy as np
import pytest

from synth.photo.assign import Nodes, Shown
from synth.photo.index import CELLS
from synth.photo.motion import CELL, LEVELS
from synth.photo.pieces import VERSIONS, Cut
from synth.photo.steps import nearest_edge, neighbours, piece

CUT = Cut(32)
STRAIGHT = VERSIONS.index((1.0, 0.0, False))


def noise(seed, frames=24, shape=(80, 112)):
    return np.random.Generator(np.random.Philox(seed)).integers(0, 256, (frames, *shape)).astype(np.uint8)


def test_a_piece_is_cut_round_its_place_and_moved_inwards_at_the_border():
    frames = noise(1, 4)
    for place, corner in (((56, 40), (24, 40)), ((0, 0), (0, 0)), ((111, 79), (48, 80))):
        found = piece(frames, None, place, CUT)
        np.testing.assert_array_equal(found.corner, corner)
        y, x = corner
        np.testing.assert_array_equal(found.frames, frames[:, y:y + 32, x:x + 32])
        np.testing.assert_allclose(found.average, found.frames.mean(axis=0), atol=1e-4)
        assert found.texture.shape == (32 // CELL, 32 // CELL, LEVELS)


def test_a_known_mean_motion_is_taken_and_tells_what_is_significant():
    velocity = np.zeros((80, 112, 2), np.float32)
    velocity[:, 56:] = [0, -3]
    found = piece(noise(2, 4), velocity, (56, 40), CUT)
    assert found.significant[:, 16:].all() and not found.significant[:, :16].any()
    assert found.spectrum[0] == pytest.approx(3 / np.sqrt(2), rel=1e-5)
    np.testing.assert_array_equal(found.mean, velocity[24:56, 40:72])


def test_without_a_known_motion_the_flow_says_it():
    rows = np.repeat(noise(3, 1, (80, 28)), 4, axis=2)[0]
    frames = np.stack([np.roll(rows, 2 * k, axis=1) for k in range(56)])
    found = piece(frames, None, (56, 40), CUT)
    assert np.median(np.abs(found.mean[..., 0] - 2)) < 0.3
    assert np.median(np.abs(found.flow[..., 0] - 2)) < 0.3


def of_two(across=True):
    corner = np.array([[0, 0], [0, 16]] if across else [[0, 0], [16, 0]])
    return Nodes(corner, np.array([[0, 1]]), np.array([across]))


def shown():
    return Shown(np.array([0, 1]), np.full(2, STRAIGHT), np.array([[8, 8], [30, 40]]),
                 np.zeros((2, CELLS, CELLS, 2), np.float32), np.zeros(2, np.int64))


def test_weights_that_add_up_to_one_lose_deviation_between_pieces_and_their_roots_do_not():
    clips = {0: noise(4, 96), 1: noise(5, 96)}
    found = neighbours(of_two(), shown(), clips.__getitem__, 0, CUT, 96, 1)
    assert found.shares.shape == found.roots.shape == (32, 48)
    ends = found.deviation[:, [*range(8), *range(40, 48)]].mean(axis=1)
    between = found.deviation[:, 23:25].mean(axis=1) / ends  # where both have the same weight
    assert between[0] == pytest.approx(np.sqrt(0.5), abs=0.04)
    assert between[1] == pytest.approx(1, abs=0.06)


def test_outside_their_overlap_each_is_what_it_was():
    clips = {0: noise(6), 1: noise(7)}
    found = neighbours(of_two(), shown(), clips.__getitem__, 0, CUT, 24, 1)
    for blended in (found.shares, found.roots):
        np.testing.assert_allclose(blended[:, :15], found.differences[0][:, :15], atol=0.1)
        np.testing.assert_allclose(blended[:, 33:], found.differences[1][:, 17:], atol=0.1)
    average = clips[0][:, 8:40, 8:40].mean(axis=0)
    np.testing.assert_allclose(found.pieces[0], average + found.differences[0], atol=0.51)


def test_the_nearest_pair_beside_each_other_is_found():
    corner = np.array([[0, 0], [0, 16], [0, 32], [16, 0]])
    of = Nodes(corner, np.array([[0, 1], [1, 2], [0, 3]]), np.array([True, True, False]))
    assert nearest_edge(of, (24, 16), CUT) == 0
    assert nearest_edge(of, (90, 16), CUT) == 1
    assert nearest_edge(of, (16, 24), CUT) == 0  # the pair above each other is nearer
    with pytest.raises(ValueError, match="beside each other"):
        nearest_edge(of_two(across=False), (16, 24), CUT)
