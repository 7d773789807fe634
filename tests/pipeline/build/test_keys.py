"""Keys: each ingredient changes them, and nothing else does."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from tiny import BEADS, PAPER, SMOKE, TRACKS, changed, graph, scene

from pipeline import flow
from pipeline.build import keys
from pipeline.build.artifact import Artifact
from pipeline.files import fields
from pipeline.files.images import FIELD

BITMAP = SMOKE.replace('kind = "circle"', 'kind = "bitmap"\nfile = "a.png"')


def make(scene: Any, inputs: Any, frames: list[int]) -> Iterator[tuple[int, Any]]:
    raise AssertionError("no test here makes it")


def artifact(*reads: str) -> Artifact:
    return Artifact("P", "synth", FIELD, reads, (), make)


def values(one: Any, *reads: str) -> Any:
    return keys.declared(artifact(*reads), one)[1]


@pytest.mark.parametrize(("old", "new", "expected"), [
    ("omega = 1.5", "omega = 0.75", {"combine"}),
    ('kind = "circle"', 'kind = "square"', {"exemplar"}),
    ("iterations = 1", "iterations = 2", {"detail"}),
    ("size = [16, 16]", "size = [32, 32]", {"detail", "detail.size", "shape"}),
    ("frames = 3", "frames = 4", set()),
    ('title = "A tiny', 'title = "Another', set()),
    ("m = 2\n", "m = 2\nborder = \"clamp\"\n", set()),
])
def test_values_change_with_what_is_declared_and_with_nothing_else(tmp_path: Path, old: str, new: str,
                                                                   expected: set[str]) -> None:
    before, after = scene(tmp_path), scene(tmp_path, changed(SMOKE, old, new))
    reads = {"exemplar", "detail", "detail.size", "shape", "combine", "seed"}
    assert {key for key in reads if values(before, key) != values(after, key)} == expected


def test_values_are_json_and_come_back_as_they_were(tmp_path: Path) -> None:
    found = values(scene(tmp_path), "detail", "detail.size", "render", "figure", "combine.nothing")
    assert json.loads(json.dumps(found)) == found
    assert (found["detail.size"], found["detail"]["iterations"]) == ([16, 16], 1)
    assert found["combine.nothing"] is None


def test_a_file_counts_by_its_bytes_and_not_by_its_name(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(b"one")
    (tmp_path / "b.png").write_bytes(b"one")
    one = values(scene(tmp_path, BITMAP), "exemplar")
    assert values(scene(tmp_path, BITMAP.replace("a.png", "b.png")), "exemplar") == one
    (tmp_path / "a.png").write_bytes(b"two")
    two = values(scene(tmp_path, BITMAP), "exemplar")
    assert two["exemplar"].pop("file") != one["exemplar"].pop("file")
    assert two == one


def test_a_folder_counts_with_each_of_its_files(tmp_path: Path) -> None:
    (tmp_path / "school").mkdir()
    for frame in (1, 2):
        (tmp_path / "school" / f"{frame}.ply").write_text(f"frame {frame}")
    tracked = scene(tmp_path, TRACKS.replace("FILE", "school"))
    before = values(tracked, "exemplar")
    (tmp_path / "school" / "2.ply").write_text("frame two")
    assert values(tracked, "exemplar") != before
    (tmp_path / "school" / "2.ply").write_text("frame 2")
    assert values(tracked, "exemplar") == before
    (tmp_path / "school" / "3.ply").write_text("frame 3")
    assert values(tracked, "exemplar") != before


def test_only_what_is_declared_makes_it_depend_on_files(tmp_path: Path) -> None:
    (tmp_path / "a.png").touch()
    bitmap, circle = scene(tmp_path, BITMAP), scene(tmp_path)
    assert keys.reads_files(artifact("seed", "exemplar"), bitmap)
    assert not keys.reads_files(artifact("seed", "coarse"), bitmap)
    assert not keys.reads_files(artifact("seed", "exemplar"), circle)


def test_every_ingredient_changes_the_key(tmp_path: Path) -> None:
    one, plain = scene(tmp_path), artifact("seed")
    of_input = {"Q": replace(plain, name="Q")}
    found = [
        keys.key(keys.constant(plain, one, {}), 1, []),
        keys.key(keys.constant(plain, one, {}), 2, []),
        keys.key(keys.constant(replace(plain, name="R"), one, {}), 1, []),
        keys.key(keys.constant(replace(plain, arguments={"style": "lines"}), one, {}), 1, []),
        keys.key(keys.constant(replace(plain, reads=("seed", "fps")), one, {}), 1, []),
        keys.key(keys.constant(plain, scene(tmp_path, "seed = 2\n" + SMOKE), {}), 1, []),
        keys.key(keys.constant(replace(plain, make=flow.make_solid), one, {}), 1, []),
        keys.key(keys.constant(replace(plain, format=fields.velocity(3, 24)), one, {}), 1, []),
        keys.key(keys.constant(replace(plain, format=fields.velocity(3, 25)), one, {}), 1, []),
        keys.key(keys.constant(replace(plain, inputs=(("Q", "same"),)), one, of_input), 1, ["a"]),
        keys.key(keys.constant(replace(plain, inputs=(("Q", "same"),)), one, of_input), 1, ["b"]),
        keys.key(keys.constant(replace(plain, inputs=(("Q", "until"),)), one, of_input), 1, ["b"])]
    assert len(set(found)) == len(found)
    assert keys.key(keys.constant(plain, one, {}), 1, []) == found[0]


MARCHED = changed(SMOKE, 'kind = "lit"\nwidth = 32', 'kind = "volume"\nmethod = "both"\nwidth = 16\nheight = 16')
MARCHED = MARCHED.replace("m = 2\n", "m = 2\ndepth = { reach = 0.2 }\n")


def test_the_picture_of_both_methods_depends_on_whether_there_is_an_animation(tmp_path: Path) -> None:
    """D1: marched where there is an animation, path-traced where there is none; one key was the other's."""
    still = changed(MARCHED, "panel = 32", "panel = 32\nanimation = false")
    ids = {text: graph(tmp_path, text).content_id("", "beauty") for text in (MARCHED, still)}
    assert len(set(ids.values())) == 2
    assert "still" in graph(tmp_path, MARCHED).artifacts[""] and "still" not in graph(tmp_path, still).artifacts[""]


