"""render.denoise: marches and fits whose result is known, and the noise that a real render loses."""

import numpy as np
import pytest

from render import denoise, sheet, smoke, studio
from render.denoise import Grid


def noise(*shape: int, seed: int = 1) -> np.ndarray:
    return np.random.Generator(np.random.Philox(key=seed)).standard_normal(shape)


@pytest.mark.parametrize("axes", [(0, 1, 2), (1, 0, 2), (2, 1, 0), (1, 2, 0)])
def test_depth_grows_linearly_towards_each_side(axes: tuple[int, int, int]) -> None:
    """In uniform smoke of 0.1 per cell: a tenth per cell, whichever axis the light is on."""
    sigma = np.full((6, 6, 6), 0.1, np.float32)
    for sign in (1.0, -1.0):
        towards = [0.0, 0.0, 0.0]
        towards[2 - axes[0]] = sign
        depth = np.moveaxis(denoise.depth_towards(sigma, (towards[0], towards[1], towards[2])), axes[0], 0)
        expected = 0.1 * np.arange(6)[::-1] if sign > 0 else 0.1 * np.arange(6)
        assert depth[:, 3, 3] == pytest.approx(expected, abs=1e-6)


def test_depth_of_a_sheet_is_that_of_the_flat_smoke() -> None:
    """Light in the plane of a flat field: the same numbers as `sheet.depth_towards`."""
    flat = np.abs(noise(12, 14)).astype(np.float32)
    depth = denoise.depth_towards(np.repeat(flat[None], 3, axis=0), (0.6, 0.8, 0.0))
    assert depth[1] == pytest.approx(sheet.depth_towards(flat, (0.6, 0.8)), rel=1e-4, abs=1e-4)


def slab(cells: int = 8) -> Grid:
    """Extinction 2 per world unit, cells of 0.25, cell (0, 0, 0) at (-1, -1, -1)."""
    return Grid(np.full((cells, cells, cells), 0.5, np.float32), 0.25, np.array([-1.0, -1.0, -1.0]))


def test_march_is_beer_lambert_straight_and_aslant() -> None:
    """Rays through the middle: exp(-2 * 8 cells * 0.25), aslant the longer way."""
    rays = np.array([[0.0, 0.0, -1.0], [0.1, 0.0, -1.0], [0.0, 0.0, -3.0]])
    start = np.array([[-0.1, -0.1, 5.0], [-0.6, -0.1, 5.0], [-0.1, -0.1, 5.0]])
    passed = denoise.march(slab(), start, rays, np.full(3, 100.0))[:, 0]
    assert passed == pytest.approx(np.exp([-4.0, -4.0 * np.hypot(1.0, 0.1), -4.0]), rel=1e-5)


def test_march_ends_at_surfaces_begins_at_its_start_and_misses_what_it_misses() -> None:
    rays = np.array([[0.0, 0.0, -1.0]] * 3)
    start = np.array([[0.0, 0.0, 5.0], [0.0, 0.0, 0.1], [3.0, 0.0, 5.0]])
    passed = denoise.march(slab(), start, rays, np.array([5.1, 100.0, 100.0]))[:, 0]
    assert passed == pytest.approx(np.exp([-4 * 0.5, -5 * 0.5, 0.0]), rel=1e-5)


def test_march_sees_each_light_by_its_share_in_front() -> None:
    """A light of 1 everywhere is seen by what absorbs, 1 - passed; one far off, dimmed."""
    far = np.zeros((8, 8, 8), np.float32)
    far[:4] = 1.0  # small z: far from an eye at z = 5
    seen = denoise.march(slab(), np.array([[0.0, 0.0, 5.0]]), np.array([[0.0, 0.0, -1.0]]), np.array([100.0]),
                         (np.ones_like(far), far))[0]
    assert seen == pytest.approx([np.exp(-4.0), 1.0 - np.exp(-4.0), np.exp(-2.0) - np.exp(-4.0)], rel=1e-4)


def test_rays_of_the_view_go_where_the_camera_looks() -> None:
    camera = studio.Camera(position=(0.0, 0.0, 4.0), target=(0.0, 0.0, 0.0), fov=90.0)
    position, rays = denoise.view_rays(camera, 4, 2)
    assert position.tolist() == [0.0, 0.0, 4.0]
    assert rays[0, 0] == pytest.approx([-1.5, 0.5, -1.0])  # top row first, left first
    assert rays[1, 3] == pytest.approx([1.5, -0.5, -1.0])


def test_what_is_linear_in_the_guides_stays_as_it_is() -> None:
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
    truth = smoke.volume(*placed, smoke.VolumeSettings(**{**vars(few), "spp": 96, "seed": 1000}))
    raw = smoke.volume(*placed, few)
    clean = smoke.volume(*placed, smoke.VolumeSettings(**{**vars(few), "denoised": True}))

    def error(picture: np.ndarray) -> float:
        return float(np.sqrt(((picture - truth) ** 2).mean()))

    assert error(clean) < error(raw) / 3
    assert clean.mean() == pytest.approx(truth.mean(), rel=0.03)
    assert np.array_equal(clean, smoke.volume(*placed, smoke.VolumeSettings(**{**vars(few), "denoised": True})))
