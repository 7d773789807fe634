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

from bench.flows import wave
from synth.motion.detail import Settings, synthesize
from synth.motion.exemplar import exemplar

RUNS = 10


def digest() -> str:
    """SHA-256 of two frames of 128² from a 32² exemplar, by each search."""
    found = hashlib.sha256()
    for search in ("exact", "k-coherence"):
        for H in synthesize(exemplar("heart", 32), [wave(128)] * 2, (128, 128), Settings(3, search=search), seed=1):
            found.update(H.tobytes())
    return found.hexdigest()


def elsewhere(threads: int, cache: str) -> str:
    """The digest of a new process with this many threads and this folder of kernels."""
    environment = os.environ | {"POCL_MAX_PTHREAD_COUNT": str(threads), "OMP_NUM_THREADS": str(threads),
                                "POCL_CACHE_DIR": cache}
    child = subprocess.run([sys.executable, "-m", "bench.repeat", "digest"], env=environment, check=True,
                           capture_output=True, text=True)
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
