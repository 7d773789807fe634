"""Scenes of elements: what is accepted, and one line `file: key: reason` for what is not."""

from pathlib import Path

import pytest
from tiny import BEADS, FISH, NOODLES, PAPER, TRACKS, changed, complaint, written

from pipeline.elements.scene import Scene
from pipeline.scene import load
from pipeline.tables import PROJECT_SCENES


def test_a_table_of_elements_makes_it_a_scene_of_them_with_its_defaults(tmp_path: Path) -> None:
    scene = load(written(tmp_path, BEADS)).variants[""]
    assert isinstance(scene, Scene)
    assert (scene.dimension, scene.shape, scene.flows, scene.seed, scene.fps) == (2, (32, 32), True, 1, 24)
    assert (scene.elements.count, scene.synthesis.neighborhood, scene.synthesis.sequence) == (0, 2.0, "together")


@pytest.mark.parametrize("text", [BEADS, FISH, NOODLES, PAPER])
def test_each_kind_of_element_has_its_scene(tmp_path: Path, text: str) -> None:
    assert load(written(tmp_path, text)).variants[""].frames == 3


def test_quick_and_variants_hold_for_them_too(tmp_path: Path) -> None:
    text = BEADS + '[quick]\n"elements.spacing" = 0.2\n[variants."a"]\n[variants."b"]\n"exemplar.across" = 8\n'
    quick = load(written(tmp_path, text), quick=True).variants
    assert [scene.exemplar.across for scene in quick.values()] == [6, 8]
    assert all(scene.elements.spacing == 0.2 for scene in quick.values())
    bad = BEADS + '[quick]\n"elements.spacnig" = 0.2\n'
    assert complaint(written(tmp_path, bad)) == 'quick."elements.spacnig": unknown key; did you mean spacing?'


ROUND = 'domain = { kind = "ball", centre = CENTRE, radius = 0.3 }'


@pytest.mark.parametrize(("text", "old", "new", "expected"), [
    # keys and kinds
    (BEADS, "across", "acros", "exemplar.acros: unknown key; did you mean across?"),
    (BEADS, "hexagonal-grid", "hexagon", "exemplar.kind: unknown kind 'hexagon'; did you mean hexagonal-grid?"),
    (BEADS, "spacing = 0.12", "spacing = 0.0", "elements.spacing: should be greater than 0, not 0.0"),
    (BEADS, "spacing = 0.12", 'along = "flows"', "elements.along: 'flows' is not one of them; did you mean flow?"),
    (BEADS, "spacing = 0.12", "count = -1", "elements.count: should be greater than or equal to 0, not -1"),
    (BEADS, "spacing = 0.12", "pins = [{ frame = 2 }]", "elements.pins[0].at: is missing"),
    (BEADS, "spacing = 0.12", 'selections = [{ kinds = [], file = "a.png" }]', "elements.selections[0].kinds: "),
    (BEADS, "spacing = 0.12", 'selections = [{ kinds = [0], file = "../a.png" }]',
     "elements.selections[0].file: '../a.png' leaves the scene's folder"),
    (BEADS, "iterations = 2", "iteration = 2", "synthesis.iteration: unknown key; did you mean iterations?"),
    (BEADS, "iterations = 2", "matches = 9", "synthesis.matches: should be less than or equal to 4, not 9"),
    (BEADS, "[render]\nkind = \"beads\"\nwidth = 32\nspp = 1\n", "", "render: is missing"),
    (BEADS, '["result"]', '["resalt"]', "figure.panels[0]: 'resalt' is not one of them; did you mean result?"),
    (BEADS, "frames = 3", "frames = 0", "frames: should be greater than or equal to 1, not 0"),
    (BEADS, "[render]", "[detail]\nsize = [8, 8]\n[render]", "detail: unknown key"),
    # exemplar, coarse motion and picture
    (BEADS, 'kind = "beads"', 'kind = "noodles"', 'render.kind: "noodles" draws no hexagonal-grid: say "beads"'),
    (FISH, 'render]\nkind = "school"', 'render]\nkind = "paper"', 'render.kind: "paper" draws no school: say "school"'),
    (NOODLES, '[coarse]\nkind = "lifted"\n', "", "coarse: of noodles is one of lifted, tracks"),
    (NOODLES, '"lifted"', '"gust"', "coarse.kind: of noodles is one of lifted, tracks"),
    (PAPER, '"gust"', '"analytic"', "coarse.kind: of paper is one of gust, tracks"),
    (BEADS, '"analytic"\nflow = "rotation"\nsize = [16, 16]', '"gust"',
     'coarse.kind: "gust" carries threads or sheets, no beads'),
    (BEADS, "size = [32, 32]", "size = [32, 32, 32]", "elements.size: is 32×32×32; beads lie in the plane"),
    (FISH, "size = [16, 16, 16]", "size = [16, 16]",
     "elements.size: is 16×16; school needs three numbers: it is in space"),
    (BEADS, "size = [16, 16]", "size = [16, 24]", "elements.size: 32×32 has not the shape of coarse.size, 16×24"),
    (BEADS, "size = [16, 16]", "size = [16, 16, 16]", "coarse.size: 16×16×16 has not as many axes as elements.size"),
    (BEADS, '"analytic"\nflow = "rotation"', '"wake"', 'coarse.kind: "wake" needs a stone'),
    (BEADS, '["result"]', '["result"]\nframe = 4', "figure.frame: the animation has 3 frames"),
    (FISH, '["result"]', '["coarse"]', 'figure.panels: there is no "coarse" without a [coarse]'),
    (BEADS, '["result"]', '["result"]\nlabels = ["a", "b"]', "figure.labels: 2 labels, but 1 panel"),
    (FISH, "frames = 3", "frames = 1", "frames: an animation of school has 2 or more, not 1"),
    (BEADS, "frames = 3", "frames = 3\nfps = 0.5", "fps: should be greater than or equal to 1, not 0.5"),
    (BEADS, "iterations = 2", "neighborhood = 0.5", "synthesis.neighborhood: should be greater than or equal to 1"),
    # places
    (BEADS, "spacing = 0.12", "pins = [{ at = [0.0, 0.5, 0.0] }]",
     "elements.pins[0].at: has 3 coordinates; elements.size is 32×32"),
    (BEADS, "spacing = 0.12", "pins = [{ at = [0.0, 0.5] }, { at = [0.0, 0.5], frame = 4 }]",
     "elements.pins[1].frame: the animation has 3 frames"),
    (BEADS, "spacing = 0.12", ROUND.replace("CENTRE", "[0.0, 0.5, 0.0]"),
     "elements.domain.centre: has 3 coordinates; elements.size is 32×32"),
    (BEADS, "spacing = 0.12", ROUND.replace("CENTRE", "[0.0, 0.5]").replace("0.3", "[0.3, 0.2]"),
     "elements.domain.radius: has 2 numbers for a ball"),
    (FISH, "spacing = 0.3", 'along = "flow"', 'elements.along: "flow" needs a [coarse] that is a field'),
    # frames before and after
    (BEADS, "iterations = 2", 'sequence = "frames"\nafter = 1',
     'synthesis.after: is 0 with sequence = "frames": later frames are not there yet (figure 3)'),
    # what threads and sheets do not heed
    (NOODLES, "count = 4", "pins = [{ at = [0.0, 0.5, 0.0] }]",
     "elements.pins: applies to points only; noodles follow their [coarse] motion"),
    (NOODLES, "count = 4", "toroidal = true", "elements.toroidal: applies to points only"),
    (NOODLES, "count = 4", ROUND.replace("CENTRE", "[0.0, 0.5]"), "elements.domain: applies to points only"),
    (NOODLES, "count = 4", 'along = "centre"', "elements.along: applies to points only"),
    (PAPER, "[render]", '[[obstacles]]\nkind = "ball"\ncentre = [0.0, 0.5]\nradius = 0.1\n[render]',
     "obstacles: applies to points only; paper follow their [coarse] motion"),
    (PAPER, "iterations = 1", 'sequence = "frames"',
     'synthesis.sequence: "frames" is for points; of paper all frames are synthesized together'),
])
def test_what_is_wrong_is_named_in_one_line(tmp_path: Path, text: str, old: str, new: str, expected: str) -> None:
    assert complaint(written(tmp_path, changed(text, old, new))).startswith(expected)


