"""The looks of motion fields: each [render] table one class, its keys, what it bakes and its pictures.

All pictures are linear Rec.709 light, EXR, top row first. A new look is one class here, its place in `Render`, a module
in render/ and its test.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Strict

from pipeline.build.artifact import Artifact, Inputs
from pipeline.build.method import Faults
from pipeline.files import images
from pipeline.flow import solid_input, walls
from pipeline.motion import bake
from pipeline.motion.tables import MotionScene
from pipeline.tables import LARGEST, Framed, Look, Share, key, listed


class MotionLook(Look):
    """The [render] table of a scene of motion fields."""

    dimensions: ClassVar[tuple[int, ...]] = (2, 3)
    """Of the fields that it draws."""
    tone: ClassVar[Literal["filmic", "straight"]] = "filmic"
    draws_volume: ClassVar[bool] = False

    def faults(self, scene: MotionScene) -> Faults:
        """What it does not draw."""
        table: Any = self
        size = listed(scene.cells)
        if scene.dimension not in self.dimensions:
            reason = (f"renders 2-D fields only; detail.size is {size}" if scene.dimension == 3 else
                      f"needs a field in space; detail.size is {size}")
            yield "render.kind", f'"{table.kind}" {reason}'
        if scene.dimension == 2 and (scene.density.depth is not None) != self.draws_volume:
            need = "needs a [density.depth]" if self.draws_volume else "draws no volume, but density.depth is"
            yield "render.kind", f'"{table.kind}" {need}'

    def artifacts(self, scene: MotionScene) -> tuple[Artifact, ...]:
        """What it bakes, and its pictures: `beauty`, and `still` where the still has one of its own."""
        raise NotImplementedError


class SmokeLook(MotionLook):
    """A look of smoke."""

    def artifacts(self, scene: MotionScene) -> tuple[Artifact, ...]:
        return bake.density_artifact(scene), self._smoke("beauty")

    def _smoke(self, name: str, still: bool = False, **arguments: str) -> Artifact:
        return Artifact(name, "render", images.LIGHT, ("render", "seed"), (("density", "same"),), self.make_smoke,
                        arguments, still=still, check_frame=require_smoke_in_the_shown_frame)

    def make_smoke(self, scene: MotionScene, inputs: Inputs, frames: list[int],
                   **arguments: str) -> Iterator[tuple[int, np.ndarray]]:
        """Pictures of the density."""
        for frame in frames:
            yield frame, self.picture(inputs.read("density", frame), scene.seed, **arguments)

    def picture(self, density: Any, seed: int) -> np.ndarray:
        """Linear light (h, w, 3) of one density, a Field."""
        raise NotImplementedError


def require_smoke_in_the_shown_frame(scene: MotionScene, inputs: Inputs, frame: int) -> None:
    """ValueError if the still would show nothing."""
    if frame == (scene.figure.frame or scene.frames) and not inputs.read("density", frame).values.any():
        raise ValueError(f"there is no smoke in frame {frame}, which the figure shows: nothing to render")


class LitRender(SmokeLook):
    """2-D smoke, lit in its own plane."""

    dimensions: ClassVar[tuple[int, ...]] = (2,)
    path_traced: ClassVar[bool] = False

    kind: Literal["lit"] = key("a sheet of smoke that shadows itself")
    width: int = key("width of the picture", 1024, "pixels", ge=16, le=LARGEST)

    def picture(self, density: Any, seed: int) -> np.ndarray:
        from render import smoke

        return smoke.lit(density.values, self.width)


class InkRender(SmokeLook):
    """2-D smoke as ink on white paper."""

    dimensions: ClassVar[tuple[int, ...]] = (2,)
    tone: ClassVar[Literal["filmic", "straight"]] = "straight"
    path_traced: ClassVar[bool] = False

    kind: Literal["ink"] = key("ink on paper")
    width: int = key("width of the picture", 1024, "pixels", ge=16, le=LARGEST)
    colour: Literal["indigo", "sepia", "black"] = key("colour of the ink", "indigo")

    def picture(self, density: Any, seed: int) -> np.ndarray:
        from render import smoke

        return smoke.ink(density.values, self.width, self.colour, seed)


class VolumeRender(SmokeLook):
    """A volume, path-traced by Mitsuba or marched through by OpenCL. A march takes seconds, has no noise and does not
    flicker; it is an approximation."""

    draws_volume: ClassVar[bool] = True

    kind: Literal["volume"] = key("a volume in a studio")
    width: int = key("width of the picture", 512, "pixels", ge=16, le=LARGEST)
    height: int = key("height of the picture", 640, "pixels", ge=16, le=LARGEST)
    method: Literal["path", "march", "both"] = key(
        "path-traced, marched, or both: the still path-traced, the animation marched", "path")
    spp: int = key("paths per pixel", 64, ge=1, le=65536)
    denoised: bool = key("fit the paths to guides without noise", True)
    extinction: float = key("extinction of smoke of density 1", 110.0, "per height", gt=0, le=10000)
    bowl: Annotated[tuple[Share, Share], Strict(False)] | None = key(
        "radius and height of the bowl that the plume rises from", None, "heights")
    elevation: float | None = key("elevation of the camera above the horizon; none: about level with the plume", None,
                                  "degrees", ge=0, le=85)

    def artifacts(self, scene: MotionScene) -> tuple[Artifact, ...]:
        density = bake.density_artifact(scene)
        if self.method == "both" and scene.figure.animation:
            return density, self._smoke("beauty", method="march"), self._smoke("still", still=True, method="path")
        return density, self._smoke("beauty", method="march" if self.method == "march" else "path")

    def proof(self) -> VolumeRender:
        return super().proof().model_copy(update={"denoised": False})

    def picture(self, density: Any, seed: int, method: Literal["path", "march"] = "path") -> np.ndarray:
        from render import smoke, studio

        return smoke.volume(density.values, density.voxel_size, density.origin, smoke.VolumeSettings(
            width=self.width, height=self.height, spp=self.spp, seed=seed, extinction=self.extinction, bowl=self.bowl,
            method=method, denoised=self.denoised,
            camera=studio.CAMERA if self.elevation is None else studio.raised(self.elevation)))


class SeaweedRender(Framed, MotionLook):
    """The blades under water, path-traced by Mitsuba."""

    dimensions: ClassVar[tuple[int, ...]] = (3,)

    kind: Literal["seaweed"] = key("blades under water")

    def artifacts(self, scene: MotionScene) -> tuple[Artifact, ...]:
        return bake.blades_artifact(scene), Artifact(
            "beauty", "render", images.LIGHT, ("render", "seed", "fps"), (("blades", "same"),), self.make_seaweed)

    def make_seaweed(self, scene: MotionScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
        """The blades under water."""
        from render import seaweed, studio

        for frame in frames:
            yield frame, seaweed.picture(**inputs.read("blades", frame), shot=studio.Shot(
                self.width, self.height, self.spp, scene.seed, time=frame / scene.fps))


class ParticlesRender(MotionLook):
    """The particles as foam on a river, seen from above; obstacles are stones, path-traced once by Mitsuba."""

    dimensions: ClassVar[tuple[int, ...]] = (2,)

    kind: Literal["particles"] = key("foam on a river")
    width: int = key("width of the picture (figure 7: 640×480)", 640, "pixels", ge=16, le=LARGEST)
    spp: int = key("paths per pixel of the stones", 128, ge=1, le=65536)
    streak: float = key("length of a streak, in time", 1.2, "frames", ge=0, le=100)
    white: float = key("speed at which foam is white", 0.7, "heights per second", gt=0, le=1000)

    def artifacts(self, scene: MotionScene) -> tuple[Artifact, ...]:
        solid = solid_input(scene)
        return (
            bake.particles_artifact(scene),
            Artifact("riverbed", "render", images.LIGHT, ("render.width", "render.spp", "shape", "seed"), solid,
                     make_riverbed, animated=False),
            Artifact("beauty", "render", images.LIGHT, ("render", "particles.life", "shape", "fps"),
                     (("particles", "same"), ("riverbed", "once"), *solid), self.make_river))

    def make_river(self, scene: MotionScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
        """The particles as foam."""
        from render import particles

        bed = inputs.read("riverbed")
        open_water = particles.shown(walls_or_far(scene, inputs), self.width)
        domain = scene.shape[1] / scene.shape[0], 1.0
        for frame in frames:
            points = inputs.read("particles", frame)
            velocity = np.stack([points["vx"], points["vy"]], axis=-1)
            yield frame, particles.river(points["position"][:, :2], velocity, points["age"], scene.particles.life, bed,
                                         open_water, domain, self.streak / scene.fps, self.white)


def make_riverbed(scene: MotionScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """The river without foam: its bed and its stones."""
    from render import particles

    render: Any = scene.render
    yield 0, particles.riverbed(walls_or_far(scene, inputs), render.width, render.spp, scene.seed)


def walls_or_far(scene: MotionScene, inputs: Inputs) -> np.ndarray:
    """The distance to the obstacles, cells (Y, X) or (Z, Y, X); far from everywhere where there are none."""
    distance = walls(scene, inputs)
    return np.full(scene.shape, np.float32(sum(scene.shape))) if distance is None else distance


class NoRender(MotionLook):
    """No smoke: a figure of fields alone; nothing is baked but F."""

    kind: Literal["none"] = key("fields only")
    width: int = key("width of a panel", 1024, "pixels", ge=16, le=LARGEST)

    def faults(self, scene: MotionScene) -> Faults:
        if "result" in scene.figure.panels:
            yield "figure.panels", 'there is no "result" with render.kind = "none"'

    def artifacts(self, scene: MotionScene) -> tuple[Artifact, ...]:
        return ()


Render = LitRender | InkRender | VolumeRender | ParticlesRender | SeaweedRender | NoRender
