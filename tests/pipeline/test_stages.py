"""The stages on a tiny scene: what they make, what they make again, and what they leave alone."""

import hashlib
import json
import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from pipeline import manifest, stages
from pipeline.errors import BadInput
from pipeline.progress import Progress
from pipeline.scene import load
from pipeline.schema import PROJECT_SCENES

SCENE = """\
title = "A tiny circle"
frames = 3
[exemplar]
kind = "circle"
size = 8
[coarse]
kind = "analytic"
flow = "rotation"
size = [8, 8]
[detail]
size = [16, 16]
iterations = 1
neighborhoods = [5]
[combine]
omega = 1.5
[density]
m = 2
scale = 1
[render]
kind = "lit"
width = 32
[figure]
panels = ["input", "coarse", "result"]
panel = 32
"""
QUIET = Progress(quiet=True)


def made(folder: Path, text: str = SCENE, verb: str = "figure", frames: list[int] | None = None,
         out: str = "out") -> Path:
    """out/tiny after running `verb` on a scene with `text`."""
    (folder / "tiny.toml").write_text(text)
    stages.run(verb, load(folder / "tiny.toml"), folder / out, QUIET, frames)
    return folder / out / "tiny"


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
    assert old in SCENE
    made(tmp_path, SCENE.replace(old, new))
    assert remade(root, before) == expected


def test_what_a_scene_no_longer_shows_is_removed(root: Path, tmp_path: Path) -> None:
    (root / "images" / "mine.txt").write_text("mine")
    made(tmp_path, SCENE.replace('"input", ', "").replace("frames = 3", "frames = 2"))
    names = {file.name for file in root.rglob("*") if file.is_file()}
    assert "input.exr" not in names
    assert not any(".0003." in name for name in names)
    assert "mine.txt" in names


def test_a_longer_animation_keeps_the_frames_it_has(tmp_path: Path, reference: dict[str, str]) -> None:
    root = made(tmp_path, SCENE.replace("frames = 3", "frames = 2"), "render")
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
            made(tmp_path, SCENE.replace('"circle"', '"square"'))
    assert list((tmp_path / "out" / "tiny" / "fields" / manifest.NOTES).glob("*.npz"))
    assert bits(made(tmp_path)) == reference


def test_frames_baked_and_rendered_apart_are_the_same(tmp_path: Path, reference: dict[str, str]) -> None:
    made(tmp_path, verb="synth")
    for verb in ("bake", "render"):
        made(tmp_path, verb=verb, frames=[3])
        folder = tmp_path / "out" / "tiny" / {"bake": "geometry", "render": "images"}[verb]
        assert not (folder / "manifest.json").exists()
        made(tmp_path, verb=verb, frames=[1])
        made(tmp_path, verb=verb, frames=[2, 3])
    assert bits(made(tmp_path)) == reference


def test_a_stage_asked_for_frames_does_not_run_the_stages_before_it(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="run flowloom synth"):
        made(tmp_path, verb="bake", frames=[1])
    made(tmp_path, verb="synth")
    with pytest.raises(BadInput, match="run flowloom bake"):
        made(tmp_path, verb="render", frames=[1])


VARIANTS = SCENE.replace('panels = ["input", "coarse", "result"]', 'panels = ["result"]') + """\
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
    root = made(tmp_path, verb="synth")
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
    text = SCENE.replace('kind = "circle"', 'kind = "bitmap"\nfile = "blank.png"')
    with pytest.raises(BadInput, match=r"exemplar: .*blank"):
        made(tmp_path, text)


SEAWEED = SCENE.replace("frames = 3", "frames = 4").replace("size = [8, 8]", "size = [8, 4, 8]").replace(
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
def test_a_product_comes_after_what_any_variant_makes_it_from(scene: str, tmp_path: Path) -> None:
    """Variants need not have the same products: some have obstacles, a flow, a coarse motion of threads."""
    works = stages.Works(load(PROJECT_SCENES / f"{scene}.toml", quick=True), tmp_path)
    for stage in ("synth", "bake", "render"):
        order = works._in_order(stage)
        for made in works.products.values():
            for product in made.values():
                if product.stage != stage:
                    continue
                before = [other for other, _ in product.inputs if made[other].stage == stage]
                assert all(order.index(other) < order.index(product.name) for other in before)
