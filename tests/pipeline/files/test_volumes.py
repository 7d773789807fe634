"""VDB files keep every value where it belongs, and say so when they cannot."""

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import BadInput, StorageFailed
from pipeline.files import _openvdb, sandbox, volumes
from synth.field import Field

ORIGIN = (-1.25, 0.5, -3.0)


def numbered(shape: tuple[int, ...]) -> np.ndarray:
    """No two values are alike, none is zero, so that a swapped axis cannot hide."""
    return np.arange(1, np.prod(shape) + 1, dtype=np.float32).reshape(shape)


@pytest.fixture
def fields() -> dict[str, Field]:
    return {
        "density": Field(numbered((2, 3, 5)), 0.25, ORIGIN),
        "vel": Field(numbered((2, 3, 5, 3)) - 40, 0.25, ORIGIN),
    }


def vdb_print(path: Path) -> str:
    return subprocess.run(["vdb_print", "-l", "-m", path], capture_output=True, text=True, check=True).stdout


def test_what_is_written_is_read(tmp_path: Path, fields: dict[str, Field]) -> None:
    path = tmp_path / "a.vdb"
    volumes.write(path, fields, metadata={"seed": "1", "ω": "15"})
    assert volumes.read(path) == fields
    assert volumes.read_foreign(path, "vel") == fields["vel"]
    assert volumes.metadata(path) == {"seed": "1", "ω": "15"}
    assert [p.name for p in tmp_path.iterdir()] == ["a.vdb"]


@pytest.mark.parametrize("shape", [(1, 1, 1), (2, 2, 2), (7, 3, 5), (9, 17, 33)])
def test_odd_shapes(tmp_path: Path, shape: tuple[int, int, int]) -> None:
    field = Field(numbered(shape), 0.1, ORIGIN)
    volumes.write(tmp_path / "a.vdb", {"density": field})
    assert volumes.read(tmp_path / "a.vdb") == {"density": field}


def test_another_program_sees_the_same(tmp_path: Path, fields: dict[str, Field]) -> None:
    """OpenVDB's own tool agrees on axes, values, place and names."""
    values = np.zeros((2, 3, 5), np.float32)
    values[1, 0, 3] = 8.0   # z = 1, y = 0, x = 3
    values[0, 2, 4] = -2.0  # z = 0, y = 2, x = 4
    volumes.write(tmp_path / "a.vdb", {"density": Field(values, 0.25, ORIGIN)})
    told = vdb_print(tmp_path / "a.vdb")
    assert "Bounding box of active voxels: [3, 0, 0] -> [4, 2, 1]" in told
    assert re.search(r"Min value: -2\s", told) and re.search(r"Max value: 8\s", told)
    assert "class: fog volume" in told
    assert f"{volumes.SHAPE}: 5 3 2" in told
    matrix = [[float(n) for n in row.split(",")] for row in re.findall(r"\[([^\[\]]+)\] ?\n", told)][-4:]
    assert matrix == [[0.25, 0, 0, 0], [0, 0.25, 0, 0], [0, 0, 0.25, 0], [*ORIGIN, 1]]
    volumes.write(tmp_path / "b.vdb", fields)
    assert re.findall(r"Name: (\w+)", vdb_print(tmp_path / "b.vdb")) == ["density", "vel"]


def test_empty_space_keeps_its_size(tmp_path: Path) -> None:
    nothing = Field(np.zeros((4, 5, 6), np.float32), 0.5, ORIGIN)
    volumes.write(tmp_path / "a.vdb", {"density": nothing})
    assert volumes.read(tmp_path / "a.vdb") == {"density": nothing}


def test_the_same_fields_are_the_same_bytes(tmp_path: Path, fields: dict[str, Field]) -> None:
    for name in ("a.vdb", "b.vdb"):
        volumes.write(tmp_path / name, fields)
    assert (tmp_path / "a.vdb").read_bytes() == (tmp_path / "b.vdb").read_bytes()
    volumes.write(tmp_path / "c.vdb", {"density": fields["density"] * 2, "vel": fields["vel"]})
    a, c = (vdb_print(tmp_path / name) for name in ("a.vdb", "c.vdb"))
    assert a != c


def test_a_view_of_another_array_is_written_right(tmp_path: Path) -> None:
    whole = numbered((8, 6, 4))
    for view in (whole[::2, 1:, ::-1], whole.transpose(2, 0, 1), np.asfortranarray(whole)):
        volumes.write(tmp_path / "a.vdb", {"density": Field(view, 1.0, ORIGIN)})
        assert np.array_equal(volumes.read(tmp_path / "a.vdb")["density"].values, view)


def test_half_floats_keep_three_digits(tmp_path: Path) -> None:
    field = Field(np.random.Generator(np.random.Philox(key=1)).random((9, 8, 7), np.float32), 1.0, ORIGIN)
    volumes.write(tmp_path / "a.vdb", {"density": field}, half=True)
    values = volumes.read(tmp_path / "a.vdb")["density"].values
    assert np.array_equal(values, field.values.astype(np.float16).astype(np.float32))
    with pytest.raises(ValueError, match="half"):
        volumes.write(tmp_path / "b.vdb", {"density": field * 1e6}, half=True)
    assert not (tmp_path / "b.vdb").exists()


