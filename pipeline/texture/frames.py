"""What synth makes of a scene of a moving texture, in out/X/fields: the frames, and what the figures show of them.

All are pictures in linear light, top row first; synth.texture has the lowest row first.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from scipy import ndimage

from pipeline.build.artifact import Artifact, Inputs
from pipeline.files import fields, images
from pipeline.files.format import Format
from pipeline.flow import past_obstacles, solid_input, upsampled, walls
from pipeline.texture.samples import read_sample
from pipeline.texture.surfaces import pixel, read_back
from pipeline.texture.tables import TextureScene
from synth.field import Field

RESTS = 1e-3
"""Share of its largest speed below which a flow rests: differences of pixels leave as much of a source of 10 pixels, to
which texture.slowest would give a speed."""
READS = ("texture", "sample.direction", "seed", "fps", "shape")


def velocity(scene: TextureScene, inputs: Inputs, frame: int) -> np.ndarray:
    """The velocity that the texture moves with (Y, X, 2), pixels per frame (§3)."""
    from synth.texture import flow

    L, table = upsampled(_flow(inputs, frame), scene), scene.texture
    if table.speed == "normalized":
        return flow.normalized(L, table.pace)
    return flow.limited(L, table.slowest, table.fastest)


def _flow(inputs: Inputs, frame: int) -> Field:
    """What the texture follows: L, or its part that is free of divergence."""
    found: Field = inputs.read("flow" if "flow" in inputs else "L", frame)
    return found


def make_flow(scene: TextureScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, Field]]:
    """The part of L that is free of divergence, on the pixels, world units per second.

    Past walls, of a flow that changes, this is slow: 13 s a frame for the winds of wang05-wind (768 x 512).
    """
    before: tuple[np.ndarray, Field] | None = None
    for frame in frames:
        L = inputs.read("L", frame).per_frame(scene.fps).values
        if before is None or not np.array_equal(before[0], L):  # a steady flow is projected once
            free = past_obstacles(scene, inputs, L)
            speed = np.hypot(free[..., 0], free[..., 1])
            # both in pixels
            largest = np.hypot(L[..., 0], L[..., 1]).max() * len(free) / len(L)
            free[speed < RESTS * largest] = 0
            before = L, Field.centred(free, 2).per_second(scene.fps)
        yield frame, before[1]


def _sample(scene: TextureScene, inputs: Inputs) -> Any:
    return read_sample(inputs.read("sample"), scene.sample.direction)


def make_by_paper(scene: TextureScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """The frames by the paper's method (§2)."""
    from synth.texture import paper

    yield from ((frame, synthesis.picture(state)[::-1]) for frame, synthesis, state in _states(
        scene, inputs, frames, paper, scene.paper.settings()))


def make_by_carry(scene: TextureScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """The frames by patches that carry coordinates into the sample."""
    yield from ((frame, synthesis.picture(state)[::-1]) for frame, synthesis, state in _carried(scene, inputs, frames))


def make_maps(scene: TextureScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """The UV maps: (h, w, 6), u, v and weight of the strongest patch of each pixel, then of the next."""
    yield from ((frame, synthesis.maps(state)[::-1]) for frame, synthesis, state in _carried(scene, inputs, frames))


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


def _carried(scene: TextureScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, Any, Any]]:
    """(frame, synthesis, state) of each of `frames` by the method "carry"."""
    from synth.texture import carry

    if scene.texture.loop:
        return _looped(scene, inputs, frames)
    return _states(scene, inputs, frames, carry, scene.carry.settings())


def _looped(scene: TextureScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, Any, Any]]:
    """(frame, synthesis, state) of each of `frames` of a loop. A run that goes on finds the same patches again."""
    from synth.texture.loop import Loop

    rows, columns = scene.shape
    synthesis = Loop(_sample(scene, inputs), (rows, columns), scene.carry.settings(), scene.seed)
    states = synthesis.states(_velocities(scene, inputs), scene.frames, _mask(scene, inputs))
    yield from ((frame, synthesis, states[frame - 1]) for frame in frames)


def _velocities(scene: TextureScene, inputs: Inputs) -> Callable[[int], np.ndarray]:
    """The velocity at a frame; while L does not change it is found once."""
    last: list[tuple[np.ndarray, np.ndarray]] = []

    def at(frame: int) -> np.ndarray:
        L = _flow(inputs, frame).values
        if not last or not np.array_equal(last[0][0], L):
            last[:] = [(L, velocity(scene, inputs, frame))]
        return last[0][1]

    return at


def _mask(scene: TextureScene, inputs: Inputs) -> np.ndarray | None:
    """Where texture is, (Y, X) bool; None: everywhere."""
    distance = walls(scene, inputs)
    return None if distance is None else distance > 0


def _states(scene: TextureScene, inputs: Inputs, frames: list[int], method: Any, settings: Any,
            ) -> Iterator[tuple[int, Any, Any]]:
    """(frame, synthesis, state) of each of `frames`."""
    synthesis = method.Synthesis(_sample(scene, inputs), scene.shape, settings, scene.seed)
    mask = _mask(scene, inputs)

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
    """The lines of the flow; solids and what has no values plain, with their outline."""
    from render import lic, tonemap

    distance = walls(scene, inputs)
    for frame in frames:
        v = _flow(inputs, frame).values
        picture = lic.picture(v, scene.figure.panel, scene.seed)
        yield frame, tonemap.from_srgb(picture if distance is None else lic.with_solids(picture, distance))


