"""A scene of a photograph that flows (okabe11), all its tables together, and what does not fit together in them."""

from __future__ import annotations

from pipeline.build.method import Faults
from pipeline.photo.clips import Clips
from pipeline.photo.tables import Assignment, Figure, Photo, PhotoScene
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
    elif not scene.clips.recipes() and not scene.clips.files:
        yield "clips.count", "is 0, and clips.files is empty: there is no clip"
    if scene.clips.count and scene.assignment.piece >= min(scene.clips.size) // 2:
        yield "assignment.piece", (f"pieces of {scene.assignment.piece} pixels do not fit into clips of "
                                   f"{scene.clips.size[0]} x {scene.clips.size[1]} at half their size")
    for number, moment in enumerate(scene.figure.moments):
        if moment > scene.frames:
            yield f"figure.moments[{number}]", f"the animation has {scene.frames} frames"


def _target_fits(scene: Scene) -> Faults:
    """A file with its matte, or a made picture without files in their place."""
    photo = scene.photo
    if photo.made is None:
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
