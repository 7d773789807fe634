"""Sheets of clips: of a library, of a scene, of the catalogue."""

from pathlib import Path

import footage
import pytest
import tiny
from footage import falling
from tiny import PHOTO

from pipeline import cli
from pipeline.files import pictures
from pipeline.photo import sheet


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_library_is_on_one_sheet(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("a.mp4", "b.mp4", "c.mp4"):
        cli.run(["clips", "add", str(footage.write(home / name, falling(8 + ord(name[0]))))])
    capsys.readouterr()
    assert cli.run(["clips", "sheet", "--into", "clips", "--out", "three.png"]) == 0
    assert capsys.readouterr().out == "three.png\n"
    three = pictures.read(home / "three.png")
    for name in ("b", "c"):
        (home / f"clips/{name}.json").unlink()
    cli.run(["clips", "sheet", "--into", "clips"])
    one = pictures.read(home / "clips.png")
    assert three.shape[0] > 1.8 * one.shape[0] - 20 and three.shape[1] > 1.8 * one.shape[1] - 20


def test_a_scenes_clips_are_made_and_shown(home: Path) -> None:
    tiny.written(home, PHOTO)
    assert cli.run(["clips", "sheet", "tiny.toml", "--quiet"]) == 0
    assert pictures.read(home / "clips.png").std() > 0.1
    assert [file.name for file in (home / "out/shared").glob("*/*.npz")] == ["clip-cloud-01.npz"]
    assert not (home / "out/tiny").exists()


def test_what_has_no_sheet_is_one_line(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    tiny.written(home, PHOTO)
    for arguments, told in ((["--into", "none"], "none: is no clip library: flowloom clips add makes one\n"),
                            (["tiny.toml", "--into", "clips"], "clips sheet: shows a scene or a folder, not both\n")):
        assert cli.run(["clips", "sheet", *arguments]) == 2
        assert capsys.readouterr().err == told
    assert not (home / "clips.png").exists()


def test_the_catalogue_is_shown_in_colour_where_a_clip_has_some() -> None:
    """The first nine are of all families, fire among them."""
    shown = sheet.of_catalogue(tiny.QUIET)
    found = dict(next(shown) for _ in range(9))
    assert found["fire-01"].shape == (32, 120, 160, 3)
    assert found["fall-01"].shape == (32, 120, 160)
