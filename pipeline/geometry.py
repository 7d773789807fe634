"""What bake makes, in out/X/geometry: the final motion F and the smoke density, in world units.

F is 2-D, an EXR. The density is what F carries: an EXR too.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from pipeline.fields import coarse_cells, exr, read_field, write_field
from pipeline.product import Product, Stock
from pipeline.schema import Scene
from synth.field import Field


def transformed(scene: Scene, stock: Stock, frame: int) -> np.ndarray:
    """H' (Y, X, 2): H in the domain's coordinates (§3.1, CoordinateTransform)."""
    from synth.motion import frames as local

    return local.to_world(stock.read("H", frame).values, local.local_frame(coarse_cells(scene, stock, frame)))


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


def make_density(scene: Scene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, Field]]:
    """The density. A few frames of many are made one by one, which gives the same bits as all in a row."""
    wanted = scene.density
    last = frames[-1]
    F = (_cells(scene, stock, "F", frame) for frame in range(1, last + 1))
    settings: dict[str, Any] = {"scale": wanted.scale, "border": wanted.border}
    if wanted.scheme == "naive":
        every = _naive(scene, F, settings)
    elif len(frames) * wanted.m <= last:
        yield from _single_windows(scene, stock, frames, settings)
        return
    else:
        from synth.motion.density import windowed

        L = (_cells(scene, stock, "L", frame) for frame in range(1, last + 1))
        every = windowed(L, F, _sources(scene), wanted.m, **settings)
    for frame, values in enumerate(every, start=1):
        if frame in frames:
            yield frame, Field.centred(values, values.ndim)


def _cells(scene: Scene, stock: Stock, name: str, frame: int) -> np.ndarray:
    """L on its own grid or F, cells per frame."""
    return stock.read(name, frame).per_frame(scene.fps).values


def _sources(scene: Scene) -> list[Any]:
    from synth.motion.density import Source

    made = []
    for number, source in enumerate(scene.density.sources):
        radius = source.radius if len(source.radius) > 1 else source.radius[0]
        settings = source.model_dump(exclude={"radius"})
        made.append(Source(radius=radius, seed=scene.seed + number, **settings))
    return made


def _naive(scene: Scene, motion: Iterator[np.ndarray], settings: dict[str, Any]) -> Iterator[np.ndarray]:
    from synth.motion.density import naive

    return naive(motion, _sources(scene), **settings)


def _single_windows(scene: Scene, stock: Stock, frames: list[int], settings: dict[str, Any],
                    ) -> Iterator[tuple[int, Field]]:
    """Frame by frame, each from O_{i-m} (pseudocode 4): for a farm, and for a file that was lost."""
    from synth.motion.density import window

    m = scene.density.m
    starts = {max(frame - m, 0): frame for frame in frames}
    coarse = (coarse_cells(scene, stock, frame) for frame in range(1, max(starts) + 1))
    smoke: Iterator[np.ndarray | None] = _naive(scene, coarse, settings)
    first = [frame for frame in frames if frame <= m]
    for frame in first:
        yield frame, _window(scene, stock, window, None, frame, settings)
    for start, O in enumerate(smoke, start=1):
        if start in starts:
            yield starts[start], _window(scene, stock, window, O, starts[start], settings)


def _window(scene: Scene, stock: Stock, window: Any, O: np.ndarray | None, frame: int,
            settings: dict[str, Any]) -> Field:
    motion = [_cells(scene, stock, "F", i) for i in range(max(frame - scene.density.m, 0) + 1, frame + 1)]
    values = window(O, motion, _sources(scene), frame, **settings)
    return Field.centred(values, values.ndim)


def products(scene: Scene) -> tuple[Product, ...]:
    """F; and the density, unless nothing renders it."""
    final = Product(
        name="F", stage="bake", folder="geometry", suffix=exr, reads=("combine", "detail.size", "fps"),
        inputs=(("L", "same"), ("H", "same")), methods=("synth.motion.combine", "synth.motion.frames", "synth.field"),
        make=make_final, write=write_field, read=read_field)
    density = Product(
        name="density", stage="bake", folder="geometry", suffix=exr,
        reads=("density", "detail.size", "seed", "fps"), inputs=(("L", "until"), ("F", "until")),
        methods=("synth.motion.density", "synth.field"), make=make_density, write=write_field, read=read_field)
    return (final,) if scene.render.kind == "none" else (final, density)
