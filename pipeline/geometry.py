"""What bake makes, in out/X/geometry: the final motion F and the smoke density, in world units.

The density is carried by F as it is computed from L and H, not by the files of F: so any frame can be baked
alone, by any machine of a farm.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.fields import coarse_cells, exr, read_field, write_field
from pipeline.files import volumes
from pipeline.product import Product, Stock
from pipeline.schema import Scene
from synth.field import Field


def transformed(scene: Scene, stock: Stock, frame: int) -> np.ndarray:
    """H' (Y, X, 2): H in the domain's coordinates (§3.1, CoordinateTransform)."""
    from synth.motion import frames as local

    frames = local.local_frame(coarse_cells(scene, stock, frame), scene.detail.along)
    return local.to_world(stock.read("H", frame).values, frames)


def final_motion(scene: Scene, stock: Stock, frame: int) -> np.ndarray:
    """F (Y, X, 2), cells per frame (§3.5)."""
    from synth.motion.combine import combine

    weight = None if scene.combine.weight == "uniform" else scene.combine.weight
    return combine(stock.read("L", frame).per_frame(scene.fps).values, transformed(scene, stock, frame),
                   scene.combine.omega, weight, "wall" if scene.combine.project else None)


def make_final(scene: Scene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, Field]]:
    """F, world units per second."""
    for frame in frames:
        yield frame, Field.centred(final_motion(scene, stock, frame), 2).per_second(scene.fps)


def _placed(scene: Scene, density: np.ndarray) -> Field:
    """A density of the plane, in the plane or with the body that [density.depth] gives it."""
    if scene.density.depth is None:
        return Field.centred(density, 2)
    from synth.motion.depth import inflate

    return Field.centred(inflate(density, scene.density.depth.reach), 3)


def make_density(scene: Scene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, Field]]:
    """The density. A few frames of many are made one by one, which gives the same bits as all in a row."""
    wanted = scene.density
    last = frames[-1]
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
        every = windowed(L, F, _sources(scene), wanted.m, **settings)
    for frame, values in enumerate(every, start=1):
        if frame in frames:
            yield frame, _placed(scene, values)


def _sources(scene: Scene) -> list[Any]:
    from synth.motion.density import Source

    made = []
    for number, source in enumerate(scene.density.sources):
        radius = source.radius if len(source.radius) > 1 else source.radius[0]
        settings = source.model_dump(exclude={"radius"})
        made.append(Source(radius=radius, seed=scene.seed + number, **settings))
    return made


def _carried(scene: Scene, stock: Stock, frame: int) -> Any:
    """F of a frame, its detail riding on L."""
    from synth.motion.density import Carried

    return Carried(final_motion(scene, stock, frame), coarse_cells(scene, stock, frame))


def _naive(scene: Scene, motion: Iterator[Any], settings: dict[str, Any]) -> Iterator[np.ndarray]:
    from synth.motion.density import naive

    return naive(motion, _sources(scene), **settings)


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

    motion = [_carried(scene, stock, i) for i in range(max(frame - scene.density.m, 0) + 1, frame + 1)]
    values = window(O, motion, _sources(scene), frame, **settings)
    return _placed(scene, values)


def _suffix(scene: Scene) -> str:
    return "exr" if scene.density.depth is None else "vdb"


def write_density(file: Path, field: Field, scene: Scene) -> None:
    """Write a density: 2-D as EXR, 3-D as VDB grid `density`."""
    if field.dimension == 2:
        write_field(file, field, scene)
    else:
        volumes.write(file, {"density": field})


def read_density(file: Path, scene: Scene) -> Field:
    """Read a density that `write_density` wrote."""
    return read_field(file, scene) if scene.density.depth is None else volumes.read(file)["density"]


TRANSFORM = ("synth.motion.combine", "synth.motion.frames", "synth.field")


def products(scene: Scene) -> tuple[Product, ...]:
    """F; and the density, unless nothing renders it."""
    final = Product(
        name="F", stage="bake", folder="geometry", suffix=exr, reads=("combine", "detail.size", "detail.along", "fps"),
        inputs=(("L", "same"), ("H", "same")), methods=TRANSFORM,
        make=make_final, write=write_field, read=read_field)
    density = Product(
        name="density", stage="bake", folder="geometry", suffix=_suffix,
        reads=("density", "combine", "detail.size", "detail.along", "seed", "fps"),
        inputs=(("L", "until"), ("H", "until")),
        methods=("synth.motion.density", "synth.motion.depth", *TRANSFORM), make=make_density, write=write_density,
        read=read_density)
    return (final,) if scene.render.kind == "none" else (final, density)
