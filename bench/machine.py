"""The machine a table was measured on."""

from __future__ import annotations

import os
from pathlib import Path

from synth import opencl


def machine() -> dict[str, str | int | float]:
    """The processor, how many cores this process may use, the load by others, and the OpenCL device."""
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    model = next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), "unknown")
    return {"processor": model, "cores": len(os.sched_getaffinity(0)),
            "load when it began": round(os.getloadavg()[0], 1), "device": opencl.description()}


def peak_memory() -> float:
    """The most memory this process has held so far (VmHWM), in MB of 10^6 bytes."""
    status = Path("/proc/self/status").read_text().splitlines()
    return int(next(line for line in status if line.startswith("VmHWM")).split()[1]) * 1024 / 1e6
