"""A method that pipeline has never met, without geometry and without a [render] table, as image methods are: its record
in the list is all that it takes to load, synthesize, set, farm and diff its scenes."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
import tiny

from pipeline import cli, references, scene
from pipeline.build.artifact import Artifact, Inputs
from pipeline.build.method import Method, Panel
from pipeline.build.view import Undeclared
from pipeline.errors import BadInput
from pipeline.files import images
from pipeline.methods import METHODS
from pipeline.tables import FigureTable, SceneTables, Table, key


class Stripes(Table):
    """Stripes that move."""

    period: int = key("pixels of a stripe", 4, ge=2, le=64)
    colour: Literal["grey", "red"] = key("colour", "grey")


class StripesScene(SceneTables):
    """A scene of stripes."""

    stripes: Stripes
    figure: FigureTable = FigureTable(panel=16)


def make_frames(scene: StripesScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """A picture of each frame, sequential: each moves the one before."""
    kept = inputs.checkpoint.load(before=frames[0])
    done, state = kept or (0, {"row": np.arange(16) % scene.stripes.period / scene.stripes.period})
    row = state["row"]
    for frame in range(done + 1, frames[-1] + 1):
        row = np.roll(row, 1)
        inputs.checkpoint.save(frame, {"row": row})
        if frame in frames:
            tint = [1.0, 0.0, 0.0] if scene.stripes.colour == "red" else [1.0, 1.0, 1.0]
            yield frame, np.broadcast_to(row[None, :, None] * np.array(tint), (8, 16, 3)).astype(np.float32)


def make_secretly(scene: StripesScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, Any]]:
    yield 1, scene.fps


def artifacts(scene: StripesScene) -> tuple[Artifact, ...]:
    return (Artifact("frames", "synth", images.LIGHT, ("stripes",), (), make_frames),)


METHOD = Method("stripes", "stripes", StripesScene, (), artifacts,
                lambda scene: (Panel("stripes", "frames", scene.figure.panel, "straight"),))
TEXT = 'title = "Stripes"\nframes = 3\n[stripes]\nperiod = 4\n'


@pytest.fixture(autouse=True)
def known(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(scene, "METHODS", (*METHODS, METHOD))
    monkeypatch.chdir(tmp_path)


def test_its_scenes_run_through_every_stage(tmp_path: Path) -> None:
    graph = tiny.made(tmp_path, TEXT)
    assert {path for path in tiny.contents(graph.root) if "manifest" not in path} == {
        "tiny.png", "tiny.mp4", *(f"fields/frames.{n:04d}.exr" for n in (1, 2, 3))}
    before = tiny.contents(graph.root)
    assert tiny.contents(tiny.made(tmp_path, TEXT).root) == before
    assert tiny.contents(tiny.made(tmp_path, TEXT + 'colour = "red"\n').root) != before


def test_its_mistakes_are_told_as_all_others(tmp_path: Path) -> None:
    assert tiny.complaint(tiny.written(tmp_path, TEXT.replace("period", "peroid"))) == (
        "stripes.peroid: unknown key; did you mean period?")
    with pytest.raises(BadInput, match=r"figure\.labels: 2 labels, but 1 panel"):
        scene.load(tiny.written(tmp_path, TEXT + '[figure]\nlabels = ["a", "b"]\n'))


def test_variants_references_and_the_farm_know_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tiny.written(tmp_path, TEXT + '[variants.a]\n[variants.b]\n"stripes.period" = 8\n')
    assert cli.run(["references", str(file), "--quiet"]) == 0
    assert cli.run(["diff", str(file), "--quiet"]) == 0
    assert "the same" in capsys.readouterr().out
    kept = {p.relative_to(references.folder_of(file)).as_posix()
            for p in references.folder_of(file).rglob("*.exr")}
    assert kept == {"fields/a/frames.0003.exr", "fields/b/frames.0003.exr"}
    assert cli.run(["farm", str(file), "--dry-run"]) == 0


def test_what_it_does_not_declare_it_cannot_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = (Artifact("frames", "synth", images.LIGHT, ("stripes",), (), make_secretly),)
    monkeypatch.setattr(scene, "METHODS", (*METHODS, replace(METHOD, artifacts=lambda _: made)))
    with pytest.raises(Undeclared, match="frames reads fps, which it does not declare"):
        tiny.made(tmp_path, TEXT)
