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
from synth.motion.depth import inflate
from synth.motion.frames import local_frame, to_world

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
    geometry.write_density(tmp_path / "density.vdb", field, deep)
    assert volumes.read(tmp_path / "density.vdb") == {"density": field}
    assert geometry.read_density(tmp_path / "density.vdb", deep) == field


def test_nothing_is_baked_for_a_scene_that_renders_nothing() -> None:
    assert [p.name for p in geometry.products(scene(render={"kind": "none"}))] == ["F"]
