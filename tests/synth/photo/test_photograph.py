"""A carried photograph: it moves by the motion, keeps its contrast, closes, and what is held stands still."""

import numpy as np
import pytest
from scipy import ndimage

from synth.photo.photograph import LIFE, ages, carried, lifetime, paths

SHAPE = (72, 96)


def picture(seed=1, sigma=1.5):
    grain = ndimage.gaussian_filter(np.random.Generator(np.random.Philox(seed)).random((*SHAPE, 3)), (sigma, sigma, 0))
    return ((grain - grain.min()) / np.ptp(grain)).astype(np.float32)


def uniform(x, y):
    return np.broadcast_to(np.float32([x, y]), (*SHAPE, 2)).copy()


@pytest.mark.parametrize("length", [1, 7, 20, 24, 60, 90, 96, 97, 120])
def test_a_loop_holds_whole_lifetimes(length):
    assert length % lifetime(length) == 0
    if length in (20, 60, 96, 120):
        assert abs(lifetime(length) - LIFE) <= 4


def test_paths_lead_back_along_the_motion():
    found = paths(uniform(1.5, -0.5), 8)
    y, x = np.mgrid[:SHAPE[0], :SHAPE[1]]
    inside = np.s_[:60, 20:]
    np.testing.assert_allclose(found[8, ..., 0][inside], (x - 12)[inside], atol=1e-3)
    np.testing.assert_allclose(found[8, ..., 1][inside], (y + 4)[inside], atol=1e-3)


def test_paths_in_a_vortex_keep_their_distance_from_its_middle():
    y, x = np.mgrid[:SHAPE[0], :SHAPE[1]]
    dx, dy = x - 47.5, y - 35.5
    found = paths((0.08 * np.stack([-dy, dx], axis=-1)).astype(np.float32), 20)[20]
    ring = (np.hypot(dx, dy) > 5) & (np.hypot(dx, dy) < 30)
    away = np.hypot(found[..., 0] - 47.5, found[..., 1] - 35.5)
    assert np.abs(away - np.hypot(dx, dy))[ring].max() < 0.1


def test_all_ages_are_alike_and_neighbours_are_near():
    found = ages((300, 400), 20, 3)
    counts = np.histogram(found, 10, (0, 20))[0] / found.size
    assert found.min() >= 0 and found.max() < 20
    assert counts.min() > 0.03
    step = np.abs(np.diff(found, axis=1))
    assert np.quantile(np.minimum(step, 20 - step), 0.99) < 2


def test_without_motion_only_the_mixture_of_equal_copies_changes():
    shown = carried(picture(), uniform(0, 0), 20, 1)
    coarse = shown.mean(axis=0)
    assert np.abs(shown.mean(axis=(1, 2)) - picture().mean(axis=(0, 1))).max() < 0.02
    assert np.corrcoef(coarse.ravel(), picture().ravel())[0, 1] > 0.95


def test_it_moves_by_the_motion():
    """Each frame, moved by the motion, is nearer to the next than the frame itself is."""
    shown = carried(picture(), uniform(2, 1), 60, 1)
    inside = np.s_[12:-12, 12:-12]
    moved = np.roll(shown, (1, 2), axis=(1, 2))
    along = [np.abs(shown[k + 1][inside] - moved[k][inside]).mean() for k in range(59)]
    still = [np.abs(shown[k + 1][inside] - shown[k][inside]).mean() for k in range(59)]
    assert np.mean(along) < 0.5 * np.mean(still)


def test_the_contrast_is_the_pictures():
    """Of what moves by more than its own size in half a lifetime: two copies then have nothing in common."""
    shown = carried(picture(), uniform(2, 1), 60, 1)
    detail = shown - np.stack([ndimage.gaussian_filter(f, (8, 8, 0)) for f in shown])
    own = picture() - ndimage.gaussian_filter(picture(), (8, 8, 0))
    assert detail[:, 12:-12, 12:-12].std() / own[12:-12, 12:-12].std() == pytest.approx(1, abs=0.15)


def test_the_loop_closes():
    shown = carried(picture(), uniform(2, 1), 60, 1)
    steps = np.sqrt(((np.roll(shown, -1, axis=0) - shown) ** 2).mean(axis=(1, 2, 3)))
    assert steps[-1] <= 1.2 * np.median(steps)
    np.testing.assert_array_equal(shown[0], carried(picture(), uniform(2, 1), 60, 1)[0])


def test_what_is_held_stands_still_and_nothing_is_read_from_it():
    held = np.zeros(SHAPE, bool)
    held[:, 40:52] = True
    marked = picture()
    marked[held] = [9.0, 0.0, 0.0]
    shown = carried(marked, uniform(2, 0), 40, 1, held)
    np.testing.assert_array_equal(shown[:, held], np.broadcast_to([9.0, 0.0, 0.0], shown[:, held].shape))
    assert shown[:, :, 54:, 0].max() < 3
