"""What a product is: one series of files that a stage makes, and what its content depends on."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Protocol

from pipeline.elements_schema import ElementsScene
from pipeline.manifest import file_sha256
from pipeline.schema import Scene as MotionScene

Scene = MotionScene | ElementsScene
"""A scene of either kind; the functions of a product take the kind that has it."""

Frames = Literal["same", "until", "every", "once"]


class Stock(Protocol):
    """What a product is made from: the files that are whole, read on demand."""

    def read(self, product: str, frame: int = 0) -> Any:
        """The value of an input product's frame (0: the one file of a product that is not animated)."""

    def own(self, frame: int) -> Any | None:
        """The product's own frame, if it is whole."""

    def key(self, frame: int) -> str:
        """What the product's own frame is made from, as its manifest will say."""

    @property
    def work(self) -> Path:
        """A folder for what an interrupted run needs to go on; emptied when the product is whole."""


@dataclass(frozen=True)
class Product:
    """One series of files, `name.0001.suffix` …, or the one file `name.suffix`.

    reads   dotted keys of the scene that its content depends on; the first is blamed for values that do not do
    methods modules that compute it, of synth and render mostly: their sources, and all these import, count for its key
    inputs  products it is made from, and which of their frames frame i needs: the "same", all "until" and with
            i, "every" one, or the one file there is ("once")
    make    make(scene, stock, frames): yields (frame, value) for each of `frames` (ascending), in that order
    write   write(file, value, scene); `read` is its inverse
    still   of an animated product: whether there is only the frame that the still shows
    export  made for other programs: nothing of ours reads it
    check   refuses what can be known to be wrong before anything is made, files of the user's above all: raises
            BadInput or ValueError
    memory  bytes that make takes at its peak, an estimate from above, and the key that decides it; None: little
    """

    name: str
    stage: str
    folder: str
    suffix: Callable[[Any], str]
    reads: tuple[str, ...]
    inputs: tuple[tuple[str, Frames], ...]
    methods: tuple[str, ...]
    make: Callable[[Any, Stock, list[int]], Iterator[tuple[int, Any]]]
    write: Callable[[Path, Any, Any], None]
    read: Callable[[Path, Any], Any]
    animated: bool = True
    still: bool = False
    export: bool = False
    check: Callable[[Any], None] | None = None
    memory: Callable[[Any], tuple[float, str]] | None = None

    def file(self, scene: Scene, frame: int) -> str:
        """File name of a frame."""
        number = f".{frame:04d}" if self.animated else ""
        return f"{self.name}{number}.{self.suffix(scene)}"

    def frames(self, scene: Scene) -> list[int]:
        """The frames there are: 1 to scene.frames; the still's alone where there is no animation; or [0]."""
        if not self.animated:
            return [0]
        if self.still or (self.stage != "synth" and not scene.figure.animation):
            return [scene.figure.frame or scene.frames]
        return list(range(1, scene.frames + 1))

    def reads_files(self, scene: Scene) -> bool:
        """Whether its content depends on files that the scene names."""
        tables = [value_at(scene, key) for key in self.reads]
        several = [table for value in tables for table in (value if isinstance(value, tuple) else (value,))]
        return any(isinstance(getattr(table, "file", None), Path) for table in several)

    def tables(self, scene: Scene) -> dict[str, Any]:
        """The values of `reads`, files by their content."""
        return {key: _plain(value_at(scene, key)) for key in self.reads}


def value_at(scene: Scene, key: str) -> Any:
    """The value of a dotted key, `views[0].exemplar`; None where a table has not the key."""
    value: Any = scene
    for part in key.split("."):
        name, _, number = part.rstrip("]").partition("[")
        value = getattr(value, name, None)
        value = value[int(number)] if number else value
    return value


def _plain(value: Any) -> Any:
    """A scene value as JSON; a file as the SHA-256 of its bytes, a folder as those of its files."""
    if isinstance(value, Path):
        return {f.name: file_sha256(f) for f in sorted(value.iterdir()) if f.is_file()} if value.is_dir() else (
            file_sha256(value))
    if hasattr(value, "model_dump"):
        return _plain({name: getattr(value, name) for name in type(value).model_fields})
    if isinstance(value, dict):
        return {name: _plain(v) for name, v in value.items()}
    if isinstance(value, tuple):
        return [_plain(v) for v in value]
    return value
