"""Plots: curves are where their values say, in their colours."""

import numpy as np
import pytest

from render.plot import BLUE, PALE, RED, Curve, plot


def rows_of(page, colour, column):
    return np.flatnonzero(np.abs(page[:, column] - colour).max(axis=1) < 0.05)


def test_a_curve_is_as_high_as_its_values():
    x = np.arange(11.0)
    heights = [rows_of(plot([Curve(x, np.full(11, y), BLUE)], "x", "y", 300, 4.0), BLUE, 200).mean() for y in (1, 2, 3)]
    assert heights[0] - heights[1] == pytest.approx(heights[1] - heights[2], abs=1)
    assert heights[0] - heights[1] > 20


def test_the_last_curve_lies_above_the_others():
    x = np.arange(11.0)
    under, over = Curve(x, np.full(11, 2.0), PALE), Curve(x, np.full(11, 2.0), RED)
    page = plot([under, over], "x", "y", 300, 4.0)
    assert len(rows_of(page, RED, 200)) > 0


def test_what_is_higher_than_the_axis_is_cut_and_a_page_is_three_to_two():
    x = np.arange(11.0)
    page = plot([Curve(x, np.full(11, 9.0), BLUE)], "x", "y", 301, 4.0)
    assert page.shape == (201, 301, 3) and page.min() >= 0 and page.max() <= 1
    assert len(rows_of(page, BLUE, 200)) == 0


def test_names_are_written_in_the_colour_of_their_curve():
    x = np.arange(11.0)
    named, plain = (plot([Curve(x, np.zeros(11), RED, name)], "x", "y", 300, 4.0) for name in ("ours", ""))
    written = np.abs(named - plain).max(axis=2) > 0.1
    assert written.any()
    assert (named[written][:, 0] - named[written][:, 2]).mean() > 0.2


def test_equal_factors_are_equal_steps_of_a_logarithmic_axis():
    x = np.arange(11.0)
    heights = [rows_of(plot([Curve(x, np.full(11, y), BLUE)], "x", "y", 300, 10.0, 0.001), BLUE, 200).mean()
               for y in (0.01, 0.1, 1)]
    assert heights[0] - heights[1] == pytest.approx(heights[1] - heights[2], abs=1)
    assert heights[0] - heights[1] > 20
    assert len(rows_of(plot([Curve(x, np.zeros(11), BLUE)], "x", "y", 300, 10.0, 0.001), BLUE, 200)) == 0


@pytest.mark.parametrize(("x", "top"), [(np.zeros(3), 1.0), (np.arange(3.0), 0.0)])
def test_axes_without_a_length_are_refused(x, top):
    with pytest.raises(ValueError, match="axes go from less to more"):
        plot([Curve(x, np.zeros(3), BLUE)], "x", "y", 300, top)
