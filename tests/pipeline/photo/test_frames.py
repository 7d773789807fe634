"""The frames: light that moves inside the matte alone, the same whichever are asked for."""

from pathlib import Path

import numpy as np
import pytest
import tiny
from scipy import ndimage
from tiny import PHOTO, Memory, changed

from pipeline.build.graph import BuildGraph, computed
from pipeline.photo.method import METHOD
from pipeline.photo.target import read_target
from render import tonemap


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> BuildGraph:
    return tiny.made(tmp_path_factory.mktemp("photo"), PHOTO, "render")


def frames(graph: BuildGraph, name: str = "frames") -> np.ndarray:
    return np.stack([graph.read("", name, number) for number in range(1, 9)])


def test_it_moves_inside_the_matte_and_nowhere_else(made: BuildGraph) -> None:
    shown, matte = frames(made), read_target(made.variants[""]).matte[::-1]
    assert shown.shape == (8, *matte.shape, 3)
    assert np.isfinite(shown).all() and shown.min() >= 0 and shown.max() <= 1
    changes = np.abs(np.diff(shown, axis=0)).max(axis=(0, 3))
    assert changes[matte == 0].max() < 1e-3
    assert np.median(changes[matte > 0.95]) > 0.005


def test_the_mean_is_the_photograph_but_for_its_detail(made: BuildGraph) -> None:
    target = read_target(made.variants[""])
    light = tonemap.from_srgb(target.picture)[::-1]
    inside = target.matte[::-1] > 0.5
    found = ndimage.gaussian_filter(frames(made).mean(axis=0) - light, (4, 4, 0))
    assert np.abs(found)[inside].mean() < 0.03


def test_the_motion_follows_the_strokes(made: BuildGraph) -> None:
    target, moves = read_target(made.variants[""]), made.read("", "assignment", 0)["motion"]
    inside = target.matte > 0.9
    speed = np.hypot(moves[..., 0], moves[..., 1])[inside]
    along = (moves * target.wanted.orientation).sum(axis=2)[inside]
    assert np.degrees(np.arccos(np.clip(along / np.maximum(speed, 1e-6), -1, 1))).mean() < 15
    assert not moves[target.matte == 0].any()


def test_a_matte_that_stands_is_the_users(made: BuildGraph) -> None:
    shown = frames(made, "mattes")
    np.testing.assert_allclose(shown[5, ..., 1], read_target(made.variants[""]).matte[::-1], atol=1e-3)


def test_any_frames_are_those_of_the_whole(made: BuildGraph, tmp_path: Path) -> None:
    one = made.variants[""]
    artifact = next(a for a in METHOD.artifacts(one) if a.name == "fluid")
    inputs = Memory(tmp_path, **{name: made.read("", name, 0) for name, _ in artifact.inputs})
    whole = dict(computed(artifact, one, inputs, list(range(1, 9))))
    some = dict(computed(artifact, one, inputs, [3, 6]))
    assert list(some) == [3, 6]
    for number, picture in some.items():
        np.testing.assert_array_equal(picture, whole[number])


def test_a_dynamic_matte_moves(tmp_path: Path) -> None:
    graph = tiny.made(tmp_path, changed(PHOTO, "width = 96", "width = 96\ndynamics = 0.8"), "synth")
    shown = frames(graph, "mattes")[..., 0]
    assert np.abs(np.diff(shown, axis=0)).max() > 0.01
    np.testing.assert_allclose(shown.sum(axis=(1, 2)), shown[0].sum(), rtol=5e-3)
