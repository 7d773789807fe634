"""The index of a clip whose motion, brightness and texture are known."""

import hashlib
import os

import cv2
import numpy as np
import processes
import pytest
from scipy import ndimage

from synth.photo.index import (
    BAND,
    CELLS,
    DEVIATION,
    EXPOSURES,
    FEATURES,
    MEAN,
    TEXTURE,
    described_by,
    exposures,
    index,
)
from synth.photo.pieces import VERSIONS, Cut
from synth.photo.words import TOTAL, codebook, common, descriptors

FRAMES, SHAPE, CUT = 12, (72, 96), Cut(32)
SPEED = (1.0, -2.0)


def clip():
    """Grain that moves by whole pixels on the right half of a picture whose left half stands still."""
    grain = ndimage.gaussian_filter(np.random.Generator(np.random.Philox(1)).random(SHAPE), 1.2, mode="wrap")
    grain = np.uint8(40 + 170 * (grain - grain.min()) / np.ptp(grain))
    moved = np.stack([np.roll(grain, (round(SPEED[1] * k), round(SPEED[0] * k)), axis=(0, 1)) for k in range(FRAMES)])
    still = np.arange(SHAPE[1]) < 36
    return np.where(still, grain, moved), np.where(still[:, None], 0, np.broadcast_to(SPEED, (*SHAPE, 2))).astype(
        np.float32)


@pytest.fixture(scope="module")
def found():
    frames, velocity = clip()
    words = codebook(np.concatenate([descriptors(e, CUT.step).reshape(-1, 128) for e in exposures(frames)]), 20)
    return frames, words, index(frames, words, CUT, velocity)


def test_every_part_has_a_row_for_each_piece(found):
    _, words, of = found
    count = len(of.version)
    assert count > 20
    assert of.corner.shape == (count, 2)
    assert of.histogram.shape == (count, len(EXPOSURES), 5 * len(words))
    assert of.brightness.shape == (count, len(EXPOSURES))
    assert of.features.shape == (count, CELLS, CELLS, FEATURES)
    assert of.features.dtype == np.float16
    assert len(set(of.version.tolist())) > 8


def test_pieces_that_stand_still_are_left_out(found):
    _, _, of = found
    straight = VERSIONS.index((1.0, 0.0, False))
    corners = of.corner[of.version == straight]
    assert corners[:, 1].min() >= 16
    assert corners[:, 1].max() == 48


@pytest.mark.parametrize("scale", [0.5, 0.75, 1.0])
@pytest.mark.parametrize("flipped", [False, True])
def test_the_motion_of_a_piece_is_that_of_its_version(found, scale, flipped):
    _, _, of = found
    number = VERSIONS.index((scale, 0.0, flipped))
    mine = of.features[of.version == number].astype(float)
    assert len(mine)
    moving = mine[..., CELLS // 2:, MEAN] if not flipped else mine[..., :CELLS // 2, MEAN]
    expected = np.array([-SPEED[0] if flipped else SPEED[0], SPEED[1]]) * scale
    fastest = moving.reshape(-1, 2)[np.abs(moving.reshape(-1, 2)[:, 1]).argmax()]
    np.testing.assert_allclose(fastest, expected, atol=0.02)


def test_what_does_not_move_has_no_deviation_and_what_does_has_texture(found):
    _, _, of = found
    piece = of.features[(of.version == VERSIONS.index((1.0, 0.0, False))) & (of.corner[:, 1] == 16)][0].astype(float)
    assert piece[:, 0, DEVIATION].max() < 0.1 * piece[:, -1, DEVIATION].min()
    assert (piece[..., TEXTURE] > 0).all()
    assert np.isfinite(piece[..., BAND]).all()


def test_brightness_is_that_of_the_piece(found):
    frames, _, of = found
    straight = np.flatnonzero(of.version == VERSIONS.index((1.0, 0.0, False)))
    for exposure, picture in enumerate(exposures(frames)):
        for n in straight:
            row, column = of.corner[n]
            expected = picture[row:row + 32, column:column + 32].mean()
            assert float(of.brightness[n, exposure]) == pytest.approx(expected, abs=0.1)


def test_exposures_are_means_of_all_of_some_and_of_few():
    frames = np.zeros((40, 2, 2), np.uint8)
    frames[18:22] = 200
    whole, some, few = exposures(frames)
    assert (whole[0, 0], some[0, 0], few[0, 0]) == (20, 50, 200)
    assert [e[0, 0] for e in exposures(frames[19:21])] == [200] * 3


def test_a_part_of_the_clip_itself_is_found(found):
    """A target cut out of a short exposure: of all pieces its own place has most in common with it."""
    frames, words, of = found
    target = exposures(frames)[2]
    asked = described_by(target, np.array([[16, 48]]), words, CUT)
    flat = of.histogram.reshape(-1, of.histogram.shape[2])
    shared = common(asked, flat)[0]
    n, exposure = np.unravel_index(shared.argmax(), (len(of.version), len(EXPOSURES)))
    assert VERSIONS[of.version[n]] == (1.0, 0.0, False)
    assert (of.corner[n] == [16, 48]).all()
    assert exposure == 2
    assert shared.max() == TOTAL


def test_a_clip_that_stands_still_has_no_pieces(found):
    frames, words, _ = found
    of = index(np.repeat(frames[:1], 4, axis=0), words, CUT, np.zeros((*SHAPE, 2), np.float32))
    assert len(of.version) == 0
    assert of.features.shape == (0, CELLS, CELLS, FEATURES)


def digest():
    cv2.setNumThreads(int(os.environ.get("OMP_NUM_THREADS", "2")))  # OpenCV has a variable of its own
    frames, _ = clip()
    words = codebook(descriptors(exposures(frames)[0], CUT.step).reshape(-1, 128), 10)
    of = index(frames, words, CUT)
    return hashlib.sha256(b"".join(np.ascontiguousarray(values).tobytes() for values in (
        of.version, of.corner, of.histogram, of.brightness, of.features,
        common(of.histogram[:, 0], of.histogram[:, 0])))).hexdigest()


def test_the_same_bits_at_any_thread_count(tmp_path):
    assert processes.digests(__file__, tmp_path) == {digest()}
