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
import math
import re
import tomllib
import unicodedata
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from pipeline.elements_schema import ElementsScene, TracksExemplar, TracksMotion
from pipeline.errors import BadInput
from pipeline.product import Scene as AnyScene
from pipeline.schema import Scene, ShapeObstacle, View, is_of_exemplar

Raw = Mapping[str, Any]
FLAT = ("lit", "ink", "particles")  # kinds of [render] that draw a plane
MOST_APART = 4  # at most so much larger is an exemplar than another: at the coarsest level a 9² neighbourhood sees both
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
    variants: dict[str, AnyScene]

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


def _validated(file: Path, raw: Raw, *overrides: Overrides) -> AnyScene:
    """The scene of `raw` under `overrides`, the last one winning; BadInput blames the override if it was one."""
    for table in overrides:
        raw = _overridden(file, raw, table)
    try:
        scene = _kind(raw).model_validate(raw, context={"folder": file.parent})
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


def _kind(raw: Raw) -> type[Scene] | type[ElementsScene]:
    """What kind of scene a file is."""
    return ElementsScene if "elements" in raw else Scene


def _first_fault(raw: Raw, error: ValidationError) -> tuple[str, str]:
    """Dotted key and reason of one fault: a misspelt key first, for it is often why another is missing."""
    faults = sorted(error.errors(), key=lambda fault: fault["type"] != "extra_forbidden")
    fault = faults[0]
    key = ""
    table: Any = raw
    model: type[BaseModel] = _kind(raw)
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


def _fault_between_tables(scene: AnyScene) -> tuple[str, str]:
    """Dotted key and reason of values that are fine each and impossible together; ("", "") if all is well."""
    checks: Sequence[Callable[[Any], Faults]] = (
        (_grids, _flat_and_deep, _exemplar, _views, _obstacles, _shown) if isinstance(scene, Scene) else
        (_element_kinds, _element_places, _grids, _obstacles, _shown))
    for faults in checks:
        for key, reason in faults(scene):
            return key, reason
    return "", ""


Faults = Iterator[tuple[str, str]]


def _flat_and_deep(scene: Scene) -> Faults:
    """What is for a field in the plane and what is for one in space."""
    detail, density, render = scene.detail, scene.density, scene.render
    size = _sized(detail.size)
    if scene.dimension == 2:
        need = f"needs a field in space; detail.size is {size}"
        if scene.views:
            yield "views", need
        if detail.facing != "camera":
            yield "detail.facing", need
        if scene.figure.plane != "front":
            yield "figure.plane", need
        for number, source in enumerate(density.sources):
            if len(source.centre) != 2:
                yield f"density.sources[{number}].centre", need
        if render.kind == "seaweed":
            yield "render.kind", f'"seaweed" {need}'
        if (density.depth is not None) != (render.kind == "volume") and render.kind != "none":
            need = "needs a [density.depth]" if render.kind == "volume" else "draws no volume, but density.depth is"
            yield "render.kind", f'"{render.kind}" {need}'
    else:
        if density.depth is not None:
            yield "density.depth", f"gives a plane a body; detail.size is {size}, which has one"
        for name, default in (("synthesize", "motion"), ("samples", "grid")):
            chosen = getattr(detail, name)
            if chosen != default:
                yield f"detail.{name}", f'"{chosen}" is for a field in the plane; detail.size is {size}'
        if render.kind in FLAT:
            yield "render.kind", f'"{render.kind}" draws a plane; detail.size is {size}'
    if detail.samples == "lagrangian":
        if detail.search != "exact":
            yield "detail.search", "samples that move have no fixed neighbours for k-coherence to ask: say exact"
        if detail.synthesize != "motion":
            yield "detail.synthesize", "the potential is synthesized on the grid only"
    if (detail.facing == "directions") != bool(detail.directions):
        yield "detail.directions", ("is missing, for facing = \"directions\"" if not detail.directions else
                                    f"is not used with facing = \"{detail.facing}\"")
    for number, direction in enumerate(detail.directions):
        if not any(direction.vector):
            yield f"detail.directions[{number}].vector", "is zero: it faces nowhere"
        if direction.at in [other.at for other in detail.directions[:number]]:
            yield f"detail.directions[{number}].at", "is the place of one before it"


def _exemplar(scene: Scene) -> Faults:
    """The exemplar of a field in the plane."""
    if scene.dimension == 3:
        return
    size, levels = scene.exemplar.size, scene.detail.levels
    if size > min(scene.detail.size):
        yield "exemplar.size", f"an exemplar of {size}² is larger than the output ({_sized(scene.detail.size)})"
    if isinstance(levels, int) and size >> (levels - 1) < 4:
        yield "detail.levels", f"{levels} levels bring an exemplar of {size}² below 4 cells"


