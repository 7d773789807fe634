"""wang05 as the build takes it."""

from __future__ import annotations

from pipeline.build.artifact import Artifact
from pipeline.build.method import Method
from pipeline.flow import coarse_artifact, grids_fit, obstacles_fit, solid_artifacts
from pipeline.texture.frames import frame_artifacts
from pipeline.texture.panels import panels
from pipeline.texture.samples import sample_artifact
from pipeline.texture.scene import Scene, ground_fits, texture_fits
from pipeline.texture.surfaces import surface_artifact
from pipeline.texture.tables import TextureScene


def artifacts(scene: TextureScene) -> tuple[Artifact, ...]:
    """All artifacts of a scene, each after those it is made from."""
    if scene.surface is not None:
        return sample_artifact(scene), surface_artifact(scene), *frame_artifacts(scene), *scene.render.artifacts()
    return *solid_artifacts(scene), sample_artifact(scene), coarse_artifact(scene), *frame_artifacts(scene)


METHOD = Method("wang05", "texture", Scene, (ground_fits, grids_fit, texture_fits, obstacles_fit), artifacts, panels)
