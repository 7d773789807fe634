"""The scene as an artifact may read it: what it does not declare raises, so that a key cannot lie.

An artifact that read a value it does not declare would stay as it is when that value changes: a stale picture,
in silence. So `make` is given a view of the scene, in the product as in every test.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any


class Undeclared(RuntimeError):
    """An artifact reads what it does not declare; the text names both. A fault of the method's code."""


def value_at(scene: Any, key: str) -> Any:
    """The value of a dotted key, `views[0].exemplar`; None where a table does not have the key."""
    if isinstance(scene, SceneView):
        return scene._at(key)
    value: Any = scene
    for part in key.split("."):
        name, _, number = part.rstrip("]").partition("[")
        value = getattr(value, name, None)
        value = value[int(number)] if number else value
    return value


class SceneView:
    """A scene, or a table of it, of which only the keys in `reads` can be read.

    A declared key gives the value itself, with all that it holds; a table above a declared key gives a view of that
    table. A property or a constant of a table is a key like any other: its value counts. Methods can be called only of
    a table that is declared as a whole, whose code then counts.
    """

    __slots__ = ("_by", "_path", "_reads", "_value")

    def __init__(self, value: Any, reads: Sequence[str], by: str, path: str = ""):
        self._value, self._reads, self._by, self._path = value, reads, by, path

    def __getattr__(self, name: str) -> Any:
        key = f"{self._path}.{name}" if self._path else name
        if _covered(key, self._reads):
            return getattr(self._value, name)
        if not any(read.startswith((f"{key}.", f"{key}[")) for read in self._reads):
            raise Undeclared(f"{self._by} reads {key}, which it does not declare")
        value = getattr(self._value, name, None)
        return None if value is None else SceneView(value, self._reads, self._by, key)

    def _at(self, key: str) -> Any:
        if not _covered(key, self._reads):
            raise Undeclared(f"{self._by} reads {key}, which it does not declare")
        return value_at(self._value, key)


def _covered(key: str, reads: Sequence[str]) -> bool:
    """Whether a key is declared, or lies in a table that is."""
    return any(key == read or key.startswith((f"{read}.", f"{read}[")) for read in reads)
