"""What render makes for the figure: which pictures, of which fields, as light."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline import panels
from pipeline.files import pictures
from pipeline.schema import PROJECT_SCENES, Panel, Scene
from render import arrows, film, lic
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


def picture(panel: str, **tables: Any) -> np.ndarray:
    """The light of a panel."""
    made = scene([panel], **tables)
    product = next(p for p in panels.products(made) if p.name == panels.picture_of(panel))
    (_, light), = product.make(made, Fields(), product.frames(made)[:1])
    return light


def test_a_display_value_comes_back_from_its_light() -> None:
    shown = np.linspace(0, 1, 300, dtype=np.float32).reshape(10, 10, 3)
    np.testing.assert_allclose(film.developed(film.decoded(shown), "straight"), shown, atol=1e-6)


@pytest.mark.parametrize("panel", Panel.__args__)
def test_every_panel_there_is_has_its_picture(panel: str) -> None:
    light = picture(panel)
    assert light.shape == ((24, 24, 3) if panel == "result" else (32, 32, 3))
    assert np.isfinite(light).all()
    assert np.ptp(light) > 0.05


def test_only_what_is_shown_is_made_and_the_smoke() -> None:
    assert [p.name for p in panels.products(scene(["coarse", "coarse"]))] == ["beauty", "coarse-lines"]
    assert [p.name for p in panels.products(scene(["coarse"], render={"kind": "none"}))] == ["coarse-lines"]


def test_a_field_is_shown_as_the_renderer_draws_it() -> None:
    combined = Fields().read("F").values
    np.testing.assert_allclose(picture("combined"), film.decoded(lic.picture(combined, 32, 1)))
    np.testing.assert_allclose(picture("combined-colour"), film.decoded(lic.colour(combined, 32)))


def test_the_input_is_the_bitmap_itself_or_the_colours_of_a_procedure(tmp_path: Path) -> None:
    np.testing.assert_allclose(picture("input"), film.decoded(lic.colour(exemplar("circle", 8), 32)))
    shown = film.developed(picture("input", exemplar={"kind": "bitmap", "file": "assets/lightning.png", "size": 16}),
                           "straight")
    bitmap = pictures.read(PROJECT_SCENES / "assets" / "lightning.png")
    assert abs(shown.mean() - bitmap.mean()) < 0.02
    assert shown[:16].mean() > 0.02  # the right way up: the bolt comes from above


def test_arrows_of_the_detail_are_red_where_right_and_green_where_not_transformed() -> None:
    plain, drawn = (picture(p, figure={"panels": [p], "panel": 192}) for p in ("detail", "detail-arrows"))
    touched = np.abs(plain - drawn).max(-1) > 0.2
    for colour in (arrows.RED, arrows.GREEN):
        near = np.abs(drawn - film.decoded(np.array(colour))).max(-1) < 0.05
        assert (near & touched).sum() > 10
