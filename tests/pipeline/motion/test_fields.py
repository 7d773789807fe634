"""What synth makes: exemplars of every kind, L in world units, H that goes on where it was stopped."""

import re
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline import fields
from pipeline.files import images, pictures, video, volumes
from pipeline.schema import PROJECT_SCENES, Scene
from synth.field import Field
from synth.motion import lagrangian
from synth.motion.coarse import upsample
from synth.motion.density import naive
from synth.motion.detail import State
from synth.motion.exemplar import exemplar
from synth.motion.local_axes import interpolated_directions, outward


def scene(folder: Path = PROJECT_SCENES, **tables: Any) -> Scene:
    """A small scene with these tables."""
    raw: dict[str, Any] = {
        "title": "small", "frames": 4, "exemplar": {"kind": "circle", "size": 8},
        "coarse": {"kind": "analytic", "flow": "rotation", "size": [8, 8]},
        "detail": {"size": [16, 16], "iterations": 1, "neighborhoods": [5]}, "combine": {"omega": 2.0},
        "render": {"kind": "lit"}}
    return Scene.model_validate({**raw, **tables}, context={"folder": folder})


class Memory:
    """A stock in memory, for one product."""

    def __init__(self, work: Path, files: dict[tuple[str, int], Any]):
        self.work, self.files = work, files

    def read(self, product: str, frame: int = 0) -> Any:
        return self.files[product, frame]

    def own(self, frame: int) -> Any | None:
        return None

    def key(self, frame: int) -> str:
        return f"key of {frame}"


def drawn(folder: Path, kind: str) -> dict[str, Any]:
    """An [exemplar] table of a kind that reads a file, and the file."""
    rng = np.random.default_rng(1)
    x = np.arange(32)
    wave = np.stack([np.sin(x * 0.4)[None] * np.ones((32, 1)), np.cos(x * 0.4)[:, None] * np.ones((1, 32))], -1)
    match kind:
        case "bitmap":
            pictures.write(folder / "a.png", rng.random((32, 32)))
        case "drawing":
            paper = np.ones((64, 64))
            paper[30:34, 8:56] = 0
            pictures.write(folder / "a.png", paper)
        case "svg":
            (folder / "a.svg").write_text(
                '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 10 10"><path d="M1 5 L9 5"/></svg>')
            return {"kind": "drawing", "file": "a.svg", "size": 16}
        case "exr":
            images.write_field(folder / "a.exr", Field.centred(wave, 2))
            return {"kind": "field", "file": "a.exr", "size": 16}
        case "vdb":
            values = np.zeros((3, 32, 32, 3), np.float32)
            values[..., :2] = wave
            volumes.write(folder / "a.vdb", {"vel": Field.centred(values, 3)})
            return {"kind": "field", "file": "a.vdb", "size": 16}
        case "clip":
            blob = np.exp(-((x[:, None] - 16.0) ** 2 + (x - 10.0) ** 2) / 30)
            frames = [np.repeat(np.roll(blob, 2 * i, 1)[..., None], 3, 2) for i in range(4)]
            video.write(folder / "a.mp4", frames, 30)
            return {"kind": "clip", "file": "a.mp4", "size": 16}
    return {"kind": kind, "file": "a.png", "size": 16}


def made_exemplar(scene: Scene, folder: Path) -> Any:
    """What the scene's first product makes."""
    return fields.products(scene)[0].make(scene, Memory(folder, {}), [0])


@pytest.mark.parametrize("kind", ["bitmap", "drawing", "svg", "exr", "vdb", "clip"])
def test_every_kind_of_file_makes_an_exemplar_in_its_unit(tmp_path: Path, kind: str) -> None:
    made = scene(tmp_path, exemplar=drawn(tmp_path, kind))
    (frame, field), = made_exemplar(made, tmp_path)
    assert frame == 0
    assert field.values.shape == (16, 16, 2)
    assert np.linalg.norm(field.values, axis=-1).max() == pytest.approx(1.0, abs=1e-6)


def test_a_horizontal_stroke_is_a_flow_to_the_right(tmp_path: Path) -> None:
    for kind in ("drawing", "svg"):
        made = scene(tmp_path, exemplar=drawn(tmp_path, kind))
        (_, field), = made_exemplar(made, tmp_path)
        assert field.values[7:9, 4:12, 0].min() > 0.5


def test_a_procedure_is_what_the_method_makes(tmp_path: Path) -> None:
    (_, field), = made_exemplar(scene(), tmp_path)
    np.testing.assert_array_equal(field.values, exemplar("circle", 8))


