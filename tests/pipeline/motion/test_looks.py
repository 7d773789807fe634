"""The looks of motion fields: the pictures of each kind, what makes them, and their proofs."""

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
import tiny

from pipeline.build import keys
from pipeline.build.artifact import Artifact
from pipeline.build.graph import computed
from pipeline.files import images
from pipeline.motion import looks
from pipeline.motion.method import artifacts
from pipeline.motion.scene import Scene
from pipeline.tables import PROJECT_SCENES, PROOF_SAMPLES
from render import smoke, studio
from synth.field import Field

SPACE: dict[str, Any] = {"coarse": {"kind": "analytic", "size": [8, 6, 4]}, "detail": {"size": [16, 12, 8]}}
VOLUME = {"kind": "volume", "width": 24, "height": 24, "spp": 1, "denoised": False}
FOAM = {"kind": "particles", "width": 24, "spp": 1}
STONE = [{"kind": "ball", "centre": [0.0, 0.5], "radius": 0.2}]


def scene(render: dict[str, Any], **tables: Any) -> Scene:
    """The tiny scene with this look."""
    raw = {**tomllib.loads(tiny.SMOKE), "figure": {"panels": ["result"], "panel": 32}, **tables, "render": render}
    return Scene.model_validate(raw, context={"folder": PROJECT_SCENES})


def named(scene: Scene) -> dict[str, Artifact]:
    """The artifacts of a scene by their names."""
    return {artifact.name: artifact for artifact in artifacts(scene)}


def light(scene: Scene, name: str, inputs: Any, frames: Sequence[int]) -> list[np.ndarray]:
    """Pictures of an artifact, which sees only what it declares."""
    return [picture for _, picture in computed(named(scene)[name], scene, inputs, frames)]


def density(folder: Path, shape: tuple[int, ...] = (16, 16)) -> tiny.Memory:
    """Seeded smoke, the same in each frame."""
    return tiny.Memory(folder, density=Field.centred(np.random.default_rng(2).random(shape), len(shape)))


@pytest.mark.parametrize("table", get_args(looks.Render))
def test_every_look_declares_what_it_bakes_and_its_beauty(table: type[looks.MotionLook]) -> None:
    kind, = get_args(table.model_fields["kind"].annotation)
    spatial = SPACE if 2 not in table.dimensions or table.draws_volume else {}
    one = scene({"kind": kind}, **spatial)
    expected = {"lit": ["density", "beauty"], "ink": ["density", "beauty"], "volume": ["density", "beauty"],
                "seaweed": ["blades", "beauty"], "particles": ["particles", "riverbed", "beauty"], "none": []}
    declared = one.render.artifacts(one)
    assert [artifact.name for artifact in declared] == expected[kind]
    assert all(artifact.format == images.LIGHT for artifact in declared if artifact.stage == "render")


def test_smoke_of_the_plane_is_lit_or_ink(tmp_path: Path) -> None:
    inputs = density(tmp_path)
    values = inputs.files["density"].values
    picture, = light(scene({"kind": "lit", "width": 24}), "beauty", inputs, [1])
    np.testing.assert_array_equal(picture, smoke.lit(values, 24))
    sepia = scene({"kind": "ink", "width": 24, "colour": "sepia"}, seed=5)
    picture, = light(sepia, "beauty", inputs, [1])
    np.testing.assert_array_equal(picture, smoke.ink(values, 24, "sepia", 5))
    assert (sepia.render.tone, scene({"kind": "lit"}).render.tone) == ("straight", "filmic")


@pytest.fixture
def marked(monkeypatch: pytest.MonkeyPatch) -> list[smoke.VolumeSettings]:
    """Volumes are 1 where they are path-traced and 2 where they are marched; what they are drawn with."""
    asked: list[smoke.VolumeSettings] = []

    def drawn(density: np.ndarray, voxel: float, origin: Any, settings: smoke.VolumeSettings) -> np.ndarray:
        asked.append(settings)
        return np.full((2, 2, 3), {"path": 1.0, "march": 2.0}[settings.method])

    monkeypatch.setattr(smoke, "volume", drawn)
    return asked


@pytest.mark.usefixtures("marked")
def test_the_method_of_a_volume_is_the_scenes_and_a_still_may_have_its_own(tmp_path: Path) -> None:
    def methods(method: str, **figure: Any) -> dict[str, tuple[float, list[int]]]:
        one = scene({**VOLUME, "method": method}, **SPACE | {
            "figure": {"panels": ["result"], "frame": 2, **figure}})
        shown = {}
        for name, artifact in named(one).items():
            if artifact.stage == "render":
                picture, = light(one, name, density(tmp_path, (8, 12, 16)), [2])
                shown[name] = (picture[0, 0, 0], artifact.frames(one))
        return shown

    assert methods("path") == {"beauty": (1.0, [1, 2, 3])}
    assert methods("march") == {"beauty": (2.0, [1, 2, 3])}
    assert methods("both") == {"beauty": (2.0, [1, 2, 3]), "still": (1.0, [2])}
    assert methods("both", animation=False) == {"beauty": (1.0, [2])}


