"""The panels of a figure of motion fields, and the pictures of fields that they show, in out/X/images.

Pictures of fields are made as display values and stored as linear light, so that the tone "straight" gives these back.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.build.artifact import Artifact, Inputs, Needs
from pipeline.build.method import Panel
from pipeline.build.view import value_at
from pipeline.files import images, pictures
from pipeline.flow import solid_input, upsampled
from pipeline.motion.bake import transformed
from pipeline.motion.fields import LOCAL_AXES, smoke_input
from pipeline.motion.looks import walls_or_far
from pipeline.motion.tables import MotionScene

ARROWS = 9  # across a picture
LABELS = {
    "input": "input", "exemplar": "exemplar *I*", "coarse": "coarse motion *L*", "detail": "detail *H′*",
    "detail-divergence": "divergence of *H′*", "combined": "*F* = *L* + *ωH′*", "result": "result",
}
"""Of panels by their names, or by what they show."""


@dataclass(frozen=True)
class Shown:
    """A panel as the scene names it, `detail-arrows`, and the exemplar that it is of."""

    name: str
    exemplar: str

    @property
    def what(self) -> str:
        """Input, exemplar, coarse, detail, combined or result."""
        return self.name.partition("-")[0]

    @property
    def of_exemplar(self) -> bool:
        """Whether there are as many of it as there are exemplars."""
        return self.what in ("input", "exemplar")

    @property
    def view(self) -> str:
        """The view that first shows its exemplar: front … or a number; "" if there is one exemplar."""
        return self.exemplar.removeprefix("exemplar").removeprefix("-") if self.of_exemplar else ""

    @property
    def style(self) -> str:
        """Lines, colour, arrows or divergence."""
        return self.name.partition("-")[2] or "lines"

    @property
    def artifact(self) -> str:
        """The picture that it shows."""
        if self.what == "result":
            return "beauty"
        named = f"{self.what}-{self.view}" if self.view else self.what
        return named if self.what == "input" else f"{named}-{self.style}"


def shown(scene: MotionScene) -> list[Shown]:
    """The panels of the scene's figure, from left to right; those of the exemplar once for each exemplar."""
    return [one for name in scene.figure.panels for exemplar in scene.exemplars
            if (one := Shown(name, exemplar)).of_exemplar or exemplar == next(iter(scene.exemplars))]


def panels(scene: MotionScene) -> tuple[Panel, ...]:
    """The panels of the scene's figure."""
    has_still = any(artifact.name == "still" for artifact in scene.render.artifacts(scene))
    made = []
    for one in shown(scene):
        label = LABELS.get(one.name) or LABELS[one.what]
        result = one.what == "result"
        made.append(Panel(
            label + (f", {one.view}" if one.view else ""), one.artifact, _width(scene, one),
            scene.render.tone if result else "straight", still="still" if result and has_still else "",
            legend=one.style == "colour"))
    return tuple(made)


def _width(scene: MotionScene, one: Shown) -> int:
    """Pixels across a panel: figure.panel, but an exemplar is no higher than a result that is wider than high."""
    full = scene.figure.panel
    height = getattr(scene.render, "height", None)
    if not one.of_exemplar or "result" not in scene.figure.panels or height is None:
        return full
    return min(full, round(full * height / scene.render.width))


def picture_artifacts(scene: MotionScene) -> tuple[Artifact, ...]:
    """The pictures of fields that the scene's figure shows."""
    return tuple(_picture_of_input(scene, one) if one.what == "input" else _picture_of_field(scene, one)
                 for one in dict.fromkeys(shown(scene)) if one.what != "result")


def _picture_of_input(scene: MotionScene, one: Shown) -> Artifact:
    at = scene.exemplars[one.exemplar]
    return Artifact(one.artifact, "render", images.LIGHT, (at, "figure.panel", "figure.plane"),
                    ((one.exemplar, "once"),), make_input, {"at": at, "exemplar": one.exemplar}, animated=False)