def test_a_coarse_motion_is_stored_in_world_units_per_second(tmp_path: Path) -> None:
    made = scene(coarse={"kind": "analytic", "flow": "constant", "size": [8, 8], "speed": 0.5}, fps=24)
    found = dict(fields.make_coarse(made, Memory(tmp_path, {}), [2, 3]))
    assert sorted(found) == [2, 3]
    # half a cell of an eighth of the height, 24 times a second
    np.testing.assert_allclose(found[2].values[..., 0], 0.5 / 8 * 24)
    cells = fields.coarse_cells(made, Memory(tmp_path, {("L", 2): found[2]}), 2)
    np.testing.assert_allclose(cells[..., 0], 1.0, rtol=1e-6)  # on twice the cells


@pytest.mark.parametrize("coarse", [
    {"kind": "smoke", "size": [8, 8], "warmup": 3}, {"kind": "curl-noise", "size": [8, 8]}])
def test_some_frames_of_a_coarse_motion_are_those_of_all(tmp_path: Path, coarse: dict[str, Any]) -> None:
    made, stock = scene(coarse=coarse), Memory(tmp_path, {})
    every = dict(fields.make_coarse(made, stock, [1, 2, 3, 4]))
    some = dict(fields.make_coarse(made, stock, [3]))
    assert some[3] == every[3]
    assert not np.array_equal(every[2].values, every[3].values)


def test_a_coarse_motion_from_a_file_is_placed_on_the_domain(tmp_path: Path) -> None:
    values = np.full((16, 16, 2), 0.25, np.float32)
    images.write_field(tmp_path / "wind.exr", Field(values, 3.0, (5.0, 5.0)))
    made = scene(tmp_path, coarse={"kind": "file", "file": "wind.exr"})
    found = dict(fields.make_coarse(made, Memory(tmp_path, {}), [1, 4]))
    assert found[1] == found[4] == Field.centred(values, 2)


WAYS: dict[str, tuple[dict[str, str], type]] = {
    "motion": ({}, State), "potential": ({"synthesize": "potential"}, State),
    "lagrangian": ({"samples": "lagrangian"}, lagrangian.State)}


@pytest.mark.parametrize("way", WAYS)
def test_detail_goes_on_from_its_state_with_the_same_bits_and_without_it_from_the_start(
        tmp_path: Path, way: str) -> None:
    keys, state_type = WAYS[way]
    made = scene(detail={"size": [16, 16], "iterations": 1, "neighborhoods": [5], **keys})
    motion = dict(fields.make_coarse(made, Memory(tmp_path, {}), [1, 2, 3, 4]))
    stock = Memory(tmp_path, {("exemplar", 0): Field.centred(exemplar("circle", 8), 2),
                              **{("L", frame): L for frame, L in motion.items()}})
    every = dict(fields.make_detail(made, stock, [1, 2, 3, 4]))
    assert (tmp_path / fields.STATE).is_file()
    assert fields._kept(stock, 4, state_type)[0] == 3
    assert dict(fields.make_detail(made, stock, [4])) == {4: every[4]}
    (tmp_path / fields.STATE).write_bytes((tmp_path / fields.STATE).read_bytes()[:-50])
    assert fields._kept(stock, 4, state_type) == (0, None)
    assert dict(fields.make_detail(made, stock, [4])) == {4: every[4]}


def test_each_way_of_synthesis_is_another(tmp_path: Path) -> None:
    found = {}
    for way, (keys, _) in WAYS.items():
        made = scene(detail={"size": [16, 16], "iterations": 1, "neighborhoods": [5], **keys})
        stock = Memory(tmp_path, {("exemplar", 0): Field.centred(exemplar("circle", 8), 2)})
        stock.files["L", 1] = dict(fields.make_coarse(made, stock, [1]))[1]
        found[way] = dict(fields.make_detail(made, stock, [1]))[1]
        assert found[way].shape == (16, 16)
        assert f"synth.motion.{'detail' if way == 'motion' else way}" in fields.products(made)[-1].methods
    assert found["motion"] != found["potential"] != found["lagrangian"] != found["motion"]


SPACE: dict[str, Any] = {
    "coarse": {"kind": "curl-noise", "size": [8, 10, 6]},
    "detail": {"size": [16, 20, 12], "iterations": 1, "neighborhoods": [5], "levels": 1},
    "density": {"sources": [{"centre": [0.0, 0.4, 0.1], "radius": 0.2}]}, "render": {"kind": "volume"}}
