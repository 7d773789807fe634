"""The flow that a scene lives in, shared by all methods: its coarse motion L and the solids in it.

Tables [coarse] and [[obstacles]], each with what it does; the artifacts `L`, a velocity in world units per second, and
`solid`, the signed distance to the walls of all obstacles in world units, negative inside, and negative too where the
coarse motion is a file's that has no values there. A new kind of coarse motion or of obstacle is one class here and its
place in `Coarse` or `Obstacle`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, Strict

from pipeline.build.artifact import Artifact, Inputs, Needs, Reads
from pipeline.build.method import Faults
from pipeline.errors import BadInput
from pipeline.files import fields, meshes, netcdf, pictures, video, volumes
from pipeline.tables import Asset, Grid, Radius, SceneTables, Table, grid, key, listed
from synth.field import Field as MotionField
from synth.field import domain_origin

if TYPE_CHECKING:
    from synth import obstacle

OUTLINE = 1024  # rows of the mask that an SVG is filled into
WIDEST = 16.0  # of it, in its heights
VOXEL = 0.5  # of a mesh, in cells of H
Longitude = Annotated[float, Field(ge=-360, le=720)]
Latitude = Annotated[float, Field(ge=-90, le=90)]


# -- coarse motion ------------------------------------------------------------------------------------------------


class Motion(Table):
    """A coarse motion that is a field."""

    is_field: ClassVar[bool] = True
    border: ClassVar[str] = "open"
    """How it meets the border of the domain: "open" flows through, "wall" is a closed box."""
    passes_obstacles: ClassVar[bool] = False
    """Whether it goes round the obstacles by itself."""
    has_gaps: ClassVar[bool] = False
    """Whether it may have no values somewhere: these places are solid."""
    reads: ClassVar[Reads] = ()
    """What `make` reads of the scene beside the table itself."""

    def faults(self, scene: SceneInFlow) -> Faults:
        """What does not fit the scene."""
        yield from ()

    def settings(self, scene: SceneInFlow) -> dict[str, Any]:
        """What `synth.motion.coarse` takes."""
        return self.model_dump(exclude={"kind", "size"})

    def gaps(self, scene: SceneInFlow) -> list[obstacle.Obstacle]:
        """Where it has no values: one solid, or none if it has them everywhere."""
        return []

    def check(self, scene: SceneInFlow) -> None:
        """Refuse a file that cannot be used: raises BadInput."""

    @property
    def unit(self) -> str:
        """The unit of `speeds`, as a legend says it."""
        return "heights per second"

    def speeds(self, L: Iterable[MotionField]) -> Iterator[np.ndarray]:
        """Of each L, world units per second, the speed that a legend shows: (Y, X) or (Z, Y, X) float32."""
        yield from (np.linalg.norm(one.values, axis=-1) for one in L)

    def make(self, scene: SceneInFlow, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, MotionField]]:
        """L, world units per second. A simulation is run from its start: at its resolution that costs little."""
        from synth.motion.coarse import coarse

        table: Any = self
        motion = coarse(table.kind, table.size[::-1], frames[-1], scene.seed, **self.settings(scene))
        before: tuple[np.ndarray, np.ndarray] | None = None
        for frame, values in enumerate(motion, start=1):
            if frame in frames:
                if "solid" in inputs and not self.passes_obstacles:
                    if before is None or not np.array_equal(before[0], values):  # a steady flow is projected once
                        before = values, past_obstacles(scene, inputs, values)
                    values = before[1]
                yield frame, MotionField.centred(values, scene.dimension).per_second(scene.fps)


def past_obstacles(scene: SceneInFlow, inputs: Inputs, L: np.ndarray) -> np.ndarray:
    """L on the cells of H, where the walls are as sharp as H will know them, with no flow through them.

    L and the result are in cells per frame, each of its own grid.
    """
    from synth.motion.coarse import upsample
    from synth.projection import project

    return project(upsample(L, scene.shape), scene.border, walls(scene, inputs))


class SmokeMotion(Motion):
    """L by simulation: stable fluids with vorticity confinement (§4: [Fedkiw et al. 2001])."""

    border: ClassVar[str] = "wall"

    kind: Literal["smoke"] = key("a plume that rises from a hot ball")
    size: Grid = grid("columns and rows of L", (64, 64))
    radius: float = key("radius of the hot ball", 0.08, "heights", gt=0, le=0.5)
    height: float = key("height of the hot ball's centre", 0.1, "heights", ge=0, le=1)
    buoyancy: float = key("acceleration of the hottest smoke", 9.5e-4, "heights per frame²", ge=0, le=0.1)
    confinement: float = key("ε of [Fedkiw et al. 2001]: what keeps vortices", 0.15, "per frame", ge=0, le=2)
    cooling: float = key("share of the temperature lost", 0.01, "per frame", ge=0, lt=1)
    sway: float = key("sideways wandering of the rising smoke, by seeded noise", 2.0, "buoyancies", ge=0, le=20)
    sway_period: float = key("period in which it wanders from side to side", 20.0, "frames", gt=0, le=100000)
    warmup: int = key("frames simulated before the first", 0, "frames", ge=0, le=10000)


class NoiseMotion(Motion):
    """L by curl noise ([Bridson et al. 2007], of figure 7)."""

    kind: Literal["curl-noise"] = key("the curl of a random potential")
    size: Grid = grid("columns and rows of L", (64, 64))
    octaves: int = key("number of octaves, each of half the size of the one before", 3, ge=1, le=10)
    length: float = key("size of the largest features", 0.5, "heights", gt=0, le=10)
    gain: float = key("speed of an octave over that of the one before", 0.6, ge=0, le=2)
    speed: float = key("rms speed of the first frame", 1.0, "cells of L per frame", ge=0, le=100)
    period: float = key("period in which the largest features turn over", 60.0, "frames", gt=0, le=100000)


class AnalyticMotion(Motion):
    """L by formula, steady, free of divergence."""

    kind: Literal["analytic"] = key("a formula")
    size: Grid = grid("columns and rows of L", (64, 64))
    flow: Literal["constant", "diagonal", "rotation", "shear", "saddle", "vortex-pair"] = key(
        "form of the flow", "constant")
    speed: float = key("largest speed", 1.0, "cells of L per frame", gt=0, le=100)
    angle: float = key("turns the whole pattern", 0.0, "degrees", ge=-360, le=360)


class WakeMotion(Motion):
    """L of figure 7: a river past a round stone, the first [[obstacles]] with kind = "ball" ([Bridson et al. 2007])."""

    passes_obstacles: ClassVar[bool] = True
    reads: ClassVar[Reads] = ("stone",)

    kind: Literal["wake"] = key("a wake behind a stone")
    size: Grid = grid("columns and rows of L", (200, 150))
    flow: float = key("speed of the river along x", -0.25, "heights per unit of time", ge=-10, le=10)
    influence: float = key("distance from the stone within which the river gives way", 0.25, "heights", gt=0, le=10)
    expansion: float = key("how much the wake widens, to each side, per height downstream", 0.3, ge=0, le=10)
    lengths: Annotated[tuple[Annotated[float, Field(gt=0, le=10)], ...], Strict(False)] = key(
        "sizes of the features of each octave of noise in the wake", (0.1, 0.06, 0.026), "heights", max_length=8)
    gains: Annotated[tuple[Annotated[float, Field(ge=0, le=10)], ...], Strict(False)] = key(
        "amplitude of the potential of each octave", (0.03, 0.0105, 0.003), "heights² per unit of time", max_length=8)
    step: float = key("time from frame to frame", 0.04, "units of time", gt=0, le=10)
    period: float = key("period in which the noise turns over", 25.0, "frames", gt=0, le=100000)

    def faults(self, scene: SceneInFlow) -> Faults:
        if scene.dimension == 3:
            yield "coarse.kind", f'"wake" is a flow of the plane; {scene.cells_key} is {listed(scene.cells)}'
        if scene.stone is None:
            yield "coarse.kind", '"wake" needs a stone, an [[obstacles]] with kind = "ball"'
        if len(self.lengths) != len(self.gains):
            yield "coarse.gains", f"{len(self.gains)} gains for {len(self.lengths)} lengths"

    def settings(self, scene: SceneInFlow) -> dict[str, Any]:
        assert scene.stone is not None, "a check of the scene"
        return super().settings(scene) | {"centre": scene.stone.centre, "radius": scene.stone.radius[0]}


class FileMotion(Motion):
    """L from a file."""

    reads: ClassVar[Reads] = ("cells", "cells_key")

    kind: Literal["file"] = key("a field, the same in every frame")
    file: Asset = key("EXR (channels x, y) or VDB (grid vel; its middle slice, in 3-D all of it), heights per second; "
                      "it fills the domain, wherever it lies and whatever its voxels")

    def check(self, scene: SceneInFlow) -> None:
        self._read(scene)

    def _read(self, scene: SceneInFlow) -> MotionField:
        """The field of the file, world units per second."""
        read = fields.read_user_field(self.file, "coarse.file", scene.dimension)
        size, cells = read.shape[::-1], scene.cells
        if not read.values.any():
            raise BadInput(self.file, "coarse.file", "is 0 everywhere")
        if not _alike(cells, size):
            raise BadInput(self.file, "coarse.file",
                           f"{listed(size)} has not the shape of {scene.cells_key}, {listed(cells)}")
        return MotionField.centred(read.values, scene.dimension)

    def make(self, scene: SceneInFlow, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, MotionField]]:
        """L, world units per second: the field of the file in every frame."""
        steady = self._read(scene)
        if "solid" in inputs:
            values = past_obstacles(scene, inputs, steady.per_frame(scene.fps).values)
            steady = MotionField.centred(values, scene.dimension).per_second(scene.fps)
        yield from ((frame, steady) for frame in frames)


def _alike(cells: tuple[int, ...], size: tuple[int, ...]) -> bool:
    """Whether two grids have the same proportions."""
    return all(n * size[1] == cells[1] * m for n, m in zip(cells, size, strict=True))


class NetcdfMotion(Motion):
    """L from NetCDF: winds or currents on latitude and longitude, over time. Where values are missing, L is 0 and the
    domain solid. L is the data's, divergence and all; where there are [[obstacles]] too, its part that is free of
    divergence and goes round both."""

    has_gaps: ClassVar[bool] = True

    kind: Literal["netcdf"] = key("a field on latitude and longitude, over time")
    file: Asset = key("NetCDF 3 or 4")
    u: str = key("name of the eastward component", "u", min_length=1, max_length=200)
    v: str = key("name of the northward component", "v", min_length=1, max_length=200)
    size: Grid = grid("columns and rows of L", (64, 64))
    window: Annotated[tuple[Longitude, Latitude, Longitude, Latitude], Strict(False)] | None = key(
        "west, south, east, north, of which the domain shows the largest part of its proportions, a degree as long in "
        "both directions; on such a map what moves to the east is faster by 1 over the cosine of the latitude, from 85 "
        "degrees on as there; none: all there is", None, "degrees")
    first: int = key("first time step, counted from 0", 0, ge=0, le=10**6)
    last: Annotated[int, Field(ge=0, le=10**6)] | None = key("last time step; none: the last there is", None)
    step: float = key("time from a time step to the next; between them L is interpolated, after the last it stays",
                      30.0, "frames", gt=0, le=100000)
    cyclic: bool = key("after the last time step comes the first again, as in a climatology", False)
    speed: float = key("rms speed of all time steps on the map, to which the file's is scaled", 0.1,
                       "heights per second", gt=0, le=1000)

    def faults(self, scene: SceneInFlow) -> Faults:
        if scene.dimension == 3:
            yield "coarse.kind", f'"netcdf" is a flow of the plane; {scene.cells_key} is {listed(scene.cells)}'
        if self.last is not None and self.last < self.first:
            yield "coarse.last", f"is before coarse.first, {self.first}"
        if self.window and self.window[1] >= self.window[3]:
            yield "coarse.window", "has its south not below its north"
        if self.window and self.window[2] - self.window[0] > 360:
            yield "coarse.window", "is wider than the globe"

    def check(self, scene: SceneInFlow) -> None:
        self._read()

    def _read(self) -> netcdf.Currents:
        found = netcdf.read_foreign(self.file, "coarse", self.u, self.v, self.first, self.last, self.window)
        if not (found.u.any() or found.v.any()):
            raise BadInput(self.file, "coarse.file", f"{self.u} and {self.v} are 0 wherever they have values")
        return found

    def _per_unit(self, found: netcdf.Currents) -> float:
        """Heights per second on the map, at the equator, for one of the file's unit."""
        values, share = found.on(self.size[::-1])
        rms = np.sqrt(np.mean(np.sum(values[:, share >= 0.5].astype(np.float64) ** 2, axis=-1)))
        return float(self.speed / max(rms, 1e-30))

    @property
    def unit(self) -> str:
        unit = self._read().unit or "the file's unit"
        return re.sub(r"^(\w+)[ .]s(\^|\*\*)?-1$", r"\1/s", unit)

    def speeds(self, L: Iterable[MotionField]) -> Iterator[np.ndarray]:
        """The data's speeds, not those on the map, in the file's unit."""
        found = self._read()
        per_unit = np.float32(self._per_unit(found))
        for one in L:
            eastward = one.values[..., 0] * netcdf.shrunk(found.places(one.shape)[0])[:, None]
            yield np.hypot(eastward, one.values[..., 1]) / per_unit

    def gaps(self, scene: SceneInFlow) -> list[obstacle.Obstacle]:
        from synth import obstacle

        share = self._read().on(scene.shape)[1]
        cell = 1.0 / scene.shape[0]
        corner = tuple(c - cell for c in domain_origin(scene.shape))
        solid = obstacle.level_set(scene.shape, MotionField(np.pad(share - 0.5, 1, mode="edge"), cell, corner))
        if (solid.distance < 0.5).all():
            raise BadInput(self.file, "coarse.file", "has no values in the domain")
        return [solid] if solid.solid.any() else []

    def make(self, scene: SceneInFlow, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, MotionField]]:
        """L, world units per second."""
        found = self._read()
        values = found.on(self.size[::-1])[0] * np.float32(self._per_unit(found))
        for frame in frames:
            field = MotionField.centred(_between(values, (frame - 1) / self.step, self.cyclic), 2)
            if "solid" in inputs:
                past = past_obstacles(scene, inputs, field.per_frame(scene.fps).values)
                field = MotionField.centred(past, 2).per_second(scene.fps)
            yield frame, field


