"""The measures, by pictures whose numbers are known: the sample itself, shifted, blurred, faded, turned."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage
from scipy.spatial.distance import cdist

from synth.texture import measures, procedural
from synth.texture.sample import luminance, sample, turned

UP = np.pi / 2


@pytest.fixture(scope="module")
def canes():
    return measures.Reference(sample(procedural.canes()))


@pytest.fixture(scope="module")
def noise():
    """A smooth random picture, the same in all directions, as a sample."""
    grey = ndimage.gaussian_filter(np.random.default_rng(0).normal(size=(128, 128)), 2, mode="wrap")
    grey = np.clip(0.4 + 0.12 * grey / grey.std(), 0, 1)
    return measures.Reference(sample(np.repeat(grey[..., None], 3, -1)))


def upward(reference):
    return np.full(reference.sample.shape, reference.sample.direction)


def test_the_sample_is_like_itself(canes):
    numbers = measures.of_frame(canes.sample.luminance, upward(canes), canes)
    assert numbers["fwd"] < 1e-4  # float32 of a spline that passes through the pixels
    assert numbers["hist"] == 0
    # against a mean over turned pieces of it
    for name in ("std", "grad", "lap"):
        assert numbers[name] == pytest.approx(1, abs=0.1), name
    assert numbers["dir_50"] < np.deg2rad(1) and numbers["dir_90"] < np.deg2rad(3)
    # 8,192 places of 104² draw as many distinct ones as chance allows, and each finds itself
    possible = 104**2
    distinct = possible * (1 - (1 - 1 / possible) ** measures.PLACES)
    assert numbers["used"] == pytest.approx(distinct / 120**2, rel=0.02)


def test_every_patch_of_the_sample_is_found_backward(canes):
    """Of the sample's patches that lie among the measured places, the share that was drawn is at distance zero."""
    _, bwd, _ = measures.distances(canes.sample.luminance, upward(canes), canes)
    assert 0.05 < bwd < 0.2
    flipped = canes.sample.luminance[::-1]
    assert measures.distances(flipped, upward(canes), canes)[1] > 1.1 * bwd


def test_the_reference_is_a_mean_over_the_same_square(noise):
    """For a picture that is the same in all directions, the turned pieces agree with the whole."""
    assert len(noise._turned) == 5 and noise._turned[0].shape == (88, 88)
    np.testing.assert_allclose(noise._turned[0], noise.sample.luminance[20:108, 20:108], atol=1e-6)
    for name in ("contrast", "gradient", "laplacian"):
        assert getattr(measures, name)(noise.sample.luminance, noise) == pytest.approx(1, abs=0.08), name


def test_the_reference_of_stripes_is_a_mean_over_turns():
    """Of a wave A sin(k·x) the mean squared difference is A²/2 (sin² k_x + sin² k_y): least where upright."""
    A, k = 0.3, 1.2
    wave = np.broadcast_to(0.5 + A * np.sin(k * np.arange(128)), (128, 128))
    reference = measures.Reference(replace(sample(np.random.default_rng(0).random((128, 128, 3))), luminance=wave))
    turns = np.deg2rad([0, 13, 29, 45, 61])
    expected = A**2 / 2 * (np.sin(k * np.cos(turns)) ** 2 + np.sin(k * np.sin(turns)) ** 2)
    # 88 pixels hold no whole number of waves, and bicubic interpolation between pixels takes a little
    assert reference.gradient == pytest.approx(expected.mean(), rel=0.03)
    assert reference.gradient > 1.1 * expected[0]
    deviations = [turned(wave, angle, 88).std() for angle in turns]
    assert reference.contrast == pytest.approx(np.mean(deviations), rel=1e-6)
    assert reference.contrast != pytest.approx(deviations[0], rel=1e-4)


def test_known_gradients_and_laplacians():
    y, x = np.mgrid[:20, :30].astype(np.float64)
    assert measures._gradient(3 * x - 2 * y) == pytest.approx(13)
    assert measures._laplacian(3 * x - 2 * y) == pytest.approx(0, abs=1e-20)
    assert measures._laplacian(x * x + 2 * y * y) == pytest.approx(36)


def test_a_blurred_picture_loses_gradient_and_more_laplacian(canes):
    sharp, soft = canes.sample.luminance, ndimage.gaussian_filter(canes.sample.luminance, 1.0)
    assert measures.gradient(soft, canes) < 0.8 * measures.gradient(sharp, canes)
    assert measures.laplacian(soft, canes) < 0.5 * measures.laplacian(sharp, canes)
    assert measures.contrast(soft, canes) < measures.contrast(sharp, canes)
    assert measures.distances(soft, upward(canes), canes)[0] > 0.05


