"""Meshes: what is refused, topology, fields on them, and motion over them with known ends."""

import meshes
import numpy as np
import pytest

from synth.texture.mesh import Mesh, aligned, continued, length, mesh, refined, turning, unit, walked

SQUARE = meshes.square()
TRIANGLE = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
CORNERS = np.concatenate([TRIANGLE, [[1.0, 1, 0], [1, 1, 1]]])


def start(of: Mesh, count: int = 200, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    return random.integers(len(of.faces), size=count), random.dirichlet([1, 1, 1], count)


@pytest.mark.parametrize(("vertices", "faces", "told"), [
    (CORNERS, np.zeros((0, 3), int), r"triangles \(F, 3\)"),
    (CORNERS * [np.nan, 1, 1], [[0, 1, 2]], "NaN or infinity"),
    (CORNERS, [[0, 1, 5]], r"does not exist \(0 to 4\)"),
    (CORNERS, [[0, 1, 2], [1, 1, 2]], "1 triangles have no area, the first is number 1"),
    (CORNERS * [1, 0, 0], [[0, 1, 2]], "no area"),
    (CORNERS, [[0, 1, 2], [2, 1, 3], [2, 1, 4]], r"an edge at \(0.5, 0.5, 0\) has 3 triangles"),
    (CORNERS, [[0, 1, 2], [1, 2, 3]], r"at \(0.5, 0.5, 0\) are turned different ways round"),
])
def test_what_is_no_surface_is_told(vertices: np.ndarray, faces: object, told: str) -> None:
    with pytest.raises(ValueError, match=told):
        mesh(vertices, np.array(faces))


def test_vertices_of_no_triangle_are_left_out() -> None:
    one = mesh(CORNERS, np.array([[4, 3, 1]]))
    np.testing.assert_array_equal(one.vertices, CORNERS[[1, 3, 4]])
    np.testing.assert_array_equal(one.faces, [[2, 1, 0]])


def test_neighbours_lie_across_the_edge_that_a_corner_does_not_touch() -> None:
    for of in (SQUARE, meshes.cylinder(1, 2, 11, 5), meshes.sphere(2)):
        border = 0
        for face, row in enumerate(of.beside):
            for corner, other in enumerate(row):
                edge = set(np.delete(of.faces[face], corner))
                border += other < 0
                assert other < 0 or len(edge & set(of.faces[other])) == 2
        assert border == {len(SQUARE.faces): 2 * (12 + 16), 110: 22}.get(len(of.faces), 0)


def test_slopes_are_the_gradients_of_barycentric_coordinates() -> None:
    of = meshes.sphere(2)
    along = (of.slopes[:, :, None] * (np.roll(of.corners, -1, axis=1) - of.corners)[:, None]).sum(axis=-1)
    # from corner k to the next its coordinate falls by 1 and the next one's grows by 1
    np.testing.assert_allclose(along, np.broadcast_to([[-1, 0, 1], [1, -1, 0], [0, 1, -1]], along.shape), atol=1e-12)


def test_a_sphere_of_radius_2_is_curved_by_a_quarter_and_a_cylinder_is_not() -> None:
    ball = meshes.sphere(4)
    doubled = Mesh(2 * ball.vertices, ball.faces, ball.normals)
    np.testing.assert_allclose(doubled.curvature, 0.25, rtol=0.07)  # angles at vertices of 4 and 6 triangles differ
    assert meshes.cylinder(1, 2, 24, 12).curvature.max() < 1e-12


def test_the_shortest_rotation_takes_one_normal_to_the_other() -> None:
    random = np.random.default_rng(2)
    a, b, v = (unit(random.normal(size=(50, 3))) for _ in range(3))
    b = unit(a + 0.9 * b)  # not opposite
    np.testing.assert_allclose(aligned(a, a, b), b, atol=1e-12)
    np.testing.assert_allclose(length(aligned(v, a, b)), 1, atol=1e-12)
    axis = np.cross(a, b)
    np.testing.assert_allclose(aligned(axis, a, b), axis, atol=1e-12)


def test_refining_keeps_the_surface_and_halves_long_edges() -> None:
    coarse = meshes.cylinder(1, 5, 7, 2)
    fine, values = refined(coarse, coarse.vertices.copy(), 0.4)
    assert fine.longest <= 0.4 < coarse.longest
    np.testing.assert_allclose(fine.areas.sum(), coarse.areas.sum())
    np.testing.assert_allclose(values, fine.vertices, atol=1e-12)
    again = mesh(fine.vertices, fine.faces)  # a surface still: no edge has a vertex in its middle
    assert (again.beside < 0).sum() == (length(fine.vertices[:, [0, 2]] @ np.eye(2, 3)) > 0)[
        np.isin(fine.vertices[:, 1], [0, 5])].sum()


def test_a_field_that_rests_somewhere_is_continued_there() -> None:
    v = np.broadcast_to([2.0, 1.0, 5.0], SQUARE.vertices.shape).copy()
    v[np.hypot(*(SQUARE.vertices[:, :2] - [8, 6]).T) < 3] = 0
    expected = np.array([2.0, 1.0, 0.0]) / np.sqrt(5)
    np.testing.assert_allclose(continued(SQUARE, v), np.broadcast_to(expected, v.shape), atol=1e-12)
    assert not continued(SQUARE, 0 * v).any()


def test_the_angle_of_a_rotation_turns_by_one_over_the_radius() -> None:
    of = meshes.square(40, 40)
    offset = of.vertices - [20, 20, 0]
    facing = unit(np.cross([0, 0, 1.0], offset))
    away = length(offset)
    inside = (away > 6) & (np.abs(offset[:, :2]).max(axis=1) < 19)
    gradient = turning(of, facing)
    t, n = facing, np.cross([0, 0, 1.0], facing)
    np.testing.assert_allclose((gradient * t).sum(axis=1)[inside], 1 / away[inside], rtol=0.02)
    np.testing.assert_allclose((gradient * n).sum(axis=1)[inside], 0, atol=2e-3)


def test_no_field_moves_nothing() -> None:
    face, place = start(SQUARE)
    after = walked(SQUARE, np.zeros_like(SQUARE.vertices), face, place)
    for one, other in zip(after, (face, place, np.zeros(len(face), bool)), strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("step", [(0.3, 0.1), (2.5, -1.0), (1.0, 0.0), (-3.0, -3.0)])
def test_a_uniform_field_shifts_places_on_a_plane(step: tuple[float, float]) -> None:
    face, place = start(SQUARE)
    # on vertices and edges too
    place[:20], place[20:40, 0] = [0, 1, 0], 0
    place /= place.sum(axis=1)[:, None]
    before = SQUARE.at(SQUARE.vertices, face, place)
    v = np.broadcast_to([*step, 0.7], SQUARE.vertices.shape)
    to, where, left = walked(SQUARE, v, face, place)
    wanted = before + np.array([*step, 0])
    inside = ((wanted[:, :2] > 0) & (wanted[:, :2] < [16, 12])).all(axis=1)
    assert 20 < inside.sum() < len(face)
    np.testing.assert_allclose(SQUARE.at(SQUARE.vertices, to, where)[inside], wanted[inside], atol=1e-9)
    np.testing.assert_array_equal(left[inside], False)
    outside = ((wanted[:, :2] < -1e-9) | (wanted[:, :2] > np.array([16, 12]) + 1e-9)).any(axis=1)
    assert left[outside].all()


@pytest.mark.parametrize(("of", "tolerance"), [(meshes.cylinder(1, 2, 48, 12), 1e-6), (meshes.sphere(4), 2e-3)],
                         ids=["cylinder", "sphere"])
def test_a_full_turn_returns_every_place(of: Mesh, tolerance: float) -> None:
    """The field of a vertex is as fast as the smooth surface is; in the middle of an edge it is cos(π/48) as fast, and
    the way is as much shorter."""
    face, place = start(of, 100)
    before = of.at(of.vertices, face, place)
    v = meshes.turning(of, 2 * np.pi / 100)
    for _ in range(100):
        face, place, left = walked(of, v, face, place)
        assert not left.any()
    away = of.at(of.vertices, face, place) - before
    radius = np.hypot(before[:, 0], before[:, 2])
    along = np.stack([-before[:, 2], 0 * radius, -before[:, 0]], -1) / radius[:, None]
    assert np.abs((away * along).sum(axis=1)).max() < 2 * np.pi * 3e-3
    across = away - (away * along).sum(axis=1)[:, None] * along
    assert np.abs(across[:, 1]).max() < tolerance


def test_a_field_that_leads_onto_an_edge_from_both_sides_goes_on_along_it() -> None:
    of = mesh(np.array([[0.0, 0, 0], [4, 0, 0], [2, 2, 0], [2, -2, 0]]), np.array([[0, 1, 2], [1, 0, 3]]))
    v = np.array([[0.5, 0, 0], [0.5, 0, 0], [0.5, -3, 0], [0.5, 3, 0]])
    face, place, left = walked(of, v, np.array([0, 1]), np.array([[0.45, 0.35, 0.2], [0.35, 0.45, 0.2]]))
    for _ in range(3):
        face, place, left = walked(of, v, face, place)
    x, y, _ = of.at(of.vertices, face, place).T
    assert not left.any()
    assert (np.abs(y) < 0.05).all() and (np.abs(x - (0.35 * 4 + 0.4 + 4 * 0.5)) < 0.05).all()
