"""The code that an artifact depends on, found by following what functions name; no list is written by hand.

Of `synth` and `render` a whole module counts, with its kernels and all the modules that it imports. Of `pipeline`
each function, class and constant counts by itself, with those that it names: one module holds the artifacts of several
looks, and an edit to one must not render the others again. `pipeline.build` and the errors compute nothing. The methods
of the tables that an artifact reads count too: `make` can call them.

Only what computes counts: formatting, comments, docstrings and annotations do not.

Not followed: names that are made up at run time. tests/pipeline/build/test_source_digest.py traces what runs.
"""

from __future__ import annotations

import ast
import functools
import hashlib
import inspect
import re
import sys
import types
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
WHOLE = ("synth", "render")
COMPUTES_NOTHING = ("pipeline.build", "pipeline.errors", "pipeline.tables", "pipeline.files.atomic",
                    "pipeline.files.format")
Owned = tuple[Any, type | None]
"""A function or a constant, and the class that `self` and `cls` stand for in it."""


def digest(functions: Iterable[Callable[..., Any]], tables: Iterable[type] = ()) -> str:
    """SHA-256 of all that `functions`, and the methods of `tables`, depend on."""
    return hashlib.sha256("\n".join(sorted(sources(functions, tables))).encode()).hexdigest()


def sources(functions: Iterable[Callable[..., Any]], tables: Iterable[type] = ()) -> dict[str, str]:
    """What counts, by its place, `synth/advect.py` or `pipeline.flow.walls`, and the SHA-256 of each in it."""
    waiting: list[Owned] = [(_plain(function), _owner(function)) for function in functions]
    waiting += [method for table in tables for method in _methods(table)]
    seen, found = set[tuple[int, type | None]](), dict[str, str]()
    while waiting:
        item, owner = waiting.pop()
        place = f"{item.__module__}.{item.__qualname__}"
        if (id(item), owner) in seen or not _counts(item.__module__) or "Artifact" in _returned(item):
            continue  # a function that declares artifacts makes none
        seen.add((id(item), owner))
        found[f"{place} {_code_digest(item)}"] = place
        for name, value in _named(item, owner):
            if isinstance(value, Path):
                found |= _files(value)
            elif isinstance(value, types.FunctionType):
                waiting.append((_plain(value), owner if owner and getattr(owner, name, None) is not None else None))
            elif isinstance(value, types.MethodType):
                waiting.append((_plain(value), owner))
            elif isinstance(value, property):
                waiting.append((value.fget, owner))
            elif isinstance(value, type):
                waiting += _methods(value)
            else:
                found[f"{place} {name} {_sha256(_spelled(value))}"] = place
                waiting += [(inner, None) for inner in _functions_in(value)]
    return found


def _plain(value: Any) -> Any:
    """A function without what decorators put round it; anything else as it is."""
    return inspect.unwrap(getattr(value, "__func__", value)) if callable(value) or hasattr(value, "__func__") else value


def _owner(function: Any) -> type | None:
    """The class of a method: of its object, or the one that it is written in."""
    bound = getattr(function, "__self__", None)
    if bound is not None:
        return bound if isinstance(bound, type) else type(bound)
    cls, _, method = _plain(function).__qualname__.rpartition(".")
    found = getattr(sys.modules[function.__module__], cls, None) if method and cls else None
    return found if isinstance(found, type) else None


def _methods(table: type) -> list[Owned]:
    """The methods that a class of pipeline defines or inherits."""
    return [(_plain(value.fget if isinstance(value, property) else value), table)
            for one in table.__mro__ if _counts(one.__module__) for name, value in vars(one).items()
            if isinstance(value, types.FunctionType | classmethod | staticmethod | property) and name[:2] != "__"]


def _counts(module: str) -> bool:
    return module.startswith("pipeline.") and not module.startswith(COMPUTES_NOTHING)


def _returned(function: Any) -> str:
    return str(getattr(function, "__annotations__", {}).get("return", ""))


