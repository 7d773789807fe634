"""Coarse motions: the analytic flows' known values, the kinds by name, and upsampling."""

import numpy as np
import pytest

from synth.motion.coarse import FLOWS, coarse, settings_of, upsample
from synth.projection import divergence
from synth.smoke import vorticity


def analytic(shape=(8, 12), **settings):
    return next(coarse("analytic", shape, 1, **settings))


def test_known_values():
    constant = analytic(flow="constant", speed=2.0)
    np.testing.assert_array_equal(constant, np.broadcast_to([2.0, 0.0], (8, 12, 2)))
    np.testing.assert_allclose(analytic(flow="diagonal", speed=2.0), np.sqrt(2.0), rtol=1e-6)
    np.testing.assert_allclose(analytic(flow="constant", angle=90.0, speed=2.0)[3, 3], [0.0, 2.0], atol=1e-6)
    rotation = analytic(flow="rotation")
    fastest = np.abs(rotation[..., 0]).max()
    np.testing.assert_allclose(rotation[0, :, 0], fastest, rtol=1e-6)  # the bottom row goes right
    assert rotation[4, 11, 1] > 0 > rotation[4, 0, 1]  # right side up: counter-clockwise
    w = vorticity(rotation)
    np.testing.assert_allclose(w, w[0, 0], rtol=1e-5)
    shear = analytic(flow="shear", speed=3.5)
    np.testing.assert_allclose(shear[:, 5, 0], np.arange(-3.5, 4.0), rtol=1e-6)
    assert not shear[..., 1].any()
    saddle = analytic(flow="saddle")
    assert saddle[4, 11, 0] > 0 > saddle[7, 6, 1]


def test_between_the_vortices_of_a_pair_it_blows_up():
    pair = analytic((32, 48), flow="vortex-pair")
    assert pair[16, 24, 1] > 0.9 and pair[16, 0, 1] < 0 and pair[16, 47, 1] < 0
    np.testing.assert_allclose(pair[..., 1], pair[:, ::-1, 1], atol=1e-6)


@pytest.mark.parametrize("flow", FLOWS)
@pytest.mark.parametrize("shape", [(16, 24), (3, 16, 24)])
@pytest.mark.parametrize("angle", [0.0, 30.0])
def test_every_flow_is_free_of_divergence_and_as_fast_as_asked(flow, shape, angle):
    v = analytic(shape, flow=flow, speed=2.5, angle=angle)
    assert v.shape == (*shape, len(shape)) and v.dtype == np.float32
    assert np.linalg.norm(v, axis=-1).max() == pytest.approx(2.5, rel=1e-5)
    inner = (Ellipsis, slice(1, -1), slice(1, -1))
    # only the pair is no polynomial of first degree: central differences see it to their second order
    assert np.abs(divergence(v, "open")[inner]).max() < (0.06 if flow == "vortex-pair" else 1e-6)


@pytest.mark.parametrize("kind", ["smoke", "curl-noise", "analytic"])
def test_every_kind_yields_its_frames(kind):
    frames = list(coarse(kind, (16, 20), 3, seed=4))
    assert [f.shape for f in frames] == [(16, 20, 2)] * 3
    assert all(f.dtype == np.float32 for f in frames)
    assert settings_of(kind)


def test_refusals_come_at_once():
    with pytest.raises(ValueError, match="none of smoke, curl-noise, wake, analytic"):
        coarse("fire", (8, 8), 1)
    with pytest.raises(ValueError, match=r"no setting 'bouyancy'; it has .*buoyancy"):
        coarse("smoke", (8, 8), 1, bouyancy=1.0)
    with pytest.raises(ValueError, match="flow 'spiral'"):
        coarse("analytic", (8, 8), 1, flow="spiral")
    with pytest.raises(ValueError, match="2 or 3 dimensions"):
        coarse("smoke", (8,), 1)


@pytest.mark.parametrize("kernel", ["linear", "cubic"])
@pytest.mark.parametrize("shape", [(5, 7), (4, 6, 5)])
def test_upsampling_to_the_same_cells_is_the_identity(shape, kernel):
    v = np.random.default_rng(0).normal(size=(*shape, len(shape))).astype(np.float32)
    np.testing.assert_array_equal(upsample(v, shape, kernel), v)


@pytest.mark.parametrize("kernel", ["linear", "cubic"])
def test_upsampling_keeps_the_motion_in_world_units(kernel):
    constant = np.broadcast_to(np.float32([1.0, 2.0, 3.0]), (4, 5, 6, 3))
    fine = upsample(constant, (8, 15, 24), kernel)
    np.testing.assert_allclose(fine, np.broadcast_to([4.0, 6.0, 6.0], fine.shape), rtol=1e-6)


@pytest.mark.parametrize("kernel", ["linear", "cubic"])
def test_a_linear_flow_stays_linear_inside(kernel):
    coarse_flow, fine_flow = (analytic((n, n), flow="rotation", speed=1.0) for n in (8, 32))
    per_cell = coarse_flow[0, 4, 0] - coarse_flow[1, 4, 0]
    expected = fine_flow * (per_cell / (fine_flow[0, 4, 0] - fine_flow[1, 4, 0]))
    inner = (slice(8, -8), slice(8, -8))
    np.testing.assert_allclose(upsample(coarse_flow, (32, 32), kernel)[inner], expected[inner], atol=1e-5)


def test_cubic_leaves_no_kink():
    v = np.random.default_rng(1).normal(size=(12, 12, 2)).astype(np.float32)
    linear, cubic = (np.abs(np.diff(upsample(v, (384, 384), kernel)[..., 0], 2, axis=1)).max()
                     for kernel in ("linear", "cubic"))
    assert cubic < linear / 4


def test_upsampling_refusals():
    v = np.zeros((4, 4, 2), np.float32)
    with pytest.raises(ValueError, match="2 dimensions cannot fill"):
        upsample(v, (2, 8, 8))
    with pytest.raises(ValueError, match="neither linear nor cubic"):
        upsample(v, (8, 8), "nearest")
