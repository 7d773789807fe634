"""The code that an artifact depends on, found by following what functions name; no list is written by hand.

Of `synth` and `render` a whole module counts, with its kernels and all the modules that it imports. Of `pipeline`
each function, class and constant counts by itself, with those that it names: one module holds the artifacts of several
looks, and an edit to one must not render the others again. `pipeline.build` and the errors compute nothing. The methods
of the tables that an artifact reads count too: `make` can call them.

Only what computes counts: formatting, comments and docstrings do not.

Not followed: names that are made up at run time, and partial functions. tests/pipeline/build/test_source_digest.py
traces what runs.
"""

from __future__ import annotations

import ast
import functools
import hashlib
import importlib
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
COMPUTES_NOTHING = ("pipeline.build.", "pipeline.errors.", "pipeline.tables.", "pipeline.files.atomic.",
                    "pipeline.files.format.")
Owned = tuple[Any, type | None]
"""A function or a constant, and the class that `self` and `cls` stand for in it."""


def digest(functions: Iterable[Callable[..., Any]], tables: Iterable[type] = ()) -> str:
    """SHA-256 of all that `functions`, and the methods of `tables`, depend on."""
    return hashlib.sha256("\n".join(sorted(sources(functions, tables))).encode()).hexdigest()


def sources(functions: Iterable[Callable[..., Any]], tables: Iterable[type] = ()) -> dict[str, str]:
    """The place of each thing that counts, `synth/advect.py` or `pipeline.flow.walls`, by place and SHA-256."""
    waiting: list[Owned] = [(_plain(function), _owner(function)) for function in functions]
    waiting += [method for table in tables for method in _methods(table)]
    seen, found = set[tuple[int, type | None]](), dict[str, str]()
    while waiting:
        item, owner = waiting.pop()
        place = f"{item.__module__}.{item.__qualname__}"
        if (id(item), owner) in seen or not _counts(item.__module__) or _declares_artifacts(item):
            continue
        seen.add((id(item), owner))
        found[f"{place} {_code_digest(item)}"] = place
        for name, value in _named(item, owner):
            if isinstance(value, Path):
                found |= _files(value)
            elif isinstance(value, types.FunctionType):
                waiting.append((value, owner if owner and getattr(owner, name, None) is not None else None))
            elif isinstance(value, type):
                waiting += _methods(value)
                found |= {f"{place} {value.__qualname__}.{inner} {_sha256(_spelled(data))}": place
                          for inner, data in vars(value).items()
                          if not inner.startswith(("__", "_abc_")) and _is_constant(data)}
            else:
                found[f"{place} {name} {_sha256(_spelled(value))}"] = place
                waiting += [(inner, None) for inner in _functions_in(value)]
    return found


def _plain(value: Any) -> Any:
    """A function without what decorators put round it, of a property its getter; anything else as it is."""
    if isinstance(value, property):
        value = value.fget
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
    """The methods that a class of pipeline defines or inherits; not those that a library wrote."""
    methods = [_plain(value) for one in table.__mro__ if _counts(one.__module__) for value in vars(one).values()
               if isinstance(value, types.FunctionType | classmethod | staticmethod | property)]
    return [(one, table) for one in methods if _counts(one.__module__) and one.__code__.co_filename[0] != "<"]


def _counts(module: str) -> bool:
    return f"{module}.".startswith("pipeline.") and not f"{module}.".startswith(COMPUTES_NOTHING)


def _declares_artifacts(function: Any) -> bool:
    """Such a function makes none: what it decides is in the artifact, which its key knows."""
    return str(getattr(function, "__annotations__", {}).get("return", "")) in ("Artifact", "tuple[Artifact, ...]")


