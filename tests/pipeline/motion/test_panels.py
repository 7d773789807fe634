"""The panels of a figure of motion fields: which pictures, of which fields, as light."""

import tomllib
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
import tiny

from pipeline.build.graph import computed
from pipeline.files import pictures
from pipeline.motion import panels
from pipeline.motion.method import artifacts
from pipeline.motion.scene import Scene
from pipeline.motion.tables import Panel
from pipeline.tables import PROJECT_SCENES
from render import arrows, lic, tonemap
from synth.field import Field
from synth.motion.exemplar import exemplar


def scene(shown: list[str], **tables: Any) -> Scene:
    """The tiny scene with a figure that shows these panels."""
    raw = {**tomllib.loads(tiny.SMOKE), "combine": {"omega": 2.0}, "render": {"kind": "ink", "width": 24},
           "figure": {"panels": shown, "panel": 32}, **tables}
    return Scene.model_validate(raw, context={"folder": PROJECT_SCENES})


def flat(folder: Path) -> tiny.Memory:
    """Every artifact, the same in each frame."""
    values = np.random.default_rng(2).random((16, 16, 2)) - 0.5
    return tiny.Memory(
        folder, exemplar=Field.centred(exemplar("circle", 8), 2), L=Field.centred(values[:8, :8], 2),
        H=Field.centred(values, 2), F=Field.centred(values[::-1], 2),
        density=Field.centred(np.abs(values[..., 0]), 2))


def solid(folder: Path) -> tiny.Memory:
    """The same in space: 8 layers of 12 rows and 16 columns."""
    values = np.random.default_rng(2).random((8, 12, 16, 3)) - 0.5
    views = {"exemplar-top": "square", "exemplar-side": "stripes"}
    return tiny.Memory(
        folder, exemplar=Field.centred(exemplar("circle", 8), 2), L=Field.centred(values[::2, ::2, ::2], 3),
        H=Field.centred(values, 3), F=Field.centred(values[::-1], 3), density=Field.centred(np.abs(values[..., 0]), 3),
        **{name: Field.centred(exemplar(kind, 8), 2) for name, kind in views.items()})


SPACE: dict[str, Any] = {
    "coarse": {"kind": "analytic", "size": [8, 6, 4]}, "detail": {"size": [16, 12, 8]},
    "render": {"kind": "volume", "width": 24, "height": 24, "spp": 1, "denoised": False}}
VIEWS = [{"plane": "top", "exemplar": {"kind": "square", "size": 8}},
         {"plane": "side", "exemplar": {"kind": "stripes", "size": 8}}]


def light(scene: Scene, name: str, inputs: Any) -> np.ndarray:
    """The picture of that name of a frame."""
    artifact = next(one for one in artifacts(scene) if one.name == name)
    return next(computed(artifact, scene, inputs, artifact.frames(scene)[:1]))[1]


def picture(panel: str, inputs: tiny.Memory, **tables: Any) -> np.ndarray:
    """The light of a panel."""
    one = scene([panel], **tables)
    return light(one, panels.shown(one)[0].artifact, inputs)


def test_a_display_value_comes_back_from_its_light() -> None:
    shown = np.linspace(0, 1, 300, dtype=np.float32).reshape(10, 10, 3)
    np.testing.assert_allclose(tonemap.to_display(tonemap.from_srgb(shown), "straight"), shown, atol=1e-6)


@pytest.mark.parametrize("panel", get_args(Panel))
def test_every_panel_there_is_has_its_picture(tmp_path: Path, panel: str) -> None:
    light = picture(panel, flat(tmp_path))
    assert light.shape == ((24, 24, 3) if panel == "result" else (32, 32, 3))
    assert np.isfinite(light).all()
    assert np.ptp(light) > 0.05


@pytest.mark.parametrize("panel", get_args(Panel))
@pytest.mark.parametrize("plane", ["front", "side", "top"])
def test_every_panel_has_its_picture_in_space(tmp_path: Path, panel: str, plane: str) -> None:
    shape = {"front": (24, 32, 3), "side": (48, 32, 3), "top": (16, 32, 3)}[plane]
    light = picture(panel, solid(tmp_path), **SPACE, figure={"panels": [panel], "panel": 32, "plane": plane})
    assert light.shape == ((24, 24, 3) if panel == "result" else (32, 32, 3) if panel[:2] in ("ex", "in") else shape)
    assert np.isfinite(light).all()
    assert np.ptp(light) > 0.05


def test_in_space_the_middle_slice_is_shown(tmp_path: Path) -> None:
    inputs = solid(tmp_path)
    combined = inputs.read("F").values
    np.testing.assert_allclose(picture("combined", inputs, **SPACE), tonemap.from_srgb(lic.picture(
        combined[4][..., :2], 32, 1)))
    seen = picture("combined-colour", inputs, **SPACE, figure={"panels": ["combined-colour"], "panel": 32,
                                                               "plane": "top"})
    np.testing.assert_allclose(seen, tonemap.from_srgb(lic.colour(combined[:, 6][..., [0, 2]], 32)))


