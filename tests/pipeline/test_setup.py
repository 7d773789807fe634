"""Set-up says in one line what it lacks, and make runs it once. The real set-up has run: these tests run in it."""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SETUP = ROOT / "pipeline" / "setup.sh"


def packages() -> list[str]:
    block = re.search(r"PACKAGES=\((.*?)\n\)", SETUP.read_text(), re.DOTALL)
    assert block
    return [name for line in block[1].splitlines() for name in line.split("#")[0].split()]


def program(folder: Path, name: str, body: str) -> None:
    path = folder / name
    path.write_text(f"#!/bin/bash\n{body}\n")
    path.chmod(0o755)


@pytest.fixture
def bare(tmp_path: Path) -> Path:
    """A checkout's set-up, and a machine (a folder of programs) without any of the packages."""
    shutil.copytree(ROOT / "pipeline", tmp_path / "pipeline", ignore=lambda *_: ["files", "__pycache__"])
    machine = tmp_path / "bin"
    machine.mkdir()
    for name in ("dirname", "cat", "grep", "head", "mkdir", "env", "cut"):
        (machine / name).symlink_to(shutil.which(name) or name)
    program(machine, "dpkg-query", "exit 1")
    program(machine, "id", "echo 1000")
    program(machine, "sudo", "exit 1")
    return tmp_path


def set_up(bare: Path) -> subprocess.CompletedProcess[str]:
    environment = {"PATH": str(bare / "bin"), "FLOWLOOM_CLEAN": "1"}
    return subprocess.run(["/bin/bash", bare / "pipeline" / "setup.sh"], env=environment, capture_output=True,
                          text=True, timeout=60, check=False)


def test_who_may_not_install_reads_what_to_type(bare: Path) -> None:
    child = set_up(bare)
    assert child.returncode == 3
    assert child.stderr.count("\n") == 1 and child.stdout == ""
    assert child.stderr.strip().endswith(
        "run this first, as root: apt-get install -y --no-install-recommends " + " ".join(packages()))


def test_only_what_is_missing_is_named(bare: Path) -> None:
    program(bare / "bin", "dpkg-query", 'if [ "${!#}" = libllvm19 ]; then exit 1; fi; echo -n installed')
    assert set_up(bare).stderr.strip().endswith("--no-install-recommends libllvm19")


def test_a_failing_apt_is_one_line(bare: Path) -> None:
    program(bare / "bin", "id", "echo 0")
    program(bare / "bin", "apt-get", 'echo "Get: 1"; if [ "$2" = install ]; then echo "E: no space left"; exit 100; fi')
    child = set_up(bare)
    assert child.returncode == 3
    *_, last = child.stderr.splitlines()
    assert "apt-get failed (E: no space left)" in last and "build/apt.log" in last
    assert (bare / "build" / "apt.log").read_text().count("Get: 1") == 2


def test_without_apt_it_says_what_it_needs(bare: Path) -> None:
    (bare / "bin" / "dpkg-query").unlink()
    child = set_up(bare)
    assert child.returncode == 3 and "needs Debian 12" in child.stderr and child.stderr.count("\n") == 1


def test_the_users_environment_does_not_reach_in(bare: Path) -> None:
    """PYTHONPATH, compilers and search paths are dropped; the proxy stays."""
    script = bare / "pipeline" / "setup.sh"
    head, _, _ = script.read_text().partition("missing_packages()")
    script.write_text(head + "env\n")
    evil = {"PYTHONPATH": "/evil", "VIRTUAL_ENV": "/evil", "CXX": "/evil", "CMAKE_PREFIX_PATH": "/evil",
            "LD_LIBRARY_PATH": "/evil", "UV_PROJECT_ENVIRONMENT": "/evil", "PATH": f"/evil:{os.environ['PATH']}"}
    child = subprocess.run([script], env=evil | {"https_proxy": "http://proxy:3128", "HOME": "/home/me"},
                           capture_output=True, text=True, check=True)
    assert "evil" not in child.stdout
    assert "https_proxy=http://proxy:3128\n" in child.stdout and "HOME=/home/me\n" in child.stdout


