"""The tables and keys of a scene of elements (ma13): a scene that has a table [elements] is one.

A key's section (§) is ma13's. The tables of flows and obstacles are those of the other scenes (pipeline.schema).
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, Strict

from pipeline.schema import (
    LARGEST,
    AnalyticMotion,
    Asset,
    AssetOrFolder,
    FileMotion,
    Grid,
    NoiseMotion,
    Obstacle,
    ShapeObstacle,
    Table,
    WakeMotion,
    grid,
    key,
)

MOST = 100_000  # elements of an output
Place = Annotated[tuple[Annotated[float, Field(ge=-100, le=100)], ...], Strict(False)]


class ArrangedExemplar(Table):
    """Points at rest that repeat, by procedure (figure 8a, c, d)."""

    kind: Literal["poisson-disk", "jittered-grid", "hexagonal-grid"] = key("how the points are arranged")
    across: int = key("elements along its edge, about", 10, ge=2, le=200)
    jitter: float = key("of a jittered grid: largest way from its place", 0.25, "spacings", ge=0, le=0.5)


class DotsExemplar(Table):
    """Points at rest drawn by hand (figure 8b): each dot of a picture is an element of the dot's colour and size."""

    kind: Literal["dots"] = key("the dots of a picture, which repeats")
    file: Asset = key("PNG")


class SchoolExemplar(Table):
    """Fish that swim together along x (figure 9)."""

    kind: Literal["school"] = key("fish")
    behaviour: Literal["homogeneous", "crossing", "mixed"] = key(
        "everywhere alike (figure 9a), groups between which some dart (9c), or large ones among small (9e)",
        "homogeneous")
    count: int = key("of fish", 40, ge=2, le=2000)
    frames: int = key("of the exemplar", 60, "frames", ge=2, le=10000)


class ThreadExemplar(Table):
    """A small bundle of noodles (figure 10b, d)."""

    kind: Literal["noodles"] = key("a bundle of threads")
    style: Literal["simulated", "jagged"] = key("elastic rods (figure 10b), or zigzags made by hand (10d)", "simulated")
    frames: int = key("of the exemplar", 60, "frames", ge=2, le=10000)


class SheetExemplar(Table):
    """A few sheets of paper (figure 13a, b)."""

    kind: Literal["paper"] = key("sheets")
    style: Literal["simulated", "folded", "fluttering"] = key(
        "in turbulent air (figure 13a), or by hand: folding, or waves along them (13b)", "simulated")
    frames: int = key("of the exemplar", 60, "frames", ge=2, le=10000)


class TracksExemplar(Table):
    """Elements made elsewhere: tracked in a film (figure 11), simulated, modelled."""

    kind: Literal["tracks"] = key("positions over time")
    file: AssetOrFolder = key("CSV, a folder of one PLY or OBJ file per frame, USD, or our own NPZ; see above")
    rate: float | None = key("none: what the file says, or else the scene's fps, to which the motion is resampled",
                             None, "frames per second", gt=0, le=1000)
    captured: bool = key("a school tracked in a film, x and y in pixels, y down (§6.4): its tracks are smoothed, and "
                         "its mean motion is taken out; in space it is at depth 0", False)


ElementsExemplar = ArrangedExemplar | DotsExemplar | SchoolExemplar | ThreadExemplar | SheetExemplar | TracksExemplar


class CarriedThreads(Table):
    """C of noodles: the motion of one is that of all, beside each other (§6.2)."""

    kind: Literal["lifted"] = key("a bundle lifted from a plate (figure 10a)")


class CarriedSheets(Table):
    """C of sheets: each moves stiffly in a gust (figure 13c)."""

    kind: Literal["gust"] = key("a gust that tosses them")


class TracksMotion(Table):
    """C made elsewhere: by keyframes or a simulation."""

    kind: Literal["tracks"] = key("threads or sheets over time")
    file: AssetOrFolder = key("as of an exemplar of this kind, in heights; as long as the animation, and as many "
                              "samples for an element as the exemplar has")


class Pin(Table):
    """A hard position (§4.1): an element is at a place in a frame."""

    at: Place = key("(x, y) or (x, y, z)", ..., "heights", min_length=2, max_length=3)
    frame: int = key("when", 1, "frames", ge=1, le=100000)


