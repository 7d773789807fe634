"""What bake makes of a scene of motion fields, in out/X/geometry: the final motion F, and what it moves, the smoke
density, particles or the blades of seaweed; in world units.

These are moved by F as it is computed from L and H, not by the files of F: so any frame can be baked alone, by any
machine of a farm.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.build.artifact import Artifact, Inputs, Needs
from pipeline.files import fields, meshes
from pipeline.files.meshes import Mesh
from pipeline.flow import solid_input, upsampled, walls
from pipeline.motion.fields import LOCAL_AXES, smoke_input, sources, towards
from pipeline.motion.tables import MotionScene
from synth.field import Field, domain_origin


@dataclass(frozen=True)
class Motion:
    """The motion of one frame, cells per frame; L is read and upsampled once.

    L      the coarse motion on its own cells
    fine   L on the cells of H
    final  F on the cells of H (§3.5)
    """

    L: np.ndarray
    fine: np.ndarray
    final: np.ndarray


def motion(scene: MotionScene, inputs: Inputs, frame: int) -> Motion:
    """The motion of a frame (§3.5)."""
    from synth.motion.combine import combine

    L = inputs.read("L", frame)
    fine = upsampled(L, scene)
    weight = None if scene.combine.weight == "uniform" else scene.combine.weight
    final = combine(fine, transformed(scene, inputs, frame, fine), scene.combine.omega, weight,
                    scene.border if scene.combine.project else None,
                    walls(scene, inputs) if scene.combine.project else None)
    return Motion(L.per_frame(scene.fps).values, fine, final)


def transformed(scene: MotionScene, inputs: Inputs, frame: int, L: np.ndarray) -> np.ndarray:
    """H' (Y, X, 2) or (Z, Y, X, 3): H in the domain's coordinates (§3.1, CoordinateTransform). L: on the cells of H."""
    from synth.motion import local_axes

    if scene.dimension == 2:
        axes = local_axes.axes_2d(L, scene.detail.along)
    else:
        axes = local_axes.axes_3d(L, towards(scene, inputs, frame), scene.detail.along)
    return local_axes.to_world(inputs.read("H", frame).values, axes)


def make_final(scene: MotionScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, Field]]:
    """F, world units per second."""
    for frame in frames:
        yield frame, Field.centred(motion(scene, inputs, frame).final, scene.dimension).per_second(scene.fps)


# -- the density --------------------------------------------------------------------------------------------------


def require_smoke(scene: MotionScene) -> None:
    """ValueError unless some source lets smoke in, in some frame: a density of zero is nothing to render."""
    from synth.motion.density import density_shape

    shape = density_shape(scene.shape, scene.density.scale)
    if not any(source.bounds(shape, frame)[1].any() for frame in range(1, scene.frames + 1)
               for source in sources(scene)):
        raise ValueError("no smoke enters: each source lies outside the domain, or its level or duty is 0")


def make_density(scene: MotionScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, Field]]:
    """The density. A few frames of many are made one by one, which gives the same bits as all in a row."""
    table = scene.density
    last = frames[-1]
    settings: dict[str, Any] = {"scale": table.scale, "border": table.border}
    if table.scheme == "windowed" and len(frames) * table.m <= last:
        yield from _single_windows(scene, inputs, frames, settings)
        return
    from synth.motion.density import naive, windowed

    motions = (motion(scene, inputs, frame) for frame in range(1, last + 1))
    if table.scheme == "naive":
        every = naive(map(_carried, motions), sources(scene), **settings)
    else:  # it takes L and F frame by frame: one frame of motion is held
        one, other = itertools.tee(motions)
        every = windowed((m.L for m in other), map(_carried, one), sources(scene), table.m, **settings)
    for frame, values in enumerate(every, start=1):
        if frame in frames:
            yield frame, _placed(scene, inputs, values)


def _carried(frame: Motion) -> Any:
    """F of a frame, its detail riding on L."""
    from synth.motion.density import Carried

    return Carried(frame.final, frame.fine)


def _single_windows(scene: MotionScene, inputs: Inputs, frames: list[int], settings: dict[str, Any],
                    ) -> Iterator[tuple[int, Field]]:
    """Frame by frame, each from O_{i-m} (pseudocode 4): for a farm, and for a file that was lost."""
    from synth.motion.density import naive

    m = scene.density.m
    ends = {frame - m: frame for frame in frames if frame > m}
    for frame in frames:
        if frame <= m:
            yield frame, _window(scene, inputs, None, frame, settings)
    L = (upsampled(inputs.read("L", frame), scene) for frame in range(1, max(ends, default=0) + 1))
    for start, O in enumerate(naive(L, sources(scene), **settings), start=1):
        if start in ends:
            yield ends[start], _window(scene, inputs, O, ends[start], settings)


def _window(scene: MotionScene, inputs: Inputs, O: np.ndarray | None, frame: int, settings: dict[str, Any]) -> Field:
    from synth.motion.density import window

    first = max(frame - scene.density.m, 0) + 1
    F = (_carried(motion(scene, inputs, i)) for i in range(first, frame + 1))
    return _placed(scene, inputs, window(O, F, sources(scene), first, **settings))


def _placed(scene: MotionScene, inputs: Inputs, density: np.ndarray) -> Field:
    """A density where it was made, or one of the plane with the body that [density.depth] gives it; none of it inside
    an obstacle, where a source may have put it."""
    distance = walls(scene, inputs)
    if distance is not None:
        from synth.pyramid import resample

        share = 1 / scene.density.scale
        fine = resample(distance, density.shape, (0.5 * share - 0.5,) * distance.ndim, share)
        density = density * np.clip(fine * scene.density.scale + 0.5, 0, 1)
    if scene.density.depth is None:
        return Field.centred(density, scene.dimension)
    from synth.motion.inflate import inflate

    return Field.centred(inflate(density, scene.density.depth.reach), 3)


def density_memory(scene: MotionScene) -> tuple[float, str]:
    """Bytes that the density takes, and the key that decides. The detail's frames come one by one."""
    from synth.motion.density import memory_needed

    table = scene.density
    m = table.m if table.scheme == "windowed" else 1
    return memory_needed(scene.shape, m, table.scale), "density.scale" if table.scale > 1 else "detail.size"


