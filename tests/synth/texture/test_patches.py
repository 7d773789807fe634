"""Patches: every kernel is its reference, and what is known in advance comes out."""

import numpy as np
import pytest

from synth import opencl
from synth.texture.patches import (
    BEFORE,
    BIAS,
    FINE,
    INVERSE,
    NEVER,
    RADIUS,
    STEEP,
    TILE,
    Painter,
    Places,
    Query,
    Table,
    bare_reference,
    directions_reference,
    draw_reference,
    enlarged,
    match_reference,
    owners_reference,
    pairs_within,
    rectify_reference,
    sees_reference,
    sites,
    strongest_reference,
)
from synth.texture.sample import Sample

SHAPE = (37, 53)
KINDS = pytest.mark.parametrize(("grey", "masked", "elongation"),
                                [(False, False, 1.0), (True, False, 1.5), (False, True, 1.5), (True, True, 1.0)])


def rng(seed):
    return np.random.Generator(np.random.Philox(key=seed))


def noise(height=41, width=47, grey=False, direction=1.1, opaque=None, seed=1):
    """A sample of noise; its luminance is no function of its colour, so that neither can stand for the other."""
    colour = rng(seed).random((height, width, 1 if grey else 3), np.float32)
    return Sample(np.ascontiguousarray(np.broadcast_to(colour, (height, width, 3))),
                  rng(seed + 1).random((height, width), np.float32), direction, 0.5, 1.0, opaque)


def painter(grey=False, elongation=1.0, **sample):
    return Painter(noise(grey=grey, **sample), SHAPE, 1.7, elongation, 9.0)


def table(count=24, seed=3, near=NEVER):
    """Patches of radii 4 to 9 on and round the picture, some still growing."""
    random = rng(seed)
    centre = random.uniform(-6, np.array(SHAPE[::-1]) + 6, (count, 2))
    values = np.zeros((count, 16), np.float32)
    cells = np.floor(centre)
    values[:, :2] = centre - cells
    angle, radius = random.uniform(-np.pi, np.pi, count), random.uniform(4, 9, count)
    values[:, 2:4] = np.stack([np.cos(angle), np.sin(angle)], -1)
    values[:, 4:6] = random.uniform(-0.5, 0.5, (count, 2)) / radius[:, None]
    values[:, 6:8] = random.integers(12, 30, (count, 2))
    values[:, INVERSE], values[:, STEEP], values[:, RADIUS] = 1 / radius**2, 0.4 * radius, radius
    weight = random.choice([0, 0.25, 1], count)
    values[:, BIAS] = values[:, STEEP] * 1.3 * (1 - weight)
    values[:, BEFORE] = np.where(weight == 0, NEVER, values[:, BIAS] * 1.1)
    values[:, 13] = near
    return Table(cells.astype(np.int32), values)