@pytest.mark.parametrize(("text", "old", "new", "expected"), [
    (NOODLES, 'style = "jagged"\nframes = 4', 'file = "a.csv"\ncaptured = true',
     "exemplar.captured: is for points, not for noodles"),
    (NOODLES, 'count = 4\n[coarse]\nkind = "lifted"', 'count = 4\n[coarse]\nkind = "tracks"\nfile = "a.csv"',
     "elements.count: is that of coarse.file"),
])
def test_what_tracks_of_the_users_do_not_go_with(tmp_path: Path, text: str, old: str, new: str, expected: str) -> None:
    (tmp_path / "a.csv").write_text("0,1,2,3,4\n")
    if "captured" in new:
        text = changed(text, '"noodles"', '"tracks"')
    assert complaint(written(tmp_path, changed(text, old, new))) == expected


def test_tracks_may_be_a_folder_whose_files_stay_inside(tmp_path: Path) -> None:
    home = tmp_path / "home"
    (home / "school").mkdir(parents=True)
    (home / "school" / "fish.1.ply").write_text("ply")
    scene = load(written(home, TRACKS.replace("FILE", "school"))).variants[""]
    assert scene.exemplar.file == home / "school"
    (tmp_path / "secret.ply").write_text("ply")
    (home / "school" / "fish.2.ply").symlink_to("../../secret.ply")
    assert complaint(written(home, TRACKS.replace("FILE", "school"))) == (
        "exemplar.file: 'school/fish.2.ply' is a link that leaves its folder")
    for file, expected in (("..", "leaves the scene's folder"), ("gone", "no file 'gone'")):
        assert expected in complaint(written(home, TRACKS.replace("FILE", file)))
    (home / "out").symlink_to(tmp_path)
    assert "is a link that leaves the scene's folder" in complaint(written(home, TRACKS.replace("FILE", "out")))


def test_the_readmes_example_is_a_whole_scene(tmp_path: Path) -> None:
    text = (PROJECT_SCENES / "README.md").read_text().split("## Scenes of elements\n")[1].split("\n## ")[0]
    example = [line.removeprefix("    ") for line in text.splitlines() if line.startswith("    ")]
    scene = load(written(tmp_path, "\n".join(example))).variants[""]
    assert isinstance(scene, Scene)
    assert (scene.exemplar.kind, scene.render.kind, scene.flows) == ("hexagonal-grid", "beads", True)
