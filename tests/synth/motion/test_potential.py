"""Potentials: what has one is given back, what has none is lost; the synthesis has no divergence and keeps motifs."""

import numpy as np
import pytest
from scipy import ndimage

from synth.motion import detail, potential
from synth.motion.detail import Settings, enough_levels
from synth.motion.exemplar import exemplar
from synth.motion.local_axes import axes_2d, to_world
from synth.motion.potential import Synthesis, curl
from synth.motion.quality import measure, whole_motifs
from synth.projection import divergence, project


def tile(psi):
    """Central differences of ψ (N, M), toroidal: (N, M, 2)."""
    return np.stack([np.roll(psi, -1, 0) - np.roll(psi, 1, 0), np.roll(psi, 1, 1) - np.roll(psi, -1, 1)], -1) / 2


def smooth_tile(shape, seed=0):
    return ndimage.gaussian_filter(np.random.default_rng(seed).normal(size=shape), 2, mode="wrap")


def wave(n, columns=None):
    swing = 0.8 * np.sin(2 * np.pi * np.arange(columns or n) / n)
    rows = np.ones((n, columns or n))
    return np.stack([rows, rows * swing], -1).astype(np.float32)


@pytest.mark.parametrize("shape", [(16, 16), (15, 22)])
def test_a_curl_gives_its_potential_back(shape):
    psi = smooth_tile(shape)
    found, lost = potential.potential(tile(psi).astype(np.float32))
    assert found.shape == (*shape, 1) and found.dtype == np.float32 and lost < 0.01
    # up to the constant that makes it zero where the flow rests
    difference = found[..., 0] - psi
    assert np.ptp(difference) < 0.02 * np.ptp(psi)


@pytest.mark.parametrize("shape", [(16, 16), (15, 22)])
def test_what_is_left_is_the_exact_projection(shape):
    v = np.stack([smooth_tile(shape, 1), smooth_tile(shape, 2)], -1).astype(np.float32)
    psi, lost = potential.potential(v)
    projected = project(v, "toroidal")
    projected -= projected.mean(axis=(0, 1))  # the mean motion has no tile of a potential
    np.testing.assert_allclose(tile(psi[..., 0].astype(float)), projected, atol=0.02 * np.abs(v).max())
    assert lost == pytest.approx(np.sqrt(np.mean((v - projected) ** 2) / np.mean(v**2)), abs=0.01)


@pytest.mark.parametrize("size", [16, 32, 128])
@pytest.mark.parametrize(("kind", "most"), [("circle", 0.03), ("square", 0.06), ("stripes", 1e-5), ("sinusoid", 0.03),
                                            ("heart", 0.15)])
def test_the_built_in_exemplars_lose_little(kind, most, size):
    """The heart's corners alternate from cell to cell, which central differences do not see."""
    assert potential.potential(exemplar(kind, size))[1] < most


def test_the_potential_is_zero_where_the_exemplar_rests():
    I = exemplar("circle", 32)
    psi = potential.potential(I)[0][..., 0]
    still = np.linalg.norm(I, axis=-1) == 0
    assert np.abs(psi[[0, -1]]).max() < 0.02 * np.abs(psi).max() and still[[0, -1]].all()


def test_an_exemplar_without_curl_is_refused():
    x = 2 * np.pi * np.arange(16) / 16
    spring = np.stack(np.meshgrid(np.sin(x), np.sin(x)), -1).astype(np.float32)
    for none in (spring, np.full((16, 16, 2), 1, np.float32)):
        with pytest.raises(ValueError, match="no curl"):
            potential.potential(none)


def test_a_curl_has_no_divergence():
    psi = np.random.default_rng(0).normal(size=(13, 17, 1))
    assert np.abs(divergence(curl(psi))[1:-1, 1:-1]).max() < 1e-6
    y, x = np.mgrid[:5, :7]
    np.testing.assert_allclose(curl((2.0 * y - 3.0 * x)[..., None]), np.broadcast_to([2, 3], (5, 7, 2)))


@pytest.mark.parametrize("search", ["exact", "k-coherence"])
def test_what_is_synthesized_has_no_divergence_and_whole_motifs(search):
    """Where the motion itself is synthesized it keeps 5 to 10 % of the rms gradient."""
    I, L = exemplar("circle", 16), wave(72)
    synthesis = Synthesis(I, (72, 72), Settings(enough_levels(16), search=search), 1)
    first = synthesis.frame(L, None)
    for state in (first, synthesis.frame(L, first)):
        H = synthesis.visible(state)
        assert H.shape == (72, 72, 2) and H.dtype == np.float32
        world, frame = to_world(H, axes_2d(L)), axes_2d(L)
        slopes = np.sqrt(sum(np.mean(np.gradient(world[..., c], axis=a) ** 2) for c in (0, 1) for a in (0, 1)))
        assert np.sqrt(np.mean(divergence(world)[1:-1, 1:-1] ** 2)) < 1e-6 * slopes
    found = measure(H, frame, I)
    assert found.used > 0.9 and 0.85 < found.rms < 1.15 and found.forward < 0.3
    whole, motifs = whole_motifs(H, frame, I)
    assert motifs >= 6 and whole >= 0.85 * motifs


def test_the_exemplar_is_a_fixed_point():
    synthesis = Synthesis(exemplar("heart", 16), (48, 48), Settings(2), 1)
    level, frame = synthesis.levels[-1], axes_2d(np.broadcast_to(np.float32([1, 0]), (48, 48, 2)))
    psi = np.tile(level.exemplar, (3, 3, 1))
    np.testing.assert_allclose(level.optimize(psi, frame, 2)[0].get()[8:-8, 8:-8], psi[8:-8, 8:-8],
                               atol=0.02 * np.abs(psi).max())


def test_nothing_flows_through_a_wall_and_inside_it_rests():
    L = np.broadcast_to(np.float32([0, 1]), (48, 48, 2)).copy()
    y, x = np.mgrid[:48, :48]
    away_x, away_y = x - 23.5, y - 23.5
    distance = (np.hypot(away_x, away_y) - 10).astype(np.float32)
    synthesis = Synthesis(exemplar("sinusoid", 16), (48, 48), Settings(2), 1, distance)
    H = to_world(synthesis.visible(synthesis.frame(L, None)), axes_2d(L))
    normal = np.stack([away_x, away_y], -1) / np.hypot(away_x, away_y)[..., None]
    rms = np.sqrt(np.mean(H[distance > 4] ** 2))
    at_wall = np.abs(distance) < 0.5
    assert np.sqrt(np.mean(np.sum(H * normal, -1)[at_wall] ** 2)) < 0.02 * rms
    np.testing.assert_array_equal(H[distance < -1.5], 0)
    assert np.abs(divergence(H)[1:-1, 1:-1]).max() < 1e-5


def test_the_same_seed_gives_the_same_bits_and_the_margin_sees_the_same_frames():
    I, L = exemplar("heart", 16), wave(40, 56)
    first, again = (Synthesis(I, L.shape[:2], Settings(2), 5) for _ in range(2))
    state = first.frame(L, None)
    np.testing.assert_array_equal(first.visible(state), again.visible(again.frame(L, None)))
    margin = detail.MARGIN
    np.testing.assert_array_equal(state.axes[-1][margin:-margin, margin:-margin], axes_2d(L))
