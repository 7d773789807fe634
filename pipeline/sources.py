"""The sources a product depends on: the module that makes it, and the methods it uses with all they import.

Only what computes counts: formatting and comments do not, so tidying a module re-makes nothing.
"""

from __future__ import annotations

import ast
import functools
import hashlib
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("synth", "render")


@functools.cache
def sources(method: str) -> tuple[Path, ...]:
    """The .py, .cl and .h files that `method`, a dotted module of synth or render, depends on; itself first."""
    found: list[Path] = []
    waiting = [method]
    while waiting:
        file = _file(waiting.pop())
        if file.is_file() and file not in found:
            found.append(file)
            waiting += _imported(file)
    kernels = [file.with_suffix(".cl") for file in found if file.with_suffix(".cl").is_file()]
    for kernel in kernels:  # grows by what it includes, as synth.opencl.with_includes finds it
        named = re.findall(r'^#include "([^"]+)"$', kernel.read_text(), flags=re.MULTILINE)
        kernels += [file for name in named if (file := ROOT / "synth" / name).is_file() and file not in kernels]
    return (*found, *kernels)


def _file(module: str) -> Path:
    return ROOT.joinpath(*module.split(".")).with_suffix(".py")


@functools.cache
def _imported(file: Path) -> list[str]:
    """The modules of PACKAGES that `file` imports, at its top or inside a function."""
    names: list[str] = []
    for node in ast.walk(_tree(file)):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            # `from synth import advect` names a module, `from synth.advect import departure` what is in one
            names += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
    return [name for name in names if name.split(".")[0] in PACKAGES]


@functools.cache
def digest(maker: str, methods: tuple[str, ...]) -> str:
    """SHA-256 of what module `maker` by itself, and `methods` with all they depend on, say to the machine."""
    files = {_file(maker), *(file for method in methods for file in sources(method))}
    said = [f"{file.relative_to(ROOT).as_posix()} {_said(file)}" for file in sorted(files)]
    return hashlib.sha256("\n".join(said).encode()).hexdigest()


@functools.cache
def _said(file: Path) -> str:
    """SHA-256 of a file's content; of Python that of its syntax tree, which comments are not part of."""
    text = file.read_text()
    return hashlib.sha256((ast.dump(_tree(file)) if file.suffix == ".py" else text).encode()).hexdigest()


@functools.cache
def _tree(file: Path) -> ast.Module:
    return ast.parse(file.read_text())
