"""Photographs, strokes, clips and databases as users bring them, end to end: one line, the right exit code, nothing
half-written; and pictures of every kind that are good."""

import base64
import struct
import zlib
from pathlib import Path

import footage
import numpy as np
import OpenImageIO as oiio
import pytest
import tiny
from footage import falling
from tiny import PHOTO, changed

from pipeline import cli
from pipeline.build.graph import BuildGraph
from pipeline.files import pictures
from pipeline.photo.frames import widened
from pipeline.photo.target import read_target

SCENE = PHOTO
for old, new in (("assets/stream/image.jpg", "a.png"), ("assets/stream/mask.png", "m.png"),
                 ("width = 96", "width = 64"),
                 ("[[[490, 28], [487, 64]], [[305, 288], [245, 328]]]", "[[[20, 10], [20, 50]]]")):
    SCENE = changed(SCENE, old, new)
OWN = changed(SCENE, "count = 1", 'count = 0\nfiles = ["c.mp4"]')
SHAPE = (60, 120)
RED, BLUE = (220, 40, 30), (30, 60, 200)
CMYK = (  # a JPEG of 24 x 16 pixels, RED above BLUE, as Pillow 13 writes it
    "/9j/7gAOQWRvYmUAZAAAAAAA/9sAQwANCQoLCggNCwoLDg4NDxMgFRMSEhMnHB4XIC4pMTAuKS0sMzpKPjM2RjcsLUBXQUZMTlJT"
    "UjI+WmFaUGBKUVJP/8AAFAgAEAAYBEMRAE0RAFkRAEsRAP/EAB8AAAEFAQEBAQEBAAAAAAAAAAABAgMEBQYHCAkKC//EALUQAAIB"
    "AwMCBAMFBQQEAAABfQECAwAEEQUSITFBBhNRYQcicRQygZGhCCNCscEVUtHwJDNicoIJChYXGBkaJSYnKCkqNDU2Nzg5OkNERUZH"
    "SElKU1RVVldYWVpjZGVmZ2hpanN0dXZ3eHl6g4SFhoeIiYqSk5SVlpeYmZqio6Slpqeoqaqys7S1tre4ubrCw8TFxsfIycrS09TV"
    "1tfY2drh4uPk5ebn6Onq8fLz9PX29/j5+v/aAA4EQwBNAFkASwAAPwDua4muDr06iiiiiiiivCquV7RRRRRRRRRRX//Z")


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory with a grainy picture, a matte of its left half, and a clip of the user's."""
    monkeypatch.chdir(tmp_path)
    pictures.write(tmp_path / "a.png", np.random.default_rng(1).random((*SHAPE, 3)).astype(np.float32))
    pictures.write(tmp_path / "m.png", half())
    footage.write(tmp_path / "c.mp4", falling())
    return tmp_path


def half() -> np.ndarray:
    matte = np.zeros(SHAPE, np.float32)
    matte[:, :60] = 1
    return matte


def refused(text: str, capsys: pytest.CaptureFixture[str]) -> str:
    """The line that a scene with `text` ends with; nothing must have been written."""
    Path("tiny.toml").write_text(text)
    before = sorted(Path().rglob("*"))
    assert cli.run(["synth", "tiny.toml"]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1, err
    assert sorted(Path().rglob("*")) == before
    return err.rstrip()


def stored(name: str, pixels: np.ndarray, orientation: int = 1) -> None:
    """A picture file of any channels and depth."""
    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], str(pixels.dtype))
    spec.attribute("Orientation", orientation)
    out = oiio.ImageOutput.create(name)
    assert out.open(name, spec) and out.write_image(pixels) and out.close()