def test_a_faded_picture_by_its_histogram(noise):
    """Half the contrast about the mean: ranks keep, each value is half as far from the mean."""
    values = noise.sample.luminance.astype(np.float64)
    faded = values.mean() + 0.5 * (values - values.mean())
    expected = 0.5 * np.abs(values - values.mean()).mean() / values.std()
    assert measures.histogram(faded, noise) == pytest.approx(expected, rel=1e-3)
    assert measures.contrast(faded, noise) == pytest.approx(0.5 * measures.contrast(values, noise), rel=1e-9)
    assert measures.gradient(faded, noise) == pytest.approx(0.25 * measures.gradient(values, noise), rel=1e-9)


def test_a_lighter_picture_by_its_histogram(noise):
    assert measures.histogram(noise.sample.luminance + 0.3 * noise.s, noise) == pytest.approx(0.3, rel=1e-4)


def test_the_histogram_does_not_ask_where_and_how_many(noise):
    tiled = np.tile(noise.sample.luminance[::-1], (2, 3))
    assert measures.histogram(tiled, noise) < 2e-3  # ranks of another count lie between


def test_a_picture_of_one_value_shows_little_of_the_sample(canes):
    flat = np.full((64, 64), canes.sample.luminance.mean(), np.float32)
    fwd, bwd, used = measures.distances(flat, np.zeros((64, 64)), canes)
    assert used == pytest.approx(1 / 120**2)
    # the patches of the sample all look at the mean: their distance is about their deviation
    assert bwd == pytest.approx(1, abs=0.1)
    assert fwd < bwd
    assert all(np.isnan(measures.direction(flat, np.zeros((64, 64)))))


@pytest.mark.parametrize("degrees", [0, 20, 90, 200])
def test_a_turned_sample_is_itself_in_a_flow_that_is_turned(canes, degrees):
    angle = np.deg2rad(degrees)
    frame = turned(canes.sample.luminance, angle, 88)
    theta = np.full(frame.shape, canes.sample.direction + angle)
    fwd, _, _ = measures.distances(frame, theta, canes)
    # at other turns its patches lie between those of the sample, by up to half a pixel each way
    assert fwd < (1e-3 if degrees in (0, 90) else 0.2)
    median, most = measures.direction(frame, theta)
    assert median < np.deg2rad(1) and most < np.deg2rad(3)
    # 25° off, both see it
    off_fwd, _, _ = measures.distances(frame, theta + np.deg2rad(25), canes)
    assert off_fwd > 2 * max(fwd, 0.2)
    assert measures.direction(frame, theta + np.deg2rad(25))[0] == pytest.approx(np.deg2rad(25), abs=np.deg2rad(1.5))
    # the direction of stripes is modulo a half turn
    assert measures.direction(frame, theta + np.pi)[0] == pytest.approx(median, abs=1e-6)


def test_distances_by_brute_force():
    """A sample so small that all its patches look backward."""
    random = np.random.default_rng(3)
    small = measures.Reference(sample(random.random((30, 34, 3)), direction=0.4))
    frame = ndimage.gaussian_filter(random.random((40, 50)), 1.0).astype(np.float32)
    theta = random.uniform(-np.pi, np.pi, (40, 50))
    ours, theirs = measures._oriented_patches(frame, theta, 0.4, 1), small.patches
    apart = cdist(ours, theirs) / np.sqrt(81) / small.s
    used = len(np.unique(apart.argmin(1))) / len(theirs)
    assert 0.02 < used < 0.98
    assert measures.distances(frame, theta, small) == pytest.approx((apart.min(1).mean(), apart.min(0).mean(), used))


def test_patches_leave_out_what_is_transparent():
    alpha = np.ones((32, 32))
    alpha[0] = 0
    picture = np.random.default_rng(0).random((32, 32, 3))
    assert measures.Reference(sample(picture)).patches.shape == (24 * 24, 81)
    assert measures.Reference(sample(picture, alpha)).patches.shape == (23 * 24, 81)
    with pytest.raises(ValueError, match="no patch of the sample is opaque"):
        _ = measures.Reference(sample(picture, np.arange(32)[:, None] % 4 != np.zeros(32))).patches
    with pytest.raises(ValueError, match="9 x 9"):
        _ = measures.Reference(sample(picture[:8])).patches


def test_patches_of_a_large_sample_are_thinned():
    picture = np.random.default_rng(0).random((300, 280, 3))
    patches = measures.Reference(sample(picture)).patches
    assert len(patches) == 146 * 136
    np.testing.assert_array_equal(patches[1, :9], luminance(picture)[0, 2:11])


