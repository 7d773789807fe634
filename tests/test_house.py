"""The house's own rules: who may import what, what things are called, and what stands beside what."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
MODULES = sorted(p for top in ("pipeline", "synth", "render", "bench") for p in (ROOT / top).rglob("*.py"))

HOMES = {
    "mitsuba": {"render/backend.py"},
    "drjit": {"render/backend.py"},
    "pyopencl": {"synth/opencl.py"},
    "pipeline.files._openvdb": {"pipeline/files/volumes.py"},
    "OpenEXR": {"pipeline/files/images.py"},
    "OpenImageIO": {"pipeline/files/pictures.py", "render/layout.py"},  # files and FLIP; letters in a picture
    "av": {"pipeline/files/video.py"},
    "trimesh": {"pipeline/files/meshes.py"},
    "pymeshlab": {"pipeline/files/mesh_repair.py"},
    "cv2": {"synth/motion/exemplar.py", "synth/elements/exemplar.py"},
    "svgpathtools": {"synth/motion/exemplar.py"},
    "mujoco": {"synth/elements/simulation.py"},
    "pxr": {"pipeline/files/usd.py"},
    "rlic": {"render/lic.py"},
    "threadpoolctl": {"synth/motion/neighborhood.py", "synth/elements/assignment.py"},
    "cyclopts": {"pipeline/cli.py"},
    "pydantic": {"pipeline/schema.py", "pipeline/elements_schema.py", "pipeline/scene.py"},  # tables; filling them
    "rich": {"pipeline/progress.py"},
    "faiss": {"bench/"},  # a peer that the bench runs beside us
}
"""Each heavy library and the only files that may import it (a folder ends with a slash)."""

MAY_IMPORT = {
    "synth": {"synth"},
    "render": {"render", "synth"},
    "pipeline": {"pipeline", "render", "synth"},
    "bench": {"bench", "pipeline", "render", "synth"},
}
NOT_IN_METHODS = {"subprocess", "multiprocessing", "socket", "shutil", "tempfile", "logging", "tomllib"}
VAGUE = {"utils", "util", "common", "helpers", "helper", "core", "base", "misc", "tools"}


def place(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def imports(source: str) -> Iterator[tuple[int, str]]:
    """Each module that a source imports, with its line; `from a import b` is both `a` and `a.b`."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield node.lineno, alias.name
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute: a reader sees where a name comes from"
            yield node.lineno, node.module or ""
            for alias in node.names:
                yield node.lineno, f"{node.module}.{alias.name}"


def is_part(name: str, of: str) -> bool:
    return name == of or name.startswith(of + ".")


def is_home(where: str, homes: set[str]) -> bool:
    return where in homes or any(home.endswith("/") and where.startswith(home) for home in homes)


def offences(where: str, source: str) -> Iterator[str]:
    """One line for each import that the house does not allow in file `where`."""
    top = where.split("/")[0]
    for line, name in imports(source):
        for library, homes in HOMES.items():
            if is_part(name, library) and not is_home(where, homes):
                yield f"{where}:{line}: imports {name}, whose home is {' and '.join(sorted(homes))}"
        first = name.split(".")[0]
        if first in MAY_IMPORT and first not in MAY_IMPORT[top]:
            yield f"{where}:{line}: {top} imports {name}; imports point one way: pipeline → render → synth"
        if top == "synth" and first in NOT_IN_METHODS:
            yield f"{where}:{line}: imports {name}; the methods know arrays, no files and no processes"


def test_imports_keep_to_the_table() -> None:
    found = {line for path in MODULES for line in offences(place(path), path.read_text())}
    assert not found, "\n".join(sorted(found))


@pytest.mark.parametrize(("where", "source", "named"), [
    ("synth/advect.py", "import numpy\nimport mitsuba as mi", "synth/advect.py:2: imports mitsuba"),
    ("render/studio.py", "def f():\n    from drjit import llvm", "render/studio.py:2: imports drjit"),
    ("pipeline/stages.py", "import pyopencl.array", "pipeline/stages.py:1: imports pyopencl.array"),
    ("pipeline/stages.py", "from pipeline.files import _openvdb", "stages.py:1: imports pipeline.files._openvdb"),
    ("synth/motion/detail.py", "from render import lic", "synth imports render"),
    ("render/lic.py", "import pipeline.errors", "render imports pipeline.errors"),
    ("synth/noise.py", "import subprocess", "no files and no processes"),
    ("pipeline/x.py", "import faiss", "whose home is bench/"),
])
def test_an_offence_is_named_with_its_line(where: str, source: str, named: str) -> None:
    assert any(named in line for line in offences(where, source))


def test_what_looks_like_an_offence_and_is_none() -> None:
    assert not list(offences("pipeline/x.py", "import average\nfrom render import backend\nimport avail.x"))
    assert not list(offences("bench/search.py", "import faiss\nfrom synth.motion import search"))


def test_names_say_something() -> None:
    names = [p for top in ("pipeline", "synth", "render", "bench", "tests") for p in (ROOT / top).rglob("*")]
    vague = [place(p) for p in names if p.stem.removeprefix("test_") in VAGUE]
    assert not vague, f"these names say nothing: {', '.join(vague)}"


def has_test(path: Path) -> bool:
    names = (f"test_{path.stem}.py", f"test_{path.parent.name}_{path.stem}.py")
    return any((ROOT / "tests" / name).exists() for name in names)


def test_every_kernel_has_its_module_and_its_test() -> None:
    kernels = sorted(p for top in ("synth", "render") for p in (ROOT / top).rglob("*.cl"))
    assert kernels
    alone = [place(p) for p in kernels if not p.with_suffix(".py").exists() or not has_test(p)]
    assert not alone, f"without a .py beside it or a test of the same stem: {', '.join(alone)}"


def test_every_module_has_its_test() -> None:
    modules = [p for p in MODULES if p.stem[0] != "_" and not place(p).startswith("bench/")]
    untested = [place(p) for p in modules if not has_test(p)]
    assert not untested, f"without tests/test_<module>.py: {', '.join(untested)}"


def test_every_package_lists_its_modules() -> None:
    """The package's docstring is the first page a newcomer reads."""
    for folder in ("synth", "synth/motion", "synth/elements", "render", "pipeline", "pipeline/files"):
        told = ast.get_docstring(ast.parse((ROOT / folder / "__init__.py").read_text())) or ""
        words = set(told.replace(",", " ").replace(".", " ").split())
        untold = [p.stem for p in (ROOT / folder).glob("*.py") if p.stem[0] != "_" and p.stem not in words]
        assert not untold, f"{folder}/__init__.py does not name {', '.join(sorted(untold))}"


def test_no_folder_holds_one_file() -> None:
    for folder in {path.parent for path in MODULES}:
        inside = [p.name for p in folder.iterdir() if p.name not in ("__pycache__", "__init__.py")]
        assert len(inside) > 1 or place(folder) == "bench", f"{place(folder)} holds only {inside}"


def test_the_command_starts_without_anything_heavy() -> None:
    heavy = [name for name in HOMES if name not in ("cyclopts",)] + ["numpy", "scipy"]
    code = f"import sys, pipeline.cli; print([name for name in {heavy!r} if name in sys.modules])"
    child = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert child.stdout.strip() == "[]", f"pipeline.cli loads {child.stdout.strip()}"
