"""Ctrl-C, SIGTERM and kill -9 in every stage: nothing half-written, and the next run ends with the same bits."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import processes
import pytest
import tiny


def run(folder: Path, scene: str = tiny.SMOKE, verb: str = "figure") -> dict[str, bytes]:
    """What an uninterrupted run leaves in folder/out/tiny."""
    return tiny.contents(tiny.made(folder, scene, verb).root)


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """What an uninterrupted run leaves."""
    return run(tmp_path_factory.mktemp("reference"))





@pytest.mark.parametrize(("name", "by", "code"), [
    ("H.0002.exr", signal.SIGINT, 130),
    ("density.0002.exr", signal.SIGINT, 130),
    ("beauty.0001.exr", signal.SIGTERM, 143),
    ("tiny.mp4", signal.SIGINT, 130),
    ("manifest.json", signal.SIGTERM, 143),
    ("L.0001.exr", signal.SIGKILL, -9),
    ("H.0002.exr", signal.SIGKILL, -9),
    ("H.0001.exr.note", signal.SIGKILL, -9),
    ("density.0002.exr", signal.SIGKILL, -9),
    ("beauty.0002.exr", signal.SIGKILL, -9),
    ("tiny.png", signal.SIGKILL, -9),
    ("manifest.json", signal.SIGKILL, -9),
])
def test_a_stopped_run_leaves_nothing_half_written_and_the_next_one_goes_on(
        tmp_path: Path, reference: dict[str, bytes], name: str, by: signal.Signals, code: int) -> None:
    ended = processes.stopped(tmp_path, name, by)
    assert ended.returncode == code
    if code > 0:
        assert ended.stderr.count("\n") == 1
        assert "run the same command again" in ended.stderr
    left = tiny.contents(tmp_path / "out" / "tiny")
    hidden = {path for path in left if any(part.startswith(".") for part in Path(path).parts)}
    for path in left.keys() - hidden:
        assert left[path] == reference[path], f"{path} is not complete"
    if code > 0:
        assert not [path for path in hidden if path.endswith(".partial")]
    assert run(tmp_path) == reference


SMOKY = tiny.changed(tiny.SMOKE, "m = 2\n", "m = 2\nsources = [{ centre = [0.0, 0.5], radius = 0.3 }]\n")
SOLID = tiny.changed(tiny.changed(tiny.changed(SMOKY, "[8, 8]", "[8, 8, 8]"), "size = [16, 16]",
                                  'size = [16, 16, 16]\nfacing = "density"\nlevels = 1'), '"lit"', '"volume"')


@pytest.fixture(scope="module")
def solid_reference(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """What an uninterrupted bake in space leaves."""
    return run(tmp_path_factory.mktemp("solid"), SOLID, "bake")


@pytest.mark.parametrize(("name", "by", "code"), [
    ("O.0002.vdb", signal.SIGKILL, -9),
    ("H.0003.vdb", signal.SIGTERM, 143),
    ("H.state.npz", signal.SIGKILL, -9),
    ("density.0003.vdb", signal.SIGKILL, -9),
])
def test_in_space_too_the_next_run_goes_on_with_the_same_bits(
        tmp_path: Path, solid_reference: dict[str, bytes], name: str, by: signal.Signals, code: int) -> None:
    assert processes.stopped(tmp_path, name, by, SOLID, "bake").returncode == code
    left = tiny.contents(tmp_path / "out" / "tiny")
    for path in left:
        if not any(part.startswith(".") for part in Path(path).parts):
            assert left[path] == solid_reference[path], f"{path} is not complete"
    if name == "H.0003.vdb":  # what the third frame goes on from
        assert "fields/.journal/H.state.npz" in left
    assert run(tmp_path, SOLID, "bake") == solid_reference


@pytest.mark.parametrize(("by", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_long_render_is_stopped_in_its_middle(tmp_path: Path, by: signal.Signals, code: int) -> None:
    render = 'kind = "volume"\nwidth = 400\nheight = 400\nspp = 4096'
    volume = tiny.changed(SMOKY, 'kind = "lit"\nwidth = 32', render)
    volume = tiny.changed(volume, "m = 2\n", "m = 2\ndepth = { reach = 0.2 }\n")
    tiny.written(tmp_path, volume)
    # says so when Mitsuba is about to trace; that takes minutes
    code_ = ("import pathlib, signal, sys; from pipeline import cli; from render import smoke; "
             "traced = smoke.volume; "
             "smoke.volume = lambda *a: (pathlib.Path('flag').touch(), traced(*a))[1]; "
             "signal.signal(signal.SIGINT, signal.default_int_handler); cli.main(sys.argv[1:])")
    process = subprocess.Popen([sys.executable, "-P", "-c", code_, "figure", "tiny.toml"], cwd=tmp_path,
                               stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 100
    while not (tmp_path / "flag").exists() and time.monotonic() < deadline:
        time.sleep(0.01)
    time.sleep(3)
    process.send_signal(by)
    try:
        _, err = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == code, err
    assert "run the same command again" in err.splitlines()[-1]
    assert not list((tmp_path / "out" / "tiny" / "images").glob("*.exr"))


def test_two_runs_at_once_end_with_the_same_bits(tmp_path: Path, reference: dict[str, bytes]) -> None:
    tiny.written(tmp_path)
    command = [sys.executable, "-P", "-m", "pipeline.cli", "figure", "tiny.toml"]
    processes = [subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True) for _ in range(2)]
    for process in processes:
        _, err = process.communicate(timeout=200)
        assert process.returncode == 0, err
    assert tiny.contents(tmp_path / "out" / "tiny") == reference


def test_the_farm_ends_with_the_same_bits_and_stops_its_processes(tmp_path: Path,
                                                                  reference: dict[str, bytes]) -> None:
    tiny.written(tmp_path)
    command = [sys.executable, "-P", "-m", "pipeline.cli", "farm", "tiny.toml", "--workers", "2", "--batch", "1"]
    subprocess.run(command, cwd=tmp_path, check=True, timeout=300)
    assert tiny.contents(tmp_path / "out" / "tiny") == reference
