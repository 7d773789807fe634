"""A carried photograph: it moves by the motion, keeps its contrast, closes, and what is held stands still."""

import numpy as np
import pytest
from scipy import ndimage

from synth.photo.photograph import (
    HALVINGS,
    LIFE,
    OWN,
    Carrying,
    carried,
    carried_reference,
    flowing,
    lives,
    mirrored,
    paths,
    places,
    split,
    starts,
    turns,
)

SHAPE = (72, 96)


def moving(of, motion, length, seed, feature=10.0, fluid=None):
    shown_at = flowing(of, motion, length, seed, feature, np.ones(SHAPE, bool) if fluid is None else fluid)
    return np.stack([shown_at(frame) for frame in range(length)])


def picture(seed=1, sigma=1.5):
    grain = ndimage.gaussian_filter(np.random.Generator(np.random.Philox(seed)).random((*SHAPE, 3)), (sigma, sigma, 0))
    return ((grain - grain.min()) / np.ptp(grain)).astype(np.float32)


def uniform(x, y):
    return np.broadcast_to(np.float32([x, y]), (*SHAPE, 2)).copy()


@pytest.mark.parametrize("length", [1, 7, 20, 24, 60, 90, 96, 97, 120])
def test_a_loop_holds_whole_lives(length):
    found = lives(length)
    assert len(found) >= 2 and (np.diff(found) < 0).all()
    np.testing.assert_allclose(length / found, np.rint(length / found), rtol=1e-6)
    if length >= 48:
        assert found[0] == pytest.approx(LIFE, rel=0.3)
        assert found[-1] == pytest.approx(LIFE / 2**HALVINGS, rel=0.3)


def test_a_life_ends_where_the_motion_has_passed_a_feature():
    lived = lives(96)
    assert places(np.full(SHAPE, 0.1), lived, 10).max() == 0
    assert places(np.full(SHAPE, 30.0), lived, 10).min() == len(lived) - 1
    at = places(np.full(SHAPE, 10 / 12), lived, 10)[36, 48]
    assert np.interp(at, np.arange(len(lived)), lived) == pytest.approx(12, abs=0.5)


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
    found = turns((300, 400), 4, 3)
    counts = np.histogram(found % 1, 10, (0, 1))[0] / found.size
    assert found.min() >= 0
    assert counts.min() > 0.05
    assert np.abs(np.diff(found, axis=1)).max() < 0.15


def test_a_frame_has_no_cracks():
    """A smooth picture, that is carried far from where it lies, stays smooth."""
    soft = picture(sigma=4.0)
    shown = moving(soft, uniform(2, 1), 60, 1, feature=24)
    steps = np.abs(np.diff(soft, axis=1)).max()
    assert max(np.abs(np.diff(frame[8:-8, 8:-8], axis=1)).max() for frame in shown[::7]) < 3 * steps


def test_ground_and_detail_are_the_picture():
    of = split(picture(), uniform(2, 1), 10, np.ones(SHAPE, bool))
    whole = of.ground + of.strength[..., None] * of.detail
    assert np.quantile(np.abs(whole - picture()), 0.98) < 0.02


def test_an_edge_across_the_motion_stays_sharp_and_grain_does_not():
    """A step of light, as the lip of a fall, with streaks over it."""
    x = np.mgrid[:SHAPE[0], :SHAPE[1]][1]
    edge = np.where(x < 48, 0.2, 0.7).astype(np.float32)
    grain = 0.04 * np.random.Generator(np.random.Philox(2)).standard_normal(SHAPE)
    shown = np.repeat((edge + grain)[..., None], 3, axis=2).astype(np.float32)
    ground = split(shown, uniform(2, 0), 10, np.ones(SHAPE, bool)).ground[..., 0]
    assert ground[:, 51].mean() - ground[:, 44].mean() > 0.9 * 0.5
    assert ground[8:-8, 60:88].std() < 0.25 * 0.04


