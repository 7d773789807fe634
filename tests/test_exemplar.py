"""Exemplars: what the maths promises of each kind, then what each source of a user's exemplar promises."""

import numpy as np
import pytest

from synth.motion.exemplar import KINDS, exemplar

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
    assert wave[..., 1].std() > 0.2 and ((wave[..., 0] > 0) != (np.roll(wave[..., 0], 1, 0) > 0)).sum(0).tolist() == [4] * size


@pytest.mark.parametrize(
    ("kind", "size", "reason"), [("hart", 64, "unknown exemplar kind 'hart'"), ("heart", 7, "too small")]
)
def test_procedural_refuses(kind, size, reason):
    with pytest.raises(ValueError, match=reason):
        exemplar(kind, size)
