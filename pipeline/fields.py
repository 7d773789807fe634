"""What synth makes, in out/X/fields: the exemplars I, the coarse motion L and the detail H; 2-D fields as EXR, 3-D ones
as VDB.

L is a velocity in world units per second. The exemplars and H are in the exemplar's unit (its longest vector is
1), H in the exemplar's coordinates, before the coordinate transformation: so ω and what follows it is tuned
without re-synthesis. Where the local frame faces out of the smoke (§3.3), O is the smoke that L alone carries.
"""

from __future__ import annotations

import dataclasses
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from pipeline import obstacles
from pipeline.errors import BadInput
from pipeline.files import atomic, images, pictures, volumes
from pipeline.product import Frames, Product, Stock, value_at
from pipeline.product import Scene as AnyScene
from pipeline.schema import Scene
from synth.field import Field, domain_origin


def suffix(scene: AnyScene) -> str:
    """The suffix of a field."""
    return "exr" if scene.dimension == 2 else "vdb"


def write_field(file: Path, field: Field, scene: Scene) -> None:
    """Write a 2-D field as EXR, a 3-D one as VDB: grid `vel` of vectors, `density` of scalars."""
    if field.dimension == 2:
        images.write_field(file, field)
    else:
        volumes.write(file, {"vel" if field.is_vector else "density": field})


def write_velocity(file: Path, field: Field, scene: AnyScene) -> None:
    """Write a velocity; a volume says its unit and its rate."""
    if field.dimension == 2:
        images.write_field(file, field)
    else:
        volumes.write(file, {"vel": field}, metadata={"unit": "world units per second", "fps": f"{scene.fps:g}"})


def write_detail(file: Path, field: Field, scene: Scene) -> None:
    """Write H; a volume says that it is no velocity of the world."""
    if field.dimension == 2:
        images.write_field(file, field)
    else:
        volumes.write(file, {"vel": field}, metadata={"unit": "the exemplar's longest vector", "axes": "local frame"})


def read_field(file: Path, scene: AnyScene) -> Field:
    """Read a field that one of these wrote; its checksum vouches for it, so it needs no child process."""
    if file.suffix != ".vdb":
        return images.read_field(file)
    (field,) = volumes.read(file).values()
    return field


