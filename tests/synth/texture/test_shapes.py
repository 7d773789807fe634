"""Surfaces by procedure and fields on them: closed where they should be, turned outwards, of the size they say."""

import meshes
import numpy as np
import pytest

from synth.texture import shapes
from synth.texture.mesh import Mesh, dot, length

EDGE = 0.04


@pytest.mark.parametrize(("made", "border"), [(shapes.vase, 2), (shapes.torus, 0)])
def test_they_are_surfaces_with_even_triangles(made, border: int) -> None:
    of: Mesh = made(EDGE)
    assert (of.beside < 0).sum() % max(border, 1) == 0 and ((of.beside < 0).any() == (border > 0))
    edges = length(of.vertices[of.edges[:, 0]] - of.vertices[of.edges[:, 1]])
    assert edges.max() < 1.5 * EDGE
    assert np.median(edges) > 0.5 * EDGE
    assert np.abs(of.vertices[:, 1].min()) < 1e-9
    fine = made(EDGE / 2)
    assert 3.5 < len(fine.faces) / len(of.faces) < 4.5


def test_the_torus_has_its_area_and_faces_outwards() -> None:
    of = shapes.torus(0.02)
    np.testing.assert_allclose(of.areas.sum(), 4 * np.pi**2 * shapes.RING * shapes.TUBE, rtol=5e-3)
    flat = np.stack([of.vertices[:, 0], 0 * of.vertices[:, 0], of.vertices[:, 2]], axis=-1)
    middle = flat / length(flat)[:, None] * shapes.RING + [0, shapes.TUBE, 0]
    assert (dot(of.normals, of.vertices - middle) > 0.99 * shapes.TUBE).all()


def test_the_vase_faces_outwards_on_its_belly_and_inwards_in_its_neck() -> None:
    of = shapes.vase(EDGE)
    radius = np.hypot(of.vertices[:, 0], of.vertices[:, 2])
    out = (of.normals[:, 0] * of.vertices[:, 0] + of.normals[:, 2] * of.vertices[:, 2]) / radius
    height = of.vertices[:, 1]
    assert (out[(height > 0.2) & (height < 0.6)] > 0.5).all()
    neck = (height > 0.87) & (height < 0.93)
    assert set(np.sign(out[neck])) == {-1, 1}
    np.testing.assert_array_less(out[neck & (radius < 0.121)], 0)


def test_round_an_axis_points_of_one_radius_are_equally_fast() -> None:
    of = shapes.torus(EDGE)
    v = shapes.around(of, np.array([0, 2.0, 0]), 0.5)
    radius = np.hypot(of.vertices[:, 0], of.vertices[:, 2])
    np.testing.assert_allclose(np.hypot(v[:, 0], v[:, 2]), radius, rtol=2e-3)  # the box of a polygon
    np.testing.assert_allclose(v[:, 1], 0.5, rtol=1e-2)  # longest side: about 1
    assert (np.cross(of.vertices, v)[:, 1] > 0).all()  # counter-clockwise from above


def test_the_tangent_part_lies_in_the_surface() -> None:
    of = meshes.sphere(3)
    v = shapes.tangent(of, np.broadcast_to([0, 0, 3.0], of.vertices.shape))
    np.testing.assert_allclose(dot(v, of.normals), 0, atol=1e-12)
    poles = np.abs(of.vertices[:, 2]) > 1 - 1e-9
    assert poles.sum() == 2 and not v[poles].any() and v[~poles].any(axis=1).all()


@pytest.mark.parametrize(("field", "told"), [
    (np.zeros((3, 3)), "has 3 vectors for 221 vertices"),
    (np.full((221, 3), np.nan), "holds NaN or infinity"),
    (np.zeros((221, 3)), "is zero everywhere"),
    (np.broadcast_to([0, 0, 2.0], (221, 3)), "is normal to the surface everywhere"),
])
def test_a_field_that_leads_nowhere_is_told(field: np.ndarray, told: str) -> None:
    with pytest.raises(ValueError, match=told):
        shapes.tangent(meshes.square(), field)


def test_speeds_are_scaled_to_the_largest_and_lifted_to_the_least() -> None:
    v = np.array([[0, 0, 0], [1.0, 0, 0], [0, 4, 0], [0, 0, 10]])
    np.testing.assert_allclose(length(shapes.paced(v, 0.3, 2.0)), [0, 0.3, 0.8, 2.0])
    np.testing.assert_allclose(length(shapes.paced(v, 1.5, 1.5)), [0, 1.5, 1.5, 1.5])
