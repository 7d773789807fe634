"""render.smoke_slab: the kernels against their NumPy reference, and results known in advance."""

import numpy as np
import pytest

from render import smoke_slab

LAMPS = (
    smoke_slab.Lamp(smoke_slab.directions(125.0, 12.0, 3), slope=2.2, density=1.6),
    smoke_slab.Lamp(smoke_slab.directions(30.0, 12.0, 2), slope=1.2, density=0.8, behind=True),
)


def test_depth_of_a_uniform_slab_grows_linearly_with_the_distance_through_it() -> None:
    """depth = sigma * rows above (half a cell less), straight and aslant, from either side."""
    sigma = np.full((20, 60), 0.1, np.float32)
    up = smoke_slab.depth_towards(sigma, (0.0, 1.0))
    assert up[:, 30] == pytest.approx(0.1 * np.arange(19, -1, -1), abs=1e-5)
    down = smoke_slab.depth_towards(sigma, (0.0, -1.0))
    assert np.allclose(down, up[::-1])
    aslant = smoke_slab.depth_towards(sigma, (0.6, 0.8))
    assert aslant[0, 20] == pytest.approx(1.9 / 0.8, rel=1e-4)
    assert np.allclose(smoke_slab.depth_towards(sigma.T, (1.0, 0.0)), up.T)


def test_shadow_falls_away_from_the_light() -> None:
    """A small cloud lit from the upper right darkens what lies to its lower left, and nothing else."""
    sigma = np.zeros((41, 41), np.float32)
    sigma[18:23, 18:23] = 0.3
    depth = smoke_slab.depth_towards(sigma, (np.sqrt(0.5), np.sqrt(0.5)))
    assert depth[10, 10] > 1.0
    assert depth[30, 30] == depth[30, 10] == depth[10, 30] == 0.0


@pytest.mark.parametrize("shape", [(2, 2), (5, 7), (33, 18), (9, 70)])
def test_kernels_equal_their_reference(shape: tuple[int, int]) -> None:
    rng = np.random.Generator(np.random.Philox(key=8))
    depth, relief = 6.0 * rng.random(shape, dtype=np.float32), 1.2 * rng.random(shape, dtype=np.float32)
    got = smoke_slab.light(depth, relief, 1.7, LAMPS, 2)
    expected = smoke_slab.light_reference(depth, relief, 1.7, LAMPS, 2)
    assert got.passed == pytest.approx(expected.passed, abs=2e-6)
    assert got.sky == pytest.approx(expected.sky, abs=2e-6)
    for one, other in zip(got.lamps, expected.lamps, strict=True):
        assert one == pytest.approx(other, abs=2e-6)


def test_kernels_repeat_bit_for_bit() -> None:
    rng = np.random.Generator(np.random.Philox(key=9))
    depth, relief = 6.0 * rng.random((40, 50), dtype=np.float32), rng.random((40, 50), dtype=np.float32)
    first, second = (smoke_slab.light(depth, relief, 1.7, LAMPS, 2) for _ in range(2))
    assert np.array_equal(first.passed, second.passed) and np.array_equal(first.sky, second.sky)
    assert all(np.array_equal(a, b) for a, b in zip(first.lamps, second.lamps, strict=True))


def test_without_smoke_all_light_passes() -> None:
    seen = smoke_slab.light(np.zeros((6, 5), np.float32), np.ones((6, 5), np.float32), 2.0, LAMPS, 1)
    assert (seen.passed == 1.0).all()
    assert not seen.sky.any() and not any(lamp.any() for lamp in seen.lamps)


def test_a_full_slab_obeys_beer_lambert_and_a_thin_one_holds_less_smoke() -> None:
    """relief 1.1 fills all layers: exp(-depth); relief 0.5 fills half of them: exp(-depth / 2)."""
    depth = np.full((4, 4), 3.0, np.float32)
    full, half = (smoke_slab.light(depth, np.full_like(depth, r), 1.0, (), 1).passed for r in (1.1, 0.5))
    assert full == pytest.approx(np.exp(-3.0), rel=1e-5)
    assert half == pytest.approx(np.exp(-1.5), rel=1e-5)


def test_thin_smoke_shows_a_lamp_in_proportion_to_what_it_hides() -> None:
    """In the limit of thin smoke nothing is shadowed: light = 1 - passed, on whichever side the lamp is."""
    depth = np.full((8, 8), 1e-3, np.float32)
    seen = smoke_slab.light(depth, np.full_like(depth, 1.1), 1.0, LAMPS, 1)
    for lamp in seen.lamps:
        assert lamp == pytest.approx(1.0 - seen.passed, rel=5e-3)


def test_a_lamp_in_front_shows_more_of_thick_smoke_than_one_behind() -> None:
    depth = np.full((30, 30), 8.0, np.float32)
    one = smoke_slab.Lamp(((0.0, 1.0),), slope=0.5, density=1.0)
    front, back = (smoke_slab.light(depth, np.full_like(depth, 1.1), 1.0, (lamp,), 1).lamps[0][15, 15]
                   for lamp in (one, smoke_slab.Lamp(one.towards, 0.5, 1.0, behind=True)))
    assert front > 4.0 * back


def test_a_ridge_is_bright_towards_the_lamp_and_dark_behind() -> None:
    """A ridge along y, lit from the left: its left flank is brighter than its right one."""
    x = np.arange(60)
    profile = (0.3 + 0.7 * np.exp(-(((x - 30) / 8.0) ** 2))).astype(np.float32)
    relief = np.broadcast_to(profile, (20, 60)).copy()
    lamp = smoke_slab.Lamp(((-1.0, 0.0),), slope=2.0, density=1.0)
    seen = smoke_slab.light(np.full_like(relief, 8.0), relief, 1.5, (lamp,), 1).lamps[0][10]
    assert seen[20:28].mean() > 1.3 * seen[32:40].mean()


def test_moved_reads_at_the_offset_and_outside_beyond_the_border() -> None:
    values = np.arange(12.0, dtype=np.float32).reshape(3, 4)
    assert np.array_equal(smoke_slab.moved(values, 0.0, 0.0, 9.0), values)
    assert np.array_equal(smoke_slab.moved(values, 1.0, -1.0, 9.0)[1:, :3], values[:2, 1:])
    assert (smoke_slab.moved(values, 1.0, -1.0, 9.0)[0] == 9.0).all()
    assert smoke_slab.moved(values, 0.25, 0.5, 9.0)[0, 0] == pytest.approx(0.25 + 2.0)
