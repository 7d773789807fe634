"""The one home of pyopencl: device, build, launch. A kernel is written once, for CPU (PoCL) and GPU alike.

What it promises: the same source, defines and inputs give the same bits on one device, at any number of
threads. So kernels gather, or scatter sums of integers, use no float atomics, and are built without fast-math.
"""

from __future__ import annotations

import functools
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np


class OpenCLUnavailable(RuntimeError):
    """No OpenCL platform offers a device; the message says what to install."""


INSTALL = "install Debian's pocl-opencl-icd (apt-get install pocl-opencl-icd)"


@functools.cache
def _queue() -> Any:
    """The command queue of the chosen device: the first GPU, else the first CPU (newest PoCL first)."""
    try:
        import pyopencl as cl

        platforms = cl.get_platforms()
    except ImportError as error:
        raise OpenCLUnavailable(f"pyopencl cannot be loaded ({error}); run make setup") from error
    except cl.Error as error:
        raise OpenCLUnavailable(f"no OpenCL platform ({error}); {INSTALL}") from error
    devices = [d for p in sorted(platforms, key=lambda p: p.version, reverse=True) for d in p.get_devices()]
    if not devices:
        raise OpenCLUnavailable(f"no OpenCL device; {INSTALL}")
    requested = os.environ.get("FLOWLOOM_DEVICE", "")
    if requested:
        matching = [d for d in devices if requested.lower() in f"{d.platform.name} {d.name}".lower()]
        if not matching:
            names = ", ".join(f"{d.platform.name}: {d.name}" for d in devices)
            raise OpenCLUnavailable(f"FLOWLOOM_DEVICE={requested!r} matches none of: {names}")
        devices = matching
    devices.sort(key=lambda d: not d.type & cl.device_type.GPU)
    return cl.CommandQueue(cl.Context(devices[:1]))


def description() -> str:
    """One line: the device, its driver and its platform, as a manifest records it."""
    device = _queue().device
    return f"{device.name} ({device.platform.name} {device.platform.version}, driver {device.driver_version})"


class Program:
    """One built source file; its kernels are attributes: `program.name(global_size, local_size, *args)`.

    Sizes are in x, y, z order as OpenCL counts them; `offset=` is where the global ids begin. Arguments are
    device arrays (`to_device`, `empty`), or NumPy scalars of the kernel's exact type.
    """

    def __init__(self, source: Path, defines: dict[str, Any]):
        import pyopencl as cl

        options = [f"-D{name}={value}" for name, value in sorted(defines.items())]
        # -w: on a processor without AVX-512 PoCL warns at every vector of 16, each time a kernel is compiled
        options += ["-cl-std=CL1.2", "-w"]
        self._program = cl.Program(_queue().context, with_includes(source)).build(options)
        self._kernels: dict[str, Any] = {}

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        # one cl.Kernel per name: fetching it anew for each call is slow and warns
        if name not in self._kernels:
            self._kernels[name] = self._launcher(getattr(self._program, name))
        return self._kernels[name]

    @staticmethod
    def _launcher(kernel: Any) -> Callable[..., None]:
        import pyopencl.array as cl_array

        arrays = (cl_array.Array, np.ndarray)

        def launch(global_size: tuple[int, ...], local_size: tuple[int, ...] | None, *args: Any,
                   offset: tuple[int, ...] | None = None) -> None:
            kernel(_queue(), global_size, local_size, *(a.data if isinstance(a, arrays) else a for a in args),
                   global_offset=offset)

        return launch


def with_includes(source: Path) -> str:
    """The text of `source`, with each #include "name" replaced by that file of synth/.

    Not by the compiler: PoCL's breaks at a space in an include path, and its kernel cache need not notice that
    an included file has changed.
    """
    def included(match: re.Match[str]) -> str:
        return with_includes(Path(__file__).parent / match[1])

    return re.sub(r'^#include "([^"]+)"$', included, source.read_text(), flags=re.MULTILINE)


@functools.cache
def _program(source: Path, defines: tuple[tuple[str, Any], ...]) -> Program:
    return Program(source, dict(defines))


def program(source: Path, **defines: Any) -> Program:
    """The program of `source` (a .cl beside the .py that calls this), built once per set of -D defines."""
    return _program(source, tuple(sorted(defines.items())))


def to_device(values: np.ndarray) -> Any:
    """A device array holding a C-order copy of `values`; `.get()` brings it back.

    Copied at once and not by the queue: it does not wait for what the device was given before.
    """
    import pyopencl as cl
    import pyopencl.array as cl_array

    host = np.ascontiguousarray(values)
    if host.size == 0:
        return cl_array.empty(_queue(), host.shape, host.dtype)
    buffer = cl.Buffer(_queue().context, cl.mem_flags.READ_WRITE | cl.mem_flags.COPY_HOST_PTR, hostbuf=host)
    return cl_array.Array(_queue(), host.shape, host.dtype, data=buffer)


def empty(shape: tuple[int, ...] | int, dtype: Any = np.float32) -> Any:
    """An uninitialised device array."""
    import pyopencl.array as cl_array

    return cl_array.empty(_queue(), shape, dtype)


def zeros(shape: tuple[int, ...] | int, dtype: Any = np.float32) -> Any:
    """A device array of zeros."""
    import pyopencl.array as cl_array

    return cl_array.zeros(_queue(), shape, dtype)


def finish() -> None:
    """Wait until the device has done all it was given (for timing)."""
    _queue().finish()
