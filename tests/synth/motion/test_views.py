"""Views: what they see and contribute, then the kernels against their references."""

import numpy as np
import pytest

from synth import opencl
from synth.motion import views

FRONT, SIDE, TOP = ((1, 0, 0), (0, 1, 0)), ((0, 0, 1), (0, 1, 0)), ((1, 0, 0), (0, 0, 1))


def picture(shape=(8, 8), seed=0):
    return np.random.default_rng(seed).normal(size=(*shape, 2)).astype(np.float32)


def views_of(I, *planes, weights=(1, 1, 1)):
    return [views.View(I, *plane, weight) for plane, weight in zip(planes, weights, strict=False)]


def test_three_planes_give_equation_2():
    # x is seen by front and top, y by front and side, z by side and top: each the mean of two
    front, side, top = views.contributions(views_of(picture(), FRONT, SIDE, TOP))
    np.testing.assert_allclose(front, [[0.5, 0], [0, 0.5], [0, 0]], atol=1e-12)
    np.testing.assert_allclose(side, [[0, 0], [0, 0.5], [0.5, 0]], atol=1e-12)
    np.testing.assert_allclose(top, [[0.5, 0], [0, 0], [0, 0.5]], atol=1e-12)


def test_a_heavy_view_dominates():
    front, side, _ = views.contributions(views_of(picture(), FRONT, SIDE, TOP, weights=(9, 1, 1)))
    np.testing.assert_allclose(front[0, 0], 0.9)
    np.testing.assert_allclose(side[1, 1], 0.1)
    np.testing.assert_allclose(side[2, 0], 0.5)  # what the front does not see


def test_tilted_views_agree_on_what_they_all_see():
    turned = views.View(picture(), (1, 0, 0), (0, 1, 1))
    chosen = [*views_of(picture(), FRONT, SIDE), turned]
    matrices = views.contributions(chosen)
    s = np.array([0.3, -1.2, 0.7])
    np.testing.assert_allclose(sum(m @ v.projection @ s for m, v in zip(matrices, chosen, strict=True)), s)


@pytest.mark.parametrize("planes", [(FRONT,), (FRONT, FRONT), (FRONT, ((0, 1, 0), (1, 0, 0)))])
def test_views_that_do_not_span_space_are_refused(planes):
    with pytest.raises(ValueError, match=r"do not span space: none sees the direction \((-?0, ){2}-?1\)"):
        views.contributions(views_of(picture(), *planes))


@pytest.mark.parametrize("wrong, message", [
    ({"right": (0, 0, 0)}, "span no plane"), ({"up": (2, 0, 0)}, "span no plane"), ({"weight": 0}, "positive"),
    ({"exemplar": np.zeros((4, 4, 2), np.float32)}, "zero everywhere"),
    ({"exemplar": np.ones((4, 4, 3), np.float32)}, "not"),
])
def test_a_view_is_checked(wrong, message):
    with pytest.raises(ValueError, match=message):
        views.View(**({"exemplar": picture()} | wrong))


def rotations(count, seed=3):
    """Random rotations (count, 3, 3) float32."""
    random = np.random.default_rng(seed)
    found, _ = np.linalg.qr(random.normal(size=(count, 3, 3)))
    found[np.linalg.det(found) < 0, :, 0] *= -1
    return found.astype(np.float32)


class Bench:
    """One view's search over a field whose every site has local axes of its own."""

    def __init__(self, dimension, shape, dominant, width=5):
        random = np.random.default_rng(7)
        size = (6, 7) if dimension == 2 else (3, 4, 5)
        I = random.normal(size=(*size, dimension)).astype(np.float32)
        view = views.View(I, (1, 2, 0), (0, 1, 1), 1.5)
        matrix = random.normal(size=(3, dimension))
        self.search = views.ViewSearch(view, I, matrix, width, dominant)
        self.field = random.normal(size=(*shape, 3)).astype(np.float32)
        slices = views.site_grid(shape, width)
        cells = np.stack(np.meshgrid(*(np.arange(n)[s] for n, s in zip(shape, slices, strict=True)), indexing="ij"), -1)
        self.grid = cells.shape[:3]
        self.sites = cells.reshape(-1, 3)[:, ::-1]
        axes = rotations(len(self.sites)).reshape(*self.grid, 3, 3)
        self.basis = self.search.basis_at(axes)
        self.on_host = self.basis.get()[..., :3].astype(np.float64)
        self.position = (random.random((len(self.sites), 2 * dimension - 2)) * 9 - 1).astype(np.float32)[:, :4]
        if dimension == 3:
            self.position[:, 3] = 0
        self.weight = random.random(len(self.sites)).astype(np.float32)


