"""What a key is made of. Two files with the same key have the same content; nothing else decides what is made again.

    name, arguments     of the artifact, and the frame
    values              the scene's values that it declares, files of the user's by their content
    code                what computes it, found by following the names it uses (`source_digest`)
    format              suffix and options
    inputs              the hash of each file it is made from

`make` can read nothing else: the scene through a `view.SceneView`, its inputs through `graph`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from pipeline.build import source_digest
from pipeline.build.artifact import Artifact
from pipeline.build.manifest import digest, file_sha256
from pipeline.build.view import value_at


def key(constant: str, frame: int, hashes: Sequence[str]) -> str:
    """The key of a frame; `hashes`: of the files that it is made from, in the order of the artifact's inputs."""
    return digest([constant, frame, hashes])


def constant(artifact: Artifact, scene: Any, made_from: Mapping[str, Artifact]) -> str:
    """What is the same in the keys of all frames. `made_from`: the artifacts of its inputs."""
    return digest([declared(artifact, scene), code(artifact, scene, made_from)])


def content_id(artifact: Artifact, scene: Any, inputs: Sequence[str]) -> str:
    """Equal for two scenes exactly if this artifact of theirs has the same content; `inputs`: the ids of its inputs.

    It knows which function makes the artifact but not the code, so that an edit does not move files.
    """
    table = getattr(artifact.make, "__self__", None)
    owner = "" if table is None else (table if isinstance(table, type) else type(table)).__qualname__
    return digest([declared(artifact, scene), artifact.make.__module__, artifact.make.__qualname__, owner, inputs])


def declared(artifact: Artifact, scene: Any) -> list[Any]:
    """Name, inputs, the values of the scene that an artifact declares, arguments and format, as JSON."""
    values = {read: plain(value_at(scene, read)) for read in artifact.reads}
    needs = [[name, which, scene.frames if which == "every" else 0] for name, which in artifact.inputs]
    return [artifact.name, values, needs, plain(artifact.arguments), artifact.format.suffix,
            plain(artifact.format.options)]


def code(artifact: Artifact, scene: Any, made_from: Mapping[str, Artifact]) -> str:
    """SHA-256 of the code that computes an artifact, writes it and reads its inputs."""
    functions = [artifact.make, artifact.format.write, *(made_from[name].format.read for name, _ in artifact.inputs)]
    return source_digest.digest(functions, tables(artifact, scene))


def tables(artifact: Artifact, scene: Any) -> set[type]:
    """The classes of the tables that an artifact declares: their methods are code that `make` can call."""
    return {type(value) for value in _declared_values(artifact, scene) if hasattr(value, "model_fields")}


def reads_files(artifact: Artifact, scene: Any) -> bool:
    """Whether its content depends on files that the scene names."""
    return any(isinstance(value, Path) for value in _declared_values(artifact, scene))


def _declared_values(artifact: Artifact, scene: Any) -> Iterator[Any]:
    """The values that an artifact declares, and all that is in them."""
    waiting = [value_at(scene, read) for read in artifact.reads]
    while waiting:
        value = waiting.pop()
        yield value
        if hasattr(type(value), "model_fields"):
            waiting += [getattr(value, name) for name in type(value).model_fields]
        elif isinstance(value, Mapping):
            waiting += value.values()
        elif isinstance(value, tuple | list):
            waiting += value


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
