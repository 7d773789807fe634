"""What guides elements: the domain of a scene, its maps and its hard positions, as synth takes them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline import guides
from pipeline.elements_schema import ElementsScene
from pipeline.errors import WrongValue
from pipeline.files import pictures
from synth.elements.samples import Elements


class Nothing:
    """A stock without products: none of these scenes has obstacles or a flow."""

    def read(self, product: str, frame: int = 0) -> Any:
        raise AssertionError(f"asks for {product}")


def scene(folder: Path, **elements: Any) -> ElementsScene:
    raw = {"title": "t", "exemplar": {"kind": "poisson-disk"}, "render": {"kind": "beads"},
           "elements": {"size": [96, 48], **elements}}
    return ElementsScene.model_validate(raw, context={"folder": folder})


def test_the_domain_is_the_rectangle_in_heights(tmp_path: Path) -> None:
    found = guides.domain(scene(tmp_path), Nothing())
    away = found.distance(np.array([[0.0, 0.5], [-0.95, 0.5], [1.2, 0.5]]))
    assert away[0] == pytest.approx(0.5, abs=0.02)
    assert away[1] == pytest.approx(0.05, abs=0.02)
    assert away[2] < -0.15, "beyond the grid is outside"


def test_a_domain_that_repeats_along_x_ends_along_y(tmp_path: Path) -> None:
    found = guides.domain(scene(tmp_path, toroidal=True), Nothing())
    away = found.distance(np.array([[-0.99, 0.5], [1.2, 0.5], [0.0, 1.1]]))
    assert away[:2] == pytest.approx([0.5, 0.5], abs=0.02) and away[2] < 0


def test_a_shape_is_the_domain_and_one_that_lies_outside_is_refused(tmp_path: Path) -> None:
    ball = {"kind": "ball", "centre": [0.2, 0.5], "radius": [0.3]}
    found = guides.domain(scene(tmp_path, domain=ball), Nothing())
    assert found.distance(np.array([[0.2, 0.5], [0.6, 0.5]])) == pytest.approx([0.3, -0.1], abs=0.02)
    with pytest.raises(WrongValue):
        guides.domain(scene(tmp_path, domain={**ball, "centre": [9.0, 0.5]}), Nothing())


def test_maps_stand_upright_and_fill_the_domain(tmp_path: Path) -> None:
    top = np.zeros((16, 32, 3), np.uint8)
    top[:8] = 255
    pictures.write(tmp_path / "top.png", top)
    chosen = scene(tmp_path, selections=[{"kinds": [1], "file": "top.png"}], control={"file": "top.png"})
    example = Elements(np.zeros((1, 2, 1, 2)), kind=np.array([0, 1]), size=np.array([1.0, 3.0]))
    points = np.array([[-0.9, 0.9], [0.9, 0.1]])
    bits = guides.allowed(chosen, example)(0, points)
    assert bits[0] & 2 and not bits[0] & 1 and bits[1] & 1 and not bits[1] & 2
    assert guides.control(chosen)(0, points) == pytest.approx([1.0, 0.0], abs=0.05)
    assert guides.ranked(example, "size").tolist() == [0.0, 1.0]
    with pytest.raises(WrongValue, match="no element of kind 1"):
        guides.allowed(chosen, Elements(np.zeros((1, 2, 1, 2))))


def test_each_hard_position_has_an_element_of_its_own(tmp_path: Path) -> None:
    wanted = scene(tmp_path, pins=[{"at": [0.1, 0.5]}, {"at": [0.12, 0.5]}])
    found = guides.pins(wanted, np.array([[[[0.1, 0.5]], [[0.5, 0.5]], [[0.3, 0.5]]]]))
    assert found.sample.tolist() == [0, 2] and found.frame.tolist() == [0, 0]


def test_what_a_scene_does_not_have_is_none(tmp_path: Path) -> None:
    plain = scene(tmp_path)
    example = Elements(np.zeros((1, 2, 1, 2)))
    assert guides.flow(plain, Nothing(), None) is None and guides.turn(plain, Nothing()) is None
    assert guides.allowed(plain, example) is None and guides.control(plain) is None
    assert guides.toroidal(plain) is None and guides.pins(plain, example.positions) is None
