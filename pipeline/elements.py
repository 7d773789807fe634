"""What the stages make of a scene of elements (ma13).

synth   in fields/: the exemplar I and the output O as tracks (.npz), the coarse motion L where it is a field
bake    in geometry/: a mesh of each frame (PLY), and the whole animation as one USD file
render  in images/: the elements, their exemplar, their coarse motion
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pipeline import fields, guides, looks, obstacles
from pipeline.elements_schema import ElementsScene, TracksExemplar, TracksMotion
from pipeline.errors import WrongValue, blaming
from pipeline.files import atomic, pictures, tracks
from pipeline.product import Frames, Product, Stock
from synth.elements.samples import Elements

MANY = 200  # threads or sheets, where the scene does not say how many
FOLLOWED = 0.2  # of its frames and samples, to each side: what a bundle does more slowly than that is not detail
LIFT = 2.5  # seconds that a lift takes at least
NEIGHBOURS = 9  # threads that are copied side by side
TOPOLOGIES = {"beads": "none", "school": "none", "noodles": "thread", "paper": "sheet"}
"""How the elements hang together that a [render] kind draws."""
PLURALS = {"none": "points", "thread": "threads", "sheet": "sheets"}
SIZES = {"none": 0.8, "thread": 0.38, "sheet": 0.02}
"""Length of a fish, radius of a thread, thickness of a sheet whose file does not say it, spacings."""
THREAD = 4  # samples or more
THICKEST = 2.0  # threads that `hybrid` pushes apart, over how far apart they are


def make_exemplar(scene: ElementsScene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, Elements]]:
    """I, by procedure or from a file, scaled so that its spacing is elements.spacing."""
    example = _exemplar(scene)
    spacing = _spacing(example)
    if not spacing > 0:
        raise ValueError("its elements are all in one place")
    example = _scaled(example, scene.elements.spacing / spacing)
    if scene.render.kind == "beads":
        radius = scene.elements.radius * scene.elements.spacing
        example = replace(example, size=example.size * np.float32(radius / np.median(example.size)))
    yield 0, example


def _exemplar(scene: ElementsScene) -> Elements:
    from synth.elements import arrangement, keyframed, school, simulation

    wanted: Any = scene.exemplar
    match wanted.kind:
        case "poisson-disk":
            return arrangement.poisson_disk((wanted.across,) * 2, seed=scene.seed)
        case "jittered-grid":
            return arrangement.jittered_grid((wanted.across,) * 2, jitter=wanted.jitter, seed=scene.seed)
        case "hexagonal-grid":
            return arrangement.hexagonal_grid((wanted.across, wanted.across + wanted.across % 2))
        case "dots":
            return arrangement.drawn(pictures.read_foreign(wanted.file, "exemplar.file")[::-1])
        case "school":
            schools: dict[str, Any] = {
                "homogeneous": school.homogeneous, "crossing": school.crossing, "mixed": school.mixed}
            return schools[wanted.behaviour](wanted.count, frames=wanted.frames, rate=scene.fps, seed=scene.seed)[0]
        case "noodles":
            threads: Any = simulation.noodles if wanted.style == "simulated" else keyframed.jagged
            return threads(frames=wanted.frames, rate=scene.fps, seed=scene.seed)
        case "paper":
            sheets: dict[str, Any] = {"simulated": simulation.sheets, "folded": keyframed.folded,
                                      "fluttering": keyframed.fluttering}
            return sheets[wanted.style](frames=wanted.frames, rate=scene.fps, seed=scene.seed)
    with blaming("exemplar.file"):
        return _from_tracks(scene, wanted)


def _from_tracks(scene: ElementsScene, wanted: TracksExemplar) -> Elements:
    """The elements of a file, of the topology and the dimensions of the scene, at its rate."""
    drawn = scene.render.kind
    found = tracks.read_foreign(
        wanted.file, "exemplar.file", rate=wanted.rate, otherwise=scene.fps,
        dimensions=2 if wanted.captured else scene.dimension, fewest_frames=1 if drawn == "beads" else 2)
    if found.topology != TOPOLOGIES[drawn]:
        raise WrongValue("render.kind", f'"{drawn}" draws {PLURALS[TOPOLOGIES[drawn]]}; the elements of '
                                        f"{wanted.file.name} are {PLURALS[found.topology]}")
    if found.topology == "thread" and found.grid[0] < THREAD:
        raise ValueError(f"threads of {found.grid[0]} samples; it takes {THREAD} or more")
    if wanted.captured:
        from synth.elements import school

        if found.dimensions == 3:
            raise WrongValue("exemplar.captured", f"tracks of a film are x and y; {wanted.file.name} has depth")
        # a film's y points down, as school.tracked takes it
        found = school.tracked(found.positions[:, :, 0], found.rate)[0]
    elif wanted.file.suffix.lower() != ".npz":
        found = replace(found, size=np.full(found.count, SIZES[found.topology] * _spacing(found)))
    return _at_rate(_in_space(found, scene.dimension if found.topology == "none" else 3), scene.fps)


def _in_space(elements: Elements, dimensions: int) -> Elements:
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


def _at_rate(elements: Elements, rate: float) -> Elements:
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


def _spacing(example: Elements) -> float:
    """What elements.spacing says of an exemplar: of points and threads the nearest distance, of sheets that of their
    samples."""
    from synth.elements import neighborhood

    if example.topology != "sheet":
        places = example.positions if example.coarse is None else example.coarse
        return neighborhood.spacing(places, _period(example))
    surface = example.positions.reshape(*example.positions.shape[:2], *example.grid, example.dimensions)
    return float(np.linalg.norm(np.diff(surface, axis=3), axis=-1).mean())


def _scaled(example: Elements, factor: float) -> Elements:
    lengths = {name: getattr(example, name) * np.float32(factor) for name in ("positions", "size", "coarse", "box")
               if getattr(example, name) is not None}
    return replace(example, **lengths)


def _period(example: Elements) -> np.ndarray | None:
    return None if example.box is None else (example.box[1] - example.box[0]).astype(np.float64)


def make_elements(scene: ElementsScene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, Any]]:
    """O, and its energy after each search (Eq. 5). An interrupted run goes on after the last whole iteration, or frame
    by frame after the last whole frame: same bits."""
    example = stock.read("exemplar")
    within, start, guided = (_of_points if example.topology == "none" else _on_coarse)(scene, stock, example)
    settings = _settings(scene)
    kept = _kept(stock)
    from synth.elements import synthesis

    if scene.synthesis.sequence == "together":
        run = synthesis.together(within, start.elements, start.source, guided, settings, kept)
    else:
        run = synthesis.by_frames(within, start.elements, start.source, scene.frames, guided, settings, kept)
    for optimizer in run:
        _keep(stock, optimizer.state())
    yield 0, (optimizer.result(), np.array(optimizer.energies))


def _settings(scene: ElementsScene) -> Any:
    from synth.elements.synthesis import Settings

    wanted = scene.synthesis
    return Settings(iterations=wanted.iterations, n=wanted.matches, coherent=wanted.search == "k-coherence",
                    solver=wanted.assignment, centre=wanted.hold, hybrid=wanted.hybrid,
                    control=scene.elements.control.weight * scene.elements.spacing**2 if scene.elements.control else 0)


def _shape(scene: ElementsScene, example: Elements) -> Any:
    from synth.elements.neighborhood import Shape

    wanted = scene.synthesis
    radius = wanted.neighborhood * scene.elements.spacing
    # Table 2: σ_p is measured by the neighbourhood; Eq. 10 divides squares of distances by it
    sigma = wanted.sigma_p * radius**2 if wanted.sigma_p else np.inf
    # sheets are compared by their own samples alone (§3.2)
    most = {"most": 1} if example.topology == "sheet" else {}
    return Shape(radius, wanted.before, wanted.after, wanted.whole, sigma=sigma, **most)


def _of_points(scene: ElementsScene, stock: Stock, example: Elements) -> tuple[Any, Any, Any]:
    """The exemplar for the search, the first guess and the guides of elements that are points in a domain."""
    from synth.elements import initialize, search
    from synth.elements.constraints import Constraints
    from synth.elements.synthesis import Guides

    wanted = scene.elements
    control = guides.control(scene)
    ranks = guides.ranked(example, wanted.control.property) if wanted.control else np.zeros(example.count)
    within = search.exemplar(example, _shape(scene, example), period=_period(example), control=ranks)
    region = guides.domain(scene, stock)
    count = wanted.count or initialize.as_dense(example, region, wanted.spacing)
    guides.require_room(scene, region, count)
    flow, turn, allowed = guides.flow(scene, stock, region), guides.turn(scene, stock), guides.allowed(scene, example)
    pins = [pin for pin in wanted.pins if pin.frame == 1]
    together = scene.synthesis.sequence == "together"
    with blaming("synthesis.neighborhood"):
        start = initialize.points(
            example, region, scene.frames if together else 1, within.shape.radius, wanted.spacing, scene.seed,
            turn=None if turn is None else lambda points: turn(0, points),
            pins=np.array([pin.at for pin in pins]) if pins else None,
            allowed=None if allowed is None else lambda points: allowed(0, points),
            unlike=None if control is None else lambda points, elements: (
                control(0, points) - ranks[elements]) ** 2, count=count)
    if together and flow is not None:
        start = initialize.carried(start, flow)
    margin = 0.5 * wanted.spacing if scene.obstacles or wanted.domain else 0.0
    return within, start, Guides(
        Constraints(region, margin, guides.pins(scene, start.elements.positions), hard=margin > 0), flow, turn,
        control=control, allowed=allowed, period=guides.toroidal(scene))


def _on_coarse(scene: ElementsScene, stock: Stock, example: Elements) -> tuple[Any, Any, Any]:
    """The exemplar for the search, the first guess and the guides of threads or sheets on coarse positions."""
    from synth.elements import initialize, orientation, search
    from synth.elements.constraints import Constraints
    from synth.elements.synthesis import Guides

    thick = 2 * float(example.size.max()) / scene.elements.spacing
    if scene.synthesis.hybrid and example.topology == "thread" and thick > THICKEST:
        raise WrongValue("synthesis.hybrid", f"the exemplar's threads are {thick:.1f} times as thick as far apart, "
                                             f"and {THICKEST:g} times is the most that can be pushed apart")
    example = in_detail(example)
    coarse = stock.read("coarse").positions
    assert example.coarse is not None
    inner, outer = (orientation.along(positions, example.grid) for positions in (example.coarse, coarse))
    within = search.exemplar(example, _shape(scene, example), inner)
    neighbours = NEIGHBOURS if example.topology == "thread" else 1
    start = initialize.on_coarse(example, coarse, inner, outer, neighbours, scene.seed, scene.fps)
    return within, start, Guides(Constraints(), frames=outer)


def in_detail(example: Elements) -> Elements:
    """An exemplar with the C that its details are told from: of threads, one that follows what they do slowly."""
    from synth.elements import decomposition

    example = _decomposed(example)
    if example.topology == "thread":
        return decomposition.following(example, round(FOLLOWED * example.frames), round(FOLLOWED * example.grid[0]))
    return example


def _decomposed(example: Elements) -> Elements:
    """An exemplar with its C."""
    if example.coarse is not None:
        return example
    from synth.elements import decomposition

    return decomposition.with_coarse(example)


def make_coarse(scene: ElementsScene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, Elements]]:
    """C of threads or sheets, as many as the output has."""
    from synth.elements import bundle, falling_paper, simulation

    wanted: Any = scene.coarse
    example = _decomposed(stock.read("exemplar"))
    assert example.coarse is not None
    count = scene.elements.count or MANY
    if wanted.kind == "tracks":
        foreign = _coarse_tracks(scene, wanted)
        if foreign.grid != example.grid:
            raise WrongValue("coarse.file", f"{_sized(foreign.grid)} samples for an element, and {_sized(example.grid)}"
                                            " in the exemplar")
        yield 0, _looking_like(replace(foreign, size=np.full(foreign.count, np.median(example.size))), example)
        return
    spacing = scene.elements.spacing
    settings: dict[str, Any] = {"frames": scene.frames, "rate": scene.fps, "seed": scene.seed}
    if wanted.kind == "gust":
        if example.grid[0] != example.grid[1]:
            raise WrongValue("coarse.kind", f'"gust" tosses square sheets; those of the exemplar are '
                                            f"{_sized(example.grid)}")
        with blaming("elements.count"):
            tossed = falling_paper.tossed(count, side=example.grid[0], **settings)
        yield 0, _scaled(tossed, spacing)
        return
    thick = float(np.linalg.norm(bundle.section(count, 1.0), axis=1).max()) + 0.5
    length = float(np.linalg.norm(np.diff(example.coarse[0, 0], axis=0), axis=-1).sum()) / spacing
    # lifted faster than that a simulation comes apart: a shorter animation shows the same lift in fewer frames
    enough = max(scene.frames, round(LIFT * scene.fps))
    curve = simulation.lifted(samples=example.grid[0], length=max(length, 10 * thick), thick=thick,
                              **{**settings, "frames": enough})
    curve = curve[np.linspace(0, enough - 1, scene.frames).round().astype(int)]
    made = _scaled(bundle.duplicated(curve, count, radius=float(np.median(example.size)) / spacing, rate=scene.fps),
                   spacing)
    yield 0, _looking_like(made, example)


def _looking_like(made: Elements, example: Elements) -> Elements:
    """Elements of the kinds and colours of the exemplar's, one after the other."""
    alike = np.arange(made.count) % example.count
    return replace(made, kind=example.kind[alike], colour=example.colour[alike])


