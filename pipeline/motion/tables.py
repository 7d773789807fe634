"""The tables of ma09's synthesis, and what a scene of motion fields is to them.

A key's section (§) is ma09's. The tables [exemplar], [coarse], [[obstacles]] and [render] stand with what they do:
`exemplars`, `pipeline.flow`, `looks`; `scene` puts all of them together.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import Field, Strict

from pipeline.flow import SceneInFlow
from pipeline.tables import FigureTable, Grid, Radius, Share, Table, Vector, Width, grid, key


class Direction(Table):
    """Where the local z axis faces at a point, placed by hand and interpolated over the domain (§3.3, [Turk 2001])."""

    at: Vector = key("(x, y, z)", ..., "heights", min_length=3, max_length=3)
    vector: Vector = key("(x, y, z), of any length", ..., min_length=3, max_length=3)


def _neighborhoods(table: dict[str, Any]) -> tuple[int, ...]:
    return (9,) if len(table.get("size", ())) == 3 else (17, 9)


def _search(table: dict[str, Any]) -> str:
    return "k-coherence" if len(table.get("size", ())) == 3 else "exact"


class Detail(Table):
    """The synthesis of H (§3.1 to 3.4, 3.7)."""

    size: Grid = grid("columns and rows of H and F", (256, 256))
    levels: Annotated[int, Field(ge=1, le=10)] | Literal["auto"] = key(
        "levels of the image pyramid; \"auto\" brings the exemplar down to 8 cells", "auto")
    neighborhoods: Annotated[tuple[Width, ...], Strict(False)] = key(
        "widths, odd, in the order used (§4: 17² followed by 9²; 9² in 3-D)", _neighborhoods, "cells",
        min_length=1, max_length=4)
    iterations: int = key("rounds of search and assignment with each width (§4: 3 to 5)", 4, ge=1, le=50)
    search: Literal["exact", "k-coherence"] = key("exact, or k-coherence (§3.7)", _search)
    k: int = key("candidates of k-coherence", 4, ge=1, le=32)
    along: Literal["x", "y"] = key("the exemplar's axis that follows L (§3.3); \"y\": upright motifs rise upright", "x")
    synthesize: Literal["motion", "potential"] = key(
        "in the plane: H itself, or its potential, whose curl has no divergence (§3.6, Discussion); the exemplar's "
        "mean motion, sources and sinks have no potential and are lost", "motion")
    samples: Literal["grid", "lagrangian"] = key(
        "in the plane: H is synthesized on the grid, or at samples that move with L and keep their detail (§5)", "grid")
    facing: Literal["camera", "density", "directions"] = key(
        "in 3-D, what the local z axis faces (§3.3): the front, out of the smoke that L carries, or what "
        "[[detail.directions]] say", "camera")
    directions: Annotated[tuple[Direction, ...], Strict(False)] = key(
        "an array of tables [[detail.directions]], for facing = \"directions\"", (), max_length=256)
    boundary: bool = key("observe the boundary of the obstacles: E_n (§3.6, Eq. 3)", True)


class Combine(Table):
    """F = upsample(L) + ω H' (§3.5)."""

    omega: float = key("ω, the length of the exemplar's longest vector in F", ..., "cells per frame", ge=0, le=1000)
    weight: Literal["uniform", "kinetic-energy", "vorticity"] = key("what ω is proportional to in space", "uniform")
    project: bool = key("make F divergence-free and let nothing flow through obstacles (§3.6, incompressibility); over "
                        "the border it flows freely but where L is smoke in its box", False)


