"""Noodles on a plate: bits repeat, the plate is below the noodles, and dough is translucent."""

import numpy as np
import pytest

from render import backend, mitsuba_shapes, noodles, studio
from synth.elements import mesh

SMALL = studio.Shot(width=64, height=36, spp=9)


def rods(count: int = 12) -> mesh.Mesh:
    """A grate of straight noodles on the plate."""
    x = np.linspace(-0.4, 0.4, count)
    ends = np.stack([np.stack([x, np.full(count, 0.03), np.full(count, z)], 1) for z in (-0.4, 0.0, 0.4)], 1)
    return mesh.tubes(ends, np.full(count, 0.025), np.tile([0.96, 0.80, 0.48], (count, 1)))


def test_a_picture_repeats() -> None:
    m = rods()
    first = noodles.picture(m.vertices, m.faces, m.colours, SMALL)
    assert first.shape == (36, 64, 3) and np.isfinite(first).all() and first.min() >= 0
    assert np.array_equal(first, noodles.picture(m.vertices, m.faces, m.colours, SMALL))
    heap = first[14:20, 26:38].mean((0, 1))
    assert heap[0] > heap[1] > heap[2]  # golden
    table = noodles.picture(m.vertices, m.faces, m.colours, SMALL, plate=0.0)
    assert table[22:26, 10:16].mean() < 0.5 * first[22:26, 10:16].mean()  # the plate is light, the table dark


def test_an_inset_does_not_depend_on_where_the_exemplar_is() -> None:
    m = rods()
    low, high = m.vertices.min(0), m.vertices.max(0)
    first = noodles.inset(m.vertices, m.faces, m.colours, low, high, SMALL)
    moved = noodles.inset(7 * m.vertices + 3, m.faces, m.colours, 7 * low + 3, 7 * high + 3, SMALL)
    assert first.mean((0, 1)) == pytest.approx(moved.mean((0, 1)), rel=0.01)


def test_a_view_shows_the_whole_plate() -> None:
    camera, radius = noodles.view(np.array([-0.2, 0.0, -0.1]), np.array([0.3, 0.9, 0.2]), 16 / 9)
    assert radius == pytest.approx(noodles.MARGIN * 0.3)
    m = rods()
    shot = studio.Shot(64, 36, 9, camera=camera)
    hidden = m.vertices - 50, m.faces, m.colours
    seen, bare = (noodles.picture(*hidden, shot, plate) for plate in (radius, 0.0))
    dish = seen.mean(-1) > 2.5 * bare.mean(-1)
    assert dish.any() and not (dish[0] | dish[-1]).any() and not (dish[:, 0] | dish[:, -1]).any()


def test_the_plate_is_closed_below_flat_where_noodles_lie_and_above_the_table() -> None:
    made = noodles.plate_mesh(0.8)
    radius = np.linalg.norm(made.vertices[:, [0, 2]], axis=1)
    assert radius.max() == pytest.approx(0.8, rel=0.01)
    well = mitsuba_shapes.normals(made.vertices, made.faces)[radius < 0.3, 1]
    assert made.vertices[:, 1].min() >= noodles.TABLE_LEVEL - 1e-6
    assert made.vertices[radius < 0.3, 1].max() == pytest.approx(0, abs=1e-6)
    assert well.max() > 0.99 and well.min() < -0.99


def test_light_comes_through_dough() -> None:
    """A wall between the camera and a lamp is not black."""
    mi = backend.mitsuba("llvm_ad_rgb")
    wall = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    camera = studio.Camera(position=(0.0, 0.0, 5.0), target=(0.0, 0.0, 0.0), fov=8.0)
    lamp = studio.Softbox((0.0, 0.0, -3.0), (0.0, 0.0, 0.0), (1.0, 1.0), (9.0, 9.0, 9.0), 1.0)
    colours = np.full((4, 3), [0.9, 0.7, 0.3])
    scene = {"sensor": mitsuba_shapes.sensor(mi, camera, 8, 8), "lamp": mitsuba_shapes.lamp(mi, lamp),
             "wall": mitsuba_shapes.shape(mi, "wall", wall, faces, colours, noodles.dough())}
    path = mi.load_dict({"type": "path", "max_depth": 3})
    seen = mitsuba_shapes.rendered(mi, scene, path, studio.Shot())
    red, green, blue = seen.mean((0, 1))
    assert red > green > blue > 0.01
