"""What bake makes: F of its formula, the density of its pseudocode, particles and blades; any frame alone."""

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tiny

from pipeline.build.artifact import Artifact
from pipeline.build.graph import computed
from pipeline.files import volumes
from pipeline.files.fields import velocity
from pipeline.motion import bake
from pipeline.motion.method import artifacts
from pipeline.motion.scene import Scene
from pipeline.tables import PROJECT_SCENES
from synth.field import Field
from synth.motion.coarse import upsample
from synth.motion.inflate import inflate
from synth.motion.local_axes import axes_2d, axes_3d, outward, to_world

FRAMES = 6
ALL = list(range(1, FRAMES + 1))
SMOKE = {"m": 2, "scale": 1, "sources": [{"centre": [0.0, 0.5], "radius": 0.3}]}


def scene(**tables: Any) -> Scene:
    """The tiny scene, FRAMES long, with these tables."""
    raw = {**tomllib.loads(tiny.SMOKE), "frames": FRAMES, "combine": {"omega": 2.0}, "density": SMOKE, **tables}
    return Scene.model_validate(raw, context={"folder": PROJECT_SCENES})


@pytest.fixture
def inputs(tmp_path: Path) -> tiny.Memory:
    """L and H of every frame, seeded noise."""
    rng = np.random.default_rng(3)
    return tiny.Memory(
        tmp_path, L=[Field.centred(rng.standard_normal((8, 8, 2)), 2).per_second(30) for _ in ALL],
        H=[Field.centred(rng.standard_normal((16, 16, 2)), 2) for _ in ALL])


def made(artifact: Artifact, scene: Scene, inputs: Any, frames: Sequence[int] = ALL) -> dict[int, Any]:
    """What an artifact makes of its inputs, which sees only what it declares."""
    return dict(computed(artifact, scene, inputs, frames))


def test_the_final_motion_is_the_formula_in_world_units(inputs: tiny.Memory) -> None:
    field = made(bake.final_artifact(scene()), scene(), inputs, [2])[2]
    L = upsample(inputs.files["L"][1].per_frame(30).values, (16, 16))
    np.testing.assert_allclose(
        field.per_frame(30).values, L + 2 * to_world(inputs.files["H"][1].values, axes_2d(L)), atol=1e-5)


def test_omega_zero_is_the_coarse_motion(inputs: tiny.Memory) -> None:
    still = scene(combine={"omega": 0.0})
    field = made(bake.final_artifact(still), still, inputs, [1])[1]
    np.testing.assert_allclose(field.values, upsample(inputs.files["L"][0].values, (16, 16)) / 2, atol=1e-6)


@pytest.mark.parametrize("scheme", ["windowed", "naive"])
@pytest.mark.parametrize("frames", [[1], [6], [2, 5], [4, 5, 6], [1, 3]])
def test_any_frames_alone_have_the_bits_of_all_in_a_row(inputs: tiny.Memory, scheme: str, frames: list[int]) -> None:
    smoky = scene(density={"m": 2, "scale": 1, "scheme": scheme})
    every = made(bake.density_artifact(smoky), smoky, inputs)
    assert made(bake.density_artifact(smoky), smoky, inputs, frames) == {frame: every[frame] for frame in frames}


@pytest.mark.parametrize("scheme", ["windowed", "naive"])
def test_all_in_a_row_each_frame_of_the_motion_is_read_once(inputs: tiny.Memory, scheme: str) -> None:
    smoky = scene(density={"m": 2, "scale": 1, "scheme": scheme})
    assert len(made(bake.density_artifact(smoky), smoky, inputs)) == FRAMES
    assert sorted(inputs.asked) == [(name, frame) for name in "HL" for frame in ALL]


def test_a_depth_makes_a_volume_of_the_same_smoke(inputs: tiny.Memory) -> None:
    deep = scene(density={**SMOKE, "depth": {"reach": 0.2}}, render={"kind": "volume"})
    flat = made(bake.density_artifact(scene()), scene(), inputs, [3])[3]
    assert made(bake.density_artifact(deep), deep, inputs, [3])[3] == Field.centred(inflate(flat.values, 0.2), 3)


def test_a_volume_is_stored_as_vdb_and_a_plane_as_exr(tmp_path: Path) -> None:
    flat, deep = (bake.density_artifact(s) for s in (
        scene(), scene(density={"depth": {}}, render={"kind": "volume"})))
    assert [flat.file(7), deep.file(7)] == ["density.0007.exr", "density.0007.vdb"]
    field = Field.centred(np.random.default_rng(1).random((3, 4, 5)), 3)
    deep.format.save(tmp_path / "density.vdb", field)
    assert volumes.read(tmp_path / "density.vdb") == {"density": field}
    assert deep.format.read(tmp_path / "density.vdb") == field


# -- in space -----------------------------------------------------------------------------------------------------


@pytest.fixture
def solid_inputs(tmp_path: Path) -> tiny.Memory:
    """L, H and O of every frame in space, seeded noise."""
    rng = np.random.default_rng(3)
    return tiny.Memory(
        tmp_path, L=[Field.centred(rng.standard_normal((4, 8, 6, 3)), 3).per_second(30) for _ in ALL],
        H=[Field.centred(rng.standard_normal((8, 16, 12, 3)), 3) for _ in ALL],
        O=[Field.centred(rng.random((4, 8, 6)), 3) for _ in ALL])