def make_speed(scene: TextureScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, Field]]:
    """The speed of L as it is, in the unit of its legend; where L has no values, that of the nearest place."""
    distance = walls(scene, inputs)
    for frame, speed in zip(frames, scene.coarse.speeds(inputs.read("L", n) for n in frames), strict=False):
        if distance is not None:
            rows, columns = ((np.arange(n) * 2 + 1) * pixels // (2 * n)
                             for n, pixels in zip(speed.shape, distance.shape, strict=True))
            unknown = (speed == 0) & (distance[np.ix_(rows, columns)] < len(distance) / len(speed))
            nearest = ndimage.distance_transform_edt(unknown, return_distances=False, return_indices=True)
            speed = speed[tuple(nearest)]
        yield frame, Field.centred(speed.astype(np.float32), 2)


def _range(inputs: Inputs, frames: int) -> tuple[float, float]:
    """Least and greatest speed of all frames; a flow of one speed is the upper end of a range from 0."""
    speeds = [inputs.read("speed", frame).values for frame in range(1, frames + 1)]
    least, greatest = min(float(s.min()) for s in speeds), max(float(s.max()) for s in speeds)
    return (least, greatest) if greatest - least > 1e-3 * greatest else (0.0, greatest or 1.0)


def make_tinted(scene: TextureScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """The frames in the colours of their speed; solids and what has no values plain, with their outline."""
    from render import lic, speed_map, tonemap

    least, greatest = _range(inputs, scene.frames)
    sample = inputs.read("sample")
    shown = sample[..., :3][sample[..., 3] == 1] if sample.shape[2] == 4 else sample.reshape(-1, 3)
    mean = float(tonemap.linear_to_oklab(np.maximum(shown, 0))[..., 0].mean())
    distance = walls(scene, inputs)
    for frame in frames:
        speed = lic.resampled(inputs.read("speed", frame).values, *scene.shape)[::-1]
        light = speed_map.tinted(inputs.read("frames", frame), (speed - least) / (greatest - least), mean)
        yield frame, light if distance is None else tonemap.from_srgb(
            lic.with_solids(tonemap.to_srgb(light), distance))


def make_speed_legend(scene: TextureScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """The colours of the speeds of all frames, with their numbers and unit."""
    from render import speed_map, tonemap

    legend = speed_map.legend(*_range(inputs, scene.frames), scene.coarse.unit, scene.figure.panel)
    yield 0, tonemap.from_srgb(legend)


def make_zoom(scene: TextureScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """A square of the frames, enlarged: each pixel is a block, so that nothing is smoothed (figure 7)."""
    x, y, edge = scene.figure.zoom or (0.5, 0.5, 1.0)
    rows, columns = scene.shape
    side = max(8, min(round(edge * columns), rows, columns))
    left = min(max(round(x * columns - side / 2), 0), columns - side)
    top = min(max(round(rows - y * columns - side / 2), 0), rows - side)
    block = max(1, scene.figure.panel // (2 * side))
    for frame in frames:
        part = inputs.read("tinted" if "tinted" in inputs else "frames", frame)[top:top + side, left:left + side]
        yield frame, np.repeat(np.repeat(part, block, axis=0), block, axis=1)


def frame_artifacts(scene: TextureScene) -> tuple[Artifact, ...]:
    """The frames; the holes and the flow where the figure shows them."""
    if scene.surface is not None:
        return (Artifact("frames", "synth", images.LIGHT, ("texture", "sample", "carry", "seed", "shape", "surface"),
                         (("sample", "once"), ("surface", "once")), make_on_surface),)
    source, loop = "flow" if scene.texture.divergence_free else "L", scene.texture.loop
    needs: Any = (("sample", "once"), (source, "every" if loop else "until"), *solid_input(scene))
    reads = (*READS, "frames") if loop else READS
    make, keys = {"carry": (make_by_carry, "carry"), "paper": (make_by_paper, "paper"),
                  "pixels": (make_by_pixels, "paper")}[scene.texture.method]
    made = [Artifact("flow", "synth", fields.velocity(2, scene.fps), ("fps", "shape", "border"),
                     (("L", "same"), *solid_input(scene)), make_flow)] if scene.texture.divergence_free else []
    made.append(Artifact("frames", "synth", images.LIGHT, (*reads, keys), needs, make))
    if scene.texture.maps:
        made.append(Artifact("uv", "synth", MAPS, (*reads, "carry"), needs, make_maps, export=True))
    if "holes" in scene.figure.panels:
        made.append(Artifact("holes", "synth", images.LIGHT, (*READS, "paper"), needs, make_holes))
    result = "frames"
    if scene.figure.overlay == "speed":
        result = "tinted"
        solid = solid_input(scene)
        made += [
            Artifact("speed", "synth", images.FIELD, ("coarse", "shape"), (("L", "same"), *solid), make_speed),
            Artifact(result, "render", images.LIGHT, ("shape", "frames"),
                     (("frames", "same"), ("speed", "every"), ("sample", "once"), *solid), make_tinted),
            Artifact("speed-legend", "render", images.LIGHT, ("coarse", "figure.panel", "frames"),
                     (("speed", "every"),), make_speed_legend, animated=False)]
    if scene.figure.zoom:
        made.append(Artifact("zoom", "render", images.LIGHT, ("figure.zoom", "figure.panel", "shape"),
                             ((result, "same"),), make_zoom))
    if "flow" in scene.figure.panels:
        made.append(Artifact("flow-lines", "render", images.LIGHT, ("figure.panel", "seed", "shape"),
                             ((source, "same"), *solid_input(scene)), make_flow_picture))
    return tuple(made)
