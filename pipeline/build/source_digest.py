"""The code that an artifact depends on, found by following names and imports; no list is written by hand.

Of `synth` and `render` a whole module counts, with its kernels and all the modules that it imports. Of `pipeline`
each definition counts by itself, a function, a class, a constant, with those that it names: one module holds the
artifacts of several looks, and an edit to one must not render the others again. `pipeline.build` and the errors
compute nothing. The methods of the tables that an artifact reads count too: `make` can call them.

Only what computes counts: formatting, comments, docstrings and annotations do not.

Not followed: names that are made up at run time. tests/pipeline/build/test_source_digest.py traces what runs.
"""

from __future__ import annotations

import ast
import functools
import hashlib
import inspect
import re
import types
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
WHOLE = ("synth", "render")
COMPUTES_NOTHING = ("pipeline.build", "pipeline.errors", "pipeline.progress", "pipeline.tables")


@dataclass(frozen=True)
class Definition:
    """A name at the top of a module of pipeline, or a name in a class there.

    of  the class that `self` and `cls` stand for, "module:class"; "" outside of classes
    """

    module: str
    name: str
    of: str = ""


def digest(functions: Iterable[Callable[..., Any]], tables: Iterable[type] = ()) -> str:
    """SHA-256 of all that `functions`, and the methods of `tables`, depend on."""
    starts = [start for function in functions for start in _start(function)]
    starts += [Definition(defined.__module__, f"{defined.__name__}.{name}", f"{table.__module__}:{table.__name__}")
               for table in tables for defined in table.__mro__ if defined.__module__.startswith("pipeline.")
               for name, value in vars(defined).items()
               if isinstance(value, types.FunctionType | classmethod | property) and not name.startswith("__")]
    return _digest(frozenset(starts))


@functools.cache
def _digest(starts: frozenset[Definition]) -> str:
    said = {f"{place} {sha256}" for place, sha256 in sources(starts)}
    return hashlib.sha256("\n".join(sorted(said)).encode()).hexdigest()


def sources(starts: Iterable[Definition]) -> Iterator[tuple[str, str]]:
    """(place, SHA-256) of all that `starts` depend on: `synth/advect.py`, `pipeline/flow.py walls`."""
    waiting: list[Definition | Path] = list(starts)
    seen: set[Definition | Path] = set()
    while waiting:
        item = waiting.pop()
        if item not in seen:
            seen.add(item)
            found, next_ones = _followed(item)
            yield from found
            waiting += next_ones


@functools.cache
def _followed(item: Definition | Path) -> tuple[list[tuple[str, str]], list[Definition | Path]]:
    """What counts of a file or a definition, and what it depends on by itself."""
    if isinstance(item, Path):
        text = ast.dump(_tree(item)) if item.suffix == ".py" else item.read_text()
        return [(item.relative_to(ROOT).as_posix(), _sha256(text))], [*_imported_methods(item), *_kernels(item)]
    if item.module.startswith(COMPUTES_NOTHING):
        return [], []
    place = f"{_file(item.module).relative_to(ROOT).as_posix()} {item.name}"
    nodes = _nodes(item)
    named = [target for node in nodes for target in _named(node, item)]
    return [(place, _sha256(ast.dump(node))) for node in nodes], [*named, *_inherited(item)]


def _start(function: Callable[..., Any]) -> list[Definition]:
    """The definition of a function, or of a method as its object's class has it."""
    owner = getattr(function, "__self__", None)
    function = inspect.unwrap(getattr(function, "__func__", function))
    if not getattr(function, "__module__", "").startswith("pipeline."):
        return []  # of a library, such as Path.read_bytes
    of = f"{function.__module__}:{function.__qualname__.split('.')[0]}" if "." in function.__qualname__ else ""
    if owner is not None:
        table = owner if isinstance(owner, type) else type(owner)
        of = f"{table.__module__}:{table.__name__}"
    return [Definition(function.__module__, function.__qualname__, of)]


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


# -- modules ------------------------------------------------------------------------------------------------------


def _file(module: str) -> Path:
    """The file of a dotted module; of a package its __init__.py."""
    path = ROOT.joinpath(*module.split("."))
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


@functools.cache
def _tree(file: Path) -> ast.Module:
    """The syntax tree of a file, without what does not compute."""
    stripped = _Stripped().visit(ast.parse(file.read_text(encoding="utf-8")))
    assert isinstance(stripped, ast.Module)
    return stripped


class _Stripped(ast.NodeTransformer):
    """Leaves out docstrings and annotations, and functions that declare artifacts instead of making them."""

    def generic_visit(self, node: ast.AST) -> ast.AST:
        for name in ("annotation", "returns"):
            if getattr(node, name, None) is not None:
                setattr(node, name, ast.Constant(None) if isinstance(node, ast.AnnAssign) else None)
        super().generic_visit(node)
        body = getattr(node, "body", None)
        if isinstance(body, list):
            kept = [one for one in body
                    if not (isinstance(one, ast.Expr) and isinstance(one.value, ast.Constant))]
            node.body = kept or [ast.Pass()]  # type: ignore[attr-defined]
        return node

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        if node.returns is not None and "Artifact" in ast.unparse(node.returns):
            node.body = [ast.Pass()]
        return self.generic_visit(node)


def _imported_methods(file: Path) -> tuple[Path, ...]:
    """The files of WHOLE that a file of WHOLE imports, at its top or inside a function."""
    names: list[str] = []
    for node in ast.walk(_tree(file)) if file.suffix == ".py" else ():
        names += [target for _, target in _bindings(node)]
        if isinstance(node, ast.ImportFrom) and node.module:
            names.append(node.module)
    return tuple(found for name in names if name.split(".")[0] in WHOLE and (found := _file(name)).is_file())