def foreign_field(file: Path, key: str, dimension: int = 2) -> Field:
    """A vector field of the user's: an EXR, or a VDB's grid `vel`, in the plane its middle slice."""
    try:
        field = volumes.read_foreign(file, "vel") if file.suffix == ".vdb" else images.read_foreign_field(file, key)
    except BadInput as error:
        raise BadInput(file, key, error.reason) from error
    if not field.is_vector:
        raise BadInput(file, key, "holds no vector field")
    if field.dimension < dimension:
        raise BadInput(file, key, "is flat, and the output is not: it takes a VDB with a grid vel")
    if field.dimension > dimension:
        field = Field(field.values[len(field.values) // 2, ..., :2], field.voxel_size, field.origin[:2])
    return field


def _exemplar(key: str) -> Callable[[Scene, Stock, list[int]], Iterator[tuple[int, Field]]]:
    """Makes the exemplar whose table is at `key` of the scene, from its procedure or its file."""

    def make(scene: Scene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, Field]]:
        from synth.motion import exemplar

        wanted: Any = value_at(scene, key)
        file = f"{key}.file"
        match wanted.kind:
            case "bitmap":
                values = exemplar.from_bitmap(pictures.read_grey(wanted.file, file), wanted.size, wanted.blur)
            case "drawing" if wanted.file.suffix == ".svg":
                values = exemplar.from_svg(_text(wanted.file, file), wanted.size)
            case "drawing":
                values = exemplar.from_drawing(pictures.read_foreign(wanted.file, file)[::-1], wanted.size)
            case "field":
                solid = scene.dimension == 3 and wanted.solid
                foreign = foreign_field(wanted.file, file, 3 if solid else 2).values
                values = (exemplar.from_volume if solid else exemplar.from_field)(foreign, wanted.size, wanted.toroidal)
            case "clip":
                from pipeline.files import video

                values = exemplar.from_clip(video.read_grey(wanted.file, file), wanted.size)
            case _:
                values = exemplar.exemplar(wanted.kind, wanted.size)
        yield 0, Field.centred(values, values.ndim - 1)

    return make


def _text(file: Path, key: str) -> str:
    try:
        return file.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise BadInput(file, key, "is not an SVG document in UTF-8") from None


def make_coarse(scene: AnyScene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, Field]]:
    """L, world units per second. A simulation is run from its start: at its resolution that costs little."""
    from synth.motion.coarse import coarse

    wanted: Any = scene.coarse
    if wanted.kind == "file":
        steady = foreign_field(wanted.file, "coarse.file", scene.dimension)
        size, cells = steady.shape[::-1], scene.cells
        if any(n * size[1] != cells[1] * m for n, m in zip(cells, size, strict=True)):
            raise BadInput(wanted.file, "coarse.file", f"{'×'.join(map(str, size))} has not the shape of "
                                                       f"{scene.cells_key}, {'×'.join(map(str, cells))}")
        steady = Field.centred(steady.values, scene.dimension)
        if scene.obstacles:
            steady = Field.centred(_past_obstacles(scene, stock, steady.values), scene.dimension)
        yield from ((frame, steady) for frame in frames)
        return
    settings = wanted.model_dump(exclude={"kind", "size"})
    if wanted.kind == "wake" and scene.stone:
        settings |= {"centre": scene.stone.centre, "radius": scene.stone.radius[0]}
    motion = coarse(wanted.kind, wanted.size[::-1], frames[-1], scene.seed, **settings)
    before: tuple[np.ndarray, np.ndarray] | None = None
    for frame, values in enumerate(motion, start=1):
        if frame in frames:
            if scene.obstacles and wanted.kind != "wake":  # which passes its stone by itself
                if before is None or not np.array_equal(before[0], values):  # a steady flow is projected once
                    before = values, _past_obstacles(scene, stock, values)
                values = before[1]
            yield frame, Field.centred(values, scene.dimension).per_second(scene.fps)


def _past_obstacles(scene: AnyScene, stock: Stock, L: np.ndarray) -> np.ndarray:
    """L on the cells of H, where the walls are as sharp as H will know them, with no flow through them."""
    from synth.motion.coarse import upsample
    from synth.projection import project

    return project(upsample(L, scene.shape), obstacles.border(scene), obstacles.distance(scene, stock))


def make_smoke(scene: Scene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, Field]]:
    """O on the cells of L: the smoke that the coarse motion alone carries (supplement A, pseudocode 4)."""
    from synth.motion.density import naive

    L = (stock.read("L", frame).per_frame(scene.fps).values for frame in range(1, frames[-1] + 1))
    for frame, values in enumerate(naive(L, sources(scene), border=scene.density.border), start=1):
        if frame in frames:
            yield frame, Field.centred(values, scene.dimension)


def sources(scene: Scene) -> list[Any]:
    """The sources of the density, as synth.motion.density takes them."""
    from synth.motion.density import Source

    made = []
    for number, source in enumerate(scene.density.sources):
        radius = source.radius if len(source.radius) > 1 else source.radius[0]
        settings = source.model_dump(exclude={"radius"})
        made.append(Source(radius=radius, seed=scene.seed + number, **settings))
    return made


def make_detail(scene: Scene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, Field]]:
    """H, sequential in time. An interrupted run goes on from the state kept beside its last frame: same bits."""
    synthesis, state_type = _flat_synthesis(scene, stock) if scene.dimension == 2 else _solid_synthesis(scene, stock)
    done, state = _kept(stock, frames[0], state_type)
    for frame in range(done + 1, frames[-1] + 1):
        L = coarse_cells(scene, stock, frame)
        state = synthesis.frame(L, state) if scene.dimension == 2 else synthesis.frame(
            L, towards(scene, stock, frame), state)
        if frame in frames:
            yield frame, Field.centred(synthesis.visible(state), scene.dimension)
        if frame < frames[-1]:
            _keep(stock, frame, state)


