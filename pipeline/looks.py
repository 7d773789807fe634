"""How elements are looked at (ma13): in geometry/ their meshes, frame by frame as PLY and all as one USD file; in
images/ the output, its exemplar and its coarse motion.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from pipeline import guides, obstacles
from pipeline.elements_schema import ElementsScene
from pipeline.geometry import read_mesh, write_mesh
from pipeline.panels import read_light, suffix, write_light
from pipeline.product import Frames, Product, Stock
from synth.elements.mesh import Mesh
from synth.elements.samples import Elements

INSET = 0.6  # of the result's paths per pixel are enough for a small picture
MARGIN = 0.02  # of a height round the domain that beads lie in


def mesh_of(scene: ElementsScene, elements: Elements, frame: int) -> Mesh:
    """The elements of a frame, from 0, as one mesh, world units."""
    from synth.elements import fish, mesh

    match scene.render.kind:
        case "beads":
            return mesh.solids(_in_domain(scene, elements.positions[frame, :, 0]), elements.size,
                               _bead_colours(scene, elements))
        case "school":
            gait = fish.swimming(swum(scene, elements), elements.size, elements.rate, scene.seed)
            return fish.bodies(elements.positions[frame, :, 0], gait.heading[frame], elements.size, elements.colour,
                               gait.phase[frame], gait.turn[frame])
        case "noodles":
            return mesh.tubes(elements.positions[frame], elements.size, elements.colour)
    rows, columns = elements.grid
    return mesh.sheets(elements.positions[frame].reshape(elements.count, rows, columns, 3),
                       _paper_colours(scene, elements))


ORIGINS = np.array([[0.10, 0.32, 0.42], [0.16, 0.55, 0.58], [0.93, 0.78, 0.42], [0.90, 0.48, 0.26], [0.62, 0.16, 0.20]])
"""Colours of beads from left to right in the first frame, sRGB: petrol, teal, sand, orange, madder."""


def _bead_colours(scene: ElementsScene, elements: Elements) -> np.ndarray:
    """Colours (E, 3) of the beads; an exemplar has those of the middle."""
    if scene.render.kind != "beads" or scene.render.colour == "exemplar":
        return elements.colour
    if elements.box is not None:
        return np.broadcast_to(ORIGINS[len(ORIGINS) // 2], (elements.count, 3))
    x = elements.positions[0, :, 0, 0]
    share = (np.argsort(np.argsort(x, kind="stable"), kind="stable") + 0.5) / elements.count * (len(ORIGINS) - 1)
    return np.stack([np.interp(share, np.arange(len(ORIGINS)), ORIGINS[:, c]) for c in range(3)], axis=-1)


SHARES = (0.40, 0.25, 0.14, 0.12, 0.09)  # of the sheets, of each colour of paper.PALETTE


def _paper_colours(scene: ElementsScene, elements: Elements) -> np.ndarray:
    """Colours (E, 3) of the sheets."""
    from render.paper import PALETTE

    if scene.render.kind != "paper" or scene.render.colour == "exemplar":
        return elements.colour
    rng = np.random.Generator(np.random.Philox(key=scene.seed))
    return np.array(PALETTE)[rng.choice(len(PALETTE), elements.count, p=SHARES)]


def _in_domain(scene: ElementsScene, points: np.ndarray) -> np.ndarray:
    """Points (M, 2) of a domain that repeats along x, in its one unit."""
    if not scene.elements.toroidal:
        return points
    width = scene.cells[0] / scene.cells[1]
    return np.stack([np.mod(points[:, 0] + width / 2, width) - width / 2, points[:, 1]], axis=-1)


def swum(scene: ElementsScene, elements: Elements) -> np.ndarray:
    """Tracks (T, E, 3) of fish through water that stands still: their domain swims along x."""
    render: Any = scene.render
    track = elements.positions[:, :, 0].astype(np.float64)
    track[:, :, 0] += (render.speed * scene.elements.spacing / elements.rate * np.arange(len(track)))[:, None]
    return track


def make_mesh(scene: ElementsScene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, dict[str, np.ndarray]]]:
    """The meshes, as `meshes.write` takes them."""
    elements = stock.read("elements")
    for frame in frames:
        found = mesh_of(scene, elements, frame - 1)
        yield frame, {"vertices": found.vertices, "faces": found.faces, "colours": found.colours}


def make_stage(scene: ElementsScene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, Elements]]:
    """The elements, for one USD file of the whole animation."""
    yield 0, stock.read("elements")


def write_stage(file: Path, elements: Elements, scene: ElementsScene) -> None:
    """Write the animation: points and curves as such, fish as meshes, sheets as shells with their thickness.

    Fish bend, and Blender (4.2) shows the first frame of instances in all: so they are meshes, not instances.
    """
    from pipeline.files import usd
    from synth.elements import mesh

    def school(frame: int) -> dict[str, Any]:
        return {"fish": mesh_of(scene, elements, frame - 1)}

    def sheets(frame: int) -> dict[str, Any]:
        surface = elements.positions[frame - 1].reshape(elements.count, *elements.grid, 3)
        return {"sheets": mesh.shells(surface, elements.size, _paper_colours(scene, elements))}

    usd.write(file, elements, {"school": school, "paper": sheets}.get(scene.render.kind))


def read_stage(file: Path, scene: ElementsScene) -> bytes:
    """The file's content."""
    return file.read_bytes()


