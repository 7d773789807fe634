"""A current: uniform without stones, past them with, and eddies that drift along and come back."""

import numpy as np
import pytest

from synth.noise import curl
from synth.photo.current import Current, eddies, past_stones
from synth.photo.tiles import rng

SHAPE = (120, 160)
U = np.array([2.0, 0.5])


def disc(radius=18):
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    return (np.hypot(x - 80, y - 60) - radius).astype(np.float32)


def test_without_stones_the_current_is_uniform():
    np.testing.assert_array_equal(past_stones(U, np.full(SHAPE, 50, np.float32)),
                                  np.broadcast_to(np.float32(U), (*SHAPE, 2)))


def test_water_slows_before_a_stone_and_hurries_beside_it():
    v = past_stones(np.array([2.0, 0.0]), disc())
    assert v[60, 58, 0] < 1.2, "before it"
    assert v[60 + 22, 80, 0] > 2.2 and v[60 - 22, 80, 0] > 2.2, "beside it"
    assert v[66, 60, 1] > 0.3 > -0.3 > v[54, 60, 1], "it parts"
    np.testing.assert_allclose(v[5, 5], [2, 0], atol=0.25)


def test_eddies_have_their_speed_and_diverge_nowhere():
    psi = eddies(SHAPE, 24, U, 30.0, 0.7, np.ones(SHAPE, np.float32), rng(1))
    v = curl(psi[0][None])
    assert np.sqrt((v**2).sum(-1).mean()) == pytest.approx(0.7, rel=1e-4)
    inner = np.gradient(v[..., 0], axis=1) + np.gradient(v[..., 1], axis=0)
    assert np.abs(inner[1:-1, 1:-1]).max() < 1e-5


def test_eddies_drift_with_the_current_by_whole_tiles():
    """T = 128: a tile 256 pixels wide passes once along x; four frames later they lie 8 pixels further."""
    psi = eddies(SHAPE, 128, np.array([2.0, 0.0]), 30.0, 1.0, np.ones(SHAPE, np.float32), rng(2))
    moved, stayed = (np.corrcoef(psi[4][:, 8:].ravel(), before.ravel())[0, 1]
                     for before in (psi[0][:, :-8], psi[0][:, 8:]))
    assert moved > 0.85 > stayed  # they also change
    steps = np.abs(np.diff(psi, axis=0)).mean((1, 2))
    assert np.abs(psi[0] - psi[-1]).mean() == pytest.approx(steps.mean(), rel=0.15)


def test_the_mean_is_that_of_all_frames():
    current = Current(past_stones(U, disc()), eddies(SHAPE, 8, U, 30.0, 0.7, np.ones(SHAPE, np.float32), rng(3)))
    np.testing.assert_allclose(current.mean(), np.mean([current.velocity(t) for t in range(8)], axis=0), atol=1e-5)
