"""OpenEXR files: linear pictures (Rec.709) with named channels, and 2-D fields with channels `x`, `y`.

A picture (h, w[, C]) has its top row first, in memory as in the file. A field (Y, X[, 2]) has its lowest row
first in memory and is turned over on its way, so that every viewer shows it the right way up. The same pixels
give the same bytes.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import BadInput, StorageFailed
from pipeline.files import atomic, sandbox
from pipeline.files.format import Format
from synth.field import Field

REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)  # red, green, blue, white: x, y
VOXEL_SIZE, ORIGIN = "flowloom_voxel_size", "flowloom_origin"  # world units, as text: exact


def write(path: Path, channels: Mapping[str, np.ndarray], *, half: bool = False,
          metadata: Mapping[str, str] | None = None) -> None:
    """Write channels (h, w) of one size, top row first, read them back and compare, then rename into place.

    Names are `R G B A`, `Z`, `albedo.R`, `N.X` …; stored as 32-bit floats, or 16 bits with `half`. Raises
    ValueError for NaN, infinity, different sizes or, with `half`, a value above 65,504; `StorageFailed` if
    the disk is full.
    """
    import OpenEXR

    stored = {name: _storable(name, values, half) for name, values in channels.items()}
    if len({values.shape for values in stored.values()}) != 1:
        sizes = ", ".join(f"{name} {values.shape}" for name, values in stored.items())
        raise ValueError(f"the channels of an image have one size, not {sizes}")
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **(metadata or {})}
    if "R" in stored:
        header["chromaticities"] = REC709
    with atomic.replacing(path) as temporary:
        try:
            OpenEXR.File(header, dict(stored)).write(str(temporary))  # a copy: it puts its own objects in
            back = _channels(temporary)
        except (RuntimeError, ValueError) as error:  # OpenEXR's on writing, ours on reading back
            raise StorageFailed(path, f"{error}; is the disk full?") from error
        for name, values in stored.items():
            if name not in back or not np.array_equal(back[name], values):
                raise StorageFailed(path, f"channel {name} did not read back as written; is the disk full?")


def _storable(name: str, values: np.ndarray, half: bool) -> np.ndarray:
    """A contiguous copy in the stored type: OpenEXR writes wrong pixels, without an error, from a view."""
    if values.ndim != 2 or 0 in values.shape:
        raise ValueError(f"channel {name} has shape {values.shape}, not (h, w)")
    kind = np.float16 if half else np.float32
    if not np.isfinite(values).all():
        raise ValueError(f"channel {name} holds NaN or infinity")
    if half and float(np.abs(values).max()) > float(np.finfo(np.float16).max):
        raise ValueError(f"channel {name} holds values above 65,504, which half floats cannot")
    return np.ascontiguousarray(values, dtype=kind)


def _channels(path: Path) -> dict[str, Any]:
    """Each channel (h, w) in its stored type, and the header's texts under "texts"; ValueError if damaged."""
    import OpenEXR

    try:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            found = {name: np.array(channel.pixels) for name, channel in file.channels().items()}
            texts = {key: value for key, value in file.header().items() if isinstance(value, str)}
    except Exception as error:  # it raises ValueError, RuntimeError, TypeError …
        raise ValueError(f"damaged, cut short or no EXR file ({str(error).splitlines()[0]})") from error
    return {**found, "texts": texts}


def _own(path: Path) -> dict[str, Any]:
    """`_channels`, as `BadInput`."""
    if not path.is_file():
        raise BadInput(path, "", "no such file")
    try:
        return _channels(path)
    except ValueError as error:
        raise BadInput(path, "", str(error)) from error


def write_picture(path: Path, picture: np.ndarray, *, half: bool = False,
                  metadata: Mapping[str, str] | None = None) -> None:
    """Write a linear picture (h, w, 3), or (h, w, 4) with alpha, by which its colours are multiplied."""
    if picture.ndim != 3 or picture.shape[2] not in (3, 4):
        raise ValueError(f"a picture has shape (h, w, 3) or (h, w, 4), not {picture.shape}")
    channels = {name: picture[..., n] for n, name in enumerate("RGBA"[: picture.shape[2]])}
    write(path, channels, half=half, metadata=metadata)


def read(path: Path) -> dict[str, np.ndarray]:
    """The channels (h, w) float32 of an EXR file, top row first; `BadInput` if it is missing or damaged.

    Reads in this process; for files of our own. A user's field is read by `read_foreign_field`.
    """
    return {name: values.astype(np.float32) for name, values in _own(path).items() if name != "texts"}


def metadata(path: Path) -> dict[str, str]:
    """The texts of the header."""
    return dict(_own(path)["texts"])


def read_picture(path: Path) -> np.ndarray:
    """The linear picture of an EXR file with R, G, B: (h, w, 3) float32, (h, w, 4) with A too. Raises `BadInput`."""
    channels = read(path)
    missing = [c for c in "RGB" if c not in channels]
    if missing:
        raise BadInput(path, "", f"no channel {', '.join(missing)}; the file holds: {', '.join(channels)}")
    return np.stack([channels[c] for c in "RGBA" if c in channels], axis=-1)


def write_field(path: Path, field: Field, *, half: bool = False,
                metadata: Mapping[str, str] | None = None) -> None:
    """Write a 2-D field: channels `x`, `y` of a vector field, `Y` (luminance) of a scalar one."""
    if field.dimension != 2:
        raise ValueError(f"an image holds a field of 2 dimensions, not {field.dimension}")
    values = field.values[::-1]
    channels = {"x": values[..., 0], "y": values[..., 1]} if field.is_vector else {"Y": values}
    place = {VOXEL_SIZE: repr(field.voxel_size), ORIGIN: " ".join(map(repr, field.origin))}
    write(path, channels, half=half, metadata={**(metadata or {}), **place})


def read_field(path: Path) -> Field:
    """The 2-D field that `write_field` wrote. Raises `BadInput` if it is missing or damaged."""
    return _field(path, "", _own(path))


def read_foreign_field(path: Path, key: str) -> Field:
    """The 2-D field of a user's EXR file, read in a child process; `key` is the scene's, for the error.

    Without our header it lies on the scene's domain, one world unit high. Raises `BadInput` for other
    channels than x, y (a vector field) or Y (a scalar one), for NaN or infinity, and for a missing or damaged
    file.
    """
    return _field(path, key, sandbox.read(_channels, path, key))


def _field(path: Path, key: str, found: dict[str, Any]) -> Field:
    texts = found.pop("texts")
    if {"x", "y"} <= found.keys():
        values = np.stack([found["x"], found["y"]], axis=-1)
    elif "Y" in found:
        values = found["Y"]
    else:
        raise BadInput(path, key, f"no channels x and y; the file holds: {', '.join(found)}")
    try:
        if VOXEL_SIZE in texts and ORIGIN in texts:
            return Field(values[::-1], float(texts[VOXEL_SIZE]), tuple(map(float, texts[ORIGIN].split())))
        return Field.centred(values[::-1], 2)
    except ValueError as error:
        raise BadInput(path, key, str(error)) from error


FIELD = Format("exr", write_field, read_field)
LIGHT = Format("exr", write_picture, read_picture, {"half": True})
"""Linear pictures (h, w, 3), in half floats."""
