"""The panels of a figure of elements: labels, widths, tones and insets."""

from pathlib import Path

import pytest
from tiny import BEADS, FISH, NOODLES, PAPER, changed, scene

from pipeline.build.method import Panel
from pipeline.elements.panels import panels

ALL = '["exemplar", "coarse", "result"]'


def of(folder: Path, text: str, shown: str) -> tuple[Panel, ...]:
    return panels(scene(folder, changed(text, '["result"]', shown)))


def test_each_panel_has_its_label_its_width_and_its_tone(tmp_path: Path) -> None:
    assert of(tmp_path, BEADS, ALL) == (
        Panel("exemplar *I*", "exemplar-picture", 16, "filmic"),
        Panel("coarse motion *L*", "coarse-picture", 32, "straight"),
        Panel("result", "beauty", 32, "filmic"))


@pytest.mark.parametrize("text", [NOODLES, PAPER])
def test_the_coarse_motion_of_threads_and_sheets_is_a_picture_in_light(tmp_path: Path, text: str) -> None:
    assert of(tmp_path, text, '["coarse"]') == (Panel("coarse motion *C*", "coarse-picture", 32, "filmic"),)


def test_panels_stand_in_the_order_of_the_scene(tmp_path: Path) -> None:
    assert [panel.artifact for panel in of(tmp_path, FISH, '["result", "exemplar"]')] == ["beauty", "exemplar-picture"]


def test_the_inset_is_the_exemplar_in_the_result_alone(tmp_path: Path) -> None:
    assert [panel.inset for panel in of(tmp_path, BEADS, f"{ALL}\ninset = true")] == ["", "", "exemplar-picture"]
    assert [panel.inset for panel in of(tmp_path, BEADS, ALL)] == ["", "", ""]


def test_the_width_is_the_scenes(tmp_path: Path) -> None:
    wide = changed(BEADS, "panel = 32", "panel = 301")
    assert [panel.width for panel in of(tmp_path, wide, ALL)] == [150, 301, 301]