def _coarse_tracks(scene: ElementsScene, wanted: TracksMotion) -> Elements:
    """C from a file, as long as the animation, in heights as it stands."""
    found = tracks.read_foreign(wanted.file, "coarse.file", otherwise=scene.fps, dimensions=3, fewest_elements=1)
    with blaming("coarse.file"):
        if found.topology != TOPOLOGIES[scene.render.kind]:
            raise ValueError(f"its elements are {PLURALS[found.topology]}")
        found = _at_rate(_in_space(found, 3), scene.fps)
        if found.frames < scene.frames:
            raise ValueError(f"lasts {found.frames} frames, and the animation {scene.frames}")
    return replace(found, positions=found.positions[: scene.frames], coarse=None)


def _sized(grid: tuple[int, ...]) -> str:
    return " × ".join(map(str, grid))


def check_coarse(scene: ElementsScene) -> None:
    """Refuse tracks that do not do."""
    if isinstance(scene.coarse, TracksMotion):
        _coarse_tracks(scene, scene.coarse)


def check_output(scene: ElementsScene) -> None:
    """Refuse a domain, or pictures of a control map or of selections, that do not do."""
    guides.control(scene)
    guides.maps(scene)
    if scene.elements.domain is not None:
        guides.shaped(scene)


STATE = "elements.state.npz"


