"""Bad input and bad surroundings, end to end: one line, the right exit code, nothing half-written."""

import os
import re
import resource
import shutil
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import tiny

from pipeline import cli
from pipeline.files import images, pictures, volumes
from synth.field import Field

FLOWLOOM = [sys.executable, "-P", "-m", "pipeline.cli"]
ANALYTIC = 'kind = "analytic"\nsize = [8, 8]'
SCENE = tiny.SMOKE
for old, new in (("frames = 3", "frames = 2"), ('kind = "analytic"\nflow = "rotation"\nsize = [8, 8]', "COARSE"),
                 ('kind = "circle"', "EXEMPLAR"), ("m = 2", "m = 1"), ('panels = ["input", "coarse", "result"]\n', "")):
    SCENE = tiny.changed(SCENE, old, new)


def scene(exemplar: str = 'kind = "heart"', coarse: str = ANALYTIC) -> str:
    """The text of a scene with these tables."""
    return tiny.changed(tiny.changed(SCENE, "EXEMPLAR", exemplar), "COARSE", coarse)


LIT = 'kind = "lit"\nwidth = 32'
VOLUME = tiny.changed(scene(), LIT, 'kind = "volume"\nwidth = 16\nheight = 16\nspp = 1')
VOLUME = tiny.changed(VOLUME, "m = 1\n", (
    "m = 1\ndepth = { reach = 0.2 }\nsources = [{ centre = [0.0, 0.5], radius = 0.3 }]\n"))
