"""PNG files: eight bits, right way up, and a clear word about what is none."""

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import BadInput, StorageFailed
from pipeline.files import pictures


def drawn(*shape: int) -> np.ndarray:
    return np.random.Generator(np.random.Philox(key=1)).random(shape, np.float32)


def png(path: Path, pixels: np.ndarray, colour_type: int) -> Path:
    """A PNG made by hand, without a library: an independent word on what the file means."""
    depth = pixels.dtype.itemsize * 8
    height, width = pixels.shape[:2]
    rows = b"".join(b"\0" + row.astype(pixels.dtype.newbyteorder(">")).tobytes() for row in pixels)

    def chunk(name: bytes, content: bytes) -> bytes:
        named = name + content
        return struct.pack(">I", len(content)) + named + struct.pack(">I", zlib.crc32(named))

    header = struct.pack(">IIBBBBB", width, height, depth, colour_type, 0, 0, 0)
    chunks = chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunks)
    return path


@pytest.mark.parametrize("shape", [(1, 1, 3), (5, 7, 3), (4, 6)])
def test_what_is_written_is_read(tmp_path: Path, shape: tuple[int, ...]) -> None:
    pixels = (drawn(*shape) * 256).astype(np.uint8)
    pictures.write(tmp_path / "a.png", pixels)
    back = pictures.read(tmp_path / "a.png")
    expected = pixels if pixels.ndim == 3 else np.repeat(pixels[..., None], 3, axis=2)
    assert back.dtype == np.float32 and np.array_equal(np.rint(back * 255), expected)
    assert np.array_equal(pictures.read_foreign(tmp_path / "a.png", "key"), back)


def test_views_are_written_as_they_look(tmp_path: Path) -> None:
    whole = (drawn(8, 6, 4) * 256).astype(np.uint8)
    for view in (whole[::-1, ::2, :3], whole.transpose(1, 0, 2)[..., 1:], np.asfortranarray(whole[..., :3])):
        pictures.write(tmp_path / "a.png", view)
        assert np.array_equal(np.rint(pictures.read(tmp_path / "a.png") * 255), view)


def test_floats_are_rounded_and_clipped() -> None:
    given = np.array([[-1.0, 0.0, 0.499 / 255, 0.501 / 255, 1.0, 7.0]])
    assert pictures.as_bytes(given).tolist() == [[0, 0, 0, 1, 255, 255]]


@pytest.mark.parametrize(("pixels", "colour_type", "expected"), [
    (np.array([[[255, 0, 51]]], np.uint8), 2, (1.0, 0.0, 0.2)),
    (np.array([[51]], np.uint8), 0, (0.2, 0.2, 0.2)),
    (np.array([[[13107, 0, 65535]]], np.uint16), 2, (0.2, 0.0, 1.0)),
    (np.array([[[255, 0, 0, 0]]], np.uint8), 6, (1.0, 1.0, 1.0)),     # wholly transparent: white
    (np.array([[[255, 0, 0, 51]]], np.uint8), 6, (1.0, 0.8, 0.8)),    # a fifth of red on white
    (np.array([[[0, 102]]], np.uint8), 4, (0.6, 0.6, 0.6)),           # two fifths of black on white
])
def test_every_kind_of_png_is_understood(tmp_path: Path, pixels: np.ndarray, colour_type: int,
                                         expected: tuple[float, ...]) -> None:
    picture = pictures.read_foreign(png(tmp_path / "a.png", pixels, colour_type), "exemplar.file")
    assert picture.shape == (1, 1, 3)
    assert np.allclose(picture[0, 0], expected, atol=1e-6)


@pytest.mark.parametrize("channels", [1, 2, 3, 4])
@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_colours_of_any_depth_come_as_stored_beside_their_alpha(tmp_path: Path, kind: type, channels: int) -> None:
    most = np.iinfo(kind).max
    pixels = (drawn(5, 7, channels) * most).astype(kind)
    pixels[0, 0] = most
    pixels[1, 1, -1] = 0
    read = pictures.read_coloured(png(tmp_path / "a.png", pixels, {1: 0, 2: 4, 3: 2, 4: 6}[channels]), "sample.file")
    assert not read.is_linear and read.colour.shape == (5, 7, 3) and read.colour.dtype == np.float32
    colours = pixels[..., :-1] if channels in (2, 4) else pixels
    np.testing.assert_array_equal(np.rint(read.colour.astype(np.float64) * most),
                                  np.broadcast_to(colours, (5, 7, 3)))
    if channels in (2, 4):
        assert read.alpha is not None
        np.testing.assert_array_equal(np.rint(read.alpha.astype(np.float64) * most), pixels[..., -1])
    else:
        assert read.alpha is None


def test_grey_values_have_the_lowest_row_first(tmp_path: Path) -> None:
    pixels = np.zeros((3, 2), np.uint8)
    pixels[0, 1] = 255  # top right
    grey = pictures.read_grey(png(tmp_path / "a.png", pixels, 0), "exemplar.file")
    assert np.allclose(grey, [[0, 0], [0, 0], [0, 1]], atol=1e-6)


