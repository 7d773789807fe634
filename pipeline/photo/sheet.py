"""The contact sheet of `flowloom clips sheet`: the clips of the catalogue, of a library or of a scene."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from pipeline.build.artifact import Artifact
from pipeline.build.graph import BuildGraph
from pipeline.files import pictures
from pipeline.photo import library
from pipeline.photo.clips import clip_artifacts, names
from pipeline.photo.tables import PhotoScene
from pipeline.progress import Progress

SIZE, LENGTH = (160, 120), 32
"""Columns and rows, and frames, of the clips of the catalogue's sheet: as large as they are shown."""

Named = Iterator[tuple[str, np.ndarray]]


def of_catalogue(progress: Progress) -> Named:
    """Names and frames of all clips that can be made, small and short."""
    from synth.photo.clips import catalogue

    recipes = catalogue()
    with progress.task("clips sheet", len(recipes)) as advance:
        for recipe in recipes:
            made = recipe.clip(LENGTH, SIZE)
            yield recipe.name, made.luma if made.chroma is None else made.chroma
            advance()


def of_library(folder: Path) -> Named:
    """Names and frames of the clips of a library. Raises as `library.entries` and `library.read`."""
    for entry in library.entries(folder):
        yield entry.name, library.read(library.frames_file(folder, entry.name))


def of_scene(graph: BuildGraph, progress: Progress) -> Named:
    """Names and frames of the clips of a scene's first variant, made first where they are not there."""
    variant, scene = next(iter(graph.variants.items()))
    clips = BuildGraph(replace(graph.method, artifacts=_only_clips), graph.file_of_scene, {variant: scene},
                       graph.shared.parent)
    clips.check("synth")
    clips.make("synth", None, progress)
    for name in names(scene, "clip"):
        yield name.removeprefix("clip-"), clips.read(variant, name, 0)["luma"]


def _only_clips(scene: PhotoScene) -> tuple[Artifact, ...]:
    wanted = names(scene, "clip")
    return tuple(artifact for artifact in clip_artifacts(scene) if artifact.name in wanted)


def write(file: Path, clips: Named) -> None:
    """Write the sheet of the clips as PNG."""
    from render.contact_sheet import contact_sheet

    pictures.write(file, contact_sheet(clips))
