"""Search: planted matches are found, ties go to the lowest index, and each kernel equals its reference."""

import numpy as np
import pytest

from synth import opencl
from synth.motion.exemplar import exemplar
from synth.motion.neighborhood import Space, site_grid, space, spacing
from synth.motion.search import (
    QUERIES_TOGETHER,
    Matcher,
    close_together,
    coherent_reference,
    exact_reference,
    refine_reference,
    similar_sets,
)


def cloud(count, dims, seed=0):
    return np.random.default_rng(seed).normal(size=(count, dims)).astype(np.float32)


def matcher(points, size=None, k=1):
    """A matcher of bare points: their basis plays no part in the search."""
    return Matcher(Space(0, np.zeros(2, np.float32), np.zeros((2, points.shape[1]), np.float32), points),
                   size or (1, len(points)), k)


def exact(points, queries):
    best, distance = matcher(points).exact(opencl.to_device(queries))
    return best.get(), distance.get()


@pytest.mark.parametrize("count", [1, 2, 31, 32, 33, 35, 4097])
@pytest.mark.parametrize("dims", [16, 48])
def test_exact_equals_its_reference(count, dims):
    points = cloud(count, dims)
    for queries in (1, QUERIES_TOGETHER - 1, QUERIES_TOGETHER, 3 * QUERIES_TOGETHER + 1):
        asked = cloud(queries, dims, seed=queries)
        best, distance = exact(points, asked)
        expected, squared = exact_reference(points, asked)
        np.testing.assert_array_equal(best, expected)
        np.testing.assert_allclose(distance, squared, rtol=2e-5, atol=1e-5)


@pytest.mark.parametrize("spread", [0, 1e-3, 0.5])
def test_nothing_that_a_bound_rules_out_was_the_nearest(spread):
    """Clusters far apart, in which whole blocks of points are passed over; queries near them and between them."""
    middles = 20 * cloud(40, 32, seed=1)
    points = np.repeat(middles, 50, axis=0) + spread * cloud(2000, 32, seed=2)
    points = points[np.random.default_rng(3).permutation(2000)]
    asked = np.concatenate([points[::7] + 0.1 * cloud(286, 32, seed=4), middles[1:] / 2 + middles[:-1] / 2])
    best, distance = exact(points, asked)
    _, squared = exact_reference(points, asked)
    np.testing.assert_allclose(distance, squared, rtol=2e-5, atol=2e-2)  # of squares that cancel, 1e4
    np.testing.assert_allclose(((points[best] - asked) ** 2).sum(1), squared, rtol=2e-5, atol=2e-2)


