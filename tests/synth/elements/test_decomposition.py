"""Decomposition: the coarse part is smooth, unbiased, and adds up with the details."""

import numpy as np

from synth.elements import decomposition
from synth.elements.samples import Elements


def test_a_line_that_moves_evenly_is_all_coarse() -> None:
    t, s = np.meshgrid(np.arange(9.0), np.arange(12.0), indexing="ij")
    positions = np.stack([t, s, 0.5 * t - s], axis=-1)[:, None]
    assert np.allclose(decomposition.coarse(positions, (12,), 3, 4), positions, atol=1e-5)


def test_a_wave_shorter_than_the_filter_is_detail() -> None:
    s = np.arange(60)
    positions = np.zeros((5, 1, 60, 3))
    positions[..., 0] = np.sin(2 * np.pi * s / 6)
    positions[..., 2] = s
    found = decomposition.coarse(positions, (60,), 1, 9)
    assert np.abs(found[:, :, 12:-12, 0]).max() < 0.15
    assert np.allclose(found[..., 2], positions[..., 2], atol=1e-4)


def test_with_coarse_keeps_the_rest() -> None:
    elements = Elements(np.random.default_rng(1).normal(size=(8, 2, 12, 3)), (3, 4), rate=12.0)
    found = decomposition.with_coarse(elements)
    assert found.coarse is not None and (found.positions == elements.positions).all() and found.rate == 12.0
