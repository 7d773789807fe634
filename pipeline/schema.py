"""The tables and keys of a scene: types, ranges, units, defaults, and what each is for.

A key's section (§) is ma09's. scenes/README.md shows all of them; tests/test_schema.py holds it to this file.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, Strict, ValidationInfo

PROJECT_SCENES = Path(__file__).resolve().parent.parent / "scenes"
LARGEST = 4096  # cells or pixels along an axis; beyond it a slip of the keyboard is likelier than a wish


def _inside(name: Path, info: ValidationInfo) -> Path:
    """The existing file `name`: relative, inside the scene's folder, or inside the project's scenes/assets."""
    found = _there(name, info)
    if not found.is_file():
        raise ValueError(f"'{name}' is not a file")
    return found


def _inside_or_folder(name: Path, info: ValidationInfo) -> Path:
    """The same, or a folder there, whose files are links to none outside it."""
    found = _there(name, info)
    if not found.is_dir():
        return _inside(name, info)
    for file in found.iterdir():
        if not file.resolve().is_relative_to(found):
            raise ValueError(f"'{name}/{file.name}' is a link that leaves its folder")
    return found


def _there(name: Path, info: ValidationInfo) -> Path:
    if name.is_absolute() or ".." in name.parts:
        raise ValueError(f"'{name}' leaves the scene's folder; write a path relative to it, without ..")
    folder: Path = info.context["folder"] if info.context else Path()
    for start, home in ((folder, folder), (PROJECT_SCENES, PROJECT_SCENES / "assets")):
        try:
            found = (start / name).resolve()
            if not found.exists():
                continue
        except (OSError, ValueError, RuntimeError) as error:
            raise ValueError(f"'{name}' cannot be a file ({error})") from error
        if not found.is_relative_to(home.resolve()):
            raise ValueError(f"'{name}' is a link that leaves the scene's folder")
        return found
    raise ValueError(f"no file '{name}' in the scene's folder or the project's scenes/assets")


class Table(BaseModel):
    """A table of a scene: unknown keys, other types and NaN or infinity are errors."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


def key(description: str, default: Any = ..., unit: str = "", **limits: Any) -> Any:
    """A key of a table with what scenes/README.md says of it. A default that depends on other keys is a function
    of those before it; its description says what it gives."""
    kind = "default_factory" if callable(default) else "default"
    return Field(**{kind: default}, description=description, json_schema_extra={"unit": unit}, **limits)


Asset = Annotated[Path, Strict(False), AfterValidator(_inside)]
AssetOrFolder = Annotated[Path, Strict(False), AfterValidator(_inside_or_folder)]


def _odd(width: int) -> int:
    if width % 2 == 0:
        raise ValueError(f"should be odd, not {width}")
    return width


def _several(value: object) -> object:
    return [value] if isinstance(value, int | float) else value


Width = Annotated[int, Field(ge=3, le=33), AfterValidator(_odd)]
Cells = Annotated[int, Field(ge=4, le=LARGEST)]
Share = Annotated[float, Field(gt=0, le=1)]
Vector = Annotated[tuple[Annotated[float, Field(ge=-1000, le=1000)], ...], Strict(False)]


def grid(description: str, default: Any) -> Any:
    """The key `size` of a field: two numbers in the plane, three in space."""
    return key(f"{description}; in 3-D layers (z) too", default, "cells", min_length=2, max_length=3)


Grid = Annotated[tuple[Cells, ...], Strict(False)]


class ProceduralExemplar(Table):
    """An exemplar made by procedure (§4, figures 1, 2, 4 and 9)."""

    kind: Literal["circle", "square", "heart", "stripes", "sinusoid"] = key("the shape its flow lines follow")
    size: int = key("edge; with detail.size it sets the texture scale", 64, "cells", ge=8, le=1024)


class BitmapExemplar(Table):
    """The curl of a picture's grey values (§4: "we take curl on the gray scale magnitude")."""

    kind: Literal["bitmap"] = key("a picture")
    file: Asset = key("PNG; its central square is taken")
    size: int = key("edge, to which it is resampled", 64, "cells", ge=8, le=1024)
    blur: float = key("standard deviation of a Gaussian on the picture", 1.0, "cells", ge=0, le=64)


class DrawingExemplar(Table):
    """The strokes of a hand drawing, along their direction (§1, "manual art")."""

    kind: Literal["drawing"] = key("a drawing")
    file: Asset = key("PNG (an open stroke starts at its red dot) or SVG")
    size: int = key("edge", 64, "cells", ge=8, le=1024)


