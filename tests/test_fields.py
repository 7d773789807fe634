"""What synth makes: exemplars of every kind, L in world units, H that goes on where it was stopped."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline import fields
from pipeline.files import images, pictures, video, volumes
from pipeline.schema import PROJECT_SCENES, Scene
from synth.field import Field
from synth.motion.exemplar import exemplar


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


@pytest.mark.parametrize("kind", ["bitmap", "drawing", "svg", "exr", "vdb", "clip"])
def test_every_kind_of_file_makes_an_exemplar_in_its_unit(tmp_path: Path, kind: str) -> None:
    made = scene(tmp_path, exemplar=drawn(tmp_path, kind))
    (frame, field), = fields.make_exemplar(made, Memory(tmp_path, {}), [0])
    assert frame == 0
    assert field.values.shape == (16, 16, 2)
    assert np.linalg.norm(field.values, axis=-1).max() == pytest.approx(1.0, abs=1e-6)


def test_a_horizontal_stroke_is_a_flow_to_the_right(tmp_path: Path) -> None:
    for kind in ("drawing", "svg"):
        made = scene(tmp_path, exemplar=drawn(tmp_path, kind))
        (_, field), = fields.make_exemplar(made, Memory(tmp_path, {}), [0])
        assert field.values[7:9, 4:12, 0].min() > 0.5


def test_a_procedure_is_what_the_method_makes(tmp_path: Path) -> None:
    (_, field), = fields.make_exemplar(scene(), Memory(tmp_path, {}), [0])
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


def test_detail_goes_on_from_its_state_with_the_same_bits_and_without_it_from_the_start(tmp_path: Path) -> None:
    made = scene()
    motion = dict(fields.make_coarse(made, Memory(tmp_path, {}), [1, 2, 3, 4]))
    stock = Memory(tmp_path, {("exemplar", 0): Field.centred(exemplar("circle", 8), 2),
                              **{("L", frame): L for frame, L in motion.items()}})
    every = dict(fields.make_detail(made, stock, [1, 2, 3, 4]))
    assert (tmp_path / fields.STATE).is_file()
    assert fields._kept(stock, 4)[0] == 3
    assert dict(fields.make_detail(made, stock, [4])) == {4: every[4]}
    (tmp_path / fields.STATE).write_bytes((tmp_path / fields.STATE).read_bytes()[:-50])
    assert fields._kept(stock, 4) == (0, None)
    assert dict(fields.make_detail(made, stock, [4])) == {4: every[4]}
