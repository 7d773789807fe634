"""Which files of an output folder are up to date, and what each was made from: content decides, not time.

A folder ends with its `manifest.json`, written last: for each file its size, its SHA-256, and the key of what
it was made from (`keys`). A file is up to date if it is there, hashes to its entry and its entry has the key that is
asked for. So touching a file changes nothing; a deleted, truncated or damaged one is noticed and made again, it alone.

While a stage works, each finished file has its entry in the journal, the folder `.journal/`; an interrupted run leaves
the journal, and the next one goes on from it. Any number of processes may work in one folder: every write is a
rename, and two that make the same file write the same bits.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pipeline.errors import StorageFailed
from pipeline.files import atomic

MANIFEST = "manifest.json"
JOURNAL = ".journal"


@dataclass(frozen=True)
class Entry:
    """What the manifest says of one file."""

    key: str
    size: int
    sha256: str


def digest(value: Any) -> str:
    """SHA-256 of a JSON value in one spelling."""
    return hashlib.sha256(json.dumps(value, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def file_sha256(file: Path) -> str:
    """SHA-256 of a file's bytes."""
    with open(file, "rb") as opened:
        return hashlib.file_digest(opened, "sha256").hexdigest()


class Folder:
    """The files of one output folder and their entries. `about` goes into the manifest, for the reader."""

    def __init__(self, path: Path):
        self.path = path
        self.entries = _entries(path)
        self._verified: dict[str, tuple[int, int]] = {}

    def up_to_date(self, name: str, key: str) -> Entry | None:
        """The entry of `name` if that file is intact and was made from `key`."""
        entry = self.entries.get(name)
        return entry if entry and entry.key == key and self._intact(name, entry) else None

    def _intact(self, name: str, entry: Entry) -> bool:
        try:
            state = (self.path / name).stat()
        except OSError:
            return False
        if state.st_size != entry.size:
            return False
        stamp = (state.st_mtime_ns, state.st_ino)
        if self._verified.get(name) != stamp:
            if file_sha256(self.path / name) != entry.sha256:
                return False
            self._verified[name] = stamp
        return True

    def add(self, name: str, key: str) -> Entry:
        """Note that `name`, just written, is complete."""
        file = self.path / name
        entry = Entry(key, file.stat().st_size, file_sha256(file))
        for attempts_left in (2, 1, 0):
            try:
                self._set_manifest_aside()
                atomic.write_text(self.path / JOURNAL / f"{name}.note", _json({name: entry}))
                break
            except StorageFailed as error:
                # another process has just closed the folder, and removed its journal meanwhile
                if not (attempts_left and isinstance(error.__cause__, FileNotFoundError)):
                    raise
        self.entries[name] = entry
        return entry

    def _set_manifest_aside(self) -> None:
        """From here on the folder is not what its manifest says; its entries still hold for the other files."""
        if (self.path / MANIFEST).exists():
            (self.path / JOURNAL).mkdir(exist_ok=True)
            with contextlib.suppress(FileNotFoundError):  # another process was faster
                os.replace(self.path / MANIFEST, self.path / JOURNAL / MANIFEST)

    def close(self, keys: Mapping[str, str], about: Mapping[str, Any]) -> bool:
        """If every file of `keys` (name: key) is up to date, write the manifest and tidy up; else return False."""
        self.entries |= _entries(self.path)  # other processes may have made some of them
        found = {name: self.up_to_date(name, key) for name, key in keys.items()}
        complete = {name: entry for name, entry in found.items() if entry}
        if len(complete) < len(keys):
            return False
        written = _json(complete, about)
        manifest = self.path / MANIFEST
        if not manifest.exists() or manifest.read_text() != written:
            atomic.write_text(manifest, written)
        self._remove(name for name in self.entries if name not in keys)
        self.entries = complete
        _remove_journal(self.path)
        return True

    def discard(self) -> None:
        """Remove the files that manifest and journal name, these two, and the folder if nothing else is in it."""
        self._remove(self.entries)
        (self.path / MANIFEST).unlink(missing_ok=True)
        _remove_journal(self.path)
        with contextlib.suppress(OSError):  # the user keeps files of their own here
            self.path.rmdir()

    def _remove(self, names: Iterable[str]) -> None:
        for name in names:
            (self.path / name).unlink(missing_ok=True)


def _remove_journal(path: Path) -> None:
    journal = path / JOURNAL
    for file in journal.glob("*") if journal.is_dir() else ():
        if file.suffix != atomic.SUFFIX:
            file.unlink(missing_ok=True)
    atomic.sweep(journal)
    with contextlib.suppress(OSError):  # not there, or another process is writing a note
        journal.rmdir()


def _json(entries: Mapping[str, Entry], about: Mapping[str, Any] | None = None) -> str:
    files = {name: asdict(entries[name]) for name in sorted(entries)}
    return json.dumps({**(about or {}), "files": files}, indent=1, ensure_ascii=False) + "\n"


def _entries(path: Path) -> dict[str, Entry]:
    """What the manifest of a folder and the journal of unfinished work say; the journal is newer."""
    found = _read(path / MANIFEST)
    journal = path / JOURNAL
    for file in [journal / MANIFEST, *sorted(journal.glob("*.note"))]:
        found |= _read(file)
    # once more: meanwhile another process may have turned the journal into a manifest
    return _read(path / MANIFEST) | found


def _read(file: Path) -> dict[str, Entry]:
    """The entries of a manifest or a note; none if it is missing or damaged: its files are then made again."""
    try:
        files = json.loads(file.read_text())["files"]
        return {name: Entry(**entry) for name, entry in files.items() if Path(name).name == name}
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        return {}
