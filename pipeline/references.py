"""What a scene gives at its [quick] settings, and the reference that keeps it (`flowloom references`).

A reference is a folder tests/references/<scene>/, or references/<scene>/ beside a scene that is not the
project's. It holds the frame that the figure shows of every artifact of synth and bake, as the stages write it, but
for files above LARGEST; a small proof of that frame, `proof.exr`, for each different picture; and
`reference.json`, written last: the sums of every frame, the SHA-256 of each file, and the versions that rendered
the proofs.
"""

from __future__ import annotations

import hashlib
import json
import math
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.build.artifact import Artifact
from pipeline.build.graph import BuildGraph, DeclaredInputs, computed
from pipeline.errors import BadInput
from pipeline.files import atomic, images
from pipeline.tables import PROJECT_SCENES
from synth.elements.samples import Elements

RECORD = "reference.json"
PROOF = "proof.exr"
LARGEST = 1_000_000  # bytes of a file that is kept


@dataclass(frozen=True)
class Made:
    """A file of fields or geometry: its path under the scene's output root, where it is, and how it is read."""

    path: str
    file: Path
    artifact: Artifact
    is_kept: bool

    def values(self, file: Path) -> np.ndarray:
        """The values of `file`, which is this one or its reference."""
        return _numbers(self.artifact.format.read(file))

    @property
    def is_light(self) -> bool:
        """Whether the values are a picture (h, w, 3) of linear light, top row first."""
        return self.artifact.format.read is images.read_picture


@dataclass(frozen=True)
class Proof:
    """A small picture of a variant's shown frame: linear light (h, w, 3), and what versions rendered it."""

    path: str
    light: np.ndarray
    made_with: dict[str, str]


def contents(graph: BuildGraph) -> Iterator[Made]:
    """Every file of fields and geometry, each once however many variants share it."""
    seen: set[Path] = set()
    for variant, artifacts in graph.artifacts.items():
        scene = graph.variants[variant]
        for artifact in artifacts.values():
            if artifact.stage == "render" or artifact.export or artifact.shared:
                continue
            for frame in artifact.frames(scene):
                file = graph.file(variant, artifact.name, frame)
                if file not in seen:
                    seen.add(file)
                    path = file.relative_to(graph.root).as_posix()
                    # of a large mesh the sums are enough: its proof shows it
                    is_kept = frame in (0, _shown_frame(scene)) and file.stat().st_size <= LARGEST
                    yield Made(path, file, artifact, is_kept)


def _shown_frame(scene: Any) -> int:
    """The frame of the still."""
    frame: int = scene.figure.frame or scene.frames
    return frame


def proofs(graph: BuildGraph) -> Iterator[Proof]:
    """One proof for each different picture among the variants; none of a scene that renders no smoke."""
    for variant in graph.distinct_variants("beauty"):
        scene = graph.variants[variant]
        small = scene.model_copy(update={"render": scene.render.proof()})
        frame = _shown_frame(scene)
        folder = graph.file(variant, "beauty", frame).parent.relative_to(graph.root)
        light = np.asarray(_ProofInputs(graph, variant, small, "beauty").picture(frame), np.float32)
        yield Proof((folder / PROOF).as_posix(), light, small.render.made_with())


class _ProofInputs(DeclaredInputs):
    """The inputs of a proof, which is made in memory: files that are up to date, and other pictures made as small."""

    def __init__(self, graph: BuildGraph, variant: str, small: Any, name: str):
        self._small = small
        self._artifacts = {artifact.name: artifact for artifact in graph.method.artifacts(small)}
        super().__init__(graph, variant, self._artifacts[name])

    def picture(self, frame: int) -> np.ndarray:
        """The artifact's picture of a frame, in the small scene."""
        light: np.ndarray = next(computed(self._artifact, self._small, self, [frame]))[1]
        return light

    def _value(self, name: str, frame: int) -> Any:
        if self._artifacts[name].stage == "render":
            return _ProofInputs(self._graph, self._variant, self._small, name).picture(frame)
        return super()._value(name, frame)


