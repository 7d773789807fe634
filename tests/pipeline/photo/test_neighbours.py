"""Panels of two neighbours: the two nearest to the place, and the pictures that are made of them."""

from pathlib import Path
from typing import get_args

import numpy as np
import pytest
import tiny
from tiny import PHOTO, changed

from pipeline.build.graph import BuildGraph
from pipeline.photo.neighbours import neighbour_artifacts
from pipeline.photo.panels import panels
from pipeline.photo.tables import OfPair
from render import tonemap

NAMES = ", ".join(f'"{name}"' for name in get_args(OfPair))
PAIR = changed(PHOTO, '["target", "matte", "motion", "result"]\npanel = 32',
               f"[{NAMES}]\npanel = 96\nanimation = false\nplace = [0.45, 0.75]")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> BuildGraph:
    return tiny.made(tmp_path_factory.mktemp("photo"), PAIR, "render")


def test_the_neighbours_are_beside_each_other_and_near_the_place(made: BuildGraph) -> None:
    left, right = made.read("", "neighbours", 0)["corner"]
    np.testing.assert_array_equal(right - left, [0, 8])
    middle = (left + right) / 2 + 8
    assert np.hypot(*(middle - [0.25 * 64, 0.45 * 96])) < 12


def test_every_panel_has_its_picture(made: BuildGraph) -> None:
    found = panels(made.variants[""])
    assert len(found) == len(get_args(OfPair)) + 2
    for panel in found:
        assert made.read("", panel.artifact, 0).shape[:2] == (64, panel.width)


def test_blends_are_shown_about_mid_grey(made: BuildGraph) -> None:
    stored = made.read("", "neighbours", 0)
    for name in ("shares", "roots"):
        shown = tonemap.to_srgb(made.read("", f"{name}-picture", 0))[::-1, :, 0]
        small = shown.reshape(16, 4, 24, 4).mean(axis=(1, 3))
        np.testing.assert_allclose((small - 0.5) * 220, stored[name], atol=6)


def test_a_figure_without_such_panels_needs_none(tmp_path: Path) -> None:
    assert neighbour_artifacts(tiny.scene(tmp_path, PHOTO)) == ()
