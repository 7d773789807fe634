"""Scenes of elements end to end: bad input, captured tracks, constraints, interrupted runs, references, farm."""

import shutil
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_elements_schema import BEADS, FISH, NOODLES, PAPERS, TRACKS, changed
from test_interrupt import contents, run, stopped

from pipeline import cli, elements, stages
from pipeline.files import pictures, tracks
from pipeline.progress import Progress
from pipeline.scene import load
from synth.elements.samples import Elements

FISH_SCHOOL = Path(__file__).parent.parent / "scenes" / "assets" / "fish-school" / "ground_truth.csv"
SCHOOL = changed(changed(FISH, '"school"\ncount = 12\nframes = 8', '"tracks"\nfile = "FILE"'), "spacing = 0.3",
                "spacing = 0.3\ncount = 12")
THREADS = changed(NOODLES, '"noodles"\nstyle = "jagged"\nframes = 4', '"tracks"\nfile = "FILE"')
SHEETS = changed(PAPERS, '"paper"\nstyle = "folded"\nframes = 4', '"tracks"\nfile = "FILE"')


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def refused(text: str, capsys: pytest.CaptureFixture[str], whole: tuple[str, ...] = ()) -> str:
    """The one line that running the scene ends with; nothing but the files `whole` may have been written."""
    Path("tiny.toml").write_text(text)
    before = set(Path().rglob("*"))
    assert cli.run(["figure", "tiny.toml"]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1, err
    written = {path.name for path in set(Path().rglob("*")) - before if path.is_file() and ".whole" not in path.parts}
    assert written == set(whole)
    return err.rstrip()


def made(text: str, verb: str = "synth") -> tuple[Elements, Elements]:
    """Exemplar and output of a scene."""
    Path("tiny.toml").write_text(text)
    stages.run(verb, load(Path("tiny.toml")), Path("out"), Progress(quiet=True))
    folder = Path("out/tiny/fields")
    return tracks.read(folder / "exemplar.npz"), tracks.read(folder / "elements.npz")


def wide(positions: np.ndarray) -> str:
    """(T, E, D) as a wide table."""
    return "".join(f"{frame}," + ",".join(f"{v:g}" for v in row.ravel()) + "\n" for frame, row in enumerate(positions))


def long(rows: list[tuple[int, ...]], names: str) -> str:
    return names + "\n" + "".join(",".join(map(str, row)) + "\n" for row in rows)


def threads(count: int = 3, frames: int = 4, samples: int = 6) -> str:
    """Threads side by side that sway, as a long table."""
    return long([(f, e, s, s, e + round(0.2 * np.sin(f + s), 3), 0) for f in range(frames) for e in range(count)
                 for s in range(samples)], "frame,element,sample,x,y,z")


def sheets(count: int = 3, frames: int = 4, rows: int = 4, columns: int = 4, lost: tuple[int, ...] = ()) -> str:
    """Sheets above each other that sway, as a long table."""
    found = [(f, e, r, c, c, 3 * e + round(0.2 * np.sin(f + r), 3), r) for f in range(frames) for e in range(count)
             for r in range(rows) for c in range(columns)]
    return long([row for row in found if row[1:4] != lost], "frame,element,row,column,x,y,z")


GRID = np.stack(np.meshgrid(np.arange(4.0), np.arange(4.0)), axis=-1).reshape(-1, 2)
MOVED = GRID + np.arange(6.0)[:, None, None] * [0.1, 0.0]
"""Sixteen points on a grid that move along x over six frames."""


# --- what may be wrong in a file of tracks

@pytest.mark.parametrize(("text", "content", "expected"), [
    (TRACKS, wide(MOVED[:, :1]), "a.csv: exemplar.file: holds 1 element; it takes 2 or more"),
    (SCHOOL, wide(np.pad(MOVED[:1], [(0, 0), (0, 0), (0, 1)])), "a.csv: exemplar.file: holds 1 frame; it takes 2 or"),
    (THREADS, threads(frames=1), "a.csv: exemplar.file: holds 1 frame; it takes 2 or more"),
    (SHEETS, sheets(frames=1), "a.csv: exemplar.file: holds 1 frame; it takes 2 or more"),
    (THREADS, threads().replace("2,1,5,5,", "2,1,6,5,"), "a.csv: exemplar.file: frame 2, element 1, sample 5 is"),
    (THREADS, threads() + "0,7,0,1,1,1\n", "a.csv: exemplar.file: element 7 has 1 samples, element 0 has 6"),
    (THREADS, threads(count=1), "a.csv: exemplar.file: holds 1 element; it takes 2 or more"),
    (TRACKS, wide(MOVED).replace("3,0.3,0,", "3,,0,"), "a.csv: exemplar.file: frame 3, element 1 (line 4): a gap"),
    (TRACKS, wide(MOVED).replace("3,0.3,0,", "3,nan,0,"), "a.csv: exemplar.file: frame 3, element 1 (line 4): a gap"),
    (TRACKS, wide(MOVED).replace("3,0.3,0,", "3,1e30,0,"), "a.csv: exemplar.file: frame 3, element 1 (line 4): a pos"),
    (TRACKS, wide(MOVED).replace("3,0.3,0,", "1,0.3,0,"), "a.csv: exemplar.file: frame 1 is out of order, after fr"),
    (TRACKS, wide(MOVED).replace("3,0.3,0,", "4,0.3,0,"), "a.csv: exemplar.file: frame 3 is missing (line 4)"),
    (SHEETS, sheets(lost=(1, 2, 3)), "a.csv: exemplar.file: element 1: a sheet that is not a grid: row 2, column 3"),
    (SHEETS, sheets(rows=1), "a.csv: exemplar.file: element 0: a sheet that is not a grid: 1 x 4 samples"),
    (TRACKS, wide(MOVED * 0), "tiny.toml: exemplar: its elements are all in one place"),
    (TRACKS, "", "a.csv: exemplar.file: is empty"),
    (TRACKS, "not what it says", "a.csv: exemplar.file: holds no rows of numbers"),
    (THREADS, threads(samples=3), "tiny.toml: exemplar.file: threads of 3 samples; it takes 4 or more"),
    # good tracks that the scene is not for
    (TRACKS, threads(), 'tiny.toml: render.kind: "beads" draws points; the elements of a.csv are threads'),
    (SHEETS, threads(), 'tiny.toml: render.kind: "paper" draws sheets; the elements of a.csv are threads'),
    (THREADS, wide(np.pad(MOVED, [(0, 0), (0, 0), (0, 1)])), 'tiny.toml: render.kind: "noodles" draws threads; the'),
    (TRACKS, long([(f, e, e, 0, e * f) for f in range(3) for e in range(3)], "frame,element,x,y,z"),
     "tiny.toml: exemplar.file: its elements are not in one plane, and elements.size is in 2-D"),
    (TRACKS.replace('"FILE"', '"FILE"\nrate = 960'), wide(MOVED),
     "tiny.toml: exemplar.file: 6 frames at 960 per second are one at the scene's 24"),
])
def test_bad_tracks(home: Path, capsys: pytest.CaptureFixture[str], text: str, content: str, expected: str) -> None:
    Path("a.csv").write_text(content)
    assert expected in refused(text.replace("FILE", "a.csv"), capsys)


@pytest.mark.parametrize(("faces", "expected"), [
    ([[0, 1, 2]], "exemplar.file: "),
    ([[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6]], "exemplar.file: element 1: a sheet that is not a grid"),
])
def test_a_sheet_of_a_mesh_that_is_not_a_grid(home: Path, capsys: pytest.CaptureFixture[str],
                                              faces: list[list[int]], expected: str) -> None:
    Path("paper").mkdir()
    for frame in (1, 2):
        lines = [f"v {k % 3} {frame * 0.1} {k // 3}" for k in range(9)]
        lines += ["f " + " ".join(str(n + 1) for n in face) for face in faces]
        Path(f"paper/{frame}.obj").write_text("\n".join(lines) + "\n")
    line = refused(SHEETS.replace("FILE", "paper"), capsys)
    assert expected in line and "paper/1.obj" in line


def test_a_frame_of_a_sequence_that_is_missing(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("school").mkdir()
    for frame in (1, 2, 4):
        Path(f"school/{frame}.obj").write_text("v 0 0 0\nv 1 0 0\n")
    assert refused(SCHOOL.replace("FILE", "school"), capsys).endswith("school: exemplar.file: frame 3 is missing")


# --- domains, hard positions, numbers

BALL = '[[obstacles]]\nkind = "ball"\ncentre = [0.0, 0.5]\nradius = RADIUS\n[render]'


@pytest.mark.parametrize(("old", "new", "expected"), [
    ("spacing = 0.12", "spacing = 0.9", "synthesis.neighborhood: the domain is smaller than a neighbourhood"),
    ("spacing = 0.12", 'spacing = 0.12\ndomain = { kind = "ball", centre = [0.0, 0.5], radius = 0.1 }',
     "synthesis.neighborhood: the domain is smaller than a neighbourhood"),
    ("spacing = 0.12", "spacing = 0.12\ncount = 5000", "elements.count: 5,000 elements are more than the domain holds"),
    ("spacing = 0.12", "spacing = 0.001", "elements.spacing: 1,154,700 elements would fill the domain; 100,000 are"),
    ("spacing = 0.12", "spacing = 0.12\ncount = 2\npins = [{ at = [0.0, 0.2] }, { at = [0.0, 0.5] }, "
                       "{ at = [0.0, 0.8] }]", "elements.pins: 3 hard positions in frame 1, and 2 elements"),
    ("spacing = 0.12", "spacing = 0.12\ncount = 2\npins = [{ at = [0.0, 0.2], frame = 2 }, { at = [0.0, 0.5], frame = 2"
                       " }, { at = [0.0, 0.8], frame = 2 }]", "elements.pins: 3 hard positions in frame 2, and 2 elem"),
    ("spacing = 0.12", "spacing = 0.12\npins = [{ at = [0.0, 0.5] }, { at = [0.0, 1.5] }]",
     "elements.pins[1].at: is outside the domain, or in an obstacle"),
    ("spacing = 0.12", 'spacing = 0.12\ndomain = { kind = "ball", centre = [0.0, 0.5], radius = 0.001 }',
     "elements.domain: "),
])
def test_an_output_without_room(home: Path, capsys: pytest.CaptureFixture[str], old: str, new: str,
                                expected: str) -> None:
    line = refused(changed(changed(BEADS, '[coarse]\nkind = "analytic"\nflow = "rotation"\nsize = [16, 16]\n', ""),
                           old, new), capsys, ("exemplar.npz",))
    assert line.startswith(f"tiny.toml: {expected}")


@pytest.mark.parametrize(("new", "expected"), [
    (BALL.replace("RADIUS", "2.0"), "obstacles: "),
    (BALL.replace("RADIUS", "0.7"), "obstacles: "),
    (BALL.replace("RADIUS", "0.3").replace("[0.0, 0.5]", "[5.0, 0.5]"), "obstacles: "),
])
def test_obstacles_that_fill_the_domain_or_lie_outside_it(home: Path, capsys: pytest.CaptureFixture[str], new: str,
                                                          expected: str) -> None:
    Path("tiny.toml").write_text(changed(BEADS, "[render]", new))
    assert cli.run(["figure", "tiny.toml"]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and err.startswith(f"tiny.toml: {expected}")
    assert not list(Path("out").rglob("elements*")) and not list(Path("out").rglob("*.partial"))


def test_a_domain_that_the_obstacles_fill(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = changed(BEADS, "spacing = 0.12",
                   'spacing = 0.12\ndomain = { kind = "ball", centre = [0.0, 0.5], radius = 0.3 }')
    Path("tiny.toml").write_text(changed(text, "[render]", BALL.replace("RADIUS", "0.4")))
    assert cli.run(["synth", "tiny.toml"]) == 2
    assert capsys.readouterr().err == "tiny.toml: obstacles: leave elements no room\n"


def test_selections_are_of_kinds_that_there_are_and_pictures_that_can_be_read(
        home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pictures.write(home / "left.png", np.tile(np.arange(16) < 8, (16, 1)).astype(np.float32))
    text = changed(BEADS, "spacing = 0.12", 'spacing = 0.12\nselections = [{ kinds = [3], file = "left.png" }]')
    Path("tiny.toml").write_text(text)
    assert cli.run(["synth", "tiny.toml"]) == 2
    assert capsys.readouterr().err == (
        "tiny.toml: elements.selections[0].kinds: the exemplar has no element of kind 3; it has 0\n")
    (home / "left.png").write_text("no picture")
    shutil.rmtree("out")
    assert "left.png: elements.selections[0].file: " in refused(text, capsys)


def test_an_exemplar_that_the_methods_refuse_is_blamed(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line = refused(changed(FISH, "count = 12", "count = 3"), capsys)
    assert line.startswith("tiny.toml: exemplar: a school has 8 fish or more")
    pictures.write(home / "white.png", np.ones((32, 32, 3), np.float32))
    line = refused(changed(BEADS, '"hexagonal-grid"\nacross = 6', '"dots"\nfile = "white.png"'), capsys)
    assert line.startswith("tiny.toml: exemplar: 0 dots are found in the drawn pattern")


# --- coarse motions of the user's

MOTION = changed(changed(NOODLES, 'kind = "lifted"', 'kind = "tracks"\nfile = "c.csv"'), "count = 4", "")


@pytest.mark.parametrize(("content", "expected", "whole"), [
    (threads(frames=2, samples=40), "tiny.toml: coarse.file: lasts 2 frames, and the animation 3", ()),
    (threads(frames=4, samples=6), "tiny.toml: coarse.file: 6 samples for an element, and 40 in the exem",
     ("exemplar.npz",)),
    (sheets(), "tiny.toml: coarse.file: its elements are sheets", ()),
    (threads(frames=4, samples=40).replace("1,0,3,3,", "1,0,3,nan,"), "c.csv: coarse.file: frame 1, element 0, samp",
     ()),
])
def test_a_bad_coarse_motion(home: Path, capsys: pytest.CaptureFixture[str], content: str, expected: str,
                             whole: tuple[str, ...]) -> None:
    Path("c.csv").write_text(content)
    assert expected in refused(MOTION, capsys, whole)


def test_threads_follow_a_coarse_motion_of_the_users(home: Path) -> None:
    Path("c.csv").write_text(threads(count=5, frames=6, samples=40))
    example, output = made(MOTION)
    assert (output.frames, output.count, output.grid) == (3, 5, example.grid)
    assert set(output.size) == set(example.size)


def test_a_gust_tosses_square_sheets(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("a.csv").write_text(sheets(columns=3))
    line = refused(SHEETS.replace("FILE", "a.csv"), capsys, ("exemplar.npz",))
    assert line == 'tiny.toml: coarse.kind: "gust" tosses square sheets; those of the exemplar are 4 × 3'
    Path("a.csv").write_text(sheets())
    shutil.rmtree("out")
    line = refused(changed(SHEETS.replace("FILE", "a.csv"), "count = 4", "count = 9000"), capsys, ("exemplar.npz",))
    assert line.startswith("tiny.toml: elements.count: 1 to 5000 scraps")


@pytest.mark.parametrize(("text", "content", "grid"), [
    (THREADS, threads(samples=40), (40,)), (SHEETS, sheets(), (4, 4))])
def test_threads_and_sheets_of_the_users_are_exemplars(home: Path, text: str, content: str,
                                                       grid: tuple[int, ...]) -> None:
    Path("a.csv").write_text(content)
    example, output = made(text.replace("FILE", "a.csv"))
    assert example.grid == output.grid == grid and output.count == 4
    assert np.isfinite(output.positions).all()


def test_threads_too_thick_to_lie_beside_each_other(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("a.csv").write_text(threads(samples=40))
    found = tracks.read_foreign(Path("a.csv"), "exemplar.file", dimensions=3)
    tracks.write(Path("a.npz"), replace(found, size=np.full(found.count, 50.0)))
    text = changed(THREADS.replace("FILE", "a.npz"), "iterations = 1", "iterations = 1\nhybrid = true")
    line = refused(text, capsys, ("exemplar.npz", "coarse.npz"))
    assert line.startswith("tiny.toml: synthesis.hybrid: the exemplar's threads are ")


# --- tracks that do

def test_points_at_rest_are_an_exemplar_of_beads(home: Path) -> None:
    Path("a.csv").write_text(wide(MOVED[:1]))
    example, output = made(TRACKS.replace("FILE", "a.csv"))
    assert example.frames == 1 and output.frames == 3
    assert np.diff(np.sort(example.positions[0, :4, 0, 0])) == pytest.approx(0.12, rel=1e-4)


def test_a_folder_of_meshes_flat_in_space_is_flat_in_the_plane_and_each_file_counts(home: Path) -> None:
    Path("dots").mkdir()
    for frame, points in enumerate(MOVED, 1):
        Path(f"dots/{frame}.obj").write_text("".join(f"v {x} {y} 2\n" for x, y in points))
    example, _ = made(TRACKS.replace("FILE", "dots"))
    assert example.dimensions == 2 and example.frames == 6
    before = Path("out/tiny/fields/elements.npz").read_bytes()
    moved = Path("dots/6.obj").read_text().replace("v 0.5 0.0 2", "v 0.9 0.1 2")
    Path("dots/6.obj").write_text(moved)
    made(TRACKS.replace("FILE", "dots"))
    assert Path("out/tiny/fields/elements.npz").read_bytes() != before


def test_a_film_of_another_rate_is_resampled(home: Path) -> None:
    Path("a.csv").write_text(wide(np.repeat(GRID[None], 11, axis=0) + np.arange(11.0)[:, None, None] * [0.1, 0.0]))
    example, _ = made(TRACKS.replace('"FILE"', '"a.csv"\nrate = 12.0'))
    assert (example.frames, example.rate) == (21, 24.0)
    steps = np.diff(example.positions[:, 0, 0, 0])
    assert steps == pytest.approx(np.full(20, 0.05 * 0.12), rel=1e-3)


@pytest.mark.parametrize("deep", [False, True])
def test_a_captured_school_swims_without_its_mean_motion(home: Path, deep: bool) -> None:
    shutil.copy(FISH_SCHOOL, "fish.csv")
    text = SCHOOL if deep else TRACKS
    example, output = made(text.replace('"FILE"', '"fish.csv"\nrate = 24.0\ncaptured = true'))
    assert (example.frames, example.count, example.dimensions) == (301, 5, 3 if deep else 2)
    middle = example.positions.mean(axis=(1, 2))
    assert np.abs(np.diff(middle, axis=0)).max() < 1e-4
    jumps = np.abs(np.diff(example.positions, n=2, axis=0)).max()
    assert jumps < (0.12 if deep else 0.05)  # 0.4 spacings: the tracker's steps of a pixel are smoothed
    assert output.count >= 2 and np.isfinite(output.positions).all()
    if deep:
        assert (example.positions[..., 2] == 0).all() and np.allclose(example.size, example.size[0])


def test_what_is_captured_is_flat_and_long_enough(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = SCHOOL.replace('"FILE"', '"a.csv"\ncaptured = true')
    Path("a.csv").write_text(wide(MOVED))
    assert refused(text, capsys) == (
        "tiny.toml: exemplar.file: tracks of 6 frames are shorter than the 9 of their smoothing")
    Path("a.csv").write_text(wide(np.repeat(GRID[None], 12, axis=0)))
    assert "exemplar.file: the tracked school is at rest" in refused(text, capsys)
    Path("a.csv").write_text("frame,x1,y1,z1,x2,y2,z2\n0,0,0,0,1,1,1\n1,0,0,0,1,1,1\n")
    assert refused(text, capsys) == "tiny.toml: exemplar.captured: tracks of a film are x and y; a.csv has depth"


def test_beads_are_as_large_as_the_scene_says_and_keep_their_proportions(home: Path) -> None:
    dots = np.ones((64, 64, 3), np.float32)
    for number, (y, x) in enumerate((y, x) for y in (8, 24, 40, 56) for x in (8, 24, 40, 56)):
        reach = 5 if number == 5 else 3
        dots[y - reach:y + reach, x - reach:x + reach] = 0.2
    pictures.write(home / "dots.png", dots)
    text = changed(BEADS, '"hexagonal-grid"\nacross = 6', '"dots"\nfile = "dots.png"')
    example, _ = made(changed(text, "spacing = 0.12", "spacing = 0.12\nradius = 0.3"))
    assert sorted(example.size)[:15] == pytest.approx([0.3 * 0.12] * 15, rel=1e-3)
    assert max(example.size) == pytest.approx(0.3 * 0.12 * 5 / 3, rel=0.1)


# --- what constraints do

def test_hard_positions_hold_in_their_frames(home: Path) -> None:
    pins = 'pins = [{ at = [0.1, 0.3] }, { at = [-0.2, 0.6], frame = 3 }, { at = [0.2, 0.6], frame = 3 }]'
    _, output = made(changed(BEADS, "spacing = 0.12", f"spacing = 0.12\n{pins}"))
    for frame, place in ((0, (0.1, 0.3)), (2, (-0.2, 0.6)), (2, (0.2, 0.6))):
        away = np.linalg.norm(output.positions[frame, :, 0] - place, axis=1)
        assert away.min() < 1e-6


def test_elements_stay_in_the_domain_and_out_of_obstacles(home: Path) -> None:
    text = changed(BEADS, "spacing = 0.12",
                   'spacing = 0.12\ndomain = { kind = "ball", centre = [0.0, 0.5], radius = 0.45 }')
    _, output = made(changed(text, "[render]", BALL.replace("RADIUS", "0.15")))
    away = np.linalg.norm(output.positions[:, :, 0] - [0.0, 0.5], axis=-1)
    assert away.min() > 0.15 and away.max() < 0.45


def test_kinds_stand_where_they_are_selected(home: Path) -> None:
    dots = np.ones((64, 64, 3), np.float32)
    for y in range(4, 64, 16):
        for x in range(4, 64, 16):
            dots[y:y + 7, x:x + 7] = [0.9, 0.1, 0.1] if (x + y) % 32 < 16 else [0.1, 0.1, 0.9]
    pictures.write(home / "dots.png", dots)
    pictures.write(home / "left.png", np.tile(np.arange(32) < 16, (32, 1)).astype(np.float32))
    text = changed(BEADS, '"hexagonal-grid"\nacross = 6', '"dots"\nfile = "dots.png"')
    text = changed(text, '[coarse]\nkind = "analytic"\nflow = "rotation"\nsize = [16, 16]\n', "")
    _, output = made(changed(text, "spacing = 0.12",
                             'spacing = 0.12\nselections = [{ kinds = [1, 1], file = "left.png" }]'))
    left = output.positions[0, :, 0, 0] < -0.06  # a row may lean over the border
    right = output.positions[0, :, 0, 0] > 0.06
    assert set(output.kind[left]) == {1} and set(output.kind[right]) == {0}


# --- interrupted, farmed, kept

@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """What an uninterrupted run leaves."""
    return run(tmp_path_factory.mktemp("whole"), SEVERAL)


SEVERAL = changed(BEADS, "iterations = 2", "iterations = 3\nbefore = 1")


@pytest.mark.parametrize(("name", "by", "code"), [
    ("elements.state.npz", signal.SIGKILL, -9),  # after an iteration
    ("elements.npz", signal.SIGKILL, -9),  # all iterations are done, and their file is not written
    ("elements.npz", signal.SIGTERM, 143),
    ("L.0002.exr", signal.SIGKILL, -9),
    ("animation.usdc", signal.SIGKILL, -9),
    ("mesh.0002.ply", signal.SIGINT, 130),
])
def test_a_stopped_run_goes_on_with_the_same_bits(tmp_path: Path, whole: dict[str, bytes], name: str,
                                                  by: signal.Signals, code: int) -> None:
    assert stopped(tmp_path, name, by, SEVERAL).returncode == code
    left = contents(tmp_path / "out" / "tiny")
    for path in left:
        if not any(part.startswith(".") for part in Path(path).parts):
            assert left[path] == whole[path], f"{path} is not whole"
    if name == "elements.npz":
        assert "fields/.whole/elements.state.npz" in left
    assert run(tmp_path, SEVERAL) == whole


class Stopped(BaseException):
    """What a test stops the work with."""


@pytest.mark.parametrize(("sequence", "after"), [("together", 1), ("together", 2), ("frames", 1), ("frames", 2)])
def test_it_goes_on_after_the_last_whole_iteration_or_frame(home: Path, monkeypatch: pytest.MonkeyPatch,
                                                            sequence: str, after: int) -> None:
    from synth.elements.synthesis import Optimizer

    text = changed(SEVERAL, "iterations = 3", f'iterations = 3\nsequence = "{sequence}"')
    _, expected = made(text)
    shutil.rmtree("out")
    counted: list[int] = []
    iterate, keep = Optimizer.iterate, elements._keep

    def counting(self: Optimizer, *arguments: object) -> float:
        counted.append(1)
        return iterate(self, *arguments)  # type: ignore[arg-type]

    def stopping(*arguments: object) -> None:
        keep(*arguments)  # type: ignore[arg-type]
        kept.append(1)
        if len(kept) == after:
            raise Stopped

    kept: list[int] = []
    monkeypatch.setattr(Optimizer, "iterate", counting)
    monkeypatch.setattr(elements, "_keep", stopping)
    with pytest.raises(Stopped):
        made(text)
    monkeypatch.setattr(elements, "_keep", keep)
    counted.clear()
    _, output = made(text)
    assert (output.positions == expected.positions).all()
    assert len(counted) == (3 - after) * (3 if sequence == "frames" else 1)


@pytest.mark.parametrize("damage", [b"", b"PK\x03\x04 cut short"])
def test_a_damaged_state_is_passed_over(home: Path, damage: bytes) -> None:
    _, expected = made(BEADS)
    shutil.rmtree("out")
    state = Path("out/tiny/fields/.whole/elements.state.npz")
    state.parent.mkdir(parents=True)
    state.write_bytes(damage)
    _, output = made(BEADS)
    assert (output.positions == expected.positions).all()


def test_the_farm_ends_with_the_same_bits(tmp_path: Path, whole: dict[str, bytes]) -> None:
    (tmp_path / "tiny.toml").write_text(SEVERAL)
    command = [sys.executable, "-P", "-m", "pipeline.cli", "farm", "tiny.toml", "--workers", "2", "--batch", "2"]
    subprocess.run(command, cwd=tmp_path, check=True, timeout=300)
    assert contents(tmp_path / "out" / "tiny") == whole


def test_the_whole_animation_is_made_by_the_last_batch_alone(home: Path) -> None:
    made(BEADS)
    scenes = load(Path("tiny.toml"))
    stages.run("bake", scenes, Path("out"), Progress(quiet=True), [1, 2])
    assert not Path("out/tiny/geometry/animation.usdc").exists()
    assert not Path("out/tiny/geometry/manifest.json").exists()
    stages.run("bake", scenes, Path("out"), Progress(quiet=True), [3])
    assert Path("out/tiny/geometry/animation.usdc").exists()
    assert Path("out/tiny/geometry/manifest.json").exists()


def test_references_keep_a_scene_of_elements_and_tell_what_changed(home: Path,
                                                                   capsys: pytest.CaptureFixture[str]) -> None:
    file = home / "tiny.toml"
    file.write_text(changed(BEADS, '["result"]', '["exemplar", "result"]') + '[quick]\n"elements.spacing" = 0.2\n')
    out = ["--out", str(home / "out")]
    assert cli.run(["references", str(file), *out]) == 0
    kept = {path.relative_to(home / "references" / "tiny").as_posix()
            for path in (home / "references").rglob("*.*") if path.is_file()}
    assert kept == {"reference.json", "fields/exemplar.npz", "fields/elements.npz", "fields/L.0003.exr",
                    "geometry/mesh.0003.ply", "images/proof.exr"}
    assert cli.run(["diff", str(file), *out]) == 0
    capsys.readouterr()
    file.write_text(changed(file.read_text(), "iterations = 2", "iterations = 3"))
    assert cli.run(["diff", str(file), *out]) == 1
    told = capsys.readouterr().out
    assert "elements.npz: " in told and "mesh.000" in told and "exemplar.npz" not in told
    assert "index.html" in told


@pytest.mark.parametrize("text", [FISH, NOODLES, PAPERS])
def test_every_kind_of_scene_ends_with_its_figure(home: Path, text: str) -> None:
    panels = '["exemplar", "result"]' if text == FISH else '["exemplar", "coarse", "result"]'
    made(changed(text, '["result"]', panels), "figure")
    root = Path("out/tiny")
    assert (root / "tiny.png").is_file() and (root / "tiny.mp4").is_file()
    assert (root / "geometry" / "animation.usdc").is_file()
