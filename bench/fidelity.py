"""Fidelity of every scene of elements: how far the output's statistics are off those of its exemplar (ma13).

`python -m bench.fidelity` synthesizes what is not up to date in out/ and prints one JSON object. Of points the
statistics are asked in the depth of the domain; of threads the neighbours are asked at their middles, of sheets on
each sheet, and the motion of both is that of their details, without the coarse motion.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline import scene, stages
from pipeline.build.artifact import Inputs
from pipeline.build.graph import DeclaredInputs
from pipeline.elements import controls
from pipeline.elements.output import in_detail
from pipeline.elements.tables import ElementsScene
from pipeline.progress import Progress
from synth.elements import collision, fidelity, orientation
from synth.elements.neighborhood import spacing
from synth.elements.samples import Elements

OUT = Path("out")
SHEETS = 12  # of an output, whose samples are asked for their neighbours


@dataclass(frozen=True)
class Seen:
    """What is compared of an exemplar or an output: statistics, and the motion (T, E·S, 1, D) that is its own."""

    statistics: fidelity.Statistics
    motion: np.ndarray


def row(example: Elements, output: Elements, given: Seen, found: Seen) -> dict[str, Any]:
    """How far three statistics are off, and the output's jitter over the exemplar's; threads that cross."""
    moves = len(given.statistics.spectrum) > 0
    threads = example.topology == "thread"
    theirs, ours = given.statistics, found.statistics
    return {"elements": output.count,
            "pair correlation": round(fidelity.difference(theirs.correlation, ours.correlation), 3),
            "motion spectrum": round(fidelity.difference(theirs.spectrum, ours.spectrum), 3) if moves else None,
            "nearest distance": round(abs(ours.nearest / theirs.nearest - 1), 3),
            "jitter over the exemplar's": round(fidelity.jitter(found.motion) / fidelity.jitter(given.motion), 2)
            if moves else None,
            "crossing threads a frame": crossed(output) if threads else None,
            "in the exemplar": crossed(example) if threads else None}


def of_points(one: ElementsScene, inputs: Inputs, example: Elements, output: Elements) -> tuple[Seen, Seen]:
    """Points of an exemplar that repeats, or not, and of an output in its domain and flow."""
    period = None if example.box is None else (example.box[1] - example.box[0]).astype(np.float64)
    unit = spacing(example.positions, period)
    region = controls.domain(one, inputs)
    flow = controls.flow(one, inputs, region)
    moved = None if flow is None else carried(flow, output.positions)
    found = fidelity.statistics(output.positions, unit, controls.toroidal(one), region.distance, moved)
    return (Seen(fidelity.statistics(example.positions, unit, period), example.positions),
            Seen(found, output.positions))


def crossed(elements: Elements) -> str:
    """The least and the most pairs of threads that interpenetrate in a frame."""
    pairs = [collision.crossings(threads, elements.size) for threads in elements.positions.astype(np.float64)]
    return f"{min(pairs)} to {max(pairs)}"


def of_threads(elements: Elements) -> Seen:
    """Threads by their middles; the motion of their samples' details."""
    middle = elements.positions[:, :, elements.grid[0] // 2, None]
    found, motion = fidelity.statistics(middle, spacing(elements.positions)), details(elements)
    return Seen(fidelity.Statistics(found.correlation, fidelity.spectrum(motion), found.nearest), motion)


def of_sheets(elements: Elements) -> Seen:
    """The samples of each of a few sheets by themselves; the motion of their details."""
    chosen = np.unique(np.linspace(0, elements.count - 1, SHEETS).astype(int))
    rows, columns = elements.grid
    surface = elements.positions.reshape(elements.frames, elements.count, rows, columns, 3)
    edge = float(np.linalg.norm(np.diff(surface, axis=3), axis=-1).mean())
    each = [fidelity.statistics(elements.positions[:, e, :, None], edge) for e in chosen]
    motion = details(elements)
    return Seen(fidelity.Statistics(np.mean([one.correlation for one in each], axis=0), fidelity.spectrum(motion),
                                    float(np.mean([one.nearest for one in each]))), motion)


def details(elements: Elements) -> np.ndarray:
    """What samples do beside the coarse motion, in their local axes: (T, E·S, 1, D)."""
    assert elements.coarse is not None
    axes = orientation.along(elements.coarse, elements.grid)
    moved = (elements.positions - elements.coarse).reshape(-1, 3)
    return np.einsum("nji,nj->ni", axes, moved).reshape(elements.frames, -1, 1, 3)


def rows_of(file: Path, quick: bool = False) -> list[dict[str, Any]]:
    """All variants of a scene file, at its quick settings or not; none if it is not a scene of elements."""
    loaded = scene.load(file, quick)
    if loaded.method.name != "ma13":
        return []
    graph = stages.run("synth", loaded, OUT, Progress(quiet=True))
    found = []
    for variant, one in loaded.variants.items():
        inputs = DeclaredInputs(graph, variant, graph.artifacts[variant]["elements"])
        example, output = inputs.read("exemplar"), graph.read(variant, "elements", 0)
        if example.topology == "none":
            given, seen = of_points(one, inputs, example, output)
        else:
            example = in_detail(example)
            given, seen = map(of_threads if example.topology == "thread" else of_sheets, (example, output))
        found.append({"scene": loaded.file.stem, "variant": variant, **row(example, output, given, seen)})
    return found


def carried(flow: Callable[[int, np.ndarray], np.ndarray], positions: np.ndarray) -> np.ndarray:
    """How far the flow has carried each sample, frame by frame, like positions (T, E, 1, D)."""
    steps = [flow(t, before[:, 0].astype(np.float64))[:, None] for t, before in enumerate(positions[:-1])]
    return np.concatenate([np.zeros((1, *positions.shape[1:])), np.cumsum(steps, axis=0)])


def main() -> None:
    rows = [row for file in sorted(Path("scenes").glob("ma13-*.toml")) for row in rows_of(file)]
    print(json.dumps({"fidelity of scenes": rows}, indent=1, ensure_ascii=False))


if __name__ == "__main__":
    main()
