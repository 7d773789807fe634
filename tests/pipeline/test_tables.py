"""What every scene is written in: tables, the types of their values, and the tables that all scenes have."""

from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError
from tiny import BEADS, FISH, SMOKE, changed, scene

from pipeline.flow import ShapeObstacle
from pipeline.tables import (
    LARGEST,
    PROJECT_SCENES,
    PROOF_SAMPLES,
    PROOF_WIDTH,
    Asset,
    AssetOrFolder,
    FigureTable,
    Grid,
    SceneTables,
    Share,
    Table,
    Vector,
    Width,
    grid,
    key,
    listed,
)


class Every(Table):
    """A key of each type."""

    number: float = key("a number", 1.0, "heights", ge=0, le=2)
    count: int = key("an integer", 1)
    size: Grid = grid("of it", (8, 8))
    width: Width = 9
    share: Share = 0.5
    vector: Vector = (0.0,)
    file: Asset | None = None
    files: AssetOrFolder | None = None


class Following(Table):
    """A key whose default follows from the one before it."""

    count: int = key("an integer", 1)
    later: int = key("twice the count", lambda table: 2 * table["count"])


@pytest.mark.parametrize(("name", "value", "expected"), [
    ("number", 2, 2.0), ("number", 0.0, 0.0), ("count", -7, -7), ("size", [4, LARGEST], (4, LARGEST)),
    ("size", [4, 5, 6], (4, 5, 6)), ("width", 3, 3), ("width", 33, 33), ("share", 1.0, 1.0), ("share", 1e-9, 1e-9),
    ("vector", [-1000.0, 1000.0, 0.5], (-1000.0, 1000.0, 0.5)),
])
def test_values_of_each_type(name: str, value: Any, expected: Any) -> None:
    assert getattr(Every.model_validate({name: value}), name) == expected


@pytest.mark.parametrize(("name", "value"), [
    ("number", 2.1), ("number", -0.1), ("number", "1"), ("number", True), ("number", float("nan")),
    ("number", float("inf")), ("count", 1.0), ("count", "1"), ("count", True), ("size", [8]), ("size", 8),
    ("size", [3, 8]), ("size", [8, LARGEST + 1]), ("size", [8, 8.0]), ("size", [8, 8, 8, 8]), ("width", 4),
    ("width", 1), ("width", 35), ("share", 0.0), ("share", 1.1), ("vector", [1000.1]), ("vector", [float("nan")]),
    ("numbr", 1.0), ("file", 3),
])
def test_what_is_not_of_its_type_or_beyond_its_range_is_refused(name: str, value: Any) -> None:
    with pytest.raises(ValidationError) as caught:
        Every.model_validate({name: value})
    assert {fault["loc"][0] for fault in caught.value.errors()} == {name}


def test_a_table_does_not_change() -> None:
    with pytest.raises(ValidationError):
        Every().number = 2.0


def test_a_key_says_what_it_is_and_a_default_may_follow_from_the_keys_before_it() -> None:
    field = Every.model_fields["number"]
    assert (field.description, field.json_schema_extra) == ("a number", {"unit": "heights"})
    assert Every.model_fields["size"].json_schema_extra == {"unit": "cells"}
    assert Following().later == 2 and Following(count=5).later == 10 and Following(count=5, later=1).later == 1


def test_one_number_stands_for_an_array() -> None:
    raw = {"kind": "box", "centre": [0.0, 0.5]}
    assert ShapeObstacle.model_validate({**raw, "radius": 0.2}).radius == (0.2,)
    assert ShapeObstacle.model_validate({**raw, "radius": [0.2, 0.3]}).radius == (0.2, 0.3)
    for wrong in (0.0, 10.1, [0.0], "0.2", []):
        with pytest.raises(ValidationError, match="radius"):
            ShapeObstacle.model_validate({**raw, "radius": wrong})


def test_a_file_is_one_in_the_scenes_folder_or_the_projects_assets(tmp_path: Path) -> None:
    (tmp_path / "dots").mkdir()
    (tmp_path / "dots" / "a.png").touch()
    context = {"folder": tmp_path}
    assert Every.model_validate({"file": "dots/a.png"}, context=context).file == tmp_path / "dots" / "a.png"
    assert Every.model_validate({"files": "dots/a.png"}, context=context).files == tmp_path / "dots" / "a.png"
    assert Every.model_validate({"files": "dots"}, context=context).files == tmp_path / "dots"
    asset = next(file for file in sorted((PROJECT_SCENES / "assets").iterdir()) if file.is_file())
    assert Every.model_validate({"file": f"assets/{asset.name}"}, context=context).file == asset
    for raw in ({"file": "dots"}, {"file": "b.png"}, {"files": "b"}, {"file": "../a.png"}, {"file": str(asset)},
                {"file": "README.md"}):
        with pytest.raises(ValidationError):
            Every.model_validate(raw, context=context)


@pytest.mark.parametrize(("table", "name", "inside", "outside"), [
    (SceneTables, "title", ["a", "a" * 200], ["", "a" * 201]),
    (SceneTables, "source", ["", "a" * 200], ["a" * 201]),
    (SceneTables, "seed", [0, 2**31 - 1], [-1, 2**31]),
    (SceneTables, "frames", [1, 100000], [0, 100001]),
    (SceneTables, "fps", [0.5, 1000.0], [0.0, 1000.1]),
    (FigureTable, "columns", [0, 64], [-1, 65]),
    (FigureTable, "panel", [16, LARGEST], [15, LARGEST + 1]),
    (FigureTable, "frame", [0, 100000], [-1, 100001]),
])
def test_the_limits_of_what_all_scenes_have(table: type[Table], name: str, inside: list[Any],
                                            outside: list[Any]) -> None:
    needed = {"title": "a"} if table is SceneTables else {}
    for value in inside:
        assert getattr(table.model_validate({**needed, name: value}), name) == value
    for value in outside:
        with pytest.raises(ValidationError, match=name):
            table.model_validate({**needed, name: value})


def test_cells_are_x_first_and_arrays_x_last(tmp_path: Path) -> None:
    plane = scene(tmp_path, SMOKE)
    assert (plane.cells, plane.shape, plane.dimension, plane.cells_key) == ((16, 16), (16, 16), 2, "detail.size")
    space = scene(tmp_path, changed(FISH, "[16, 16, 16]", "[24, 16, 8]"))
    assert (space.cells, space.shape, space.dimension) == ((24, 16, 8), (8, 16, 24), 3)
    assert listed(space.cells) == "24×16×8"


def test_a_proof_is_the_same_look_small_and_with_few_paths(tmp_path: Path) -> None:
    fish = scene(tmp_path, changed(FISH, "width = 32\nheight = 24\nspp = 1", "width = 960\nheight = 540")).render
    small = fish.proof()
    assert (small.width, small.height, small.spp) == (PROOF_WIDTH, 54, PROOF_SAMPLES)
    assert type(small) is type(fish) and small.speed == fish.speed
    assert scene(tmp_path, FISH).render.proof().width == 32, "none is enlarged"


def test_a_look_tells_what_renders_it(tmp_path: Path) -> None:
    assert set(scene(tmp_path, SMOKE).render.made_with()) == {"numpy", "scipy"}
    assert "mitsuba" in scene(tmp_path, BEADS).render.made_with()
