"""Starts of the synthesis: random pixels, mosaics of whole exemplars, and exemplars sown where it is empty."""

import numpy as np
import pytest

from synth.motion.exemplar import exemplar
from synth.motion.initialize import mosaics, owners, owners_reference, random_pixels, reseed
from synth.motion.local_axes import axes_2d
from synth.motion.quality import measure, whole_motifs


def generator(seed=0):
    return np.random.Generator(np.random.Philox(key=seed))


def mosaic(I, frame, random):
    return mosaics(I, frame, [random])[0]


def along(angle, shape):
    return np.broadcast_to(np.float32([np.cos(angle), np.sin(angle)]), (*shape, 2)).copy()


def curved(n):
    x = np.arange(n, dtype=np.float32)
    L = np.stack([np.ones((n, n), np.float32), np.broadcast_to(0.8 * np.sin(2 * np.pi * x / n), (n, n))], -1)
    return (L / np.linalg.norm(L, axis=-1, keepdims=True)).astype(np.float32)


def rms(field):
    return float(np.sqrt(np.mean(field.astype(np.float64) ** 2)))


def test_random_pixels_are_pixels_of_the_exemplar_all_alike_often():
    I = np.arange(70, dtype=np.float32).reshape(5, 7, 2)
    H = random_pixels(I, (200, 210), generator())
    assert H.shape == (200, 210, 2) and H.dtype == np.float32
    pixels, counts = np.unique(H.reshape(-1, 2), axis=0, return_counts=True)
    np.testing.assert_array_equal(pixels, I.reshape(-1, 2))
    assert (np.abs(counts - 1200) < 6 * np.sqrt(1200)).all()


@pytest.mark.parametrize("start", [lambda I, random: random_pixels(I, (40, 40), random),
                                   lambda I, random: mosaic(I, along(0.3, (40, 40)), random)])
def test_the_same_seed_the_same_start(start):
    I = exemplar("heart", 8)
    np.testing.assert_array_equal(start(I, generator(3)), start(I, generator(3)))
    assert (start(I, generator(3)) != start(I, generator(4))).any()


@pytest.mark.parametrize("shape", [(5, 7), (2, 2), (1, 9), (30, 17)])
def test_a_mosaic_is_made_of_the_exemplars_cells(shape):
    I = np.arange(72, dtype=np.float32).reshape(6, 6, 2)
    H = mosaic(I, along(0.7, shape), generator())
    assert H.shape == (*shape, 2)
    known = {tuple(v) for v in I.reshape(-1, 2).tolist()}
    assert {tuple(v) for v in H.reshape(-1, 2).tolist()} <= known


@pytest.mark.parametrize("kind", ["circle", "square", "heart"])
@pytest.mark.parametrize("frame", [along(0, (96, 96)), along(0.54, (96, 96)), curved(96)],
                         ids=["x", "turned", "curved"])
def test_a_mosaic_holds_whole_motifs_that_follow_the_frame(kind, frame):
    I = exemplar(kind, 16)
    H = mosaic(I, frame, generator())
    whole, total = whole_motifs(H, frame, I)
    # neighbouring tiles may overlap and grow together, up to the border: those do not count
    assert total >= 4 and whole >= 0.6 * total
    assert 0.8 < rms(H) / rms(I) < 1.2


def test_a_mosaic_uses_the_exemplar_better_than_random_pixels():
    I, frame = exemplar("heart", 16), along(0.54, (96, 96))
    laid = measure(mosaic(I, frame, generator()), frame, I)
    thrown = measure(random_pixels(I, (96, 96), generator()), frame, I)
    assert laid.forward < 0.7 * thrown.forward
    assert laid.used > 0.95 > 0.2 > thrown.used


@pytest.mark.parametrize(("shape", "edge", "count"), [((5, 7), 3, 4), ((2, 2), 8, 1), ((1, 9), 2, 3),
                                                      ((61, 40), 8, 35), ((61, 40), 2, 3)])
def test_owners_equal_their_reference(shape, edge, count):
    """Near or far, many or few of them, crowded into a corner or spread."""
    random = generator(6)
    frame = axes_2d(random.standard_normal((*shape, 2), dtype=np.float32))
    last = np.array(shape[::-1], np.float32) - 1
    centres = random.random((3, count, 2), dtype=np.float32) * last
    centres[2] *= np.float32(0.1)
    cells = np.argwhere(np.ones(shape))[:, ::-1].astype(np.float32)
    owner, offset = owners(cells, centres, frame, edge)
    expected, way = owners_reference(cells, centres, frame)
    np.testing.assert_allclose(np.abs(offset).max(-1), np.abs(way).max(-1), atol=1e-4)
    same = owner == expected  # two may be as near
    assert same.mean() > 0.99
    np.testing.assert_allclose(offset[same], way[same], atol=1e-4)


def test_mosaics_laid_together_are_those_laid_alone():
    I, frame = exemplar("heart", 16), curved(70)
    together = mosaics(I, frame, [generator(seed) for seed in range(3)])
    for seed, laid in enumerate(together):
        np.testing.assert_array_equal(laid, mosaic(I, frame, generator(seed)))


def test_nothing_is_sown_where_nothing_is_empty():
    I = exemplar("heart", 16)
    H = np.tile(I, (4, 4, 1))
    np.testing.assert_array_equal(reseed(H, I, along(0, H.shape[:2])), H)


def test_a_missing_motif_is_sown_and_the_others_are_left():
    I = exemplar("heart", 16)
    H = np.tile(I, (5, 5, 1))
    H[32:48, 32:48] = 0
    given = H.copy()
    out = reseed(H, I, along(0, H.shape[:2]))
    np.testing.assert_array_equal(H, given)  # the argument is not changed
    assert whole_motifs(out, along(0, H.shape[:2]), I)[0] >= 24
    assert rms(out[32:48, 32:48]) > 0.8 * rms(I)
    far = np.ones((80, 80), bool)
    far[24:56, 24:56] = False
    np.testing.assert_array_equal(out[far], H[far])


@pytest.mark.parametrize("angle", [0, 0.6, 2.5])
def test_an_empty_field_is_filled(angle):
    I, frame = exemplar("heart", 16), along(angle, (64, 64))
    H = reseed(np.zeros((64, 64, 2), np.float32), I, frame)
    assert rms(H) > 0.6 * rms(I)
    whole, total = whole_motifs(H, frame, I)
    assert total >= 3 and whole >= 0.6 * total


@pytest.mark.parametrize("shape", [(5, 7), (2, 2), (1, 9)])
def test_fields_smaller_than_the_exemplar_are_sown_too(shape):
    I = exemplar("circle", 16)
    H = reseed(np.zeros((*shape, 2), np.float32), I, along(0, shape))
    assert H.shape == (*shape, 2) and np.isfinite(H).all()