def _keep(stock: Stock, state: dict[str, np.ndarray]) -> None:
    with atomic.replacing(stock.work / STATE) as temporary, temporary.open("wb") as content:
        np.savez(content, allow_pickle=False, **{"key": np.array(stock.key(0)), **state})


def _kept(stock: Stock) -> dict[str, np.ndarray] | None:
    """The state of an interrupted run of the same key; None if there is none, or a crash of the machine damaged it."""
    try:
        with (stock.work / STATE).open("rb") as file, np.load(file, allow_pickle=False) as kept:
            return dict(kept) if str(kept["key"]) == stock.key(0) else None
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None


def write_tracks(file: Path, elements: Elements, scene: ElementsScene) -> None:
    """Write elements."""
    tracks.write(file, elements)


def write_output(file: Path, made: tuple[Elements, np.ndarray], scene: ElementsScene) -> None:
    """Write the output; its energies lie beside the tracks as the array `energy`."""
    tracks.write(file, made[0], energy=made[1])


def read_tracks(file: Path, scene: ElementsScene) -> Elements:
    """Read elements."""
    return tracks.read(file)


def _npz(scene: ElementsScene) -> str:
    return "npz"


METHODS = ("pipeline.guides", "synth.elements.synthesis", "synth.elements.initialize",
           "synth.elements.orientation", "synth.elements.decomposition")


