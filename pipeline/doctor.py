"""`flowloom doctor`: tries what a render needs, each in a child process, and says in a line what it found.

A trial is a function that does the thing, small, and returns what it did it with; what it raises, its death
or its silence is the reason why the thing is missing.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np

from pipeline.errors import EnvironmentMissing

_CHILD = """
import sys
try:
    from {module} import {name} as trial
    print("found:", trial())
except Exception as error:
    sys.exit(str(error) or type(error).__name__)
"""
SECONDS = 180.0  # the first trial of LLVM and of OpenCL compile their kernels


def machine() -> str:
    """Cores, memory, and room for results where the command runs."""
    memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") >> 30
    free = shutil.disk_usage(os.environ["FLOWLOOM_FOLDER"]).free >> 30
    cores, python = len(os.sched_getaffinity(0)), sys.version.split()[0]
    return f"{cores} cores, {memory} GiB memory, {free} GiB free here; Python {python}"


def opencl() -> str:
    """Moves a field by one cell on the device: the kernel that everything else is made of."""
    if sys.platform == "linux" and not Path("/sys/devices").is_dir():  # in a bare chroot: it would abort, not say so
        raise EnvironmentMissing("/sys is not mounted, without which PoCL aborts: mount -t sysfs sysfs /sys")
    from synth import advect, opencl

    field = np.arange(20, dtype=np.float32).reshape(4, 5)
    flow = np.zeros((4, 5, 2), np.float32)
    flow[..., 0] = 1
    if not np.array_equal(advect.advect(field, flow)[:, 1:], field[:, :-1]):
        raise RuntimeError("the kernel ran and its result is wrong")
    return f"{opencl.description()}, pyopencl {version('pyopencl')}"


def mitsuba_llvm() -> str:
    """Renders a small volume on the cores' vector units."""
    from render import backend

    library = backend.llvm_library()
    reason = backend.proven("llvm_ad_rgb", library)
    if reason:
        raise RuntimeError(reason)
    told = backend.versions("llvm_ad_rgb")
    return f"Mitsuba {told['mitsuba']}, Dr.Jit {told['drjit']}, LLVM {told['llvm']} ({library})"


def mitsuba_scalar() -> str:
    """Renders a small volume without LLVM."""
    from render import backend

    reason = backend.proven("scalar_rgb")
    if reason:
        raise RuntimeError(reason)
    return f"Mitsuba {version('mitsuba')}"


def openvdb() -> str:
    """Writes a volume and reads it back."""
    from pipeline.files import volumes
    from synth.field import Field

    volumes.write(Path("trial.vdb"), {"density": Field(np.ones((2, 3, 4)), 0.5, (-1.0, 0.0, 1.0))})
    return f"OpenVDB {volumes.library_version()}"


def openexr() -> str:
    """Writes a picture and reads it back."""
    from pipeline.files import images

    images.write_picture(Path("trial.exr"), np.ones((3, 4, 3), np.float32), half=True)
    return f"OpenEXR {version('OpenEXR')}"


def png() -> str:
    """Writes a picture and reads it back."""
    from pipeline.files import pictures

    pictures.write(Path("trial.png"), np.ones((3, 4, 3)))
    return f"OpenImageIO {version('OpenImageIO')}"


def video() -> str:
    """Encodes two frames in each format and counts them."""
    from pipeline.files import video

    frames = [np.zeros((16, 16, 3)), np.ones((16, 16, 3))]
    video.write(Path("trial.mp4"), frames, 30.0)
    video.write_webp(Path("trial.webp"), frames, 30.0)
    return f"H.264 and WebP by PyAV {version('av')}"


@dataclass(frozen=True)
class Trial:
    """What a render needs, how it is tried, and what to do where it fails."""

    name: str
    function: Callable[[], str]
    remedy: str = "run make setup"


TRIALS = (
    Trial("machine", machine),
    Trial("OpenCL", opencl, "apt-get install pocl-opencl-icd"),
    Trial("Mitsuba, LLVM", mitsuba_llvm, "apt-get install libllvm19"),
    Trial("Mitsuba, scalar", mitsuba_scalar),
    Trial("OpenVDB", openvdb, "apt-get install libopenvdb-dev, then make setup"),
    Trial("OpenEXR", openexr),
    Trial("PNG", png),
    Trial("video", video),
)


def tried(trial: Trial, seconds: float = SECONDS) -> tuple[bool, str]:
    """Whether the trial succeeds in a child process, and what it found or why not, in one line."""
    code = _CHILD.format(module=trial.function.__module__, name=trial.function.__name__)
    environment = os.environ | {"FLOWLOOM_FOLDER": os.getcwd()}
    with tempfile.TemporaryDirectory(prefix="flowloom-doctor-") as folder:
        try:
            child = subprocess.run([sys.executable, "-P", "-c", code], cwd=folder, env=environment,
                                   capture_output=True, text=True, timeout=seconds, check=False)
        except subprocess.TimeoutExpired:
            return False, f"no answer after {seconds:.0f} s"
    found = [line for line in child.stdout.splitlines() if line.startswith("found: ")]
    if child.returncode == 0 and found:
        return True, found[-1].removeprefix("found: ")
    if child.returncode < 0:
        return False, f"ended by {signal.Signals(-child.returncode).name}"
    lines = child.stderr.strip().splitlines() or [f"exit {child.returncode}"]
    return False, lines[-1]


def run() -> None:
    """Print a line for each trial; raises `EnvironmentMissing` if one fails."""
    missing = []
    for trial in TRIALS:
        works, told = tried(trial)
        if works:
            print(f"ok       {trial.name:16s} {told}", flush=True)
        else:
            remedy = "" if trial.remedy in told else f"; to fix it: {trial.remedy}"
            print(f"MISSING  {trial.name:16s} {told}{remedy}", flush=True)
            missing.append(trial.name)
    if missing:
        raise EnvironmentMissing(f"missing: {'; '.join(missing)}")