def _kernels(file: Path) -> tuple[Path, ...]:
    """The kernel beside a module, or what a kernel includes, as synth.opencl.with_includes finds it."""
    if file.suffix == ".py":
        return (file.with_suffix(".cl"),) if file.with_suffix(".cl").is_file() else ()
    named = re.findall(r'^#include "([^"]+)"$', file.read_text(), flags=re.MULTILINE)
    return tuple(ROOT / "synth" / name for name in named if (ROOT / "synth" / name).is_file())


def _bindings(node: ast.AST) -> list[tuple[str, str]]:
    """(local name, dotted target) of an import statement."""
    if isinstance(node, ast.Import):
        return [(alias.asname or alias.name.split(".")[0], alias.name) for alias in node.names]
    if isinstance(node, ast.ImportFrom) and node.module and not node.level:
        return [(alias.asname or alias.name, f"{node.module}.{alias.name}") for alias in node.names]
    return []


# -- definitions --------------------------------------------------------------------------------------------------


@functools.cache
def _defined(module: str) -> tuple[dict[str, list[ast.stmt]], dict[str, str]]:
    """The statements at the top of a module by the names they define, and the targets of its imports."""
    file = _file(module)
    return _names(_tree(file).body) if file.is_file() else ({}, {})


def _names(body: Iterable[ast.stmt]) -> tuple[dict[str, list[ast.stmt]], dict[str, str]]:
    defined: dict[str, list[ast.stmt]] = {}
    imports: dict[str, str] = {}
    for node in body:
        imports |= dict(_bindings(node))
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            defined.setdefault(node.name, []).append(node)
        elif isinstance(node, ast.Assign | ast.AnnAssign | ast.AugAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            for name in (n.id for target in targets for n in ast.walk(target) if isinstance(n, ast.Name)):
                defined.setdefault(name, []).append(node)
    return defined, imports


def _nodes(item: Definition) -> list[ast.stmt]:
    """The statements that define a name; of `C.m` those in the body of class C."""
    first, _, inner = item.name.partition(".")
    found = _defined(item.module)[0].get(first, [])
    if not inner:
        return found
    return [node for one in found if isinstance(one, ast.ClassDef) for node in _names(one.body)[0].get(inner, [])]


def _inherited(item: Definition) -> list[Definition | Path]:
    """Where a class does not define a name itself: the same name in its bases."""
    first, _, inner = item.name.partition(".")
    if not inner or _nodes(item):
        return []
    return [target for one in _defined(item.module)[0].get(first, []) if isinstance(one, ast.ClassDef)
            for base in one.bases for target in _resolved(f"{ast.unparse(base)}.{inner}", item, {})]


def _named(node: ast.stmt, item: Definition) -> list[Definition | Path]:
    """The definitions of pipeline and the files of WHOLE that a statement names."""
    local: dict[str, str] = {}
    for inner in ast.walk(node):
        local |= dict(_bindings(inner))
    return [target for name in _dotted(node) for target in _resolved(name, item, local)]


def _dotted(node: ast.AST) -> Iterator[str]:
    """Every name of a statement with the attributes that are read of it: `volumes.read`, `cls.mesh`."""
    if isinstance(node, ast.Attribute):
        text = ast.unparse(node)
        if re.fullmatch(r"[\w.]+|super\(\)\.\w+", text):
            yield text
            return
    if isinstance(node, ast.Name):
        yield node.id
    for child in ast.iter_child_nodes(node):
        yield from _dotted(child)


def _resolved(name: str, item: Definition, local: dict[str, str]) -> list[Definition | Path]:
    """What a dotted name stands for in the module of `item`: definitions, files, or nothing of ours."""
    root, _, rest = name.partition(".")
    defined, imports = _defined(item.module)
    if root in ("self", "cls") and item.of:
        module, _, table = item.of.partition(":")
        return [Definition(module, f"{table}.{rest.split('.')[0]}", item.of)] if rest else []
    if root == "super()":
        table = item.name.split(".")[0]
        found = [target for one in defined.get(table, []) if isinstance(one, ast.ClassDef) for base in one.bases
                 for target in _resolved(f"{ast.unparse(base)}.{rest}", item, {})]
        return [Definition(one.module, one.name, item.of) if isinstance(one, Definition) else one for one in found]
    target = local.get(root) or imports.get(root)
    if target:
        return _targets(f"{target}.{rest}" if rest else target, item.of)
    if root in defined:
        return _attribute(item.module, root, rest, item.of)
    return []


def _targets(dotted: str, of: str) -> list[Definition | Path]:
    """What a dotted target of an import stands for."""
    top = dotted.split(".")[0]
    parts = dotted.split(".")
    modules = [".".join(parts[:end]) for end in range(len(parts), 0, -1)]
    module = next((one for one in modules if top in (*WHOLE, "pipeline") and _file(one).is_file()), "")
    if not module:
        return []
    if top in WHOLE:
        return [_file(module)]
    rest = parts[len(module.split(".")):]
    if not rest:  # the module itself is handed on
        return [Definition(module, name) for name in _defined(module)[0]]
    defined, imports = _defined(module)
    if rest[0] in defined:
        return _attribute(module, rest[0], ".".join(rest[1:]), of)
    return _targets(".".join([imports[rest[0]], *rest[1:]]), of) if rest[0] in imports else []


def _attribute(module: str, name: str, rest: str, of: str) -> list[Definition | Path]:
    """A definition; of a class that a name is read of, that name."""
    is_class = any(isinstance(node, ast.ClassDef) for node in _defined(module)[0][name])
    if is_class and rest:
        return [Definition(module, f"{name}.{rest.split('.')[0]}", of or f"{module}:{name}")]
    return [Definition(module, name, f"{module}:{name}" if is_class else "")]
