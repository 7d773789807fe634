"""The panels of a figure of a moving texture."""

from __future__ import annotations

from pipeline.build.method import Panel
from pipeline.texture.tables import TextureScene


def panels(scene: TextureScene) -> tuple[Panel, ...]:
    """The panels of the scene's figure; with moments, in the still one result for each."""
    full = scene.figure.panel
    known = {"sample": Panel("sample", "sample", full // 2, "straight"), "flow": Panel("flow", "flow-lines", full,
             "straight"), "holes": Panel("holes", "holes", full, "straight"), "result": Panel("result", "frames", full,
             "straight")}
    made: list[Panel] = []
    for name in scene.figure.panels:
        if name == "result" and scene.figure.moments:
            made += [Panel(f"frame {moment}", "frames", full, "straight", frame=moment, shown_in="still")
                     for moment in scene.figure.moments]
            made.append(Panel("result", "frames", full, "straight", shown_in="animation"))
        else:
            made.append(known[name])
    return tuple(made)
