"""Surfaces of elements: closed, their outside outside, as thick as they should be."""


import numpy as np
import pytest

from synth.elements import mesh


def wavy(count: int = 5, samples: int = 12, seed: int = 1) -> np.ndarray:
    """Threads (E, S, 3) that wind."""
    rng = np.random.Generator(np.random.Philox(key=seed))
    s = np.linspace(0, 1, samples)
    swing = rng.normal(0, 0.12, (count, 3, 3))
    waves = np.stack([np.sin(2 * np.pi * s), np.cos(3 * np.pi * s), np.sin(5 * np.pi * s)], 1)
    return np.einsum("sk,ekc->esc", waves, swing) + s[:, None] * [1.0, 0.3, 0.2] + rng.normal(0, 1, (count, 1, 3))


def open_edges(faces: np.ndarray) -> int:
    """Edges that do not lie between two triangles which run along it in opposite directions."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)
    size = edges.max() + 1
    there, back = (np.sort(e[:, 0] * size + e[:, 1]) for e in (edges, edges[:, ::-1]))
    assert len(np.unique(there)) == len(there), "two triangles run along an edge in the same direction"
    return int((there != back).sum())


def welded(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """The faces after equal points became one; triangles without area left out."""
    _, index = np.unique(vertices.round(7), axis=0, return_inverse=True)
    return index.ravel()[faces]


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    """What a closed surface encloses; positive if its faces are counter-clockwise from outside."""
    a, b, c = (vertices[faces[:, k]].astype(float) for k in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


def test_a_straight_tube_is_a_cylinder_with_round_ends() -> None:
    line = np.linspace([0, 0, 0], [2, 0, 0], 9)[None]
    tube = mesh.tubes(line, np.array([0.1]), np.array([[1.0, 0.5, 0.0]]), sides=48)
    assert volume(tube.vertices, tube.faces) == pytest.approx(np.pi * 0.01 * 2 + 4 / 3 * np.pi * 0.001, rel=0.01)
    assert tube.vertices[:, 0].min() == pytest.approx(-0.1) and tube.vertices[:, 0].max() == pytest.approx(2.1)
    assert np.linalg.norm(tube.vertices[:, 1:], axis=1).max() == pytest.approx(0.1, abs=1e-6)
    assert (tube.colours == [255, 128, 0]).all()


def test_tubes_are_closed_and_their_outside_is_outside() -> None:
    threads = wavy()
    tubes = mesh.tubes(threads, np.full(5, 0.02), np.full((5, 3), 0.5), sides=10)
    assert open_edges(tubes.faces) == 0
    assert (np.diff(tubes.element) >= 0).all() and tubes.element.max() == 4
    for e in range(5):
        own = tubes.faces[tubes.element[tubes.faces[:, 0]] == e]
        assert (tubes.element[own] == e).all()
        assert volume(tubes.vertices, own) > 0


def test_frames_do_not_twist() -> None:
    """From ring to ring, a point of a cross section goes along the thread and not round it."""
    threads = wavy(samples=40)
    weights, slopes = mesh._spline(40, 32, 1.0)
    curve, way = np.einsum("ns,esc->enc", weights, threads), np.einsum("ns,esc->enc", slopes, threads)
    tangent = way / np.linalg.norm(way, axis=-1, keepdims=True)
    side = mesh.carried_along(curve, tangent)
    assert np.abs((side * tangent).sum(-1)).max() < 1e-9
    assert np.linalg.norm(side, axis=-1) == pytest.approx(np.ones(side.shape[:2]))
    about = (np.cross(side[:, :-1], side[:, 1:]) * tangent[:, :-1]).sum(-1)
    assert np.abs(about.sum(1)).max() < 0.03  # of what a whole thread bends, many radians
    assert (side[:, :-1] * side[:, 1:]).sum(-1).min() > 0.9


@pytest.mark.parametrize("smoothing", [0.0, 0.5, 1.0])
def test_a_spline_keeps_ends_and_lines_and_goes_through_samples_if_it_should(smoothing: float) -> None:
    weights, slopes = mesh._spline(7, 5, smoothing)
    line = np.linspace(3.0, 9.0, 7)
    assert weights @ line == pytest.approx(np.linspace(3, 9, 31)) and slopes @ line == pytest.approx(np.ones(31))
    corner = np.array([0.0, 0, 0, 1, 0, 0, 0])
    curve = weights @ corner
    assert curve[0] == pytest.approx(0, abs=1e-12) and curve[-1] == pytest.approx(0, abs=1e-12)
    assert curve[15] == pytest.approx(1 - smoothing / 3)
    if smoothing == 1:
        assert curve.min() > -1e-12  # no overshoot


def test_threads_that_cannot_be_tubes() -> None:
    with pytest.raises(ValueError, match="two samples"):
        mesh.tubes(np.zeros((1, 1, 3)), np.ones(1), np.ones((1, 3)))
    still = mesh.tubes(np.zeros((1, 4, 3)), np.ones(1), np.ones((1, 3)))  # no length: nothing to see, nothing broken
    assert np.isfinite(still.vertices).all()


def sheet(count: int = 3) -> np.ndarray:
    r, c = np.meshgrid(np.linspace(0, 1, 7), np.linspace(0, 0.8, 7), indexing="ij")
    bend = np.linspace(0.2, 0.6, count)[:, None, None]
    return np.stack(np.broadcast_arrays(c, bend * np.sin(3 * r) * (1 + c), r), -1)


def test_a_flat_shell_is_a_slab() -> None:
    flat = sheet(1) * [1, 0, 1]
    shell = mesh.shells(flat, np.array([0.01]), np.ones((1, 3)))
    assert volume(shell.vertices, shell.faces) == pytest.approx(0.8 * 0.01, rel=1e-4)
    assert np.ptp(shell.vertices, axis=0) == pytest.approx([0.8, 0.01, 1.0], abs=1e-6)


def test_shells_are_closed_and_as_thick_as_they_should_be() -> None:
    thickness = np.array([0.004, 0.01, 0.02])
    shells = mesh.shells(sheet(), thickness, np.ones((3, 3)), fine=3)
    for e in range(3):
        own = shells.faces[shells.element[shells.faces[:, 0]] == e]
        assert open_edges(welded(shells.vertices, own)) == 0
        assert volume(shells.vertices, own) > 0
        points = shells.vertices[shells.element == e]
        grid = 19 * 19
        assert np.linalg.norm(points[:grid] - points[grid:2 * grid], axis=1) == pytest.approx(
            np.full(grid, thickness[e]), rel=1e-3)


def test_a_sheet_lies_between_the_sides_of_its_shell() -> None:
    one, two = mesh.sheets(sheet(), np.ones((3, 3)), fine=3), mesh.shells(sheet(), np.full(3, 0.01), np.ones((3, 3)), 3)
    grid = 19 * 19
    for e in range(3):
        points = two.vertices[two.element == e]
        assert one.vertices[one.element == e] == pytest.approx((points[:grid] + points[grid:2 * grid]) / 2, abs=1e-6)
    with pytest.raises(ValueError, match="two rows"):
        mesh.sheets(np.zeros((1, 1, 7, 3)), np.ones((1, 3)))


def test_solids_lie_on_the_plane_within_their_radius() -> None:
    place = np.array([[0.0, 0.0], [3.0, 1.0], [-2.0, 4.0], [5.0, 5.0]])
    radius = np.array([0.5, 1.0, 0.7, 0.3])
    solids = mesh.solids(place, radius, np.full((4, 3), 0.5), np.arange(4), np.array([0.0, 1.0, 2.0, 3.0]))
    assert open_edges(solids.faces) == 0
    for e in range(4):
        own = solids.vertices[solids.element == e]
        assert np.linalg.norm(own[:, :2] - place[e], axis=1).max() == pytest.approx(radius[e], rel=0.02)
        assert 0 <= own[:, 2].min() < 0.03 * radius[e]
        assert volume(solids.vertices, solids.faces[solids.element[solids.faces[:, 0]] == e]) > 0
    with pytest.raises(ValueError, match="kind of solid"):
        mesh.solids(place, radius, np.full((4, 3), 0.5), np.array([0, 1, 2, 9]))


def test_an_animation_is_one_mesh_that_moves() -> None:
    first, second = (mesh.tubes(wavy(seed=seed), np.full(5, 0.02), np.full((5, 3), 0.5)) for seed in (1, 2))
    assert np.array_equal(first.faces, second.faces) and np.array_equal(first.element, second.element)
