"""8-bit PNG files, and what OpenImageIO does with pictures: read a user's, resize, FLIP.

A picture is (h, w, 3), top row first, sRGB, but what `read_coloured` gives. Grey values that become a field are (Y, X),
lowest row first.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pipeline.errors import BadInput, StorageFailed
from pipeline.files import atomic, sandbox

LUMA = np.array([0.2126, 0.7152, 0.0722], np.float32)  # Rec.709, of sRGB values
LARGEST = 16384  # pixels along a side of a user's picture
BOXED = 4  # pixels left for each of a scaled picture, at least: a filter of so few costs little


def write(path: Path, picture: np.ndarray) -> None:
    """Write an sRGB picture (h, w, 3) or (h, w), uint8 or floats from 0 to 1 (clipped, rounded), as PNG.

    Raises ValueError for another shape, NaN or infinity; `StorageFailed` if it does not read back.
    """
    pixels = as_bytes(picture)
    import OpenImageIO as oiio

    height, width = pixels.shape[:2]
    spec = oiio.ImageSpec(width, height, 1 if pixels.ndim == 2 else 3, "uint8")
    spec.attribute("oiio:ColorSpace", "srgb_rec709_scene")
    with atomic.replacing(path) as temporary:
        out = oiio.ImageOutput.create("png")
        stored = pixels.reshape(height, width, -1)
        done = out.open(str(temporary), spec) and out.write_image(stored) and out.close()
        if not done:
            raise StorageFailed(path, f"PNG: {_first_line(out.geterror())}; is the disk full?")
        try:
            back = _pixels(temporary)["pixels"]
        except ValueError as error:
            raise StorageFailed(path, f"did not read back ({error}); is the disk full?") from error
        if not np.array_equal(back.reshape(pixels.shape), pixels):
            raise StorageFailed(path, "did not read back as it was written; is the disk full?")


def as_bytes(picture: np.ndarray) -> np.ndarray:
    """The 8-bit pixels of a picture (h, w[, 3]): uint8 as it is, floats from 0 to 1 clipped and rounded."""
    if not (picture.ndim == 2 or (picture.ndim == 3 and picture.shape[2] == 3)) or 0 in picture.shape:
        raise ValueError(f"a picture has shape (h, w) or (h, w, 3), not {picture.shape}")
    if picture.dtype == np.uint8:
        return np.ascontiguousarray(picture)
    if not np.isfinite(picture).all():
        raise ValueError("the picture holds NaN or infinity")
    return np.ascontiguousarray(np.rint(np.clip(picture, 0, 1) * 255).astype(np.uint8))


def _first_line(text: str) -> str:
    return text.strip().splitlines()[0] if text.strip() else "no reason given"


def _pixels(path: Path) -> dict[str, Any]:
    """The pixels (h, w, channels) as stored, in uint8 or uint16; ValueError if not all of them are there."""
    pixels, _ = _decoded(path, {"uint16": "uint16"}, "uint8")
    return {"pixels": pixels}


def _decoded(path: Path, types: Mapping[str, str], otherwise: str, largest: int = LARGEST) -> tuple[np.ndarray, Any]:
    """The pixels (h, w, channels), upright, and what the file says of them; `types`: in which type to take each that is
    stored.

    Raises ValueError if it is no picture, too large, or not all there.
    """
    import OpenImageIO as oiio

    hints = oiio.ImageSpec()
    hints.attribute("oiio:UnassociatedAlpha", 1)  # the stored colours, not multiplied by their alpha
    source = oiio.ImageInput.open(str(path), hints)
    if source is None:
        raise ValueError(f"no picture ({_first_line(oiio.geterror())})")
    spec = source.spec()
    if max(spec.width, spec.height) > largest:
        raise ValueError(f"has {spec.width} x {spec.height} pixels; {largest} a side are the most")
    pixels = source.read_image(types.get(str(spec.format), otherwise))
    error = source.geterror()
    source.close()
    if pixels is None or error:
        raise ValueError(f"damaged or cut short ({_first_line(error)})")
    return _upright(np.asarray(pixels), spec.get_int_attribute("Orientation", 1)), spec


def _upright(pixels: np.ndarray, orientation: int) -> np.ndarray:
    """Stored pixels as a viewer shows them: `orientation` of EXIF and TIFF, 1 to 8, is how the camera was held."""
    if orientation in (5, 6, 7, 8):
        pixels = pixels.swapaxes(0, 1)
    if orientation in (2, 3, 6, 7):
        pixels = pixels[:, ::-1]
    if orientation in (3, 4, 7, 8):
        pixels = pixels[::-1]
    return pixels


def _coloured(path: Path) -> dict[str, Any]:
    """Runs in the child: channels (h, w, 1, 2, 3 or 4), alpha last, in uint8, uint16 or float32; and whether colours
    are multiplied by alpha."""
    floats = dict.fromkeys(("half", "float", "double"), "float")
    pixels, spec = _decoded(path, {"uint8": "uint8", **floats}, "uint16")
    names = list(spec.channelnames)
    colours = next((wanted for wanted in (["R", "G", "B"], ["Y"]) if set(wanted) <= set(names)), [])
    if not colours:
        raise ValueError(f"no channels R, G, B or Y; the file holds: {', '.join(names)}")
    taken = [names.index(name) for name in colours] + ([spec.alpha_channel] if spec.alpha_channel >= 0 else [])
    return {"pixels": np.ascontiguousarray(pixels[..., taken]),
            "multiplied": not spec.get_int_attribute("oiio:UnassociatedAlpha")}


def read(path: Path) -> np.ndarray:
    """The sRGB picture (h, w, 3) float32, 0 to 1, of a PNG file; `BadInput` if it is missing or damaged.

    Reads in this process; for files of our own.
    """
    if not path.is_file():
        raise BadInput(path, "", "no such file")
    try:
        return _picture(_pixels(path)["pixels"])
    except ValueError as error:
        raise BadInput(path, "", str(error)) from error


def read_foreign(path: Path, key: str) -> np.ndarray:
    """The sRGB picture (h, w, 3) float32, 0 to 1, of a user's PNG, JPEG or TIFF; on white where transparent.

    Read in a child process; `key` is the scene's, for the error. Raises `BadInput` if it is missing, damaged
    or cut short.
    """
    try:
        return _picture(sandbox.read(_pixels, path, key)["pixels"])
    except ValueError as error:
        raise BadInput(path, key, str(error)) from error


class Scaled(NamedTuple):
    """A user's picture at another size: (h, w, 3) float32, 0 to 1, sRGB; and the shape (h, w) of the file, upright."""

    picture: np.ndarray
    of: tuple[int, int]


