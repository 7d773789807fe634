"""The exemplars I of ma13: each kind one class, its keys and its elements; artifact `exemplar`.

A new kind is one class here and its place in `Exemplar`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, ClassVar, Literal

import numpy as np

from pipeline.build.artifact import Artifact, Inputs, Reads
from pipeline.elements.tables import ElementsScene
from pipeline.errors import InvalidValue, attributed_to
from pipeline.files import pictures, tracks
from pipeline.tables import Asset, AssetOrFolder, Table, key
from synth.elements.samples import Elements

PLURALS = {"none": "points", "thread": "threads", "sheet": "sheets"}
"""What elements of each topology are called."""
FEWEST_SAMPLES = 4  # of a thread


class ExemplarTable(Table):
    """One exemplar."""

    topology: ClassVar[str | None] = "none"
    """How its elements hang together, as a look `draws` them; None: as the file has them."""
    dimension: ClassVar[int | None] = 2
    """Of its elements; None: as the scene's."""
    reads: ClassVar[Reads] = ()
    """What `elements` reads of the scene beside the table itself, seed and fps."""

    def elements(self, scene: ElementsScene) -> Elements:
        """The elements, at any scale."""
        raise NotImplementedError


class ArrangedExemplar(ExemplarTable):
    """Points at rest that repeat, by procedure (figure 8a, c, d)."""

    kind: Literal["poisson-disk", "jittered-grid", "hexagonal-grid"] = key("how the points are arranged")
    across: int = key("elements along its edge, about", 10, ge=2, le=200)
    jitter: float = key("largest offset of an element of a jittered grid", 0.25, "spacings", ge=0, le=0.5)

    def elements(self, scene: ElementsScene) -> Elements:
        from synth.elements import arrangement

        match self.kind:
            case "poisson-disk":
                return arrangement.poisson_disk((self.across,) * 2, seed=scene.seed)
            case "jittered-grid":
                return arrangement.jittered_grid((self.across,) * 2, jitter=self.jitter, seed=scene.seed)
        return arrangement.hexagonal_grid((self.across, self.across + self.across % 2))


class DotsExemplar(ExemplarTable):
    """Points at rest drawn by hand (figure 8b): each dot of a picture is an element of the dot's colour and size."""

    kind: Literal["dots"] = key("the dots of a picture, which repeats")
    file: Asset = key("PNG")

    def elements(self, scene: ElementsScene) -> Elements:
        from synth.elements import arrangement

        return arrangement.drawn(pictures.read_foreign(self.file, "exemplar.file")[::-1])


class SchoolExemplar(ExemplarTable):
    """Fish that swim together along x (figure 9)."""

    dimension: ClassVar[int | None] = 3

    kind: Literal["school"] = key("fish")
    behaviour: Literal["homogeneous", "crossing", "mixed"] = key(
        "everywhere alike (figure 9a), groups between which some dart (9c), or large ones among small (9e)",
        "homogeneous")
    count: int = key("number of fish", 40, ge=2, le=2000)
    frames: int = key("length of the exemplar", 60, "frames", ge=2, le=10000)

    def elements(self, scene: ElementsScene) -> Elements:
        from synth.elements import school

        schools: dict[str, Any] = {
            "homogeneous": school.homogeneous, "crossing": school.crossing, "mixed": school.mixed}
        made: Elements = schools[self.behaviour](self.count, frames=self.frames, rate=scene.fps, seed=scene.seed)[0]
        return made


class ThreadExemplar(ExemplarTable):
    """A small bundle of noodles (figure 10b, d)."""

    topology: ClassVar[str | None] = "thread"
    dimension: ClassVar[int | None] = 3

    kind: Literal["noodles"] = key("a bundle of threads")
    style: Literal["simulated", "jagged"] = key("elastic rods (figure 10b), or zigzags made by hand (10d)", "simulated")
    frames: int = key("length of the exemplar", 60, "frames", ge=2, le=10000)

    def elements(self, scene: ElementsScene) -> Elements:
        from synth.elements import keyframed, simulation

        threads = simulation.noodles if self.style == "simulated" else keyframed.jagged
        return threads(frames=self.frames, rate=scene.fps, seed=scene.seed)


class SheetExemplar(ExemplarTable):
    """A few sheets of paper (figure 13a, b)."""

    topology: ClassVar[str | None] = "sheet"
    dimension: ClassVar[int | None] = 3

    kind: Literal["paper"] = key("sheets")
    style: Literal["simulated", "folded", "fluttering"] = key(
        "in turbulent air (figure 13a), or by hand: folding, or waves along them (13b)", "simulated")
    frames: int = key("length of the exemplar", 60, "frames", ge=2, le=10000)

    def elements(self, scene: ElementsScene) -> Elements:
        from synth.elements import keyframed, simulation

        sheets: dict[str, Any] = {"simulated": simulation.sheets, "folded": keyframed.folded,
                                  "fluttering": keyframed.fluttering}
        made: Elements = sheets[self.style](frames=self.frames, rate=scene.fps, seed=scene.seed)
        return made


