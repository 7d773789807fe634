"""okabe11 as the build takes it."""

from __future__ import annotations

from pipeline.build.artifact import Artifact
from pipeline.build.method import Method
from pipeline.photo.clips import clip_artifacts
from pipeline.photo.frames import frame_artifacts
from pipeline.photo.made import made_artifacts
from pipeline.photo.neighbours import neighbour_artifacts
from pipeline.photo.outputs import output_artifacts
from pipeline.photo.panels import panels, view_artifacts
from pipeline.photo.pieces import piece_artifacts
from pipeline.photo.scene import Scene, photo_fits
from pipeline.photo.tables import PhotoScene


def artifacts(scene: PhotoScene) -> tuple[Artifact, ...]:
    """All artifacts of a scene, each after those it is made from."""
    return (*made_artifacts(scene), *clip_artifacts(scene), *frame_artifacts(scene), *output_artifacts(scene),
            *piece_artifacts(scene), *neighbour_artifacts(scene), *view_artifacts(scene))


METHOD = Method("okabe11", "photo", Scene, (photo_fits,), artifacts, panels)
