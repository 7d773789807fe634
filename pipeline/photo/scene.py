"""A scene of a photograph that flows (okabe11), all its tables together, and what does not fit together in them."""

from __future__ import annotations

from typing import get_args

from pipeline.build.method import Faults
from pipeline.errors import BadInput
from pipeline.photo.clips import Clips, names
from pipeline.photo.made import STROKES
from pipeline.photo.tables import Assignment, Figure, OfPiece, Photo, PhotoScene
from pipeline.tables import key


class Scene(PhotoScene):
    """A scene of a photograph: keys above the first table."""

    frames: int = key("length of the animation, which is a loop", 96, "frames", ge=8, le=1000)
    fps: float = key("speed of the animation", 24, "frames per second", gt=0, le=1000)
    photo: Photo
    clips: Clips = Clips()
    assignment: Assignment = Assignment()
    figure: Figure = Figure()


def photo_fits(scene: Scene) -> Faults:
    """Check: one target, a database that has clips, pieces that fit into them, moments there are."""
    yield from _target_fits(scene)
    unknown = [family for family in scene.clips.families if family not in _families()]
    if unknown:
        yield "clips.families", f"there is no family {unknown[0]!r}, only {', '.join(_families())}"
    elif not scene.clips.recipes() and not scene.clips.files and scene.clips.library is None:
        yield "clips.count", "is 0, and there is neither clips.files nor clips.library: there is no clip"
    try:
        _ = scene.clips.kept
    except BadInput as error:
        yield "clips.library", error.reason
    if scene.clips.count and scene.assignment.piece >= min(scene.clips.size) // 2:
        yield "assignment.piece", (f"pieces of {scene.assignment.piece} pixels do not fit into clips of "
                                   f"{scene.clips.size[0]} x {scene.clips.size[1]} at half their size")
    strokes = len(scene.photo.strokes or STROKES.get(scene.photo.made, ()))
    if scene.photo.speeds and len(scene.photo.speeds) != strokes:
        yield "photo.speeds", f"has {len(scene.photo.speeds)} speeds, and there are {strokes} strokes"
    if scene.photo.speeds and scene.photo.speed is not None:
        yield "photo.speeds", "and photo.speed both say how fast it flows: leave out one"
    for number, moment in enumerate(scene.figure.moments):
        if moment > scene.frames:
            yield f"figure.moments[{number}]", f"the animation has {scene.frames} frames"
    for number, (clip, _, _) in enumerate(scene.figure.pieces):
        if f"clip-{clip}" not in names(scene, "clip"):
            yield f"figure.pieces[{number}]", f"the scene has no clip \"{clip}\""
    for name in scene.figure.panels:
        if name in get_args(OfPiece) and not scene.figure.pieces:
            yield "figure.pieces", f"is empty, and the panel \"{name}\" shows a piece"
        if name in ("strokes", "orientation") and not (scene.photo.strokes or scene.photo.made):
            yield "photo.strokes", f"is empty, and the panel \"{name}\" shows the strokes"


def _target_fits(scene: Scene) -> Faults:
    """A file with its matte, or a made picture without files in their place."""
    photo = scene.photo
    if not photo.made:
        for name, file in (("file", photo.file), ("matte", photo.matte)):
            if file is None:
                yield f"photo.{name}", "is missing, and so is photo.made"
    else:
        for name, file in (("file", photo.file), ("matte", photo.matte), ("background", photo.background)):
            if file is not None:
                yield f"photo.{name}", f"is given, and so is photo.made = \"{photo.made}\", which has its own"


def _families() -> list[str]:
    from synth.photo.clips import FAMILIES

    return list(FAMILIES)
