"""ma13 as the build takes it: of every scene the artifacts in order, and a picture for every panel."""

from pathlib import Path
from typing import Any

import pytest
from tiny import BEADS, FISH, NOODLES, PAPER, TRACKS, changed, scene

from pipeline.build.artifact import FOLDERS
from pipeline.elements.method import METHOD
from pipeline.listing import project_scenes
from pipeline.scene import load

PROJECT = [(file, quick) for file in project_scenes() if file.stem.startswith("ma13") for quick in (False, True)]


def require_whole(one: Any) -> None:
    """Every artifact after its inputs, of the stages there are, and a picture for every panel."""
    artifacts = METHOD.artifacts(one)
    names = [artifact.name for artifact in artifacts]
    assert len(set(names)) == len(names)
    for number, artifact in enumerate(artifacts):
        before = {other.name: other for other in artifacts[:number]}
        for name, which in artifact.inputs:
            assert name in before, f"{artifact.name} is made from {name}, which is not before it"
            assert (which == "once") == (not before[name].animated), f"{artifact.name}: {name} {which}"
            assert not before[name].export, f"{artifact.name} reads {name}, which is for others"
            assert list(FOLDERS).index(before[name].stage) <= list(FOLDERS).index(artifact.stage)
        assert artifact.export == (artifact.name == "animation")
    pictures = {artifact.name for artifact in artifacts if artifact.stage == "render"}
    panels = METHOD.panels(one)
    assert len(panels) == len(one.figure.panels)
    shown = {name for panel in panels for name in (panel.artifact, panel.still, panel.inset) if name}
    assert shown <= pictures
    assert pictures <= shown | {"beauty"}, "a picture that nothing shows"


@pytest.mark.parametrize(("file", "quick"), PROJECT, ids=lambda value: getattr(value, "stem", f"quick={value}"))
def test_artifacts_follow_their_inputs_and_every_panel_has_its_picture(file: Path, quick: bool) -> None:
    loaded = load(file, quick)
    assert loaded.method is METHOD
    for one in loaded.variants.values():
        require_whole(one)


PANELS = ('["result"]', '["exemplar"]', '["result"]\ninset = true', '["coarse"]', '["exemplar", "coarse", "result"]')


@pytest.mark.parametrize(("text", "panels"), [
    *((text, panels) for text in (BEADS, NOODLES, PAPER) for panels in PANELS),
    *((FISH, panels) for panels in PANELS if "coarse" not in panels)])
def test_so_do_those_of_every_kind_with_all_panels(tmp_path: Path, text: str, panels: str) -> None:
    require_whole(scene(tmp_path, changed(text, '["result"]', panels)))


@pytest.mark.parametrize(("text", "expected"), [
    (BEADS, ["exemplar", "L", "elements", "mesh", "animation", "beauty"]),
    (FISH, ["exemplar", "elements", "mesh", "animation", "beauty"]),
    (NOODLES, ["exemplar", "coarse", "elements", "mesh", "animation", "beauty"]),
    (PAPER, ["exemplar", "coarse", "elements", "mesh", "animation", "beauty"]),
])
def test_what_a_scene_is_made_of(tmp_path: Path, text: str, expected: list[str]) -> None:
    assert [artifact.name for artifact in METHOD.artifacts(scene(tmp_path, text))] == expected


def test_obstacles_come_first(tmp_path: Path) -> None:
    ball = '[[obstacles]]\nkind = "ball"\ncentre = [0.0, 0.5, 0.0]\nradius = 0.1\n[render]'
    among = METHOD.artifacts(scene(tmp_path, changed(FISH, "[render]", ball)))
    assert [artifact.name for artifact in among][:3] == ["solid", "exemplar", "elements"]
    assert [artifact.name for artifact in among if "solid" in dict(artifact.inputs)] == ["elements", "beauty"]


def test_a_file_of_the_users_is_read_before_anything_is_made(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("0,1,2,3,4\n")
    first = METHOD.artifacts(scene(tmp_path, TRACKS.replace("FILE", "a.csv")))[0]
    assert (first.name, first.reads[0], first.inputs, first.animated) == ("exemplar", "exemplar", (), False)
