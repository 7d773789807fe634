"""Surfaces: what each kind gives, what is no surface or no field, and the file of the surface."""

from pathlib import Path

import meshes as small
import numpy as np
import pytest
from tiny import TEXTURE_ON_SURFACE, Memory, changed, complaint, contents, graph, made, scene, written

from pipeline import cli
from pipeline.errors import BadInput, InvalidValue
from pipeline.files import meshes
from pipeline.texture.surfaces import check_surface, made_surface, make_surface, pixel, read_back
from synth.texture.atlas import Atlas
from synth.texture.mesh import length

FILE = changed(TEXTURE_ON_SURFACE, 'kind = "torus"', 'kind = "file"\nfile = "a.ply"').replace(
    'kind = "around"', 'kind = "around", axis = [0, 0, 1]')
AROUND_Z = 'kind = "around", axis = [0, 0, 1]'
BY_VERTICES = changed(FILE, AROUND_Z, 'kind = "vertices"')


def along(direction: str) -> str:
    """The scene of a file along a direction in space."""
    return changed(FILE, AROUND_Z, f'kind = "direction", direction = {direction}')


def ply(path: Path, vertices: np.ndarray, faces: np.ndarray, **attributes: np.ndarray) -> None:
    """A PLY file of anything, good or bad."""
    names = [*"xyz", *attributes]
    columns = np.column_stack([*np.asarray(vertices, float).T, *attributes.values()])
    head = ["ply", "format ascii 1.0", f"element vertex {len(vertices)}", *(f"property float {n}" for n in names),
            f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    rows = [" ".join(map(str, row)) for row in columns] + [f"3 {a} {b} {c}" for a, b, c in faces]
    path.write_text("\n".join([*head, *rows]) + "\n")


def refuse(folder: Path, text: str) -> None:
    """Run a scene, which ends with exit code 2 and has written nothing."""
    with pytest.raises(SystemExit) as ended:
        cli.main(["synth", str(written(folder, text)), "--out", str(folder / "out")])
    assert ended.value.code == 2
    assert not (folder / "out").exists()


SQUARE = small.square(4, 6, 0.1)


@pytest.mark.parametrize("kind", ["vase", "torus"])
def test_a_procedure_gives_a_mesh_that_the_patches_need(tmp_path: Path, kind: str) -> None:
    one = scene(tmp_path, changed(TEXTURE_ON_SURFACE, '"torus"', f'"{kind}"'))
    mesh, field = made_surface(one)
    size = pixel(one, mesh.vertices)
    np.testing.assert_allclose(size, 0.6 / 32, rtol=0.04)  # coarse
    assert mesh.longest <= 12 * size
    assert field.shape == mesh.vertices.shape and length(field).max() > 0


def test_a_file_is_refined_and_keeps_its_place(tmp_path: Path) -> None:
    ply(tmp_path / "a.ply", SQUARE.vertices + np.array([5, 0, 0]), SQUARE.faces)
    one = scene(tmp_path, changed(FILE, "scale = 0.6", "scale = 0.2"))
    mesh, _ = made_surface(one)
    assert len(mesh.faces) > len(SQUARE.faces)
    np.testing.assert_allclose(mesh.vertices.min(axis=0), [5, 0, 0], atol=1e-6)
    np.testing.assert_allclose(mesh.areas.sum(), 0.24, rtol=1e-5)


def test_a_direction_is_projected_and_vectors_of_vertices_are_read(tmp_path: Path) -> None:
    v = np.stack([np.ones(35), SQUARE.vertices[:, 0], np.full(35, 7.0)], axis=-1)
    ply(tmp_path / "a.ply", SQUARE.vertices, SQUARE.faces, vx=v[:, 0], vy=v[:, 1], vz=v[:, 2])
    mesh, field = made_surface(scene(tmp_path, along("[0, 2, 9]")))
    np.testing.assert_allclose(field, np.broadcast_to([0, 2.0, 0], field.shape), atol=1e-9)
    mesh, field = made_surface(scene(tmp_path, BY_VERTICES))
    np.testing.assert_allclose(field, np.stack([0 * field[:, 0] + 1, mesh.vertices[:, 0], 0 * field[:, 0]], -1),
                               atol=1e-6)


def test_vertices_at_one_place_are_one(tmp_path: Path) -> None:
    """As STL has them, and OBJ at seams of its texture: else the texture would end there."""
    ply(tmp_path / "a.ply", SQUARE.vertices[SQUARE.faces].reshape(-1, 3), np.arange(144).reshape(-1, 3))
    mesh, _ = made_surface(scene(tmp_path, FILE))
    border = length(np.roll(mesh.corners, -1, axis=1) - np.roll(mesh.corners, -2, axis=1))[mesh.beside < 0]
    np.testing.assert_allclose(border.sum(), 2.0, rtol=1e-5)  # round 0.4 × 0.6


THREE = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1]])
BAD = {
    "no faces": (SQUARE.vertices, np.zeros((0, 3), int), FILE, "surface.file: holds no mesh"),
    "NaN": (SQUARE.vertices * [np.nan, 1, 1], SQUARE.faces, FILE, "surface.file: the vertices hold NaN or infinity"),
    "flat triangles": (SQUARE.vertices @ [[1, 0, 0], [0.37, 0, 0], [0, 0, 0]], SQUARE.faces, FILE,
                       "surface.file: 48 triangles have no area"),
    "triangles that are points": (0 * SQUARE.vertices, SQUARE.faces, FILE,
                                  "surface.file: its triangles have no area"),
    "three at an edge": (THREE, [[0, 1, 2], [1, 0, 3], [0, 1, 4]], FILE,
                         "surface.file: an edge at (0.5, 0, 0) has 3 triangles"),
    "turned": (SQUARE.vertices, np.concatenate([SQUARE.faces[:24], SQUARE.faces[24:, ::-1]]), FILE,
               "are turned different ways round; orient them alike"),
    "no such vectors": (SQUARE.vertices, SQUARE.faces, BY_VERTICES,
                        "surface.field.attribute: its vertices have no vx, vy, vz, but x, y, z"),
    "normal": (SQUARE.vertices, SQUARE.faces, along("[0, 0, 1]"),
               "surface.field: is normal to the surface everywhere"),
    "nowhere": (SQUARE.vertices, SQUARE.faces, along("[0, 0, 0]"),
                "surface.field: is zero everywhere"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_is_no_surface_is_one_line_and_nothing_is_written(tmp_path: Path, name: str,
                                                               capsys: pytest.CaptureFixture[str]) -> None:
    vertices, faces, text, reason = BAD[name]
    ply(tmp_path / "a.ply", vertices, faces)
    refuse(tmp_path, text)
    line = capsys.readouterr().err.strip()
    assert "\n" not in line and "a.ply: surface." in line and reason in line


@pytest.mark.parametrize(("values", "reason"), [(0.0, "is zero everywhere"), (np.nan, "holds NaN or infinity")])
def test_vectors_that_lead_nowhere_are_told(tmp_path: Path, values: float, reason: str) -> None:
    v = np.full(35, values)
    ply(tmp_path / "a.ply", SQUARE.vertices, SQUARE.faces, vx=v, vy=v, vz=v)
    with pytest.raises(BadInput, match=rf"a\.ply: surface\.field: {reason}"):
        check_surface(scene(tmp_path, BY_VERTICES))


@pytest.mark.parametrize("name", ["a.ply", "a.obj", "a.stl", "a.usda", "a.txt"])
def test_a_file_that_is_no_mesh_is_told(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("a poem\nof two lines\n")
    with pytest.raises(BadInput, match=rf"{name}: surface\.file: (damaged|is no PLY, OBJ, STL or USD|holds no mesh)"):
        check_surface(scene(tmp_path, FILE.replace("a.ply", name)))


def test_a_texture_too_small_for_the_triangles_is_told(tmp_path: Path) -> None:
    one = scene(tmp_path, changed(TEXTURE_ON_SURFACE, "size = [256, 256]", "size = [48, 48]"))
    with pytest.raises(InvalidValue, match="triangles do not fit into 48×48 texels") as caught:
        check_surface(one)
    assert caught.value.key == "texture.size"


@pytest.mark.parametrize(("old", "new", "reason"), [
    ('kind = "around"', 'kind = "vertices"', 'surface.field.kind: "vertices" are those of a file: there is none with '
                                             'kind = "torus"'),
    ('kind = "around"', 'kind = "around", axis = [0, 0, 0]', "surface.field.axis: is zero"),
    ("[surface]", '[coarse]\nkind = "analytic"\n[surface]', "coarse: is of a texture in the plane, and there is a "
                                                            "[surface]"),
    ("[texture]", '[[obstacles]]\nkind = "ball"\ncentre = [0, 0.5]\nradius = 0.2\n[texture]',
     "obstacles: are of a texture in the plane, and there is a [surface]"),
    ("size = [256, 256]", 'size = [256, 256]\nmethod = "paper"',
     'texture.method: "paper" is of a texture in the plane; on a [surface] it is "carry"'),
    ("size = [256, 256]", "size = [256, 256]\nmaps = true",
     "texture.maps: is of a texture in the plane, and there is a [surface]"),
    ("size = [256, 256]", "size = [256, 256]\ndivergence_free = true",
     "texture.divergence_free: is of a texture in the plane, and there is a [surface]"),
    ("size = [256, 256]", "size = [256, 256]\nloop = true",
     "texture.loop: is of a texture in the plane, and there is a [surface]"),
    ("panel = 32", 'panel = 32\noverlay = "speed"',
     "figure.overlay: is of a texture in the plane, and there is a [surface]"),
    ('"sample", "result"', '"flow", "result"', 'figure.panels: there is no "flow" with a [surface]'),
    ("panel = 32", "panel = 32\nzoom = [0.5, 0.5, 0.2]", "figure.zoom: is of a texture in the plane, and there is a "
                                                         "[surface]"),
    ('kind = "torus"', 'kind = "cube"', "surface.kind: unknown kind 'cube'"),
])
def test_what_does_not_fit_is_one_line(tmp_path: Path, old: str, new: str, reason: str) -> None:
    assert complaint(written(tmp_path, changed(TEXTURE_ON_SURFACE, old, new))).startswith(reason)


def test_the_file_holds_all_that_the_frames_need(tmp_path: Path) -> None:
    one = scene(tmp_path, TEXTURE_ON_SURFACE)
    _, stored = next(make_surface(one, Memory(tmp_path), [0]))
    meshes.SURFACE.write(tmp_path / "surface.ply", stored)
    mesh, field, uv = read_back(meshes.SURFACE.read(tmp_path / "surface.ply"))
    expected, v = made_surface(one)
    np.testing.assert_array_equal(mesh.faces, expected.faces)
    np.testing.assert_allclose(mesh.vertices, expected.vertices, atol=1e-6)
    np.testing.assert_allclose(mesh.normals, expected.normals, atol=1e-6)
    np.testing.assert_allclose(field, v, atol=1e-6)
    assert len(Atlas.of_uv(uv, (256, 256)).texels().number) > 0.5 * 256**2


def test_its_key_is_of_what_it_is_made_from(tmp_path: Path) -> None:
    one = graph(tmp_path, TEXTURE_ON_SURFACE).content_id("", "surface")
    for old, new, same in (("seed = 3", "seed = 4", True), ("size = 32", "size = 40", False),
                           ("scale = 0.6", "scale = 0.7", False), ("size = [256, 256]", "size = [260, 256]", False)):
        assert (graph(tmp_path, changed(TEXTURE_ON_SURFACE, old, new)).content_id("", "surface") == one) == same


def test_a_whole_scene_twice_gives_the_same_files(tmp_path: Path) -> None:
    folders = [tmp_path / name for name in "ab"]
    for folder in folders:
        folder.mkdir()
        made(folder, TEXTURE_ON_SURFACE)
    one, other = (contents(folder / "out") for folder in folders)
    pictures = [name for name in one if name.endswith((".exr", ".ply", ".png", ".mp4"))]
    assert {"tiny/tiny.png", "tiny/tiny.mp4", "tiny/fields/surface.ply", "tiny/fields/frames.0003.exr",
            "tiny/images/beauty.0003.exr"} <= set(pictures)
    assert all(one[name] == other[name] for name in pictures)
