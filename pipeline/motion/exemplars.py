"""The exemplars I of ma09: each kind one class, its keys and how its field is made; artifact `exemplar`.

A new kind is one class here and its place in `Exemplar`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np

from pipeline.build.artifact import Artifact, Inputs, Reads
from pipeline.build.view import value_at
from pipeline.errors import BadInput
from pipeline.files import fields, pictures, video
from pipeline.motion.tables import MotionScene
from pipeline.tables import Asset, Table, key
from synth.field import Field

if TYPE_CHECKING:
    from pathlib import Path


class ExemplarTable(Table):
    """One exemplar."""

    if TYPE_CHECKING:
        size: int

    reads: ClassVar[Reads] = ()
    """What `values` reads of the scene beside the table itself."""

    @property
    def volumetric(self) -> bool:
        """Whether it fills a volume, where the scene is in 3-D."""
        return False

    def values(self, scene: MotionScene, at: str) -> np.ndarray:
        """The field (N, N, 2), or of a volume (N, N, N, 3), in the exemplar's unit. `at`: the table's key."""
        raise NotImplementedError

    def picture(self, at: str) -> np.ndarray | None:
        """The picture (h, w, 3) that it is made of, display values; None if it is not made of one."""
        return None


class ProceduralExemplar(ExemplarTable):
    """An exemplar made by procedure (§4, figures 1, 2, 4 and 9)."""

    kind: Literal["circle", "square", "heart", "stripes", "sinusoid"] = key("the shape its flow lines follow")
    size: int = key("edge; with detail.size it sets the texture scale", 64, "cells", ge=8, le=1024)

    def values(self, scene: MotionScene, at: str) -> np.ndarray:
        from synth.motion import exemplar

        return exemplar.exemplar(self.kind, self.size)


class BitmapExemplar(ExemplarTable):
    """The curl of a picture's grey values (§4: "we take curl on the gray scale magnitude")."""

    kind: Literal["bitmap"] = key("a picture")
    file: Asset = key("PNG; its central square is taken")
    size: int = key("edge, to which it is resampled", 64, "cells", ge=8, le=1024)
    blur: float = key("standard deviation of a Gaussian on the picture", 1.0, "cells", ge=0, le=64)

    def values(self, scene: MotionScene, at: str) -> np.ndarray:
        from synth.motion import exemplar

        return exemplar.from_bitmap(pictures.read_grey(self.file, f"{at}.file"), self.size, self.blur)

    def picture(self, at: str) -> np.ndarray | None:
        return pictures.read_foreign(self.file, f"{at}.file")


class DrawingExemplar(ExemplarTable):
    """The strokes of a hand drawing, along their direction (§1, "manual art")."""

    kind: Literal["drawing"] = key("a drawing")
    file: Asset = key("PNG (an open stroke starts at its red dot) or SVG")
    size: int = key("edge", 64, "cells", ge=8, le=1024)

    def values(self, scene: MotionScene, at: str) -> np.ndarray:
        from synth.motion import exemplar

        if self.file.suffix == ".svg":
            return exemplar.from_svg(_text(self.file, f"{at}.file"), self.size)
        return exemplar.from_drawing(pictures.read_foreign(self.file, f"{at}.file")[::-1], self.size)

    def picture(self, at: str) -> np.ndarray | None:
        return None if self.file.suffix == ".svg" else pictures.read_foreign(self.file, f"{at}.file")


def _text(file: Path, at: str) -> str:
    try:
        return file.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise BadInput(file, at, "is not an SVG document in UTF-8") from None


class FieldExemplar(ExemplarTable):
    """A field made elsewhere."""

    reads: ClassVar[Reads] = ("dimension",)

    kind: Literal["field"] = key("a field")
    file: Asset = key("EXR (channels x, y) or VDB (grid vel; its middle slice, in 3-D all of it), any unit")
    size: int = key("edge, to which its central square or cube is resampled", 64, "cells", ge=8, le=1024)
    toroidal: bool = key("take out the jumps where the tile's borders meet", False)

    @property
    def volumetric(self) -> bool:
        return self.file.suffix == ".vdb"

    def values(self, scene: MotionScene, at: str) -> np.ndarray:
        from synth.motion import exemplar

        volume = scene.dimension == 3 and self.volumetric
        read = fields.read_user_field(self.file, f"{at}.file", 3 if volume else 2).values
        return (exemplar.from_volume if volume else exemplar.from_field)(read, self.size, self.toroidal)


class ClipExemplar(ExemplarTable):
    """The mean optical flow of a clip (§1, "captured data")."""

    kind: Literal["clip"] = key("a clip")
    file: Asset = key("a video")
    size: int = key("edge, to which its central square is resampled", 64, "cells", ge=8, le=1024)

    def values(self, scene: MotionScene, at: str) -> np.ndarray:
        from synth.motion import exemplar

        return exemplar.from_clip(video.read_grey(self.file, f"{at}.file"), self.size)


Exemplar = ProceduralExemplar | BitmapExemplar | DrawingExemplar | FieldExemplar | ClipExemplar


def make_exemplar(scene: MotionScene, inputs: Inputs, frames: list[int], at: str) -> Iterator[tuple[int, Field]]:
    """The exemplar whose table is at the key `at` of the scene, from its procedure or its file."""
    table: ExemplarTable = value_at(scene, at)
    values = table.values(scene, at)
    yield 0, Field.centred(values, values.ndim - 1)


def exemplar_artifacts(scene: MotionScene) -> tuple[Artifact, ...]:
    """The exemplars of a scene."""
    made = []
    for name, at in scene.exemplars.items():
        table: ExemplarTable = value_at(scene, at)
        # of one file a flat scene takes another part than one in space
        dimension = 3 if scene.dimension == 3 and table.volumetric else 2
        made.append(Artifact(name, "synth", fields.kept(dimension), (at, *table.reads), (), make_exemplar, {"at": at},
                             animated=False))
    return tuple(made)
