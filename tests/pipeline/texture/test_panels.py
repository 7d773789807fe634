"""Panels of moving textures: the still shows the result at its moments, the animation the result."""

from pathlib import Path

from tiny import BY_PAPER, TEXTURE, TEXTURE_ON_SURFACE, changed, scene

from pipeline.texture.panels import panels


def test_without_moments_the_result_stands_in_both(tmp_path: Path) -> None:
    found = panels(scene(tmp_path, TEXTURE))
    assert [(p.artifact, p.frame, p.shown_in) for p in found] == [
        ("sample", 0, "both"), ("flow-lines", 0, "both"), ("frames", 0, "both")]
    assert [p.width for p in found] == [16, 32, 32]


def test_with_moments_the_still_has_one_for_each(tmp_path: Path) -> None:
    found = panels(scene(tmp_path, BY_PAPER))
    assert [(p.label, p.frame, p.shown_in) for p in found[2:]] == [
        ("frame 1", 1, "still"), ("frame 3", 3, "still"), ("result", 0, "animation")]
    assert found[1].artifact == "holes"


def test_all_are_display_values(tmp_path: Path) -> None:
    text = changed(TEXTURE, "panel = 32", "panel = 32\nmoments = [2]")
    assert {panel.tone for panel in panels(scene(tmp_path, text))} == {"straight"}


def test_an_overlay_of_speed_is_the_result_and_has_a_legend_at_the_end(tmp_path: Path) -> None:
    text = changed(BY_PAPER, "panel = 32", 'panel = 32\noverlay = "speed"\nzoom = [0.5, 0.5, 0.5]')
    found = panels(scene(tmp_path, text))
    assert [(p.artifact, p.frame, p.shown_in) for p in found[2:]] == [
        ("tinted", 1, "still"), ("tinted", 3, "still"), ("tinted", 0, "animation"), ("speed-legend", 0, "both")]
    assert [p.border for p in found] == [True] * 5 + [False]


def test_of_a_surface_its_pictures_are_shown_as_light(tmp_path: Path) -> None:
    found = panels(scene(tmp_path, TEXTURE_ON_SURFACE))
    assert [(p.artifact, p.tone, p.shown_in) for p in found] == [
        ("sample", "straight", "both"), ("beauty", "filmic", "both")]
    found = panels(scene(tmp_path, changed(TEXTURE_ON_SURFACE, "panel = 32", "panel = 32\nmoments = [1, 3]")))
    assert [(p.label, p.frame, p.shown_in) for p in found[1:]] == [
        ("frame 1", 1, "still"), ("frame 3", 3, "still"), ("result", 0, "animation")]
