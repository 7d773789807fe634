"""The tables of ma13's synthesis, and what a scene of elements is to them.

A key's section (§) is ma13's. The tables [exemplar], [coarse], [[obstacles]] and [render] stand with what they do:
`exemplars`, `coarse`, `pipeline.flow`, `looks`; `scene` puts all of them together.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import Field, Strict

from pipeline.flow import Obstacle, SceneInFlow
from pipeline.tables import LARGEST, Asset, FigureTable, Grid, Table, grid, key

MOST = 100_000  # elements of an output
Place = Annotated[tuple[Annotated[float, Field(ge=-100, le=100)], ...], Strict(False)]


class Pin(Table):
    """A hard position (§4.1): an element is at a place in a frame."""

    at: Place = key("(x, y) or (x, y, z)", ..., "heights", min_length=2, max_length=3)
    frame: int = key("when", 1, "frames", ge=1, le=100000)


class Selection(Table):
    """Where only some kinds of elements may stand (§4.1, constrained selections)."""

    kinds: Annotated[tuple[Annotated[int, Field(ge=0, le=30)], ...], Strict(False)] = key(
        "kinds of the exemplar's elements: of dots, their colours, numbered by how many there are", ..., min_length=1)
    file: Asset = key("a picture that fills the domain: these kinds stand where it is bright, no other does")


class Control(Table):
    """A control map (§4.1, [Lu et al. 2007]): where which elements of the exemplar should rather stand."""

    file: Asset = key("a picture that fills the domain, black to white")
    property: Literal["size", "kind"] = key(
        "property of the exemplar's elements that follows the map, least to largest", "size")
    weight: float = key("weight of the difference from the map in the search", 1.0, "squared spacings", ge=0, le=1000)


class Elements(Table):
    """The output. Heights are those of the domain, which is 1 high, its floor at y = 0, centred on x = 0 and z = 0."""

    size: Grid = grid("columns and rows of the grid on which domain, obstacles and flow are known", (256, 256))
    spacing: float = key("nearest distance of elements, of sheets that of their samples: to it the exemplar is scaled",
                         0.03, "heights", gt=0, le=1)
    radius: float = key("radius of a particle of the exemplar's middle size, as drawn and as it collides", 0.42,
                        "spacings", gt=0, le=10)
    count: int = key("number of elements; 0: as dense as the exemplar, of threads and sheets 200", 0, ge=0, le=MOST)
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
    iterations: int = key("most rounds of search and assignment", 8, ge=1, le=200)
    sequence: Literal["frames", "together"] = key("frame by frame, or all frames together", "together")
    search: Literal["exact", "k-coherence"] = key("exhaustive, or k-coherence", "k-coherence")
    assignment: Literal["sparse", "local"] = key(
        "all positions at once, or each by its neighbours as constants (§4.1, Parallelization)", "sparse")
    hybrid: bool = key("resolve collisions (figure 5): of points after each assignment; threads never pass "
                       "through each other", False)
    hold: float = key("weight of the coarse place of threads and sheets", 0.3, ge=0, le=100)


class Figure(FigureTable):
    """The panels of X.png and X.mp4, set as those of other scenes."""

    panels: Annotated[tuple[Literal["exemplar", "coarse", "result"], ...], Strict(False)] = key(
        "panels from left to right", ("exemplar", "result"), min_length=1)
    inset: bool = key("the exemplar in a corner of the result", False)
    panel: int = key("width of a panel", 640, "pixels", ge=16, le=LARGEST)


class ElementsScene(SceneInFlow):
    """A scene of elements as its artifacts see it; `scene.Scene` is the whole of it."""

    if TYPE_CHECKING:
        exemplar: Any
        elements: Elements
        synthesis: Synthesis
        render: Any
        figure: Figure

    cells_key: ClassVar[str] = "elements.size"

    @property
    def cells(self) -> tuple[int, ...]:
        """Of the grid on which the domain is known, x first."""
        return self.elements.size
