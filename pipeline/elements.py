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

from pipeline import fields, looks, obstacles
from pipeline.elements_schema import MOST, ElementsScene, TracksExemplar, TracksMotion
from pipeline.errors import WrongValue, blaming
from pipeline.files import atomic, pictures, tracks
from pipeline.product import Frames, Product, Stock
from synth.elements.samples import Elements
from synth.field import domain_origin

MANY = 200  # threads or sheets, where the scene does not say how many
FOLLOWED = 0.2  # of its frames and samples, to each side: what a bundle does more slowly than that is not detail
LIFT = 2.5  # seconds that a lift takes at least
NEIGHBOURS = 9  # threads that are copied side by side
TOPOLOGIES = {"beads": "none", "shoal": "none", "noodles": "thread", "papers": "sheet"}
"""How the elements hang together that a [render] kind draws."""
PLURALS = {"none": "points", "thread": "threads", "sheet": "sheets"}
SIZES = {"none": 0.8, "thread": 0.38, "sheet": 0.02}
"""Length of a fish, radius of a thread, thickness of a sheet whose file does not say it, spacings."""
THREAD = 4  # samples or more
CROWDED = 0.6  # spacings: an output whose elements cannot be farther apart than that holds too many


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
    from synth.elements import arrangement, handmade, school, simulation

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
        case "shoal":
            shoals: dict[str, Any] = {
                "homogeneous": school.homogeneous, "crossing": school.crossing, "mixed": school.mixed}
            return shoals[wanted.behaviour](wanted.count, frames=wanted.frames, rate=scene.fps, seed=scene.seed)[0]
        case "noodles":
            threads: Any = simulation.noodles if wanted.style == "simulated" else handmade.jagged
            return threads(frames=wanted.frames, rate=scene.fps, seed=scene.seed)
        case "papers":
            sheets: dict[str, Any] = {"simulated": simulation.sheets, "folded": handmade.folded,
                                      "fluttering": handmade.fluttering}
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
    within, start, guides = (_of_points if example.topology == "none" else _on_coarse)(scene, stock, example)
    settings = _settings(scene)
    kept = _kept(stock)
    from synth.elements import synthesis

    if scene.synthesis.sequence == "together":
        run = synthesis.together(within, start.elements, start.source, guides, settings, kept)
    else:
        run = synthesis.by_frames(within, start.elements, start.source, scene.frames, guides, settings, kept)
    for optimizer in run:
        _keep(stock, optimizer.state())
    yield 0, (optimizer.result(), np.array(optimizer.energies))


def _settings(scene: ElementsScene) -> Any:
    from synth.elements.synthesis import Settings

    wanted = scene.synthesis
    return Settings(iterations=wanted.iterations, n=wanted.matches, coherent=wanted.search == "k-coherence",
                    solver=wanted.assignment, centre=wanted.hold, hybrid=wanted.hybrid,
                    control=scene.elements.control.weight * scene.elements.spacing**2 if scene.elements.control else 0)


def _shape(scene: ElementsScene, spacing: float) -> Any:
    from synth.elements.neighborhood import Shape

    wanted = scene.synthesis
    radius = wanted.neighborhood * spacing
    # Table 2: σ_p is measured by the neighbourhood; Eq. 10 divides squares of distances by it
    sigma = wanted.sigma_p * radius**2 if wanted.sigma_p else np.inf
    # sheets are compared by their own samples alone (§3.2)
    most = {"most": 1} if scene.exemplar.kind == "papers" else {}
    return Shape(radius, wanted.before, wanted.after, wanted.whole, sigma=sigma, **most)


def _of_points(scene: ElementsScene, stock: Stock, example: Elements) -> tuple[Any, Any, Any]:
    """The exemplar for the search, the first guess and the guides of elements that are points in a domain."""
    from synth.elements import initialize, search
    from synth.elements.constraints import Constraints
    from synth.elements.synthesis import Guides

    wanted = scene.elements
    control = _control(scene)
    ranks = _ranked(example, wanted.control.property) if wanted.control else np.zeros(example.count)
    within = search.exemplar(example, _shape(scene, wanted.spacing), period=_period(example), control=ranks)
    region = domain(scene, stock)
    count = wanted.count or initialize.as_dense(example, region, wanted.spacing)
    _require_room(scene, region, count)
    flow, turn, allowed = _flow(scene, stock, region), _turn(scene, stock), _allowed(scene, example)
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
        Constraints(region, margin, _pins(scene, start.elements.positions), hard=margin > 0), flow, turn,
        control=control, allowed=allowed, period=_toroidal(scene))


