"""The same bits: run after run, with one thread and with two, with a kernel cache that is empty and one that is not.

`python -m bench.repeat` prints one JSON object; `python -m bench.repeat digest` the hash of one run.
"""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator

import numpy as np

from bench.elements import square, turning
from bench.flows import wave
from synth.elements import (
    arrangement,
    bundle,
    falling_paper,
    initialize,
    keyframed,
    orientation,
    search,
    simulation,
    synthesis,
)
from synth.elements.constraints import Constraints
from synth.elements.neighborhood import Shape
from synth.elements.synthesis import Controls
from synth.elements.synthesis import Settings as Synthesis
from synth.motion.detail import Settings, synthesize
from synth.motion.exemplar import exemplar

RUNS = 10


def elements() -> Iterator[np.ndarray]:
    """Positions of a few points, threads that may not pass through each other, and sheets, after two iterations."""
    grid = arrangement.jittered_grid((6, 6), seed=1)
    points = search.exemplar(grid, Shape(2.0, 1, 1, sigma=4.0), period=grid.period)
    start = initialize.points(grid, square(12.0), 6, 2.0, 1.0, 1)
    cases = [(points, start, Controls(Constraints(square(12.0)), turning(12.0)), False)]
    bundled = bundle.duplicated(simulation.lifted(60, length=40.0, thick=4.0), 30).positions[:8]
    tossed = falling_paper.tossed(20, 8).positions
    for example, coarse, axes_of, many in (
            (keyframed.jagged(frames=12), bundled, orientation.along_threads, 9),
            (keyframed.folded(frames=12), tossed, lambda sheets: orientation.on_sheets(sheets, (7, 7)), 1)):
        inner, outer = axes_of(example.coarse), axes_of(coarse)
        start = initialize.on_coarse(example, coarse, inner, outer, many, 1, 24.0)
        cases.append((search.exemplar(example, Shape(3.0, 2, 2), inner), start, Controls(axes=outer), many > 1))
    for within, start, controls, hybrid in cases:
        settings = Synthesis(iterations=2, hybrid=hybrid)
        *_, last = synthesis.together(within, start.elements, start.source, controls, settings)
        yield last.result().positions


def digest() -> str:
    """SHA-256 of points, threads and sheets, and of two frames of 128² from a 32² exemplar by each search."""
    found = hashlib.sha256()
    for positions in elements():
        found.update(positions.tobytes())
    for matching in ("exact", "k-coherence"):
        for H in synthesize(exemplar("heart", 32), [wave(128)] * 2, (128, 128), Settings(3, search=matching), seed=1):
            found.update(H.tobytes())
    return found.hexdigest()


def elsewhere(threads: int, cache: str, module: str = "bench.repeat") -> str:
    """The digest of a new process of a module of the bench, with this many threads and this folder of kernels."""
    environment = os.environ | {"POCL_MAX_PTHREAD_COUNT": str(threads), "OMP_NUM_THREADS": str(threads),
                                "OPENCV_FOR_THREADS_NUM": str(threads), "POCL_CACHE_DIR": cache}
    child = subprocess.run([sys.executable, "-m", module, "digest"], env=environment, check=True, capture_output=True,
                           text=True)
    return child.stdout.strip()


def main() -> None:
    if sys.argv[1:] == ["digest"]:
        print(digest())
        return
    found = {f"run {run + 1}": digest() for run in range(RUNS)}
    for threads in (1, 2):
        with tempfile.TemporaryDirectory() as cache:
            found[f"{threads} threads, cold cache"] = elsewhere(threads, cache)
            found[f"{threads} threads, warm cache"] = elsewhere(threads, cache)
    print(json.dumps({"runs": len(found), "different results": len(set(found.values())), "digests": found}, indent=1))


if __name__ == "__main__":
    main()
