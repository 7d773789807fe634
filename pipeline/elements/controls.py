"""The user controls of an output of points (ma13 §4.1): its domain, flow, orientation, maps and hard positions.

Lengths are heights of the domain; frames count from 0. A control that the scene does not have is None.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.build.artifact import Inputs
from pipeline.elements.tables import MOST, ElementsScene
from pipeline.errors import InvalidValue, attributed_to
from pipeline.files import pictures
from synth.elements.samples import Elements
from synth.field import domain_origin

CROWDED = 0.6  # spacings: an output whose elements cannot be farther apart than that holds too many


def require_room(scene: ElementsScene, region: Any, count: int) -> None:
    """Raise for an output that is over-constrained: more elements than the domain holds, more hard positions than
    elements, or one that lies outside."""
    if count > MOST:
        raise InvalidValue("elements.spacing", f"{count:,} elements would fill the domain; {MOST:,} are the most")
    room = float((region.inside > 0).sum()) * region.cell**scene.dimension
    # of the densest packing, in the plane or in space
    most = room / ((CROWDED * scene.elements.spacing) ** scene.dimension * (0.866 if scene.dimension == 2 else 0.707))
    if count > most:
        raise InvalidValue("elements.count", f"{count:,} elements are more than the domain holds: "
                                           f"{int(most):,} would be {CROWDED:g} spacings apart")
    pinned: dict[int, int] = {}
    for number, pin in enumerate(scene.elements.pins):
        pinned[pin.frame] = pinned.get(pin.frame, 0) + 1
        cells = (np.array(pin.at) - region.origin) / region.cell
        beyond = (cells < -0.5) | (cells > np.array(scene.cells) - 0.5)  # the distance is not known there
        if beyond.any() or region.distance(np.array([pin.at]))[0] < 0:
            raise InvalidValue(f"elements.pins[{number}].at", "is outside the domain, or in an obstacle")
    frame = max(pinned, key=lambda f: pinned[f], default=0)
    if frame and pinned[frame] > count:
        raise InvalidValue("elements.pins", f"{pinned[frame]} hard positions in frame {frame}, and {count} elements")


def toroidal(scene: ElementsScene) -> np.ndarray | None:
    """The period of the output, 0 along axes that end."""
    if not scene.elements.toroidal:
        return None
    return np.array([scene.cells[0] / scene.cells[1], *[0.0] * (scene.dimension - 1)])


def domain(scene: ElementsScene, inputs: Inputs) -> Any:
    """Where elements may be: the domain's rectangle and the shape in it, less the obstacles; heights."""
    from synth.elements.constraints import Domain

    cell = 1.0 / scene.cells[1]
    origin = np.array(domain_origin(scene.shape))
    inside = np.full(scene.shape, np.inf)
    for axis, count in enumerate(scene.shape):
        if scene.elements.toroidal and axis == scene.dimension - 1:
            continue
        at = (np.arange(count) + 0.5) * cell
        inside = np.minimum(inside, np.minimum(at, count * cell - at).reshape(
            [-1 if n == axis else 1 for n in range(scene.dimension)]))
    if scene.elements.domain is not None:
        inside = np.minimum(inside, -shaped(scene) * cell)
    if "solid" in inputs:
        inside = np.minimum(inside, inputs.read("solid").values)
    if not (inside > 0).any():
        if "solid" in inputs:
            raise InvalidValue("obstacles", "leave elements no room")
        raise InvalidValue("elements.domain", "is smaller than a cell of elements.size")
    return Domain(inside.astype(np.float32), cell, origin, toroidal(scene))


def shaped(scene: ElementsScene) -> np.ndarray:
    """The signed distance to the border of the domain's shape, cells, negative inside."""
    table: Any = scene.elements.domain
    with attributed_to("elements.domain"):
        found: np.ndarray = table.solid(scene.shape, "elements.domain").distance
        return found


def flow(scene: ElementsScene, inputs: Inputs, region: Any) -> Any:
    """How far points are carried from a frame to the next, heights; None without a flow. Nothing flows out of a domain
    that has a shape."""
    if "L" not in inputs:
        return None
    from synth.motion.coarse import upsample
    from synth.projection import project

    before: list[np.ndarray] = []

    def velocity(frame: int) -> np.ndarray:
        """Heights per second; of a steady flow it is found once."""
        values = inputs.read("L", frame).values
        if scene.elements.domain is None:
            return values
        if not before or not np.array_equal(before[0], values):
            cells = scene.shape[-2]
            before[:] = [values, project(upsample(values, scene.shape), "open", region.inside * cells)]
        return before[1]

    def carried(t: int, points: np.ndarray) -> np.ndarray:
        """By the midpoint rule: a step along the tangent would spiral out of every vortex."""
        field = velocity(min(t + 1, scene.frames)) / scene.fps
        return _sampled(scene, field, points + 0.5 * _sampled(scene, field, points))

    return carried


