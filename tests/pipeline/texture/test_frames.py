"""The frames: what they move with, what they depend on, masks, and runs that go on."""

from pathlib import Path

import numpy as np
import pytest
import tiny
from scipy import ndimage
from tiny import BY_PAPER, TEXTURE, TEXTURE_ON_SURFACE, Memory, changed, scene

from pipeline.build.graph import computed
from pipeline.texture.frames import velocity
from pipeline.texture.method import METHOD
from synth.field import Field

STONE = TEXTURE + '[[obstacles]]\nkind = "ball"\ncentre = [0.0, 0.5]\nradius = 0.2\n'


def L(speed: float) -> Field:
    """A flow to the right of so many pixels of the picture per frame, on 12 rows."""
    values = np.zeros((12, 16, 2), np.float32)
    values[..., 0] = speed / 4
    return Field.centred(values, 2).per_second(30)


@pytest.mark.parametrize(("keys", "speed", "expected"), [
    ("", 1.0, 1.0), ("", 9.0, 2.2), ("", 0.1, 0.3), ('speed = "normalized"\npace = 1.5', 9.0, 1.5)])
def test_the_speed_is_limited_or_the_same_everywhere(tmp_path: Path, keys: str, speed: float, expected: float) -> None:
    one = scene(tmp_path, changed(TEXTURE, "size = [64, 48]", f"size = [64, 48]\n{keys}"))
    v = velocity(one, Memory(tmp_path, L=L(speed)), 1)
    assert v.shape == (48, 64, 2)
    np.testing.assert_allclose(v, np.broadcast_to([expected, 0.0], v.shape), atol=1e-5)


@pytest.mark.parametrize("text", [TEXTURE, BY_PAPER], ids=["carry", "paper"])
def test_frames_are_light_top_row_first_and_move(tmp_path: Path, text: str) -> None:
    graph = tiny.made(tmp_path, text, "synth")
    first, last = (graph.read("", "frames", frame) for frame in (1, 3))
    assert first.shape == (48, 64, 3)
    assert np.isfinite(first).all() and first.min() >= 0 and first.max() <= 1.5
    assert np.abs(last - first).mean() > 0.001


@pytest.mark.parametrize("text", [TEXTURE, BY_PAPER], ids=["carry", "paper"])
def test_an_interrupted_run_goes_on_with_the_same_bits(tmp_path: Path, text: str) -> None:
    one = scene(tmp_path, text)
    graph = tiny.made(tmp_path, text, "synth")
    frames = next(a for a in METHOD.artifacts(one) if a.name == "frames")

    def inputs(work: Path) -> Memory:
        work.mkdir()
        return Memory(work, sample=graph.read("", "sample", 0), L=[graph.read("", "L", n) for n in (1, 2, 3)])

    whole = dict(computed(frames, one, inputs(tmp_path / "whole"), [1, 2, 3]))
    stopped = inputs(tmp_path / "stopped")
    list(zip(range(2), computed(frames, one, stopped, [1, 2, 3]), strict=False))
    kept = stopped.checkpoint.load(before=3)
    assert kept is not None and kept[0] in (1, 2)
    np.testing.assert_array_equal(dict(computed(frames, one, stopped, [3]))[3], whole[3])


def test_an_interrupted_run_on_a_surface_goes_on_with_the_same_bits(tmp_path: Path) -> None:
    one = scene(tmp_path, TEXTURE_ON_SURFACE)
    graph = tiny.made(tmp_path, TEXTURE_ON_SURFACE, "synth")
    frames = next(a for a in METHOD.artifacts(one) if a.name == "frames")
    surface = graph.read("", "surface", 0)
    stopped = Memory(tmp_path, sample=graph.read("", "sample", 0), surface=surface)
    list(zip(range(2), computed(frames, one, stopped, [1, 2, 3]), strict=False))
    kept = stopped.checkpoint.load(before=3)
    assert kept is not None and kept[0] in (1, 2)
    last = dict(computed(frames, one, stopped, [3]))[3]
    np.testing.assert_array_equal(last.astype(np.float16).astype(np.float32), graph.read("", "frames", 3))
    # every triangle shows something, and it moves
    rows, columns = (np.clip((places * 256).astype(int), 0, 255) for places in (1 - surface["t"], surface["s"]))
    assert (last[rows, columns].sum(axis=1) > 0).mean() > 0.95  # a corner may be nearest to another's texel
    assert np.abs(last - graph.read("", "frames", 1)).mean() > 1e-3


@pytest.mark.parametrize("text", [STONE, STONE.replace("size = [64, 48]", 'size = [64, 48]\nmethod = "paper"')],
                         ids=["carry", "paper"])
def test_there_is_no_texture_in_an_obstacle(tmp_path: Path, text: str) -> None:
    graph = tiny.made(tmp_path, text, "synth")
    for frame in (1, 3):
        picture = graph.read("", "frames", frame)
        assert (picture[20:28, 28:36] == 0).all()
        assert picture[:, :12].mean() > 0.05


def test_the_other_methods_keys_change_nothing(tmp_path: Path) -> None:
    one = tiny.graph(tmp_path, TEXTURE).content_id("", "frames")
    assert tiny.graph(tmp_path, TEXTURE + "[paper]\nrotations = 24\n").content_id("", "frames") == one
    assert tiny.graph(tmp_path, TEXTURE + "[carry]\nusage = 0.7\n").content_id("", "frames") != one


def test_holes_are_black_in_the_frames_of_the_paper(tmp_path: Path) -> None:
    graph = tiny.made(tmp_path, BY_PAPER, "synth")
    holes, frame = graph.read("", "holes", 3), graph.read("", "frames", 3)
    black = (holes == 0).all(axis=-1)
    assert 0 < black.mean() < 1
    np.testing.assert_array_equal(holes[~black], frame[~black])


def test_a_frame_is_drawn_from_its_maps_alone(tmp_path: Path) -> None:
    """What Blender, Unity or Houdini does with them: sample the picture at u, v, and mix by the weights."""
    text = changed(TEXTURE, "size = [64, 48]", "size = [64, 48]\nmaps = true") + "[carry]\nblend = 0.0\n"
    graph = tiny.made(tmp_path, text, "synth")
    sample = graph.read("", "sample", 0)[::-1]
    for frame in (1, 3):
        maps, expected = graph.read("", "uv", frame), graph.read("", "frames", frame)
        assert maps.shape == (48, 64, 6)
        weights = maps[..., [2, 5]]
        assert (weights >= 0).all() and (weights.sum(axis=-1) <= 1 + 1e-5).all()
        drawn = sum(maps[..., [n + 2]] * looked_up(sample, maps[..., n:n + 2]) for n in (0, 3)) / weights.sum(
            axis=-1, keepdims=True)
        sure = weights.sum(axis=-1) > 0.97
        assert sure.mean() > 0.5
        assert np.abs(drawn - expected)[sure].mean() < 0.1 * expected.std()


def looked_up(sample: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """The sample (H, W, 3), row 0 the lowest, at places (Y, X, 2) from 0 at its left and lower edge to 1."""
    at = [uv[..., 1] * sample.shape[0] - 0.5, uv[..., 0] * sample.shape[1] - 0.5]
    return np.stack([ndimage.map_coordinates(sample[..., c], at, order=3, mode="nearest") for c in range(3)], axis=-1)


def test_maps_are_of_patches(tmp_path: Path) -> None:
    text = changed(BY_PAPER, "size = [64, 48]", "size = [64, 48]\nmaps = true")
    assert tiny.complaint(tiny.written(tmp_path, text)) == (
        'texture.maps: are of patches: there are none with method = "paper"')
