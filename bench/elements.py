"""Elements (ma13): time, memory, how time grows, fidelity, and jitter.

`python -m bench.elements` prints one JSON object and draws out/bench-elements.svg, seconds over elements, and
out/bench-jitter.svg, acceleration over frames. `python -m bench.elements run NAME` measures one case, in a process of
its own so that its memory is its own.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bench import plot
from bench.machine import peak_memory
from bench.synthesis import timed
from pipeline.files import atomic
from synth.elements import (
    arrangement,
    bundle,
    falling_paper,
    fidelity,
    initialize,
    keyframed,
    neighborhood,
    orientation,
    school,
    search,
    simulation,
    synthesis,
)
from synth.elements.constraints import Constraints, Domain
from synth.elements.neighborhood import Shape
from synth.elements.samples import Elements
from synth.elements.synthesis import Controls, Settings

FRAMES = 60
COUNTS = (500, 1000, 2000, 4000, 8000)
GROWTH_FRAMES = 8
CONVERGED = 0.005  # the energy falls by less than this share
MOST = 20  # iterations
REFERENCED = 24  # samples that the reference searches
CURVE, JITTER = Path("out/bench-elements.svg"), Path("out/bench-jitter.svg")


def square(edge: float) -> Domain:
    """A square from 0 to edge."""
    cells = 200
    at = (np.arange(cells) + 0.5) * edge / cells
    away = np.minimum(at, edge - at)
    return Domain(np.minimum(away[:, None], away).astype(np.float32), edge / cells, np.full(2, edge / cells / 2))


def turning(edge: float) -> synthesis.Flow:
    """A slow rotation round the middle of the square that dies towards its border."""

    def flow(t: int, points: np.ndarray) -> np.ndarray:
        away = points - edge / 2
        slower = np.exp(-(away**2).sum(axis=1) / (edge / 3) ** 2)[:, None]
        return 1.5 / edge * np.stack([-away[:, 1], away[:, 0]], axis=-1) * slower

    return flow


def converged(within: search.Exemplar, start: initialize.Copied, controls: Controls,
              settings: Settings) -> dict[str, Any]:
    """Times and energies until the energy stays."""
    energies: list[float] = []

    def run() -> np.ndarray:
        for optimizer in synthesis.together(within, start.elements, start.source, controls,
                                            replace(settings, iterations=MOST)):
            energies.append(optimizer.energies[-1])
            if len(energies) > 1 and energies[-2] - energies[-1] < CONVERGED * energies[-2]:
                optimizer.finish()
                break
        return optimizer.result().positions

    _, took = timed(run)
    return {**took, "iterations": len(energies), "energies": [round(e, 4) for e in energies],
            "peak memory MB": round(peak_memory())}


def particles(count: int = 1000, frames: int = FRAMES) -> dict[str, Any]:
    """Poisson-disk particles in a flow, all frames together, 2.0 neighbourhood."""
    exemplar = arrangement.poisson_disk((10, 10), seed=1)
    edge = float(np.sqrt(count / exemplar.count * 100))
    within = search.exemplar(exemplar, Shape(2.0, 1, 1, sigma=4.0), period=exemplar.period)
    flow = turning(edge)
    start = initialize.carried(initialize.points(exemplar, square(edge), frames, 2.0, 1.0, 1, count=count), flow)
    return converged(within, start, Controls(Constraints(square(edge)), flow), Settings())


def noodles() -> dict[str, Any]:
    """200 noodles of 40 samples, 60 frames, that do not pass through each other."""
    exemplar = keyframed.jagged(frames=FRAMES)
    curve_ = simulation.lifted(FRAMES, length=100.0, thick=8.5)
    coarse = bundle.duplicated(curve_, 200).positions
    inner, outer = orientation.along_threads(exemplar.coarse), orientation.along_threads(coarse)
    within = search.exemplar(exemplar, Shape(3.0, 3, 3), inner)
    start = initialize.on_coarse(exemplar, coarse, inner, outer, 9, 1, 24.0)
    return converged(within, start, Controls(axes=outer), Settings(hybrid=True))


def sheets() -> dict[str, Any]:
    """300 sheets of 7×7 samples, 60 frames."""
    exemplar = keyframed.folded(frames=FRAMES)
    coarse = falling_paper.tossed(300, FRAMES).positions
    inner, outer = (orientation.on_sheets(c, exemplar.grid) for c in (exemplar.coarse, coarse))
    within = search.exemplar(exemplar, Shape(3.0, 5, 4), inner)
    start = initialize.on_coarse(exemplar, coarse, inner, outer, 1, 1, 24.0)
    return converged(within, start, Controls(axes=outer), Settings())


CASES: dict[str, Callable[[], dict[str, Any]]] = {
    "1,000 particles × 60 frames": particles, "200 noodles × 40 samples × 60 frames": noodles,
    "300 sheets × 7×7 samples × 60 frames": sheets}


def growth() -> dict[str, Any]:
    """Processor seconds of one iteration from 500 to 8,000 elements, and the exponent in their number."""
    took = {}
    for count in COUNTS:
        exemplar = arrangement.poisson_disk((10, 10), seed=1)
        edge = float(np.sqrt(count / exemplar.count * 100))
        within = search.exemplar(exemplar, Shape(2.0, 1, 1, sigma=4.0), period=exemplar.period)
        start = initialize.points(exemplar, square(edge), GROWTH_FRAMES, 2.0, 1.0, 1, count=count)
        run = synthesis.together(within, start.elements, start.source, Controls(Constraints(square(edge))), Settings())
        next(run)  # builds the kernels
        before = time.process_time()
        next(run)
        took[count] = time.process_time() - before
    exponent = float(np.polyfit(np.log(list(took)), np.log(list(took.values())), 1)[0])
    curve = plot.Curve(np.array(list(took)), np.array(list(took.values())), [f"{count}" for count in took])
    atomic.write_text(CURVE, plot.svg(f"one iteration: time ~ elements^{exponent:.2f}", "elements", "processor seconds",
                                      {"": curve}, log_x=True))
    return {"processor s of an iteration": {f"{n}": round(s, 3) for n, s in took.items()},
            "exponent": round(exponent, 3)}


def against_reference() -> dict[str, float]:
    """How much faster the kernel searches one sample exhaustively than NumPy and SciPy do."""
    exemplar = arrangement.poisson_disk((10, 10), seed=1)
    shape = Shape(2.0, sigma=4.0)
    within = search.exemplar(exemplar, shape, period=exemplar.period)
    start = initialize.points(exemplar, square(36.0), 1, 2.0, 1.0, 1)
    count = start.elements.count
    output = search.Output(start.elements.positions, start.elements.positions[0, :, 0], None, 1, None,
                           np.zeros(count, np.float32), np.full(count, -1, np.int32))
    matches = search.Matches.none(count, 2, shape)
    searcher = search.Searcher(within, 2, coherent=False)
    searcher.nearest(output, np.arange(1), matches)  # builds the kernel
    _, ours = timed(lambda: searcher.nearest(output, np.arange(1), matches))
    samples = np.arange(REFERENCED) * (count // REFERENCED)
    _, theirs = timed(lambda: search.nearest_reference(within, output, samples, matches.neighbors[samples], 2))
    ratio = {name: theirs[name] / REFERENCED / (ours[name] / count) for name in ("wall", "processor")}
    return {name: round(value, 1) for name, value in ratio.items()}


def own_domain(name: str, exemplar: Elements, shape: Shape, frames: int) -> dict[str, Any]:
    """The output of an exemplar in its own domain, begun from patches of it: how far the three statistics are off."""
    period = np.asarray(exemplar.period, np.float64)
    cell = float(period.max()) / 48
    shape_ = np.ceil(period[::-1] / cell).astype(int)
    whole = Domain(np.ones(shape_, np.float32), cell, exemplar.box[0] + cell / 2, period)
    within = search.exemplar(exemplar, shape, period=period)
    spacing = neighborhood.spacing(exemplar.positions, period)
    start = initialize.points(exemplar, whole, frames, shape.radius, spacing, 1, count=exemplar.count)
    *_, last = synthesis.together(within, start.elements, start.source, Controls(period=period),
                                  Settings(iterations=12))
    given = fidelity.statistics(exemplar.positions, spacing, period)
    found = fidelity.statistics(last.result().positions, spacing, period)
    return {"exemplar": name, "pair correlation": round(fidelity.difference(given.correlation, found.correlation), 3),
            "motion spectrum": round(fidelity.difference(given.spectrum, found.spectrum), 3),
            "nearest distance": round(abs(found.nearest / given.nearest - 1), 3),
            "jitter over the exemplar's": round(fidelity.jitter(last.result().positions)
                                                / max(fidelity.jitter(exemplar.positions), 1e-12), 2)
            if exemplar.frames > 2 else None}


def own_domains() -> list[dict[str, Any]]:
    """Every exemplar that repeats, in its own domain."""
    still = {"Poisson disk": (arrangement.poisson_disk((10, 10), seed=1), 2.0),
             "jittered grid": (arrangement.jittered_grid((10, 10), seed=1), 1.75),
             "hexagonal grid": (arrangement.hexagonal_grid((10, 10)), 1.75)}
    found = [own_domain(name, exemplar, Shape(radius, sigma=radius**2), 1)
             for name, (exemplar, radius) in still.items()]
    schools = {"homogeneous school": school.homogeneous(seed=1)[0], "crossing school": school.crossing(seed=1)[0],
              "school of two sizes": school.mixed(seed=1)[0]}
    return found + [own_domain(name, exemplar, Shape(2.0, 5, 4), exemplar.frames) for name, exemplar in schools.items()]


def jitter() -> dict[str, Any]:
    """Mean squared acceleration of the basic synthesis (§4.1), of the smooth one (§4.2), and with motion weighted, on a
    small exemplar in a flow; in squared spacings per frame⁴."""
    exemplar, edge, frames = arrangement.jittered_grid((5, 5), seed=2), 18.0, 24
    flow = turning(edge)
    unweighted = Shape(1.8, 1, 1, at_rest=1.0)
    variants = {"basic (§4.1)": (1, unweighted), "smooth (§4.2)": (2, replace(unweighted, sigma=1.8**2)),
                "smooth, motion weighted": (2, Shape(1.8, 1, 1, sigma=1.8**2))}
    found, curves = {}, {}
    for name, (n, shape) in variants.items():
        within = search.exemplar(exemplar, shape, period=exemplar.period)
        start = initialize.carried(initialize.points(exemplar, square(edge), frames, 1.8, 1.0, 1), flow)
        *_, last = synthesis.together(within, start.elements, start.source, Controls(Constraints(square(edge)), flow),
                                      Settings(iterations=8, n=n, coherent=False))
        positions = last.result().positions.astype(np.float64)
        found[name] = fidelity.jitter(positions)
        rms = np.sqrt(np.mean(np.sum(np.diff(positions, n=2, axis=0) ** 2, axis=-1), axis=(1, 2)))
        curves[name] = plot.Curve(np.arange(2, frames), rms)
    atomic.write_text(JITTER, plot.svg("jitter in a flow", "frame", "rms acceleration, spacings per frame²", curves,
                                       log_x=False))
    return {name: float(f"{value:.3g}") for name, value in found.items()}


def main() -> None:
    if sys.argv[1:2] == ["run"]:
        print(json.dumps(CASES[sys.argv[2]]()))
        return
    found: dict[str, Any] = {"cases": {}}
    for name in CASES:
        child = subprocess.run([sys.executable, "-m", "bench.elements", "run", name], stdout=subprocess.PIPE, text=True,
                               check=True)
        found["cases"][name] = json.loads(child.stdout)
        print(f"  {name} done", file=sys.stderr, flush=True)
    found["growth"] = growth()
    found["times faster than the reference"] = against_reference()
    found["jitter"] = jitter()
    found["exemplars in their own domains"] = own_domains()
    print(json.dumps(found, indent=1, ensure_ascii=False))


if __name__ == "__main__":
    main()