def _sampled(scene: ElementsScene, values: np.ndarray, points: np.ndarray) -> np.ndarray:
    """A field of the domain (…, D) at points (M, D), linearly between its cells."""
    from scipy import ndimage

    at = (points - np.array(domain_origin(values.shape[:-1]))) * values.shape[-3]
    if scene.elements.toroidal:
        at[:, 0] = np.mod(at[:, 0], values.shape[-2])
    return np.stack([ndimage.map_coordinates(values[..., d], at[:, ::-1].T, order=1, mode="nearest")
                     for d in range(scene.dimension)], axis=-1)


def rotation(scene: ElementsScene, inputs: Inputs) -> Any:
    """The orientation field: local frames at points; None where nothing is turned."""
    from synth.elements.orientation import along_directions

    match scene.elements.along:
        case "exemplar":
            return None
        case "flow":
            return lambda t, points: along_directions(
                _sampled(scene, inputs.read("L", min(t + 1, scene.frames)).values, points))
    centre = np.array([0.0, 0.5, 0.0][: scene.dimension])

    def circling(t: int, points: np.ndarray) -> np.ndarray:
        away = points - centre
        round_ = np.zeros_like(away)
        round_[:, 0], round_[:, 1] = -away[:, 1], away[:, 0]
        return along_directions(round_)

    return circling


def ranked(example: Elements, name: str) -> np.ndarray:
    """The elements' property (E,) from 0, the least, to 1."""
    values = np.asarray(getattr(example, name), np.float64)
    return (values - values.min()) / max(float(np.ptp(values)), 1e-9)


def control(scene: ElementsScene) -> Any:
    """The control map at points of the domain, 0 to 1; None without one."""
    if scene.elements.control is None:
        return None
    tones = pictures.read_grey(scene.elements.control.file, "elements.control.file")
    return lambda t, points: _map_at(scene, tones, points, 1)


def _map_at(scene: ElementsScene, values: np.ndarray, points: np.ndarray, order: int) -> np.ndarray:
    """A picture that fills the domain, lowest row first, at points (M, D)."""
    from scipy import ndimage

    rows, columns = values.shape
    width = scene.cells[0] / scene.cells[1]
    at = [points[:, 1] * rows - 0.5, (points[:, 0] / width + 0.5) * columns - 0.5]
    return ndimage.map_coordinates(values, at, order=order, mode="nearest")


def maps(scene: ElementsScene) -> list[np.ndarray]:
    """Where each selection is, bool, lowest row first."""
    return [pictures.read_grey(s.file, f"elements.selections[{n}].file") > 0.5
            for n, s in enumerate(scene.elements.selections)]


def allowed(scene: ElementsScene, example: Elements) -> Any:
    """Which kinds may stand where, as bits; None where all may everywhere."""
    if not scene.elements.selections:
        return None
    known = sorted(set(example.kind.tolist()))
    for number, selection in enumerate(scene.elements.selections):
        for kind in selection.kinds:
            if kind not in known:
                raise InvalidValue(f"elements.selections[{number}].kinds",
                                   f"the exemplar has no element of kind {kind}; it has {', '.join(map(str, known))}")
    pictured = maps(scene)
    bits = [sum(1 << kind for kind in set(s.kinds)) for s in scene.elements.selections]

    def kinds_at(t: int, points: np.ndarray) -> np.ndarray:
        found = np.zeros(len(points), np.int64)
        for bright, kinds in zip(pictured, bits, strict=True):
            inside = _map_at(scene, bright.astype(np.uint8), points, 0) > 0
            found |= np.where(inside, kinds, 0)
        others = (1 << 31) - 1
        for kinds in bits:
            others &= ~kinds
        return np.where(found > 0, found, others).astype(np.int32)

    return kinds_at


def pins(scene: ElementsScene, positions: np.ndarray) -> Any:
    """The hard positions, each for the element that is nearest to it in its frame and has none there yet."""
    from synth.elements.constraints import Pins

    if not scene.elements.pins:
        return None
    taken: set[tuple[int, int]] = set()
    chosen = []
    for pin in scene.elements.pins:
        frame = min(pin.frame, len(positions)) - 1
        away = np.linalg.norm(positions[frame, :, 0] - np.array(pin.at), axis=1)
        away[[n for f, n in taken if f == pin.frame]] = np.inf
        taken.add((pin.frame, int(np.argmin(away))))
        chosen.append(int(np.argmin(away)))
    return Pins(np.array([pin.frame - 1 for pin in scene.elements.pins]), np.array(chosen),
                np.array([pin.at for pin in scene.elements.pins]))
