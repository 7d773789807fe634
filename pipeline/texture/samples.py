"""The samples of wang05: each kind one class, its keys and its picture; artifact `sample`.

A new kind is one class here and its place in `Sample`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field

from pipeline.build.artifact import Artifact, Inputs
from pipeline.files import images, pictures
from pipeline.files.format import Format
from pipeline.tables import Asset, Table, key

if TYPE_CHECKING:
    from pipeline.texture.tables import TextureScene

KEPT = Format("exr", images.write_picture, images.read_picture)
"""Linear pictures, top row first, in full floats."""
Degrees = Annotated[float, Field(ge=-360, le=360)]


class SampleTable(Table):
    """One sample."""

    if TYPE_CHECKING:
        direction: float | None

    def picture(self, at: str) -> np.ndarray:
        """The picture (h, w, 3), linear light, top row first. `at`: the table's key."""
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
    file: Asset = key("PNG or another picture; its central square is taken")
    size: int = key("edge, to which the square is resampled", 128, "pixels", ge=16, le=1024)
    direction: Degrees | None = key(DIRECTION, None, "degrees")

    def picture(self, at: str) -> np.ndarray:
        from render import tonemap

        read = pictures.read_foreign(self.file, f"{at}.file")
        edge = min(read.shape[:2])
        top, left = (read.shape[0] - edge) // 2, (read.shape[1] - edge) // 2
        square = pictures.resized(read[top:top + edge, left:left + edge], self.size, self.size)
        return tonemap.from_srgb(np.clip(square, 0, 1)).astype(np.float32)


Sample = ProceduralSample | PictureSample


def make_sample(scene: TextureScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """The sample's picture. Raises ValueError for one that is no texture, of one colour above all."""
    from synth.texture.sample import sample

    picture = scene.sample.picture("sample")
    sample(np.ascontiguousarray(picture[::-1]))
    yield 0, picture


def sample_artifact(scene: TextureScene) -> Artifact:
    """The sample."""
    return Artifact("sample", "synth", KEPT, ("sample",), (), make_sample, animated=False)