@pytest.mark.parametrize(("method", "differs"), [("both", True), ("path", False), ("march", False)])
def test_a_beauty_marched_for_the_animation_is_not_taken_for_one_path_traced_for_the_still(
        method: str, differs: bool) -> None:
    def beauty(animation: bool) -> tuple[str, str]:
        one = scene({**VOLUME, "method": method}, **SPACE | {
            "figure": {"panels": ["result"], "animation": animation}})
        made = named(one)
        return (keys.key(keys.constant(made["beauty"], one, made), 3, ["the density"]),
                keys.content_id(made["beauty"], one, ["the density"]))

    for animated, alone in zip(beauty(True), beauty(False), strict=True):
        assert (animated != alone) == differs


def test_a_volume_is_drawn_as_the_scene_says(tmp_path: Path, marked: list[smoke.VolumeSettings]) -> None:
    render = {"kind": "volume", "width": 40, "height": 30, "spp": 7, "denoised": False, "extinction": 50.0,
              "bowl": [0.2, 0.1], "elevation": 20.0}
    light(scene(render, **SPACE | {"seed": 4}), "beauty", density(tmp_path, (8, 12, 16)), [1])
    assert marked == [smoke.VolumeSettings(width=40, height=30, spp=7, seed=4, extinction=50.0, bowl=(0.2, 0.1),
                                           method="path", denoised=False, camera=studio.raised(20.0))]


def test_nothing_to_see_in_the_shown_frame_is_refused_and_in_another_it_is_not(tmp_path: Path) -> None:
    one = scene({"kind": "lit", "width": 24}, figure={"panels": ["result"], "frame": 2})
    empty = tiny.Memory(tmp_path, density=Field.centred(np.zeros((16, 16)), 2))
    assert len(light(one, "beauty", empty, [1])) == 1
    with pytest.raises(ValueError, match="there is no smoke in frame 2, which the figure shows"):
        light(one, "beauty", empty, [1, 2])


@pytest.mark.parametrize("stones", [[], STONE])
def test_foam_is_drawn_over_the_riverbed_and_its_stones(tmp_path: Path, stones: list[dict[str, Any]]) -> None:
    one = scene(FOAM, obstacles=stones)
    inputs = tiny.Memory(tmp_path)
    assert ("solid" in dict(named(one)["riverbed"].inputs)) == bool(stones)
    if stones:
        inputs.files["solid"] = next(computed(named(one)["solid"], one, inputs, [0]))[1]
    bed, = light(one, "riverbed", inputs, [0])
    still = {name: np.zeros(1, np.float32) for name in ("vx", "vy", "vz")}
    moving = {"position": np.float32([[-0.4, 0.1, 0.0]]), **still, "vx": np.float32([2.0]), "age": np.int32([30])}
    resting = {**moving, **still}
    inputs.files |= {"riverbed": bed, "particles": [moving, resting]}
    foam, calm = light(one, "beauty", inputs, [1, 2])
    assert bed.shape == foam.shape == (24, 24, 3)
    touched = np.abs(foam - calm).max(axis=-1) > 1e-3
    assert touched.any() and not touched[:12].any()  # low in the picture, where the particle is


def test_a_bed_with_stones_is_another_than_one_without(tmp_path: Path) -> None:
    plain, = light(scene(FOAM), "riverbed", tiny.Memory(tmp_path), [0])
    one = scene(FOAM, obstacles=STONE)
    inputs = tiny.Memory(tmp_path)
    inputs.files["solid"] = next(computed(named(one)["solid"], one, inputs, [0]))[1]
    stones, = light(one, "riverbed", inputs, [0])
    assert np.abs(stones - plain)[10:14, 10:14].max() > 0.05


def test_blades_are_drawn_at_the_time_of_their_frame(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from render import seaweed

    asked: list[studio.Shot] = []

    def drawn(vertices: np.ndarray, faces: np.ndarray, colours: np.ndarray, shot: studio.Shot) -> np.ndarray:
        asked.append(shot)
        return np.zeros((2, 2, 3))

    monkeypatch.setattr(seaweed, "picture", drawn)
    one = scene({"kind": "seaweed", "width": 40, "height": 30, "spp": 2}, **SPACE | {"seed": 6, "fps": 20.0})
    mesh = {"vertices": np.zeros((3, 3)), "faces": np.array([[0, 1, 2]]), "colours": np.zeros((3, 3), np.uint8)}
    light(one, "beauty", tiny.Memory(tmp_path, blades=mesh), [1, 3])
    assert asked == [studio.Shot(40, 30, 2, 6, time=frame / 20) for frame in (1, 3)]


# -- proofs -------------------------------------------------------------------------------------------------------


def test_a_proof_is_small_and_shows_the_same() -> None:
    large = scene({"kind": "volume", "width": 480, "height": 640, "spp": 64, "elevation": 10.0}, **SPACE).render
    proof = large.proof()
    assert (proof.width, proof.height, proof.spp, proof.denoised) == (96, 128, PROOF_SAMPLES, False)
    assert {name for name in type(large).model_fields if getattr(proof, name) != getattr(large, name)} == {
        "width", "height", "spp", "denoised"}
    assert scene({"kind": "lit", "width": 64}).render.proof().width == 64  # smaller already
    assert scene({"kind": "lit"}).render.proof().width == 96


def test_proofs_name_what_renders_them() -> None:
    versions = scene({"kind": "volume"}, **SPACE).render.made_with()
    assert set(versions) == {"variant", "mitsuba", "drjit", "llvm"} and versions["mitsuba"] == "3.9.1"
    for kind in ("lit", "ink"):
        assert set(scene({"kind": kind}).render.made_with()) == {"numpy", "scipy"}
