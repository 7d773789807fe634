"""The obstacles of a scene: what synth keeps as fields/solid, the signed distance to their walls in world units."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from pipeline.errors import BadInput
from pipeline.files import images, meshes, pictures, volumes
from pipeline.product import Frames, Product, Scene, Stock
from synth.field import Field

if TYPE_CHECKING:
    from pathlib import Path

    import numpy as np

    from synth.obstacle import Obstacle

OUTLINE = 1024  # rows of the mask that an SVG is filled into
WIDEST = 16.0  # of it, in its heights
VOXEL = 0.5  # of a mesh, in cells of H


def make_solid(scene: Scene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, Field]]:
    """The distance to the walls of all obstacles, world units, negative inside.

    Raises ValueError where they fill the domain or one lies outside it, BadInput for a file that does not do.
    """
    from synth import obstacle

    solids = [solid(scene, wanted, f"obstacles[{number}]") for number, wanted in enumerate(scene.obstacles)]
    yield 0, Field.centred(obstacle.union(solids).distance / scene.shape[-2], scene.dimension)


def solid(scene: Scene, wanted: Any, key: str) -> Obstacle:
    """The solid of one table, whose key is blamed for a file that does not do."""
    from synth import obstacle

    key = f"{key}.file"
    match wanted.kind:
        case "ball":
            return obstacle.ball(scene.shape, wanted.centre, wanted.radius[0])
        case "box":
            half = wanted.radius if len(wanted.radius) > 1 else wanted.radius * scene.dimension
            return obstacle.box(scene.shape, wanted.centre, half, wanted.angle)
        case "mesh":
            pitch = VOXEL / scene.shape[-2]
            filled, origin = meshes.read_solid(wanted.file, key, pitch, wanted.centre, wanted.height)
            return obstacle.voxels(scene.shape, filled, pitch, origin)
        case "level-set":
            return obstacle.level_set(scene.shape, volumes.read_level_set(wanted.file, wanted.grid, key))
        case "mask":
            inked = pictures.read_grey(wanted.file, key)
        case _:
            inked = _drawing(wanted.file, key)
    return obstacle.picture(scene.shape, inked, wanted.centre, wanted.height)


def _drawing(file: Path, key: str) -> np.ndarray:
    """A drawing's solids as a mask, lowest row first."""
    from synth import obstacle

    try:
        if file.suffix == ".svg":
            from synth.motion.exemplar import svg_outlines

            polygons, width = svg_outlines(file.read_text(encoding="utf-8"))
            return obstacle.outlines(polygons, (OUTLINE, max(1, round(OUTLINE * min(width, WIDEST)))))
        return obstacle.drawn(pictures.read_grey(file, key))
    except UnicodeDecodeError:
        raise BadInput(file, key, "is not an SVG document in UTF-8") from None
    except ValueError as error:
        raise BadInput(file, key, str(error)) from error


def distance(scene: Scene, stock: Stock) -> np.ndarray | None:
    """Cells of H to the nearest wall, negative inside, (Y, X) or (Z, Y, X) float32; None without obstacles."""
    return stock.read("solid").values * scene.shape[-2] if scene.obstacles else None


def border(scene: Scene) -> str:
    """How the motion meets the border of the domain: smoke rises in a closed box, all else flows through."""
    return "wall" if scene.coarse and scene.coarse.kind == "smoke" else "open"


def inputs(scene: Scene) -> tuple[tuple[str, Frames], ...]:
    """The input of what knows the obstacles."""
    return (("solid", "once"),) if scene.obstacles else ()


def products(scene: Scene) -> tuple[Product, ...]:
    """The distance, where there are obstacles."""
    if not scene.obstacles:
        return ()
    return (Product(
        name="solid", stage="synth", folder="fields", suffix=lambda s: "exr" if s.dimension == 2 else "vdb",
        animated=False, reads=("obstacles", "cells"), inputs=(),
        methods=("synth.obstacle", "synth.motion.exemplar"), make=make_solid, write=write_solid, read=read_solid),)


def write_solid(file: Path, field: Field, scene: Scene) -> None:
    """Write a distance: in the plane as EXR, in space as a level set."""
    if field.dimension == 2:
        images.write_field(file, field)
    else:
        volumes.write(file, {"surface": field}, level_set=True)


def read_solid(file: Path, scene: Scene) -> Field:
    """Read a distance that `write_solid` wrote."""
    return images.read_field(file) if scene.dimension == 2 else volumes.read(file)["surface"]
