"""The tables of photographs: their keys reach the method."""

from pathlib import Path

from tiny import PHOTO, changed, scene


def test_keys_reach_the_assignment(tmp_path: Path) -> None:
    one = scene(tmp_path, changed(PHOTO, "candidates = 20", 'candidates = 7\nsigma = 2.0\nminimizer = "expansion"'))
    settings = one.assignment.settings()
    assert (settings.candidates, settings.sigma, settings.minimizer, settings.rho) == (7, 2.0, "expansion", 0.5)


def test_moments_are_shown_beside_the_figures_frame(tmp_path: Path) -> None:
    one = scene(tmp_path, changed(PHOTO, "panel = 32", "panel = 32\nmoments = [2, 5]"))
    assert one.figure.shown(8) == [2, 5, 8]
