"""EXR files keep every pixel, the right way up, whatever array it came from."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from pipeline.errors import BadInput, StorageFailed
from pipeline.files import images
from synth.field import Field


def numbered(*shape: int) -> np.ndarray:
    return np.arange(1, np.prod(shape) + 1, dtype=np.float32).reshape(shape)


def drawn(*shape: int) -> np.ndarray:
    return np.random.Generator(np.random.Philox(key=1)).random(shape, np.float32)


@pytest.mark.parametrize("shape", [(1, 1), (2, 3), (5, 7), (64, 48)])
def test_channels_come_back(tmp_path: Path, shape: tuple[int, int]) -> None:
    some = drawn(*shape)
    channels = {"R": some, "Z": numbered(*shape), "albedo.R": -some, "N.X": some * 1e30}
    about = {"seed": "12345678901234567890", "about": '{"m": 16}'}
    images.write(tmp_path / "a.exr", channels, metadata=about)
    back = images.read(tmp_path / "a.exr")
    assert back.keys() == channels.keys()
    for name, values in channels.items():
        assert back[name].dtype == np.float32 and np.array_equal(back[name], values)
    assert about.items() <= images.metadata(tmp_path / "a.exr").items()
    assert [p.name for p in tmp_path.iterdir()] == ["a.exr"]


def test_views_are_written_as_they_look(tmp_path: Path) -> None:
    """OpenEXR itself writes other pixels from these, and says nothing (openexr issue 1929)."""
    rgba = drawn(6, 8, 4)
    turned = rgba.transpose(1, 0, 2)
    for view in (rgba[..., :3], rgba[::-1, ::2, :3], turned[..., 1:], np.asfortranarray(rgba)):
        images.write_picture(tmp_path / "a.exr", view)
        assert np.array_equal(images.read_picture(tmp_path / "a.exr"), view)


def test_the_top_row_is_the_files_first(tmp_path: Path) -> None:
    """As any other program sees it: a picture as it is, a field turned over."""
    picture = np.zeros((4, 3, 3), np.float32)
    picture[0, 2] = (1, 2, 3)
    images.write_picture(tmp_path / "picture.exr", picture)
    with OpenEXR.File(str(tmp_path / "picture.exr")) as file:
        assert np.array_equal(file.channels()["RGB"].pixels[0, 2], (1, 2, 3))
        assert np.allclose(file.header()["chromaticities"], images.REC709)
    values = np.zeros((4, 3, 2), np.float32)
    values[0, 2] = (5, -6)  # lowest row, last column
    images.write_field(tmp_path / "field.exr", Field(values, 0.25, (-1.0, 0.5)))
    with OpenEXR.File(str(tmp_path / "field.exr"), separate_channels=True) as file:
        assert file.channels()["x"].pixels[3, 2] == 5
        assert file.channels()["y"].pixels[3, 2] == -6
        assert "chromaticities" not in file.header()


@pytest.mark.parametrize("components", [(), (2,)])
def test_fields_come_back_with_their_place(tmp_path: Path, components: tuple[int, ...]) -> None:
    field = Field(drawn(5, 7, *components) - 0.5, 0.1, (-1.0 / 3.0, 1e-9))
    images.write_field(tmp_path / "a.exr", field)
    assert images.read_field(tmp_path / "a.exr") == field
    assert images.read_foreign_field(tmp_path / "a.exr", "coarse.file") == field


def test_another_programs_field_lies_on_our_domain(tmp_path: Path) -> None:
    x, y = numbered(4, 8), -numbered(4, 8)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    halves = {"x": x.astype(np.float16), "y": y.astype(np.float16)}
    OpenEXR.File(header, halves).write(str(tmp_path / "a.exr"))
    field = images.read_foreign_field(tmp_path / "a.exr", "coarse.file")
    assert field == Field.centred(np.stack([x[::-1], y[::-1]], axis=-1), 2)


def test_the_same_pixels_are_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a.exr", "b.exr"):
        images.write_picture(tmp_path / name, drawn(40, 30, 3), half=True)
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()


def test_half_floats(tmp_path: Path) -> None:
    picture = drawn(5, 6, 3)
    images.write_picture(tmp_path / "a.exr", picture, half=True)
    assert np.array_equal(images.read_picture(tmp_path / "a.exr"), picture.astype(np.float16))


@pytest.mark.parametrize(("channels", "reason"), [
    ({"R": np.full((2, 2), np.nan)}, "channel R holds NaN or infinity"),
    ({"R": np.full((2, 2), np.inf)}, "channel R holds NaN or infinity"),
    ({"Z": np.full((2, 2), 1e5)}, "channel Z holds values above 65,504"),
    ({"x": np.zeros((2, 2)), "y": np.zeros((2, 3))}, "one size"),
    ({"x": np.zeros((2, 2, 3))}, "not (h, w)"),
])
def test_what_cannot_be_stored_is_refused(tmp_path: Path, channels: dict[str, np.ndarray],
                                          reason: str) -> None:
    with pytest.raises(ValueError) as caught:
        images.write(tmp_path / "a.exr", channels, half=True)
    assert reason in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_a_file_cut_short_is_refused_wherever_it_is_cut(tmp_path: Path) -> None:
    whole = tmp_path / "whole.exr"
    images.write_field(whole, Field(drawn(64, 64, 2), 1.0, (0, 0)))
    content = whole.read_bytes()
    for length in [0, 2, 100, *range(400, len(content), 3001), len(content) - 1]:
        cut = tmp_path / "cut.exr"
        cut.write_bytes(content[:length])
        with pytest.raises(BadInput, match=r"cut\.exr: .*damaged"):
            images.read_field(cut)
    with pytest.raises(BadInput, match=r"cut\.exr: coarse\.file: damaged") as caught:
        images.read_foreign_field(cut, "coarse.file")
    assert "\n" not in str(caught.value)


def test_other_files_and_channels_are_refused(tmp_path: Path) -> None:
    images.write_picture(tmp_path / "a.exr", drawn(2, 2, 3))
    with pytest.raises(BadInput, match="no channels x and y; the file holds: B, G, R"):
        images.read_field(tmp_path / "a.exr")
    images.write(tmp_path / "b.exr", {"Z": drawn(2, 2)})
    with pytest.raises(BadInput, match="no channel R, G, B; the file holds: Z"):
        images.read_picture(tmp_path / "b.exr")
    with pytest.raises(BadInput, match="no such file"):
        images.read(tmp_path / "none.exr")
    with pytest.raises(BadInput, match="damaged"):
        images.read_foreign_field(Path(__file__), "coarse.file")


def test_a_foreign_field_with_infinity_is_refused(tmp_path: Path) -> None:
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    x = np.full((2, 2), np.inf, np.float32)
    OpenEXR.File(header, {"x": x, "y": x.copy()}).write(str(tmp_path / "a.exr"))
    with pytest.raises(BadInput, match=r"coarse\.file: the field holds NaN or infinity"):
        images.read_foreign_field(tmp_path / "a.exr", "coarse.file")


def test_a_full_disk_is_noticed(tiny_disk: Path) -> None:
    old = drawn(8, 8, 3)
    images.write_picture(tiny_disk / "a.exr", old)
    with pytest.raises(StorageFailed, match="disk"):
        images.write_picture(tiny_disk / "a.exr", drawn(300, 300, 3))
    assert [p.name for p in tiny_disk.iterdir()] == ["a.exr"]
    assert np.array_equal(images.read_picture(tiny_disk / "a.exr"), old)


def test_nothing_heavy_is_loaded_before_it_is_used() -> None:
    code = "import sys, pipeline.files.images; sys.exit('OpenEXR' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)
