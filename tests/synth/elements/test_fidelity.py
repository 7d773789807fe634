"""Fidelity: what the statistics say of arrangements that are known."""

import numpy as np
import pytest

from synth.elements import arrangement, fidelity


def test_a_grid_has_its_peaks_and_chance_has_none() -> None:
    grid = arrangement.hexagonal_grid((12, 12))
    period = grid.box[1] - grid.box[0]
    found = fidelity.statistics(grid.positions, 1.0, period)
    at = (np.arange(fidelity.BINS) + 0.5) / fidelity.BINS * fidelity.REACH
    assert found.nearest == pytest.approx(1.0, abs=1e-3)
    g = found.correlation
    assert g[at < 0.5].max() == 0 and g[at < 0.7].max() < 0.05 and g.max() > 2.5
    # rings at 1, 1.73 and 2, 2.65, and next to nothing between the first and the second
    peaks = at[1:-1][(g[1:-1] > g[:-2]) & (g[1:-1] > g[2:]) & (g[1:-1] > 1)]
    assert np.allclose(peaks, np.sqrt([1, 3, 4, 7]), atol=0.08) and g[np.abs(at - 1.36) < 0.08].max() < 0.2
    rng = np.random.Generator(np.random.Philox(key=1))
    chance = fidelity.statistics(rng.uniform(0, 30, (1, 3000, 1, 2)), 1.0, np.array([30.0, 30.0]))
    assert np.abs(chance.correlation[3:] - 1).max() < 0.15


def test_the_border_does_not_count_as_emptiness() -> None:
    rng = np.random.Generator(np.random.Philox(key=2))
    points = rng.uniform(0, 30, (1, 3000, 1, 2))

    def depth(p: np.ndarray) -> np.ndarray:
        return np.minimum(p, 30 - p).min(axis=1)

    whole = fidelity.statistics(points, 1.0, np.array([30.0, 30.0]))
    inner = fidelity.statistics(points, 1.0, depth=depth)
    assert fidelity.difference(whole.correlation, inner.correlation) < 0.06
    with pytest.raises(ValueError, match="deep enough"):
        fidelity.statistics(points, 20.0, depth=depth)


def test_a_spectrum_shows_its_frequency() -> None:
    t = np.arange(65)
    positions = np.zeros((65, 3, 1, 2))
    positions[:, :, 0, 0] = np.sin(2 * np.pi * t / 8)[:, None] + np.arange(3) * 5
    assert np.argmax(fidelity.spectrum(positions)) == 8


def test_difference_and_jitter() -> None:
    assert fidelity.difference(np.ones(4), np.ones(4)) == 0 and fidelity.difference(np.ones(4), 2 * np.ones(4)) == 1
    even = np.arange(5.0)[:, None, None, None] * np.ones((1, 2, 1, 2))
    assert fidelity.jitter(even) == 0
    assert fidelity.jitter(even**2) == pytest.approx(8.0)


def test_a_unit_smaller_than_the_radii_that_are_asked_repeats_as_often_as_it_takes() -> None:
    """A hexagonal grid of 4 by 4 is the same grid as one of 12 by 12."""
    small, large = (fidelity.statistics(grid.positions, 0.95, grid.box[1] - grid.box[0])
                    for grid in (arrangement.hexagonal_grid((4, 4)), arrangement.hexagonal_grid((12, 12))))
    assert fidelity.difference(large.correlation, small.correlation) < 0.02
    assert small.nearest == pytest.approx(large.nearest, rel=1e-4)