class Selection(Table):
    """Where only some kinds of elements may stand (§4.1, constrained selections)."""

    kinds: Annotated[tuple[Annotated[int, Field(ge=0, le=30)], ...], Strict(False)] = key(
        "of the exemplar's elements: of dots, their colours, numbered by how many there are", ..., min_length=1)
    file: Asset = key("a picture that fills the domain: these kinds stand where it is bright, no other does")


class Control(Table):
    """A control map (§4.1, [Lu et al. 2007]): where which elements of the exemplar should rather stand."""

    file: Asset = key("a picture that fills the domain, black to white")
    property: Literal["size", "kind"] = key("of the exemplar's elements, least to largest, that follows it", "size")
    weight: float = key("of its difference in the search", 1.0, "squared spacings", ge=0, le=1000)


class Elements(Table):
    """The output. Heights are those of the domain, which is 1 high, its floor at y = 0, centred on x = 0 and z = 0."""

    size: Grid = grid("columns and rows of the grid on which domain, obstacles and flow are known", (256, 256))
    spacing: float = key("nearest distance of elements, of sheets that of their samples: to it the exemplar is scaled",
                         0.03, "heights", gt=0, le=1)
    radius: float = key("of a particle of the exemplar's middle size, as drawn and as it collides", 0.42, "spacings",
                        gt=0, le=10)
    count: int = key("of elements; 0: as dense as the exemplar, of threads and sheets 200", 0, ge=0, le=MOST)
    domain: Annotated[Obstacle, Field(discriminator="kind")] | None = key(
        "a table with the keys of one of [[obstacles]]: elements stay inside; none: the whole domain", None)
    toroidal: bool = key("along x, what leaves the domain comes in on the other side", False)
    along: Literal["exemplar", "flow", "centre"] = key(
        "what the exemplar's x axis follows: itself, the coarse motion, or circles round the domain's centre",
        "exemplar")
    pins: Annotated[tuple[Pin, ...], Strict(False)] = key(
        "hard positions, an array of tables [[elements.pins]]", (), max_length=1000)
    selections: Annotated[tuple[Selection, ...], Strict(False)] = key(
        "an array of tables [[elements.selections]]", (), max_length=16)
    control: Control | None = key("a control map; none: all elements stand everywhere alike", None)


class Synthesis(Table):
    """The synthesis (§4.1, §4.2, Table 2)."""

    neighborhood: float = key("radius", 2.0, "spacings", ge=1, le=10)
    before: int = key("frames of the neighbourhood before its own", 0, "frames", ge=0, le=60)
    after: int = key("frames after it, with sequence = \"together\"", 0, "frames", ge=0, le=60)
    whole: bool = key("neighbours in all these frames, not only the sample itself (figure 3)", False)
    sigma_p: float = key("falloff in space (Eq. 10); 0: none", 0.0, "neighbourhoods", ge=0, le=1000)
    matches: int = key("N, that predict together (§4.2)", 2, ge=1, le=4)
    iterations: int = key("of search and assignment, at most", 8, ge=1, le=200)
    sequence: Literal["frames", "together"] = key("frame by frame, or all frames together", "together")
    search: Literal["exact", "k-coherence"] = key("exhaustive, or k-coherence", "k-coherence")
    assignment: Literal["sparse", "local"] = key(
        "all positions at once, or each by its neighbours as constants (§4.1, Parallelization)", "sparse")
    hybrid: bool = key("resolve collisions (figure 5): of points after each assignment; threads never pass "
                       "through each other", False)
    hold: float = key("weight of the coarse place of threads and sheets", 0.3, ge=0, le=100)


class BeadsRender(Table):
    """Particles of the plane, seen from above."""

    kind: Literal["beads"] = key("beads on paper")
    width: int = key("of the picture", 800, "pixels", ge=16, le=LARGEST)
    spp: int = key("paths per pixel", 64, ge=1, le=65536)
    colour: Literal["exemplar", "origin"] = key(
        "of a bead: that of what it was copied from, or by where it is in the first frame, which shows its way",
        "exemplar")


class SchoolRender(Table):
    """Fish under water."""

    kind: Literal["school"] = key("fish in the sea")
    width: int = key("of the picture", 960, "pixels", ge=16, le=LARGEST)
    height: int = key("of the picture", 540, "pixels", ge=16, le=LARGEST)
    spp: int = key("paths per pixel", 128, ge=1, le=65536)
    speed: float = key("at which the school swims along x, as the picture follows it", 2.2, "spacings per second", ge=0,
                       le=1000)


