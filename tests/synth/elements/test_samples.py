"""Elements: what they refuse, and what they fill in."""

import numpy as np
import pytest

from synth.elements.samples import Elements


def test_topology_follows_the_grid() -> None:
    assert Elements(np.zeros((1, 2, 1, 2))).topology == "none"
    assert Elements(np.zeros((1, 2, 5, 3)), grid=(5,)).topology == "thread"
    assert Elements(np.zeros((1, 2, 6, 3)), grid=(2, 3)).topology == "sheet"


def test_what_is_not_given_is_filled_in() -> None:
    elements = Elements(np.zeros((3, 4, 1, 2)))
    assert (elements.frames, elements.count, elements.dimensions) == (3, 4, 2)
    assert elements.size.shape == (4,) and elements.kind.dtype == np.int32 and elements.colour.shape == (4, 3)


@pytest.mark.parametrize(("arguments", "told"), [
    ({"positions": np.zeros((2, 3, 4))}, "frames, elements, samples"),
    ({"positions": np.zeros((0, 3, 1, 2))}, "frames, elements, samples"),
    ({"positions": np.zeros((2, 3, 6, 3)), "grid": (2, 2)}, "does not hold 6"),
    ({"positions": np.zeros((2, 3, 1, 2)), "size": np.zeros(2)}, r"size of 3 elements is \(3,\)"),
    ({"positions": np.zeros((2, 3, 1, 2)), "coarse": np.zeros((2, 3, 1, 3))}, "coarse of 3 elements"),
])
def test_shapes_that_do_not_fit(arguments: dict, told: str) -> None:
    with pytest.raises(ValueError, match=told):
        Elements(**arguments)


def test_a_gap_is_named_by_frame_and_element() -> None:
    positions = np.zeros((3, 4, 1, 2))
    positions[1, 2] = np.nan
    with pytest.raises(ValueError, match="frame 2, element 3 is not finite"):
        Elements(positions)


def test_a_box_is_two_corners_and_gives_the_period() -> None:
    elements = Elements(np.zeros((1, 2, 1, 2)), box=np.array([[1, 2], [4, 8]]))
    assert elements.period is not None and elements.period.tolist() == [3, 6]
    assert Elements(np.zeros((1, 2, 1, 2))).period is None
    for box in (np.zeros((2, 2)), np.ones((2, 3)), np.array([[0, 0], [1, np.nan]])):
        with pytest.raises(ValueError, match="a lower and an upper corner"):
            Elements(np.zeros((1, 2, 1, 2)), box=box)
