"""okabe11 as the build takes it."""

from __future__ import annotations

from pipeline.build.artifact import Artifact
from pipeline.build.method import Method
from pipeline.photo.clips import clip_artifacts
from pipeline.photo.frames import frame_artifacts
from pipeline.photo.made import made_artifacts
from pipeline.photo.panels import panels
from pipeline.photo.scene import Scene, photo_fits
from pipeline.photo.tables import PhotoScene


def artifacts(scene: PhotoScene) -> tuple[Artifact, ...]:
    """All artifacts of a scene, each after those it is made from."""
    return *made_artifacts(scene), *clip_artifacts(scene), *frame_artifacts(scene)


METHOD = Method("okabe11", "photo", Scene, (photo_fits,), artifacts, panels)