def _views(scene: Scene) -> Faults:
    """The views of a field in space (§3.2): whole, of one scale, smaller than the output, and enough of them."""
    if scene.dimension == 2:
        return
    smallest = min(_exemplar_of(view).size for view in scene.seen)
    for number, view in enumerate(scene.seen):
        exemplar, where = _exemplar_of(view), f"views[{number}]"
        if not view.plane and not (view.right and view.up):
            yield where, "needs a plane, or both right and up"
            return
        if view.plane and (view.right or view.up):
            yield f"{where}.plane", "says what right and up say too: leave one out"
        if _parallel(*view.axes):
            yield f"{where}.up", "is parallel to right, or one of them is zero: they span no plane"
        spanned = [n for n, *along in zip(scene.detail.size, *view.axes, strict=True) if any(along) or view.solid]
        size, power = exemplar.size, "³" if view.solid else "²"
        key = f"{where}.exemplar.size" if scene.views and scene.views[number].exemplar else "exemplar.size"
        if size > min(spanned):
            output = _sized(scene.detail.size)
            yield key, f"an exemplar of {size}{power} is larger than the output ({output}) along an axis of its view"
        if size > MOST_APART * smallest:
            yield key, f"an exemplar of {size}{power} beside one of {smallest}²: at most {MOST_APART} times as large"
    blind = not any(view.solid for view in scene.seen) and _unseen([a for view in scene.seen for a in view.axes])
    if blind:
        yield "views", f"do not span space: none of them shows {blind}"
    levels = scene.detail.levels
    if isinstance(levels, int) and smallest >> (levels - 1) < 4:
        yield "detail.levels", f"{levels} levels bring an exemplar of {smallest}² below 4 cells"


def _exemplar_of(view: View) -> Any:
    return view.exemplar


