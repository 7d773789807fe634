"""The surfaces of wang05: each kind one class, its keys and its mesh; fields on them; artifact `surface`.

A new kind of surface is one class here and its place in `Surface`, a new kind of field one here and its place in
`Direction`. In out/X/fields/surface.ply each triangle has its own three vertices, with the place of each in the frames
(s, t), its normal, the field there, and which vertex of the surface it is.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, Strict

from pipeline.build.artifact import Artifact, Inputs
from pipeline.build.method import Faults
from pipeline.errors import BadInput, InvalidValue, attributed_to
from pipeline.files import meshes
from pipeline.tables import Asset, Table, key

if TYPE_CHECKING:
    from pipeline.texture.tables import TextureScene
    from synth.texture.mesh import Mesh

EDGE = 8.0
"""Pixels of the sample: edges of meshes made by procedure."""
LONGEST = 12.0
"""Pixels of the sample: longer edges are halved."""
Part = Annotated[float, Field(ge=-1000, le=1000)]
Vector = Annotated[tuple[Part, Part, Part], Strict(False)]


# -- fields -------------------------------------------------------------------------------------------------------


class DirectionTable(Table):
    """The direction of the texture."""

    names: ClassVar[tuple[str, ...]] = ()
    """What it is called in the file of the surface, if it is there."""

    def vectors(self, on: Mesh, given: np.ndarray) -> np.ndarray:
        """A vector at each vertex (V, 3); `given`: those of the file, if it has any."""
        raise NotImplementedError


class AroundDirection(DirectionTable):
    """Round an axis through the middle of the surface, as a screw turns."""

    kind: Literal["around"] = key("round an axis")
    axis: Vector = key("the axis; it turns counter-clockwise, seen from its tip", (0.0, 1.0, 0.0))
    rise: float = key("way along the axis in a turn, over 2π", 0.0, "longest sides of the surface's box", ge=-100,
                      le=100)

    def vectors(self, on: Mesh, given: np.ndarray) -> np.ndarray:
        from synth.texture import shapes

        return shapes.around(on, np.array(self.axis), self.rise)


class StraightDirection(DirectionTable):
    """A direction in space; the texture follows the part of it that is tangent to the surface."""

    kind: Literal["direction"] = key("one direction in space")
    direction: Vector = key("the direction")

    def vectors(self, on: Mesh, given: np.ndarray) -> np.ndarray:
        return np.broadcast_to(np.array(self.direction, np.float64), on.vertices.shape)


class VerticesDirection(DirectionTable):
    """Vectors of the file, of which the texture follows the part that is tangent to the surface."""

    kind: Literal["vertices"] = key("a vector at each vertex of the file")
    attribute: Annotated[tuple[Annotated[str, Field(min_length=1, max_length=200)], ...], Strict(False)] = key(
        "names of the three properties of a PLY file, or of the one primvar of a USD file", ("vx", "vy", "vz"),
        min_length=1, max_length=3)

    @property
    def names(self) -> tuple[str, ...]:  # type: ignore[override]
        """What it is called in the file of the surface."""
        return self.attribute

    def vectors(self, on: Mesh, given: np.ndarray) -> np.ndarray:
        return given


Direction = AroundDirection | StraightDirection | VerticesDirection


# -- surfaces -----------------------------------------------------------------------------------------------------


class SurfaceTable(Table):
    """One surface that the texture lies on, instead of a plane with a [coarse] motion."""

    has_vectors: ClassVar[bool] = False
    """Whether it may bring vectors of its own."""

    scale: float = key("edge of the sample on the surface", 0.3, "longest sides of the surface's box", gt=0, le=10)
    field: Direction = Field(discriminator="kind")

    def faults(self) -> Faults:
        """What does not fit together."""
        table: Any = self
        if self.field.names and not self.has_vectors:
            yield "surface.field.kind", f'"vertices" are those of a file: there is none with kind = "{table.kind}"'
        if getattr(self.field, "axis", ()) == (0, 0, 0):
            yield "surface.field.axis", "is zero"

    def made(self, edge: float) -> tuple[Mesh, np.ndarray]:
        """The mesh, where it is made with edges of about `edge` over the longest side of its box; and the vectors that
        it brings (V, 3), zero without. Raises BadInput for a file that cannot be used."""
        raise NotImplementedError


class ProceduralSurface(SurfaceTable):
    """A surface made by procedure, about one unit large."""

    kind: Literal["vase", "torus"] = key("a vase that is open at its foot, or a ring")

    def made(self, edge: float) -> tuple[Mesh, np.ndarray]:
        from synth.texture import shapes

        procedures: dict[str, Any] = {"vase": shapes.vase, "torus": shapes.torus}
        mesh: Mesh = procedures[self.kind](edge)
        return mesh, np.zeros(mesh.vertices.shape)


class FileSurface(SurfaceTable):
    """A surface modelled elsewhere, where it stands; y is upwards. Vertices at one place are one."""

    has_vectors: ClassVar[bool] = True

    kind: Literal["file"] = key("a triangle mesh")
    file: Asset = key("PLY, OBJ, STL or USD")

    def made(self, edge: float) -> tuple[Mesh, np.ndarray]:
        from synth.texture.mesh import mesh

        vertices, faces, vectors = meshes.read_surface(self.file, "surface.file", self.field.names,
                                                       "surface.field.attribute")
        try:
            found = mesh(vertices, faces)
        except ValueError as error:
            raise BadInput(self.file, "surface.file", str(error)) from error
        return found, vectors[np.unique(faces)]


Surface = Annotated[ProceduralSurface | FileSurface, Field(discriminator="kind")]


# -- the artifact -------------------------------------------------------------------------------------------------

READS = ("surface", "sample.size", "shape")
"""What the surface, and a pixel on it, read of the scene."""


def made_surface(scene: TextureScene) -> tuple[Mesh, np.ndarray]:
    """The mesh of a scene, its edges short enough for the patches, and the tangent field on it (V, 3).

    Raises BadInput for a file that cannot be used, ValueError for a field that leads nowhere.
    """
    from synth.texture import shapes
    from synth.texture.mesh import refined

    table: Any = scene.surface
    mesh, given = table.made(EDGE * table.scale / scene.sample.size)
    try:
        field = shapes.tangent(mesh, table.field.vectors(mesh, given))
    except ValueError as error:
        if hasattr(table, "file"):
            raise BadInput(table.file, "surface.field", str(error)) from error
        raise InvalidValue("surface.field", str(error)) from error
    return refined(mesh, field, LONGEST * pixel(scene, mesh.vertices))


def pixel(scene: TextureScene, vertices: np.ndarray) -> float:
    """World units in a pixel of the sample on a surface with vertices (N, 3)."""
    longest = float((vertices.max(axis=0) - vertices.min(axis=0)).max())
    return float(scene.surface.scale) * longest / scene.sample.size


def check_surface(scene: TextureScene) -> None:
    """BadInput or ValueError for a surface or a field that cannot be used, or frames that are too small for it."""
    from synth.texture.atlas import atlas
    from synth.texture.charts import require_coarse

    mesh, _ = made_surface(scene)
    with attributed_to("texture.size"):
        atlas(mesh, (scene.shape[0], scene.shape[1]))
    with attributed_to("surface"):
        settings = scene.carry.settings()
        reach = settings.radius[1] * settings.window * settings.elongation**0.5
        require_coarse(mesh, reach * pixel(scene, mesh.vertices))


def make_surface(scene: TextureScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, meshes.Mesh]]:
    """The surface with its places in the frames and the field."""
    from synth.texture.atlas import atlas

    mesh, field = made_surface(scene)
    rows, columns = scene.shape
    uv = atlas(mesh, (rows, columns)).uv.reshape(-1, 2)
    every = mesh.faces.ravel()
    attributes = {"s": uv[:, 0], "t": uv[:, 1], "corner_of": every.astype(np.int32)}
    for names, values in ((("nx", "ny", "nz"), mesh.normals), (("vx", "vy", "vz"), field)):
        attributes |= {name: values[every, axis].astype(np.float32) for axis, name in enumerate(names)}
    yield 0, {"vertices": mesh.vertices[every].astype(np.float32),
              "faces": np.arange(len(every), dtype=np.int32).reshape(-1, 3), **attributes}


def read_back(stored: meshes.Mesh) -> tuple[Mesh, np.ndarray, np.ndarray]:
    """Of what `make_surface` made the mesh, the field on it (V, 3), and the places of corners in frames (F, 3, 2)."""
    from synth.texture.mesh import Mesh

    faces = stored["corner_of"].reshape(-1, 3).astype(np.int64)
    first = np.unique(faces, return_index=True)[1]

    def of(*names: str) -> np.ndarray:
        return np.stack([stored[name][first] for name in names], axis=-1).astype(np.float64)

    mesh = Mesh(stored["vertices"][first].astype(np.float64), faces, of("nx", "ny", "nz"))
    return mesh, of("vx", "vy", "vz"), np.stack([stored["s"], stored["t"]], axis=-1).reshape(-1, 3, 2)


def surface_artifact(scene: TextureScene) -> Artifact:
    """The surface."""
    return Artifact("surface", "synth", meshes.SURFACE, READS, (), make_surface, animated=False, check=check_surface)
