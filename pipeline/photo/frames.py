"""What synth makes of a scene of a photograph, in out/X/fields: the assignment, the motion, the frames, their mattes.

Pictures are in linear light, top row first; synth.photo has display values, the lowest row first.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from pipeline.build.artifact import Artifact, Inputs, Needs
from pipeline.errors import attributed_to
from pipeline.files import arrays, images
from pipeline.photo.clips import names
from pipeline.photo.tables import PhotoScene
from pipeline.photo.target import check_target, flowing_size, target_inputs, target_of


def cut_of(scene: PhotoScene) -> Any:
    """How pictures are cut into pieces."""
    from synth.photo.pieces import Cut

    return Cut(scene.assignment.piece)


def _database(inputs: Inputs, index: list[str]) -> Any:
    """The database of synth.photo.assign, of all clips."""
    from synth.photo.assign import Database
    from synth.photo.index import Index

    with attributed_to("clips"):
        return Database.joined([Index(**inputs.read(name)) for name in index], inputs.read("codebook")["words"])


def frames_of(inputs: Inputs, clips: list[str]) -> Callable[[int], np.ndarray]:
    """The frames of each clip, read when they are wanted; the last is kept."""
    @functools.lru_cache(maxsize=1)
    def luma(number: int) -> np.ndarray:
        return np.asarray(inputs.read(clips[number])["luma"])

    return luma


def frames_memory(scene: PhotoScene) -> tuple[float, str]:
    """Bytes that `make_fluid`, `make_displacement` and `make_mattes` take at most: of each pixel of each frame the
    bands of differences, the motion, and what is made of them."""
    from synth.photo.integrate import BANDS

    rows, columns = flowing_size(scene)
    return rows * columns * scene.frames * 4 * (BANDS + 6.0), "frames" if scene.frames > columns else "photo.width"


def make_assignment(scene: PhotoScene, inputs: Inputs, frames: list[int], index: list[str], clips: list[str],
                    ) -> Iterator[tuple[int, arrays.Arrays]]:
    """Which piece of which clip is shown where (§5), and the motion."""
    from synth.photo.animate import motion
    from synth.photo.assign import assign
    from synth.photo.fit import fitted

    target, database, cut = target_of(scene, inputs), _database(inputs, index), cut_of(scene)
    of, found = assign(target.grey, target.fluid, database, cut, target.wanted, scene.assignment.settings())
    shown = found.shown(database)
    if scene.assignment.energy == "mended":
        shown = fitted(target.grey, of, shown, found.exposure, frames_of(inputs, clips), cut)
    yield 0, {"node": of.corner, "edges": of.edges, "across": of.across, "clip": shown.clip, "version": shown.version,
              "corner": shown.corner, "cells": shown.motion, "fit": shown.fit, "exposure": found.exposure,
              "angle": found.angle, "energies": np.array(found.energies), "motion": motion(target, of, shown, cut)}


def assigned(inputs: Inputs) -> tuple[Any, Any]:
    """The synth.photo.assign.Nodes of the target, and what they are Shown."""
    from synth.photo.assign import Nodes, Shown

    kept = inputs.read("assignment")
    return (Nodes(kept["node"], kept["edges"], kept["across"]),
            Shown(kept["clip"], kept["version"], kept["corner"], kept["cells"], kept["fit"]))


def widened(scene: PhotoScene, assignment: arrays.Arrays) -> str:
    """What is said where pieces of the clips that move as wanted were too few; "" where they were not."""
    from synth.photo.assign import ANGLES

    angle = assignment["angle"]
    wide = int((angle > ANGLES[0]).sum())
    photo = scene.photo
    near = " and ".join(text for text, there in (
        (f"within {ANGLES[0]:.0f} degrees of the strokes", photo.strokes or photo.made),
        ("near the speeds of the strokes", photo.speeds), ("near the speed map", photo.speed)) if there)
    return "" if not wide else (
        f"clips: {wide} of {len(angle)} pieces of the picture found too few candidates {near}; the angle was widened, "
        f"to {angle.max():.0f} degrees at most, and the range of speeds with it")


def _boxed(scene: PhotoScene, target: Any, inputs: Inputs) -> tuple[tuple[slice, slice], Any]:
    """The part of the target round its matte, and the nodes as they lie in it."""
    of, box = assigned(inputs)[0], target.box(cut_of(scene).size)
    return box, of._replace(corner=of.corner - [box[0].start, box[1].start])


def make_displacement(scene: PhotoScene, inputs: Inputs, frames: list[int], clips: list[str],
                      ) -> Iterator[tuple[int, arrays.Arrays]]:
    """How far the fluid is from its place in each frame, in the part of the picture round the matte (§6)."""
    from synth.photo.boundary import displacements
    from synth.photo.integrate import motion_changes

    target, shown = target_of(scene, inputs), assigned(inputs)[1]
    box, of = _boxed(scene, target, inputs)
    rows, columns = target.matte[box].shape
    changes = motion_changes(of, shown, frames_of(inputs, clips), (rows, columns), cut_of(scene), scene.frames,
                             scene.seed)
    mean = np.ascontiguousarray(inputs.read("assignment")["motion"][box])
    yield 0, {"by": displacements(mean, changes, scene.photo.dynamics).astype(np.float16)}


def make_fluid(scene: PhotoScene, inputs: Inputs, frames: list[int], clips: list[str],
               ) -> Iterator[tuple[int, np.ndarray]]:
    """The fluid of each frame, everywhere, before the matte cuts it (§6)."""
    from render import tonemap
    from synth.photo.animate import Look, composed
    from synth.photo.boundary import displaced
    from synth.photo.integrate import differences

    target, cut, shown = target_of(scene, inputs), cut_of(scene), assigned(inputs)[1]
    box, of = _boxed(scene, target, inputs)
    part = target.part(box)
    rows, columns = part.matte.shape
    more = differences(of, shown, frames_of(inputs, clips), (rows, columns), cut, scene.frames, scene.seed,
                       scene.photo.blending)
    by = inputs.read("displacement")["by"] if "displacement" in inputs else None
    look = Look(scene.photo.carried, scene.photo.feature, scene.photo.strength, scene.photo.matching)
    whole, moves = target.picture.copy(), inputs.read("assignment")["motion"][box]
    shown_at = composed(part, more, moves, look, scene.seed)
    for frame in frames:
        picture = shown_at(frame - 1)
        shape = picture if by is None else displaced(picture, by[frame - 1].astype(np.float32))
        whole[box] = np.clip(shape, 0, 1)
        yield frame, tonemap.from_srgb(whole)[::-1].astype(np.float32)


def _display(inputs: Inputs, frame: int) -> np.ndarray:
    """The fluid of a frame, display values, lowest row first: (Y, X, 3) float32."""
    from render import tonemap

    return np.ascontiguousarray(tonemap.to_srgb(inputs.read("fluid", frame))[::-1], np.float32)


def make_mattes(scene: PhotoScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """The matte of each frame (h, w, 3), which moves with scene.photo.dynamics."""
    from synth.photo.animate import matte_displaced, mattes_mixed

    target = target_of(scene, inputs)
    if "displacement" in inputs:
        by, box = inputs.read("displacement")["by"], target.box(cut_of(scene).size)

        def matte(frame: int) -> np.ndarray:
            whole = np.zeros((*target.matte.shape, 2), np.float32)
            whole[box] = by[frame - 1]
            return np.asarray(matte_displaced(target, whole))
    elif "fluid" in inputs:
        fluid = np.stack([np.rint(255 * np.clip(_display(inputs, frame).mean(axis=2), 0, 1)).astype(np.uint8)
                          for frame in range(1, scene.frames + 1)])
        found = mattes_mixed(target, fluid, scene.photo.dynamics)

        def matte(frame: int) -> np.ndarray:
            return np.asarray(found[frame - 1])
    else:
        def matte(frame: int) -> np.ndarray:
            return np.asarray(target.matte)

    for frame in frames:
        yield frame, np.repeat(matte(frame)[::-1, :, None], 3, axis=2)


def make_frames(scene: PhotoScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """The frames, a loop: the fluid over the background."""
    from render import tonemap
    from synth.photo.animate import over_background

    target = target_of(scene, inputs)
    for frame in frames:
        matte = np.ascontiguousarray(inputs.read("mattes", frame)[::-1, :, 0])
        picture = over_background(target, _display(inputs, frame), matte)
        yield frame, tonemap.from_srgb(np.clip(picture, 0, 1))[::-1].astype(np.float32)


def frame_artifacts(scene: PhotoScene) -> tuple[Artifact, ...]:
    """All after the clips."""
    clips, index = names(scene, "clip"), names(scene, "index")
    target: Needs = tuple((name, "once") for name in target_inputs(scene))
    all_clips: Needs = tuple((name, "once") for name in clips)
    displaced = scene.photo.dynamics > 0 and scene.photo.boundary == "displaced"
    moves: Needs = (("displacement", "once"),) if displaced else ()
    made = [
        Artifact("assignment", "synth", arrays.ARRAYS, ("photo", "assignment"),
                 (*target, ("codebook", "once"), *((name, "once") for name in index), *all_clips), make_assignment,
                 {"index": index, "clips": clips}, animated=False, check=check_target, note=widened)]
    if displaced:
        made.append(Artifact(
            "displacement", "synth", arrays.ARRAYS, ("photo", "assignment.piece", "frames", "seed"),
            (*target, ("assignment", "once"), *all_clips), make_displacement, {"clips": clips}, animated=False,
            memory=frames_memory))
    shape: Needs = moves or ((("fluid", "every"),) if scene.photo.dynamics > 0 else ())
    return (
        *made,
        Artifact("fluid", "synth", images.LIGHT, ("photo", "assignment.piece", "frames", "seed"),
                 (*target, *moves, ("assignment", "once"), *all_clips), make_fluid, {"clips": clips},
                 memory=frames_memory),
        Artifact("mattes", "synth", images.LIGHT, ("photo", "assignment.piece", "frames"), (*target, *shape),
                 make_mattes),
        Artifact("frames", "synth", images.LIGHT, ("photo",), (*target, ("fluid", "same"), ("mattes", "same")),
                 make_frames))
