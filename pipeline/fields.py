"""What synth makes, in out/X/fields: the exemplar I, the coarse motion L and the detail H, 2-D fields as EXR.

L is a velocity in world units per second. The exemplar and H are in the exemplar's unit (its longest vector is
1), H in the exemplar's coordinates, before the coordinate transformation: so ω and what follows it is tuned
without re-synthesis.
"""

from __future__ import annotations

import dataclasses
import io
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.errors import BadInput
from pipeline.files import atomic, images, pictures, volumes
from pipeline.product import Product, Stock
from pipeline.schema import Scene
from synth.field import Field

if TYPE_CHECKING:
    from synth.motion.detail import State


def exr(scene: Scene) -> str:
    """The suffix of a 2-D field."""
    return "exr"


def write_field(file: Path, field: Field, scene: Scene) -> None:
    """Write a 2-D field."""
    images.write_field(file, field)


def read_field(file: Path, scene: Scene) -> Field:
    """Read a field that `write_field` wrote; its checksum vouches for it, so it needs no child process."""
    return images.read_field(file)


def foreign_field(file: Path, key: str) -> Field:
    """A 2-D vector field of the user's: an EXR, or the middle slice of a VDB's grid `vel`."""
    try:
        field = volumes.read_foreign(file, "vel") if file.suffix == ".vdb" else images.read_foreign_field(file, key)
    except BadInput as error:
        raise BadInput(file, key, error.reason) from error
    if not field.is_vector:
        raise BadInput(file, key, "holds no vector field")
    if field.dimension == 3:
        field = Field(field.values[len(field.values) // 2, ..., :2], field.voxel_size, field.origin[:2])
    return field


def make_exemplar(scene: Scene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, Field]]:
    """I, from its procedure or its file."""
    from synth.motion import exemplar

    wanted: Any = scene.exemplar
    match wanted.kind:
        case "bitmap":
            values = exemplar.from_bitmap(pictures.read_grey(wanted.file, "exemplar.file"), wanted.size, wanted.blur)
        case "drawing" if wanted.file.suffix == ".svg":
            values = exemplar.from_svg(_text(wanted.file), wanted.size)
        case "drawing":
            values = exemplar.from_drawing(pictures.read_foreign(wanted.file, "exemplar.file")[::-1], wanted.size)
        case "field":
            values = exemplar.from_field(foreign_field(wanted.file, "exemplar.file").values, wanted.size,
                                         wanted.toroidal)
        case "clip":
            from pipeline.files import video

            values = exemplar.from_clip(video.read_grey(wanted.file, "exemplar.file"), wanted.size)
        case _:
            values = exemplar.exemplar(wanted.kind, wanted.size)
    yield 0, Field.centred(values, 2)


def _text(file: Path) -> str:
    try:
        return file.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise BadInput(file, "exemplar.file", "is not an SVG document in UTF-8") from None


def make_coarse(scene: Scene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, Field]]:
    """L, world units per second. A simulation is run from its start: at its resolution that costs little."""
    from synth.motion.coarse import coarse

    wanted: Any = scene.coarse
    if wanted.kind == "file":
        steady = foreign_field(wanted.file, "coarse.file")
        (rows, columns), detail = steady.shape, scene.detail.size
        if detail[0] * rows != detail[1] * columns:
            raise BadInput(wanted.file, "coarse.file", f"{columns}×{rows} has not the shape of detail.size, "
                                                       f"{detail[0]}×{detail[1]}")
        steady = Field.centred(steady.values, 2)
        yield from ((frame, steady) for frame in frames)
        return
    columns, rows = wanted.size
    settings = wanted.model_dump(exclude={"kind", "size"})
    motion = coarse(wanted.kind, (rows, columns), frames[-1], scene.seed, **settings)
    for frame, values in enumerate(motion, start=1):
        if frame in frames:
            yield frame, Field.centred(values, 2).per_second(scene.fps)


def make_detail(scene: Scene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, Field]]:
    """H, sequential in time. An interrupted run goes on from the state kept beside its last frame: same bits."""
    from synth.motion import detail

    wanted = scene.detail
    columns, rows = wanted.size
    levels = detail.enough_levels(scene.exemplar.size) if wanted.levels == "auto" else wanted.levels
    settings = detail.Settings(levels, wanted.neighborhoods, wanted.iterations, wanted.search, wanted.k,
                               wanted.along)
    synthesis = detail.Synthesis(stock.read("exemplar").values, (rows, columns), settings, scene.seed)
    done, state = _kept(stock, frames[0])
    for frame in range(done + 1, frames[-1] + 1):
        state = synthesis.frame(coarse_cells(scene, stock, frame), state)
        if frame in frames:
            yield frame, Field.centred(synthesis.visible(state), 2)
        if frame < frames[-1]:
            _keep(stock, frame, state)


def coarse_cells(scene: Scene, stock: Stock, frame: int) -> np.ndarray:
    """L (Y, X, 2) on the cells of H, cells per frame."""
    from synth.motion.coarse import upsample

    columns, rows = scene.detail.size
    return upsample(stock.read("L", frame).per_frame(scene.fps).values, (rows, columns))


STATE = "H.state.npz"


def _keep(stock: Stock, frame: int, state: State) -> None:
    """Keep what frame + 1 is made from: each list of arrays of the state, by its name and their numbers."""
    arrays = {f"{field.name}.{level}": values
              for field in dataclasses.fields(state) for level, values in enumerate(getattr(state, field.name))}
    content = io.BytesIO()
    np.savez(content, allow_pickle=False, **{"frame": np.array(frame), "key": np.array(stock.key(frame)), **arrays})
    atomic.write_bytes(stock.work / STATE, content.getvalue())


def _kept(stock: Stock, first: int) -> tuple[int, State | None]:
    """The last frame before `first` whose state is kept, and the state; (0, None) if there is none."""
    from synth.motion.detail import State

    lists: dict[str, list[np.ndarray]] = {field.name: [] for field in dataclasses.fields(State)}
    try:
        with np.load(io.BytesIO((stock.work / STATE).read_bytes()), allow_pickle=False) as kept:
            frame = int(kept["frame"])
            if not 0 < frame < first or str(kept["key"]) != stock.key(frame):
                return 0, None
            for name in kept.files:
                field, _, level = name.rpartition(".")
                if field:
                    lists[field].insert(int(level), kept[name])
            return frame, State(**lists)
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return 0, None  # none, or damaged by a crash of the machine: the frames are made again from the first


PRODUCTS = (
    Product(
        name="exemplar", stage="synth", folder="fields", suffix=exr, animated=False,
        reads=("exemplar",), inputs=(), methods=("synth.motion.exemplar", "synth.field"),
        make=make_exemplar, write=write_field, read=read_field),
    Product(
        name="L", stage="synth", folder="fields", suffix=exr,
        reads=("coarse", "seed", "fps"), inputs=(), methods=("synth.motion.coarse", "synth.field"),
        make=make_coarse, write=write_field, read=read_field),
    Product(
        name="H", stage="synth", folder="fields", suffix=exr,
        reads=("detail", "seed", "fps"), inputs=(("exemplar", "once"), ("L", "until")),
        methods=("synth.motion.detail", "synth.motion.coarse", "synth.field"),
        make=make_detail, write=write_field, read=read_field),
)
