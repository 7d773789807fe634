"""The photo part: its scene is one, and a clip that is compared with itself is perfect."""

from pathlib import Path

import pytest

from bench import photo, subjects
from pipeline.scene import load
from synth.photo.minimize import MINIMIZERS

FRAMES, SIZE = 32, (128, 96)


@pytest.fixture(scope="module")
def river() -> subjects.Subject:
    return subjects.of_clip("river", FRAMES, SIZE)


def test_a_clip_is_its_own_truth(river: subjects.Subject) -> None:
    row = photo.truth("river", "without", river, river.frames)
    assert row["spectrum"] == 0
    assert row["angle"] == row["angle of the clip's own flow"]
    assert row["angle"] < 15


def test_a_clip_looks_like_its_target_moves_along_its_strokes_and_loops(river: subjects.Subject) -> None:
    row = photo.look("river", photo.ITSELF, river, river.frames)
    assert row["low-pass"] < 6
    assert all(0.85 < row[band] < 1.15 for band in ("1 px", "2 px", "4 px"))
    assert row["angle to strokes"] < 20
    assert row["loop"] < 1.2
    assert row["edges"] > 0.8


def test_a_clip_that_runs_backwards_and_one_that_jumps_are_neither(river: subjects.Subject) -> None:
    backwards = river.frames[::-1]
    assert photo.truth("river", "without", river, backwards)["angle"] > 150
    assert photo.look("river", "backwards", river, backwards)["angle to strokes"] > 150
    cut = river.frames.copy()
    cut[FRAMES // 2:] = 1 - cut[FRAMES // 2:]
    assert photo.truth("river", "without", river, cut)["spectrum"] > 0.3


@pytest.mark.parametrize("scale", photo.SCALES)
def test_the_database_is_that_of_a_scene(scale: str, tmp_path: Path) -> None:
    of = photo.SCALES[scale]
    file = tmp_path / "bench.toml"
    file.write_text(photo.SCENE.format(frames=photo.FRAMES, seed=photo.SEED, width=of.photograph, count=of.clips,
                                       columns=of.size[0], rows=of.size[1]))
    scene = load(file).variants[""]
    assert len(scene.clips.recipes()) == of.clips
    assert (scene.clips.size, scene.clips.length, scene.photo.width) == (of.size, photo.FRAMES, of.photograph)


def test_every_minimizer_is_measured() -> None:
    assert set(photo.MINIMIZERS) == set(MINIMIZERS)


def test_what_is_compared_is_measured() -> None:
    assert {*photo.COMPARED, *photo.MINIMIZED} <= {photo.PHOTOGRAPH, *subjects.CLIPS}
    assert photo.OURS in photo.VARIANTS
