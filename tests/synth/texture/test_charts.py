"""Charts: exact on a plane, within stated bounds on a sphere, and the kernel is its reference."""

import hashlib

import meshes
import numpy as np
import processes
import pytest

from synth.texture import charts
from synth.texture.mesh import Mesh, dot, mesh, unit

REACH = 4.0


def logarithms(of: Mesh, source: np.ndarray, vertex: np.ndarray) -> np.ndarray:
    """On the unit sphere where vertices lie, exactly, in the tangent planes of sources: (E, 3)."""
    up, to = of.vertices[source], of.vertices[vertex]
    flat = unit(to - dot(up, to)[:, None] * up)
    return flat * np.arccos(np.clip(dot(up, to), -1, 1))[:, None]


def sources(of: charts.Charts) -> tuple[np.ndarray, np.ndarray]:
    return np.divmod(of.keys, len(of.mesh.vertices))


def test_on_a_plane_they_are_exact_and_whole() -> None:
    of = meshes.square()
    found = charts.charts(of, REACH)
    source, vertex = sources(found)
    offset = of.vertices[vertex] - of.vertices[source]
    expected = np.stack([dot(of.bases[source][:, k], offset) for k in (0, 1)], axis=-1)
    np.testing.assert_allclose(found.places, expected, atol=2e-5)
    apart = np.linalg.norm(of.vertices[:, None] - of.vertices, axis=-1)
    assert (np.linalg.norm(expected, axis=1) <= REACH).sum() == (apart <= REACH).sum()


def test_on_a_sphere_they_are_exponential_maps_within_two_hundredths() -> None:
    of = meshes.sphere(4)
    found = charts.charts(of, 0.8)
    source, vertex = sources(found)
    exact = logarithms(of, source, vertex)
    expected = np.stack([dot(of.bases[source][:, k], exact) for k in (0, 1)], axis=-1)
    away, error = np.linalg.norm(exact, axis=1), np.linalg.norm(found.places - expected, axis=1)
    near = (away > 1e-3) & (away < 0.8)
    assert (error / np.maximum(away, 1e-9))[near].max() < 0.02
    assert error[near].mean() < 0.002


def test_the_two_sides_of_a_thin_sheet_do_not_see_each_other() -> None:
    low = meshes.square(6, 6)
    both = mesh(np.concatenate([low.vertices, low.vertices + np.array([0, 0, 0.01])]),
                np.concatenate([low.faces[:, ::-1], low.faces + len(low.vertices)]))
    source, vertex = sources(charts.charts(both, REACH))
    half = len(low.vertices)
    assert ((source < half) == (vertex < half)).all()


@pytest.mark.parametrize("of", [meshes.square(5, 7), meshes.sphere(3), meshes.cylinder(1, 3, 9, 7)])
def test_lay_is_its_reference(of: Mesh) -> None:
    ways = charts.ways(of)
    what = charts.ordered(ways, np.arange(0, len(of.vertices), 3), 3 * of.longest)
    found = charts.lay(of, ways, what)
    assert len(found) > 4 * len(of.vertices) / 3
    np.testing.assert_array_equal(found, charts.lay_reference(of, ways, what))


