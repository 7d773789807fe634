"""Obstacles: distances known by hand, whatever the solid was made from, and what is no obstacle."""

import numpy as np
import pytest

from synth import obstacle
from synth.field import Field, domain_origin


def centres(shape):
    """World coordinates of the cells, one array for each component."""
    axes = [o + np.arange(n) / shape[-2] for o, n in zip(domain_origin(shape), shape[::-1], strict=True)]
    return np.meshgrid(*axes[::-1], indexing="ij")[::-1]


def turn_between(one, other):
    """The largest angle between two fields of unit vectors, degrees."""
    return float(np.degrees(np.arccos(np.clip(np.sum(one * other, -1), -1, 1)).max()))


@pytest.mark.parametrize(("shape", "centre"), [((30, 40), (0.1, 0.4)), ((12, 20, 16), (0.05, 0.4, -0.02))])
def test_a_ball_is_as_far_away_as_its_centre_less_its_radius(shape, centre):
    away = [c - m for c, m in zip(centres(shape), centre, strict=True)]
    far = np.sqrt(sum(a * a for a in away))
    made = obstacle.ball(shape, centre, 0.2)
    np.testing.assert_allclose(made.distance, (far - 0.2) * shape[-2], atol=1e-5)
    near = np.abs(made.distance) < 1
    outward = np.stack(away, -1)[near] / far[near][:, None]
    assert turn_between(made.normal[near], outward) < 3
    assert (made.solid == (far < 0.2)).all()


def test_a_box_on_its_sides_at_its_corners_and_turned():
    shape = (40, 40)  # cells of 1 / 40, centres at odd 80ths
    flat = obstacle.box(shape, (0.0, 0.5), (0.25, 0.125)).distance
    assert flat[20, 31] == pytest.approx((23 / 80 - 0.25) * 40)  # beside
    assert flat[30, 31] == pytest.approx(np.hypot(23 / 80 - 0.25, 21 / 80 - 0.125) * 40, abs=1e-5)  # off a corner
    assert flat[20, 20] == pytest.approx(-(0.125 - 1 / 80) * 40)  # inside, to the nearest side
    upright = obstacle.box(shape, (0.0, 0.5), (0.25, 0.125), 90.0).distance
    np.testing.assert_allclose(upright, flat.T, atol=1e-4)
    np.testing.assert_array_equal(
        obstacle.box((40, 40), (0.0, 0.5), (0.25, 0.125), 180.0).distance.round(4), flat.round(4))


def test_a_box_in_space():
    made = obstacle.box((8, 10, 12), (0.0, 0.5, 0.0), (0.3, 0.2, 0.1))
    x, y, z = centres((8, 10, 12))
    assert (made.solid == ((abs(x) < 0.3) & (abs(y - 0.5) < 0.2) & (abs(z) < 0.1))).all()


def disc_picture(rows, columns, radius):
    """A white disc in the middle of a black picture; radius as a share of the height."""
    y, x = np.mgrid[:rows, :columns]
    far = np.hypot(x - (columns - 1) / 2, y - (rows - 1) / 2) / rows
    return np.clip((radius - far) * rows + 0.5, 0, 1).astype(np.float32)


@pytest.mark.parametrize("pixels", [(48, 64), (150, 200), (301, 401)])
def test_a_picture_of_a_disc_is_the_disc(pixels):
    made = obstacle.picture((60, 80), disc_picture(*pixels, 0.25), (0.0, 0.5), 1.0)
    disc = obstacle.ball((60, 80), (0.0, 0.5), 0.25)
    near = np.abs(disc.distance) < 4
    assert np.abs(made.distance - disc.distance)[near].max() < 0.35
    assert turn_between(made.normal[near], disc.normal[near]) < 12


def test_a_picture_stands_where_it_is_put():
    made = obstacle.picture((60, 80), disc_picture(80, 80, 0.5), (-0.25, 0.3), 0.4)
    disc = obstacle.ball((60, 80), (-0.25, 0.3), 0.2)
    assert np.abs(made.distance - disc.distance)[np.abs(disc.distance) < 4].max() < 0.35