def _require_room(scene: ElementsScene, region: Any, count: int) -> None:
    """Raise for an output that is over-constrained: more elements than the domain holds, more hard positions than
    elements, or one that lies outside."""
    if count > MOST:
        raise WrongValue("elements.spacing", f"{count:,} elements would fill the domain; {MOST:,} are the most")
    room = float((region.inside > 0).sum()) * region.cell**scene.dimension
    # of the densest packing, in the plane or in space
    most = room / ((CROWDED * scene.elements.spacing) ** scene.dimension * (0.866 if scene.dimension == 2 else 0.707))
    if count > most:
        raise WrongValue("elements.count", f"{count:,} elements are more than the domain holds: "
                                           f"{int(most):,} would be {CROWDED:g} spacings apart")
    pinned: dict[int, int] = {}
    for number, pin in enumerate(scene.elements.pins):
        pinned[pin.frame] = pinned.get(pin.frame, 0) + 1
        cells = (np.array(pin.at) - region.origin) / region.cell
        beyond = (cells < -0.5) | (cells > np.array(scene.cells) - 0.5)  # the distance is not known there
        if beyond.any() or region.distance(np.array([pin.at]))[0] < 0:
            raise WrongValue(f"elements.pins[{number}].at", "is outside the domain, or in an obstacle")
    frame = max(pinned, key=lambda f: pinned[f], default=0)
    if frame and pinned[frame] > count:
        raise WrongValue("elements.pins", f"{pinned[frame]} hard positions in frame {frame}, and {count} elements")


def _toroidal(scene: ElementsScene) -> np.ndarray | None:
    """The period of the output, 0 along axes that end."""
    if not scene.elements.toroidal:
        return None
    return np.array([scene.cells[0] / scene.cells[1], *[0.0] * (scene.dimension - 1)])


def domain(scene: ElementsScene, stock: Stock) -> Any:
    """Where elements may be: the domain's rectangle and the shape in it, less the obstacles; heights."""
    from synth.elements.constraints import Domain

    cell = 1.0 / scene.cells[1]
    origin = np.array(domain_origin(scene.shape))
    inside = np.full(scene.shape, np.inf)
    for axis, count in enumerate(scene.shape):
        if scene.elements.toroidal and axis == scene.dimension - 1:
            continue
        at = (np.arange(count) + 0.5) * cell
        inside = np.minimum(inside, np.minimum(at, count * cell - at).reshape(
            [-1 if n == axis else 1 for n in range(scene.dimension)]))
    if scene.elements.domain is not None:
        inside = np.minimum(inside, -_shaped(scene) * cell)
    if scene.obstacles:
        inside = np.minimum(inside, stock.read("solid").values)
    if not (inside > 0).any():
        raise WrongValue("obstacles" if scene.obstacles else "elements.domain", "leave elements no room"
                         if scene.obstacles else "is smaller than a cell of elements.size")
    return Domain(inside.astype(np.float32), cell, origin, _toroidal(scene))


def _shaped(scene: ElementsScene) -> np.ndarray:
    """The signed distance to the border of the domain's shape, cells, negative inside."""
    with blaming("elements.domain"):
        return obstacles.solid(scene, scene.elements.domain, "elements.domain").distance


def _flow(scene: ElementsScene, stock: Stock, region: Any) -> Any:
    """How far points are carried from a frame to the next, heights; None without a flow. Nothing flows out of a domain
    that has a shape."""
    if not scene.flows:
        return None
    from synth.motion.coarse import upsample
    from synth.projection import project

    before: list[np.ndarray] = []

    def velocity(frame: int) -> np.ndarray:
        """Heights per second; of a steady flow it is found once."""
        values = stock.read("L", frame).values
        if scene.elements.domain is None:
            return values
        if not before or not np.array_equal(before[0], values):
            cells = scene.shape[-2]
            before[:] = [values, project(upsample(values, scene.shape), "open", region.inside * cells)]
        return before[1]

    def flow(t: int, points: np.ndarray) -> np.ndarray:
        """By the midpoint rule: a step along the tangent would spiral out of every vortex."""
        field = velocity(min(t + 1, scene.frames)) / scene.fps
        return _sampled(scene, field, points + 0.5 * _sampled(scene, field, points))

    return flow


