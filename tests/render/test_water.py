"""Light under water: amount and position of sunlight."""

from typing import Any

import numpy as np
import pytest
from scipy import ndimage

from render import backend, water


def floor_under(sunlight: np.ndarray, pixels: int, extent: float) -> np.ndarray:
    """A white floor in sunlight only, from above: columns along x, rows along z, from -extent to extent."""
    mi: Any = backend.mitsuba("llvm_ad_rgb")
    white = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [1, 1, 1]}}
    transform = mi.ScalarTransform4f()
    above = transform.look_at(origin=[0, 5, 0], target=[0, 0, 0], up=[0, 0, -1])
    flat = transform.rotate([1, 0, 0], -90).scale([5, 5, 1])
    scene = mi.load_dict({
        "type": "scene", "sun": water.sun(mi, sunlight),
        "floor": {"type": "rectangle", "to_world": flat, "bsdf": white},
        "sensor": {"type": "orthographic", "to_world": above.scale([extent, extent, 1]),
                   "film": {"type": "hdrfilm", "width": pixels, "height": pixels, "rfilter": {"type": "box"},
                            "pixel_format": "rgb"}}})
    return np.array(mi.render(scene, integrator=mi.load_dict({"type": "direct"}), spp=16, seed=1))


def test_caustics_keep_the_mean_of_the_light() -> None:
    light = water.caustics(0.0, 1)
    assert light.shape == (water.CAUSTICS, water.CAUSTICS) and light.min() >= 0
    assert light.mean() == pytest.approx(1, abs=1e-4)
    assert light.max() > 4 and np.median(light) < 0.8  # bright lines, dim fields


def test_caustics_change_slowly_between_frames() -> None:
    first, next_frame, later = (water.caustics(t, 1).ravel() for t in (0.0, 1 / 30, 3.0))
    assert np.corrcoef(first, next_frame)[0, 1] > 0.7
    assert np.corrcoef(first, later)[0, 1] < 0.3
    assert np.array_equal(first, water.caustics(0.0, 1).ravel())


def test_the_sun_has_its_irradiance() -> None:
    """White, diffuse: radiance is irradiance · cosine / π."""
    cosine = -water.SUN[1] / np.linalg.norm(water.SUN)
    seen = floor_under(np.ones((64, 64), np.float32), 8, 1.0)
    expected = water.SUN_LIGHT * cosine / np.pi
    assert seen.mean(axis=(0, 1)) == pytest.approx(expected, rel=0.02)  # rays are not quite parallel


def test_caustics_lie_where_the_shafts_in_the_water_end() -> None:
    light = ndimage.gaussian_filter(water.caustics(0.0, 1), 3.0, mode="wrap")
    seen = floor_under(light, 48, 1.5)[..., 1]
    x, z = np.meshgrid(*[(np.arange(48) + 0.5) / 48 * 3 - 1.5] * 2)
    right, upward = water._across(water.SUN)
    places = np.stack([x, 0 * x, z], -1)
    column, row = (places @ right / water.LIT + 0.5, -(places @ upward) / water.LIT + 0.5)
    expected = ndimage.map_coordinates(light, np.array([row, column]) * water.CAUSTICS - 0.5, order=1)
    assert np.corrcoef(expected.ravel(), seen.ravel())[0, 1] > 0.97


def test_the_sand_stays_below_the_tips_and_about_zero() -> None:
    from synth.seaweed import CLEARANCE

    height = water.sand()[0][:, 1]
    assert height.max() < CLEARANCE and abs(height.mean()) < 0.002