def test_every_package_is_installed_here() -> None:
    query = ["dpkg-query", "-W", "-f=${db:Status-Status}\n", *packages()]
    told = subprocess.run(query, capture_output=True, text=True, check=False).stdout.splitlines()
    assert told == ["installed"] * len(packages())


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A checkout in a folder with a space, whose set-up and command only write down that they were called."""
    folder = tmp_path / "a checkout"
    (folder / "pipeline" / "files").mkdir(parents=True)
    (folder / "scenes").mkdir()
    (folder / "bin").mkdir()
    for name in ("pyproject.toml", "uv.lock", "CMakeLists.txt", "pipeline/files/openvdb.cpp", "scenes/ma09-fig01.toml",
                 "scenes/mine.toml"):
        (folder / name).touch()
    shutil.copy(ROOT / "Makefile", folder)
    program(folder / "pipeline", "setup.sh", "mkdir -p .venv/bin; cp bin/* .venv/bin; touch .venv/flowloom.stamp; "
            "echo setup >> calls")
    for name in ("flowloom", "python", "ruff", "mypy"):
        program(folder / "bin", name, f'echo {name} "$@" >> calls; exit ${{FAIL:-0}}')
    return folder


def calls(checkout: Path, *targets: str, fail: int = 0) -> list[str]:
    """What `make targets` calls, in order."""
    (checkout / "calls").unlink(missing_ok=True)
    environment = {k: v for k, v in os.environ.items() if k not in ("MAKEFLAGS", "MAKELEVEL")} | {"FAIL": str(fail)}
    child = subprocess.run(["make", "-s", *targets], cwd=checkout, env=environment, capture_output=True, text=True,
                           check=False)
    assert (child.returncode == 0) == (fail == 0), child.stderr
    assert "warning" not in child.stderr
    return (checkout / "calls").read_text().splitlines() if (checkout / "calls").exists() else []


def test_set_up_runs_first_and_once(checkout: Path) -> None:
    assert calls(checkout, "demo") == ["setup", "flowloom figure scenes/ma09-fig01.toml"]
    assert calls(checkout, "demo") == ["flowloom figure scenes/ma09-fig01.toml"]
    for changed in ("uv.lock", "pipeline/files/openvdb.cpp", "pipeline/setup.sh"):
        os.utime(checkout / ".venv" / "flowloom.stamp", (1e9, 1e9))
        for path in ("pyproject.toml", "uv.lock", "CMakeLists.txt", "pipeline/files/openvdb.cpp", "pipeline/setup.sh"):
            os.utime(checkout / path, (0, 1e9 + 1 if path == changed else 0))
        assert calls(checkout, "setup") == ["setup"]
        assert calls(checkout, "setup") == []


def test_each_scene_is_a_target(checkout: Path) -> None:
    calls(checkout, "setup")
    assert calls(checkout, "mine", "QUICK=1") == ["flowloom figure scenes/mine.toml --quick"]
    assert sorted(calls(checkout, "figures")) == [f"flowloom figure scenes/{n}.toml" for n in ("ma09-fig01", "mine")]
    assert calls(checkout, "farm", "SCENE=scenes/mine.toml", "WORKERS=3") == [
        "flowloom farm scenes/mine.toml --workers 3"]
    assert calls(checkout, "-j4", "lint") == ["ruff check .", "mypy"]
    assert calls(checkout, "test", "PYTEST=-k volumes") == ["ruff check .", "mypy", "python -m pytest -k volumes"]


def test_a_failure_is_makes_failure(checkout: Path) -> None:
    calls(checkout, "setup")
    assert calls(checkout, "test", fail=1) == ["ruff check ."]
    assert calls(checkout, "diff", fail=1) == ["flowloom diff"]


def test_help_names_every_target() -> None:
    makefile = (ROOT / "Makefile").read_text()
    targets = {name for line in re.findall(r"^\.PHONY: (.*)$", makefile, re.MULTILINE) for name in line.split()}
    shown = subprocess.run(["make", "-s", "-C", ROOT, "--no-print-directory"], capture_output=True, text=True,
                           check=True, env={"PATH": os.environ["PATH"]}).stdout
    for name in targets - {"$(FIGURES)"}:
        assert re.search(rf"^  make {name} .*\w", shown, re.MULTILINE), f"make {name} has no help"
    for scene in (ROOT / "scenes").glob("*.toml"):
        assert f"  make {scene.stem}\n" in shown