class ClipMotion(Motion):
    """L is the optical flow of a clip: what moves there moves the scene."""

    kind: Literal["clip"] = key("the motion in a clip")
    file: Asset = key("a video; of its pictures the largest part of the domain's proportions is taken, in the middle, "
                      "one height high")
    size: Grid = grid("columns and rows of L", (64, 64))
    scale: float = key("what the clip's speeds are multiplied by", 1.0, gt=0, le=1000)
    step: float = key("time from a frame of the clip to the next; between them L is interpolated, after the last it "
                      "stays", 1.0, "frames", gt=0, le=100000)
    cyclic: bool = key("after the clip's last frame comes its first again", False)
    smoothing: float = key("standard deviation of a Gaussian over time; 0: none", 1.0, "frames of the clip", ge=0,
                           le=100)

    def faults(self, scene: SceneInFlow) -> Faults:
        if scene.dimension == 3:
            yield "coarse.kind", f'"clip" is a flow of the plane; {scene.cells_key} is {listed(scene.cells)}'

    def check(self, scene: SceneInFlow) -> None:
        self._read()

    def _read(self) -> np.ndarray:
        """The clip's motion (N - 1, Y, X, 2), cells of L per frame of the clip."""
        from synth.optical_flow import coarse_flow

        grey = video.read_grey(self.file, "coarse.file")
        try:
            return coarse_flow(grey, self.size[::-1], self.smoothing, self.cyclic)
        except ValueError as error:
            raise BadInput(self.file, "coarse.file", str(error)) from error

    def make(self, scene: SceneInFlow, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, MotionField]]:
        """L, world units per second."""
        values = self._read() * np.float32(self.scale / self.step)
        for frame in frames:
            field = _between(values, (frame - 1) / self.step, self.cyclic)
            if "solid" in inputs:
                field = past_obstacles(scene, inputs, field)
            yield frame, MotionField.centred(field, 2).per_second(scene.fps)


