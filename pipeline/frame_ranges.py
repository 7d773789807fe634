"""Ranges of frames as a render farm writes them: `1-10,20,30-40x2`."""

from __future__ import annotations

import re
from collections.abc import Iterable

from pipeline.errors import BadInput

PART = re.compile(r"([0-9]{1,9})(?:-([0-9]{1,9})(?:x([0-9]{1,9}))?)?")


def frames(text: str, last: int) -> list[int]:
    """The frames of `text`, ascending, each once: numbers and ranges a-b or a-bxSTEP, separated by commas.

    Raises BadInput for anything else, and for a frame outside 1 to `last`.
    """
    found: set[int] = set()
    for part in text.split(","):
        match = PART.fullmatch(part.strip())
        if not match:
            raise BadInput("--frames", "", f"{part!r} is not a range such as 1-10,20,30-40x2")
        first = int(match[1])
        end, step = int(match[2] or first), int(match[3] or 1)
        if not (1 <= first <= end <= last and step >= 1):
            raise BadInput("--frames", "", f"{part!r} is not within 1-{last}, ascending, with a step of at least 1")
        found.update(range(first, end + 1, step))
    return sorted(found)


def spelled(numbers: Iterable[int]) -> str:
    """The shortest list of plain ranges: [1, 2, 3, 7] is 1-3,7."""
    runs: list[list[int]] = []
    for number in sorted(set(numbers)):
        if runs and runs[-1][1] == number - 1:
            runs[-1][1] = number
        else:
            runs.append([number, number])
    return ",".join(f"{a}-{b}" if b > a else f"{a}" for a, b in runs)