def test_a_file_cut_short_is_refused_wherever_it_is_cut(tmp_path: Path) -> None:
    pictures.write(tmp_path / "whole.png", drawn(64, 64, 3))
    content = (tmp_path / "whole.png").read_bytes()
    cut = tmp_path / "cut.png"
    for length in [0, 4, 20, *range(40, len(content) - 20, 1009)]:
        cut.write_bytes(content[:length])
        with pytest.raises(BadInput, match=r"cut\.png: (damaged|no picture)"):
            pictures.read(cut)
    with pytest.raises(BadInput, match=r"cut\.png: exemplar\.file: damaged or cut short") as caught:
        pictures.read_grey(cut, "exemplar.file")
    assert "\n" not in str(caught.value)


def test_what_is_no_picture_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="no picture"):
        pictures.read_foreign(Path(__file__), "exemplar.file")
    with pytest.raises(BadInput, match="no such file"):
        pictures.read(tmp_path / "none.png")
    for picture, reason in ((np.zeros((2, 2, 2)), "shape"), (np.full((2, 2, 3), np.nan), "NaN")):
        with pytest.raises(ValueError, match=reason):
            pictures.write(tmp_path / "a.png", picture)
    huge = png(tmp_path / "huge.png", np.zeros((1, pictures.LARGEST + 1), np.uint8), 0)
    with pytest.raises(BadInput, match="16384 a side are the most"):
        pictures.read_foreign(huge, "exemplar.file")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["huge.png"]


def test_the_same_pixels_are_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a.png", "b.png"):
        pictures.write(tmp_path / name, drawn(40, 30, 3))
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_a_full_disk_is_noticed(tiny_disk: Path) -> None:
    pictures.write(tiny_disk / "a.png", drawn(8, 8, 3))
    with pytest.raises(StorageFailed, match="disk"):
        pictures.write(tiny_disk / "a.png", drawn(400, 400, 3))
    assert [p.name for p in tiny_disk.iterdir()] == ["a.png"]
    assert pictures.read(tiny_disk / "a.png").shape == (8, 8, 3)


def test_flip_is_zero_for_the_same_and_one_for_black_and_white() -> None:
    black, white, some = np.zeros((64, 64, 3)), np.ones((64, 64, 3)), drawn(64, 64, 3)
    assert pictures.flip(some, some).max() == 0
    assert pictures.flip(black, white)[16:-16, 16:-16].min() > 0.95
    slight = pictures.flip(some, np.clip(some + 0.02, 0, 1)).mean()
    assert 0 < slight < pictures.flip(some, np.clip(some + 0.2, 0, 1)).mean()


def test_resizing_keeps_a_plain_colour_and_the_way_up() -> None:
    plain = np.full((10, 14, 3), 0.25, np.float32)
    assert np.allclose(pictures.resized(plain, 7, 5), 0.25, atol=1e-5)
    half = np.zeros((8, 8, 3), np.float32)
    half[:4] = 1  # white on top
    small = pictures.resized(half, 4, 4)
    assert small.shape == (4, 4, 3) and small[0].min() > 0.9 and small[-1].max() < 0.1


@pytest.mark.parametrize(("size", "scaled"), [((120, 80), (60, 40)), ((1280, 852), (240, 160)), ((60, 40), (120, 80))])
def test_the_triangle_kernel_does_not_overshoot(size: tuple[int, int], scaled: tuple[int, int]) -> None:
    """A mask stays black far from what is white, and white inside it."""
    mask = np.zeros((size[1], size[0], 1), np.float32)
    mask[:, size[0] // 2:] = 1
    small = pictures.resized(mask, *scaled, "triangle")[..., 0]
    middle, reach = scaled[0] // 2, 2
    np.testing.assert_array_equal(small[:, :middle - reach], 0)
    np.testing.assert_allclose(small[:, middle + reach:], 1, atol=1e-6)
    assert (np.diff(small, axis=1) >= -1e-6).all()


def test_a_picture_many_times_as_large_is_averaged_before_it_is_filtered(tmp_path: Path) -> None:
    """A ramp stays one, in its place; grain of single pixels becomes its mean."""
    ramp = np.linspace(0, 1, 1003)[None, :, None] * np.ones((701, 1, 3))
    grain = np.random.default_rng(1).random((701, 1003, 1)) * 0.2 - 0.1
    pictures.write(tmp_path / "a.png", (0.8 * ramp + 0.1 + grain).astype(np.float32))
    read = pictures.read_scaled(tmp_path / "a.png", "photo.file", 20, 1.0, 2000)
    assert read.of == (701, 1003) and read.picture.shape == (14, 20, 3)
    expected = 0.8 * (np.arange(20) + 0.5) / 20 + 0.1
    np.testing.assert_allclose(read.picture[7, 2:-2, 1], expected[2:-2], atol=0.005)
    with pytest.raises(BadInput, match=r"a\.png: photo\.file: has 1003 x 701 pixels; 1000 a side are the most"):
        pictures.read_scaled(tmp_path / "a.png", "photo.file", 20, 1.0, 1000)