def read_scaled(path: Path, key: str, width: int, ground: float, largest: int, kernel: str = "") -> Scaled:
    """A user's PNG, JPEG or TIFF at a `width`, its height in proportion; on a grey `ground`, 0 to 1, where transparent.

    Read in a child process. What is many times as large is averaged over boxes there: a filter of that width would take
    minutes. `key` is the scene's, for the error. Raises `BadInput` if it is missing, damaged, cut short, or has more
    than `largest` pixels along a side. kernel as in `resized`.
    """
    found = sandbox.read(_reduced, path, key, BOXED * width, ground, largest)
    rows, columns = found["shape"]
    height = max(1, round(rows * width / columns))
    picture = found["picture"]
    if picture.shape[:2] != (height, width):
        picture = np.clip(resized(picture, width, height, kernel), 0, 1)
    return Scaled(picture, (rows, columns))


def _reduced(path: Path, most: int, ground: float, largest: int) -> dict[str, Any]:
    """Runs in the child: the picture (h, w, 3) float32 on its ground, of at least `most` columns where the file has so
    many, each the mean of a box of pixels; and the file's shape."""
    pixels, _ = _decoded(path, {"uint16": "uint16"}, "uint8", largest)
    rows, columns = pixels.shape[:2]
    box = max(1, columns // most)
    down, across = (np.rint(np.linspace(0, n, max(1, n // box) + 1)).astype(int) for n in (rows, columns))
    means = np.empty((len(down) - 1, len(across) - 1, 3), np.float32)
    for row, (first, last) in enumerate(itertools.pairwise(down)):
        band = _picture(pixels[first:last], ground).mean(axis=0)
        means[row] = np.add.reduceat(band, across[:-1], axis=0) / np.diff(across)[:, None]
    return {"picture": means, "shape": [rows, columns]}


@dataclass(frozen=True, eq=False)
class Coloured:
    """A user's picture of any depth, top row first.

    colour     (h, w, 3) float32, not multiplied by alpha
    alpha      (h, w) float32, 0 to 1; None where the file has none
    is_linear  whether the colours are linear light, of which some may be above 1 or below 0; else sRGB, 0 to 1
    """

    colour: np.ndarray
    alpha: np.ndarray | None
    is_linear: bool


def read_coloured(path: Path, key: str) -> Coloured:
    """A user's picture: integers, of 8 or 16 bits, are sRGB; floats are linear light.

    Where the file's colours are multiplied by alpha, as in EXR, they are divided by it, and 0 where it is 0. Read in a
    child process; `key` is the scene's, for the error. Raises `BadInput` if it is missing, damaged, cut short, or holds
    NaN or infinity.
    """
    found = sandbox.read(_coloured, path, key)
    pixels = found["pixels"]
    is_linear = pixels.dtype.kind == "f"
    if is_linear and not np.isfinite(pixels).all():
        raise BadInput(path, key, "holds NaN or infinity")
    values = pixels if is_linear else pixels.astype(np.float32) / np.float32(np.iinfo(pixels.dtype).max)
    alpha = None
    if values.shape[2] in (2, 4):
        alpha = np.clip(values[..., -1], 0, 1)
        values = values[..., :-1]
        if found["multiplied"]:
            values = values / np.where(alpha > 0, alpha, 1)[..., None] * (alpha > 0)[..., None]
    if not is_linear:
        values = np.minimum(values, 1)
    colour = np.ascontiguousarray(np.broadcast_to(values, (*values.shape[:2], 3)), np.float32)
    return Coloured(colour, alpha, is_linear)


def read_grey(path: Path, key: str) -> np.ndarray:
    """The grey values (Y, X) float32, 0 to 1, lowest row first, of a user's picture; see `read_foreign`."""
    return np.ascontiguousarray((read_foreign(path, key) @ LUMA)[::-1])


def _picture(stored: np.ndarray, ground: float = 1.0) -> np.ndarray:
    """(h, w, 3) float32 from 0 to 1 of stored pixels: grey, colour, each with or without alpha, on a ground."""
    pixels = stored.astype(np.float32) / np.float32(np.iinfo(stored.dtype).max)
    channels = pixels.shape[2]
    if channels > 4:
        raise ValueError(f"{channels} channels; a picture has 1 to 4")
    if channels in (2, 4):
        alpha = pixels[..., -1:]
        pixels = pixels[..., :-1] * alpha + np.float32(ground) * (1 - alpha)
    return np.ascontiguousarray(np.broadcast_to(pixels, (*pixels.shape[:2], 3)))


def resized(picture: np.ndarray, width: int, height: int, kernel: str = "") -> np.ndarray:
    """The picture (h, w, C) resampled to (height, width, C) float32: Blackman-Harris up, Lanczos 3 down; or by one of
    OpenImageIO's kernels, of which "triangle" does not overshoot."""
    import OpenImageIO as oiio

    source = oiio.ImageBuf(np.ascontiguousarray(picture, dtype=np.float32))
    region = oiio.ROI(0, width, 0, height, 0, 1, 0, picture.shape[2])
    result = oiio.ImageBufAlgo.resize(source, kernel, 0.0, roi=region)
    if result.has_error:
        raise ValueError(f"cannot resize: {_first_line(result.geterror())}")
    return np.asarray(result.get_pixels("float")).reshape(height, width, -1)


def flip(reference: np.ndarray, test: np.ndarray) -> np.ndarray:
    """The visible difference (h, w), 0 to 1, of two sRGB pictures (h, w, 3): FLIP, 67 pixels a degree."""
    import OpenImageIO as oiio

    from render import tonemap

    linear = [oiio.ImageBuf(np.ascontiguousarray(tonemap.from_srgb(p), dtype=np.float32)) for p in (reference, test)]
    result = oiio.ImageBufAlgo.FLIP_diff(*linear, hdr=0, ppd=67.0)
    if result.has_error:
        raise ValueError(f"FLIP: {_first_line(result.geterror())}")
    return np.asarray(result.get_pixels("float")).reshape(*reference.shape[:2], -1)[..., 0]