VOLUME = tiny.changed(VOLUME, "frames = 2", "frames = 1")


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory inside tmp_path, with things a scene should not reach beside it."""
    home = tmp_path / "home"
    home.mkdir()
    pictures.write(tmp_path / "secret.png", np.eye(16, dtype=np.float32))
    monkeypatch.chdir(home)
    return home


def refused(text: str, capsys: pytest.CaptureFixture[str], code: int = 2) -> str:
    """The one line that running the scene ends with; nothing must have been written."""
    Path("tiny.toml").write_text(text)
    before = sorted(Path().rglob("*"))
    assert cli.run(["figure", "tiny.toml"]) == code
    err = capsys.readouterr().err
    assert err.count("\n") == 1, err
    assert sorted(Path().rglob("*")) == before
    return err.rstrip()


def field(value: float = 1.0, shape: tuple[int, ...] = (16, 16, 2)) -> Field:
    """A field with an edge in it."""
    values = np.zeros(shape, np.float32)
    values[4:12, 4:12, ..., 0] = value
    return Field.centred(values, len(shape) - 1)


def written_raw(path: Path, value: float) -> None:
    """An EXR with `value` in one of its pixels, which our own writer would refuse."""
    import OpenEXR

    channel = np.ones((16, 16), np.float32)
    channel[3, 5] = value
    OpenEXR.File({}, {"x": channel, "y": np.ones((16, 16), np.float32)}).write(str(path))


@pytest.mark.parametrize(("old", "new", "expected"), [
    ('kind = "heart"', 'kind = "heart"\nsise = 8', "tiny.toml: exemplar.sise: unknown key; did you mean size?"),
    ("omega = 1.5", 'omega = "1.5"', "tiny.toml: combine.omega: should be a valid number, not '1.5'"),
    ("omega = 1.5", "omega = -1.5", "tiny.toml: combine.omega: should be greater than or equal to 0, not -1.5"),
    ("omega = 1.5", "omega = nan", "tiny.toml: combine.omega: should be a finite number, not nan"),
    ("size = 8\n", "size = 32\n", "tiny.toml: exemplar.size: an exemplar of 32² is larger than the output (16×16)"),
])
def test_a_bad_scene(home: Path, capsys: pytest.CaptureFixture[str], old: str, new: str, expected: str) -> None:
    assert refused(tiny.changed(scene(), old, new), capsys) == expected


@pytest.mark.parametrize("file", ["../secret.png", "deep/../../secret.png", "SECRET", "link.png", "links/secret.png"])
def test_a_path_that_leaves_the_scenes_folder(home: Path, capsys: pytest.CaptureFixture[str], file: str) -> None:
    os.symlink(home.parent / "secret.png", home / "link.png")
    os.symlink(home.parent, home / "links")
    (home / "deep").mkdir()
    file = file.replace("SECRET", str(home.parent / "secret.png"))
    line = refused(scene(f'kind = "bitmap"\nfile = "{file}"'), capsys)
    assert line.startswith("tiny.toml: exemplar.file: ")
    assert "leaves the scene's folder" in line


def spoilt(path: Path, how: str) -> None:
    """Spoil a good file."""
    content = bytearray(path.read_bytes())
    if how == "truncated":
        content = content[: len(content) // 2]
    elif how == "flipped":
        for i in range(8, 40):
            content[i] ^= 0xFF
    path.write_bytes({"empty": b"", "text": b"not what it says"}.get(how, bytes(content)))


@pytest.mark.parametrize("how", ["truncated", "flipped", "empty", "text", "missing"])
@pytest.mark.parametrize(("name", "exemplar"), [
    ("a.png", "bitmap"), ("a.png", "drawing"), ("a.exr", "field"), ("a.vdb", "field"), ("a.mp4", "clip")])
def test_a_spoilt_exemplar_file(home: Path, capsys: pytest.CaptureFixture[str], name: str, exemplar: str,
                                how: str) -> None:
    from pipeline.files import video

    match name:
        case "a.png":
            pictures.write(home / name, np.random.default_rng(1).random((32, 32)))
        case "a.exr":
            images.write_field(home / name, field())
        case "a.vdb":
            volumes.write(home / name, {"vel": field(shape=(16, 16, 16, 3))})
        case "a.mp4":
            video.write(home / name, (np.full((32, 32, 3), i * 20, np.uint8) for i in range(4)), 30)
    if how == "missing":
        (home / name).unlink()
    else:
        spoilt(home / name, how)
    line = refused(scene(f'kind = "{exemplar}"\nfile = "{name}"'), capsys)
    assert name in line
    assert "exemplar.file" in line


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("table", ["exemplar", "coarse"])
def test_nan_and_infinity_in_a_field(home: Path, capsys: pytest.CaptureFixture[str], value: float,
                                     table: str) -> None:
    written_raw(home / "a.exr", value)
    if table == "exemplar":
        line = refused(scene('kind = "field"\nfile = "a.exr"'), capsys)
    else:
        line = refused(scene(coarse='kind = "file"\nfile = "a.exr"'), capsys)
    assert f"a.exr: {table}.file: " in line
    assert "NaN or infinity" in line


@pytest.mark.parametrize(("name", "made", "expected"), [
    ("a.exr", Field.centred(np.ones((16, 16), np.float32), 2), "no vector field"),
    ("a.vdb", Field.centred(np.ones((16, 16, 16), np.float32), 3), "no such grid"),
    ("a.exr", field(shape=(16, 24, 2)), "24×16 has not the shape of detail.size, 16×16"),
    ("a.exr", field(value=1e30), "cells per frame"),
    ("a.exr", field(value=0.0), "a.exr: coarse.file: is 0 everywhere"),
])
def test_a_coarse_motion_that_does_not_do(home: Path, capsys: pytest.CaptureFixture[str], name: str, made: Field,
                                          expected: str) -> None:
    if name == "a.exr":
        images.write_field(home / name, made)
    else:
        volumes.write(home / name, {"density": made})
    Path("tiny.toml").write_text(scene(coarse=f'kind = "file"\nfile = "{name}"'))
    assert cli.run(["figure", "tiny.toml"]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert expected in err


def test_a_good_field_from_a_file_goes_through(home: Path) -> None:
    volumes.write(home / "a.vdb", {"vel": field(shape=(16, 16, 16, 3))})
    images.write_field(home / "a.exr", field())
    Path("tiny.toml").write_text(scene('kind = "field"\nfile = "a.exr"', 'kind = "file"\nfile = "a.vdb"'))
    assert cli.run(["figure", "tiny.toml"]) == 0


def test_a_hostile_drawing_opens_nothing(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (home / "a.svg").write_text('<!DOCTYPE svg [<!ENTITY x SYSTEM "file:///etc/passwd">]><svg>&x;</svg>')
    line = refused(scene('kind = "drawing"\nfile = "a.svg"'), capsys)
    assert line.startswith("tiny.toml: exemplar: ")


SOLID = tiny.changed(scene(coarse='kind = "analytic"\nsize = [8, 8, 8]'), "[16, 16]", "[16, 16, 16]")
SOLID = tiny.changed(SOLID, LIT, 'kind = "volume"\nwidth = 16\nheight = 16\nspp = 1\ndenoised = false')
SOLID = tiny.changed(SOLID, "m = 1\n", "m = 1\nsources = [{ centre = [0.0, 0.5], radius = 0.3 }]\n")
SOLID = tiny.changed(SOLID, "iterations = 1", "iterations = 1\nlevels = 1")


def windy(file: str) -> str:
    """SOLID with L from a file."""
    return tiny.changed(SOLID, 'kind = "analytic"\nsize = [8, 8, 8]', f'kind = "file"\nfile = "{file}"')


def test_a_scene_in_space_goes_through(home: Path) -> None:
    Path("tiny.toml").write_text(SOLID)
    assert cli.run(["figure", "tiny.toml"]) == 0
    made = {file.relative_to("out/tiny").as_posix() for file in Path("out/tiny").rglob("*.exr")}
    assert made == {"fields/exemplar.exr", "images/beauty.0001.exr", "images/beauty.0002.exr"}
    volume = volumes.read(Path("out/tiny/geometry/F.0002.vdb"))["vel"]
    assert (volume.shape, volume.origin) == ((16, 16, 16), Field.centred(volume.values, 3).origin)


def test_a_volume_as_exemplar_and_a_wind_from_a_file_go_through(home: Path) -> None:
    random = np.random.default_rng(2)
    for name, shape in (("swirl.vdb", (12, 16, 16, 3)), ("wind.vdb", (8, 8, 8, 3))):
        values = random.standard_normal(shape, np.float32) * np.float32(0.1)
        volumes.write(home / name, {"vel": Field(values, 0.25, (-4.0, -1.0, 2.0))})
    Path("tiny.toml").write_text(windy("wind.vdb").replace('kind = "heart"', 'kind = "field"\nfile = "swirl.vdb"'))
    assert cli.run(["bake", "tiny.toml"]) == 0
    assert volumes.read(Path("out/tiny/fields/exemplar.vdb"))["vel"].shape == (8, 8, 8)
    assert volumes.read(Path("out/tiny/fields/H.0001.vdb"))["vel"].values.any()


@pytest.mark.parametrize(("old", "new", "expected"), [
    ("[coarse]", '[[views]]\nplane = "top"\n[coarse]',
     "tiny.toml: views: do not span space: none of them shows y of the local frame"),
    ("[coarse]", "[[views]]\nplane = 'top'\n[[views]]\nplane = 'side'\nexemplar = { kind = 'heart', size = 17 }\n"
     "[coarse]", "tiny.toml: views[1].exemplar.size: an exemplar of 17² is larger than the output (16×16×16) along an "
                 "axis of its view"),
    ("size = [8, 8, 8]", "size = [8, 8]", "tiny.toml: coarse.size: 8×8 has not as many axes as detail.size, 16×16×16"),
])
def test_a_bad_scene_in_space(home: Path, capsys: pytest.CaptureFixture[str], old: str, new: str,
                              expected: str) -> None:
    assert expected == refused(tiny.changed(SOLID, old, new), capsys)


def test_exemplars_of_different_scale(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = SOLID.replace("[16, 16, 16]", "[48, 48, 48]").replace("[coarse]", (
        "[[views]]\nplane = 'top'\n[[views]]\nplane = 'side'\nexemplar = { kind = 'heart', size = 40 }\n[coarse]"))
    assert refused(text, capsys) == (
        "tiny.toml: views[1].exemplar.size: an exemplar of 40² beside one of 8²: at most 4 times as large")


@pytest.mark.parametrize(("old", "new", "key", "what"), [
    ("size = [16, 16, 16]", "size = [4096, 4096, 4096]", "detail.size", "H"),
    ("size = [16, 16, 16]", "size = [16, 16, 16]", "density.scale", "density"),
])
def test_a_field_too_large_for_memory_is_refused_with_its_size(
        home: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, old: str, new: str, key: str,
        what: str) -> None:
    if what == "density":  # a machine on which the field fits and its smoke does not
        monkeypatch.setattr(os, "sysconf", {"SC_PHYS_PAGES": 1000000, "SC_PAGE_SIZE": 4096}.__getitem__)
        new = "size = [64, 64, 64]"
    line = refused(SOLID.replace(old, new).replace("scale = 1", "scale = 8"), capsys, code=4)
    cells = "×".join(new.split("[")[1].rstrip("]").split(", "))
    assert re.fullmatch(rf"tiny\.toml: {key}: {what} on {cells} cells needs [\d,]+ GB of memory; this machine has "
                        r"[\d,]+ GB", line), line


@pytest.mark.parametrize(("name", "made", "expected"), [
    ("a.exr", field(), "is flat, and the output is not"),
    ("a.vdb", field(shape=(16, 16, 24, 3)), "24×16×16 has not the shape of detail.size, 16×16×16"),
    ("a.vdb", field(shape=(16, 16, 16, 3), value=1e30), "cells per frame"),
])
def test_a_coarse_motion_that_does_not_do_in_space(home: Path, capsys: pytest.CaptureFixture[str], name: str,
                                                   made: Field, expected: str) -> None:
    if name == "a.exr":
        images.write_field(home / name, made)
    else:
        volumes.write(home / name, {"vel": made})
    Path("tiny.toml").write_text(windy(name))
    assert cli.run(["figure", "tiny.toml"]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert expected in err


def written_stretched(path: Path, sizes: tuple[float, float, float]) -> None:
    """A VDB with voxels of these sizes, which our own writer never writes."""
    volumes.write(path, {"vel": Field(np.ones((16, 16, 16, 3), np.float32), 0.125, (-1.0, -1.0, -1.0))})
    # the scale map holds the sizes, their inverses and the like as doubles: each axis has its own
    content = path.read_bytes()
    for number, inverse in ((0.125, False), (8.0, True)):
        packed = struct.pack("<3d", *[number] * 3)
        stretched = struct.pack("<3d", *(1 / s if inverse else s for s in sizes))
        assert packed in content
        content = content.replace(packed, stretched)
    path.write_bytes(content)


def test_anisotropic_voxels(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    written_stretched(home / "a.vdb", (0.125, 0.25, 0.125))
    line = refused(windy("a.vdb"), capsys)
    assert "a.vdb: coarse.file: " in line
    assert "anisotropic voxels (0.125 x 0.25 x 0.125); resample the grid to cubes" in line


def test_a_negative_origin_is_moved_onto_the_domain(home: Path) -> None:
    values = np.random.default_rng(1).random((16, 16, 16, 3), np.float32)
    results = []
    for name, origin in (("near", (0.0, 0.0, 0.0)), ("far", (-300.5, -20.25, -7.0))):
        volumes.write(home / "a.vdb", {"vel": Field(values, 0.5, origin)})
        Path("tiny.toml").write_text(windy("a.vdb"))
        assert cli.run(["bake", "tiny.toml", "--out", name]) == 0
        results.append({file.name: file.read_bytes() for file in Path(name).rglob("*.vdb")})
    assert results[0] == results[1]
    assert len(results[0]) == 8


@pytest.mark.parametrize("source", [
    "centre = [0.0, 0.5], radius = 0.3, level = 0.0", "centre = [0.0, 0.5], radius = 0.3, duty = 0.0",
    "centre = [9.0, 0.5], radius = 0.3", "centre = [0.0, 0.5, -4.0], radius = 0.3"])
def test_a_density_of_zero(home: Path, capsys: pytest.CaptureFixture[str], source: str) -> None:
    Path("tiny.toml").write_text(SOLID.replace("centre = [0.0, 0.5], radius = 0.3", source))
    assert cli.run(["figure", "tiny.toml"]) == 2
    assert capsys.readouterr().err == (
        "tiny.toml: density: no smoke enters: each source lies outside the domain, or its level or duty is 0\n")
    assert not list(Path("out").rglob("density*"))


def test_a_figure_of_a_frame_without_smoke(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    blown_away = SOLID.replace("omega = 1.5", "omega = 0.0").replace("[8, 8, 8]", "[8, 8, 8]\nspeed = 50.0")
    Path("tiny.toml").write_text(blown_away)
    assert cli.run(["figure", "tiny.toml"]) == 2
    assert capsys.readouterr().err == (
        "tiny.toml: render: there is no smoke in frame 2, which the figure shows: nothing to render\n")


def ended(arguments: list[str], **settings: object) -> subprocess.CompletedProcess[str]:
    """The command line in a process of its own."""
    return subprocess.run([*FLOWLOOM, *arguments], capture_output=True, text=True, check=False, timeout=200,
                          **settings)


def test_no_opencl(home: Path) -> None:
    Path("tiny.toml").write_text(scene(coarse='kind = "smoke"\nsize = [8, 8]'))
    environment = os.environ | {"OCL_ICD_VENDORS": str(home / "none"), "OPENCL_VENDOR_PATH": str(home / "none")}
    done = ended(["figure", "tiny.toml"], env=environment)
    assert done.returncode == 3
    assert done.stderr.count("\n") == 1
    assert "pocl-opencl-icd" in done.stderr
    assert not list(home.rglob("*.partial"))
    assert cli.run(["figure", "tiny.toml"]) == 0


def test_a_volume_needs_no_llvm_so_an_old_one_does_no_harm(home: Path) -> None:
    Path("tiny.toml").write_text(VOLUME)
    old = sorted(Path("/usr/lib").glob("*-linux-gnu/libLLVM-1[4-6].so.1"))
    assert old, "Debian's PoCL brings one of them"
    for number, library in enumerate(old):
        done = ended(["figure", "tiny.toml", "--out", f"out{number}"], env=os.environ | {
            "DRJIT_LIBLLVM_PATH": str(library), "XDG_CACHE_HOME": str(home)})
        assert done.returncode == 0, done.stderr  # Dr.Jit itself tells of a library that it refuses
        assert (home / f"out{number}" / "tiny" / "images" / "beauty.0001.exr").is_file()


@pytest.mark.parametrize("where", ["the working directory", "beside the scene"])
def test_a_hostile_plugin_is_never_loaded(home: Path, tmp_path: Path, where: str) -> None:
    source = tmp_path / "hostile.c"
    owned = tmp_path / "owned"
    source.write_text(f'#include <stdio.h>\n__attribute__((constructor)) void f(void) {{ fopen("{owned}", "w"); }}\n')
    scenes = tmp_path / "scenes"
    scenes.mkdir()
    (scenes / "tiny.toml").write_text(VOLUME)
    plugins = (home if where == "the working directory" else scenes) / "plugins"
    plugins.mkdir()
    names = ["diffuse", "volpath", "heterogeneous", "gridvolume", "constant", "hdrfilm", "perspective", "independent",
             "box", "cube", "null", "area", "rectangle", "isotropic", "constvolume", "volpathmis", "scene", "path"]
    library = plugins / "diffuse.so"
    subprocess.run(["cc", "-shared", "-fPIC", "-o", str(library), str(source)], check=True)
    for name in names[1:]:
        shutil.copy(library, plugins / f"{name}.so")
    done = ended(["figure", str(scenes / "tiny.toml")])
    assert (done.returncode, done.stderr) == (0, "")
    assert not owned.exists()
    # the library would have told: it does when it is loaded
    subprocess.run([sys.executable, "-c", f"import ctypes; ctypes.CDLL({str(library)!r})"], check=True)
    assert owned.exists()


@pytest.mark.parametrize("room", [0, 1, 4, 12])
def test_a_full_disk_is_4_and_nothing_is_half_written(home: Path, tiny_disk: Path, room: int) -> None:
    Path("tiny.toml").write_text(scene())
    filler = tiny_disk / "filler"
    settings: dict[str, object] = {}
    if os.path.ismount(tiny_disk):
        free = shutil.disk_usage(tiny_disk).free
        filler.write_bytes(bytes(free - room * 4096))
    else:  # where nothing may be mounted: no file may grow beyond a few hundred bytes
        limit = 200 + 10 * room
        settings = {"preexec_fn": lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))}
    done = ended(["figure", "tiny.toml", "--out", str(tiny_disk)], **settings)
    assert done.returncode == 4, done.stderr
    assert done.stderr.count("\n") == 1
    assert "full" in done.stderr
    assert not list(tiny_disk.rglob("*.partial"))
    for file in tiny_disk.rglob("*.exr"):
        assert images.read(file)
    filler.unlink(missing_ok=True)
    assert cli.run(["figure", "tiny.toml", "--out", str(tiny_disk)]) == 0
    assert cli.run(["figure", "tiny.toml"]) == 0
    both = [{p.relative_to(root).as_posix(): p.read_bytes() for p in (root / "tiny").rglob("*") if p.is_file()}
            for root in (tiny_disk, home / "out")]
    assert both[0] == both[1]


def test_an_output_folder_that_is_none(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("tiny.toml").write_text(scene())
    Path("out").write_text("in the way")
    assert cli.run(["figure", "tiny.toml"]) == 4
    assert capsys.readouterr().err.count("\n") == 1
