"""Samples: what each kind gives, and what is no texture."""

from pathlib import Path

import numpy as np
import pytest
from tiny import TEXTURE, Memory, changed, made, scene

from pipeline.errors import BadInput
from pipeline.files import images, pictures
from pipeline.texture.samples import make_sample, read_sample, sample_artifact
from render import tonemap
from synth.texture import procedural

PICTURE = changed(TEXTURE, 'kind = "canes"', 'kind = "picture"\nfile = "a.png"')


def sample(folder: Path, text: str = TEXTURE) -> np.ndarray:
    one = scene(folder, text)
    return next(make_sample(one, Memory(folder), [0]))[1]


@pytest.mark.parametrize("kind", ["canes", "straw", "scales"])
def test_a_procedure_gives_its_picture_top_row_first(tmp_path: Path, kind: str) -> None:
    found = sample(tmp_path, changed(TEXTURE, '"canes"', f'"{kind}"'))
    np.testing.assert_array_equal(found, getattr(procedural, kind)(32)[::-1])


def test_of_a_picture_the_central_square_is_taken_as_linear_light(tmp_path: Path) -> None:
    drawn = np.random.default_rng(1).random((40, 60, 3)).astype(np.float32)
    pictures.write(tmp_path / "a.png", drawn)
    found = sample(tmp_path, changed(PICTURE, "size = 32", "size = 40"))
    assert found.shape == (40, 40, 3)
    np.testing.assert_allclose(tonemap.to_srgb(found), np.rint(drawn[:, 10:50] * 255) / 255, atol=4e-3)


@pytest.mark.parametrize(("value", "told"), [(0.5, "sample: "), (0.0, "sample: ")])
def test_one_colour_is_no_texture_and_nothing_is_written(tmp_path: Path, value: float, told: str) -> None:
    pictures.write(tmp_path / "a.png", np.full((32, 32, 3), value, np.float32))
    with pytest.raises(BadInput, match=told):
        made(tmp_path, PICTURE)
    assert not (tmp_path / "out").exists()


RGBA = np.random.default_rng(2).integers(0, 65536, (40, 40, 4)).astype(np.uint16)
"""A picture of 16 bits, with alpha."""


def stored(file: Path, pixels: np.ndarray, multiplied: bool = False) -> Path:
    """Write pixels in their type, as another program would."""
    import OpenImageIO as oiio

    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], str(pixels.dtype))
    if not multiplied:
        spec.attribute("oiio:UnassociatedAlpha", 1)
    out = oiio.ImageOutput.create(str(file))
    assert out.open(str(file), spec) and out.write_image(pixels) and out.close()
    return file


@pytest.mark.parametrize("name", ["a.png", "a.tif"])
def test_of_sixteen_bits_none_is_lost(tmp_path: Path, name: str) -> None:
    pixels = RGBA[..., :3]
    stored(tmp_path / name, pixels)
    found = sample(tmp_path, changed(PICTURE, "size = 32", "size = 40").replace("a.png", name))
    assert found.shape == (40, 40, 3)
    np.testing.assert_array_equal(np.rint(tonemap.to_srgb(found.astype(np.float64)) * 65535), pixels)


@pytest.mark.parametrize(("name", "multiplied"), [("a.png", False), ("a.tif", False), ("a.tif", True)])
def test_what_is_transparent_is_not_shown_and_colours_are_the_files(tmp_path: Path, name: str, multiplied: bool,
                                                                     ) -> None:
    pixels = RGBA.copy()
    pixels[..., 3] = np.where(np.arange(40) < 20, np.where(np.arange(40) % 2 == 0, 50000, 40000), 20000)
    meant = pixels[..., :3] / 65535
    if multiplied:
        pixels[..., :3] = np.rint(pixels[..., :3] * (pixels[..., 3:] / 65535))
    stored(tmp_path / name, pixels, multiplied)
    found = sample(tmp_path, changed(PICTURE, "size = 32", "size = 40").replace("a.png", name))
    np.testing.assert_array_equal(found[..., 3], np.broadcast_to(np.arange(40) < 20, (40, 40)))
    assert (found[:, 20:] == 0).all()
    # a multiplied value is rounded before it is divided
    np.testing.assert_allclose(tonemap.to_srgb(found[:, :20, :3]), meant[:, :20], atol=2e-5)


def test_where_it_shrinks_the_unseen_does_not_show_at_the_edge_of_the_seen(tmp_path: Path) -> None:
    pixels = np.zeros((128, 128, 4), np.uint8)
    pixels[..., 0] = np.where(np.arange(128) % 32 < 16, 200, 100)[:, None]
    pixels[:, 51:] = (0, 255, 0, 0)
    pixels[:, :51, 3] = 255
    stored(tmp_path / "a.png", pixels)
    found = sample(tmp_path, PICTURE)
    shown = found[..., 3] == 1
    assert 0.3 < shown.mean() < 0.45 and found[shown][:, 1].max() < 1e-6
    assert np.isclose(tonemap.to_srgb(found[shown][:, 0]).max(), 200 / 255, atol=0.02)


def test_light_of_an_exr_is_kept_over_one_and_its_colours_divided_by_alpha(tmp_path: Path) -> None:
    light = (np.random.default_rng(3).random((40, 40, 3)) * 8).astype(np.float32)
    alpha = np.where(np.arange(40) < 30, 0.75, 0.25).astype(np.float32) * np.ones((40, 1), np.float32)
    images.write_picture(tmp_path / "a.exr", np.dstack([light * alpha[..., None], alpha]))
    text = changed(PICTURE, "size = 32", "size = 40").replace("a.png", "a.exr")
    found = sample(tmp_path, text)
    np.testing.assert_allclose(found[:, :30, :3], light[:, :30], rtol=1e-5, atol=1e-5)
    assert (found[:, 30:] == 0).all() and (found[:, :30, 3] == 1).all()
    images.write_picture(tmp_path / "a.exr", light)
    np.testing.assert_array_equal(sample(tmp_path, text), light)


