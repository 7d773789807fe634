"""A scene of motion fields (ma09), all its tables together, and what does not fit together in them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any, Literal

from pydantic import Field, Strict

from pipeline.build.method import Faults
from pipeline.build.view import value_at
from pipeline.flow import Coarse, Obstacle
from pipeline.motion.exemplars import Exemplar
from pipeline.motion.looks import Render
from pipeline.motion.tables import Blades, Combine, Density, Detail, Figure, MotionScene, Particles
from pipeline.tables import Table, Vector, key, listed

LARGEST_RATIO = 4  # of the sizes of two exemplars: at the coarsest level a 9² neighbourhood sees both


Triple = tuple[float, float, float]
PLANES: dict[str, tuple[Triple, Triple]] = {
    "front": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    "side": ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0)),
    "top": ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0))}
"""The planes of views: the exemplar's x and y axis in the local frame."""


def _triple(vector: tuple[float, ...] | None) -> Triple:
    x, y, z = vector or (0.0, 0.0, 0.0)
    return x, y, z


class View(Table):
    """One of the views of 2-D exemplars that make a 3-D H (§3.2). It stands in the local frame, whose x axis (or y:
    detail.along) follows L and whose z axis faces what detail.facing says; it fixes the components of H in its plane.
    Without [[views]] the exemplar is seen from the front, the side and the top. Cells of all exemplars are cells of H:
    their sizes may differ, up to four times. A VDB as exemplar (kind "field") is a view of all three components."""

    plane: Literal["front", "side", "top"] | None = key(
        "plane of the exemplar's x and y axis: front x, y; side z, y; top x, z", None)
    right: Vector | None = key("the exemplar's x axis in the local frame, instead of a plane", None, min_length=3,
                               max_length=3)
    up: Vector | None = key("the exemplar's y axis, made perpendicular to right", None, min_length=3, max_length=3)
    weight: float = key("weight of its matches beside those of the other views (§4)", 1.0, gt=0, le=1000)
    exemplar: Annotated[Exemplar, Field(discriminator="kind")] | None = key(
        "the exemplar of this view, a table with the keys of [exemplar]; none: [exemplar] itself", None)

    @property
    def axes(self) -> tuple[Triple, Triple]:
        """Right and up, as they are written."""
        return PLANES[self.plane] if self.plane else (_triple(self.right), _triple(self.up))

    @property
    def volumetric(self) -> bool:
        """Whether its exemplar is a volume, which fixes all components."""
        return self.exemplar is not None and self.exemplar.volumetric


class Scene(MotionScene):
    """The scene itself: keys above the first table."""

    exemplar: Exemplar = Field(discriminator="kind")
    coarse: Coarse = Field(discriminator="kind")
    views: Annotated[tuple[View, ...], Strict(False)] = key(
        "in 3-D, an array of tables [[views]]; none: front, side and top of [exemplar]", (), max_length=16)
    detail: Detail = Detail()
    obstacles: Annotated[tuple[Obstacle, ...], Strict(False)] = key(
        "solids in the flow, an array of tables [[obstacles]]", (), max_length=64)
    combine: Combine
    density: Density = Density()
    particles: Particles = Particles()
    blades: Blades = Blades()
    render: Render = Field(discriminator="kind")
    figure: Figure = Figure()

    @property
    def seen(self) -> tuple[Any, ...]:
        """The views of a 3-D scene (View), each with its exemplar."""
        planes: tuple[Any, ...] = ("front",) if self.exemplar.volumetric else ("front", "side", "top")
        views = self.views or tuple(View(plane=plane) for plane in planes)
        return tuple(view if view.exemplar else view.model_copy(update={"exemplar": self.exemplar}) for view in views)

    @property
    def exemplars(self) -> dict[str, str]:
        """The names of the exemplars, and the key of each: exemplar, or where the views of a 3-D scene have several
        exemplar-front, exemplar-top … (after the first view that shows it; exemplar-1 … without a plane)."""
        if self.dimension == 2:
            return {"exemplar": "exemplar"}
        first: dict[Any, int] = {}
        for number, view in enumerate(self.seen):
            first.setdefault(view.exemplar, number)
        planes = [self.seen[number].plane for number in first.values()]
        names = [plane if plane and planes.count(plane) == 1 else str(place) for place, plane in enumerate(planes, 1)]
        return {f"exemplar-{name}" if len(first) > 1 else "exemplar":
                f"views[{number}].exemplar" if self.views and self.views[number].exemplar else "exemplar"
                for name, number in zip(names, first.values(), strict=True)}

    @property
    def seen_exemplars(self) -> tuple[str, ...]:
        """The name of the exemplar of each view of `seen`."""
        names = {value_at(self, at): name for name, at in self.exemplars.items()}
        return tuple(names[view.exemplar] for view in self.seen)


# -- what does not fit together -----------------------------------------------------------------------------------


