"""Scenes: what is accepted, and one line `file: key: reason` for what is not."""

import os
from pathlib import Path
from typing import get_args

import pytest
from tiny import BEADS, changed, complaint, written

from pipeline.build.graph import folder_name
from pipeline.build.method import Method
from pipeline.methods import METHODS
from pipeline.scene import load
from pipeline.schema import branches
from pipeline.tables import PROJECT_SCENES

GOOD = """\
title = "A small heart"
frames = 4
[exemplar]
kind = "heart"
size = 16
[coarse]
kind = "smoke"
size = [16, 16]
[detail]
size = [32, 32]
[combine]
omega = 1.5
[render]
kind = "lit"
width = 64
[quick]
"detail.size" = [16, 16]
"""


def test_a_good_scene_is_read_with_its_defaults(tmp_path: Path) -> None:
    scene = load(written(tmp_path, GOOD)).variants[""]
    assert scene.exemplar.kind == "heart"
    assert scene.detail.size == (32, 32)
    assert scene.detail.neighborhoods == (17, 9)
    assert scene.combine.omega == 1.5


def test_quick_overrides_apply_only_when_asked_for(tmp_path: Path) -> None:
    file = written(tmp_path, GOOD)
    assert load(file).variants[""].detail.size == (32, 32)
    assert load(file, quick=True).variants[""].detail.size == (16, 16)


@pytest.mark.parametrize(("old", "new", "expected"), [
    ("size = 16\n", "sise = 16\n", "exemplar.sise: unknown key; did you mean size?"),
    ("frames = 4", "frame = 4", "frame: unknown key; did you mean frames?"),
    ("[render]", "[rendr]", "rendr: unknown key; did you mean render?"),
    ('"heart"', '"hart"', "exemplar.kind: unknown kind 'hart'; did you mean heart?"),
    ('kind = "lit"\n', "", "render.kind: is missing"),
    ("omega = 1.5", "", "combine.omega: is missing"),
    ('title = "A small heart"\n', "", "title: is missing"),
    ("omega = 1.5", 'omega = "much"', "combine.omega: should be a valid number, not 'much'"),
    ("omega = 1.5", "omega = true", "combine.omega: should be a valid number, not True"),
    ("omega = 1.5", "omega = nan", "combine.omega: should be a finite number, not nan"),
    ("omega = 1.5", "omega = inf", "combine.omega: should be a finite number, not inf"),
    ("omega = 1.5", "omega = -1", "combine.omega: should be greater than or equal to 0, not -1"),
    ("size = [32, 32]", "size = [32, 32.5]", "detail.size[1]: should be a valid integer, not 32.5"),
    ("size = [32, 32]", "size = 32", "detail.size: should be an array, not 32"),
    ("size = [32, 32]", "size = [32, 32, 32, 32]", "detail.size: should have at most 3 items, not 4"),
    ("size = [32, 32]", "size = [32, 32, 32]", "coarse.size: 16×16 has not as many axes as detail.size, 32×32×32"),
    ("[render]", "[[views]]\nplane = 'top'\n[render]", "views: needs a field in space; detail.size is 32×32"),
    ("[render]", "[[views]]\nplan = 'top'\n[render]", "views[0].plan: unknown key; did you mean plane?"),
    ("size = [32, 32]", "size = [32, 32]\nfacing = 'density'", "detail.facing: needs a field in space"),
    ("size = [32, 32]", "size = [32, 32]\nsamples = 'lagrangian'\nsearch = 'k-coherence'",
     "detail.search: samples that move have no fixed neighbours"),
    ("size = [32, 32]", "size = [32, 32]\nsamples = 'lagrangian'\nsynthesize = 'potential'",
     "detail.synthesize: the potential is synthesized on the grid only"),
    ("size = [32, 32]", "facing = 'directions'", "detail.facing: needs a field in space"),
    ("[render]", "[figure]\nplane = 'top'\n[render]", "figure.plane: needs a field in space"),
    ('kind = "lit"', 'kind = "seaweed"', "render.kind: \"seaweed\" needs a field in space; detail.size is 32×32"),
    ("[render]", "[blades]\ncover = 1.5\n[render]", "blades.cover: should be less than or equal to 1, not 1.5"),
    ("[render]", "[[density.sources]]\ncentre = [0.0, 0.1, 0.0]\n[render]",
     "density.sources[0].centre: needs a field in space"),
    ("[render]", "[[density.sources]]\nradius = 0.0\n[render]", "density.sources[0].radius[0]: should be greater"),
    ("size = [32, 32]", "size = [32, 100000]", "detail.size[1]: should be less than or equal to 4096, not 100000"),
    ("size = [32, 32]", "levels = 0", "detail.levels: "),
    ("size = [32, 32]", 'levels = "some"', "detail.levels: "),
    ("size = [32, 32]", "neighborhoods = [8]", "detail.neighborhoods[0]: should be odd, not 8"),
    ("frames = 4", "frames = 0", "frames: should be greater than or equal to 1, not 0"),
    ("frames = 4", "frames = 4.0", "frames: should be a valid integer, not 4.0"),
    ("frames = 4", "seed = -1", "seed: should be greater than or equal to 0, not -1"),
    ('kind = "heart"', 'kind = "heart"\nfile = "a.png"', "exemplar.file: unknown key; known: kind, size"),
    ("[detail]", "[detail.deep]\na = 1\n[detail]", "detail.deep: unknown key"),
    ("size = 16\n", "size = 64\n", "exemplar.size: an exemplar of 64² is larger than the output (32×32)"),
    ("size = [32, 32]", "size = [32, 48]", "detail.size: 32×48 has not the shape of coarse.size, 16×16"),
    ("size = [32, 32]", "levels = 4", "detail.levels: 4 levels bring an exemplar of 16² below 4 cells"),
    ("[render]", "[figure]\nframe = 5\n[render]", "figure.frame: the animation has 4 frames"),
    ("[render]", '[figure]\npanels = ["resalt"]\n[render]', "figure.panels[0]: "),
    ('kind = "lit"', 'kind = "volume"', "render.kind: "),
    ("title = ", "title == ", "is not TOML: "),
    ("frames = 4", "frames = 4\nframes = 5", "is not TOML: "),
])
def test_what_is_wrong_is_named_in_one_line(tmp_path: Path, old: str, new: str, expected: str) -> None:
    assert complaint(written(tmp_path, changed(GOOD, old, new))).startswith(expected)


