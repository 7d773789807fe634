"""Scenes: what is accepted, and one line `file: key: reason` for what is not."""

import os
from pathlib import Path

import pytest

from pipeline import schema
from pipeline.errors import BadInput
from pipeline.scene import folder_name, load

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


def written(folder: Path, text: str = GOOD, name: str = "tiny.toml") -> Path:
    """A scene file with `text`."""
    file = folder / name
    file.write_text(text)
    return file


def complaint(file: Path) -> str:
    """The line that loading `file` ends with."""
    with pytest.raises(BadInput) as caught:
        load(file)
    line = str(caught.value)
    assert line.startswith(f"{file}: ")
    assert "\n" not in line
    return line.removeprefix(f"{file}: ")


def test_a_good_scene_is_read_with_its_defaults(tmp_path: Path) -> None:
    scene = load(written(tmp_path)).variants[""]
    assert scene.exemplar.kind == "heart"
    assert scene.detail.size == (32, 32)
    assert scene.detail.neighborhoods == (17, 9)
    assert scene.combine.omega == 1.5


def test_quick_overrides_apply_only_when_asked_for(tmp_path: Path) -> None:
    file = written(tmp_path)
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
    ("size = [32, 32]", "size = [32, 32, 32]", "detail.size: should have at most 2 items, not 3"),
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
    assert old in GOOD
    assert complaint(written(tmp_path, GOOD.replace(old, new, 1))).startswith(expected)


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
    assert scene.exemplar.file == schema.PROJECT_SCENES / "assets" / "lightning.png"


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
    assert "a scene's name has" in complaint(written(tmp_path, name=name))


def test_a_missing_scene_is_bad_input(tmp_path: Path) -> None:
    assert complaint(tmp_path / "none.toml").startswith("no such scene")
    (tmp_path / "folder.toml").mkdir()
    assert complaint(tmp_path / "folder.toml").startswith("cannot be read")
