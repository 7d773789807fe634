"""The panels of a figure of a moving texture."""

from __future__ import annotations

from collections.abc import Iterator

from pipeline.build.method import Panel
from pipeline.texture.tables import TextureScene


def panels(scene: TextureScene) -> tuple[Panel, ...]:
    """The panels of the scene's figure; with moments, in the still one result for each."""
    if scene.surface is not None:
        return tuple(_on_surface(scene))
    full, zoom = scene.figure.panel, "zoom" if scene.figure.zoom else ""
    tinted = scene.figure.overlay == "speed"
    result = "tinted" if tinted else "frames"
    known = {"sample": Panel("sample", "sample", full // 2, "straight"), "flow": Panel("flow", "flow-lines", full,
             "straight"), "holes": Panel("holes", "holes", full, "straight"), "result": Panel("result", result, full,
             "straight", inset=zoom)}
    made: list[Panel] = []
    for name in scene.figure.panels:
        if name == "result" and scene.figure.moments:
            made += [Panel(f"frame {moment}", result, full, "straight", inset=zoom, frame=moment,
                           shown_in="still")
                     for moment in scene.figure.moments]
            made.append(Panel("result", result, full, "straight", inset=zoom, shown_in="animation"))
        else:
            made.append(known[name])
    if tinted:
        made.append(Panel("speed", "speed-legend", full, "straight", border=False))
    return tuple(made)


def _on_surface(scene: TextureScene) -> Iterator[Panel]:
    """The panels of a texture on a surface: its result is light."""
    full = scene.figure.panel
    for name in scene.figure.panels:
        if name == "sample":
            yield Panel("sample", "sample", full // 2, "straight")
            continue
        moments = scene.figure.moments
        for moment in moments:
            yield Panel(f"frame {moment}", "beauty", full, frame=moment, shown_in="still")
        yield Panel("result", "beauty", full, shown_in="animation" if moments else "both")
