"""Fields as files: in the plane and in space, ours and a user's."""

from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import BadInput
from pipeline.files import fields, images, volumes
from synth.field import Field


def some(dimension: int, vectors: bool = True) -> Field:
    """A field of noise."""
    shape = (3, 4, 5)[-dimension:] + ((dimension,) if vectors else ())
    return Field.centred(np.random.default_rng(dimension).standard_normal(shape), dimension)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("vectors", [True, False])
def test_a_field_comes_back_with_the_same_bits(tmp_path: Path, dimension: int, vectors: bool) -> None:
    kept = fields.kept(dimension)
    assert kept.suffix == {2: "exr", 3: "vdb"}[dimension]
    file = tmp_path / f"a.{kept.suffix}"
    kept.save(file, some(dimension, vectors))
    assert kept.read(file) == some(dimension, vectors)
    if dimension == 3:
        assert set(volumes.read(file)) == {"vel" if vectors else "density"}


def test_a_volume_says_its_unit_and_a_plane_cannot(tmp_path: Path) -> None:
    kept = fields.velocity(3, 24.0)
    kept.save(tmp_path / "a.vdb", some(3))
    assert volumes.metadata(tmp_path / "a.vdb") == {"unit": fields.WORLD_UNITS, "fps": "24"}
    assert kept.read(tmp_path / "a.vdb") == some(3)
    assert fields.velocity(2, 24.0) == images.FIELD


def test_what_a_file_says_counts_for_its_key() -> None:
    assert fields.velocity(3, 24.0).options == {"metadata": {"unit": fields.WORLD_UNITS, "fps": "24"}}
    assert fields.velocity(3, 24.0) != fields.velocity(3, 25.0)
    assert fields.kept(3).options == {} and fields.kept(3, axes="local frame") != fields.kept(3)


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_distance_is_a_level_set_in_space(tmp_path: Path, dimension: int) -> None:
    kept, distance = fields.distance(dimension), some(dimension, vectors=False)
    file = tmp_path / f"a.{kept.suffix}"
    kept.save(file, distance)
    assert kept.read(file) == distance
    if dimension == 3:
        assert volumes.read_level_set(file, "surface", "key") == distance


def test_a_users_field_is_an_exr_or_the_velocity_of_a_vdb(tmp_path: Path) -> None:
    images.write_field(tmp_path / "a.exr", some(2))
    assert fields.read_user_field(tmp_path / "a.exr", "key") == some(2)
    volumes.write(tmp_path / "a.vdb", {"vel": some(3)})
    assert fields.read_user_field(tmp_path / "a.vdb", "key", 3) == some(3)


def test_of_a_volume_the_plane_has_the_middle_slice(tmp_path: Path) -> None:
    volume = Field(some(3).values, 0.5, (-3.0, 1.0, 2.0))
    volumes.write(tmp_path / "a.vdb", {"vel": volume})
    assert fields.read_user_field(tmp_path / "a.vdb", "key") == Field(volume.values[1, ..., :2], 0.5, (-3.0, 1.0))


@pytest.mark.parametrize(("name", "grid", "field", "dimension", "reason"), [
    ("a.exr", "", some(2, vectors=False), 2, "holds no vector field"),
    ("a.vdb", "vel", some(3, vectors=False), 3, "holds no vector field"),
    ("a.exr", "", some(2), 3, "is flat, and the output is not: it takes a VDB with a grid vel"),
    ("a.vdb", "wind", some(3), 3, "no such grid; the file holds: wind"),
    ("a.exr", "", None, 2, "damaged, cut short or no EXR file"), ("a.vdb", "vel", None, 3, "")])
def test_what_is_no_field_of_motion_is_refused_by_its_key(tmp_path: Path, name: str, grid: str, field: Field | None,
                                                          dimension: int, reason: str) -> None:
    file = tmp_path / name
    if field is None:
        file.write_text("nothing")
    elif grid:
        volumes.write(file, {grid: field})
    else:
        images.write_field(file, field)
    with pytest.raises(BadInput) as caught:
        fields.read_user_field(file, "coarse.file", dimension)
    assert str(caught.value).startswith(f"{file}: coarse.file: {reason}")


def test_a_missing_file_is_refused_by_its_key(tmp_path: Path) -> None:
    for name in ("a.exr", "a.vdb"):
        with pytest.raises(BadInput, match=rf"{name}: coarse\.file: no such file"):
            fields.read_user_field(tmp_path / name, "coarse.file")
