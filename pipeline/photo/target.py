"""The target (okabe11 §3): the photograph, its matte, what stands still in it, what the user wants of the motion."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import BadInput, InvalidValue
from pipeline.files import pictures
from pipeline.photo.tables import PhotoScene

LARGEST = 8192
"""Edge of a photograph, pixels."""
FULL = 0.5
"""Grey from which a mask holds."""


def read_target(scene: PhotoScene) -> Any:
    """The synth.photo.animate.Target of a scene, at its width.

    Raises BadInput for a file that is no use, InvalidValue for strokes that are none.
    """
    from synth.photo.animate import Target

    photo = scene.photo
    picture = pictures.read_foreign(photo.file, "photo.file")
    shape = (picture.shape[0], picture.shape[1])
    if max(shape) > LARGEST:
        raise BadInput(photo.file, "photo.file", f"has {shape[1]} x {shape[0]} pixels; {LARGEST} a side are the most")
    if min(shape) < 16:
        raise BadInput(photo.file, "photo.file", f"has {shape[1]} x {shape[0]} pixels: too few to show a fluid")
    matte = _mask(scene, photo.matte, "photo.matte", shape)
    if not (matte >= FULL).any():
        raise BadInput(photo.matte, "photo.matte", "is empty: nothing is white, so there is nothing to animate")
    small = _scaled(scene, picture)
    if np.ptp(small[_scaled(scene, matte[..., None])[..., 0] >= FULL], axis=0).max(initial=0) <= 1 / 255:
        raise BadInput(photo.file, "photo.file", "is of one colour inside the matte")
    frozen = None if photo.frozen is None else _scaled(scene, _mask(scene, photo.frozen, "photo.frozen", shape)[
        ..., None])[..., 0] >= FULL
    if frozen is not None and not ((_scaled(scene, matte[..., None])[..., 0] >= FULL) & ~frozen).any():
        raise BadInput(scene.photo.frozen or "", "photo.frozen", "covers all of the matte")
    background = _background(scene, shape, small, _scaled(scene, matte[..., None])[..., 0])
    wanted = _wanted(scene, shape, frozen)
    return Target(small, _scaled(scene, matte[..., None])[..., 0], background, frozen, wanted)


def _background(scene: PhotoScene, shape: tuple[int, int], picture: np.ndarray, matte: np.ndarray) -> np.ndarray | None:
    """What is behind the fluid at the scene's size: the user's, or made up where a dynamic matte will show it."""
    from synth.photo.boundary import inpainted

    file = scene.photo.background
    if file is not None:
        at = "photo.background"
        return _scaled(scene, _of_size(pictures.read_foreign(file, at), file, at, shape))
    return inpainted(picture, matte) if scene.photo.dynamics > 0 else None


def _of_size(picture: np.ndarray, file: Path, at: str, shape: tuple[int, int]) -> np.ndarray:
    if picture.shape[:2] != shape:
        raise BadInput(file, at, f"has {picture.shape[1]} x {picture.shape[0]} pixels, and the picture "
                                 f"{shape[1]} x {shape[0]}")
    return picture


def _mask(scene: PhotoScene, file: Path, at: str, shape: tuple[int, int]) -> np.ndarray:
    """A grey picture (h, w), top row first, of the photograph's size."""
    grey: np.ndarray = _of_size(pictures.read_foreign(file, at), file, at, shape) @ pictures.LUMA
    return grey


def _scaled(scene: PhotoScene, picture: np.ndarray) -> np.ndarray:
    """A picture (h, w, C), top row first, at the scene's width, lowest row first: float32, 0..1."""
    width = scene.photo.width
    height = max(1, round(picture.shape[0] * width / picture.shape[1]))
    same = picture.shape[1] == width
    resized = picture if same else pictures.resized(picture.astype(np.float32), width, height)
    return np.ascontiguousarray(np.clip(resized, 0, 1)[::-1], np.float32)


def _wanted(scene: PhotoScene, shape: tuple[int, int], frozen: np.ndarray | None) -> Any:
    """What the user wants of the motion, by strokes, by their speeds, by a speed map."""
    from synth.photo.assign import Wanted
    from synth.photo.guides import orientation, speeds

    photo = scene.photo
    size = (max(1, round(shape[0] * photo.width / shape[1])), photo.width)
    strokes = _strokes(scene, shape)
    speed = None
    if photo.speeds:
        speed = speeds(strokes, photo.speeds, size, frozen)
    elif photo.speed is not None:
        map_ = _scaled(scene, _mask(scene, photo.speed, "photo.speed", shape)[..., None])[..., 0]
        speed = np.float32(photo.fastest) * map_
    return Wanted(orientation(strokes, size, frozen) if strokes else None, speed)


def _strokes(scene: PhotoScene, shape: tuple[int, int]) -> list[np.ndarray]:
    """The strokes, in the file in pixels from its upper left, in pixels of the output, y up."""
    photo = scene.photo
    scale = photo.width / shape[1]
    height = max(1, round(shape[0] * scale))
    strokes = []
    for number, stroke in enumerate(photo.strokes):
        points = np.array(stroke, np.float64)
        if ((points < -0.5) | (points > np.array(shape[::-1]) - 0.5)).any():
            raise InvalidValue(f"photo.strokes[{number}]", f"leaves the picture of {shape[1]} x {shape[0]} pixels")
        if not np.ptp(points, axis=0).any():
            raise InvalidValue(f"photo.strokes[{number}]", "has no length")
        placed = (points + 0.5) * scale - 0.5
        strokes.append(np.stack([placed[:, 0], height - 1 - placed[:, 1]], axis=-1))
    return strokes


def check_target(scene: PhotoScene) -> None:
    """Refuses a target before anything is made."""
    read_target(scene)
