"""ma09 as the build takes it: its artifacts in order, and its panels, of every scene of the project."""

from pathlib import Path

import pytest
import tiny

from pipeline.build.artifact import FOLDERS
from pipeline.listing import project_scenes
from pipeline.motion.method import METHOD, artifacts
from pipeline.scene import Scenes, load

FILES = [file for file in project_scenes() if file.stem.startswith("ma09-")]


@pytest.fixture(params=FILES, ids=lambda file: file.stem)
def scenes(request: pytest.FixtureRequest) -> Scenes:
    """A scene file of ma09."""
    return load(request.param)


def test_there_are_scenes_and_all_are_of_this_method() -> None:
    assert len(FILES) > 10
    assert {load(file).method.name for file in FILES} == {"ma09"}


def test_every_artifact_comes_after_those_it_is_made_from(scenes: Scenes) -> None:
    for scene in scenes.variants.values():
        known: dict[str, int] = {}
        stages = list(FOLDERS)
        for artifact in METHOD.artifacts(scene):
            assert artifact.name not in known
            stage = stages.index(artifact.stage)
            for name, _ in artifact.inputs:
                assert name in known, f"{artifact.name} is made from {name}, which is not before it"
                assert known[name] <= stage, f"{artifact.name} is of an earlier stage than {name}"
            known[artifact.name] = stage


def test_what_every_panel_shows_exists(scenes: Scenes) -> None:
    for scene in scenes.variants.values():
        rendered = {artifact.name for artifact in METHOD.artifacts(scene) if artifact.stage == "render"}
        panels = METHOD.panels(scene)
        assert panels
        for panel in panels:
            assert {panel.artifact, panel.still or panel.artifact, panel.inset or panel.artifact} <= rendered


def test_what_an_input_needs_fits_what_it_is(scenes: Scenes) -> None:
    """One file of what is not animated, and frames of what is."""
    for scene in scenes.variants.values():
        made = {artifact.name: artifact for artifact in METHOD.artifacts(scene)}
        for artifact in made.values():
            for name, which in artifact.inputs:
                assert made[name].animated == (which != "once"), (artifact.name, name, which)


def test_the_tiny_scene_has_all_stages_in_order(tmp_path: Path) -> None:
    assert [(a.name, a.stage) for a in artifacts(tiny.scene(tmp_path))] == [
        ("exemplar", "synth"), ("L", "synth"), ("H", "synth"), ("F", "bake"), ("density", "bake"),
        ("beauty", "render"), ("input", "render"), ("coarse-lines", "render")]
