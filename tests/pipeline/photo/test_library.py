"""The library of own clips: what is added once stays, what is damaged is told and not used."""

import json
from pathlib import Path

import footage
import numpy as np
import pytest
import tiny
from footage import falling
from tiny import PHOTO, changed

from pipeline import cli
from pipeline.errors import BadInput, StorageFailed
from pipeline.photo import library
from pipeline.photo.own import read_own

SCENE = changed(PHOTO, "count = 1", 'count = 0\nlibrary = "clips"')


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory with a video, `My Pond.mp4`."""
    monkeypatch.chdir(tmp_path)
    footage.write(tmp_path / "My Pond.mp4", falling())
    return tmp_path


def spoilt(file: Path) -> None:
    content = bytearray(file.read_bytes())
    content[5000] ^= 1
    file.write_bytes(content)


def test_a_clip_is_kept_as_it_was_read_with_what_is_known_of_it(home: Path) -> None:
    entry, is_new = library.add(Path("My Pond.mp4"), Path("clips"))
    assert is_new
    luma = library.read(Path("clips/my-pond.npz"))
    np.testing.assert_array_equal(luma, read_own(Path("My Pond.mp4"), "").luma)
    assert (entry.name, entry.frames, entry.size, entry.fps) == ("my-pond", 24, (128, 96), 24)
    assert 1.5 < entry.speed < 4 and 0.2 < entry.moving < 0.6  # 3 pixels a frame in a quarter of the picture
    assert library.entries(Path("clips")) == [library._noted(Path("clips/my-pond.json"))]


def test_adding_it_twice_changes_nothing_and_mends_what_is_damaged(home: Path) -> None:
    library.add(Path("My Pond.mp4"), Path("clips"))
    before = tiny.contents(home / "clips")
    assert not library.add(Path("My Pond.mp4"), Path("clips"))[1]
    assert tiny.contents(home / "clips") == before
    spoilt(home / "clips/my-pond.npz")
    assert library.add(Path("My Pond.mp4"), Path("clips"))[1]
    assert tiny.contents(home / "clips") == before


def test_another_video_of_the_name_is_refused(home: Path) -> None:
    library.add(Path("My Pond.mp4"), Path("clips"))
    before = tiny.contents(home / "clips")
    footage.write(home / "my-pond.mp4", falling(12))
    with pytest.raises(BadInput, match=r"my-pond\.mp4: clips has a clip my-pond of another video, My Pond\.mp4"):
        library.add(Path("my-pond.mp4"), Path("clips"))
    assert tiny.contents(home / "clips") == before


def test_the_command_adds_what_is_good_and_tells_what_is_not(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    footage.write(home / "cut.mp4", np.concatenate([falling(12), 1 - falling(12)]))
    (home / "text.mp4").write_text("no video")
    assert cli.run(["clips", "add", "cut.mp4", "My Pond.mp4", "text.mp4", "none.mp4", "--into", "mine"]) == 2
    out, err = capsys.readouterr()
    assert out == "My Pond.mp4: is now mine/my-pond\n"
    assert err.splitlines() == ["cut.mp4: has a cut after frame 12", "text.mp4: damaged, or no video",
                                "none.mp4: no such file"]
    assert sorted(file.name for file in (home / "mine").iterdir()) == ["my-pond.json", "my-pond.npz"]
    assert cli.run(["clips", "add"]) == 2
    assert cli.run(["clips", "add", "My Pond.mp4", "--into", "mine"]) == 0
    assert "is already mine/my-pond" in capsys.readouterr().out


def test_the_list_tells_families_and_clips_and_what_is_damaged(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["clips", "list"]) == 0
    out = capsys.readouterr().out.splitlines()
    assert out[0].startswith("made: 150 clips: fall 40, white-water 30") and out[1:] == ["clips: 0 clips"]
    cli.run(["clips", "add", "My Pond.mp4"])
    footage.write(home / "brook.mp4", falling(16))
    cli.run(["clips", "add", "brook.mp4"])
    capsys.readouterr()
    assert cli.run(["clips", "list"]) == 0
    lines = capsys.readouterr().out.splitlines()[2:]
    assert [line.split()[:5] for line in lines] == [["brook", "16", "frames", "128", "x"],
                                                    ["my-pond", "24", "frames", "128", "x"]]
    spoilt(home / "clips/brook.npz")
    assert cli.run(["clips", "list"]) == 4
    out, err = capsys.readouterr()
    assert "brook    damaged" in out and "my-pond   24 frames" in out
    assert err == "clips/brook.npz: is damaged or gone; add brook.mp4 again, or delete brook.json\n"


@pytest.mark.parametrize("damage", ["changed", "gone", "note"])
def test_a_scene_never_uses_a_damaged_clip(home: Path, capsys: pytest.CaptureFixture[str], damage: str) -> None:
    """Neither before its first run nor after it, when the database has the clip already."""
    library.add(Path("My Pond.mp4"), Path("clips"))
    file, note = home / "clips/my-pond.npz", home / "clips/my-pond.json"
    tiny.written(home, changed(SCENE, "width = 96", "width = 64"))
    assert cli.run(["synth", "tiny.toml", "--quiet"]) == 0
    if damage == "changed":
        spoilt(file)
    elif damage == "gone":
        file.unlink()
    else:
        note.write_text(note.read_text()[:40])
    capsys.readouterr()
    for out in ("out", "other"):
        assert cli.run(["synth", "tiny.toml", "--quiet", "--out", out]) == 4
        err = capsys.readouterr().err
        assert err.count("\n") == 1 and "my-pond" in err and "damaged" in err
    assert not (home / "other").exists()


def test_a_clip_of_the_library_joins_as_its_video_does(home: Path) -> None:
    library.add(Path("My Pond.mp4"), Path("clips"))
    kept = tiny.graph(home, SCENE)
    video = tiny.graph(home, changed(PHOTO, "count = 1", 'count = 0\nfiles = ["My Pond.mp4"]'))
    assert [name for name in kept.artifacts[""] if "clip" in name] == ["clip-library-my-pond"]
    (_, one), = kept.run("", "clip-library-my-pond", [0])
    (_, other), = video.run("", "clip-own-01", [0])
    np.testing.assert_array_equal(one["luma"], other["luma"])


@pytest.mark.parametrize(("library", "told"), [
    ("clips", "clips.library: is no clip library: flowloom clips add makes one"),
    ("none", "clips.library: no file 'none' in the scene's folder or the project's scenes/assets"),
    ("My Pond.mp4", "clips.library: 'My Pond.mp4' is not a folder"),
    ("../clips", "clips.library: '../clips' leaves the scene's folder; write a path relative to it, without ..")])
def test_a_folder_that_is_none_is_one_line(home: Path, library: str, told: str) -> None:
    (home / "clips").mkdir()
    line = tiny.complaint(tiny.written(home, changed(SCENE, '"clips"', f'"{library}"')))
    assert line == told


def test_a_clip_without_its_note_is_not_there_yet(home: Path) -> None:
    """As when adding it was interrupted."""
    library.add(Path("My Pond.mp4"), Path("clips"))
    (home / "clips/my-pond.json").unlink()
    with pytest.raises(BadInput):
        library.entries(Path("clips"))
    assert library.add(Path("My Pond.mp4"), Path("clips"))[1]


def test_a_note_of_another_form_is_damaged(home: Path) -> None:
    library.add(Path("My Pond.mp4"), Path("clips"))
    note = home / "clips/my-pond.json"
    for content in ("[]", "{}", json.dumps({**json.loads(note.read_text()), "name": "../x"})):
        note.write_text(content)
        with pytest.raises(StorageFailed, match=r"my-pond\.json: is damaged"):
            library.entries(Path("clips"))