def places(folder: Path, text: str, name: str) -> set[str]:
    """Where the code is that an artifact depends on."""
    made = graph(folder, text)
    one = made.artifacts[""][name]
    return set(keys.source_digest.sources([one.make, one.format.write], keys.tables(one, made.variants[""])).values())


@pytest.mark.parametrize(("text", "name", "expected"), [
    # D2: the colours of paper; D3: what panels of H', points' exemplars and F are computed by
    (BEADS, "exemplar",
     {"synth/elements/neighborhood.py", "synth/elements/arrangement.py"}),
    (SMOKE.replace('"coarse"', '"detail"'), "detail-lines",
     {"synth/motion/coarse.py", "synth/motion/local_axes.py", "pipeline.motion.bake.transformed",
      "pipeline.flow.upsampled"}),
    (SMOKE, "F", {"pipeline.flow.upsampled", "pipeline.flow.walls", "synth/motion/combine.py"}),
    (SMOKE, "density", {"pipeline.motion.fields.sources", "synth/motion/density.py", "synth/motion/density.cl"}),
])
def test_the_code_of_an_artifact_is_all_that_computes_it(tmp_path: Path, text: str, name: str,
                                                         expected: set[str]) -> None:
    assert expected <= places(tmp_path, text, name)


def test_the_mesh_of_paper_depends_on_its_palette(tmp_path: Path) -> None:
    assert {"render/paper.py", "synth/elements/mesh.py"} <= places(tmp_path, PAPER, "mesh")
