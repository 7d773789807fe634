"""Tests that need a process of their own: runs that are stopped, results at other numbers of threads."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import tiny

ROOT = Path(__file__).parents[1]

# runs the command line; the first time a file of this name is written and not yet renamed, it says so and waits
HELD = """
import pathlib, signal, sys, time
from pipeline import cli
from pipeline.files import atomic

name, flag = sys.argv[1], pathlib.Path(sys.argv[2])
sync = atomic._sync

def held(path):
    if name in path.name and path.name.endswith(atomic.SUFFIX):
        flag.touch()
        time.sleep(60)
    sync(path)

atomic._sync = held
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell starts background jobs with it ignored
cli.main(sys.argv[3:])
"""


def stopped(folder: Path, name: str, by: signal.Signals, scene: str = tiny.SMOKE,
            verb: str = "figure") -> subprocess.CompletedProcess[str]:
    """`flowloom figure`, or another verb, stopped while the file `name` is written and not yet in its place."""
    tiny.written(folder, scene)
    flag = folder / "flag"
    command = [sys.executable, "-P", "-c", HELD, name, str(flag), verb, "tiny.toml"]
    process = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 100
    while not flag.exists() and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.01)
    process.send_signal(by)
    try:
        out, err = process.communicate(timeout=50)
    finally:
        process.kill()
    assert flag.exists(), err
    return subprocess.CompletedProcess(command, process.returncode, out, err)


def digests(file: str, folder: Path) -> set[str]:
    """What `digest()` of the test module `file` gives: with one thread and no kernel cache, then with one thread and
    with two from the cache in `folder` that the first left."""
    code = "import runpy, sys; print(runpy.run_path(sys.argv[1])['digest']())"
    found = set()
    for threads in ("1", "1", "2"):
        environment = os.environ | {"POCL_MAX_PTHREAD_COUNT": threads, "OMP_NUM_THREADS": threads,
                                    "OPENBLAS_NUM_THREADS": threads, "POCL_CACHE_DIR": str(folder),
                                    "XDG_CACHE_HOME": str(folder), "PYTHONPATH": str(ROOT / "tests")}
        child = subprocess.run([sys.executable, "-c", code, file], cwd=ROOT, env=environment, capture_output=True,
                               text=True, check=False)
        assert child.returncode == 0, child.stderr
        found.add(child.stdout.strip())
    assert any(folder.iterdir())  # the cache was used
    return found
