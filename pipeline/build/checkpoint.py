"""The state that interrupted sequential work goes on from: the one mechanism for every artifact."""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from pipeline.files import atomic

State = dict[str, np.ndarray]
FRAME, KEY = "checkpoint.frame", "checkpoint.key"  # beside the arrays of the state, whatever their names


class Checkpoint:
    """The last state of an artifact's work, beside its unfinished files; it goes when the folder is complete.

    file  where it is kept
    key   the key of one of the artifact's frames, as its manifest will say: a state of another scene, exemplar or
          code is not gone on from
    """

    def __init__(self, file: Path, key: Callable[[int], str]):
        self._file, self._key = file, key

    def save(self, frame: int, state: Mapping[str, np.ndarray]) -> None:
        """Keep the state after `frame`, the artifact's last or the one that is in work."""
        with atomic.replacing(self._file) as temporary, temporary.open("wb") as content:
            about = {FRAME: np.array(frame), KEY: np.array(self._key(frame))}
            np.savez(content, allow_pickle=False, **about, **state)

    def load(self, before: int | None = None) -> tuple[int, State] | None:
        """The frame of the state that is kept, and the state, its arrays in the order they were saved in.

        None if there is none, if it is of another key, damaged by a crash of the machine, or not of a frame `before`
        this one.
        """
        try:
            with self._file.open("rb") as file, np.load(file, allow_pickle=False) as kept:
                frame = int(kept[FRAME])
                if str(kept[KEY]) != self._key(frame) or (before is not None and not 0 < frame < before):
                    return None
                return frame, {name: kept[name] for name in kept.files if name not in (FRAME, KEY)}
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
            return None


class OwnFrames(Checkpoint):
    """The checkpoint of an artifact whose frames are its states: it goes on from the frame before.

    read  the value of one of its own frames, None if that is not up to date
    """

    def __init__(self, read: Callable[[int], State | None]):
        self._read = read

    def save(self, frame: int, state: Mapping[str, np.ndarray]) -> None:
        """The frame is the state: nothing more is kept."""

    def load(self, before: int | None = None) -> tuple[int, State] | None:
        """The frame before `before`, if there is one."""
        state = self._read(before - 1) if before and before > 1 else None
        return None if before is None or state is None else (before - 1, state)
