"""Which sources a product's key counts, and what of them."""

from pathlib import Path

import pytest

from pipeline import sources


def names(method: str) -> set[str]:
    """The files that `method` depends on, under the project's root."""
    return {file.relative_to(sources.ROOT).as_posix() for file in sources.sources(method)}


def test_a_method_brings_its_kernels_and_all_it_imports() -> None:
    found = names("synth.motion.density")
    assert {"synth/motion/density.py", "synth/motion/density.cl", "synth/advect.py", "synth/advect.cl",
            "synth/opencl.py"} <= found
    assert {"synth/motion/assignment.cl", "synth/motion/sample.h"} <= names("synth.motion.assignment")
    assert not any(name.startswith(("pipeline/", "render/")) for name in found)
    assert "synth/motion/detail.py" not in found


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project of two methods, one of which imports the other inside a function, and a maker."""
    for package in ("synth", "pipeline"):
        (tmp_path / package).mkdir()
    (tmp_path / "synth" / "a.py").write_text("def f():\n    from synth import b\n    return b\n")
    (tmp_path / "synth" / "b.py").write_text("x = 1  # one\n")
    (tmp_path / "synth" / "b.cl").write_text('#include "c.h"\nkernel void k() {}\n')
    (tmp_path / "synth" / "c.h").write_text("// shared\n")
    (tmp_path / "synth" / "other.py").write_text("y = 1\n")
    (tmp_path / "pipeline" / "maker.py").write_text("from synth import other\n")
    monkeypatch.setattr(sources, "ROOT", tmp_path)
    return tmp_path


def key() -> str:
    """The digest, nothing remembered."""
    for function in (sources.digest, sources.sources, sources._said, sources._tree, sources._imported):
        function.cache_clear()
    return sources.digest("pipeline.maker", ("synth.a",))


@pytest.mark.parametrize(("file", "text", "is_other"), [
    ("synth/b.py", "x=1\n\n# another comment\n", False),
    ("synth/b.py", "x = 2\n", True),
    ("synth/b.cl", '#include "c.h"\nkernel void k() { }\n', True),
    ("synth/c.h", "// shared by kernels\n", True),
    ("synth/a.py", "def f():\n    from synth import b\n    return b.x\n", True),
    ("pipeline/maker.py", "from synth import other as another\n", True),
    ("synth/other.py", "y = 2\n", False),  # the maker imports it, no method of this product does
])
def test_only_what_computes_counts(project: Path, file: str, text: str, is_other: bool) -> None:
    before = key()
    (project / file).write_text(text)
    assert (key() != before) == is_other
    for function in (sources.digest, sources.sources, sources._said, sources._tree, sources._imported):
        function.cache_clear()
