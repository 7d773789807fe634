"""Which code counts for a key: what a function names counts, comments do not, and all that runs is found."""

import importlib.util
import inspect
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from types import CodeType, FrameType, ModuleType
from typing import Any

import pytest
import tiny
from tiny import SCENES, changed

from pipeline.build import graph, keys, source_digest
from pipeline.build.artifact import Artifact
from pipeline.files.format import Format

SOURCE = '''
"""A module of pipeline."""
import functools
import re

import numpy as np

from pipeline import {other} as other
from synth import advect

TABLE = {{"a": 1}}
UNUSED = 5
BY_NAME = {{"twice": lambda x: 2 * x}}


def helper(x: int) -> int:
    """A docstring."""
    return x + TABLE["a"]  # a comment


def make(scene, inputs, frames):
    yield 0, helper(1)


def chosen(scene, inputs, frames):
    yield 0, BY_NAME["twice"](1), PATTERN, VALUES, cached(1)


PATTERN = re.compile("a")
VALUES = np.arange(3)


@functools.cache
def cached(x):
    return x + 1


def later(scene, inputs, frames):
    from synth import noise
    yield 0, noise


class Base:
    """A base."""

    def drawn(self):
        return self.colour()

    def colour(self):
        return 1


class Look(Base):
    """A look."""

    def colour(self):
        return 2

    def unused(self):
        return 3

    def lifted(self):
        return super().colour() + self.UNIT

    UNIT = 7


class Other(Base):
    """Another."""

    def colour(self):
        return 4
'''


def module(folder: Path, text: str, name: str = "pipeline.sample_of_a_test") -> ModuleType:
    """A module of `text` that calls itself one of pipeline."""
    file = folder / f"sample{len(list(folder.glob('*.py')))}.py"
    file.write_text(text.format(other="errors"))
    spec = importlib.util.spec_from_file_location(name, file)
    assert spec and spec.loader
    made = importlib.util.module_from_spec(spec)
    sys.modules[name] = made
    spec.loader.exec_module(made)
    return made


@pytest.fixture(autouse=True)
def forgotten() -> Iterator[None]:
    yield
    sys.modules.pop("pipeline.sample_of_a_test", None)


@pytest.mark.parametrize(("old", "new", "counts"), [
    ("# a comment", "# another", False),
    ('"""A docstring."""', '"""Another."""', False),
    ("x: int", "x: float", False),
    ("UNUSED = 5", "UNUSED = 6", False),
    ("x + TABLE", "x - TABLE", True),
    ('{{"a": 1}}', '{{"a": 2}}', True),
    ("helper(1)", "helper(2)", True),
    ("from synth import noise\n    yield 0, noise", "yield 1, None", False),
])
def test_only_what_computes_counts(tmp_path: Path, old: str, new: str, counts: bool) -> None:
    before = source_digest.digest([module(tmp_path, SOURCE).make])
    assert (source_digest.digest([module(tmp_path, changed(SOURCE, old, new)).make]) != before) == counts


@pytest.mark.parametrize(("old", "new", "counts"), [
    ("return 2", "return 5", True),
    ("return self.colour()", "return -self.colour()", True),
    ("return 4", "return 5", False),
    ("return 3", "return 5", False),
    ("return 1", "return 5", False),  # Look has a colour of its own
    ("UNIT = 7", "UNIT = 8", False),
])
def test_a_method_counts_with_the_methods_that_it_calls_on_its_own_class(tmp_path: Path, old: str, new: str,
                                                                         counts: bool) -> None:
    before = source_digest.digest([module(tmp_path, SOURCE).Look().drawn])
    assert (source_digest.digest([module(tmp_path, changed(SOURCE, old, new)).Look().drawn]) != before) == counts


@pytest.mark.parametrize(("old", "new"), [
    ("2 * x", "3 * x"), ('"twice": ', '"thrice": '), ('compile("a")', 'compile("b")'), ("arange(3)", "arange(4)"),
    ("return x + 1", "return x + 2")])
def test_tables_of_functions_patterns_arrays_and_cached_functions_count(tmp_path: Path, old: str, new: str) -> None:
    before = source_digest.digest([module(tmp_path, SOURCE).chosen])
    assert source_digest.digest([module(tmp_path, SOURCE).chosen]) == before, "the same in each process"
    assert source_digest.digest([module(tmp_path, changed(SOURCE, old, new)).chosen]) != before


@pytest.mark.parametrize(("old", "new"), [("return 1", "return 5"), ("UNIT = 7", "UNIT = 8")])
def test_what_a_method_takes_of_its_bases_and_its_class_counts(tmp_path: Path, old: str, new: str) -> None:
    before = source_digest.digest([module(tmp_path, SOURCE).Look().lifted])
    assert source_digest.digest([module(tmp_path, changed(SOURCE, old, new)).Look().lifted]) != before


@pytest.mark.parametrize(("old", "new"), [("size=4", "size=5"), ("self.a = 1", "self.a = 2"), ('"a" +', '"b" +'),
                                          ('{{"x", "y"}}', '{{"x", "z"}}'), ("EDGE = 6", "EDGE = 7")])
def test_classes_sets_and_texts_that_a_function_uses_count(tmp_path: Path, old: str, new: str) -> None:
    text = """
CHOSEN = {{"x", "y"}}
class Box:
    EDGE = 6
    def __init__(self):
        self.a = 1
def helper(size=4):
    return size
def make(scene, inputs, frames):
    yield 0, (Box(), helper(), ["a" + n for n in inputs], CHOSEN)
"""
    before = source_digest.digest([module(tmp_path, text).make])
    assert source_digest.digest([module(tmp_path, changed(text, old, new)).make]) != before


