"""What a scene gives at its [quick] settings, and the reference that keeps it (`flowloom references`).

A reference is a folder tests/references/<scene>/, or references/<scene>/ beside a scene that is not the
project's. It holds the frame that the figure shows of every product of synth and bake, as the stages write it, but
for files above LARGEST; a small proof of that frame, `proof.exr`, for each different picture; and
`reference.json`, written last: the sums of every frame, the SHA-256 of each file, and the versions that rendered
the proofs.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
import math
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline import stages
from pipeline.errors import BadInput
from pipeline.files import atomic, images
from pipeline.product import Scene
from pipeline.progress import Progress
from pipeline.scene import load
from pipeline.schema import PROJECT_SCENES
from synth.elements.samples import Elements

RECORD = "reference.json"
PROOF = "proof.exr"
PROOF_WIDTH, PROOF_SAMPLES = 96, 8
LARGEST = 1_000_000  # bytes of a file that is kept


@dataclass(frozen=True)
class Made:
    """A file of fields or geometry: its path under the scene's output root, and where and how to read it."""

    path: str
    file: Path
    works: stages.Works
    variant: str
    product: str
    is_kept: bool

    def values(self, file: Path) -> np.ndarray:
        """The values of `file`, which is this one or its reference."""
        return _read(self.works, self.variant, self.product, file)


@dataclass(frozen=True)
class Proof:
    """A small picture of a variant's shown frame: linear light (h, w, 3), and what versions rendered it."""

    path: str
    light: np.ndarray
    made_with: dict[str, str]


def baked(scene_file: Path, out: Path, progress: Progress) -> stages.Works:
    """The scene's works with all of synth and bake made, at its [quick] settings."""
    scenes = load(scene_file, quick=True)
    stages.run("bake", scenes, out, progress)
    return stages.Works(scenes, out)


def shown_frame(scene: Scene) -> int:
    """The frame of the still."""
    return scene.figure.frame or scene.frames


def contents(works: stages.Works) -> Iterator[Made]:
    """Every file of fields and geometry, each once however many variants share it."""
    seen: set[Path] = set()
    for variant, products in works.products.items():
        scene = works.scenes.variants[variant]
        for product in products.values():
            if product.stage not in ("synth", "bake") or product.export:
                continue
            for frame in product.frames(scene):
                file = works.file(variant, product.name, frame)
                if file not in seen:
                    seen.add(file)
                    path = file.relative_to(works.root).as_posix()
                    # of a large mesh the sums are enough: its proof shows it
                    is_kept = frame in (0, shown_frame(scene)) and file.stat().st_size <= LARGEST
                    yield Made(path, file, works, variant, product.name, is_kept)


def proofs(works: stages.Works) -> Iterator[Proof]:
    """One proof for each different picture among the variants; none of a scene that renders no smoke."""
    for variant in works.makers("beauty"):
        scene = works.scenes.variants[variant]
        render = proof_settings(scene.render)
        product, frame = works.products[variant]["beauty"], shown_frame(scene)
        small = scene.model_copy(update={"render": render})
        made = product.make(small, _Stock(works, variant, small), [frame])
        folder = works.file(variant, "beauty", frame).parent.relative_to(works.root)
        light = np.asarray(next(made)[1], np.float32)
        yield Proof((folder / PROOF).as_posix(), light, made_with(render.kind))


def proof_settings(render: Any) -> Any:
    """A scene's [render] table at the size and samples of a proof."""
    width = min(PROOF_WIDTH, render.width)
    small: dict[str, Any] = {"width": width}
    if render.kind == "volume":
        height = round(render.height * width / render.width)
        small |= {"height": height, "spp": PROOF_SAMPLES, "denoised": False}
    if render.kind in ("seaweed", "school", "noodles", "paper"):
        small |= {"height": round(render.height * width / render.width), "spp": PROOF_SAMPLES}
    if render.kind in ("particles", "beads"):
        small |= {"spp": PROOF_SAMPLES}
    return render.model_copy(update=small)