def _numbers(value: Any) -> np.ndarray:
    """All numbers of a value as one array that a page can show."""
    if isinstance(value, Elements):
        return value.positions.reshape(len(value.positions), -1)
    if isinstance(value, dict):  # a mesh or points: all their numbers, in a square
        if "faces" in value:  # numbers of vertices and bytes of colour as shares: else they would drown the places
            value = {**value, "faces": value["faces"] / len(value["vertices"])}
            if "colours" in value:
                value["colours"] = value["colours"] / 255
        numbers = np.concatenate([np.ravel(value[name]).astype(np.float32) for name in sorted(value)])
        side = math.isqrt(len(numbers) - 1) + 1
        return np.pad(numbers, (0, side * side - len(numbers))).reshape(side, side)
    return np.asarray(getattr(value, "values", value))


def sums(values: np.ndarray) -> dict[str, Any]:
    """What is kept of every frame: shape, sum, and sum of absolute values, added in double precision."""
    exact = values.astype(np.float64)
    return {"shape": list(values.shape), "sum": float(exact.sum()), "absolute": float(np.abs(exact).sum())}


def folder_of(scene_file: Path) -> Path:
    """Where a scene's reference is kept."""
    home = scene_file.resolve().parent
    if home == PROJECT_SCENES:
        home = PROJECT_SCENES.parent / "tests"
    return home / "references" / scene_file.stem


def write(graph: BuildGraph) -> str:
    """Keep what a scene gives, whose graph is baked at its [quick] settings; returns one line for the user.

    A reference that would be the same to the bit stays untouched.
    """
    folder = folder_of(graph.file_of_scene)
    record: dict[str, dict[str, Any]] = {"sums": {}, "proofs": {}, "files": {}}
    kept: dict[str, bytes] = {}
    for made in contents(graph):
        record["sums"][made.path] = sums(made.values(made.file))
        if made.is_kept:
            kept[made.path] = made.file.read_bytes()
    for proof in proofs(graph):
        record["proofs"][proof.path] = proof.made_with
        kept[proof.path] = _exr(proof.light)
    record["files"] = {path: hashlib.sha256(content).hexdigest() for path, content in kept.items()}
    text = _spelled(record)
    if (folder / RECORD).is_file() and (folder / RECORD).read_text() == text:
        return f"{graph.name}: unchanged"
    for path, content in kept.items():
        atomic.write_bytes(folder / path, content)
    atomic.write_text(folder / RECORD, text)
    for file in folder.rglob("*"):
        if file.is_file() and file.relative_to(folder).as_posix() not in {RECORD, *kept}:
            file.unlink()
    megabytes = sum(map(len, kept.values())) / 1e6
    return f"{graph.name}: {len(kept)} files, {megabytes:.1f} MB, kept in {folder}"


def _exr(light: np.ndarray) -> bytes:
    """Linear light (h, w, 3) as the content of a float EXR file."""
    with tempfile.TemporaryDirectory(prefix="flowloom-proof-") as folder:
        file = Path(folder) / PROOF
        images.write_picture(file, light)
        return file.read_bytes()


def _spelled(record: dict[str, dict[str, Any]]) -> str:
    """The record as JSON, one line for each file: a review of a changed reference shows which changed."""
    tables = []
    for name, table in record.items():
        lines = (f"  {json.dumps(path)}: {json.dumps(value)}" for path, value in table.items())
        tables.append(f" {json.dumps(name)}: {{\n" + ",\n".join(lines) + "\n }")
    return "{\n" + ",\n".join(tables) + "\n}\n"


def record_of(scene_file: Path) -> dict[str, dict[str, Any]]:
    """The record of a scene's reference, its files checked; BadInput if there is none or it is damaged."""
    folder = folder_of(scene_file)
    remedy = f"type: flowloom references {scene_file}"
    try:
        record: dict[str, dict[str, Any]] = json.loads((folder / RECORD).read_text())
        damaged = [path for path, sha256 in record["files"].items() if sha256 != _sha256(folder / path)]
    except FileNotFoundError as error:
        missing = Path(error.filename).relative_to(folder)
        raise BadInput(scene_file, "", f"has no reference ({missing} is missing); {remedy}") from None
    except (ValueError, KeyError, AttributeError, TypeError) as error:
        raise BadInput(folder / RECORD, "", f"is damaged; check it out anew, or {remedy}") from error
    if damaged:
        raise BadInput(folder / damaged[0], "", f"is damaged; check it out anew, or {remedy}")
    return record


def _sha256(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()