SOLID = """\
title = "A small heart in space"
frames = 2
[exemplar]
kind = "heart"
size = 16
[coarse]
kind = "smoke"
size = [8, 16, 8]
[detail]
size = [16, 32, 16]
[combine]
omega = 1.5
[render]
kind = "volume"
VIEWS
"""
TOP, SIDE, OBLIQUE = ("[[views]]\n" + keys + "\n" for keys in (
    'plane = "top"', 'plane = "side"', "right = [1.0, 1.0, 0.0]\nup = [0.0, 0.0, 1.0]"))


@pytest.mark.parametrize("views", ["", TOP + SIDE, TOP + OBLIQUE, TOP + "weight = 3.0\n" + SIDE + (
    'exemplar = { kind = "stripes", size = 8 }')])
def test_a_good_scene_in_space(tmp_path: Path, views: str) -> None:
    scene = load(written(tmp_path, SOLID.replace("VIEWS", views))).variants[""]
    assert (scene.dimension, scene.shape) == (3, (16, 32, 16))
    assert scene.detail.neighborhoods == (9,)
    assert [view.exemplar.size for view in scene.seen] == ([16, 8] if "stripes" in views else [16] * len(scene.seen))
    assert len(scene.seen) == (views.count("[[views]]") or 3)


@pytest.mark.parametrize(("views", "expected"), [
    (TOP, "views: do not span space: none of them shows y of the local frame"),
    (TOP + TOP, "views: do not span space: none of them shows y of the local frame"),
    ("[[views]]\nright = [1.0, 1.0, 0.0]\nup = [0.0, 0.0, 1.0]", "views: do not span space: none of them"),
    (TOP + "[[views]]", "views[1]: needs a plane, or both right and up"),
    (TOP + "[[views]]\nup = [0.0, 1.0, 0.0]", "views[1]: needs a plane, or both right and up"),
    (TOP + "[[views]]\nright = [0.0, 2.0, 0.0]\nup = [0.0, 1.0, 0.0]", "views[1].up: is parallel to right"),
    (TOP + "[[views]]\nright = [0.0, 0.0, 0.0]\nup = [0.0, 1.0, 0.0]", "views[1].up: is parallel to right"),
    (TOP + SIDE + "up = [0.0, 1.0, 0.0]", "views[1].plane: says what right and up say too: leave one out"),
    (TOP + SIDE + 'exemplar = { kind = "heart", size = 24 }',
     "views[1].exemplar.size: an exemplar of 24² is larger than the output (16×32×16) along an axis of its view"),
    (TOP + SIDE + 'exemplar = { kind = "heart", sise = 24 }', "views[1].exemplar.sise: unknown key; did you mean"),
    (TOP + SIDE + 'exemplar = { kind = "hart" }', "views[1].exemplar.kind: unknown kind 'hart'; did you mean heart?"),
    (TOP + SIDE + "weight = 0.0", "views[1].weight: should be greater than 0, not 0.0"),
    (TOP + SIDE + 'exemplar = { kind = "heart", size = 8 }\n[variants.a]\n"detail.levels" = 3',
     'variants."a"."detail.levels": 3 levels bring an exemplar of 8² below 4 cells'),
    ("[density]\ndepth = {}", "density.depth: gives a plane a body; detail.size is 16×32×16, which has one"),
    ('[variants.a]\nrender = { kind = "lit" }', 'variants."a"."render".kind: "lit" renders 2-D fields only'),
    ('[variants.a]\n"detail.synthesize" = "potential"', 'variants."a"."detail.synthesize": "potential" is for a field'),
    ('[variants.a]\n"detail.samples" = "lagrangian"', 'variants."a"."detail.samples": "lagrangian" is for a field'),
    ('[variants.a]\n"detail.size" = [16, 32, 8]', 'variants."a"."detail.size": 16×32×8 has not the shape of'),
    ('[variants.a]\n"detail.facing" = "directions"', "variants.\"a\": detail.directions: is missing"),
    ("[[detail.directions]]\nat = [0.0, 0.5, 0.0]\nvector = [0.0, 0.0, 1.0]",
     'detail.directions: is not used with facing = "camera"'),
    ('[variants.a]\n"detail.facing" = "directions"\n"detail.directions" = [{ at = [0.0, 0.5, 0.0], vector = '
     '[0.0, 0.0, 0.0] }]', 'variants."a"."detail.directions"[0].vector: is zero: it faces nowhere'),
])
def test_what_is_wrong_in_space_is_named_in_one_line(tmp_path: Path, views: str, expected: str) -> None:
    assert complaint(written(tmp_path, SOLID.replace("VIEWS", views))).startswith(expected)


