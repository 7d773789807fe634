"""scenes/README.md documents every table and key of the schema; `python tests/test_schema.py` writes its tables."""

import re
import types
import typing
from pathlib import Path

import pytest
from annotated_types import Ge, Gt, Le, Lt, MaxLen, MinLen
from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from pipeline import schema

README = schema.PROJECT_SCENES / "README.md"
START, END = "<!-- tables: written by tests/test_schema.py -->", "<!-- end of tables -->"


HEAD = ("| key | what | type and range | unit | default |", "|---|---|---|---|---|")


def branches(annotation: object) -> list[type[BaseModel]]:
    """The tables among the types that `annotation` allows."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [table for part in typing.get_args(annotation) for table in branches(part)]


def tables(model: type[BaseModel] = schema.Scene, path: str = "") -> list[tuple[str, type[BaseModel]]]:
    """(dotted path, table) of the schema, depth first, each table once."""
    found = [(path, model)]
    for name, field in model.model_fields.items():
        for table in branches(field.annotation):
            found += [(at, one) for at, one in tables(table, f"{path}.{name}" if path else name)
                      if one not in [known for _, known in found]]
    return found


def limits(metadata: object) -> str:
    """The range that a field's metadata demand: [0, 1], (0, 1] …"""
    low, high = "", ""
    for limit in metadata:
        if isinstance(limit, Ge | Gt):
            low = f"[{limit.ge}" if isinstance(limit, Ge) else f"({limit.gt}"
        if isinstance(limit, Le | Lt):
            high = f"{limit.le}]" if isinstance(limit, Le) else f"{limit.lt})"
    return f"{low}, {high}" if low and high else ""


def spelled(annotation: object, metadata: object = ()) -> str:
    """A type in the reader's words: integer [1, 50], "lit", array of 2 integers [4, 4096] …"""
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
    name = {int: "integer", float: "number", str: "text", bool: "true or false", Path: "file"}.get(annotation, "table")
    return f"{name} {limits(metadata)}".strip()


def default(field: FieldInfo) -> str:
    """What a key is if it is left out."""
    value = field.default
    if field.default_factory:
        flat, deep = (field.default_factory({"size": size}) for size in ((8, 8), (8, 8, 8)))
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
    unit = (field.json_schema_extra or {}).get("unit", "")
    description = field.description or "a table, see below"
    return f"| `{name}` | {description} | {spelled(field.annotation, field.metadata)} | {unit} | {default(field)} |"


def heading(path: str, model: type[BaseModel]) -> str:
    """A table's heading: its path, and the kinds that this form of it is for."""
    kind = model.model_fields.get("kind")
    kinds = ", ".join(f'"{k}"' for k in typing.get_args(kind.annotation)) if kind and "." not in path else ""
    return f"### {f'[{path}]' if path else 'Top of the file'}" + (f" kind = {kinds}" if kinds else "")


def documentation() -> str:
    """All tables of the schema in Markdown."""
    parts = []
    for path, model in tables():
        purpose = " ".join((model.__doc__ or "").split())
        rows = [row(name, field) for name, field in model.model_fields.items()]
        parts.append("\n".join([heading(path, model), "", purpose, "", *HEAD, *rows, ""]))
    return "\n".join(parts)


def test_the_readme_documents_every_table_and_key_as_the_schema_has_them() -> None:
    text = README.read_text()
    written = text[text.index(START) + len(START):text.index(END)].strip()
    assert written == documentation().strip(), "type: .venv/bin/python tests/test_schema.py"


@pytest.mark.parametrize(("path", "model"), tables())
def test_every_number_has_a_range_and_every_key_a_description(path: str, model: type[BaseModel]) -> None:
    for name, field in model.model_fields.items():
        assert field.description or branches(field.annotation), f"{path}.{name} is not described"
        said = spelled(field.annotation, field.metadata)
        bare = re.search(r"\b(integer|number)(?! [\[(])", said)
        assert not bare or name == "centre", f"{path}.{name} has no range: {said}"


def test_every_table_refuses_what_it_does_not_know() -> None:
    for _, model in tables():
        config = model.model_config
        assert (config["extra"], config["strict"], config["frozen"], config["allow_inf_nan"]) == (
            "forbid", True, True, False)


if __name__ == "__main__":
    before, after = README.read_text().split(START)[0], README.read_text().split(END)[1]
    README.write_text(f"{before}{START}\n\n{documentation()}\n{END}{after}")
