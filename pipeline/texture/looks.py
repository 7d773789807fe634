"""The looks of surfaces: each [render] table one class, its keys and its pictures; artifact `beauty`.

Pictures are linear Rec.709 light, EXR, top row first. A new look is one class here, its place in `scene.Scene`, a
module in render/ and its test.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

import numpy as np

from pipeline.build.artifact import Artifact, Inputs
from pipeline.files import images
from pipeline.tables import LARGEST, Framed, Look, key
from pipeline.texture.tables import TextureScene


class CeramicRender(Framed, Look):
    """The surface as glazed ware on a table, path-traced by Mitsuba; of scenes with a [surface] alone."""

    kind: Literal["ceramic"] = key("glazed ware in a studio")
    width: int = key("width of the picture", 720, "pixels", ge=16, le=LARGEST)
    height: int = key("height of the picture", 720, "pixels", ge=16, le=LARGEST)

    def artifacts(self) -> tuple[Artifact, ...]:
        """Its pictures."""
        return (Artifact("beauty", "render", images.LIGHT, ("render", "seed"),
                         (("frames", "same"), ("surface", "once")), self.make_beauty),)

    def make_beauty(self, scene: TextureScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
        """The surface with the texture of each frame."""
        from render import ceramic
        from render.studio import Shot

        stored = inputs.read("surface")
        uv = np.stack([stored[name] for name in "st"], axis=-1)
        shot = Shot(self.width, self.height, self.spp, scene.seed)
        for frame in frames:
            yield frame, ceramic.picture(stored["vertices"], stored["faces"], uv, inputs.read("frames", frame), shot)
