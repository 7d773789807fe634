"""The exact search step alone beside FAISS's flat index: 65,536 queries on 4,096 points, both on all cores.

`python -m bench.search` prints one JSON object. The two take turns, and each ratio is of two neighbouring runs, so
that what else the machine does touches both.
"""

from __future__ import annotations

import json
import os
import time

import faiss
import numpy as np

from synth import opencl
from synth.motion.neighborhood import Space
from synth.motion.search import Matcher

POINTS, QUERIES, TURNS = 4096, 65536, 9


def turns(dims: int) -> dict[str, float]:
    """Median seconds of each and the median of their ratios, at this many dimensions."""
    random = np.random.Generator(np.random.Philox(key=dims))
    points = random.standard_normal((POINTS, dims), np.float32)
    queries = random.standard_normal((QUERIES, dims), np.float32)
    index = faiss.IndexFlatL2(dims)
    index.add(points)
    space = Space(0, np.zeros(2, np.float32), np.zeros((2, dims), np.float32), points)
    matcher, asked = Matcher(space, (64, 64), 1), opencl.to_device(queries)
    ours, theirs = [], []
    for turn in range(TURNS + 1):
        start = time.perf_counter()
        best, _ = matcher.exact(asked)
        opencl.finish()
        middle = time.perf_counter()
        _, found = index.search(queries, 1)
        end = time.perf_counter()
        if turn > 0:  # the first one builds the kernel and touches the memory
            ours.append(middle - start)
            theirs.append(end - middle)
    agree = float(np.mean(best.get() == found[:, 0]))
    return {"ours": float(np.median(ours)), "FAISS": float(np.median(theirs)),
            "ratio": float(np.median(np.divide(ours, theirs))), "same match": agree}


def main() -> None:
    faiss.omp_set_num_threads(len(os.sched_getaffinity(0)))
    print(json.dumps({f"{dims} dimensions": turns(dims) for dims in (32, 64)}, indent=1))


if __name__ == "__main__":
    main()
