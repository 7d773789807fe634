"""The frames: what they move with, what they depend on, masks, and runs that go on."""

from pathlib import Path

import numpy as np
import pytest
import tiny
from scipy import ndimage
from tiny import BY_PAPER, LOOP, TEXTURE, TEXTURE_ON_SURFACE, Memory, changed, scene

from pipeline.build.graph import computed
from pipeline.files import images
from pipeline.texture.frames import velocity
from pipeline.texture.method import METHOD
from render import lic, speed_map, tonemap
from synth import obstacle
from synth.field import Field
from synth.projection import divergence

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


FREE = changed(TEXTURE, "size = [64, 48]", "size = [64, 48]\ndivergence_free = true")


def free(folder: Path, v: np.ndarray, text: str = FREE, **files: Field) -> np.ndarray:
    """The part free of divergence of v (Y, X, 2), pixels per frame."""
    one = scene(folder, text)
    flow = next(a for a in METHOD.artifacts(one) if a.name == "flow")
    ((_, found),) = computed(flow, one, Memory(folder, L=Field.centred(v, 2).per_second(30), **files), [1])
    return found.per_frame(30).values


def places(times: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """x and y of the pixels from the middle, (48, 64) times `times` each, in heights."""
    rows, columns = 48 * times, 64 * times
    y, x = (np.mgrid[:rows, :columns] - np.array([rows - 1, columns - 1]).reshape(2, 1, 1) / 2) / rows
    return x, y


def test_of_a_pure_source_nothing_is_left_and_the_texture_rests(tmp_path: Path) -> None:
    text = changed(FREE, "size = [64, 48]", "size = [192, 144]")
    x, y = places(3)
    source = (np.stack([x, y], -1) * 20 * np.exp(-(x * x + y * y) / (2 * 0.08**2))[..., None]).astype(np.float32)
    assert np.hypot(*source.T).max() > 0.9
    left = free(tmp_path, source, text)
    assert left.shape == (144, 192, 2) and not left.any()
    assert not velocity(scene(tmp_path, text), Memory(tmp_path, flow=Field.centred(left, 2)), 1).any()


def test_a_rotation_is_free_of_divergence_already_and_unchanged(tmp_path: Path) -> None:
    x, y = places()
    rotation = (2 * np.stack([-y, x], -1)).astype(np.float32)
    np.testing.assert_allclose(free(tmp_path, rotation), rotation, atol=2e-6)


def test_what_is_left_has_no_divergence_and_goes_round_a_stone(tmp_path: Path) -> None:
    v = np.random.default_rng(1).normal(size=(48, 64, 2)).astype(np.float32)
    v = np.stack([ndimage.gaussian_filter(v[..., c], 4) for c in (0, 1)], -1) * 10
    found = free(tmp_path, v)
    rms = np.sqrt(np.mean(np.square(divergence(v, "open"))))
    assert np.abs(divergence(found, "open")).max() < 1e-4 * rms and np.abs(found).mean() > 0.1 * np.abs(v).mean()
    text = STONE.replace("size = [64, 48]", "size = [64, 48]\ndivergence_free = true")
    distance = obstacle.ball((48, 64), (0, 0.5), 0.2).distance
    found = free(tmp_path, v, text, solid=Field.centred(distance / 48, 2))
    assert np.sqrt(np.mean(np.square(divergence(found, "open", distance)))) < 1e-3 * rms
    wall = np.abs(distance) < 1
    through = np.abs(np.sum(found * obstacle.outward(distance), -1))[wall].mean()
    assert through < 0.35 * np.hypot(*found[wall].T).mean()


def test_frames_and_lines_are_of_the_part_free_of_divergence(tmp_path: Path) -> None:
    """A wind that gathers where it slows down: the frames that follow all of it are others."""
    v = np.zeros((12, 16, 2), np.float32)
    v[..., 0] = 2 - np.arange(16) / 8
    images.write_field(tmp_path / "wind.exr", Field.centred(v, 2))
    text = changed(TEXTURE, 'kind = "analytic"\nflow = "rotation"\nsize = [16, 12]', 'kind = "file"\nfile = "wind.exr"')
    freed = changed(text, "size = [64, 48]", "size = [64, 48]\ndivergence_free = true")
    pictures = []
    for number, one in enumerate((text, freed)):
        (tmp_path / str(number)).mkdir()
        (tmp_path / str(number) / "wind.exr").write_bytes((tmp_path / "wind.exr").read_bytes())
        graph = tiny.made(tmp_path / str(number), one)
        pictures.append([graph.read("", name, 3) for name in ("frames", "flow-lines")])
    (all_of_it, lines), (part, its_lines) = pictures
    assert np.abs(all_of_it - part).mean() > 0.001 and np.abs(lines - its_lines).mean() > 0.001
    named = {a.name: [name for name, _ in a.inputs] for a in METHOD.artifacts(scene(tmp_path, freed))}
    assert named["flow"] == ["L"] and "L" not in named["frames"] + named["flow-lines"]


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


def test_any_frames_of_a_loop_are_those_of_the_whole(tmp_path: Path) -> None:
    """A farm makes the frames of a loop in batches; each process finds the same patches."""
    one, graph = scene(tmp_path, LOOP), tiny.made(tmp_path, LOOP, "synth")
    frames = next(a for a in METHOD.artifacts(one) if a.name == "frames")
    inputs = Memory(tmp_path, sample=graph.read("", "sample", 0), L=[graph.read("", "L", n) for n in range(1, 7)])
    whole = dict(computed(frames, one, inputs, [1, 2, 3, 4, 5, 6]))
    some = dict(computed(frames, one, inputs, [2, 5]))
    assert list(some) == [2, 5]
    for number, picture in some.items():
        np.testing.assert_array_equal(picture, whole[number])
    assert np.abs(some[5] - some[2]).mean() > 0.001


def test_the_length_of_a_loop_is_in_its_key_alone(tmp_path: Path) -> None:
    def made(text: str) -> str:
        return str(tiny.graph(tmp_path, text).require("", "frames", 1).key)

    tiny.made(tmp_path, LOOP, "synth")
    loop = made(LOOP)
    tiny.made(tmp_path, changed(LOOP, "frames = 6", "frames = 7"), "synth")
    assert made(changed(LOOP, "frames = 6", "frames = 7")) != loop


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


def test_the_lines_of_the_flow_leave_an_obstacle_plain(tmp_path: Path) -> None:
    graph = tiny.made(tmp_path, STONE.replace("panel = 32", "panel = 128"))
    lines = tonemap.to_srgb(graph.read("", "flow-lines", 1))
    y, x = np.mgrid[:96, :128] - np.array([47.5, 63.5]).reshape(2, 1, 1)
    inside = np.hypot(x, y) < 0.2 * 96 - 3
    np.testing.assert_allclose(lines[inside], lic.SOLID, atol=1e-3)
    assert lines[np.hypot(x, y) > 0.2 * 96 + 3].std() > 0.1


TINTED = changed(TEXTURE, "panel = 32", 'panel = 32\noverlay = "speed"')


def test_the_overlay_shows_the_speed_of_the_flow_itself_and_not_that_of_the_texture(tmp_path: Path) -> None:
    """A rotation: slow in the middle, fast at the corners, though the texture has one speed everywhere."""
    graph = tiny.made(tmp_path, changed(TINTED, "size = [64, 48]", 'size = [64, 48]\nspeed = "normalized"'))
    L, speed = graph.read("", "L", 2), graph.read("", "speed", 2)
    np.testing.assert_allclose(speed.values, np.hypot(L.values[..., 0], L.values[..., 1]), rtol=1e-6)
    lab = tonemap.linear_to_oklab(graph.read("", "tinted", 2))
    x, y = places()
    away = np.hypot(x, y)
    inner, outer = lab[away < 0.1].mean(0), lab[(away > 0.5) & (away < 0.7)].mean(0)
    least, greatest = speed.values.min(), speed.values.max()
    for found, where in ((inner, away < 0.1), ((outer), (away > 0.5) & (away < 0.7))):
        share = (lic.resampled(speed.values, 48, 64)[where].mean() - least) / (greatest - least)
        assert np.abs(found - speed_map.colours(share)).max() < 0.06
    assert outer[0] - inner[0] > 0.2
    frame = tonemap.linear_to_oklab(graph.read("", "frames", 2))[..., 0]
    near = away < 0.15
    assert np.corrcoef(lab[near][:, 0], frame[near])[0, 1] > 0.8


def test_an_obstacle_is_plain_in_the_overlay_and_the_speed_beside_land_is_that_of_the_sea(tmp_path: Path) -> None:
    stone = changed(STONE, "panel = 32", 'panel = 32\noverlay = "speed"')
    graph = tiny.made(tmp_path, stone)
    shown = tonemap.to_srgb(graph.read("", "tinted", 3))
    x, y = places()
    np.testing.assert_allclose(shown[np.hypot(x, y) < 0.13], lic.SOLID, atol=1e-3)
    one = scene(tmp_path, stone)
    values = np.zeros((12, 16, 2), np.float32)
    values[:, :8, 0] = 3  # no values on land, the right half
    sea = Field.centred((31.5 - np.arange(64)) / 48 * np.ones((48, 1)), 2)
    speed = next(a for a in METHOD.artifacts(one) if a.name == "speed")
    ((_, found),) = computed(speed, one, Memory(tmp_path, L=Field.centred(values, 2), solid=sea), [1])
    np.testing.assert_allclose(found.values, 3)


def test_the_legend_is_of_all_frames_and_a_flow_of_one_speed_has_one_too(tmp_path: Path) -> None:
    graph = tiny.made(tmp_path, changed(TINTED, '"rotation"', '"constant"'))
    legend = graph.read("", "speed-legend", 0)
    speed = float(graph.read("", "speed", 1).values.max())
    meant = speed_map.legend(0.0, speed, "heights per second", 32)
    np.testing.assert_allclose(tonemap.to_srgb(legend), meant, atol=1e-3)
    noise = changed(TINTED, 'kind = "analytic"\nflow = "rotation"', 'kind = "curl-noise"\nperiod = 2')
    graph = tiny.made(tmp_path, noise)
    speeds = [graph.read("", "speed", n).values for n in (1, 2, 3)]
    greatest = [float(s.max()) for s in speeds]
    assert greatest[0] != greatest[2]
    meant = speed_map.legend(min(float(s.min()) for s in speeds), max(greatest), "heights per second", 32)
    np.testing.assert_allclose(tonemap.to_srgb(graph.read("", "speed-legend", 0)), meant, atol=1e-3)


def test_moments_are_rendered_where_there_is_no_animation(tmp_path: Path) -> None:
    text = changed(TINTED, "panel = 32", "panel = 32\nmoments = [1, 2]\nzoom = [0.5, 0.5, 0.5]\nanimation = false")
    graph = tiny.made(tmp_path, text)
    assert (graph.root / "tiny.png").is_file() and not (graph.root / "tiny.mp4").exists()
    assert sorted(file.name for file in (graph.root / "images").glob("zoom.*")) == [
        f"zoom.{n:04d}.exr" for n in (1, 2, 3)]


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