class _Stock:
    """product.Stock for a proof, which is made in memory from whole files; other pictures that it needs too."""

    def __init__(self, works: stages.Works, variant: str, small: Scene):
        self._works, self._variant, self._small = works, variant, small

    def read(self, product: str, frame: int = 0) -> Any:
        scene, made = self._works.scenes.variants[self._variant], self._works.products[self._variant][product]
        if made.stage == "render":
            return next(made.make(self._small, self, [frame]))[1]
        return made.read(self._works.file(self._variant, product, frame), scene)

    def own(self, frame: int) -> Any | None:
        return None

    def key(self, frame: int) -> str:
        return ""

    @property
    def work(self) -> Path:
        raise NotImplementedError("a proof is one frame: there is nothing to go on from")


def _read(works: stages.Works, variant: str, product: str, file: Path) -> np.ndarray:
    value = works.products[variant][product].read(file, works.scenes.variants[variant])
    if isinstance(value, Elements):
        return value.positions.reshape(len(value.positions), -1)
    if isinstance(value, dict):  # a mesh or points: all their numbers, in a square that a page can show
        if "faces" in value:  # numbers of vertices and bytes of colour as shares: else they would drown the places
            value = {**value, "faces": value["faces"] / len(value["vertices"])}
            if "colours" in value:
                value["colours"] = value["colours"] / 255
        numbers = np.concatenate([np.ravel(value[name]).astype(np.float32) for name in sorted(value)])
        side = math.isqrt(len(numbers) - 1) + 1
        return np.pad(numbers, (0, side * side - len(numbers))).reshape(side, side)
    return np.asarray(getattr(value, "values", value))


def made_with(kind: str) -> dict[str, str]:
    """The versions that a picture of this [render] kind depends on."""
    if kind not in ("lit", "ink"):
        from render import backend

        return {"llvm": "none", **backend.versions("scalar_rgb")}  # a scalar variant does without
    return {name: importlib.metadata.version(name) for name in ("numpy", "scipy")}


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


def write(scene_file: Path, out: Path, progress: Progress) -> str:
    """Run a scene at its [quick] settings and keep what it gives; returns one line for the user.

    A reference that would be the same to the bit stays untouched. Raises what the stages raise.
    """
    works = baked(scene_file, out, progress)
    folder = folder_of(scene_file)
    record: dict[str, dict[str, Any]] = {"sums": {}, "proofs": {}, "files": {}}
    kept: dict[str, bytes] = {}
    for made in contents(works):
        record["sums"][made.path] = sums(made.values(made.file))
        if made.is_kept:
            kept[made.path] = made.file.read_bytes()
    for proof in proofs(works):
        record["proofs"][proof.path] = proof.made_with
        kept[proof.path] = _exr(proof.light)
    record["files"] = {path: hashlib.sha256(content).hexdigest() for path, content in kept.items()}
    text = _spelled(record)
    if (folder / RECORD).is_file() and (folder / RECORD).read_text() == text:
        return f"{scene_file.stem}: unchanged"
    for path, content in kept.items():
        atomic.write_bytes(folder / path, content)
    atomic.write_text(folder / RECORD, text)
    for file in folder.rglob("*"):
        if file.is_file() and file.relative_to(folder).as_posix() not in {RECORD, *kept}:
            file.unlink()
    megabytes = sum(map(len, kept.values())) / 1e6
    return f"{scene_file.stem}: {len(kept)} files, {megabytes:.1f} MB, kept in {folder}"


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
    mending = f"type: flowloom references {scene_file}"
    try:
        record: dict[str, dict[str, Any]] = json.loads((folder / RECORD).read_text())
        damaged = [path for path, sha256 in record["files"].items() if sha256 != _sha256(folder / path)]
    except FileNotFoundError as error:
        missing = Path(error.filename).relative_to(folder)
        raise BadInput(scene_file, "", f"has no reference ({missing} is missing); {mending}") from None
    except (ValueError, KeyError, AttributeError, TypeError) as error:
        raise BadInput(folder / RECORD, "", f"is damaged; check it out anew, or {mending}") from error
    if damaged:
        raise BadInput(folder / damaged[0], "", f"is damaged; check it out anew, or {mending}")
    return record


def _sha256(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()
