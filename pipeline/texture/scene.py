"""A scene of a moving texture (wang05), all its tables together, and what does not fit together in them."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, Strict

from pipeline.build.method import Faults
from pipeline.flow import Coarse, Obstacle
from pipeline.tables import key, listed
from pipeline.texture.looks import CeramicRender
from pipeline.texture.samples import Sample
from pipeline.texture.surfaces import Surface
from pipeline.texture.tables import Carry, Figure, Paper, Texture, TextureScene


class Scene(TextureScene):
    """A scene of a moving texture: keys above the first table."""

    sample: Sample = Field(discriminator="kind")
    coarse: Annotated[Coarse, Field(discriminator="kind")] | None = key(
        "the flow of a texture in the plane; exactly one of [coarse] and [surface] is given", None)
    surface: Surface | None = key("the surface that the texture lies on", None)
    obstacles: Annotated[tuple[Obstacle, ...], Strict(False)] = key(
        "where there is no texture: solids, an array of tables [[obstacles]]", (), max_length=64)
    texture: Texture = Texture()
    carry: Carry = Carry()
    paper: Paper = Paper()
    render: CeramicRender = CeramicRender(kind="ceramic")
    figure: Figure = Figure()


def ground_fits(scene: Scene) -> Faults:
    """Check: a plane with a flow, or a surface, and what goes with each."""
    texture, figure = scene.texture, scene.figure
    if scene.surface is None:
        if scene.coarse is None:
            yield "coarse", "is missing; so is [surface], the other ground of a texture"
        return
    if scene.coarse is not None:
        yield "coarse", "is of a texture in the plane, and there is a [surface]"
    if scene.obstacles:
        yield "obstacles", "are of a texture in the plane, and there is a [surface]"
    if texture.method != "carry":
        yield "texture.method", f'"{texture.method}" is of a texture in the plane; on a [surface] it is "carry"'
    for name, given in (("texture.maps", texture.maps), ("texture.loop", texture.loop),
                        ("texture.divergence_free", texture.divergence_free), ("figure.zoom", figure.zoom),
                        ("figure.overlay", figure.overlay != "none")):
        if given:
            yield name, "is of a texture in the plane, and there is a [surface]"
    for panel in figure.panels:
        if panel not in ("sample", "result"):
            yield "figure.panels", f'there is no "{panel}" with a [surface]'
    yield from scene.surface.faults()


def texture_fits(scene: Scene) -> Faults:
    """Check: sizes, speeds and moments."""
    from synth.texture.loop import SHORTEST

    texture, size = scene.texture, scene.sample.size
    if size > min(texture.size):
        yield "sample.size", f"a sample of {size}² is larger than the picture ({listed(texture.size)})"
    if texture.slowest > texture.fastest:
        yield "texture.slowest", f"is above texture.fastest, {texture.fastest:g}"
    if scene.carry.radius[0] > scene.carry.radius[1]:
        yield "carry.radius", "has its least after its largest"
    if scene.paper.smallest > scene.paper.largest:
        yield "paper.smallest", f"is above paper.largest, {scene.paper.largest}"
    if texture.maps and texture.method != "carry":
        yield "texture.maps", f'are of patches: there are none with method = "{texture.method}"'
    if texture.loop and texture.method != "carry":
        yield "texture.loop", f'is of patches: there are none with method = "{texture.method}"'
    if texture.loop and scene.frames < SHORTEST * scene.carry.growth:
        yield "frames", (f"a loop of {scene.frames} is too short: patches that grow for {scene.carry.growth} frames "
                         f"(carry.growth) need {SHORTEST * scene.carry.growth}")
    if "holes" in scene.figure.panels and texture.method != "paper":
        yield "figure.panels", f'there are no "holes" with texture.method = "{texture.method}"'
    for number, moment in enumerate(scene.figure.moments):
        if moment > scene.frames:
            yield f"figure.moments[{number}]", f"the animation has {scene.frames} frames"