def fits_its_dimension(scene: Scene) -> Faults:
    """Keys that apply only in 2-D or only in 3-D."""
    detail, density = scene.detail, scene.density
    size = listed(detail.size)
    if scene.dimension == 2:
        need = f"needs a field in space; detail.size is {size}"
        if scene.views:
            yield "views", need
        if detail.facing != "camera":
            yield "detail.facing", need
        if scene.figure.plane != "front":
            yield "figure.plane", need
        for number, source in enumerate(density.sources):
            if len(source.centre) != 2:
                yield f"density.sources[{number}].centre", need
    else:
        if density.depth is not None:
            yield "density.depth", f"gives a plane a body; detail.size is {size}, which has one"
        for name, default in (("synthesize", "motion"), ("samples", "grid")):
            chosen = getattr(detail, name)
            if chosen != default:
                yield f"detail.{name}", f'"{chosen}" is for a field in the plane; detail.size is {size}'
    if detail.samples == "lagrangian":
        if detail.search != "exact":
            yield "detail.search", "samples that move have no fixed neighbours for k-coherence to ask: say exact"
        if detail.synthesize != "motion":
            yield "detail.synthesize", "the potential is synthesized on the grid only"
    if (detail.facing == "directions") != bool(detail.directions):
        yield "detail.directions", ("is missing, for facing = \"directions\"" if not detail.directions else
                                    f"is not used with facing = \"{detail.facing}\"")
    for number, direction in enumerate(detail.directions):
        if not any(direction.vector):
            yield f"detail.directions[{number}].vector", "is zero: it faces nowhere"
        if direction.at in [other.at for other in detail.directions[:number]]:
            yield f"detail.directions[{number}].at", "is the place of one before it"


def exemplar_fits(scene: Scene) -> Faults:
    """The exemplar of a field in the plane."""
    if scene.dimension == 3:
        return
    size, levels = scene.exemplar.size, scene.detail.levels
    if size > min(scene.detail.size):
        yield "exemplar.size", f"an exemplar of {size}² is larger than the output ({listed(scene.detail.size)})"
    if isinstance(levels, int) and size >> (levels - 1) < 4:
        yield "detail.levels", f"{levels} levels bring an exemplar of {size}² below 4 cells"


def views_fit(scene: Scene) -> Faults:
    """The views of a field in space (§3.2): whole, of one scale, smaller than the output, and enough of them."""
    if scene.dimension == 2:
        return
    smallest = min(view.exemplar.size for view in scene.seen)
    for number, view in enumerate(scene.seen):
        exemplar, where = view.exemplar, f"views[{number}]"
        if not view.plane and not (view.right and view.up):
            yield where, "needs a plane, or both right and up"
            return
        if view.plane and (view.right or view.up):
            yield f"{where}.plane", "says what right and up say too: leave one out"
        if _parallel(*view.axes):
            yield f"{where}.up", "is parallel to right, or one of them is zero: they span no plane"
        spanned = [n for n, *along in zip(scene.detail.size, *view.axes, strict=True) if any(along) or view.volumetric]
        size, power = exemplar.size, "³" if view.volumetric else "²"
        key = f"{where}.exemplar.size" if scene.views and scene.views[number].exemplar else "exemplar.size"
        if size > min(spanned):
            output = listed(scene.detail.size)
            yield key, f"an exemplar of {size}{power} is larger than the output ({output}) along an axis of its view"
        if size > LARGEST_RATIO * smallest:
            yield key, f"an exemplar of {size}{power} beside one of {smallest}²: at most {LARGEST_RATIO} times as large"
    blind = not any(view.volumetric for view in scene.seen) and _unseen([a for view in scene.seen for a in view.axes])
    if blind:
        yield "views", f"do not span space: none of them shows {blind}"
    levels = scene.detail.levels
    if isinstance(levels, int) and smallest >> (levels - 1) < 4:
        yield "detail.levels", f"{levels} levels bring an exemplar of {smallest}² below 4 cells"


def _parallel(a: Sequence[float], b: Sequence[float]) -> bool:
    """Whether two vectors of space span no plane to speak of."""
    cross = (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    return math.hypot(*cross) <= 1e-3 * math.hypot(*a) * math.hypot(*b)


def _unseen(vectors: Sequence[Sequence[float]]) -> str:
    """The direction that all vectors, of which two span a plane, are perpendicular to; "" if they span space."""
    a = vectors[0]
    b = next(v for v in vectors if not _parallel(a, v))
    normal = (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    unit = [n / math.hypot(*normal) for n in normal]
    for v in vectors:
        if abs(sum(n * c for n, c in zip(unit, v, strict=True))) > 1e-3 * math.hypot(*v):
            return ""
    axis = next((name for name, n in zip("xyz", unit, strict=True) if abs(n) > 0.995), "")
    return (axis or "(" + ", ".join(f"{n:.2g}" for n in unit) + ")") + " of the local frame"


def render_fits(scene: Scene) -> Faults:
    """Check: the look, and what the figure shows of it."""
    yield from scene.render.faults(scene)


def samples_fit(scene: Scene) -> Faults:
    """Check: samples that move, and the obstacles."""
    if (scene.obstacles or scene.has_gaps) and scene.detail.boundary and scene.detail.samples == "lagrangian":
        yield "detail.samples", "samples that move do not observe a boundary: say boundary = false"
