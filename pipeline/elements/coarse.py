"""The coarse motion C of threads and sheets (ma13): each kind one class, its keys and its elements; artifact `coarse`.

Points are carried by a field instead, one of `pipeline.flow`. A new kind is one class here and its place in `Carried`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, ClassVar, Literal

import numpy as np

from pipeline.build.artifact import Artifact, Inputs
from pipeline.elements.exemplars import PLURALS, at_rate, in_dimensions, scaled
from pipeline.elements.tables import ElementsScene
from pipeline.errors import InvalidValue, attributed_to
from pipeline.files import tracks
from pipeline.tables import AssetOrFolder, Table, key
from synth.elements.samples import Elements

MANY = 200  # threads or sheets, where the scene does not say how many
LIFT = 2.5  # seconds that a lift takes at least


class CarriedMotion(Table):
    """A coarse motion that is elements, not a field."""

    is_field: ClassVar[bool] = False
    topology: ClassVar[str | None] = None
    """Of the elements that it carries, as a look `draws` them; None: of threads and of sheets."""

    def check(self, scene: ElementsScene) -> None:
        """Refuse files that cannot be used."""

    def carried(self, scene: ElementsScene, example: Elements) -> Elements:
        """C, as many elements as the output has. `example`: the exemplar with its own C."""
        raise NotImplementedError


class CarriedThreads(CarriedMotion):
    """C of noodles: the motion of one is that of all, beside each other (§6.2)."""

    topology: ClassVar[str | None] = "thread"

    kind: Literal["lifted"] = key("a bundle lifted from a plate (figure 10a)")

    def carried(self, scene: ElementsScene, example: Elements) -> Elements:
        from synth.elements import bundle, simulation

        assert example.coarse is not None
        count, spacing = scene.elements.count or MANY, scene.elements.spacing
        thick = float(np.linalg.norm(bundle.section(count, 1.0), axis=1).max()) + 0.5
        length = float(np.linalg.norm(np.diff(example.coarse[0, 0], axis=0), axis=-1).sum()) / spacing
        # lifted faster than that a simulation comes apart: a shorter animation shows the same lift in fewer frames
        enough = max(scene.frames, round(LIFT * scene.fps))
        curve = simulation.lifted(samples=example.grid[0], length=max(length, 10 * thick), thick=thick,
                                  frames=enough, rate=scene.fps, seed=scene.seed)
        curve = curve[np.linspace(0, enough - 1, scene.frames).round().astype(int)]
        radius = float(np.median(example.size)) / spacing
        made = scaled(bundle.duplicated(curve, count, radius=radius, rate=scene.fps), spacing)
        return looking_like(made, example)


class CarriedSheets(CarriedMotion):
    """C of sheets: each moves stiffly in a gust (figure 13c)."""

    topology: ClassVar[str | None] = "sheet"

    kind: Literal["gust"] = key("a gust that tosses them")

    def carried(self, scene: ElementsScene, example: Elements) -> Elements:
        from synth.elements import falling_paper

        if example.grid[0] != example.grid[1]:
            raise InvalidValue("coarse.kind", f'"gust" tosses square sheets; those of the exemplar are '
                                              f"{' × '.join(map(str, example.grid))}")
        with attributed_to("elements.count"):
            tossed = falling_paper.tossed(scene.elements.count or MANY, side=example.grid[0], frames=scene.frames,
                                          rate=scene.fps, seed=scene.seed)
        return scaled(tossed, scene.elements.spacing)


class TracksMotion(CarriedMotion):
    """C made elsewhere: by keyframes or a simulation."""

    kind: Literal["tracks"] = key("threads or sheets over time")
    file: AssetOrFolder = key("as of an exemplar of this kind, in heights; as long as the animation, and as many "
                              "samples for an element as the exemplar has")

    def check(self, scene: ElementsScene) -> None:
        self._read(scene)

    def carried(self, scene: ElementsScene, example: Elements) -> Elements:
        found = self._read(scene)
        if found.grid != example.grid:
            raise InvalidValue("coarse.file", f"{' × '.join(map(str, found.grid))} samples for an element, and "
                                              f"{' × '.join(map(str, example.grid))} in the exemplar")
        return looking_like(replace(found, size=np.full(found.count, np.median(example.size))), example)

    def _read(self, scene: ElementsScene) -> Elements:
        """C from the file, as long as the animation, in heights as it stands."""
        found = tracks.read_foreign(self.file, "coarse.file", otherwise=scene.fps, dimensions=3, fewest_elements=1)
        with attributed_to("coarse.file"):
            if found.topology != scene.render.draws:
                raise ValueError(f"its elements are {PLURALS[found.topology]}")
            found = at_rate(in_dimensions(found, 3), scene.fps)
            if found.frames < scene.frames:
                raise ValueError(f"lasts {found.frames} frames, and the animation {scene.frames}")
        return replace(found, positions=found.positions[: scene.frames], coarse=None)


Carried = CarriedThreads | CarriedSheets | TracksMotion


def looking_like(made: Elements, example: Elements) -> Elements:
    """Elements of the kinds and colours of the exemplar's, one after the other."""
    alike = np.arange(made.count) % example.count
    return replace(made, kind=example.kind[alike], colour=example.colour[alike])


def with_coarse(example: Elements) -> Elements:
    """An exemplar with its C (§5)."""
    if example.coarse is not None:
        return example
    from synth.elements import decomposition

    return decomposition.with_coarse(example)


def make_coarse(scene: ElementsScene, inputs: Inputs, frames: list[int]) -> Iterator[tuple[int, Elements]]:
    """C of threads or sheets, as many as the output has."""
    table: Any = scene.coarse
    yield 0, table.carried(scene, with_coarse(inputs.read("exemplar")))


def _check(scene: ElementsScene) -> None:
    table: Any = scene.coarse
    table.check(scene)


def carried_artifact(scene: ElementsScene) -> Artifact:
    """C."""
    reads = ("coarse", "elements.count", "elements.spacing", "render.draws", "frames", "seed", "fps")
    return Artifact("coarse", "synth", tracks.TRACKS, reads, (("exemplar", "once"),), make_coarse, animated=False,
                    check=_check)
