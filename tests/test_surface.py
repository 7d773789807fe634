"""Meshes, cameras and lamps as Mitsuba takes them."""

import numpy as np
import pytest

from render import backend, studio, surface


def test_normals_of_a_tent() -> None:
    """Two flat halves, and the mean of them along the ridge."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
    found = surface.normals(vertices, np.array([[0, 1, 2], [0, 2, 3]]))
    assert found[1] == pytest.approx([0, 0, 1]) and found[3] == pytest.approx([1, 0, 0])
    assert found[0] == pytest.approx([0.5**0.5, 0, 0.5**0.5]) and found[2] == pytest.approx(found[0])


def test_a_lamp_faces_its_target_with_its_radiance() -> None:
    mi = backend.mitsuba("llvm_ad_rgb")
    box = studio.Softbox((0.0, 2.0, 2.0), (0.0, 0.0, 0.0), (0.5, 0.8), (3.0, 2.0, 1.0), 1.0)
    camera = studio.Camera(position=(0.0, 0.0, 0.0), target=box.position, fov=5.0)
    scene = mi.load_dict({"type": "scene", "sensor": surface.sensor(mi, camera, 8, 4), "lamp": surface.lamp(mi, box)})
    seen = np.array(mi.render(scene, integrator=mi.load_dict({"type": "direct"}), spp=4, seed=1))
    assert seen.shape == (4, 8, 3)
    assert seen == pytest.approx(np.broadcast_to(np.array([3.0, 2.0, 1.0]), (4, 8, 3)))
