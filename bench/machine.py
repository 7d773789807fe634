"""What a table was measured on: the machine, and the revision of the code."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

from synth import opencl

ROOT = Path(__file__).parents[1]
MEASURED = ("bench", "pipeline", "render", "synth", "scenes", "uv.lock", ":(exclude)bench/RESULTS.md")


def machine() -> dict[str, str | int | float]:
    """The processor, how many cores this process may use, the load by others, and the OpenCL device."""
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    model = next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), "unknown")
    return {"processor": model, "cores": len(os.sched_getaffinity(0)),
            "load when it began": round(os.getloadavg()[0], 1), "device": opencl.description()}


def revision(root: Path = ROOT) -> str:
    """The git revision, and whether what is measured differs from it; "unknown" outside a git checkout."""
    def git(*command: str) -> str:
        return subprocess.run(["git", "-C", str(root), *command], check=True, capture_output=True, text=True).stdout

    try:
        head, changes = git("rev-parse", "--short", "HEAD").strip(), git("status", "--porcelain", "--", *MEASURED)
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return f"{head} with uncommitted changes" if changes else head


def peak_memory() -> float:
    """The most memory this process has held so far (VmHWM), in MB of 10^6 bytes."""
    status = Path("/proc/self/status").read_text().splitlines()
    return int(next(line for line in status if line.startswith("VmHWM")).split()[1]) * 1024 / 1e6
