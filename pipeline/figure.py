"""The figure: panels, labels, legends, as one still X.png and one animation X.mp4, on request X.webp too.

A scene without variants has its panels in one row (or rows of `figure.columns`). With variants and one panel,
that panel stands once for each variant; with several panels, each variant has a row.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.build import manifest, source_digest
from pipeline.build.graph import BuildGraph
from pipeline.build.method import Panel
from pipeline.build.view import SceneView
from pipeline.files import pictures, video
from pipeline.progress import Progress

INSET = 0.27  # of a panel's width
READS = ("frames", "fps", "figure.frame", "figure.animation", "figure.webp", "figure.columns", "figure.labels")
"""What the figure reads of each scene, beside its panels."""


def make(graph: BuildGraph, progress: Progress) -> None:
    """Set X.png, X.mp4 and X.webp, unless they are up to date. The images must be."""
    figure = Figure(graph)
    folder = manifest.Folder(graph.root)
    png = f"{graph.name}.png"
    keys = {png: figure.key([figure.shown_frame], pictures.write, still=True)}
    moving = {f"{graph.name}.{suffix}": write for suffix, write in figure.animations.items()}
    keys |= {name: figure.key(range(1, figure.frames + 1), write) for name, write in moving.items()}
    if not folder.up_to_date(png, keys[png]):
        pictures.write(graph.root / png, figure.sheet(figure.shown_frame, still=True))
        folder.add(png, keys[png])
    for name, write in moving.items():
        if folder.up_to_date(name, keys[name]):
            continue
        with progress.task(name, figure.frames) as advance:

            def sheets(advance: Callable[[], None] = advance) -> Iterator[np.ndarray]:
                for frame in range(1, figure.frames + 1):
                    yield figure.sheet(frame)
                    advance()

            write(graph.root / name, sheets(), figure.first.fps)
        folder.add(name, keys[name])
    folder.close(keys, {"scene": graph.name, "stage": "figure"})


class Figure:
    """The figure of a scene file: which panels, of which variants, at which frames."""

    def __init__(self, graph: BuildGraph):
        self.graph = graph
        self.scenes: dict[str, Any] = {name: SceneView(scene, READS, "the figure")
                                       for name, scene in graph.variants.items()}
        self._labelled = {name: self._with_labels(name, graph.method.panels(scene))
                          for name, scene in graph.variants.items()}
        self.first = next(iter(self.scenes.values()))
        self.frames: int = max(scene.frames for scene in self.scenes.values())
        self.shown_frame: int = self.first.figure.frame or self.frames

    @property
    def animations(self) -> dict[str, Callable[[Path, Iterator[np.ndarray], float], int]]:
        """What writes each file of the animation, by its suffix."""
        if not self.first.figure.animation:
            return {}
        return {"mp4": video.write} | ({"webp": video.write_webp} if self.first.figure.webp else {})

    def _with_labels(self, variant: str, panels: Sequence[Panel]) -> list[tuple[Panel, str]]:
        labels = self.scenes[variant].figure.labels or [panel.label for panel in panels]
        return list(zip(panels, labels, strict=True))

    def panels(self, still: bool) -> dict[str, list[tuple[Panel, str]]]:
        """The panels of each variant and their labels, in reading order, in the still or in the animation."""
        hidden = "animation" if still else "still"
        return {variant: [(panel, label) for panel, label in panels if panel.shown_in != hidden]
                for variant, panels in self._labelled.items()}

    def key(self, frames: Sequence[int], write: Callable[..., Any], still: bool = False) -> str:
        """What a figure of these frames depends on, written by `write`."""
        places = [(variant, panel) for variant, panels in self.panels(still).items() for panel, _ in panels]
        panels = [[variant, [[asdict(panel), label] for panel, label in panels]]
                  for variant, panels in self.panels(still).items()]
        hashes = [self.graph.require(variant, name, self.frame_of(variant, name, panel.frame or frame)).sha256
                  for variant, panel in places for frame in frames
                  for name in (self.artifact(panel, still), panel.inset) if name]
        read = {self.graph.artifacts[variant][panel.artifact].format.read for variant, panel in places}
        code = source_digest.digest([Figure.sheet, write, *read])
        return manifest.digest([panels, self.first.figure.columns, self.first.fps, hashes, code])

    def artifact(self, panel: Panel, still: bool) -> str:
        """The artifact that a panel shows, in the animation or in the still."""
        return panel.still if still and panel.still else panel.artifact

    def frame_of(self, variant: str, name: str, frame: int) -> int:
        """The frame of an artifact to show: an animation that is shorter than another stands still at its end."""
        return min(frame, self.scenes[variant].frames) if self.graph.artifacts[variant][name].animated else 0

    def sheet(self, frame: int, still: bool = False) -> np.ndarray:
        """The figure at a frame, (h, w, 3) uint8 sRGB: as the animation shows it, or as the still does."""
        from render import layout

        several = len(self.scenes) > 1 or "" not in self.scenes
        shown = []
        for variant, panels in self.panels(still).items():
            for number, (panel, label) in enumerate(panels):
                named = variant if several and not number else label
                shown.append(self._panel(variant, panel, frame, still, named))
        columns = self.first.figure.columns or len(shown)
        row = len(next(iter(self.panels(still).values())))
        if several and row > 1:
            columns = row
        return layout.figure([shown[start:start + columns] for start in range(0, len(shown), columns)])

    def _panel(self, variant: str, panel: Panel, frame: int, still: bool, label: str) -> Any:
        from render import layout, lic, tonemap

        light = self._light(variant, self.artifact(panel, still), panel.frame or frame)
        picture = layout.fitted(tonemap.to_display(light, panel.tone), panel.width)
        inset = None
        if panel.inset:
            light = self._light(variant, panel.inset, panel.frame or frame)
            inset = layout.fitted(tonemap.to_display(light, panel.tone), round(INSET * panel.width))
        return layout.Panel(picture, label, inset=inset, legend=lic.wheel(panel.width // 6) if panel.legend else None,
                            border=panel.border)

    def _light(self, variant: str, name: str, frame: int) -> np.ndarray:
        picture: np.ndarray = self.graph.read(variant, name, self.frame_of(variant, name, frame))
        return picture
