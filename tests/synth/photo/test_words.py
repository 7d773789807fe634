"""Descriptors, words, histograms: planted answers, and the kernel beside its specification."""

import hashlib

import numpy as np
import processes
import pytest

from synth.photo.words import (
    GRID,
    TOTAL,
    codebook,
    common,
    common_reference,
    descriptors,
    histograms,
    nearest_words,
)


def picture(seed=1, shape=(96, 120)):
    from scipy import ndimage

    grain = np.random.Generator(np.random.Philox(seed)).random(shape)
    smooth = ndimage.gaussian_filter(grain, 2)
    return np.uint8(255 * (smooth - smooth.min()) / np.ptp(smooth))


def test_a_descriptor_lies_where_its_point_does():
    """Moved by one step of the grid, the picture has the same descriptors one point farther."""
    whole = picture()
    found, moved = descriptors(whole, 6), descriptors(whole[6:, 6:], 6)
    inside = np.s_[4:12, 4:14]
    differences = np.abs(found[1:, 1:][inside].astype(int) - moved[inside])
    assert found.shape == (16, 20, 128)
    assert differences.max() <= 2
    other = np.abs(found[inside].astype(int) - moved[inside])
    assert np.median(other) > 5 * np.median(differences)


def test_a_descriptor_sees_half_a_piece():
    whole = picture()
    changed = whole.copy()
    changed[:, 60 + 20:] = 255 - changed[:, 60 + 20:]
    here, there = descriptors(whole, 6)[8], descriptors(changed, 6)[8]
    difference = np.abs(here.astype(int) - there).max(axis=1)
    assert (difference[:10] <= 2).all(), "20 pixels and more away from what changed"
    assert difference[12:16].max() > 10


def test_brightness_and_contrast_do_not_count():
    whole = picture()
    dull = np.uint8(60 + whole // 3)
    difference = np.abs(descriptors(whole, 6).astype(int) - descriptors(dull, 6))[3:-3, 3:-3]
    assert np.median(difference) <= 1
    assert np.quantile(difference, 0.95) <= 12


@pytest.mark.parametrize("wrong", [np.zeros((4, 4, 3), np.uint8), np.zeros((8, 8), np.float32)])
def test_what_is_no_grey_picture_is_refused(wrong):
    with pytest.raises(ValueError, match="uint8"):
        descriptors(wrong, 6)


def blobs(count=5, each=80, seed=2):
    random = np.random.Generator(np.random.Philox(seed))
    centres = random.integers(20, 235, (count, 128))
    samples = np.rint(centres[:, None] + random.normal(0, 3, (count, each, 128)))
    return centres, np.clip(samples, 0, 255).astype(np.uint8)


def test_planted_clusters_become_the_words():
    centres, samples = blobs()
    words = codebook(samples.reshape(-1, 128), 5)
    nearest = ((words[:, None].astype(int) - centres) ** 2).sum(axis=2).argmin(axis=1)
    assert sorted(nearest) == [0, 1, 2, 3, 4]
    assert np.abs(words.astype(int) - centres[nearest]).max() <= 2
    found = nearest_words(samples, words)
    assert (found == found[:, :1]).all()
    assert len(set(found[:, 0].tolist())) == 5


def test_no_more_words_than_there_are_descriptors():
    _, samples = blobs(2, 1)
    twice = np.concatenate([samples.reshape(-1, 128)] * 2)
    assert len(codebook(twice, 10)) == 2
    with pytest.raises(ValueError, match="needs descriptors"):
        codebook(twice[:0])


def test_the_nearest_word_is_exact():
    random = np.random.Generator(np.random.Philox(3))
    found, words = (random.integers(0, 256, (n, 128)).astype(np.uint8) for n in (300, 40))
    expected = ((found[:, None].astype(int) - words) ** 2).sum(axis=2).argmin(axis=1)
    np.testing.assert_array_equal(nearest_words(found, words), expected)


def test_a_histogram_counts_each_point_on_both_levels():
    nearest = np.zeros((20, 30), int)
    nearest[3 + GRID // 2 + 1:, 5 + GRID // 2 + 1:] = 7
    (one, other) = histograms(nearest, np.array([[3, 5], [0, 0]]), 10).reshape(2, 5, 10)
    assert one.sum() == other.sum() == TOTAL
    low, high = GRID // 2 + 1, GRID // 2
    np.testing.assert_array_equal(one[:, 7], [high * high, 0, 0, 0, high * high])
    np.testing.assert_array_equal(one[:, 0], [81 - high * high, low * low, low * high, low * high, 0])


def test_equal_histograms_have_all_in_common_and_disjoint_ones_nothing():
    random = np.random.Generator(np.random.Philox(4))
    of = histograms(random.integers(0, 50, (40, 40)), random.integers(0, 30, (6, 2)), 100)
    far = histograms(random.integers(50, 100, (40, 40)), random.integers(0, 30, (6, 2)), 100)
    shared = common(of, np.concatenate([of, far]))
    assert (np.diag(shared) == TOTAL).all()
    assert (shared[:, 6:] == 0).all()
    assert (shared[:, :6][~np.eye(6, dtype=bool)] < TOTAL).all()


@pytest.mark.parametrize("size", [(1, 1, 5), (7, 33, 1000), (3, 130, 17)])
def test_the_kernel_is_its_specification(size):
    ours, theirs, count = size
    random = np.random.Generator(np.random.Philox(5))
    a, b = (random.multinomial(TOTAL, np.ones(count) / count, n).astype(np.uint8) for n in (ours, theirs))
    np.testing.assert_array_equal(common(a, b), common_reference(a, b))


def digest():
    found = descriptors(picture(), 6)
    words = codebook(found.reshape(-1, 128), 30)
    of = histograms(nearest_words(found, words), np.array([[0, 0], [3, 4], [7, 9]]), len(words))
    return hashlib.sha256(words.tobytes() + of.tobytes() + common(of, of).tobytes()).hexdigest()


def test_the_same_bits_at_any_thread_count_and_from_a_cold_cache(tmp_path):
    assert processes.digests(__file__, tmp_path) == {digest()}
