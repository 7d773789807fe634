"""Mitsuba renders with an LLVM that was proven, and never loads a library of the working directory."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from render import backend
from render.backend import RenderUnavailable

HOSTILE = """
#include <stdio.h>
#include <stdlib.h>
__attribute__((constructor)) static void arrive(void) {
    FILE *file = fopen(getenv("MARKER"), "w");
    if (file) fclose(file);
}
"""
RENDER = """
import sys
sys.path.append({folder!r})
{load}
mi.set_variant(sys.argv[1])
scene = mi.load_dict({{"type": "scene", "integrator": {{"type": "path"}}, "light": {{"type": "constant"}},
    "shape": {{"type": "sphere", "bsdf": {{"type": "diffuse"}}}},
    "sensor": {{"type": "perspective", "film": {{"type": "hdrfilm", "width": 4, "height": 4}}}}}})
mi.render(scene, spp=1)
"""
OURS = "from render import backend\nmi = backend.mitsuba(sys.argv[1])"
BARE = "import mitsuba as mi"
PLUGINS = ("scene", "path", "constant", "sphere", "diffuse", "perspective", "hdrfilm", "gaussian")


@pytest.fixture(scope="module")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with libraries named as Mitsuba's plug-ins, which leave a mark when they are loaded."""
    folder = tmp_path_factory.mktemp("hostile")
    (folder / "hostile.c").write_text(HOSTILE)
    (folder / "plugins").mkdir()
    first = folder / "plugins" / f"{PLUGINS[0]}.so"
    subprocess.run(["cc", "-shared", "-fPIC", "-o", first, folder / "hostile.c"], check=True)
    for name in PLUGINS[1:]:
        (folder / "plugins" / f"{name}.so").write_bytes(first.read_bytes())
    return folder


def leaves_a_mark(folder: Path, load: str, variant: str) -> bool:
    marker = folder / "marker"
    marker.unlink(missing_ok=True)
    code = RENDER.format(folder=str(Path(backend.__file__).parents[1]), load=load)
    child = subprocess.run([sys.executable, "-c", code, variant], cwd=folder, capture_output=True, text=True,
                           env=os.environ | {"MARKER": str(marker)}, timeout=120, check=False)
    loaded = marker.exists()
    assert loaded or child.returncode == 0, child.stderr
    return loaded


@pytest.mark.parametrize("variant", ["scalar_rgb", "llvm_ad_rgb"])
def test_a_library_in_the_working_directory_is_never_loaded(hostile: Path, variant: str) -> None:
    assert leaves_a_mark(hostile, BARE, variant), "Mitsuba alone no longer does it: this test shows nothing"
    assert not leaves_a_mark(hostile, OURS, variant)


def test_both_variants_render_in_one_process() -> None:
    """A furnace: light of 1 from everywhere is 1 in every pixel."""
    for variant in ("scalar_rgb", "llvm_ad_rgb", "scalar_rgb"):
        mi = backend.mitsuba(variant)
        film = {"type": "hdrfilm", "width": 4, "height": 3, "rfilter": {"type": "box"}}
        scene = mi.load_dict({"type": "scene", "integrator": {"type": "path"}, "light": {"type": "constant"},
                              "sensor": {"type": "perspective", "film": film}})
        assert np.array_equal(np.array(mi.render(scene, spp=2)), np.ones((3, 4, 3)))
        assert mi.variant() == variant


def test_what_a_picture_depends_on_is_named() -> None:
    versions = backend.versions("llvm_ad_rgb")
    assert versions["variant"] == "llvm_ad_rgb"
    assert versions["mitsuba"] == "3.9.1" and versions["drjit"] == "1.5.0"
    assert int(versions["llvm"].split(".")[0]) == backend.version_in_name(backend.llvm_library()) >= 17
    assert "llvm" not in backend.versions("scalar_rgb")


@pytest.mark.parametrize(("name", "version"), [
    ("libLLVM-15.so.1", 15), ("libLLVM-19.so", 19), ("libLLVM.so.19.1", 19), ("libLLVM-14.0.6.so.1", 14),
    ("libLLVM.so", 0), ("libfoo.so", 0),
])
def test_the_version_a_name_tells(name: str, version: int) -> None:
    assert backend.version_in_name(Path("/usr/lib") / name) == version


def test_19_is_tried_first_and_16_never(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    for version in ("14.so.1", "15.so.1", "16.so.1", "17.so.1", "18.so.1", "20.so.1"):
        (tmp_path / f"libLLVM-{version}").touch()
    (tmp_path / "libLLVM.so.19.1").touch()
    (tmp_path / "libLLVM-19.so").symlink_to("libLLVM.so.19.1")
    (tmp_path / "libLLVMSupport.a").touch()
    found = [backend.version_in_name(p) for p in backend.candidates((tmp_path,))]
    assert found == [19, 20, 18, 17]
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", "/mine/libLLVM.so")
    assert backend.candidates((tmp_path,)) == [Path("/mine/libLLVM.so")]


@pytest.fixture
def fresh(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Path]:
    """No verdict remembered, in memory or on disk; the cache's folder."""
    backend.llvm_library.cache_clear()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    yield tmp_path / "cache" / "flowloom"
    backend.llvm_library.cache_clear()


@pytest.mark.usefixtures("fresh")
def test_only_old_libraries_is_an_error_that_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, reason in (("libLLVM-14.so.1", "LLVM 14 is too"), ("libLLVM-16.so.1", "LLVM 16 is too")):
        backend.llvm_library.cache_clear()
        monkeypatch.setenv("DRJIT_LIBLLVM_PATH", f"/usr/lib/x/{name}")
        with pytest.raises(RenderUnavailable, match=reason) as caught:
            backend.llvm_library()
        assert "apt-get install libllvm19" in str(caught.value)
        assert "unset DRJIT_LIBLLVM_PATH" in str(caught.value)
        assert "\n" not in str(caught.value)
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH")
    monkeypatch.setattr(backend, "candidates", list)
    backend.llvm_library.cache_clear()
    with pytest.raises(RenderUnavailable, match="no LLVM 17 or newer; install Debian's libllvm19"):
        backend.llvm_library()


def test_a_library_that_is_none_is_found_out_by_rendering(fresh: Path, tmp_path: Path,
                                                          monkeypatch: pytest.MonkeyPatch) -> None:
    fake = tmp_path / "libLLVM.so.19.1"
    fake.write_bytes(b"\x7fELF and nothing more")
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", str(fake))
    with pytest.raises(RenderUnavailable, match=r"libLLVM\.so\.19\.1: .*exit 1"):
        backend.llvm_library()
    assert not fresh.exists(), "a failure is not remembered"
    fake.unlink()
    backend.llvm_library.cache_clear()
    with pytest.raises(RenderUnavailable, match="cannot be read"):
        backend.llvm_library()


def test_a_proof_is_made_once_per_library(fresh: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    proofs = []

    def proven(variant: str, library: Path | None = None) -> str:
        proofs.append((variant, library))
        return ""

    monkeypatch.setattr(backend, "proven", proven)
    library = backend.llvm_library()
    backend.llvm_library.cache_clear()
    assert backend.llvm_library() == library
    assert proofs == [("llvm_ad_rgb", library)]
    assert len(list(fresh.iterdir())) == 1


def test_the_proof_renders_for_real() -> None:
    assert backend.proven("scalar_rgb") == ""
    assert backend.proven("llvm_ad_rgb", backend.llvm_library()) == ""
    assert "exit" in backend.proven("no_such_variant")
