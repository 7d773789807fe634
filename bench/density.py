"""The density window side by side with SciPy: 256 x 256 x 64 cells, m = 16, in one process (ma09 pseudocode
4); and that of ma09 figure 5, 96 x 128 x 96 cells, its detail carried along L as the pipeline does it.

`python -m bench.density [--frames N] [--small]` prints one JSON object. SciPy does what the pseudocode says
with `map_coordinates(order=1)`: m gathers per frame from departure points that were found beforehand, and
neither the sources nor the backtrace nor O; ours does all of it.
"""

from __future__ import annotations

import argparse
import itertools
import json
import resource
import time
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from scipy.ndimage import map_coordinates

from synth import noise, opencl
from synth.advect import departure
from synth.motion.coarse import coarse, upsample
from synth.motion.combine import combine
from synth.motion.density import Carried, Motion, Source, windowed

M = 16


def motions(shape: tuple[int, int, int]) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """A few frames of L (a quarter of the resolution) and of F = upsample(L) + 2 curl noise."""
    low = tuple(n // 4 for n in shape)
    L = list(coarse("curl-noise", low, 3, seed=1, speed=0.5))
    H = noise.curl_noise(low, 3, seed=2, length=0.2)
    return L, [combine(l, upsample(h, shape) / 4, 2.0) for l, h in zip(L, H, strict=True)]


def ours(L: list[np.ndarray], F: Sequence[Motion], sources: list[Source],
         frames: int) -> tuple[list[float], float]:
    """Seconds of each frame from the first full window on, and processor seconds a frame, all cores together."""
    def endless(fields: Sequence[Any]) -> Iterator[Any]:
        return itertools.islice(itertools.cycle(fields), M + frames)

    seconds = []
    densities = windowed(endless(L), endless(F), sources, M)
    for i in range(M + frames):
        start = time.perf_counter()
        next(densities)
        if i >= M:
            seconds.append(time.perf_counter() - start)
        else:
            busy = time.process_time()
    return seconds, (time.process_time() - busy) / frames


def scipy_window(F: list[np.ndarray], start: np.ndarray) -> float:
    """Seconds of the m gathers of one frame."""
    cells = np.stack(np.meshgrid(*(np.arange(n, dtype=np.float32) for n in start.shape), indexing="ij"))
    points = [cells + np.moveaxis(departure(v)[..., ::-1], -1, 0) for v in F]
    density = start
    begin = time.perf_counter()
    for j in range(M):
        density = map_coordinates(density, points[j % len(points)], order=1, mode="constant")
    return time.perf_counter() - begin


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--frames", type=int, default=5)
    options.add_argument("--small", action="store_true", help="64 x 64 x 16")
    chosen = options.parse_args()
    shape = (16, 64, 64) if chosen.small else (64, 256, 256)
    L, F = motions(shape)
    sources = [Source((0.0, 0.3), 0.11, streaks=0.5)]
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    seconds, busy = ours(L, F, sources, chosen.frames)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    reference = scipy_window(F, np.random.default_rng(0).random(shape, np.float32))
    median = float(np.median(seconds))
    row: dict[str, Any] = {
        "what": f"density window {shape[2]}x{shape[1]}x{shape[0]}, m = {M}",
        "seconds a frame": round(median, 3), "fastest": round(min(seconds), 3),
        "slowest": round(max(seconds), 3), "processor seconds a frame": round(busy, 3),
        "scipy, seconds a frame": round(reference, 3),
        "times faster": round(reference / median, 1), "target": "1.5 s a frame, 6 times",
        "peak memory MB": peak // 1024, "of it for the inputs MB": before // 1024,
        "device": opencl.description()}
    row["plume"] = plume((24, 32, 24) if chosen.small else (96, 128, 96), chosen.frames)
    print(json.dumps(row, indent=1))


def plume(shape: tuple[int, int, int], frames: int) -> dict[str, Any]:
    """Seconds of a frame of figure 5's density, half of the domain full of smoke."""
    L, F = motions(shape)
    carried = [Carried(f, l) for f, l in zip(F, L, strict=True)]
    seconds, busy = ours(L, carried, [Source((0.0, 0.4), 0.33, streaks=0.5)], frames)
    cells = f"{shape[2]}x{shape[1]}x{shape[0]}"
    return {"what": f"density window {cells}, m = {M}, the detail carried along L, half full of smoke",
            "seconds a frame": round(float(np.median(seconds)), 3), "processor seconds a frame": round(busy, 3)}


if __name__ == "__main__":
    main()
