"""render.layout: positions of panels, labels, insets and legends."""

import numpy as np
import pytest

from render import layout, lic, tonemap
from render.layout import Panel


def grey(value: int, height: int = 40, width: int = 60) -> np.ndarray:
    return np.full((height, width, 3), value, np.uint8)


def test_panels_keep_their_pixels() -> None:
    """Bytes come back as they are; float values within the dither."""
    noise = np.random.Generator(np.random.Philox(key=1)).integers(0, 256, (40, 60, 3), dtype=np.uint8)
    page = layout.figure([[Panel(noise, border=False)]], margin=10)
    assert page.shape == (60, 80, 3)
    assert np.array_equal(page[10:50, 10:70], noise)
    page = layout.figure([[Panel(noise / np.float32(255.0), border=False)]], margin=10)
    assert np.abs(page[10:50, 10:70].astype(int) - noise).max() <= 1


def test_margin_and_gap_are_white() -> None:
    page = layout.figure([[Panel(grey(0)), Panel(grey(0))]], margin=10, gap=7)
    assert (page[:10] == 255).all()
    assert (page[:, 70:77] == 255).all()
    assert page.shape == (60, 147, 3)


def test_panels_of_a_row_and_of_a_column_are_aligned() -> None:
    """Columns 30 and 60 wide; the last row has one panel only and is centred."""
    large = Panel(grey(0))
    rows = [[Panel(grey(0, 20, 30)), large], [Panel(grey(0, 20, 20)), large], [large]]
    page = layout.figure(rows, margin=0, gap=10)
    assert page.shape == (40 + 10 + 40 + 10 + 40, 30 + 10 + 60, 3)
    assert (page[:20, :30] == 255).all()
    assert (page[22:38, 2:28] < 20).all()
    assert (page[72:88, 7:23] < 20).all() and (page[72:88, :5] == 255).all()
    assert (page[52:88, 42:98] < 20).all()
    assert (page[102:138, 22:78] < 20).all()


def test_labels_shrink_until_they_fit_their_panel() -> None:
    """A grid keeps its columns under each other, whatever the labels say."""
    long = "a label that would be wider than it may be"
    grid = [[Panel(grey(0, 100, 400), long), Panel(grey(0, 100, 400))]] * 2
    assert layout.figure(grid, margin=0, gap=10).shape[1] == 810
    assert layout._fitting([("L", 400), (long, 400)], 26) < layout._fitting([("L", 400)], 26) == 26
    assert layout._fitting([(long, 10)], 26) == layout.LEGIBLE


def test_a_prime_stands_close_to_its_letter() -> None:
    assert layout.lettering("*H′*", 40).shape[1] < 1.35 * layout.lettering("*H*", 40).shape[1]


def test_labels_are_dark_centred_and_below() -> None:
    page = layout.figure([[Panel(grey(255, 40, 300), "coarse motion *L*", border=False)]], margin=0)
    ink = (255 - page[40:].astype(int)).sum(axis=(0, 2))
    assert page[40:].min() < 60
    assert (page[:40] == 255).all()
    assert (ink * np.arange(300)).sum() / ink.sum() == pytest.approx(150, abs=8)


def test_italics_and_greek_are_drawn() -> None:
    """Every symbol leaves ink: a letter the font lacks would be blank or a box like any other."""
    glyphs = [layout.lettering(text, 40) for text in ("*m*", "m", "ω", "λ", "×")]
    assert all(glyph.sum() > 30 for glyph in glyphs)
    assert not np.array_equal(glyphs[2][:, :20], glyphs[3][:, :20])


def test_lines_of_one_size_have_one_height_and_blanks_take_room() -> None:
    assert layout.lettering("x", 26).shape[0] == layout.lettering("Éyg*L*ω", 26).shape[0]
    assert layout.lettering("a b", 26).shape[1] > layout.lettering("ab", 26).shape[1] + 3


def test_inset_is_lower_left_and_legend_lower_right() -> None:
    panel = Panel(grey(100, 200, 300), inset=grey(0, 40, 40), legend=lic.wheel(50))
    page = layout.figure([[panel]], margin=0)
    left, right = page[150:, :60].astype(int), page[150:, 240:].astype(int)
    assert left.min() == 0
    assert np.ptp(right, axis=2).max() > 60
    assert (page[5:140, 5:295] == 100).all()


def test_an_inset_that_does_not_fit_is_refused() -> None:
    with pytest.raises(ValueError, match="does not fit"):
        layout.figure([[Panel(grey(0), inset=grey(0))]])


def test_fitting_up_repeats_pixels_and_down_averages_light() -> None:
    checks = (np.indices((4, 4)).sum(axis=0) % 2).astype(np.float32)[..., None].repeat(3, axis=2)
    larger = layout.fitted(checks, 12)
    assert np.array_equal(larger, checks.repeat(3, axis=0).repeat(3, axis=1))
    smaller = layout.fitted(checks, 2)
    assert smaller == pytest.approx(0.7354, abs=1e-3)  # sRGB of half the light


def test_fitting_to_an_odd_width_keeps_the_mean() -> None:
    light = np.random.Generator(np.random.Philox(key=2)).random((30, 50, 3)).astype(np.float32)
    fitted = tonemap.from_srgb(layout.fitted(light, 17))
    assert fitted.mean() == pytest.approx(tonemap.from_srgb(light).mean(), rel=1e-4)


def test_no_panels_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one panel"):
        layout.figure([[]])


def test_what_is_no_picture_is_refused() -> None:
    with pytest.raises(ValueError, match="picture"):
        layout.figure([[Panel(np.zeros((4, 4)))]])
