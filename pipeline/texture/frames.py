"""What synth makes of a scene of a moving texture, in out/X/fields: the frames, and what the figures show of them.

All are pictures in linear light, top row first; synth.texture has the lowest row first.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.build.artifact import Artifact, Inputs
from pipeline.files import images
from pipeline.files.format import Format
from pipeline.flow import solid_input, upsampled, walls
from pipeline.texture.surfaces import pixel, read_back
from pipeline.texture.tables import TextureScene

READS = ("texture", "sample.direction", "seed", "fps", "shape")


def velocity(scene: TextureScene, inputs: Inputs, frame: int) -> np.ndarray:
    """The velocity that the texture moves with (Y, X, 2), pixels per frame (§3)."""
    from synth.texture import flow

    L, table = upsampled(inputs.read("L", frame), scene), scene.texture
    if table.speed == "normalized":
        return flow.normalized(L, table.pace)
    return flow.limited(L, table.slowest, table.fastest)


def _sample(scene: TextureScene, inputs: Inputs) -> Any:
    from synth.texture.sample import sample

    degrees = scene.sample.direction
    return sample(np.ascontiguousarray(inputs.read("sample")[::-1]),
                  direction=None if degrees is None else np.radians(degrees))


def make_by_paper(scene: TextureScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """The frames by the paper's method (§2)."""
    from synth.texture import paper

    yield from ((frame, synthesis.picture(state)[::-1]) for frame, synthesis, state in _states(
        scene, inputs, frames, paper, scene.paper.settings()))


