"""Assignment: what a single match, a hold and a resting flow give, then the kernels against their references."""

import numpy as np
import pytest

from synth import opencl
from synth.motion.assignment import (
    EDGE,
    Assigner,
    average_reference,
    carry,
    carry_reference,
    catmull_rom,
    falloff,
    robust_weights,
    robust_weights_reference,
    sample_reference,
)
from synth.motion.neighborhood import site_grid, spacing

SHAPES = [(5, 7), (2, 2), (1, 9), (9, 1), (1, 1), (21, 26)]


def field(shape, seed=0, channels=2):
    return np.random.default_rng(seed).normal(size=(*shape, channels)).astype(np.float32)


def case(shape, radius, size, seed=0, channels=2):
    """Arguments of `average_reference`: random matches, weights, axes, prior and hold."""
    rng = np.random.default_rng(seed)
    sites, grid = site_grid(shape, 2 * radius + 1)
    angle = rng.uniform(-np.pi, np.pi, len(sites))
    position = rng.uniform(-0.5, np.array(size[::-1]) - 0.5, (len(sites), 2)).astype(np.float32)
    return (field(size, seed + 1, channels), position, rng.uniform(0.1, 1, len(sites)).astype(np.float32),
            np.stack([np.cos(angle), np.sin(angle)], -1).astype(np.float32), grid, radius, spacing(2 * radius + 1),
            field(shape, seed + 2, channels), rng.uniform(0, 3, shape).astype(np.float32))


def averaged(exemplar, position, weight, axis, grid, radius, step, prior, coherence):
    position, weight, axis, prior, coherence = map(opencl.to_device, (position, weight, axis, prior, coherence))
    return Assigner(exemplar, radius, step).average(position, weight, axis, grid, prior, coherence).get()


@pytest.mark.parametrize("weights", [
    robust_weights_reference,
    lambda squared, *given: robust_weights(opencl.to_device(squared), *given).get(),
], ids=["reference", "kernel"])
def test_robust_weights_are_one_for_an_exact_match_and_fall_with_distance(weights):
    found = weights(np.float32([0, 1, 10, 100, 1e5, 1e8]), 100, 0.5)
    assert found[0] == 1 and found.dtype == np.float32
    assert (np.diff(found) < 0).all() and found[-1] > 0
    # far matches weigh as d^(r-2), r = 0.8: a thousand times the squared distance, 10^(-0.6 * 3) the weight
    assert found[5] / found[4] == pytest.approx(10 ** (-0.6 * 3), rel=1e-3)


def test_robust_weights_equal_their_reference():
    squared = np.random.default_rng(0).exponential(30, 77).astype(np.float32)
    ours = robust_weights(opencl.to_device(squared), 162, 0.4).get()
    np.testing.assert_allclose(ours, robust_weights_reference(squared, 162, 0.4), rtol=1e-6)


def test_the_falloff_reaches_its_edge():
    for radius in (1, 4, 8):
        assert np.exp(-falloff(radius) * radius**2) == pytest.approx(EDGE)


def test_catmull_rom_interpolates_and_sums_to_one():
    np.testing.assert_array_equal(catmull_rom(0.0), [0, 1, 0, 0])
    t = np.linspace(0, 1, 11)[:-1]
    np.testing.assert_allclose(catmull_rom(t).sum(-1), 1, atol=1e-6)
    np.testing.assert_allclose(catmull_rom(t) @ [-1, 0, 1, 2], t, atol=1e-6)  # linear fields stay linear


def test_sampling_at_cells_is_exact_and_wraps_or_repeats():
    values = field((5, 7))
    at = np.array([[3, 2], [-1, 0], [7, 5], [-15, 12]], np.float32)
    np.testing.assert_array_equal(sample_reference(values, at, True), values[[2, 0, 0, 2], [3, 6, 0, 6]])
    np.testing.assert_array_equal(sample_reference(values, at, False), values[[2, 0, 4, 4], [3, 0, 6, 0]])


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("radius", [1, 4, 8])
@pytest.mark.parametrize("size", [(5, 7), (2, 2), (16, 16)])
@pytest.mark.parametrize("channels", [1, 2])
def test_average_equals_its_reference(shape, radius, size, channels):
    given = case(shape, radius, size, channels=channels)
    np.testing.assert_allclose(averaged(*given), average_reference(*given), atol=2e-5)


