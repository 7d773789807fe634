"""The wake of Bridson 2007: what flows past the stone, far from it and behind it."""

import numpy as np
import pytest

from synth.motion.coarse import coarse
from synth.wake import potential, ramp, smooth_step, velocity, wake

SETTINGS = {"seed": 1, "centre": (1 / 30, 0.5), "radius": 0.12, "flow": -0.25, "influence": 0.25, "expansion": 0.3,
                "lengths": (0.1, 0.06, 0.026), "gains": (0.03, 0.0105, 0.003)}


def on_disc(count=720):
    """Points x, y of the disc and its normals."""
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    normal = np.stack([np.cos(angle), np.sin(angle)], -1)
    return SETTINGS["centre"][0] + 0.12 * normal[:, 0], 0.5 + 0.12 * normal[:, 1], normal


def test_the_ramps():
    r = np.linspace(-2, 2, 401)
    assert ramp(np.array([-1.0, 0, 1])).tolist() == [-1, 0, 1] and smooth_step(np.array([0.0, 0.5, 1])).tolist() == [
        0, 0.5, 1]
    for f in (ramp, smooth_step):
        assert (np.diff(f(r)) >= 0).all()
        assert np.abs(np.diff(f(r), 2)).max() < 0.02**2 / 4 * 10  # no kinks


@pytest.mark.parametrize("time", [0.0, 0.37, 2.1])
def test_nothing_flows_through_the_disc(time):
    """Measured on Bridson's own program: 7.1e-5."""
    x, y, normal = on_disc()
    assert np.abs(potential(x, y, time, **SETTINGS)).max() < 1e-12
    assert np.abs(np.sum(velocity(x, y, time, **SETTINGS) * normal, -1)).max() < 1e-4


def test_far_upstream_the_river_flows_as_it_does():
    """Measured on Bridson's own program: -0.250004."""
    y = np.linspace(0.05, 0.95, 50)
    far = velocity(np.full(50, 0.6), y, 0.0, **SETTINGS)
    np.testing.assert_allclose(far, np.broadcast_to([-0.25, 0.0], (50, 2)), atol=1e-6)


def test_the_turbulence_is_behind_the_stone_and_changes_with_time():
    y, x = np.meshgrid(np.linspace(0.05, 0.95, 60), np.linspace(-0.6, 0.6, 80), indexing="ij")
    calm = velocity(x, y, 0.0, **{**SETTINGS, "gains": (0, 0, 0)})
    rough = np.linalg.norm(velocity(x, y, 0.3, **SETTINGS) - calm, axis=-1)
    assert rough[x > 1 / 30 + 0.121].max() == 0  # upstream of the stone
    assert rough[(x < -0.1) & (np.abs(y - 0.5) < 0.1)].mean() > 0.05
    later = velocity(x, y, 0.8, **SETTINGS) - calm
    assert np.linalg.norm(later, axis=-1).max() > 0.05 and not np.allclose(later, rough[..., None], atol=0.01)


def test_it_flows_the_other_way_round():
    """Turned by half a turn about the disc, the background flow is that of the other sign."""
    away = np.random.Generator(np.random.Philox(key=1)).uniform(-0.4, 0.4, (2, 50))
    calm = {**SETTINGS, "gains": (0, 0, 0), "centre": (0, 0)}
    there = velocity(away[0], away[1], 0.0, **calm)
    back = velocity(-away[0], -away[1], 0.0, **{**calm, "flow": 0.25})
    np.testing.assert_allclose(back, -there, atol=1e-9)


def test_a_frame_is_in_cells_and_free_of_divergence():
    (frame,) = coarse("wake", (75, 100), 1, seed=1, gains=(0.03,), lengths=(0.1,))
    assert frame.shape == (75, 100, 2) and frame.dtype == np.float32
    assert frame[3, -2, 0] == pytest.approx(-0.25 * 0.04 * 75, rel=1e-4)
    slope = [np.gradient(frame[..., c], axis=1 - c) for c in (0, 1)]
    assert np.abs(sum(slope))[2:-2, 2:-2].mean() < 0.02 * np.abs(slope[0]).max()


def test_frames_repeat_and_the_seed_decides():
    one, two = (list(wake((30, 40), 2, seed=3)) for _ in range(2))
    assert all(np.array_equal(a, b) for a, b in zip(one, two, strict=True))
    assert not np.array_equal(one[0], one[1])
    assert not np.array_equal(one[0], next(wake((30, 40), 1, seed=4)))


def test_bad_settings():
    with pytest.raises(ValueError, match="of the plane"):
        next(wake((4, 30, 40), 1, seed=1))
    with pytest.raises(ValueError, match="3 lengths and 2 gains"):
        next(wake((30, 40), 1, seed=1, gains=(0.1, 0.1)))
