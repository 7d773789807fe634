"""The tables of a synthesis of elements: their limits, and what they are where nothing is said."""

from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError
from tiny import BEADS, FISH, changed, complaint, scene, written

from pipeline.elements.tables import MOST, Control, Elements, Figure, Pin, Selection, Synthesis
from pipeline.tables import Table


@pytest.mark.parametrize(("table", "name", "lowest", "highest", "beyond"), [
    (Elements, "spacing", 1e-6, 1.0, (0.0, 1.001)),
    (Elements, "radius", 1e-6, 10.0, (0.0, 10.1)),
    (Elements, "count", 0, MOST, (-1, MOST + 1)),
    (Elements, "size", [4, 4], [4096, 4096, 4096], ([3, 4], [4, 4097], [4], [4, 4, 4, 4])),
    (Synthesis, "neighborhood", 1.0, 10.0, (0.99, 10.1)),
    (Synthesis, "before", 0, 60, (-1, 61)),
    (Synthesis, "after", 0, 60, (-1, 61)),
    (Synthesis, "sigma_p", 0.0, 1000.0, (-0.1, 1000.1)),
    (Synthesis, "matches", 1, 4, (0, 5)),
    (Synthesis, "iterations", 1, 200, (0, 201)),
    (Synthesis, "hold", 0.0, 100.0, (-0.1, 100.1)),
    (Figure, "panel", 16, 4096, (15, 4097)),
    (Figure, "panels", ["result"], ["exemplar", "coarse", "result"], ([], ["input"])),
])
def test_the_limits_of_numbers(table: type[Table], name: str, lowest: Any, highest: Any,
                               beyond: tuple[Any, ...]) -> None:
    for value in (lowest, highest):
        found = getattr(table.model_validate({name: value}), name)
        assert found == (tuple(value) if isinstance(value, list) else value)
    for value in beyond:
        with pytest.raises(ValidationError, match=name):
            table.model_validate({name: value})


@pytest.mark.parametrize(("table", "raw", "beyond"), [
    (Pin, {"at": [0.0, 0.5]}, {"at": [0.0]}),
    (Pin, {"at": [0.0, 0.5, -100.0], "frame": 100000}, {"at": [0.0, 0.5, 0.0, 0.0]}),
    (Pin, {"at": [100.0, 0.5]}, {"at": [100.1, 0.5]}),
    (Pin, {"at": [0.0, 0.5], "frame": 1}, {"at": [0.0, 0.5], "frame": 0}),
    (Selection, {"kinds": [0, 30], "file": "a.png"}, {"kinds": [31], "file": "a.png"}),
    (Selection, {"kinds": [0], "file": "a.png"}, {"kinds": [-1], "file": "a.png"}),
    (Selection, {"kinds": [0], "file": "a.png"}, {"kinds": [], "file": "a.png"}),
    (Control, {"file": "a.png", "weight": 1000.0}, {"file": "a.png", "weight": 1000.1}),
    (Control, {"file": "a.png", "property": "kind"}, {"file": "a.png", "property": "colour"}),
    (Control, {"file": "a.png"}, {"file": "b.png"}),
])
def test_the_limits_of_places_selections_and_maps(tmp_path: Path, table: type[Table], raw: dict[str, Any],
                                                  beyond: dict[str, Any]) -> None:
    (tmp_path / "a.png").touch()
    table.model_validate(raw, context={"folder": tmp_path})
    with pytest.raises(ValidationError):
        table.model_validate(beyond, context={"folder": tmp_path})


@pytest.mark.parametrize(("name", "most"), [("pins", 1000), ("selections", 16)])
def test_the_limits_of_arrays_of_tables(tmp_path: Path, name: str, most: int) -> None:
    (tmp_path / "a.png").touch()
    one = {"pins": {"at": [0.0, 0.5]}, "selections": {"kinds": [0], "file": "a.png"}}[name]
    context = {"folder": tmp_path}
    assert len(getattr(Elements.model_validate({name: [one] * most}, context=context), name)) == most
    with pytest.raises(ValidationError, match=f"at most {most}"):
        Elements.model_validate({name: [one] * (most + 1)}, context=context)


def test_a_scene_that_says_nothing_has_what_the_paper_has() -> None:
    assert Synthesis().model_dump() == {
        "neighborhood": 2.0, "before": 0, "after": 0, "whole": False, "sigma_p": 0.0, "matches": 2, "iterations": 8,
        "sequence": "together", "search": "k-coherence", "assignment": "sparse", "hybrid": False, "hold": 0.3}
    assert Elements().size == (256, 256) and Elements().count == 0
    assert Figure().panels == ("exemplar", "result")


def test_a_scene_lives_on_the_cells_of_its_elements(tmp_path: Path) -> None:
    plane, space = scene(tmp_path, BEADS), scene(tmp_path, changed(FISH, "[16, 16, 16]", "[24, 16, 8]"))
    assert (plane.cells, plane.shape, plane.dimension, plane.cells_key) == ((32, 32), (32, 32), 2, "elements.size")
    assert (space.cells, space.shape, space.dimension) == ((24, 16, 8), (8, 16, 24), 3)


@pytest.mark.parametrize(("old", "new", "expected"), [
    ("spacing = 0.12", "spacing = 1.2", "elements.spacing: should be less than or equal to 1, not 1.2"),
    ("iterations = 2", "iterations = 201", "synthesis.iterations: should be less than or equal to 200, not 201"),
    ("panel = 32", "panel = 15", "figure.panel: should be greater than or equal to 16, not 15"),
    ("spacing = 0.12", "count = 100001", "elements.count: should be less than or equal to 100000, not 100001"),
])
def test_a_number_beyond_is_told_with_its_limit(tmp_path: Path, old: str, new: str, expected: str) -> None:
    assert complaint(written(tmp_path, changed(BEADS, old, new))) == expected
