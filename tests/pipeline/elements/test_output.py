"""The output: what it depends on, interrupted, farmed and kept, end to end with its pictures."""

import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import processes
import pytest
from tiny import BEADS, FISH, NOODLES, PAPER, changed, contents, graph, made, scene, written

from pipeline import cli
from pipeline.build.checkpoint import Checkpoint
from pipeline.elements.output import in_detail, output_artifact
from pipeline.files import tracks
from synth.elements.samples import Elements

Synthesized = Callable[[str], tuple[Elements, Elements]]
THREADS = changed(NOODLES, '"noodles"\nstyle = "jagged"\nframes = 4', '"tracks"\nfile = "FILE"')
SEVERAL = changed(BEADS, "iterations = 2", "iterations = 3\nbefore = 1")


BALL = '[[obstacles]]\nkind = "ball"\ncentre = [0.0, 0.5]\nradius = 0.1\n[render]'


@pytest.mark.parametrize(("text", "inputs"), [
    (BEADS, {"exemplar": "once", "L": "every"}),
    (changed(BEADS, "[render]", BALL), {"exemplar": "once", "L": "every", "solid": "once"}),
    (FISH, {"exemplar": "once"}),
    (NOODLES, {"exemplar": "once", "coarse": "once"}),
    (PAPER, {"exemplar": "once", "coarse": "once"}),
])
def test_what_it_is_made_from(tmp_path: Path, text: str, inputs: dict[str, str]) -> None:
    assert dict(output_artifact(scene(tmp_path, text)).inputs) == inputs


def test_the_picture_alone_makes_no_other_output(tmp_path: Path) -> None:
    variants = '[variants."a"]\n[variants."b"]\n"render.spp" = 2\n[variants."c"]\n"synthesis.hold" = 0.5\n'
    built = graph(tmp_path, BEADS + variants)
    assert built.distinct_variants("elements") == ["a", "c"]
    assert built.distinct_variants("exemplar") == ["a"]


def test_details_are_told_from_a_coarse_motion_of_every_exemplar(synthesized: Synthesized) -> None:
    for text in (NOODLES, PAPER):
        example, output = synthesized(text)
        told = in_detail(example)
        assert told.coarse is not None and (told.positions == example.positions).all()
        assert output.coarse is not None and output.coarse.shape == output.positions.shape


def test_threads_too_thick_to_lie_beside_each_other(home: Path, tables: Any, refused: Callable[..., str]) -> None:
    Path("a.csv").write_text(tables.threads(samples=40))
    found = tracks.read_foreign(Path("a.csv"), "exemplar.file", dimensions=3)
    tracks.write(Path("a.npz"), replace(found, size=np.full(found.count, 50.0)))
    text = changed(THREADS.replace("FILE", "a.npz"), "iterations = 1", "iterations = 1\nhybrid = true")
    line = refused(text, "exemplar.npz", "coarse.npz")
    assert line.startswith("tiny.toml: synthesis.hybrid: the exemplar's threads are ")


# -- interrupted, farmed, kept

@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """What an uninterrupted run leaves."""
    return contents(made(tmp_path_factory.mktemp("whole"), SEVERAL).root)


@pytest.mark.parametrize(("name", "by", "code"), [
    ("elements.state.npz", signal.SIGKILL, -9),  # after an iteration
    ("elements.npz", signal.SIGKILL, -9),  # all iterations are done, and their file is not written
    ("elements.npz", signal.SIGTERM, 143),
    ("L.0002.exr", signal.SIGKILL, -9),
    ("animation.usdc", signal.SIGKILL, -9),
    ("mesh.0002.ply", signal.SIGINT, 130),
])
def test_a_stopped_run_goes_on_with_the_same_bits(tmp_path: Path, whole: dict[str, bytes], name: str,
                                                  by: signal.Signals, code: int) -> None:
    assert processes.stopped(tmp_path, name, by, SEVERAL).returncode == code
    left = contents(tmp_path / "out" / "tiny")
    for path in left:
        if not any(part.startswith(".") for part in Path(path).parts):
            assert left[path] == whole[path], f"{path} is not whole"
    if name == "elements.npz":
        assert "fields/.journal/elements.state.npz" in left
    assert contents(made(tmp_path, SEVERAL).root) == whole


class Stopped(BaseException):
    """What a test stops the work with."""


