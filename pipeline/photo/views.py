"""Pictures for the panels of a figure: the photograph, what the user wants of its motion (okabe11 fig. 8), the motion,
the database (fig. 3).

Pictures are in linear light, top row first.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from pipeline.build.artifact import Artifact, Inputs, Needs
from pipeline.files import images
from pipeline.photo.clips import names
from pipeline.photo.outputs import speed_map
from pipeline.photo.tables import PhotoScene
from pipeline.photo.target import read_strokes, target_inputs, target_of

Pictures = Iterator[tuple[int, np.ndarray]]


class View(NamedTuple):
    """A picture that is made for a panel: its artifact, the panel's label and width in pixels, whether a colour wheel
    stands in its corner, whether it has a thin border."""

    artifact: Artifact
    label: str
    width: int
    legend: bool = False
    border: bool = True


def picture(name: str, reads: tuple[str, ...], inputs: tuple[str, ...], make: Callable[..., Pictures],
            **arguments: Any) -> Artifact:
    """The artifact of a view, from inputs of which there is one file each."""
    needs: Needs = tuple((needed, "once") for needed in inputs)
    return Artifact(f"{name}-picture", "render", images.LIGHT, reads, needs, make, arguments, animated=False)


def make_target(scene: PhotoScene, inputs: Inputs, frames: list[int]) -> Pictures:
    """The photograph."""
    from render import tonemap

    yield 0, tonemap.from_srgb(target_of(scene, inputs).picture)[::-1].astype(np.float32)


def make_strokes(scene: PhotoScene, inputs: Inputs, frames: list[int]) -> Pictures:
    """The photograph with the strokes on it (fig. 8 a)."""
    from render import steps, tonemap

    yield 0, tonemap.from_srgb(steps.strokes(target_of(scene, inputs).picture, read_strokes(scene), scene.figure.panel))


def make_orientation(scene: PhotoScene, inputs: Inputs, frames: list[int]) -> Pictures:
    """The orientation map that is interpolated from the strokes (fig. 8 b)."""
    from render import steps, tonemap

    target, width = target_of(scene, inputs), scene.figure.panel
    yield 0, tonemap.from_srgb(steps.orientation(target.wanted.orientation, target.fluid, width, scene.seed))


def make_speed(scene: PhotoScene, inputs: Inputs, frames: list[int]) -> Pictures:
    """The speed map (fig. 8 c)."""
    from render import tonemap

    grey = speed_map(inputs.read("assignment")["motion"], scene.photo.fastest).astype(np.float32) / 255
    yield 0, tonemap.from_srgb(np.repeat(grey[..., None], 3, axis=2))


def make_motion(scene: PhotoScene, inputs: Inputs, frames: list[int]) -> Pictures:
    """The motion by colour: its direction by hue, its speed by strength."""
    from render import lic, tonemap

    yield 0, tonemap.from_srgb(lic.colour(inputs.read("assignment")["motion"], scene.figure.panel))


def make_database(scene: PhotoScene, inputs: Inputs, frames: list[int], clips: list[str]) -> Pictures:
    """The first frame of each clip of the database, on one sheet (fig. 3)."""
    from render import contact_sheet, tonemap

    rows, columns = target_of(scene, inputs).matte.shape
    # copies: a view would keep the whole of each clip in memory
    first = [inputs.read(name)["luma"][0].copy() for name in clips]
    yield 0, tonemap.from_srgb(contact_sheet.thumbnails(first, scene.figure.panel, columns / rows))


def target_view(scene: PhotoScene, name: str) -> View:
    """The view of a panel that shows the photograph as a whole, or the database."""
    full, assignment, target = scene.figure.panel, ("assignment",), target_inputs(scene)
    match name:
        case "target":
            return View(picture(name, ("photo",), target, make_target), name, full)
        case "strokes":
            return View(picture(name, ("photo", "figure.panel"), target, make_strokes), name, full)
        case "orientation":
            return View(picture(name, ("photo", "figure.panel", "seed"), target, make_orientation), "orientation map",
                        full, legend=True)
        case "speed":
            return View(picture(name, ("photo.fastest",), assignment, make_speed),
                        f"speed map, white: {scene.photo.fastest:g} pixels per frame", full)
        case "motion":
            return View(picture(name, ("figure.panel",), assignment, make_motion), name, full, legend=True)
        case "database":
            clips = names(scene, "clip")
            return View(picture(name, ("photo", "figure.panel"), (*target, *clips), make_database, clips=clips),
                        f"database, {len(clips)} clip{'s' * (len(clips) > 1)}", full, border=False)
    raise ValueError(f"there is no view {name!r}")
