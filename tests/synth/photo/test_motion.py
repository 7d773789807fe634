"""Motion and textureness of clips whose motion and texture are known."""

import numpy as np
import pytest
from scipy import ndimage

from synth.photo.motion import (
    BANDS,
    CELL,
    LEVELS,
    SIGNIFICANT,
    in_cells,
    laplacians,
    motion,
    octaves,
    optical_flow,
    spectrum,
    textureness,
)

FRAMES, SHAPE = 32, (64, 96)


def grain(seed=1, shape=SHAPE, sigma=1.5):
    values = ndimage.gaussian_filter(np.random.Generator(np.random.Philox(seed)).random(shape), sigma, mode="wrap")
    return np.uint8(255 * (values - values.min()) / np.ptp(values))


def moved(x, y):
    """A loop of grain that moves by whole pixels, x and y per frame, round the picture."""
    return np.stack([np.roll(grain(), (y * k, x * k), axis=(0, 1)) for k in range(FRAMES)])


@pytest.mark.parametrize(("x", "y"), [(3, 0), (0, -2), (-2, 2)])
def test_the_flow_of_a_moved_picture_is_its_motion(x, y):
    found = optical_flow(moved(x, y))
    assert found.shape == (FRAMES, *SHAPE, 2)
    inside = found[:-1, 12:-12, 12:-12]
    assert np.median(np.hypot(inside[..., 0] - x, inside[..., 1] - y)) < 0.2


def test_a_mean_is_a_vector_and_what_stands_does_not_move():
    flow = np.zeros((FRAMES, *SHAPE, 2), np.float32)
    flow[:, :, 48:, 0] = -1.5
    found = motion(flow)
    assert found.mean.shape == (SHAPE[0] // CELL, SHAPE[1] // CELL, 2)
    np.testing.assert_allclose(found.mean[:, 12:], np.broadcast_to([-1.5, 0], (16, 12, 2)))
    np.testing.assert_array_equal(found.moving, [[0] * 12 + [1] * 12] * 16)
    assert not found.bands.any()


def test_the_least_motion_that_counts():
    flow = np.full((4, *SHAPE, 2), 0.0, np.float32)
    flow[..., 0] = SIGNIFICANT * 1.01
    assert motion(flow).moving.all()
    assert not motion(flow * 0.98).moving.any()


def test_a_known_mean_replaces_that_of_the_flow():
    flow = np.zeros((FRAMES, *SHAPE, 2), np.float32)
    found = motion(flow, np.full((*SHAPE, 2), 2.0, np.float32))
    assert (found.mean == 2).all()
    assert (found.moving == 1).all()


@pytest.mark.parametrize("frequency", [1, 3, 6, 15])
def test_a_velocity_that_swings_is_in_the_band_of_its_frequency(frequency):
    """u = a cos has the power a² / 2, and all of it lies in one band."""
    flow = np.zeros((FRAMES, *SHAPE, 2), np.float32)
    flow[..., 1] = (0.8 * np.cos(2 * np.pi * frequency * np.arange(FRAMES) / FRAMES))[:, None, None]
    bands = motion(flow).bands[2, 3]
    of = next(k for k, (low, high) in enumerate(octaves(FRAMES)) if low <= frequency < high)
    np.testing.assert_allclose(bands[of], 0.8 / np.sqrt(2), rtol=1e-4)
    np.testing.assert_allclose(np.delete(bands, of), 0, atol=1e-5)


@pytest.mark.parametrize("frames", [4, 8, 32, 96, 97])
def test_octaves_hold_each_frequency_once(frames):
    found = octaves(frames)
    assert len(found) == BANDS
    assert [k for low, high in found for k in range(low, high)] == list(range(1, frames // 2 + 1))


def test_cells_are_means_and_what_is_left_over_is_left_out():
    values = np.arange(20 * 17, dtype=np.float32).reshape(20, 17)
    found = in_cells(values)
    assert found.shape == (5, 4)
    np.testing.assert_allclose(found[2, 0], values[8:12, :4].mean())


def test_a_pyramid_adds_up():
    picture = grain().astype(np.float32)
    found = laplacians(picture)
    rest = picture - np.sum(found, axis=0)
    assert len(found) == LEVELS
    blurred = ndimage.gaussian_filter(picture, 8, mode="nearest")
    np.testing.assert_allclose(rest[24:-24, 24:-24], blurred[24:-24, 24:-24], atol=1)


def test_textureness_knows_strength_and_scale():
    fine, coarse = (textureness(np.stack([grain(sigma=s)] * 2)) for s in (0.7, 4.0))
    assert fine.shape == (16, 24, LEVELS)
    assert fine[..., 0].mean() > 3 * coarse[..., 0].mean()
    assert coarse[..., 3].mean() > fine[..., 3].mean()
    half = textureness(np.stack([np.uint8(128 + (grain(sigma=0.7) - 128.0) / 2)] * 2))
    np.testing.assert_allclose(half.mean() / fine.mean(), 0.5, atol=0.02)
    assert not textureness(np.full((2, *SHAPE), 99, np.uint8)).any()


@pytest.mark.parametrize("frames", [32, 33])
def test_a_spectrum_tells_the_amplitude_and_frequency_of_a_motion(frames):
    """A swing of 3 pixels along x, 5 times in the clip, over a drift of 2 along y."""
    flow = np.zeros((frames, 16, 16, 2), np.float32)
    flow[..., 0] += 3 * np.cos(2 * np.pi * 5 * np.arange(frames) / frames)[:, None, None]
    flow[..., 1] = 2
    found = spectrum(flow)
    assert found.shape == (frames // 2 + 1,)
    np.testing.assert_allclose(found[[0, 5]], [2, 3 / np.sqrt(2)], atol=1e-5)
    assert np.delete(found, [0, 5]).max() < 1e-5
    assert spectrum(flow, np.full((16, 16, 2), 4, np.float32))[0] == pytest.approx(4 * np.sqrt(2))


@pytest.mark.parametrize("frames", [16, 17])
def test_a_spectrum_has_all_the_power_of_a_motion(frames):
    flow = np.random.Generator(np.random.Philox(3)).normal(size=(frames, CELL, CELL, 2))
    flow[:] = flow.mean(axis=(1, 2), keepdims=True)
    assert (spectrum(flow) ** 2).sum() == pytest.approx((flow**2).sum(axis=3).mean(), rel=1e-6)
