"""An artifact: what its files are called, which frames there are, and that what makes it captures nothing."""

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from pipeline.build.artifact import Artifact
from pipeline.files.images import FIELD
from pipeline.tables import FigureTable


def make(scene: Any, inputs: Any, frames: list[int]) -> Iterator[tuple[int, Any]]:
    raise AssertionError("no test here makes it")


def artifact(stage: str = "bake", **how: Any) -> Artifact:
    return Artifact("P", stage, FIELD, (), (), make, **how)


def scene(frames: int = 3, frame: int = 0, animation: bool = True) -> Any:
    return SimpleNamespace(frames=frames, figure=FigureTable(frame=frame, animation=animation))


def test_a_series_is_numbered_from_1_and_a_single_file_is_not() -> None:
    assert [artifact().file(frame) for frame in artifact().frames(scene(2))] == ["P.0001.exr", "P.0002.exr"]
    single = artifact(animated=False)
    assert [single.file(frame) for frame in single.frames(scene())] == ["P.exr"]


def test_names_sort_as_frames_do() -> None:
    names = [artifact().file(frame) for frame in artifact().frames(scene(9999))]
    assert names == sorted(names)
    assert (len(set(names)), names[-1]) == (9999, "P.9999.exr")


def test_without_an_animation_only_the_shown_frame_is_baked_and_all_are_synthesized() -> None:
    assert artifact().frames(scene(frame=2, animation=False)) == [2]
    assert artifact().frames(scene(animation=False)) == [3]
    assert artifact("synth").frames(scene(animation=False)) == [1, 2, 3]
    assert artifact(still=True).frames(scene(frame=2)) == [2]


def test_a_closure_cannot_make_it_for_the_key_would_not_know_what_it_captures() -> None:
    captured = 2

    def closure(scene: Any, inputs: Any, frames: list[int]) -> Iterator[tuple[int, Any]]:
        yield captured, None

    with pytest.raises(ValueError, match="P: make is a closure"):
        Artifact("P", "bake", FIELD, (), (), closure)
