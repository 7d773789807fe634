"""OpenVDB files: 3-D fields in world units, grids `density` (fog volume), `vel` (world units per second) and `surface`
(level set).

Index (i, j, k) of a grid is (x, y, z) of an array (Z, Y, X); the transform takes it to the centre of that
cell in the world: voxel_size * (i, j, k) + origin. OpenVDB keeps only voxels that are not zero, so the full
shape is stored beside them. The same fields give the same bytes.

Not read: rotated, sheared or anisotropic grids, staggered velocities, other types than float and vec3s.
"""

from __future__ import annotations

import hashlib
import uuid
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import BadInput, StorageFailed
from pipeline.files import atomic, sandbox
from pipeline.files.format import Format
from synth.field import Field

SHAPE = "flowloom_shape"  # grid metadata: cells along x, y, z
VOXEL_SIZE = "flowloom_voxel_size"  # grid metadata: OpenVDB changes the last bit when it reads a transform
LEVEL_SET = "level set"  # as OpenVDB calls the class of a grid
MOST_VOXELS = 1024**3
_UUID = slice(21, 57)  # where the header holds a random name of the file


def write(path: Path, fields: Mapping[str, Field], *, metadata: Mapping[str, str] | None = None,
          half: bool = False, level_set: bool = False) -> None:
    """Write 3-D fields of one grid to `path`, read them back and compare, then rename into place.

    half       stores 16 bits per number: three decimal digits, up to 65,504
    level_set  the scalars are distances, negative inside

    Raises ValueError for fields that are not 3-D, lie on different grids or do not fit into half floats;
    `StorageFailed` if the file does not read back.
    """
    first, *others = fields.values()
    for field in fields.values():
        if field.dimension != 3:
            raise ValueError(f"a volume has 3 dimensions, not {field.dimension}")
        if half and float(np.abs(field.values).max()) > float(np.finfo(np.float16).max):
            raise ValueError("values above 65,504 do not fit into half floats")
    for field in others:
        first.require_same_grid(field)

    from pipeline.files import _openvdb

    shape = " ".join(str(n) for n in reversed(first.shape))
    about = {SHAPE: shape, VOXEL_SIZE: repr(first.voxel_size)} | ({"class": LEVEL_SET} if level_set else {})
    grids = [(name, field.values, about) for name, field in fields.items()]
    with atomic.replacing(path) as temporary:
        try:
            _openvdb.write(str(temporary), grids, first.voxel_size, list(first.origin),
                           dict(metadata or {}), half)
        except RuntimeError as error:
            raise StorageFailed(path, f"OpenVDB: {error}") from error
        _name_by_content(temporary)
        _check(path, temporary, fields, half)


def _name_by_content(file: Path) -> None:
    """Overwrite the random UUID in the header by one made of the content: same fields, same bytes."""
    content = bytearray(file.read_bytes())
    if len(content) < _UUID.stop:
        return  # a full disk: the check says so
    content[_UUID] = bytes(36)
    name = uuid.UUID(bytes=hashlib.sha256(content).digest()[:16])
    with file.open("r+b") as handle:
        handle.seek(_UUID.start)
        handle.write(str(name).encode())


def _check(path: Path, temporary: Path, fields: Mapping[str, Field], half: bool) -> None:
    """OpenVDB reports no full disk: only a file that reads back as it was meant is believed."""
    try:
        stored = read(temporary)
    except BadInput as error:
        raise StorageFailed(path, f"did not read back ({error.reason}); is the disk full?") from error
    for name, field in fields.items():
        values = field.values.astype(np.float16).astype(np.float32) if half else field.values
        if name not in stored or stored[name] != field.with_values(values):
            raise StorageFailed(path, f"grid '{name}' did not read back as it was written; is the disk full?")


def library_version() -> str:
    """The version of the OpenVDB library."""
    from pipeline.files import _openvdb

    return _openvdb.version


def read(path: Path) -> dict[str, Field]:
    """The fields of a file that `write` made, by name. Raises `BadInput` if it is missing or damaged.

    Reads in this process: a damaged file may abort it. For files whose checksum is known; others by
    `read_foreign`.
    """
    from pipeline.files import _openvdb

    if not path.is_file():
        raise BadInput(path, "", "no such file")
    try:
        grids, _ = _openvdb.contents(str(path))
        return {grid["name"]: _field(_values(path, grid)) for grid in grids}
    except (RuntimeError, ValueError) as error:
        raise BadInput(path, "", f"damaged: {error}") from error


