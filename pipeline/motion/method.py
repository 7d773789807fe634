"""ma09 as the build takes it."""

from __future__ import annotations

from pipeline.build.artifact import Artifact
from pipeline.build.method import Method
from pipeline.flow import coarse_artifact, grids_fit, obstacles_fit, solid_artifacts
from pipeline.motion import scene as scenes
from pipeline.motion.bake import final_artifact
from pipeline.motion.exemplars import exemplar_artifacts
from pipeline.motion.fields import field_artifacts
from pipeline.motion.panels import panels, picture_artifacts
from pipeline.motion.tables import MotionScene


def artifacts(scene: MotionScene) -> tuple[Artifact, ...]:
    """All artifacts of a scene, each after those it is made from."""
    return (*solid_artifacts(scene), *exemplar_artifacts(scene), coarse_artifact(scene), *field_artifacts(scene),
            final_artifact(scene), *scene.render.artifacts(scene), *picture_artifacts(scene))


METHOD = Method(
    "ma09", "detail", scenes.Scene,
    (grids_fit, scenes.fits_its_dimension, scenes.render_fits, scenes.exemplar_fits, scenes.views_fit, obstacles_fit,
     scenes.samples_fit),
    artifacts, panels)
