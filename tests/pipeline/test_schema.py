"""scenes/README.md documents every table and key of the schemas; `python tests/test_schema.py` writes its tables."""

import re
import types
import typing
from pathlib import Path

import pytest
from annotated_types import Ge, Gt, Le, Lt, MaxLen, MinLen
from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from pipeline import elements_schema, schema

README = schema.PROJECT_SCENES / "README.md"
BY = "written by tests/test_schema.py"

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


def shared() -> dict[type[BaseModel], str]:
    """The tables that both kinds of scene have, and their paths in the first."""
    there = {model for _, model in tables(elements_schema.ElementsScene)}
    return {model: path for path, model in tables() if model in there}


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
    """What a table is called: its path, and the kinds that this form of it is for."""
    kind = model.model_fields.get("kind")
    kinds = ", ".join(f'"{k}"' for k in typing.get_args(kind.annotation)) if kind and "." not in path else ""
    return (f"[{path}]" if path else "Top of the file") + (f" kind = {kinds}" if kinds else "")


def table_of(path: str, model: type[BaseModel]) -> str:
    """A table in Markdown."""
    purpose = " ".join((model.__doc__ or "").split())
    rows = [row(name, field) for name, field in model.model_fields.items()]
    return "\n".join([f"### {heading(path, model)}", "", purpose, "", *HEAD, *rows, ""])


def documentation() -> dict[str, str]:
    """The tables of both kinds of scene in Markdown, by the name of their place in the README; what is shared stands
    in the first and is named in the second."""
    also = [f"`{heading(path, model)}`" for model, path in shared().items()]
    return {
        "tables": "\n".join(table_of(path, model) for path, model in tables()),
        "tables of elements": "\n".join([
            *(table_of(path, model) for path, model in tables(elements_schema.ElementsScene) if model not in shared()),
            f"As above, what is said of detail.size there being meant of elements.size: {', '.join(also)}."])}


def around(name: str, text: str) -> tuple[str, str, str]:
    """What stands in a text before a place of the README, in it and after it."""
    before, rest = text.split(f"<!-- {name}: {BY} -->")
    inside, after = rest.split(f"<!-- end of {name} -->")
    return before, inside.strip(), after


@pytest.mark.parametrize(("name", "content"), documentation().items())
def test_the_readme_documents_every_table_and_key_as_the_schema_has_them(name: str, content: str) -> None:
    assert around(name, README.read_text())[1] == content.strip(), "type: .venv/bin/python tests/test_schema.py"


def test_what_both_kinds_of_scene_have_is_documented_once() -> None:
    names = {model.__name__ for model in shared()}
    assert {"NoiseMotion", "FileMotion", "ShapeObstacle", "MeshObstacle"} <= names
    written = README.read_text().splitlines()
    for model, path in shared().items():
        assert written.count(f"### {heading(path, model)}") == 1


@pytest.mark.parametrize(("path", "model"), [*tables(), *tables(elements_schema.ElementsScene)])
def test_every_number_has_a_range_and_every_key_a_description(path: str, model: type[BaseModel]) -> None:
    for name, field in model.model_fields.items():
        assert field.description or branches(field.annotation), f"{path}.{name} is not described"
        said = spelled(field.annotation, field.metadata)
        bare = re.search(r"\b(integer|number)(?! [\[(])", said)
        assert not bare or name == "centre", f"{path}.{name} has no range: {said}"


def test_every_table_refuses_what_it_does_not_know() -> None:
    for _, model in [*tables(), *tables(elements_schema.ElementsScene)]:
        config = model.model_config
        assert (config["extra"], config["strict"], config["frozen"], config["allow_inf_nan"]) == (
            "forbid", True, True, False)


if __name__ == "__main__":
    for name, content in documentation().items():
        before, _, after = around(name, README.read_text())
        README.write_text(f"{before}<!-- {name}: {BY} -->\n\n{content}\n<!-- end of {name} -->{after}")
