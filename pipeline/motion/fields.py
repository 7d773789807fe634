"""What synth makes of a scene of motion fields, in out/X/fields: the smoke O where the local axes face out of it, and
the detail H.

H is in the exemplar's unit (the longest vector of an exemplar is 1) and in the exemplar's coordinates, before the
coordinate transformation: so ω and what follows it is tuned without re-synthesis.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from pipeline.build.artifact import Artifact, Frames, Inputs, Needs
from pipeline.build.view import value_at
from pipeline.files import fields
from pipeline.flow import solid_input, upsampled, walls
from pipeline.motion.tables import MotionScene
from synth.field import Field, domain_origin


def make_smoke(scene: MotionScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, Field]]:
    """O on the cells of L: the smoke that the coarse motion alone carries (supplement A, pseudocode 4)."""
    from synth.motion.density import naive

    L = (inputs.read("L", frame).per_frame(scene.fps).values for frame in range(1, frames[-1] + 1))
    for frame, values in enumerate(naive(L, sources(scene), border=scene.density.border), start=1):
        if frame in frames:
            yield frame, Field.centred(values, scene.dimension)


def sources(scene: MotionScene) -> list[Any]:
    """The sources of the density, as synth.motion.density takes them."""
    from synth.motion.density import Source

    made = []
    for number, source in enumerate(scene.density.sources):
        radius = source.radius if len(source.radius) > 1 else source.radius[0]
        settings = source.model_dump(exclude={"radius"})
        made.append(Source(radius=radius, seed=scene.seed + number, **settings))
    return made


# -- H ------------------------------------------------------------------------------------------------------------


def make_detail(scene: MotionScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, Field]]:
    """H on a grid in the plane (§3.1 to 3.4)."""
    from synth.motion import detail

    synthesis = detail.Synthesis(*_plane(scene, inputs), distance=walls(scene, inputs))
    yield from _sequence(scene, inputs, frames, synthesis, detail.State)


def make_detail_by_potential(scene: MotionScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, Field]]:
    """H as the curl of a synthesized potential (§3.6, Discussion)."""
    from synth.motion import detail, potential

    synthesis = potential.Synthesis(*_plane(scene, inputs), distance=walls(scene, inputs))
    yield from _sequence(scene, inputs, frames, synthesis, detail.State)


def make_detail_at_samples(scene: MotionScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, Field]]:
    """H at samples that move with L (§5)."""
    from synth.motion import lagrangian

    synthesis = lagrangian.Synthesis(*_plane(scene, inputs))
    yield from _sequence(scene, inputs, frames, synthesis, lagrangian.State)


def make_detail_in_space(scene: MotionScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, Field]]:
    """H in space, from views (§3.2)."""
    from synth.motion import synthesis_3d

    views = views_of(scene, {name: inputs.read(name).values for name in scene.exemplars})
    synthesis = synthesis_3d.Synthesis(views, space(scene), settings_in_space(scene), scene.seed, walls(scene, inputs))
    yield from _sequence(scene, inputs, frames, synthesis, synthesis_3d.State)


def _sequence(scene: MotionScene, inputs: Inputs, frames: list[int], synthesis: Any, state_type: type,
              ) -> Iterator[tuple[int, Field]]:
    """H, sequential in time. An interrupted run goes on from the last state that was kept: same bits."""
    kept = inputs.checkpoint.load(before=frames[0])
    done, state = (kept[0], _state(state_type, kept[1])) if kept else (0, None)
    for frame in range(done + 1, frames[-1] + 1):
        L = upsampled(inputs.read("L", frame), scene)
        state = synthesis.frame(L, state) if scene.dimension == 2 else synthesis.frame(
            L, towards(scene, inputs, frame), state)
        if frame in frames:
            yield frame, Field.centred(synthesis.visible(state), scene.dimension)
        if frame < frames[-1]:
            inputs.checkpoint.save(frame, _arrays(state))


def _plane(scene: MotionScene, inputs: Inputs) -> tuple[Any, Any, Any, int]:
    """Exemplar, shape, settings and seed of a synthesis in the plane."""
    from synth.motion import detail

    table = scene.detail
    levels = detail.enough_levels(scene.exemplar.size) if table.levels == "auto" else table.levels
    settings = detail.Settings(levels, table.neighborhoods, table.iterations, table.search, table.k, table.along)
    return inputs.read("exemplar").values, scene.shape, settings, scene.seed


def views_of(scene: MotionScene, values: Mapping[str, np.ndarray]) -> list[Any]:
    """The views of a 3-D scene for the synthesis; values: of each exemplar, by its artifact's name."""
    from synth.motion.views import View

    return [View(values[name], view.axes[0], view.axes[1], weight=view.weight)
            for view, name in zip(scene.seen, scene.seen_exemplars, strict=True)]


