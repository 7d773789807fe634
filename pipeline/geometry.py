"""What bake makes, in out/X/geometry: the final motion F, and what it moves, the smoke density, particles or the
blades of seaweed; in world units.

These are moved by F as it is computed from L and H, not by the files of F: so any frame can be baked alone, by any
machine of a farm.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from pipeline import obstacles
from pipeline.fields import (
    LOCAL_FRAME,
    coarse_cells,
    facing,
    read_field,
    sources,
    suffix,
    towards,
    write_field,
    write_velocity,
)
from pipeline.files import meshes
from pipeline.product import Frames, Product, Stock
from pipeline.product import Scene as AnyScene
from pipeline.schema import Scene
from synth.field import Field, domain_origin


def transformed(scene: Scene, stock: Stock, frame: int) -> np.ndarray:
    """H' (Y, X, 2) or (Z, Y, X, 3): H in the domain's coordinates (§3.1, CoordinateTransform)."""
    from synth.motion import local_axes as local

    L, along = coarse_cells(scene, stock, frame), scene.detail.along
    if scene.dimension == 2:
        axes = local.local_frame(L, along)
    else:
        axes = local.solid_frame(L, towards(scene, stock, frame), along)
    return local.to_world(stock.read("H", frame).values, axes)


def final_motion(scene: Scene, stock: Stock, frame: int) -> np.ndarray:
    """F (Y, X, 2) or (Z, Y, X, 3), cells per frame (§3.5)."""
    from synth.motion.combine import combine

    weight = None if scene.combine.weight == "uniform" else scene.combine.weight
    return combine(stock.read("L", frame).per_frame(scene.fps).values, transformed(scene, stock, frame),
                   scene.combine.omega, weight, obstacles.border(scene) if scene.combine.project else None,
                   obstacles.distance(scene, stock) if scene.combine.project else None)


def make_final(scene: Scene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, Field]]:
    """F, world units per second."""
    for frame in frames:
        yield frame, Field.centred(final_motion(scene, stock, frame), scene.dimension).per_second(scene.fps)


def _require_smoke(scene: Scene) -> None:
    """ValueError unless some source lets smoke in, in some frame: a density of zero is nothing to render."""
    from synth.motion.density import density_shape

    shape = density_shape(scene.shape, scene.density.scale)
    if not any(source.bounds(shape, frame)[1].any() for frame in range(1, scene.frames + 1)
               for source in sources(scene)):
        raise ValueError("no smoke enters: each source lies outside the domain, or its level or duty is 0")


def _placed(scene: Scene, stock: Stock, density: np.ndarray) -> Field:
    """A density where it was made, or one of the plane with the body that [density.depth] gives it; none of it inside
    an obstacle, where a source may have put it."""
    away = obstacles.distance(scene, stock)
    if away is not None:
        from synth.pyramid import resample

        share = 1 / scene.density.scale
        fine = resample(away, density.shape, (0.5 * share - 0.5,) * away.ndim, share)
        density = density * np.clip(fine * scene.density.scale + 0.5, 0, 1)
    if scene.density.depth is None:
        return Field.centred(density, scene.dimension)
    from synth.motion.inflate import inflate

    return Field.centred(inflate(density, scene.density.depth.reach), 3)


def density_memory(scene: Scene) -> tuple[float, str]:
    """Bytes that the density takes, and the key that decides. The detail's frames come one by one."""
    from synth.motion.density import memory_needed

    wanted = scene.density
    m = wanted.m if wanted.scheme == "windowed" else 1
    return memory_needed(scene.shape, m, wanted.scale), "density.scale" if wanted.scale > 1 else "detail.size"


def make_density(scene: Scene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, Field]]:
    """The density. A few frames of many are made one by one, which gives the same bits as all in a row."""
    wanted = scene.density
    last = frames[-1]
    _require_smoke(scene)
    F = (_carried(scene, stock, frame) for frame in range(1, last + 1))
    settings: dict[str, Any] = {"scale": wanted.scale, "border": wanted.border}
    if wanted.scheme == "naive":
        every = _naive(scene, F, settings)
    elif len(frames) * wanted.m <= last:
        yield from _single_windows(scene, stock, frames, settings)
        return
    else:
        from synth.motion.density import windowed

        L = (stock.read("L", frame).per_frame(scene.fps).values for frame in range(1, last + 1))
        every = windowed(L, F, sources(scene), wanted.m, **settings)
    for frame, values in enumerate(every, start=1):
        if frame in frames:
            yield frame, _placed(scene, stock, values)


