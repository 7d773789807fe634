"""Exemplars: what the maths promises of each kind, then what each source of a user's exemplar promises."""

from pathlib import Path

import numpy as np
import pytest

from synth.motion.exemplar import (
    KINDS,
    exemplar,
    from_bitmap,
    from_clip,
    from_drawing,
    from_field,
    from_svg,
    from_volume,
    svg_outlines,
)

SIZES = (16, 32, 33, 64, 128)
MOTIFS = ("circle", "square", "heart")


def speed(v):
    return np.sqrt((v.astype(np.float64) ** 2).sum(-1))


def slope(q, axis):
    """Central differences on the torus, per cell."""
    return (np.roll(q, -1, axis) - np.roll(q, 1, axis)) / 2


def divergence(v):
    return slope(v[..., 0], 1) + slope(v[..., 1], 0)


def vorticity(v):
    return slope(v[..., 1], 1) - slope(v[..., 0], 0)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("kind", KINDS)
def test_procedural_is_unit_balanced_and_the_same_again(kind, size):
    v = exemplar(kind, size)
    assert v.shape == (size, size, 2) and v.dtype == np.float32 and v.flags.c_contiguous
    assert speed(v).max() == pytest.approx(1, abs=1e-6)
    # the curl of a periodic potential has no mean
    assert np.abs(v.mean((0, 1), dtype=np.float64)).max() < 1e-6
    assert np.array_equal(v, exemplar(kind, size))


@pytest.mark.parametrize("kind", KINDS)
def test_procedural_has_no_sources(kind):
    """What central differences still see is their own error: it shrinks with the cell."""

    def ratio(size):
        v = exemplar(kind, size).astype(np.float64)
        return np.sqrt((divergence(v) ** 2).mean() / (vorticity(v) ** 2).mean())

    kinked = kind in ("square", "heart")  # corners: v jumps there, first order at best
    assert ratio(128) < (0.04 if kinked else 0.003)
    assert ratio(128) <= ratio(32) * (0.4 if kinked else 0.2)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("kind", MOTIFS)
