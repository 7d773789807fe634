"""Neighbourhoods: the grid of sites, what they see in their frame, and the space they are compared in."""

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from synth import opencl
from synth.motion.exemplar import exemplar
from synth.motion.neighborhood import (
    MOST_DIMS,
    VARIANCE_KEPT,
    _scatter,
    exemplar_patches,
    gather_reference,
    site_grid,
    space,
    spacing,
)

SHAPES = [(5, 7), (2, 2), (1, 9), (9, 1), (1, 1), (24, 31)]


def field(shape, seed=0, channels=2):
    return np.random.default_rng(seed).normal(size=(*shape, channels)).astype(np.float32)


def turning(shape, seed=1):
    """Unit vectors in all directions."""
    angle = np.random.default_rng(seed).uniform(-np.pi, np.pi, shape)
    return np.stack([np.cos(angle), np.sin(angle)], -1).astype(np.float32)


def along(angle, shape):
    return np.broadcast_to(np.float32([np.cos(angle), np.sin(angle)]), (*shape, 2)).copy()


def gathered(ours, values, frame, sites):
    """`gather` on host arrays: the neighbourhoods of the sites, without the rows that fill up."""
    axis = frame[sites[:, 1], sites[:, 0]]
    return ours.gather(*map(opencl.to_device, (values, sites, axis))).get()[:len(sites)]


def projected(ours, values, frame, sites):
    return ours.project(*map(opencl.to_device, (values, sites, frame[sites[:, 1], sites[:, 0]]))).get()


def windows_of(values, sites, radius):
    return np.stack([values[y - radius:y + radius + 1, x - radius:x + radius + 1].ravel() for x, y in sites])


