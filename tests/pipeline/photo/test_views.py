"""Pictures of the photograph, of what the user wants, and of the database."""

from pathlib import Path

import numpy as np
import pytest
import tiny
from tiny import PHOTO, changed

from pipeline.build.graph import BuildGraph
from pipeline.photo.target import read_strokes, read_target
from pipeline.photo.views import target_view
from render import arrows, tonemap

NAMES = '"target", "strokes", "orientation", "speed", "motion", "database"'
VIEWS = changed(changed(PHOTO, '"target", "matte", "motion", "result"', NAMES), "panel = 32", "panel = 192")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> BuildGraph:
    return tiny.made(tmp_path_factory.mktemp("photo"), VIEWS, "render")


def shown(graph: BuildGraph, name: str) -> np.ndarray:
    return np.asarray(tonemap.to_srgb(graph.read("", f"{name}-picture", 0)))


def test_the_target_is_the_photograph(made: BuildGraph) -> None:
    np.testing.assert_allclose(shown(made, "target")[::-1], read_target(made.variants[""]).picture, atol=2e-3)


def test_strokes_are_on_it_where_they_were_drawn(made: BuildGraph) -> None:
    orange = np.abs(shown(made, "strokes") - arrows.ORANGE).max(axis=2) < 0.06
    rows, columns = np.nonzero(orange)
    assert len(rows) > 20
    tips = [(stroke[-1] + 0.5) * 2 for stroke in read_strokes(made.variants[""])]
    height = len(orange)
    for x, y in tips:
        assert np.hypot(columns - x, height - rows - y).min() < 4


def test_the_speed_map_is_grey_and_black_outside_the_fluid(made: BuildGraph) -> None:
    speed = shown(made, "speed")
    np.testing.assert_array_equal(speed[..., 0], speed[..., 2])
    motion = made.read("", "assignment", 0)["motion"][::-1]
    np.testing.assert_allclose(speed[..., 0], np.minimum(np.hypot(*np.moveaxis(motion, -1, 0)) / 4, 1), atol=0.01)


def test_the_orientation_map_is_pale_outside_the_fluid(made: BuildGraph) -> None:
    picture, fluid = shown(made, "orientation"), read_target(made.variants[""]).fluid[::-1].repeat(2, 0).repeat(2, 1)
    assert np.ptp(picture[fluid > 0.9], axis=-1).mean() > 0.1  # colours
    assert picture[fluid == 0].mean() > 0.8


def test_the_database_has_the_clips_of_the_scene(made: BuildGraph) -> None:
    first = made.read("", "clip-cloud-01", 0)["luma"][0, ::-1].astype(float)
    page = shown(made, "database")[..., 0] * 255
    assert page.shape[1] == 192
    small = page.reshape(64, -1, 64, 3).mean(axis=(1, 3)) if page.shape[0] % 64 == 0 else page[:64, :64]
    assert np.corrcoef(small.ravel(), first.ravel())[0, 1] > 0.95


def test_labels_say_what_is_shown(tmp_path: Path) -> None:
    one = tiny.scene(tmp_path, VIEWS)
    assert target_view(one, "speed").label == "speed map, white: 4 pixels per frame"
    assert target_view(one, "database").label == "database, 1 clip"
    assert target_view(one, "orientation").legend and not target_view(one, "target").legend
    with pytest.raises(ValueError, match="no view 'piece'"):
        target_view(one, "piece")
