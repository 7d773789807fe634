"""Named arrays: what is written comes back, the same bytes each time, and damage is one line."""

from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import BadInput
from pipeline.files import arrays

SOME = {"a": np.arange(12, dtype=np.uint8).reshape(3, 4), "b": np.float32([[1.5, np.inf]]), "none": np.zeros((0, 2))}


def test_arrays_come_back_with_their_types_and_shapes(tmp_path: Path) -> None:
    arrays.write(tmp_path / "x.npz", SOME)
    found = arrays.read(tmp_path / "x.npz")
    assert list(found) == list(SOME)
    for name, values in SOME.items():
        assert found[name].dtype == values.dtype
        np.testing.assert_array_equal(found[name], values)


def test_the_same_arrays_give_the_same_bytes(tmp_path: Path) -> None:
    for name in ("x.npz", "y.npz"):
        arrays.write(tmp_path / name, SOME)
    assert (tmp_path / "x.npz").read_bytes() == (tmp_path / "y.npz").read_bytes()


@pytest.mark.parametrize("left", [0, 10, 200, -30])
def test_a_file_cut_short_is_one_line(tmp_path: Path, left: int) -> None:
    file = tmp_path / "x.npz"
    arrays.write(file, SOME)
    file.write_bytes(file.read_bytes()[:left])
    with pytest.raises(BadInput, match=r"x\.npz: damaged or cut short"):
        arrays.read(file)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="no such file"):
        arrays.read(tmp_path / "x.npz")


def test_an_array_that_is_lost_is_noticed(tmp_path: Path) -> None:
    np.savez(tmp_path / "x.npz", **{arrays._NAMES: np.array(["a", "b"]), "a": np.zeros(2)})
    with pytest.raises(BadInput, match="damaged: b is lost"):
        arrays.read(tmp_path / "x.npz")
