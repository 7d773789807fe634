"""The record of a method: every project scene fits the promises that the build relies on."""

from pathlib import Path

import pytest

from pipeline.build.artifact import FOLDERS
from pipeline.build.view import value_at
from pipeline.methods import METHODS
from pipeline.scene import load
from pipeline.tables import PROJECT_SCENES


@pytest.mark.parametrize("file", sorted(PROJECT_SCENES.glob("*.toml")), ids=lambda file: file.stem)
def test_artifacts_come_after_their_inputs_and_panels_show_artifacts(file: Path) -> None:
    loaded = load(file, quick=True)
    assert loaded.method in METHODS
    for scene in loaded.variants.values():
        known: dict[str, int] = {}
        for artifact in loaded.method.artifacts(scene):
            assert artifact.name not in known
            assert set(dict(artifact.inputs)) <= set(known), artifact.name
            known[artifact.name] = list(FOLDERS).index(artifact.stage)
            assert all(known[name] <= known[artifact.name] for name, _ in artifact.inputs)
        for panel in loaded.method.panels(scene):
            shown = {panel.artifact, panel.still or panel.artifact, panel.inset or panel.artifact}
            assert shown <= set(known)


def test_every_key_that_an_artifact_declares_is_one_that_scenes_have() -> None:
    """A misspelt key would be None for ever: a change to it would make nothing again."""
    known, read = set(), set()
    for file in sorted(PROJECT_SCENES.glob("*.toml")):
        loaded = load(file)
        for scene in loaded.variants.values():
            for artifact in loaded.method.artifacts(scene):
                for key in artifact.reads:
                    read.add((loaded.method.name, key))
                    parent, _, last = key.rpartition(".")
                    above = value_at(scene, parent) if parent else scene
                    if hasattr(above, last.partition("[")[0]):
                        known.add((loaded.method.name, key))
    assert read
    assert not read - known