# -- seaweed and particles ----------------------------------------------------------------------------------------


def make_blades(scene: MotionScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, Mesh]]:
    """The blades as one mesh. Each frame is made of F of its window alone."""
    from synth import seaweed

    table = scene.blades
    width, _, depth = (cells / scene.cells[1] for cells in scene.cells)
    plants = seaweed.bed(width, depth, table.height, table.spacing, table.cover, scene.seed)
    motions: dict[int, Field] = {}
    for frame in frames:
        window = range(max(frame - table.window, 0) + 1, frame + 1)
        motions = {i: motions[i] if i in motions else _in_world(scene, inputs, i) for i in window}
        before = [motions[window[0]]] * (table.window - len(window))  # it moved so before the first frame
        spines = seaweed.spines(plants, [*before, *motions.values()], table.bend)
        yield frame, dict(zip(("vertices", "faces", "colours"), seaweed.ribbons(plants, spines), strict=True))


def _in_world(scene: MotionScene, inputs: Inputs, frame: int) -> Field:
    """F, world units per second."""
    return Field.centred(motion(scene, inputs, frame).final, 3).per_second(scene.fps)


def make_particles(scene: MotionScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, Mesh]]:
    """The particles. A run goes on from the frame before: same bits."""
    from synth import particles

    table, distance = scene.particles, walls(scene, inputs)
    kept = inputs.checkpoint.load(before=frames[0])
    done, points = kept or (1, {})
    after = motion(scene, inputs, done).final
    if not kept:
        points = _placed_points(scene, particles.start(after, table.count, table.life, scene.seed, distance))
        if frames[0] == 1:
            yield 1, points
    for frame in range(done + 1, frames[-1] + 1):
        before, after = after, motion(scene, inputs, frame).final
        # through the file's numbers, so that going on from kept ones gives the same bits
        points = _placed_points(scene, particles.moved(_free_points(scene, points), before, after, table.life, frame,
                                                       scene.seed, distance))
        if frame in frames:
            yield frame, points
        inputs.checkpoint.save(frame, points)


def _placed_points(scene: MotionScene, particles: Any) -> Mesh:
    """Particles in world units and world units per second."""
    voxel = 1.0 / scene.shape[-2]
    flat = np.zeros((len(particles.age), 3 - scene.dimension), np.float32)
    position = np.array(domain_origin(scene.shape), np.float32) + np.float32(voxel) * particles.position
    velocity = np.float32(voxel * scene.fps) * particles.velocity
    vx, vy, vz = np.concatenate([velocity, flat], axis=-1).T
    return {"position": np.concatenate([position, flat], axis=-1), "vx": np.ascontiguousarray(vx),
            "vy": np.ascontiguousarray(vy), "vz": np.ascontiguousarray(vz), "age": particles.age}


def _free_points(scene: MotionScene, points: Mesh) -> Any:
    """The inverse of `_placed_points`, but for rounding."""
    from synth.particles import Particles

    voxel, kept = 1.0 / scene.shape[-2], slice(scene.dimension)
    position = (points["position"][:, kept] - np.array(domain_origin(scene.shape), np.float32)) / np.float32(voxel)
    velocity = np.stack([points["vx"], points["vy"], points["vz"]], axis=-1)[:, kept] / np.float32(voxel * scene.fps)
    return Particles(position, velocity, points["age"])


# -- artifacts ----------------------------------------------------------------------------------------------------

F_READS = ("combine", "border", *LOCAL_AXES)
"""The keys that F depends on, beside its inputs."""


def final_artifact(scene: MotionScene) -> Artifact:
    """F."""
    projected = solid_input(scene) if scene.combine.project else ()
    return Artifact("F", "bake", fields.velocity(scene.dimension, scene.fps), F_READS,
                    (("L", "same"), ("H", "same"), *smoke_input(scene, "same"), *projected), make_final)


def _until(scene: MotionScene) -> Needs:
    """The inputs of what F carries."""
    return ("L", "until"), ("H", "until"), *smoke_input(scene, "until"), *solid_input(scene)


def density_artifact(scene: MotionScene) -> Artifact:
    """The density; of the plane with [density.depth] a volume."""
    kept = fields.kept(scene.dimension if scene.density.depth is None else 3)
    return Artifact("density", "bake", kept, ("density", "seed", *F_READS), _until(scene), make_density,
                    check=require_smoke, memory=density_memory)


def particles_artifact(scene: MotionScene) -> Artifact:
    """The particles."""
    return Artifact("particles", "bake", meshes.POINTS, ("particles", "seed", *F_READS), _until(scene), make_particles,
                    state_is_frame=True)


def blades_artifact(scene: MotionScene) -> Artifact:
    """The blades of seaweed."""
    return Artifact("blades", "bake", meshes.MESH, ("blades", "cells", "seed", *F_READS), _until(scene), make_blades)
