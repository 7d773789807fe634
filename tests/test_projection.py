"""Projection: the four properties that make it one, at each border and on odd shapes."""

import numpy as np
import pytest

from synth.noise import curl_noise
from synth.projection import BORDERS, divergence, project

SHAPES = [(8, 8), (5, 7), (33, 20), (1, 9), (5, 7, 3), (2, 2, 2), (12, 16, 9)]
everywhere = pytest.mark.parametrize("border", BORDERS)


def noise(shape, seed=0):
    return np.random.default_rng(seed).normal(size=(*shape, len(shape))).astype(np.float32)


def rms(a):
    return float(np.sqrt(np.mean(np.square(a, dtype=np.float64))))


def gradient(p, border):
    """Central differences of a pressure (the test's own): ghosts even at a wall, odd at an opening."""
    padded = np.pad(p, 1, mode="wrap" if border == "toroidal" else "symmetric")
    if border == "open":
        padded = -padded
        padded[(slice(1, -1),) * p.ndim] = p
    inner = [slice(1, -1)] * p.ndim
    out = []
    for axis in reversed(range(p.ndim)):
        after, before = list(inner), list(inner)
        after[axis], before[axis] = slice(2, None), slice(0, -2)
        out.append((padded[tuple(after)] - padded[tuple(before)]) / 2)
    return np.stack(out, -1).astype(np.float32)


@everywhere
@pytest.mark.parametrize("shape", SHAPES)
def test_the_result_is_divergence_free(shape, border):
    assert rms(divergence(project(noise(shape), border), border)) <= 2e-7 < 1e-5


@everywhere
@pytest.mark.parametrize("shape", SHAPES)
def test_projecting_again_changes_nothing(shape, border):
    once = project(noise(shape), border)
    np.testing.assert_allclose(project(once, border), once, atol=1e-6)


@everywhere
@pytest.mark.parametrize("shape", SHAPES)
def test_a_gradient_vanishes(shape, border):
    p = np.random.default_rng(1).normal(size=shape)
    np.testing.assert_allclose(project(gradient(p, border), border), 0.0, atol=1e-6)


@everywhere
def test_the_divergence_free_part_survives_an_added_gradient(border):
    v = project(noise((20, 31)), border)
    p = np.random.default_rng(2).normal(size=(20, 31))
    np.testing.assert_allclose(project(v + gradient(p, border), border), v, atol=1e-6)


@everywhere
def test_it_is_orthogonal(border):
    v = noise((14, 9, 11))
    part = project(v, border)
    rest = v - part
    cosine = np.vdot(part, rest) / np.linalg.norm(part) / np.linalg.norm(rest)
    assert abs(cosine) < 1e-5


def test_a_rotation_stays_and_a_source_goes():
    y, x = (np.mgrid[:32, :32] - 15.5).astype(np.float32)
    hump = np.exp(-(x * x + y * y) / 32)
    swirl = np.stack([-y * hump, x * hump], -1)
    burst = np.stack([x * hump, y * hump], -1)
    # 0.02: radial symmetry holds to the order of central differences, not to rounding
    np.testing.assert_allclose(project(swirl), swirl, atol=0.02)
    assert rms(project(burst)) < 0.02 * rms(burst)


def test_curl_noise_is_already_free_of_divergence():
    v = next(curl_noise((24, 40), 1, seed=3))
    assert np.abs(divergence(v)[1:-1, 1:-1]).max() < 1e-6


def test_walls_stop_the_flow_and_openings_let_it_through():
    wind = np.zeros((16, 16, 2), np.float32)
    wind[..., 0] = 1.0
    np.testing.assert_allclose(project(wind, "open"), wind, atol=1e-6)
    np.testing.assert_allclose(project(wind, "toroidal"), wind, atol=1e-6)
    assert rms(project(wind, "wall")) < 0.3 * rms(wind)


def test_refusals():
    with pytest.raises(ValueError, match="border"):
        project(noise((4, 4)), "clamp")
    with pytest.raises(ValueError, match="velocity field is"):
        project(np.zeros((4, 4), np.float32))
