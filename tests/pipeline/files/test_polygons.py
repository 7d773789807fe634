"""Shapes of strangers: PLY and OBJ as they stand, and the elements that their vertices make."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from pipeline.files import meshes, polygons
from pipeline.files.polygons import Shape

SQUARE = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (1.0, 1.0, 0.5)]


def generator(key: int) -> np.random.Generator:
    return np.random.Generator(np.random.Philox(key=key))


def ply(order: str, counts: str = "uchar") -> bytes:
    """A vertex with a colour, a quad and a triangle, edges, and an element that nobody knows."""
    head = (f"ply\nformat {order} 1.0\ncomment by hand\nelement vertex 4\nproperty float x\nproperty double y\n"
            f"property float z\nproperty uchar red\nelement face 2\nproperty list {counts} int vertex_indices\n"
            "property uchar flags\nelement edge 0\nproperty int vertex1\nproperty int vertex2\n"
            "element other 1\nproperty short a\nend_header\n")
    if order == "ascii":
        body = "".join(f"{x} {y} {z} 7\n" for x, y, z in SQUARE) + "4 0 1 3 2 9\n3 0 1 2 8\n-5\n"
        return (head + body).encode()
    e = "<" if "little" in order else ">"
    vertices = np.array([(*v, 7) for v in SQUARE], [("x", e + "f4"), ("y", e + "f8"), ("z", e + "f4"), ("c", "u1")])
    size = polygons._TYPES[counts]
    faces = b"".join(np.array(len(f), e + size).tobytes() + np.array(f, e + "i4").tobytes() + b"\x09"
                     for f in ((0, 1, 3, 2), (0, 1, 2)))
    return head.encode() + vertices.tobytes() + faces + np.array(-5, e + "i2").tobytes()


@pytest.mark.parametrize("order", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("counts", ["uchar", "int"])
def test_ply_of_each_kind_says_the_same(tmp_path: Path, order: str, counts: str) -> None:
    (tmp_path / "a.ply").write_bytes(ply(order, counts))
    shape = polygons.read(tmp_path / "a.ply")
    assert np.array_equal(shape.vertices, SQUARE) and shape.lines == []
    assert shape.faces == [(0, 1, 3, 2), (0, 1, 2)]


def test_our_own_meshes_and_points_are_read(tmp_path: Path) -> None:
    meshes.write(tmp_path / "a.ply", np.array(SQUARE, np.float32), np.array([[0, 1, 2], [2, 1, 3]], np.int32))
    assert polygons.read(tmp_path / "a.ply").faces == [(0, 1, 2), (2, 1, 3)]
    meshes.write_points(tmp_path / "b.ply", np.array(SQUARE, np.float32), {"age": np.arange(4, dtype=np.int32)})
    shape = polygons.read(tmp_path / "b.ply")
    assert np.array_equal(shape.vertices, SQUARE) and not shape.faces


def test_obj_with_lines_continued_counted_backwards_and_with_normals(tmp_path: Path) -> None:
    text = "# by hand\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nl 1 2 \\\n3\nv 1 1 0.5\nf -4/1/1 -3//1 -1 -2\no x\n\n"
    for end in ("\n", "\r\n"):
        (tmp_path / "a.obj").write_text(text, newline=end)
        shape = polygons.read(tmp_path / "a.obj")
        assert shape.lines == [(0, 1, 2)] and shape.faces == [(0, 1, 3, 2)]
        assert np.array_equal(shape.vertices, SQUARE)


@pytest.mark.parametrize(("name", "content", "reason"), [
    ("a.stl", b"solid", "is no PLY or OBJ file"),
    ("a.ply", b"", "is no PLY file"),
    ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 1\nend_header\n", "have no x, y, z"),
    ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nend_header\n", "have no x, y, z"),
    ("a.obj", b"f 1 2 3\n", "holds no vertices"),
    ("a.ply", ply("ascii").replace(b"vertex 4", b"vertex 99999999999"), "cut short"),
    ("a.ply", ply("ascii").replace(b"format ascii", b"format pigeon"), "names no format"),
    ("a.ply", ply("ascii").replace(b"float z", b"quaternion z"), "damaged: property quaternion z"),
    ("a.ply", ply("ascii").replace(b"4 0 1 3 2", b"4 0 1 3 9"), "face 1 names a vertex that does not exist"),
    ("a.ply", ply("ascii").replace(b"4 0 1 3 2", b"4 0 1 3 0"), "face 1 names a vertex twice"),
    ("a.ply", ply("ascii").replace(b"4 0 1 3 2", b"4 0 1 3 x"), "damaged"),
    ("a.ply", ply("ascii").replace(b"4 0 1 3 2", b"-1 0 1 3 2"), "a list of -1 values"),
    ("a.ply", ply("binary_little_endian")[:-30], "cut short"),
    ("a.obj", b"v 1 2\n", "damaged: line 1"),
    ("a.obj", b"v 1 2 3\nl 1 x\n", "damaged: line 2"),
    ("a.obj", b"v 1 2 3\nv 1 2 3\nl 1 0\n", "line 1 names a vertex that does not exist"),
    ("a.obj", b"\x00\xff", "holds no vertices"),
])
def test_what_cannot_be_read_says_why(tmp_path: Path, name: str, content: bytes, reason: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ValueError, match=reason):
        polygons.read(tmp_path / name)


@pytest.mark.parametrize("order", ["ascii", "binary_big_endian"])
def test_damage_is_a_value_error_or_harmless(tmp_path: Path, order: str) -> None:
    """Anything else would still be caught where the child answers; here none should happen at all."""
    path, random, whole = tmp_path / "a.ply", generator(1), ply(order)
    for _ in range(400):
        content = bytearray(whole[:random.integers(1, len(whole))] if random.random() < 0.3 else whole)
        for place in random.integers(0, len(content), 3):
            content[place] = random.integers(256)
        path.write_bytes(content)
        try:
            polygons.read(path)
        except ValueError as error:
            assert "\n" not in str(error) or len(str(error).splitlines()[0]) > 3


# --- elements ---

def quads(rows: int, columns: int) -> list[tuple[int, ...]]:
    corner = [r * columns + c for r in range(rows - 1) for c in range(columns - 1)]
    return [(k, k + 1, k + columns + 1, k + columns) for k in corner]


def halved(faces: list[tuple[int, ...]], how: str) -> list[tuple[int, ...]]:
    found: list[tuple[int, ...]] = []
    for n, (a, b, c, d) in enumerate(faces):
        other = how == "one way" or (how == "in turn" and n % 2)
        found += [(a, b, d), (b, c, d)] if other else [(a, b, c), (a, c, d)]
    return found


def plane(rows: int, columns: int) -> np.ndarray:
    y, x = np.mgrid[:rows, :columns].reshape(2, -1)
    return np.stack([x, y, 0.1 * np.sin(x + y)], axis=-1).astype(float)


@pytest.mark.parametrize(("rows", "columns"), [(2, 2), (2, 5), (7, 7), (3, 4), (5, 2)])
@pytest.mark.parametrize("how", ["whole", "one way", "other way", "in turn"])
def test_a_sheet_row_by_row_is_found_without_looking_at_positions(rows: int, columns: int, how: str) -> None:
    faces = quads(rows, columns) if how == "whole" else halved(quads(rows, columns), how)
    order, grid = polygons.elements(Shape(np.zeros((rows * columns, 3)), faces=faces[::-1]))
    sides = {frozenset(pair) for face in quads(rows, columns) for pair in pairwise((*face, face[0]))}
    found = order.reshape(grid)
    told = {frozenset(pair) for row in (*found, *found.T) for pair in pairwise(row.tolist())}
    assert grid in ((rows, columns), (columns, rows)) if how != "whole" else (grid == (rows, columns))
    if how == "whole":
        assert np.array_equal(order, [np.arange(rows * columns)]) and told == sides


@pytest.mark.parametrize(("rows", "columns"), [(2, 2), (2, 5), (7, 7), (3, 4)])
@pytest.mark.parametrize("how", ["whole", "one way", "in turn"])
def test_a_sheet_in_any_order_is_walked(rows: int, columns: int, how: str) -> None:
    random = generator(rows * columns)
    new = random.permutation(rows * columns)  # vertex k becomes new[k]
    faces = quads(rows, columns) if how == "whole" else halved(quads(rows, columns), how)
    faces = [tuple(int(new[v]) for v in np.roll(faces[k], random.integers(4)))
             for k in random.permutation(len(faces))]
    vertices = np.empty((rows * columns, 3))
    vertices[new] = plane(rows, columns)
    order, grid = polygons.elements(Shape(vertices, faces=faces))
    assert sorted(grid) == sorted((rows, columns)) and sorted(order[0]) == list(range(rows * columns))
    at = vertices[order[0]].reshape(*grid, 3)[..., :2]
    for axis in (0, 1):  # each neighbour is one step away, along one axis
        steps = np.diff(at, axis=axis)
        assert (np.abs(steps).sum(axis=-1) == 1).all() and (steps == steps.reshape(-1, 2)[0]).all()


def test_several_sheets_are_several_elements_and_alike() -> None:
    one, size = quads(3, 4), 12
    turned = [tuple((v % 4) * 3 + v // 4 for v in face) for face in one]  # the same sheet, counted down its columns
    faces = [tuple(v + size for v in face) for face in turned] + one
    order, grid = polygons.elements(Shape(np.concatenate([plane(3, 4)] * 2), faces=faces))
    assert grid == (3, 4) and order.shape == (2, 12)
    assert np.array_equal(order[0], np.arange(12))
    assert np.array_equal(order[1].reshape(3, 4), size + np.arange(12).reshape(4, 3).T)


@pytest.mark.parametrize("faces", [
    quads(3, 3)[:-1],  # a corner is missing
    [f for f in quads(4, 4) if f != (5, 6, 10, 9)],  # a hole
    halved(quads(3, 3), "one way")[:-1],
    [(0, 1, 2)],
    [(0, 1, 2, 3, 4)],
    [(0, 1, 3, 2), (0, 1, 5, 4), (2, 3, 5, 4)],  # a ring
    [(0, 1, 2), (0, 2, 3), (0, 3, 1), (1, 3, 2)],  # a solid
    [(0, 1, 2, 3), (0, 3, 2, 1)],  # twice the same
    [(0, 1, 2), (0, 1, 3)],  # both halves on one side
])
def test_a_sheet_that_is_no_grid_is_refused(faces: list[tuple[int, ...]]) -> None:
    with pytest.raises(ValueError, match="element 1: a sheet that is not a grid"):
        polygons.elements(Shape(plane(4, 4), faces=faces))


def test_threads_keep_their_own_direction() -> None:
    order, grid = polygons.elements(Shape(np.zeros((6, 3)), [(5, 4, 3), (0, 2, 1)]))
    assert order.tolist() == [[0, 2, 1], [5, 4, 3]] and grid == (3,)


def test_edges_join_to_threads() -> None:
    edges = [(1, 2), (7, 6), (0, 1), (5, 4), (3, 2), (6, 5)]
    order, grid = polygons.elements(Shape(np.zeros((8, 3)), edges))
    assert order.tolist() == [[0, 1, 2, 3], [4, 5, 6, 7]] and grid == (4,)


@pytest.mark.parametrize(("lines", "faces", "reason"), [
    ([(0, 1), (1, 2), (1, 3)], [], "branches at vertex 2"),
    ([(0, 1), (1, 2), (2, 0)], [], "through vertex 1 is closed"),
    ([(0, 1, 2, 0)], [], "through vertex 1 is closed"),
    ([(0, 1, 2), (3, 4)], [], "element 2 has 2 samples, element 1 has 3"),
    ([(0, 1)], [(0, 1, 3, 2)], "lines and faces"),
    ([], [*quads(2, 3), (6, 7, 9, 8)], "element 2 has 2 x 2 samples, element 1 has 2 x 3"),
])
def test_what_makes_no_elements_says_why(lines: list, faces: list, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        polygons.elements(Shape(np.zeros((12, 3)), lines, faces))


def test_points_are_elements_of_one_sample() -> None:
    order, grid = polygons.elements(Shape(np.zeros((3, 3))))
    assert order.tolist() == [[0], [1], [2]] and grid == ()
