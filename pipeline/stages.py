"""The stages in order: synth, bake, render and figure. Each makes what is not up to date of its folder.

What runs after what within a stage follows from the inputs of its artifacts (`build.graph`).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pipeline import figure
from pipeline.build.artifact import FOLDERS
from pipeline.build.graph import BuildGraph
from pipeline.progress import Progress
from pipeline.scene import Scenes

STAGES = (*FOLDERS, "figure")


def graph_of(scenes: Scenes, out: Path) -> BuildGraph:
    """The build graph of a scene file."""
    return BuildGraph(scenes.method, scenes.file, scenes.variants, out, scenes.quick)


def run(stage: str, scenes: Scenes, out: Path, progress: Progress, frames: Sequence[int] | None = None) -> BuildGraph:
    """Run a stage; without `frames`, the stages before it first, as far as they are not up to date."""
    graph = graph_of(scenes, out)
    stages = STAGES[: STAGES.index(stage) + 1] if frames is None else (stage,)
    for one in stages:
        graph.require_memory(one, frames)
    for one in stages:
        graph.check(one)
    for one in stages:
        if one == "figure":
            figure.make(graph, progress)
        else:
            graph.make(one, frames, progress)
    return graph