@pytest.mark.parametrize(("width", "step"), [(17, 4), (9, 2), (5, 1), (3, 1)])
def test_sites_stand_every_quarter_of_the_width(width, step):
    sites, (rows, columns) = site_grid((37, 53), width)
    assert spacing(width) == step and sites.dtype == np.int32 and len(sites) == rows * columns
    lattice = sites.reshape(rows, columns, 2)
    assert (np.diff(lattice[..., 0], axis=1) == step).all() and (np.diff(lattice[..., 1], axis=0) == step).all()
    assert (lattice[0, 0] == step // 2).all()
    # no cell is further from a site than the spacing allows: every cell is covered many times over
    assert 37 - 1 - sites[:, 1].max() < step and 53 - 1 - sites[:, 0].max() < step


def test_the_smallest_field_has_a_site():
    for shape in ((1, 1), (2, 2)):
        sites, grid = site_grid(shape, 9)
        assert len(sites) == grid[0] * grid[1]


def test_exemplar_patches_are_its_toroidal_windows():
    values = field((5, 7))
    patches = exemplar_patches(values, 4).reshape(5, 7, 9, 9, 2)
    for y, x in np.ndindex(5, 7):
        there = values[np.arange(y - 4, y + 5)[:, None] % 5, np.arange(x - 4, x + 5) % 7]
        np.testing.assert_array_equal(patches[y, x], there)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("radius", [1, 4, 8])
@pytest.mark.parametrize("channels", [1, 2])
def test_gather_equals_its_reference(shape, radius, channels):
    values, frame = field(shape, channels=channels), turning(shape)
    sites, _ = site_grid(shape, 3)
    ours = space(field((6, 5), channels=channels), radius)
    assert ours.channels == channels
    expected = gather_reference(values, sites, frame[sites[:, 1], sites[:, 0]], radius)
    np.testing.assert_allclose(gathered(ours, values, frame, sites), expected, atol=2e-5)


@pytest.mark.parametrize("radius", [1, 4])
def test_along_x_a_neighbourhood_is_the_window_exactly(radius):
    values = field((19, 23))
    sites = np.array([[11, 9], [9, 11], [13, 8]], np.int32)
    patches = gathered(space(field((6, 5)), radius), values, along(0, (19, 23)), sites)
    np.testing.assert_array_equal(patches, windows_of(values, sites, radius))


def test_along_y_a_neighbourhood_is_the_window_turned():
    values = field((19, 23))
    sites = np.array([[11, 9]], np.int32)
    frame = np.broadcast_to(np.float32([0, 1]), (19, 23, 2)).copy()
    patch = gathered(space(field((6, 5)), 3), values, frame, sites).reshape(7, 7, 2)
    # offset (i, j) in the frame lies at (-j, i) in the field: values are not turned, only where they are read
    window = values[6:13, 8:15]
    for j, i in np.ndindex(7, 7):
        np.testing.assert_array_equal(patch[j, i], window[i, 6 - j])


@pytest.mark.parametrize("size", [(5, 7), (16, 16)])
@pytest.mark.parametrize(("radius", "channels"), [(2, 1), (2, 2), (8, 2)])
def test_project_equals_its_reference(size, radius, channels):
    ours = space(field(size, channels=channels), radius)
    values, frame = field((13, 11), 2, channels), turning((13, 11))
    for sites in (site_grid((13, 11), 9)[0], np.array([[3, 4]], np.int32)):
        patches = gather_reference(values, sites, frame[sites[:, 1], sites[:, 0]], radius)
        expected = ours.project_reference(patches)
        np.testing.assert_allclose(projected(ours, values, frame, sites), expected, atol=2e-5 * np.abs(expected).max())


def test_the_exemplar_seen_in_the_output_is_its_own_points():
    I = exemplar("heart", 16)
    ours = space(I, 4)
    tiled = np.tile(I, (3, 3, 1))
    sites = np.stack(np.meshgrid(np.arange(16, 32), np.arange(16, 32)), -1).reshape(-1, 2).astype(np.int32)
    np.testing.assert_allclose(projected(ours, tiled, along(0, (48, 48)), sites), ours.points, atol=1e-5)


@pytest.mark.parametrize(("kind", "size", "radius"), [("heart", 32, 8), ("square", 16, 4), ("stripes", 16, 8)])
def test_the_space_holds_the_variance_in_orthonormal_directions(kind, size, radius):
    I = exemplar(kind, size)
    ours = space(I, radius)
    assert ours.dims % 16 == 0 and ours.dims <= MOST_DIMS
    assert ours.points.shape == (size * size, ours.dims) and ours.points.dtype == ours.basis.dtype == np.float32
    kept = int((np.abs(ours.basis).max(axis=0) > 0).sum())
    np.testing.assert_allclose(ours.basis.T @ ours.basis, np.diag(np.arange(ours.dims) < kept), atol=1e-5)
    patches = exemplar_patches(I, radius)
    share = ours.points.var(axis=0).sum() / patches.var(axis=0).sum()
    assert share >= VARIANCE_KEPT or kept == MOST_DIMS
    variances = ours.points.var(axis=0)[:kept]
    assert (np.diff(variances) <= 1e-5 * variances[0]).all()


@pytest.mark.parametrize(("size", "channels", "radius"), [((20, 17), 2, 2), ((5, 9), 1, 1), ((4, 3), 2, 3)])
def test_the_scatter_is_that_of_the_neighbourhoods(size, channels, radius):
    """Of odd sizes, and of neighbourhoods wider than the exemplar."""
    I = field(size, channels=channels)
    patches = exemplar_patches(I, radius).astype(np.float64)
    centred = patches - patches.mean(0)
    np.testing.assert_allclose(_scatter(I, radius), centred.T @ centred, atol=1e-9 * np.prod(size))


def test_distances_in_the_space_are_those_of_the_neighbourhoods():
    I = exemplar("circle", 16)
    patches, points = exemplar_patches(I, 4), space(I, 4).points
    pairs = np.random.default_rng(0).integers(256, size=(200, 2))
    long = np.linalg.norm(patches[pairs[:, 0]] - patches[pairs[:, 1]], axis=1)
    short = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1)
    assert (short <= long + 1e-4).all()
    assert short.sum() > 0.98 * long.sum()


def test_more_neighbourhoods_than_numbers_or_fewer_give_one_space():
    """The two Gram matrices: 64 patches of 578 numbers, and the same exemplar tiled to 1024 patches."""
    I = exemplar("heart", 8)
    few, many = space(I, 8), space(np.tile(I, (4, 4, 1)), 8)
    np.testing.assert_allclose(np.linalg.norm(few.points, axis=1),
                               np.linalg.norm(many.points.reshape(4, 8, 4, 8, -1)[0, :, 0].reshape(64, -1), axis=1),
                               atol=1e-4)


def test_an_exemplar_without_variance_has_a_space():
    ours = space(np.full((5, 7, 2), 0.5, np.float32), 2)
    np.testing.assert_array_equal(ours.points, np.zeros((35, ours.dims)))


def test_the_space_does_not_depend_on_the_threads_of_blas():
    I = field((16, 16))
    with threadpool_limits(1):
        one = space(I, 8)
    with threadpool_limits(2):
        two = space(I, 8)
    np.testing.assert_array_equal(one.basis, two.basis)
    np.testing.assert_array_equal(one.points, two.points)


def test_projecting_twice_gives_the_same_bits():
    ours = space(field((8, 8)), 4)
    values, frame, sites = field((20, 20)), turning((20, 20)), site_grid((20, 20), 9)[0]
    np.testing.assert_array_equal(projected(ours, values, frame, sites), projected(ours, values, frame, sites))
