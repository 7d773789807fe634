"""What synth makes of a scene of a photograph, in out/X/fields: the assignment, the motion, the frames, their mattes.

Pictures are in linear light, top row first; synth.photo has display values, the lowest row first.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from pipeline.build.artifact import Artifact, Inputs, Needs
from pipeline.files import arrays, images
from pipeline.photo.clips import names
from pipeline.photo.tables import PhotoScene
from pipeline.photo.target import check_target, read_target


def _target(scene: PhotoScene, inputs: Inputs) -> Any:
    """The synth.photo.animate.Target, of a file or made."""
    return read_target(scene, inputs.read("made") if "made" in inputs else None)


def _cut(scene: PhotoScene) -> Any:
    from synth.photo.pieces import Cut

    return Cut(scene.assignment.piece)


def _database(inputs: Inputs, index: list[str]) -> Any:
    """The database of synth.photo.assign, of all clips."""
    from synth.photo.assign import Database
    from synth.photo.index import Index

    return Database.joined([Index(**inputs.read(name)) for name in index], inputs.read("codebook")["words"])


def make_assignment(scene: PhotoScene, inputs: Inputs, frames: list[int], index: list[str],
                    ) -> Iterator[tuple[int, arrays.Arrays]]:
    """Which piece of which clip is shown where (§5), and the motion."""
    from synth.photo.animate import motion
    from synth.photo.assign import assign

    target, database, cut = _target(scene, inputs), _database(inputs, index), _cut(scene)
    of, found = assign(target.grey, target.fluid, database, cut, target.wanted, scene.assignment.settings())
    shown = found.shown(database)
    yield 0, {"node": of.corner, "edges": of.edges, "across": of.across, "clip": shown.clip, "version": shown.version,
              "corner": shown.corner, "cells": shown.motion, "exposure": found.exposure, "angle": found.angle,
              "energies": np.array(found.energies), "motion": motion(target, of, shown, cut)}


def make_fluid(scene: PhotoScene, inputs: Inputs, frames: list[int], clips: list[str],
               ) -> Iterator[tuple[int, np.ndarray]]:
    """The fluid of each frame, everywhere, before the matte cuts it (§6)."""
    from render import tonemap
    from synth.photo.animate import Look, composed
    from synth.photo.assign import Nodes, Shown
    from synth.photo.integrate import differences

    target, cut, kept = _target(scene, inputs), _cut(scene), inputs.read("assignment")
    of = Nodes(kept["node"], kept["edges"], kept["across"])
    shown = Shown(kept["clip"], kept["version"], kept["corner"], kept["cells"])
    read: dict[int, np.ndarray] = {}

    def luma(number: int) -> np.ndarray:
        if number not in read:
            read[number] = inputs.read(clips[number])["luma"]
        return read[number]

    rows, columns = target.matte.shape
    more = differences(of, shown, luma, (rows, columns), cut, scene.frames, scene.seed)
    look = Look(scene.photo.carried, scene.photo.strength, scene.photo.matching)
    for frame, picture in enumerate(composed(target, more, kept["motion"], look, scene.seed), start=1):
        if frame in frames:
            yield frame, tonemap.from_srgb(np.clip(picture, 0, 1))[::-1].astype(np.float32)
        if frame == frames[-1]:
            break


def _display(inputs: Inputs, frame: int) -> np.ndarray:
    """The fluid of a frame, display values, lowest row first: (Y, X, 3) float32."""
    from render import tonemap

    return np.ascontiguousarray(tonemap.to_srgb(inputs.read("fluid", frame))[::-1], np.float32)


def make_mattes(scene: PhotoScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """The matte of each frame (h, w, 3), which moves with scene.photo.dynamics."""
    from synth.photo.animate import mattes

    target = _target(scene, inputs)
    fluid = np.stack([np.rint(255 * np.clip(_display(inputs, frame).mean(axis=2), 0, 1)).astype(np.uint8)
                      for frame in range(1, scene.frames + 1)])
    found = mattes(target, fluid, scene.photo.dynamics)
    for frame in frames:
        yield frame, np.repeat(found[frame - 1][::-1, :, None], 3, axis=2)


def make_frames(scene: PhotoScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """The frames, a loop: the fluid over the background."""
    from render import tonemap
    from synth.photo.animate import over_background

    target = _target(scene, inputs)
    for frame in frames:
        matte = np.ascontiguousarray(inputs.read("mattes", frame)[::-1, :, 0])
        picture = over_background(target, _display(inputs, frame), matte)
        yield frame, tonemap.from_srgb(np.clip(picture, 0, 1))[::-1].astype(np.float32)


def make_target_picture(scene: PhotoScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """The photograph."""
    from render import tonemap

    target = _target(scene, inputs)
    yield 0, tonemap.from_srgb(target.picture)[::-1].astype(np.float32)


def make_motion_picture(scene: PhotoScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """The motion by colour: its direction by hue, its speed by strength."""
    from render import lic, tonemap

    yield 0, tonemap.from_srgb(lic.colour(inputs.read("assignment")["motion"], scene.figure.panel))


def frame_artifacts(scene: PhotoScene) -> tuple[Artifact, ...]:
    """All after the clips."""
    clips, index = names(scene, "clip"), names(scene, "index")
    target: Needs = () if scene.photo.made is None else (("made", "once"),)
    made = [
        Artifact("assignment", "synth", arrays.ARRAYS, ("photo", "assignment"),
                 (*target, ("codebook", "once"), *((name, "once") for name in index)), make_assignment,
                 {"index": index}, animated=False, check=check_target),
        Artifact("fluid", "synth", images.LIGHT, ("photo", "assignment.piece", "frames", "seed"),
                 (*target, ("assignment", "once"), *((name, "once") for name in clips)), make_fluid, {"clips": clips}),
        Artifact("mattes", "synth", images.LIGHT, ("photo", "frames"), (*target, ("fluid", "every")), make_mattes),
        Artifact("frames", "synth", images.LIGHT, ("photo",), (*target, ("fluid", "same"), ("mattes", "same")),
                 make_frames)]
    if "target" in scene.figure.panels:
        made.append(Artifact("target", "render", images.LIGHT, ("photo",), target, make_target_picture,
                             animated=False))
    if "motion" in scene.figure.panels:
        made.append(Artifact("motion", "render", images.LIGHT, ("figure.panel",), (("assignment", "once"),),
                             make_motion_picture, animated=False))
    return tuple(made)
