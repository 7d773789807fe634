"""Small meshes that the tests of textures on surfaces share. Imported as `meshes`."""

import numpy as np

from synth.texture.mesh import Mesh, mesh, refined, unit


def square(rows: int = 12, columns: int = 16, edge: float = 1.0) -> Mesh:
    """A flat one, rows × columns cells of two triangles, from (0, 0, 0), its normal z."""
    y, x = np.mgrid[:rows + 1, :columns + 1] * edge
    number = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (part.ravel() for part in (number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])
    return mesh(np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3), faces)


def cylinder(radius: float, height: float, segments: int, rows: int) -> Mesh:
    """An open one round y, from y = 0."""
    flat = square(rows, segments)
    angle, y = 2 * np.pi * flat.vertices[:, 0] / segments, flat.vertices[:, 1] * height / rows
    around = np.stack([radius * np.cos(angle), y, -radius * np.sin(angle)], axis=-1)
    column = flat.vertices[:, 0].astype(int)
    row = flat.vertices[:, 1].astype(int)
    first = (row * (segments + 1) + column % segments)[flat.faces]
    return mesh(around, first)


def sphere(halvings: int) -> Mesh:
    """A unit one, from an octahedron."""
    corners = np.concatenate([np.eye(3), -np.eye(3)])
    faces = np.array([[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]])
    ball = mesh(corners, faces)
    for _ in range(halvings):
        ball, _ = refined(ball, np.zeros((len(ball.vertices), 0)), 0.501 * ball.longest)
        ball = Mesh(unit(ball.vertices), ball.faces, unit(ball.vertices))
    return ball


def turning(of: Mesh, speed: float = 1.0) -> np.ndarray:
    """The field round y, of so many radians a step."""
    return speed * np.cross([0.0, 1.0, 0.0], of.vertices)