def test_exemplars_of_different_scale_are_refused(tmp_path: Path) -> None:
    text = SOLID.replace("[8, 16, 8]", "[16, 16, 16]").replace("[16, 32, 16]", "[64, 64, 64]")
    views = TOP + 'exemplar = { kind = "square", size = SIZE }\n' + SIDE + 'exemplar = { kind = "stripes", size = 8 }'
    load(written(tmp_path, text.replace("VIEWS", views).replace("SIZE", "32")))
    assert complaint(written(tmp_path, text.replace("VIEWS", views).replace("SIZE", "48"))) == (
        "views[0].exemplar.size: an exemplar of 48² beside one of 8²: at most 4 times as large")


@pytest.mark.parametrize(("line", "expected"), [
    ('"detail.sise" = [16, 16]', 'quick."detail.sise": unknown key; did you mean size?'),
    ('"coarse.size" = [16, "a"]', "quick.\"coarse.size\"[1]: should be a valid integer, not 'a'"),
    ('"detial.size" = [16, 16]', 'quick."detial.size": unknown key; did you mean detail?'),
    ('"frames.of" = 3', 'quick."frames.of": frames is not a table'),
    ('"exemplar.size" = 32', "quick.\"exemplar.size\": an exemplar of 32² is larger than the output (16×16)"),
    ('"coarse.kind" = "smok"', 'quick."coarse.kind": '),
])
def test_quick_is_checked_as_strictly_even_when_it_is_not_used(tmp_path: Path, line: str, expected: str) -> None:
    assert complaint(written(tmp_path, f"{GOOD}{line}\n")).startswith(expected)


def test_a_fault_that_only_overrides_bring_about_says_so(tmp_path: Path) -> None:
    text = GOOD.replace('"detail.size" = [16, 16]', '"detail.size" = [12, 12]')
    assert complaint(written(tmp_path, text)) == (
        "quick: exemplar.size: an exemplar of 16² is larger than the output (12×12)")


def test_variants_are_scenes_of_their_own_and_win_over_quick(tmp_path: Path) -> None:
    text = GOOD + '"density.m" = 2\n[variants."m = 4"]\n"density.m" = 4\n[variants."m = 8"]\n"density.m" = 8\n'
    quick = load(written(tmp_path, text), quick=True).variants
    assert {name: scene.density.m for name, scene in quick.items()} == {"m = 4": 4, "m = 8": 8}
    assert all(scene.detail.size == (16, 16) for scene in quick.values())