def _carried(scene: Scene, stock: Stock, frame: int) -> Any:
    """F of a frame, its detail riding on L."""
    from synth.motion.density import Carried

    return Carried(final_motion(scene, stock, frame), coarse_cells(scene, stock, frame))


def _naive(scene: Scene, motion: Iterator[Any], settings: dict[str, Any]) -> Iterator[np.ndarray]:
    from synth.motion.density import naive

    return naive(motion, sources(scene), **settings)


def _single_windows(scene: Scene, stock: Stock, frames: list[int], settings: dict[str, Any],
                    ) -> Iterator[tuple[int, Field]]:
    """Frame by frame, each from O_{i-m} (pseudocode 4): for a farm, and for a file that was lost."""
    m = scene.density.m
    ends = {frame - m: frame for frame in frames if frame > m}
    for frame in frames:
        if frame <= m:
            yield frame, _window(scene, stock, None, frame, settings)
    coarse = (coarse_cells(scene, stock, frame) for frame in range(1, max(ends, default=0) + 1))
    for start, O in enumerate(_naive(scene, coarse, settings), start=1):
        if start in ends:
            yield ends[start], _window(scene, stock, O, ends[start], settings)


def _window(scene: Scene, stock: Stock, O: np.ndarray | None, frame: int, settings: dict[str, Any]) -> Field:
    from synth.motion.density import window

    first = max(frame - scene.density.m, 0) + 1
    motion = (_carried(scene, stock, i) for i in range(first, frame + 1))
    values = window(O, motion, sources(scene), first, **settings)
    return _placed(scene, stock, values)


def _ply(scene: Scene) -> str:
    return "ply"


Mesh = dict[str, np.ndarray]
Points = dict[str, np.ndarray]


def make_blades(scene: Scene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, Mesh]]:
    """The blades as one mesh, as `meshes.write` takes it. Each frame is made of F of its window alone."""
    from synth import seaweed

    wanted = scene.blades
    width, _, depth = (cells / scene.detail.size[1] for cells in scene.detail.size)
    plants = seaweed.bed(width, depth, wanted.height, wanted.spacing, wanted.cover, scene.seed)
    motion: dict[int, Field] = {}
    for frame in frames:
        window = range(max(frame - wanted.window, 0) + 1, frame + 1)
        motion = {i: motion[i] if i in motion else _motion(scene, stock, i) for i in window}
        before = [motion[window[0]]] * (wanted.window - len(window))  # it moved so before the first frame
        spines = seaweed.spines(plants, [*before, *motion.values()], wanted.bend)
        yield frame, dict(zip(("vertices", "faces", "colours"), seaweed.ribbons(plants, spines), strict=True))


def _motion(scene: Scene, stock: Stock, frame: int) -> Field:
    """F, world units per second."""
    return Field.centred(final_motion(scene, stock, frame), 3).per_second(scene.fps)


def make_particles(scene: Scene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, Points]]:
    """The particles, as `meshes.write_points` takes them; from the last frame that is whole, or from the first."""
    from synth import particles

    count, life = scene.particles.count, scene.particles.life
    distance = obstacles.distance(scene, stock)
    kept = stock.own(frames[0] - 1) if frames[0] > 1 else None
    after = final_motion(scene, stock, frames[0] - 1 if kept else 1)
    points = kept or _placed_points(scene, particles.start(after, count, life, scene.seed, distance))
    first = frames[0] - 1 if kept else 1
    if first in frames:
        yield first, points
    for frame in range(first + 1, frames[-1] + 1):
        before, after = after, final_motion(scene, stock, frame)
        # through the file's numbers, so that going on from a file gives the same bits
        points = _placed_points(scene, particles.moved(_free_points(scene, points), before, after, life, frame,
                                                       scene.seed, distance))
        if frame in frames:
            yield frame, points