def settings_in_space(scene: MotionScene) -> Any:
    """The settings of the synthesis in space."""
    from synth.motion import detail, synthesis_3d

    table = scene.detail
    levels = detail.enough_levels(min(view.exemplar.size for view in scene.seen if view.exemplar)) if (
        table.levels == "auto") else table.levels
    return synthesis_3d.Settings(levels, table.neighborhoods, table.iterations, table.search, table.k, table.along)


def detail_memory(scene: MotionScene) -> tuple[float, str]:
    """Bytes that the synthesis of a 3-D H takes, and the key that decides."""
    from synth.motion import synthesis_3d

    cells = {name: np.broadcast_to(np.float32(1), _exemplar_shape(value_at(scene, key)))
             for name, key in scene.exemplars.items()}  # stand-ins that take no memory
    return synthesis_3d.memory_needed(views_of(scene, cells), space(scene), settings_in_space(scene)), "detail.size"


def _exemplar_shape(exemplar: Any) -> tuple[int, ...]:
    dimension = 3 if exemplar.volumetric else 2
    return (exemplar.size,) * dimension + (dimension,)


def _arrays(state: Any) -> dict[str, np.ndarray]:
    """Each list of arrays of a state, by its name and their numbers."""
    return {f"{field.name}.{level}": values
            for field in dataclasses.fields(state) for level, values in enumerate(getattr(state, field.name))}


def _state(state_type: type, arrays: Mapping[str, np.ndarray]) -> Any:
    """The inverse of `_arrays`."""
    lists: dict[str, list[np.ndarray]] = {field.name: [] for field in dataclasses.fields(state_type)}
    for name, values in arrays.items():
        lists[name.rpartition(".")[0]].append(values)
    return state_type(**lists)


# -- the local axes on the cells of H -----------------------------------------------------------------------

LOCAL_AXES = ("shape", "dimension", "detail.along", "detail.facing", "detail.directions", "fps")
"""The keys that the coordinate transformation depends on."""


def towards(scene: MotionScene, inputs: Inputs, frame: int) -> np.ndarray:
    """What the local z axis faces (Z, Y, X, 3), of any length, on the cells of H (§3.3)."""
    from synth.motion import local_axes
    from synth.motion.coarse import upsample

    match scene.detail.facing:
        case "density":
            return upsample(local_axes.outward(inputs.read("O", frame).values), scene.shape)
        case "directions":
            cells = (np.array([d.at for d in scene.detail.directions]) - domain_origin(scene.shape)) * scene.shape[-2]
            return local_axes.interpolated_directions(
                cells, np.array([d.vector for d in scene.detail.directions]), space(scene))
    return np.broadcast_to(np.array([0, 0, 1], np.float32), (*scene.shape, 3))


def smoke_input(scene: MotionScene, which: Frames) -> Needs:
    """The input that `towards` reads, if any."""
    return (("O", which),) if scene.dimension == 3 and scene.detail.facing == "density" else ()


def space(scene: MotionScene) -> tuple[int, int, int]:
    """The shape of a scene in space."""
    z, y, x = scene.shape
    return z, y, x


def field_artifacts(scene: MotionScene) -> tuple[Artifact, ...]:
    """O where the local axes face out of the smoke, and H."""
    made = []
    if smoke_input(scene, "until"):
        made.append(Artifact(
            "O", "synth", fields.kept(scene.dimension),
            ("density.sources", "density.border", "seed", "fps", "dimension"), (("L", "until"),), make_smoke))
    reads = ("detail", "seed", "fps", "shape", "dimension",
             *(("exemplar.size",) if scene.dimension == 2 else ("seen", "seen_exemplars", "exemplars")))
    walls_seen = solid_input(scene) if scene.detail.boundary else ()
    made.append(Artifact(
        "H", "synth", fields.kept(scene.dimension, unit=fields.EXEMPLAR_UNITS, axes="local frame"), reads,
        (*((name, "once") for name in scene.exemplars), ("L", "until"), *smoke_input(scene, "until"), *walls_seen),
        _synthesis(scene), memory=detail_memory if scene.dimension == 3 else None))
    return tuple(made)


def _synthesis(scene: MotionScene) -> Callable[..., Iterator[tuple[int, Field]]]:
    """How H is synthesized."""
    if scene.dimension == 3:
        return make_detail_in_space
    if scene.detail.samples == "lagrangian":
        return make_detail_at_samples
    return make_detail_by_potential if scene.detail.synthesize == "potential" else make_detail
