"""Meshes, cameras and lights as Mitsuba takes them."""

from typing import Any

import numpy as np
import pytest

from render import backend, mitsuba_shapes, studio


def test_normals_of_a_tent() -> None:
    """Two flat halves, and their mean along the ridge."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
    found = mitsuba_shapes.normals(vertices, np.array([[0, 1, 2], [0, 2, 3]]))
    assert found[1] == pytest.approx([0, 0, 1]) and found[3] == pytest.approx([1, 0, 0])
    assert found[0] == pytest.approx([0.5**0.5, 0, 0.5**0.5]) and found[2] == pytest.approx(found[0])


def test_a_lamp_faces_its_target_with_its_radiance() -> None:
    mi = backend.mitsuba("llvm_ad_rgb")
    box = studio.Softbox((0.0, 2.0, 2.0), (0.0, 0.0, 0.0), (0.5, 0.8), (3.0, 2.0, 1.0), 1.0)
    camera = studio.Camera(position=(0.0, 0.0, 0.0), target=box.position, fov=5.0)
    scene = mi.load_dict({"type": "scene", "sensor": mitsuba_shapes.sensor(mi, camera, 8, 4),
                          "lamp": mitsuba_shapes.lamp(mi, box)})
    seen = np.array(mi.render(scene, integrator=mi.load_dict({"type": "direct"}), spp=4, seed=1))
    assert seen.shape == (4, 8, 3)
    assert seen == pytest.approx(np.broadcast_to(np.array([3.0, 2.0, 1.0]), (4, 8, 3)))


def test_an_overhead_camera_sees_one_unit_of_y() -> None:
    """A grey square that fills the left half of a picture twice as wide as high."""
    mi = backend.mitsuba("llvm_ad_rgb")
    corners = np.array([[-1, 0, 0], [0, 0, 0], [0, 1, 0], [-1, 1, 0]], np.float32)
    square = studio.Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.uint32))
    grey = mitsuba_shapes.matte((0.5, 0.5, 0.5))
    scene = {"sensor": mitsuba_shapes.overhead(mi, 0.5, 8, 4, 2.0),
             "sky": mitsuba_shapes.sky((1.0, 1.0, 1.0)),
             "square": mitsuba_shapes.plain(mi, "square", square, grey)}
    seen = mitsuba_shapes.rendered(mi, scene, mitsuba_shapes.every_lamp(mi, 1), studio.Shot(8, 4, spp=4))
    assert seen[:, :4] == pytest.approx(0.5, rel=1e-5) and seen[:, 4:] == pytest.approx(1.0)


def room(mi: Any, *, lamps: bool, glossy: bool = False) -> Any:
    """A ball in constant light, over a floor if there are lamps."""
    camera = studio.Camera(position=(0.0, 1.0, 6.0), target=(0.0, 0.0, 0.0), fov=30.0)
    grey = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.5, 0.5, 0.5]}}
    coat = {"type": "principled", "base_color": {"type": "rgb", "value": [0.5, 0.3, 0.2]}, "roughness": 0.3}
    scene = {"type": "scene", "sensor": mitsuba_shapes.sensor(mi, camera, 24, 24),
             "air": {"type": "constant", "radiance": {"type": "rgb", "value": [0.5, 0.5, 0.5]}},
             "ball": {"type": "sphere", "bsdf": coat if glossy else grey}}
    if lamps:
        down = mi.ScalarTransform4f().translate([0, -1, 0])
        key = studio.Softbox((3.0, 3.0, 2.0), (0, 0, 0), (1.0, 1.0), (9.0, 7.0, 5.0), 1.0)
        fill = studio.Softbox((-3.0, 2.0, 2.0), (0, 0, 0), (2.0, 2.0), (1.0, 2.0, 3.0), 1.0)
        scene |= {
            "key": mitsuba_shapes.lamp(mi, key), "fill": mitsuba_shapes.lamp(mi, fill),
            "floor": {"type": "rectangle", "bsdf": grey,
                      "to_world": down.rotate([1, 0, 0], -90).scale(3)}}
    return mi.load_dict(scene)


def test_a_ball_in_constant_light_reflects_its_albedo() -> None:
    mi = backend.mitsuba("llvm_ad_rgb")
    integrator = mitsuba_shapes.every_lamp(mi, 2)
    seen = np.array(mi.render(room(mi, lamps=False), integrator=integrator, spp=16, seed=1))
    assert seen[12, 12] == pytest.approx([0.25, 0.25, 0.25], rel=1e-5)
    assert seen[0, 0] == pytest.approx([0.5, 0.5, 0.5], rel=1e-5)


@pytest.mark.parametrize("split", [1, 2])
def test_every_lamp_agrees_with_the_path_tracer_and_has_less_noise(split: int) -> None:
    mi = backend.mitsuba("llvm_ad_rgb")
    scene = room(mi, lamps=True, glossy=True)
    path = mi.load_dict({"type": "path", "max_depth": 4, "rr_depth": 9})  # two indirect bounces
    truth = np.array(mi.render(scene, integrator=path, spp=1024, seed=9))
    one_lamp = np.array(mi.render(scene, integrator=path, spp=16, seed=1))
    all_lamps = np.array(mi.render(scene, integrator=mitsuba_shapes.every_lamp(mi, 2, split), spp=16, seed=1))
    assert all_lamps.mean((0, 1)) == pytest.approx(truth.mean((0, 1)), rel=0.01)
    # only 0.9: the noise along edges is the same in both
    assert ((all_lamps - truth) ** 2).mean() < 0.9 * ((one_lamp - truth) ** 2).mean()
