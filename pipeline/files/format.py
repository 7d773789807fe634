"""A file format as a value: a suffix, how a value is written and how it is read back."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Format:
    """How the values of an artifact are kept. Each module of `pipeline.files` ends with its formats.

    write    write(file, value, **options), which is atomic and checks what it wrote
    read     its inverse, for our own files: their checksum is known
    options  JSON values; they count for the key of what is written with them
    """

    suffix: str
    write: Callable[..., None]
    read: Callable[[Path], Any]
    options: Mapping[str, Any] = field(default_factory=dict)

    def save(self, file: Path, value: Any) -> None:
        """Write `value` to `file`."""
        self.write(file, value, **self.options)