def test_motif_is_whole_and_alone(kind, size):
    """One motif, 75 to 80 % of the tile across, mirror symmetric, counter-clockwise, rest zero."""
    v = exemplar(kind, size)
    moving = np.flatnonzero(speed(v).max(0) > 1e-3)
    across = (moving[-1] - moving[0] + 1) / size
    assert 0.70 < across <= 0.78 + 2 / size
    border = np.ones((size, size), bool)
    border[size // 16 : -(size // 16), size // 16 : -(size // 16)] = False
    assert not v[border].any()
    np.testing.assert_allclose(v[:, ::-1] * np.float32([1, -1]), v, atol=1e-6)
    y, x = np.mgrid[:size, :size] - (size - 1) / 2
    moment = x * v[..., 1] - y * v[..., 0]
    assert moment.sum() > 0.9 * np.abs(moment).sum()


def test_motif_speeds_are_the_formulas():
    """Circle: |v| = 9 ρ² (1 - ρ³)² over its greatest value; square: the same of the Chebyshev distance."""
    size = 128
    y, x = (np.mgrid[:size, :size] + 0.5) / size * 2 - 1
    for kind, rho in (("circle", np.hypot(x, y) / 0.78), ("square", np.maximum(abs(x), abs(y)) / 0.78)):
        profile = rho**2 * np.clip(1 - rho**3, 0, None) ** 2
        smooth = np.ones_like(rho, bool) if kind == "circle" else abs(abs(x) - abs(y)) > 2 / size
        smooth &= rho > 0.05
        np.testing.assert_allclose(speed(exemplar(kind, size))[smooth], profile[smooth] / 0.2232, atol=0.01)


def test_heart_is_a_heart():
    """Two lobes, a notch between them, one tip below, and the flow follows nested hearts."""
    v = exemplar("heart", 128)
    inside = speed(v) > 0.01
    top = np.array([np.flatnonzero(column).max(initial=-1) for column in inside.T])
    bottom = np.array([np.flatnonzero(column).min(initial=128) for column in inside.T])
    left, right = top[:64].argmax(), 64 + top[64:].argmax()
    assert 30 < left < 50 and 76 < right < 97
    assert top[63] < top[left] - 5  # the notch
    assert abs(bottom.argmin() - 63.5) < 2 and bottom[63] < bottom[40] - 20  # the tip
    # sides slope straight into the tip
    slope = np.diff(bottom[34:60])
    assert (slope <= 0).all() and -1.3 < slope.mean() < -0.7
    # the flow turns sharply at the axis just below the notch: down the left lobe's inner side, up the right's
    row = np.flatnonzero(inside[:, 63]).max() - 8
    assert v[row, 61, 1] < -0.2 or v[row, 61, 1] > 0.2
    assert np.sign(v[row, 61, 1]) == -np.sign(v[row, 66, 1])


def test_small_heart_is_the_large_one_averaged():
    """At 16² the heart is what block means of the 128² one are: nothing is lost to aliasing."""
    large = exemplar("heart", 128).astype(np.float64).reshape(16, 8, 16, 8, 2).mean((1, 3))
    small = exemplar("heart", 16)
    np.testing.assert_allclose(large / speed(large).max(), small, atol=2e-4)


def test_bands():
    """stripes: sin(4π y) along x; sinusoid: four bands of alternating direction in every column."""
    size = 64
    y = (np.arange(size) + 0.5) / size
    stripes = exemplar("stripes", size)
    assert not stripes[..., 1].any()
    np.testing.assert_allclose(stripes[:, 0, 0], np.sin(4 * np.pi * y), atol=6e-3)  # cell mean against point
    wave = exemplar("sinusoid", size)
    forth = wave[..., 0] > 0
    assert wave[..., 1].std() > 0.2
    assert ((forth != np.roll(forth, 1, 0)).sum(0) == 4).all()


@pytest.mark.parametrize(
    ("kind", "size", "reason"), [("hart", 64, "unknown exemplar kind 'hart'"), ("heart", 7, "too small")]
)
def test_procedural_refuses(kind, size, reason):
    with pytest.raises(ValueError, match=reason):
        exemplar(kind, size)


def wave(size, k_x, k_y):
    """cos of whole waves on the tile, at cell centres."""
    x = (np.arange(size) + 0.5) / size
    return np.cos(2 * np.pi * (k_x * x[None, :] + k_y * x[:, None]))


@pytest.mark.parametrize("side", [48, 64, 200])
def test_bitmap_is_the_curl_of_its_grey_values(side):
    """A wave's curl is known; the border correction takes a wave for the tile it almost is."""
    size, k_x, k_y = 48, 2, 3
    x = (np.arange(size) + 0.5) / size
    s = np.sin(2 * np.pi * (k_x * x[None, :] + k_y * x[:, None]))
    known = np.stack([-k_y * s, k_x * s], axis=-1) / np.hypot(k_x, k_y)
    v = from_bitmap(100 + 50 * wave(side, k_x, k_y), size, blur=0.0)
    inner = slice(size // 4, -size // 4)
    assert np.abs(v - known)[inner, inner].max() < 0.2
    cosine = (v * known).sum() / np.sqrt((v.astype(np.float64) ** 2).sum() * (known**2).sum())
    assert cosine > 0.985


def test_bitmap_that_is_a_tile_stays_exact():
    """A spot on plain paper: nothing to take out at the border, bright on the flow's left, no sources."""
    x = (np.arange(96) + 0.5) / 96 - 0.5
    spot = np.exp(-(x[None, :] ** 2 + x[:, None] ** 2) / (2 * 0.06**2))
    v = from_bitmap(spot, 48, blur=0.0)
    x = (np.arange(48) + 0.5) / 48 - 0.5
    known = np.stack(np.broadcast_arrays(-x[:, None], x[None, :]), axis=-1)
    known = known * np.exp(-(x[None, :, None] ** 2 + x[:, None, None] ** 2) / (2 * 0.06**2))
    known /= speed(known).max()
    np.testing.assert_allclose(v, known, atol=1e-4)
    assert np.array_equal(v, from_bitmap(np.uint8([1]) * spot, 48, blur=0.0))


def test_bitmap_is_toroidal_and_without_sources():
    """Even a photograph that does not tile: across the border it is as smooth as inside."""
    grey = np.random.default_rng(3).random((70, 90)).cumsum(0).cumsum(1)  # a ramp with texture
    v = from_bitmap(grey, 32).astype(np.float64)
    k = np.fft.fftfreq(32) * 32
    spectrum = np.fft.fft2(v, axes=(0, 1))
    sources = np.abs(k[None, :] * spectrum[..., 0] + k[:, None] * spectrum[..., 1])
    assert sources.max() < 1e-5 * np.abs(spectrum).max() * 32
    steps = speed(np.roll(v, -1, 1) - v)
    assert steps[:, -1].mean() < 2 * steps[:, :-1].mean()


def test_bitmap_blur_takes_out_grain():
    grey = np.random.default_rng(0).random((64, 64))
    rough, smooth = (from_bitmap(grey, 64, blur=b) for b in (0.0, 2.0))
    for axis in (0, 1):
        assert np.abs(np.diff(smooth, axis=axis)).mean() < 0.5 * np.abs(np.diff(rough, axis=axis)).mean()


def test_field():
    """A tile of the right size only loses its unit; others are resampled and cropped; jumps can go."""
    heart = exemplar("heart", 64)
    np.testing.assert_allclose(from_field(7 * heart, 64), heart, atol=1e-6)
    np.testing.assert_allclose(from_field(heart, 64, toroidal=True), heart, atol=1e-6)
    blocks = heart.astype(np.float64).reshape(32, 2, 32, 2, 2).mean((1, 3))
    np.testing.assert_allclose(from_field(heart, 32), blocks / speed(blocks).max(), atol=1e-6)
    wide = np.pad(heart, ((0, 0), (10, 10), (0, 0)), constant_values=3)
    np.testing.assert_allclose(from_field(wide, 64), heart, atol=1e-6)
    assert np.abs(from_field(heart, 128) - exemplar("heart", 128)).mean() < 0.02
    y, x = np.mgrid[:32, :32] / 31
    ramp = from_field(np.stack([1 + 0.1 * np.sin(9 * x), y], axis=-1), 32, toroidal=True)
    assert np.abs(ramp[0] - ramp[-1]).mean() < 0.2 * np.abs(np.stack([x, y])).max()


def test_a_volume_keeps_its_axes_and_its_place() -> None:
    cube = np.random.default_rng(1).standard_normal((16, 16, 16, 3))
    cube /= np.linalg.norm(cube, axis=-1).max()
    np.testing.assert_allclose(from_volume(7 * cube, 16), cube, atol=1e-6)
    wide = np.pad(cube, ((1, 1), (4, 4), (2, 2), (0, 0)))
    np.testing.assert_allclose(from_volume(wide, 18)[1:-1, 1:-1, 1:-1], cube, atol=1e-6)
    blocks = cube.reshape(8, 2, 8, 2, 8, 2, 3).mean((1, 3, 5))
    np.testing.assert_allclose(from_volume(cube, 8), blocks / np.linalg.norm(blocks, axis=-1).max(), atol=1e-6)
    ramp = np.zeros((16, 16, 16, 3))
    ramp[..., 2] = np.arange(16)[:, None, None]
    ramp[..., 0] = np.sin(2 * np.pi * (np.arange(16) + 0.5) / 16)[:, None]
    tile = from_volume(ramp, 16, toroidal=True)
    z, x = tile[..., 2] / tile[..., 2].mean(), tile[..., 0] / tile[..., 2].mean()
    assert abs(z[0, 8, 8] - z[-1, 8, 8]) < 0.15  # the ramp's jump of twice its mean is gone …
    np.testing.assert_allclose(np.ptp(x), 2 / 7.5, rtol=0.15)  # … what waves stays, but for its own step there


def test_a_volume_of_three_and_a_half_cells_to_one() -> None:
    constant = np.broadcast_to(np.array([1.0, 2.0, -2.0]), (28, 28, 28, 3))
    unit = np.broadcast_to([1 / 3, 2 / 3, -2 / 3], (8, 8, 8, 3))
    np.testing.assert_allclose(from_volume(constant, 8), unit, atol=1e-6)



def test_clip_finds_a_known_motion():
    """Texture that moves by (2, -1) pixels a frame, y up, gives that direction, and the same bits again."""
    noise = np.random.default_rng(1).random((96, 96))
    k = np.fft.fftfreq(96)
    texture = np.fft.ifft2(np.fft.fft2(noise) * np.exp(-400 * (k[:, None] ** 2 + k**2))).real
    texture = (texture - texture.min()) / np.ptp(texture)
    frames = [np.roll(texture, (-n, 2 * n), (0, 1)) for n in range(5)]
    v = from_clip(frames, 32)
    assert v.shape == (32, 32, 2)
    mean = v[8:-8, 8:-8].mean((0, 1))
    assert mean[0] / mean[1] == pytest.approx(-2, abs=0.15) and mean[0] > 0.5
    assert np.array_equal(v, from_clip([np.rint(255 * f).astype(np.uint8) for f in frames], 32))


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


@pytest.mark.parametrize(
    ("call", "reason"),
    [
        (lambda: from_bitmap(np.full((32, 32), 7), 16), "blank"),
        (lambda: from_bitmap(np.full((32, 32), np.nan), 16), "not finite"),
        (lambda: from_bitmap(np.eye(5), 16), "too small"),
        (lambda: from_bitmap(np.eye(32), 4), "too small"),
        (lambda: from_bitmap(np.eye(32), 16, blur=-1), "blur"),
        (lambda: from_bitmap(np.zeros((32, 32, 3)), 16), "dimensions"),
        (lambda: from_field(np.zeros((32, 32, 2)), 16), "blank"),
        (lambda: from_field(np.full((32, 32, 2), np.inf), 16), "not finite"),
        (lambda: from_field(np.ones((32, 32, 3)), 16), "components"),
        (lambda: from_volume(np.zeros((16, 32, 32, 3)), 16), "blank"),
        (lambda: from_volume(np.ones((32, 32, 32, 2)), 16), "components"),
        (lambda: from_volume(np.ones((32, 32, 7, 3)), 16), "thin"),
        (lambda: from_clip([np.eye(32)], 16), "two frames"),
        (lambda: from_clip([np.eye(32), np.eye(33)], 16), "frame 2"),
        (lambda: from_clip([np.eye(32), np.full((32, 32), np.nan)], 16), "frame 2.*not finite"),
        (lambda: from_clip([np.full((32, 32), 0.5)] * 3, 16), "blank"),
        (lambda: from_drawing(np.full((64, 64, 3), 255, np.uint8), 16), "blank"),
        (lambda: from_drawing(np.zeros((64, 64, 2)), 16), "channels"),
        (lambda: from_drawing(np.full((64, 64), np.nan), 16), "not finite"),
    ],
)
def test_sources_refuse(call, reason):
    with pytest.raises(ValueError, match=reason):
        call()


ASSETS = Path(__file__).parent.parent / "scenes" / "assets"


def test_assets_make_exemplars():
    """The pictures the scenes name, read as any PNG reader gives them, with the flow each was drawn for."""
    import cv2

    for name in ("lightning", "brick", "gravel"):
        grey = cv2.imread(str(ASSETS / f"{name}.png"), cv2.IMREAD_GRAYSCALE)[::-1]
        v = from_bitmap(grey, 64)
        assert 0.2 < np.sqrt((speed(v) ** 2).mean()) < 0.5
    spiral = from_drawing(cv2.imread(str(ASSETS / "spiral.png"))[::-1, :, ::-1], 64)
    y, x = np.mgrid[:64, :64] - 31.5
    inward = -(x * spiral[..., 0] + y * spiral[..., 1]).sum()
    around = np.abs(x * spiral[..., 1] - y * spiral[..., 0]).sum()
    assert 0.05 * around < inward < around  # from the red dot inwards
    leaf = from_svg((ASSETS / "leaf.svg").read_text(), 64)
    assert at(leaf, 0.5, 0.42) == pytest.approx([0, 1], abs=0.1)
    np.testing.assert_allclose(leaf[:, ::-1] * np.float32([-1, 1]), leaf, atol=1e-5)
    assert all(f.stat().st_size < 300_000 for f in ASSETS.iterdir())


def test_closed_paths_are_contours_in_their_viewbox():
    text = ('<svg xmlns="http://www.w3.org/2000/svg" viewBox="10 20 200 100"><path d="M60 45 h50 v50 h-50 z"/>'
            '<path d="M0 0 L5 5"/></svg>')
    (square,), width = svg_outlines(text)
    assert width == 2.0
    np.testing.assert_allclose((square.min(0), square.max(0)), ((0.5, 0.25), (1.0, 0.75)), atol=1e-9)
    for bad in ("<svg", text.replace(" z", "")):
        with pytest.raises(ValueError, match="SVG"):
            svg_outlines(bad)
