"""Seaweed under water: the sun's light is what it says, lands where it says, and the distance takes all of it."""

from typing import Any

import numpy as np
import pytest
from scipy import ndimage

from render import backend, seaweed, studio

LOOK = studio.Camera(position=(0.0, 0.5, 3.0), target=(0.0, 0.5, 0.0), fov=30.0)
SMALL = seaweed.Settings(width=32, height=24, spp=8, camera=LOOK)


def board(z: float, size: float = 0.3) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A white square that stands at z."""
    corners = np.array([[-1, 0, 0], [1, 0, 0], [1, 2, 0], [-1, 2, 0]], np.float32) * size + [0, 0.2, z]
    return corners.astype(np.float32), np.array([[0, 1, 2], [0, 2, 3]]), np.full((4, 3), 255, np.uint8)


def floor_under(sunlight: np.ndarray, pixels: int, reach: float) -> np.ndarray:
    """A white floor under the sun alone, from above: columns along x, rows along z, from -reach to reach."""
    mi: Any = backend.mitsuba("llvm_ad_rgb")
    white = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [1, 1, 1]}}
    turn = mi.ScalarTransform4f()
    scene = mi.load_dict({
        "type": "scene", "sun": seaweed._sun(mi, sunlight),
        "floor": {"type": "rectangle", "to_world": turn.rotate([1, 0, 0], -90).scale([5, 5, 1]), "bsdf": white},
        "sensor": {"type": "orthographic",
                   "to_world": turn.look_at(origin=[0, 5, 0], target=[0, 0, 0], up=[0, 0, -1]).scale([reach, reach, 1]),
                   "film": {"type": "hdrfilm", "width": pixels, "height": pixels, "rfilter": {"type": "box"},
                            "pixel_format": "rgb"}}})
    return np.array(mi.render(scene, integrator=mi.load_dict({"type": "direct"}), spp=16, seed=1))


def test_caustics_are_all_the_light_there_is() -> None:
    light = seaweed.caustics(0.0, 1)
    assert light.shape == (seaweed.CAUSTICS, seaweed.CAUSTICS) and light.min() >= 0
    assert light.mean() == pytest.approx(1, abs=1e-4)
    assert light.max() > 4 and np.median(light) < 0.8  # bright lines, dim fields


def test_caustics_flow_and_do_not_flicker() -> None:
    first, next_frame, later = (seaweed.caustics(t, 1).ravel() for t in (0.0, 1 / 30, 3.0))
    assert np.corrcoef(first, next_frame)[0, 1] > 0.7
    assert np.corrcoef(first, later)[0, 1] < 0.3
    assert np.array_equal(first, seaweed.caustics(0.0, 1).ravel())


def test_normals_of_a_tent() -> None:
    """Two flat halves, and the mean of them along the ridge."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
    found = seaweed.normals(vertices, np.array([[0, 1, 2], [0, 2, 3]]))
    assert found[1] == pytest.approx([0, 0, 1]) and found[3] == pytest.approx([1, 0, 0])
    assert found[0] == pytest.approx([0.5**0.5, 0, 0.5**0.5]) and found[2] == pytest.approx(found[0])


def test_the_sun_shines_as_brightly_as_it_says() -> None:
    """White, diffuse: radiance is irradiance · cosine / π."""
    cosine = -seaweed.SUN[1] / np.linalg.norm(seaweed.SUN)
    seen = floor_under(np.ones((64, 64), np.float32), 8, 1.0)
    assert seen.mean(axis=(0, 1)) == pytest.approx(seaweed.SUN_LIGHT * cosine / np.pi, rel=0.02)  # not quite parallel


def test_caustics_lie_where_the_shafts_in_the_water_end() -> None:
    light = ndimage.gaussian_filter(seaweed.caustics(0.0, 1), 3.0, mode="wrap")
    seen = floor_under(light, 48, 1.5)[..., 1]
    x, z = np.meshgrid(*[(np.arange(48) + 0.5) / 48 * 3 - 1.5] * 2)
    right, upward = seaweed._across(seaweed.SUN)
    places = np.stack([x, 0 * x, z], -1)
    column, row = (places @ right / seaweed.LIT + 0.5, -(places @ upward) / seaweed.LIT + 0.5)
    expected = ndimage.map_coordinates(light, np.array([row, column]) * seaweed.CAUSTICS - 0.5, order=1)
    assert np.corrcoef(expected.ravel(), seen.ravel())[0, 1] > 0.97


def test_the_sand_stays_below_the_tips_and_about_zero() -> None:
    from synth.blades import CLEARANCE

    height = seaweed.sand()[0][:, 1]
    assert height.max() < CLEARANCE and abs(height.mean()) < 0.002


def test_a_picture_repeats_and_the_distance_fades_into_the_water() -> None:
    near = seaweed.picture(*board(1.0), settings=SMALL)
    assert near.shape == (24, 32, 3) and np.isfinite(near).all() and near.min() >= 0
    assert np.array_equal(near, seaweed.picture(*board(1.0), settings=SMALL))
    nothing = seaweed.picture(*board(-60.0), settings=SMALL)
    far = seaweed.picture(*board(-20.0, 3.0), settings=SMALL)
    middle = np.s_[8:12, 14:18]
    assert np.abs(near[middle] - nothing[middle]).max() > 0.05
    # paths to another mesh draw other numbers, so pixels of few paths agree on average only
    assert far[middle].mean((0, 1)) == pytest.approx(nothing[middle].mean((0, 1)), rel=0.1)
    red, blue = (near[middle].mean((0, 1)) / nothing[middle].mean((0, 1)))[[0, 2]]
    assert red > blue  # the water is blue, the board is white