class Source(Table):
    """Where smoke enters, in every frame (supplement A: "inject density sources").
    World units: the domain is 1 high, its floor at y = 0, centred on x = 0 and z = 0."""

    kind: Literal["ball", "box"] = key("form of the source", "ball")
    centre: Annotated[tuple[float, ...], Strict(False)] = key(
        "(x, y) or (x, y, z)", (0.0, 0.1), "heights", min_length=2, max_length=3)
    radius: Radius = key(
        "radius of the ball, or half the edge of the box; one number, or one for each axis", (0.08,), "heights",
        min_length=1, max_length=3)
    softness: float = key("share of the radius over which the edge fades", 0.3, ge=0, le=1)
    level: float = key("density injected", 1.0, ge=0, le=1)
    streaks: float = key("contrast of streaks, which draw the paths of the smoke", 0.0, ge=0, le=1)
    streak_size: float = key("width of a streak", 0.02, "heights", gt=0, le=1)
    streak_period: float = key("period in which the streaks change", 40.0, "frames", gt=0, le=100000)
    period: int = key("period of puffs", 1, "frames", ge=1, le=100000)
    duty: float = key("share of the period during which smoke enters", 1.0, ge=0, le=1)


class Depth(Table):
    """Gives the smoke of the plane a body: each part is about as deep as it is wide."""

    reach: float = key("how deep the widest smoke reaches, to the front and to the back", 0.06, "heights", gt=0, le=0.5)


class Density(Table):
    """The smoke carried by F (supplement A)."""

    scheme: Literal["windowed", "naive"] = key("pseudocode 4, or 3", "windowed")
    m: int = key("frames of the window (supplement A: 10 to 20)", 16, "frames", ge=1, le=1000)
    scale: int = key("density cells per field cell, along each axis", 2, ge=1, le=8)
    border: Literal["zero", "clamp", "toroidal"] = key("what comes in over the border: nothing, the same, the other "
                                                       "side", "zero")
    sources: Annotated[tuple[Source, ...], Strict(False)] = key(
        "where smoke enters, an array of tables [[density.sources]]", (Source(),), min_length=1, max_length=64)
    depth: Depth | None = key("makes the density a volume, for [render] kind = \"volume\"", None)


class Blades(Table):
    """A bed of seaweed that F bends (§4, figure 9: "use that to direct the movements of points on the seaweed
    polygonal models"); for fields in space."""

    height: float = key("height of the tallest blade", 0.95, "heights", gt=0, le=2)
    spacing: float = key("least distance of two plants", 0.13, "heights", ge=0.03, le=2)
    cover: Share = key("share of the floor that plants stand on, in patches", 0.5)
    bend: float = key("tangent of the angle by which a flow of one height per second bends a tip", 2.0, ge=0, le=100)
    window: int = key("frames whose motion a tip follows; it lags by half of them", 9, "frames", ge=1, le=100)


class Particles(Table):
    """Particles that F carries, for [render] kind = "particles" (figure 7)."""

    count: int = key("number of particles", 40000, ge=1, le=10000000)
    life: int = key("after which one is born again elsewhere", 60, "frames", ge=2, le=100000)


Panel = Literal["input", "exemplar", "exemplar-colour", "exemplar-arrows", "coarse", "coarse-colour", "detail",
                "detail-colour", "detail-arrows", "detail-divergence", "combined", "combined-colour", "result"]


class Figure(FigureTable):
    """The panels of X.png and X.mp4. With several variants and one panel, one panel for each of them; with
    several of both, one row for each variant. A panel of the exemplar stands once for each exemplar of the views."""

    panels: Annotated[tuple[Panel, ...], Strict(False)] = key("panels from left to right", ("result",), min_length=1)
    plane: Literal["front", "side", "top"] = key("plane of the middle slice that panels of 3-D fields show", "front")


class MotionScene(SceneInFlow):
    """A scene of motion fields as its artifacts see it; `scene.Scene` is the whole of it."""

    if TYPE_CHECKING:
        exemplar: Any
        detail: Detail
        combine: Combine
        density: Density
        particles: Particles
        blades: Blades
        render: Any
        figure: Figure

        @property
        def seen(self) -> tuple[Any, ...]: ...
        @property
        def seen_exemplars(self) -> tuple[str, ...]: ...
        @property
        def exemplars(self) -> dict[str, str]: ...

    cells_key: ClassVar[str] = "detail.size"

    @property
    def cells(self) -> tuple[int, ...]:
        """Of H and F, x first."""
        return self.detail.size