def _between(values: np.ndarray, time: float, cyclic: bool) -> np.ndarray:
    """Values (T, ...) at a time from 0, linear between two of them; after the last it stays, or the first follows."""
    time = time % len(values) if cyclic else min(time, len(values) - 1)
    before = int(time)
    t, after = np.float32(time - before), (before + 1) % len(values)
    between: np.ndarray = (1 - t) * values[before] + t * values[after]
    return between


Coarse = SmokeMotion | NoiseMotion | WakeMotion | AnalyticMotion | FileMotion | NetcdfMotion | ClipMotion


# -- obstacles ----------------------------------------------------------------------------------------------------


class ObstacleTable(Table):
    """One of [[obstacles]]."""

    def faults(self, scene: SceneInFlow, at: str) -> Faults:
        """What does not fit the scene; `at`: the table's key."""
        yield from ()

    def solid(self, shape: tuple[int, ...], at: str) -> obstacle.Obstacle:
        """The solid on the cells `shape`. Raises BadInput for a file that cannot be used, whose key is below `at`."""
        raise NotImplementedError


class ShapeObstacle(ObstacleTable):
    """A solid in the flow (§3.6, figure 7). Several are one."""

    kind: Literal["ball", "box"] = key("form of the solid; a ball in the plane is a disc")
    centre: Annotated[tuple[float, ...], Strict(False)] = key(
        "(x, y), in 3-D (x, y, z)", ..., "heights", min_length=2, max_length=3)
    radius: Radius = key(
        "radius of the ball, or half the edge of the box; of a box one number, or one for each axis", ..., "heights",
        min_length=1, max_length=3)
    angle: float = key("turns a box in the plane of x and y", 0.0, "degrees", ge=-360, le=360)

    def faults(self, scene: SceneInFlow, at: str) -> Faults:
        if len(self.centre) != scene.dimension:
            yield f"{at}.centre", f"has {len(self.centre)} coordinates; {scene.cells_key} is {listed(scene.cells)}"
        if len(self.radius) not in (1, scene.dimension if self.kind == "box" else 1):
            yield f"{at}.radius", f"has {len(self.radius)} numbers for a {self.kind}"

    def solid(self, shape: tuple[int, ...], at: str) -> obstacle.Obstacle:
        from synth import obstacle

        if self.kind == "ball":
            return obstacle.ball(shape, self.centre, self.radius[0])
        half = self.radius if len(self.radius) > 1 else self.radius * len(shape)
        return obstacle.box(shape, self.centre, half, self.angle)