class TracksExemplar(ExemplarTable):
    """Elements made elsewhere: tracked in a film (figure 11), simulated, modelled."""

    topology: ClassVar[str | None] = None
    dimension: ClassVar[int | None] = None
    reads: ClassVar[Reads] = ("dimension", "render.kind", "render.draws", "render.fewest_frames", "render.default_size")

    kind: Literal["tracks"] = key("positions over time")
    file: AssetOrFolder = key("CSV, a folder of one PLY or OBJ file per frame, USD, or our own NPZ; see above")
    rate: float | None = key("none: what the file says, or else the scene's fps, to which the motion is resampled",
                             None, "frames per second", gt=0, le=1000)
    captured: bool = key("a school tracked in a film, x and y in pixels, y down (§6.4): its tracks are smoothed, and "
                         "its mean motion is taken out; in space it is at depth 0", False)

    def elements(self, scene: ElementsScene) -> Elements:
        """The elements of a file, of the topology and the dimensions of the scene, at its rate."""
        with attributed_to("exemplar.file"):
            return self._elements(scene)

    def _elements(self, scene: ElementsScene) -> Elements:
        look = scene.render
        found = tracks.read_foreign(
            self.file, "exemplar.file", rate=self.rate, otherwise=scene.fps,
            dimensions=2 if self.captured else scene.dimension, fewest_frames=look.fewest_frames)
        if found.topology != look.draws:
            raise InvalidValue("render.kind", f'"{look.kind}" draws {PLURALS[look.draws]}; the elements of '
                                              f"{self.file.name} are {PLURALS[found.topology]}")
        if found.topology == "thread" and found.grid[0] < FEWEST_SAMPLES:
            raise ValueError(f"threads of {found.grid[0]} samples; it takes {FEWEST_SAMPLES} or more")
        if self.captured:
            from synth.elements import school

            if found.dimensions == 3:
                raise InvalidValue("exemplar.captured", f"tracks of a film are x and y; {self.file.name} has depth")
            # a film's y points down, as school.tracked takes it
            found = school.tracked(found.positions[:, :, 0], found.rate)[0]
        elif self.file.suffix.lower() != ".npz":
            found = replace(found, size=np.full(found.count, look.default_size * spacing_of(found)))
        return at_rate(in_dimensions(found, scene.dimension if found.topology == "none" else 3), scene.fps)


Exemplar = ArrangedExemplar | DotsExemplar | SchoolExemplar | ThreadExemplar | SheetExemplar | TracksExemplar


def make_exemplar(scene: ElementsScene, inputs: Inputs, frames: list[int], radius: float | None,
                  ) -> Iterator[tuple[int, Elements]]:
    """I, by procedure or from a file, scaled so that its spacing is elements.spacing.

    radius  of an element of the middle size, heights; None: as the exemplar has it
    """
    example = scene.exemplar.elements(scene)
    spacing = spacing_of(example)
    if not spacing > 0:
        raise ValueError("its elements are all in one place")
    example = scaled(example, scene.elements.spacing / spacing)
    if radius is not None:
        example = replace(example, size=example.size * np.float32(radius / np.median(example.size)))
    yield 0, example


def exemplar_artifact(scene: ElementsScene) -> Artifact:
    """I."""
    return Artifact("exemplar", "synth", tracks.TRACKS, ("exemplar", "elements.spacing", "seed", "fps",
                                                         *scene.exemplar.reads),
                    (), make_exemplar, {"radius": scene.render.radius(scene)}, animated=False)


def in_dimensions(elements: Elements, dimensions: int) -> Elements:
    """What is flat is at depth 0 in space; what is at one depth is flat in the plane."""
    if elements.dimensions == dimensions:
        return elements
    if dimensions == 3:
        deep = [(0, 0)] * 3 + [(0, 1)]
        return replace(elements, positions=np.pad(elements.positions, deep), box=None,
                       coarse=None if elements.coarse is None else np.pad(elements.coarse, deep))
    if np.ptp(elements.positions[..., 2]) > 0:
        raise ValueError("its elements are not in one plane, and elements.size is in 2-D")
    return replace(elements, positions=elements.positions[..., :2], coarse=None,
                   box=None if elements.box is None else elements.box[:, :2])


def at_rate(elements: Elements, rate: float) -> Elements:
    """The same motion at `rate` frames per second, between frames by cubic splines."""
    if elements.rate == rate or elements.frames == 1:
        return replace(elements, rate=rate)
    from scipy.interpolate import make_interp_spline

    frames = np.arange(0, elements.frames - 1 + 1e-9, elements.rate / rate)
    if len(frames) < 2:
        raise ValueError(f"{elements.frames} frames at {elements.rate:g} per second are one at the scene's {rate:g}")

    def between(values: np.ndarray) -> np.ndarray:
        spline = make_interp_spline(np.arange(elements.frames), values.astype(np.float64), min(3, elements.frames - 1))
        found: np.ndarray = spline(frames)
        return found

    return replace(elements, rate=rate, positions=between(elements.positions),
                   coarse=None if elements.coarse is None else between(elements.coarse))


def spacing_of(example: Elements) -> float:
    """What elements.spacing says of an exemplar: of points and threads the nearest distance, of sheets that of their
    samples."""
    from synth.elements import neighborhood

    if example.topology != "sheet":
        places = example.positions if example.coarse is None else example.coarse
        return neighborhood.spacing(places, period_of(example))
    surface = example.positions.reshape(*example.positions.shape[:2], *example.grid, example.dimensions)
    return float(np.linalg.norm(np.diff(surface, axis=3), axis=-1).mean())


def scaled(example: Elements, factor: float) -> Elements:
    """The same elements at another scale."""
    lengths = {name: getattr(example, name) * np.float32(factor) for name in ("positions", "size", "coarse", "box")
               if getattr(example, name) is not None}
    return replace(example, **lengths)



def period_of(example: Elements) -> np.ndarray | None:
    """The period of an exemplar that repeats, in double precision."""
    return None if example.period is None else example.period.astype(np.float64)