def flag(shape: tuple[int, int] = (32, 48)) -> np.ndarray:
    """RED above BLUE, uint8, and darker to the right."""
    pixels = np.empty((*shape, 3), np.uint8)
    pixels[:shape[0] // 2], pixels[shape[0] // 2:] = RED, BLUE
    pixels[:, shape[1] * 3 // 4:] //= 4
    return pixels


@pytest.mark.parametrize(("name", "content", "told"), [
    ("m.png", np.zeros(SHAPE), "m.png: photo.matte: is empty: nothing is white, so there is nothing to animate"),
    ("m.png", np.ones((60, 100)), "m.png: photo.matte: has 100 x 60 pixels, and the picture 120 x 60"),
    ("a.png", np.full(SHAPE, 0.4), "a.png: photo.file: is of one colour inside the matte"),
    ("a.png", np.full((1, 1), 0.4), "a.png: photo.file: has 1 x 1 pixels: too few to show a fluid"),
    ("a.png", b"", "a.png: photo.file: no picture"), ("a.png", b"some words", "a.png: photo.file: no picture"),
    ("a.png", 0.6, "a.png: photo.file: damaged or cut short"),
    ("c.mp4", b"", "c.mp4: clips.files[0]: damaged, or no video"),
    ("c.mp4", b"some words", "c.mp4: clips.files[0]: damaged, or no video"),
    ("c.mp4", 0.6, "c.mp4: clips.files[0]: damaged or cut short"),
    ("c.mp4", 0.02, "c.mp4: clips.files[0]: no video in it"),
])
def test_a_file_that_is_no_use(home: Path, capsys: pytest.CaptureFixture[str], name: str,
                               content: np.ndarray | bytes | float, told: str) -> None:
    """A number: the share of the file that is left."""
    if isinstance(content, np.ndarray):
        pictures.write(home / name, content)
    else:
        whole = (home / name).read_bytes()
        (home / name).write_bytes(content if isinstance(content, bytes) else whole[:int(len(whole) * content)])
    assert told in refused(OWN, capsys)


@pytest.mark.parametrize(("stroke", "told"), [
    ("[[20, 10], [20, 10]]", "has no length"), ("[[20, 10], [200, 10]]", "leaves the picture of 120 x 60 pixels"),
    ("[[20, 10]]", "should have at least 2 items"), ("[[20, nan], [30, 10]]", "should be a finite number")])
def test_strokes_that_are_none(home: Path, capsys: pytest.CaptureFixture[str], stroke: str, told: str) -> None:
    line = refused(changed(SCENE, "[[20, 10], [20, 50]]", stroke), capsys)
    assert line.startswith("tiny.toml: photo.strokes[0]") and told in line


def test_sound_alone_is_no_clip(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import av

    with av.open("c.wav", "w") as container:
        stream = container.add_stream("pcm_s16le", rate=8000)
        frame = av.AudioFrame.from_ndarray(np.zeros((1, 8000), np.int16), format="s16", layout="mono")
        frame.sample_rate = 8000
        container.mux(stream.encode(frame))
        container.mux(stream.encode())
    line = refused(changed(OWN, "c.mp4", "c.wav"), capsys)
    assert line.endswith("c.wav: clips.files[0]: no video in it")


def test_a_picture_too_large_is_refused_before_it_is_decoded(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pictures.write(home / "a.png", np.zeros((16, 8193), np.uint8))
    assert "has 8193 x 16 pixels; 8192 a side are the most" in refused(SCENE, capsys)


def made(home: Path, text: str = SCENE) -> BuildGraph:
    return tiny.made(home, text, "synth")


def moves(graph: BuildGraph) -> bool:
    shown = np.stack([graph.read("", "frames", number) for number in (1, 5)])
    return bool(np.isfinite(shown).all() and np.abs(shown[1] - shown[0]).max() > 0.01)


def test_a_full_matte_flows_to_its_edges(home: Path) -> None:
    pictures.write(home / "m.png", np.ones(SHAPE, np.float32))
    assert moves(made(home))


def test_one_clip_alone_will_do_and_its_poor_choice_is_told(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Water falls in it, and the stroke goes up; in a quiet run nothing is told."""
    Path("tiny.toml").write_text(changed(OWN, "[20, 10], [20, 50]", "[20, 50], [20, 10]"))
    assert cli.run(["synth", "tiny.toml"]) == 0
    err = capsys.readouterr().err
    assert "tiny.toml: clips: " in err and err.count("\n") == 1
    assert "pieces of the picture found too few candidates within 45 degrees of the strokes; the angle was" in err
    assert cli.run(["synth", "tiny.toml", "--quiet", "--out", "other"]) == 0
    assert capsys.readouterr().err == ""


def test_what_was_widened_is_named(home: Path) -> None:
    one = tiny.scene(home, changed(OWN, "[photo]", "[photo]\nspeeds = [2.0]"))
    told = widened(one, {"angle": np.array([45.0, 90.0])})
    assert told == ("clips: 1 of 2 pieces of the picture found too few candidates within 45 degrees of the strokes and "
                    "near the speeds of the strokes; the angle was widened, to 90 degrees at most, and the range of "
                    "speeds with it")
    assert widened(one, {"angle": np.array([45.0, 45.0])}) == ""


def test_a_clip_without_a_piece_that_moves_is_told(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Pieces that are larger than the clip."""
    Path("tiny.toml").write_text(changed(OWN, "piece = 16", "piece = 128"))
    assert cli.run(["synth", "tiny.toml"]) == 2
    assert capsys.readouterr().err == "tiny.toml: clips: no clip of the database has a piece that moves\n"
    assert not list(Path("out").rglob("*.partial"))


ALPHA = np.concatenate([flag(), np.full((32, 48, 1), 255, np.uint8)], axis=2)
GREY = flag()[..., :1]


@pytest.mark.parametrize(("name", "pixels", "upper"), [
    ("p.png", ALPHA, RED), ("p.png", flag().astype(np.uint16) * 257, RED), ("p.png", GREY, (220, 220, 220)),
    ("p.tif", flag(), RED), ("p.jpg", flag(), RED), ("p.tif", ALPHA.astype(np.uint16) * 257, RED)])
def test_pictures_of_every_kind_are_read(home: Path, name: str, pixels: np.ndarray, upper: tuple[int, ...]) -> None:
    stored(name, pixels)
    read = pictures.read_scaled(Path(name), "photo.file", 48, 1.0, 8192)
    assert read.of == (32, 48)
    np.testing.assert_allclose(255 * read.picture[4, 4], upper, atol=3)


def test_inks_and_palettes_are_read(home: Path) -> None:
    Path("p.jpg").write_bytes(base64.b64decode(CMYK))
    read = pictures.read_scaled(Path("p.jpg"), "photo.file", 24, 1.0, 8192)
    np.testing.assert_allclose(255 * read.picture[[2, 12], 4], [RED, BLUE], atol=3)
    Path("p.png").write_bytes(indexed(16, 24))
    read = pictures.read_scaled(Path("p.png"), "photo.file", 24, 1.0, 8192)
    np.testing.assert_allclose(255 * read.picture[[2, 12], 4], [RED, BLUE], atol=1)


def indexed(rows: int, columns: int) -> bytes:
    """A PNG of indices into a palette of two colours: RED above BLUE."""
    header = struct.pack(">2I5B", columns, rows, 8, 3, 0, 0, 0)
    content = b"".join(bytes([0, *[row >= rows // 2] * columns]) for row in range(rows))
    chunks = ((b"IHDR", header), (b"PLTE", bytes(RED + BLUE)), (b"IDAT", zlib.compress(content)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in chunks)


def test_what_is_transparent_is_white_in_a_picture_and_black_in_a_matte(home: Path) -> None:
    """A matte from a compositor is often white all over, and transparent where it does not hold."""
    pixels = np.full((*SHAPE, 4), 255, np.uint8)
    pixels[:, 60:, 3] = 0
    stored("m.png", pixels)
    matte = read_target(tiny.scene(home, SCENE)).matte
    assert matte[:, :30].min() > 0.98 and matte[:, 34:].max() < 0.02
    read = pictures.read_scaled(Path("m.png"), "photo.file", 64, 1.0, 8192)
    assert read.picture.min() > 0.98


@pytest.mark.parametrize("orientation", range(1, 9))
def test_strokes_and_matte_are_in_the_pixels_of_the_upright_picture(home: Path, orientation: int) -> None:
    """However the camera was held: stored turned, the file is what it is stored upright."""
    upright = tiny.scene(home, SCENE)
    expected = read_target(upright)
    content = np.rint(255 * pictures.read(home / "a.png")).astype(np.uint8)
    turned = {1: content, 2: content[:, ::-1], 3: content[::-1, ::-1], 4: content[::-1], 5: content.swapaxes(0, 1),
              6: np.rot90(content), 7: content[::-1, ::-1].swapaxes(0, 1), 8: np.rot90(content, -1)}[orientation]
    stored("a.png", np.ascontiguousarray(turned), orientation)
    found = read_target(upright)
    np.testing.assert_array_equal(found.picture, expected.picture)
    np.testing.assert_array_equal(found.wanted.orientation, expected.wanted.orientation)


@pytest.mark.parametrize("damage", ["changed", "cut short"])
@pytest.mark.parametrize("name", ["clip-cloud-01", "codebook", "index-cloud-01", "assignment"])
def test_a_damaged_database_is_made_again(database: Path, name: str, damage: str, capsys: pytest.CaptureFixture[str],
                                          ) -> None:
    before = tiny.contents(database / "out")
    file = next((database / "out").rglob(f"{name}.npz"))
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content if damage == "changed" else content[:len(content) // 2])
    assert cli.run(["synth", str(database / "tiny.toml"), "--out", str(database / "out"), "--quiet"]) == 0
    assert tiny.contents(database / "out") == before


@pytest.fixture(scope="module")
def database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a scene and what synth makes of it."""
    folder = tmp_path_factory.mktemp("database")
    pictures.write(folder / "a.png", np.random.default_rng(1).random((*SHAPE, 3)).astype(np.float32))
    pictures.write(folder / "m.png", half())
    tiny.made(folder, SCENE, "synth")
    return folder
