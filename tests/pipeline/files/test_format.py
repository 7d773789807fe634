"""A format: how a value is kept, and that what it is kept with counts."""

from pathlib import Path

import numpy as np
import pytest

from pipeline.files import images, meshes, volumes
from pipeline.files.format import Format
from synth.field import Field


def test_a_value_is_written_with_the_options_and_read_back(tmp_path: Path) -> None:
    def write(file: Path, value: str, *, times: int = 1) -> None:
        file.write_text(value * times)

    text = Format("txt", write, Path.read_text, {"times": 3})
    text.save(tmp_path / "a.txt", "ab")
    assert text.read(tmp_path / "a.txt") == "ababab"
    plain = Format("txt", write, Path.read_text)
    plain.save(tmp_path / "a.txt", "ab")
    assert plain.read(tmp_path / "a.txt") == "ab"
    assert plain.options == {}
    assert text != plain and text == Format("txt", write, Path.read_text, {"times": 3})


FLAT = Field.centred(np.random.default_rng(1).random((4, 5, 2)), 2)
DEEP = Field.centred(np.random.default_rng(2).random((3, 4, 5)) - 0.5, 3)


@pytest.mark.parametrize(("kept", "value"), [(images.FIELD, FLAT), (volumes.LEVEL_SET_FIELD, DEEP)])
def test_our_fields_come_back_with_the_same_bits(tmp_path: Path, kept: Format, value: Field) -> None:
    file = tmp_path / f"a.{kept.suffix}"
    kept.save(file, value)
    assert kept.read(file) == value


def test_light_is_kept_in_half_floats(tmp_path: Path) -> None:
    assert images.LIGHT.options == {"half": True}
    light = np.random.default_rng(3).random((4, 5, 3)).astype(np.float32)
    images.LIGHT.save(tmp_path / "a.exr", light)
    np.testing.assert_array_equal(images.LIGHT.read(tmp_path / "a.exr"), light.astype(np.float16))


@pytest.mark.parametrize(("kept", "value"), [
    (meshes.MESH, {"vertices": np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), "faces": np.int32([[0, 1, 2]]),
                   "colours": np.uint8([[1, 2, 3], [4, 5, 6], [7, 8, 9]])}),
    (meshes.POINTS, {"position": np.float32([[0, 1, 2], [3, 4, 5]]), "vx": np.float32([1, 2]),
                     "age": np.int32([7, 8])})])
def test_meshes_and_points_come_back(tmp_path: Path, kept: Format, value: dict[str, np.ndarray]) -> None:
    file = tmp_path / f"a.{kept.suffix}"
    kept.save(file, value)
    back = kept.read(file)
    assert set(back) >= set(value)
    for name, array in value.items():
        np.testing.assert_array_equal(back[name], array)
