"""What bake makes: F of its formula, the density of its pseudocode, any frame alone."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline import geometry
from pipeline.files import volumes
from pipeline.schema import PROJECT_SCENES, Scene
from synth.field import Field
from synth.motion.coarse import upsample
from synth.motion.inflate import inflate
from synth.motion.local_axes import local_frame, outward, solid_frame, to_world

FRAMES = 6


def scene(**tables: Any) -> Scene:
    """A small scene with these tables."""
    raw: dict[str, Any] = {
        "title": "small", "frames": FRAMES, "exemplar": {"kind": "circle", "size": 8},
        "coarse": {"kind": "analytic", "size": [8, 8]}, "detail": {"size": [16, 16]}, "combine": {"omega": 2.0},
        "density": {"m": 2, "scale": 1, "sources": [{"centre": [0.0, 0.5], "radius": 0.3}]}, "render": {"kind": "lit"}}
    return Scene.model_validate({**raw, **tables}, context={"folder": PROJECT_SCENES})


class Fields:
    """L and H of every frame, seeded noise."""

    work = Path()

    def __init__(self) -> None:
        rng = np.random.default_rng(3)
        self.L = [Field.centred(rng.standard_normal((8, 8, 2)), 2).per_second(30) for _ in range(FRAMES)]
        self.H = [Field.centred(rng.standard_normal((16, 16, 2)), 2) for _ in range(FRAMES)]

    def read(self, product: str, frame: int = 0) -> Field:
        return getattr(self, product)[frame - 1]

    def own(self, frame: int) -> Any | None:
        return None

    def key(self, frame: int) -> str:
        return ""


def test_the_final_motion_is_the_formula_in_world_units() -> None:
    stock = Fields()
    (_, field), = geometry.make_final(scene(), stock, [2])
    L = upsample(stock.L[1].per_frame(30).values, (16, 16))
    np.testing.assert_allclose(field.per_frame(30).values, L + 2 * to_world(stock.H[1].values, local_frame(L)),
                               atol=1e-5)


def test_omega_zero_is_the_coarse_motion() -> None:
    stock = Fields()
    (_, field), = geometry.make_final(scene(combine={"omega": 0.0}), stock, [1])
    np.testing.assert_allclose(field.values, upsample(stock.L[0].values, (16, 16)) / 2, atol=1e-6)


@pytest.mark.parametrize("scheme", ["windowed", "naive"])
@pytest.mark.parametrize("frames", [[1], [6], [2, 5], [4, 5, 6], [1, 3]])
def test_any_frames_alone_have_the_bits_of_all_in_a_row(scheme: str, frames: list[int]) -> None:
    made = scene(density={"m": 2, "scale": 1, "scheme": scheme})
    every = dict(geometry.make_density(made, Fields(), list(range(1, FRAMES + 1))))
    some = dict(geometry.make_density(made, Fields(), frames))
    assert some == {frame: every[frame] for frame in frames}


def test_a_depth_makes_a_volume_of_the_same_smoke() -> None:
    flat = dict(geometry.make_density(scene(), Fields(), [3]))[3]
    density = {"m": 2, "scale": 1, "sources": [{"centre": [0.0, 0.5], "radius": 0.3}], "depth": {"reach": 0.2}}
    deep = dict(geometry.make_density(scene(density=density, render={"kind": "volume"}), Fields(), [3]))[3]
    assert deep == Field.centred(inflate(flat.values, 0.2), 3)


def test_a_volume_is_stored_as_vdb_and_a_plane_as_exr(tmp_path: Path) -> None:
    flat, deep = (scene(), scene(density={"depth": {}}, render={"kind": "volume"}))
    assert [geometry.products(s)[1].file(s, 7) for s in (flat, deep)] == ["density.0007.exr", "density.0007.vdb"]
    field = Field.centred(np.random.default_rng(1).random((3, 4, 5)), 3)
    geometry.write_field(tmp_path / "density.vdb", field, deep)
    assert volumes.read(tmp_path / "density.vdb") == {"density": field}
    assert geometry.read_field(tmp_path / "density.vdb", deep) == field


class Solid(Fields):
    """L, H and O of every frame in space, seeded noise."""

    def __init__(self) -> None:
        rng = np.random.default_rng(3)
        self.L = [Field.centred(rng.standard_normal((4, 8, 6, 3)), 3).per_second(30) for _ in range(FRAMES)]
        self.H = [Field.centred(rng.standard_normal((8, 16, 12, 3)), 3) for _ in range(FRAMES)]
        self.O = [Field.centred(rng.random((4, 8, 6)), 3) for _ in range(FRAMES)]


def solid(facing: str = "camera", **density: Any) -> Scene:
    """A small scene in space."""
    smoke = {"m": 2, "scale": 1, "sources": [{"centre": [0.0, 0.5, 0.1], "radius": 0.3}], **density}
    return scene(coarse={"kind": "analytic", "size": [6, 8, 4]}, render={"kind": "volume"}, density=smoke,
                 detail={"size": [12, 16, 8], "facing": facing})


@pytest.mark.parametrize("facing", ["camera", "density"])
def test_the_final_motion_in_space_is_the_formula(facing: str) -> None:
    stock, made = Solid(), solid(facing)
    (_, field), = geometry.make_final(made, stock, [2])
    L = upsample(stock.L[1].per_frame(30).values, (8, 16, 12))
    towards = np.broadcast_to(np.float32([0, 0, 1]), L.shape) if facing == "camera" else upsample(
        outward(stock.O[1].values), (8, 16, 12))
    np.testing.assert_allclose(field.per_frame(30).values, L + 2 * to_world(
        stock.H[1].values, solid_frame(L, towards)), atol=1e-5)
    assert field.origin == pytest.approx((-12 / 32 + 1 / 32, 1 / 32, -8 / 32 + 1 / 32))


@pytest.mark.parametrize("scheme", ["windowed", "naive"])
@pytest.mark.parametrize("frames", [[6], [2, 5], [4, 5, 6]])
def test_in_space_too_any_frames_alone_have_the_bits_of_all_in_a_row(scheme: str, frames: list[int]) -> None:
    made = solid(scheme=scheme)
    every = dict(geometry.make_density(made, Solid(), list(range(1, FRAMES + 1))))
    assert every[6].values.shape == (8, 16, 12)
    assert dict(geometry.make_density(made, Solid(), frames)) == {frame: every[frame] for frame in frames}


def test_what_is_baked_in_space_are_volumes_made_from_what_the_frame_needs() -> None:
    final, density = geometry.products(solid("density"))
    assert (final.file(solid(), 7), density.file(solid(), 7)) == ("F.0007.vdb", "density.0007.vdb")
    assert (final.inputs[-1], density.inputs[-1]) == (("O", "same"), ("O", "until"))
    assert [name for name, _ in geometry.products(solid())[0].inputs] == ["L", "H"]


def test_nothing_is_baked_for_a_scene_that_renders_nothing() -> None:
    assert [p.name for p in geometry.products(scene(render={"kind": "none"}))] == ["F"]
