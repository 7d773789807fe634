"""A reader that aborts, hangs or devours memory costs a child process and one line."""

import importlib.util
import time
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from pipeline.errors import BadInput
from pipeline.files import sandbox

HERE = Path(__file__)


READERS = """
import os, signal, time, sys, numpy as np
def arrays(path): return dict(np.load(path))
def settings(path, factor): print("noise"); return {"size": path.stat().st_size, "factor": factor}
def abort(path): os.abort()
def crash(path): os.kill(os.getpid(), signal.SIGSEGV)
def leave(path): sys.exit("two lines\\nthe last")
def refuse(path): raise ValueError("not a picture\\nat all")
def hang(path): time.sleep(60)
def devour(path): return {"all": np.ones(1 << 28, np.float64)}
"""


@pytest.fixture
def readers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """A module of readers that the child finds too."""
    folder = tmp_path / "modules"
    folder.mkdir()
    (folder / "readers.py").write_text(READERS)
    monkeypatch.setenv("PYTHONPATH", str(folder))
    spec = importlib.util.spec_from_file_location("readers", folder / "readers.py")
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_arrays_and_values_come_through(tmp_path: Path, readers: ModuleType) -> None:
    path = tmp_path / "a.npz"
    a, b = np.arange(24, dtype=np.float32).reshape(2, 3, 4)[:, ::-1], np.array([[7]], dtype=np.int16)
    np.savez(path, a=a, b=b, none=np.zeros((0, 3)))
    answer = sandbox.read(readers.arrays, path, "key")
    assert sorted(answer) == ["a", "b", "none"]
    assert answer["a"].dtype == np.float32 and np.array_equal(answer["a"], a)
    assert answer["b"].dtype == np.int16 and np.array_equal(answer["b"], b)
    assert answer["none"].shape == (0, 3)
    answer["a"][0] = 0  # writable
    assert sandbox.read(readers.settings, path, "key", 2.5) == {"size": path.stat().st_size, "factor": 2.5}


@pytest.mark.parametrize(("name", "reason"), [
    ("refuse", "not a picture"),
    ("abort", "damaged: its reader ended by SIGABRT"),
    ("crash", "damaged: its reader ended by SIGSEGV"),
    ("leave", "damaged: the last"),
])
def test_a_dead_reader_is_one_line(readers: ModuleType, name: str, reason: str) -> None:
    with pytest.raises(BadInput) as caught:
        sandbox.read(getattr(readers, name), HERE, "coarse.file")
    assert str(caught.value) == f"{HERE}: coarse.file: {reason}"
    assert caught.value.exit_code == 2


def test_a_hanging_reader_is_ended(readers: ModuleType) -> None:
    start = time.monotonic()
    with pytest.raises(BadInput, match="damaged: not read within 2 s"):
        sandbox.read(readers.hang, HERE, "key", seconds=2.0)
    assert time.monotonic() - start < 20


def test_memory_is_limited(readers: ModuleType) -> None:
    with pytest.raises(BadInput, match="needs more than 1024 MiB"):
        sandbox.read(readers.devour, HERE, "key", memory=1 << 30)


def test_a_missing_file_is_said_plainly(tmp_path: Path, readers: ModuleType) -> None:
    with pytest.raises(BadInput, match=r"coarse\.file: no such file"):
        sandbox.read(readers.arrays, tmp_path / "none", "coarse.file")
