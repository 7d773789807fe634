"""Ranges of frames: what a farm may write, and what it may not."""

import pytest

from pipeline.errors import BadInput
from pipeline.frame_ranges import frames, spelled


@pytest.mark.parametrize(("text", "expected"), [
    ("7", [7]),
    ("1-10,20,30-40x2", [*range(1, 11), 20, *range(30, 41, 2)]),
    ("3,1,2", [1, 2, 3]),
    ("1-3,2-4", [1, 2, 3, 4]),
    ("1-4x3", [1, 4]),
    ("1-5x3", [1, 4]),
    (" 1 , 3-4 ", [1, 3, 4]),
    ("90", [90]),
])
def test_a_range_is_its_frames_each_once_ascending(text: str, expected: list[int]) -> None:
    assert frames(text, 90) == expected


@pytest.mark.parametrize("text", [
    "", "0", "91", "5-3", "1-91", "1-", "-3", "1-5x0", "1x2", "a", "1,,2", "1.5", "١", "9" * 5000,
])
def test_anything_else_is_refused_by_name(text: str) -> None:
    with pytest.raises(BadInput) as caught:
        frames(text, 90)
    assert str(caught.value).startswith("--frames: ")


@pytest.mark.parametrize("text", ["1-3,7", "1", "1-90", "2,4,6-8"])
def test_spelling_is_the_inverse_of_reading(text: str) -> None:
    assert spelled(frames(text, 90)) == text
