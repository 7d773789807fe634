"""The panels of a figure of a photograph."""

from __future__ import annotations

from pipeline.build.method import Panel
from pipeline.photo.tables import PhotoScene


def panels(scene: PhotoScene) -> tuple[Panel, ...]:
    """The panels of the scene's figure; with moments, in the still one result for each."""
    full = scene.figure.panel
    made: list[Panel] = []
    for name in scene.figure.panels:
        if name == "result" and scene.figure.moments:
            made += [Panel(f"frame {moment}", "frames", full, "straight", frame=moment, shown_in="still")
                     for moment in scene.figure.moments]
            made.append(Panel("result", "frames", full, "straight", shown_in="animation"))
        else:
            artifact = {"target": "target", "matte": "mattes", "motion": "motion", "result": "frames"}[name]
            made.append(Panel(name, artifact, full, "straight", legend=name == "motion"))
    return tuple(made)
