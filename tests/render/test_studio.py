"""render.studio: meshes are consistent and in their place; cameras see what they should."""

import numpy as np
import pytest

from render import studio


def edges(mesh: studio.Mesh) -> dict[tuple[int, int], int]:
    """How often each directed edge occurs among the faces that have an area."""
    count: dict[tuple[int, int], int] = {}
    for face in mesh.faces.tolist():
        for a, b in zip(face, face[1:] + face[:1], strict=True):
            count[a, b] = count.get((a, b), 0) + 1
    return count


def test_each_edge_is_used_once_each_way_round() -> None:
    """One orientation all over: no directed edge is used twice."""
    for mesh in (studio.bowl(0.2, 0.1), studio.backdrop()):
        assert max(edges(mesh).values()) == 1


def test_the_bowl_holds_a_positive_volume_and_stands_on_the_floor() -> None:
    """Faces look outwards: the signed volume is the stone's, less than the cylinder round it."""
    bowl = studio.bowl(0.2, 0.1)
    a, b, c = (bowl.vertices[bowl.faces[:, k]].astype(np.float64) for k in range(3))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0
    assert 0.1 * np.pi * 0.232**2 * 0.1 < volume < np.pi * 0.232**2 * 0.1
    assert bowl.vertices[:, 1].min() == 0.0
    assert np.isclose(bowl.vertices[:, 1].max(), 0.1, atol=1e-6)


def test_the_bowl_is_open_and_as_wide_as_asked() -> None:
    bowl = studio.bowl(0.2, 0.1)
    radius = np.hypot(bowl.vertices[:, 0], bowl.vertices[:, 2])
    near_rim = np.abs(bowl.vertices[:, 1] - 0.084) < 0.005  # where the lip ends and the inside begins
    assert np.isclose(radius[near_rim].min(), 0.2, atol=1e-3)