@pytest.mark.parametrize(("tables", "expected"), [
    ('[variants."m = 4"]\n"density.n" = 4', 'variants."m = 4"."density.n": unknown key'),
    ('[variants."m = 4"]\n"density.m" = 0', 'variants."m = 4"."density.m": should be greater than or equal to 1'),
    ('[variants]\na = 3', 'variants."a": is not a table'),
    ('[variants."***"]', 'variants."***": its name needs a letter or a digit'),
    ('[variants."m 4"]\n[variants."m=4"]', 'variants."m=4": shares the folder m-4 with \'m 4\''),
])
def test_variants_are_checked_as_strictly(tmp_path: Path, tables: str, expected: str) -> None:
    assert complaint(written(tmp_path, f"{GOOD}{tables}\n")).startswith(expected)


ONE_FIGURE = GOOD + '[variants."first"]\n[variants."other"]\n'


@pytest.mark.parametrize(("line", "expected"), [
    ('"figure.frame" = 2', '"figure.frame": is 2, and 0 in'),
    ('"figure.animation" = false', '"figure.animation": is false, and true in'),
    ('"figure.webp" = true', '"figure.webp": is true, and false in'),
    ('"figure.columns" = 3', '"figure.columns": is 3, and 0 in'),
    ('"fps" = 12.5', '"fps": is 12.5, and 30 in'),
    ("figure = { frame = 2 }", '"figure.frame": is 2, and 0 in'),
])
def test_variants_that_want_the_one_figure_in_two_ways_are_refused(tmp_path: Path, line: str, expected: str) -> None:
    assert complaint(written(tmp_path, ONE_FIGURE + line)) == (
        f'variants."other".{expected} variants."first": a file has one figure')


def test_variants_are_of_one_figure_at_their_quick_settings_too(tmp_path: Path) -> None:
    quick = changed(GOOD, "[quick]\n", '[figure]\nframe = 3\n[quick]\n"figure.frame" = 2\n')
    assert complaint(written(tmp_path, quick + '[variants."first"]\n[variants."other"]\n"figure.frame" = 3\n')) == (
        'variants."other"."figure.frame": is 3, and 2 in variants."first": a file has one figure')


def test_variants_that_agree_on_their_figure_may_differ_in_the_rest_of_it(tmp_path: Path) -> None:
    same = '"figure.frame" = 2\n"figure.animation" = false\n'
    text = GOOD + f'[variants."first"]\n{same}[variants."other"]\n{same}"frames" = 3\n"figure.panel" = 64\n'
    assert [one.figure.panel for one in load(written(tmp_path, text)).variants.values()] == [512, 64]


@pytest.mark.parametrize(("text", "old", "kind", "expected"), [
    (GOOD, "lit", "lite", "unknown kind 'lite'; did you mean lit?"),
    (GOOD, "lit", "particle", "unknown kind 'particle'; did you mean particles?"),
    (GOOD, "lit", "smoke", "unknown kind 'smoke'; known: lit, ink, volume, particles, seaweed, none"),
    (GOOD, "lit", "beads", "unknown kind 'beads'; known: lit, ink, volume, particles, seaweed, none"),
    (BEADS, "beads", "bead", "unknown kind 'bead'; did you mean beads?"),
    (BEADS, "beads", "shoal", "unknown kind 'shoal'; did you mean school?"),
    (BEADS, "beads", "smoke", "unknown kind 'smoke'; known: beads, school, noodles, paper"),
    (BEADS, "beads", "lit", "unknown kind 'lit'; known: beads, school, noodles, paper"),
])
def test_an_unknown_look_is_an_error_with_a_suggestion(tmp_path: Path, text: str, old: str, kind: str,
                                                       expected: str) -> None:
    look = f'[render]\nkind = "{kind}"'
    assert complaint(written(tmp_path, changed(text, f'[render]\nkind = "{old}"', look))) == f"render.kind: {expected}"
    variant = text + f'[variants."first"]\n[variants."other"]\n"render.kind" = "{kind}"\n'
    assert complaint(written(tmp_path, variant)) == f'variants."other"."render.kind": {expected}'


@pytest.mark.parametrize("method", [m for m in METHODS if "render" in m.scene.model_fields],
                         ids=lambda method: method.name)