def test_blocks_of_points_lie_close_together_and_identical_ones_in_order():
    points = np.repeat(cloud(20, 8), 5, axis=0)[np.random.default_rng(0).permutation(100)]
    order = close_together(points)
    np.testing.assert_array_equal(np.sort(order), np.arange(100))
    for point in np.unique(points, axis=0):
        assert (np.diff(order[(points[order] == point).all(1)]) > 0).all()
    line = np.arange(96, dtype=np.float32)[np.random.default_rng(1).permutation(96), None]
    np.testing.assert_array_equal(line[close_together(line)].ravel() // 32, np.arange(96) // 32)


def test_every_planted_point_is_found():
    points = cloud(1000, 32)
    order = np.random.default_rng(1).permutation(1000)
    best, distance = exact(points, points[order])
    np.testing.assert_array_equal(best, order)
    assert distance.max() < 1e-4


def test_equal_distances_go_to_the_lowest_index():
    """In whatever lane of the vector unit they lie: copies of one point at every offset."""
    point = cloud(1, 16)
    points = np.concatenate([cloud(7, 16, seed=2) + 10, *[point] * 70])
    best, _ = exact(points, np.repeat(point, 9, axis=0))
    np.testing.assert_array_equal(best, np.full(9, 7))
    for first in range(7, 60):
        moved = np.concatenate([cloud(first, 16, seed=3) + 10, *[point] * (77 - first)])
        assert exact(moved, point)[0][0] == first


def test_the_padding_is_never_a_match():
    """33 points are padded to 64; far queries must not fall on a point that is not there."""
    best, _ = exact(cloud(33, 16), 1e3 * cloud(40, 16, seed=5))
    assert best.min() >= 0 and best.max() < 33


def test_similar_sets_begin_with_themselves_and_are_the_nearest():
    points = cloud(60, 16)
    sets = similar_sets(points, 4)
    squared = ((points[:, None].astype(np.float64) - points) ** 2).sum(-1)
    np.testing.assert_array_equal(sets, np.argsort(squared, axis=1, kind="stable")[:, :4])
    assert sets.dtype == np.int32


def test_among_identical_neighbourhoods_each_set_still_begins_with_its_own():
    points = np.repeat(cloud(5, 16), 6, axis=0)
    for k in (1, 3, 4):
        sets = similar_sets(points, k)
        np.testing.assert_array_equal(sets[:, 0], np.arange(30))
        assert all(len(set(row)) == k for row in sets.tolist())
    assert similar_sets(points[:2], 4).shape == (2, 2)


def oriented_case(shape, width, size, seed=0):
    """Sites on a grid, unit axes in all directions, queries and a last match."""
    rng = np.random.default_rng(seed)
    sites, grid = site_grid(shape, width)
    angle = rng.uniform(-np.pi, np.pi, len(sites))
    axis = np.stack([np.cos(angle), np.sin(angle)], -1).astype(np.float32)
    match = rng.integers(size[0] * size[1], size=len(sites)).astype(np.int32)
    return sites, grid, axis, match


@pytest.mark.parametrize("shape", [(1, 1), (5, 7), (2, 2), (1, 30), (30, 1), (23, 31)])
@pytest.mark.parametrize("size", [(4, 4), (5, 7), (2, 3)])
@pytest.mark.parametrize("k", [1, 4])
def test_coherent_equals_its_reference(shape, size, k):
    points = cloud(size[0] * size[1], 16)
    ours = matcher(points, size, k)
    sites, grid, axis, match = oriented_case(shape, 9, size)
    queries = cloud(len(sites), 16, seed=4)
    best, distance = ours.coherent(opencl.to_device(queries), opencl.to_device(sites), opencl.to_device(axis), grid,
                                   opencl.to_device(match))
    expected, squared = coherent_reference(points, similar_sets(points, k), size, queries, sites, axis, grid, match)
    np.testing.assert_array_equal(best.get(), expected)
    np.testing.assert_allclose(distance.get(), squared, rtol=1e-5)


def test_coherence_carries_a_neighbours_match_along_the_frame():
    """One site knows the right match; each round its neighbours learn theirs, shifted by their distance."""
    size = (16, 16)
    points = cloud(256, 16)
    ours = matcher(points, size)
    sites, grid = site_grid((40, 40), 9)
    # the frame points along y: a step of (dx, dy) in the output is one of (dy, -dx) in the exemplar
    axis = np.broadcast_to(np.float32([0, 1]), sites.shape).copy()
    right = ((3 - (sites[:, 0] - 1)) % 16 * 16 + (5 + sites[:, 1] - 1) % 16).astype(np.int32)
    match = np.where(np.arange(len(sites)) == 0, right, (right + 37) % 256).astype(np.int32)
    queries = opencl.to_device(points[right])
    for round_ in range(1, 4):
        best, distance = ours.coherent(queries, opencl.to_device(sites), opencl.to_device(axis), grid,
                                       opencl.to_device(match))
        match = best.get()
        reached = (sites <= 1 + round_ * spacing(9)).all(axis=1)
        np.testing.assert_array_equal(match[reached], right[reached])
        np.testing.assert_array_equal(distance.get()[reached], 0)


def test_coherent_matches_are_never_better_than_exact_ones():
    I = exemplar("heart", 16)
    ours = Matcher(space(I, 4), (16, 16), 4)
    sites, grid, axis, match = oriented_case((40, 40), 9, (16, 16))
    queries = opencl.to_device(ours.space.points[match] + cloud(len(sites), ours.space.dims, 8) / 10)
    _, best = ours.exact(queries)
    _, coherent = ours.coherent(queries, opencl.to_device(sites), opencl.to_device(axis), grid,
                                opencl.to_device(match))
    assert (coherent.get() >= best.get() - 1e-4).all()


@pytest.mark.parametrize("size", [(1, 1), (2, 2), (1, 9), (5, 7), (12, 12)])
def test_refine_equals_its_reference(size):
    points = cloud(size[0] * size[1], 32)
    queries = cloud(21, 32, seed=9)
    best, _ = exact_reference(points, queries)
    position = matcher(points, size).refine(opencl.to_device(queries), opencl.to_device(best.astype(np.int32)))
    np.testing.assert_allclose(position.get(), refine_reference(points, size, queries, best), atol=1e-4)


@pytest.mark.parametrize("kind", ["heart", "sinusoid"])
def test_an_exact_match_is_not_moved(kind):
    ours = Matcher(space(exemplar(kind, 16), 4), (16, 16), 1)
    own = np.arange(256, dtype=np.int32)
    position = ours.refine(opencl.to_device(ours.space.points), opencl.to_device(own)).get()
    np.testing.assert_allclose(position, np.stack([own % 16, own // 16], -1), atol=1e-6)


@pytest.mark.parametrize("shift", [(0.3, 0.0), (0.0, -0.4), (0.25, 0.25)])
def test_a_neighbourhood_between_cells_is_found_between_them(shift):
    """A smooth exemplar, sampled off its cells: the refined position is nearer than a tenth of a cell."""
    n = 16
    j, i = np.mgrid[:n, :n] * 2 * np.pi / n

    def flow(dx, dy):
        x, y = i + dx * 2 * np.pi / n, j + dy * 2 * np.pi / n
        return np.stack([np.sin(x) + np.cos(2 * y), np.cos(x + y)], -1).astype(np.float32)

    ours = Matcher(space(flow(0, 0), 4), (n, n), 1)
    tiled = np.tile(flow(*shift), (3, 3, 1))
    sites = np.stack(np.meshgrid(np.arange(n, 2 * n), np.arange(n, 2 * n)), -1).reshape(-1, 2).astype(np.int32)
    axis = np.broadcast_to(np.float32([1, 0]), sites.shape)
    queries = ours.space.project(*map(opencl.to_device, (tiled, sites, axis)))
    position = ours.refine(queries, ours.exact(queries)[0]).get()
    off = (position - (sites - n) - np.float32(shift) + n / 2) % n - n / 2
    assert np.abs(off).max() < 0.1
