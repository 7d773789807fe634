"""The panels of a figure of a photograph."""

from pathlib import Path

from tiny import PHOTO, changed, scene

from pipeline.photo.panels import panels


def test_each_name_is_its_artifact(tmp_path: Path) -> None:
    found = panels(scene(tmp_path, PHOTO))
    assert [(p.label, p.artifact, p.legend) for p in found] == [
        ("target", "target", False), ("matte", "mattes", False), ("motion", "motion", True),
        ("result", "frames", False)]


def test_with_moments_the_still_has_one_result_and_one_matte_for_each(tmp_path: Path) -> None:
    found = panels(scene(tmp_path, changed(PHOTO, "panel = 32", "panel = 32\nmoments = [1, 3]")))
    assert [(p.label, p.frame, p.shown_in) for p in found] == [
        ("target", 0, "both"), ("matte of frame 1", 1, "still"), ("matte of frame 3", 3, "still"),
        ("matte", 0, "animation"), ("motion", 0, "both"),
        ("frame 1", 1, "still"), ("frame 3", 3, "still"), ("result", 0, "animation")]
