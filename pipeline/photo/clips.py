"""[clips]: the database of clips (okabe11 §4) as artifacts.

    clip-fall-01 …   the frames and the mean velocity of a clip that synth.photo.clips makes
    clip-own-01 …    the same, read from a user's video
    codebook         visual words
    index-fall-01 …  the pieces of a clip as assignment compares them

Each is kept once for all scenes, in out/shared; a clip that is made has one name in all of them. A run that is
interrupted goes on with the clip that it was at.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, Strict

from pipeline.build.artifact import Artifact, Inputs
from pipeline.build.view import value_at
from pipeline.files import arrays
from pipeline.photo import library
from pipeline.photo.own import read_own
from pipeline.photo.tables import PhotoScene
from pipeline.tables import Asset, Folder, Table, key

SAMPLED = 7
"""Every so manieth descriptor of a clip goes into the sample of the codebook."""
Even = Annotated[int, Field(ge=64, le=1920, multiple_of=2)]
Families = tuple[str, ...]


class Clips(Table):
    """The clips whose motion the picture gets: made for it, and a user's own."""

    count: int = key("clips that are made; 0: the user's alone", 150, ge=0, le=150)
    families: Annotated[Families, Strict(False)] = key(
        "of which families: fall, white-water, river, bay, shallow, lake, fire, smoke, cloud; none: of all", (),
        max_length=16)
    size: Annotated[tuple[Even, Even], Strict(False)] = key("columns and rows of a made clip", (320, 240), "pixels")
    length: int = key("length of a made clip", 96, "frames", ge=16, le=480, multiple_of=8)
    files: Annotated[tuple[Asset, ...], Strict(False)] = key(
        "videos of fluids, by a fixed camera, without a cut", (), max_length=150)
    library: Folder | None = key("a folder of your own clips, which flowloom clips add fills; none: no library", None)

    def recipes(self) -> list[Any]:
        """The recipes of the made clips: the first `count` of the catalogue that are of the families."""
        from synth.photo.clips import catalogue

        found = [recipe for recipe in catalogue(150) if not self.families or recipe.family in self.families]
        return found[:self.count]

    @cached_property
    def kept(self) -> tuple[Path, ...]:
        """The files of the library's clips. Raises BadInput for a folder that is none, StorageFailed for one gone."""
        return () if self.library is None else library.files(self.library)


def names(scene: PhotoScene, kind: str) -> list[str]:
    """The artifacts of all clips, "clip" or "index"."""
    own = [f"own-{number:02d}" for number in range(1, len(scene.clips.files) + 1)]
    kept = [f"library-{file.stem}" for file in scene.clips.kept]
    return [f"{kind}-{name}" for name in [*(recipe.name for recipe in scene.clips.recipes()), *own, *kept]]


def make_clip(scene: PhotoScene, inputs: Inputs, frames: list[int], family: str, seed: int, variation: dict[str, Any],
              ) -> Iterator[tuple[int, arrays.Arrays]]:
    """A made clip, by its recipe."""
    from synth.photo.clips import clip

    made = clip(family, seed, scene.clips.length, scene.clips.size, **variation)
    yield 0, {"luma": made.luma, "velocity": made.velocity}


def make_own_clip(scene: PhotoScene, inputs: Inputs, frames: list[int], at: str) -> Iterator[tuple[int, arrays.Arrays]]:
    """A user's clip of the key `at`, a video, whose velocity is what its optical flow says."""
    yield 0, {"luma": read_own(value_at(scene, at), at).luma}


def make_kept_clip(scene: PhotoScene, inputs: Inputs, frames: list[int], at: str,
                   ) -> Iterator[tuple[int, arrays.Arrays]]:
    """A clip of the library, whose frames are the file of the key `at`: checked when it was added."""
    yield 0, {"luma": library.read(value_at(scene, at))}


def make_codebook(scene: PhotoScene, inputs: Inputs, frames: list[int], clips: list[str],
                  ) -> Iterator[tuple[int, arrays.Arrays]]:
    """Visual words of the exposures of all clips (§4)."""
    from synth.photo.index import exposures
    from synth.photo.pieces import Cut
    from synth.photo.words import codebook, descriptors

    step = Cut(scene.assignment.piece).step
    samples = [descriptors(picture, step).reshape(-1, 128)[::SAMPLED]
               for name in clips for picture in exposures(inputs.read(name)["luma"])]
    yield 0, {"words": codebook(np.concatenate(samples))}


def make_index(scene: PhotoScene, inputs: Inputs, frames: list[int], clip: str) -> Iterator[tuple[int, arrays.Arrays]]:
    """The pieces of one clip."""
    from synth.photo.index import index
    from synth.photo.pieces import Cut

    stored = inputs.read(clip)
    found = index(stored["luma"], inputs.read("codebook")["words"], Cut(scene.assignment.piece), stored.get("velocity"))
    yield 0, vars(found)


def clip_artifacts(scene: PhotoScene) -> tuple[Artifact, ...]:
    """The clips, the codebook and the index of each clip."""
    recipes, clips, index = scene.clips.recipes(), names(scene, "clip"), names(scene, "index")
    own = [(make_own_clip, f"clips.files[{k}]") for k in range(len(scene.clips.files))]
    own += [(make_kept_clip, f"clips.kept[{k}]") for k in range(len(scene.clips.kept))]

    def one(name: str, reads: tuple[str, ...], needs: Sequence[str], make: Any, **more: Any) -> Artifact:
        return Artifact(name, "synth", arrays.ARRAYS, reads, tuple((n, "once") for n in needs), make, animated=False,
                        shared=True, **more)

    return (
        *(one(name, ("clips.size", "clips.length"), (), make_clip, arguments={
            "family": of.family, "seed": of.seed, "variation": dict(of.variation)})
          for name, of in zip(clips, recipes, strict=False)),
        *(one(name, (at,), (), make, arguments={"at": at})
          for name, (make, at) in zip(clips[len(recipes):], own, strict=True)),
        one("codebook", ("assignment.piece",), clips, make_codebook, arguments={"clips": clips}),
        *(one(name, ("assignment.piece",), ("codebook", clip), make_index, arguments={"clip": clip})
          for name, clip in zip(index, clips, strict=True)))
