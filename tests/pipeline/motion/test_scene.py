"""What does not fit together in a scene of motion fields: each fault, its key and its reason, by the check alone."""

import tomllib
from typing import Any

import pytest
import tiny

from pipeline.build.method import Faults
from pipeline.motion import scene as checks
from pipeline.motion.scene import Scene
from pipeline.tables import PROJECT_SCENES

SPACE: dict[str, Any] = {"coarse": {"kind": "analytic", "size": [8, 8, 8]}, "detail": {"size": [16, 16, 16]},
                         "render": {"kind": "volume"}}
DEEP = {"density": {"depth": {"reach": 0.2}}}


def scene(**tables: Any) -> Scene:
    """The tiny scene with these tables."""
    return Scene.model_validate({**tomllib.loads(tiny.SMOKE), **tables}, context={"folder": PROJECT_SCENES})


def spelled(faults: Faults) -> list[str]:
    """The faults, as they are told."""
    return [f"{key}: {reason}" for key, reason in faults]


@pytest.mark.parametrize(("tables", "fault"), [
    ({"render": {"kind": "lit"}}, None), ({"render": {"kind": "ink"}}, None), ({"render": {"kind": "particles"}}, None),
    ({"render": {"kind": "volume"}, **DEEP}, None), (SPACE, None), (SPACE | {"render": {"kind": "seaweed"}}, None),
    (SPACE | {"render": {"kind": "lit"}}, 'render.kind: "lit" renders 2-D fields only; detail.size is 16×16×16'),
    (SPACE | {"render": {"kind": "ink"}}, 'render.kind: "ink" renders 2-D fields only; detail.size is 16×16×16'),
    (SPACE | {"render": {"kind": "particles"}},
     'render.kind: "particles" renders 2-D fields only; detail.size is 16×16×16'),
    ({"render": {"kind": "volume"}}, 'render.kind: "volume" needs a [density.depth]'),
    ({"render": {"kind": "lit"}, **DEEP}, 'render.kind: "lit" draws no volume, but density.depth is'),
    ({"render": {"kind": "ink"}, **DEEP}, 'render.kind: "ink" draws no volume, but density.depth is'),
    ({"render": {"kind": "seaweed"}}, 'render.kind: "seaweed" needs a field in space; detail.size is 16×16'),
])
def test_a_look_draws_fields_of_its_dimension(tables: dict[str, Any], fault: str | None) -> None:
    assert spelled(checks.render_fits(scene(**tables)))[:1] == ([fault] if fault else [])


def test_fields_alone_have_no_result() -> None:
    shown = {"panels": ["coarse", "result"]}
    assert spelled(checks.render_fits(scene(render={"kind": "none"}, figure=shown))) == [
        'figure.panels: there is no "result" with render.kind = "none"']
    assert not spelled(checks.render_fits(scene(render={"kind": "none"}, figure={"panels": ["coarse"]})))


TOP, SIDE = {"plane": "top"}, {"plane": "side"}
SIDEWAYS = {"right": [1.0, 0.0, 0.0], "up": [0.0, 0.0, 1.0]}


def square(size: int) -> dict[str, Any]:
    """An exemplar of its own for a view."""
    return {"exemplar": {"kind": "square", "size": size}}


@pytest.mark.parametrize(("views", "faults"), [
    ([], []), ([TOP, SIDE], []), ([SIDEWAYS, SIDE], []), ([TOP | square(16), SIDE], []),
    ([TOP], ["views: do not span space: none of them shows y of the local frame"]),
    ([SIDEWAYS, TOP], ["views: do not span space: none of them shows y of the local frame"]),
    ([TOP, {}], ["views[1]: needs a plane, or both right and up"]),
    ([TOP, {"up": [0.0, 1.0, 0.0]}], ["views[1]: needs a plane, or both right and up"]),
    ([TOP | {"right": [1.0, 0.0, 0.0]}, SIDE], ["views[0].plane: says what right and up say too: leave one out"]),
    ([TOP, {"right": [1.0, 0.0, 0.0], "up": [2.0, 0.0, 0.0]}, SIDE],
     ["views[1].up: is parallel to right, or one of them is zero: they span no plane"]),
    ([TOP | square(24), SIDE], ["views[0].exemplar.size: an exemplar of 24² is larger than the output (16×16×16) along "
                                "an axis of its view"]),
])
def test_views_span_space_and_fit_the_output(views: list[dict[str, Any]], faults: list[str]) -> None:
    assert spelled(checks.views_fit(scene(**SPACE, views=views))) == faults