def metadata(path: Path) -> dict[str, str]:
    """The texts that `write` was given as metadata, of a file that `write` made."""
    from pipeline.files import _openvdb

    try:
        _, texts = _openvdb.contents(str(path))
    except RuntimeError as error:
        raise BadInput(path, "", f"damaged: {error}") from error
    return dict(texts)


def read_foreign(path: Path, name: str) -> Field:
    """Grid `name` of a user's VDB file, read in a child process; without a stored shape its active voxels.

    Raises `BadInput`: no such file or grid, damaged, not read here (see above), NaN or infinity.
    """
    grid = sandbox.read(_grid, path, name, name)
    try:
        return _field(grid)
    except ValueError as error:
        raise BadInput(path, name, str(error)) from error


def read_level_set(path: Path, name: str, key: str) -> Field:
    """The distances of level set `name` of a user's VDB file, read in a child process: its active voxels and those
    between them. `key` is the scene's, for the error.

    Raises `BadInput`: no such file or grid, no level set, damaged, not read here (see above), NaN or infinity.
    """
    grid = sandbox.read(_grid, path, key, name, LEVEL_SET)
    try:
        return _field(grid)
    except ValueError as error:
        raise BadInput(path, key, str(error)) from error


def _grid(path: Path, name: str, of_class: str = "") -> dict[str, Any]:
    """Runs in the child: the grid's values, voxel size and origin, or ValueError."""
    from pipeline.files import _openvdb

    grids, _ = _openvdb.contents(str(path))
    for grid in grids:
        if grid["name"] == name:
            if of_class not in ("", grid["metadata"].get("class")):
                raise ValueError(f"grid '{name}' is no {of_class}, but of class {grid['metadata'].get('class')}")
            return _values(path, grid)
    raise ValueError(f"no such grid; the file holds: {', '.join(g['name'] for g in grids) or 'none'}")


def _values(path: Path, grid: dict[str, Any]) -> dict[str, Any]:
    """Values (Z, Y, X[, 3]), voxel size and origin of the first value, of a grid as `contents` tells it."""
    from pipeline.files import _openvdb

    if grid["type"] not in ("float", "vec3s"):
        raise ValueError(f"a grid of type {grid['type']}; flowloom reads float and vec3s")
    if grid["staggered"]:
        raise ValueError("a staggered velocity; convert it to one with all components at the voxel's centre")
    voxel_size, origin = _placement(grid["matrix"])
    about = grid["metadata"]
    size = [int(n) for n in about.get(SHAPE, "").split()]
    stored = float(about.get(VOXEL_SIZE, "nan"))
    if abs(stored - voxel_size) < 1e-9 * voxel_size:  # not where somebody scaled it since
        voxel_size = stored
    first, values = _openvdb.values(str(path), grid["name"], size, MOST_VOXELS)
    corner = [o + voxel_size * i for o, i in zip(origin, first, strict=True)]
    return {"values": values, "voxel_size": voxel_size, "origin": corner}


def _placement(matrix: list[float]) -> tuple[float, list[float]]:
    """Voxel size and origin of an index-to-world matrix (row vectors), if it holds nothing else."""
    if not matrix:
        raise ValueError("a frustum grid; flowloom reads uniform voxels")
    transform = np.array(matrix).reshape(4, 4)
    scales, turn = np.diag(transform)[:3], transform[:3, :3] - np.diag(np.diag(transform)[:3])
    size = float(scales[0])
    turned = not np.isfinite(transform).all() or np.abs(turn).max() > 1e-6 * abs(size)
    if turned or scales.min() <= 0:
        raise ValueError("a rotated, sheared or mirrored grid; flowloom reads grids along the world's axes")
    if np.abs(scales - size).max() > 1e-6 * size:
        sizes = " x ".join(f"{s:g}" for s in scales)
        raise ValueError(f"anisotropic voxels ({sizes}); resample the grid to cubes")
    return size, [float(o) for o in transform[3, :3]]


def _field(grid: dict[str, Any]) -> Field:
    return Field(grid["values"], grid["voxel_size"], tuple(grid["origin"]))


def write_field(path: Path, field: Field, *, metadata: Mapping[str, str] | None = None) -> None:
    """Write one field: grid `vel` of vectors, `density` of scalars."""
    write(path, {"vel" if field.is_vector else "density": field}, metadata=metadata)


def write_level_set(path: Path, distance: Field) -> None:
    """Write a signed distance as grid `surface`."""
    write(path, {"surface": distance}, level_set=True)


def read_field(path: Path) -> Field:
    """The one field of a file that `write_field` or `write_level_set` wrote."""
    (field,) = read(path).values()
    return field


LEVEL_SET_FIELD = Format("vdb", write_level_set, read_field)