def make_beauty(scene: ElementsScene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """The output."""
    ground, extent = _ground(scene, stock), _extent(stock.read("elements"))
    for frame in frames:
        yield frame, _picture(scene, stock.read("mesh", frame), frame, ground, extent, scene.render.width,
                              scene.render.spp)


def _extent(elements: Elements) -> np.ndarray:
    """The corners (2, D) of the box that holds the elements in all frames: pictures do not follow them."""
    return np.stack([elements.positions.min(axis=(0, 1, 2)), elements.positions.max(axis=(0, 1, 2))])


def _picture(scene: ElementsScene, mesh: dict[str, np.ndarray], frame: int, ground: Any, extent: np.ndarray, width: int,
             spp: int, inset: bool = False) -> np.ndarray:
    """One picture of elements that have an extent; an inset is a square that they fill."""
    from render import beads, noodles, paper, school, studio

    render: Any = scene.render
    if render.kind == "beads":
        return beads.picture(**mesh, ground=ground, settings=beads.Settings(width=width, spp=spp, seed=scene.seed))
    height = width if inset else round(render.height * width / render.width)
    how: dict[str, Any] = {"width": width, "height": height, "spp": spp, "seed": scene.seed}
    looks: dict[str, Any] = {"school": school, "noodles": noodles, "paper": paper}
    look = looks[render.kind]
    if render.kind == "school":
        how["time"] = frame / scene.fps
    elif not inset and render.kind == "noodles":
        how["camera"], how["plate"] = noodles.view(extent[0], extent[1], width / height)
    elif not inset:
        how["camera"] = studio.framing(extent[0], extent[1], paper.CAMERA, width / height)
    settings = look.Settings(**how)
    made: np.ndarray = (look.inset(**mesh, low=extent[0], high=extent[1], settings=settings) if inset
                        else look.picture(**mesh, settings=settings))
    return made


def _ground(scene: ElementsScene, stock: Stock) -> Any:
    """What beads lie on."""
    if scene.render.kind != "beads":
        return None
    from render.beads import Ground

    found = guides.domain(scene, stock)
    inside = np.argwhere(found.inside > 0)[:, ::-1]
    low, high = found.origin + found.cell * inside.min(axis=0), found.origin + found.cell * inside.max(axis=0)
    plain = scene.elements.domain is None and not scene.obstacles
    margin = 0.0 if scene.elements.toroidal or plain else MARGIN
    low, high = low - found.cell / 2 - margin, high + found.cell / 2 + margin
    return Ground(tuple(low), tuple(high), None if plain else found.inside, found.cell, tuple(found.origin))


def make_exemplar_picture(scene: ElementsScene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """The exemplar, in the same light; one that is shorter than the animation begins again."""
    from render.beads import Ground

    example = stock.read("exemplar")
    ground = None
    extent = _extent(example)
    if scene.render.kind == "beads":
        corners = example.box if example.box is not None else extent
        ground = Ground(tuple(corners[0]), tuple(corners[1]))
    seen: dict[int, np.ndarray] = {}
    for frame in frames:
        at = (frame - 1) % example.frames
        if at not in seen:
            found = mesh_of(scene, example, at)
            mesh = {"vertices": found.vertices, "faces": found.faces, "colours": found.colours}
            seen = {at: _picture(scene, mesh, frame, ground, extent, scene.figure.panel // 2,
                                 max(1, round(INSET * scene.render.spp)), inset=True)}
        yield frame, seen[at]


def make_coarse_picture(scene: ElementsScene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, np.ndarray]]:
    """The coarse motion: elements without details, or the lines of a flow."""
    if scene.flows:
        from render import lic, tonemap

        for frame in frames:
            yield frame, tonemap.from_srgb(lic.picture(stock.read("L", frame).values, scene.figure.panel, scene.seed))
        return
    coarse = stock.read("coarse")
    for frame in frames:
        found = mesh_of(scene, coarse, frame - 1)
        mesh = {"vertices": found.vertices, "faces": found.faces, "colours": found.colours}
        yield frame, _picture(scene, mesh, frame, None, _extent(coarse), scene.figure.panel, scene.render.spp)


def products(scene: ElementsScene) -> tuple[Product, ...]:
    """The meshes, the USD file, and the pictures that the figure shows."""
    solid = obstacles.inputs(scene)
    shape = ("synth.elements.fish" if scene.render.kind == "school" else "synth.elements.mesh",)
    mesh_keys = ("render.kind", "render.colour", "render.speed", "elements.spacing", "seed")
    ground = ("elements.domain", "elements.size", "elements.toroidal")
    made = [
        Product(name="mesh", stage="bake", folder="geometry", suffix=lambda s: "ply", reads=mesh_keys,
                inputs=(("elements", "once"),), methods=shape, make=make_mesh, write=write_mesh, read=read_mesh),
        Product(name="animation", stage="bake", folder="geometry", suffix=lambda s: "usdc", animated=False,
                reads=mesh_keys, inputs=(("elements", "once"),), methods=shape, make=make_stage, write=write_stage,
                read=read_stage, export=True),
        Product(name="beauty", stage="render", folder="images", suffix=suffix,
                reads=("render", "seed", "fps", *ground), inputs=(("mesh", "same"), ("elements", "once"), *solid),
                methods=(f"render.{scene.render.kind}", "pipeline.guides"), make=make_beauty, write=write_light,
                read=read_light)]
    look = (f"render.{scene.render.kind}", *shape)
    pictures: dict[str, tuple[Any, tuple[tuple[str, Frames], ...], tuple[str, ...]]] = {
        "exemplar": (make_exemplar_picture, (("exemplar", "once"),), look),
        "coarse": (make_coarse_picture, (("L", "same") if scene.flows else ("coarse", "once"),),
                   ("render.lic",) if scene.flows else look)}
    shown = {*scene.figure.panels, *(("exemplar",) if scene.figure.inset else ())}
    for name, (make, inputs, methods) in pictures.items():
        if name in shown:
            made.append(Product(
                name=f"{name}-picture", stage="render", folder="images", suffix=suffix,
                reads=("render", "figure.panel", "elements.spacing", "seed", "fps"), inputs=inputs, methods=methods,
                make=make, write=write_light, read=read_light))
    return tuple(made)
