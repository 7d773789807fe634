"""The looks of elements (ma13): each [render] table one class, its keys, its topology, its mesh and its pictures.

In out/X/geometry the meshes, frame by frame as PLY and all as one USD file; in out/X/images the output, its exemplar
and its coarse motion. A new look is one class here, its place in `Render`, a module in render/ and its test.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar, Literal, get_args

import numpy as np

from pipeline.build.artifact import Artifact, Inputs, Reads
from pipeline.build.method import Faults
from pipeline.elements import controls
from pipeline.elements.coarse import Carried
from pipeline.elements.exemplars import ExemplarTable
from pipeline.elements.tables import ElementsScene
from pipeline.files import images, meshes, usd
from pipeline.files.meshes import Mesh
from pipeline.flow import solid_input
from pipeline.tables import LARGEST, Framed, Look, key, listed
from synth.elements.samples import Elements

if TYPE_CHECKING:
    from render.studio import Shot

INSET = 0.6  # of the result's paths per pixel are enough for a small picture
MARGIN = 0.02  # of a height round the domain that beads lie in


class ElementsLook(Look):
    """The [render] table of a scene of elements."""

    draws: ClassVar[Literal["none", "thread", "sheet"]] = "none"
    """How its elements hang together: points, threads or sheets."""
    dimension: ClassVar[int] = 3
    """Of the elements."""
    default_size: ClassVar[float] = 0.0
    """Length of a fish, radius of a thread, thickness of a sheet whose file does not say it, spacings."""
    fewest_frames: ClassVar[int] = 2
    """Of its exemplar, and of an animation."""
    mesh_reads: ClassVar[Reads] = ()
    """What its mesh reads of the scene."""
    beauty_reads: ClassVar[Reads] = ()
    """What its picture reads of the scene beside the table itself, seed and fps."""

    if TYPE_CHECKING:
        kind: str
        height: int
        spp: int

    def faults(self, scene: ElementsScene) -> Faults:
        """What does not fit the look: exemplar, coarse motion, domain."""
        exemplar, coarse = scene.exemplar, scene.coarse
        if not self.draws_exemplar(exemplar):
            other = next(look for look in get_args(Render) if look.draws_exemplar(exemplar))
            yield "render.kind", f'"{self.kind}" draws no {exemplar.kind}: say "{kind_of(other)}"'
        if getattr(exemplar, "captured", False) and self.draws != "none":
            yield "exemplar.captured", f"is for points, not for {self.kind}"
        if scene.frames < self.fewest_frames:
            yield "frames", f"an animation of {self.kind} has {self.fewest_frames} or more, not {scene.frames}"
        if self.draws != "none":
            fitting = [motion for motion in get_args(Carried) if motion.topology in (None, self.draws)]
            if type(coarse) not in fitting:
                kinds = ", ".join(map(kind_of, fitting))
                yield "coarse" if coarse is None else "coarse.kind", f"of {self.kind} is one of {kinds}"
            return
        if coarse is not None and not scene.flows:
            yield "coarse.kind", f'"{coarse.kind}" carries threads or sheets, no {self.kind}'
        if scene.dimension != self.dimension:
            yield "elements.size", f"is {listed(scene.cells)}; {self.kind} " + (
                "lie in the plane" if self.dimension == 2 else "needs three numbers: it is in space")

    @classmethod
    def draws_exemplar(cls, exemplar: ExemplarTable) -> bool:
        """Whether it draws an exemplar of this kind."""
        return exemplar.topology in (None, cls.draws) and exemplar.dimension in (None, cls.dimension)

    def radius(self, scene: ElementsScene) -> float | None:
        """Median radius of an element, heights; None: as the exemplar has it."""
        return None

    # -- meshes

    @classmethod
    def mesh(cls, scene: ElementsScene, elements: Elements, frame: int, exemplar: bool = False) -> Any:
        """The elements of a frame, from 0, as one synth.elements.mesh.Mesh, world units; of the exemplar or of an
        output."""
        raise NotImplementedError

    @classmethod
    def surfaces(cls, scene: ElementsScene, elements: Elements) -> Callable[[int], Mapping[str, Any]] | None:
        """What the USD file has beside points and curves: of a frame, from 1, meshes by their names."""
        return None

    @classmethod
    def arrays(cls, scene: ElementsScene, elements: Elements, frame: int, exemplar: bool = False) -> Mesh:
        """The mesh of a frame as the files and the renderer take it."""
        made = cls.mesh(scene, elements, frame, exemplar)
        return {"vertices": made.vertices, "faces": made.faces, "colours": made.colours}

    @classmethod
    def make_mesh(cls, scene: ElementsScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, Mesh]]:
        """The meshes."""
        elements = inputs.read("elements")
        for frame in frames:
            yield frame, cls.arrays(scene, elements, frame - 1)

    @classmethod
    def make_animation(cls, scene: ElementsScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, Any]]:
        """The elements and their surfaces, for one USD file of the whole animation."""
        elements = inputs.read("elements")
        yield 0, (elements, cls.surfaces(scene, elements))

    # -- pictures

    def ground(self, scene: ElementsScene, inputs: Inputs) -> Any:
        """What the output lies on."""
        return None

    def picture(self, mesh: Mesh, extent: np.ndarray, ground: Any, shot: Shot) -> np.ndarray:
        """Linear light (h, w, 3) of a mesh whose elements have an extent (2, D) in all frames."""
        raise NotImplementedError

    def inset(self, mesh: Mesh, example: Elements, shot: Shot) -> np.ndarray:
        """A square picture of an exemplar, which fills it."""
        raise NotImplementedError

    def shot(self, scene: ElementsScene, frame: int, width: int, spp: int) -> Shot:
        """How a picture of this width is rendered, in the proportions of the table."""
        from render.studio import Shot

        height = round(self.height * width / self.width) if hasattr(self, "height") else width
        return Shot(width, height, spp, scene.seed, time=frame / scene.fps)

    def make_beauty(self, scene: ElementsScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
        """The output."""
        ground, extent = self.ground(scene, inputs), extent_of(inputs.read("elements"))
        for frame in frames:
            yield frame, self.picture(inputs.read("mesh", frame), extent, ground,
                                      self.shot(scene, frame, self.width, self.spp))

    def make_exemplar_picture(self, scene: ElementsScene, inputs: Inputs, frames: list[int],
                              ) -> Iterator[tuple[int, np.ndarray]]:
        """The exemplar, in the same light; one that is shorter than the animation begins again."""
        from render.studio import Shot

        example, edge = inputs.read("exemplar"), scene.figure.panel // 2
        picture: np.ndarray | None = None
        for frame in frames:
            if picture is None or example.frames > 1:  # what is at rest is rendered once
                shot = Shot(edge, edge, max(1, round(INSET * self.spp)), scene.seed, time=frame / scene.fps)
                mesh = self.arrays(scene, example, (frame - 1) % example.frames, exemplar=True)
                picture = self.inset(mesh, example, shot)
            yield frame, picture

    def make_coarse_picture(self, scene: ElementsScene, inputs: Inputs, frames: list[int],
                            ) -> Iterator[tuple[int, np.ndarray]]:
        """The coarse motion: elements without details."""
        coarse = inputs.read("coarse")
        for frame in frames:
            yield frame, self.picture(self.arrays(scene, coarse, frame - 1), extent_of(coarse), None,
                                      self.shot(scene, frame, scene.figure.panel, self.spp))

    # -- artifacts

    def artifacts(self, scene: ElementsScene) -> tuple[Artifact, ...]:
        """The meshes, the USD file, and the pictures that the figure shows."""
        output: Any = (("elements", "once"),)
        made = [
            Artifact("mesh", "bake", meshes.MESH, ("render.kind", *self.mesh_reads), output, self.make_mesh),
            Artifact("animation", "bake", usd.ANIMATION, ("render.kind", *self.mesh_reads), output,
                     self.make_animation, animated=False, export=True),
            Artifact("beauty", "render", images.LIGHT, ("render", "seed", "fps", *self.beauty_reads),
                     (("mesh", "same"), *output, *solid_input(scene)), self.make_beauty)]
        reads = ("render", "figure.panel", "seed", "fps", *self.mesh_reads)
        if "exemplar" in scene.figure.panels or scene.figure.inset:
            made.append(Artifact("exemplar-picture", "render", images.LIGHT, reads, (("exemplar", "once"),),
                                 self.make_exemplar_picture))
        if "coarse" in scene.figure.panels:
            made.append(Artifact("coarse-picture", "render", images.LIGHT, ("figure.panel", "seed"), (("L", "same"),),
                                 make_flow_picture) if scene.flows else
                        Artifact("coarse-picture", "render", images.LIGHT, reads, (("coarse", "once"),),
                                 self.make_coarse_picture))
        return tuple(made)


def kind_of(table: type[Any]) -> str:
    """The kind of a table, as a scene says it."""
    kind: str = get_args(table.model_fields["kind"].annotation)[0]
    return kind


def extent_of(elements: Elements) -> np.ndarray:
    """The corners (2, D) of the box that holds the elements in all frames: pictures do not follow them."""
    return np.stack([elements.positions.min(axis=(0, 1, 2)), elements.positions.max(axis=(0, 1, 2))])


def make_flow_picture(scene: ElementsScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """The coarse motion: the lines of a flow."""
    from render import lic, tonemap

    for frame in frames:
        yield frame, tonemap.from_srgb(lic.picture(inputs.read("L", frame).values, scene.figure.panel, scene.seed))


ORIGINS = np.array([[0.10, 0.32, 0.42], [0.16, 0.55, 0.58], [0.93, 0.78, 0.42], [0.90, 0.48, 0.26], [0.62, 0.16, 0.20]])
"""Colours of beads from left to right in the first frame, sRGB: petrol, teal, sand, orange, madder."""


class BeadsRender(ElementsLook):
    """Particles of the plane, seen from above."""

    dimension: ClassVar[int] = 2
    default_size: ClassVar[float] = 0.8
    fewest_frames: ClassVar[int] = 1
    mesh_reads: ClassVar[Reads] = ("render.colour", "elements.toroidal", "cells")
    beauty_reads: ClassVar[Reads] = ("elements.domain", "elements.toroidal", "shape", "cells", "dimension")

    kind: Literal["beads"] = key("beads on paper")
    width: int = key("width of the picture", 800, "pixels", ge=16, le=LARGEST)
    spp: int = key("paths per pixel", 64, ge=1, le=65536)
    colour: Literal["exemplar", "origin"] = key(
        "colour of a bead: that of the element it was copied from, or by its place in the first frame, which shows "
        "its path", "exemplar")

    def radius(self, scene: ElementsScene) -> float | None:
        return scene.elements.radius * scene.elements.spacing

    @classmethod
    def mesh(cls, scene: ElementsScene, elements: Elements, frame: int, exemplar: bool = False) -> Any:
        from synth.elements import mesh

        points = elements.positions[frame, :, 0]
        if scene.elements.toroidal and not exemplar:  # an exemplar has its own period
            width = scene.cells[0] / scene.cells[1]
            points = np.stack([np.mod(points[:, 0] + width / 2, width) - width / 2, points[:, 1]], axis=-1)
        return mesh.solids(points, elements.size, cls._colours(scene, elements, exemplar))

    @classmethod
    def _colours(cls, scene: ElementsScene, elements: Elements, exemplar: bool) -> np.ndarray:
        """Colours (E, 3) of the beads; an exemplar has those of the middle."""
        render: Any = scene.render
        if render.colour == "exemplar":
            return elements.colour
        if exemplar:
            return np.broadcast_to(ORIGINS[len(ORIGINS) // 2], (elements.count, 3))
        x = elements.positions[0, :, 0, 0]
        share = (np.argsort(np.argsort(x, kind="stable"), kind="stable") + 0.5) / elements.count * (len(ORIGINS) - 1)
        return np.stack([np.interp(share, np.arange(len(ORIGINS)), ORIGINS[:, c]) for c in range(3)], axis=-1)

    def ground(self, scene: ElementsScene, inputs: Inputs) -> Any:
        from render.beads import Ground

        found = controls.domain(scene, inputs)
        inside = np.argwhere(found.inside > 0)[:, ::-1]
        low, high = found.origin + found.cell * inside.min(axis=0), found.origin + found.cell * inside.max(axis=0)
        plain = scene.elements.domain is None and "solid" not in inputs
        margin = 0.0 if scene.elements.toroidal or plain else MARGIN
        low, high = low - found.cell / 2 - margin, high + found.cell / 2 + margin
        return Ground(tuple(low), tuple(high), None if plain else found.inside, found.cell, tuple(found.origin))

    def picture(self, mesh: Mesh, extent: np.ndarray, ground: Any, shot: Shot) -> np.ndarray:
        from render import beads

        return beads.picture(**mesh, ground=ground, shot=shot)

    def inset(self, mesh: Mesh, example: Elements, shot: Shot) -> np.ndarray:
        from render.beads import Ground

        corners = example.box if example.box is not None else extent_of(example)
        return self.picture(mesh, corners, Ground(tuple(corners[0]), tuple(corners[1])), shot)


class SchoolRender(Framed, ElementsLook):
    """Fish under water."""

    default_size: ClassVar[float] = 0.8
    mesh_reads: ClassVar[Reads] = ("render.speed", "elements.spacing", "seed")

    kind: Literal["school"] = key("fish in the sea")
    spp: int = key("paths per pixel", 128, ge=1, le=65536)
    speed: float = key("speed at which the school swims along x; the picture follows it", 2.2, "spacings per second",
                       ge=0, le=1000)

    @classmethod
    def mesh(cls, scene: ElementsScene, elements: Elements, frame: int, exemplar: bool = False) -> Any:
        from synth.elements import fish

        gait = fish.swimming(cls.swum(scene, elements), elements.size, elements.rate, scene.seed)
        return fish.bodies(elements.positions[frame, :, 0], gait.heading[frame], elements.size, elements.colour,
                           gait.phase[frame], gait.turn[frame])

    @classmethod
    def swum(cls, scene: ElementsScene, elements: Elements) -> np.ndarray:
        """Tracks (T, E, 3) of fish through water that stands still: their domain swims along x."""
        render: Any = scene.render
        track = elements.positions[:, :, 0].astype(np.float64)
        track[:, :, 0] += (render.speed * scene.elements.spacing / elements.rate * np.arange(len(track)))[:, None]
        return track

    @classmethod
    def surfaces(cls, scene: ElementsScene, elements: Elements) -> Callable[[int], Mapping[str, Any]] | None:
        # they bend, and Blender (4.2) shows the first frame of instances in all: so they are meshes, not instances
        return lambda frame: {"fish": cls.mesh(scene, elements, frame - 1)}

    def picture(self, mesh: Mesh, extent: np.ndarray, ground: Any, shot: Shot) -> np.ndarray:
        from render import school

        return school.picture(**mesh, shot=shot)

    def inset(self, mesh: Mesh, example: Elements, shot: Shot) -> np.ndarray:
        from render import school

        low, high = extent_of(example)
        return school.inset(**mesh, low=low, high=high, shot=shot)


class NoodlesRender(Framed, ElementsLook):
    """Noodles on a plate."""

    draws: ClassVar[Literal["none", "thread", "sheet"]] = "thread"
    default_size: ClassVar[float] = 0.38

    kind: Literal["noodles"] = key("noodles in a studio")

    @classmethod
    def mesh(cls, scene: ElementsScene, elements: Elements, frame: int, exemplar: bool = False) -> Any:
        from synth.elements import mesh

        return mesh.tubes(elements.positions[frame], elements.size, elements.colour)

    def picture(self, mesh: Mesh, extent: np.ndarray, ground: Any, shot: Shot) -> np.ndarray:
        from render import noodles

        camera, plate = noodles.view(extent[0], extent[1], shot.aspect)
        return noodles.picture(**mesh, shot=replace(shot, camera=camera), plate=plate)

    def inset(self, mesh: Mesh, example: Elements, shot: Shot) -> np.ndarray:
        from render import noodles

        low, high = extent_of(example)
        return noodles.inset(**mesh, low=low, high=high, shot=shot)


SHARES = (0.40, 0.25, 0.14, 0.12, 0.09)  # of the sheets, of each colour of render.paper.PALETTE


class PaperRender(Framed, ElementsLook):
    """Sheets of paper in the air."""

    draws: ClassVar[Literal["none", "thread", "sheet"]] = "sheet"
    default_size: ClassVar[float] = 0.02
    mesh_reads: ClassVar[Reads] = ("render.colour", "seed")

    kind: Literal["paper"] = key("paper in a studio")
    colour: Literal["exemplar", "mixed"] = key(
        "colour of a sheet: that of the element it was copied from, or one of a few that go together, at random",
        "mixed")

    @classmethod
    def mesh(cls, scene: ElementsScene, elements: Elements, frame: int, exemplar: bool = False) -> Any:
        from synth.elements import mesh

        return mesh.sheets(_surface(elements, frame), cls._colours(scene, elements))

    @classmethod
    def _colours(cls, scene: ElementsScene, elements: Elements) -> np.ndarray:
        """Colours (E, 3) of the sheets."""
        from render.paper import PALETTE

        render: Any = scene.render
        if render.colour == "exemplar":
            return elements.colour
        rng = np.random.Generator(np.random.Philox(key=scene.seed))
        return np.array(PALETTE)[rng.choice(len(PALETTE), elements.count, p=SHARES)]

    @classmethod
    def surfaces(cls, scene: ElementsScene, elements: Elements) -> Callable[[int], Mapping[str, Any]] | None:
        from synth.elements import mesh

        colours = cls._colours(scene, elements)
        return lambda frame: {"sheets": mesh.shells(_surface(elements, frame - 1), elements.size, colours)}

    def picture(self, mesh: Mesh, extent: np.ndarray, ground: Any, shot: Shot) -> np.ndarray:
        from render import paper, studio

        camera = studio.framing(extent[0], extent[1], paper.CAMERA, shot.aspect)
        return paper.picture(**mesh, shot=replace(shot, camera=camera))

    def inset(self, mesh: Mesh, example: Elements, shot: Shot) -> np.ndarray:
        from render import paper

        low, high = extent_of(example)
        return paper.inset(**mesh, low=low, high=high, shot=shot)


def _surface(elements: Elements, frame: int) -> np.ndarray:
    """The samples of sheets (E, rows, columns, 3) in a frame, from 0."""
    rows, columns = elements.grid
    return elements.positions[frame].reshape(elements.count, rows, columns, 3)


Render = BeadsRender | SchoolRender | NoodlesRender | PaperRender
