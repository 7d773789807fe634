"""The command line: what it says, its exit codes, and that it is quick to answer."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from tiny import SMOKE, written

from pipeline import cli, stages
from pipeline.errors import EnvironmentMissing, StorageFailed, Terminated

FLOWLOOM = [sys.executable, "-P", "-m", "pipeline.cli"]
SCENE = SMOKE + "[quick]\nframes = 1\n"


@pytest.fixture
def scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A scene in the working directory."""
    monkeypatch.chdir(tmp_path)
    return written(Path(), SCENE)


def line(capsys: pytest.CaptureFixture[str]) -> str:
    """The one line on stderr."""
    err = capsys.readouterr().err
    assert err.count("\n") == 1, err
    return err.rstrip()


def test_help_names_every_command_and_loads_nothing_heavy() -> None:
    code = ("import sys; from pipeline import cli; cli.run(['--help']); "
            "heavy = {'numpy', 'pydantic', 'pyopencl', 'mitsuba', 'scipy', 'cv2', 'OpenEXR', 'av', 'rich.progress'}; "
            "sys.exit(str(heavy & set(sys.modules)) if heavy & set(sys.modules) else 0)")
    done = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for command in ("synth", "bake", "render", "figure", "diff", "references", "list", "doctor", "gallery", "schema",
                    "farm"):
        assert f"\n  {command} " in done.stdout.replace("│", " "), command


def test_every_command_has_its_own_help(capsys: pytest.CaptureFixture[str]) -> None:
    for command in ("synth", "bake", "render", "figure", "farm", "list", "schema"):
        assert cli.run([command, "--help"]) == 0
        assert f"flowloom {command}" in capsys.readouterr().out


def test_the_verbs_fill_their_folders_in_turn(scene: Path) -> None:
    folders = {"synth": "fields", "bake": "geometry", "render": "images", "figure": ""}
    for verb, folder in folders.items():
        assert cli.run([verb, str(scene)]) == 0
        assert (Path("out/tiny") / folder / "manifest.json").is_file()
    assert Path("out/tiny/tiny.png").is_file()
    assert Path("out/tiny/tiny.mp4").is_file()


def test_quick_and_out_choose_the_folder(scene: Path, tmp_path: Path) -> None:
    assert cli.run(["synth", str(scene), "--quick", "--out", str(tmp_path / "elsewhere")]) == 0
    assert (tmp_path / "elsewhere" / "quick" / "tiny" / "fields" / "H.0001.exr").is_file()
    assert not (tmp_path / "elsewhere" / "quick" / "tiny" / "fields" / "H.0002.exr").exists()
    assert not Path("out").exists()


def test_frames_choose_the_frames(scene: Path) -> None:
    cli.run(["synth", str(scene)])
    assert cli.run(["bake", str(scene), "--frames", "2"]) == 0
    assert sorted(p.name for p in Path("out/tiny/geometry").glob("*.exr")) == ["F.0002.exr", "density.0002.exr"]


@pytest.mark.parametrize(("arguments", "expected"), [
    (["synth"], "requires an argument"),
    (["snyth", "tiny.toml"], 'Did you mean "synth"'),
    (["synth", "tiny.toml", "--quik"], "--quik"),
    (["synth", "none.toml"], "none.toml: no such scene"),
    (["bake", "tiny.toml", "--frames", "4"], "--frames: '4' is not within 1-3"),
    (["bake", "tiny.toml", "--frames", "x"], "--frames: 'x' is not a range"),
    (["bake", "tiny.toml", "--frames", ""], "--frames: '' is not a range"),
    (["bake", "tiny.toml", "--frames", "1"], "run flowloom synth"),
    (["farm", "tiny.toml", "--workers", "0"], "--workers: must be at least 1"),
    (["farm", "tiny.toml", "--batch", "two"], "--batch"),
    (["list", "nowhere"], "nowhere: holds no scenes"),
    (["gallery"], "out: holds no figure yet"),
])
def test_wrong_arguments_are_one_line_and_2_and_nothing_is_written(
        scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], expected: str) -> None:
    assert cli.run(arguments) == 2
    assert expected in line(capsys)
    assert [p.name for p in tmp_path.iterdir()] == ["tiny.toml"]


class _Refused(OSError):
    """What the file system says of a full disk."""

    def __init__(self) -> None:
        super().__init__(28, "No space left on device", "a.exr")


def _opencl_is_missing() -> BaseException:
    from synth.opencl import OpenCLUnavailable

    return OpenCLUnavailable("no OpenCL platform; install pocl")