class FieldExemplar(Table):
    """A field made elsewhere."""

    kind: Literal["field"] = key("a field")
    file: Asset = key("EXR (channels x, y) or VDB (grid vel; its middle slice, in 3-D all of it), any unit")
    size: int = key("edge, to which its central square or cube is resampled", 64, "cells", ge=8, le=1024)
    toroidal: bool = key("take out the jumps where the tile's borders meet", False)

    @property
    def solid(self) -> bool:
        """Whether it fills a volume, where the scene is in 3-D."""
        return self.file.suffix == ".vdb"


class ClipExemplar(Table):
    """The mean optical flow of a clip (§1, "captured data")."""

    kind: Literal["clip"] = key("a clip")
    file: Asset = key("a video")
    size: int = key("edge, to which its central square is resampled", 64, "cells", ge=8, le=1024)


Exemplar = ProceduralExemplar | BitmapExemplar | DrawingExemplar | FieldExemplar | ClipExemplar


class SmokeMotion(Table):
    """L by simulation: stable fluids with vorticity confinement (§4: [Fedkiw et al. 2001])."""

    kind: Literal["smoke"] = key("a plume that rises from a hot ball")
    size: Grid = grid("columns and rows of L", (64, 64))
    radius: float = key("of the hot ball", 0.08, "heights", gt=0, le=0.5)
    height: float = key("of the hot ball's centre", 0.1, "heights", ge=0, le=1)
    buoyancy: float = key("acceleration of the hottest smoke", 9.5e-4, "heights per frame²", ge=0, le=0.1)
    confinement: float = key("ε of [Fedkiw et al. 2001]: what keeps vortices", 0.15, "per frame", ge=0, le=2)
    cooling: float = key("share of the temperature lost", 0.01, "per frame", ge=0, lt=1)
    sway: float = key("sideways wandering of the rising smoke, by seeded noise", 2.0, "buoyancies", ge=0, le=20)
    sway_period: float = key("in which it wanders from side to side", 20.0, "frames", gt=0, le=100000)
    warmup: int = key("simulated before the first", 0, "frames", ge=0, le=10000)


class NoiseMotion(Table):
    """L by curl noise ([Bridson et al. 2007], of figure 7)."""

    kind: Literal["curl-noise"] = key("the curl of a random potential")
    size: Grid = grid("columns and rows of L", (64, 64))
    octaves: int = key("each of half the size of the one before", 3, ge=1, le=10)
    length: float = key("of the largest features", 0.5, "heights", gt=0, le=10)
    gain: float = key("speed of an octave over that of the one before", 0.6, ge=0, le=2)
    speed: float = key("rms of the first frame", 1.0, "cells of L per frame", ge=0, le=100)
    period: float = key("in which the largest features turn over", 60.0, "frames", gt=0, le=100000)


class AnalyticMotion(Table):
    """L by formula, steady, free of divergence."""

    kind: Literal["analytic"] = key("a formula")
    size: Grid = grid("columns and rows of L", (64, 64))
    flow: Literal["constant", "diagonal", "rotation", "shear", "saddle", "vortex-pair"] = key("its form", "constant")
    speed: float = key("largest", 1.0, "cells of L per frame", gt=0, le=100)
    angle: float = key("turns the whole pattern", 0.0, "degrees", ge=-360, le=360)


class WakeMotion(Table):
    """L of figure 7: a river past a round stone, the first [[obstacles]] with kind = "ball" ([Bridson et al. 2007])."""

    kind: Literal["wake"] = key("a wake behind a stone")
    size: Grid = grid("columns and rows of L", (200, 150))
    flow: float = key("of the river along x", -0.25, "heights per unit of time", ge=-10, le=10)
    influence: float = key("distance from the stone within which the river gives way", 0.25, "heights", gt=0, le=10)
    expansion: float = key("how much the wake widens, to each side, per height downstream", 0.3, ge=0, le=10)
    lengths: Annotated[tuple[Annotated[float, Field(gt=0, le=10)], ...], Strict(False)] = key(
        "sizes of the features of each octave of noise in the wake", (0.1, 0.06, 0.026), "heights", max_length=8)
    gains: Annotated[tuple[Annotated[float, Field(ge=0, le=10)], ...], Strict(False)] = key(
        "amplitude of the potential of each octave", (0.03, 0.0105, 0.003), "heights² per unit of time", max_length=8)
    step: float = key("time from frame to frame", 0.04, "units of time", gt=0, le=10)
    period: float = key("in which the noise turns over", 25.0, "frames", gt=0, le=100000)


