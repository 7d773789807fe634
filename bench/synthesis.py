"""ma09 2-D: 64² exemplar, 256² output, 3 levels, 17² then 9², 4 iterations each; and the reference beside it.

`python -m bench.synthesis` prints one JSON object: seconds of the first frame and of the ones after, with a warm
kernel cache, processor seconds (all cores together: on a shared machine the steadier number), and peak memory.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from bench import reference
from bench.flows import wave
from bench.machine import machine, peak_memory
from synth import opencl
from synth.motion.detail import Settings, Synthesis
from synth.motion.exemplar import exemplar

SIZE, OUTPUT, LEVELS = 64, 256, 3
REPEATS = 5


def timed(work: Callable[[], Any]) -> tuple[Any, dict[str, float]]:
    """The result of some work, and its seconds on the wall and on the processors."""
    wall, busy = time.perf_counter(), time.process_time()
    result = work()
    return result, {"wall": time.perf_counter() - wall, "processor": time.process_time() - busy}


def two_frames(I: np.ndarray, L: np.ndarray, search: str) -> tuple[dict[str, float], dict[str, float]]:
    """Times of the first frame, all its preparation included, and of the next one."""
    settings = Settings(LEVELS, search=search)
    synthesis = Synthesis(I, L.shape[:2], settings, seed=1)
    state, first = timed(lambda: synthesis.frame(L, None))
    _, after = timed(lambda: synthesis.frame(L, state))
    return first, after


def median(times: list[dict[str, float]]) -> dict[str, float]:
    return {key: round(float(np.median([t[key] for t in times])), 3) for key in times[0]}


def main() -> None:
    facts = machine()
    opencl.to_device(np.zeros(1)).get()
    before = peak_memory()
    I, L = exemplar("heart", SIZE), wave(OUTPUT)
    searches = ("exact", "k-coherence")
    for search in searches:
        two_frames(I, L, search)
    peak = peak_memory()
    times: dict[str, list[dict[str, float]]] = {f"{s}, {f}": [] for s in searches for f in ("first", "next")}
    times["reference"] = []
    ratios = []
    for repeat in range(REPEATS):
        for search in searches:
            for frame, found in zip(("first", "next"), two_frames(I, L, search), strict=True):
                times[f"{search}, {frame}"].append(found)
        if repeat % 2 == 0:
            times["reference"].append(timed(lambda: reference.synthesize(I, L, LEVELS))[1])
            ratios.append(times["reference"][-1]["wall"] / times["exact, first"][-1]["wall"])
    print(json.dumps({"machine": facts, **{key: median(found) for key, found in times.items()},
                      "times faster than the reference": round(float(np.median(ratios)), 1),
                      "peak memory MB": round(peak), "of it Python, libraries and PoCL at rest MB": round(before)},
                     indent=1))


if __name__ == "__main__":
    main()
