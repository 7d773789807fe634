"""The tables of okabe11's synthesis, and what a scene of a photograph is to them.

A key's section (§) is okabe11's. The table [clips] stands with what it does; `scene` puts all of them together.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import Field, Strict

from pipeline.tables import Asset, FigureTable, SceneTables, Table, key

Place = Annotated[float, Field(ge=-100000, le=100000)]
Stroke = Annotated[tuple[Annotated[tuple[Place, Place], Strict(False)], ...], Strict(False), Field(min_length=2)]
Share01 = Annotated[float, Field(ge=0, le=1)]


class Photo(Table):
    """The photograph or painting, and what the user says of it."""

    file: Asset | None = key("the picture: JPEG, PNG, TIFF; none: `made` says it", None)
    made: Literal["", "fire", "smoke", "painting"] = key(
        "in place of a file, a target that is made, with its matte, its background and, unless the scene gives them, "
        "its strokes: a bonfire, the smoke of a stack, a painting of a waterfall; it counts as 640 x 480 pixels; "
        "\"\": photo.file", "")
    matte: Asset | None = key("of a file: a grey picture of the same size, white where the fluid is (§3)", None)
    frozen: Asset | None = key("a grey picture of the same size: white where something stands still in the fluid, "
                               "as stones and ledges do; none: nothing", None)
    background: Asset | None = key("a picture of the same size that is seen where a dynamic matte leaves (§6); none: "
                                   "inpainted", None)
    strokes: Annotated[tuple[Stroke, ...], Strict(False)] = key(
        "strokes along the flow, from their first point to their last, each an array of points [x, y] of the file, "
        "from its upper left corner (§5, figure 8); none: a made picture's, or none", (), max_length=1000)
    speeds: Annotated[tuple[Annotated[float, Field(ge=0, le=100)], ...], Strict(False)] = key(
        "a speed of each stroke, as many as strokes; none: the clips alone decide, or photo.speed", (),
        "pixels of the output per frame", max_length=1000)
    speed: Asset | None = key("a grey picture of the same proportions, the speed map (§5, figure 8), as speed.png is: "
                              "black rests, white is photo.fastest; none: the clips alone decide", None)
    fastest: float = key("speed where the speed map is white", 4.0, "pixels of the output per frame", gt=0, le=100)
    width: int = key("width of the output; the picture is scaled to it", 640, "pixels", ge=64, le=4096)
    carried: Share01 = key("how much of the photograph itself is carried along the motion; 0: the paper's blurred "
                           "average, to which differences are added", 1.0)
    feature: float = key("size of what moves in the photograph, as streaks, ripples and billows: what is larger "
                         "stands, as the steps of a stream", 10.0, "pixels of the output", ge=2, le=200)
    strength: float = key("strength of the differences", 1.0, ge=0, le=4)
    matching: Literal["gains", "histograms", "regions", "none"] = key(
        "how differences get the look of the picture (§6): \"gains\" by the strength of their bands, over all time; "
        "\"histograms\" frame by frame in regions that overlap; \"regions\" as in the paper, in regions side by "
        "side", "gains")
    blending: Literal["roots", "shares"] = key(
        "weights of pieces that overlap (figure 9): \"roots\": their squares add up to one, which keeps contrast; "
        "\"shares\": they do, as in the paper", "roots")
    dynamics: Annotated[float, Field(ge=0, lt=1)] = key(
        "τ of the dynamic boundary of fire and smoke (§6); 0: the matte stands still", 0.0)
    boundary: Literal["displaced", "mixed"] = key(
        "what a dynamic boundary is: \"displaced\", and the fluid with it, by the changing motion of the clips; "
        "\"mixed\" with the one before, as in the paper", "displaced")


class Assignment(Table):
    """The assignment of pieces (§5)."""

    piece: int = key("edge of a piece; of 48 in the paper, about the size of the fluid's features", 48, "pixels",
                     ge=16, le=256, multiple_of=16)
    candidates: int = key("of each piece of the picture", 100, ge=1, le=1000)
    sigma: float = key("σ of Eq. 2: motion that changes, over its mean", 0.7, ge=0, le=1000)
    rho: float = key("ρ of Eq. 6: textureness over motion", 0.5, ge=0, le=100000)
    weight: float = key("λ of Eq. 4: neighbours over likeness", 0.15, ge=0, le=1000)
    texture: float = key("weight of the difference of textureness in Eq. 5", 0.35, ge=0, le=100)
    brightness: float = key("weight of the difference of brightness in Eq. 5", 0.5, ge=0, le=100)
    minimizer: Literal["messages", "expansion", "modes", "data"] = key(
        "\"messages\": TRW-S; \"expansion\": the paper's α-expansion; \"modes\": ICM; \"data\": no neighbours",
        "messages")
    energy: Literal["mended", "printed"] = key(
        "\"printed\": Eqs. 2, 3 and 5 as the paper has them, in its units, to compare with", "mended")

    def settings(self) -> Any:
        """As synth.photo.assign takes them."""
        from synth.photo.assign import Settings

        return Settings(**self.model_dump(exclude={"piece"}))


OfTarget = Literal["target", "strokes", "matte", "orientation", "speed", "motion", "database", "result"]
OfPiece = Literal["clip", "piece", "flow", "mean-motion", "significant-motion", "average", "difference", "spectrum",
                  "textureness"]
OfPair = Literal["neighbours", "neighbour-pieces", "neighbour-differences", "shares", "roots",
                 "deviation"]
PanelName = OfTarget | OfPiece | OfPair
ClipPiece = Annotated[tuple[str, Share01, Share01], Strict(False)]
ScenePlace = Annotated[tuple[Share01, Share01], Strict(False)]


class Figure(FigureTable):
    """The panels of X.png and X.mp4. With moments, the still shows result and matte once for each of them."""

    panels: Annotated[tuple[PanelName, ...], Strict(False)] = key(
        "panels from left to right; those that show a piece stand once for each of figure.pieces, in turn, as far as "
        "they follow each other", ("target", "result"), min_length=1)
    moments: Annotated[tuple[Annotated[int, Field(ge=1, le=100000)], ...], Strict(False)] = key(
        "frames at which the still shows result and matte; none: figure.frame alone", (), "frames", max_length=16)
    pieces: Annotated[tuple[ClipPiece, ...], Strict(False)] = key(
        "pieces of clips whose processing is shown (figures 5 to 7), each [clip, x, y]: its clip, as \"fall-01\", "
        "\"own-01\" or \"library-pond\", and its middle, from the upper left corner", (),
        "widths and heights of the clip", max_length=8)
    place: ScenePlace = key(
        "x and y from the upper left corner: the two neighbours beside each other nearest to it are shown (figure 9)",
        (0.5, 0.5), "widths and heights of the picture")

    def shown(self, frames: int) -> list[int]:
        return sorted({*super().shown(frames), *self.moments})


class PhotoScene(SceneTables):
    """A scene of a photograph as its artifacts see it; `scene.Scene` is the whole of it."""

    if TYPE_CHECKING:
        photo: Photo
        clips: Any
        assignment: Assignment
        figure: Figure

    cells_key: ClassVar[str] = "photo.width"