TOP = {"plane": "top", "exemplar": {"kind": "square", "size": 8}}


def test_the_exemplars_of_the_views_are_named_after_them(tmp_path: Path) -> None:
    def names(*views: dict[str, Any]) -> list[str]:
        made = scene(**SPACE, views=list(views))
        return [p.file(made, 0) for p in fields.products(made) if not p.animated]

    side, stripes = {"plane": "side"}, {"kind": "stripes", "size": 8}
    assert names() == ["exemplar.exr"]
    assert names(TOP, side) == ["exemplar-top.exr", "exemplar-side.exr"]
    assert names(TOP, side, {"plane": "front"}) == ["exemplar-top.exr", "exemplar-side.exr"]
    assert names(TOP, TOP | {"plane": "side"}) == ["exemplar.exr"]
    oblique = {"right": [1.0, 1.0, 0.0], "up": [0.0, 0.0, 1.0], "exemplar": stripes}
    assert names(TOP, oblique, side | {"exemplar": stripes}) == ["exemplar-top.exr", "exemplar-2.exr"]
    assert names(TOP, TOP | {"exemplar": stripes}, side) == ["exemplar-1.exr", "exemplar-2.exr", "exemplar-side.exr"]
    made = scene(**SPACE, views=[TOP, side])
    for product, kind in zip(fields.products(made), ("square", "circle"), strict=False):
        (_, field), = product.make(made, Memory(tmp_path, {}), [0])
        np.testing.assert_array_equal(field.values, exemplar(kind, 8))


def volume(folder: Path, size: int = 16) -> np.ndarray:
    """A field in space, in a.vdb with a negative origin and a voxel size of its own."""
    values = np.random.default_rng(3).standard_normal((size, size + 4, size, 3)).astype(np.float32)
    volumes.write(folder / "a.vdb", {"vel": Field(values, 0.25, (-3.0, -1.0, -2.0))})
    return values


def test_a_vdb_is_a_solid_exemplar_in_space_and_a_slice_in_the_plane(tmp_path: Path) -> None:
    values = volume(tmp_path)
    table = {"kind": "field", "file": "a.vdb", "size": 8}
    made = scene(tmp_path, **SPACE | {"exemplar": table})
    product = fields.products(made)[0]
    (_, field), = product.make(made, Memory(tmp_path, {}), [0])
    assert (product.file(made, 0), field.values.shape, len(made.seen)) == ("exemplar.vdb", (8, 8, 8, 3), 1)
    product.write(tmp_path / "exemplar.vdb", field, made)
    assert product.read(tmp_path / "exemplar.vdb", made) == field
    np.testing.assert_allclose(field.values * np.linalg.norm(values[:, 2:-2].reshape(
        8, 2, 8, 2, 8, 2, 3).mean((1, 3, 5)), axis=-1).max(), values[:, 2:-2].reshape(8, 2, 8, 2, 8, 2, 3).mean(
            (1, 3, 5)), atol=1e-5)
    flat = scene(tmp_path, exemplar=table)
    assert next(fields.products(flat)[0].make(flat, Memory(tmp_path, {}), [0]))[1].values.shape == (8, 8, 2)
    assert fields.products(flat)[0].tables(flat) != product.tables(made)


def test_a_coarse_motion_from_a_vdb_is_moved_onto_the_domain_whatever_its_origin(tmp_path: Path) -> None:
    values = volume(tmp_path, 8)
    made = scene(tmp_path, **SPACE | {"coarse": {"kind": "file", "file": "a.vdb"}, "detail": {"size": [16, 24, 16]}})
    found = dict(fields.make_coarse(made, Memory(tmp_path, {}), [1, 2]))
    assert found[1] == found[2] == Field.centred(values, 3)
    assert found[1].origin == pytest.approx((-1 / 3 + 1 / 24, 1 / 24, -1 / 3 + 1 / 24))


def test_files_of_fields_in_space_say_what_they_hold_and_read_back(tmp_path: Path) -> None:
    made = scene(**SPACE)
    products = {p.name: p for p in fields.products(made)}
    (_, L), = fields.make_coarse(made, Memory(tmp_path, {}), [1])
    for name, said in (("L", {"unit": "world units per second", "fps": "30"}),
                       ("H", {"unit": "the exemplar's longest vector", "axes": "local frame"})):
        file = tmp_path / products[name].file(made, 1)
        products[name].write(file, L, made)
        assert file.name == f"{name}.0001.vdb"
        assert volumes.read(file) == {"vel": L}
        assert products[name].read(file, made) == L
        assert volumes.metadata(file) == said


