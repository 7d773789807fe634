"""Exemplars: what may be wrong in a file of tracks, one line for each, and what the files of the user's become."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tiny import BEADS, FISH, NOODLES, PAPER, TRACKS, changed

from pipeline.files import pictures
from synth.elements.samples import Elements

Content = Callable[[Any], str]
Refused = Callable[..., str]
Synthesized = Callable[[str], tuple[Elements, Elements]]
FISH_SCHOOL = Path(__file__).parents[3] / "scenes" / "assets" / "fish-school" / "ground_truth.csv"
SCHOOL = changed(changed(FISH, '"school"\ncount = 12\nframes = 8', '"tracks"\nfile = "FILE"'), "spacing = 0.3",
                 "spacing = 0.3\ncount = 12")
THREADS = changed(NOODLES, '"noodles"\nstyle = "jagged"\nframes = 4', '"tracks"\nfile = "FILE"')
SHEETS = changed(PAPER, '"paper"\nstyle = "folded"\nframes = 4', '"tracks"\nfile = "FILE"')

# -- what may be wrong


@pytest.mark.parametrize(("text", "content", "expected"), [
    (TRACKS, lambda of: of.wide(of.moved[:, :1]), "a.csv: exemplar.file: holds 1 element; it takes 2 or more"),
    (SCHOOL, lambda of: of.wide(of.deep(of.moved[:1])), "a.csv: exemplar.file: holds 1 frame; it takes 2 or"),
    (THREADS, lambda of: of.threads(frames=1), "a.csv: exemplar.file: holds 1 frame; it takes 2 or more"),
    (SHEETS, lambda of: of.sheets(frames=1), "a.csv: exemplar.file: holds 1 frame; it takes 2 or more"),
    (THREADS, lambda of: of.threads().replace("2,1,5,5,", "2,1,6,5,"),
     "a.csv: exemplar.file: frame 2, element 1, sample 5 is"),
    (THREADS, lambda of: of.threads() + "0,7,0,1,1,1\n",
     "a.csv: exemplar.file: element 7 has 1 samples, element 0 has 6"),
    (THREADS, lambda of: of.threads(count=1), "a.csv: exemplar.file: holds 1 element; it takes 2 or more"),
    (TRACKS, lambda of: of.wide(of.moved).replace("3,0.3,0,", "3,,0,"),
     "a.csv: exemplar.file: frame 3, element 1 (line 4): a gap"),
    (TRACKS, lambda of: of.wide(of.moved).replace("3,0.3,0,", "3,nan,0,"),
     "a.csv: exemplar.file: frame 3, element 1 (line 4): a gap"),
    (TRACKS, lambda of: of.wide(of.moved).replace("3,0.3,0,", "3,1e30,0,"),
     "a.csv: exemplar.file: frame 3, element 1 (line 4): a pos"),
    (TRACKS, lambda of: of.wide(of.moved).replace("3,0.3,0,", "1,0.3,0,"),
     "a.csv: exemplar.file: frame 1 is out of order, after fr"),
    (TRACKS, lambda of: of.wide(of.moved).replace("3,0.3,0,", "4,0.3,0,"),
     "a.csv: exemplar.file: frame 3 is missing (line 4)"),
    (SHEETS, lambda of: of.sheets(lost=(1, 2, 3)),
     "a.csv: exemplar.file: element 1: a sheet that is not a grid: row 2, column 3"),
    (SHEETS, lambda of: of.sheets(rows=1),
     "a.csv: exemplar.file: element 0: a sheet that is not a grid: 1 x 4 samples"),
    (TRACKS, lambda of: of.wide(of.moved * 0), "tiny.toml: exemplar: its elements are all in one place"),
    (TRACKS, lambda of: "", "a.csv: exemplar.file: is empty"),
    (TRACKS, lambda of: "not what it says", "a.csv: exemplar.file: holds no rows of numbers"),
    (THREADS, lambda of: of.threads(samples=3),
     "tiny.toml: exemplar.file: threads of 3 samples; it takes 4 or more"),
    # good tracks that the scene is not for
    (TRACKS, lambda of: of.threads(),
     'tiny.toml: render.kind: "beads" draws points; the elements of a.csv are threads'),
    (SHEETS, lambda of: of.threads(),
     'tiny.toml: render.kind: "paper" draws sheets; the elements of a.csv are threads'),
    (THREADS, lambda of: of.wide(of.deep(of.moved)), 'tiny.toml: render.kind: "noodles" draws threads; the'),
    (TRACKS, lambda of: of.long([(f, e, e, 0, e * f) for f in range(3) for e in range(3)], "frame,element,x,y,z"),
     "tiny.toml: exemplar.file: its elements are not in one plane, and elements.size is in 2-D"),
    (TRACKS.replace('"FILE"', '"FILE"\nrate = 960'), lambda of: of.wide(of.moved),
     "tiny.toml: exemplar.file: 6 frames at 960 per second are one at the scene's 24"),
])
def test_bad_tracks(home: Path, tables: Any, refused: Refused, text: str, content: Content, expected: str) -> None:
    Path("a.csv").write_text(content(tables))
    assert expected in refused(text.replace("FILE", "a.csv"))


@pytest.mark.parametrize(("faces", "expected"), [
    ([[0, 1, 2]], "exemplar.file: "),
    ([[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6]], "exemplar.file: element 1: a sheet that is not a grid"),
])
def test_a_sheet_of_a_mesh_that_is_not_a_grid(home: Path, refused: Refused, faces: list[list[int]],
                                              expected: str) -> None:
    Path("paper").mkdir()
    for frame in (1, 2):
        lines = [f"v {k % 3} {frame * 0.1} {k // 3}" for k in range(9)]
        lines += ["f " + " ".join(str(n + 1) for n in face) for face in faces]
        Path(f"paper/{frame}.obj").write_text("\n".join(lines) + "\n")
    line = refused(SHEETS.replace("FILE", "paper"))
    assert expected in line and "paper/1.obj" in line


def test_a_frame_of_a_sequence_that_is_missing(home: Path, refused: Refused) -> None:
    Path("school").mkdir()
    for frame in (1, 2, 4):
        Path(f"school/{frame}.obj").write_text("v 0 0 0\nv 1 0 0\n")
    assert refused(SCHOOL.replace("FILE", "school")).endswith("school: exemplar.file: frame 3 is missing")


def test_an_exemplar_that_the_methods_refuse_is_blamed(home: Path, refused: Refused) -> None:
    line = refused(changed(FISH, "count = 12", "count = 3"))
    assert line.startswith("tiny.toml: exemplar: a school has 8 fish or more")
    pictures.write(home / "white.png", np.ones((32, 32, 3), np.float32))
    line = refused(changed(BEADS, '"hexagonal-grid"\nacross = 6', '"dots"\nfile = "white.png"'))
    assert line.startswith("tiny.toml: exemplar: 0 dots are found in the drawn pattern")


# -- what files become


@pytest.mark.parametrize(("text", "content", "grid"), [
    (THREADS, lambda of: of.threads(samples=40), (40,)), (SHEETS, lambda of: of.sheets(), (4, 4))])
def test_threads_and_sheets_of_the_users_are_exemplars(home: Path, tables: Any, synthesized: Synthesized, text: str,
                                                       content: Content, grid: tuple[int, ...]) -> None:
    Path("a.csv").write_text(content(tables))
    example, output = synthesized(text.replace("FILE", "a.csv"))
    assert example.grid == output.grid == grid and output.count == 4
    assert np.isfinite(output.positions).all()


def test_points_at_rest_are_an_exemplar_of_beads(home: Path, tables: Any, synthesized: Synthesized) -> None:
    Path("a.csv").write_text(tables.wide(tables.moved[:1]))
    example, output = synthesized(TRACKS.replace("FILE", "a.csv"))
    assert example.frames == 1 and output.frames == 3
    assert np.diff(np.sort(example.positions[0, :4, 0, 0])) == pytest.approx(0.12, rel=1e-4)


def test_a_folder_of_meshes_flat_in_space_is_flat_in_the_plane_and_each_file_counts(
        home: Path, tables: Any, synthesized: Synthesized) -> None:
    Path("dots").mkdir()
    for frame, points in enumerate(tables.moved, 1):
        Path(f"dots/{frame}.obj").write_text("".join(f"v {x} {y} 2\n" for x, y in points))
    example, _ = synthesized(TRACKS.replace("FILE", "dots"))
    assert example.dimensions == 2 and example.frames == 6
    before = Path("out/tiny/fields/elements.npz").read_bytes()
    moved = Path("dots/6.obj").read_text().replace("v 0.5 0.0 2", "v 0.9 0.1 2")
    Path("dots/6.obj").write_text(moved)
    synthesized(TRACKS.replace("FILE", "dots"))
    assert Path("out/tiny/fields/elements.npz").read_bytes() != before


def test_a_film_of_another_rate_is_resampled(home: Path, tables: Any, synthesized: Synthesized) -> None:
    moved = np.repeat(tables.grid[None], 11, axis=0) + np.arange(11.0)[:, None, None] * [0.1, 0.0]
    Path("a.csv").write_text(tables.wide(moved))
    example, _ = synthesized(TRACKS.replace('"FILE"', '"a.csv"\nrate = 12.0'))
    assert (example.frames, example.rate) == (21, 24.0)
    steps = np.diff(example.positions[:, 0, 0, 0])
    assert steps == pytest.approx(np.full(20, 0.05 * 0.12), rel=1e-3)


@pytest.mark.parametrize("deep", [False, True])
def test_a_captured_school_swims_without_its_mean_motion(home: Path, synthesized: Synthesized, deep: bool) -> None:
    shutil.copy(FISH_SCHOOL, "fish.csv")
    text = SCHOOL if deep else TRACKS
    example, output = synthesized(text.replace('"FILE"', '"fish.csv"\nrate = 24.0\ncaptured = true'))
    assert (example.frames, example.count, example.dimensions) == (301, 5, 3 if deep else 2)
    middle = example.positions.mean(axis=(1, 2))
    assert np.abs(np.diff(middle, axis=0)).max() < 1e-4
    jumps = np.abs(np.diff(example.positions, n=2, axis=0)).max()
    assert jumps < (0.12 if deep else 0.05)  # 0.4 spacings: the tracker's steps of a pixel are smoothed
    assert output.count >= 2 and np.isfinite(output.positions).all()
    if deep:
        assert (example.positions[..., 2] == 0).all() and np.allclose(example.size, example.size[0])


def test_what_is_captured_is_flat_and_long_enough(home: Path, tables: Any, refused: Refused) -> None:
    text = SCHOOL.replace('"FILE"', '"a.csv"\ncaptured = true')
    Path("a.csv").write_text(tables.wide(tables.moved))
    assert refused(text) == (
        "tiny.toml: exemplar.file: tracks of 6 frames are shorter than the 9 of their smoothing")
    Path("a.csv").write_text(tables.wide(np.repeat(tables.grid[None], 12, axis=0)))
    assert "exemplar.file: the tracked school is at rest" in refused(text)
    Path("a.csv").write_text("frame,x1,y1,z1,x2,y2,z2\n0,0,0,0,1,1,1\n1,0,0,0,1,1,1\n")
    assert refused(text) == "tiny.toml: exemplar.captured: tracks of a film are x and y; a.csv has depth"


def test_beads_are_as_large_as_the_scene_says_and_keep_their_proportions(home: Path, synthesized: Synthesized) -> None:
    dots = np.ones((64, 64, 3), np.float32)
    for number, (y, x) in enumerate((y, x) for y in (8, 24, 40, 56) for x in (8, 24, 40, 56)):
        reach = 5 if number == 5 else 3
        dots[y - reach:y + reach, x - reach:x + reach] = 0.2
    pictures.write(home / "dots.png", dots)
    text = changed(BEADS, '"hexagonal-grid"\nacross = 6', '"dots"\nfile = "dots.png"')
    example, _ = synthesized(changed(text, "spacing = 0.12", "spacing = 0.12\nradius = 0.3"))
    assert sorted(example.size)[:15] == pytest.approx([0.3 * 0.12] * 15, rel=1e-3)
    assert max(example.size) == pytest.approx(0.3 * 0.12 * 5 / 3, rel=0.1)


