"""What render makes for the figure: which pictures, of which fields, as light."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline import panels
from pipeline.files import pictures
from pipeline.schema import PROJECT_SCENES, Panel, Scene
from render import arrows, lic, tonemap
from synth.field import Field
from synth.motion.exemplar import exemplar


def scene(shown: list[str], **tables: Any) -> Scene:
    """A small scene whose figure shows these panels."""
    raw: dict[str, Any] = {
        "title": "small", "exemplar": {"kind": "circle", "size": 8}, "coarse": {"kind": "analytic", "size": [8, 8]},
        "detail": {"size": [16, 16]}, "combine": {"omega": 2.0}, "render": {"kind": "ink", "width": 24},
        "figure": {"panels": shown, "panel": 32}}
    return Scene.model_validate({**raw, **tables}, context={"folder": PROJECT_SCENES})


class Fields:
    """One frame of every product."""

    work = Path()

    def __init__(self) -> None:
        values = np.random.default_rng(2).random((16, 16, 2)) - 0.5
        self.files = {"exemplar": Field.centred(exemplar("circle", 8), 2), "L": Field.centred(values[:8, :8], 2),
                      "H": Field.centred(values, 2), "F": Field.centred(values[::-1], 2),
                      "density": Field.centred(np.abs(values[..., 0]), 2)}

    def read(self, product: str, frame: int = 0) -> Field:
        return self.files[product]

    def own(self, frame: int) -> Any | None:
        return None

    def key(self, frame: int) -> str:
        return ""


class Solid(Fields):
    """The same in space: 8 layers of 12 rows and 16 columns."""

    def __init__(self) -> None:
        values = np.random.default_rng(2).random((8, 12, 16, 3)) - 0.5
        self.files = {"exemplar": Field.centred(exemplar("circle", 8), 2), "L": Field.centred(values[::2, ::2, ::2], 3),
                      "exemplar-top": Field.centred(exemplar("square", 8), 2),
                      "exemplar-side": Field.centred(exemplar("stripes", 8), 2),
                      "H": Field.centred(values, 3), "F": Field.centred(values[::-1], 3),
                      "density": Field.centred(np.abs(values[..., 0]), 3)}


SPACE: dict[str, Any] = {
    "coarse": {"kind": "analytic", "size": [8, 6, 4]}, "detail": {"size": [16, 12, 8]},
    "render": {"kind": "volume", "width": 24, "height": 24, "spp": 1, "denoised": False}}
VIEWS = [{"plane": "top", "exemplar": {"kind": "square", "size": 8}},
         {"plane": "side", "exemplar": {"kind": "stripes", "size": 8}}]


def picture(panel: str, stock: Fields | None = None, **tables: Any) -> np.ndarray:
    """The light of a panel."""
    made = scene([panel], **tables)
    product = next(p for p in panels.products(made) if p.name == panels.shown(made)[0].picture)
    (_, light), = product.make(made, stock or Fields(), product.frames(made)[:1])
    return light


def test_a_display_value_comes_back_from_its_light() -> None:
    shown = np.linspace(0, 1, 300, dtype=np.float32).reshape(10, 10, 3)
    np.testing.assert_allclose(tonemap.to_display(tonemap.from_srgb(shown), "straight"), shown, atol=1e-6)


@pytest.mark.parametrize("panel", Panel.__args__)
def test_every_panel_there_is_has_its_picture(panel: str) -> None:
    light = picture(panel)
    assert light.shape == ((24, 24, 3) if panel == "result" else (32, 32, 3))
    assert np.isfinite(light).all()
    assert np.ptp(light) > 0.05


@pytest.mark.parametrize("panel", Panel.__args__)
@pytest.mark.parametrize("plane", ["front", "side", "top"])
def test_every_panel_has_its_picture_in_space(panel: str, plane: str) -> None:
    shape = {"front": (24, 32, 3), "side": (48, 32, 3), "top": (16, 32, 3)}[plane]
    light = picture(panel, Solid(), **SPACE, figure={"panels": [panel], "panel": 32, "plane": plane})
    assert light.shape == ((24, 24, 3) if panel == "result" else (32, 32, 3) if panel[:2] in ("ex", "in") else shape)
    assert np.isfinite(light).all()
    assert np.ptp(light) > 0.05


def test_in_space_the_middle_slice_is_shown() -> None:
    combined = Solid().read("F").values
    np.testing.assert_allclose(picture("combined", Solid(), **SPACE), tonemap.from_srgb(lic.picture(
        combined[4][..., :2], 32, 1)))
    seen = picture("combined-colour", Solid(), **SPACE, figure={"panels": ["combined-colour"], "panel": 32,
                                                                "plane": "top"})
    np.testing.assert_allclose(seen, tonemap.from_srgb(lic.colour(combined[:, 6][..., [0, 2]], 32)))


def test_each_exemplar_of_the_views_has_a_panel() -> None:
    made = scene(["exemplar", "input", "coarse"], **SPACE, views=VIEWS)
    assert [panel.picture for panel in panels.shown(made)] == [
        "exemplar-top-lines", "exemplar-side-lines", "input-top", "input-side", "coarse-lines"]
    products = {p.name: p for p in panels.products(made)}
    (_, light), = products["exemplar-side-lines"].make(made, Solid(), [0])
    np.testing.assert_allclose(light, tonemap.from_srgb(lic.picture(exemplar("stripes", 8), 32, 1)))
    (_, light), = products["input-top"].make(made, Solid(), [0])
    np.testing.assert_allclose(light, tonemap.from_srgb(lic.colour(exemplar("square", 8), 32)))


def test_only_what_is_shown_is_made_and_the_smoke() -> None:
    assert [p.name for p in panels.products(scene(["coarse", "coarse"]))] == ["beauty", "coarse-lines"]
    assert [p.name for p in panels.products(scene(["coarse"], render={"kind": "none"}))] == ["coarse-lines"]


def test_a_field_is_shown_as_the_renderer_draws_it() -> None:
    combined = Fields().read("F").values
    np.testing.assert_allclose(picture("combined"), tonemap.from_srgb(lic.picture(combined, 32, 1)))
    np.testing.assert_allclose(picture("combined-colour"), tonemap.from_srgb(lic.colour(combined, 32)))


def test_the_input_is_the_bitmap_itself_or_the_colours_of_a_procedure(tmp_path: Path) -> None:
    np.testing.assert_allclose(picture("input"), tonemap.from_srgb(lic.colour(exemplar("circle", 8), 32)))
    shown = tonemap.to_display(picture("input", exemplar={"kind": "bitmap", "file": "assets/lightning.png", "size": 16}),
                           "straight")
    bitmap = pictures.read(PROJECT_SCENES / "assets" / "lightning.png")
    assert abs(shown.mean() - bitmap.mean()) < 0.02
    assert shown[:16].mean() > 0.02  # the right way up: the bolt comes from above


def test_arrows_of_the_detail_are_red_where_right_and_green_where_not_transformed() -> None:
    plain, drawn = (picture(p, figure={"panels": [p], "panel": 192}) for p in ("detail", "detail-arrows"))
    touched = np.abs(plain - drawn).max(-1) > 0.2
    for colour in (arrows.RED, arrows.GREEN):
        near = np.abs(drawn - tonemap.from_srgb(np.array(colour))).max(-1) < 0.05
        assert (near & touched).sum() > 10


def test_the_method_of_a_volume_is_the_scenes_and_a_still_may_have_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    from render import smoke

    def drawn(density: np.ndarray, voxel: float, origin: Any, settings: smoke.VolumeSettings) -> np.ndarray:
        return np.full((2, 2, 3), {"path": 1.0, "march": 2.0}[settings.method])

    monkeypatch.setattr(smoke, "volume", drawn)

    def methods(method: str, **figure: Any) -> dict[str, tuple[float, list[int]]]:
        made = scene(["result"], **{**SPACE, "render": {**SPACE["render"], "method": method}}, frames=3,
                     figure={"panels": ["result"], "frame": 2, **figure})
        shown = {}
        for product in panels.products(made):
            (_, light), = product.make(made, Solid(), [2])
            shown[product.name] = (light[0, 0, 0], product.frames(made))
        return shown

    assert methods("path") == {"beauty": (1.0, [1, 2, 3])}
    assert methods("march") == {"beauty": (2.0, [1, 2, 3])}
    assert methods("both") == {"beauty": (2.0, [1, 2, 3]), "still": (1.0, [2])}
    assert methods("both", animation=False) == {"beauty": (1.0, [2])}
