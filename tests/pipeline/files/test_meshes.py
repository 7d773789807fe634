"""PLY files: the arrays come back, and a damaged file is one line."""

from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import BadInput, StorageFailed
from pipeline.files import meshes

VERTICES = np.array([[-1.5, 0.25, 3], [1, 0, 0], [0, 1, 0], [0, 0, 1e-7]], np.float32)
FACES = np.array([[0, 1, 2], [2, 1, 3], [0, 0, 3]], np.int32)  # the last one has no area, and stays


def test_what_is_written_is_read(tmp_path: Path) -> None:
    meshes.write(tmp_path / "a.ply", VERTICES[::-1], FACES)
    vertices, faces = meshes.read(tmp_path / "a.ply", "key")
    assert np.array_equal(vertices, VERTICES[::-1]) and np.array_equal(faces, FACES)
    assert vertices.dtype == np.float32 and faces.dtype == np.int32
    head = (tmp_path / "a.ply").read_bytes()[:200].decode(errors="replace")
    assert head.startswith("ply") and "element vertex 4" in head and "element face 3" in head
    first = (tmp_path / "a.ply").read_bytes()
    meshes.write(tmp_path / "a.ply", VERTICES[::-1], FACES)
    assert (tmp_path / "a.ply").read_bytes() == first


def test_colours_come_back_and_are_their_vertices(tmp_path: Path) -> None:
    colours = np.array([[255, 0, 1], [2, 254, 3], [0, 0, 0], [9, 8, 7]], np.uint8)
    meshes.write(tmp_path / "a.ply", VERTICES, FACES, colours)
    back = meshes.read_own(tmp_path / "a.ply")
    assert all(np.array_equal(back[name], a) for name, a in
               {"vertices": VERTICES, "faces": FACES, "colours": colours}.items())
    assert np.array_equal(meshes.read(tmp_path / "a.ply", "key")[0], VERTICES)
    meshes.write(tmp_path / "b.ply", VERTICES, FACES)
    assert set(meshes.read_own(tmp_path / "b.ply")) == {"vertices", "faces"}
    for wrong in (colours[:3], colours / 255.0):
        with pytest.raises(ValueError, match="colours are"):
            meshes.write(tmp_path / "a.ply", VERTICES, FACES, wrong)


@pytest.mark.parametrize(("vertices", "faces", "reason"), [
    (VERTICES, FACES + 1, "names a vertex that does not exist"),
    (VERTICES, FACES - 1, "names a vertex that does not exist"),
    (np.where(VERTICES > 2, np.nan, VERTICES), FACES, "NaN or infinity"),
    (VERTICES[:, :2], FACES, r"shape \(n, 3\)"),
    (VERTICES, FACES[:0], "n > 0"),
])
def test_what_is_no_mesh_is_refused(tmp_path: Path, vertices: np.ndarray, faces: np.ndarray,
                                    reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        meshes.write(tmp_path / "a.ply", vertices, faces)
    assert list(tmp_path.iterdir()) == []


def test_damaged_files_are_one_line(tmp_path: Path) -> None:
    whole, cut = tmp_path / "whole.ply", tmp_path / "cut.ply"
    meshes.write(whole, VERTICES, FACES)
    content = whole.read_bytes()
    for damaged in (b"", content[:-20], content.replace(b"face 3", b"face 9")):
        cut.write_bytes(damaged)
        with pytest.raises(BadInput, match=r"cut\.ply: key: ") as caught:
            meshes.read(cut, "key")
        assert "\n" not in str(caught.value)


def test_a_full_disk_is_noticed(tiny_disk: Path) -> None:
    many = np.random.Generator(np.random.Philox(key=1)).random((40000, 3), np.float32)
    with pytest.raises(StorageFailed, match="the disk is full"):
        meshes.write(tiny_disk / "a.ply", many, FACES)
    assert list(tiny_disk.iterdir()) == []


def test_points_come_back_with_what_they_carry(tmp_path: Path) -> None:
    attributes = {"vx": np.array([1, -2, 1e-7], np.float32), "age": np.array([0, 7, -3], np.int32)}
    meshes.write_points(tmp_path / "a.ply", VERTICES[:3], attributes)
    back = meshes.read_points(tmp_path / "a.ply")
    assert np.array_equal(back["position"], VERTICES[:3]) and set(back) == {"position", "vx", "age"}
    assert all(np.array_equal(back[name], values) and back[name].dtype == values.dtype
               for name, values in attributes.items())
    (tmp_path / "b.ply").write_bytes((tmp_path / "a.ply").read_bytes()[:-4])
    with pytest.raises(BadInput, match=r"b\.ply: damaged"):
        meshes.read_points(tmp_path / "b.ply")
    with pytest.raises(ValueError, match="as many as these, 3"):
        meshes.write_points(tmp_path / "c.ply", VERTICES[:3], {"age": np.zeros(2, np.int32)})
    with pytest.raises(ValueError, match="finite"):
        meshes.write_points(tmp_path / "c.ply", VERTICES[:3] * np.nan, {})


# surfaces

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
BOTH = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
OBJ = "".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS)