def _sampled(scene: ElementsScene, values: np.ndarray, points: np.ndarray) -> np.ndarray:
    """A field of the domain (…, D) at points (M, D), linearly between its cells."""
    from scipy import ndimage

    at = (points - np.array(domain_origin(values.shape[:-1]))) * values.shape[-3]
    if scene.elements.toroidal:
        at[:, 0] = np.mod(at[:, 0], values.shape[-2])
    return np.stack([ndimage.map_coordinates(values[..., d], at[:, ::-1].T, order=1, mode="nearest")
                     for d in range(scene.dimension)], axis=-1)


def _turn(scene: ElementsScene, stock: Stock) -> Any:
    """The orientation field: local frames at points; None where nothing is turned."""
    from synth.elements.orientation import along_directions

    match scene.elements.along:
        case "exemplar":
            return None
        case "flow":
            return lambda t, points: along_directions(
                _sampled(scene, stock.read("L", min(t + 1, scene.frames)).values, points))
    centre = np.array([0.0, 0.5, 0.0][: scene.dimension])

    def circling(t: int, points: np.ndarray) -> np.ndarray:
        away = points - centre
        round_ = np.zeros_like(away)
        round_[:, 0], round_[:, 1] = -away[:, 1], away[:, 0]
        return along_directions(round_)

    return circling


def _ranked(example: Elements, name: str) -> np.ndarray:
    """The elements' property (E,) from 0, the least, to 1."""
    values = np.asarray(getattr(example, name), np.float64)
    return (values - values.min()) / max(float(np.ptp(values)), 1e-9)


def _control(scene: ElementsScene) -> Any:
    """The control map at points of the domain, 0 to 1; None without one."""
    if scene.elements.control is None:
        return None
    tones = pictures.read_grey(scene.elements.control.file, "elements.control.file")
    return lambda t, points: _map_at(scene, tones, points, 1)


def _map_at(scene: ElementsScene, values: np.ndarray, points: np.ndarray, order: int) -> np.ndarray:
    """A picture that fills the domain, lowest row first, at points (M, D)."""
    from scipy import ndimage

    rows, columns = values.shape
    width = scene.cells[0] / scene.cells[1]
    at = [points[:, 1] * rows - 0.5, (points[:, 0] / width + 0.5) * columns - 0.5]
    return ndimage.map_coordinates(values, at, order=order, mode="nearest")


def _maps(scene: ElementsScene) -> list[np.ndarray]:
    """Where each selection is, bool, lowest row first."""
    return [pictures.read_grey(s.file, f"elements.selections[{n}].file") > 0.5
            for n, s in enumerate(scene.elements.selections)]


def _allowed(scene: ElementsScene, example: Elements) -> Any:
    """Which kinds may stand where, as bits; None where all may everywhere."""
    if not scene.elements.selections:
        return None
    known = sorted(set(example.kind.tolist()))
    for number, selection in enumerate(scene.elements.selections):
        for kind in selection.kinds:
            if kind not in known:
                raise WrongValue(f"elements.selections[{number}].kinds", f"the exemplar has no element of kind {kind}; "
                                                                         f"it has {', '.join(map(str, known))}")
    maps = _maps(scene)
    bits = [sum(1 << kind for kind in set(s.kinds)) for s in scene.elements.selections]

    def allowed(t: int, points: np.ndarray) -> np.ndarray:
        found = np.zeros(len(points), np.int64)
        for bright, kinds in zip(maps, bits, strict=True):
            inside = _map_at(scene, bright.astype(np.uint8), points, 0) > 0
            found |= np.where(inside, kinds, 0)
        others = (1 << 31) - 1
        for kinds in bits:
            others &= ~kinds
        return np.where(found > 0, found, others).astype(np.int32)

    return allowed