def test_every_look_draws_its_own_picture_and_none_falls_back_to_smoke(method: Method) -> None:
    for look in branches(method.scene.model_fields["render"].annotation):
        kinds = get_args(look.model_fields["kind"].annotation)
        assert len(kinds) == 1
        drawn = {name for name in vars(look) if name == "picture" or name.startswith("make_")}
        assert drawn or kinds == ("none",), f"{kinds[0]} has the picture of another look"


def test_an_override_may_replace_a_whole_table(tmp_path: Path) -> None:
    text = GOOD + '[variants.noise]\ncoarse = { kind = "curl-noise", size = [16, 16], speed = 0.5 }\n'
    assert load(written(tmp_path, text)).variants["noise"].coarse.kind == "curl-noise"


@pytest.mark.parametrize(("name", "folder"), [
    ("m = 4", "m-4"), ("ω = 15", "omega-15"), ("Naïve?", "na-ve"), ("0.5", "0.5"), ("../up", "up"), ("a/b", "a-b"),
])
def test_a_variants_folder_is_a_plain_name(name: str, folder: str) -> None:
    assert folder_name(name) == folder


def bitmap(file: str) -> str:
    """GOOD with a bitmap exemplar."""
    return GOOD.replace('kind = "heart"', f'kind = "bitmap"\nfile = {file}')


def test_files_stand_in_the_scenes_folder_or_the_projects_assets(tmp_path: Path) -> None:
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep" / "mine.png").write_bytes(b"x")
    scene = load(written(tmp_path, bitmap('"deep/mine.png"'))).variants[""]
    assert scene.exemplar.file == tmp_path / "deep" / "mine.png"
    scene = load(written(tmp_path, bitmap('"assets/lightning.png"'))).variants[""]
    assert scene.exemplar.file == PROJECT_SCENES / "assets" / "lightning.png"


@pytest.mark.parametrize(("file", "expected"), [
    ('"../secret.png"', "leaves the scene's folder"),
    ('"deep/../../secret.png"', "leaves the scene's folder"),
    ('"deep/../inside.png"', "leaves the scene's folder"),
    ('"/etc/passwd"', "leaves the scene's folder"),
    ('"link.png"', "is a link that leaves the scene's folder"),
    ('"linked/secret.png"', "is a link that leaves the scene's folder"),
    ('"chain.png"', "is a link that leaves the scene's folder"),
    ('"loop.png"', ""),
    ('"missing.png"', "no file 'missing.png'"),
    ('"deep"', "is not a file"),
    ('""', "is not a file"),
    ('"a\\u0000b"', ""),
    ('"' + "a" * 5000 + '"', ""),
    ("3", "should be"),
])
def test_a_path_that_leaves_the_scenes_folder_or_leads_nowhere_is_refused(
        tmp_path: Path, file: str, expected: str) -> None:
    home = tmp_path / "home"
    (home / "deep").mkdir(parents=True)
    (tmp_path / "outside").mkdir()
    for place in (tmp_path, tmp_path / "outside", home):
        (place / ("inside.png" if place is home else "secret.png")).write_bytes(b"x")
    os.symlink("../secret.png", home / "link.png")
    os.symlink("link.png", home / "chain.png")
    os.symlink(tmp_path / "outside", home / "linked")
    os.symlink("loop.png", home / "loop.png")
    line = complaint(written(home, bitmap(file)))
    assert line.startswith("exemplar.file: ")
    assert expected in line


def test_a_link_that_stays_inside_is_followed(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(b"x")
    os.symlink("a.png", tmp_path / "b.png")
    assert load(written(tmp_path, bitmap('"b.png"'))).variants[""].exemplar.file == tmp_path / "a.png"


@pytest.mark.parametrize("content", [b"\xff\xfe", b"a = " + b"[" * 100000, b"\x00", b""])
def test_what_is_not_toml_is_refused_in_one_line(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "tiny.toml").write_bytes(content)
    complaint(tmp_path / "tiny.toml")


@pytest.mark.parametrize("name", ["Tiny.toml", "tiny.json", "a b.toml", "-a.toml"])
def test_a_scenes_name_is_a_plain_name(tmp_path: Path, name: str) -> None:
    assert "a scene's name has" in complaint(written(tmp_path, GOOD, name))


def test_a_missing_scene_is_bad_input(tmp_path: Path) -> None:
    assert complaint(tmp_path / "none.toml").startswith("no such scene")
    (tmp_path / "folder.toml").mkdir()
    assert complaint(tmp_path / "folder.toml").startswith("cannot be read")
