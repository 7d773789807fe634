"""What an artifact is: one series of files that a stage makes, and what its content depends on."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol

from pipeline.build.checkpoint import Checkpoint
from pipeline.files.format import Format

Frames = Literal["same", "until", "every", "once"]
Reads = tuple[str, ...]
Needs = tuple[tuple[str, Frames], ...]

FOLDERS = {"synth": "fields", "bake": "geometry", "render": "images"}
"""The stages that make artifacts, in order, and the folder of each."""


class Inputs(Protocol):
    """What an artifact is made from, read on demand. Reading anything undeclared raises Undeclared."""

    def read(self, name: str, frame: int = 0) -> Any:
        """The value of an input's frame (0: the one file of an input that is not animated)."""

    def __contains__(self, name: str) -> bool:
        """Whether the artifact declares this input."""

    @property
    def checkpoint(self) -> Checkpoint:
        """Where the artifact keeps the state of sequential work."""


@dataclass(frozen=True)
class Artifact:
    """One series of files, `name.0001.suffix` …, or the one file `name.suffix`.

    stage        a key of FOLDERS
    reads        dotted keys of the scene that its content depends on; `make` can read no other: they raise Undeclared.
                 Where a method refuses a value, the error names the first
    inputs       artifacts it is made from, and which of their frames frame i needs: the "same", all "until" and with
                 i, "every" one, or the one file there is ("once")
    make         make(scene, inputs, frames, **arguments): yields (frame, value) for each of `frames` (ascending), in
                 that order; a frame has the same bits whichever others are made with it. A function of a module or a
                 method of a table, no closure: what it does is told by its sources and by `arguments`
    arguments    JSON values; they count for the key
    animated     one file per frame
    state_is_frame  a frame holds all that the next is made from: its checkpoint is the frame before
    still        of an animated artifact: there is only the frame that the still shows
    export       made for other programs: nothing of ours reads it
    shared       belongs to no scene: kept once for all of them, in a folder named after its content
    check        check(scene) refuses what can be known to be wrong before anything is made, files of the user's above
                 all: raises BadInput or ValueError. It sees the whole scene, since it can only refuse
    check_frame  check_frame(scene, inputs, frame) refuses what shows when the inputs of a frame are there
    note         note(scene, value): a line for the user on what was made, "" for none; a dotted key and what to know
    memory       memory(scene): bytes that make takes at its peak, an estimate from above, and the key that decides it
    """

    name: str
    stage: str
    format: Format
    reads: Reads
    inputs: Needs
    make: Callable[..., Iterator[tuple[int, Any]]]
    arguments: Mapping[str, Any] = field(default_factory=dict)
    animated: bool = True
    state_is_frame: bool = False
    still: bool = False
    export: bool = False
    shared: bool = False
    check: Callable[[Any], None] | None = None
    check_frame: Callable[[Any, Inputs, int], None] | None = None
    note: Callable[[Any, Any], str] | None = None
    memory: Callable[[Any], tuple[float, str]] | None = None

    def __post_init__(self) -> None:
        if getattr(self.make, "__closure__", None):
            raise ValueError(f"{self.name}: make is a closure; give what it captures as arguments, which its key knows")

    def file(self, frame: int) -> str:
        """File name of a frame."""
        number = f".{frame:04d}" if self.animated else ""
        return f"{self.name}{number}.{self.format.suffix}"

    def frames(self, scene: Any) -> list[int]:
        """The frames there are: 1 to scene.frames; those of the still alone where there is no animation; or [0]."""
        if not self.animated:
            return [0]
        if self.still:
            return [scene.figure.frame or scene.frames]
        if self.stage != "synth" and not scene.figure.animation:
            frames: list[int] = scene.figure.shown(scene.frames)
            return frames
        return list(range(1, scene.frames + 1))
