"""[photo] made: targets that the project makes itself, each with its matte and, of fire and smoke, its true motion.

No photograph of a fire or of smoke may be shipped. These are rendered from simulated volumes, so that their motion is
known; the painting is painted by program.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from pipeline.build.artifact import Artifact, Inputs
from pipeline.files import arrays
from pipeline.photo.tables import PhotoScene, Stroke

SHAPE = (480, 640)
"""Rows and columns in which strokes and masks of a made picture are given; it is rendered at the scene's width."""
SPP = {"fire": 48, "smoke": 24}
"""Paths per pixel."""
STROKES: dict[str, tuple[Stroke, ...]] = {
    "fire": (((318.0, 410.0), (318.0, 250.0), (325.0, 40.0)), ((270.0, 370.0), (290.0, 240.0), (310.0, 80.0)),
             ((370.0, 370.0), (352.0, 240.0), (335.0, 80.0))),
    "smoke": (((248.0, 350.0), (256.0, 270.0), (300.0, 170.0), (380.0, 60.0)),),
    "painting": (((344.0, 264.0), (344.0, 316.0), (344.0, 360.0)), ((325.0, 264.0), (316.0, 316.0), (306.0, 355.0)),
                 ((363.0, 264.0), (373.0, 316.0), (383.0, 355.0)), ((318.0, 378.0), (250.0, 392.0), (170.0, 402.0)),
                 ((370.0, 378.0), (440.0, 392.0), (520.0, 402.0)), ((344.0, 384.0), (340.0, 420.0)))}
"""Along the flow, where a scene gives none; points as in [photo] strokes."""


def size(scene: PhotoScene) -> tuple[int, int]:
    """Rows and columns of a made picture."""
    return round(scene.photo.width * SHAPE[0] / SHAPE[1]), scene.photo.width


def make_fire(scene: PhotoScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, arrays.Arrays]]:
    """A bonfire at dusk."""
    from render import bonfire, studio
    from render.screen_motion import screen_motion
    from synth.photo.flames import GROUND, flames

    rows, columns = size(scene)
    fire = flames(scene.seed, rows)
    shot = studio.Shot(columns, rows, SPP["fire"], scene.seed)
    photograph = bonfire.photograph(fire.glow, fire.heat, GROUND, shot)
    voxel, origin = bonfire.placed(fire.glow.shape, GROUND)
    motion = screen_motion(fire.risen.usual, fire.risen.velocity, voxel, origin, bonfire.CAMERA, columns, rows)
    yield 0, {**vars(photograph), "motion": motion}


def make_smoke(scene: PhotoScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, arrays.Arrays]]:
    """Smoke of a stack in the low sun."""
    from render import chimney, studio
    from render.screen_motion import screen_motion
    from synth.photo.plume import MOUTH, plume

    rows, columns = size(scene)
    smoke = plume(scene.seed, rows)
    shot = studio.Shot(columns, rows, SPP["smoke"], scene.seed)
    photograph = chimney.photograph(smoke.density, smoke.left, MOUTH, shot)
    voxel, origin = chimney.placed(smoke.density.shape, smoke.left, MOUTH)
    motion = screen_motion(smoke.usual, smoke.velocity, voxel, origin, chimney.CAMERA, columns, rows)
    yield 0, {**vars(photograph), "motion": motion}


def make_painting(scene: PhotoScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, arrays.Arrays]]:
    """A waterfall between autumn trees, in oils."""
    from render import tonemap
    from synth.photo.painting import painting

    made = painting(scene.seed, size(scene))
    yield 0, {"picture": tonemap.from_srgb(made.picture)[::-1].astype(np.float32), "matte": made.matte[::-1]}


MAKES: dict[str, Any] = {"fire": make_fire, "smoke": make_smoke, "painting": make_painting}


def made_artifacts(scene: PhotoScene) -> tuple[Artifact, ...]:
    """The made target of a scene that asks for one: picture and background (h, w, 3), linear light, matte (h, w) and
    motion (h, w, 2), pixels per frame, to the right and upwards; top row first. Kept once for all scenes."""
    if not scene.photo.made:
        return ()
    return (Artifact("made", "synth", arrays.ARRAYS, ("photo.made", "photo.width", "seed"), (), MAKES[scene.photo.made],
                     animated=False, shared=True),)
