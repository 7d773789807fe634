"""Mending: what is closed afterwards, and that it stays what it was."""

import numpy as np
import pytest

from pipeline.files import mesh_repair


def is_closed(faces: np.ndarray) -> bool:
    """Whether each edge has two faces, which run along it in opposite directions."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    forward, count = np.unique(edges, axis=0, return_counts=True)
    back = np.unique(edges[:, ::-1], axis=0)
    return bool((count == 1).all() and len(back) == len(forward) and np.array_equal(forward, back))


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    """What the mesh encloses."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return abs(float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum())) / 6


CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
CUBE = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6],
                 [0, 6, 4], [1, 5, 7], [1, 7, 3]])


def test_a_whole_cube_stays_one() -> None:
    assert is_closed(CUBE)
    vertices, faces = mesh_repair.closed(CORNERS, CUBE)
    assert is_closed(faces) and volume(vertices, faces) == pytest.approx(1) and len(faces) == 12


@pytest.mark.parametrize("faces", [
    CUBE[1:], np.delete(CUBE, (0, 1), axis=0), np.delete(CUBE, (0, 2), axis=0), np.concatenate([CUBE, CUBE[:1]]),
    np.concatenate([CUBE[:5], CUBE[5:, ::-1]])], ids=["a hole", "a side missing", "two holes", "a face twice",
                                                      "turned inside out in part"])
def test_a_broken_cube_is_mended(faces: np.ndarray) -> None:
    assert not is_closed(faces)
    vertices, mended = mesh_repair.closed(CORNERS, faces)
    assert is_closed(mended) and volume(vertices, mended) == pytest.approx(1)


def test_corners_that_meet_without_being_one_are_joined() -> None:
    apart = CORNERS[CUBE].reshape(-1, 3)  # as an STL file has them
    vertices, faces = mesh_repair.closed(apart, np.arange(36).reshape(12, 3))
    assert is_closed(faces) and len(vertices) == 8
