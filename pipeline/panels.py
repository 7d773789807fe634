"""What render makes, in out/X/images: the smoke, and a picture of each field that the figure shows.

All are linear Rec.709 EXR, top row first. `beauty` is light, toned when the figure is set; pictures of fields
were made as display values and are stored so that `straight` development gives these back.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from pipeline import geometry
from pipeline.files import images, pictures
from pipeline.product import Frames, Product, Stock
from pipeline.schema import Scene

ARROWS = 9  # across a picture


def suffix(scene: Scene) -> str:
    """The suffix of a picture."""
    return "exr"


def write_light(file: Path, picture: np.ndarray, scene: Scene) -> None:
    """Write a linear picture (h, w, 3) in half floats."""
    images.write_picture(file, picture, half=True)


def read_light(file: Path, scene: Scene) -> np.ndarray:
    """Read a picture that `write_light` wrote."""
    return images.read_picture(file)


def make_beauty(scene: Scene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """The smoke: lit, ink or a volume."""
    from render import smoke

    settings: Any = scene.render
    for frame in frames:
        density = stock.read("density", frame)
        match settings.kind:
            case "lit":
                yield frame, smoke.lit(density.values, settings.width)
            case "ink":
                yield frame, smoke.ink(density.values, settings.width, settings.colour, scene.seed)
            case "volume":
                yield frame, smoke.volume(
                    density.values, density.voxel_size, density.origin, smoke.VolumeSettings(
                        width=settings.width, height=settings.height, spp=settings.spp, seed=scene.seed,
                        denoised=settings.denoised, extinction=settings.extinction, bowl=settings.bowl))


def make_input(scene: Scene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """The exemplar as figure 4 shows it: a bitmap itself, the colours of any other."""
    from render import film, lic

    width = scene.figure.panel
    if scene.exemplar.kind in ("bitmap", "drawing") and scene.exemplar.file.suffix != ".svg":
        picture = pictures.read_foreign(scene.exemplar.file, "exemplar.file")
        yield 0, film.decoded(np.clip(pictures.resized(picture, width, lic.height_for(picture.shape, width)), 0, 1))
    else:
        yield 0, film.decoded(lic.colour(stock.read("exemplar").values, width))


def field_values(name: str, scene: Scene, stock: Stock, frame: int) -> np.ndarray:
    """The field that panel `name` shows, any unit."""
    match name:
        case "exemplar":
            return stock.read("exemplar").values
        case "coarse":
            return stock.read("L", frame).values
        case "detail":
            return geometry.transformed(scene, stock, frame)
        case _:
            return stock.read("F", frame).values


def maker(name: str, style: str) -> Callable[[Scene, Stock, list[int]], Iterator[tuple[int, np.ndarray]]]:
    """Makes the pictures of field `name` in `style`: lines, colour or arrows."""

    def make(scene: Scene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
        from render import film, lic

        width = scene.figure.panel
        for frame in frames:
            values = field_values(name, scene, stock, frame)
            shown = lic.colour(values, width) if style == "colour" else lic.picture(values, width, scene.seed)
            if style == "arrows":
                wrong = stock.read("H", frame).values if name == "detail" else None
                shown = with_arrows(shown, values, wrong)
            yield frame, film.decoded(shown)

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


INPUTS: dict[str, tuple[tuple[str, Frames], ...]] = {
    "exemplar": (("exemplar", "once"),),
    "coarse": (("L", "same"),),
    "detail": (("L", "same"), ("H", "same")),
    "combined": (("F", "same"),),
}


def picture_of(panel: str) -> str:
    """The product that a panel of the figure shows."""
    names = {"result": "beauty", "input": "input"}
    return names.get(panel) or (panel if "-" in panel else f"{panel}-lines")


def products(scene: Scene) -> tuple[Product, ...]:
    """The pictures that the scene's figure shows, and the smoke."""
    made = [_smoke()] if scene.render.kind != "none" else []
    for panel in dict.fromkeys(scene.figure.panels):
        if panel == "input":
            made.append(_picture(panel, make_input, ("exemplar", "figure.panel"), INPUTS["exemplar"], False))
        elif panel != "result":
            name, _, style = picture_of(panel).partition("-")
            transform = ("detail.size", "detail.along") if name == "detail" else ()
            made.append(_picture(picture_of(panel), maker(name, style), ("figure.panel", "seed", *transform),
                                 INPUTS[name], name != "exemplar"))
    return tuple(made)


def _smoke() -> Product:
    return Product(
        name="beauty", stage="render", folder="images", suffix=suffix, reads=("render", "seed"),
        inputs=(("density", "same"),), methods=("render.smoke",), make=make_beauty, write=write_light,
        read=read_light)


def _picture(name: str, make: Any, reads: tuple[str, ...], inputs: tuple[tuple[str, Frames], ...],
             animated: bool) -> Product:
    return Product(
        name=name, stage="render", folder="images", suffix=suffix, reads=reads, inputs=inputs,
        methods=("render.lic", "render.arrows", "synth.motion.frames"), make=make, write=write_light,
        read=read_light, animated=animated)