class FileMotion(Table):
    """L from a file."""

    kind: Literal["file"] = key("a field, the same in every frame")
    file: Asset = key("EXR (channels x, y) or VDB (grid vel; its middle slice, in 3-D all of it), heights per second; "
                      "it fills the domain, wherever it lies and whatever its voxels")


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
        "of the image pyramid; \"auto\" brings the exemplar down to 8 cells", "auto")
    neighborhoods: Annotated[tuple[Width, ...], Strict(False)] = key(
        "widths, odd, in the order used (§4: 17² followed by 9²; 9² in 3-D)", _neighborhoods, "cells",
        min_length=1, max_length=4)
    iterations: int = key("of search and assignment with each width (§4: 3 to 5)", 4, ge=1, le=50)
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
        "that the exemplar's x and y axis lie in: front x, y; side z, y; top x, z", None)
    right: Vector | None = key("the exemplar's x axis in the local frame, instead of a plane", None, min_length=3,
                               max_length=3)
    up: Vector | None = key("its y axis, made perpendicular to right", None, min_length=3, max_length=3)
    weight: float = key("of its matches beside those of the other views (§4)", 1.0, gt=0, le=1000)
    exemplar: Annotated[Exemplar, Field(discriminator="kind")] | None = key(
        "its own, a table with the keys of [exemplar]; none: that one", None)

    @property
    def axes(self) -> tuple[Triple, Triple]:
        """Right and up, as they are written."""
        return PLANES[self.plane] if self.plane else (_triple(self.right), _triple(self.up))


    @property
    def solid(self) -> bool:
        """Whether its exemplar is a volume, which fixes all components."""
        return _solid(self.exemplar)


def _solid(exemplar: Exemplar | None) -> bool:
    return isinstance(exemplar, FieldExemplar) and exemplar.solid


class ShapeObstacle(Table):
    """A solid in the flow (§3.6, figure 7). Several are one."""

    kind: Literal["ball", "box"] = key("its form; a ball in the plane is a disc")
    centre: Annotated[tuple[float, ...], Strict(False)] = key(
        "(x, y), in 3-D (x, y, z)", ..., "heights", min_length=2, max_length=3)
    radius: Annotated[tuple[Annotated[float, Field(gt=0, le=10)], ...], Strict(False), BeforeValidator(_several)] = key(
        "of the ball, or half the box's edge; of a box one number, or one for each axis", ..., "heights",
        min_length=1, max_length=3)
    angle: float = key("turns a box in the plane of x and y", 0.0, "degrees", ge=-360, le=360)


class PictureObstacle(Table):
    """Solids from a picture (figure 8: "object contours"); in 3-D prisms along z."""

    kind: Literal["mask", "drawing"] = key("white is solid, or ink and what ink encloses is")
    file: Asset = key("PNG; of a drawing SVG too, what its closed paths enclose")
    centre: Annotated[tuple[float, float], Strict(False)] = key("of the picture", (0.0, 0.5), "heights")
    height: float = key("of the picture", 1.0, "heights", gt=0, le=10)


class MeshObstacle(Table):
    """A solid modelled elsewhere, filled with voxels; in 2-D its section at z = 0. Holes in it are closed."""

    kind: Literal["mesh"] = key("a triangle mesh")
    file: Asset = key("PLY, OBJ or STL, y upwards")
    centre: Annotated[tuple[float, float, float], Strict(False)] | None = key(
        "where the middle of its bounding box is put; none: where it is", None, "heights")
    height: Annotated[float, Field(gt=0, le=10)] | None = key(
        "to which it is scaled; none: its coordinates are heights", None, "heights")


class LevelSetObstacle(Table):
    """A solid modelled elsewhere, where it stands in its own coordinates; in 2-D its section at z = 0."""

    kind: Literal["level-set"] = key("a level set")
    file: Asset = key("VDB, of any origin")
    grid: str = key("its grid of class level set", "surface", min_length=1, max_length=200)


Obstacle = Annotated[ShapeObstacle | PictureObstacle | MeshObstacle | LevelSetObstacle, Field(discriminator="kind")]


