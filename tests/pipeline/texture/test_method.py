"""The record of wang05: its artifacts come after what they are made from, and its panels show some of them."""

from pathlib import Path

import pytest
from tiny import BY_PAPER, TEXTURE, TEXTURE_ON_SURFACE, scene

from pipeline.scene import load
from pipeline.tables import PROJECT_SCENES
from pipeline.texture.method import METHOD

STONE = TEXTURE + '[[obstacles]]\nkind = "ball"\ncentre = [0.0, 0.5]\nradius = 0.2\n'


@pytest.mark.parametrize("text", [TEXTURE, BY_PAPER, STONE, TEXTURE_ON_SURFACE])
def test_artifacts_come_after_their_inputs(tmp_path: Path, text: str) -> None:
    one, known = scene(tmp_path, text), set[str]()
    for artifact in METHOD.artifacts(one):
        assert set(dict(artifact.inputs)) <= known
        known.add(artifact.name)
    assert {panel.artifact for panel in METHOD.panels(one)} <= known


@pytest.mark.parametrize("file", sorted(PROJECT_SCENES.glob("wang05-*.toml")), ids=lambda file: file.stem)
def test_its_scenes_compare_both_methods_or_say_why_not(file: Path) -> None:
    loaded = load(file)
    assert loaded.method is METHOD
    if file.stem in ("wang05-fig08", "wang05-fig09", "wang05-fig10", "wang05-fig11"):
        assert [one.texture.method for one in loaded.variants.values()] == ["paper", "carry"]
        assert {one.figure.moments for one in loaded.variants.values()} == {(1, 30, 70, 100)}
