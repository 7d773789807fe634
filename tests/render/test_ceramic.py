"""Glazed ware: the right way up, lit, and the texture where its places say."""

import numpy as np

from render import ceramic, studio

SHOT = studio.Shot(48, 48, 8)


def card() -> dict[str, np.ndarray]:
    """An upright square that faces the camera, its places in the texture those of the square."""
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    vertices = np.stack([corners[:, 0] - 0.5, corners[:, 1], 0 * corners[:, 0]], axis=-1).astype(np.float32)
    return {"vertices": vertices, "faces": np.array([[0, 1, 2], [0, 2, 3]]), "uv": corners}


def quarters() -> np.ndarray:
    """Top row first: red and green above, blue and black below."""
    texture = np.zeros((64, 64, 3), np.float32)
    texture[:32, :32, 0] = texture[:32, 32:, 1] = texture[32:, :32, 2] = 0.6
    return texture


def test_the_texture_stands_upright_and_is_not_mirrored() -> None:
    picture = ceramic.picture(**card(), texture=quarters(), shot=SHOT)
    assert picture.shape == (48, 48, 3) and np.isfinite(picture).all()
    found = [picture[rows, columns].mean(axis=(0, 1)) for rows, columns in (
        (slice(14, 20), slice(12, 20)), (slice(14, 20), slice(28, 36)), (slice(30, 36), slice(12, 20)),
        (slice(30, 36), slice(28, 36)))]
    assert [int(part.argmax()) for part in found[:3]] == [0, 1, 2]
    assert found[3].max() < 0.5 * min(part.max() for part in found[:3])


def test_it_is_the_same_at_any_size_and_place() -> None:
    """The camera and the lamps go with it."""
    one, far = card(), card()
    far["vertices"] = 7 * far["vertices"] + np.float32([3, 2, -5])
    a, b = (ceramic.picture(**mesh, texture=quarters(), shot=SHOT) for mesh in (one, far))
    assert np.abs(a - b).mean() < 0.02 * a.mean()


def test_the_same_picture_twice_has_the_same_bits() -> None:
    a, b = (ceramic.picture(**card(), texture=quarters(), shot=SHOT) for _ in range(2))
    np.testing.assert_array_equal(a, b)


def test_a_crease_is_shaded_as_two_planes_and_a_bend_as_one() -> None:
    """Two triangles at an edge: at a right angle each has its own normal there, at 20 degrees they share one."""
    for degrees, sharp in ((90.0, True), (20.0, False)):
        turn = np.radians(degrees)
        vertices = np.float32([[0, 0, 0], [0, 1, 0], [1, 0, 0], [-np.cos(turn), 0, -np.sin(turn)]])
        faces = np.array([[0, 2, 1], [0, 1, 3]])
        planes = np.float32([[0, 0, 1], [-np.sin(turn), 0, np.cos(turn)]])
        found = ceramic.creased(vertices, faces).reshape(2, 3, 3)
        np.testing.assert_allclose(found[0, 1], planes[0], atol=1e-6)
        np.testing.assert_allclose(found[1, 2], planes[1], atol=1e-6)
        for own, corners in enumerate(([0, 2], [0, 1])):
            expected = planes[own] if sharp else planes.sum(axis=0) / np.linalg.norm(planes.sum(axis=0))
            np.testing.assert_allclose(found[own, corners], np.stack([expected] * 2), atol=1e-5)


def test_corners_at_one_place_are_of_one_vertex_and_a_triangle_without_area_has_no_normal() -> None:
    vertices, faces = np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.2], [2, 0, 0]]), np.array(
        [[0, 1, 2], [1, 3, 2], [0, 1, 4]])
    found = ceramic.creased(vertices, faces)
    apart = ceramic.creased(vertices[faces].reshape(-1, 3), np.arange(9).reshape(3, 3))
    np.testing.assert_array_equal(found, apart)
    np.testing.assert_allclose(np.linalg.norm(found[:6], axis=1), 1, atol=1e-6)
    assert not found[8].any() and np.isfinite(found).all()
