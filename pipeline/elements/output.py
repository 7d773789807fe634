"""The output O of ma13: the synthesis of elements, as points in a domain or on a coarse motion; artifact `elements`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from pipeline.build.artifact import Artifact, Inputs, Needs
from pipeline.elements import controls
from pipeline.elements.coarse import with_coarse
from pipeline.elements.exemplars import period_of
from pipeline.elements.tables import ElementsScene
from pipeline.errors import InvalidValue, attributed_to
from pipeline.files import tracks
from pipeline.flow import solid_input
from synth.elements.samples import Elements

FOLLOWED = 0.2  # of its frames and samples, to each side: what a bundle does more slowly than that is not detail
NEIGHBOURS = 9  # threads that are copied side by side
THICKEST = 2.0  # threads that `hybrid` pushes apart, over how far apart they are


def make_elements(scene: ElementsScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, Any]]:
    """O, and its energy after each search (Eq. 5). An interrupted run goes on after the last complete iteration, or
    frame by frame after the last complete frame: same bits."""
    example = inputs.read("exemplar")
    searched, start, controlled = (_of_points if example.topology == "none" else _on_coarse)(scene, inputs, example)
    settings = _settings(scene)
    kept = inputs.checkpoint.load()
    state = kept[1] if kept else None
    from synth.elements import synthesis

    if scene.synthesis.sequence == "together":
        run = synthesis.together(searched, start.elements, start.source, controlled, settings, state)
    else:
        run = synthesis.by_frames(searched, start.elements, start.source, scene.frames, controlled, settings, state)
    for optimizer in run:
        inputs.checkpoint.save(0, optimizer.state())
    yield 0, (optimizer.result(), np.array(optimizer.energies))


def _settings(scene: ElementsScene) -> Any:
    from synth.elements.synthesis import Settings

    table = scene.synthesis
    return Settings(iterations=table.iterations, n=table.matches, coherent=table.search == "k-coherence",
                    solver=table.assignment, centre=table.hold, hybrid=table.hybrid,
                    control=scene.elements.control.weight * scene.elements.spacing**2 if scene.elements.control else 0)


def _shape(scene: ElementsScene, example: Elements) -> Any:
    from synth.elements.neighborhood import Shape

    table = scene.synthesis
    radius = table.neighborhood * scene.elements.spacing
    # Table 2: σ_p is measured by the neighbourhood; Eq. 10 divides squares of distances by it
    sigma = table.sigma_p * radius**2 if table.sigma_p else np.inf
    # sheets are compared by their own samples alone (§3.2)
    most = {"most": 1} if example.topology == "sheet" else {}
    return Shape(radius, table.before, table.after, table.whole, sigma=sigma, **most)


def _of_points(scene: ElementsScene, inputs: Inputs, example: Elements) -> tuple[Any, Any, Any]:
    """The exemplar for the search, the first guess and the controls of elements that are points in a domain."""
    from synth.elements import initialize, search
    from synth.elements.constraints import Constraints
    from synth.elements.synthesis import Controls

    table = scene.elements
    control = controls.control(scene)
    ranks = controls.ranked(example, table.control.property) if table.control else np.zeros(example.count)
    searched = search.exemplar(example, _shape(scene, example), period=period_of(example), control=ranks)
    region = controls.domain(scene, inputs)
    count = table.count or initialize.as_dense(example, region, table.spacing)
    controls.require_room(scene, region, count)
    flow, rotation = controls.flow(scene, inputs, region), controls.rotation(scene, inputs)
    allowed = controls.allowed(scene, example)
    pins = [pin for pin in table.pins if pin.frame == 1]
    together = scene.synthesis.sequence == "together"
    with attributed_to("synthesis.neighborhood"):
        start = initialize.points(
            example, region, scene.frames if together else 1, searched.shape.radius, table.spacing, scene.seed,
            rotation=None if rotation is None else lambda points: rotation(0, points),
            pins=np.array([pin.at for pin in pins]) if pins else None,
            allowed=None if allowed is None else lambda points: allowed(0, points),
            mismatch=None if control is None else lambda points, elements: (
                control(0, points) - ranks[elements]) ** 2, count=count)
    if together and flow is not None:
        start = initialize.carried(start, flow)
    margin = 0.5 * table.spacing if "solid" in inputs or table.domain else 0.0
    return searched, start, Controls(
        Constraints(region, margin, controls.pins(scene, start.elements.positions), hard=margin > 0), flow, rotation,
        control=control, allowed=allowed, period=controls.toroidal(scene))


def _on_coarse(scene: ElementsScene, inputs: Inputs, example: Elements) -> tuple[Any, Any, Any]:
    """The exemplar for the search, the first guess and the controls of threads or sheets on coarse positions."""
    from synth.elements import initialize, orientation, search
    from synth.elements.constraints import Constraints
    from synth.elements.synthesis import Controls

    thick = 2 * float(example.size.max()) / scene.elements.spacing
    if scene.synthesis.hybrid and example.topology == "thread" and thick > THICKEST:
        raise InvalidValue("synthesis.hybrid", f"the exemplar's threads are {thick:.1f} times as thick as far apart, "
                                             f"and {THICKEST:g} times is the most that can be pushed apart")
    example = in_detail(example)
    coarse = inputs.read("coarse").positions
    assert example.coarse is not None
    inner, outer = (orientation.along(positions, example.grid) for positions in (example.coarse, coarse))
    searched = search.exemplar(example, _shape(scene, example), inner)
    neighbours = NEIGHBOURS if example.topology == "thread" else 1
    start = initialize.on_coarse(example, coarse, inner, outer, neighbours, scene.seed, scene.fps)
    return searched, start, Controls(Constraints(), axes=outer)


def in_detail(example: Elements) -> Elements:
    """An exemplar with the C that its details are told from: of threads, one that follows what they do slowly."""
    from synth.elements import decomposition

    example = with_coarse(example)
    if example.topology == "thread":
        return decomposition.following(example, round(FOLLOWED * example.frames), round(FOLLOWED * example.grid[0]))
    return example


def check_output(scene: ElementsScene) -> None:
    """Refuse a domain, or pictures of a control map or of selections, that cannot be used."""
    controls.control(scene)
    controls.maps(scene)
    if scene.elements.domain is not None:
        controls.shaped(scene)


def output_artifact(scene: ElementsScene) -> Artifact:
    """O. Its one file depends on all frames of the flow."""
    carried: Needs = (("L", "every"),) if scene.flows else (("coarse", "once"),) if scene.coarse is not None else ()
    return Artifact("elements", "synth", tracks.OUTPUT,
                    ("elements", "synthesis", "frames", "seed", "fps", "shape", "cells", "dimension"),
                    (("exemplar", "once"), *carried, *solid_input(scene)), make_elements, animated=False,
                    check=check_output)