def _flat_synthesis(scene: Scene, stock: Stock) -> tuple[Any, type]:
    from synth.motion import detail, lagrangian, potential

    wanted = scene.detail
    levels = detail.enough_levels(scene.exemplar.size) if wanted.levels == "auto" else wanted.levels
    settings = detail.Settings(levels, wanted.neighborhoods, wanted.iterations, wanted.search, wanted.k, wanted.along)
    exemplar, shape = stock.read("exemplar").values, (scene.shape[0], scene.shape[1])
    if wanted.samples == "lagrangian":
        return lagrangian.Synthesis(exemplar, shape, settings, scene.seed), lagrangian.State
    way = potential.Synthesis if wanted.synthesize == "potential" else detail.Synthesis
    return way(exemplar, shape, settings, scene.seed,
               obstacles.distance(scene, stock) if wanted.boundary else None), detail.State


def _solid_synthesis(scene: Scene, stock: Stock) -> tuple[Any, type]:
    from synth.motion import synthesis_3d

    views = solid_views(scene, {name: stock.read(name).values for name in scene.exemplars})
    distance = obstacles.distance(scene, stock) if scene.detail.boundary else None
    return synthesis_3d.Synthesis(views, _solid_shape(scene), solid_settings(scene), scene.seed, distance), synthesis_3d.State


def solid_views(scene: Scene, values: dict[str, np.ndarray]) -> list[Any]:
    """The views of a 3-D scene for synth.motion.solid; values: of each exemplar, by its product's name."""
    from synth.motion.synthesis_3d import View

    tables = {value_at(scene, key): name for name, key in scene.exemplars.items()}
    return [View(values[tables[view.exemplar]], *view.axes, weight=view.weight) for view in scene.seen]


def solid_settings(scene: Scene) -> Any:
    """The settings of the synthesis in space."""
    from synth.motion import detail, synthesis_3d

    wanted = scene.detail
    levels = detail.enough_levels(min(view.exemplar.size for view in scene.seen if view.exemplar)) if (
        wanted.levels == "auto") else wanted.levels
    return synthesis_3d.Settings(levels, wanted.neighborhoods, wanted.iterations, wanted.search, wanted.k, wanted.along)


def detail_memory(scene: Scene) -> tuple[float, str]:
    """Bytes that the synthesis of a 3-D H takes, and the key that decides."""
    from synth.motion import synthesis_3d

    cells = {name: np.broadcast_to(np.float32(1), _exemplar_shape(value_at(scene, key)))
             for name, key in scene.exemplars.items()}  # stand-ins that take no memory
    return synthesis_3d.memory_needed(solid_views(scene, cells), _solid_shape(scene), solid_settings(scene)), "detail.size"


def _exemplar_shape(exemplar: Any) -> tuple[int, ...]:
    dimension = 3 if getattr(exemplar, "solid", False) else 2
    return (exemplar.size,) * dimension + (dimension,)


def coarse_cells(scene: Scene, stock: Stock, frame: int) -> np.ndarray:
    """L (Y, X, 2) or (Z, Y, X, 3) on the cells of H, cells per frame."""
    from synth.motion.coarse import upsample

    return upsample(stock.read("L", frame).per_frame(scene.fps).values, scene.shape)


def towards(scene: Scene, stock: Stock, frame: int) -> np.ndarray:
    """What the local z axis faces (Z, Y, X, 3), of any length, on the cells of H (§3.3)."""
    from synth.motion import local_axes as local
    from synth.motion.coarse import upsample

    match scene.detail.facing:
        case "density":
            return upsample(local.outward(stock.read("O", frame).values), scene.shape)
        case "directions":
            cells = (np.array([d.at for d in scene.detail.directions]) - domain_origin(scene.shape)) * scene.shape[-2]
            return local.interpolated_directions(
                cells, np.array([d.vector for d in scene.detail.directions]), _solid_shape(scene))
    return np.broadcast_to(np.array([0, 0, 1], np.float32), (*scene.shape, 3))


def _solid_shape(scene: Scene) -> tuple[int, int, int]:
    z, y, x = scene.shape
    return z, y, x


STATE = "H.state.npz"