def test_a_grey_exr_is_a_picture_and_light_below_zero_is_none(tmp_path: Path) -> None:
    grey = np.random.default_rng(4).normal(1, 1, (40, 40)).astype(np.float32)
    images.write(tmp_path / "a.exr", {"Y": grey})
    found = sample(tmp_path, changed(PICTURE, "size = 32", "size = 40").replace("a.png", "a.exr"))
    np.testing.assert_array_equal(found, np.repeat(np.maximum(grey, 0)[..., None], 3, axis=2))


@pytest.mark.parametrize("method", ["carry", "paper"])
def test_frames_keep_light_over_one_and_show_nothing_transparent(tmp_path: Path, method: str) -> None:
    """Bright stripes on dark; what is transparent would be green."""
    rng = np.random.default_rng(5)
    light = np.zeros((64, 64, 4), np.float32)
    light[..., 0] = np.where(np.arange(64)[:, None] % 8 < 4, 6.0, 0.2) * rng.uniform(0.8, 1.2, (64, 64))
    light[..., 3] = 1
    light[:, 52:] = (0, 0, 0, 0)
    light[:, 52:, 1] = 5
    images.write_picture(tmp_path / "a.exr", light)
    text = PICTURE.replace("a.png", "a.exr").replace("[texture]", f'[texture]\nmethod = "{method}"')
    graph = made(tmp_path, changed(text, "size = 32", "size = 64").replace("[64, 48]", "[128, 96]"))
    for frame in (1, 3):
        shown = graph.read("", "frames", frame)
        assert 4 < np.quantile(shown[..., 0], 0.9) <= 7.21 and shown[..., 1].max() == 0


SPOILT = {
    "one colour": (lambda f: pictures.write(f, np.full((32, 32, 3), 0.5)), "tiny.toml: sample: the sample is of one c"),
    "one pixel": (lambda f: pictures.write(f, np.full((1, 1, 3), 0.5)), "tiny.toml: sample: the sample is of one c"),
    "no picture": (lambda f: f.write_text("none"), "a.png: sample.file: no picture"),
    "cut": (lambda f: (stored(f, RGBA), f.write_bytes(f.read_bytes()[:4000])), "a.png: sample.file: damaged or cut"),
    "transparent": (lambda f: stored(f, np.dstack([RGBA[..., :3], np.zeros((40, 40), np.uint16)])),
                    "tiny.toml: sample: the sample is transparent everywhere"),
}


@pytest.mark.parametrize("how", SPOILT)
def test_what_is_no_sample_is_one_line_and_nothing_is_written(tmp_path: Path, how: str) -> None:
    spoil, told = SPOILT[how]
    spoil(tmp_path / "a.png")
    refused(tmp_path, PICTURE, told)


@pytest.mark.parametrize(("channels", "told"), [
    ({"R": np.nan, "G": 0, "B": 0}, "a.exr: sample.file: holds NaN or infinity"),
    ({"R": np.inf, "G": 0, "B": 0}, "a.exr: sample.file: holds NaN or infinity"),
    ({"R": 7e4, "G": 0, "B": 0}, "a.exr: sample.file: holds 70000; frames hold 65504 at most"),
    ({"x": 0, "y": 0}, "a.exr: sample.file: no channels R, G, B or Y; the file holds: "),
])
def test_light_that_frames_cannot_show_is_one_line(tmp_path: Path, channels: dict[str, float], told: str) -> None:
    import OpenEXR

    noise = np.random.default_rng(6).random((32, 32)).astype(np.float32)
    stored = {name: noise.copy() for name in channels}
    for name, value in channels.items():
        stored[name][3, 5] = value
    OpenEXR.File({}, dict(stored)).write(str(tmp_path / "a.exr"))
    refused(tmp_path, PICTURE.replace("a.png", "a.exr"), told)


def test_a_sample_larger_than_the_output_is_refused_before_it_is_read(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_text("no picture")
    refused(tmp_path, changed(PICTURE, "size = 32", "size = 64"), "tiny.toml: sample.size: a sample of 64² is larger")


def refused(folder: Path, text: str, told: str) -> None:
    """A scene is refused in one line that holds `told`, and nothing is written."""
    with pytest.raises(BadInput) as caught:
        made(folder, text)
    assert told in str(caught.value) and "\n" not in str(caught.value) and caught.value.exit_code == 2
    assert not (folder / "out").exists()


def test_a_panel_shows_what_is_transparent_as_paper(tmp_path: Path) -> None:
    pixels = RGBA.copy()
    pixels[..., 3] = np.where(np.arange(40) < 20, 65535, 0)
    stored(tmp_path / "a.png", pixels)
    graph = made(tmp_path, PICTURE)
    picture = graph.read("", "sample", 0)
    assert picture.shape == (32, 32, 4)
    shown = tonemap.to_display(picture, "straight")
    assert shown.shape == (32, 32, 3) and (shown[:, 17:] > 0.999999).all() and shown[:, :15].mean() < 0.8


@pytest.mark.parametrize("degrees", [-90.0, 270.0, -360.0, 360.0])
def test_a_direction_is_modulo_a_turn(degrees: float) -> None:
    found = read_sample(procedural.scales(32), degrees).direction
    assert np.isclose(found, np.radians(degrees) % (2 * np.pi))


def test_it_depends_on_its_table_alone(tmp_path: Path) -> None:
    assert sample_artifact(scene(tmp_path, TEXTURE)).reads == ("sample",)
