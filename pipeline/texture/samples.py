"""The samples of wang05: each kind one class, its keys and its picture; artifact `sample`.

A new kind is one class here and its place in `Sample`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field

from pipeline.build.artifact import Artifact, Inputs
from pipeline.errors import BadInput
from pipeline.files import images, pictures
from pipeline.files.format import Format
from pipeline.tables import Asset, Table, key

if TYPE_CHECKING:
    from pipeline.texture.tables import TextureScene

KEPT = Format("exr", images.write_picture, images.read_picture)
"""Linear pictures, top row first, in full floats; of some, alpha tells what is shown."""
BRIGHTEST = 65504.0
"""Of the half floats that frames are kept in."""
Degrees = Annotated[float, Field(ge=-360, le=360)]


class SampleTable(Table):
    """One sample."""

    if TYPE_CHECKING:
        direction: float | None

    def picture(self, at: str) -> np.ndarray:
        """The picture (h, w, 3), linear light, top row first. `at`: the table's key.

        Where some pixels are not to be shown (h, w, 4): its alpha is 1 or 0, and it is 0 where alpha is.
        """
        raise NotImplementedError


DIRECTION = ("main direction of the sample, counter-clockwise from x; given for samples with heads and tails; none: by "
             "[Tamura et al. 1978] (§2.1)")


class ProceduralSample(SampleTable):
    """A sample made by procedure."""

    kind: Literal["canes", "straw", "scales"] = key("what it shows")
    size: int = key("edge of the sample", 128, "pixels", ge=16, le=1024)
    direction: Degrees | None = key(DIRECTION, None, "degrees")

    def picture(self, at: str) -> np.ndarray:
        from synth.texture import procedural

        procedures: dict[str, Any] = {
            "canes": procedural.canes, "straw": procedural.straw, "scales": procedural.scales}
        made: np.ndarray = procedures[self.kind](self.size)[::-1]
        return made


class PictureSample(SampleTable):
    """A sample from a picture."""

    kind: Literal["picture"] = key("a picture")
    file: Asset = key("PNG, TIFF, EXR or another picture; its central square is taken. Of 8 or 16 bits it is sRGB; of "
                      "floats it is linear light, and values over 1 are kept. Where alpha is below a half, the sample "
                      "is not shown, elsewhere wholly. Colours are divided by alpha where the file says that they are "
                      "multiplied by it, as those of EXR are")
    size: int = key("edge, to which the square is resampled", 128, "pixels", ge=16, le=1024)
    direction: Degrees | None = key(DIRECTION, None, "degrees")

    def picture(self, at: str) -> np.ndarray:
        from render import tonemap

        read = pictures.read_coloured(self.file, f"{at}.file")
        colour, alpha = _square(read.colour), None if read.alpha is None else _square(read.alpha)[..., None]
        brightest = float(colour.max())
        if brightest > BRIGHTEST:
            raise BadInput(self.file, f"{at}.file", f"holds {brightest:g}; frames hold {BRIGHTEST:g} at most")
        if alpha is None:
            colour = _resampled(colour, self.size)
        else:
            # multiplied: what is not seen must not show at the edge of what is
            colour, alpha = _resampled(colour * alpha, self.size), _resampled(alpha, self.size)
            colour = colour / np.maximum(alpha, 0.5)
        colour = np.clip(colour, 0, max(1, brightest))  # a filter overshoots
        light = (colour if read.is_linear else tonemap.from_srgb(colour)).astype(np.float32)
        if alpha is None or alpha.min() >= 0.5:
            return light
        shown = (alpha >= 0.5).astype(np.float32)
        return np.concatenate([light * shown, shown], axis=-1)


def _square(picture: np.ndarray) -> np.ndarray:
    """The central square of a picture (h, w[, C])."""
    edge = min(picture.shape[:2])
    top, left = (picture.shape[0] - edge) // 2, (picture.shape[1] - edge) // 2
    return picture[top:top + edge, left:left + edge]


def _resampled(square: np.ndarray, size: int) -> np.ndarray:
    """A square (n, n, C) as (size, size, C) float32; of that size already, as it is."""
    return square if len(square) == size else pictures.resized(square, size, size)


Sample = ProceduralSample | PictureSample


def make_sample(scene: TextureScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """The sample's picture. Raises ValueError for one that is no texture, of one colour above all."""
    picture = scene.sample.picture("sample")
    read_sample(picture, None)
    yield 0, picture


def read_sample(picture: np.ndarray, degrees: float | None) -> Any:
    """The synth.texture.sample.Sample of a picture as `SampleTable.picture` gives it; its direction in degrees."""
    from synth.texture.sample import sample

    lowest_first = np.ascontiguousarray(picture[::-1])
    return sample(lowest_first[..., :3], lowest_first[..., 3] if picture.shape[2] == 4 else None,
                  None if degrees is None else np.radians(degrees) % (2 * np.pi))


def sample_artifact(scene: TextureScene) -> Artifact:
    """The sample."""
    return Artifact("sample", "synth", KEPT, ("sample",), (), make_sample, animated=False)
