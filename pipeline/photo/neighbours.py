"""Two neighbours before and after integration, for the panels of a figure (okabe11 §6, fig. 9).

    neighbours  the two at figure.place, first frame

and their pictures, in linear light, top row first.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import get_args

import numpy as np

from pipeline.build.artifact import Artifact, Inputs
from pipeline.files import arrays
from pipeline.photo.clips import names
from pipeline.photo.frames import assigned, cut_of, frames_of
from pipeline.photo.tables import OfPair, PhotoScene
from pipeline.photo.target import target_inputs, target_of
from pipeline.photo.views import Pictures, View, picture


def make_neighbours(scene: PhotoScene, inputs: Inputs, frames: list[int], clips: list[str],
                    ) -> Iterator[tuple[int, arrays.Arrays]]:
    """The neighbours at figure.place and their integration."""
    from synth.photo.steps import nearest_edge, neighbours

    of, shown = assigned(inputs)
    rows, columns = inputs.read("assignment")["motion"].shape[:2]
    x, y = scene.figure.place
    edge = nearest_edge(of, (x * columns - 0.5, (1 - y) * rows - 0.5), cut_of(scene))
    yield 0, neighbours(of, shown, frames_of(inputs, clips), edge, cut_of(scene), scene.frames, scene.seed)._asdict()


def make_place(scene: PhotoScene, inputs: Inputs, frames: list[int]) -> Pictures:
    """The photograph round the neighbours, with the outline of each."""
    from render import plot, steps, tonemap

    whole, corner, size = target_of(scene, inputs).picture, inputs.read("neighbours")["corner"], scene.assignment.piece
    shape = np.minimum([2 * size, 3 * size], whole.shape[:2])
    low = np.clip(np.rint(corner.mean(axis=0)).astype(int) + (size - shape) // 2, 0, np.array(whole.shape[:2]) - shape)
    part = whole[low[0]:low[0] + shape[0], low[1]:low[1] + shape[1]]
    yield 0, tonemap.from_srgb(steps.outlined(part, corner - low, size, [plot.RED, plot.BLUE], scene.figure.panel))


def make_neighbour(scene: PhotoScene, inputs: Inputs, frames: list[int], side: int) -> Pictures:
    """The piece of a clip that the left or the right neighbour shows."""
    from render import steps, tonemap

    yield 0, tonemap.from_srgb(steps.grey(inputs.read("neighbours")["pieces"][side], narrow(scene)))


def make_difference(scene: PhotoScene, inputs: Inputs, frames: list[int], side: int) -> Pictures:
    """Its difference from its average."""
    from render import steps, tonemap

    yield 0, tonemap.from_srgb(steps.difference(inputs.read("neighbours")["differences"][side], narrow(scene)))


def make_blended(scene: PhotoScene, inputs: Inputs, frames: list[int], how: str) -> Pictures:
    """The differences of both, blended by "shares" or by "roots"."""
    from render import steps, tonemap

    yield 0, tonemap.from_srgb(steps.difference(inputs.read("neighbours")[how], scene.figure.panel))


def make_deviation(scene: PhotoScene, inputs: Inputs, frames: list[int]) -> Pictures:
    """The deviation over time of each column of both: what is lost between the pieces."""
    from render import plot, tonemap

    shares, roots = inputs.read("neighbours")["deviation"]
    at = np.arange(len(shares))
    curves = [plot.Curve(at, shares, plot.RED, "weights add up to 1"), plot.Curve(at, roots, plot.BLUE, "squares do")]
    yield 0, tonemap.from_srgb(plot.plot(curves, "column, pixels", "grey levels", scene.figure.panel,
                                         1.4 * float(max(shares.max(), roots.max()))))


def narrow(scene: PhotoScene) -> int:
    """Width of a square panel as high as one of 3 : 2."""
    return round(scene.figure.panel * 2 / 3)


def neighbour_artifacts(scene: PhotoScene) -> tuple[Artifact, ...]:
    """The neighbours, where the figure shows them."""
    if not set(scene.figure.panels) & set(get_args(OfPair)):
        return ()
    clips = names(scene, "clip")
    return (Artifact("neighbours", "synth", arrays.ARRAYS, ("figure.place", "assignment.piece", "frames", "seed"),
                     (("assignment", "once"), *((name, "once") for name in clips)), make_neighbours, {"clips": clips},
                     animated=False),)


def neighbour_views(scene: PhotoScene, name: str) -> list[View]:
    """The views of a panel that shows the neighbours."""
    full, of, reads = scene.figure.panel, ("neighbours",), ("figure.panel",)
    sides = (0, "left"), (1, "right")
    match name:
        case "neighbours":
            shown = picture("place", ("photo", "assignment.piece", *reads), (*target_inputs(scene), *of), make_place)
            return [View(shown, "two pieces", full)]
        case "neighbour-pieces":
            return [View(picture(f"piece-{side}", reads, of, make_neighbour, side=number), f"clip of the {side} piece",
                         narrow(scene)) for number, side in sides]
        case "neighbour-differences":
            return [View(picture(f"difference-{side}", reads, of, make_difference, side=number), "its difference *D*",
                         narrow(scene)) for number, side in sides]
        case "shares":
            return [View(picture(name, reads, of, make_blended, how=name), "blended, weights add up to 1", full)]
        case "roots":
            return [View(picture(name, reads, of, make_blended, how=name), "blended, their squares do", full)]
        case "deviation":
            return [View(picture(name, reads, of, make_deviation), "deviation over time", full, border=False)]
    raise ValueError(f"there is no view {name!r}")
