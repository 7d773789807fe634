"""Fields as files: OpenEXR in the plane, OpenVDB in space."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pipeline.errors import BadInput
from pipeline.files import images, volumes
from pipeline.files.format import Format
from synth.field import Field

WORLD_UNITS = "world units per second"
EXEMPLAR_UNITS = "the exemplar's longest vector"


def kept(dimension: int, **metadata: str) -> Format:
    """The format of fields of this dimension; a volume says `metadata` too."""
    return images.FIELD if dimension == 2 else Format(
        "vdb", volumes.write_field, volumes.read_field, {"metadata": metadata} if metadata else {})


def velocity(dimension: int, fps: float) -> Format:
    """The format of a velocity in world units per second."""
    return kept(dimension, unit=WORLD_UNITS, fps=f"{fps:g}")


def distance(dimension: int) -> Format:
    """The format of a signed distance, negative inside: in space a level set."""
    return images.FIELD if dimension == 2 else volumes.LEVEL_SET_FIELD


def read_user_field(file: Path, key: str, dimension: int = 2) -> Field:
    """A vector field of the user's: an EXR, or a VDB's grid `vel`, in the plane its middle slice.

    Raises BadInput, which names `key`: a scalar field, a flat one where `dimension` is 3, a damaged file.
    """
    try:
        field = volumes.read_foreign(file, "vel") if file.suffix == ".vdb" else images.read_foreign_field(file, key)
    except BadInput as error:
        raise BadInput(file, key, error.reason) from error
    if not field.is_vector:
        raise BadInput(file, key, "holds no vector field")
    if field.dimension < dimension:
        raise BadInput(file, key, "is flat, and the output is not: it takes a VDB with a grid vel")
    if field.dimension > dimension:
        middle: Any = field.values[len(field.values) // 2, ..., :2]
        field = Field(middle, field.voxel_size, field.origin[:2])
    return field
