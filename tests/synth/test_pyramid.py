"""Pyramids: what they keep, where their cells stand, and the filter against a plain loop."""

import numpy as np
import pytest

from synth.pyramid import KERNEL, pyramid, reduce, resample

SHAPES = [(5, 7), (2, 2), (1, 9), (9, 1), (6, 8), (5, 7, 2)]
BOTH = pytest.mark.parametrize("toroidal", [True, False])


def field(shape, seed=0):
    return np.random.default_rng(seed).normal(size=shape).astype(np.float32)


def reduced_by_loop(values, toroidal):
    rows, columns = (-(-n // 2) for n in values.shape[:2])

    def at(i, size):
        return i % size if toroidal else min(max(i, 0), size - 1)

    out = np.zeros((rows, columns, *values.shape[2:]))
    for y, x, j, i in np.ndindex(rows, columns, 4, 4):
        there = values[at(2 * y + j - 1, values.shape[0]), at(2 * x + i - 1, values.shape[1])]
        out[y, x] += float(KERNEL[j]) * float(KERNEL[i]) * there
    return out


@BOTH
@pytest.mark.parametrize("shape", SHAPES)
def test_a_constant_stays_exactly(shape, toroidal):
    coarse = reduce(np.full(shape, 3.0, np.float32), toroidal)
    assert coarse.dtype == np.float32
    np.testing.assert_array_equal(coarse, np.full((-(-shape[0] // 2), -(-shape[1] // 2), *shape[2:]), 3.0))


@BOTH
@pytest.mark.parametrize("shape", SHAPES)
def test_reduce_equals_the_loop(shape, toroidal):
    values = field(shape)
    np.testing.assert_allclose(reduce(values, toroidal), reduced_by_loop(values, toroidal), atol=1e-6)


def test_toroidal_reduction_keeps_the_mean_and_commutes_with_shifts_of_two():
    values = field((8, 12))
    coarse = reduce(values, True)
    assert coarse.mean() == pytest.approx(values.mean(), abs=1e-6)
    np.testing.assert_array_equal(reduce(np.roll(values, (2, -4), (0, 1)), True), np.roll(coarse, (1, -2), (0, 1)))


def test_a_coarse_cell_stands_between_two_fine_ones():
    ramp = np.tile(np.arange(12, dtype=np.float32), (10, 1))
    np.testing.assert_array_equal(reduce(ramp, False)[:, 1:-1], np.tile(2 * np.arange(1, 5) + 0.5, (5, 1)))


def test_the_levels_go_from_coarse_to_the_field_itself():
    values = field((20, 13, 2))
    levels = pyramid(values, 4, toroidal=True)
    assert [level.shape for level in levels] == [(3, 2, 2), (5, 4, 2), (10, 7, 2), (20, 13, 2)]
    assert levels[-1] is values
    np.testing.assert_array_equal(levels[1], reduce(levels[2], True))
    assert len(pyramid(values, 1, toroidal=False)) == 1


@pytest.mark.parametrize("shape", SHAPES)
def test_resampling_at_the_cells_is_the_identity(shape):
    values = field(shape)
    np.testing.assert_array_equal(resample(values, shape[:2], (0.0, 0.0), 1.0), values)


def test_resampling_is_linear_and_repeats_the_edges():
    ramp = np.tile(np.arange(5, dtype=np.float32), (3, 1))
    out = resample(ramp, (6, 12), (-0.25, -0.25), 0.5)
    np.testing.assert_array_equal(out, np.tile(np.clip(np.arange(12) * 0.5 - 0.25, 0, 4), (6, 1)))
    assert out.dtype == np.float32


def test_a_finer_level_stands_where_its_coarser_one_did():
    """Reducing and resampling back moves nothing: a smooth bump keeps its centre."""
    y, x = np.mgrid[:32, :48].astype(np.float32)
    bump = np.exp(-((x - 21) ** 2 + (y - 14) ** 2) / 18).astype(np.float32)
    back = resample(reduce(bump, False), (32, 48), (-0.25, -0.25), 0.5)
    for grid, centre in ((x, 21), (y, 14)):
        assert (back * grid).sum() / back.sum() == pytest.approx(centre, abs=1e-3)


@BOTH
def test_a_field_constant_along_z_is_reduced_in_each_layer(toroidal):
    layer = field((5, 7, 3))
    coarse = reduce(np.broadcast_to(layer, (6, 5, 7, 3)), toroidal, dimension=3)
    assert coarse.shape == (3, 3, 4, 3)
    for z in range(3):
        np.testing.assert_allclose(coarse[z], reduce(layer, toroidal), atol=1e-6)


def test_three_dimensions_are_sampled_linearly():
    ramp = np.stack(np.meshgrid(np.arange(4.0), np.arange(3.0), np.arange(5.0), indexing="ij"), -1)
    fine = resample(ramp.astype(np.float32), (4, 3, 5), (0.5, 0.25, 0.0), 0.5)
    np.testing.assert_allclose(fine[2, 1, 3], [1.5, 0.75, 1.5])
