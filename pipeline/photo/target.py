"""The target (okabe11 §3): the photograph, its matte, what stands still in it, what the user wants of the motion."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from pipeline.build.artifact import Inputs
from pipeline.errors import BadInput, InvalidValue
from pipeline.files import arrays, pictures
from pipeline.photo.made import SHAPE, STROKES
from pipeline.photo.tables import PhotoScene

LARGEST = 8192
"""Edge of a photograph, pixels, upright."""
SMALLEST = 16
FULL = 0.5
"""Grey from which a mask holds."""


def read_target(scene: PhotoScene, made: arrays.Arrays | None = None) -> Any:
    """The synth.photo.animate.Target of a scene, at its width.

    made  the arrays of `made`, where the scene asks for a made picture
    Raises BadInput for a file that is no use, InvalidValue for strokes that are none.
    """
    from synth.photo.animate import Target

    shape, picture, matte, background = _read(scene) if made is None else _made(made)
    frozen = _frozen(scene, shape)
    if frozen is not None and not ((matte >= FULL) & ~frozen).any():
        raise BadInput(scene.photo.frozen or "", "photo.frozen", "covers all of the matte")
    return Target(picture, matte, background, frozen, _wanted(scene, shape, frozen))


def target_inputs(scene: PhotoScene) -> tuple[str, ...]:
    """The artifacts that `target_of` reads."""
    return () if not scene.photo.made else ("made",)


def target_of(scene: PhotoScene, inputs: Inputs) -> Any:
    """The target of a scene for an artifact that declares `target_inputs`."""
    return read_target(scene, inputs.read("made") if "made" in inputs else None)


Read = tuple[tuple[int, int], np.ndarray, np.ndarray, np.ndarray | None]
"""Rows and columns in which the user counts; picture, matte and background at the scene's width, lowest row first."""


def _read(scene: PhotoScene) -> Read:
    """The user's picture, its matte and what is behind the fluid."""
    photo = scene.photo
    file, matte_file = Path(photo.file or ""), Path(photo.matte or "")
    read = pictures.read_scaled(file, "photo.file", photo.width, 1.0, LARGEST)
    if min(read.of) < SMALLEST:
        raise BadInput(file, "photo.file", f"has {read.of[1]} x {read.of[0]} pixels: too few to show a fluid")
    picture = _lowest_first(read.picture)
    matte = _mask(scene, matte_file, "photo.matte", read.of)
    inside = matte >= FULL
    if not inside.any():
        raise BadInput(matte_file, "photo.matte", "is empty: nothing is white, so there is nothing to animate")
    if np.ptp(picture[inside], axis=0).max(initial=0) <= 1 / 255:
        raise BadInput(file, "photo.file", "is of one colour inside the matte")
    return read.of, picture, matte, _background(scene, read.of, picture, matte)


def _made(made: arrays.Arrays) -> Read:
    """The same of a made picture, which has the scene's width."""
    from render import tonemap

    def display(name: str) -> np.ndarray:
        return _lowest_first(tonemap.to_srgb(made[name]))

    return SHAPE, display("picture"), _lowest_first(made["matte"]), (
        display("background") if "background" in made else None)


def _frozen(scene: PhotoScene, shape: tuple[int, int]) -> np.ndarray | None:
    """What stands still in the fluid, (Y, X) bool."""
    file = scene.photo.frozen
    return None if file is None else _mask(scene, file, "photo.frozen", shape) >= FULL


def _background(scene: PhotoScene, shape: tuple[int, int], picture: np.ndarray, matte: np.ndarray) -> np.ndarray | None:
    """What is behind the fluid at the scene's size: the user's, or made up where a dynamic matte will show it."""
    from synth.photo.boundary import inpainted

    file = scene.photo.background
    if file is not None:
        return _lowest_first(_of_size(scene, file, "photo.background", shape, 1.0))
    return inpainted(picture, matte) if scene.photo.dynamics > 0 else None


def _of_size(scene: PhotoScene, file: Path, at: str, shape: tuple[int, int], ground: float, kernel: str = "",
             ) -> np.ndarray:
    """A picture of the photograph's size, at the scene's: (h, w, 3), top row first."""
    read = pictures.read_scaled(file, at, scene.photo.width, ground, LARGEST, kernel)
    if read.of != shape:
        raise BadInput(file, at, f"has {read.of[1]} x {read.of[0]} pixels, and the picture {shape[1]} x {shape[0]}")
    return read.picture


