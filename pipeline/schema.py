"""What a scene may hold, for people and for editors: the tables of scenes/README.md, and a JSON Schema.

Both are written from the models of the methods, so that they are true: `flowloom schema --write`.
"""

from __future__ import annotations

import json
import types
import typing
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from annotated_types import Ge, Gt, Le, Lt, MaxLen, MinLen
from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic.json_schema import models_json_schema
from pydantic_core import PydanticUndefined

from pipeline.files import atomic
from pipeline.methods import METHODS
from pipeline.tables import PROJECT_SCENES, AssetOrFolder, Folder

README, SCHEMA = PROJECT_SCENES / "README.md", PROJECT_SCENES / "scene.schema.json"
BY = "written by flowloom schema --write"
HEAD = ("| key | what | type and range | unit | default |", "|---|---|---|---|---|")
OVERRIDES = {"type": "object", "description": "overrides by dotted keys: \"detail.size\" = [96, 96]"}


def write() -> None:
    """Write the JSON Schema, and the tables into their places in scenes/README.md."""
    text = README.read_text(encoding="utf-8")
    for name, content in documentation().items():
        before, _, after = around(name, text)
        text = f"{before}<!-- {name}: {BY} -->\n\n{content}\n\n<!-- end of {name} -->{after}"
    atomic.write_text(README, text)
    atomic.write_text(SCHEMA, json_schema() + "\n")


def json_schema() -> str:
    """The JSON Schema of scene files (draft 2020-12), for an editor's completion and checks."""
    places, definitions = models_json_schema([(method.scene, "validation") for method in METHODS])
    references = [places[method.scene, "validation"] for method in METHODS]
    for reference in references:
        definition = definitions["$defs"][reference["$ref"].rpartition("/")[2]]
        definition["properties"] |= {
            "quick": {**OVERRIDES, "description": "what --quick overrides"},
            "variants": {"type": "object", "description": "one figure of several scenes: overrides by name",
                         "additionalProperties": OVERRIDES}}
    scene: dict[str, Any] = references[0]
    for method, reference in zip(METHODS[1:], references[1:], strict=True):
        scene = {"if": {"required": [method.table]}, "then": reference, "else": scene}
    return json.dumps({"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "A scene of flowloom",
                       **scene, **definitions}, indent=1, ensure_ascii=False)


def documentation() -> dict[str, str]:
    """The tables of each method in Markdown, by the name of their place in the README; what two methods share stands
    with the first and is named with the second."""
    found: dict[str, str] = {}
    known: dict[type[BaseModel], str] = {}
    for method in METHODS:
        every = tables(method.scene)
        own = [table_of(path, model) for path, model in every if model not in known]
        shared = [f"`{heading(known[model], model)}`" for _, model in every if model in known]
        if shared:
            own.append("As above, what is said of detail.size there being meant of "
                       f"{method.scene.cells_key}: {', '.join(shared)}.")
        found[f"tables of {method.name}"] = "\n".join(own).strip()
        known = {model: path for path, model in every} | known
    return found


def around(name: str, text: str) -> tuple[str, str, str]:
    """What stands in a text before a place of the README, in it and after it."""
    before, rest = text.split(f"<!-- {name}: {BY} -->")
    inside, after = rest.split(f"<!-- end of {name} -->")
    return before, inside.strip(), after


def branches(annotation: Any) -> Iterator[type[BaseModel]]:
    """The tables among the types that `annotation` allows."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in typing.get_args(annotation):
        yield from branches(part)


def tables(model: type[BaseModel], path: str = "") -> list[tuple[str, type[BaseModel]]]:
    """(dotted path, table) of a model, depth first, each table once."""
    found = [(path, model)]
    for name, field in model.model_fields.items():
        for table in branches(field.annotation):
            found += [(at, one) for at, one in tables(table, f"{path}.{name}" if path else name)
                      if one not in [known for _, known in found]]
    return found


def limits(metadata: Iterable[Any]) -> str:
    """The range that a field's metadata demand: [0, 1], (0, 1] …"""
    low, high = "", ""
    for limit in metadata:
        if isinstance(limit, Ge | Gt):
            low = f"[{limit.ge}" if isinstance(limit, Ge) else f"({limit.gt}"
        if isinstance(limit, Le | Lt):
            high = f"{limit.le}]" if isinstance(limit, Le) else f"{limit.lt})"
    return f"{low}, {high}" if low and high else ""