class Combine(Table):
    """F = upsample(L) + ω H' (§3.5)."""

    omega: float = key("ω, the length of the exemplar's longest vector in F", ..., "cells per frame", ge=0, le=1000)
    weight: Literal["uniform", "kinetic-energy", "vorticity"] = key("what ω is proportional to in space", "uniform")
    project: bool = key("make F divergence-free and let nothing flow through obstacles (§3.6, incompressibility); over "
                        "the border it flows freely but where L is smoke in its box", False)


class Source(Table):
    """Where smoke enters, in every frame (supplement A: "inject density sources").
    World units: the domain is 1 high, its floor at y = 0, centred on x = 0 and z = 0."""

    kind: Literal["ball", "box"] = key("its form", "ball")
    centre: Annotated[tuple[float, ...], Strict(False)] = key(
        "(x, y) or (x, y, z)", (0.0, 0.1), "heights", min_length=2, max_length=3)
    radius: Annotated[tuple[Annotated[float, Field(gt=0, le=10)], ...], Strict(False), BeforeValidator(_several)] = key(
        "of the ball, or half the box's edge; one number, or one for each axis", (0.08,), "heights",
        min_length=1, max_length=3)
    softness: float = key("share of the radius over which the edge fades", 0.3, ge=0, le=1)
    level: float = key("density injected", 1.0, ge=0, le=1)
    streaks: float = key("contrast of streaks, which draw the paths of the smoke", 0.0, ge=0, le=1)
    streak_size: float = key("width of a streak", 0.02, "heights", gt=0, le=1)
    streak_period: float = key("in which the streaks change", 40.0, "frames", gt=0, le=100000)
    period: int = key("of puffs", 1, "frames", ge=1, le=100000)
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

    height: float = key("of the tallest blade", 0.95, "heights", gt=0, le=2)
    spacing: float = key("least distance of two plants", 0.13, "heights", ge=0.03, le=2)
    cover: Share = key("of the floor that plants stand on, in patches", 0.5)
    bend: float = key("tangent of the angle by which a flow of one height per second bends a tip", 2.0, ge=0, le=100)
    window: int = key("whose motion a tip follows; half of it is its lag", 9, "frames", ge=1, le=100)


class Particles(Table):
    """Particles that F carries, for [render] kind = "particles" (figure 7)."""

    count: int = key("how many", 40000, ge=1, le=10000000)
    life: int = key("after which one is born again elsewhere", 60, "frames", ge=2, le=100000)


class LitRender(Table):
    """2-D smoke, lit in its own plane."""

    kind: Literal["lit"] = key("a sheet of smoke that shadows itself")
    width: int = key("of the picture", 1024, "pixels", ge=16, le=LARGEST)


class InkRender(Table):
    """2-D smoke as ink on white paper."""

    kind: Literal["ink"] = key("ink on paper")
    width: int = key("of the picture", 1024, "pixels", ge=16, le=LARGEST)
    colour: Literal["indigo", "sepia", "black"] = key("of the ink", "indigo")


class VolumeRender(Table):
    """A volume, path-traced by Mitsuba or marched through by OpenCL. A march takes seconds, has no noise and does not
    flicker; it is an approximation."""

    kind: Literal["volume"] = key("a volume in a studio")
    width: int = key("of the picture", 512, "pixels", ge=16, le=LARGEST)
    height: int = key("of the picture", 640, "pixels", ge=16, le=LARGEST)
    method: Literal["path", "march", "both"] = key(
        "path-traced, marched, or both: the still path-traced, the animation marched", "path")
    spp: int = key("paths per pixel", 64, ge=1, le=65536)
    denoised: bool = key("fit the paths to guides without noise", True)
    extinction: float = key("of smoke of density 1", 110.0, "per height", gt=0, le=10000)
    bowl: Annotated[tuple[Share, Share], Strict(False)] | None = key(
        "radius and height of the bowl that the plume rises from", None, "heights")
    elevation: float | None = key("of the camera above the horizon; none: about level with the plume", None, "degrees",
                                  ge=0, le=85)


class SeaweedRender(Table):
    """The blades under water, path-traced by Mitsuba."""

    kind: Literal["seaweed"] = key("blades under water")
    width: int = key("of the picture", 960, "pixels", ge=16, le=LARGEST)
    height: int = key("of the picture", 540, "pixels", ge=16, le=LARGEST)
    spp: int = key("paths per pixel", 64, ge=1, le=65536)