def stocked(made: Scene, folder: Path, frames: int = 4) -> Memory:
    """A stock with the exemplar and L of some frames."""
    files: dict[tuple[str, int], Any] = {("exemplar", 0): Field.centred(exemplar("circle", 8), 2)}
    for frame, L in fields.make_coarse(made, Memory(folder, {}), list(range(1, frames + 1))):
        files["L", frame] = L
    return Memory(folder, files)


def test_the_local_frame_faces_the_camera_the_smoke_or_where_the_user_says(tmp_path: Path) -> None:
    made = scene(**SPACE)
    stock = stocked(made, tmp_path)
    assert [p.name for p in fields.products(made)] == ["exemplar", "L", "H"]
    assert (fields.towards(made, stock, 1) == [0, 0, 1]).all()

    out = scene(**SPACE | {"detail": SPACE["detail"] | {"facing": "density"}})
    assert [p.name for p in fields.products(out)] == ["exemplar", "L", "O", "H"]
    smoke = dict(fields.make_smoke(out, stock, [2, 3]))
    L = [stock.files["L", frame].per_frame(out.fps).values for frame in (1, 2, 3)]
    expected = list(naive(L, fields.sources(out)))
    assert sorted(smoke) == [2, 3]
    np.testing.assert_array_equal(smoke[3].values, expected[2])
    stock.files["O", 3] = smoke[3]
    np.testing.assert_array_equal(fields.towards(out, stock, 3), upsample(outward(expected[2]), (12, 20, 16)))

    placed = [{"at": [0.0, 0.5, 0.0], "vector": [0.0, 0.0, 2.0]}, {"at": [0.2, 0.9, 0.1], "vector": [1.0, 0.0, 0.0]}]
    hand = scene(**SPACE | {"detail": SPACE["detail"] | {"facing": "directions", "directions": placed}})
    # the centre of 16 × 20 × 12 cells; and 4 cells to the right, 8 up, 2 to the front of it
    np.testing.assert_allclose(fields.towards(hand, stock, 1), interpolated_directions(
        np.array([[7.5, 9.5, 5.5], [11.5, 17.5, 7.5]]), np.array([[0, 0, 2.0], [1, 0, 0]]), (12, 20, 16)), atol=1e-5)


@pytest.mark.parametrize("views", [[], [TOP, {"plane": "side", "weight": 2.0}]])
def test_detail_in_space_goes_on_from_its_state_with_the_same_bits(tmp_path: Path, views: list[dict[str, Any]]) -> None:
    made = scene(**SPACE, views=views)
    stock = stocked(made, tmp_path, 3)
    stock.files |= {("exemplar-top", 0): Field.centred(exemplar("square", 8), 2),
                    ("exemplar-side", 0): stock.files["exemplar", 0]}
    every = dict(fields.make_detail(made, stock, [1, 2, 3]))
    assert every[1].values.shape == (12, 20, 16, 3)
    assert not np.array_equal(every[1].values, every[3].values)
    assert dict(fields.make_detail(made, stock, [3])) == {3: every[3]}
    (tmp_path / fields.STATE).unlink()
    assert dict(fields.make_detail(made, stock, [3])) == {3: every[3]}


def test_another_program_opens_what_is_written_the_right_way_up(tmp_path: Path) -> None:
    """OpenVDB's own tool agrees where a marked vector lies: third column, fourth row, first layer of 6 × 5 × 4."""
    made = scene(**SPACE)
    values = np.zeros((4, 5, 6, 3), np.float32)
    values[0, 3, 2] = (1.0, -2.0, 3.0)
    product = next(p for p in fields.products(made) if p.name == "L")
    product.write(tmp_path / "L.vdb", Field.centred(values, 3), made)
    told = subprocess.run(["vdb_print", "-l", "-m", tmp_path / "L.vdb"], capture_output=True, text=True,
                          check=True).stdout
    assert "Name: vel" in told and "Type: Tree_vec3s" in told
    assert "Bounding box of active voxels: [2, 3, 0] -> [2, 3, 0]" in told
    assert re.search(r"Max value: \[1, -2, 3\]", told)
    assert "unit: world units per second" in told
    matrix = [[float(n) for n in row.split(",")] for row in re.findall(r"\[([^\[\]]+)\] ?\n", told)][-4:]
    scale = [[0.2, 0, 0, 0], [0, 0.2, 0, 0], [0, 0, 0.2, 0]]
    np.testing.assert_allclose(matrix, [*scale, [-0.5, 0.1, -0.3, 1]], atol=1e-6)