def _named(function: types.FunctionType, owner: type | None) -> Iterator[tuple[str, Any]]:
    """What of ours a function names: functions, classes and constants of pipeline, files of synth and render."""
    names = list(_names(function.__code__))
    for name in names:
        value = _plain(function.__globals__.get(name))
        if isinstance(value, types.ModuleType) and _counts(f"{value.__name__}."):
            yield from ((inner, vars(value)[inner]) for inner in names if _is_ours(vars(value).get(inner)))
        elif isinstance(value, types.ModuleType) and value.__name__.split(".")[0] in WHOLE:
            yield name, _file(value.__name__)
        elif _is_ours(value):
            yield name, value
        elif (getattr(value, "__module__", "") or "").split(".")[0] in WHOLE:
            yield name, _file(value.__module__)
        if owner is not None and _counts(owner.__module__) and name in dir(owner) and name[:2] != "__":
            inherited = inspect.getattr_static(owner, name)
            if name not in getattr(owner, "model_fields", {}) and _is_ours(_plain(inherited)):
                yield name, _plain(inherited)
        if name.split(".")[0] in WHOLE:  # an import inside the function
            files = (_file(f"{name}.{inner}".rstrip(".")) for inner in ("", *names))
            yield from ((name, file) for file in files if file.is_file())


def _names(code: types.CodeType) -> Iterator[str]:
    """The names in a function and in the functions in it."""
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _names(constant)


def _is_ours(value: Any) -> bool:
    """Whether it is a function, a class or a property of pipeline that counts, or a constant."""
    if isinstance(value, property):
        value = value.fget
    if isinstance(value, types.FunctionType | types.MethodType | type):
        return _counts(getattr(value, "__module__", "") or "")
    return isinstance(value, int | float | str | tuple | dict | list | np.ndarray | re.Pattern)


def _spelled(value: Any) -> str:
    """A constant as text: the same in every process."""
    if isinstance(value, np.ndarray):
        return f"{value.dtype} {value.shape} {value.tobytes()!r}"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{name!r}: {_spelled(inner)}' for name, inner in value.items())}}}"
    if isinstance(value, tuple | list):
        return f"[{', '.join(map(_spelled, value))}]"
    return getattr(value, "__qualname__", None) or repr(value)


def _functions_in(value: Any) -> Iterator[types.FunctionType]:
    """The functions of pipeline in a table of them."""
    for inner in value.values() if isinstance(value, dict) else value if isinstance(value, tuple | list) else ():
        if isinstance(inner, types.FunctionType):
            yield inner
        yield from _functions_in(inner)


def _code_digest(function: types.FunctionType) -> str:
    return _sha256(repr([_instructions(function.__code__), function.__defaults__, function.__kwdefaults__]))


def _instructions(code: types.CodeType) -> list[Any]:
    """What a function does, without its docstring and its place in the file."""
    docstring = code.co_consts[:1] if code.co_consts and isinstance(code.co_consts[0], str) else ()
    constants = [_instructions(c) if isinstance(c, types.CodeType) else c for c in code.co_consts[len(docstring):]]
    return [code.co_code, code.co_names, code.co_varnames, code.co_freevars, constants]


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


# -- files of synth and render ------------------------------------------------------------------------------------


def _file(module: str) -> Path:
    return ROOT.joinpath(*module.split(".")).with_suffix(".py")


@functools.cache
def _files(first: Path) -> dict[str, str]:
    """A file, all that it imports of WHOLE, their kernels and what these include."""
    waiting, seen, found = [first], set[Path](), dict[str, str]()
    while waiting:
        file = waiting.pop()
        if file.is_file() and file not in seen:
            seen.add(file)
            place = file.relative_to(ROOT).as_posix()
            found[f"{place} {_file_digest(file)}"] = place
            waiting += _imported(file)
    return found


@functools.cache
def _file_digest(file: Path) -> str:
    return _sha256(ast.dump(_tree(file)) if file.suffix == ".py" else file.read_text(encoding="utf-8"))


@functools.cache
def _imported(file: Path) -> list[Path]:
    """What a file of WHOLE imports or includes."""
    if file.suffix != ".py":  # as synth.opencl.with_includes finds it
        return [ROOT / "synth" / name for name in re.findall(r'^#include "([^"]+)"$', file.read_text(), re.MULTILINE)]
    names: list[str] = []
    for node in ast.walk(_tree(file)):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            # `from synth import advect` names a module, `from synth.advect import departure` what is in one
            names += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
    return [*(_file(name) for name in names if name.split(".")[0] in WHOLE), file.with_suffix(".cl")]


@functools.cache
def _tree(file: Path) -> ast.Module:
    """The syntax tree of a file without docstrings."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node, clean=False):
            node.body[0] = ast.Pass()
    return tree
