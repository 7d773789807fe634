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
from pipeline.elements_schema import ElementsScene
from pipeline.files import atomic, pictures, tracks
from pipeline.product import Frames, Product, Stock
from synth.elements.samples import Elements
from synth.field import domain_origin

MANY = 200  # threads or sheets, where the scene does not say how many
FOLLOWED = 0.2  # of its frames and samples, to each side: what a bundle does more slowly than that is not detail
LIFT = 2.5  # seconds that a lift takes at least
NEIGHBOURS = 9  # threads that are copied side by side


def make_exemplar(scene: ElementsScene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, Elements]]:
    """I, by procedure or from a file, scaled so that its spacing is elements.spacing."""
    example = _exemplar(scene)
    example = _scaled(example, scene.elements.spacing / _spacing(example))
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
            threads: dict[str, Any] = {"simulated": simulation.noodles, "jagged": handmade.jagged}
            return threads[wanted.style](frames=wanted.frames, rate=scene.fps, seed=scene.seed)
        case "papers":
            sheets: dict[str, Any] = {"simulated": simulation.sheets, "folded": handmade.folded,
                      "fluttering": handmade.fluttering}
            return sheets[wanted.style](frames=wanted.frames, rate=scene.fps, seed=scene.seed)
    return tracks.read_foreign(wanted.file, "exemplar.file", rate=wanted.rate or scene.fps,
                               dimensions=scene.dimension)


def _spacing(example: Elements) -> float:
    """What elements.spacing says of an exemplar: of points and threads the nearest distance, of sheets that of their
    samples."""
    from synth.elements import neighborhood

    if example.topology != "sheet":
        places = example.positions if example.coarse is None else example.coarse
        return neighborhood.spacing(places, _period(example))
    surface = example.positions.reshape(*example.positions.shape[:2], *example.grid, 3)
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
    optimizer = None
    for optimizer in run:
        _keep(stock, optimizer.state())
    if optimizer is None:  # the run was interrupted after its last iteration, before its file was whole
        raise RuntimeError("nothing was left to do")
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
    if example.dimensions != scene.dimension:
        raise ValueError(f"the exemplar has {example.dimensions} dimensions, the domain {scene.dimension}")
    control = _control(scene)
    ranks = _ranked(example, wanted.control.property) if wanted.control else np.zeros(example.count)
    within = search.exemplar(example, _shape(scene, wanted.spacing), period=_period(example),
                             control=ranks)
    region = domain(scene, stock)
    flow, turn, allowed = _flow(scene, stock, region), _turn(scene, stock), _allowed(scene)
    pins = [pin for pin in wanted.pins if pin.frame == 1]
    together = scene.synthesis.sequence == "together"
    start = initialize.points(
        example, region, scene.frames if together else 1, within.shape.radius, wanted.spacing, scene.seed,
        turn=None if turn is None else lambda points: turn(0, points),
        pins=np.array([pin.at for pin in pins]) if pins else None,
        allowed=None if allowed is None else lambda points: allowed(0, points),
        unlike=None if control is None else lambda points, elements: (
            control(0, points) - ranks[elements]) ** 2,
        count=wanted.count or None)
    if together and flow is not None:
        start = initialize.carried(start, flow)
    margin = 0.5 * wanted.spacing if scene.obstacles or wanted.domain else 0.0
    return within, start, Guides(
        Constraints(region, margin, _pins(scene, start.elements.positions), hard=margin > 0), flow, turn,
        control=control, allowed=allowed, period=_toroidal(scene))


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
        shape = obstacles.solid(scene, scene.elements.domain, "elements.domain").distance
        inside = np.minimum(inside, -shape * cell)
    if scene.obstacles:
        inside = np.minimum(inside, stock.read("solid").values)
    if not (inside > 0).any():
        raise ValueError("the domain is empty: obstacles fill it, or its shape lies outside")
    return Domain(inside.astype(np.float32), cell, origin, _toroidal(scene))


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


def _allowed(scene: ElementsScene) -> Any:
    """Which kinds may stand where, as bits; None where all may everywhere."""
    if not scene.elements.selections:
        return None
    maps = [pictures.read_grey(s.file, f"elements.selections[{n}].file") > 0.5
            for n, s in enumerate(scene.elements.selections)]
    bits = [sum(1 << kind for kind in s.kinds) for s in scene.elements.selections]

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

    if example.coarse is None:
        example = decomposition.with_coarse(example)
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


def make_coarse(scene: ElementsScene, stock: Stock, frames: list[int]) -> Iterator[tuple[int, Elements]]:
    """C of threads or sheets, as many as the output has."""
    from synth.elements import bundle, scraps, simulation

    wanted: Any = scene.coarse
    example = stock.read("exemplar")
    count = scene.elements.count or MANY
    if wanted.kind == "tracks":
        foreign = tracks.read_foreign(wanted.file, "coarse.file", rate=scene.fps, fewest_elements=1)
        if foreign.grid != example.grid:
            raise ValueError(f"coarse.file has a grid {foreign.grid} for an element, the exemplar {example.grid}")
        yield 0, foreign
        return
    spacing = scene.elements.spacing
    settings: dict[str, Any] = {"frames": scene.frames, "rate": scene.fps, "seed": scene.seed}
    if wanted.kind == "gust":
        yield 0, _scaled(scraps.tossed(count, side=example.grid[0], **settings), spacing)
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
    alike = np.arange(count) % example.count
    yield 0, replace(made, kind=example.kind[alike], colour=example.colour[alike])


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
    example = Product(
        name="exemplar", stage="synth", folder="fields", suffix=_npz, animated=False,
        reads=("exemplar", "elements.spacing", "elements.radius", "render.kind", "seed", "fps"), inputs=(),
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
            write=write_tracks, read=read_tracks))
        coarse = (("coarse", "once"),)
    made.append(Product(
        name="elements", stage="synth", folder="fields", suffix=_npz, animated=False,
        reads=("elements", "synthesis", "frames", "seed", "fps"), inputs=(("exemplar", "once"), *coarse, *solid),
        methods=METHODS, make=make_elements, write=write_output, read=read_tracks))
    return (*made, *looks.products(scene))