def _parallel(a: Sequence[float], b: Sequence[float]) -> bool:
    """Whether two vectors of space span no plane to speak of."""
    cross = (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    return math.hypot(*cross) <= 1e-3 * math.hypot(*a) * math.hypot(*b)


def _unseen(vectors: Sequence[Sequence[float]]) -> str:
    """The direction that all vectors, of which two span a plane, are perpendicular to; "" if they span space."""
    a = vectors[0]
    b = next(v for v in vectors if not _parallel(a, v))
    normal = (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    unit = [n / math.hypot(*normal) for n in normal]
    for v in vectors:
        if abs(sum(n * c for n, c in zip(unit, v, strict=True))) > 1e-3 * math.hypot(*v):
            return ""
    axis = next((name for name, n in zip("xyz", unit, strict=True) if abs(n) > 0.995), "")
    return (axis or "(" + ", ".join(f"{n:.2g}" for n in unit) + ")") + " of the local frame"


def _grids(scene: AnyScene) -> Faults:
    """Grids that have to fit each other."""
    cells, coarse = scene.cells, getattr(scene.coarse, "size", None)
    if coarse is None:
        return
    where = scene.cells_key
    if len(coarse) != len(cells):
        yield "coarse.size", f"{_sized(coarse)} has not as many axes as {where}, {_sized(cells)}"
    elif any(n * coarse[1] != cells[1] * m for n, m in zip(cells, coarse, strict=True)):
        yield where, f"{_sized(cells)} has not the shape of coarse.size, {_sized(coarse)}"


def _obstacles(scene: AnyScene) -> Faults:
    """The obstacles, and the stone that a wake needs."""
    for number, obstacle in enumerate(scene.obstacles):
        if not isinstance(obstacle, ShapeObstacle):
            continue
        yield from _of_dimension(scene, obstacle, f"obstacles[{number}]")
    if isinstance(scene, Scene) and scene.obstacles and scene.detail.boundary and scene.detail.samples == "lagrangian":
        yield "detail.samples", "samples that move do not observe a boundary: say boundary = false"
    if scene.coarse is not None and scene.coarse.kind == "wake":
        if scene.dimension == 3:
            yield "coarse.kind", f'"wake" is a flow of the plane; {scene.cells_key} is {_sized(scene.cells)}'
        if scene.stone is None:
            yield "coarse.kind", '"wake" needs a stone, an [[obstacles]] with kind = "ball"'
        if len(scene.coarse.lengths) != len(scene.coarse.gains):
            yield "coarse.gains", f"{len(scene.coarse.gains)} gains for {len(scene.coarse.lengths)} lengths"


def _of_dimension(scene: AnyScene, shape: ShapeObstacle, key: str) -> Faults:
    if len(shape.centre) != scene.dimension:
        yield f"{key}.centre", f"has {len(shape.centre)} coordinates; {scene.cells_key} is {_sized(scene.cells)}"
    if len(shape.radius) not in (1, scene.dimension if shape.kind == "box" else 1):
        yield f"{key}.radius", f"has {len(shape.radius)} numbers for a {shape.kind}"


def _shown(scene: AnyScene) -> Faults:
    """What the figure shows."""
    figure = scene.figure
    if figure.frame > scene.frames:
        yield "figure.frame", f"the animation has {scene.frames} frames"
    panels = sum(len(scene.exemplars) if is_of_exemplar(panel) else 1 for panel in figure.panels)
    if figure.labels and len(figure.labels) != panels:
        yield "figure.labels", f"{len(figure.labels)} labels for {panels} panels"
    if "result" in figure.panels and scene.render.kind == "none":
        yield "figure.panels", 'there is no "result" with render.kind = "none"'
    if "coarse" in figure.panels and scene.coarse is None:
        yield "figure.panels", 'there is no "coarse" without a [coarse]'


LOOKS = {"noodles": ("noodles",), "paper": ("paper",), "school": ("school",),
         "tracks": ("beads", "school", "noodles", "paper")}
"""The [render] kinds that draw an exemplar of elements: "beads" those that are not here."""
CARRIED = {"noodles": ("lifted", "tracks"), "paper": ("gust", "tracks")}
"""The kinds of [coarse] that threads and sheets have, by their [render] kind."""


def _element_kinds(scene: ElementsScene) -> Faults:
    """Exemplar, coarse motion and picture of one topology, in a domain of the exemplar's dimension."""
    exemplar, coarse, render = scene.exemplar, scene.coarse, scene.render.kind
    looks = LOOKS.get(exemplar.kind, ("beads",))
    if render not in looks:
        yield "render.kind", f'"{render}" draws no {exemplar.kind}: say "{looks[0]}"'
    if isinstance(exemplar, TracksExemplar) and exemplar.captured and render not in ("beads", "school"):
        yield "exemplar.captured", f'is for points, not for {render}'
    if render != "beads" and scene.frames < 2:
        yield "frames", f"an animation of {render} has 2 or more, not {scene.frames}"
    if render in CARRIED:
        if coarse is None or coarse.kind not in CARRIED[render]:
            yield "coarse" if coarse is None else "coarse.kind", f'of {render} is one of {", ".join(CARRIED[render])}'
        yield from _for_points_alone(scene, render)
        return
    if coarse is not None and not scene.flows:
        yield "coarse.kind", f'"{coarse.kind}" carries threads or sheets, no {render}'
    if scene.dimension != (2 if render == "beads" else 3):
        yield "elements.size", f"is {_sized(scene.cells)}; " + (
            "beads lie in the plane" if render == "beads" else f"{render} is in space: it takes a third number")


def _for_points_alone(scene: ElementsScene, render: str) -> Faults:
    """Keys that threads and sheets do not heed, which are where their coarse motion is."""
    wanted, reason = scene.elements, f"is for points; {render} go where their [coarse] is"
    heeded = {"elements.domain": wanted.domain, "elements.toroidal": wanted.toroidal, "elements.pins": wanted.pins,
              "elements.selections": wanted.selections, "elements.control": wanted.control,
              "obstacles": scene.obstacles}
    yield from ((key, reason) for key, value in heeded.items() if value)
    if wanted.along != "exemplar":
        yield "elements.along", reason
    if isinstance(scene.coarse, TracksMotion) and wanted.count:
        yield "elements.count", "is that of coarse.file"
    if scene.synthesis.sequence == "frames":
        yield "synthesis.sequence", f'"frames" is for points; of {render} all frames are synthesized together'


def _element_places(scene: ElementsScene) -> Faults:
    """Domain, hard positions and sequence."""
    wanted, synthesis = scene.elements, scene.synthesis
    if isinstance(wanted.domain, ShapeObstacle):
        yield from _of_dimension(scene, wanted.domain, "elements.domain")
    for number, pin in enumerate(wanted.pins):
        if len(pin.at) != scene.dimension:
            yield (f"elements.pins[{number}].at",
                   f"has {len(pin.at)} coordinates; elements.size is {_sized(scene.cells)}")
        if pin.frame > scene.frames:
            yield f"elements.pins[{number}].frame", f"the animation has {scene.frames} frames"
    if synthesis.sequence == "frames" and synthesis.after:
        yield "synthesis.after", 'is 0 with sequence = "frames": later frames are not there yet (figure 3)'
    if synthesis.sequence == "frames" and scene.coarse is not None and not scene.flows:
        yield "synthesis.sequence", 'of threads and sheets is "together": their coarse motion is known for all frames'
    if wanted.along == "flow" and not scene.flows:
        yield "elements.along", '"flow" needs a [coarse] that is a field'

def _sized(size: Sequence[int]) -> str:
    """A size as the user reads it: 96×128×96."""
    return "×".join(map(str, size))