def test_a_shift_by_whole_pixels_leaves_no_residual(canes):
    frame = canes.sample.luminance
    v = np.broadcast_to(np.array([3.0, -2.0], np.float32), (128, 128, 2))
    shifted = np.roll(frame, (-2, 3), (0, 1))
    blocks = measures.residual(frame, shifted, v, canes)
    assert len(blocks) == 7 * 7  # three columns and two rows come from outside
    assert blocks.max() < 1e-5
    numbers = measures.of_pair(frame, shifted, v, canes)
    assert numbers["residual_95"] < 1e-5 and numbers["worst"] < 1e-5
    back = measures.of_pair(frame, np.roll(frame, (2, -3), (0, 1)), v, canes)
    assert back["residual_50"] > 0.3, "the sign of the flow does not matter"


def test_no_flow_leaves_no_residual_and_a_planted_error_is_found(canes):
    frame, v = canes.sample.luminance, np.zeros((128, 128, 2), np.float32)
    assert measures.residual(frame, frame, v, canes).max() < 1e-6
    later = frame.copy()
    later[32:48, 64:80] += 0.5 * canes.s  # the third row, fifth column of 8 by 8 blocks
    blocks = measures.residual(frame, later, v, canes)
    assert blocks.argmax() == 2 * 8 + 4 and blocks[20] == pytest.approx(0.5, rel=1e-4)
    numbers = measures.of_pair(frame, later, v, canes)
    assert numbers["worst"] == pytest.approx(0.5, rel=1e-4) and numbers["residual_50"] < 1e-6


def test_a_flow_that_leaves_the_picture_in_one_frame_has_no_blocks(canes):
    v = np.full((128, 128, 2), 5000, np.float32)
    assert all(np.isnan(x) for x in measures.of_pair(canes.sample.luminance, canes.sample.luminance, v, canes).values())


def test_ten_whole_shifts_correlate_wholly_and_noise_not_at_all(noise):
    frame = noise.sample.luminance
    v = [np.broadcast_to(np.array([x, 1.0], np.float32), (128, 128, 2)) for x in (1, 2, 0, 1, 1, 1, 0, 2, 1, 1)]
    assert measures.correlation(frame, np.roll(frame, (10, 10), (0, 1)), v) == pytest.approx(1, abs=1e-6)
    # equal means and deviations on both sides: the share of another picture lowers it by its weight
    other = np.roll(frame, (64, 64), (0, 1))
    still = [np.zeros((128, 128, 2), np.float32)]
    assert abs(measures.correlation(frame, other, still)) < 0.15
    mixed = (frame - frame.mean()) + (other - frame.mean())
    assert measures.correlation(frame, mixed, still) == pytest.approx(np.sqrt(0.5), abs=0.08)
    assert np.isnan(measures.correlation(frame, np.ones_like(frame), still))


def test_steps_lead_back_in_order():
    """Right by the second flow's step, up by the first's: the last step is undone first."""
    x = np.arange(20)
    first, second = np.zeros((20, 20, 2), np.float32), np.zeros((20, 20, 2), np.float32)
    first[..., 1] = np.where(x < 10, 2, 0)
    second[..., 0] = 5
    source = measures.departures((20, 20), [first, second])
    np.testing.assert_allclose(source[10, 12], [7, 8])  # to x = 7 first, where the first flow rises
    np.testing.assert_allclose(source[10, 17], [12, 10])


def test_drift_is_what_changed():
    first = {"std": 1.0, "grad": 0.9, "hist": 0.02, "bwd": 0.2, "used": 0.4, "fwd": 0.3}
    last = {**first, "std": 0.9, "used": 0.45}
    assert measures.drift(first, last) == pytest.approx(
        {"std": 0.1, "grad": 0, "hist": 0, "bwd": 0, "used": 0.05})


def test_a_sample_without_direction_has_no_measure_of_it(noise):
    assert not noise.sample.has_direction
    assert "dir_50" not in measures.of_frame(noise.sample.luminance, upward(noise), noise)


def test_a_small_frame_is_refused(canes):
    with pytest.raises(ValueError, match="too small"):
        measures.of_frame(np.zeros((24, 60), np.float32), np.zeros((24, 60)), canes)


def test_the_same_numbers_each_time(canes):
    frame = np.random.default_rng(0).random((64, 70), dtype=np.float32)
    theta = np.full(frame.shape, UP)
    assert measures.of_frame(frame, theta, canes) == measures.of_frame(frame, theta, canes)
