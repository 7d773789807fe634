"""The report of a diff: what stands in the page, what the picture shows."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline import diff_report
from pipeline.diff import Finding, compared_light, compared_values
from pipeline.files import pictures
from synth.motion.exemplar import exemplar


def findings():
    heart = exemplar("heart", 32)
    density = np.linspace(0, 1, 24 * 32, dtype=np.float32).reshape(24, 32)
    light = np.repeat(density[..., None], 3, axis=2)
    volume = np.repeat(density[None], 8, axis=0)
    return [
        compared_values("fields/H.0001.exr", heart, heart),
        compared_values("geometry/density.0001.exr", density * np.float32(1.01), density),
        compared_values("geometry/density.0001.vdb", volume, volume),
        compared_values("geometry/vel.0001.vdb", np.stack([volume] * 3, -1), np.stack([volume] * 3, -1)),
        compared_light("images/proof.exr", light * np.float32(1.01), light),
        compared_values("geometry/other.exr", density[:-1], density),
        Finding("geometry/<old>.exr", "is no longer made; the reference has it"),
    ]


def test_page_and_picture(tmp_path):
    page = diff_report.write("ma09-fig01", findings(), tmp_path / "diff")
    text = page.read_text()
    assert page == tmp_path / "diff" / "index.html"
    assert "4 of 7 comparisons differ" in text and 'src="diff.png"' in text
    assert text.index("geometry/density.0001.exr") < text.index("fields/H.0001.exr")  # faults first
    assert "geometry/&lt;old&gt;.exr" in text and "<old>" not in text
    assert "largest difference 0.01 of the largest value" in text
    picture = pictures.read(page.with_name("diff.png"))
    assert picture.shape[1] > 4 * diff_report.WIDTH  # four panels side by side


def test_same_says_so_and_the_same_again_is_the_same_page(tmp_path):
    same = [f for f in findings() if not f.fault]
    pages = [diff_report.write("x", same, tmp_path / name) for name in "ab"]
    assert "all 3 comparisons are the same" in pages[0].read_text()
    for name in ("index.html", "diff.png"):
        assert pages[0].with_name(name).read_bytes() == pages[1].with_name(name).read_bytes()


def test_colours_are_shown_as_light_in_their_own_shape(tmp_path):
    colours = np.linspace(0, 1, 64 * 48 * 3, dtype=np.float32).reshape(64, 48, 3)
    finding = replace(compared_values("fields/frames.0004.exr", colours, colours), is_light=True)
    shown = pictures.read(diff_report.write("x", [finding], tmp_path).with_name("diff.png"))
    assert shown.shape[0] < 2 * diff_report.WIDTH  # the row of panels is no taller than they are


def test_without_pictures_there_is_no_picture(tmp_path):
    page = diff_report.write("x", [Finding("F", "is new; the reference does not have it")], tmp_path)
    assert "<img" not in page.read_text() and not page.with_name("diff.png").exists()


@pytest.mark.parametrize(("largest", "factor"), [(0.01, 100), (0.3, 1), (2e-6, 1e5), (0, 1)])
def test_difference_is_brightened_by_powers_of_ten(largest, factor):
    difference = np.zeros((4, 5))
    difference[0, 0] = largest
    shown, given = diff_report._brightened(difference, is_light=False)
    assert given == pytest.approx(factor) and shown[-1, 0] == pytest.approx([largest * factor] * 3)
