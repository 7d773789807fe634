"""A product: what its files are called, and that its tables change exactly when what it reads does."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from test_cli import SCENE
from test_elements_schema import TRACKS

from pipeline import stages
from pipeline.listing import project_scenes
from pipeline.product import Product, Stock, value_at
from pipeline.scene import load
from pipeline.schema import Scene

BITMAP = SCENE.replace('kind = "stripes"', 'kind = "bitmap"\nfile = "a.png"')


def make(scene: Scene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, Any]]:
    raise AssertionError("no test here makes it")


def product(*reads: str, animated: bool = True) -> Product:
    return Product("P", "synth", "fields", lambda scene: "exr" if scene.fps > 20 else "vdb", reads, (), (), make,
                   write=lambda file, value, scene: None, read=lambda file, scene: None, animated=animated)


def scene(folder: Path, text: str = SCENE) -> Scene:
    (folder / "tiny.toml").write_text(text)
    return load(folder / "tiny.toml").variants[""]


def test_a_series_is_numbered_from_1_and_a_single_file_is_not(tmp_path: Path) -> None:
    tiny = scene(tmp_path)
    series, single = product(), product(animated=False)
    assert [series.file(tiny, frame) for frame in series.frames(tiny)] == ["P.0001.exr", "P.0002.exr"]
    assert [single.file(tiny, frame) for frame in single.frames(tiny)] == ["P.exr"]


def test_names_sort_as_frames_do_and_the_scene_chooses_the_suffix(tmp_path: Path) -> None:
    slow = scene(tmp_path, SCENE.replace("frames = 2", "frames = 9999\nfps = 12"))
    names = [product().file(slow, frame) for frame in product().frames(slow)]
    assert names == sorted(names)
    assert (len(set(names)), names[-1]) == (9999, "P.9999.vdb")


@pytest.mark.parametrize(("old", "new", "changed"), [
    ("omega = 0.5", "omega = 0.75", {"combine"}),
    ('kind = "stripes"', 'kind = "circle"', {"exemplar"}),
    ("iterations = 1", "iterations = 2", {"detail"}),
    ("size = [8, 8]\niterations", "size = [16, 16]\niterations", {"detail", "detail.size"}),
    ("frames = 2", "frames = 3", set()),
    ('title = "Stripes', 'title = "Lines', set()),
])
def test_tables_change_with_what_is_read_and_with_nothing_else(tmp_path: Path, old: str, new: str,
                                                               changed: set[str]) -> None:
    assert old in SCENE
    before, after = scene(tmp_path), scene(tmp_path, SCENE.replace(old, new))
    keys = {"exemplar", "detail", "detail.size", "combine", "seed"}
    assert {key for key in keys if product(key).tables(before) != product(key).tables(after)} == changed


def test_tables_are_json_and_come_back_as_they_were(tmp_path: Path) -> None:
    tables = product("detail", "detail.size", "render", "figure", "combine.nothing").tables(scene(tmp_path))
    assert json.loads(json.dumps(tables)) == tables
    assert (tables["detail.size"], tables["detail"]["iterations"]) == ([8, 8], 1)
    assert tables["combine.nothing"] is None


def test_a_file_counts_by_its_bytes_and_not_by_its_name(tmp_path: Path) -> None:
    exemplar = product("seed", "exemplar")
    (tmp_path / "a.png").write_bytes(b"one")
    (tmp_path / "b.png").write_bytes(b"one")
    one = exemplar.tables(scene(tmp_path, BITMAP))
    assert exemplar.tables(scene(tmp_path, BITMAP.replace("a.png", "b.png"))) == one
    (tmp_path / "a.png").write_bytes(b"two")
    two = exemplar.tables(scene(tmp_path, BITMAP))
    assert two["exemplar"].pop("file") != one["exemplar"].pop("file")
    assert two == one


def test_only_what_is_read_makes_it_depend_on_files(tmp_path: Path) -> None:
    (tmp_path / "a.png").touch()
    bitmap, stripes = scene(tmp_path, BITMAP), scene(tmp_path)
    assert product("seed", "exemplar").reads_files(bitmap)
    assert not product("seed", "coarse").reads_files(bitmap)
    assert not product("seed", "exemplar").reads_files(stripes)


def test_every_key_that_a_product_reads_is_one_that_scenes_have() -> None:
    """A misspelt key would be None for ever: a change to it would re-make nothing."""
    known, read = set(), set()
    for one in (one for file in project_scenes() for one in load(file).variants.values()):
        for key in (key for made in stages.products(one).values() for key in made.reads):
            read.add(key)
            parent, _, last = key.rpartition(".")
            if hasattr(value_at(one, parent) if parent else one, last):
                known.add(key)
    assert read
    assert not read - known


def test_a_folder_counts_with_each_of_its_files(tmp_path: Path) -> None:
    (tmp_path / "school").mkdir()
    for frame in (1, 2):
        (tmp_path / "school" / f"{frame}.ply").write_text(f"frame {frame}")
    (tmp_path / "tiny.toml").write_text(TRACKS.replace("FILE", "school"))
    tracked, reads = load(tmp_path / "tiny.toml").variants[""], product("exemplar")
    before = reads.tables(tracked)
    assert reads.reads_files(tracked)
    (tmp_path / "school" / "2.ply").write_text("frame two")
    assert reads.tables(tracked) != before
    (tmp_path / "school" / "2.ply").write_text("frame 2")
    assert reads.tables(tracked) == before
    (tmp_path / "school" / "3.ply").write_text("frame 3")
    assert reads.tables(tracked) != before
