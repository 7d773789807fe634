"""How an untrusted file is read: in a child process, with a limit on its memory and its time.

A damaged file can abort the library that reads it, make it hang or take all memory. Here it takes down a
child, and the user reads one line.
"""

from __future__ import annotations

import importlib
import json
import os
import resource
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import BadInput

MEMORY = min(8 << 30, os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") // 2)  # bytes of address space
SECONDS = 20.0  # and one more for each 10 MB of the file

_CHILD = "from pipeline.files import sandbox; sandbox._answer()"


def read(function: Callable[..., dict[str, Any]], path: Path, key: str, *arguments: Any,
         memory: int | None = None, seconds: float | None = None) -> dict[str, Any]:
    """`function(path, *arguments)`, called in a child process.

    `function` stands at the top level of its module and returns a dict of arrays and JSON values; arguments
    are JSON values. Raises `BadInput(path, key, reason)` where it raises, dies, hangs or takes too much
    memory.
    """
    if not path.is_file():
        raise BadInput(path, key, "no such file")
    task = {
        "function": f"{function.__module__}:{function.__qualname__}",
        "path": str(path.resolve()),
        "arguments": arguments,
        "memory": memory or MEMORY,
    }
    seconds = (seconds or SECONDS) + path.stat().st_size / 10e6
    # one thread: each takes address space, and on a big machine they would use up the limit between them
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "MALLOC_ARENA_MAX": "2"}
    try:
        child = subprocess.run([sys.executable, "-P", "-c", _CHILD], input=json.dumps(task).encode(), cwd="/",
                               env=environment, capture_output=True, timeout=seconds, check=False)
    except subprocess.TimeoutExpired:
        raise BadInput(path, key, f"damaged: not read within {seconds:.0f} s") from None
    header, _, content = child.stdout.partition(b"\n")
    if child.returncode or not header:
        raise BadInput(path, key, f"damaged: {_last_words(child)}")
    answer = json.loads(header)
    if "error" in answer:
        raise BadInput(path, key, answer["error"])
    return _unpacked(answer, content)


def _last_words(child: subprocess.CompletedProcess[bytes]) -> str:
    if child.returncode < 0:
        return f"its reader ended by {signal.Signals(-child.returncode).name}"
    lines = child.stderr.decode(errors="replace").strip().splitlines()
    return lines[-1] if lines else f"its reader ended with {child.returncode}"


def _unpacked(answer: dict[str, Any], content: bytes) -> dict[str, Any]:
    result = dict(answer["values"])
    start = 0
    for name, dtype, shape in answer["arrays"]:
        count = int(np.prod(shape))
        array = np.frombuffer(content, dtype, count, start).reshape(shape)
        result[name] = array.copy()  # a buffer of bytes is read-only
        start += array.nbytes
    return result


def _reason(error: Exception, memory: int) -> str:
    """ValueError is our own verdict; a library may raise anything at a damaged file."""
    if isinstance(error, MemoryError):
        return f"needs more than {memory >> 20} MiB to read"
    words = str(error).splitlines()[0] if str(error) else type(error).__name__
    return words if type(error) is ValueError else f"damaged: {words}"


def _answer() -> None:
    """The child: does the task on stdin; answers on stdout one line of JSON, then the arrays' bytes."""
    task = json.load(sys.stdin)
    resource.setrlimit(resource.RLIMIT_AS, (task["memory"], task["memory"]))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints must not stand in the answer
    module, _, name = task["function"].partition(":")
    try:
        result = getattr(importlib.import_module(module), name)(Path(task["path"]), *task["arguments"])
    except Exception as error:
        out.write(json.dumps({"error": _reason(error, task["memory"])}).encode() + b"\n")
    else:
        arrays = {name: np.ascontiguousarray(v) for name, v in result.items() if isinstance(v, np.ndarray)}
        values = {name: v for name, v in result.items() if name not in arrays}
        shapes = [(name, array.dtype.str, array.shape) for name, array in arrays.items()]
        out.write(json.dumps({"arrays": shapes, "values": values}).encode() + b"\n")
        for array in arrays.values():
            out.write(array.data)
    out.flush()
