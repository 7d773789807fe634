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
)

SIZES = (16, 32, 33, 64, 128)
MOTIFS = ("circle", "square", "heart")


def speed(v):
    return np.sqrt((v.astype(np.float64) ** 2).sum(-1))


def at(v, x, y):
    """The cell at x, y in the unit tile."""
    return v[int(y * v.shape[0]), int(x * v.shape[1])]


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


ASSETS = Path(__file__).parents[3] / "scenes" / "assets"


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
