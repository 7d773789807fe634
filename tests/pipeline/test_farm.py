"""The farm: which commands it makes, how many run at a time, and what becomes of them when one fails."""

import shlex
import signal
import subprocess
import time
from pathlib import Path
from typing import Any

import pytest
from tiny import SMOKE, changed, written

from pipeline import farm
from pipeline.errors import BadInput


class Watched(subprocess.Popen):
    """A process that the test can look at when the farm has ended."""

    started: list["Watched"]
    peak: int

    def __init__(self, *args: Any, **options: Any):
        super().__init__(*args, **options)
        Watched.started.append(self)
        Watched.peak = max(Watched.peak, sum(process.poll() is None for process in Watched.started))


@pytest.fixture
def watched(monkeypatch: pytest.MonkeyPatch) -> type[Watched]:
    Watched.started, Watched.peak = [], 0
    monkeypatch.setattr(subprocess, "Popen", Watched)
    return Watched


def run(monkeypatch: pytest.MonkeyPatch, steps: list[list[list[str]]], workers: int = 2, quiet: bool = True) -> None:
    """Run `steps` instead of those of a scene."""
    monkeypatch.setattr(farm, "steps", lambda *_: steps)
    farm.run(Path("tiny.toml"), workers, 1, False, Path("out"), quiet, dry_run=False)


def shell(script: str) -> list[str]:
    return ["sh", "-c", script, "sh"]


def made(folder: Path, text: str, batch: int, quick: bool = False) -> list[list[list[str]]]:
    """The steps of a scene with `text`, without what starts python."""
    steps = farm.steps(written(folder, text), batch, quick, folder / "my out")
    return [[command[command.index("pipeline.cli") + 1:] for command in step] for step in steps]


def test_the_batches_cover_every_frame_once_and_the_last_is_what_is_left(tmp_path: Path) -> None:
    steps = made(tmp_path, changed(SMOKE, "frames = 3", "frames = 5"), 2)
    assert [[command[0] for command in step] for step in steps] == [
        ["synth"], ["bake"] * 3, ["render"] * 3, ["figure"]]
    for step in steps[1:3]:
        assert [command[command.index("--frames") + 1] for command in step] == ["1-2", "3-4", "5"]
    assert all("--frames" not in command for command in (*steps[0], *steps[3]))


def test_a_batch_as_long_as_the_animation_is_one_process(tmp_path: Path) -> None:
    assert [len(step) for step in made(tmp_path, SMOKE, 3)] == [1, 1, 1, 1]


def test_quick_has_its_own_frames_and_every_command_is_told(tmp_path: Path) -> None:
    text = SMOKE + "[quick]\nframes = 1\n"
    steps = made(tmp_path, text, 1, quick=True)
    assert [len(step) for step in steps] == [1, 1, 1, 1]
    assert all("--quick" in command for step in steps for command in step)
    assert not [command for step in made(tmp_path, text, 1) for command in step if "--quick" in command]


def test_the_longest_variant_says_how_many_frames_there_are(tmp_path: Path) -> None:
    variants = '[variants]\n"short" = { frames = 1 }\n"long" = { frames = 4 }\n"usual" = {}\n'
    assert [len(step) for step in made(tmp_path, SMOKE + variants, 1)] == [1, 4, 4, 1]


def test_a_printed_command_survives_a_shell(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, out = written(tmp_path), tmp_path / "it's my out"
    farm.run(file, 2, 10, False, out, False, dry_run=True)
    printed = [shlex.split(line) for line in capsys.readouterr().out.splitlines() if line]
    assert printed == [command for step in farm.steps(file, 10, False, out) for command in step]
    assert not out.exists()


@pytest.mark.parametrize(("workers", "batch", "blamed"), [(0, 1, "--workers"), (1, 0, "--batch"), (1, -3, "--batch")])
def test_no_workers_and_empty_batches_are_bad_input(watched: type[Watched], workers: int, batch: int,
                                                    blamed: str) -> None:
    with pytest.raises(BadInput, match=f"^{blamed}: must be at least 1"):
        farm.run(Path("tiny.toml"), workers, batch, False, Path("out"), True, dry_run=False)
    assert not watched.started


@pytest.mark.parametrize("workers", [1, 3])
def test_no_more_processes_than_workers(monkeypatch: pytest.MonkeyPatch, watched: type[Watched], workers: int) -> None:
    run(monkeypatch, [[shell("sleep 0.2")] * 5], workers)
    assert [process.returncode for process in watched.started] == [0] * 5
    assert watched.peak == workers


def test_a_step_waits_for_all_of_the_one_before(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    slow, quick = shell(f"sleep 0.3; touch '{tmp_path}/slow'"), shell("true")
    run(monkeypatch, [[quick, slow], [shell(f"test -e '{tmp_path}/slow' && touch '{tmp_path}/after'")]], workers=4)
    assert (tmp_path / "after").exists()


def test_a_failure_ends_the_others_and_starts_no_more(monkeypatch: pytest.MonkeyPatch, watched: type[Watched],
                                                      tmp_path: Path) -> None:
    later = shell(f"touch '{tmp_path}/later'")
    started = time.monotonic()
    with pytest.raises(farm.BatchFailed, match=r"exit 3.*ended with exit code 3") as failed:
        run(monkeypatch, [[shell("exec sleep 60"), shell("sleep 0.2; exit 3"), later], [later]])
    assert failed.value.exit_code == 3
    assert time.monotonic() - started < 30
    assert [process.returncode for process in watched.started] == [-signal.SIGTERM, 3]
    assert not (tmp_path / "later").exists()


def test_a_killed_process_has_the_code_a_shell_would_give(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(farm.BatchFailed, match="exit code 137") as failed:
        run(monkeypatch, [[shell("kill -9 $$")]])
    assert failed.value.exit_code == 128 + signal.SIGKILL


@pytest.mark.parametrize("quiet", [True, False])
def test_only_a_process_alone_may_show_its_progress(monkeypatch: pytest.MonkeyPatch, watched: type[Watched],
                                                    quiet: bool) -> None:
    run(monkeypatch, [[shell("true")], [shell("true"), shell("true")]], quiet=quiet)
    assert ["--quiet" in process.args for process in watched.started] == [quiet, True, True]
