"""The user controls of points: the domain of a scene, its flow, its maps and its hard positions."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tiny import BEADS, Memory, changed, written

from pipeline import cli
from pipeline.elements import controls
from pipeline.elements.scene import Scene
from pipeline.errors import InvalidValue
from pipeline.files import pictures
from synth import projection
from synth.elements.samples import Elements
from synth.field import Field as MotionField

Refused = Callable[..., str]
Synthesized = Callable[[str], tuple[Elements, Elements]]


def scene(folder: Path, **elements: Any) -> Scene:
    raw = {"title": "t", "exemplar": {"kind": "poisson-disk"}, "render": {"kind": "beads"},
           "elements": {"size": [96, 48], **elements}}
    return Scene.model_validate(raw, context={"folder": folder})


def test_the_domain_is_the_rectangle_in_heights(tmp_path: Path) -> None:
    found = controls.domain(scene(tmp_path), Memory(tmp_path))
    away = found.distance(np.array([[0.0, 0.5], [-0.95, 0.5], [1.2, 0.5]]))
    assert away[0] == pytest.approx(0.5, abs=0.02)
    assert away[1] == pytest.approx(0.05, abs=0.02)
    assert away[2] < -0.15, "beyond the grid is outside"


def test_a_domain_that_repeats_along_x_ends_along_y(tmp_path: Path) -> None:
    found = controls.domain(scene(tmp_path, toroidal=True), Memory(tmp_path))
    away = found.distance(np.array([[-0.99, 0.5], [1.2, 0.5], [0.0, 1.1]]))
    assert away[:2] == pytest.approx([0.5, 0.5], abs=0.02) and away[2] < 0


def test_a_shape_is_the_domain_and_one_that_lies_outside_is_refused(tmp_path: Path) -> None:
    ball = {"kind": "ball", "centre": [0.2, 0.5], "radius": [0.3]}
    found = controls.domain(scene(tmp_path, domain=ball), Memory(tmp_path))
    assert found.distance(np.array([[0.2, 0.5], [0.6, 0.5]])) == pytest.approx([0.3, -0.1], abs=0.02)
    with pytest.raises(InvalidValue):
        controls.domain(scene(tmp_path, domain={**ball, "centre": [9.0, 0.5]}), Memory(tmp_path))


def test_maps_stand_upright_and_fill_the_domain(tmp_path: Path) -> None:
    top = np.zeros((16, 32, 3), np.uint8)
    top[:8] = 255
    pictures.write(tmp_path / "top.png", top)
    chosen = scene(tmp_path, selections=[{"kinds": [1], "file": "top.png"}], control={"file": "top.png"})
    example = Elements(np.zeros((1, 2, 1, 2)), kind=np.array([0, 1]), size=np.array([1.0, 3.0]))
    points = np.array([[-0.9, 0.9], [0.9, 0.1]])
    bits = controls.allowed(chosen, example)(0, points)
    assert bits[0] & 2 and not bits[0] & 1 and bits[1] & 1 and not bits[1] & 2
    assert controls.control(chosen)(0, points) == pytest.approx([1.0, 0.0], abs=0.05)
    assert controls.ranked(example, "size").tolist() == [0.0, 1.0]
    with pytest.raises(InvalidValue, match="no element of kind 1"):
        controls.allowed(chosen, Elements(np.zeros((1, 2, 1, 2))))


def test_each_hard_position_has_an_element_of_its_own(tmp_path: Path) -> None:
    wanted = scene(tmp_path, pins=[{"at": [0.1, 0.5]}, {"at": [0.12, 0.5]}])
    found = controls.pins(wanted, np.array([[[[0.1, 0.5]], [[0.5, 0.5]], [[0.3, 0.5]]]]))
    assert found.sample.tolist() == [0, 2] and found.frame.tolist() == [0, 0]


def test_what_a_scene_does_not_have_is_none(tmp_path: Path) -> None:
    plain = scene(tmp_path)
    example = Elements(np.zeros((1, 2, 1, 2)))
    assert controls.flow(plain, Memory(tmp_path), None) is None and controls.rotation(plain, Memory(tmp_path)) is None
    assert controls.allowed(plain, example) is None and controls.control(plain) is None
    assert controls.toroidal(plain) is None and controls.pins(plain, example.positions) is None


def test_a_flow_carries_points_and_where_the_domain_has_a_shape_nothing_out_of_it(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    known = Memory(tmp_path, L=MotionField.centred(np.full((32, 32, 2), [0.24, 0.0]), 2))  # heights per second
    points = np.array([[0.0, 0.5], [0.25, 0.5]])
    free = controls.flow(scene(tmp_path, size=[32, 32]), known, None)
    assert free(0, points) == pytest.approx(np.full((2, 2), [0.01, 0.0]), abs=1e-6)

    ball = scene(tmp_path, domain={"kind": "ball", "centre": [0.0, 0.5], "radius": [0.3]}, size=[32, 32])
    projected, calls = projection.project, list[int]()
    monkeypatch.setattr(projection, "project", lambda *args: (calls.append(1), projected(*args))[1])
    closed = controls.flow(ball, known, controls.domain(ball, known))
    for frame in (0, 1, 59, 60):
        assert closed(frame, points) == pytest.approx(np.zeros((2, 2)), abs=1e-4)
    assert {frame for _, frame in known.asked} == {1, 2, 60}
    assert len(calls) == 1, "a steady flow is projected once"


@pytest.mark.parametrize(("along", "expected"), [("centre", [0.0, 1.0]), ("flow", [-1.0, 0.0])])
def test_the_exemplars_x_axis_follows_the_flow_or_circles(tmp_path: Path, along: str, expected: list[float]) -> None:
    turned = scene(tmp_path, along=along, size=[32, 32])
    left = MotionField.centred(np.full((32, 32, 2), [-0.5, 0.0]), 2)
    frames = controls.rotation(turned, Memory(tmp_path, L=left))(0, np.array([[0.3, 0.5]]))
    assert frames[0] @ [1.0, 0.0] == pytest.approx(expected, abs=1e-6)


# -- outputs without room, end to end

BALL = '[[obstacles]]\nkind = "ball"\ncentre = [0.0, 0.5]\nradius = RADIUS\n[render]'


@pytest.mark.parametrize(("old", "new", "expected"), [
    ("spacing = 0.12", "spacing = 0.9", "synthesis.neighborhood: the domain is smaller than a neighbourhood"),
    ("spacing = 0.12", 'spacing = 0.12\ndomain = { kind = "ball", centre = [0.0, 0.5], radius = 0.1 }',
     "synthesis.neighborhood: the domain is smaller than a neighbourhood"),
    ("spacing = 0.12", "spacing = 0.12\ncount = 5000", "elements.count: 5,000 elements are more than the domain holds"),
    ("spacing = 0.12", "spacing = 0.001", "elements.spacing: 1,154,700 elements would fill the domain; 100,000 are"),
    ("spacing = 0.12", "spacing = 0.12\ncount = 2\npins = [{ at = [0.0, 0.2] }, { at = [0.0, 0.5] }, "
                       "{ at = [0.0, 0.8] }]", "elements.pins: 3 hard positions in frame 1, and 2 elements"),
    ("spacing = 0.12", "spacing = 0.12\ncount = 2\npins = [{ at = [0.0, 0.2], frame = 2 }, { at = [0.0, 0.5], frame = 2"
                       " }, { at = [0.0, 0.8], frame = 2 }]", "elements.pins: 3 hard positions in frame 2, and 2 elem"),
    ("spacing = 0.12", "spacing = 0.12\npins = [{ at = [0.0, 0.5] }, { at = [0.0, 1.5] }]",
     "elements.pins[1].at: is outside the domain, or in an obstacle"),
    ("spacing = 0.12", 'spacing = 0.12\ndomain = { kind = "ball", centre = [0.0, 0.5], radius = 0.001 }',
     "elements.domain: "),
])
def test_an_output_without_room(refused: Refused, old: str, new: str, expected: str) -> None:
    line = refused(changed(changed(BEADS, '[coarse]\nkind = "analytic"\nflow = "rotation"\nsize = [16, 16]\n', ""),
                           old, new), "exemplar.npz")
    assert line.startswith(f"tiny.toml: {expected}")


@pytest.mark.parametrize(("new", "expected"), [
    (BALL.replace("RADIUS", "2.0"), "obstacles: "),
    (BALL.replace("RADIUS", "0.7"), "obstacles: "),
    (BALL.replace("RADIUS", "0.3").replace("[0.0, 0.5]", "[5.0, 0.5]"), "obstacles: "),
])
def test_obstacles_that_fill_the_domain_or_lie_outside_it(home: Path, capsys: pytest.CaptureFixture[str], new: str,
                                                          expected: str) -> None:
    written(home, changed(BEADS, "[render]", new))
    assert cli.run(["figure", "tiny.toml"]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and err.startswith(f"tiny.toml: {expected}")
    assert not list(Path("out").rglob("elements*")) and not list(Path("out").rglob("*.partial"))


def test_a_domain_that_the_obstacles_fill(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = changed(BEADS, "spacing = 0.12",
                   'spacing = 0.12\ndomain = { kind = "ball", centre = [0.0, 0.5], radius = 0.3 }')
    written(home, changed(text, "[render]", BALL.replace("RADIUS", "0.4")))
    assert cli.run(["synth", "tiny.toml"]) == 2
    assert capsys.readouterr().err == "tiny.toml: obstacles: leave elements no room\n"


def test_selections_are_of_kinds_that_there_are_and_pictures_that_can_be_read(
        home: Path, capsys: pytest.CaptureFixture[str], refused: Refused) -> None:
    pictures.write(home / "left.png", np.tile(np.arange(16) < 8, (16, 1)).astype(np.float32))
    text = changed(BEADS, "spacing = 0.12", 'spacing = 0.12\nselections = [{ kinds = [3], file = "left.png" }]')
    written(home, text)
    assert cli.run(["synth", "tiny.toml"]) == 2
    assert capsys.readouterr().err == (
        "tiny.toml: elements.selections[0].kinds: the exemplar has no element of kind 3; it has 0\n")
    (home / "left.png").write_text("no picture")
    shutil.rmtree("out")
    assert "left.png: elements.selections[0].file: " in refused(text)


# -- what constraints do, end to end


def test_hard_positions_hold_in_their_frames(synthesized: Synthesized) -> None:
    pins = 'pins = [{ at = [0.1, 0.3] }, { at = [-0.2, 0.6], frame = 3 }, { at = [0.2, 0.6], frame = 3 }]'
    _, output = synthesized(changed(BEADS, "spacing = 0.12", f"spacing = 0.12\n{pins}"))
    for frame, place in ((0, (0.1, 0.3)), (2, (-0.2, 0.6)), (2, (0.2, 0.6))):
        away = np.linalg.norm(output.positions[frame, :, 0] - place, axis=1)
        assert away.min() < 1e-6


def test_elements_stay_in_the_domain_and_out_of_obstacles(synthesized: Synthesized) -> None:
    text = changed(BEADS, "spacing = 0.12",
                   'spacing = 0.12\ndomain = { kind = "ball", centre = [0.0, 0.5], radius = 0.45 }')
    _, output = synthesized(changed(text, "[render]", BALL.replace("RADIUS", "0.15")))
    away = np.linalg.norm(output.positions[:, :, 0] - [0.0, 0.5], axis=-1)
    assert away.min() > 0.15 and away.max() < 0.45


def test_kinds_stand_where_they_are_selected(home: Path, synthesized: Synthesized) -> None:
    dots = np.ones((64, 64, 3), np.float32)
    for y in range(4, 64, 16):
        for x in range(4, 64, 16):
            dots[y:y + 7, x:x + 7] = [0.9, 0.1, 0.1] if (x + y) % 32 < 16 else [0.1, 0.1, 0.9]
    pictures.write(home / "dots.png", dots)
    pictures.write(home / "left.png", np.tile(np.arange(32) < 16, (32, 1)).astype(np.float32))
    text = changed(BEADS, '"hexagonal-grid"\nacross = 6', '"dots"\nfile = "dots.png"')
    text = changed(text, '[coarse]\nkind = "analytic"\nflow = "rotation"\nsize = [16, 16]\n', "")
    _, output = synthesized(changed(text, "spacing = 0.12",
                             'spacing = 0.12\nselections = [{ kinds = [1, 1], file = "left.png" }]'))
    left = output.positions[0, :, 0, 0] < -0.06  # a row may lean over the border
    right = output.positions[0, :, 0, 0] > 0.06
    assert set(output.kind[left]) == {1} and set(output.kind[right]) == {0}
