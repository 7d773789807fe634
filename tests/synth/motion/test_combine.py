"""F = upsample(L) + omega H': term by term, weights of mean one, and the projection."""

import numpy as np
import pytest

from synth.motion.coarse import coarse, upsample
from synth.motion.combine import WEIGHTS, combine, weight_of
from synth.projection import divergence, project


def fields(seed=0, low=(6, 8), high=(18, 24)):
    rng = np.random.default_rng(seed)
    return (rng.normal(size=(*low, len(low))).astype(np.float32),
            rng.normal(size=(*high, len(high))).astype(np.float32))


@pytest.mark.parametrize("low, high", [((6, 8), (18, 24)), ((2, 3, 4), (4, 6, 8))])
def test_the_equation(low, high):
    L, H = fields(low=low, high=high)
    F = combine(L, H, 15.0)
    np.testing.assert_array_equal(F, upsample(L, high) + np.float32(15) * H)
    assert F.dtype == np.float32
    np.testing.assert_array_equal(combine(L, H, 0.0), upsample(L, high))


@pytest.mark.parametrize("weight", WEIGHTS)
@pytest.mark.parametrize("low, high", [((6, 8), (18, 24)), ((2, 3, 4), (4, 6, 8))])
def test_weights_have_mean_one_and_only_move_omega_about(weight, low, high):
    L, H = fields(low=low, high=high)
    w = weight_of(upsample(L, high), weight)
    assert w.mean() == pytest.approx(1.0, rel=1e-5) and w.min() >= 0
    F = combine(L, H, 3.0, weight)
    np.testing.assert_allclose(F, upsample(L, high) + 3 * w[..., None] * H, rtol=2e-5, atol=1e-5)
    np.testing.assert_allclose(weight_of(10 * L, weight), weight_of(L, weight), rtol=1e-4, atol=1e-6)


def test_weights_of_known_flows():
    shear = next(coarse("analytic", (8, 8), 1, flow="shear"))
    np.testing.assert_allclose(weight_of(shear, "vorticity"), 1.0, rtol=1e-5)
    energy = weight_of(shear, "kinetic-energy")
    np.testing.assert_allclose(energy[:, 0], np.arange(-3.5, 4) ** 2 / 5.25, rtol=1e-5)
    for weight in WEIGHTS:
        assert not weight_of(np.zeros((4, 4, 2), np.float32), weight).any()


def test_projection_of_f():
    L, H = fields()
    F = combine(L, H, 2.0, projection="wall")
    np.testing.assert_array_equal(F, project(combine(L, H, 2.0), "wall"))
    assert np.sqrt(np.mean(divergence(F, "wall") ** 2)) < 1e-5


def test_refusals():
    L, H = fields()
    with pytest.raises(ValueError, match="weight 'speed'"):
        combine(L, H, 1.0, "speed")
    with pytest.raises(ValueError, match="omega must be finite"):
        combine(L, H, np.nan)
    with pytest.raises(ValueError, match="border"):
        combine(L, H, 1.0, projection="clamp")
    with pytest.raises(ValueError, match=r"do not combine|cannot fill"):
        combine(L, H[..., :1], 1.0)
    with pytest.raises(ValueError, match="cannot fill"):
        combine(L, np.zeros((4, 4, 4, 3), np.float32), 1.0)
