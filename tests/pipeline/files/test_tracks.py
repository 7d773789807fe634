"""Element tracks: our own come back bit for bit; a stranger's are read, or refused with one line that says where."""

import dataclasses
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import BadInput, StorageFailed
from pipeline.files import meshes, tracks, usd
from synth.elements.samples import Elements


def generator(key: int) -> np.random.Generator:
    return np.random.Generator(np.random.Philox(key=key))


def some(grid: tuple[int, ...] = (), dimensions: int = 3, frames: int = 4, count: int = 3) -> Elements:
    random, samples = generator(1), int(np.prod(grid))
    return Elements(random.random((frames, count, samples, dimensions), np.float32), grid, 30.0,
                    size=random.random(count), kind=np.arange(count), colour=random.random((count, 3)))


def same(a: Elements, b: Elements) -> bool:
    return all(np.array_equal(getattr(a, f.name), getattr(b, f.name)) for f in dataclasses.fields(Elements)
               if getattr(a, f.name) is not None or getattr(b, f.name) is not None)


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a child would do is done in this process, without the half second that a child costs."""
    def called(function: Callable, path: Path, key: str, *arguments: object, **_: object) -> object:
        try:
            return function(path, *arguments)
        except ValueError as error:
            raise BadInput(path, key, str(error)) from error

    monkeypatch.setattr(tracks.sandbox, "read", called)


# --- our own ---

@pytest.mark.parametrize("elements", [
    some(), some(dimensions=2), some((5,)), some((3, 4)),
    dataclasses.replace(some((5,)), coarse=some((5,)).positions + 1),
    dataclasses.replace(some(dimensions=2), box=np.array([[0, 0], [1, 2]], np.float32)),
])
def test_what_is_written_is_read_and_its_bytes_are_always_the_same(tmp_path: Path, elements: Elements) -> None:
    tracks.write(tmp_path / "a.npz", elements)
    back = tracks.read(tmp_path / "a.npz")
    assert same(back, elements) and back.grid == elements.grid and back.rate == elements.rate
    assert back.positions.dtype == np.float32 and back.kind.dtype == np.int32
    tracks.write(tmp_path / "b.npz", elements)
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    with np.load(tmp_path / "a.npz", allow_pickle=False) as stored:  # anybody's numpy reads it
        assert np.array_equal(stored["positions"], elements.positions)
    assert same(tracks.read_foreign(tmp_path / "a.npz", "key"), elements)


def test_what_lies_beside_the_elements(tmp_path: Path) -> None:
    tracks.write(tmp_path / "a.npz", some(), energy=np.arange(3.0))
    assert same(tracks.read(tmp_path / "a.npz"), some())
    with np.load(tmp_path / "a.npz") as stored:
        assert stored["energy"].tolist() == [0, 1, 2]
    with pytest.raises(ValueError, match="cannot lie beside them: coarse"):
        tracks.write(tmp_path / "a.npz", some(), coarse=np.zeros(3))


def test_a_damaged_file_of_our_own_is_one_line(tmp_path: Path) -> None:
    tracks.write(tmp_path / "whole.npz", some((5,)))
    whole, path, random = (tmp_path / "whole.npz").read_bytes(), tmp_path / "a.npz", generator(2)
    unlike = 0
    directory = whole.index(b"PK\x01\x02")  # more of the damage to the zip's directory, which has no checksum
    for n in range(600):
        content = bytearray(whole[:random.integers(len(whole))] if n % 4 == 0 else whole)
        if content and n % 4:
            content[random.integers(0 if n % 4 == 1 else directory, len(content))] ^= 1 << int(random.integers(8))
        path.write_bytes(content)
        try:
            unlike += not same(tracks.read(path), some((5,)))
        except BadInput as error:
            assert "\n" not in str(error) and str(path) in str(error)
    assert unlike == 0
    with pytest.raises(BadInput, match="no such file"):
        tracks.read(tmp_path / "none.npz")
    np.savez(path, positions=np.zeros((1, 2, 1, 2)))
    with pytest.raises(BadInput, match="no element tracks of flowloom"):
        tracks.read(path)
    np.savez(path, flowloom_tracks="positions", positions=np.array([{}], object))
    with pytest.raises(BadInput, match="damaged"):
        tracks.read(path)


def test_a_full_disk_is_noticed(tiny_disk: Path) -> None:
    with pytest.raises(StorageFailed, match="the disk is full"):
        tracks.write(tiny_disk / "a.npz", some((40,), frames=60, count=50))
    assert list(tiny_disk.iterdir()) == []


def test_a_stranger_s_npz_is_read_in_a_child_with_a_limit(tmp_path: Path) -> None:
    """A megabyte of zip that says it holds 64 GiB of zeros."""
    with zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        for name, shape in (("flowloom_tracks", (0,)), ("positions", (1 << 12, 1 << 20, 1, 4))):
            with archive.open(f"{name}.npy", "w", force_zip64=True) as entry:
                np.lib.format.write_array_header_1_0(
                    entry, {"descr": "<f4", "fortran_order": False, "shape": shape})
                entry.write(bytes(1 << 20))
    with pytest.raises(BadInput, match=r"a\.npz: key: (needs more than|damaged)"):
        tracks.read_foreign(tmp_path / "a.npz", "key")


# --- tables ---

WIDE = "0,1,2,3,4\n1,1.5,2,3,4.25\n2,2,2,3,4.5\n"
WIDE_POSITIONS = np.array([[[1, 2], [3, 4]], [[1.5, 2], [3, 4.25]], [[2, 2], [3, 4.5]]], np.float32)[:, :, None]


@pytest.mark.parametrize("content", [
    WIDE.encode(),
    WIDE.replace("\n", "\r\n").encode(),
    WIDE.replace("\n", "\r").encode(),
    WIDE.replace("\n", "\n\n,,,,\n").encode(),
    WIDE.replace(",", ";").replace(".", ",").encode(),
    WIDE.replace(",", "\t").encode(),
    WIDE.replace(",", "   ").encode(),
    WIDE.replace(",", " , ").encode(),
    WIDE.rstrip().encode(),
    b"\xef\xbb\xbf" + WIDE.encode(),
    WIDE.encode("utf-16"),
    ("frame,x1,y1,x2,y2\n" + WIDE).encode(),
    ('"Frame","ax","ay","bx","by"\n' + WIDE).encode(),
    b"-1,1,2,3,4\n0,1.5,2,3,4.25\n+1.0,2e0,.2E+1,3.,4.5\n",  # a film may begin before 0
    (b"frame,element,x,y\n0,7,1,2\n0,9,3,4\n1,7,1.5,2\n1,9,3,4.25\n2,7,2,2\n2,9,3,4.5\n"),
    (b"y,note,x,element,frame\n2,a,1,-1,5\n2,,1.5,-1,6\n2,,2,-1,7\n4,,3,8,5\n4.25,,3,8,6\n4.5,,3,8,7\n"),
    b"frame,element,sample,x,y\n0,0,0,1,2\n0,1,0,3,4\n1,0,0,1.5,2\n1,1,0,3,4.25\n2,0,0,2,2\n2,1,0,3,4.5\n",
])
def test_each_way_to_write_a_table_says_the_same(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.csv").write_bytes(content)
    found = tracks._elements(tracks._table(tmp_path / "a.csv", 2))
    assert np.array_equal(found.positions, WIDE_POSITIONS) and found.grid == ()


@pytest.mark.usefixtures("here")
def test_a_wide_table_of_three_coordinates_says_so_or_is_told(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("frame,x,y,z,x,y,z\n1,1,2,3,4,5,6\n")
    (tmp_path / "b.csv").write_text("1,1,2,3,4,5,6\n")
    wanted = np.arange(1, 7, dtype=np.float32).reshape(1, 2, 1, 3)
    assert np.array_equal(tracks.read_foreign(tmp_path / "a.csv", "key").positions, wanted)
    assert np.array_equal(tracks.read_foreign(tmp_path / "b.csv", "key", dimensions=3).positions, wanted)
    assert tracks.read_foreign(tmp_path / "b.csv", "key").positions.shape == (1, 3, 1, 2)


def long_table(grid: tuple[int, ...], positions: np.ndarray) -> str:
    """Rows in the order of the elements, their samples from the last to the first."""
    frames, count, samples = positions.shape[:3]
    names = {0: [], 1: ["sample"], 2: ["row", "column"]}[len(grid)]
    lines = [",".join(["frame", "element", *names, "x", "y", "z"])]
    for e in range(count):
        for s in reversed(range(samples)):
            within = [] if not grid else [s] if len(grid) == 1 else divmod(s, grid[1])
            lines += [",".join(map(str, (t + 10, 3 * e, *within, *map(repr, positions[t, e, s].tolist()))))
                      for t in range(frames)]
    return "\n".join(lines)


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("grid", [(), (5,), (3, 4)])
def test_a_long_table_holds_points_threads_and_sheets(tmp_path: Path, grid: tuple[int, ...]) -> None:
    (tmp_path / "a.csv").write_text(long_table(grid, some(grid).positions))
    found = tracks.read_foreign(tmp_path / "a.csv", "key", rate=25)
    assert tracks.read_foreign(tmp_path / "a.csv", "key", otherwise=12).rate == 12
    assert tracks.read_foreign(tmp_path / "a.csv", "key", rate=25, otherwise=12).rate == 25
    assert found.grid == grid and found.rate == 25 and np.array_equal(found.positions, some(grid).positions)


HEAD = "frame,element,x,y\n"
SAMPLES = "frame,element,sample,x,y\n"


@pytest.mark.parametrize(("content", "reason"), [
    ("", "is empty"),
    ("\n,,\n", "is empty"),
    ("frame,x,y,x,y\n", "holds no rows"),
    ("a\0b", "is no text"),
    ("1,2,3,4\n", "line 1: 4 cells; a row is a frame and then x, y of each element"),
    ("1,2\n", "line 1: 2 cells"),
    ("1.5,2,3,4,5\n", "line 1: the frame is '1.5', no whole number"),
    ("1,2,3,4,5\nx,2,3,4,5\n", "line 2: the frame is 'x', no whole number"),
    ("1e30,2,3,4,5\n", "the frame is '1e30', no whole number"),
    ("nan,2,3,4,5\n", "the frame is 'nan', no whole number"),
    ("1,2,3,4,5\n2,2,3\n", r"frame 2 \(line 2\): 2 numbers, and 4 in the first row"),
    ("1,2,3,4,5\n2,2,3,4,5,6,7\n", "6 numbers, and 4"),
    ("1,2,3,4,5\n2,2,3,,\n", r"frame 2, element 2 \(line 2\): a gap, no position"),
    ("1,2,3,4,5\n2,2,NaN,4,5\n", r"frame 2, element 1 \(line 2\): a gap"),
    ("1,2,3,4,5\n2,2,inf,4,5\n", "frame 2, element 1 .*beyond 1e"),
    ("1,2,3,4,5\n2,2,3,-1e300,5\n", "frame 2, element 2 .*beyond 1e"),
    ("1,2,3,4,5\n2,2,3,4,five\n", "frame 2, element 2 .*'five' is no number"),
    ("1,2,3,4,5\n2,2,3,4,1_0\n", "'1_0' is no number"),
    ("1,2,3,4,5\n2,2,3,4,٣\n", "'٣' is no number"),
    ("1,2,3,4,5\n3,2,3,4,5\n", r"frame 2 is missing \(line 2\)"),
    ("1,2,3,4,5\n1,2,3,4,5\n", r"frame 1 is there twice \(line 2\)"),
    ("5,2,3,4,5\n4,2,3,4,5\n", r"frame 4 is out of order, after frame 5 \(line 2\)"),
    ("1,2,3\n2,3,4\n", "holds 1 element; it takes 2 or more"),
    ("frame,element,y\n1,1,1\n", "its columns are not frame, element, x, y"),
    ("frame,element,row,x,y\n1,1,1,1,1\n", "its columns are not"),
    ("frame,element,x,x,y\n1,1,1,1,1\n", "a column is named twice"),
    (HEAD + "1,1,1\n", "line 2: 3 cells, and 4 names"),
    (HEAD + "1,fish,1,2\n", "line 2: the element is 'fish', no whole number"),
    (HEAD + "1,1,0,0\n1,2,0,0\n2,1,0,0\n", "frame 2, element 2: a gap"),
    (HEAD + "1,1,0,0\n2,2,0,0\n2,1,0,0\n", "frame 1, element 2: a gap"),
    (HEAD + "1,1,0,0\n3,1,0,0\n", r"frame 2, element 1 is missing \(line 3\)"),
    (HEAD + "1,1,0,0\n1,1,0,0\n", r"frame 1, element 1 is there twice \(line 3\)"),
    (HEAD + "2,1,0,0\n1,1,0,0\n", "frame 1, element 1 is out of order, after frame 2"),
    (HEAD + "1,1,0,0\n1,2,0,\n", "frame 1, element 2 .*a gap"),
    (SAMPLES + "1,1,0,0,0\n1,1,1,0,0\n1,2,0,0,0\n", "element 2 has 1 samples, element 1 has 2"),
    (SAMPLES + "1,1,0,0,0\n1,1,1,0,0\n2,1,1,0,0\n", "frame 2, element 1: a gap"),
    ("frame,element,row,column,x,y\n1,1,0,0,0,0\n1,1,0,1,0,0\n1,1,1,1,0,0\n",
     "element 1: a sheet that is not a grid: row 1, column 0 is missing"),
    ("frame,element,row,column,x,y\n1,1,0,0,0,0\n1,1,0,1,0,0\n", "a sheet that is not a grid: 1 x 2 samples"),
])
@pytest.mark.usefixtures("here")
def test_a_table_that_cannot_be_used_says_where(tmp_path: Path, content: str, reason: str) -> None:
    (tmp_path / "a.csv").write_text(content)
    with pytest.raises(BadInput, match=rf"a\.csv: exemplar\.file: .*{reason}") as caught:
        tracks.read_foreign(tmp_path / "a.csv", "exemplar.file")
    assert "\n" not in str(caught.value)


def test_frames_where_an_animation_is_needed(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("1,2,3,4,5\n")
    assert tracks.read_foreign(tmp_path / "a.csv", "key").frames == 1
    with pytest.raises(BadInput, match=r"a\.csv: key: holds 1 frame; it takes 2 or more"):
        tracks.read_foreign(tmp_path / "a.csv", "key", fewest_frames=2)
    with pytest.raises(BadInput, match="a rate of 1e\\+09 frames"):
        tracks.read_foreign(tmp_path / "a.csv", "key", rate=1e9)
    with pytest.raises(BadInput, match="is no text"):
        (tmp_path / "a.csv").write_bytes(bytes(range(128, 256)))
        tracks.read_foreign(tmp_path / "a.csv", "key")
    with pytest.raises(BadInput, match="no file of element tracks: csv"):
        (tmp_path / "a.doc").write_text("1,2,3,4,5\n")
        tracks.read_foreign(tmp_path / "a.doc", "key")


@pytest.mark.parametrize("content", [WIDE, long_table((3,), some((3,)).positions[:2])])
def test_random_damage_of_a_table_is_a_value_error_or_harmless(tmp_path: Path, content: str) -> None:
    path, random = tmp_path / "a.csv", generator(3)
    marks = [b",", b";", b"\n", b"\r", b"\t", b"\0", b'"', b"-", b"e9", b"1e999", b"nan", b"\xef\xbb\xbf", b"\xff"]
    for _ in range(600):
        damaged = bytearray(content.encode())
        for place in random.integers(0, len(damaged), 2):
            damaged[place:place + int(random.integers(3))] = marks[random.integers(len(marks))]
        if random.random() < 0.2:
            damaged = damaged[:random.integers(len(damaged))]
        path.write_bytes(damaged)
        try:
            found = tracks._elements(tracks._table(path, 2))
        except ValueError as error:
            assert str(error) and "\n" not in str(error)
        else:
            assert np.isfinite(found.positions).all()


@pytest.mark.usefixtures("here")
def test_a_hundred_thousand_rows_are_read_in_time(tmp_path: Path) -> None:
    rows = [f"{t},{e},{t},{e}" for t in range(50) for e in range(2000)]
    (tmp_path / "a.csv").write_text(HEAD + "\n".join(rows))
    found = tracks.read_foreign(tmp_path / "a.csv", "key")
    assert found.positions.shape == (50, 2000, 1, 2) and found.positions[7, 9].tolist() == [[7, 9]]


# --- sequences ---

def sheet(random: np.random.Generator) -> np.ndarray:
    y, x = np.mgrid[:3, :4].reshape(2, -1)
    return np.stack([x, y, random.random(12)], axis=-1).astype(np.float32)


QUADS = np.array([[r * 4 + c, r * 4 + c + 1, r * 4 + c + 5, r * 4 + c + 4] for r in range(2) for c in range(3)])
HALVES = np.concatenate([QUADS[:, [0, 1, 2]], QUADS[:, [0, 2, 3]]]).astype(np.int32)


def test_sheets_from_a_folder_of_ply_meshes(tmp_path: Path) -> None:
    random = generator(4)
    frames = [np.concatenate([sheet(random), sheet(random) + 5]) for _ in range(3)]
    for n, vertices in enumerate(frames, 8):  # 8, 9, 10: by number, not by name
        meshes.write(tmp_path / f"paper.{n}.ply", vertices, np.concatenate([HALVES, HALVES + 12]))
    (tmp_path / "notes.txt").write_text("by hand")
    found = tracks.read_foreign(tmp_path, "key", rate=60)
    assert found.grid == (3, 4) and found.rate == 60
    assert np.array_equal(found.positions, np.stack(frames).reshape(3, 2, 12, 3))
    assert [f.name for f in tracks.sources(tmp_path, "key")] == [f"paper.{n}.ply" for n in (8, 9, 10)]


@pytest.mark.usefixtures("here")
def test_points_by_a_pattern_and_threads_from_one_file(tmp_path: Path) -> None:
    for n in range(3):
        meshes.write_points(tmp_path / f"school.{n:04}.ply", np.full((5, 3), n, np.float32), {})
        meshes.write_points(tmp_path / f"other.{n:04}.ply", np.full((7, 3), n, np.float32), {})
    for name in ("school.####.ply", "sc*.ply"):
        found = tracks.read_foreign(tmp_path / name, "key")
        assert found.positions.shape == (3, 5, 1, 3) and found.positions[2, 4, 0, 0] == 2 and found.grid == ()
    (tmp_path / "a.obj").write_text("".join(f"v {k} 0 {k * k}\n" for k in range(6)) + "l 1 2 3\nl 6 5 4\n")
    found = tracks.read_foreign(tmp_path / "a.obj", "key")
    assert found.grid == (3,) and found.positions[0, :, :, 0].tolist() == [[0, 1, 2], [5, 4, 3]]


@pytest.mark.parametrize(("second", "name", "reason"), [
    ("v 0 0 0\nv 1 1 1\n", "a.2.obj", r"a\.2\.obj: key: 2 vertices, and 3 in a\.1\.obj"),
    ("v 0 0 0\nv nan 1 1\nv 0 0 0\nl 1 2 3\n", "a.2.obj", r"a\.2\.obj: key: element 1: NaN or a position beyond"),
    ("v 0 0 0\nv 1e99 1 1\nv 0 0 0\nl 1 2 3\n", "a.2.obj", r"a\.2\.obj: key: element 1: NaN or a position beyond"),
    ("v 0 0 0\nv 1 1 1\nv 0 0 0\nl 1 3 2\n", "a.2.obj", r"a\.2\.obj: key: its vertices are joined otherwise"),
    ("v 0 0 0\nv x 1 1\n", "a.2.obj", r"a\.2\.obj: key: damaged: line 2"),
    ("ply\n", "a.2.ply", r"a\.2\.ply: key: is no PLY file"),
])
@pytest.mark.usefixtures("here")
def test_the_file_of_a_sequence_that_is_at_fault_is_named(tmp_path: Path, second: str, name: str,
                                                          reason: str) -> None:
    (tmp_path / "a.1.obj").write_text("v 0 0 0\nv 1 1 1\nv 0 0 0\nl 1 2 3\n")
    (tmp_path / name).write_text(second)
    with pytest.raises(BadInput, match=reason) as caught:
        tracks.read_foreign(tmp_path, "key", fewest_elements=1)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("names", "what", "reason"), [
    ([], "", "holds no PLY or OBJ file"),
    ([], "a.####.ply", r"a\.####\.ply: key: no file has such a name"),
    ([], "none/a.####.ply", "no file has such a name"),
    ([], "a.ply", "no such file"),
    (["a.1.ply", "a.2.ply", "a.4.ply"], "", "frame 3 is missing"),
    (["a.1.ply", "b.1.ply"], "", r"b\.1\.ply: key: frame 1 is there twice, also as a\.1\.ply"),
    (["a.1.ply", "a.ply"], "", r"a\.ply: key: has no frame number in its name"),
    (["a.1.csv", "a.2.csv"], "a.#.csv", "a sequence is of PLY or OBJ files"),
])
def test_sequences_are_whole(tmp_path: Path, names: list[str], what: str, reason: str) -> None:
    for name in names:
        (tmp_path / name).write_text("ply")
    with pytest.raises(BadInput, match=reason):
        tracks.read_foreign(tmp_path / what, "key")


def test_curves_from_a_usd_file_with_its_rate(tmp_path: Path) -> None:
    usd.write(tmp_path / "a.usdc", some((5,)))
    found = tracks.read_foreign(tmp_path / "a.usdc", "key", otherwise=12)
    assert found.grid == (5,) and found.rate == 30 and np.array_equal(found.positions, some((5,)).positions)
    with pytest.raises(BadInput, match=r"a\.usdc: key: holds no prim /nobody"):
        tracks.read_foreign(tmp_path / "a.usdc", "key", prim="/nobody")