def test_matches_that_agree_reproduce_the_exemplar():
    """Every site's match continues its neighbours': the average is the exemplar, tiled."""
    I = field((8, 8))
    for axis, place in ((np.float32([1, 0]), lambda x, y: (x, y)), (np.float32([0, 1]), lambda x, y: (y, -x))):
        sites, grid = site_grid((24, 24), 9)
        position = np.stack(place(sites[:, 0], sites[:, 1]), -1) % 8
        out = averaged(I, position.astype(np.float32), np.full(len(sites), 0.3, np.float32),
                       np.broadcast_to(axis, sites.shape).copy(), grid, 4, spacing(9), field((24, 24)),
                       np.zeros((24, 24), np.float32))
        y, x = np.mgrid[:24, :24]
        at = place(x, y)
        np.testing.assert_allclose(out, I[at[1] % 8, at[0] % 8], atol=1e-5)


def test_no_hold_forgets_the_prior_and_an_endless_one_keeps_it():
    given = list(case((12, 15), 4, (6, 6)))
    given[-1] = np.zeros((12, 15), np.float32)
    free = averaged(*given)
    given[-2] = given[-2] + 1
    np.testing.assert_array_equal(averaged(*given), free)
    given[-1] = np.full((12, 15), 1e9, np.float32)
    np.testing.assert_allclose(averaged(*given), given[-2], atol=1e-5)


def test_a_hold_of_one_is_the_mean_of_matches_and_prior():
    given = list(case((12, 15), 4, (6, 6)))
    given[-1] = np.zeros((12, 15), np.float32)
    free = averaged(*given)
    given[-1] = np.ones((12, 15), np.float32)
    np.testing.assert_allclose(averaged(*given), (free + given[-2]) / 2, atol=1e-5)


def test_the_average_does_not_depend_on_the_scale_of_the_weights():
    given = list(case((12, 15), 4, (6, 6)))
    first = averaged(*given)
    given[2] = given[2] * 8
    np.testing.assert_allclose(averaged(*given), first, atol=1e-6)


@pytest.mark.parametrize("shape", SHAPES)
def test_a_resting_flow_carries_nothing(shape):
    values = field(shape)
    np.testing.assert_array_equal(carry(values, np.zeros_like(values)), values)


def test_whole_cells_are_carried_exactly():
    values = field((5, 7))
    displacement = np.broadcast_to(np.float32([2, -1]), values.shape).copy()
    y, x = np.mgrid[:5, :7]
    np.testing.assert_array_equal(carry(values, displacement), values[np.clip(y - 1, 0, 4), np.clip(x + 2, 0, 6)])


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("channels", [1, 2])
def test_carry_equals_its_reference(shape, channels):
    values, displacement = field(shape, channels=channels), 3 * field(shape, 1)
    np.testing.assert_allclose(carry(values, displacement), carry_reference(values, displacement), atol=1e-5)


def test_carrying_to_and_fro_wears_less_than_linear_interpolation():
    """Thirty frames of a third of a cell: the detail keeps 97 % of its rms (linear interpolation: 72 %)."""
    x = np.arange(96) * 2 * np.pi / 16
    wave = np.broadcast_to(np.stack([np.sin(x), np.cos(x)], -1).astype(np.float32), (4, 96, 2)).copy()
    carried = wave
    for frame in range(30):
        carried = carry(carried, np.full_like(wave, (1 / 3, 0)) * (-1) ** frame)
    inside = np.s_[:, 16:-16]
    assert np.sqrt(np.mean(carried[inside] ** 2) / np.mean(wave[inside] ** 2)) > 0.97
