"""Solid synthesis: what the views see and say, then the kernels against their references, then whole fields."""

import numpy as np
import pytest

from synth.motion import exemplar, solid

FRONT, SIDE, TOP = ((1, 0, 0), (0, 1, 0)), ((0, 0, 1), (0, 1, 0)), ((1, 0, 0), (0, 0, 1))


def picture(shape=(8, 8), seed=0):
    return np.random.default_rng(seed).normal(size=(*shape, 2)).astype(np.float32)


def views(I, *planes, weights=(1, 1, 1)):
    return [solid.View(I, *plane, weight) for plane, weight in zip(planes, weights, strict=False)]


def test_three_planes_give_equation_2():
    # x is seen by front and top, y by front and side, z by side and top: each the mean of two
    front, side, top = solid.contributions(views(picture(), FRONT, SIDE, TOP))
    np.testing.assert_allclose(front, [[0.5, 0], [0, 0.5], [0, 0]], atol=1e-12)
    np.testing.assert_allclose(side, [[0, 0], [0, 0.5], [0.5, 0]], atol=1e-12)
    np.testing.assert_allclose(top, [[0.5, 0], [0, 0], [0, 0.5]], atol=1e-12)


def test_a_weighty_view_has_its_way():
    front, side, _ = solid.contributions(views(picture(), FRONT, SIDE, TOP, weights=(9, 1, 1)))
    np.testing.assert_allclose(front[0, 0], 0.9)
    np.testing.assert_allclose(side[1, 1], 0.1)
    np.testing.assert_allclose(side[2, 0], 0.5)  # what the front does not see


def test_tilted_views_agree_on_what_they_all_see():
    turned = solid.View(picture(), (1, 0, 0), (0, 1, 1))
    ways = [*views(picture(), FRONT, SIDE), turned]
    matrices = solid.contributions(ways)
    s = np.array([0.3, -1.2, 0.7])
    np.testing.assert_allclose(sum(m @ v.projection @ s for m, v in zip(matrices, ways, strict=True)), s)


@pytest.mark.parametrize("planes", [(FRONT,), (FRONT, FRONT), (FRONT, ((0, 1, 0), (1, 0, 0)))])
def test_views_that_do_not_span_space_are_refused(planes):
    with pytest.raises(ValueError, match=r"do not span space: none sees the direction \((-?0, ){2}-?1\)"):
        solid.contributions(views(picture(), *planes))


@pytest.mark.parametrize("wrong, message", [
    ({"right": (0, 0, 0)}, "span no plane"), ({"up": (2, 0, 0)}, "span no plane"), ({"weight": 0}, "positive"),
    ({"exemplar": np.zeros((4, 4, 2), np.float32)}, "zero everywhere"),
    ({"exemplar": np.ones((4, 4, 3), np.float32)}, "not"),
])
def test_a_view_is_checked(wrong, message):
    with pytest.raises(ValueError, match=message):
        solid.View(**({"exemplar": picture()} | wrong))


def flow(shape, axis=0, towards=2):
    L, T = np.zeros((*shape, 3), np.float32), np.zeros((*shape, 3), np.float32)
    L[..., axis], T[..., towards] = 1, 1
    return L, T


def first(ways, shape, **settings):
    settings = solid.Settings(**({"levels": 1, "iterations": 2} | settings))
    synthesis = solid.Synthesis(ways, shape, settings, seed=1)
    state = synthesis.frame(*flow(shape), None)
    return synthesis, state, synthesis.visible(state)


@pytest.mark.parametrize("search", ["exact", "k-coherence"])
def test_a_field_the_views_agree_on_is_a_fixed_point(search):
    # stripes along x seen by all: (cos(2 pi y / 8), 0, 0)
    y = np.cos(2 * np.pi * np.arange(8) / 8).astype(np.float32)
    I = np.stack([np.broadcast_to(y[:, None], (8, 8)), np.zeros((8, 8), np.float32)], -1)
    still = np.full((8, 8, 2), 1e-6, np.float32)
    ways = [solid.View(I, *FRONT), solid.View(still, *SIDE, 1e-3), solid.View(still, *TOP, 1e-3)]
    settings = solid.Settings(levels=1, iterations=2, search=search)
    level = solid.Synthesis(ways, (9, 32, 11), settings, 1).levels[0]
    shape = (17, 40, 19)
    H = np.zeros((*shape, 3), np.float32)
    H[..., 0] = np.cos(2 * np.pi * np.arange(40) / 8)[:, None]
    frame = np.broadcast_to(np.eye(3, dtype=np.float32), (*shape, 3, 3))
    result, distance = level.optimize(H, frame, 2)
    inside = np.s_[:, 12:-12]  # neighbourhoods at the lowest and highest rows see no whole wave
    np.testing.assert_allclose(result[inside], H[inside], atol=2e-3)
    assert distance < 0.7  # the views that see nothing count as far


@pytest.mark.parametrize("search", ["exact", "k-coherence"])
def test_the_same_seed_gives_the_same_bits(search):
    I = exemplar.exemplar("sinusoid", 8)
    ways = views(I, FRONT, SIDE, TOP)
    once, again = (first(ways, (7, 9, 10), search=search)[2] for _ in range(2))
    np.testing.assert_array_equal(once, again)
    assert once.shape == (7, 9, 10, 3) and np.isfinite(once).all()