def make_by_carry(scene: TextureScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """The frames by patches that carry coordinates into the sample."""
    from synth.texture import carry

    yield from ((frame, synthesis.picture(state)[::-1]) for frame, synthesis, state in _states(
        scene, inputs, frames, carry, scene.carry.settings()))


def make_maps(scene: TextureScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """The UV maps: (h, w, 6), u, v and weight of the strongest patch of each pixel, then of the next."""
    from synth.texture import carry

    yield from ((frame, synthesis.maps(state)[::-1]) for frame, synthesis, state in _states(
        scene, inputs, frames, carry, scene.carry.settings()))


def make_on_surface(scene: TextureScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """The frames on a surface: the texture of all its triangles, each where `surface` has it."""
    from synth.texture import shapes, surface
    from synth.texture.atlas import Atlas

    mesh, field, uv = read_back(inputs.read("surface"))
    rows, columns = scene.shape
    table, scale = scene.texture, pixel(scene, mesh.vertices)
    least, most = (table.pace,) * 2 if table.speed == "normalized" else (table.slowest, table.fastest)
    v = shapes.paced(field, least * scale, most * scale)
    synthesis = surface.Synthesis(_sample(scene, inputs), mesh, scene.carry.settings(), scene.seed, scale)
    texels = Atlas.of_uv(uv, (rows, columns)).texels()
    for frame, state in _resumed(inputs, frames, surface.State, lambda _, before: synthesis.frame(v, before)):
        yield frame, synthesis.picture(state, v, texels, (rows, columns))[::-1]


def write_maps(file: Path, maps: np.ndarray) -> None:
    """Write UV maps as an EXR of CHANNELS."""
    images.write(file, {name: maps[..., n] for n, name in enumerate(CHANNELS)})


def read_maps(file: Path) -> np.ndarray:
    """The maps that `write_maps` wrote."""
    found = images.read(file)
    return np.stack([found[name] for name in CHANNELS], axis=-1)


CHANNELS = ("first.u", "first.v", "first.weight", "second.u", "second.v", "second.weight")
MAPS = Format("exr", write_maps, read_maps)


def make_by_pixels(scene: TextureScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """The paper's first frame, its pixels moved one by one along the flow of each frame (figure 3)."""
    from synth.texture import paper

    rows, columns = scene.shape
    synthesis = paper.Synthesis(_sample(scene, inputs), (rows, columns), scene.paper.settings(), scene.seed)
    first = synthesis.picture(synthesis.frame(velocity(scene, inputs, 1), None))
    for frame in frames:
        yield frame, paper.moved_pixels(first, velocity(scene, inputs, frame), frame - 1)[::-1]


def make_holes(scene: TextureScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """The frames of the paper's method with their holes in black (figure 5)."""
    from synth.texture import paper

    for frame, synthesis, state in _states(scene, inputs, frames, paper, scene.paper.settings()):
        shown = np.where(synthesis.holes(state)[..., None], np.float32(0), synthesis.picture(state))
        yield frame, shown[::-1]


def _states(scene: TextureScene, inputs: Inputs, frames: list[int], method: Any, settings: Any,
            ) -> Iterator[tuple[int, Any, Any]]:
    """(frame, synthesis, state) of each of `frames`."""
    synthesis = method.Synthesis(_sample(scene, inputs), scene.shape, settings, scene.seed)
    distance = walls(scene, inputs)
    mask = None if distance is None else distance > 0

    def after(frame: int, before: Any) -> Any:
        return synthesis.frame(velocity(scene, inputs, frame), before, mask)

    yield from ((frame, synthesis, state) for frame, state in _resumed(inputs, frames, method.State, after))


def _resumed(inputs: Inputs, frames: list[int], kind: Any, after: Callable[[int, Any], Any],
             ) -> Iterator[tuple[int, Any]]:
    """(frame, state) of each of `frames`, where `after` gives the state of a frame by that before it. An interrupted
    run goes on from the last state: same bits."""
    kept = inputs.checkpoint.load(before=frames[0])
    done, state = (kept[0], kind.of(kept[1])) if kept else (0, None)
    for frame in range(done + 1, frames[-1] + 1):
        state = after(frame, state)
        if frame in frames:
            yield frame, state
        if frame < frames[-1]:
            inputs.checkpoint.save(frame, state.arrays())


def make_flow_picture(scene: TextureScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """The lines of the flow."""
    from render import lic, tonemap

    for frame in frames:
        yield frame, tonemap.from_srgb(lic.picture(inputs.read("L", frame).values, scene.figure.panel, scene.seed))


def make_zoom(scene: TextureScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """A square of the frames, enlarged: each pixel is a block, so that nothing is smoothed (figure 7)."""
    x, y, edge = scene.figure.zoom or (0.5, 0.5, 1.0)
    rows, columns = scene.shape
    side = max(8, min(round(edge * columns), rows, columns))
    left = min(max(round(x * columns - side / 2), 0), columns - side)
    top = min(max(round(rows - y * columns - side / 2), 0), rows - side)
    block = max(1, scene.figure.panel // (2 * side))
    for frame in frames:
        part = inputs.read("frames", frame)[top:top + side, left:left + side]
        yield frame, np.repeat(np.repeat(part, block, axis=0), block, axis=1)


def frame_artifacts(scene: TextureScene) -> tuple[Artifact, ...]:
    """The frames; the holes and the flow where the figure shows them."""
    if scene.surface is not None:
        return (Artifact("frames", "synth", images.LIGHT, ("texture", "sample", "carry", "seed", "shape", "surface"),
                         (("sample", "once"), ("surface", "once")), make_on_surface),)
    needs: Any = (("sample", "once"), ("L", "until"), *solid_input(scene))
    make, keys = {"carry": (make_by_carry, "carry"), "paper": (make_by_paper, "paper"),
                  "pixels": (make_by_pixels, "paper")}[scene.texture.method]
    made = [Artifact("frames", "synth", images.LIGHT, (*READS, keys), needs, make)]
    if scene.texture.maps:
        made.append(Artifact("uv", "synth", MAPS, (*READS, "carry"), needs, make_maps, export=True))
    if "holes" in scene.figure.panels:
        made.append(Artifact("holes", "synth", images.LIGHT, (*READS, "paper"), needs, make_holes))
    if scene.figure.zoom:
        made.append(Artifact("zoom", "render", images.LIGHT, ("figure.zoom", "figure.panel", "shape"),
                             (("frames", "same"),), make_zoom))
    if "flow" in scene.figure.panels:
        made.append(Artifact("flow-lines", "render", images.LIGHT, ("figure.panel", "seed"), (("L", "same"),),
                             make_flow_picture))
    return tuple(made)
