"""Which code counts for a key: what a function names counts, comments do not, and all that runs is found."""

import importlib.util
import inspect
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from types import CodeType, FrameType, ModuleType
from typing import Any

import pytest
import tiny
from tiny import BEADS, FISH, NOODLES, PAPER, SMOKE, changed

from pipeline.build import graph, keys, source_digest
from pipeline.build.artifact import Artifact
from pipeline.build.view import value_at

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

RIVER = changed(changed(SMOKE, 'kind = "lit"\nwidth = 32', 'kind = "particles"\nwidth = 32\nspp = 1'), '"input", ', "")
RIVER += '[[obstacles]]\nkind = "ball"\ncentre = [0.0, 0.5]\nradius = 0.2\n[particles]\ncount = 20\n'
VOLUME = changed(changed(SMOKE, 'kind = "lit"\nwidth = 32', 'kind = "volume"\nwidth = 16\nheight = 16\nspp = 1'),
                 "m = 2\n", "m = 2\ndepth = { reach = 0.2 }\nsources = [{ centre = [0.0, 0.5], radius = 0.3 }]\n")
SPACE = SMOKE.replace("frames = 3", "frames = 2").replace("size = [8, 8]", "size = [8, 4, 8]").replace(
    "size = [16, 16]", 'size = [16, 8, 16]\nfacing = "density"').replace('"rotation"', '"constant"').replace(
    '["input", "coarse", "result"]', '["detail-arrows", "result"]').replace(
    'kind = "lit"\nwidth = 32',
    'kind = "seaweed"\nwidth = 32\nheight = 18\nspp = 1\n[blades]\nspacing = 0.4\nwindow = 2')
SPACE = SPACE.replace("m = 2\n", "m = 2\nsources = [{ centre = [0.0, 0.5, 0.0], radius = 0.3 }]\n")
POTENTIAL = changed(changed(SMOKE, "iterations = 1", 'iterations = 1\nsynthesize = "potential"'),
                    '"coarse", "result"', '"detail-divergence", "combined-colour"')
LAGRANGIAN = changed(SMOKE, "iterations = 1", 'iterations = 1\nsamples = "lagrangian"')


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
                if not module.startswith(source_digest.COMPUTES_NOTHING) and "<" not in name:
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
            RAN.setdefault((variant, name), set()).update(trace.places())
            if value is None:
                return
            yield value

    return wrapped


RAN: dict[tuple[str, str], set[str]] = {}


def is_property(place: str, scene: Any) -> bool:
    """Whether it is a property of the scene: its value is in the key, so its code need not be."""
    _, _, name = place.rpartition(".")
    return isinstance(inspect.getattr_static(type(scene), name, None), property)


SCENES = {"smoke": SMOKE, "river": RIVER, "volume": VOLUME, "space": SPACE, "potential": POTENTIAL,
          "lagrangian": LAGRANGIAN, "beads": BEADS, "fish": FISH, "noodles": NOODLES, "paper": PAPER}


@pytest.mark.parametrize("text", SCENES.values(), ids=SCENES)
def test_all_code_that_runs_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    RAN.clear()
    monkeypatch.setattr(graph.BuildGraph, "run", traced(graph.BuildGraph.run))
    made = tiny.made(tmp_path, text, "render")
    assert RAN
    for (variant, name), ran in RAN.items():
        scene, one = made.variants[variant], made.artifacts[variant][name]
        functions = [one.make, one.format.write,
                     *(made.artifacts[variant][other].format.read for other, _ in one.inputs)]
        tables = keys._tables([value_at(scene, read) for read in one.reads])
        known = set(source_digest.sources(functions, tables).values()) | checks(one)
        unknown = {place for place in ran - known if not is_property(place, scene)}
        assert not unknown, f"{name}: {sorted(unknown)}"


def checks(one: Artifact) -> set[str]:
    """The code of checks, which only refuse."""
    return set() if one.check_frame is None else set(source_digest.sources([one.check_frame]).values())
