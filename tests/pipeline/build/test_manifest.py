"""Content decides: what is whole, what is noticed, what is tidied away."""

import json
import os
from pathlib import Path

import pytest

from pipeline.build.manifest import JOURNAL, MANIFEST, Folder, digest


def filled(path: Path, names: tuple[str, ...] = ("a.exr", "b.exr"), key: str = "k") -> Folder:
    """A closed folder in which each file holds its own name."""
    path.mkdir(exist_ok=True)
    folder = Folder(path)
    for name in names:
        (path / name).write_text(name)
        folder.add(name, key)
    assert folder.close(dict.fromkeys(names, key), {"stage": "synth"})
    return folder


def test_a_closed_folder_is_whole_and_holds_its_manifest_and_nothing_of_the_work(tmp_path: Path) -> None:
    filled(tmp_path / "f")
    assert sorted(p.name for p in (tmp_path / "f").iterdir()) == ["a.exr", "b.exr", MANIFEST]
    again = Folder(tmp_path / "f")
    assert again.up_to_date("a.exr", "k")
    assert again.up_to_date("b.exr", "k")
    assert json.loads((tmp_path / "f" / MANIFEST).read_text())["stage"] == "synth"


def test_another_key_is_another_file(tmp_path: Path) -> None:
    filled(tmp_path / "f")
    assert Folder(tmp_path / "f").up_to_date("a.exr", "other") is None


def test_touching_changes_nothing(tmp_path: Path) -> None:
    filled(tmp_path / "f")
    os.utime(tmp_path / "f" / "a.exr", (1, 1))
    assert Folder(tmp_path / "f").up_to_date("a.exr", "k")


def test_a_deleted_truncated_or_damaged_file_is_noticed_and_only_it(tmp_path: Path) -> None:
    path = tmp_path / "f"
    filled(path, ("deleted.exr", "short.exr", "flipped.exr", "fine.exr"))
    (path / "deleted.exr").unlink()
    (path / "short.exr").write_text("short")
    stamp = (path / "flipped.exr").stat()
    (path / "flipped.exr").write_text("flippee.exr")
    os.utime(path / "flipped.exr", ns=(stamp.st_atime_ns, stamp.st_mtime_ns))  # same size, same time, other bits
    folder = Folder(path)
    assert [name for name in folder.entries if folder.up_to_date(name, "k")] == ["fine.exr"]


def test_damage_within_one_run_is_noticed_too(tmp_path: Path) -> None:
    folder = filled(tmp_path / "f")
    assert folder.up_to_date("a.exr", "k")
    (tmp_path / "f" / "a.exr").write_text("b.exr")
    assert folder.up_to_date("a.exr", "k") is None


def test_an_interrupted_run_leaves_notes_that_the_next_one_reads(tmp_path: Path) -> None:
    (tmp_path / "a.exr").write_text("a")
    Folder(tmp_path).add("a.exr", "k")
    folder = Folder(tmp_path)
    assert folder.up_to_date("a.exr", "k")
    assert not folder.close({"a.exr": "k", "b.exr": "k"}, {})
    assert not (tmp_path / MANIFEST).exists()


def test_the_first_new_file_takes_the_old_manifest_away_and_keeps_what_it_says(tmp_path: Path) -> None:
    filled(tmp_path / "f")
    (tmp_path / "f" / "a.exr").write_text("new")
    Folder(tmp_path / "f").add("a.exr", "new key")
    assert not (tmp_path / "f" / MANIFEST).exists()
    folder = Folder(tmp_path / "f")
    assert folder.up_to_date("b.exr", "k")
    assert folder.up_to_date("a.exr", "new key")
    assert folder.close({"a.exr": "new key", "b.exr": "k"}, {})


def test_closing_removes_what_older_scenes_made_and_nothing_of_the_users(tmp_path: Path) -> None:
    path = tmp_path / "f"
    filled(path, ("a.exr", "old.exr"))
    (path / "mine.txt").write_text("mine")
    Folder(path).close({"a.exr": "k"}, {})
    assert sorted(p.name for p in path.iterdir()) == ["a.exr", MANIFEST, "mine.txt"]


def test_closing_twice_leaves_the_manifest_untouched(tmp_path: Path) -> None:
    folder = filled(tmp_path / "f")
    before = (tmp_path / "f" / MANIFEST).stat()
    folder.close({"a.exr": "k", "b.exr": "k"}, {"stage": "synth"})
    assert (tmp_path / "f" / MANIFEST).stat() == before


def test_discarding_removes_the_folder_but_never_the_users_files(tmp_path: Path) -> None:
    filled(tmp_path / "f").discard()
    assert not (tmp_path / "f").exists()
    folder = filled(tmp_path / "g")
    (tmp_path / "g" / "mine.txt").write_text("mine")
    folder.discard()
    assert [p.name for p in (tmp_path / "g").iterdir()] == ["mine.txt"]


@pytest.mark.parametrize("text", ["", "{", "[]", '{"files": 3}', '{"files": {"a.exr": {"size": 1}}}', '{"files": []}',
                                  '{"files": {"a.exr": 1}}', "\x00"])
def test_a_damaged_manifest_means_nothing_is_whole(tmp_path: Path, text: str) -> None:
    filled(tmp_path / "f")
    (tmp_path / "f" / MANIFEST).write_text(text)
    assert Folder(tmp_path / "f").entries == {}


def test_a_manifest_cannot_name_files_outside_its_folder(tmp_path: Path) -> None:
    (tmp_path / "precious").write_text("precious")
    (tmp_path / "f").mkdir()
    entry = {"key": "k", "size": 8, "sha256": ""}
    (tmp_path / "f" / MANIFEST).write_text(json.dumps({"files": {"../precious": entry, "/etc/x": entry}}))
    Folder(tmp_path / "f").discard()
    assert (tmp_path / "precious").exists()


def test_notes_of_several_processes_add_up(tmp_path: Path) -> None:
    first, second = Folder(tmp_path), Folder(tmp_path)
    for folder, name in ((first, "a.exr"), (second, "b.exr")):
        (tmp_path / name).write_text(name)
        folder.add(name, "k")
    assert Folder(tmp_path).close({"a.exr": "k", "b.exr": "k"}, {})
    assert not (tmp_path / JOURNAL).exists()


def test_a_digest_depends_on_content_not_on_order() -> None:
    assert digest({"a": 1, "b": [1, 2]}) == digest({"b": [1, 2], "a": 1})
    assert digest({"a": 1}) != digest({"a": 1.5})
    assert digest([1, 2]) != digest([2, 1])
