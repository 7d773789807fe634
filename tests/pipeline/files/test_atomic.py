"""No file is ever half there."""

import errno
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pipeline.errors import StorageFailed, Terminated
from pipeline.files import atomic


def names(folder: Path) -> list[str]:
    return sorted(p.name for p in folder.iterdir())


def test_content_arrives_whole_and_nothing_else_stays(tmp_path: Path) -> None:
    atomic.write_text(tmp_path / "new" / "a.json", "ω")
    assert (tmp_path / "new" / "a.json").read_bytes() == b"\xcf\x89"
    assert names(tmp_path / "new") == ["a.json"]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, Terminated])
def test_an_error_leaves_the_old_file_and_no_temporary(tmp_path: Path, error: type[BaseException]) -> None:
    atomic.write_text(tmp_path / "a", "old")
    with pytest.raises(error), atomic.replacing(tmp_path / "a") as temporary:
        temporary.write_text("half of the n")
        raise error
    assert names(tmp_path) == ["a"]
    assert (tmp_path / "a").read_text() == "old"


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT, errno.EFBIG])
def test_a_full_disk_is_called_by_its_name(tmp_path: Path, number: int) -> None:
    with pytest.raises(StorageFailed, match="the disk is full") as caught, atomic.replacing(tmp_path / "a"):
        raise OSError(number, os.strerror(number))
    assert caught.value.exit_code == 4
    assert "\n" not in str(caught.value)
    assert names(tmp_path) == []


def test_the_limit_of_a_file_is_met_as_a_full_disk(tmp_path: Path) -> None:
    """A real write that the system refuses (RLIMIT_FSIZE), in a process of its own."""
    code = ("import resource, sys\nfrom pathlib import Path\nfrom pipeline.files import atomic\n"
            "resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))\n"
            "try: atomic.write_bytes(Path(sys.argv[1]), bytes(5000))\n"
            "except Exception as error: print(type(error).__name__, error)")
    command = [sys.executable, "-c", code, str(tmp_path / "a")]
    child = subprocess.run(command, capture_output=True, text=True, check=True)
    assert child.stdout.startswith("StorageFailed") and "the disk is full" in child.stdout
    assert names(tmp_path) == []


def test_two_writers_of_one_file_do_not_meet(tmp_path: Path) -> None:
    path = tmp_path / "a"
    with atomic.replacing(path) as one, atomic.replacing(path) as other:
        one.write_text("one")
        other.write_text("other")
        assert one != other
    assert names(tmp_path) == ["a"]
    assert path.read_text() == "one"  # the outer one is renamed last


KILLED = """
import sys, time
from pathlib import Path
from pipeline.files import atomic
with atomic.replacing(Path(sys.argv[1])) as temporary:
    temporary.write_text("half")
    print("writing", flush=True)
    time.sleep(60)
"""


def test_the_next_run_removes_what_a_killed_one_left(tmp_path: Path) -> None:
    path = tmp_path / "density.0001.vdb"
    command = [sys.executable, "-c", KILLED, str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout is not None and child.stdout.readline() == "writing\n"
        atomic.sweep(tmp_path)
        assert len(names(tmp_path)) == 1, "the temporary of a living process stays"
        child.send_signal(signal.SIGKILL)
    assert names(tmp_path)[0].endswith(".partial")
    atomic.write_text(tmp_path / "other", "content")
    assert names(tmp_path) == ["other"]


def test_another_hosts_temporary_is_left_alone_for_a_day(tmp_path: Path) -> None:
    temporary = tmp_path / ".a.vdb.farm_node_7.1-00112233.partial"
    temporary.write_text("half")
    atomic.sweep(tmp_path)
    assert temporary.exists()
    old = time.time() - atomic.ABANDONED_SECONDS - 60
    os.utime(temporary, (old, old))
    atomic.sweep(tmp_path)
    assert not temporary.exists()


def test_a_strangers_hidden_file_is_no_temporary(tmp_path: Path) -> None:
    stranger = tmp_path / ".mine.partial"
    stranger.write_text("keep")
    atomic.sweep(tmp_path)
    assert stranger.exists()
