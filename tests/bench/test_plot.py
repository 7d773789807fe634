from xml.etree import ElementTree

import numpy as np
import pytest

from bench import plot

SVG = "{http://www.w3.org/2000/svg}"


def drawn(**curves: plot.Curve) -> ElementTree.Element:
    return ElementTree.fromstring(plot.svg("time ~ voxels^0.92", "voxels", "seconds", curves, log_x=True))


def points(line: ElementTree.Element) -> np.ndarray:
    return np.array([place.split(",") for place in line.attrib["points"].split()], float)


def test_a_power_law_is_a_straight_line_inside_the_axes() -> None:
    x = np.array([64, 96, 128, 192, 256]) ** 3
    line = points(drawn(ours=plot.Curve(x, 1e-6 * x**0.92)).find(f"{SVG}polyline"))
    assert len(line) == 5
    slopes = np.diff(line[:, 1]) / np.diff(line[:, 0])
    assert np.allclose(slopes, slopes[0], atol=2e-3)  # coordinates are rounded to 0.1 pixel
    assert slopes[0] < 0, "larger values stand higher"
    assert (line.min(axis=0) >= [plot.LEFT, plot.TOP]).all()
    assert (line.max(axis=0) <= [plot.RIGHT, plot.BOTTOM]).all()


def test_every_curve_has_its_line_its_colour_and_its_name() -> None:
    x = np.arange(2.0, 24.0)
    image = drawn(basic=plot.Curve(x, 1 / x), smooth=plot.Curve(x, 0.1 / x))
    lines = image.findall(f"{SVG}polyline")
    assert len(lines) == 2
    assert len({line.attrib["stroke"] for line in lines}) == 2
    assert points(lines[0])[0, 1] < points(lines[1])[0, 1], "both curves share one scale"
    assert {"basic", "smooth"} <= {text.text for text in image.iter(f"{SVG}text")}


def test_labels_mark_the_points_of_the_first_curve() -> None:
    image = drawn(**{"": plot.Curve(np.array([8, 64]), np.array([1, 7]), ["2³", "4³"])})
    texts = [text.text for text in image.iter(f"{SVG}text")]
    assert {"2³", "4³"} <= set(texts)
    assert None not in texts
    assert len(image.findall(f"{SVG}circle")) == 2


def test_text_is_escaped() -> None:
    image = ElementTree.fromstring(plot.svg("a < b & c", "x", "y", {"<i>": plot.Curve(np.ones(2), np.ones(2))},
                                            log_x=False))
    assert {"a < b & c", "<i>"} <= {text.text for text in image.iter(f"{SVG}text")}


def test_nothing_above_zero_has_no_logarithm() -> None:
    with pytest.raises(ValueError, match="a logarithmic axis needs numbers above 0, not 0"):
        drawn(ours=plot.Curve(np.ones(2), np.array([0, 1])))


@pytest.mark.parametrize(("low", "high", "expected"), [
    (2, 23, [5, 10, 15, 20]), (0, 1, [0, 0.2, 0.4, 0.6, 0.8, 1])])
def test_linear_ticks_are_round_numbers(low: float, high: float, expected: list[float]) -> None:
    assert plot.linear_ticks(low, high) == expected


@pytest.mark.parametrize(("low", "high", "expected"), [
    (2.9, 133, [5, 10, 20, 50, 100]), (1e-6, 1, [1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1]), (6, 7, [6, 7])])
def test_logarithmic_ticks_are_round_numbers(low: float, high: float, expected: list[float]) -> None:
    assert plot.log_ticks(low, high) == expected