def _keep(stock: Stock, frame: int, state: Any) -> None:
    """Keep what frame + 1 is made from: each list of arrays of the state, by its name and their numbers."""
    arrays = {f"{field.name}.{level}": values
              for field in dataclasses.fields(state) for level, values in enumerate(getattr(state, field.name))}
    with atomic.replacing(stock.work / STATE) as temporary, temporary.open("wb") as content:
        np.savez(content, allow_pickle=False, **{"frame": np.array(frame), "key": np.array(stock.key(frame)), **arrays})


def _kept(stock: Stock, first: int, state_type: type) -> tuple[int, Any]:
    """The last frame before `first` whose state is kept, and the state; (0, None) if there is none."""
    lists: dict[str, list[np.ndarray]] = {field.name: [] for field in dataclasses.fields(state_type)}
    try:
        with (stock.work / STATE).open("rb") as file, np.load(file, allow_pickle=False) as kept:
            frame = int(kept["frame"])
            if not 0 < frame < first or str(kept["key"]) != stock.key(frame):
                return 0, None
            for name in kept.files:
                field, _, level = name.rpartition(".")
                if field:
                    lists[field].insert(int(level), kept[name])
            return frame, state_type(**lists)
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return 0, None  # none, or damaged by a crash of the machine: the frames are made again from the first


LOCAL_FRAME = ("detail.size", "detail.along", "detail.facing", "detail.directions")
"""The keys that the coordinate transformation depends on."""


def facing(scene: Scene, which: Frames) -> tuple[tuple[str, Frames], ...]:
    """The input that `towards` reads, if any."""
    return (("O", which),) if scene.dimension == 3 and scene.detail.facing == "density" else ()


def products(scene: Scene) -> tuple[Product, ...]:
    """The exemplars, L, the smoke O where the local frame faces out of it, and H."""
    flat, known, out_of_smoke = scene.dimension == 2, scene.exemplars, facing(scene, "until")
    solid = obstacles.inputs(scene)
    files = ("synth.motion.exemplar", "synth.field")
    # of one file a flat scene takes another part than one in space
    made = [Product(
        name=name, stage="synth", folder="fields", suffix=_exemplar_suffix(key), animated=False,
        reads=(key, "dimension") if hasattr(value_at(scene, key), "solid") else (key,), inputs=(), methods=files,
        make=_exemplar(key), write=write_field, read=read_field) for name, key in known.items()]
    made.append(coarse_product(scene))
    if out_of_smoke:
        made.append(Product(
            name="O", stage="synth", folder="fields", suffix=suffix,
            reads=("density.sources", "density.border", "seed", "fps"), inputs=(("L", "until"),),
            methods=("synth.motion.density", "synth.field"), make=make_smoke, write=write_field, read=read_field))
    made.append(Product(
        name="H", stage="synth", folder="fields", suffix=suffix,
        reads=("detail", "seed", "fps", *(() if flat else ("views",))),
        inputs=(*((name, "once") for name in known), ("L", "until"), *out_of_smoke,
                *(solid if scene.detail.boundary else ())),
        methods=(_method(scene), "synth.motion.coarse", "synth.field"),
        make=make_detail, write=write_detail, read=read_field, memory=None if flat else detail_memory))
    return tuple(made)


def coarse_product(scene: AnyScene) -> Product:
    """L."""
    solid = obstacles.inputs(scene)
    by_file = scene.coarse is not None and scene.coarse.kind == "file"
    return Product(
        name="L", stage="synth", folder="fields", suffix=suffix,
        reads=("coarse", "seed", "fps", *(("dimension",) if by_file else ()), *(("stone", "cells") if solid else ())),
        inputs=solid, methods=("synth.motion.coarse", "synth.projection", "synth.field"), make=make_coarse,
        write=write_velocity, read=read_field)


def _method(scene: Scene) -> str:
    """The module that synthesizes H."""
    if scene.dimension == 3:
        return "synth.motion.synthesis_3d"
    if scene.detail.samples == "lagrangian":
        return "synth.motion.lagrangian"
    return "synth.motion.potential" if scene.detail.synthesize == "potential" else "synth.motion.detail"


def _exemplar_suffix(key: str) -> Callable[[Scene], str]:
    def suffix_of(scene: Scene) -> str:
        return "vdb" if scene.dimension == 3 and getattr(value_at(scene, key), "solid", False) else "exr"

    return suffix_of
