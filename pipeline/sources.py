"""The sources a product depends on: a module, all of the project's that it imports, and their kernels.

Only what computes counts: formatting and comments do not, so tidying a module re-makes nothing. What merely
orders the work (scenes, manifests, stages, the CLI) is left out by `ORDER`.
"""

from __future__ import annotations

import ast
import functools
import hashlib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("synth", "render", "pipeline")
ORDER = ("pipeline.errors", "pipeline.scene", "pipeline.schema", "pipeline.product")


@functools.cache
def sources(module: str) -> tuple[Path, ...]:
    """The .py, .cl and .h files that `module` (dotted) depends on, itself first."""
    found: dict[str, None] = {}
    waiting = [module]
    while waiting:
        name = waiting.pop()
        file = ROOT.joinpath(*name.split(".")).with_suffix(".py")
        if name in found or name in ORDER or not file.is_file():
            continue
        found[name] = None
        waiting += _imported(file)
    kernels = [_file(name).with_suffix(suffix) for name in found for suffix in (".cl", ".h")]
    return (*map(_file, found), *(file for file in kernels if file.is_file()))


def _file(module: str) -> Path:
    return ROOT.joinpath(*module.split(".")).with_suffix(".py")


def _imported(file: Path) -> list[str]:
    """The project's modules that `file` imports, at its top or inside a function."""
    names: list[str] = []
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            # `from synth import advect` names a module, `from synth.advect import departure` what is in one
            names += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
    return [name for name in names if name.split(".")[0] in PACKAGES]


@functools.cache
def digest(module: str) -> str:
    """SHA-256 of what `module` and all it depends on say to the machine."""
    whole = hashlib.sha256()
    for file in sorted(sources(module)):
        text = file.read_text()
        whole.update(file.relative_to(ROOT).as_posix().encode())
        whole.update(ast.dump(ast.parse(text)).encode() if file.suffix == ".py" else text.encode())
    return whole.hexdigest()
