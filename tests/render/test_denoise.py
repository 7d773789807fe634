"""render.denoise: fits whose result is known, and the noise that a real render loses."""

from dataclasses import replace

import numpy as np
import pytest

from render import denoise, march, smoke


def noise(*shape: int, seed: int = 1) -> np.ndarray:
    return np.random.Generator(np.random.Philox(key=seed)).standard_normal(shape)


def test_guides_hold_the_visible_studio_and_its_shadows() -> None:
    """No smoke: the guides are the empty studio; half seen and half in shadow: a half and a quarter of it."""
    layers = np.abs(noise(3, 2, 4, 3))
    empty = march.EmptyStudio(np.zeros(3), np.ones((2, 4, 3)), np.ones((2, 4)), layers, np.zeros((6, 4, 3)))
    clear = denoise.guides(march.Seen(np.zeros((2, 4, 3)), np.ones((2, 4)), np.ones((2, 2, 4))), empty)
    assert clear.shape == (2, 4, 9) and clear.dtype == np.float32
    assert clear[..., 4:7] == pytest.approx(layers.sum(axis=0), rel=1e-6)
    assert clear[..., 7] == pytest.approx(layers.sum(axis=0).mean(axis=-1), rel=1e-6)
    halved = march.Seen(np.ones((2, 4, 3)), np.full((2, 4), 0.5), np.full((2, 2, 4), 0.5))
    half = denoise.guides(halved, empty)
    assert half[..., 0] == pytest.approx(0.5) and half[..., 1:4] == pytest.approx(1.0)
    assert half[..., 4:7] == pytest.approx(0.5 * clear[..., 4:7])
    assert half[..., 7:] == pytest.approx(0.25 * clear[..., 7:])


def test_a_linear_function_of_the_guides_is_kept() -> None:
    guides = noise(20, 24, 3)
    exact = 5.0 + guides @ np.array([[1.0, 0.2, 0.0], [0.0, 0.3, 1.0], [0.5, 0.0, 0.1]])
    assert denoise.regressed(exact, guides, 3.0) == pytest.approx(exact, abs=1e-4)


def test_noise_goes_and_the_edges_of_the_guides_stay() -> None:
    """A hard edge under noise: less than a sixth of the noise is left, and the edge is one pixel wide."""
    edge = np.zeros((60, 60, 1))
    edge[:, 30:] = 1.0
    clean = 1.0 + edge * [0.5, 1.0, 2.0]
    fitted = denoise.regressed(clean + 0.2 * noise(60, 60, 3), edge, 6.0)
    assert np.sqrt(((fitted - clean) ** 2).mean()) < 0.2 / 6
    assert (fitted[:, 30] - fitted[:, 29])[5:-5, 2].min() > 1.8


def test_a_slope_that_differs_from_place_to_place_is_followed() -> None:
    """What one fit for the whole picture cannot say: brighter on the left, darker on the right."""
    guide = np.sin(np.arange(120) * 1.3)[None, :, None] * np.ones((80, 1, 1))
    sign = np.where(np.arange(120) < 60, 1.0, -1.0)[None, :, None]
    clean = 4.0 + sign * guide * np.ones(3)
    fitted = denoise.regressed(clean + 0.3 * noise(80, 120, 3), guide, 6.0)
    assert np.abs(fitted - clean)[:, np.r_[0:40, 80:120]].mean() < 0.08


def test_nothing_gets_darker_than_black() -> None:
    assert denoise.regressed(noise(16, 16, 3), noise(16, 16, 2, seed=2), 3.0).min() >= 0.0


def test_a_render_of_two_paths_comes_near_one_of_many() -> None:
    """The studio with a cloud in a bowl: the error falls to a third."""
    z, y, x = np.mgrid[-1:1:12j, -1:1:24j, -1:1:16j]
    cloud = np.clip(1.2 - np.hypot(np.hypot(x, y), z) + 0.3 * np.sin(7 * x) * np.cos(6 * y), 0.0, 1.0)
    placed = (cloud.astype(np.float32), 0.035, (-0.26, 0.1, -0.2))
    few = smoke.VolumeSettings(width=56, height=70, spp=2, extinction=30.0, bowl=(0.2, 0.1), denoised=False)
    truth = smoke.volume(*placed, replace(few, spp=96, seed=1000))
    raw = smoke.volume(*placed, few)
    denoised = replace(few, denoised=True)
    clean = smoke.volume(*placed, denoised)

    def error(picture: np.ndarray) -> float:
        return float(np.sqrt(((picture - truth) ** 2).mean()))

    assert error(clean) < error(raw) / 3
    assert clean.mean() == pytest.approx(truth.mean(), rel=0.03)
    assert np.array_equal(clean, smoke.volume(*placed, denoised))
