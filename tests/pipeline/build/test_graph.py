"""The build graph on tiny scenes: what it makes, what it makes again, and what it leaves alone."""

import hashlib
import json
import os
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tiny
from tiny import SCENES, SMOKE

from pipeline import stages
from pipeline.build import manifest
from pipeline.build.artifact import FOLDERS, Artifact
from pipeline.build.graph import BuildGraph
from pipeline.build.method import Method
from pipeline.build.view import Undeclared
from pipeline.errors import BadInput
from pipeline.files import atomic
from pipeline.files.format import Format
from pipeline.scene import load
from pipeline.tables import PROJECT_SCENES, FigureTable, SceneTables


def made(folder: Path, text: str = SMOKE, stage: str = "figure", frames: list[int] | None = None) -> Path:
    """out/tiny after running `stage` on a scene with `text`."""
    return tiny.made(folder, text, stage, frames).root


def bits(root: Path) -> dict[str, str]:
    """SHA-256 of every file under `root`, by its path."""
    return {file.relative_to(root).as_posix(): hashlib.sha256(file.read_bytes()).hexdigest()
            for file in sorted(root.rglob("*")) if file.is_file()}


def births(root: Path) -> dict[str, int]:
    """The inode of every product under `root`: another one if the file was written again."""
    return {file.relative_to(root).as_posix(): file.stat().st_ino
            for file in sorted(root.rglob("*")) if file.is_file() and file.name != manifest.MANIFEST}


def remade(root: Path, before: dict[str, int]) -> set[str]:
    """The products that are new or were written again, their frame numbers left out."""
    return {path.split(".")[0] for path, inode in births(root).items() if before.get(path) != inode}


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """out/tiny of an uninterrupted run; not to be changed."""
    return made(tmp_path_factory.mktemp("finished"))


@pytest.fixture(scope="module")
def reference(finished: Path) -> dict[str, str]:
    """The bits of an uninterrupted run."""
    return bits(finished)


@pytest.fixture
def root(finished: Path, tmp_path: Path) -> Path:
    """A copy of an uninterrupted run, in tmp_path/out/tiny."""
    return shutil.copytree(finished, tmp_path / "out" / "tiny")


def test_every_stage_fills_its_folder_and_ends_with_its_manifest(reference: dict[str, str]) -> None:
    frames = [f"{n:04d}.exr" for n in (1, 2, 3)]
    series = ["fields/L", "fields/H", "geometry/F", "geometry/density", "images/coarse-lines", "images/beauty"]
    assert set(reference) == {
        *(f"{name}.{frame}" for name in series for frame in frames), "fields/exemplar.exr", "images/input.exr",
        "tiny.png", "tiny.mp4", "manifest.json", "fields/manifest.json", "geometry/manifest.json",
        "images/manifest.json"}


def test_a_second_run_writes_nothing_and_touching_changes_nothing(root: Path, tmp_path: Path) -> None:
    before = births(root)
    stamps = {file: file.stat().st_mtime_ns for file in root.rglob("*")}
    made(tmp_path)
    assert {file: file.stat().st_mtime_ns for file in root.rglob("*")} == stamps
    for file in root.rglob("*.exr"):
        os.utime(file)
    made(tmp_path)
    assert remade(root, before) == set()


@pytest.mark.parametrize(("old", "new", "expected"), [
    ("width = 32", "width = 24", {"images/beauty", "tiny"}),
    ("m = 2", "m = 1", {"geometry/density", "images/beauty", "tiny"}),
    ("omega = 1.5", "omega = 2.5", {"geometry/F", "geometry/density", "images/beauty", "tiny"}),
    ('"circle"', '"square"', {"fields/exemplar", "fields/H", "geometry/F", "geometry/density", "images/input",
                              "images/beauty", "tiny"}),
    ('"rotation"', '"shear"', {"fields/L", "fields/H", "geometry/F", "geometry/density", "images/coarse-lines",
                               "images/beauty", "tiny"}),
    ("iterations = 1", "iterations = 2", {"fields/H", "geometry/F", "geometry/density", "images/beauty", "tiny"}),
    ("panel = 32", 'panel = 32\nlabels = ["a", "b", "c"]', {"tiny"}),
    ('title = "A tiny circle"', 'title = "Another title"', set()),
    ('"input", ', "", {"tiny"}),
])
def test_a_change_makes_again_what_it_changes_and_no_more(root: Path, tmp_path: Path, old: str, new: str,
                                                          expected: set[str]) -> None:
    before = births(root)
    assert old in SMOKE
    made(tmp_path, SMOKE.replace(old, new))
    assert remade(root, before) == expected


