"""The target: its parts at the scene's width, and one line for each that is no use."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tiny
from tiny import PHOTO, changed, scene

from pipeline import cli
from pipeline.errors import BadInput, InvalidValue
from pipeline.files import pictures
from pipeline.photo.frames import frames_memory
from pipeline.photo.target import check_target, flowing_size, read_strokes, read_target

OWN = PHOTO.replace("assets/stream/image.jpg", "a.png").replace("assets/stream/mask.png", "m.png").replace(
    "[[[490, 28], [487, 64]], [[305, 288], [245, 328]]]", "[[[20, 10], [20, 50]]]")
SHAPE = (60, 120)


def own(folder: Path, picture: np.ndarray | None = None, matte: np.ndarray | None = None) -> Path:
    """A picture that is red above and grainy, a matte of its left half."""
    if picture is None:
        picture = np.random.default_rng(1).random((*SHAPE, 3)).astype(np.float32)
        picture[:30] = picture[:30] * 0.2 + [0.8, 0, 0]
    if matte is None:
        matte = np.zeros(SHAPE, np.float32)
        matte[:, :60] = 1
    pictures.write(folder / "a.png", picture)
    pictures.write(folder / "m.png", matte)
    return folder


def test_all_parts_have_the_scenes_width_lowest_row_first(tmp_path: Path) -> None:
    target = read_target(scene(own(tmp_path), OWN))
    assert target.picture.shape == (48, 96, 3)
    assert target.picture[40:, :, 0].mean() > target.picture[:8, :, 0].mean() + 0.2
    assert target.matte.shape == (48, 96)
    assert target.matte[:, :44].min() > 0.95 and target.matte[:, 52:].max() < 0.05


def test_strokes_are_in_pixels_of_the_file_and_point_as_they_were_drawn(tmp_path: Path) -> None:
    """Downwards in the file is downwards."""
    target = read_target(scene(own(tmp_path), OWN))
    np.testing.assert_allclose(target.wanted.orientation[20, 16], [0, -1], atol=1e-5)


def test_a_speed_map_says_the_speed_and_a_frozen_part_stands(tmp_path: Path) -> None:
    own(tmp_path)
    grey = np.full(SHAPE, 0.5, np.float32)
    pictures.write(tmp_path / "s.png", grey)
    frozen = np.zeros(SHAPE, np.float32)
    frozen[20:40, 10:30] = 1
    pictures.write(tmp_path / "f.png", frozen)
    text = changed(OWN, "width = 96", 'width = 96\nspeed = "s.png"\nfastest = 3.0\nfrozen = "f.png"')
    target = read_target(scene(tmp_path, text))
    np.testing.assert_allclose(target.wanted.speed, 1.5, atol=0.01)
    assert target.frozen[24, 16]
    assert target.fluid[24, 16] == 0 and target.fluid[4, 16] == 1


def test_a_stroke_may_have_a_speed(tmp_path: Path) -> None:
    target = read_target(scene(own(tmp_path), changed(OWN, "width = 96", "width = 96\nspeeds = [2.5]")))
    np.testing.assert_allclose(target.wanted.speed, 2.5, atol=1e-5)


@pytest.mark.parametrize(("picture", "matte", "told"), [
    (None, np.zeros(SHAPE), r"m\.png: photo\.matte: is empty"),
    (None, np.ones((60, 100)), r"m\.png: photo\.matte: has 100 x 60 pixels, and the picture 120 x 60"),
    (np.full((*SHAPE, 3), 0.4), np.ones(SHAPE), r"a\.png: photo\.file: is of one colour inside the matte"),
    (np.full((1, 1, 3), 0.4), np.ones((1, 1)), r"a\.png: photo\.file: has 1 x 1 pixels: too few")])
def test_what_is_no_target_is_one_line(tmp_path: Path, picture, matte, told: str) -> None:
    own(tmp_path, None if picture is None else picture.astype(np.float32), matte.astype(np.float32))
    with pytest.raises(BadInput, match=told):
        check_target(scene(tmp_path, OWN))


@pytest.mark.parametrize(("stroke", "told"), [
    ("[[20, 10], [20, 10]]", "has no length"), ("[[20, 10], [200, 10]]", "leaves the picture of 120 x 60 pixels")])
def test_strokes_that_are_none_are_told(tmp_path: Path, stroke: str, told: str) -> None:
    with pytest.raises(InvalidValue, match=told) as caught:
        check_target(scene(own(tmp_path), changed(OWN, "[[20, 10], [20, 50]]", stroke)))
    assert caught.value.key == "photo.strokes[0]"


def test_only_the_part_round_the_matte_flows(tmp_path: Path) -> None:
    """The matte is the left half of 120 pixels, at 96: 48, and a piece to each side of it."""
    assert flowing_size(scene(own(tmp_path), OWN)) == (48, 48 + 2 * 16 + 1)


def test_more_memory_than_there_is_is_told_before_anything_is_made(tmp_path: Path) -> None:
    text = changed(changed(OWN, "width = 96", "width = 4096"), "frames = 8", "frames = 1000")
    needed, key = frames_memory(scene(own(tmp_path), text))
    assert needed > 100e9
    assert key == "photo.width"


def test_what_is_frozen_must_leave_something(tmp_path: Path) -> None:
    own(tmp_path)
    pictures.write(tmp_path / "f.png", np.ones(SHAPE, np.float32))
    with pytest.raises(BadInput, match=r"photo\.frozen: covers all of the matte"):
        check_target(scene(tmp_path, changed(OWN, "width = 96", 'width = 96\nfrozen = "f.png"')))


def test_nothing_is_written_before_the_target_is_known_to_be_good(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                                                  capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    own(tmp_path, None, np.zeros(SHAPE, np.float32))
    tiny.written(tmp_path, OWN)
    assert cli.run(["figure", "tiny.toml"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not (tmp_path / "out").exists()


def with_speed(folder: Path, shape: tuple[int, int]) -> Any:
    """A scene with a speed map of `shape` (h, w) that is white above and black below."""
    speed = np.zeros(shape, np.float32)
    speed[:shape[0] // 2] = 1
    pictures.write(folder / "s.png", speed)
    return scene(own(folder), changed(OWN, "width = 96", 'width = 96\nfastest = 3.0\nspeed = "s.png"'))


@pytest.mark.parametrize("shape", [(60, 120), (48, 96), (120, 240), (25, 50), (33, 65)])
def test_a_speed_map_of_any_size_with_the_pictures_proportions_is_taken(tmp_path: Path, shape: tuple[int, int]) -> None:
    speed = read_target(with_speed(tmp_path, shape)).wanted.speed
    assert speed.shape == (48, 96) and speed.dtype == np.float32
    np.testing.assert_allclose(speed[28:], 3, atol=0.02)
    np.testing.assert_allclose(speed[:20], 0, atol=0.02)


def test_a_speed_map_of_other_proportions_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"s\.png: photo\.speed: has 100 x 60 pixels: other proportions than the "
                                       "picture, whose output has 96 x 48"):
        check_target(with_speed(tmp_path, (60, 100)))


def test_strokes_are_read_in_pixels_of_the_output_from_below(tmp_path: Path) -> None:
    (stroke,) = read_strokes(scene(own(tmp_path), OWN))
    np.testing.assert_allclose(stroke, [[15.9, 39.1], [15.9, 7.1]])