class PictureObstacle(ObstacleTable):
    """Solids from a picture (figure 8: "object contours"); in 3-D prisms along z."""

    kind: Literal["mask", "drawing"] = key("white is solid, or ink and what ink encloses is")
    file: Asset = key("PNG; of a drawing SVG too, what its closed paths enclose")
    centre: Annotated[tuple[float, float], Strict(False)] = key("centre of the picture", (0.0, 0.5), "heights")
    height: float = key("height of the picture", 1.0, "heights", gt=0, le=10)

    def solid(self, shape: tuple[int, ...], at: str) -> obstacle.Obstacle:
        from synth import obstacle

        where = f"{at}.file"
        inked = pictures.read_grey(self.file, where) if self.kind == "mask" else _drawing(self.file, where)
        return obstacle.picture(shape, inked, self.centre, self.height)


def _drawing(file: Any, at: str) -> np.ndarray:
    """A drawing's solids as a mask, lowest row first."""
    from synth import obstacle

    try:
        if file.suffix == ".svg":
            from synth.motion.strokes import svg_outlines

            polygons, width = svg_outlines(file.read_text(encoding="utf-8"))
            return obstacle.outlines(polygons, (OUTLINE, max(1, round(OUTLINE * min(width, WIDEST)))))
        return obstacle.drawn(pictures.read_grey(file, at))
    except UnicodeDecodeError:
        raise BadInput(file, at, "is not an SVG document in UTF-8") from None
    except ValueError as error:
        raise BadInput(file, at, str(error)) from error