def _named(function: types.FunctionType, owner: type | None) -> Iterator[tuple[str, Any]]:
    """What of ours a function names: functions, classes and constants of pipeline, files of synth and render."""
    names = [*_names(function.__code__)]
    known = [(name, _plain(function.__globals__[name])) for name in names if name in function.__globals__]
    cells = zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
    known += [(name, _plain(cell.cell_contents)) for name, cell in cells]
    known += [(name, value) for name in names for value in _imported_inside(name, names)]
    for module in [value for _, value in known if isinstance(value, types.ModuleType) and _counts(value.__name__)]:
        known += [(name, _plain(vars(module)[name])) for name in names if name in vars(module)]
    for name, value in known:
        home = value.__name__ if isinstance(value, types.ModuleType) else getattr(value, "__module__", None) or ""
        if home.split(".")[0] in WHOLE:
            yield name, _file(home)
        elif _is_ours(value):
            yield name, value
    if owner is not None:
        yield from _inherited(owner, names)


def _inherited(owner: type, names: list[str]) -> Iterator[tuple[str, Any]]:
    """What a method of `owner` can mean by `self.x` and `cls.x`, and by `super().x`."""
    for one in owner.__mro__ if _counts(owner.__module__) else ():
        for name in names:
            value = _plain(vars(one).get(name))
            if value is None or not _is_ours(value) or name in getattr(owner, "model_fields", {}):
                continue
            if "super" in names or inspect.getattr_static(owner, name) is vars(one)[name]:
                yield name, value


def _imported_inside(name: str, names: list[str]) -> Iterator[Any]:
    """The modules that an import inside a function binds: files of synth and render, modules of pipeline."""
    if name.split(".")[0] in WHOLE or _counts(name):
        for dotted in (name, *(f"{name}.{inner}" for inner in names)):
            if _file(dotted).is_file():
                yield _file(dotted) if name.split(".")[0] in WHOLE else importlib.import_module(dotted)
            elif (compiled := _file(dotted.replace("._", ".")).with_suffix(".cpp")).is_file():
                yield compiled


def _names(code: types.CodeType) -> Iterator[str]:
    """The names in a function and in the functions in it."""
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _names(constant)


def _is_ours(value: Any) -> bool:
    """Whether it is a function or a class of pipeline that counts, a constant, or the source of a compiled module."""
    if isinstance(value, types.FunctionType | type):
        return _counts(value.__module__)
    return isinstance(value, Path) or _is_constant(value)


def _is_constant(value: Any) -> bool:
    """Whether it is data: not a module, and nothing that is called."""
    return not (callable(value) or isinstance(value, types.ModuleType | classmethod | staticmethod | property)
                or value is None or type(value).__module__ in ("typing", "types", "__future__"))


def _spelled(value: Any) -> str:
    """Data as text, the same in every process. Raises TypeError for what has no such text."""
    if isinstance(value, np.ndarray | np.generic):
        return f"{value.dtype} {value.shape} {value.tobytes()!r}"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{name!r}: {_spelled(inner)}' for name, inner in value.items())}}}"
    if isinstance(value, set | frozenset):
        return f"{{{', '.join(sorted(map(_spelled, value)))}}}"
    if isinstance(value, tuple | list):
        return f"[{', '.join(map(_spelled, value))}]"
    if isinstance(value, types.CodeType):
        return _spelled(_instructions(value))
    text = getattr(value, "__qualname__", None) or repr(value)
    if " at 0x" in text:
        raise TypeError(f"a constant that keys cannot know: {text}")
    return text


def _functions_in(value: Any) -> Iterator[types.FunctionType]:
    """The functions of pipeline in a table of them."""
    for inner in value.values() if isinstance(value, dict) else value if isinstance(value, tuple | list) else ():
        if isinstance(inner, types.FunctionType):
            yield inner
        yield from _functions_in(inner)


def _code_digest(function: types.FunctionType) -> str:
    docstring = function.__code__.co_consts[:1] == (function.__doc__,)
    code = _instructions(function.__code__, docstring)
    return _sha256(_spelled([code, function.__defaults__, function.__kwdefaults__]))


def _instructions(code: types.CodeType, docstring: bool = False) -> list[Any]:
    """What a function does, without its docstring and its place in the file."""
    return [code.co_code, code.co_names, code.co_varnames, code.co_freevars, code.co_consts[docstring:]]


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
