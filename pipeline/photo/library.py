"""A library of a user's own clips: a folder that scenes name, filled by `flowloom clips add`.

Each clip is two files named after its video: `pond.npz`, its frames, and `pond.json`, what is known of them. The second
is written last, so a clip without it is not there yet; who deletes both has removed the clip. A clip whose frames do
not have the SHA-256 that was noted is damaged, and never used.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from pipeline.build.graph import folder_name
from pipeline.build.manifest import file_sha256
from pipeline.errors import BadInput, StorageFailed
from pipeline.files import arrays, atomic
from pipeline.photo.own import read_own


@dataclass(frozen=True)
class Entry:
    """What is known of a clip of a library.

    name           of the clip: that of its video in lower-case letters, digits, - and .
    sha256         of its frames' file
    frames         of the clip
    size           columns and rows
    fps            frames per second; 0 where the video does not tell
    speed          pixels per frame: the median of the mean motion, where it is significant (okabe11 §4, fig. 5)
    moving         share of the pixels whose mean motion is significant
    source         name of the video
    source_sha256  of the video
    """

    name: str
    sha256: str
    frames: int
    size: tuple[int, int]
    fps: float
    speed: float
    moving: float
    source: str
    source_sha256: str


def frames_file(folder: Path, name: str) -> Path:
    """The file of the frames of a clip."""
    return folder / f"{name}.npz"


def entries(folder: Path) -> list[Entry]:
    """The clips of a library by name. Raises BadInput for a folder that is none, StorageFailed for a damaged note."""
    notes = sorted(folder.glob("*.json"))
    if not notes:
        raise BadInput(folder, "", "is no clip library: flowloom clips add makes one")
    return [_noted(note) for note in notes]


def files(folder: Path) -> tuple[Path, ...]:
    """The files of the frames of all clips of a library, by name. Raises as `entries`, and for one that is gone."""
    found = [(entry, frames_file(folder, entry.name)) for entry in entries(folder)]
    for entry, file in found:
        if not file.is_file():
            raise _damaged(file, entry)
    return tuple(file for _, file in found)


def _damaged(file: Path, entry: Entry) -> StorageFailed:
    return StorageFailed(file, f"is damaged or gone; add {entry.source} again, or delete {entry.name}.json")


def _noted(note: Path) -> Entry:
    try:
        found = Entry(**json.loads(note.read_text(encoding="utf-8")))
        if found.name != note.stem or len(found.size) != 2:
            raise ValueError
    except (OSError, ValueError, TypeError) as error:
        raise StorageFailed(note, "is damaged; delete it and add its video again") from error
    return found


def read(file: Path) -> np.ndarray:
    """The frames (T, Y, X) uint8, lowest row first, of a clip, from their file.

    Raises StorageFailed where they are damaged or gone.
    """
    entry = _noted(file.with_suffix(".json"))
    if not _intact(file, entry):
        raise _damaged(file, entry)
    return arrays.read(file)["luma"]


def _intact(file: Path, entry: Entry) -> bool:
    return file.is_file() and file_sha256(file) == entry.sha256


def add(file: Path, folder: Path) -> tuple[Entry, bool]:
    """Check a video, and keep it as a clip of the library in `folder`; its entry, and whether it is new.

    Raises BadInput for one that is no use, whose name is taken by another, or that is no file; then nothing is added.
    """
    # 1. the name, and who has it
    name = folder_name(file.stem)
    if not file.is_file():
        raise BadInput(file, "", "no such file")
    if not name:
        raise BadInput(file, "", "its name needs a letter or a digit, by which its clip is called")
    note, source = folder / f"{name}.json", file_sha256(file)
    if note.exists():
        known = _noted(note)
        if known.source_sha256 != source:
            raise BadInput(file, "", f"{folder} has a clip {name} of another video, {known.source}: rename this one")
        if _intact(frames_file(folder, name), known):
            return known, False
    # 2. the clip, its checks
    clip = read_own(file, "")
    # 3. both files
    arrays.write(frames_file(folder, name), {"luma": clip.luma})
    speed, moving = motion_of(clip.luma)
    count, rows, columns = clip.luma.shape
    entry = Entry(name, file_sha256(frames_file(folder, name)), count, (columns, rows), clip.fps, round(speed, 3),
                  round(moving, 3), file.name, source)
    atomic.write_text(note, json.dumps(asdict(entry), indent=1, ensure_ascii=False) + "\n")
    return entry, True


def motion_of(luma: np.ndarray) -> tuple[float, float]:
    """Of a clip (T, Y, X) uint8 the median speed, pixels per frame, of the pixels whose mean motion is significant, and
    their share (okabe11 §4, fig. 5)."""
    from synth.photo.motion import SIGNIFICANT, optical_flow

    mean = optical_flow(luma).mean(axis=0)
    speed = np.hypot(mean[..., 0], mean[..., 1])
    moves = speed >= SIGNIFICANT
    return float(np.median(speed[moves])) if moves.any() else 0.0, float(moves.mean())


def made_line() -> str:
    """The clips that are made: their families, and how many of each the whole catalogue has."""
    from synth.photo.clips import SHARES

    return f"made: {sum(SHARES.values())} clips: " + ", ".join(f"{name} {count}" for name, count in SHARES.items())


def lines(folder: Path) -> Iterator[str]:
    """The lines of `flowloom clips list` for a library; where there is no folder it has no clips.

    Raises StorageFailed for the first clip that is damaged, after all lines.
    """
    found = entries(folder) if folder.is_dir() else []
    yield f"{folder}: {len(found)} clip{'' if len(found) == 1 else 's'}"
    width = max((len(entry.name) for entry in found), default=0)
    damaged = None
    for entry in found:
        file = frames_file(folder, entry.name)
        if _intact(file, entry):
            yield (f"{entry.name:{width}}  {entry.frames:3d} frames  {entry.size[0]:3d} x {entry.size[1]:<3d}  "
                   f"{entry.speed:5.2f} pixels a frame  {100 * entry.moving:3.0f} % moves")
        else:
            yield f"{entry.name:{width}}  damaged"
            damaged = damaged or _damaged(file, entry)
    if damaged:
        raise damaged
