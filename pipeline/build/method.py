"""What a method hands to the build: one record, which pipeline/methods.py lists. No other file names a method."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Literal

from pipeline.build.artifact import Artifact

Faults = Iterator[tuple[str, str]]
"""Dotted keys, and what is wrong with the value of each."""


@dataclass(frozen=True)
class Panel:
    """One panel of a figure.

    artifact  what it shows, in the animation; `still` in the still, if that is another
    tone      "filmic" for light, "straight" for pictures that were made as display values
    width     pixels
    legend    whether a colour wheel stands in its corner
    inset     the artifact in a corner of it, "" for none
    frame     the frame that it always shows, 0 for that of the figure
    border    whether it has a thin border
    shown_in  "still" or "animation" alone, or "both"
    """

    label: str
    artifact: str
    width: int
    tone: Literal["filmic", "straight"] = "filmic"
    still: str = ""
    legend: bool = False
    inset: str = ""
    frame: int = 0
    border: bool = True
    shown_in: Literal["both", "still", "animation"] = "both"


@dataclass(frozen=True)
class Method:
    """One method: a kind of scene.

    name       as documents call it
    table      the table of a scene file whose presence tells that the scene is of this method
    scene      the pydantic model of the file
    checks     each yields the faults between values that are fine by themselves
    artifacts  of a scene, each after those it is made from
    panels     of a scene's figure, in reading order
    """

    name: str
    table: str
    scene: type[Any]
    checks: tuple[Callable[[Any], Faults], ...]
    artifacts: Callable[[Any], tuple[Artifact, ...]]
    panels: Callable[[Any], tuple[Panel, ...]]
