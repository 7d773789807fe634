"""The errors: one line each, each with an exit code of its own."""

import inspect
from pathlib import Path

import pytest

from pipeline import errors
from pipeline.errors import (
    BadInput,
    EnvironmentMissing,
    FlowloomError,
    InvalidValue,
    StorageFailed,
    Terminated,
    attributed_to,
)


@pytest.mark.parametrize(("error", "code", "line"), [
    (BadInput(Path("a/b.toml"), "detail.size", "is missing"), 2, "a/b.toml: detail.size: is missing"),
    (BadInput("--workers", "", "must be at least 1"), 2, "--workers: must be at least 1"),
    (BadInput("", "", "no scene"), 2, "no scene"),
    (EnvironmentMissing("no LLVM; install it"), 3, "no LLVM; install it"),
    (StorageFailed(Path("out/a.exr"), "No space left"), 4, "out/a.exr: No space left"),
])
def test_an_error_is_its_line_and_its_code(error: FlowloomError, code: int, line: str) -> None:
    assert (str(error), error.exit_code) == (line, code)


def test_what_is_blamed_can_be_asked_for() -> None:
    bad, full = BadInput(Path("a.toml"), "fps", "is zero"), StorageFailed(Path("a.exr"), "full")
    assert (bad.file, bad.key, bad.reason) == (Path("a.toml"), "fps", "is zero")
    assert (full.file, full.reason) == (Path("a.exr"), "full")


def test_no_two_kinds_share_a_code_and_the_docstring_tells_each() -> None:
    kinds = [kind for _, kind in inspect.getmembers(errors, inspect.isclass)
             if issubclass(kind, FlowloomError) and kind is not FlowloomError]
    codes = sorted(kind.exit_code for kind in kinds)
    assert codes == [2, 3, 4]  # 0, 1, 130 and 143 mean something else
    assert all(f"{code} " in (errors.__doc__ or "") for code in codes)


def test_termination_passes_whoever_catches_every_exception() -> None:
    closed = []
    with pytest.raises(Terminated):
        try:
            raise Terminated
        except Exception:
            closed.append("swallowed")
        finally:
            closed.append("closed")
    assert closed == ["closed"]


def test_the_innermost_key_is_to_blame_and_what_names_a_file_stays_as_it_is() -> None:
    with pytest.raises(InvalidValue, match="too large") as caught, attributed_to("outer"), attributed_to("outer.inner"):
        raise ValueError("too large")
    assert caught.value.key == "outer.inner"
    bad = BadInput("a.csv", "file", "is empty")
    with pytest.raises(BadInput) as passed, attributed_to("outer"):
        raise bad
    assert passed.value is bad
    with pytest.raises(TypeError), attributed_to("outer"):
        raise TypeError("a fault of ours")