def test_what_is_no_volume_is_refused(tmp_path: Path, fields: dict[str, Field]) -> None:
    with pytest.raises(ValueError, match="3 dimensions"):
        volumes.write(tmp_path / "a.vdb", {"density": Field(np.ones((2, 3)), 1.0, (0, 0))})
    elsewhere = Field(fields["density"].values, 0.25, (0, 0, 0))
    with pytest.raises(ValueError, match="different grids"):
        volumes.write(tmp_path / "a.vdb", fields | {"density": elsewhere})
    assert list(tmp_path.iterdir()) == []


def foreign(path: Path, name: str, values: np.ndarray, about: dict[str, str] | None = None) -> Path:
    """A file as other programs write them: without our metadata, or with metadata that no longer fits."""
    _openvdb.write(str(path), [(name, values, about or {})], 0.5, [-1.0, 2.0, 3.0], {}, False)
    return path


def test_a_foreign_grid_is_its_active_voxels(tmp_path: Path) -> None:
    """The field begins at the first active voxel, wherever it stands; stale metadata is not believed."""
    values = np.zeros((4, 5, 6), np.float32)
    values[1:3, 2:4, 3:5] = numbered((2, 2, 2))
    expected = Field(numbered((2, 2, 2)), 0.5, (-1.0 + 1.5, 2.0 + 1.0, 3.0 + 0.5))
    for about in ({}, {volumes.SHAPE: "3 3 3", volumes.VOXEL_SIZE: "0.25"}):
        path = foreign(tmp_path / "a.vdb", "density", values, about)
        assert volumes.read_foreign(path, "density") == expected


def test_a_missing_grid_names_those_there_are(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"a\.vdb: vel: no such grid; the file holds: density"):
        volumes.read_foreign(foreign(tmp_path / "a.vdb", "density", numbered((2, 2, 2))), "vel")


@pytest.mark.parametrize(("name", "value"), [("vel", np.nan), ("vel", np.inf), ("density", -np.inf)])
def test_a_foreign_field_with_nan_is_refused(tmp_path: Path, name: str, value: float) -> None:
    values = np.ones((2, 3, 4, 3) if name == "vel" else (2, 3, 4), np.float32)
    values.flat[0] = value
    with pytest.raises(BadInput, match=f"a.vdb: {name}: the field holds NaN or infinity"):
        volumes.read_foreign(foreign(tmp_path / "a.vdb", name, values), name)


@pytest.mark.parametrize(("matrix", "reason"), [
    (np.diag([1.0, 1.0, 2.0, 1.0]), "anisotropic voxels (1 x 1 x 2)"),
    (np.diag([-1.0, -1.0, -1.0, 1.0]), "mirrored"),
    (np.array([[0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]), "rotated"),
    (np.full((4, 4), np.nan), "rotated"),
    (np.zeros((4, 4)), "rotated"),
])
def test_grids_off_the_axes_are_refused(matrix: np.ndarray, reason: str) -> None:
    with pytest.raises(ValueError, match=re.escape(reason)):
        volumes._placement(list(matrix.ravel()))
    with pytest.raises(ValueError, match="frustum"):
        volumes._placement([])


def test_damaged_files_end_in_one_line(tmp_path: Path, fields: dict[str, Field],
                                       monkeypatch: pytest.MonkeyPatch) -> None:
    """Cut short or with flipped bits in the header, a file is refused or read as some field, no more."""
    monkeypatch.setattr(sandbox, "SECONDS", 4.0)  # some of these make OpenVDB hang, some take all memory
    monkeypatch.setattr(sandbox, "MEMORY", 1 << 30)
    whole = tmp_path / "whole.vdb"
    volumes.write(whole, fields)
    content = whole.read_bytes()
    draw = np.random.Generator(np.random.Philox(key=3))
    damaged = [content[:n] for n in (0, 3, 60, 400, len(content) // 2, len(content) - 1)]
    for _ in range(14):
        bits = bytearray(content)
        bits[int(draw.integers(0, min(2000, len(bits))))] ^= 1 << int(draw.integers(0, 8))
        damaged.append(bytes(bits))
    refused = 0
    for n, bits in enumerate(damaged):
        path = tmp_path / f"{n}.vdb"
        path.write_bytes(bits)
        try:
            assert isinstance(volumes.read_foreign(path, "density"), Field)
        except BadInput as error:
            refused += 1
            assert "\n" not in str(error) and str(path) in str(error)
    assert refused >= 6, "the six that are cut short"


def test_a_full_disk_is_noticed(tiny_disk: Path) -> None:
    noise = np.random.Generator(np.random.Philox(key=1)).random((64, 64, 64), np.float32)
    old = Field(np.ones((2, 2, 2)), 1.0, ORIGIN)
    volumes.write(tiny_disk / "a.vdb", {"density": old})
    with pytest.raises(StorageFailed, match="disk"):
        volumes.write(tiny_disk / "a.vdb", {"density": Field(noise, 1.0, ORIGIN)})
    assert [p.name for p in tiny_disk.iterdir()] == ["a.vdb"]
    assert volumes.read(tiny_disk / "a.vdb") == {"density": old}
