"""What is known of pieces of clips, for the panels of a figure (okabe11 §4, §5, figs. 5 to 7).

    piece-1 …   what the database finds out about each of figure.pieces

and their pictures, in linear light, top row first.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import get_args

import numpy as np

from pipeline.build.artifact import Artifact, Inputs
from pipeline.files import arrays
from pipeline.photo.frames import cut_of
from pipeline.photo.tables import OfPiece, PhotoScene
from pipeline.photo.views import Pictures, View, picture

SCALES = ("0 to 1", "1 to 2", "2 to 4", "4 to 8")
"""σ of the Gaussians between which each level of textureness lies, pixels."""


def make_piece(scene: PhotoScene, inputs: Inputs, frames: list[int], clip: str, place: list[float],
               ) -> Iterator[tuple[int, arrays.Arrays]]:
    """What is known of the piece at a place, in shares of the clip from its upper left; and the clip's first frame."""
    from synth.photo.steps import piece

    stored = inputs.read(clip)
    luma = stored["luma"]
    rows, columns = luma.shape[1:]
    x, y = place
    found = piece(luma, stored.get("velocity"), (x * columns - 0.5, (1 - y) * rows - 0.5), cut_of(scene))
    yield 0, {"clip": luma[0], **found._asdict()}


def make_clip(scene: PhotoScene, inputs: Inputs, frames: list[int], number: int) -> Pictures:
    """A square of the clip, with the outline of the piece."""
    from render import arrows, steps, tonemap

    of = inputs.read(f"piece-{number}")
    size, side = len(of["average"]), min(of["clip"].shape)
    low = np.clip(of["corner"] + (size - side) // 2, 0, np.array(of["clip"].shape) - side)
    square = of["clip"][low[0]:low[0] + side, low[1]:low[1] + side].astype(np.float32) / 255
    yield 0, tonemap.from_srgb(steps.outlined(np.repeat(square[..., None], 3, axis=2), (of["corner"] - low)[None], size,
                                              [arrows.ORANGE], scene.figure.panel))


def make_first(scene: PhotoScene, inputs: Inputs, frames: list[int], number: int) -> Pictures:
    """The piece's first frame (fig. 5 a)."""
    from render import steps, tonemap

    yield 0, tonemap.from_srgb(steps.grey(inputs.read(f"piece-{number}")["frames"][0], scene.figure.panel))


def make_flow(scene: PhotoScene, inputs: Inputs, frames: list[int], number: int) -> Pictures:
    """Its optical flow from there to the next frame (fig. 5 b)."""
    from render import steps, tonemap

    yield 0, tonemap.from_srgb(steps.motion(inputs.read(f"piece-{number}")["flow"], scene.figure.panel))


def make_mean(scene: PhotoScene, inputs: Inputs, frames: list[int], number: int) -> Pictures:
    """Its mean motion (fig. 5 c)."""
    from render import steps, tonemap

    yield 0, tonemap.from_srgb(steps.motion(inputs.read(f"piece-{number}")["mean"], scene.figure.panel))


def make_significant(scene: PhotoScene, inputs: Inputs, frames: list[int], number: int) -> Pictures:
    """The piece where its mean motion is significant; the rest is masked out (fig. 5 d)."""
    from render import steps, tonemap

    of = inputs.read(f"piece-{number}")
    yield 0, tonemap.from_srgb(steps.masked(of["frames"][0], of["significant"], scene.figure.panel))


def make_average(scene: PhotoScene, inputs: Inputs, frames: list[int], number: int) -> Pictures:
    """A of §6, the mean of all frames."""
    from render import steps, tonemap

    yield 0, tonemap.from_srgb(steps.grey(inputs.read(f"piece-{number}")["average"], scene.figure.panel))


def make_difference(scene: PhotoScene, inputs: Inputs, frames: list[int], number: int) -> Pictures:
    """D of §6 of the first frame."""
    from render import steps, tonemap

    of = inputs.read(f"piece-{number}")
    yield 0, tonemap.from_srgb(steps.difference(of["frames"][0] - of["average"], scene.figure.panel))


def make_spectrum(scene: PhotoScene, inputs: Inputs, frames: list[int], number: int) -> Pictures:
    """The amplitude of its motion at each frequency (fig. 6), over those of the other pieces in grey."""
    from render import plot, tonemap

    spectra = [inputs.read(f"piece-{k}")["spectrum"] for k in range(1, len(scene.figure.pieces) + 1)]
    curves = [plot.Curve(np.arange(len(values)), values, plot.PALE) for values in spectra]
    curves.append(curves.pop(number - 1)._replace(colour=plot.BLUE))
    # whole powers of ten round all values but exact zeros
    ends = [values[values > 0] for values in spectra]
    bottom = 10.0 ** np.floor(np.log10(min(float(values.min()) for values in ends)))
    top = 10.0 ** np.ceil(np.log10(max(float(values.max()) for values in ends)))
    yield 0, tonemap.from_srgb(plot.plot(curves, "cycles in the clip", "pixels per frame", plot_width(scene), top,
                                         bottom))


def make_textureness(scene: PhotoScene, inputs: Inputs, frames: list[int], number: int, level: int) -> Pictures:
    """Its textureness at one scale (fig. 7); white is the most that any of the pieces has at any scale."""
    from render import steps, tonemap

    most = max(float(inputs.read(f"piece-{k}")["texture"].max()) for k in range(1, len(scene.figure.pieces) + 1))
    yield 0, tonemap.from_srgb(steps.strength(inputs.read(f"piece-{number}")["texture"][..., level], most,
                                              scene.figure.panel))


def plot_width(scene: PhotoScene) -> int:
    """Width of a plot as high as a square panel."""
    return round(scene.figure.panel * 3 / 2)


LOOKS: dict[str, tuple[Callable[..., Pictures], str]] = {
    "clip": (make_clip, "clip"), "piece": (make_first, "piece"), "flow": (make_flow, "optical flow"),
    "mean-motion": (make_mean, "mean motion"), "significant-motion": (make_significant, "significant motion"),
    "average": (make_average, "average *A*"), "difference": (make_difference, "difference *D*")}
"""What makes the picture of a panel, and its label."""


def piece_artifacts(scene: PhotoScene) -> tuple[Artifact, ...]:
    """What is known of the pieces that the figure shows."""
    if not set(scene.figure.panels) & set(get_args(OfPiece)):
        return ()
    wanted = [(f"clip-{clip}", [x, y]) for clip, x, y in scene.figure.pieces]
    return tuple(Artifact(f"piece-{number}", "synth", arrays.ARRAYS, ("assignment.piece",), ((clip, "once"),),
                          make_piece, {"clip": clip, "place": place}, animated=False)
                 for number, (clip, place) in enumerate(wanted, start=1))


def piece_views(scene: PhotoScene, name: str, number: int) -> list[View]:
    """The views of a panel that shows a piece."""
    full, own = scene.figure.panel, f"piece-{number}"
    every = tuple(f"piece-{k}" for k in range(1, len(scene.figure.pieces) + 1))
    reads = ("figure.panel", "figure.pieces")
    if name == "spectrum":
        return [View(picture(f"spectrum-{number}", reads, every, make_spectrum, number=number),
                     "amplitude of the motion", plot_width(scene), border=False)]
    if name == "textureness":
        return [View(picture(f"textureness-{number}-{level}", reads, every, make_textureness, number=number,
                             level=level), f"*T*, σ {scale}", full) for level, scale in enumerate(SCALES)]
    make, label = LOOKS[name]
    return [View(picture(f"{name}-{number}", ("figure.panel",), (own,), make, number=number), label, full)]
