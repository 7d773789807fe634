"""What `flowloom list` shows: which scenes, in which order, and what is marked."""

from pathlib import Path

import pytest
from tiny import SMOKE, changed, written

from pipeline import listing
from pipeline.errors import BadInput
from pipeline.tables import PROJECT_SCENES


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two scenes, one broken one between them, and a file that is none."""
    written(tmp_path, SMOKE, "a.toml")
    written(tmp_path, "title = ", "broken.toml")
    written(tmp_path, changed(SMOKE, 'source = "a test"\n', ""), "long-name.toml")
    (tmp_path / "notes.txt").write_text("no scene")
    return tmp_path


def test_every_scene_has_its_line_and_a_broken_one_hides_no_other(folder: Path) -> None:
    first, broken, last = listing.lines(folder, folder / "out")
    assert first == "  a          A tiny circle (a test)"
    assert broken.startswith(f"! broken     {folder / 'broken.toml'}: is not TOML: ")
    assert last == "  long-name  A tiny circle"


@pytest.mark.parametrize(("file", "marked"), [
    ("a/a.png", ["a"]),
    ("long-name/long-name.png", ["long-name"]),
    ("a/long-name.png", []),
    ("a/a.mp4", []),
    ("quick/a/a.png", []),
    ("a.png", []),
])
def test_a_star_means_that_this_scenes_figure_is_there(folder: Path, file: str, marked: list[str]) -> None:
    there = folder / "out" / file
    there.parent.mkdir(parents=True)
    there.touch()
    told = listing.lines(folder, folder / "out")
    assert [line.split()[1] for line in told if line.startswith("*")] == marked


def test_a_title_is_that_of_the_first_variant(folder: Path) -> None:
    variants = '[variants]\n"one" = { title = "First" }\n"two" = { title = "Second" }\n'
    written(folder, SMOKE + variants, "a.toml")
    assert next(listing.lines(folder, folder / "out")) == "  a          First (a test)"


def test_a_folder_without_scenes_is_bad_input(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").touch()
    for empty in (tmp_path, tmp_path / "missing"):
        with pytest.raises(BadInput, match="holds no scenes") as refused:
            list(listing.lines(empty, tmp_path))
        assert refused.value.file == empty


def test_the_projects_scenes_are_sorted_and_what_is_listed_without_a_folder(tmp_path: Path) -> None:
    scenes = listing.project_scenes()
    assert scenes == sorted(scenes)
    assert {scene.name for scene in scenes} == {p.name for p in PROJECT_SCENES.iterdir() if p.suffix == ".toml"}
    assert [line.split()[0] for line in listing.lines(None, tmp_path)] == [scene.stem for scene in scenes]
