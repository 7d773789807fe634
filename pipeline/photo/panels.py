"""The panels of a figure of a photograph."""

from __future__ import annotations

from pipeline.build.method import Panel
from pipeline.photo.tables import PhotoScene

MOVING = {"result": "frame", "matte": "matte of frame"}
"""Panels that the still shows at each moment, and what it calls them."""


def panels(scene: PhotoScene) -> tuple[Panel, ...]:
    """The panels of the scene's figure; with moments, in the still one result and one matte for each."""
    full = scene.figure.panel
    made: list[Panel] = []
    for name in scene.figure.panels:
        artifact = {"target": "target", "matte": "mattes", "motion": "motion", "result": "frames"}[name]
        if name in MOVING and scene.figure.moments:
            made += [Panel(f"{MOVING[name]} {moment}", artifact, full, "straight", frame=moment, shown_in="still")
                     for moment in scene.figure.moments]
            made.append(Panel(name, artifact, full, "straight", shown_in="animation"))
        else:
            made.append(Panel(name, artifact, full, "straight", legend=name == "motion"))
    return tuple(made)
