"""A scene: one TOML file that says everything a figure depends on. Data, never code.

`load` reads and checks it. What cannot be used is one line `file: key: reason` (errors.BadInput) before any
time is spent: an unknown key (with the one that was meant), a wrong type, a number out of range, a file that
is missing or lies outside the scene's folder and the project's assets. [quick] and [variants] hold dotted
overrides (`"detail.size" = [96, 96]`); every scene they make is checked as strictly as the file itself, with
and without --quick.
"""

from __future__ import annotations

import copy
import difflib
import functools
import itertools
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from pipeline.build.graph import folder_name
from pipeline.build.method import Faults, Method
from pipeline.build.view import value_at
from pipeline.errors import BadInput
from pipeline.methods import METHODS

Raw = Mapping[str, Any]
WORDS = (  # pydantic's for ours
    ("Input should", "should"),
    ("a valid dictionary or object to extract fields from", "a table"),
    ("a valid dictionary or instance of", "a table:"),
    ("a valid tuple", "an array"),
    ("Input is not a valid path for <class 'pathlib.Path'>", "should be a file's name"),
    ("Tuple should have", "should have"),
    (" after validation", ""),
)


@dataclass(frozen=True)
class Scenes:
    """What one file declares: one scene per variant, by the variant's name; without variants one named ""."""

    file: Path
    quick: bool
    method: Method
    variants: dict[str, Any]


@dataclass(frozen=True)
class Overrides:
    """A table of dotted overrides, and the place in the file that holds it."""

    where: str
    table: Raw


def load(file: Path, quick: bool = False) -> Scenes:
    """The scenes of `file`, with `quick` under its [quick] overrides. Raises BadInput."""
    raw = _read(file)
    quick_table = Overrides("quick", _table(file, "quick", raw.pop("quick", {})))
    variants = {
        name: Overrides(f'variants."{name}"', _table(file, f'variants."{name}"', table))
        for name, table in _table(file, "variants", raw.pop("variants", {})).items()
    }
    _check_folder_names(file, list(variants))

    method = _method(raw)
    base = _validated(file, method, raw)
    quick_base = _validated(file, method, raw, quick_table)
    if not variants:
        return Scenes(file, quick, method, {"": quick_base if quick else base})
    # a variant wins over [quick]: it is what the figure compares
    full = {name: _validated(file, method, raw, variant) for name, variant in variants.items()}
    quickened = {name: _validated(file, method, raw, quick_table, variant) for name, variant in variants.items()}
    for scenes in (full, quickened):
        _require_one_figure(file, scenes)
    return Scenes(file, quick, method, quickened if quick else full)


