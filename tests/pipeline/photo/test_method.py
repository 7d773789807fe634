"""The record of okabe11."""

from pathlib import Path

from tiny import PHOTO, scene

from pipeline.photo.method import METHOD


def test_artifacts_come_after_their_inputs(tmp_path: Path) -> None:
    one, known = scene(tmp_path, PHOTO), set[str]()
    for artifact in METHOD.artifacts(one):
        assert set(dict(artifact.inputs)) <= known
        known.add(artifact.name)
    assert {panel.artifact for panel in METHOD.panels(one)} <= known
