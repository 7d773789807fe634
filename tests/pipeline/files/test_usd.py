"""OpenUSD: what is written is there at each frame, for a stranger's eyes; what is read is refused in a line."""

import dataclasses
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom, UsdValidation, Vt

from pipeline.errors import BadInput, StorageFailed
from pipeline.files import tracks, usd
from synth.elements.samples import Elements


def generator(key: int) -> np.random.Generator:
    return np.random.Generator(np.random.Philox(key=key))


@dataclass(frozen=True)
class Mesh:
    vertices: np.ndarray
    faces: np.ndarray
    colours: np.ndarray


def some(grid: tuple[int, ...] = (), dimensions: int = 3, frames: int = 4, count: int = 3) -> Elements:
    random, samples = generator(1), int(np.prod(grid))
    return Elements(random.random((frames, count, samples, dimensions), np.float32), grid, 30.0,
                    size=0.1 * (1 + np.arange(count)), kind=np.arange(count), colour=random.random((count, 3)))


def surface(frame: int) -> dict[str, Mesh]:
    """A quad that moves, and triangles one more of which is there from frame 3 on, when they are green."""
    vertices = np.array([[0, 0, frame], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
    grey, green = np.full((4, 3), 188, np.uint8), np.array([[0, 255, 0]] * 4, np.uint8)
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    return {"quad": Mesh(vertices, np.array([[0, 1, 2, 3]], np.int32), grey),
            "growing": Mesh(-vertices, triangles[:1 if frame < 3 else 2], grey if frame < 3 else green)}


def opened(path: Path) -> Usd.Stage:
    return Usd.Stage.Open(str(path))


@pytest.mark.parametrize("grid", [(), (5,), (3, 4)])
@pytest.mark.parametrize("dimensions", [2, 3])
def test_samples_are_where_they_were_at_each_frame(tmp_path: Path, grid: tuple[int, ...], dimensions: int) -> None:
    elements = some(grid, dimensions)
    usd.write(tmp_path / "a.usdc", elements, metres=0.01)
    found = opened(tmp_path / "a.usdc")
    assert (found.GetStartTimeCode(), found.GetEndTimeCode()) == (1, 4)
    assert found.GetTimeCodesPerSecond() == found.GetFramesPerSecond() == 30
    assert UsdGeom.GetStageUpAxis(found) == "Y" and UsdGeom.GetStageMetersPerUnit(found) == 0.01
    assert found.GetDefaultPrim().GetPath() == "/world"
    samples = UsdGeom.PointBased(found.GetPrimAtPath("/world/samples"))
    assert samples.GetPrim().GetTypeName() == {0: "Points", 1: "BasisCurves", 2: "Mesh"}[len(grid)]
    assert samples.GetPointsAttr().GetTimeSamples() == [1, 2, 3, 4]
    for frame in (1, 2, 3, 4):
        points = np.asarray(samples.GetPointsAttr().Get(frame))
        assert np.array_equal(points[:, :dimensions], elements.positions[frame - 1].reshape(-1, dimensions))
        assert dimensions == 3 or not points[:, 2].any()
    colour = np.asarray(UsdGeom.Gprim(samples).GetDisplayColorAttr().Get())
    assert np.array_equal(np.unique(colour, axis=0), np.unique(usd.linear(elements.colour), axis=0))


def test_widths_are_diameters_and_sheets_are_quads(tmp_path: Path) -> None:
    usd.write(tmp_path / "a.usdc", some())
    found = opened(tmp_path / "a.usdc")
    points = UsdGeom.Points(found.GetPrimAtPath("/world/samples"))
    assert np.asarray(points.GetWidthsAttr().Get()) == pytest.approx([0.2, 0.4, 0.6])
    usd.write(tmp_path / "b.usdc", some((5,)))
    found = opened(tmp_path / "b.usdc")
    curves = UsdGeom.BasisCurves(found.GetPrimAtPath("/world/samples"))
    assert list(curves.GetCurveVertexCountsAttr().Get()) == [5, 5, 5]
    assert np.asarray(curves.GetWidthsAttr().Get()) == pytest.approx(np.repeat([0.2, 0.4, 0.6], 5))
    usd.write(tmp_path / "c.usdc", some((3, 4)))
    found = opened(tmp_path / "c.usdc")
    mesh = UsdGeom.Mesh(found.GetPrimAtPath("/world/samples"))
    faces = np.asarray(mesh.GetFaceVertexIndicesAttr().Get()).reshape(3, 6, 4)
    assert list(faces[0, 0]) == [0, 1, 5, 4] and np.array_equal(faces[2], faces[0] + 24)
    assert list(UsdGeom.PrimvarsAPI(mesh).GetPrimvar("kind").Get()) == [0] * 12 + [1] * 12 + [2] * 12


@pytest.mark.parametrize("grid", [(), (5,), (3, 4)])
def test_usd_itself_finds_nothing_wrong(tmp_path: Path, grid: tuple[int, ...]) -> None:
    """Its own validators, and the extents that it computes, which for points and curves reach as far as the widths."""
    usd.write(tmp_path / "a.usdc", some(grid), surface)
    found = opened(tmp_path / "a.usdc")
    every = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    faults = UsdValidation.ValidationContext(every).Validate(found)
    assert [fault.GetErrorAsString() for fault in faults] == []
    for prim in found.Traverse():
        shape = UsdGeom.Boundable(prim)
        for frame in (1, 4) if shape else ():
            low, high = np.asarray(shape.GetExtentAttr().Get(frame))
            computed = np.asarray(UsdGeom.Boundable.ComputeExtentFromPlugins(shape, frame))
            points = np.asarray(UsdGeom.PointBased(prim).GetPointsAttr().Get(frame))
            assert (low <= points.min(axis=0)).all() and (high >= points.max(axis=0)).all()
            if prim.IsA(UsdGeom.BasisCurves):  # USD takes the hull of the samples, which a curve may leave
                assert (low <= computed[0] + 0.6).all() and (high >= computed[1] - 0.6).all()
            else:
                assert np.array([low, high]) == pytest.approx(computed, abs=1e-6)


def test_a_curve_lies_in_its_extent(tmp_path: Path) -> None:
    elements = dataclasses.replace(some((5,)), size=np.full(3, 1e-6, np.float32))
    usd.write(tmp_path / "a.usdc", elements)
    found = opened(tmp_path / "a.usdc")
    curves = UsdGeom.Boundable(found.GetPrimAtPath("/world/samples"))
    t = np.linspace(0, 1, 50)[:, None]
    for frame, threads in enumerate(elements.positions, 1):
        low, high = np.asarray(curves.GetExtentAttr().Get(frame))
        for p in threads:
            q = np.concatenate([2 * p[:1] - p[1:2], p, 2 * p[-1:] - p[-2:-1]])  # as pinned ends are defined
            for a, b, c, d in zip(q, q[1:], q[2:], q[3:], strict=False):
                at = 0.5 * (2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t**2 + (3 * (b - c) + d - a) * t**3)
                assert (at >= low - 1e-6).all() and (at <= high + 1e-6).all()


def test_surfaces_move_and_what_stays_the_same_is_stored_once(tmp_path: Path) -> None:
    usd.write(tmp_path / "a.usdc", some((5,)), surface)
    found = opened(tmp_path / "a.usdc")
    quad, growing = (UsdGeom.Mesh(found.GetPrimAtPath(f"/world/{name}")) for name in ("quad", "growing"))
    assert [tuple(quad.GetPointsAttr().Get(frame)[0]) for frame in (1, 3)] == [(0, 0, 1), (0, 0, 3)]
    assert quad.GetFaceVertexIndicesAttr().GetNumTimeSamples() == 0
    assert list(quad.GetFaceVertexCountsAttr().Get()) == [4]
    assert tuple(quad.GetDisplayColorAttr().Get()[0]) == pytest.approx((0.5029, 0.5029, 0.5029), abs=1e-4)
    assert [list(growing.GetFaceVertexCountsAttr().Get(frame)) for frame in (1, 2, 3, 4)] == [[3], [3], [3, 3], [3, 3]]
    assert growing.GetFaceVertexCountsAttr().GetTimeSamples() == [1, 3]
    assert [np.round(growing.GetDisplayColorAttr().Get(frame)[0], 2).tolist() for frame in (1, 2, 3, 4)] == [
        pytest.approx([0.5, 0.5, 0.5])] * 2 + [[0, 1, 0]] * 2
    samples = UsdGeom.Imageable(found.GetPrimAtPath("/world/samples"))
    assert samples.GetPurposeAttr().Get() == "guide"
    box = UsdGeom.BBoxCache(3, ["default", "render"]).ComputeWorldBound(found.GetDefaultPrim()).GetRange()
    assert tuple(box.GetMin()) == (-1, -1, -3) and tuple(box.GetMax()) == (1, 1, 3)


def test_the_same_elements_give_the_same_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in "ab":
        usd.write(tmp_path / f"{name}.usdc", some((5,)), surface)
    assert (tmp_path / "a.usdc").read_bytes() == (tmp_path / "b.usdc").read_bytes()
    monkeypatch.setattr(usd, "PENDING", 0)  # to the file after each frame: other bytes, the same animation
    usd.write(tmp_path / "c.usdc", some((5,)), surface)
    assert opened(tmp_path / "c.usdc").ExportToString().splitlines()[5:] == opened(
        tmp_path / "a.usdc").ExportToString().splitlines()[5:]


def test_a_long_animation_is_not_held_in_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """48 MB of vertices, of which a thirtieth is pending at any time."""
    def resident() -> int:
        status = Path("/proc/self/status").read_text()
        return int(status.partition("RssAnon:")[2].split()[0]) << 10

    monkeypatch.setattr(usd, "PENDING", 1 << 20)
    random, seen = generator(2), []
    faces, colours = np.array([[0, 1, 2]], np.int32), np.zeros((100_000, 3), np.uint8)

    def heavy(frame: int) -> dict[str, Mesh]:
        seen.append(resident())
        return {"heavy": Mesh(random.random((100_000, 3), np.float32), faces, colours)}

    usd.write(tmp_path / "a.usdc", some(frames=40), heavy)
    assert len(seen) == 40 and (tmp_path / "a.usdc").stat().st_size > 48e6
    assert max(seen) - seen[5] < 12e6


@pytest.mark.parametrize(("second", "reason"), [
    ({"quad": surface(1)["quad"]}, "frame 2 has surfaces"),
    ({**surface(2), "quad": Mesh(np.full((4, 3), np.nan), surface(1)["quad"].faces, surface(1)["quad"].colours)},
     "frame 2, quad: no vertices or faces, NaN"),
    ({**surface(2), "quad": Mesh(surface(2)["quad"].vertices, np.array([[0, 1, 4]]), surface(1)["quad"].colours)},
     "frame 2, quad: a face names a vertex"),
    ({**surface(2), "quad": Mesh(surface(2)["quad"].vertices, np.array([[0, 1]]), surface(1)["quad"].colours)},
     "frame 2, quad: vertices are"),
    ({**surface(2), "quad": Mesh(surface(2)["quad"].vertices, np.array([[0, 1, 2]]), np.zeros((4, 3)))},
     "frame 2, quad: colours are"),
])
def test_nothing_is_left_of_an_animation_that_fails(tmp_path: Path, second: dict, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        usd.write(tmp_path / "a.usdc", some(), lambda frame: second if frame == 2 else surface(frame))
    with pytest.raises(ValueError, match="no name of a surface"):
        usd.write(tmp_path / "a.usdc", some(), lambda frame: {"samples": surface(frame)["quad"]})
    with pytest.raises(KeyboardInterrupt):
        usd.write(tmp_path / "a.usdc", some(), interrupted)
    assert list(tmp_path.iterdir()) == []


def interrupted(frame: int) -> dict[str, Mesh]:
    raise KeyboardInterrupt


@pytest.mark.parametrize("pending", [0, 32 << 20])
def test_a_full_disk_is_noticed(tiny_disk: Path, monkeypatch: pytest.MonkeyPatch, pending: int) -> None:
    monkeypatch.setattr(usd, "PENDING", pending)
    with pytest.raises(StorageFailed, match=r"(is the disk full|the disk is full)"):
        usd.write(tiny_disk / "a.usdc", some((40,), frames=60, count=50))
    assert list(tiny_disk.iterdir()) == []


# --- a stranger's ---

@pytest.mark.parametrize("grid", [(), (5,), (3, 4)])
def test_our_own_samples_are_read_again(tmp_path: Path, grid: tuple[int, ...]) -> None:
    usd.write(tmp_path / "a.usdc", some(grid), surface)
    vertices, lines, faces, rate = usd.geometry(tmp_path / "a.usdc", "/world/samples")
    assert rate == 30 and np.array_equal(vertices, some(grid).positions.reshape(4, -1, 3))
    assert bool(lines) == (len(grid) == 1) and bool(faces) == (len(grid) == 2)


def drawn(path: Path) -> Usd.Stage:
    """A curve of three points, z up, in a group that moves along x by one each frame of two time codes."""
    made = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(made, "Z")
    made.SetTimeCodesPerSecond(48)
    made.SetFramesPerSecond(24)
    group = UsdGeom.Xform.Define(made, "/group")
    move = group.AddTranslateOp()
    move.Set(Gf.Vec3d(0, 0, 0), 10)
    move.Set(Gf.Vec3d(2, 0, 0), 14)
    made.SetStartTimeCode(10)
    made.SetEndTimeCode(14)
    curves = UsdGeom.BasisCurves.Define(made, "/group/curves")
    curves.CreatePointsAttr([(0, 0, 0), (0, 1, 0), (0, 1, 2)])
    curves.CreateCurveVertexCountsAttr([3])
    return made


def test_places_axes_and_rates_of_others(tmp_path: Path) -> None:
    drawn(tmp_path / "a.usda").Save()
    vertices, lines, _, rate = usd.geometry(tmp_path / "a.usda", "/")
    assert rate == 24 and lines == [(0, 1, 2)]
    assert vertices.tolist() == [[[x, 0, 0], [x, 0, -1], [x, 2, -1]] for x in (0, 1, 2)]


def change(what: str, made: Usd.Stage) -> None:
    curves = UsdGeom.BasisCurves(made.GetPrimAtPath("/group/curves"))
    if what == "nothing":
        made.RemovePrim("/group/curves")
    elif what == "two kinds":
        UsdGeom.Points.Define(made, "/dots").CreatePointsAttr([(0, 0, 0)])
    elif what == "closed":
        curves.CreateWrapAttr("periodic")
    elif what == "come and go":
        curves.GetPointsAttr().Set(Vt.Vec3fArray([(0, 0, 0), (0, 1, 0)]), 12)
        curves.GetPointsAttr().Set(Vt.Vec3fArray([(0, 0, 0), (0, 1, 0), (0, 0, 1)]), 10)
    elif what == "joined":
        curves.GetPointsAttr().Set(Vt.Vec3fArray([(0, 0, 0)] * 4))
        curves.GetCurveVertexCountsAttr().Set([4], 10)
        curves.GetCurveVertexCountsAttr().Set([2, 2], 14)
    elif what == "counts":
        curves.GetCurveVertexCountsAttr().Set([5])
    elif what == "times":
        made.SetEndTimeCode(1e12)
    elif what == "reference":
        made.DefinePrim("/other").GetReferences().AddReference("/etc/passwd.usda")
    elif what == "infinite":
        curves.GetPointsAttr().Set(Vt.Vec3fArray([(0, 0, 0), (0, 1e30, 0), (0, float("inf"), 2)]))


@pytest.mark.parametrize(("what", "reason"), [
    ("nothing", "holds no points, curves or meshes"),
    ("two kinds", r"holds curves \(/group/curves\) and points \(/dots\); name one of them"),
    ("closed", "closed curves"),
    ("come and go", "frame 12: /group/curves has 2 vertices, and 3 before"),
    ("joined", "frame 14: the vertices of /group/curves are joined otherwise"),
    ("counts", "counts 5 vertices of its curves, and has 3"),
    ("times", "time codes from 10 to 1e"),
    ("reference", "refers to other files"),
])
def test_what_cannot_be_read_says_why(tmp_path: Path, what: str, reason: str) -> None:
    made = drawn(tmp_path / "a.usda")
    change(what, made)
    made.Save()
    with pytest.raises(ValueError, match=reason):
        usd.geometry(tmp_path / "a.usda", "/")


def test_damaged_files_are_one_line(tmp_path: Path) -> None:
    usd.write(tmp_path / "whole.usdc", some((5,)))
    whole, path, random = (tmp_path / "whole.usdc").read_bytes(), tmp_path / "a.usdc", generator(5)
    made = drawn(tmp_path / "b.usda")
    change("infinite", made)
    made.Save()
    with pytest.raises(BadInput, match=r"b\.usda: key: .*frame 1, element 1"):
        tracks.read_foreign(tmp_path / "b.usda", "key", fewest_elements=1)
    for n in range(5):
        content = bytearray(whole)
        for place in random.integers(len(content) // 2, len(content), 20):
            content[place] = random.integers(256)
        path.write_bytes([b"", whole[:-40], random.bytes(4000)][n] if n < 3 else content)
        try:
            tracks.read_foreign(path, "key")
        except BadInput as error:
            assert str(error).startswith(f"{path}: key: ") and "\n" not in str(error)


def test_colours_are_linear() -> None:
    assert usd.linear(np.array([0, 255, 188], np.uint8)) == pytest.approx([0, 1, 0.5029], abs=1e-4)
    assert usd.linear(np.array([0.0, 0.04, 1.0])) == pytest.approx([0, 0.04 / 12.92, 1], abs=1e-6)

