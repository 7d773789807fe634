"""What a key is made of. Two files with the same key have the same content; nothing else decides what is made again.

    name, arguments     of the artifact, and the frame
    values              the scene's values that it declares, files of the user's by their content
    code                what computes it, found by following its imports (`source_digest`)
    format              suffix and options
    inputs              the hash of each file it is made from

`make` can read nothing else: the scene through a `view.SceneView`, its inputs through `graph`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pipeline.build import source_digest
from pipeline.build.artifact import Artifact
from pipeline.build.manifest import digest, file_sha256
from pipeline.build.view import value_at


def key(artifact: Artifact, scene: Any, made_from: Mapping[str, Artifact], frame: int, hashes: Sequence[str]) -> str:
    """The key of a frame. `made_from`: the artifacts of its inputs; `hashes`: of the files themselves."""
    names = [f"{name} {which}" for name, which in artifact.inputs]
    return digest([artifact.name, frame, declared(artifact, scene), names, hashes, code(artifact, scene, made_from)])


def content_id(artifact: Artifact, scene: Any, inputs: Sequence[str]) -> str:
    """Equal for two scenes exactly if this artifact of theirs has the same content; `inputs`: the ids of its inputs.

    It does not know the code, so that an edit does not move files.
    """
    return digest([artifact.name, declared(artifact, scene), inputs])


def declared(artifact: Artifact, scene: Any) -> list[Any]:
    """The values of the scene that an artifact declares, its arguments and its format, as JSON."""
    values = {read: plain(value_at(scene, read)) for read in artifact.reads}
    return [values, plain(artifact.arguments), artifact.format.suffix, plain(artifact.format.options)]


def code(artifact: Artifact, scene: Any, made_from: Mapping[str, Artifact]) -> str:
    """SHA-256 of the code that computes an artifact, writes it and reads its inputs."""
    functions = [artifact.make, artifact.format.write, *(made_from[name].format.read for name, _ in artifact.inputs)]
    return source_digest.digest(functions, _tables([value_at(scene, read) for read in artifact.reads]))


def _tables(values: Sequence[Any]) -> set[type]:
    """The classes of the tables among values, and in them: their methods are code that `make` can call."""
    found: set[type] = set()
    for value in values:
        if hasattr(value, "model_dump"):
            inner = [getattr(value, name) for name in type(value).model_fields]
            found |= {type(value), *_tables(inner)}
        elif isinstance(value, tuple):
            found |= _tables(value)
    return found


def reads_files(artifact: Artifact, scene: Any) -> bool:
    """Whether its content depends on files that the scene names."""
    return _has_path([value_at(scene, read) for read in artifact.reads])


def _has_path(values: Sequence[Any]) -> bool:
    return any(isinstance(value, Path) or (isinstance(value, tuple) and _has_path(value))
               or (hasattr(value, "model_dump") and _has_path([getattr(value, n) for n in type(value).model_fields]))
               for value in values)


def plain(value: Any) -> Any:
    """A scene value as JSON; a file as the SHA-256 of its bytes, a folder as those of its files."""
    if isinstance(value, Path):
        return {f.name: file_sha256(f) for f in sorted(value.iterdir()) if f.is_file()} if value.is_dir() else (
            file_sha256(value))
    if hasattr(value, "model_dump"):
        return plain({name: getattr(value, name) for name in type(value).model_fields})
    if isinstance(value, Mapping):
        return {name: plain(v) for name, v in value.items()}
    if isinstance(value, tuple | list):
        return [plain(v) for v in value]
    return value
