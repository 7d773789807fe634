"""The panels of a figure of elements."""

from __future__ import annotations

from pipeline.build.method import Panel
from pipeline.elements.tables import ElementsScene


def panels(scene: ElementsScene) -> tuple[Panel, ...]:
    """The panels of the scene's figure."""
    full, inset = scene.figure.panel, "exemplar-picture" if scene.figure.inset else ""
    known = {
        "exemplar": Panel("exemplar *I*", "exemplar-picture", full // 2),
        "coarse": Panel("coarse motion *L*", "coarse-picture", full, "straight") if scene.flows else
        Panel("coarse motion *C*", "coarse-picture", full),
        "result": Panel("result", "beauty", full, inset=inset),
    }
    return tuple(known[name] for name in scene.figure.panels)
