"""The looks of elements: which artifacts each has, their meshes, and the pictures of output and exemplar."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tiny import BEADS, FISH, NOODLES, PAPER, Memory, changed, made, scene

from pipeline.build.artifact import Artifact
from pipeline.build.graph import computed
from pipeline.elements.looks import ORIGINS, BeadsRender, SchoolRender
from pipeline.elements.scene import Scene
from synth.elements.samples import Elements


def artifacts(one: Scene) -> dict[str, Artifact]:
    """What the look of a scene makes, by name."""
    return {artifact.name: artifact for artifact in one.render.artifacts(one)}


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
    one = scene(tmp_path, changed(BEADS, '["result"]', panels))
    assert set(artifacts(one)) == expected


def test_the_whole_animation_is_one_file_that_nothing_of_ours_reads(tmp_path: Path) -> None:
    one = scene(tmp_path, FISH)
    found = artifacts(one)
    assert found["animation"].export and found["animation"].file(0) == "animation.usdc"
    assert not [artifact for artifact in found.values() if "animation" in dict(artifact.inputs)]
    assert found["mesh"].file(2) == "mesh.0002.ply"
    assert found["mesh"].frames(one) == [1, 2, 3]


@pytest.mark.parametrize(("text", "grid", "dimensions"), [
    (BEADS, (), 2), (FISH, (), 3), (NOODLES, (5,), 3), (PAPER, (3, 4), 3)])
def test_every_kind_has_its_mesh_which_goes_where_the_elements_go(tmp_path: Path, text: str, grid: tuple[int, ...],
                                                                  dimensions: int) -> None:
    one, moved = scene(tmp_path, text), elements(grid=grid, dimensions=dimensions)
    meshes = dict(computed(artifacts(one)["mesh"], one, Memory(tmp_path, elements=moved), [1, 3]))
    assert list(meshes) == [1, 3]
    for mesh in meshes.values():
        assert mesh["faces"].max() < len(mesh["vertices"]) == len(mesh["colours"])
        assert np.isfinite(mesh["vertices"]).all()
    way = meshes[3]["vertices"].mean(axis=0) - meshes[1]["vertices"].mean(axis=0)
    assert way[:2] == pytest.approx([0.2, 0.0], abs=0.05)  # a fish bends as it swims


def test_beads_are_as_large_as_they_say(tmp_path: Path) -> None:
    one = scene(tmp_path, BEADS)
    large = Elements(elements(dimensions=2).positions, size=np.array([1.0, 1.0, 1.0, 2.0]))
    vertices = BeadsRender.mesh(one, large, 0).vertices.reshape(4, -1, 3)
    assert np.ptp(vertices[..., 0], axis=1) / 2 == pytest.approx(np.array([1, 1, 1, 2]), rel=0.05)


def test_beads_show_where_they_come_from_if_they_are_to(tmp_path: Path) -> None:
    one = scene(tmp_path, changed(BEADS, "spp = 1", 'spp = 1\ncolour = "origin"'))
    row = Elements(np.arange(4.0)[None, :, None, None] * [1.0, 0.0], colour=np.full((4, 3), 0.5))
    colours = BeadsRender.mesh(one, row, 0).colours.reshape(4, -1, 3)[:, 0]
    assert len(np.unique(colours, axis=0)) == 4
    for box in (np.array([[0.0, 0.0], [4.0, 4.0]]), None):  # of one that repeats, and of tracks, which do not
        example = Elements(row.positions, colour=row.colour, box=box)
        alike = BeadsRender.mesh(one, example, 0, exemplar=True).colours
        assert np.abs(alike - ORIGINS[len(ORIGINS) // 2] * 255).max() <= 1


def test_fish_swim_through_water_that_stands_still(tmp_path: Path) -> None:
    one = scene(tmp_path, changed(FISH, "spp = 1", "spp = 1\nspeed = 2.0"))
    drifting = elements()
    swum = SchoolRender.swum(one, drifting)
    step = np.diff(swum[:, :, 0], axis=0)
    assert step == pytest.approx(np.full_like(step, 0.1 + 2.0 * 0.3 / 24))
    assert (swum[..., 1:] == drifting.positions[:, :, 0, 1:]).all()


# -- an exemplar in its own unit, an output in a domain that repeats

WIDE = changed(changed(BEADS, "spacing = 0.12", "spacing = 0.12\ntoroidal = true"), "across = 6", "across = 8")
"""Its exemplar is 0.96 heights wide, from 0, and its domain 1, from -0.5."""


class Pictured(list[tuple[Any, Any]]):
    """The mesh and the ground of each picture that is made."""


@pytest.fixture
def pictured(monkeypatch: pytest.MonkeyPatch) -> Pictured:
    seen = Pictured()

    def picture(self: BeadsRender, mesh: Any, extent: np.ndarray, ground: Any, shot: Any) -> np.ndarray:
        seen.append((mesh, ground))
        return np.zeros((shot.height, shot.width, 3), np.float32)

    monkeypatch.setattr(BeadsRender, "picture", picture)
    return seen


@pytest.mark.parametrize("colour", ["exemplar", "origin"])
def test_an_exemplar_wider_than_half_a_domain_that_repeats_lies_whole_in_its_own_ground(
        tmp_path: Path, pictured: Pictured, colour: str) -> None:
    text = changed(changed(WIDE, '["result"]', '["exemplar", "result"]'), "spp = 1", f'spp = 1\ncolour = "{colour}"')
    built = made(tmp_path, text, "synth")
    one, example = built.variants[""], built.read("", "exemplar", 0)
    assert np.ptp(example.box[:, 0]) > 0.5 * one.cells[0] / one.cells[1]
    assert example.positions[..., 0].max() > 0.5, "some lie beyond the domain of the output"
    list(computed(artifacts(one)["exemplar-picture"], one, Memory(tmp_path, exemplar=example), [1]))
    (mesh, ground), = pictured
    assert (ground.low, ground.high) == (tuple(example.box[0]), tuple(example.box[1]))
    beads = mesh["vertices"].reshape(example.count, -1, 3)
    middles = (beads.max(axis=1) + beads.min(axis=1))[:, :2] / 2
    assert middles == pytest.approx(example.positions[0, :, 0], abs=1e-3), "none is wrapped"
    reach = example.size.max()
    assert (mesh["vertices"][:, :2] >= np.array(ground.low) - reach).all()
    assert (mesh["vertices"][:, :2] <= np.array(ground.high) + reach).all()


def test_an_output_in_a_domain_that_repeats_comes_in_on_the_other_side(tmp_path: Path) -> None:
    one = scene(tmp_path, WIDE)
    out = Elements(np.array([[-0.7, 0.1], [0.2, 0.2], [0.6, 0.3], [1.4, 0.4]])[None, :, None], size=np.full(4, 0.05))
    mesh = dict(computed(artifacts(one)["mesh"], one, Memory(tmp_path, elements=out), [1]))[1]
    beads = mesh["vertices"].reshape(4, -1, 3)
    middles = (beads.max(axis=1) + beads.min(axis=1))[:, 0] / 2
    assert middles == pytest.approx([0.3, 0.2, -0.4, 0.4], abs=1e-3)


def test_a_domain_that_ends_moves_nothing(tmp_path: Path) -> None:
    one = scene(tmp_path, BEADS)
    out = Elements(np.array([[-0.7, 0.1], [0.6, 0.3]])[None, :, None], size=np.full(2, 0.05))
    mesh = dict(computed(artifacts(one)["mesh"], one, Memory(tmp_path, elements=out), [1]))[1]
    beads = mesh["vertices"].reshape(2, -1, 3)
    assert (beads.max(axis=1) + beads.min(axis=1))[:, 0] / 2 == pytest.approx([-0.7, 0.6], abs=1e-3)


# -- pictures


def test_a_shorter_exemplar_begins_again_and_one_at_rest_is_pictured_once(tmp_path: Path, pictured: Pictured) -> None:
    one = scene(tmp_path, changed(BEADS, '["result"]', '["exemplar", "result"]'))
    picture = artifacts(one)["exemplar-picture"]
    list(computed(picture, one, Memory(tmp_path, exemplar=elements(frames=1, dimensions=2)), [1, 2, 3]))
    assert len(pictured) == 1
    pictured.clear()
    list(computed(picture, one, Memory(tmp_path, exemplar=elements(frames=2, dimensions=2)), [1, 2, 3]))
    first, second, third = (mesh["vertices"][:, 0].mean() for mesh, _ in pictured)
    assert (first, second) == pytest.approx((third, first + 0.1))


def test_a_picture_has_the_proportions_of_its_table_at_any_width(tmp_path: Path) -> None:
    fish = scene(tmp_path, FISH)
    shot = fish.render.shot(fish, 2, 64, 5)
    assert (shot.width, shot.height, shot.spp, shot.seed, shot.time) == (64, 48, 5, 1, 2 / 24)
    beads = scene(tmp_path, BEADS)
    assert beads.render.shot(beads, 1, 48, 1).height == 48


def test_a_proof_is_small_and_has_few_paths(tmp_path: Path) -> None:
    large = changed(FISH, "width = 32\nheight = 24\nspp = 1", "width = 960\nheight = 540")
    proof = scene(tmp_path, large).render.proof()
    assert (proof.width, proof.height, proof.spp, proof.kind) == (96, 54, 8, "school")


def test_a_picture_of_the_exemplar_does_not_depend_on_the_frames_made_with_it(tmp_path: Path,
                                                                             monkeypatch: pytest.MonkeyPatch) -> None:
    """Frame 9 of an exemplar of 8 frames shows its first pose again, under other waves."""
    text = changed(changed(FISH, "frames = 3", "frames = 9"), '["result"]', '["exemplar", "result"]')
    one = scene(tmp_path, text)
    monkeypatch.setattr(SchoolRender, "inset", lambda self, mesh, example, shot: np.full((1, 1, 3), shot.time))
    picture = artifacts(one)["exemplar-picture"]

    def shown(*frames: int) -> dict[int, Any]:
        return dict(computed(picture, one, Memory(tmp_path, exemplar=elements(frames=8)), list(frames)))

    assert shown(1, 9)[9] == pytest.approx(shown(9)[9])
    assert shown(1, 9)[9].mean() > shown(1, 9)[1].mean()
