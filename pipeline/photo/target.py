"""The target (okabe11 §3): the photograph, its matte, what stands still in it, what the user wants of the motion."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import BadInput, InvalidValue
from pipeline.files import arrays, pictures
from pipeline.photo.made import SHAPE, STROKES
from pipeline.photo.tables import PhotoScene

LARGEST = 8192
"""Edge of a photograph, pixels."""
FULL = 0.5
"""Grey from which a mask holds."""


def read_target(scene: PhotoScene, made: arrays.Arrays | None = None) -> Any:
    """The synth.photo.animate.Target of a scene, at its width.

    made  the arrays of `made`, where the scene asks for a made picture
    Raises BadInput for a file that is no use, InvalidValue for strokes that are none.
    """
    from synth.photo.animate import Target

    shape, picture, matte, background = _read(scene) if made is None else _made(made)
    frozen, wanted = _guides(scene, shape)
    if frozen is not None and not ((matte >= FULL) & ~frozen).any():
        raise BadInput(scene.photo.frozen or "", "photo.frozen", "covers all of the matte")
    return Target(picture, matte, background, frozen, wanted)


def _read(scene: PhotoScene) -> tuple[tuple[int, int], np.ndarray, np.ndarray, np.ndarray | None]:
    """The size of the user's file; at the scene's width the picture, its matte and what is behind the fluid."""
    photo = scene.photo
    file, matte_file = Path(photo.file or ""), Path(photo.matte or "")
    picture = pictures.read_foreign(file, "photo.file")
    shape = (picture.shape[0], picture.shape[1])
    if max(shape) > LARGEST:
        raise BadInput(file, "photo.file", f"has {shape[1]} x {shape[0]} pixels; {LARGEST} a side are the most")
    if min(shape) < 16:
        raise BadInput(file, "photo.file", f"has {shape[1]} x {shape[0]} pixels: too few to show a fluid")
    full_matte = _mask(scene, matte_file, "photo.matte", shape)
    if not (full_matte >= FULL).any():
        raise BadInput(matte_file, "photo.matte", "is empty: nothing is white, so there is nothing to animate")
    small, matte = _scaled(scene, picture), _scaled(scene, full_matte[..., None])[..., 0]
    if np.ptp(small[matte >= FULL], axis=0).max(initial=0) <= 1 / 255:
        raise BadInput(file, "photo.file", "is of one colour inside the matte")
    return shape, small, matte, _background(scene, shape, small, matte)


def _made(made: arrays.Arrays) -> tuple[tuple[int, int], np.ndarray, np.ndarray, np.ndarray | None]:
    """The same of a made picture, which has the scene's width."""
    from render import tonemap

    def display(name: str) -> np.ndarray:
        return np.ascontiguousarray(tonemap.to_srgb(made[name])[::-1], np.float32)

    background = display("background") if "background" in made else None
    return SHAPE, display("picture"), np.ascontiguousarray(made["matte"][::-1]), background


def _guides(scene: PhotoScene, shape: tuple[int, int]) -> tuple[np.ndarray | None, Any]:
    """What stands still, (Y, X) bool, and the synth.photo.assign.Wanted, of a picture that counts as `shape`."""
    from synth.photo.assign import Wanted

    photo = scene.photo
    frozen = None if photo.frozen is None else _scaled(scene, _mask(scene, photo.frozen, "photo.frozen", shape)[
        ..., None])[..., 0] >= FULL
    speed = None if photo.speed is None else np.float32(photo.fastest) * _scaled(
        scene, _mask(scene, photo.speed, "photo.speed", shape)[..., None])[..., 0]
    return frozen, Wanted(_orientation(scene, shape, frozen), speed)


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


def _orientation(scene: PhotoScene, shape: tuple[int, int], frozen: np.ndarray | None) -> np.ndarray | None:
    """The orientation map of the strokes, which are in pixels of the file from its upper left."""
    from synth.photo.guides import orientation

    photo = scene.photo
    drawn = photo.strokes or STROKES.get(photo.made or "", ())
    if not drawn:
        return None
    scale = photo.width / shape[1]
    height = max(1, round(shape[0] * scale))
    strokes = []
    for number, stroke in enumerate(drawn):
        points = np.array(stroke, np.float64)
        if ((points < -0.5) | (points > np.array(shape[::-1]) - 0.5)).any():
            raise InvalidValue(f"photo.strokes[{number}]", f"leaves the picture of {shape[1]} x {shape[0]} pixels")
        if not np.ptp(points, axis=0).any():
            raise InvalidValue(f"photo.strokes[{number}]", "has no length")
        placed = (points + 0.5) * scale - 0.5
        strokes.append(np.stack([placed[:, 0], height - 1 - placed[:, 1]], axis=-1))
    return orientation(strokes, (height, photo.width), frozen)


def check_target(scene: PhotoScene) -> None:
    """Refuses a target before anything is made; of a made one what the scene says of it."""
    if scene.photo.made is None:
        read_target(scene)
    else:
        _guides(scene, SHAPE)
