"""A scene of elements (ma13), all its tables together, and what does not fit together in them."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, Strict

from pipeline.build.method import Faults
from pipeline.elements.coarse import Carried
from pipeline.elements.exemplars import Exemplar
from pipeline.elements.looks import Render
from pipeline.elements.tables import Elements, ElementsScene, Figure, Synthesis
from pipeline.flow import (
    AnalyticMotion,
    ClipMotion,
    FileMotion,
    NetcdfMotion,
    NoiseMotion,
    Obstacle,
    WakeMotion,
)
from pipeline.tables import key, listed


class Scene(ElementsScene):
    """A scene of elements: keys above the first table."""

    frames: int = key("length of the animation", 60, "frames", ge=1, le=100000)
    fps: float = key("speed of the animation", 24, "frames per second", ge=1, le=1000)
    exemplar: Exemplar = Field(discriminator="kind")
    elements: Elements
    coarse: Annotated[NoiseMotion | WakeMotion | AnalyticMotion | FileMotion | NetcdfMotion | ClipMotion |
                      Carried, Field(discriminator="kind")] | None = key(
        "the coarse motion; none: elements do not move", None)
    obstacles: Annotated[tuple[Obstacle, ...], Strict(False)] = key(
        "solids that elements keep out of, an array of tables [[obstacles]]", (), max_length=64)
    synthesis: Synthesis = Synthesis()
    render: Render = Field(discriminator="kind")
    figure: Figure = Figure()


# -- what does not fit together -----------------------------------------------------------------------------------


def look_fits(scene: Scene) -> Faults:
    """Check: exemplar, coarse motion and picture of one topology, in a domain of the exemplar's dimension."""
    yield from scene.render.faults(scene)
    if "coarse" in scene.figure.panels and scene.coarse is None:
        yield "figure.panels", 'there is no "coarse" without a [coarse]'


def for_points_alone(scene: Scene) -> Faults:
    """Check: keys that threads and sheets do not use, which are where their coarse motion is."""
    if scene.render.draws == "none":
        return
    table, kind = scene.elements, scene.render.kind
    reason = f"applies to points only; {kind} follow their [coarse] motion"
    unused = {"elements.domain": table.domain, "elements.toroidal": table.toroidal, "elements.pins": table.pins,
              "elements.selections": table.selections, "elements.control": table.control,
              "obstacles": scene.obstacles}
    yield from ((key, reason) for key, value in unused.items() if value)
    if table.along != "exemplar":
        yield "elements.along", reason
    if table.count and hasattr(scene.coarse, "file"):
        yield "elements.count", "is that of coarse.file"
    if scene.synthesis.sequence == "frames":
        yield "synthesis.sequence", f'"frames" is for points; of {kind} all frames are synthesized together'


def places_fit(scene: Scene) -> Faults:
    """Check: domain, hard positions and sequence."""
    table, synthesis = scene.elements, scene.synthesis
    if table.domain is not None:
        yield from table.domain.faults(scene, "elements.domain")
    for number, pin in enumerate(table.pins):
        if len(pin.at) != scene.dimension:
            yield (f"elements.pins[{number}].at",
                   f"has {len(pin.at)} coordinates; elements.size is {listed(scene.cells)}")
        if pin.frame > scene.frames:
            yield f"elements.pins[{number}].frame", f"the animation has {scene.frames} frames"
    if synthesis.sequence == "frames" and synthesis.after:
        yield "synthesis.after", 'is 0 with sequence = "frames": later frames are not there yet (figure 3)'
    if synthesis.sequence == "frames" and scene.coarse is not None and not scene.flows:
        yield "synthesis.sequence", 'of threads and sheets is "together": their coarse motion is known for all frames'
    if table.along == "flow" and not scene.flows:
        yield "elements.along", '"flow" needs a [coarse] that is a field'
