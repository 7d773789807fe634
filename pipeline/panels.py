"""What render makes, in out/X/images: the smoke or the seaweed, and a picture of each field that the figure shows.

All are linear Rec.709 EXR, top row first. `beauty` is light, toned when the figure is set; pictures of fields
were made as display values and are stored so that `straight` development gives these back.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline import geometry, obstacles
from pipeline.fields import LOCAL_FRAME, facing
from pipeline.files import images, pictures
from pipeline.product import Frames, Product, Stock, value_at
from pipeline.product import Scene as AnyScene
from pipeline.schema import Scene, is_of_exemplar

ARROWS = 9  # across a picture


def suffix(scene: AnyScene) -> str:
    """The suffix of a picture."""
    return "exr"


def write_light(file: Path, picture: np.ndarray, scene: AnyScene) -> None:
    """Write a linear picture (h, w, 3) in half floats."""
    images.write_picture(file, picture, half=True)


def read_light(file: Path, scene: AnyScene) -> np.ndarray:
    """Read a picture that `write_light` wrote."""
    return images.read_picture(file)


def make_beauty(scene: Scene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """The smoke: lit, ink or a volume."""
    method = "march" if has_still(scene) else getattr(scene.render, "method", "")
    yield from _smoke_pictures(scene, stock, frames, method)


def make_still(scene: Scene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """The volume that the still shows, where the animation's are marched through."""
    yield from _smoke_pictures(scene, stock, frames, "path")


def has_still(scene: Scene) -> bool:
    """Whether the still has a picture of its own, path-traced, and the animation marched ones."""
    return scene.render.kind == "volume" and scene.render.method == "both" and scene.figure.animation


def _smoke_pictures(scene: Scene, stock: Stock, frames: list[int], method: str) -> Iterator[tuple[int, np.ndarray]]:
    from render import smoke, studio

    settings: Any = scene.render
    for frame in frames:
        density = stock.read("density", frame)
        if frame == (scene.figure.frame or scene.frames) and not density.values.any():
            raise ValueError(f"there is no smoke in frame {frame}, which the figure shows: nothing to render")
        match settings.kind:
            case "lit":
                yield frame, smoke.lit(density.values, settings.width)
            case "ink":
                yield frame, smoke.ink(density.values, settings.width, settings.colour, scene.seed)
            case "volume":
                yield frame, smoke.volume(
                    density.values, density.voxel_size, density.origin, smoke.VolumeSettings(
                        width=settings.width, height=settings.height, spp=settings.spp, seed=scene.seed,
                        extinction=settings.extinction, bowl=settings.bowl,
                        method="march" if method == "march" else "path", denoised=settings.denoised,
                        camera=studio.CAMERA if settings.elevation is None else studio.raised(settings.elevation)))