PATHS: dict[str, Any] = {"folder": Folder, "file or folder": AssetOrFolder}
"""In the reader's words, paths that are not those of a file alone."""


def spelled(annotation: Any, metadata: Iterable[Any] = ()) -> str:
    """A type in the reader's words: integer [1, 50], "lit", array of 2 integers [4, 4096] …"""
    metadata = list(metadata)
    origin, parts = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is typing.Annotated:
        inner = [m for part in parts[1:] for m in (part.metadata if isinstance(part, FieldInfo) else [part])]
        return spelled(parts[0], [*inner, *metadata])
    if origin is typing.Literal:
        return " · ".join(f'`"{value}"`' for value in parts)
    if origin in (typing.Union, types.UnionType):
        return " or ".join(dict.fromkeys(spelled(part, metadata) for part in parts if part is not type(None)))
    if origin is tuple:
        shortest = next((m.min_length for m in metadata if isinstance(m, MinLen)), 0)
        longest = next((m.max_length for m in metadata if isinstance(m, MaxLen)), "any")
        count = f"{shortest} to {longest}" if shortest != longest else f"{shortest}"
        count = count if parts[-1] is Ellipsis else f"{len(parts)}"
        return f"array of {count}: {spelled(parts[0])}"
    if annotation is Path:
        return next((word for word, kind in PATHS.items() if kind.__metadata__[-1] in metadata), "file")
    name = {int: "integer", float: "number", str: "text", bool: "true or false"}.get(annotation, "table")
    return f"{name} {limits(metadata)}".strip()


def default(field: FieldInfo) -> str:
    """What a key is if it is left out."""
    value = field.default
    factory: Any = field.default_factory
    if factory:
        flat, deep = (factory({"size": size}) for size in ((8, 8), (8, 8, 8)))
        return f"{spelled_value(flat)}, in 3-D {spelled_value(deep)}"
    if value is PydanticUndefined:
        return "needed"
    if value is None:
        return "none"
    if isinstance(value, BaseModel) or (isinstance(value, tuple) and value and isinstance(value[0], BaseModel)):
        return "as below"
    return spelled_value(value)


def spelled_value(value: object) -> str:
    """A value as one writes it in a scene."""
    text = {True: "true", False: "false"}.get(value) if isinstance(value, bool) else None
    if isinstance(value, str):
        text = f'"{value}"'
    if isinstance(value, tuple):
        text = "[" + ", ".join(f'"{v}"' if isinstance(v, str) else f"{v:g}" for v in value) + "]"
    return f"`{text or f'{value:g}'}`"


def row(name: str, field: FieldInfo) -> str:
    """One key as a row of a Markdown table."""
    extra: Any = field.json_schema_extra or {}
    unit = extra.get("unit", "")
    description = field.description or "a table, see below"
    return f"| `{name}` | {description} | {spelled(field.annotation, field.metadata)} | {unit} | {default(field)} |"


def heading(path: str, model: type[BaseModel]) -> str:
    """What a table is called: its path, and the kinds that this form of it is for."""
    kind = model.model_fields.get("kind")
    kinds = ", ".join(f'"{k}"' for k in typing.get_args(kind.annotation)) if kind else ""
    return (f"[{path}]" if path else "Top of the file") + (f" kind = {kinds}" if kinds else "")


def table_of(path: str, model: type[BaseModel]) -> str:
    """A table in Markdown."""
    purpose = " ".join((model.__doc__ or "").split())
    fields = sorted(model.model_fields.items(), key=lambda field: field[0] != "kind")
    rows = [row(name, field) for name, field in fields]
    return "\n".join([f"### {heading(path, model)}", "", purpose, "", *HEAD, *rows, ""])
