"""The tables of wang05's synthesis, and what a scene of a moving texture is to them.

A key's section (§) is wang05's. The tables [sample], [surface], [render], [coarse] and [[obstacles]] stand with what
they do: `samples`, `surfaces`, `looks`, `pipeline.flow`; `scene` puts all of them together.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import Field, Strict

from pipeline.flow import SceneInFlow
from pipeline.tables import Cells, FigureTable, Share, Table, key

Share01 = Annotated[float, Field(ge=0, le=1)]
Reach = Annotated[float, Field(ge=6, le=40)]


class Texture(Table):
    """The moving texture."""

    size: Annotated[tuple[Cells, Cells], Strict(False)] = key(
        "columns and rows of the picture; of a surface, of the texture that holds all its triangles", (512, 512),
        "pixels")
    method: Literal["carry", "paper", "pixels"] = key(
        "\"carry\": long-lived patches that carry coordinates into the sample; \"paper\": the paper's, which carries "
        "colours; \"pixels\": the paper's first frame, its pixels moved one by one (figure 3)", "carry")
    speed: Literal["limited", "normalized"] = key(
        "the flow's own, within slowest and fastest (§3), or the same everywhere (figures 8, 9 and 11); on a surface "
        "pixels are the sample's, and the field is scaled so that its largest speed is fastest", "limited")
    slowest: float = key("least speed, with speed = \"limited\"", 0.3, "pixels per frame", ge=0, le=100)
    fastest: float = key("largest speed, with speed = \"limited\"", 2.2, "pixels per frame", gt=0, le=100)
    divergence_free: bool = key(
        "follow the coarse motion's part that is free of divergence (Helmholtz-Hodge), which goes round obstacles and "
        "missing values: where a flow spreads or gathers, a texture is torn or crushed", False)
    maps: bool = key(
        "with method = \"carry\", write UV maps too, out/X/fields/uv.0001.exr …: for each pixel the places in the "
        "sample and the weights of its two strongest patches, for other programs", False)
    pace: float = key("speed, with speed = \"normalized\"", 1.5, "pixels per frame", gt=0, le=100)
    loop: bool = key(
        "with method = \"carry\", the last frame leads into the first: of a steady flow, or of one that repeats after "
        "`frames`. No seams are repaired", False)


class Carry(Table):
    """The default method: patches that live for many frames, move by parts of a pixel, turn and bend with the flow, and
    are drawn anew from the sample in each frame."""

    radius: Annotated[tuple[Reach, Reach], Strict(False)] = key(
        "least and largest radius of a patch; where the flow bends more it is smaller", (6.0, 20.0), "pixels")
    elongation: float = key("length of a patch along the flow over its width", 1.5, ge=1, le=4)
    usage: float = key("how strongly places of the sample that are in use are avoided; 0: not at all", 0.6, ge=0, le=10)
    growth: int = key("frames in which a new patch grows", 12, "frames", ge=1, le=1000)
    blend: Annotated[float, Field(ge=0, le=1)] | Literal["auto"] = key(
        "share of the blend that keeps the variance; \"auto\": so that the first frame has the sample's contrast",
        "auto")
    repair: float = key("share of the patches whose seams are tested in a frame; on a surface none are", 0.125, ge=0,
                        le=1)

    def settings(self) -> Any:
        """As synth.texture.carry takes them."""
        from synth.texture import carry

        return carry.Settings(**self.model_dump())


class Paper(Table):
    """The paper's method (§2), and the readings of what its text leaves open."""

    rotations: int = key("n, the rotated copies of the sample (§2.1: \"typically set to 24 or 48\")", 48, ge=4, le=360)
    largest: int = key("largest cell (§2.1: 32×32)", 32, "pixels", ge=4, le=64)
    smallest: int = key("smallest cell (§2.1: 4×4)", 4, "pixels", ge=2, le=64)
    boundary: int = key("D, the width of the boundary in which patches are compared and blended (§2.2.3)", 4, "pixels",
                        ge=1, le=16)
    spread: Literal["vectors", "speeds"] = key(
        "what differs by twice the least speed in a cell that is divided (§2.2.1 says \"velocities\")", "vectors")
    remainder: Literal["texture", "place"] = key(
        "what remembers a motion of less than a pixel: the texture that moves, or the place (§3, \"accumulated "
        "buffer\")", "texture")
    validity: float = key("angle between flow and texture from which a pixel is invalid (§2.2.2: \"a threshold\")",
                          15.0, "degrees", gt=0, le=180)
    refill_overlaps: bool = key("fill pixels that several cells cover anew, or take their mean", True)
    overblended: float = key("mean count of blendings above which a cell is synthesized anew (§2.3)", 2.0, ge=0, le=100)
    resynthesis_blends: bool = key("count a cell that is synthesized anew as a blending of its neighbours", True)
    remove_blur: bool = key("synthesize over-blended cells anew (§2.3; figure 7)", True)

    def settings(self) -> Any:
        """As synth.texture.paper takes them."""
        from synth.texture import paper

        return paper.Settings(
            n=self.rotations, largest=self.largest, smallest=self.smallest, D=self.boundary,
            velocity_spread=self.spread, remainder=self.remainder, validity=math.radians(self.validity),
            least=0.0, most=1000.0,  # frames.velocity has limited it
            refill_overlaps=self.refill_overlaps, overblended=self.overblended,
            resynthesis_blends=self.resynthesis_blends, remove_blur=self.remove_blur)


class Figure(FigureTable):
    """The panels of X.png and X.mp4. With moments, the still shows the result once for each of them."""

    panels: Annotated[tuple[Literal["sample", "flow", "holes", "result"], ...], Strict(False)] = key(
        "panels from left to right", ("result",), min_length=1)
    moments: Annotated[tuple[Annotated[int, Field(ge=1, le=100000)], ...], Strict(False)] = key(
        "frames at which the still shows the result (figure 8: 1, 30, 70, 100); none: figure.frame alone", (), "frames",
        max_length=16)
    overlay: Literal["none", "speed"] = key(
        "\"speed\": the result in colours that tell how fast L is, before texture.speed changes that; a "
        "legend is the last panel", "none")
    zoom: Annotated[tuple[Share01, Share01, Share], Strict(False)] | None = key(
        "x and y of the middle and edge of a square of the result that is enlarged in its corner (figure 7); none: no "
        "such view", None, "widths of the picture")

    def shown(self, frames: int) -> list[int]:
        return sorted({*super().shown(frames), *self.moments})


class TextureScene(SceneInFlow):
    """A scene of a moving texture as its artifacts see it; `scene.Scene` is the whole of it."""

    if TYPE_CHECKING:
        sample: Any
        surface: Any
        render: Any
        texture: Texture
        carry: Carry
        paper: Paper
        figure: Figure

    cells_key: ClassVar[str] = "texture.size"

    @property
    def cells(self) -> tuple[int, ...]:
        """Pixels of the picture, x first."""
        return self.texture.size