def test_what_stands_still_does_not_pulse():
    shown = moving(picture(), uniform(0, 0), 24, 1)
    np.testing.assert_allclose(shown, np.broadcast_to(shown[0], shown.shape), atol=1e-4)
    assert np.quantile(np.abs(shown[0] - picture()), 0.98) < 0.02


def test_it_moves_by_the_motion():
    """Each frame, moved by the motion, is nearer to the next than the frame itself is."""
    shown = moving(picture(), uniform(1, 1), 60, 1)
    shown = shown - shown.mean(axis=0)
    inside = np.s_[12:-12, 12:-12]
    moved = np.roll(shown, (1, 1), axis=(1, 2))
    along = [np.abs(shown[k + 1][inside] - moved[k][inside]).mean() for k in range(59)]
    still = [np.abs(shown[k + 1][inside] - shown[k][inside]).mean() for k in range(59)]
    assert np.mean(along) < 0.6 * np.mean(still)


@pytest.mark.parametrize("speed", [0.0, 0.3, 2.0])
def test_the_contrast_is_the_pictures(speed):
    shown = moving(picture(), uniform(speed, speed / 2), 60, 1)
    detail = shown - np.stack([ndimage.gaussian_filter(f, (4, 4, 0)) for f in shown])
    own = picture() - ndimage.gaussian_filter(picture(), (4, 4, 0))
    assert detail[:, 12:-12, 12:-12].std() / own[12:-12, 12:-12].std() == pytest.approx(1, abs=0.1)


def test_the_loop_closes():
    shown = moving(picture(), uniform(2, 1), 60, 1)
    steps = np.sqrt(((np.roll(shown, -1, axis=0) - shown) ** 2).mean(axis=(1, 2, 3)))
    assert steps[-1] <= 1.2 * np.median(steps)
    np.testing.assert_array_equal(shown[0], moving(picture(), uniform(2, 1), 60, 1)[0])


def test_nothing_is_read_from_what_is_no_fluid():
    held = np.zeros(SHAPE, bool)
    held[:, 40:52] = True
    marked = picture()
    marked[held] = [9.0, 0.0, 0.0]
    shown = moving(marked, uniform(2, 0), 40, 1, fluid=~held)
    assert shown[:, ~held, 0].max() < 2


def test_beyond_the_fluid_it_is_mirrored():
    fluid = np.zeros((3, 10), bool)
    fluid[:, 2:7] = True
    rows, columns = mirrored(fluid)
    assert columns[1].tolist() == [4, 3, 2, 3, 4, 5, 6, 5, 4, 3]
    assert (rows == np.arange(3)[:, None]).all()


def test_nothing_repeats_before_the_loop_does():
    """The correlation of a frame with another is nowhere as high as with its neighbours."""
    shown = moving(picture(), uniform(2, 1), 96, 1)
    flat = (shown - shown.mean(axis=0))[:, 12:-12, 12:-12].reshape(96, -1)
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    found = flat[:1] @ flat.T
    assert found[0, 6:91].max() < 0.45


@pytest.mark.parametrize("shape", [(5, 7), (2, 2), (33, 65)])
def test_the_kernel_is_its_specification(shape):
    random = np.random.Generator(np.random.Philox(7))
    motion = random.normal(0, 2, (*shape, 2)).astype(np.float32)
    lived = lives(50)
    of = Carrying(
        np.pad(random.standard_normal((*shape, 3)), ((0, 0), (0, 0), (0, 1))).astype(np.float32),
        paths(motion, int(np.ceil(lived[0]))),
        np.stack([random.random(shape), random.uniform(0, len(lived) - 1, shape), random.uniform(0, 9, shape),
                  np.zeros(shape)], axis=-1).astype(np.float32),
        lived, starts(lived, 50, 3), 50, 10 * OWN)
    for frame in (0, 17, 49):
        np.testing.assert_allclose(carried(of.on_device(), frame), carried_reference(of, frame), atol=2e-4)
