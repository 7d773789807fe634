"""Pieces fitted to the target: a turned or enlarged target turns and enlarges its piece; one that fits is left."""

import numpy as np
import pytest
from scipy import ndimage

from synth.photo.assign import Nodes, Shown
from synth.photo.fit import edges, fitted
from synth.photo.index import CELLS
from synth.photo.pieces import FITS, VERSIONS, Cut, Fit, fitted_vectors, pixels

CUT, STRAIGHT = Cut(48), VERSIONS.index((1.0, 0.0, False))
PLACE = (40, 60)


def stripes(seed=1, shape=(140, 180)):
    """Streaks that lead upwards, of a clip that does not change."""
    grain = np.random.Generator(np.random.Philox(seed)).random(shape)
    soft = ndimage.gaussian_filter(grain, (8, 1.5))
    return np.repeat(np.uint8(255 * (soft - soft.min()) / np.ptp(soft))[None], 4, axis=0)


def one_node():
    of = Nodes(np.array([[0, 0]]), np.zeros((0, 2), int), np.zeros(0, bool))
    motion = np.broadcast_to(np.float32([0, 2]), (1, CELLS, CELLS, 2))
    return of, Shown(np.array([0]), np.array([STRAIGHT]), np.array([PLACE]), motion, np.zeros(1, int))


def found_for(fit, exposure=0):
    clip = stripes()
    target = pixels(clip, clip.shape[1:], PLACE, CUT, VERSIONS[STRAIGHT], fit)[0]
    of, shown = one_node()
    return fitted(target, of, shown, np.array([exposure]), lambda _: clip, CUT)


@pytest.mark.parametrize("fit", [Fit(11.25, 1.0), Fit(-11.25, 1.0), Fit(11.25, 1.18)])
def test_a_turned_target_turns_its_piece_and_the_motion(fit):
    found = found_for(fit)
    assert FITS[int(found.fit[0])].turn == fit.turn
    np.testing.assert_allclose(found.motion[0], fitted_vectors(one_node()[1].motion[0], FITS[int(found.fit[0])]))


def test_a_piece_that_fits_is_left_as_it_is():
    found = found_for(FITS[0])
    assert found.fit[0] == 0
    np.testing.assert_array_equal(found.motion, one_node()[1].motion)


def test_edges_are_alike_whatever_their_contrast_and_unlike_across():
    picture = stripes()[0, :48, :48]
    faint = (100 + 0.2 * (255 - picture.astype(float))).astype(np.uint8)
    assert (edges(picture) * edges(faint)).sum() > 0.95
    assert (edges(picture) * edges(np.rot90(picture).copy())).sum() < -0.5
    assert not edges(np.full((48, 48), 7, np.uint8)).any()


def test_a_fitted_piece_is_turned_about_its_middle():
    """A cross in the middle stays there."""
    clip = np.zeros((1, 140, 180), np.uint8)
    clip[0, PLACE[0] + 22:PLACE[0] + 26, PLACE[1] + 22:PLACE[1] + 26] = 255
    for fit in FITS:
        shown = pixels(clip, clip.shape[1:], PLACE, CUT, VERSIONS[STRAIGHT], fit)[0].astype(float)
        y, x = (shown.sum(axis=axis) @ np.arange(48) / shown.sum() for axis in (1, 0))
        assert (y, x) == (pytest.approx(23.5, abs=0.1), pytest.approx(23.5, abs=0.1))
