"""The clips of a database: made ones by recipe, a user's own checked, each kept once for all scenes."""

from pathlib import Path

import footage
import numpy as np
import pytest
import tiny
from footage import falling
from tiny import PHOTO, changed, scene

from pipeline.errors import BadInput
from pipeline.photo.clips import names
from pipeline.photo.method import METHOD

OWN = changed(PHOTO, "count = 1", 'count = 0\nfiles = ["c.mp4"]')


def test_names_are_of_all_clips_in_order(tmp_path: Path) -> None:
    footage.write(tmp_path / "c.mp4", falling())
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


def test_a_users_clips_are_refused_before_anything_is_made(tmp_path: Path) -> None:
    footage.write(tmp_path / "c.mp4", np.concatenate([falling(12), 1 - falling(12)]))
    with pytest.raises(BadInput, match=r"c\.mp4: clips\.files\[0\]: has a cut after frame 12"):
        tiny.made(tmp_path, OWN)
    assert not (tmp_path / "out").exists()


def test_another_clip_makes_no_clip_again(tmp_path: Path) -> None:
    for name in ("c.mp4", "d.mp4"):
        footage.write(tmp_path / name, falling())
    one, both = tiny.graph(tmp_path, OWN), tiny.graph(tmp_path, changed(OWN, '"c.mp4"', '"c.mp4", "d.mp4"'))
    assert one.content_id("", "clip-own-01") == both.content_id("", "clip-own-01")


def test_a_made_clip_is_what_its_recipe_gives(tmp_path: Path) -> None:
    from synth.photo.clips import catalogue

    made = tiny.made(tmp_path, PHOTO, "synth")
    recipe = next(r for r in catalogue(150) if r.family == "cloud")
    stored = made.read("", "clip-cloud-01", 0)
    expected = recipe.clip(16, (64, 64))
    np.testing.assert_array_equal(stored["luma"], expected.luma)
    np.testing.assert_array_equal(stored["velocity"], expected.velocity)
