"""The tables of the synthesis: defaults that depend on the dimension, and what a scene says of its cells."""

import tomllib
from typing import Any

import pytest
import tiny
from pydantic import ValidationError

from pipeline.motion.scene import Scene
from pipeline.motion.tables import Combine, Density, Detail, Direction, Source
from pipeline.tables import PROJECT_SCENES


def scene(**tables: Any) -> Scene:
    """The tiny scene with these tables."""
    return Scene.model_validate({**tomllib.loads(tiny.SMOKE), **tables}, context={"folder": PROJECT_SCENES})


@pytest.mark.parametrize(("size", "neighborhoods", "search"), [
    ((32, 32), (17, 9), "exact"), ((32, 32, 32), (9,), "k-coherence")])
def test_the_detail_has_the_papers_settings_of_its_dimension(
        size: tuple[int, ...], neighborhoods: tuple[int, ...], search: str) -> None:
    detail = Detail(size=size)
    assert (detail.neighborhoods, detail.search) == (neighborhoods, search)
    own = Detail(size=size, neighborhoods=[5], search="exact")
    assert (own.neighborhoods, own.search) == ((5,), "exact")


def test_without_a_size_the_detail_is_a_plane() -> None:
    assert (Detail().size, Detail().neighborhoods, Detail().search) == ((256, 256), (17, 9), "exact")


@pytest.mark.parametrize(("table", "values"), [
    (Detail, {"neighborhoods": [4]}), (Detail, {"neighborhoods": []}), (Detail, {"size": [16]}),
    (Detail, {"size": [3, 16]}), (Detail, {"levels": 0}), (Detail, {"levels": "all"}), (Combine, {"omega": -1.0}),
    (Combine, {}), (Density, {"sources": []}), (Source, {"radius": 0.0}), (Source, {"centre": [0.0]}),
    (Direction, {"at": [0.0, 0.0], "vector": [0.0, 0.0, 1.0]}), (Density, {"depth": {"reach": 0.6}})])
def test_what_is_out_of_range_is_refused(table: Any, values: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        table(**values)


def test_a_radius_is_one_number_or_one_for_each_axis() -> None:
    assert [Source(radius=radius).radius for radius in (0.1, [0.1], [0.1, 0.2])] == [(0.1,), (0.1,), (0.1, 0.2)]


def test_a_scene_knows_its_cells() -> None:
    plane, space = scene(), scene(coarse={"kind": "analytic", "size": [8, 4, 6]}, detail={"size": [16, 8, 12]},
                                  render={"kind": "volume"})
    assert (plane.cells, plane.shape, plane.dimension) == ((16, 16), (16, 16), 2)
    assert (space.cells, space.shape, space.dimension) == ((16, 8, 12), (12, 8, 16), 3)
    assert plane.cells_key == "detail.size" and plane.flows and plane.border == "open"
    assert scene(coarse={"kind": "smoke", "size": [8, 8]}).border == "wall"