def _picture_of_field(scene: MotionScene, one: Shown) -> Artifact:
    reads: tuple[str, ...] = ("figure.panel", "figure.plane", "seed")
    if one.of_exemplar:
        return Artifact(one.artifact, "render", images.LIGHT, reads, ((one.exemplar, "once"),), make_field_picture,
                        {"what": "exemplar", "style": one.style, "exemplar": one.exemplar}, animated=False)
    inputs: dict[str, Needs] = {
        "coarse": (("L", "same"),), "detail": (("L", "same"), ("H", "same"), *smoke_input(scene, "same")),
        "combined": (("F", "same"),)}
    reads = (*reads, "shape", *(LOCAL_AXES if one.what == "detail" else ()))
    return Artifact(one.artifact, "render", images.LIGHT, reads, (*inputs[one.what], *solid_input(scene)),
                    make_field_picture, {"what": one.what, "style": one.style})


def make_input(scene: MotionScene, inputs: Inputs, frames: list[int], at: str, exemplar: str,
               ) -> Iterator[tuple[int, np.ndarray]]:
    """An exemplar as figure 4 shows it: a bitmap itself, the colours of any other."""
    from render import lic, tonemap

    width = scene.figure.panel
    picture = value_at(scene, at).picture(at)
    if picture is None:
        drawn = lic.colour(_slice(inputs.read(exemplar).values, scene), width)
    else:
        drawn = np.clip(pictures.resized(picture, width, lic.height_for(picture.shape, width)), 0, 1)
    yield 0, tonemap.from_srgb(drawn)


def make_field_picture(scene: MotionScene, inputs: Inputs, frames: list[int], what: str, style: str,
                       exemplar: str = "") -> Iterator[tuple[int, np.ndarray]]:
    """Pictures of a field: lines, colour, arrows or divergence."""
    from render import lic, tonemap

    width = scene.figure.panel
    for frame in frames:
        values = _slice(_values(scene, inputs, frame, what, exemplar), scene)
        drawing = {"colour": lic.colour, "divergence": lic.divergence}.get(style)
        picture = drawing(values, width) if drawing else lic.picture(values, width, scene.seed)
        if "solid" in inputs:
            picture = lic.with_solids(picture, _walls(scene, inputs))
        if style == "arrows":
            untransformed = _slice(inputs.read("H", frame).values, scene) if what == "detail" else None
            picture = with_arrows(picture, values, untransformed)
        yield frame, tonemap.from_srgb(picture)


def _values(scene: MotionScene, inputs: Inputs, frame: int, what: str, exemplar: str) -> np.ndarray:
    """The field of a panel, any unit."""
    if what == "detail":
        return transformed(scene, inputs, frame, upsampled(inputs.read("L", frame), scene))
    name = exemplar or {"coarse": "L", "combined": "F"}[what]
    values: np.ndarray = inputs.read(name, 0 if exemplar else frame).values
    return values


def _slice(values: np.ndarray, scene: MotionScene) -> np.ndarray:
    """A field in the plane (Y, X, 2); of one in space the middle slice along figure.plane."""
    from render import lic

    return values if values.ndim == 3 else lic.slice_of(values, scene.figure.plane)


def _walls(scene: MotionScene, inputs: Inputs) -> np.ndarray:
    """The distance to the obstacles (Y, X), cells; in space that of the slice which panels show."""
    distance: Any = walls_or_far(scene, inputs)
    return distance if distance.ndim == 2 else _slice(np.repeat(distance[..., None], 3, axis=-1), scene)[..., 0]


def with_arrows(picture: np.ndarray, values: np.ndarray, untransformed: np.ndarray | None) -> np.ndarray:
    """Figure 2: `values` (Y, X, 2) in red over those of `untransformed` in green, at a grid of points."""
    from render import arrows

    rows, columns, places = arrows.grid(values.shape, picture.shape, ARROWS)
    length = 0.8 * picture.shape[1] / ARROWS
    for field, colour in ((untransformed, arrows.GREEN), (values, arrows.RED)):
        if field is not None:
            picture = arrows.drawn(picture, places, field[rows, columns], length, colour)
    return picture