class MeshObstacle(ObstacleTable):
    """A solid modelled elsewhere, filled with voxels; in 2-D its section at z = 0. Holes in it are closed."""

    kind: Literal["mesh"] = key("a triangle mesh")
    file: Asset = key("PLY, OBJ or STL, y upwards")
    centre: Annotated[tuple[float, float, float], Strict(False)] | None = key(
        "where the middle of its bounding box is put; none: where it is", None, "heights")
    height: Annotated[float, Field(gt=0, le=10)] | None = key(
        "height to which it is scaled; none: its coordinates are heights", None, "heights")

    def solid(self, shape: tuple[int, ...], at: str) -> obstacle.Obstacle:
        from synth import obstacle

        pitch = VOXEL / shape[-2]
        filled, origin = meshes.read_solid(self.file, f"{at}.file", pitch, self.centre, self.height)
        return obstacle.voxels(shape, filled, pitch, origin)


class LevelSetObstacle(ObstacleTable):
    """A solid modelled elsewhere, where it stands in its own coordinates; in 2-D its section at z = 0."""

    kind: Literal["level-set"] = key("a level set")
    file: Asset = key("VDB, of any origin")
    grid: str = key("name of the grid, of class level set", "surface", min_length=1, max_length=200)

    def solid(self, shape: tuple[int, ...], at: str) -> obstacle.Obstacle:
        from synth import obstacle

        return obstacle.level_set(shape, volumes.read_level_set(self.file, self.grid, f"{at}.file"))


Obstacle = Annotated[ShapeObstacle | PictureObstacle | MeshObstacle | LevelSetObstacle, Field(discriminator="kind")]