def make_seaweed(scene: Scene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """The blades under water."""
    from render import seaweed

    wanted: Any = scene.render
    for frame in frames:
        yield frame, seaweed.picture(**stock.read("blades", frame), settings=seaweed.Settings(
            width=wanted.width, height=wanted.height, spp=wanted.spp, seed=scene.seed, time=frame / scene.fps))


def make_stage(scene: Scene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """The river without foam: its bed and its stones."""
    from render import particles

    wanted: Any = scene.render
    yield 0, particles.stage(_walls(scene, stock), wanted.width, wanted.spp, scene.seed)


def _walls(scene: Scene, stock: Stock) -> np.ndarray:
    """The distance to the obstacles, cells (Y, X); far from everywhere where there are none."""
    away = obstacles.distance(scene, stock)
    return np.full(scene.shape, np.float32(sum(scene.shape))) if away is None else away


def make_river(scene: Scene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """The particles as foam."""
    from render import particles

    wanted: Any = scene.render
    back = stock.read("stage")
    open_water = particles.shown(_walls(scene, stock), wanted.width)
    domain = scene.shape[1] / scene.shape[0], 1.0
    for frame in frames:
        points = stock.read("particles", frame)
        velocity = np.stack([points["vx"], points["vy"]], axis=-1)
        yield frame, particles.river(points["position"][:, :2], velocity, points["age"], scene.particles.life, back,
                                     open_water, domain, wanted.streak / scene.fps, wanted.white)


@dataclass(frozen=True)
class Shown:
    """A panel of the figure: what the scene calls it, which exemplar it is of where there are several, and how it is
    drawn where the scene does not say."""

    panel: str
    exemplar: str = "exemplar"
    usual: str = "lines"

    @property
    def view(self) -> str:
        """The view that first shows its exemplar: front … or a number; "" if there is one exemplar."""
        return self.exemplar.removeprefix("exemplar").removeprefix("-")

    @property
    def style(self) -> str:
        """Lines, colour, arrows or divergence; elements have a picture."""
        return self.panel.partition("-")[2] or self.usual

    @property
    def picture(self) -> str:
        """The product that it shows."""
        if self.panel == "result":
            return "beauty"
        what = self.panel.partition("-")[0]
        named = f"{what}-{self.view}" if self.view else what
        return named if what == "input" else f"{named}-{self.style}"


def shown(scene: AnyScene) -> list[Shown]:
    """The panels of the scene's figure, from left to right."""
    usual = "lines" if isinstance(scene, Scene) else "picture"
    return [Shown(panel, name, usual) for panel in scene.figure.panels
            for name in (scene.exemplars if is_of_exemplar(panel) else ["exemplar"])]


def make_input(panel: Shown) -> Callable[[Scene, Stock, list[int]], Iterator[tuple[int, np.ndarray]]]:
    """Makes an exemplar as figure 4 shows it: a bitmap itself, the colours of any other."""

    def make(scene: Scene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
        from render import lic, tonemap

        width, key = scene.figure.panel, scene.exemplars[panel.exemplar]
        exemplar: Any = value_at(scene, key)
        if exemplar.kind in ("bitmap", "drawing") and exemplar.file.suffix != ".svg":
            picture = pictures.read_foreign(exemplar.file, f"{key}.file")
            height = lic.height_for(picture.shape, width)
            yield 0, tonemap.from_srgb(np.clip(pictures.resized(picture, width, height), 0, 1))
        else:
            yield 0, tonemap.from_srgb(lic.colour(field_values(panel, scene, stock, 0), width))

    return make


def field_values(panel: Shown, scene: Scene, stock: Stock, frame: int) -> np.ndarray:
    """The field that a panel shows (Y, X, 2), any unit; of one in space the middle slice along figure.plane."""
    match panel.panel.partition("-")[0]:
        case "exemplar" | "input":
            values = stock.read(panel.exemplar).values
        case "coarse":
            values = stock.read("L", frame).values
        case "detail":
            values = geometry.transformed(scene, stock, frame)
        case _:
            values = stock.read("F", frame).values
    return _flat(values, scene)


def _flat(values: np.ndarray, scene: Scene) -> np.ndarray:
    from render import lic

    return values if values.ndim == 3 else lic.slice_of(values, scene.figure.plane)


def _flat_walls(scene: Scene, stock: Stock) -> np.ndarray:
    """The distance to the obstacles (Y, X), cells; in space that of the slice which panels show."""
    from render import lic

    away = _walls(scene, stock)
    return away if away.ndim == 2 else lic.slice_of(np.repeat(away[..., None], 3, axis=-1), scene.figure.plane)[..., 0]


def maker(panel: Shown) -> Callable[[Scene, Stock, list[int]], Iterator[tuple[int, np.ndarray]]]:
    """Makes the pictures of a field: lines, colour, arrows or divergence."""

    def make(scene: Scene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
        from render import lic, tonemap

        width = scene.figure.panel
        for frame in frames:
            values = field_values(panel, scene, stock, frame)
            drawn = {"colour": lic.colour, "divergence": lic.divergence}.get(panel.style)
            shown = drawn(values, width) if drawn else lic.picture(values, width, scene.seed)
            if scene.obstacles and panel.panel.partition("-")[0] != "exemplar":
                shown = lic.with_solids(shown, _flat_walls(scene, stock))
            if panel.style == "arrows":
                detail = panel.panel.startswith("detail")
                wrong = _flat(stock.read("H", frame).values, scene) if detail else None
                shown = with_arrows(shown, values, wrong)
            yield frame, tonemap.from_srgb(shown)

    return make


def with_arrows(picture: np.ndarray, right: np.ndarray, wrong: np.ndarray | None) -> np.ndarray:
    """Figure 2: the values of `right` (Y, X, 2) in red over those of `wrong` in green, at a grid of points."""
    from render import arrows

    rows, columns, places = arrows.grid(right.shape, picture.shape, ARROWS)
    length = 0.8 * picture.shape[1] / ARROWS
    for field, colour in ((wrong, arrows.GREEN), (right, arrows.RED)):
        if field is not None:
            picture = arrows.drawn(picture, places, field[rows, columns], length, colour)
    return picture


def products(scene: Scene) -> tuple[Product, ...]:
    """The pictures that the scene's figure shows, and the smoke, the particles or the seaweed."""
    others = {"none": [], "seaweed": [_seaweed()], "particles": _river(scene)}
    made = others.get(scene.render.kind, [_smoke("beauty", make_beauty)])
    if has_still(scene):
        made.append(_smoke("still", make_still))
    for panel in dict.fromkeys(shown(scene)):
        if panel.panel == "result":
            continue
        what = panel.panel.partition("-")[0]
        inputs: tuple[tuple[str, Frames], ...]
        reads: tuple[str, ...] = ("figure.panel", "seed", "figure.plane")
        match what:
            case "input":
                inputs, reads = ((panel.exemplar, "once"),), (scene.exemplars[panel.exemplar], *reads)
            case "exemplar":
                inputs = ((panel.exemplar, "once"),)
            case "coarse":
                inputs = (("L", "same"),)
            case "detail":
                inputs, reads = (("L", "same"), ("H", "same"), *facing(scene, "same")), (*reads, *LOCAL_FRAME)
            case _:
                inputs = (("F", "same"),)
        if what not in ("input", "exemplar"):
            inputs, reads = (*inputs, *obstacles.inputs(scene)), (*reads, "cells")
        make = make_input(panel) if what == "input" else maker(panel)
        made.append(Product(
            name=panel.picture, stage="render", folder="images", suffix=suffix, reads=reads, inputs=inputs,
            methods=("render.lic", "render.arrows", "synth.motion.local_axes"), make=make, write=write_light,
            read=read_light, animated=what not in ("input", "exemplar")))
    return tuple(made)


def _smoke(name: str, make: Any) -> Product:
    return Product(
        name=name, stage="render", folder="images", suffix=suffix, reads=("render", "seed"),
        inputs=(("density", "same"),), methods=("render.smoke",), make=make, write=write_light, read=read_light,
        still=name == "still")


def _river(scene: Scene) -> list[Product]:
    solid = obstacles.inputs(scene)
    stage = Product(
        name="stage", stage="render", folder="images", suffix=suffix, animated=False,
        reads=("render.width", "render.spp", "cells", "seed"), inputs=solid, methods=("render.particles",),
        make=make_stage, write=write_light, read=read_light)
    beauty = Product(
        name="beauty", stage="render", folder="images", suffix=suffix,
        reads=("render", "particles.life", "cells", "fps"),
        inputs=(("particles", "same"), ("stage", "once"), *solid), methods=("render.particles",), make=make_river,
        write=write_light, read=read_light)
    return [stage, beauty]


def _seaweed() -> Product:
    return Product(
        name="beauty", stage="render", folder="images", suffix=suffix, reads=("render", "seed", "fps"),
        inputs=(("blades", "same"),), methods=("render.seaweed",), make=make_seaweed, write=write_light,
        read=read_light)