def test_a_surface_comes_back_with_its_attributes_and_programs_find_its_uv(tmp_path: Path) -> None:
    one = {"vertices": CORNERS, "faces": BOTH, "s": CORNERS[:, 0], "t": CORNERS[:, 1],
           "part": np.arange(4, dtype=np.int32)}
    meshes.SURFACE.write(tmp_path / "a.ply", one)
    back = meshes.SURFACE.read(tmp_path / "a.ply")
    assert back.keys() == one.keys()
    for name, values in one.items():
        np.testing.assert_array_equal(back[name], values)
        assert back[name].dtype == values.dtype
    head = (tmp_path / "a.ply").read_bytes()[:400]
    assert b"property float s" in head and b"property float t" in head
    (tmp_path / "b.ply").write_bytes((tmp_path / "a.ply").read_bytes()[:-4])
    with pytest.raises(BadInput, match=r"b\.ply: damaged"):
        meshes.SURFACE.read(tmp_path / "b.ply")
    with pytest.raises(ValueError, match="part of vertices are finite and as many as these, 4"):
        meshes.SURFACE.write(tmp_path / "c.ply", {**one, "part": np.zeros(3)})
    # and it is a user's mesh, with a vector at each vertex
    vertices, faces, vectors = meshes.read_surface(tmp_path / "a.ply", "key", ["s", "t", "part"], "names")
    order = np.lexsort(CORNERS.T[::-1])
    np.testing.assert_array_equal(vertices, CORNERS[order])
    np.testing.assert_array_equal(vectors, np.column_stack([CORNERS[:, :2], np.arange(4)])[order])
    assert len(faces) == 2


@pytest.mark.parametrize("text", [
    OBJ + "f 1 2 3 4\n", OBJ + "vt 0 0\nvt 1 1\nf 1/1 2/2 3/1\nf 1/1 3/2 4/1\n",
    OBJ + "o one\nf 1 2 3\no two\nf 1 3 4\n"], ids=["a quad", "places in a texture", "two objects"])
def test_obj_files_are_surfaces_and_solids(tmp_path: Path, text: str) -> None:
    (tmp_path / "a.obj").write_text(text)
    vertices, faces, vectors = meshes.read_surface(tmp_path / "a.obj", "key", [], "names")
    assert vertices.shape == (4, 3) and not vectors.any()
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    np.testing.assert_allclose(np.cross(b - a, c - a), np.broadcast_to([0, 0, 1], (2, 3)))
    with pytest.raises(BadInput, match="encloses nothing"):  # it is read, and is no solid
        meshes.read_solid(tmp_path / "a.obj", "key", 0.1)


def test_vectors_that_a_file_cannot_have_are_told_with_their_key(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text(OBJ + "f 1 2 3\n")
    with pytest.raises(BadInput, match=r"a\.obj: names: its vertices have no vx, vy, vz$"):
        meshes.read_surface(tmp_path / "a.obj", "key", ["vx", "vy", "vz"], "names")


USDA = """#usda 1.0
( upAxis = "Z" )
def Xform "turned" {
    double3 xformOp:translate = (10, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def Mesh "one" {
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
        vector3f[] primvars:flow = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)] ( interpolation = "vertex" )
    }
}
"""


def test_usd_files_are_surfaces_with_a_primvar_as_field_y_up(tmp_path: Path) -> None:
    (tmp_path / "a.usda").write_text(USDA)
    vertices, faces, vectors = meshes.read_surface(tmp_path / "a.usda", "key", ["flow"], "names")
    expected = {(10, 0, 0): (1, 0, 0), (11, 0, 0): (0, 0, -1), (11, 0, -1): (0, 1, 0), (10, 0, -1): (1, 1, -1)}
    assert {tuple(v): tuple(f) for v, f in zip(vertices.tolist(), vectors.tolist(), strict=True)} == expected
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    np.testing.assert_allclose(np.cross(b - a, c - a), np.broadcast_to([0, 1, 0], (2, 3)))


@pytest.mark.parametrize(("old", "new", "reason"), [
    (", (1, 1, 1)]", "]", r"key: /turned/one has 4 vertices, and flow is of shape \(3, 3\)"),
    ("primvars:flow", "primvars:other", "names: its meshes have no primvar flow"),
    ("[0, 1, 2, 3]", "[0, 1, 2, 7]", "key: /turned/one names a vertex that does not exist"),
])
def test_what_a_usd_file_lacks_is_told(tmp_path: Path, old: str, new: str, reason: str) -> None:
    (tmp_path / "a.usda").write_text(USDA.replace(old, new))
    with pytest.raises(BadInput, match=rf"a\.usda: {reason}"):
        meshes.read_surface(tmp_path / "a.usda", "key", ["flow"], "names")
