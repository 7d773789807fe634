"""Strokes: which way a drawing's lines are followed, what an SVG promises, and the contours it gives."""

import numpy as np
import pytest

from synth.motion.exemplar import from_drawing, from_svg
from synth.motion.strokes import svg_outlines


def speed(v):
    return np.sqrt((v.astype(np.float64) ** 2).sum(-1))


def drawing(*strokes, size=128, dots=(), colour=(20, 20, 20)):
    """Strokes (x, y in the unit tile, y up) drawn black on white with a 5 pixel pen, bottom row first."""
    import cv2

    picture = np.full((size, size, 3), 255, np.uint8)
    for stroke in strokes:
        cv2.polylines(picture, [np.int32(np.array(stroke) * size)], False, colour, 5, cv2.LINE_AA)
    for x, y in dots:
        cv2.circle(picture, (int(x * size), int(y * size)), 6, (230, 20, 20), -1)
    return picture


def at(v, x, y):
    return v[int(y * v.shape[0]), int(x * v.shape[1])]


LEVEL = [(0.2, 0.5), (0.8, 0.5)]
UPRIGHT = [(0.5, 0.2), (0.5, 0.8)]


@pytest.mark.parametrize("inverted", [False, True])
def test_drawing_flows_along_its_strokes(inverted):
    picture = drawing(LEVEL)
    v = from_drawing(255 - picture if inverted else picture, 64)
    assert at(v, 0.5, 0.5) == pytest.approx([1, 0], abs=0.02)
    profile = speed(v)[:, 32]  # across the stroke: soft, symmetric, then nothing
    assert (np.diff(profile[33:40]) <= 0).all() and 0.2 < profile[34] < 0.95
    assert not profile[:24].any() and not profile[40:].any()


@pytest.mark.parametrize(
    ("strokes", "dots", "where", "direction"),
    [
        ([LEVEL], [], (0.5, 0.5), (1, 0)),
        ([UPRIGHT], [], (0.5, 0.5), (0, 1)),
        ([LEVEL], [(0.8, 0.5)], (0.5, 0.5), (-1, 0)),
        ([UPRIGHT], [(0.5, 0.8)], (0.5, 0.5), (0, -1)),
        ([LEVEL, UPRIGHT], [], (0.3, 0.5), (1, 0)),  # they cross and go on
        ([LEVEL, UPRIGHT], [], (0.7, 0.5), (1, 0)),
        ([LEVEL, UPRIGHT], [], (0.5, 0.3), (0, 1)),
        ([LEVEL, UPRIGHT], [], (0.5, 0.7), (0, 1)),
        ([LEVEL, UPRIGHT], [(0.8, 0.5)], (0.5, 0.7), (0, 1)),  # the dot is the level stroke's alone
    ],
)
def test_drawing_direction(strokes, dots, where, direction):
    v = from_drawing(drawing(*strokes, dots=dots), 64)
    assert at(v, *where) == pytest.approx(direction, abs=0.12)


@pytest.mark.parametrize("turn", [1, -1])
def test_drawing_closed_stroke_runs_counter_clockwise(turn):
    t = np.linspace(0, 2 * np.pi, 80) * turn
    v = from_drawing(drawing(np.stack([0.5 + 0.3 * np.cos(t), 0.5 + 0.3 * np.sin(t)], -1)), 64)
    for angle in np.arange(8) * np.pi / 4 + 0.2:
        direction = at(v, 0.5 + 0.3 * np.cos(angle), 0.5 + 0.3 * np.sin(angle))
        assert direction @ [-np.sin(angle), np.cos(angle)] > 0.85


def test_drawing_beside_the_border_acts_across_it():
    v = from_drawing(drawing([(0.2, 0.03), (0.8, 0.03)]), 64)
    assert speed(v)[-1, 32] > 0.1