# -- scenes in a flow ---------------------------------------------------------------------------------------------


class SceneInFlow(SceneTables):
    """The scene itself: keys above the first table."""

    if TYPE_CHECKING:
        coarse: Any
        obstacles: tuple[Any, ...]

    @property
    def flows(self) -> bool:
        """Whether the coarse motion is a field."""
        return self.coarse is not None and self.coarse.is_field

    @property
    def has_gaps(self) -> bool:
        """Whether the coarse motion may have no values somewhere."""
        return self.flows and self.coarse.has_gaps

    @property
    def border(self) -> str:
        """How the motion meets the border of the domain: "wall" or "open"."""
        return self.coarse.border if self.flows else "open"

    @property
    def stone(self) -> ShapeObstacle | None:
        """The first round obstacle, which a wake is behind."""
        return next((o for o in self.obstacles if o.kind == "ball"), None)


def grids_fit(scene: SceneInFlow) -> Faults:
    """Check: grids that have to fit each other."""
    cells, coarse = scene.cells, getattr(scene.coarse, "size", None)
    if coarse is None:
        return
    at = scene.cells_key
    if len(coarse) != len(cells):
        yield "coarse.size", f"{listed(coarse)} has not as many axes as {at}, {listed(cells)}"
    elif not _alike(cells, coarse):
        yield at, f"{listed(cells)} has not the shape of coarse.size, {listed(coarse)}"


def obstacles_fit(scene: SceneInFlow) -> Faults:
    """Check: the obstacles, and the coarse motion among them."""
    for number, one in enumerate(scene.obstacles):
        yield from one.faults(scene, f"obstacles[{number}]")
    if scene.flows:
        yield from scene.coarse.faults(scene)


def make_solid(scene: SceneInFlow, inputs: Inputs, frames: list[int], gaps: bool = False,
               ) -> Iterator[tuple[int, MotionField]]:
    """The distance to the walls of all obstacles, world units, negative inside; with `gaps` also to where the coarse
    motion has no values, and without either far from everywhere.

    Raises ValueError where they fill the domain or one lies outside it, BadInput for a file that cannot be used.
    """
    from synth import obstacle

    solids = [one.solid(scene.shape, f"obstacles[{number}]") for number, one in enumerate(scene.obstacles)]
    solids += scene.coarse.gaps(scene) if gaps else []
    distance = obstacle.union(solids).distance if solids else np.full(scene.shape, np.float32(sum(scene.shape)))
    yield 0, MotionField.centred(distance / scene.shape[-2], scene.dimension)


def upsampled(L: MotionField, scene: SceneInFlow) -> np.ndarray:
    """L (Y, X, 2) or (Z, Y, X, 3) on the scene's cells, cells per frame."""
    from synth.motion.coarse import upsample

    return upsample(L.per_frame(scene.fps).values, scene.shape)


def walls(scene: SceneInFlow, inputs: Inputs) -> np.ndarray | None:
    """Cells of H to the nearest wall, negative inside, (Y, X) or (Z, Y, X) float32; None without obstacles and
    gaps."""
    return inputs.read("solid").values * scene.shape[-2] if "solid" in inputs else None


def solid_input(scene: SceneInFlow) -> Needs:
    """The input of what knows the obstacles, and the gaps of the coarse motion."""
    return (("solid", "once"),) if scene.obstacles or scene.has_gaps else ()


def solid_artifacts(scene: SceneInFlow) -> tuple[Artifact, ...]:
    """The distance to the walls, where there are obstacles or may be gaps."""
    if not solid_input(scene):
        return ()
    reads = ("obstacles", "shape", "dimension", *(("coarse",) if scene.has_gaps else ()))
    return (Artifact("solid", "synth", fields.distance(scene.dimension), reads, (), make_solid,
                     {"gaps": True} if scene.has_gaps else {}, animated=False),)


def coarse_artifact(scene: SceneInFlow) -> Artifact:
    """L."""
    past = ("shape", "border") if scene.obstacles and not scene.coarse.passes_obstacles else ()
    reads = ("coarse", "seed", "fps", "dimension", *scene.coarse.reads, *past)
    # without solids its first frame is tried before anything is made, with them only its file can be
    inputs, check = (solid_input(scene), scene.coarse.check) if scene.obstacles else ((), None)
    return Artifact("L", "synth", fields.velocity(scene.dimension, scene.fps), reads, inputs, scene.coarse.make,
                    check=check)