def solid(facing: str = "camera", look: str = "volume", **density: Any) -> Scene:
    """A small scene in space."""
    smoke = {**SMOKE, "sources": [{"centre": [0.0, 0.5, 0.1], "radius": 0.3}], **density}
    return scene(coarse={"kind": "analytic", "size": [6, 8, 4]}, render={"kind": look}, density=smoke,
                 detail={"size": [12, 16, 8], "facing": facing})


@pytest.mark.parametrize("facing", ["camera", "density"])
def test_the_final_motion_in_space_is_the_formula(solid_inputs: tiny.Memory, facing: str) -> None:
    files = solid_inputs.files
    field = made(bake.final_artifact(solid(facing)), solid(facing), solid_inputs, [2])[2]
    L = upsample(files["L"][1].per_frame(30).values, (8, 16, 12))
    towards = np.broadcast_to(np.float32([0, 0, 1]), L.shape) if facing == "camera" else upsample(
        outward(files["O"][1].values), (8, 16, 12))
    np.testing.assert_allclose(field.per_frame(30).values, L + 2 * to_world(
        files["H"][1].values, axes_3d(L, towards)), atol=1e-5)
    assert field.origin == pytest.approx((-12 / 32 + 1 / 32, 1 / 32, -8 / 32 + 1 / 32))


@pytest.mark.parametrize("scheme", ["windowed", "naive"])
@pytest.mark.parametrize("frames", [[6], [2, 5], [4, 5, 6]])
def test_in_space_too_any_frames_alone_have_the_bits_of_all_in_a_row(
        solid_inputs: tiny.Memory, scheme: str, frames: list[int]) -> None:
    smoky = solid(scheme=scheme)
    every = made(bake.density_artifact(smoky), smoky, solid_inputs)
    assert every[6].values.shape == (8, 16, 12)
    assert made(bake.density_artifact(smoky), smoky, solid_inputs, frames) == {f: every[f] for f in frames}


def test_what_is_baked_in_space_are_volumes_made_from_what_the_frame_needs() -> None:
    final, density = (a for a in artifacts(solid("density")) if a.stage == "bake")
    assert (final.file(7), density.file(7)) == ("F.0007.vdb", "density.0007.vdb")
    assert final.format == velocity(3, 30)
    assert (final.inputs[-1], density.inputs[-1]) == (("O", "same"), ("O", "until"))
    assert [name for name, _ in bake.final_artifact(solid()).inputs] == ["L", "H"]


def test_nothing_is_baked_for_a_scene_that_renders_nothing() -> None:
    assert [a.name for a in artifacts(scene(render={"kind": "none"})) if a.stage == "bake"] == ["F"]


@pytest.mark.parametrize(("size", "scale", "key"), [([12, 16, 8], 1, "detail.size"), ([12, 16, 8], 3, "density.scale")])
def test_the_memory_of_a_density_is_told_with_the_key_that_decides(size: list[int], scale: int, key: str) -> None:
    needed, decides = bake.density_memory(solid(scale=scale))
    assert decides == key and needed > 4 * np.prod(size) * scale**3


# -- seaweed and particles ----------------------------------------------------------------------------------------


def same(one: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> bool:
    """Whether two meshes have the same bits."""
    return one.keys() == other.keys() and all(
        one[name].dtype == other[name].dtype and one[name].tobytes() == other[name].tobytes() for name in one)


def test_blades_of_any_frame_alone_have_the_bits_of_all_in_a_row(solid_inputs: tiny.Memory) -> None:
    bed = solid(look="seaweed").model_copy(update={"blades": Scene.model_fields["blades"].default.model_copy(
        update={"window": 3, "spacing": 0.2})})
    every = made(bake.blades_artifact(bed), bed, solid_inputs)
    assert set(every[1]) == {"vertices", "faces", "colours"} and not same(every[5], every[6])
    solid_inputs.asked.clear()
    assert same(made(bake.blades_artifact(bed), bed, solid_inputs, [6])[6], every[6])
    assert {frame for _, frame in solid_inputs.asked} == {4, 5, 6}  # those of its window alone


FOAM = {"render": {"kind": "particles"}, "particles": {"count": 50, "life": 3}}


def test_interrupted_particles_go_on_from_the_checkpoint_with_the_same_bits(
        tmp_path: Path, inputs: tiny.Memory) -> None:
    foam = scene(**FOAM)
    every = made(bake.particles_artifact(foam), foam, inputs)
    assert not same(every[5], every[6])
    (tmp_path / "stopped").mkdir()
    stopped = tiny.Memory(tmp_path / "stopped", **inputs.files)
    run = computed(bake.particles_artifact(foam), foam, stopped, ALL)
    assert all(same(next(run)[1], every[frame]) for frame in (1, 2, 3, 4))
    run.close()  # while it hands over frame 4: the last state is that of frame 3
    again = tiny.Memory(tmp_path / "stopped", **inputs.files)
    rest = made(bake.particles_artifact(foam), foam, again, [5, 6])
    assert all(same(rest[frame], every[frame]) for frame in (5, 6))
    assert {frame for _, frame in again.asked} == {3, 4, 5, 6}  # no frame before the state was asked for


def test_particles_without_a_whole_checkpoint_start_anew_with_the_same_bits(
        tmp_path: Path, inputs: tiny.Memory) -> None:
    foam = scene(**FOAM)
    every = made(bake.particles_artifact(foam), foam, inputs)
    state = tmp_path / "state.npz"
    state.write_bytes(state.read_bytes()[:-50])
    inputs.asked.clear()
    assert same(made(bake.particles_artifact(foam), foam, inputs, [6])[6], every[6])
    assert ("L", 1) in inputs.asked