def _read(file: Path) -> dict[str, Any]:
    if file.suffix != ".toml" or folder_name(file.stem) != file.stem:
        raise BadInput(file, "", "a scene's name has lower-case letters, digits, - and . and ends in .toml")
    try:
        return tomllib.loads(file.read_bytes().decode())
    except FileNotFoundError:
        raise BadInput(file, "", "no such scene; `flowloom list` shows the project's") from None
    except OSError as error:
        raise BadInput(file, "", f"cannot be read: {error.strerror}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise BadInput(file, "", f"is not TOML: {error}") from error


def _check_folder_names(file: Path, variants: list[str]) -> None:
    seen: dict[str, str] = {}
    for name in variants:
        other = seen.setdefault(folder_name(name), name)
        if not folder_name(name):
            raise BadInput(file, f'variants."{name}"', "its name needs a letter or a digit")
        if other != name:
            raise BadInput(file, f'variants."{name}"', f"shares the folder {folder_name(name)} with {other!r}")


def _table(file: Path, where: str, value: object) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise BadInput(file, where, "is not a table")
    return value


def _overridden(file: Path, raw: Raw, overrides: Overrides) -> dict[str, Any]:
    """`raw` with each override put at its dotted path; a path without a dot replaces a whole table."""
    result = copy.deepcopy(dict(raw))
    for path, value in overrides.table.items():
        table = result
        *parents, last = path.split(".")
        for parent in parents:
            table = table.setdefault(parent, {})
            if not isinstance(table, dict):
                raise BadInput(file, f'{overrides.where}."{path}"', f"{parent} is not a table")
        table[last] = copy.deepcopy(value)
    return result


def _validated(file: Path, method: Method, raw: Raw, *overrides: Overrides) -> Any:
    """The scene of `raw` under `overrides`, the last one winning; BadInput blames the override if it was one."""
    for table in overrides:
        raw = _overridden(file, raw, table)
    try:
        scene = method.scene.model_validate(raw, context={"folder": file.parent})
        key, reason = _fault_between_tables(method, scene)
    except ValidationError as error:
        key, reason = _first_fault(method.scene, raw, error)
    if not reason:
        return scene
    for table in reversed(overrides):
        for path in table.table:
            if key == path or key.startswith((f"{path}.", f"{path}[")):
                raise BadInput(file, f'{table.where}."{path}"' + key[len(path):], reason)
            if path.startswith(f"{key}."):  # the fault lies above what was overridden: a table nobody knows
                raise BadInput(file, f'{table.where}."{path}"', reason)
    raise BadInput(file, f"{overrides[-1].where}: {key}" if overrides else key, reason)


def _method(raw: Raw) -> Method:
    """The method of a scene: that of the first of the methods' tables that it has."""
    return next((method for method in METHODS[1:] if method.table in raw), METHODS[0])


def _first_fault(scene: type[BaseModel], raw: Raw, error: ValidationError) -> tuple[str, str]:
    """Dotted key and reason of one fault: a misspelt key first, for it is often why another is missing."""
    faults = sorted(error.errors(), key=lambda fault: fault["type"] != "extra_forbidden")
    fault = faults[0]
    key = ""
    table: Any = raw
    model = scene
    field: FieldInfo | None = None
    for part in fault["loc"]:
        if isinstance(part, int):
            key += f"[{part}]"
            table = table[part] if isinstance(table, list) and part < len(table) else {}
            model = _model_of(field.annotation if field else None, table) or model
        elif isinstance(table, Mapping) and (part in table or part == fault["loc"][-1]):
            key += f".{part}" if key else part
            field = model.model_fields.get(part)
            table = table.get(part, {})
            model = _model_of(field.annotation if field else None, table) or model
        # else the part is pydantic's name for a branch of a union, which the user never wrote
    if fault["type"] in ("union_tag_invalid", "union_tag_not_found"):
        key += ".kind"
    return key, _reason(fault, model)


def _model_of(annotation: Any, table: Any) -> type[BaseModel] | None:
    """The table class that `annotation` allows for `table`: of several, the one with its kind."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    kind = table.get("kind") if isinstance(table, Mapping) else None
    for choice in get_args(annotation):
        model = _model_of(choice, table)
        kinds = get_args(model.model_fields["kind"].annotation) if model and "kind" in model.model_fields else (kind,)
        if kind in kinds:
            return model
    return None


def _reason(fault: Mapping[str, Any], model: type[BaseModel]) -> str:
    """A fault in the user's words."""
    context, given = fault.get("ctx", {}), fault["input"]
    match fault["type"]:
        case "extra_forbidden":
            return f"unknown key{_did_you_mean(str(fault['loc'][-1]), model.model_fields)}"
        case "missing":
            return "is missing"
        case "union_tag_not_found":
            return "is missing"
        case "union_tag_invalid":
            kinds = re.findall(r"'([^']*)'", context["expected_tags"])
            return f"unknown kind {context['tag']!r}{_did_you_mean(context['tag'], kinds)}"
        case "literal_error":
            choices = re.findall(r"'([^']*)'", context["expected"])
            return f"{given!r} is not one of them{_did_you_mean(str(given), choices)}"
        case "value_error":
            return str(context["error"])
        case _:
            message = functools.reduce(lambda text, pair: text.replace(*pair), WORDS, fault["msg"])
            shown = {"dict": "a table", "list": "an array"}.get(type(given).__name__) or repr(given)
            return f"{message[0].lower()}{message[1:]}, not {shown}"


def _did_you_mean(given: str, known: Any) -> str:
    close = difflib.get_close_matches(given.lower(), list(known), n=1, cutoff=0.6)
    return f"; did you mean {close[0]}?" if close else f"; known: {', '.join(known)}"


def _fault_between_tables(method: Method, scene: Any) -> tuple[str, str]:
    """Dotted key and reason of values that are fine each and impossible together; ("", "") if all is well."""
    faults = itertools.chain(*(check(scene) for check in method.checks), _figure_fits(method, scene))
    return next(faults, ("", ""))


def _figure_fits(method: Method, scene: Any) -> Faults:
    """What the figure shows."""
    figure = scene.figure
    if figure.frame > scene.frames:
        yield "figure.frame", f"the animation has {scene.frames} frames"
    if figure.webp and not figure.animation:
        yield "figure.webp", "there is no animation with figure.animation = false"
    panels = len(method.panels(scene))
    if figure.labels and len(figure.labels) != panels:
        yield "figure.labels", f"{len(figure.labels)} labels, but {panels} panel{'s' if panels != 1 else ''}"


ONE_FIGURE = ("fps", "figure.frame", "figure.animation", "figure.webp", "figure.columns")
"""What the one still and the one animation of a file have once, however many variants they show."""


def _require_one_figure(file: Path, scenes: Mapping[str, Any]) -> None:
    """Refuse variants that want the one figure of the file in two ways."""
    first, *others = scenes.items()
    for name, scene in others:
        for key in ONE_FIGURE:
            mine, theirs = value_at(scene, key), value_at(first[1], key)
            if mine != theirs:
                raise BadInput(file, f'variants."{name}"."{key}"', f"is {_spelled(mine)}, and {_spelled(theirs)} in "
                               f'variants."{first[0]}": a file has one figure')


def _spelled(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else f"{value:g}"