def _placed_points(scene: Scene, particles: Any) -> Points:
    """Particles in world units and world units per second."""
    voxel = 1.0 / scene.shape[-2]
    flat = np.zeros((len(particles.age), 3 - scene.dimension), np.float32)
    position = np.array(domain_origin(scene.shape), np.float32) + np.float32(voxel) * particles.position
    velocity = np.float32(voxel * scene.fps) * particles.velocity
    vx, vy, vz = np.concatenate([velocity, flat], axis=-1).T
    return {"position": np.concatenate([position, flat], axis=-1), "vx": np.ascontiguousarray(vx),
            "vy": np.ascontiguousarray(vy), "vz": np.ascontiguousarray(vz), "age": particles.age}


def _free_points(scene: Scene, points: Points) -> Any:
    """The inverse of `_placed_points`, but for rounding."""
    from synth.particles import Particles

    voxel, kept = 1.0 / scene.shape[-2], slice(scene.dimension)
    position = (points["position"][:, kept] - np.array(domain_origin(scene.shape), np.float32)) / np.float32(voxel)
    velocity = np.stack([points["vx"], points["vy"], points["vz"]], axis=-1)[:, kept] / np.float32(voxel * scene.fps)
    return Particles(position, velocity, points["age"])


def write_points(file: Path, points: Points, scene: Scene) -> None:
    """Write particles."""
    attributes = dict(points)
    meshes.write_points(file, attributes.pop("position"), attributes)


def read_points(file: Path, scene: Scene) -> Points:
    """Read particles that `write_points` wrote."""
    return meshes.read_points(file)


def write_mesh(file: Path, mesh: Mesh, scene: AnyScene) -> None:
    """Write a mesh."""
    meshes.write(file, **mesh)


def read_mesh(file: Path, scene: AnyScene) -> Mesh:
    """Read a mesh that `write_mesh` wrote."""
    return meshes.read_own(file)


def _density_suffix(scene: Scene) -> str:
    return suffix(scene) if scene.density.depth is None else "vdb"


TRANSFORM = ("synth.motion.combine", "synth.motion.local_axes", "synth.field")


def products(scene: Scene) -> tuple[Product, ...]:
    """F; and what is rendered: the density, the particles, the blades or nothing."""
    solid = obstacles.inputs(scene) if scene.combine.project else ()
    final = Product(
        name="F", stage="bake", folder="geometry", suffix=suffix, reads=("combine", *LOCAL_FRAME, "fps"),
        inputs=(("L", "same"), ("H", "same"), *facing(scene, "same"), *solid), methods=TRANSFORM,
        make=make_final, write=write_velocity, read=read_field)
    every: tuple[tuple[str, Frames], ...] = (("L", "until"), ("H", "until"), *facing(scene, "until"))
    density = Product(
        name="density", stage="bake", folder="geometry", suffix=_density_suffix,
        reads=("density", "combine", *LOCAL_FRAME, "seed", "fps"), inputs=(*every, *obstacles.inputs(scene)),
        methods=("synth.motion.density", "synth.motion.inflate", "synth.pyramid", *TRANSFORM), make=make_density,
        write=write_field, read=read_field, memory=density_memory)
    particles = Product(
        name="particles", stage="bake", folder="geometry", suffix=_ply,
        reads=("particles", "combine", *LOCAL_FRAME, "seed", "fps"), inputs=(*every, *obstacles.inputs(scene)),
        methods=("synth.particles", *TRANSFORM), make=make_particles, write=write_points, read=read_points)
    blades = Product(
        name="blades", stage="bake", folder="geometry", suffix=_ply,
        reads=("blades", "combine", *LOCAL_FRAME, "seed", "fps"), inputs=(*every, *solid),
        methods=("synth.seaweed", *TRANSFORM), make=make_blades, write=write_mesh, read=read_mesh)
    moved = {"none": (), "seaweed": (blades,), "particles": (particles,)}
    return (final, *moved.get(scene.render.kind, (density,)))