class NoodlesRender(Table):
    """Noodles on a plate."""

    kind: Literal["noodles"] = key("noodles in a studio")
    width: int = key("of the picture", 960, "pixels", ge=16, le=LARGEST)
    height: int = key("of the picture", 540, "pixels", ge=16, le=LARGEST)
    spp: int = key("paths per pixel", 64, ge=1, le=65536)


class PaperRender(Table):
    """Sheets of paper in the air."""

    kind: Literal["paper"] = key("paper in a studio")
    width: int = key("of the picture", 960, "pixels", ge=16, le=LARGEST)
    height: int = key("of the picture", 540, "pixels", ge=16, le=LARGEST)
    spp: int = key("paths per pixel", 64, ge=1, le=65536)
    colour: Literal["exemplar", "mixed"] = key(
        "of a sheet: that of what it was copied from, or by chance of a few that go together", "mixed")


ElementsPanel = Literal["exemplar", "coarse", "result"]


class ElementsFigure(Table):
    """The panels of X.png and X.mp4, set as those of other scenes."""

    panels: Annotated[tuple[ElementsPanel, ...], Strict(False)] = key("from left to right", ("exemplar", "result"),
                                                                      min_length=1)
    labels: Annotated[tuple[str, ...], Strict(False)] = key(
        "below the panels, *italics* between asterisks; none: their usual ones", ())
    inset: bool = key("the exemplar in a corner of the result", False)
    columns: int = key("panels in a row; 0: all", 0, ge=0, le=64)
    panel: int = key("width of a panel", 640, "pixels", ge=16, le=LARGEST)
    frame: int = key("the frame the still shows; 0: the last", 0, ge=0, le=100000)
    animation: bool = key("make X.mp4 too; else bake and render the still's frame alone", True)


ElementsCoarse = (NoiseMotion | WakeMotion | AnalyticMotion | FileMotion | CarriedThreads | CarriedSheets |
                  TracksMotion)
FLOWS = ("curl-noise", "wake", "analytic", "file")
"""Kinds of [coarse] that are fields, which carry particles."""


class ElementsScene(Table):
    """A scene of elements: keys above the first table."""

    title: str = key("what the figure shows", min_length=1, max_length=200)
    source: str = key("the figure it reproduces or what it is made after", "", max_length=200)
    seed: int = key("of every random choice", 1, ge=0, le=2**31 - 1)
    frames: int = key("length of the animation", 60, "frames", ge=1, le=100000)
    fps: float = key("speed of the animation", 24, "frames per second", ge=1, le=1000)
    exemplar: ElementsExemplar = Field(discriminator="kind")
    elements: Elements
    coarse: Annotated[ElementsCoarse, Field(discriminator="kind")] | None = key(
        "the coarse motion; none: elements are carried nowhere", None)
    obstacles: Annotated[tuple[Obstacle, ...], Strict(False)] = key(
        "solids that elements keep out of, an array of tables [[obstacles]]", (), max_length=64)
    synthesis: Synthesis = Synthesis()
    render: BeadsRender | SchoolRender | NoodlesRender | PaperRender = Field(discriminator="kind")
    figure: ElementsFigure = ElementsFigure()

    @property
    def cells(self) -> tuple[int, ...]:
        """Of the grid on which the domain is known, x first."""
        return self.elements.size

    @property
    def cells_key(self) -> str:
        """The key that says them."""
        return "elements.size"

    @property
    def dimension(self) -> int:
        """Of the domain: 2 or 3."""
        return len(self.cells)

    @property
    def shape(self) -> tuple[int, ...]:
        """The cells as arrays count them, (Y, X) or (Z, Y, X)."""
        return self.cells[::-1]

    @property
    def stone(self) -> ShapeObstacle | None:
        """The first round obstacle, which a wake is behind."""
        return next((o for o in self.obstacles if isinstance(o, ShapeObstacle) and o.kind == "ball"), None)

    @property
    def flows(self) -> bool:
        """Whether a field carries the elements."""
        return self.coarse is not None and self.coarse.kind in FLOWS

    @property
    def exemplars(self) -> dict[str, str]:
        """The exemplar's product, and its key."""
        return {"exemplar": "exemplar"}
