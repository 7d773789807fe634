"""Cells: they tile the picture, obey their constraint, and are as large as it allows."""

import numpy as np
import pytest

from synth.texture.cells import by_direction, by_velocity, index

SHAPES = [(64, 96), (37, 53), (5, 3), (1, 70)]


def circles(shape, centre=(20.3, 17.6)):
    """Each pixel's velocity, proportional to its distance from a centre (x, y): (Y, X, 2)."""
    y, x = np.mgrid[: shape[0], : shape[1]]
    return 0.05 * np.stack([centre[1] - y, x - centre[0]], -1).astype(np.float32)


def angles(v):
    return np.arctan2(v[..., 1], v[..., 0])


def largest_difference(a):
    """On the circle, of all pairs: what the direction constraint bounds."""
    difference = np.abs(a.reshape(-1)[:, None] - a.reshape(-1))
    return np.minimum(difference, 2 * np.pi - difference).max()


def squares(cells, *fields):
    """The pixels of each cell in each of the fields, with its size."""
    for x, y, size in zip(*cells, strict=True):
        yield int(size), *(field[y : y + size, x : x + size] for field in fields)


@pytest.mark.parametrize("shape", SHAPES)
def test_cells_tile_the_picture(shape):
    v = circles(shape)
    for cells in (by_direction(angles(v), 48), by_velocity(v, 0.5)):
        times = np.zeros(shape, int)
        for x, y, size in zip(*cells, strict=True):
            times[y : y + size, x : x + size] += 1
        assert (times == 1).all()
        of = index(cells, shape)
        assert of.shape == shape and of.dtype == np.int32
        for number, (_, pixels) in enumerate(squares(cells, of)):
            assert (pixels == number).all()


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("n", [4, 24, 48])
def test_directions_of_a_cell_differ_by_less_than_a_turn_over_n(shape, n):
    field = angles(circles(shape))
    for size, a in squares(by_direction(field, n), field):
        assert size == 4 or largest_difference(a) < 2 * np.pi / n


@pytest.mark.parametrize("spread", ["vectors", "speeds"])
@pytest.mark.parametrize("factor", [0.25, 2])
def test_velocities_of_a_cell_differ_by_no_more_than_its_least_speed_allows(factor, spread):
    v = circles((61, 80))
    for size, cell in squares(by_velocity(v, factor, spread), v):
        speed = np.linalg.norm(cell, axis=-1)
        pairs = cell.reshape(-1, 1, 2) - cell.reshape(-1, 2)
        differ = np.linalg.norm(pairs, axis=-1).max() if spread == "vectors" else np.ptp(speed)
        assert size == 4 or differ <= factor * speed.min() + 1e-6


def test_no_four_cells_could_be_one():
    """Each square of four cells of one size breaks the constraint."""
    field = angles(circles((64, 64)))
    cells = by_direction(field, 48)
    of = {(int(x), int(y), int(size)) for x, y, size in zip(*cells, strict=True)}
    tried = 0
    for x, y, size in of:
        whole = 2 * size
        if x % whole or y % whole or size == 32:
            continue
        if {(x + size, y, size), (x, y + size, size), (x + size, y + size, size)} <= of:
            assert largest_difference(field[y : y + whole, x : x + whole]) >= 2 * np.pi / 48
            tried += 1
    assert tried > 5


def test_one_direction_and_one_velocity_need_only_the_largest_cells():
    v = np.broadcast_to(np.float32([1.0, -2.0]), (64, 96, 2))
    for cells in (by_direction(angles(v), 48), by_velocity(v), by_velocity(0 * v)):
        assert (cells.size == 32).all() and len(cells.x) == 6
        np.testing.assert_array_equal(cells.x, [0, 32, 64] * 2)  # from left to right
        np.testing.assert_array_equal(cells.y, [0] * 3 + [32] * 3)  # and bottom to top


def test_the_circle_closes():
    """Directions a little below and a little above π are close to each other."""
    field = np.where(np.arange(32) % 2, np.pi - 0.01, -np.pi + 0.01) * np.ones((32, 1))
    assert by_direction(field, 48).size.tolist() == [32]


@pytest.mark.parametrize("shape", [(8, 8), (7, 5)])
def test_four_pixels_are_small_enough(shape):
    noise = np.random.default_rng(0).uniform(-np.pi, np.pi, shape)
    assert (by_direction(noise, 48).size == 4).all()


def test_what_cannot_be_is_refused():
    with pytest.raises(ValueError, match="four directions"):
        by_direction(np.zeros((8, 8)), 3)
    with pytest.raises(ValueError, match="cells from 24 to 4"):
        by_direction(np.zeros((8, 8)), 48, largest=24)