def _mask(scene: PhotoScene, file: Path, at: str, shape: tuple[int, int]) -> np.ndarray:
    """A grey picture of the photograph's size, at the scene's: (Y, X) float32. What is transparent is black."""
    # beside the border of a mask an overshoot would be fluid
    return _lowest_first(np.clip(_of_size(scene, file, at, shape, 0.0, "triangle") @ pictures.LUMA, 0, 1))


def _lowest_first(picture: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(picture[::-1], np.float32)


def _wanted(scene: PhotoScene, shape: tuple[int, int], frozen: np.ndarray | None) -> Any:
    """What the user wants of the motion, by strokes, by their speeds, by a speed map."""
    from synth.photo.assign import Wanted
    from synth.photo.guides import orientation, speeds

    photo = scene.photo
    size = (max(1, round(shape[0] * photo.width / shape[1])), photo.width)
    strokes = _strokes(scene, shape)
    speed = speeds(strokes, photo.speeds, size, frozen) if photo.speeds else _speed_map(scene, size)
    return Wanted(orientation(strokes, size, frozen) if strokes else None, speed)


def _speed_map(scene: PhotoScene, size: tuple[int, int]) -> np.ndarray | None:
    """The user's speed map at the scene's size (Y, X), lowest row first, pixels per frame: a map of any size with the
    picture's proportions, so that one that was written at another photo.width is taken too."""
    file, (rows, columns) = scene.photo.speed, size
    if file is None:
        return None
    grey = pictures.read_foreign(file, "photo.speed") @ pictures.LUMA
    height, width = grey.shape
    # either size may be rounded
    if abs(height * columns - width * rows) > max(width, columns):
        raise BadInput(file, "photo.speed", f"has {width} x {height} pixels: other proportions than the picture, "
                                            f"whose output has {columns} x {rows}")
    if grey.shape != size:
        grey = pictures.resized(grey[..., None], columns, rows, "triangle")[..., 0]
    return np.ascontiguousarray(scene.photo.fastest * np.clip(grey, 0, 1)[::-1], np.float32)


def flowing_size(scene: PhotoScene) -> tuple[int, int]:
    """Rows and columns of the part round the matte that is made to flow, pixels of the output, without reading more."""
    photo = scene.photo
    if photo.made:
        return photo.width * SHAPE[0] // SHAPE[1], photo.width
    matte = pictures.read_scaled(Path(photo.matte or ""), "photo.matte", photo.width, 0.0, LARGEST, "triangle").picture
    filled = matte.max(axis=2) > 0

    def length(axis: int) -> int:
        at = np.flatnonzero(filled.any(axis=1 - axis))
        return int(min(np.ptp(at) + 1 + 2 * scene.assignment.piece, filled.shape[axis])) if len(at) else 0

    return length(0), length(1)


def read_strokes(scene: PhotoScene) -> list[np.ndarray]:
    """The strokes, each (K, 2) float64: x, y in pixels of the output, whose lowest left pixel is 0, 0."""
    if scene.photo.made:
        return _strokes(scene, SHAPE)
    file = Path(scene.photo.file or "")
    return _strokes(scene, pictures.read_scaled(file, "photo.file", scene.photo.width, 1.0, LARGEST).of)


def _strokes(scene: PhotoScene, shape: tuple[int, int]) -> list[np.ndarray]:
    """The strokes of a picture that has `shape` (h, w) in its file, where they are from its upper left.

    Raises InvalidValue for one that leaves the picture or has no length.
    """
    photo = scene.photo
    scale = photo.width / shape[1]
    height = max(1, round(shape[0] * scale))
    strokes = []
    for number, stroke in enumerate(photo.strokes or STROKES.get(photo.made, ())):
        points = np.array(stroke, np.float64)
        if ((points < -0.5) | (points > np.array(shape[::-1]) - 0.5)).any():
            raise InvalidValue(f"photo.strokes[{number}]", f"leaves the picture of {shape[1]} x {shape[0]} pixels")
        if not np.ptp(points, axis=0).any():
            raise InvalidValue(f"photo.strokes[{number}]", "has no length")
        placed = (points + 0.5) * scale - 0.5
        strokes.append(np.stack([placed[:, 0], height - 1 - placed[:, 1]], axis=-1))
    return strokes


def check_target(scene: PhotoScene) -> None:
    """Refuses a target before anything is made; of a made one what the scene says of it."""
    if not scene.photo.made:
        read_target(scene)
    else:
        _wanted(scene, SHAPE, _frozen(scene, SHAPE))