def patches(of: Mesh, count: int = 20) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Places, and axes that point anywhere."""
    random = np.random.default_rng(3)
    face, place = random.integers(len(of.faces), size=count), random.dirichlet([1, 1, 1], count)
    normal = unit(of.at(of.normals, face, place))
    axis = random.normal(size=(count, 3))
    return face, place, normal, unit(axis - dot(axis, normal)[:, None] * normal)


def test_the_chart_of_a_place_on_a_plane_is_exact() -> None:
    of = meshes.square()
    face, place, normal, axis = patches(of)
    near = charts.around(charts.charts(of, REACH), face, place, normal, axis)
    patch, vertex = np.divmod(near.keys, len(of.vertices))
    offset = of.vertices[vertex] - of.at(of.vertices, face, place)[patch]
    side = np.cross(normal, axis)
    expected = np.stack([dot(axis[patch], offset), dot(side[patch], offset)], axis=-1)
    np.testing.assert_allclose(near.places, expected, atol=2e-5)
    counts = np.bincount(patch, minlength=len(face))
    apart = np.linalg.norm(of.vertices - of.at(of.vertices, face, place)[:, None], axis=-1)
    assert (counts >= (apart <= REACH).sum(axis=1)).all()


def test_it_moves_smoothly_from_triangle_to_triangle() -> None:
    """Along a line over a sphere no vertex moves in the chart by much more than the place does."""
    of = meshes.sphere(4)
    found = charts.charts(of, 0.5)
    angle = np.linspace(0, 1, 200)
    points = np.stack([np.cos(angle), 0.3 * np.ones_like(angle), np.sin(angle)], axis=-1)
    # the triangle that a ray from the middle meets
    coordinates = np.linalg.solve(of.corners.transpose(0, 2, 1)[None], points[:, None, :, None])[..., 0]
    face = coordinates.min(axis=-1).argmax(axis=1)
    place = coordinates[np.arange(len(face)), face]
    place /= place.sum(axis=1)[:, None]
    normal = unit(of.at(of.normals, face, place))
    axis = np.cross([0.0, 1.0, 0.0], normal)
    near = charts.around(found, face, place, normal, unit(axis))
    patch, vertex = np.divmod(near.keys, len(of.vertices))
    steps = []
    for v in np.unique(vertex):
        mine = np.flatnonzero(vertex == v)
        mine = mine[np.linalg.norm(near.places[mine], axis=1) < 0.3]
        one_on = np.diff(patch[mine]) == 1
        steps += list(np.linalg.norm(near.places[mine[1:]] - near.places[mine[:-1]], axis=1)[one_on])
    assert len(np.unique(face)) > 15
    assert max(steps) < 3 * (angle[1] - angle[0])


def test_pieces_are_the_triangles_within_reach() -> None:
    of = meshes.square()
    face, place, normal, axis = patches(of)
    found = charts.charts(of, REACH)
    centres = charts.Centres(face, place, normal, axis)
    pieces = charts.pieces(found, centres, 0.5, np.full(len(face), 4.0), 1.0)
    assert (np.diff(pieces.starts) >= 0).all() and pieces.starts[-1] == len(pieces.patch)
    # by triangle, then by patch, none twice
    key = pieces.face * len(face) + pieces.patch
    assert (np.diff(key) > 0).all()
    # those of which some corner is nearer than 4 pixels, 2 units, are there
    centre = of.at(of.vertices, face, place)
    close = np.linalg.norm(of.corners[None] - centre[:, None, None], axis=-1).min(axis=-1) < 2
    assert set(zip(*np.nonzero(close), strict=True)) <= set(zip(pieces.patch.tolist(), pieces.face.tolist(),
                                                                strict=True))
    # a pixel is half a unit: areas are four times as large
    _, _, bx, by, cx, cy = pieces.corners.T
    np.testing.assert_allclose((bx * cy - by * cx) / 2, 4 * of.areas[pieces.face], rtol=1e-4)


def test_each_patch_has_the_triangle_of_its_centre_where_its_chart_is_of_no_use(
        monkeypatch: pytest.MonkeyPatch) -> None:
    """Else the site that bore it would stay bare, and bear in each frame."""
    monkeypatch.setattr(charts, "DISTORTED", 1.0)  # no triangle is good enough
    of = meshes.sphere(1)
    face, place, normal, axis = patches(of)
    centres = charts.Centres(face, place, normal, axis)
    found = charts.pieces(charts.charts(of, 1.0), centres, 0.1, np.full(20, 20.0), 1.0)
    order = np.argsort(found.patch)
    np.testing.assert_array_equal(found.patch[order], np.arange(20))
    np.testing.assert_array_equal(found.face[order], face)
    own = found.corners[order].reshape(20, 3, 2).astype(np.float64)
    # the centre is at 0, 0, and the triangle as large as it is
    centre = own[:, 0] + place[:, 1:2] * own[:, 1] + place[:, 2:] * own[:, 2]
    np.testing.assert_allclose(centre, 0, atol=1e-5)
    area = (own[:, 1, 0] * own[:, 2, 1] - own[:, 1, 1] * own[:, 2, 0]) / 2
    np.testing.assert_allclose(area, 100 * of.areas[face], rtol=1e-5)


def test_a_mesh_much_finer_than_its_texture_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(charts, "MOST", 1000)
    with pytest.raises(ValueError, match="the mesh of 221 vertices is finer than its texture needs"):
        charts.charts(meshes.square(), REACH)


def digest() -> str:
    of = charts.charts(meshes.sphere(3), 0.7)
    return hashlib.sha256(of.keys.tobytes() + of.places.tobytes()).hexdigest()


def test_the_same_bits_at_any_number_of_threads(tmp_path: object) -> None:
    assert len(processes.digests(__file__, tmp_path)) == 1
