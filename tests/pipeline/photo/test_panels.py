"""The panels of a figure of a photograph."""

from pathlib import Path

from tiny import PHOTO, changed, scene

from pipeline.photo.panels import panels, view_artifacts


def test_each_name_is_its_artifact(tmp_path: Path) -> None:
    found = panels(scene(tmp_path, PHOTO))
    assert [(p.label, p.artifact, p.legend) for p in found] == [
        ("target", "target-picture", False), ("matte", "mattes", False), ("motion", "motion-picture", True),
        ("result", "frames", False)]


def test_with_moments_the_still_has_one_result_for_each_and_one_matte_if_it_moves(tmp_path: Path) -> None:
    text = changed(PHOTO, "panel = 32", "panel = 32\nmoments = [1, 3]")
    frames = [("motion", 0, "both"), ("frame 1", 1, "still"), ("frame 3", 3, "still"), ("result", 0, "animation")]
    assert [(p.label, p.frame, p.shown_in) for p in panels(scene(tmp_path, text))] == [
        ("target", 0, "both"), ("matte", 0, "both"), *frames]
    moving = changed(text, "width = 96", "width = 96\ndynamics = 0.5")
    assert [(p.label, p.frame, p.shown_in) for p in panels(scene(tmp_path, moving))] == [
        ("target", 0, "both"), ("matte of frame 1", 1, "still"), ("matte of frame 3", 3, "still"),
        ("matte", 0, "animation"), *frames]


PIECES = changed(PHOTO, '["target", "matte", "motion", "result"]\npanel = 32',
                 '["target", "piece", "spectrum", "strokes", "average", "result"]\npanel = 32\n'
                 'pieces = [["cloud-01", 0.5, 0.5], ["cloud-01", 0.25, 0.5]]')


def test_panels_of_pieces_stand_in_turn_as_far_as_they_follow_each_other(tmp_path: Path) -> None:
    one = scene(tmp_path, PIECES)
    found = [panel.artifact for panel in panels(one)]
    assert found == ["target-picture", "piece-1-picture", "spectrum-1-picture", "piece-2-picture", "spectrum-2-picture",
                     "strokes-picture", "average-1-picture", "average-2-picture", "frames"]
    assert [artifact.name for artifact in view_artifacts(one)] == found[:-1]


def test_a_panel_that_stands_twice_is_made_once(tmp_path: Path) -> None:
    one = scene(tmp_path, changed(PHOTO, '"matte"', '"target"'))
    assert len(panels(one)) == 4
    assert [artifact.name for artifact in view_artifacts(one)] == ["target-picture", "motion-picture"]
