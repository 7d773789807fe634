"""Glazed ware: the right way up, lit, and the texture where its places say."""

import numpy as np

from render import ceramic, studio

SHOT = studio.Shot(48, 48, 8)


def card() -> dict[str, np.ndarray]:
    """An upright square that faces the camera, its places in the texture those of the square."""
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    vertices = np.stack([corners[:, 0] - 0.5, corners[:, 1], 0 * corners[:, 0]], axis=-1).astype(np.float32)
    return {"vertices": vertices, "faces": np.array([[0, 1, 2], [0, 2, 3]]), "uv": corners,
            "normals": np.broadcast_to(np.float32([0, 0, 1]), (4, 3))}


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
