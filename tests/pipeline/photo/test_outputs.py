"""What other programs take: the motion with its channels, the speed map that can be given back."""

from pathlib import Path

import numpy as np
import pytest
import tiny
from tiny import PHOTO, changed

from pipeline.build.graph import BuildGraph
from pipeline.files import images, pictures
from pipeline.photo.outputs import read_motion, speed_map, write_motion


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> BuildGraph:
    text = changed(PHOTO, "width = 96", "width = 96\nfastest = 2.0")
    return tiny.made(tmp_path_factory.mktemp("photo"), text, "synth")


def test_the_motion_is_in_channels_x_and_y_top_row_first(made: BuildGraph) -> None:
    stored = images.read(made.root / "fields" / "motion.exr")
    motion = made.read("", "assignment", 0)["motion"]
    assert sorted(stored) == ["x", "y"]
    for n, name in enumerate("xy"):
        np.testing.assert_array_equal(stored[name], motion[::-1, :, n])
    assert np.abs(motion).max() > 0.2
    assert images.metadata(made.root / "fields" / "motion.exr")["flowloom_unit"] == "pixels per frame"


def test_a_motion_is_read_as_it_was_written(tmp_path: Path) -> None:
    motion = np.random.default_rng(1).normal(size=(5, 7, 2)).astype(np.float32)
    write_motion(tmp_path / "m.exr", motion)
    np.testing.assert_array_equal(read_motion(tmp_path / "m.exr"), motion)


def test_white_is_the_fastest_and_the_top_row_comes_first() -> None:
    motion = np.zeros((3, 1, 2), np.float32)
    motion[:, 0] = [[3, 4], [0, 0], [-10, 0]]
    np.testing.assert_array_equal(speed_map(motion, 10.0)[:, 0], [255, 0, 128])


def test_a_speed_map_that_is_given_back_gives_the_same_speeds(made: BuildGraph, tmp_path: Path) -> None:
    """A paint program that changes nothing changes no speed by more than half a grey level, and no pixel of the map."""
    first = (made.root / "fields" / "speed.png").read_bytes()
    (tmp_path / "speed.png").write_bytes(first)
    text = changed(PHOTO, "width = 96", 'width = 96\nfastest = 2.0\nspeed = "speed.png"')
    again = tiny.made(tmp_path, text, "synth")
    before, after = (np.linalg.norm(of.read("", "assignment", 0)["motion"], axis=2) for of in (made, again))
    assert before.max() > 0.3
    np.testing.assert_allclose(after, np.minimum(before, 2), atol=0.5 * 2 / 255 + 1e-6)
    np.testing.assert_array_equal(pictures.read(again.root / "fields" / "speed.png"),
                                  pictures.read(made.root / "fields" / "speed.png"))


def test_an_edited_speed_map_changes_the_speed_where_it_was_edited(made: BuildGraph, tmp_path: Path) -> None:
    edited = pictures.read(made.root / "fields" / "speed.png")[..., 0].copy()
    edited[32:] = 0.8
    pictures.write(tmp_path / "speed.png", edited)
    text = changed(PHOTO, "width = 96", 'width = 96\nfastest = 2.0\nspeed = "speed.png"')
    motion = tiny.made(tmp_path, text, "synth").read("", "assignment", 0)["motion"]
    speed = np.linalg.norm(motion, axis=2)[::-1]
    flows = speed[40:] > 0
    assert flows.any()
    np.testing.assert_allclose(speed[40:][flows], 2 * 0.8, rtol=1e-5)