def test_in_space_a_picture_is_a_prism():
    made = obstacle.picture((5, 30, 40), disc_picture(30, 40, 0.25), (0.0, 0.5), 1.0)
    plane = obstacle.picture((30, 40), disc_picture(30, 40, 0.25), (0.0, 0.5), 1.0)
    assert all(np.array_equal(layer, plane.distance) for layer in made.distance)
    assert not made.normal[..., 2].any()


def test_an_outline_holds_what_it_encloses_and_its_ink():
    filled = disc_picture(80, 80, 0.3)
    outline = 1 - filled + disc_picture(80, 80, 0.26)  # black ink on white paper
    np.testing.assert_array_equal(obstacle.drawn(outline), (filled > 0.25).astype(np.float32))
    np.testing.assert_array_equal(obstacle.drawn(filled), (filled > 0.25).astype(np.float32))  # white ink on black
    with pytest.raises(ValueError, match="blank"):
        obstacle.drawn(np.full((20, 20), 0.7))


def test_polygons_are_filled():
    triangle = np.array([[0.1, 0.1], [0.9, 0.1], [0.1, 0.9]])
    small = np.array([[0.8, 0.8], [0.9, 0.8], [0.9, 0.9], [0.8, 0.9]])
    mask = obstacle.outlines([triangle, small], (100, 90))
    y, x = (np.mgrid[:100, :90] + 0.5) / 100
    expected = ((x > 0.1) & (y > 0.1) & (x + y < 1)) | ((x > 0.8) & (y > 0.8) & (x < 0.9) & (y < 0.9))
    on_the_edge = np.abs(x + y - 1) < 1e-9
    assert not ((mask != expected) & ~on_the_edge).any()


@pytest.mark.parametrize(("voxel", "origin"), [(0.02, (-0.7, -0.1, -0.31)), (0.04, (-3.0, -0.13, -1.0))])
def test_a_level_set_of_any_origin_and_voxel_size(voxel, origin):
    counts = [int(np.ceil((2 * -o if o < -0.3 else 1.2) / voxel)) + 1 for o in origin]
    axes = [o + voxel * np.arange(n) for o, n in zip(origin, counts, strict=True)]
    z, y, x = np.meshgrid(*axes[::-1], indexing="ij")
    phi = np.sqrt(x * x + (y - 0.5) ** 2 + z * z) - 0.2
    field = Field(np.clip(phi, -3 * voxel, 3 * voxel).astype(np.float32), voxel, origin)
    made = obstacle.level_set((16, 32, 24), field)
    ball = obstacle.ball((16, 32, 24), (0.0, 0.5, 0.0), 0.2)
    near = np.abs(ball.distance) < 3
    assert np.abs(made.distance - ball.distance)[near].max() < 0.45
    section = obstacle.level_set((32, 24), field)
    disc = obstacle.ball((32, 24), (0.0, 0.5), 0.2)
    assert np.abs(section.distance - disc.distance)[np.abs(disc.distance) < 3].max() < 0.3


def test_the_nearest_of_several_counts():
    one, other = obstacle.ball((30, 40), (-0.3, 0.5), 0.1), obstacle.box((30, 40), (0.3, 0.5), (0.1, 0.1))
    both = obstacle.union([one, other])
    np.testing.assert_array_equal(both.distance, np.minimum(one.distance, other.distance))
    np.testing.assert_array_equal(both.solid, one.solid | other.solid)


def test_what_is_no_obstacle():
    shape = (30, 40)
    inside, outside = obstacle.ball(shape, (0.0, 0.5), 0.1), obstacle.ball(shape, (2.0, 0.5), 0.1)
    with pytest.raises(ValueError, match="obstacle 2 lies outside"):
        obstacle.union([inside, outside])
    with pytest.raises(ValueError, match="fill the domain"):
        obstacle.union([inside, obstacle.ball(shape, (0.0, 0.5), 2.0)])
    with pytest.raises(ValueError, match="fill the domain"):
        obstacle.union([obstacle.picture(shape, np.ones((3, 4)), (0.0, 0.5), 1.5)])
    with pytest.raises(ValueError, match="coordinates"):
        obstacle.ball(shape, (0.0, 0.5, 0.0), 0.1)
    with pytest.raises(ValueError, match="half edges"):
        obstacle.box(shape, (0.0, 0.5), (0.1,))