def wall():
    """Two rooms, the wall between them slanting and one pixel thick, and an island."""
    open_ = np.ones(SHAPE, bool)
    rows = np.arange(SHAPE[0])
    open_[rows, 20 + rows // 3] = False
    open_[10:14, 40:45] = False
    return open_


@KINDS
@pytest.mark.parametrize("blend", [0.0, 0.3, 1.0])
def test_draw_is_its_reference(grey, masked, elongation, blend):
    p, t, open_ = painter(grey, elongation), table(near=0 if masked else NEVER), wall() if masked else None
    drawn = p.draw(t, p.reaching(t), blend, open_)
    np.testing.assert_array_equal(drawn, draw_reference(p, t, blend, open_))
    assert drawn.std() > 0.05


@KINDS
def test_strongest_is_its_reference(grey, masked, elongation):
    p, t, open_ = painter(grey, elongation), table(near=0 if masked else NEVER), wall() if masked else None
    np.testing.assert_array_equal(p.strongest(t, p.reaching(t), open_), strongest_reference(p, t, open_))


@KINDS
@pytest.mark.parametrize("when", [BIAS, BEFORE])
def test_owners_is_its_reference(grey, masked, elongation, when):
    p, t, open_ = painter(grey, elongation), table(8, near=0 if masked else NEVER), wall() if masked else None
    owner = p.owners(t, p.reaching(t), open_, when)
    np.testing.assert_array_equal(owner, owners_reference(p, t, open_, when))
    assert (owner < 0).any()


@KINDS
def test_bare_is_its_reference(grey, masked, elongation):
    p, t, open_ = painter(grey, elongation), table(near=0 if masked else NEVER), wall() if masked else None
    living = rng(5).random(24) < 0.8
    radii = rng(6).uniform(4, 9, sites(p).shape[:2]).astype(np.float32)
    bare = p.bare(t, p.reaching(t), living, radii, 1.12, open_)
    np.testing.assert_array_equal(bare, bare_reference(p, t, living, radii, 1.12, open_))
    assert bare.any() and not bare.all()


def query(p, t, who=(3, 7, 11, 20)):
    who = np.array(who, np.int32)
    radius = t.values[who, RADIUS]
    first = np.array([0, 5, 0, 17], np.int32)
    return Query(who, np.array([-1, 7, 4, 20], np.int32), first, p.places.count(1.15 * radius)), 1.15 * radius


@KINDS
def test_rectify_is_its_reference(grey, masked, elongation):
    p, t, open_ = painter(grey, elongation), table(near=0 if masked else NEVER), wall() if masked else None
    q, radius = query(p, t)
    rank = np.arange(24, dtype=np.int32) // 8
    seen = p.rectify(t, p.around(t, q.who, radius), q, rank, 2, open_).get()
    expected = rectify_reference(p, t, q, rank, 2, open_)
    for k in range(4):
        np.testing.assert_array_equal(seen[k, q.first[k]:q.end[k]], expected[k, q.first[k]:q.end[k]])
    assert expected[..., 1].sum() > 50


@pytest.mark.parametrize("transparent", [False, True])
def test_match_is_its_reference(transparent):
    opaque = None
    if transparent:
        opaque = np.ones((41, 47), bool)
        opaque[3:9, 30:40] = False
    p, t = painter(opaque=opaque), table()
    q, radius = query(p, t)
    wanted = p.rectify(t, p.around(t, q.who, radius), q, np.zeros(24, np.int32), 1, None)
    dear = rng(9).random((41, 47), np.float32)
    found = p.match(wanted, q, radius / 1.15, dear)
    np.testing.assert_array_equal(found, match_reference(p, wanted.get(), q, radius / 1.15, dear))
    assert (p.room[found[:, 1], found[:, 0]] >= p.needs(radius / 1.15)).all()


def test_directions_is_its_reference():
    v = rng(2).normal(size=(*SHAPE, 2)).astype(np.float32)
    v[:8, :8] = 0
    points = rng(3).uniform(-9, np.array(SHAPE[::-1]) + 9, (101, 2)).astype(np.float32)
    found = painter().directions(opencl.to_device(v), points)
    expected = directions_reference(v, points.astype(np.float64))
    # differences of angles are taken modulo 2π: near ±π either sign is right
    same = np.abs(found - expected) < 1e-4
    assert same.mean() > 0.99 and same[:, :2].all()


def test_the_direction_of_a_vortex():
    """The angle turns by 1 / distance along the circle, and not across it."""
    y, x = np.mgrid[:SHAPE[0], :SHAPE[1]]
    v = np.stack([-(y - 18.0), x - 26.0], axis=-1).astype(np.float32)
    at = np.array([[40.0, 18.0], [26.0, 5.0], [16.25, 27.75]])
    cos, sin, along, across = painter().directions(opencl.to_device(v), at).T
    away = np.hypot(at[:, 0] - 26, at[:, 1] - 18)
    np.testing.assert_allclose(cos, -(at[:, 1] - 18) / away, atol=1e-6)
    np.testing.assert_allclose(sin, (at[:, 0] - 26) / away, atol=1e-6)
    np.testing.assert_allclose(along, 1 / away, rtol=0.02)  # differences over 4 pixels
    np.testing.assert_allclose(across, 0, atol=1e-5)


def test_a_patch_alone_shows_the_sample():
    """Upright and without a bend it is the sample itself, pixel for pixel."""
    p = painter(direction=0.0)
    values = np.zeros((1, 16), np.float32)
    values[0, [2, 6, 7, INVERSE, STEEP, RADIUS]] = [1, 20, 19, 1 / 81, 3.6, 9]
    t = Table(np.array([[26, 17]], np.int32), values)
    drawn = p.draw(t, p.reaching(t), 0.0, None)
    assert (drawn[17, 26 + 16:] == 0).all()  # beyond its reach
    part = drawn[17 - 8:17 + 9, 26 - 8:26 + 9]
    np.testing.assert_allclose(part, p.sample.colour[19 - 8:19 + 9, 20 - 8:20 + 9], atol=3e-7)


@pytest.mark.parametrize("blend", [0.0, 1.0])
def test_weights_are_one_together(blend):
    """A sample of one colour is drawn in that colour; of two patches at a pixel the weights are 1 to rounding."""
    p, t = painter(), table(40)
    plain = Sample(np.full((41, 47, 3), 0.3, np.float32), p.sample.luminance, 1.1, 0.5)
    one = Painter(plain, SHAPE, 1.7, 1.0, 9.0)
    lists = one.reaching(t)
    covered = one.owners(t, lists, None) >= 0
    np.testing.assert_array_equal(one.draw(t, lists, blend, None)[covered], np.float32(0.3))
    two = p.strongest(t, p.reaching(t), None)[..., [2, 5]].sum(axis=-1)
    assert two.max() <= 1 + 1e-6
    assert (np.abs(two - 1) < 1e-6).mean() > 0.5


def test_a_planted_patch_is_found():
    """A newborn within a patch finds the place of the sample that goes on there."""
    p = painter(direction=0.0)
    values = np.zeros((2, 16), np.float32)
    values[:, [2, 6, 7, INVERSE, STEEP, RADIUS]] = [1, 20, 19, 1 / 81, 3.6, 9]
    values[1, RADIUS] = 6
    t = Table(np.array([[26, 17], [29, 15]], np.int32), values)
    who = np.array([1], np.int32)
    q = Query(who, np.array([-1], np.int32), np.zeros(1, np.int32), p.places.count(np.array([6.9])))
    wanted = p.rectify(t, p.around(t, who, np.array([6.9])), q, np.array([0, 1], np.int32), 1, None)
    assert wanted.get()[0, :q.end[0], 1].all()
    np.testing.assert_array_equal(p.match(wanted, q, np.array([6.0]), np.zeros((41, 47), np.float32)), [[23, 17]])


def test_places_go_from_inside_out():
    places = Places.within(9.0, 0.7, 1.5)
    assert (places.offsets[0] == 0).all() and (np.diff(places.radii) > -1e-6).all()
    assert len(np.unique(places.offsets, axis=0)) == len(places.offsets)
    np.testing.assert_allclose(np.hypot(*places.along.T), np.hypot(*places.offsets.T), rtol=1e-6)
    assert places.count(np.array([0.5]))[0] == 1


def test_a_wall_hides():
    open_ = wall()
    left, right = np.array([[10.0, 18.0]]), np.array([[45.2, 18.4]])
    assert not sees_reference(open_, left, right)[0]
    assert not sees_reference(open_, right, left)[0]
    assert sees_reference(open_, left, left + np.array([5, 9]))[0]
    # through a corner of a wall in stairs nothing is seen
    stairs = np.ones((9, 9), bool)
    stairs[np.arange(9), np.arange(9)] = False
    assert not sees_reference(stairs, np.array([[5.0, 2.0]]), np.array([[2.0, 5.0]]))[0]


def test_an_enlarged_picture_holds_the_picture():
    picture = rng(4).random((7, 5, 3), np.float32)
    fine = enlarged(picture)
    assert fine.shape == (FINE * 6 + 1, FINE * 4 + 1, 3)
    np.testing.assert_array_equal(fine[::FINE, ::FINE], picture)
    assert fine.min() == picture.min() and fine.max() == picture.max()


def test_an_enlarged_wave_keeps_its_height_between_pixels():
    """A wave of four pixels that is its own mirror image at the edges: through Catmull-Rom the error is 0.09."""
    y, x = np.mgrid[:9, :13].astype(np.float64)
    wave = np.cos(np.pi / 2 * x) * np.cos(np.pi / 4 * y)
    fine = enlarged(wave[..., None])[..., 0]
    y, x = np.mgrid[:FINE * 8 + 1, :FINE * 12 + 1] / FINE
    np.testing.assert_allclose(fine, np.cos(np.pi / 2 * x) * np.cos(np.pi / 4 * y), atol=0.02)


def test_each_tile_lists_the_patches_that_reach_it():
    p, t = painter(), table()
    starts, members = p.reaching(t)
    rows, columns = p.tiles
    owner = p.owners(t, p.reaching(t), None)
    for k in range(rows * columns):
        here = members[starts[k]:starts[k + 1]]
        assert (np.diff(here) > 0).all()
        row, column = k // columns - 1, k % columns - 1
        if row >= 0 and column >= 0:
            found = np.unique(owner[row * TILE:(row + 1) * TILE, column * TILE:(column + 1) * TILE])
            assert set(found) - {-1} <= set(here)


@pytest.mark.parametrize(("queries", "points"), [(40, 70), (1, 1), (0, 5), (5, 0)])
def test_pairs_within_are_those_of_all_pairs(queries, points):
    random = np.random.default_rng(queries)
    a, b = (random.uniform(0, 100, (n, 2)) for n in (queries, points))
    own, extent = random.uniform(0, 20, queries), random.uniform(0, 20, points)
    offset = a[:, None] - b[None]
    expected = np.nonzero((offset * offset).sum(axis=2) <= (own[:, None] + extent) ** 2)
    found = pairs_within(a, b, own, extent)
    assert np.array_equal(found[0], expected[0]) and np.array_equal(found[1], expected[1])