BENCHES = pytest.mark.parametrize("dimension, dominant", [(2, False), (2, True), (3, False)])
SHAPES = pytest.mark.parametrize("shape", [(5, 7, 3), (2, 2, 2), (4, 3, 9)])


@BENCHES
@SHAPES
def test_gather_and_search_equal_their_references(shape, dimension, dominant):
    b = Bench(dimension, shape, dominant)
    match, position, distance = b.search.search(views.on_device(b.field), b.basis, b.grid, None)
    seen = views.gather_reference(b.field, b.sites, b.on_host, b.search.view, 2, float(b.search.slab), 1)
    space = b.search.matcher.space
    queries = (seen - space.mean) @ space.basis
    squared = ((queries[:, None] - space.points) ** 2).sum(-1)
    np.testing.assert_allclose(distance.get(), squared.min(1), rtol=1e-3, atol=1e-3)
    chosen = squared[np.arange(len(b.sites)), match.get()]
    np.testing.assert_allclose(chosen, squared.min(1), rtol=1e-3, atol=1e-3)
    if dimension == 2:  # not further than half a cell along each axis from the cell that matched
        columns = b.search.exemplar.shape[1]
        cell = np.stack([match.get() % columns, match.get() // columns], -1)
        assert np.abs(position.get() - cell).max() <= 0.5
    # and from there by k-coherence
    found, _, distance = b.search.search(views.on_device(b.field), b.basis, b.grid, match)
    best, least = views.coherent_reference(
        space.points, b.search.matcher.similar.get(), b.search.exemplar.shape[:-1], queries.astype(np.float32),
        b.sites, b.on_host, b.grid, match.get())
    np.testing.assert_allclose(distance.get(), least, rtol=1e-3, atol=1e-3)
    assert (found.get() == best).mean() > 0.95  # equal but for ties to rounding


@BENCHES
@SHAPES
@pytest.mark.parametrize("eight", [True, False])
def test_average_equals_its_reference(shape, dimension, dominant, eight):
    b = Bench(dimension, shape, dominant)
    out = opencl.empty((*shape, 4))
    given = (opencl.to_device(b.position), opencl.to_device(b.weight), b.basis, b.grid,
             views.on_device(b.field), out)
    b.search.average(*given, eight, True)
    expected = views.average_reference(b.search, b.position, b.weight, b.sites, b.on_host, b.field, eight)
    np.testing.assert_allclose(out.get()[..., :3], expected, atol=2e-4)
    # a second view adds to the contribution of the first
    b.search.average(*given, eight, False)
    np.testing.assert_allclose(out.get()[..., :3], 2 * expected, atol=4e-4)


@BENCHES
@SHAPES
def test_nearest_equals_its_reference(shape, dimension, dominant):
    b = Bench(dimension, shape, dominant)
    out = opencl.empty((*shape, 4))
    b.search.nearest(opencl.to_device(b.position), b.basis, b.grid, views.on_device(b.field), out, True)
    expected = views.nearest_reference(b.search, b.position, b.sites, b.on_host, b.field)
    np.testing.assert_allclose(out.get()[..., :3], expected, atol=2e-4)


def test_a_volume_too_large_for_an_exemplar_is_refused():
    with pytest.raises(ValueError, match="too large an exemplar"):
        views.exemplar_blocks(np.ones((64, 64, 64, 3), np.float32), 4)