def test_the_exemplars_of_the_views_are_of_one_scale() -> None:
    large = SPACE | {"detail": {"size": [48, 48, 48]}}
    for size, faults in ((32, []), (40, ["views[0].exemplar.size: an exemplar of 40² beside one of 8²: at most 4 times "
                                         "as large"])):
        assert spelled(checks.views_fit(scene(**large, views=[TOP | square(size), SIDE]))) == faults


@pytest.mark.parametrize(("levels", "faults"), [
    ("auto", []), (2, []), (3, ["detail.levels: 3 levels bring an exemplar of 8² below 4 cells"])])
def test_the_levels_leave_something_of_the_exemplars(levels: Any, faults: list[str]) -> None:
    plane = scene(detail={"size": [16, 16], "levels": levels})
    space = scene(**SPACE | {"detail": {"size": [16, 16, 16], "levels": levels}})
    assert spelled(checks.exemplar_fits(plane)) == spelled(checks.views_fit(space)) == faults
    assert not spelled(checks.views_fit(plane)) + spelled(checks.exemplar_fits(space))  # each its own dimension


def test_an_exemplar_of_the_plane_is_no_larger_than_the_output() -> None:
    large = scene(exemplar={"kind": "circle", "size": 24})
    assert spelled(checks.exemplar_fits(large)) == [
        "exemplar.size: an exemplar of 24² is larger than the output (16×16)"]


STONE = [{"kind": "ball", "centre": [0.0, 0.5], "radius": 0.2}]


@pytest.mark.parametrize(("samples", "boundary", "obstacles", "refused"), [
    ("lagrangian", True, STONE, True), ("lagrangian", False, STONE, False), ("lagrangian", True, [], False),
    ("grid", True, STONE, False)])
def test_samples_that_move_do_not_observe_a_boundary(samples: str, boundary: bool, obstacles: list[dict[str, Any]],
                                                     refused: bool) -> None:
    moving = scene(detail={"size": [16, 16], "samples": samples, "boundary": boundary}, obstacles=obstacles)
    assert spelled(checks.samples_fit(moving)) == (
        ["detail.samples: samples that move do not observe a boundary: say boundary = false"] if refused else [])


@pytest.mark.parametrize(("tables", "key"), [
    ({"views": [TOP]}, "views"), ({"figure": {"plane": "top"}}, "figure.plane"),
    ({"detail": {"size": [16, 16], "facing": "density"}}, "detail.facing"),
    ({"density": {"sources": [{"centre": [0.0, 0.1, 0.0]}]}}, "density.sources[0].centre"),
    (SPACE | DEEP, "density.depth"),
    (SPACE | {"detail": {"size": [16, 16, 16], "synthesize": "potential"}}, "detail.synthesize"),
    (SPACE | {"detail": {"size": [16, 16, 16], "samples": "lagrangian", "search": "exact"}}, "detail.samples"),
    (SPACE | {"detail": {"size": [16, 16, 16], "facing": "directions"}}, "detail.directions"),
])
def test_what_is_for_the_other_dimension_is_named(tables: dict[str, Any], key: str) -> None:
    assert [fault[0] for fault in checks.fits_its_dimension(scene(**tables))] == [key]


def test_each_view_is_seen_with_its_exemplar() -> None:
    plane = scene()
    assert plane.exemplars == {"exemplar": "exemplar"}
    space = scene(**SPACE, views=[TOP | square(8), SIDE])
    assert [view.exemplar.kind for view in space.seen] == ["square", "circle"]
    assert space.exemplars == {"exemplar-top": "views[0].exemplar", "exemplar-side": "exemplar"}
    assert space.seen_exemplars == ("exemplar-top", "exemplar-side")
    assert [view.plane for view in scene(**SPACE).seen] == ["front", "side", "top"]
