"""ma13 as the build takes it."""

from __future__ import annotations

from pipeline.build.artifact import Artifact
from pipeline.build.method import Method
from pipeline.elements import scene as scenes
from pipeline.elements.coarse import carried_artifact
from pipeline.elements.exemplars import exemplar_artifact
from pipeline.elements.output import output_artifact
from pipeline.elements.panels import panels
from pipeline.elements.tables import ElementsScene
from pipeline.flow import coarse_artifact, grids_fit, obstacles_fit, solid_artifacts


def artifacts(scene: ElementsScene) -> tuple[Artifact, ...]:
    """All artifacts of a scene, each after those it is made from."""
    carried = () if scene.coarse is None else (coarse_artifact(scene) if scene.flows else carried_artifact(scene),)
    return (*solid_artifacts(scene), exemplar_artifact(scene), *carried, output_artifact(scene),
            *scene.render.artifacts(scene))


METHOD = Method(
    "ma13", "elements", scenes.Scene,
    (scenes.look_fits, scenes.for_points_alone, scenes.places_fit, grids_fit, obstacles_fit), artifacts, panels)
