"""The methods there are: told apart by their tables, and each of them whole."""

from pathlib import Path

import pytest
from tiny import BEADS, FISH, NOODLES, PAPER, SMOKE, changed, complaint, written

from pipeline.listing import project_scenes
from pipeline.methods import METHODS
from pipeline.scene import load


def test_names_tables_and_scenes_of_methods_differ() -> None:
    for told in ("name", "table", "scene"):
        values = [getattr(method, told) for method in METHODS]
        assert len(set(values)) == len(values)


def test_each_methods_table_is_one_that_its_scenes_alone_have() -> None:
    for method in METHODS:
        assert method.table in method.scene.model_fields
        assert not [other for other in METHODS if other is not method and method.table in other.scene.model_fields]


@pytest.mark.parametrize(("text", "name"), [
    (SMOKE, "ma09"), (BEADS, "ma13"), (FISH, "ma13"), (NOODLES, "ma13"), (PAPER, "ma13")])
def test_a_file_is_of_the_method_whose_table_it_has(tmp_path: Path, text: str, name: str) -> None:
    loaded = load(written(tmp_path, text))
    assert loaded.method.name == name
    assert all(isinstance(scene, loaded.method.scene) for scene in loaded.variants.values())


def test_without_any_methods_table_it_is_the_first(tmp_path: Path) -> None:
    bare = changed(SMOKE, "[detail]\nsize = [16, 16]\niterations = 1\nneighborhoods = [5]\n", "")
    assert not [method for method in METHODS if f"[{method.table}]" in bare]
    loaded = load(written(tmp_path, bare))
    assert loaded.method is METHODS[0] and loaded.method.name == "ma09"
    assert loaded.variants[""].detail.size == (256, 256)


def test_a_file_with_the_tables_of_two_methods_is_told_which_is_unknown(tmp_path: Path) -> None:
    both = changed(BEADS, "[render]", "[detail]\nsize = [32, 32]\n[render]")
    assert complaint(written(tmp_path, both)).startswith("detail: unknown key")


@pytest.mark.parametrize("file", project_scenes(), ids=lambda file: file.stem)
def test_a_projects_scene_is_of_the_method_that_its_name_says(file: Path) -> None:
    assert load(file).method.name == file.stem.partition("-")[0]