@pytest.mark.parametrize(("sequence", "after"), [("together", 1), ("together", 2), ("frames", 1), ("frames", 2)])
def test_it_goes_on_after_the_last_whole_iteration_or_frame(
        home: Path, synthesized: Synthesized, monkeypatch: pytest.MonkeyPatch, sequence: str, after: int) -> None:
    from synth.elements.synthesis import Optimizer

    text = changed(SEVERAL, "iterations = 3", f'iterations = 3\nsequence = "{sequence}"')
    _, expected = synthesized(text)
    shutil.rmtree("out")
    counted: list[int] = []
    iterate, save = Optimizer.iterate, Checkpoint.save

    def counting(self: Optimizer, *arguments: object) -> float:
        counted.append(1)
        return iterate(self, *arguments)  # type: ignore[arg-type]

    def stopping(*arguments: object) -> None:
        save(*arguments)  # type: ignore[arg-type]
        saved.append(1)
        if len(saved) == after:
            raise Stopped

    saved: list[int] = []
    monkeypatch.setattr(Optimizer, "iterate", counting)
    monkeypatch.setattr(Checkpoint, "save", stopping)
    with pytest.raises(Stopped):
        synthesized(text)
    monkeypatch.setattr(Checkpoint, "save", save)
    counted.clear()
    _, output = synthesized(text)
    assert (output.positions == expected.positions).all()
    assert len(counted) == (3 - after) * (3 if sequence == "frames" else 1)


@pytest.mark.parametrize("damage", [b"", b"PK\x03\x04 cut short"])
def test_a_damaged_state_is_passed_over(home: Path, synthesized: Synthesized, damage: bytes) -> None:
    _, expected = synthesized(BEADS)
    shutil.rmtree("out")
    state = Path("out/tiny/fields/.journal/elements.state.npz")
    state.parent.mkdir(parents=True)
    state.write_bytes(damage)
    _, output = synthesized(BEADS)
    assert (output.positions == expected.positions).all()


def test_the_farm_ends_with_the_same_bits(tmp_path: Path, whole: dict[str, bytes]) -> None:
    written(tmp_path, SEVERAL)
    command = [sys.executable, "-P", "-m", "pipeline.cli", "farm", "tiny.toml", "--workers", "2", "--batch", "2"]
    subprocess.run(command, cwd=tmp_path, check=True, timeout=300)
    assert contents(tmp_path / "out" / "tiny") == whole


def test_the_whole_animation_is_made_by_the_last_batch_alone(tmp_path: Path) -> None:
    geometry = made(tmp_path, BEADS, "synth").root / "geometry"
    made(tmp_path, BEADS, "bake", [1, 2])
    assert not (geometry / "animation.usdc").exists()
    assert not (geometry / "manifest.json").exists()
    made(tmp_path, BEADS, "bake", [3])
    assert (geometry / "animation.usdc").exists()
    assert (geometry / "manifest.json").exists()


def test_references_keep_a_scene_of_elements_and_tell_what_changed(home: Path,
                                                                   capsys: pytest.CaptureFixture[str]) -> None:
    shown = changed(BEADS, '["result"]', '["exemplar", "result"]')
    file = written(home, shown + '[quick]\n"elements.spacing" = 0.2\n')
    out = ["--out", str(home / "out")]
    assert cli.run(["references", str(file), *out]) == 0
    kept = {path.relative_to(home / "references" / "tiny").as_posix()
            for path in (home / "references").rglob("*.*") if path.is_file()}
    assert kept == {"reference.json", "fields/exemplar.npz", "fields/elements.npz", "fields/L.0003.exr",
                    "geometry/mesh.0003.ply", "images/proof.exr"}
    assert cli.run(["diff", str(file), *out]) == 0
    capsys.readouterr()
    file.write_text(changed(file.read_text(), "iterations = 2", "iterations = 3"))
    assert cli.run(["diff", str(file), *out]) == 1
    told = capsys.readouterr().out
    assert "elements.npz: " in told and "mesh.000" in told and "exemplar.npz" not in told
    assert "index.html" in told


@pytest.mark.parametrize("text", [FISH, NOODLES, PAPER])
def test_every_kind_of_scene_ends_with_its_figure(tmp_path: Path, text: str) -> None:
    panels = '["exemplar", "result"]' if text == FISH else '["exemplar", "coarse", "result"]'
    root = made(tmp_path, changed(text, '["result"]', panels)).root
    assert (root / "tiny.png").is_file() and (root / "tiny.mp4").is_file()
    assert (root / "geometry" / "animation.usdc").is_file()