def test_each_exemplar_of_the_views_has_a_panel(tmp_path: Path) -> None:
    one = scene(["exemplar", "input", "coarse"], **SPACE, views=VIEWS)
    names = ["exemplar-top-lines", "exemplar-side-lines", "input-top", "input-side", "coarse-lines"]
    assert [shown.artifact for shown in panels.shown(one)] == names
    assert [panel.artifact for panel in panels.panels(one)] == names
    assert [panel.label for panel in panels.panels(one)] == [
        "exemplar *I*, top", "exemplar *I*, side", "input, top", "input, side", "coarse motion *L*"]
    np.testing.assert_allclose(light(one, "exemplar-side-lines", solid(tmp_path)),
                               tonemap.from_srgb(lic.picture(exemplar("stripes", 8), 32, 1)))
    np.testing.assert_allclose(light(one, "input-top", solid(tmp_path)),
                               tonemap.from_srgb(lic.colour(exemplar("square", 8), 32)))


def test_only_what_is_shown_is_made_and_the_smoke() -> None:
    def rendered(one: Scene) -> list[str]:
        return [a.name for a in artifacts(one) if a.stage == "render"]

    assert rendered(scene(["coarse", "coarse"])) == ["beauty", "coarse-lines"]
    assert rendered(scene(["coarse"], render={"kind": "none"})) == ["coarse-lines"]


def test_a_field_is_shown_as_the_renderer_draws_it(tmp_path: Path) -> None:
    inputs = flat(tmp_path)
    combined = inputs.read("F").values
    np.testing.assert_allclose(picture("combined", inputs), tonemap.from_srgb(lic.picture(combined, 32, 1)))
    np.testing.assert_allclose(picture("combined-colour", inputs), tonemap.from_srgb(lic.colour(combined, 32)))


def test_obstacles_stand_in_the_pictures_of_fields_and_not_in_those_of_exemplars(tmp_path: Path) -> None:
    inputs = flat(tmp_path)
    y, x = (np.mgrid[:16, :16] - 7.5) / 16
    distance = (np.hypot(x, y) - 0.2).astype(np.float32)
    stone = {"obstacles": [{"kind": "ball", "centre": [0.0, 0.5], "radius": 0.2}]}
    plain = picture("combined", inputs)
    untouched = picture("exemplar", inputs)
    inputs.files["solid"] = Field.centred(distance, 2)
    expected = lic.with_solids(lic.picture(inputs.read("F").values, 32, 1), distance * 16)
    np.testing.assert_allclose(picture("combined", inputs, **stone), tonemap.from_srgb(expected))
    assert np.abs(tonemap.from_srgb(expected) - plain).max() > 0.05
    one = scene(["exemplar"], **stone)
    assert "solid" not in dict(next(a for a in artifacts(one) if a.name == "exemplar-lines").inputs)
    del inputs.files["solid"]
    np.testing.assert_array_equal(picture("exemplar", inputs, **stone), untouched)


def test_the_input_is_the_bitmap_itself_or_the_colours_of_a_procedure(tmp_path: Path) -> None:
    inputs = flat(tmp_path)
    np.testing.assert_allclose(picture("input", inputs), tonemap.from_srgb(lic.colour(exemplar("circle", 8), 32)))
    shown = tonemap.to_display(picture("input", inputs, exemplar={
        "kind": "bitmap", "file": "assets/lightning.png", "size": 16}), "straight")
    bitmap = pictures.read(PROJECT_SCENES / "assets" / "lightning.png")
    assert abs(shown.mean() - bitmap.mean()) < 0.02
    assert shown[:16].mean() > 0.02  # the right way up: the bolt comes from above


def test_arrows_of_the_detail_are_red_where_right_and_green_where_not_transformed(tmp_path: Path) -> None:
    plain, drawn = (picture(p, flat(tmp_path), figure={"panels": [p], "panel": 192})
                    for p in ("detail", "detail-arrows"))
    touched = np.abs(plain - drawn).max(-1) > 0.2
    for colour in (arrows.RED, arrows.GREEN):
        near = np.abs(drawn - tonemap.from_srgb(np.array(colour))).max(-1) < 0.05
        assert (near & touched).sum() > 10


def test_an_exemplar_is_no_higher_than_a_result_that_is_wider_than_high() -> None:
    def widths(**render: Any) -> list[int]:
        one = scene([], **SPACE | {"render": {"kind": "volume", **render}}, figure={
            "panels": ["exemplar", "coarse", "result"], "panel": 320})
        return [panel.width for panel in panels.panels(one)]

    assert widths(width=960, height=540) == [180, 320, 320]
    assert widths(width=512, height=640) == [320, 320, 320]
    square = scene([], render={"kind": "ink", "width": 512}, figure={"panels": ["exemplar", "result"], "panel": 320})
    assert [panel.width for panel in panels.panels(square)] == [320, 320]  # a picture without a height of its own


def test_the_tone_the_still_and_the_legend_of_a_panel() -> None:
    both = scene([], **SPACE | {"render": {"kind": "volume", "method": "both"}},
                 figure={"panels": ["coarse-colour", "result"], "panel": 32})
    colour, result = panels.panels(both)
    assert (colour.tone, colour.legend, colour.still) == ("straight", True, "")
    assert (result.tone, result.legend, result.still) == ("filmic", False, "still")
    ink, = panels.panels(scene(["result"]))
    assert (ink.tone, ink.still) == ("straight", "")
