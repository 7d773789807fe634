"""The looks of surfaces: their keys, what their pictures depend on, and that they show the texture."""

from pathlib import Path

import numpy as np
import tiny
from tiny import TEXTURE_ON_SURFACE, Memory, changed, scene

from pipeline.texture.looks import CeramicRender
from pipeline.texture.surfaces import make_surface


def test_its_picture_depends_on_its_table_and_the_frame(tmp_path: Path) -> None:
    one = tiny.graph(tmp_path, TEXTURE_ON_SURFACE)
    beauty, frames = one.content_id("", "beauty"), one.content_id("", "frames")
    other = tiny.graph(tmp_path, changed(TEXTURE_ON_SURFACE, "spp = 1", "spp = 2"))
    assert other.content_id("", "beauty") != beauty
    assert other.content_id("", "frames") == frames
    turned = tiny.graph(tmp_path, changed(TEXTURE_ON_SURFACE, "size = [256, 256]", "size = [256, 256]\nfastest = 2.0"))
    assert turned.content_id("", "beauty") != beauty


def test_the_surface_shows_the_frame(tmp_path: Path) -> None:
    """A red texture gives a ring that is red, before a backdrop that is not."""
    one = scene(tmp_path, TEXTURE_ON_SURFACE)
    surface = next(make_surface(one, Memory(tmp_path), [0]))[1]
    red = np.zeros((256, 256, 3), np.float32)
    red[..., 0] = 0.5
    inputs = Memory(tmp_path, surface=surface, frames=[red])
    look = CeramicRender(kind="ceramic", width=32, height=24, spp=8)
    picture = dict(look.make_beauty(one, inputs, [1]))[1]
    assert picture.shape == (24, 32, 3) and np.isfinite(picture).all()
    ring, corner = picture[15:17, 8:24].mean(axis=(0, 1)), picture[:4, :4].mean(axis=(0, 1))
    assert ring[0] > 2.5 * ring[1]
    assert corner[0] < 1.5 * corner[1]
