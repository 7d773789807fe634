"""The panels of a figure of a photograph, and the pictures that are made for them."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby
from typing import get_args

from pipeline.build.artifact import Artifact
from pipeline.build.method import Panel
from pipeline.photo.neighbours import neighbour_views
from pipeline.photo.pieces import piece_views
from pipeline.photo.tables import OfPair, OfPiece, PhotoScene
from pipeline.photo.views import View, target_view

MOVING = {"result": ("frames", "frame"), "matte": ("mattes", "matte of frame")}
"""Panels that the still shows at each moment: their artifacts, and what it calls them."""


def panels(scene: PhotoScene) -> tuple[Panel, ...]:
    """The panels of the scene's figure; with moments, in the still one result for each, and one matte if it moves."""
    full = scene.figure.panel
    made: list[Panel] = []
    for shown in _shown(scene):
        if isinstance(shown, View):
            made.append(Panel(shown.label, shown.artifact.name, shown.width, "straight", legend=shown.legend,
                              border=shown.border))
            continue
        artifact, name = MOVING[shown]
        # a matte that stands is shown once
        moments = () if shown == "matte" and scene.photo.dynamics == 0 else scene.figure.moments
        for moment in moments:
            made.append(Panel(f"{name} {moment}", artifact, full, "straight", frame=moment, shown_in="still"))
        made.append(Panel(shown, artifact, full, "straight", shown_in="animation" if moments else "both"))
    return tuple(made)


def view_artifacts(scene: PhotoScene) -> tuple[Artifact, ...]:
    """The pictures that are made for panels alone."""
    return tuple({shown.artifact.name: shown.artifact for shown in _shown(scene) if isinstance(shown, View)}.values())


def _shown(scene: PhotoScene) -> Iterator[str | View]:
    """The views in reading order, and "matte" and "result", which need none. Panels of pieces that follow each other
    stand together, once for each piece."""
    for of_piece, run in groupby(scene.figure.panels, lambda name: name in get_args(OfPiece)):
        names = list(run)
        if of_piece:
            for number in range(1, len(scene.figure.pieces) + 1):
                for name in names:
                    yield from piece_views(scene, name, number)
            continue
        for name in names:
            if name in MOVING:
                yield name
            elif name in get_args(OfPair):
                yield from neighbour_views(scene, name)
            else:
                yield target_view(scene, name)