def test_drawing_reads_transparent_and_wide_pictures():
    picture = drawing(LEVEL)
    transparent = np.concatenate([np.zeros_like(picture), 255 - picture[..., :1]], axis=-1)
    assert np.array_equal(from_drawing(transparent, 64), from_drawing(picture, 64))
    wide = np.pad(picture, ((0, 0), (64, 64), (0, 0)), constant_values=255)
    assert at(from_drawing(wide, 64), 0.5, 0.5) == pytest.approx([1, 0], abs=0.02)


def test_drawing_of_any_size_is_the_same():
    """A scan of 2048 pixels, in colour or grey, gives what 512 pixels give."""
    small = drawing(LEVEL, UPRIGHT, size=512)
    large = np.kron(small, np.ones((4, 4, 1), np.uint8))
    for channels in (slice(None), 0):
        v = from_drawing(large[..., channels], 64)
        np.testing.assert_allclose(v, from_drawing(small, 64), atol=0.12)


SVG = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 100">{}</svg>'


@pytest.mark.parametrize(
    ("content", "where", "direction"),
    [
        ('<path d="M 20 50 L 80 50"/>', (0.5, 0.5), (1, 0)),
        ('<path d="M 80 50 L 20 50"/>', (0.5, 0.5), (-1, 0)),
        ('<path d="M 30 20 L 30 90"/>', (0.3, 0.5), (0, -1)),  # SVG's y points down
        ('<path d="M 20 30 C 40 30 60 30 80 30"/>', (0.5, 0.7), (1, 0)),
        ('<g transform="translate(0 30)"><path d="M 20 50 L 80 50"/></g>', (0.5, 0.2), (1, 0)),
        ('<polyline points="20,50 80,50"/>', (0.5, 0.5), (1, 0)),
    ],
)
def test_svg_flows_as_drawn(content, where, direction):
    assert at(from_svg(SVG.format(content), 64), *where) == pytest.approx(direction, abs=0.02)


def test_svg_without_viewbox_is_fitted():
    v = from_svg('<svg xmlns="http://www.w3.org/2000/svg"><path d="M 1000 5 L 3000 5"/></svg>', 64)
    assert at(v, 0.5, 0.5) == pytest.approx([1, 0], abs=0.02) and not at(v, 0.005, 0.5).any()


BOMB = '<!DOCTYPE svg [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;">]>' + SVG.format("&b;")
EXTERNAL = '<!DOCTYPE svg [<!ENTITY x SYSTEM "file:///etc/passwd">]>' + SVG.format("&x;")


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (BOMB, "document type"),
        (EXTERNAL, "document type"),
        (SVG.format(""), "blank"),
        (SVG.format('<path d="M 1 1 L 1 1"/>'), "blank"),
        (SVG.format('<path d="M 0 0 L 1e999 5"/>'), "not finite"),
        (SVG.format('<path d="hello"/>'), "cannot be read|blank"),
        ("<svg", "cannot be read"),
        ("not xml", "cannot be read"),
        ('<svg xmlns="http://www.w3.org/2000/svg" viewBox="a b c d"/>', "cannot be read"),
        ('<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 0 0"><path d="M 0 0 L 1 5"/></svg>', "extent"),
        (SVG.format(" " * 1_000_001), "characters"),
        (SVG.format('<path d="M 0 0' + " l 1 1 l -1 -1" * 10_001 + '"/>'), "segments"),
    ],
)
def test_svg_refuses(text, reason):
    with pytest.raises(ValueError, match=reason):
        from_svg(text, 64)


def test_closed_paths_are_contours_in_their_viewbox():
    text = ('<svg xmlns="http://www.w3.org/2000/svg" viewBox="10 20 200 100"><path d="M60 45 h50 v50 h-50 z"/>'
            '<path d="M0 0 L5 5"/></svg>')
    (square,), width = svg_outlines(text)
    assert width == 2.0
    np.testing.assert_allclose((square.min(0), square.max(0)), ((0.5, 0.25), (1.0, 0.75)), atol=1e-9)
    for bad in ("<svg", text.replace(" z", "")):
        with pytest.raises(ValueError, match="SVG"):
            svg_outlines(bad)