def test_what_a_scene_no_longer_shows_is_removed(root: Path, tmp_path: Path) -> None:
    (root / "images" / "mine.txt").write_text("mine")
    made(tmp_path, SMOKE.replace('"input", ', "").replace("frames = 3", "frames = 2"))
    names = {file.name for file in root.rglob("*") if file.is_file()}
    assert "input.exr" not in names
    assert not any(".0003." in name for name in names)
    assert "mine.txt" in names


def test_a_longer_animation_keeps_the_frames_it_has(tmp_path: Path, reference: dict[str, str]) -> None:
    root = made(tmp_path, SMOKE.replace("frames = 3", "frames = 2"), "render")
    before = births(root)
    made(tmp_path)
    assert all(births(root)[path] == inode for path, inode in before.items())
    assert bits(root) == reference


@pytest.mark.parametrize(("path", "how"), [
    ("fields/H.0002.exr", "deleted"), ("fields/H.0003.exr", "flipped"), ("fields/L.0003.exr", "truncated"),
    ("fields/exemplar.exr", "empty"), ("geometry/density.0002.exr", "flipped"), ("geometry/F.0001.exr", "empty"),
    ("images/beauty.0003.exr", "truncated"), ("tiny.png", "flipped"), ("tiny.mp4", "deleted"),
])
def test_a_deleted_or_damaged_file_is_made_again_and_it_alone(root: Path, tmp_path: Path, path: str, how: str,
                                                              reference: dict[str, str]) -> None:
    before = births(root)
    file = root / path
    content = bytearray(file.read_bytes())
    file.unlink()
    if how == "truncated":
        file.write_bytes(content[: len(content) // 2])
    elif how == "flipped":
        content[len(content) // 2] ^= 1
        file.write_bytes(content)
    elif how == "empty":
        file.touch()
    made(tmp_path)
    assert bits(root) == reference
    assert {p for p, inode in births(root).items() if before[p] != inode} <= {path}


def test_a_damaged_manifest_costs_time_but_no_bits(root: Path, tmp_path: Path, reference: dict[str, str]) -> None:
    for folder in ("fields", "geometry"):
        (root / folder / "manifest.json").write_text('{"files": ')
    made(tmp_path)
    assert bits(root) == reference


class Stopped(BaseException):
    """What a test stops the work with."""


@pytest.mark.parametrize("stop", [1, 3, 6, 7, 9, 12, 15, 19, 22])  # of 22 files: each product once
def test_an_interrupted_run_goes_on_with_the_same_bits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stop: int,
                                                       reference: dict[str, str]) -> None:
    add, count = manifest.Folder.add, 0

    def counted(self: manifest.Folder, name: str, key: str) -> manifest.Entry:
        nonlocal count
        count += 1
        if count == stop:
            raise Stopped  # the file is there, its note is not: the hardest moment
        return add(self, name, key)

    monkeypatch.setattr(manifest.Folder, "add", counted)
    with pytest.raises(Stopped):
        made(tmp_path)
    root = tmp_path / "out" / "tiny"
    whole = len(births(root)) - 1
    count = -1000
    made(tmp_path)
    assert bits(root) == reference
    assert count + 1000 <= 22 - whole + stop, "the whole frames were made again"


def test_a_state_of_another_scene_is_not_gone_on_from(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                                      reference: dict[str, str]) -> None:
    add = manifest.Folder.add

    def stopping(self: manifest.Folder, name: str, key: str) -> manifest.Entry:
        if name == "H.0003.exr":
            raise Stopped
        return add(self, name, key)

    with monkeypatch.context() as patch:
        patch.setattr(manifest.Folder, "add", stopping)
        with pytest.raises(Stopped):
            made(tmp_path, SMOKE.replace('"circle"', '"square"'))
    assert list((tmp_path / "out" / "tiny" / "fields" / manifest.JOURNAL).glob("*.npz"))
    assert bits(made(tmp_path)) == reference


def test_frames_baked_and_rendered_apart_are_the_same(tmp_path: Path, reference: dict[str, str]) -> None:
    made(tmp_path, stage="synth")
    for verb in ("bake", "render"):
        made(tmp_path, stage=verb, frames=[3])
        folder = tmp_path / "out" / "tiny" / {"bake": "geometry", "render": "images"}[verb]
        assert not (folder / "manifest.json").exists()
        made(tmp_path, stage=verb, frames=[1])
        made(tmp_path, stage=verb, frames=[2, 3])
    assert bits(made(tmp_path)) == reference


def test_a_stage_asked_for_frames_does_not_run_the_stages_before_it(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="run flowloom synth"):
        made(tmp_path, stage="bake", frames=[1])
    made(tmp_path, stage="synth")
    with pytest.raises(BadInput, match="run flowloom bake"):
        made(tmp_path, stage="render", frames=[1])


VARIANTS = SMOKE.replace('panels = ["input", "coarse", "result"]', 'panels = ["result"]') + """\
[variants.naive]
"density.scheme" = "naive"
[variants."m = 1"]
"density.m" = 1
[variants."m = 2"]
"""


def test_variants_share_what_they_do_not_change(tmp_path: Path, reference: dict[str, str]) -> None:
    root = made(tmp_path, VARIANTS)
    found = bits(root)
    assert {path: found[path] for path in found if path.startswith("fields/H")} == {
        path: reference[path] for path in reference if path.startswith("fields/H")}
    assert sorted(p.name for p in (root / "geometry").iterdir() if p.is_dir()) == ["m-1", "m-2", "naive"]
    assert sorted(p.name for p in (root / "geometry").iterdir() if p.is_file()) == [
        "F.0001.exr", "F.0002.exr", "F.0003.exr", "manifest.json"]
    assert found["geometry/m-2/density.0003.exr"] == reference["geometry/density.0003.exr"]
    assert found["geometry/naive/density.0003.exr"] != reference["geometry/density.0003.exr"]


def test_variants_of_the_past_leave_no_folders(tmp_path: Path, reference: dict[str, str]) -> None:
    made(tmp_path, VARIANTS)
    root = made(tmp_path)
    assert bits(root) == reference
    assert not [path for path in root.rglob("*") if path.is_dir() and path.parent != root]
    made(tmp_path, VARIANTS)
    assert not list((root / "images").glob("*.exr"))


def test_the_manifest_says_what_each_file_was_made_from(tmp_path: Path) -> None:
    root = made(tmp_path, stage="synth")
    said = json.loads((root / "fields" / "manifest.json").read_text())
    assert said["stage"] == "synth"
    for name, entry in said["files"].items():
        content = (root / "fields" / name).read_bytes()
        assert entry["size"] == len(content)
        assert entry["sha256"] == hashlib.sha256(content).hexdigest()
    assert len({entry["key"] for entry in said["files"].values()}) == 7


def test_values_that_no_schema_can_know_are_bad_input(tmp_path: Path) -> None:
    from pipeline.files import pictures

    pictures.write(tmp_path / "blank.png", np.zeros((32, 32)))
    text = SMOKE.replace('kind = "circle"', 'kind = "bitmap"\nfile = "blank.png"')
    with pytest.raises(BadInput, match=r"exemplar: .*blank"):
        made(tmp_path, text)


SEAWEED = SMOKE.replace("frames = 3", "frames = 4").replace("size = [8, 8]", "size = [8, 4, 8]").replace(
    "size = [16, 16]", "size = [16, 8, 16]").replace('"rotation"', '"constant"').replace(
    '["input", "coarse", "result"]', '["exemplar-colour", "result"]').replace('kind = "lit"\nwidth = 32', """\
kind = "seaweed"
width = 32
height = 18
spp = 1
[blades]
spacing = 0.4
window = 3""")


def test_seaweed_through_the_whole_chain(tmp_path: Path) -> None:
    """Figure 9 of ma09 in small: each stage leaves its files, a change makes again what it changes, and the blades of
    one frame, made apart, are those of all frames made in a row."""
    root = made(tmp_path, SEAWEED)
    whole, before = bits(root), births(root)
    for series in ("fields/L.{}.vdb", "fields/H.{}.vdb", "geometry/F.{}.vdb", "geometry/blades.{}.ply",
                   "images/beauty.{}.exr"):
        assert {series.format(f"{n:04d}") for n in range(1, 5)} <= set(whole)
    assert {"tiny.png", "tiny.mp4", "fields/exemplar.exr", "images/exemplar-colour.exr"} <= set(whole)
    assert whole["geometry/blades.0003.ply"] != whole["geometry/blades.0004.ply"]

    for frame in (2, 4):
        (root / "geometry" / f"blades.{frame:04d}.ply").unlink()
    made(tmp_path, SEAWEED, "bake", frames=[4])
    made(tmp_path, SEAWEED, "bake", frames=[2])
    assert remade(root, before) == {"geometry/blades"}
    assert bits(made(tmp_path, SEAWEED)) == whole

    made(tmp_path, SEAWEED.replace("window = 3", "window = 2"))
    assert remade(root, before) == {"geometry/blades", "images/beauty", "tiny"}


@pytest.mark.parametrize("scene", ["ma13-fig01", "ma13-fig08", "ma09-fig04"])
def test_an_artifact_comes_after_what_any_variant_makes_it_from(scene: str, tmp_path: Path) -> None:
    """Variants need not have the same artifacts: some have obstacles, a flow, a coarse motion of threads."""
    graph = stages.graph_of(load(PROJECT_SCENES / f"{scene}.toml", quick=True), tmp_path)
    for stage in FOLDERS:
        order = graph._in_order(stage)
        for artifacts in graph.artifacts.values():
            for artifact in artifacts.values():
                if artifact.stage != stage:
                    continue
                before = [other for other, _ in artifact.inputs if artifacts[other].stage == stage]
                assert all(order.index(other) < order.index(artifact.name) for other in before)


# -- a method of the test's own: what is declared is all that can be read -------------------------------------------


class Toy(SceneTables):
    """A scene of a method with three numbers."""

    a: int = 1
    b: int = 2
    figure: FigureTable = FigureTable()


def _write(file: Path, value: int) -> None:
    atomic.write_text(file, str(value))


def _read(file: Path) -> int:
    return int(file.read_text())


NUMBER = Format("txt", _write, _read)
MADE: list[str] = []


def make_sum(scene: Any, inputs: Any, frames: list[int]) -> Iterator[tuple[int, int]]:
    for frame in frames:
        yield frame, scene.a + frame


def make_both(scene: Any, inputs: Any, frames: list[int]) -> Iterator[tuple[int, int]]:
    for frame in frames:
        yield frame, scene.a + scene.b


def make_of_sum(scene: Any, inputs: Any, frames: list[int], back: int = 0, name: str = "sum",
                ) -> Iterator[tuple[int, int]]:
    for frame in frames:
        yield frame, 10 * inputs.read(name, frame - back)


def make_database(scene: Any, inputs: Any, frames: list[int]) -> Iterator[tuple[int, int]]:
    MADE.append("database")
    yield 0, 7 * scene.b


SUM = Artifact("sum", "synth", NUMBER, ("a",), (), make_sum)
OF_SUM = Artifact("tens", "bake", NUMBER, (), (("sum", "same"),), make_of_sum)
DATABASE = Artifact("database", "synth", NUMBER, ("b",), (), make_database, animated=False, shared=True)


def toy(folder: Path, *artifacts: Artifact, name: str = "toy", quick: bool = False, **values: int) -> BuildGraph:
    """The build graph of a toy scene, its stages run."""
    method = Method("toy", "a", Toy, (), lambda scene: artifacts, lambda scene: ())
    scenes = {"": Toy(title=name, frames=3, **values)}
    graph = BuildGraph(method, folder / f"{name}.toml", scenes, folder / "out", quick)
    for stage in FOLDERS:
        graph.make(stage, None, tiny.QUIET)
    return graph


def test_what_is_declared_is_made(tmp_path: Path) -> None:
    graph = toy(tmp_path, SUM, OF_SUM)
    assert [graph.read("", "tens", frame) for frame in (1, 2, 3)] == [20, 30, 40]


@pytest.mark.parametrize(("artifact", "told"), [
    (replace(SUM, make=make_both), "sum reads b, which it does not declare"),
    (replace(SUM, reads=()), "sum reads a, which it does not declare"),
    (replace(OF_SUM, inputs=()), r"tens reads sum of frame 1 for frame 1, .* \(not an input\)"),
    (replace(OF_SUM, arguments={"back": 1}), r"tens reads sum of frame 0 for frame 1, .* \(same\)"),
    (replace(OF_SUM, arguments={"back": -1}, inputs=(("sum", "until"),)), r"tens reads sum of frame 2 for frame 1"),
    (replace(OF_SUM, arguments={"name": "database"}), "tens reads database"),
])
def test_what_is_not_declared_raises_and_is_named_by_key_and_artifact(tmp_path: Path, artifact: Artifact,
                                                                      told: str) -> None:
    """D5: such an artifact would stay as it is when what it reads in secret changes."""
    made = {one.name: one for one in (SUM, DATABASE, OF_SUM)} | {artifact.name: artifact}
    with pytest.raises(Undeclared, match=told):
        toy(tmp_path, *made.values())
    assert not list((tmp_path / "out").rglob(f"{artifact.name}.*.txt"))


def test_a_frame_before_may_be_read_where_all_until_then_are_declared(tmp_path: Path) -> None:
    late = replace(OF_SUM, inputs=(("sum", "until"),), arguments={"back": 0})
    assert toy(tmp_path, SUM, late).read("", "tens", 3) == 40


def test_what_belongs_to_no_scene_is_made_once_for_all(tmp_path: Path) -> None:
    """okabe11's database: minutes to make, and hundreds of megabytes."""
    MADE.clear()
    uses = replace(OF_SUM, inputs=(("database", "once"),), make=make_of_database)
    first = toy(tmp_path, DATABASE, uses, name="first")
    assert first.read("", "tens", 1) == 140
    second = toy(tmp_path, DATABASE, uses, name="second", a=5)
    quick = toy(tmp_path, DATABASE, uses, name="first", quick=True)
    assert MADE == ["database"]
    assert {graph.file("", "database", 0) for graph in (first, second, quick)} == {
        next((tmp_path / "out" / "shared").rglob("database.txt"))}
    assert json.loads((first.file("", "database", 0).parent / "manifest.json").read_text())["stage"] == "synth"


def test_other_content_has_another_folder_and_leaves_the_first_alone(tmp_path: Path) -> None:
    MADE.clear()
    one, other = toy(tmp_path, DATABASE), toy(tmp_path, DATABASE, name="other", b=3)
    assert (one.read("", "database", 0), other.read("", "database", 0), MADE) == (14, 21, ["database"] * 2)
    toy(tmp_path, DATABASE)
    assert MADE == ["database"] * 2


def make_of_database(scene: Any, inputs: Any, frames: list[int]) -> Iterator[tuple[int, int]]:
    for frame in frames:
        yield frame, 10 * inputs.read("database")


def test_a_damaged_shared_file_is_made_again(tmp_path: Path) -> None:
    MADE.clear()
    toy(tmp_path, DATABASE).file("", "database", 0).write_text("8")
    assert toy(tmp_path, DATABASE).read("", "database", 0) == 14
    assert MADE == ["database"] * 2


def test_a_check_of_a_frame_refuses_before_it_is_made(tmp_path: Path) -> None:
    checked = replace(OF_SUM, check_frame=refuse_above_25, reads=("a",))
    with pytest.raises(BadInput, match="a: 30 is too much"):
        toy(tmp_path, SUM, checked)
    assert [file.name for file in sorted((tmp_path / "out" / "toy" / "geometry").glob("tens.*"))] == ["tens.0001.txt"]


def refuse_above_25(scene: Any, inputs: Any, frame: int) -> None:
    if 10 * inputs.read("sum", frame) > 25:
        raise ValueError(f"{10 * inputs.read('sum', frame)} is too much")


@pytest.mark.parametrize("text", SCENES.values(), ids=SCENES)
def test_a_frame_has_the_same_bits_whichever_others_are_made_with_it(tmp_path: Path, text: str) -> None:
    """What is carried from one frame to the next, or decided by the frames asked for, is in no key."""
    together = tiny.made(tmp_path, text, "render")
    expected = bits(together.root)
    frames = [artifact.frames(together.variants[""]) for artifact in together.artifacts[""].values()]
    for folder in ("geometry", "images"):
        shutil.rmtree(together.root / folder, ignore_errors=True)
    for stage in ("bake", "render"):
        for frame in reversed(range(1, max(map(len, frames)) + 1)):
            tiny.made(tmp_path, text, stage, [frame])
    assert bits(tiny.made(tmp_path, text, "render").root) == expected