def test_the_backdrop_is_smooth_and_its_floor_is_at_zero() -> None:
    """No horizon: from floor to wall the slope turns by less than 3 degrees at a time."""
    backdrop = studio.backdrop()
    profile = backdrop.vertices[:len(backdrop.vertices) // 2, 1:].astype(np.float64)
    steps = np.diff(profile, axis=0)
    angle = np.degrees(np.unwrap(np.arctan2(steps[:, 0], -steps[:, 1])))
    assert np.abs(np.diff(angle)).max() < 3.0
    assert backdrop.vertices[:, 1].min() == 0.0


def test_rays_go_through_the_pixels_of_the_camera() -> None:
    camera = studio.Camera(position=(0.0, 0.0, 4.0), target=(0.0, 0.0, 0.0), fov=90.0)
    rays = camera.rays(4, 2)
    assert rays[0, 0] == pytest.approx([-1.5, 0.5, -1.0])  # top row first, left first
    assert rays[1, 3] == pytest.approx([1.5, -0.5, -1.0])


def test_the_edges_of_a_softbox_lie_in_its_face() -> None:
    for box in studio.LAMPS.values():
        level, upright = box.edges
        facing = np.array(box.target) - np.array(box.position)
        assert [np.linalg.norm(edge) for edge in box.edges] == pytest.approx(box.size)
        assert level[1] == 0.0 and upright[1] > 0.0
        assert level @ upright == pytest.approx(0.0, abs=1e-9)
        assert level @ facing == pytest.approx(0.0, abs=1e-9)
        assert upright @ facing == pytest.approx(0.0, abs=1e-9)


def test_a_raised_camera_keeps_its_target_and_distance() -> None:
    low, high = studio.CAMERA, studio.raised(60.0)
    assert high.target == low.target and high.fov == low.fov
    offset = np.array(high.position) - np.array(low.target)
    assert high.distance == pytest.approx(low.distance)
    assert np.degrees(np.arcsin(offset[1] / high.distance)) == pytest.approx(60.0)


def test_a_placed_box_fills_the_middle_of_the_picture() -> None:
    low, high = np.array([3.0, -1.0, 2.0]), np.array([5.0, 0.0, 2.0])
    camera = studio.Camera(position=(0.0, 1.0, 4.0), target=(0.0, 1.0, 0.0), fov=30.0)
    corners = studio.placed(np.stack([low, high]), low, high, camera, 1.5)
    view = 2 * 4 * np.tan(np.radians(15.0))
    assert corners.mean(0) == pytest.approx(camera.target, abs=1e-6)
    # twice as wide as high: the width decides
    assert np.ptp(corners[:, 0]) == pytest.approx(studio.FILLED * 1.5 * view)
    assert np.ptp(corners[:, 1]) == pytest.approx(studio.FILLED * 0.75 * view)


def test_a_framed_box_is_seen_whole_and_fills_the_picture() -> None:
    low, high = np.array([3.0, -1.0, 2.0]), np.array([5.0, 0.5, 4.0])
    camera = studio.framing(low, high, studio.CAMERA, 1.5)
    corners = low + np.indices((2, 2, 2)).reshape(3, -1).T * (high - low)
    rays = camera.rays(3, 2).reshape(2, 3, 3)
    ahead = np.array(camera.target) - np.array(camera.position)
    ahead /= np.linalg.norm(ahead)
    right, up = rays[0, 2] - rays[0, 1], rays[0, 1] - rays[1, 1]
    seen = corners - np.array(camera.position)
    seen /= (seen @ ahead)[:, None]
    # in halves of the picture, which are 1.5 pixels wide and 1 pixel high
    across, above = seen @ right / (right @ right) / 1.5, seen @ up / (up @ up)
    assert max(np.abs(across).max(), np.abs(above).max()) == pytest.approx(studio.FILLED, rel=1e-6)
    old = np.array(studio.CAMERA.target) - np.array(studio.CAMERA.position)
    assert ahead == pytest.approx(old / np.linalg.norm(old))


def test_the_studio_fits_what_a_camera_sees() -> None:
    """A camera three times as far with the same lens: everything becomes a third, around its target."""
    far = studio.Camera((2.0, 3 * 0.92, 3 * 6.2 + 1), (2.0, 3 * 0.475, 1.0), studio.CAMERA.fov)
    points = np.array([[2.0, 0.0, 1.0], [5.0, 3.0, 1.0]])
    vertices, camera, scale = studio.in_studio(points, far, studio.CAMERA)
    assert scale == pytest.approx(1 / 3)
    assert vertices == pytest.approx(np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 0.0]]), abs=1e-6)
    assert camera.position == pytest.approx(studio.CAMERA.position)
    assert camera.target == pytest.approx(studio.CAMERA.target)


def test_a_shot_has_the_aspect_of_its_picture() -> None:
    assert studio.Shot().aspect == pytest.approx(16 / 9) and studio.SHOT.camera is None


def test_a_mesh_moves_as_a_whole() -> None:
    moved = studio.backdrop().moved(1.0, 2.0, 3.0)
    shift = moved.vertices - studio.backdrop().vertices
    assert shift == pytest.approx(np.broadcast_to([1.0, 2.0, 3.0], shift.shape), abs=1e-6)
    assert moved.vertices.dtype == np.float32


def test_the_faces_of_a_grid_cover_it_once() -> None:
    """Six cells of two triangles, all turned the same way."""
    faces = studio.grid_faces(3, 4)
    assert faces.shape == (12, 3) and faces.dtype == np.uint32
    y, x = np.divmod(faces.astype(float), 4)
    area = (x[:, 1] - x[:, 0]) * (y[:, 2] - y[:, 0]) - (x[:, 2] - x[:, 0]) * (y[:, 1] - y[:, 0])
    np.testing.assert_array_equal(area, -1.0)
    assert len({tuple(face) for face in np.sort(faces, axis=1)}) == 12
