"""The clips of a database: made ones by recipe, a user's own checked, each kept once for all scenes."""

from pathlib import Path

import numpy as np
import pytest
import tiny
from tiny import PHOTO, changed, scene

from pipeline.errors import BadInput
from pipeline.files import video
from pipeline.photo.clips import check_clips, names, own_clip
from pipeline.photo.method import METHOD

OWN = changed(PHOTO, "count = 1", 'count = 0\nfiles = ["c.mp4"]')


def grain(seed: int, shape: tuple[int, ...]) -> np.ndarray:
    from scipy import ndimage

    values = ndimage.gaussian_filter(np.random.default_rng(seed).random(shape), 2, mode="wrap")
    return (values - values.min()) / np.ptp(values)


def falling(frames: int = 24) -> np.ndarray:
    """Water that falls in the middle of a wall that stands."""
    wall, water = grain(1, (96, 128)), grain(2, (96, 128))
    inside = np.zeros((96, 128), bool)
    inside[:, 48:80] = True
    return np.stack([np.where(inside, np.roll(water, 3 * k, axis=0), wall) for k in range(frames)])


def write(folder: Path, frames: np.ndarray, name: str = "c.mp4") -> Path:
    video.write(folder / name, np.repeat(frames[..., None], 3, axis=3), 24, crf=4)
    return folder


def test_names_are_of_all_clips_in_order(tmp_path: Path) -> None:
    write(tmp_path, falling())
    both = scene(tmp_path, changed(PHOTO, "count = 1", 'count = 2\nfiles = ["c.mp4"]'))
    assert names(both, "clip") == ["clip-cloud-01", "clip-cloud-02", "clip-own-01"]
    assert [a.name for a in METHOD.artifacts(both)[:7]] == [
        "clip-cloud-01", "clip-cloud-02", "clip-own-01", "codebook", "index-cloud-01", "index-cloud-02", "index-own-01"]


def test_another_number_of_clips_makes_none_of_them_again(tmp_path: Path) -> None:
    few, many = (tiny.graph(tmp_path, changed(PHOTO, "count = 1", f"count = {n}")) for n in (2, 5))
    for name in ("clip-cloud-01", "clip-cloud-02"):
        assert few.content_id("", name) == many.content_id("", name)
    assert few.content_id("", "codebook") != many.content_id("", "codebook")
    assert few.content_id("", "clip-cloud-01") != few.content_id("", "clip-cloud-02")


def test_a_clip_has_one_name_in_all_scenes(tmp_path: Path) -> None:
    one = tiny.graph(tmp_path, PHOTO)
    more = changed(PHOTO, 'families = ["cloud"]', 'families = ["fall", "cloud"]')
    other = tiny.graph(tmp_path, changed(more, "count = 1", "count = 9"))
    assert one.content_id("", "clip-cloud-01") == other.content_id("", "clip-cloud-01")


def test_the_photograph_is_in_no_clip(tmp_path: Path) -> None:
    one = tiny.graph(tmp_path, PHOTO)
    other = tiny.graph(tmp_path, changed(PHOTO, "width = 96", "width = 128"))
    for name in ("clip-cloud-01", "codebook", "index-cloud-01"):
        assert one.content_id("", name) == other.content_id("", name)


def test_a_users_clip_is_read_lowest_row_first(tmp_path: Path) -> None:
    frames = falling()
    frames[:, :20] = 0.9
    read = own_clip(scene(write(tmp_path, frames), OWN), 0)
    assert read.shape == (24, 96, 128) and read.dtype == np.uint8
    assert read[:, 80:].mean() > 200 > read[:, :60].mean()


def test_a_cut_a_moving_camera_and_a_still_are_told(tmp_path: Path) -> None:
    cut = np.concatenate([falling(12), 1 - falling(12)])
    pan = np.stack([np.roll(grain(3, (96, 256)), 2 * k, axis=1)[:, :128] for k in range(24)])
    still = np.repeat(falling(1), 12, axis=0)
    for frames, told in ((cut, "has a cut after frame 12"), (pan, "the camera moves, by 2.0 pixels a frame"),
                         (still, "nothing moves in it"), (falling(4), "has 4 frames; a clip has at least 8")):
        with pytest.raises(BadInput, match=rf"c\.mp4: clips\.files\[0\]: {told}"):
            check_clips(scene(write(tmp_path, frames), OWN))


def test_a_damaged_clip_is_one_line(tmp_path: Path) -> None:
    write(tmp_path, falling())
    (tmp_path / "c.mp4").write_bytes((tmp_path / "c.mp4").read_bytes()[:900])
    with pytest.raises(BadInput, match=r"c\.mp4: clips\.files\[0\]: "):
        check_clips(scene(tmp_path, OWN))


def test_a_made_clip_is_what_its_recipe_gives(tmp_path: Path) -> None:
    from synth.photo.clips import catalogue

    made = tiny.made(tmp_path, PHOTO, "synth")
    recipe = next(r for r in catalogue(150) if r.family == "cloud")
    stored = made.read("", "clip-cloud-01", 0)
    expected = recipe.clip(16, (64, 64))
    np.testing.assert_array_equal(stored["luma"], expected.luma)
    np.testing.assert_array_equal(stored["velocity"], expected.velocity)