class ParticlesRender(Table):
    """The particles as foam on a river, seen from above; obstacles are stones, path-traced once by Mitsuba."""

    kind: Literal["particles"] = key("foam on a river")
    width: int = key("of the picture (figure 7: 640×480)", 640, "pixels", ge=16, le=LARGEST)
    spp: int = key("paths per pixel of the stones", 128, ge=1, le=65536)
    streak: float = key("length of a streak, in time", 1.2, "frames", ge=0, le=100)
    white: float = key("speed at which foam is white", 0.7, "heights per second", gt=0, le=1000)


class NoRender(Table):
    """No smoke: a figure of fields alone; nothing is baked but F."""

    kind: Literal["none"] = key("fields only")
    width: int = key("of a panel", 1024, "pixels", ge=16, le=LARGEST)


Panel = Literal["input", "exemplar", "exemplar-colour", "exemplar-arrows", "coarse", "coarse-colour", "detail",
                "detail-colour", "detail-arrows", "detail-divergence", "combined", "combined-colour", "result"]


def is_of_exemplar(panel: str) -> bool:
    """Whether there are as many of a panel as there are exemplars."""
    return panel.partition("-")[0] in ("input", "exemplar")


class Figure(Table):
    """The panels of X.png and X.mp4. With several variants and one panel, one panel for each of them; with
    several of both, one row for each variant. A panel of the exemplar stands once for each exemplar of the views."""

    panels: Annotated[tuple[Panel, ...], Strict(False)] = key("from left to right", ("result",), min_length=1)
    labels: Annotated[tuple[str, ...], Strict(False)] = key(
        "below the panels, *italics* between asterisks; none: their usual ones", ())
    plane: Literal["front", "side", "top"] = key("of the middle slice that panels of 3-D fields show", "front")
    columns: int = key("panels in a row; 0: all", 0, ge=0, le=64)
    panel: int = key("width of a panel", 512, "pixels", ge=16, le=LARGEST)
    frame: int = key("the frame the still shows; 0: the last", 0, ge=0, le=100000)
    animation: bool = key("make X.mp4 too; else bake and render the still's frame alone", True)


class Scene(Table):
    """The scene itself: keys above the first table."""

    title: str = key("what the figure shows", min_length=1, max_length=200)
    source: str = key("the figure it reproduces or what it is made after", "", max_length=200)
    seed: int = key("of every random choice", 1, ge=0, le=2**31 - 1)
    frames: int = key("length of the animation", 90, "frames", ge=1, le=100000)
    fps: float = key("speed of the animation", 30, "frames per second", gt=0, le=1000)
    exemplar: Exemplar = Field(discriminator="kind")
    coarse: SmokeMotion | NoiseMotion | WakeMotion | AnalyticMotion | FileMotion = Field(discriminator="kind")
    views: Annotated[tuple[View, ...], Strict(False)] = key(
        "in 3-D, an array of tables [[views]]; none: front, side and top of [exemplar]", (), max_length=16)
    detail: Detail = Detail()
    obstacles: Annotated[tuple[Obstacle, ...], Strict(False)] = key(
        "solids in the flow, an array of tables [[obstacles]]", (), max_length=64)
    combine: Combine
    density: Density = Density()
    particles: Particles = Particles()
    blades: Blades = Blades()
    render: LitRender | InkRender | VolumeRender | ParticlesRender | SeaweedRender | NoRender = Field(
        discriminator="kind")
    figure: Figure = Figure()

    @property
    def dimension(self) -> int:
        """Of the fields: 2 or 3."""
        return len(self.detail.size)

    @property
    def cells(self) -> tuple[int, ...]:
        """Of H and F, x first."""
        return self.detail.size

    @property
    def cells_key(self) -> str:
        """The key that says them."""
        return "detail.size"

    @property
    def shape(self) -> tuple[int, ...]:
        """The cells as arrays count them, (Y, X) or (Z, Y, X)."""
        return self.cells[::-1]

    @property
    def flows(self) -> bool:
        """Whether the coarse motion is a field."""
        return True

    @property
    def stone(self) -> ShapeObstacle | None:
        """The first round obstacle, which a wake is behind."""
        return next((o for o in self.obstacles if isinstance(o, ShapeObstacle) and o.kind == "ball"), None)

    @property
    def seen(self) -> tuple[View, ...]:
        """The views of a 3-D scene, each with its exemplar."""
        planes: tuple[Any, ...] = ("front",) if _solid(self.exemplar) else ("front", "side", "top")
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
