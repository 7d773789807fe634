"""Arrows: their position, direction and coverage."""

import numpy as np

from render import arrows

GREY = np.full((40, 60, 3), 0.5, np.float32)


def ink(picture: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """x, y (up, pixels) of the red pixels."""
    rows, columns = np.nonzero((picture[..., 0] > 0.7) & (picture[..., 1] < 0.3))
    return columns, picture.shape[0] - 1 - rows


def one(vector: tuple[float, float]) -> np.ndarray:
    """A grey picture with one red arrow of 20 pixels from (30, 20)."""
    return arrows.drawn(GREY, np.array([[30.0, 20.0]]), np.array([vector]), 20.0, arrows.RED)


def test_an_arrow_starts_at_its_tail_and_follows_its_vector() -> None:
    for vector, spread in (((1, 0), "x"), ((0, 1), "y"), ((-1, 0), "-x"), ((0, -1), "-y")):
        x, y = ink(one(vector))
        reach = {"x": x - 30, "-x": 30 - x, "y": y - 20, "-y": 20 - y}[spread]
        across = y - 20 if "x" in spread else x - 30
        assert 17 <= reach.max() <= 20
        assert reach.min() >= -1
        assert abs(across.mean() + 0.5) < 0.6
        # the head is the wide end
        assert np.ptp(across[reach > 13]) > np.ptp(across[reach < 8]) + 1


def test_coverage_depends_on_length_not_direction() -> None:
    wide = np.full((200, 200, 3), 0.5, np.float32)
    straight, aslant = (arrows.drawn(wide, np.array([[50.0, 50.0]]), np.array([v]), 100.0, arrows.RED)
                        for v in ((5.0, 0.0), (3.0, 4.0)))
    changed = [np.abs(picture - wide).sum() for picture in (straight, aslant)]
    assert abs(changed[0] - changed[1]) < 0.02 * changed[0]


def test_the_picture_given_stays_as_it_is_and_no_motion_draws_nothing() -> None:
    before = GREY.copy()
    one((1, 0))
    np.testing.assert_array_equal(GREY, before)
    np.testing.assert_array_equal(one((0, 0)), GREY)
    tails, vectors = np.array([[30.0, 20.0], [10.0, 10.0]]), np.array([[1.0, 0.0], [0.05, 0.0]])
    two = arrows.drawn(GREY, tails, vectors, 20.0, arrows.RED)
    np.testing.assert_array_equal(two, one((1, 0)))


def test_an_arrow_over_the_border_is_cut() -> None:
    drawn = arrows.drawn(GREY, np.array([[55.0, 2.0]]), np.array([[1.0, -1.0]]), 30.0, arrows.RED)
    assert drawn.shape == GREY.shape
    assert np.isfinite(drawn).all()


def test_the_grid_lies_inside_and_even() -> None:
    rows, columns, places = arrows.grid((32, 64), (100, 200), 8)
    assert len(rows) == len(columns) == len(places) == 8 * 4
    assert rows.max() < 32
    assert columns.max() < 64
    np.testing.assert_allclose(places[0], [(columns[0] + 0.5) * 200 / 64, (rows[0] + 0.5) * 100 / 32])


def test_an_arrow_along_a_stroke_follows_its_bends_and_ends_where_it_does() -> None:
    stroke = np.array([[10.0, 10.0], [40.0, 10.0], [40.0, 34.0]])
    x, y = ink(arrows.along(GREY, [stroke], 3.0, arrows.RED))
    assert x.min() == 9 or x.min() == 8  # the round end of the shaft
    assert 31 <= y.max() <= 33  # the tip is narrower than a pixel
    assert ((y < 20) & (x < 36)).sum() > 45  # along the first part
    head, shaft = x[(y > 22) & (y < 27)], x[(y > 14) & (y < 19)]
    assert np.ptp(head) > np.ptp(shaft) + 2


def test_a_stroke_shorter_than_a_head_is_a_head_that_ends_with_it() -> None:
    x, y = ink(arrows.along(GREY, [np.array([[30.0, 20.0], [32.0, 20.0]])], 3.0, arrows.RED))
    assert x.max() <= 32 and x.min() < 30
    assert abs(y.mean() - 19.5) < 0.6
