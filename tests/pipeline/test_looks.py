"""What is looked at of elements: which products a scene has, what they depend on, and their meshes."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_elements_schema import BEADS, FISH, NOODLES, PAPERS, changed
from test_scene import written

from pipeline import looks
from pipeline.elements_schema import ElementsScene
from pipeline.scene import load
from synth.elements.samples import Elements


def scene_of(folder: Path, text: str) -> ElementsScene:
    scene = load(written(folder, text)).variants[""]
    assert isinstance(scene, ElementsScene)
    return scene


class Stock:
    """The files of a scene in memory."""

    def __init__(self, **files: Any):
        self.files = files

    def read(self, product: str, frame: int = 0) -> Any:
        return self.files[product]


def elements(frames: int = 3, count: int = 4, grid: tuple[int, ...] = (), dimensions: int = 3) -> Elements:
    """Elements one apart, that move along x."""
    samples = int(np.prod(grid))
    place = np.zeros((frames, count, samples, dimensions))
    place[..., 1] += np.arange(count)[:, None]
    place[..., 0] += np.arange(frames)[:, None, None] * 0.1
    columns = grid[-1] if grid else 1
    place[..., 0] += np.arange(samples) % columns
    if len(grid) == 2:
        place[..., 2] += np.arange(samples) // columns
    return Elements(place, grid, size=np.full(count, 0.1))


@pytest.mark.parametrize(("panels", "expected"), [
    ('["result"]', {"mesh", "animation", "beauty"}),
    ('["exemplar", "result"]', {"mesh", "animation", "beauty", "exemplar-picture"}),
    ('["coarse", "result"]', {"mesh", "animation", "beauty", "coarse-picture"}),
    ('["result"]\ninset = true', {"mesh", "animation", "beauty", "exemplar-picture"}),
])
def test_a_scene_has_the_pictures_that_it_shows(tmp_path: Path, panels: str, expected: set[str]) -> None:
    scene = scene_of(tmp_path, changed(BEADS, '["result"]', panels))
    assert {product.name for product in looks.products(scene)} == expected


def test_the_whole_animation_is_one_file_that_nothing_of_ours_reads(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, FISH)
    made = {product.name: product for product in looks.products(scene)}
    assert made["animation"].export and made["animation"].file(scene, 0) == "animation.usdc"
    assert not [p for p in made.values() if "animation" in dict(p.inputs)]
    assert made["mesh"].file(scene, 2) == "mesh.0002.ply"
    assert made["mesh"].frames(scene) == [1, 2, 3]


@pytest.mark.parametrize(("text", "grid", "dimensions"), [
    (BEADS, (), 2), (FISH, (), 3), (NOODLES, (5,), 3), (PAPERS, (3, 4), 3)])
def test_every_kind_has_its_mesh_which_goes_where_the_elements_go(tmp_path: Path, text: str, grid: tuple[int, ...],
                                                                  dimensions: int) -> None:
    scene, moved = scene_of(tmp_path, text), elements(grid=grid, dimensions=dimensions)
    meshes = dict(looks.make_mesh(scene, Stock(elements=moved), [1, 3]))
    assert list(meshes) == [1, 3]
    for mesh in meshes.values():
        assert mesh["faces"].max() < len(mesh["vertices"]) == len(mesh["colours"])
        assert np.isfinite(mesh["vertices"]).all()
    way = meshes[3]["vertices"].mean(axis=0) - meshes[1]["vertices"].mean(axis=0)
    assert way[:2] == pytest.approx([0.2, 0.0], abs=0.05)  # a fish bends as it swims


def test_beads_are_as_large_as_they_say(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, BEADS)
    large = Elements(elements(dimensions=2).positions, size=np.array([1.0, 1.0, 1.0, 2.0]))
    vertices = looks.mesh_of(scene, large, 0).vertices.reshape(4, -1, 3)
    assert np.ptp(vertices[..., 0], axis=1) / 2 == pytest.approx(np.array([1, 1, 1, 2]), rel=0.05)


def test_beads_show_where_they_come_from_if_they_are_to(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, changed(BEADS, "spp = 1", 'spp = 1\ncolour = "origin"'))
    row = Elements(np.arange(4.0)[None, :, None, None] * [1.0, 0.0], colour=np.full((4, 3), 0.5))
    colours = looks.mesh_of(scene, row, 0).colours.reshape(4, -1, 3)[:, 0]
    assert len(np.unique(colours, axis=0)) == 4
    example = Elements(row.positions, colour=row.colour, box=np.array([[0.0, 0.0], [4.0, 4.0]]))
    assert len(np.unique(looks.mesh_of(scene, example, 0).colours, axis=0)) == 1


def test_fish_swim_through_water_that_stands_still(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, changed(FISH, "spp = 1", "spp = 1\nspeed = 2.0"))
    drifting = elements()
    swum = looks.swum(scene, drifting)
    step = np.diff(swum[:, :, 0], axis=0)
    assert step == pytest.approx(np.full_like(step, 0.1 + 2.0 * 0.3 / 24))
    assert (swum[..., 1:] == drifting.positions[:, :, 0, 1:]).all()
