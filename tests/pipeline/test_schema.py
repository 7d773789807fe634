"""What is written of scenes: scenes/README.md documents every key, and the JSON Schema checks what an editor shows."""

import json
import re
import tomllib
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator
from pydantic import BaseModel
from tiny import BEADS, FISH, NOODLES, PAPER, SMOKE, changed

from pipeline import cli, schema
from pipeline.build.method import Method
from pipeline.listing import project_scenes
from pipeline.methods import METHODS
from pipeline.tables import Asset, AssetOrFolder, Folder

TABLES = [(path, model) for method in METHODS for path, model in schema.tables(method.scene)]


def shared() -> dict[type[BaseModel], str]:
    """The tables that several methods have, and their paths in the first of these."""
    found: dict[type[BaseModel], str] = {}
    known: dict[type[BaseModel], str] = {}
    for method in METHODS:
        mine = {model: path for path, model in schema.tables(method.scene)}
        found |= {model: known[model] for model in mine if model in known}
        known = mine | known
    return found


# -- scenes/README.md


@pytest.mark.parametrize("place", [f"tables of {method.name}" for method in METHODS])
def test_the_readme_documents_every_table_and_key_as_the_schema_has_them(place: str) -> None:
    written = schema.around(place, schema.README.read_text())[1]
    assert written == schema.documentation()[place].strip(), "type: flowloom schema --write"


def test_each_method_has_its_place_and_no_place_is_left_over() -> None:
    places = re.findall(rf"<!-- (.*): {schema.BY} -->", schema.README.read_text())
    assert places == list(schema.documentation()) == [f"tables of {method.name}" for method in METHODS]


def test_what_several_methods_have_is_documented_once() -> None:
    names = {model.__name__ for model in shared()}
    assert {"NoiseMotion", "FileMotion", "ShapeObstacle", "MeshObstacle"} <= names
    written = schema.README.read_text().splitlines()
    for model, path in shared().items():
        assert written.count(f"### {schema.heading(path, model)}") == 1
        told = [text.splitlines()[-1] for text in list(schema.documentation().values())[1:]]
        assert any(f"`{schema.heading(path, model)}`" in line for line in told)


@pytest.mark.parametrize(("path", "model"), TABLES)
def test_every_number_has_a_range_and_every_key_a_description(path: str, model: type[BaseModel]) -> None:
    for name, field in model.model_fields.items():
        assert field.description or list(schema.branches(field.annotation)), f"{path}.{name} is not described"
        said = schema.spelled(field.annotation, field.metadata)
        bare = re.search(r"\b(integer|number)(?! [\[(])", said)
        assert not bare or name == "centre", f"{path}.{name} has no range: {said}"


def test_a_path_is_a_file_or_a_folder_as_its_check_is() -> None:
    assert [schema.spelled(kind) for kind in (Asset, Folder, AssetOrFolder, Folder | None)] == [
        "file", "folder", "file or folder", "folder"]


def test_every_table_refuses_what_it_does_not_know() -> None:
    for _, model in TABLES:
        config = model.model_config
        assert (config["extra"], config["strict"], config["frozen"], config["allow_inf_nan"]) == (
            "forbid", True, True, False)


# -- the JSON Schema


def test_the_json_schema_is_written_as_the_models_have_it() -> None:
    assert schema.SCHEMA.read_text() == schema.json_schema() + "\n", "type: flowloom schema --write"


def test_it_is_a_json_schema_of_the_draft_that_it_names() -> None:
    document = json.loads(schema.json_schema())
    assert document["$schema"] == Draft202012Validator.META_SCHEMA["$id"]
    Draft202012Validator.check_schema(document)


def test_the_command_prints_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["schema"]) == 0
    assert json.loads(capsys.readouterr().out) == json.loads(schema.SCHEMA.read_text())


def test_write_mends_both_files_and_leaves_the_rest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = schema.README.read_text()
    row = next(line for line in whole.splitlines() if line.startswith("| `seed` |"))
    (tmp_path / "README.md").write_text(changed(whole, row, "| `seed` | out of date |"))
    monkeypatch.setattr(schema, "README", tmp_path / "README.md")
    monkeypatch.setattr(schema, "SCHEMA", tmp_path / "scene.schema.json")
    assert cli.run(["schema", "--write"]) == 0
    assert (tmp_path / "README.md").read_text() == whole
    assert json.loads((tmp_path / "scene.schema.json").read_text()) == json.loads(schema.json_schema())


def faults(text: str) -> list[str]:
    """What an editor would mark in a scene."""
    raw = tomllib.loads(text)
    found = Draft202012Validator(json.loads(schema.SCHEMA.read_text())).iter_errors(raw)
    return [error.message for error in found]


@pytest.mark.parametrize("file", project_scenes(), ids=lambda file: file.stem)
def test_the_projects_scenes_are_valid(file: Path) -> None:
    assert faults(file.read_text()) == []


@pytest.mark.parametrize("text", [SMOKE, BEADS, FISH, NOODLES, PAPER])
def test_a_scene_is_valid_and_what_load_refuses_of_a_key_is_not(text: str) -> None:
    assert faults(text) == []
    assert faults(changed(text, "[render]", '[quick]\n"frames" = 1\n[variants.a]\n"seed" = 2\n[render]')) == []
    kind = re.search(r'\[render\]\nkind = "(.*)"', text)
    assert kind
    for old, new in (
            ("frames = 3", "frame = 3"),  # a misspelt key, at the top
            ("width = 32", "widht = 32"),  # in a table
            (f'[render]\nkind = "{kind[1]}"', '[render]\nkind = "seewead"'),  # a wrong kind
            (f'[render]\nkind = "{kind[1]}"', "[render]"),  # none
            ("width = 32", 'width = "wide"'),  # a wrong type
            ("width = 32", "width = 5000"),  # out of range
            ("frames = 3", "frames = 0"),
            ("iterations = ", "iterations = 900"),
            ("[render]", "[rendr]")):
        assert faults(changed(text, old, new)), new


@pytest.mark.parametrize(("radius", "valid"), [
    ("0.1", True), ("[0.1]", True), ("0.0", False), ("11.0", False), ("[-1.0]", False), ("[]", False),
    ('"wide"', False)])
def test_one_number_may_stand_for_an_array_within_the_same_range(radius: str, valid: bool) -> None:
    ball = f'[[obstacles]]\nkind = "ball"\ncentre = [0.0, 0.5]\nradius = {radius}\n[render]'
    for text in (SMOKE, BEADS):
        assert (faults(changed(text, "[render]", ball)) == []) == valid
    source = f"[[density.sources]]\nradius = {radius}\n[render]"
    assert (faults(changed(SMOKE, "[render]", source)) == []) == valid


@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.name)
def test_a_scene_is_checked_as_one_of_its_method(method: Method) -> None:
    """A table of another method is unknown, and so is a kind that only the other draws."""
    text, other = (SMOKE, "beads") if method is METHODS[0] else (BEADS, "lit")
    assert faults(changed(text, "[render]", "[combined]\n[render]"))
    kind = re.search(r'\[render\]\nkind = "(.*)"', text)
    assert kind and faults(changed(text, kind[0], f'[render]\nkind = "{other}"'))
