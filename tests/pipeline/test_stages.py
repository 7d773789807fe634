"""The stages: their order, and which of them a run makes."""

from pathlib import Path
from typing import Any

import pytest
from tiny import BEADS, QUIET, SMOKE, contents, graph, made, written

from pipeline import figure, stages
from pipeline.build.artifact import FOLDERS
from pipeline.build.graph import BuildGraph
from pipeline.errors import BadInput, StorageFailed
from pipeline.scene import load


@pytest.fixture
def ran(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, Any]]:
    """What a run does, in order, instead of doing it."""
    found: list[tuple[str, Any]] = []
    monkeypatch.setattr(BuildGraph, "require_memory",
                        lambda self, stage, frames: found.append((f"{stage} memory", frames)))
    monkeypatch.setattr(BuildGraph, "check", lambda self, stage: found.append((f"{stage} files", None)))
    monkeypatch.setattr(BuildGraph, "make", lambda self, stage, frames, progress: found.append((stage, frames)))
    monkeypatch.setattr(figure, "make", lambda graph, progress: found.append(("figure", None)))
    return found


def test_the_order_of_the_stages() -> None:
    assert stages.STAGES == ("synth", "bake", "render", "figure")
    assert stages.STAGES[:-1] == tuple(FOLDERS)


@pytest.mark.parametrize("stage", stages.STAGES)
def test_a_run_makes_the_stages_before_first_and_checks_memory_and_files_of_all_before_any(
        tmp_path: Path, ran: list[tuple[str, Any]], stage: str) -> None:
    made(tmp_path, stage=stage)
    asked = stages.STAGES[: stages.STAGES.index(stage) + 1]
    checks = [(f"{one} {what}", None) for what in ("memory", "files") for one in asked]
    assert ran == [*checks, *((one, None) for one in asked)]


def test_a_run_with_frames_does_not_run_the_stages_before(tmp_path: Path, ran: list[tuple[str, Any]]) -> None:
    made(tmp_path, stage="render", frames=[2, 3])
    assert ran == [("render memory", [2, 3]), ("render files", None), ("render", [2, 3])]


@pytest.mark.parametrize("text", [SMOKE, BEADS])
def test_with_frames_what_the_stages_before_have_not_made_is_missing_and_nothing_is_written(
        tmp_path: Path, text: str) -> None:
    made(tmp_path, text, "synth")
    before = contents(tmp_path / "out")
    with pytest.raises(BadInput, match="is not there yet: run flowloom bake on this scene first"):
        made(tmp_path, text, "render", [2])
    assert contents(tmp_path / "out") == before


def test_memory_that_a_later_stage_lacks_is_told_before_anything_is_made(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(self: BuildGraph, stage: str, frames: Any) -> None:
        if stage == "bake":
            raise StorageFailed("memory", "not enough")

    monkeypatch.setattr(BuildGraph, "require_memory", full)
    with pytest.raises(StorageFailed):
        made(tmp_path, stage="figure")
    assert not (tmp_path / "out").exists()


def test_a_run_gives_the_graph_of_its_scenes_and_quick_has_its_own_place(tmp_path: Path) -> None:
    ended = made(tmp_path, stage="synth")
    assert (ended.name, ended.root, list(ended.variants)) == ("tiny", tmp_path / "out" / "tiny", [""])
    assert not ended.missing("", "H", [1, 2, 3])
    quick = graph(tmp_path, SMOKE, quick=True)
    assert quick.root == tmp_path / "out" / "quick" / "tiny" and quick.missing("", "H", [1, 2, 3])


def test_a_second_run_writes_nothing(tmp_path: Path) -> None:
    made(tmp_path)
    times = {path: path.stat().st_mtime_ns for path in (tmp_path / "out").rglob("*")}
    stages.run("figure", load(written(tmp_path)), tmp_path / "out", QUIET)
    assert {path: path.stat().st_mtime_ns for path in (tmp_path / "out").rglob("*")} == times