def test_a_constant_without_a_text_of_its_own_is_refused(tmp_path: Path) -> None:
    """Its key would be another in every process, and all would be made again in every run."""
    text = "class Thing:\n    pass\nTHING = Thing()\ndef make(scene, inputs, frames):\n    yield 0, THING\n"
    with pytest.raises(TypeError, match="a constant that keys cannot know"):
        source_digest.digest([module(tmp_path, text).make])


def test_digests_are_the_same_in_every_process() -> None:
    code = ("from pathlib import Path; from pipeline.scene import load; from pipeline.stages import graph_of; "
            "from pipeline.tables import PROJECT_SCENES; from pipeline.build import keys; "
            "g = graph_of(load(PROJECT_SCENES / 'ma13-fig08.toml', True), Path('none')); "
            "print([keys.constant(a, g.variants[v], made) for v, made in g.artifacts.items() for a in made.values()])")
    found = {subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True,
                            env=os.environ | {"PYTHONHASHSEED": seed}).stdout for seed in ("1", "2")}
    assert len(found) == 1 and len(found.pop()) > 1000


def test_the_reader_that_runs_in_a_child_and_the_compiled_writer_count() -> None:
    from pipeline.files import meshes, volumes

    assert "pipeline.files.mesh_repair.closed" in set(source_digest.sources([meshes.read_solid]).values())
    assert "pipeline/files/openvdb.cpp" in set(source_digest.sources([volumes.write_field]).values())


def test_an_import_inside_a_function_is_followed(tmp_path: Path) -> None:
    found = set(source_digest.sources([module(tmp_path, SOURCE).later]).values())
    assert {"synth/noise.py", "pipeline.sample_of_a_test.later"} <= found


def test_a_module_of_synth_brings_its_kernels_and_all_it_imports() -> None:
    found = set(source_digest._files(source_digest._file("synth.motion.density")).values())
    assert {"synth/motion/density.py", "synth/motion/density.cl", "synth/advect.py", "synth/advect.cl",
            "synth/opencl.py"} <= found
    assert "synth/motion/sample.h" in set(source_digest._files(source_digest._file("synth.motion.assignment")).values())
    assert "synth/motion/detail.py" not in found
    assert not any(place.startswith(("pipeline", "render")) for place in found)


# -- what really runs -----------------------------------------------------------------------------------------------


class Trace:
    """The functions of pipeline, and the files of synth and render, in which code runs."""

    def __init__(self) -> None:
        self.codes: set[CodeType] = set()

    def __call__(self, frame: FrameType, event: str, _: Any) -> None:
        if event == "call":
            self.codes.add(frame.f_code)

    def places(self) -> set[str]:
        """By their place, as source_digest has it."""
        found = set()
        for code in self.codes:
            file = Path(code.co_filename)
            if not file.is_relative_to(source_digest.ROOT) or ".venv" in file.parts or file.stem == "__init__":
                continue  # of packages: docstrings, as test_house holds
            place = file.relative_to(source_digest.ROOT)
            if place.parts[0] in source_digest.WHOLE:
                found.add(place.as_posix())
            elif place.parts[0] == "pipeline":
                module = ".".join(place.with_suffix("").parts)
                name = code.co_qualname.split(".<locals>")[0]
                if not f"{module}.".startswith(source_digest.COMPUTES_NOTHING) and "<" not in name:
                    found.add(f"{module}.{name}")
        return found


def traced(run: Callable[..., Iterator[Any]]) -> Callable[..., Iterator[Any]]:
    def wrapped(self: graph.BuildGraph, variant: str, name: str, frames: Any) -> Iterator[Any]:
        made = run(self, variant, name, frames)
        while True:
            trace = Trace()
            sys.setprofile(trace)
            threading.setprofile(trace)
            try:
                value = next(made, None)
            finally:
                sys.setprofile(None)
                threading.setprofile(None)
            RAN[variant, name] = RAN.pop((variant, name), set()) | trace.places()  # the last is in work
            if value is None:
                return
            yield value

    return wrapped


RAN: dict[tuple[str, str], set[str]] = {}


def traced_save(save: Callable[..., None]) -> Callable[..., None]:
    def wrapped(self: Format, file: Path, value: Any) -> None:
        trace = Trace()
        sys.setprofile(trace)
        try:
            save(self, file, value)
        finally:
            sys.setprofile(None)
        RAN[list(RAN)[-1]].update(trace.places())  # that of the artifact in work

    return wrapped


def is_property(place: str, scene: Any) -> bool:
    """Whether it is a property of the scene: its value is in the key, so its code need not be."""
    _, _, name = place.rpartition(".")
    return isinstance(inspect.getattr_static(type(scene), name, None), property)


@pytest.mark.parametrize("text", SCENES.values(), ids=SCENES)
def test_all_code_that_runs_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    RAN.clear()
    monkeypatch.setattr(graph.BuildGraph, "run", traced(graph.BuildGraph.run))
    monkeypatch.setattr(Format, "save", traced_save(Format.save))
    made = tiny.made(tmp_path, text, "render")
    assert RAN
    for (variant, name), ran in RAN.items():
        scene, one = made.variants[variant], made.artifacts[variant][name]
        functions = [one.make, one.format.write,
                     *(made.artifacts[variant][other].format.read for other, _ in one.inputs)]
        known = set(source_digest.sources(functions, keys.tables(one, scene)).values()) | checks(one)
        unknown = {place for place in ran - known if not is_property(place, scene)}
        assert not unknown, f"{name}: {sorted(unknown)}"


def checks(one: Artifact) -> set[str]:
    """The code of checks, which only refuse."""
    return set() if one.check_frame is None else set(source_digest.sources([one.check_frame]).values())