def products(scene: ElementsScene) -> tuple[Product, ...]:
    """The exemplar, the coarse motion, the output; and what is made of them to be looked at."""
    solid = obstacles.inputs(scene)
    fitted = ("dimension",) if scene.exemplar.kind == "tracks" else ()
    example = Product(
        name="exemplar", stage="synth", folder="fields", suffix=_npz, animated=False,
        reads=("exemplar", "elements.spacing", "elements.radius", "render.kind", "seed", "fps", *fitted), inputs=(),
        methods=("synth.elements.arrangement", "synth.elements.school", "synth.elements.simulation",
                 "synth.elements.keyframed"), make=make_exemplar, write=write_tracks, read=read_tracks)
    made = [example]
    coarse: tuple[tuple[str, Frames], ...] = ()
    if scene.flows:
        made.append(fields.coarse_product(scene))
        # all frames of the flow at once: the one file of the output depends on each
        coarse = (("L", "every"),)
    elif scene.coarse is not None:
        made.append(Product(
            name="coarse", stage="synth", folder="fields", suffix=_npz, animated=False,
            reads=("coarse", "elements.count", "elements.spacing", "frames", "seed", "fps"),
            inputs=(("exemplar", "once"),),
            methods=("synth.elements.simulation", "synth.elements.falling_paper", "synth.elements.bundle"), make=make_coarse,
            write=write_tracks, read=read_tracks, check=check_coarse))
        coarse = (("coarse", "once"),)
    made.append(Product(
        name="elements", stage="synth", folder="fields", suffix=_npz, animated=False,
        reads=("elements", "synthesis", "frames", "seed", "fps"), inputs=(("exemplar", "once"), *coarse, *solid),
        methods=METHODS, make=make_elements, write=write_output, read=read_tracks, check=check_output))
    return (*made, *looks.products(scene))