@pytest.mark.parametrize(("error", "code", "expected"), [
    (lambda: EnvironmentMissing("no LLVM"), 3, "no LLVM"),
    (_opencl_is_missing, 3, "install pocl"),
    (lambda: ImportError("libX.so: cannot open shared object file", name="pyopencl"), 3, "libX.so"),
    (lambda: StorageFailed("a.exr", "full"), 4, "a.exr: full"),
    (_Refused, 4, "a.exr: No space left on device"),
    (MemoryError, 4, "memory: not enough"),
    (lambda: RuntimeError("clEnqueueNDRangeKernel failed: OUT_OF_HOST_MEMORY"), 4, "memory: not enough"),
    (KeyboardInterrupt, 130, "interrupted"),
    (Terminated, 143, "terminated"),
])
def test_what_is_foreseen_is_one_line_with_its_own_code(scene: Path, monkeypatch: pytest.MonkeyPatch,
                                                        capsys: pytest.CaptureFixture[str], error: type, code: int,
                                                        expected: str) -> None:
    def fail(*_: object) -> None:
        raise error()

    monkeypatch.setattr(stages, "run", fail)
    assert cli.run(["synth", str(scene)]) == code
    assert expected in line(capsys)


@pytest.mark.parametrize("error", [RuntimeError("a bug"), ImportError("no name", name="pipeline.flow"), OSError("?")])
def test_what_is_not_foreseen_shows_its_traceback_and_is_no_other_code(
        scene: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], error: Exception) -> None:
    def fail(*_: object) -> None:
        raise error

    monkeypatch.setattr(stages, "run", fail)
    assert cli.run(["synth", str(scene)]) == cli.FAULT
    assert "Traceback" in capsys.readouterr().err


def test_a_pipe_and_quiet_silence_the_progress_and_a_terminal_shows_it(scene: Path) -> None:
    done = subprocess.run([*FLOWLOOM, "synth", str(scene)], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("", "")
    for options, expected in (["--quiet"], False), ([], True):
        subprocess.run(["rm", "-rf", "out"], check=True)
        reader, writer = os.openpty()
        subprocess.run([*FLOWLOOM, "synth", str(scene), *options], stderr=writer, check=True)
        os.close(writer)
        os.set_blocking(reader, False)
        try:
            shown = os.read(reader, 100000).decode(errors="replace")
        except (BlockingIOError, OSError):
            shown = ""
        os.close(reader)
        assert ("synth H" in shown) == expected


def test_list_tells_scenes_and_marks_finished_and_broken_ones(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("broken.toml").write_text("title = 3")
    Path("out/tiny").mkdir(parents=True)
    Path("out/tiny/tiny.png").touch()
    assert cli.run(["list", "."]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "! broken  broken.toml: title: should be a valid string, not 3", "* tiny    A tiny circle (a test)"]


def test_list_without_a_folder_tells_the_projects_scenes(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert any("ma09-fig01 " in told for told in lines)
    assert not [told for told in lines if told.startswith("!")]


def test_a_closed_pipe_is_no_error(scene: Path) -> None:
    done = subprocess.run(["bash", "-c", f"{sys.executable} -P -m pipeline.cli list | true; echo ${{PIPESTATUS[0]}}"],
                          capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("0\n", "")


def test_the_farm_prints_its_commands_in_steps(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["farm", str(scene), "--batch", "1", "--dry-run", "--quiet"]) == 0
    steps = [step.splitlines() for step in capsys.readouterr().out.split("\n\n")]
    assert [len(step) for step in steps] == [1, 3, 3, 1]
    assert steps[1][0].endswith("bake tiny.toml --out out --frames 1")
    assert not Path("out").exists()


def test_a_batch_that_fails_ends_the_farm_with_its_code(scene: Path, capfd: pytest.CaptureFixture[str]) -> None:
    Path("out").write_text("in the way")
    assert cli.run(["farm", str(scene)]) == 4
    assert "ended with exit code 4" in capfd.readouterr().err


def test_a_module_of_our_name_in_the_working_directory_is_not_run(scene: Path) -> None:
    Path("pipeline").mkdir()
    Path("pipeline/__init__.py").write_text("open('owned', 'w')")
    Path("numpy.py").write_text("open('owned', 'w')")
    console_script = Path(sys.executable).parent / "flowloom"
    for command in (FLOWLOOM, [str(console_script)]):
        subprocess.run([*command, "synth", str(scene)], check=True)
    assert not Path("owned").exists()
