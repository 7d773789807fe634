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
import re
import tomllib
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from pipeline.errors import BadInput
from pipeline.schema import Scene

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
    variants: dict[str, Scene]

    @property
    def name(self) -> str:
        """The file's stem, which names the make target, the output folder and the pictures."""
        return self.file.stem


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

    base = _validated(file, raw)
    quick_base = _validated(file, raw, quick_table)
    if not variants:
        return Scenes(file, quick, {"": quick_base if quick else base})
    # a variant wins over [quick]: it is what the figure compares
    full = {name: _validated(file, raw, variant) for name, variant in variants.items()}
    quickened = {name: _validated(file, raw, quick_table, variant) for name, variant in variants.items()}
    return Scenes(file, quick, quickened if quick else full)


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


def folder_name(name: str) -> str:
    """The folder of a variant: "ω = 15" is kept in omega-15."""
    greek = (unicodedata.name(c, "").split()[-1] if "GREEK" in unicodedata.name(c, "") else c for c in name)
    return re.sub(r"[^a-z0-9.]+", "-", "".join(greek).lower()).strip("-.")


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


def _validated(file: Path, raw: Raw, *overrides: Overrides) -> Scene:
    """The scene of `raw` under `overrides`, the last one winning; BadInput blames the override if it was one."""
    for table in overrides:
        raw = _overridden(file, raw, table)
    try:
        scene = Scene.model_validate(raw, context={"folder": file.parent})
        key, reason = _fault_between_tables(scene)
    except ValidationError as error:
        key, reason = _first_fault(raw, error)
    if not reason:
        return scene
    for table in reversed(overrides):
        for path in table.table:
            if key == path or key.startswith((f"{path}.", f"{path}[")):
                raise BadInput(file, f'{table.where}."{path}"' + key[len(path):], reason)
            if path.startswith(f"{key}."):  # the fault lies above what was overridden: a table nobody knows
                raise BadInput(file, f'{table.where}."{path}"', reason)
    raise BadInput(file, f"{overrides[-1].where}: {key}" if overrides else key, reason)


def _first_fault(raw: Raw, error: ValidationError) -> tuple[str, str]:
    """Dotted key and reason of one fault: a misspelt key first, for it is often why another is missing."""
    faults = sorted(error.errors(), key=lambda fault: fault["type"] != "extra_forbidden")
    fault = faults[0]
    key = ""
    table: Any = raw
    model: type[BaseModel] = Scene
    for part in fault["loc"]:
        if isinstance(part, int):
            key += f"[{part}]"
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


def _fault_between_tables(scene: Scene) -> tuple[str, str]:
    """Dotted key and reason of values that are fine each and impossible together; ("", "") if all is well."""
    exemplar, detail = scene.exemplar, scene.detail
    columns, rows = detail.size
    if exemplar.size > min(columns, rows):
        return "exemplar.size", f"an exemplar of {exemplar.size}² is larger than the output ({columns}×{rows})"
    if scene.coarse.kind != "file" and columns * scene.coarse.size[1] != rows * scene.coarse.size[0]:
        coarse = "×".join(map(str, scene.coarse.size))
        return "detail.size", f"{columns}×{rows} has not the shape of coarse.size, {coarse}"
    if isinstance(detail.levels, int) and exemplar.size >> (detail.levels - 1) < 4:
        return "detail.levels", f"{detail.levels} levels bring an exemplar of {exemplar.size}² below 4 cells"
    if (scene.density.depth is not None) != (scene.render.kind == "volume") and scene.render.kind != "none":
        need = "needs a [density.depth]" if scene.render.kind == "volume" else "draws no volume, but density.depth is"
        return "render.kind", f'"{scene.render.kind}" {need}'
    if scene.figure.frame > scene.frames:
        return "figure.frame", f"the animation has {scene.frames} frames"
    if scene.figure.labels and len(scene.figure.labels) != len(scene.figure.panels):
        return "figure.labels", f"{len(scene.figure.labels)} labels for {len(scene.figure.panels)} panels"
    if "result" in scene.figure.panels and scene.render.kind == "none":
        return "figure.panels", 'there is no "result" with render.kind = "none"'
    return "", ""
