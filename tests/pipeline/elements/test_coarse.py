"""The coarse motion of threads and sheets: those made here, and the user's."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tiny import NOODLES, PAPER, Memory, changed, graph

from pipeline.build.graph import computed
from pipeline.elements.coarse import looking_like, with_coarse
from synth.elements.samples import Elements

Synthesized = Callable[[str], tuple[Elements, Elements]]
SHEETS = changed(PAPER, '"paper"\nstyle = "folded"\nframes = 4', '"tracks"\nfile = "FILE"')
MOTION = changed(changed(NOODLES, 'kind = "lifted"', 'kind = "tracks"\nfile = "c.csv"'), "count = 4", "")


def carried(folder: Path, text: str) -> tuple[Any, Elements]:
    """The exemplar of a scene with its own C, and the coarse motion that its artifact makes of it."""
    built = graph(folder, text)
    one, artifacts = built.variants[""], built.artifacts[""]
    example = next(computed(artifacts["exemplar"], one, Memory(folder), [0]))[1]
    return with_coarse(example), next(computed(artifacts["coarse"], one, Memory(folder, exemplar=example), [0]))[1]


@pytest.mark.parametrize("text", [NOODLES, PAPER])
def test_it_lasts_as_long_as_the_animation_and_has_as_many_elements_as_the_output(tmp_path: Path, text: str) -> None:
    example, coarse = carried(tmp_path, changed(text, "count = 4", "count = 7"))
    assert (coarse.frames, coarse.count, coarse.dimensions, coarse.rate) == (3, 7, 3, 24)
    assert coarse.topology == example.topology
    assert np.isfinite(coarse.positions).all()
    assert (np.abs(np.diff(coarse.positions, axis=0)).max(axis=(1, 2, 3)) > 0).all(), "it moves in every frame"


def test_a_longer_animation_shows_the_same_lift_in_more_frames(tmp_path: Path) -> None:
    (_, short), (_, long) = (carried(tmp_path, changed(NOODLES, "frames = 3", f"frames = {n}")) for n in (3, 5))
    assert (short.positions[[0, 1, 2]] == long.positions[[0, 2, 4]]).mean() > 0.99


def test_what_is_carried_looks_like_the_exemplar_one_after_the_other() -> None:
    example = Elements(np.zeros((1, 2, 1, 3)), kind=np.array([3, 5]), colour=np.array([[0.1] * 3, [0.9] * 3]))
    made = looking_like(Elements(np.zeros((1, 5, 1, 3))), example)
    assert made.kind.tolist() == [3, 5, 3, 5, 3]
    assert made.colour[:, 0] == pytest.approx([0.1, 0.9, 0.1, 0.9, 0.1])


def test_an_exemplar_that_has_its_coarse_motion_keeps_it(tmp_path: Path) -> None:
    example, _ = carried(tmp_path, NOODLES)
    assert example.coarse is not None and example.coarse.shape == example.positions.shape
    assert with_coarse(example) is example


# -- the user's


@pytest.mark.parametrize(("content", "expected", "whole"), [
    (lambda of: of.threads(frames=2, samples=40), "tiny.toml: coarse.file: lasts 2 frames, and the animation 3", ()),
    (lambda of: of.threads(frames=4, samples=6), "tiny.toml: coarse.file: 6 samples for an element, and 40 in the exem",
     ("exemplar.npz",)),
    (lambda of: of.sheets(), "tiny.toml: coarse.file: its elements are sheets", ()),
    (lambda of: of.threads(frames=4, samples=40).replace("1,0,3,3,", "1,0,3,nan,"), "c.csv: coarse.file: "
     "frame 1, element 0, samp", ()),
])
def test_a_bad_coarse_motion(home: Path, tables: Any, refused: Callable[..., str], content: Callable[[Any], str],
                             expected: str, whole: tuple[str, ...]) -> None:
    Path("c.csv").write_text(content(tables))
    assert expected in refused(MOTION, *whole)


def test_threads_follow_a_coarse_motion_of_the_users(home: Path, tables: Any, synthesized: Synthesized) -> None:
    Path("c.csv").write_text(tables.threads(count=5, frames=6, samples=40))
    example, output = synthesized(MOTION)
    assert (output.frames, output.count, output.grid) == (3, 5, example.grid)
    assert set(output.size) == set(example.size)


def test_a_gust_tosses_square_sheets(home: Path, tables: Any, refused: Callable[..., str]) -> None:
    Path("a.csv").write_text(tables.sheets(columns=3))
    line = refused(SHEETS.replace("FILE", "a.csv"), "exemplar.npz")
    assert line == 'tiny.toml: coarse.kind: "gust" tosses square sheets; those of the exemplar are 4 × 3'
    Path("a.csv").write_text(tables.sheets())
    shutil.rmtree("out")
    line = refused(changed(SHEETS.replace("FILE", "a.csv"), "count = 4", "count = 9000"), "exemplar.npz")
    assert line.startswith("tiny.toml: elements.count: 1 to 5000 scraps")
