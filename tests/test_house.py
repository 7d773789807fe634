"""The house's own rules: who may import what, what things are called, and what stands beside what."""

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
MODULES = sorted(p for top in ("pipeline", "synth", "render", "bench") for p in (ROOT / top).rglob("*.py"))

METHODS = {f"pipeline/{file.parent.name}" for file in (ROOT / "pipeline").glob("*/method.py")} - {"pipeline/build"}

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
    "cv2": {"synth/motion/strokes.py", "synth/photo/"},  # sketches; optical flow
    "svgpathtools": {"synth/motion/strokes.py"},
    "mujoco": {"synth/elements/simulation.py"},
    "pxr": {"pipeline/files/usd.py"},
    "h5netcdf": {"pipeline/files/netcdf.py"},
    "rlic": {"render/lic.py"},
    "threadpoolctl": {"synth/motion/neighborhood.py", "synth/elements/assignment.py", "synth/photo/assign.py"},
    "cyclopts": {"pipeline/cli.py"},
    "pydantic": {"pipeline/tables.py", "pipeline/flow.py", *(f"{method}/" for method in METHODS),  # tables,
                 "pipeline/scene.py", "pipeline/schema.py"},  # filling them, writing them down
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
IN_BUILD = {"pipeline.build", "pipeline.files", "pipeline.errors", "pipeline.progress", "synth"}
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
        for method in METHODS:
            other = method.replace("/", ".")
            inside = any(where.startswith(f"{one}/") for one in METHODS - {method})
            if inside and is_part(name, other):
                yield f"{where}:{line}: imports {name}; methods import nothing of each other"
        if where.startswith("pipeline/build/") and first in MAY_IMPORT and name != "pipeline" and not any(
                is_part(name, one) for one in IN_BUILD):
            yield f"{where}:{line}: imports {name}; the build knows no method"


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
    ("pipeline/elements/looks.py", "from pipeline.motion import bake", "methods import nothing of each other"),
    ("pipeline/build/graph.py", "from pipeline.motion.method import METHOD", "the build knows no method"),
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


def mirror(path: Path) -> Path:
    """Where the tests of a module stand: tests/ mirrors the folders."""
    return ROOT / "tests" / path.relative_to(ROOT).parent / f"test_{path.stem}.py"


def test_a_test_stands_where_its_module_does() -> None:
    """Two methods have modules of one name: the tests of one are none of the other's."""
    assert mirror(ROOT / "synth/motion/search.py") == ROOT / "tests/synth/motion/test_search.py"
    assert mirror(ROOT / "synth/elements/search.py") == ROOT / "tests/synth/elements/test_search.py"


def test_every_kernel_has_its_module_and_its_test() -> None:
    kernels = sorted(p for top in ("synth", "render") for p in (ROOT / top).rglob("*.cl"))
    assert kernels
    alone = [place(p) for p in kernels if not p.with_suffix(".py").exists() or not mirror(p).exists()]
    assert not alone, f"without a .py beside it or a test of the same stem: {', '.join(alone)}"


def test_every_module_has_its_test() -> None:
    modules = [p for p in MODULES if p.stem[0] != "_" and not place(p).startswith("bench/")]
    untested = [place(p) for p in modules if not mirror(p).exists()]
    assert not untested, f"without tests/<folder>/test_<module>.py: {', '.join(untested)}"


def test_each_home_of_a_library_exists_and_imports_it() -> None:
    """A table that names a file which is gone allows nothing and hides what it should name."""
    for library, homes in HOMES.items():
        for home in homes:
            files = sorted((ROOT / home).rglob("*.py")) if home.endswith("/") else [ROOT / home]
            assert all(file.exists() for file in files), f"{home}, the home of {library}, does not exist"
            used = any(is_part(name, library) for file in files for _, name in imports(file.read_text()))
            assert used, f"{home}, the home of {library}, does not import it"


def test_every_package_lists_its_modules() -> None:
    """The package's docstring is the first page a newcomer reads."""
    for folder in sorted({path.parent for path in MODULES}):
        page = ast.parse((folder / "__init__.py").read_text())
        assert len(page.body) == 1, f"{place(folder)}/__init__.py holds more than its page"
        words = set(re.split(r"[\s,./]+", ast.get_docstring(page) or ""))
        untold = [p.stem for p in folder.glob("*.py") if p.stem[0] != "_" and p.stem not in words]
        assert not untold, f"{place(folder)}/__init__.py does not name {', '.join(sorted(untold))}"


def test_no_modules_import_each_other_in_a_circle() -> None:
    """Imports inside functions and for types count too: a circle is one to the reader."""
    known = {place(p).removesuffix(".py").replace("/", "."): p for p in MODULES if p.stem != "__init__"}
    above = {name: {other for _, other in imports(p.read_text()) if other in known and other != name}
             for name, p in known.items()}
    done: set[str] = set()

    def visit(name: str, path: tuple[str, ...]) -> None:
        assert name not in path, " → ".join([*path[path.index(name):], name])
        if name not in done:
            for other in sorted(above[name]):
                visit(other, (*path, name))
            done.add(name)

    for name in known:
        visit(name, ())


def test_the_class_of_a_scene_is_asked_nowhere() -> None:
    """What a kind means stands with the kind; a second place that asks is the one that is forgotten."""
    for path in (ROOT / "pipeline").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "isinstance":
                asked = ast.unparse(node.args[1]).replace("SceneView", "")
                assert not any(name in asked for name in ("Scene", "Render", "Exemplar", "Motion", "Obstacle")), (
                    f"{place(path)}:{node.lineno}: {ast.unparse(node)}")


def test_no_folder_holds_one_file() -> None:
    for folder in {path.parent for path in MODULES}:
        inside = [p.name for p in folder.iterdir() if p.name not in ("__pycache__", "__init__.py")]
        assert len(inside) > 1, f"{place(folder)} holds only {inside}"


def test_the_command_starts_without_anything_heavy() -> None:
    heavy = [name for name in HOMES if name not in ("cyclopts",)] + ["numpy", "scipy"]
    code = f"import sys, pipeline.cli; print([name for name in {heavy!r} if name in sys.modules])"
    child = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert child.stdout.strip() == "[]", f"pipeline.cli loads {child.stdout.strip()}"
