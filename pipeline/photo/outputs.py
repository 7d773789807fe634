"""What other programs take of a scene of a photograph, in out/X/fields beside the frames and their mattes: the motion
for a compositor, the speed map for a paint program.

"When synthesizing the first version of an animation, our system outputs the resulting speed map. This is a gray-scale
image that can be easily loaded into any paint software. By editing the map, the user can make the animation run faster
or slower" (okabe11 §7): photo.speed takes it back.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from pipeline.build.artifact import Artifact, Inputs, Needs
from pipeline.files import images, pictures
from pipeline.files.format import Format
from pipeline.photo.tables import PhotoScene


def write_motion(file: Path, motion: np.ndarray) -> None:
    """Write a motion (Y, X, 2), pixels of the output per frame, lowest row first, as an EXR: channels x, y; y up."""
    images.write(file, {name: motion[::-1, :, n] for n, name in enumerate("xy")},
                 metadata={"flowloom_unit": "pixels per frame"})


def read_motion(file: Path) -> np.ndarray:
    """The motion that `write_motion` wrote."""
    found = images.read(file)
    return np.stack([found[name][::-1] for name in "xy"], axis=-1)


MOTION = Format("exr", write_motion, read_motion)
SPEED_MAP = Format("png", pictures.write, pictures.read)


def speed_map(motion: np.ndarray, fastest: float) -> np.ndarray:
    """The speed map (h, w) uint8, top row first, of a motion (Y, X, 2), pixels per frame: white is `fastest` and more.
    """
    speed = np.hypot(motion[..., 0], motion[..., 1])
    return np.rint(255 * np.clip(speed / fastest, 0, 1))[::-1].astype(np.uint8)


def make_motion(scene: PhotoScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """The motion, which is the same in all frames."""
    yield 0, inputs.read("assignment")["motion"]


def make_speed(scene: PhotoScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """The speed map of the motion."""
    yield 0, speed_map(inputs.read("assignment")["motion"], scene.photo.fastest)


def output_artifacts(scene: PhotoScene) -> tuple[Artifact, ...]:
    """The motion and the speed map."""
    needs: Needs = (("assignment", "once"),)
    return (Artifact("motion", "synth", MOTION, (), needs, make_motion, animated=False, export=True),
            Artifact("speed", "synth", SPEED_MAP, ("photo.fastest",), needs, make_speed, animated=False, export=True))