def _pins(scene: ElementsScene, positions: np.ndarray) -> Any:
    """The hard positions, each for the element that is nearest to it in its frame and has none there yet."""
    from synth.elements.constraints import Pins

    if not scene.elements.pins:
        return None
    taken: set[tuple[int, int]] = set()
    chosen = []
    for pin in scene.elements.pins:
        frame = min(pin.frame, len(positions)) - 1
        away = np.linalg.norm(positions[frame, :, 0] - np.array(pin.at), axis=1)
        away[[n for f, n in taken if f == pin.frame]] = np.inf
        taken.add((pin.frame, int(np.argmin(away))))
        chosen.append(int(np.argmin(away)))
    return Pins(np.array([pin.frame - 1 for pin in scene.elements.pins]), np.array(chosen),
                np.array([pin.at for pin in scene.elements.pins]))


def _on_coarse(scene: ElementsScene, stock: Stock, example: Elements) -> tuple[Any, Any, Any]:
    """The exemplar for the search, the first guess and the guides of threads or sheets on coarse positions."""
    from synth.elements import decomposition, initialize, orientation, search
    from synth.elements.constraints import Constraints
    from synth.elements.synthesis import Guides

    example = _decomposed(example)
    assert example.coarse is not None
    if example.topology == "thread":
        example = decomposition.following(example, round(FOLLOWED * example.frames), round(FOLLOWED * example.grid[0]))
    coarse = stock.read("coarse").positions

    def frames_of(positions: np.ndarray) -> np.ndarray:
        if example.topology == "thread":
            return orientation.along_threads(positions)
        return orientation.on_sheets(positions, example.grid)

    assert example.coarse is not None
    inner, outer = frames_of(example.coarse), frames_of(coarse)
    within = search.exemplar(example, _shape(scene, scene.elements.spacing), inner)
    neighbours = NEIGHBOURS if example.topology == "thread" else 1
    start = initialize.on_coarse(example, coarse, inner, outer, neighbours, scene.seed, scene.fps)
    return within, start, Guides(Constraints(), frames=outer)


def _decomposed(example: Elements) -> Elements:
    """An exemplar with its C."""
    if example.coarse is not None:
        return example
    from synth.elements import decomposition

    return decomposition.with_coarse(example)


def make_coarse(scene: ElementsScene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, Elements]]:
    """C of threads or sheets, as many as the output has."""
    from synth.elements import bundle, scraps, simulation

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
            tossed = scraps.tossed(count, side=example.grid[0], **settings)
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
    _control(scene)
    _maps(scene)
    if scene.elements.domain is not None:
        _shaped(scene)


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


METHODS = ("synth.elements.synthesis", "synth.elements.initialize", "synth.elements.orientation",
           "synth.elements.decomposition")


def products(scene: ElementsScene) -> tuple[Product, ...]:
    """The exemplar, the coarse motion, the output; and what is made of them to be looked at."""
    solid = obstacles.inputs(scene)
    fitted = ("dimension",) if scene.exemplar.kind == "tracks" else ()
    example = Product(
        name="exemplar", stage="synth", folder="fields", suffix=_npz, animated=False,
        reads=("exemplar", "elements.spacing", "elements.radius", "render.kind", "seed", "fps", *fitted), inputs=(),
        methods=("synth.elements.arrangement", "synth.elements.school", "synth.elements.simulation",
                 "synth.elements.handmade"), make=make_exemplar, write=write_tracks, read=read_tracks)
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
            methods=("synth.elements.simulation", "synth.elements.scraps", "synth.elements.bundle"), make=make_coarse,
            write=write_tracks, read=read_tracks, check=check_coarse))
        coarse = (("coarse", "once"),)
    made.append(Product(
        name="elements", stage="synth", folder="fields", suffix=_npz, animated=False,
        reads=("elements", "synthesis", "frames", "seed", "fps"), inputs=(("exemplar", "once"), *coarse, *solid),
        methods=METHODS, make=make_elements, write=write_output, read=read_tracks, check=check_output))
    return (*made, *looks.products(scene))
