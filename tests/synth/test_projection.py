"""Projection: the four properties that make it one, at each border and on odd shapes."""

import numpy as np
import pytest

from synth import obstacle
from synth.noise import curl_noise
from synth.projection import BORDERS, divergence, openings, project

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


def stone(shape):
    """Cells to the wall of a ball of 0.22 heights a little off the middle."""
    centre = (0.03, 0.45, 0.02)[: len(shape)]
    return obstacle.ball(shape, centre, 0.22).distance


def rms_gradient(v):
    return float(np.sqrt(np.mean([np.gradient(v, axis=axis).astype(float) ** 2 for axis in range(v.ndim - 1)])))


@everywhere
@pytest.mark.parametrize("shape", [(24, 32), (33, 20), (40, 57), (12, 16, 9), (9, 24, 31)])
def test_past_an_obstacle_the_result_is_divergence_free(shape, border):
    distance = stone(shape)
    v = project(noise(shape), border, distance)
    assert rms(divergence(v, border, distance)) <= 1e-4 * rms_gradient(v)


@everywhere
@pytest.mark.parametrize("shape", [(24, 32), (9, 24, 31)])
def test_past_an_obstacle_too_a_second_projection_changes_nothing(shape, border):
    distance = stone(shape)
    once = project(noise(shape), border, distance)
    assert rms(project(once, border, distance) - once) < 2e-3 * rms(once)


@everywhere
def test_an_obstacle_far_away_is_none(border):
    """All faces open, and conjugate gradients come to what the transform gives at once."""
    v = noise((20, 31))
    far = np.full((20, 31), 50, np.float32)
    np.testing.assert_allclose(divergence(v, border, far), divergence(v, border), atol=1e-6)
    np.testing.assert_allclose(project(v, border, far), project(v, border), atol=5e-4)


def test_a_wind_passes_round_a_disc_as_the_potential_flow_does():
    shape, centre, radius = (150, 200), (0.0, 0.5), 0.06
    distance = obstacle.ball(shape, centre, radius).distance
    wind = np.zeros((*shape, 2), np.float32)
    wind[..., 0] = 1.0
    v = project(wind, "open", distance)
    y, x = np.mgrid[:150, :200]
    x, y = (x + 0.5) / 150 - 2 / 3, (y + 0.5) / 150 - 0.5
    squared = x * x + y * y
    ratio = radius**2 / squared
    exact = np.stack([1 - ratio * (x * x - y * y) / squared, -2 * ratio * x * y / squared], -1)
    away = (distance > 1.5) & (np.hypot(x, y) < 3 * radius)
    assert rms((v - exact)[away]) < 0.05
    near = (distance > 0) & (distance < 1.5)
    normal = obstacle.outward(distance)
    assert rms(np.sum(v * normal, -1)[near]) < 0.12
    inside = (distance < -1) & (distance > -4)
    assert rms(np.sum(v * normal, -1)[inside]) < 1e-6 and rms(v[inside]) > 0.5  # along the wall there too


def test_nothing_comes_out_of_a_closed_box():
    """A square without a face to the outside: what flows inside is no matter of the outside."""
    distance = obstacle.box((32, 32), (0.0, 0.5), (0.25, 0.25)).distance  # its walls are faces of cells
    wild, calm = noise((32, 32)), noise((32, 32))
    calm[distance < -1] = 0
    outside = distance > 0
    wild[outside] = calm[outside]
    np.testing.assert_allclose(project(wild, "wall", distance)[outside], project(calm, "wall", distance)[outside],
                               atol=2e-3)


@everywhere
@pytest.mark.parametrize("shape", [(7, 9), (4, 6, 5)])
def test_open_shares_are_none_inside_and_all_far_outside(shape, border):
    distance = stone(shape) * 3
    for axis, share in enumerate(openings(distance, border)):
        assert share.shape == tuple(n + (i == axis) for i, n in enumerate(shape))
        assert share.min() == 0 and share.max() == 1
    half = np.broadcast_to(np.arange(6) - 2.5, (5, 6)).astype(np.float32)  # a wall midway through the third cells
    across_y, across_x = openings(half, "toroidal")
    np.testing.assert_allclose(across_y[1, 1:-1], [0, 0, 1, 1])
    np.testing.assert_allclose(across_x[2, 2:-1], [0, 0, 1, 1][:across_x.shape[1] - 3], atol=1e-6)


def test_an_obstacle_of_another_size_is_refused():
    with pytest.raises(ValueError, match="does not fit"):
        project(noise((4, 4)), "wall", np.ones((4, 5), np.float32))
