"""The flow of a scene: L in world units, what each kind of obstacle becomes, what is refused, and who is told of them.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tiny
from scipy import ndimage
from scipy.io import netcdf_file

from pipeline import cli, flow
from pipeline.build.graph import computed
from pipeline.errors import BadInput
from pipeline.files import images, meshes, pictures, video, volumes
from pipeline.flow import upsampled
from pipeline.scene import load
from synth import obstacle
from synth.field import Field, domain_origin
from synth.motion.local_axes import axes_2d, to_world
from synth.projection import divergence

SCENE = """\
title = "A tiny river"
frames = 2
[exemplar]
kind = "sinusoid"
size = 8
[coarse]
COARSE
[detail]
size = SIZE
iterations = 1
neighborhoods = [5]
OBSTACLES
[combine]
omega = 0.5
[particles]
count = 60
[render]
kind = "RENDER"
width = 32
[figure]
panels = ["detail", "combined"]
panel = 32
"""
BALL = '[[obstacles]]\nkind = "ball"\ncentre = [0.0, 0.5]\nradius = 0.2'
ANALYTIC = 'kind = "analytic"\nsize = [16, 12]'
WAKE = 'kind = "wake"\nsize = [32, 24]'


def written(text: str = BALL, coarse: str = ANALYTIC, size: str = "[32, 24]", render: str = "none") -> Path:
    """tiny.toml with these obstacles."""
    content = SCENE.replace("COARSE", coarse).replace("SIZE", size).replace("OBSTACLES", text)
    if render == "particles":
        content = content.replace("width = 32", "width = 32\nspp = 1").replace('"combined"]', '"combined", "result"]')
    Path("tiny.toml").write_text(content.replace("RENDER", render))
    return Path("tiny.toml")


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Each test works in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def solid(text: str, size: str = "[32, 24]", coarse: str = ANALYTIC) -> np.ndarray:
    """The distance, in cells, that a scene with these obstacles works with."""
    (scene,) = load(written(text, size=size, coarse=coarse)).variants.values()
    (artifact,) = flow.solid_artifacts(scene)
    ((_, field),) = computed(artifact, scene, tiny.Memory(Path()), [0])
    assert field.shape == scene.shape and field.origin == domain_origin(scene.shape)
    return field.values * scene.shape[-2]


def level_set(name: str = "surface", of_class: str = "level set", values: np.ndarray | None = None) -> Path:
    """ball.vdb: a ball of 0.2 round (0, 0.5, 0), written as a level set of an origin of its own."""
    origin, voxel = (-0.43, -0.11, -0.37), 0.03
    z, y, x = np.meshgrid(*(o + voxel * np.arange(n) for o, n in zip(origin[::-1], (25, 41, 30), strict=True)),
                          indexing="ij")
    distance = np.sqrt(x * x + (y - 0.5) ** 2 + z * z) - 0.2 if values is None else values
    volumes.write(Path("ball.vdb"), {name: Field(distance.astype(np.float32), voxel, origin)},
                  level_set=of_class == "level set")
    return Path("ball.vdb")


def near(one: np.ndarray, other: np.ndarray) -> float:
    """The largest difference of two distances close to the wall of the other."""
    return float(np.abs(one - other)[np.abs(other) < 1.5].max())


def test_shapes_are_themselves() -> None:
    assert np.allclose(solid(BALL), obstacle.ball((24, 32), (0, 0.5), 0.2).distance, atol=1e-5)
    box = '[[obstacles]]\nkind = "box"\ncentre = [0.1, 0.5]\nradius = [0.2, 0.1]\nangle = 30'
    assert np.allclose(solid(box), obstacle.box((24, 32), (0.1, 0.5), (0.2, 0.1), 30).distance, atol=1e-5)
    square = '[[obstacles]]\nkind = "box"\ncentre = [0.1, 0.5]\nradius = 0.2'
    both = np.minimum(solid(BALL), solid(square))
    assert np.allclose(solid(f"{BALL}\n{square}"), both, atol=1e-5)


def test_in_space_too() -> None:
    ball = BALL.replace("0.5]", "0.5, 0.1]")
    flow = 'kind = "analytic"\nsize = [16, 12, 8]'
    made = solid(ball, "[32, 24, 16]", flow)
    assert np.allclose(made, obstacle.ball((16, 24, 32), (0, 0.5, 0.1), 0.2).distance, atol=1e-5)


def test_a_picture_a_drawing_and_a_level_set_of_a_disc() -> None:
    expected = obstacle.ball((24, 32), (0, 0.5), 0.2).distance
    y, x = (np.mgrid[:120, :160] + 0.5) / 120
    disc = np.hypot(x - 80 / 120, y - 0.5) < 0.2
    pictures.write(Path("mask.png"), disc.astype(np.float32))
    assert near(solid('[[obstacles]]\nkind = "mask"\nfile = "mask.png"'), expected) < 0.4
    ring = disc & (np.hypot(x - 80 / 120, y - 0.5) > 0.17)
    pictures.write(Path("ring.png"), 1 - ring.astype(np.float32))
    assert near(solid('[[obstacles]]\nkind = "drawing"\nfile = "ring.png"'), expected) < 0.4
    Path("disc.svg").write_text('<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 200 100">'
                                '<circle cx="100" cy="50" r="20"/></svg>')
    assert near(solid('[[obstacles]]\nkind = "drawing"\nfile = "disc.svg"'), expected) < 0.4
    moved = '[[obstacles]]\nkind = "drawing"\nfile = "disc.svg"\ncentre = [0.1, 0.4]\nheight = 0.5'
    assert near(solid(moved), obstacle.ball((24, 32), (0.1, 0.4), 0.1).distance) < 0.4
    level_set()
    assert near(solid('[[obstacles]]\nkind = "level-set"\nfile = "ball.vdb"'), expected) < 0.4


def ball_mesh(name: str = "ball.ply", radius: float = 0.2, centre: tuple[float, ...] = (0, 0.5, 0), holes: int = 0,
              ) -> Path:
    """A ball as a mesh in a file, `holes` of its faces taken away."""
    import trimesh

    mesh = trimesh.creation.icosphere(subdivisions=4, radius=radius)
    mesh.apply_translation(centre)
    mesh.update_faces(np.arange(len(mesh.faces)) % 150 >= (1 if holes else 0))
    mesh.export(name)
    return Path(name)


@pytest.mark.parametrize("name", ["ball.ply", "ball.obj", "ball.stl"])
@pytest.mark.parametrize("holes", [0, 1])
def test_a_mesh_of_a_ball_and_one_that_is_repaired(name: str, holes: int) -> None:
    ball_mesh(name, holes=holes)
    expected = obstacle.ball((24, 32), (0, 0.5), 0.2).distance
    assert near(solid(f'[[obstacles]]\nkind = "mesh"\nfile = "{name}"'), expected) < 0.35


def test_a_mesh_is_moved_and_scaled_and_stands_in_space() -> None:
    ball_mesh(radius=30, centre=(100, -7, 55))
    placed = '[[obstacles]]\nkind = "mesh"\nfile = "ball.ply"\ncentre = [0.1, 0.5, 0.05]\nheight = 0.5'
    made = solid(placed, "[32, 24, 16]", 'kind = "analytic"\nsize = [16, 12, 8]')
    assert near(made, obstacle.ball((16, 24, 32), (0.1, 0.5, 0.05), 0.25).distance) < 0.45


def refused(text: str, capsys: pytest.CaptureFixture[str], **settings: str) -> str:
    """The one line that running the scene ends with; nothing must have been written."""
    written(text, **settings)
    before = sorted(Path().rglob("*"))
    assert cli.run(["figure", "tiny.toml"]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1, err
    assert sorted(Path().rglob("*")) == before
    return err.rstrip()


@pytest.mark.parametrize(("text", "settings", "expected"), [
    (BALL.replace("0.2", "3.0"), {}, "tiny.toml: obstacles: the obstacles fill the domain"),
    (BALL.replace("0.0, 0.5", "3.0, 0.5"), {},
     "obstacles: obstacle 1 lies outside the domain, or is smaller than a cell"),
    (f"{BALL}\n{BALL.replace('0.2', '0.001')}", {}, "obstacles: obstacle 2 lies outside"),
    (BALL.replace("0.5]", "0.5, 0.0]"), {}, "obstacles[0].centre: has 3 coordinates; detail.size is 32×24"),
    (BALL.replace("0.2", "[0.2, 0.1]"), {}, "obstacles[0].radius: has 2 numbers for a ball"),
    (BALL.replace("ball", "bal"), {}, "obstacles[0].kind: unknown kind 'bal'; did you mean ball?"),
    (BALL.replace("radius = 0.2", "radius = -0.2"), {}, "obstacles[0].radius[0]: should be greater than 0"),
    ("", {"coarse": WAKE}, "coarse.kind: \"wake\" needs a stone"),
    (BALL, {"coarse": WAKE + "\ngains = [0.1]"}, "coarse.gains: 1 gains for 3 lengths"),
    ('samples = "lagrangian"\n' + BALL, {}, "detail.samples: samples that move do not observe a boundary"),
])
def test_what_no_scene_can_have(capsys: pytest.CaptureFixture[str], text: str, settings: dict[str, str],
                                expected: str) -> None:
    assert expected in refused(text, capsys, **settings)


@pytest.mark.parametrize("how", ["missing", "empty", "cut short", "text"])
@pytest.mark.parametrize(("kind", "name"), [
    ("mask", "a.png"), ("drawing", "a.png"), ("drawing", "a.svg"), ("level-set", "ball.vdb"), ("mesh", "ball.ply")])
def test_a_spoilt_file(capsys: pytest.CaptureFixture[str], kind: str, name: str, how: str) -> None:
    match name:
        case "a.png":
            pictures.write(Path(name), obstacle.outlines([np.array([[0.2, 0.2], [0.8, 0.2], [0.5, 0.8]])], (40, 40)))
        case "a.svg":
            Path(name).write_text('<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9"><circle r="2"/></svg>')
        case "ball.ply":
            ball_mesh()
        case _:
            level_set()
    content = Path(name).read_bytes()
    Path(name).unlink()
    if how != "missing":
        Path(name).write_bytes({"empty": b"", "cut short": content[:len(content) // 2], "text": b"nothing"}[how])
    line = refused(f'[[obstacles]]\nkind = "{kind}"\nfile = "{name}"', capsys)
    assert name in line and "obstacles[0].file" in line


def test_pictures_and_volumes_that_are_no_obstacle(capsys: pytest.CaptureFixture[str]) -> None:
    pictures.write(Path("black.png"), np.zeros((8, 8), np.float32))
    pictures.write(Path("white.png"), np.ones((8, 16), np.float32))
    assert "outside" in refused('[[obstacles]]\nkind = "mask"\nfile = "black.png"', capsys)
    assert "fill the domain" in refused('[[obstacles]]\nkind = "mask"\nfile = "white.png"\nheight = 2', capsys)
    assert "blank" in refused('[[obstacles]]\nkind = "drawing"\nfile = "white.png"', capsys)
    Path("open.svg").write_text('<svg xmlns="http://www.w3.org/2000/svg"><path d="M0 0 L5 5 L9 0"/></svg>')
    assert "encloses nothing" in refused('[[obstacles]]\nkind = "drawing"\nfile = "open.svg"', capsys)
    level_set("density", "fog volume")
    text = '[[obstacles]]\nkind = "level-set"\nfile = "ball.vdb"'
    assert "no such grid" in refused(text, capsys)
    assert "no level set, but of class fog volume" in refused(text + '\ngrid = "density"', capsys)


def test_meshes_that_are_no_obstacle(capsys: pytest.CaptureFixture[str]) -> None:
    text = '[[obstacles]]\nkind = "mesh"\nfile = "a.ply"'
    meshes.write(Path("a.ply"), np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]]))
    line = refused(text, capsys)
    assert "a.ply: obstacles[0].file: is not watertight and cannot be repaired: it encloses nothing" in line
    ball_mesh("a.ply", radius=500)
    assert "give it a height" in refused(text, capsys)
    ball_mesh("a.ply", centre=(9, 9, 9))
    assert "obstacles: obstacle 1 lies outside" in refused(text, capsys)
    ball_mesh("a.ply", radius=1.2)
    assert "fill the domain" in refused(text, capsys)
    meshes.write_points(Path("a.ply"), np.zeros((3, 3), np.float32), {})
    assert "holds no mesh" in refused(text, capsys)


def test_anisotropic_voxels_are_refused() -> None:
    matrix = np.diag([0.1, 0.2, 0.1, 1.0]).ravel().tolist()
    with pytest.raises(ValueError, match="anisotropic voxels"):
        volumes._placement(matrix)


@pytest.mark.parametrize("coarse", [ANALYTIC, WAKE, 'kind = "smoke"\nsize = [16, 12]\nwarmup = 5'])
def test_the_whole_chain_keeps_to_the_wall(coarse: str) -> None:
    written(BALL, coarse=coarse)
    assert cli.run(["figure", "tiny.toml"]) == 0
    out = Path("out/tiny")
    away = images.read_field(out / "fields/solid.exr").values * 24
    L, H = (images.read_field(out / f"fields/{name}.0002.exr") for name in ("L", "H"))
    motion = L.per_frame(30).values
    assert L.shape == (24, 32)  # past an obstacle L is on the cells of H
    if "wake" not in coarse:
        slope = np.sqrt(np.mean([np.gradient(motion, axis=a) ** 2 for a in (0, 1)]))
        left = divergence(motion, "wall" if "smoke" in coarse else "open", away)
        assert np.sqrt(np.mean(left**2)) < 1e-4 * slope
    detail = to_world(H.values, axes_2d(motion))
    normal = obstacle.outward(away)
    through = np.sum(detail * normal, -1)[np.abs(away) < 0.5]
    assert np.sqrt(np.mean(through**2)) < 0.02 * np.sqrt(np.mean(H.values**2))


def test_in_space_the_whole_chain_keeps_to_the_wall_and_hands_it_on_as_a_level_set() -> None:
    written(BALL.replace("0.5]", "0.5, 0.0]"), coarse='kind = "analytic"\nsize = [12, 12, 8]', size="[24, 24, 16]")
    assert cli.run(["figure", "tiny.toml"]) == 0
    out = Path("out/tiny")
    away = volumes.read(out / "fields/solid.vdb")["surface"]
    assert volumes.read_level_set(out / "fields/solid.vdb", "surface", "key") == away
    cells = away.values * 24
    assert near(cells, obstacle.ball((16, 24, 24), (0, 0.5, 0), 0.2).distance) < 1e-4
    L, F = (volumes.read(out / f"{name}.0002.vdb")["vel"].per_frame(30).values for name in ("fields/L", "geometry/F"))
    detail = (F - L) / 0.5
    slope = np.sqrt(np.mean([np.gradient(L, axis=a) ** 2 for a in range(3)]))
    assert np.sqrt(np.mean(divergence(L, "open", cells) ** 2)) < 1e-4 * slope
    through = np.sum(detail * obstacle.outward(cells), -1)[np.abs(cells) < 0.5]
    assert np.sqrt(np.mean(through**2)) < 0.02 * np.sqrt(np.mean(np.sum(detail**2, -1)))


def test_no_smoke_stands_inside_an_obstacle() -> None:
    written(BALL, render="lit")
    text = Path("tiny.toml").read_text()
    Path("tiny.toml").write_text(text + "[density]\nm = 1\nsources = [{ centre = [0.0, 0.5], radius = 0.4 }]\n")
    assert cli.run(["bake", "tiny.toml"]) == 0
    density = images.read_field(Path("out/tiny/geometry/density.0002.exr")).values
    fine = obstacle.ball((48, 64), (0, 0.5), 0.2).distance
    assert not density[fine < -1].any() and density[(fine > 1) & (fine < 6)].mean() > 0.3


def test_without_the_boundary_the_detail_goes_its_way() -> None:
    written(BALL + "\n")
    text = Path("tiny.toml").read_text().replace("iterations = 1", "iterations = 1\nboundary = false")
    Path("tiny.toml").write_text(text)
    assert cli.run(["figure", "tiny.toml"]) == 0
    away = images.read_field(Path("out/tiny/fields/solid.exr")).values * 24
    L, H = (images.read_field(Path(f"out/tiny/fields/{name}.0002.exr")) for name in ("L", "H"))
    through = np.sum(to_world(H.values, axes_2d(L.values)) * obstacle.outward(away), -1)[np.abs(away) < 0.5]
    assert np.sqrt(np.mean(through**2)) > 0.1 * np.sqrt(np.mean(H.values**2))


def test_projected_the_final_motion_is_free_of_divergence_past_the_obstacle() -> None:
    written(BALL)
    Path("tiny.toml").write_text(Path("tiny.toml").read_text().replace("omega = 0.5", "omega = 0.5\nproject = true"))
    assert cli.run(["figure", "tiny.toml"]) == 0
    away = images.read_field(Path("out/tiny/fields/solid.exr")).values * 24
    F = images.read_field(Path("out/tiny/geometry/F.0002.exr")).per_frame(30).values
    slope = np.sqrt(np.mean([np.gradient(F, axis=a) ** 2 for a in (0, 1)]))
    assert np.sqrt(np.mean(divergence(F, "open", away) ** 2)) < 1e-4 * slope


def test_particles_are_baked_drawn_and_resumed() -> None:
    written(BALL, coarse=WAKE, render="particles")
    text = Path("tiny.toml").read_text().replace("frames = 2", "frames = 4")
    Path("tiny.toml").write_text(text)
    assert cli.run(["figure", "tiny.toml"]) == 0
    files = [Path(f"out/tiny/geometry/particles.{i:04d}.ply") for i in range(1, 5)]
    points = [meshes.read_points(file) for file in files]
    distance = obstacle.ball((24, 32), (0, 0.5), 0.2)
    for found in points:
        assert found["position"].shape == (60, 3) and not found["position"][:, 2].any()
        assert np.hypot(found["position"][:, 0], found["position"][:, 1] - 0.5).min() > 0.2
        assert set(found) == {"position", "vx", "vy", "vz", "age"}
    assert distance.solid.any()
    moved = points[1]["position"] - points[0]["position"]
    same = (points[1]["age"] == points[0]["age"] + 1)
    expected = 0.5 * (points[0]["vx"] + points[1]["vx"]) / 30
    assert same.sum() > 40 and np.abs(moved[:, 0] - expected)[same].max() < 0.02
    whole = [file.read_bytes() for file in files]
    for file in files[2:]:
        file.unlink()  # it goes on from the second frame, to the same bits
    assert cli.run(["figure", "tiny.toml"]) == 0
    assert [file.read_bytes() for file in files] == whole
    assert images.read_picture(Path("out/tiny/images/beauty.0004.exr")).shape == (24, 32, 3)


def test_an_error_of_a_reader_names_its_key() -> None:
    Path("latin.svg").write_bytes(b"<svg>\xe9</svg>")
    with pytest.raises(BadInput, match=r"latin\.svg: key: is not an SVG document"):
        flow._drawing(Path("latin.svg"), "key")


# -- the coarse motion --------------------------------------------------------------------------------------------


TINY = 'kind = "analytic"\nflow = "rotation"\nsize = [8, 8]'


def coarse_scene(coarse: str, old: str = "", new: str = "") -> Any:
    """The tiny scene with this coarse motion."""
    text = tiny.changed(tiny.changed(tiny.SMOKE, TINY, coarse), "frames = 3", "frames = 4")
    return tiny.scene(Path(), tiny.changed(text, old, new))


def motion(scene: Any, frames: Sequence[int], solid: Field | None = None) -> dict[int, Field]:
    """L of these frames, made by what sees only what it declares."""
    inputs = tiny.Memory(Path(), **({"solid": solid} if solid else {}))
    return dict(computed(flow.coarse_artifact(scene), scene, inputs, frames))


def test_a_coarse_motion_is_stored_in_world_units_per_second() -> None:
    constant = TINY.replace("rotation", "constant") + "\nspeed = 0.5"
    scene = coarse_scene(constant, "frames = 4", "frames = 4\nfps = 24")
    found = motion(scene, [2, 3])
    assert sorted(found) == [2, 3]
    # half a cell of an eighth of the height, 24 times a second
    np.testing.assert_allclose(found[2].values[..., 0], 0.5 / 8 * 24)
    np.testing.assert_allclose(upsampled(found[2], scene)[..., 0], 1.0, rtol=1e-6)  # on twice the cells


@pytest.mark.parametrize("coarse", ['kind = "smoke"\nsize = [8, 8]\nwarmup = 3', 'kind = "curl-noise"\nsize = [8, 8]'])
def test_some_frames_of_a_coarse_motion_are_those_of_all(coarse: str) -> None:
    scene = coarse_scene(coarse)
    every = motion(scene, [1, 2, 3, 4])
    assert motion(scene, [3]) == {3: every[3]}
    assert not np.array_equal(every[2].values, every[3].values)


def test_a_coarse_motion_from_a_file_is_placed_on_the_domain() -> None:
    values = np.full((16, 16, 2), 0.25, np.float32)
    images.write_field(Path("wind.exr"), Field(values, 3.0, (5.0, 5.0)))
    found = motion(coarse_scene('kind = "file"\nfile = "wind.exr"'), [1, 4])
    assert found[1] == found[4] == Field.centred(values, 2)


def test_a_coarse_motion_from_a_vdb_is_moved_onto_the_domain_whatever_its_origin() -> None:
    values = np.random.default_rng(3).standard_normal((8, 12, 8, 3)).astype(np.float32)
    volumes.write(Path("a.vdb"), {"vel": Field(values, 0.25, (-3.0, -1.0, -2.0))})
    text = tiny.changed(tiny.changed(tiny.SMOKE, TINY, 'kind = "file"\nfile = "a.vdb"'), "[16, 16]", "[16, 24, 16]")
    found = motion(tiny.scene(Path(), tiny.changed(text, '"lit"', '"volume"')), [1, 2])
    assert found[1] == found[2] == Field.centred(values, 3)
    assert found[1].origin == pytest.approx((-1 / 3 + 1 / 24, 1 / 24, -1 / 3 + 1 / 24))


def test_a_wind_from_a_file_keeps_its_speed_past_an_obstacle() -> None:
    """Half a height a second on 8 × 8 cells, and far from the obstacle so on the 32 × 32 of H."""
    images.write_field(Path("wind.exr"), Field.centred(np.full((8, 8, 2), (0.5, 0.0), np.float32), 2))
    stone = '[[obstacles]]\nkind = "ball"\ncentre = [0.0, 0.5]\nradius = 0.06\n[combine]'
    text = tiny.changed(tiny.changed(tiny.SMOKE, TINY, 'kind = "file"\nfile = "wind.exr"'), "[16, 16]", "[32, 32]")
    scene = tiny.scene(Path(), tiny.changed(text, "[combine]", stone))
    (artifact,) = flow.solid_artifacts(scene)
    ((_, solid),) = computed(artifact, scene, tiny.Memory(Path()), [0])
    found = motion(scene, [1, 3], solid)
    assert found[1] == found[3] and found[1].shape == (32, 32)
    far = solid.values > 0.3
    assert far.sum() > 100
    speed = np.linalg.norm(found[1].values, axis=-1)
    assert np.abs(speed[far] - 0.5).max() < 0.05
    assert np.abs(speed - 0.5).max() > 0.1  # close to the stone it is another


@pytest.mark.parametrize("coarse", [
    'kind = "wake"\nsize = [16, 16]', 'kind = "analytic"\nsize = [16, 16]', 'kind = "smoke"\nsize = [16, 16]'])
def test_what_goes_round_the_obstacles_by_itself_declares_no_border(coarse: str) -> None:
    stone = '[[obstacles]]\nkind = "ball"\ncentre = [0.0, 0.5]\nradius = 0.2\n[combine]'
    scene = coarse_scene(coarse, "[combine]", stone)
    artifact = flow.coarse_artifact(scene)
    assert ("border" in artifact.reads) == ("wake" not in coarse)
    assert dict(artifact.inputs) == {"solid": "once"}
    assert scene.border == ("wall" if "smoke" in coarse else "open")


# -- a wind on latitude and longitude -----------------------------------------------------------------------------


def wind(land: bool = True, speed: float = 3, unit: str = "") -> Path:
    """wind.nc, 40 × 30 degrees: east wind, a moment later north wind; land in its north-east quarter."""
    latitude, longitude = np.arange(-14.5, 15), np.arange(-9.5, 30)
    u, v = np.zeros((2, 2, 30, 40), np.float32)
    u[0], v[1] = -speed, -2 * speed
    if land:
        u[:, 15:, 20:] = -999
    with netcdf_file("wind.nc", "w") as written:
        for name, values in (("time", np.arange(2.0)), ("lat", latitude[::-1]), ("lon", longitude)):
            written.createDimension(name, len(values))
            written.createVariable(name, "f8", (name,))[:] = values
        for name, field in (("u", u), ("v", v)):
            one = written.createVariable(name, "f4", ("time", "lat", "lon"))
            one[:] = field[:, ::-1]
            one.units = unit
            one._FillValue = np.float32(-999)
    return Path("wind.nc")


WIND = 'kind = "netcdf"\nfile = "wind.nc"\nsize = [16, 12]\nstep = 2'
BREEZE = tiny.changed(tiny.TEXTURE, 'kind = "analytic"\nflow = "rotation"\nsize = [16, 12]', WIND + "\nspeed = 2.0")
NORTH_EAST = np.outer(np.arange(12) >= 6, np.arange(16) >= 8)


def netcdf_scene(old: str = "", new: str = "") -> Any:
    return tiny.scene(Path(), tiny.changed(BREEZE, old, new))


def test_a_wind_is_interpolated_in_time_and_rests_on_land() -> None:
    wind()
    scene = netcdf_scene("frames = 3", "frames = 6")
    (artifact,) = flow.solid_artifacts(scene)
    assert artifact.reads[-1] == "coarse" and not dict(flow.coarse_artifact(scene).inputs)
    ((_, solid),) = computed(artifact, scene, tiny.Memory(Path()), [0])
    assert np.array_equal(solid.values < 0, np.kron(NORTH_EAST, np.ones((4, 4), bool)))
    assert solid.values[24, 0] == pytest.approx(0.5 * 64 / 48, abs=0.6 / 48)  # heights
    found = motion(scene, [1, 2, 3, 6])
    shrunk = np.cos(np.radians(-13.75 + 2.5 * np.arange(12)))[:, None] * np.ones(16)
    eastward = np.mean(9 / shrunk[~NORTH_EAST]**2)  # a degree is as long in both directions on the map
    unit = 2 / np.sqrt((eastward + 36) / 2)  # rms 2 heights per second over both moments
    for frame, expected in ((1, (-3, 0)), (2, (-1.5, -3)), (3, (0, -6)), (6, (0, -6))):
        values = found[frame].values
        assert not values[NORTH_EAST].any()
        meant = np.stack([expected[0] / shrunk, np.full(shrunk.shape, expected[1])], -1) * unit
        assert np.allclose(values[~NORTH_EAST], meant[~NORTH_EAST], atol=1e-5)
    assert motion(scene, [2]) == {2: found[2]}
    cyclic = motion(netcdf_scene("step = 2", "step = 2\ncyclic = true"), [3, 4, 5])
    meant = np.stack([-1.5 / shrunk, np.full(shrunk.shape, -3)], -1) * unit
    assert np.allclose(cyclic[4].values[~NORTH_EAST], meant[~NORTH_EAST], atol=1e-5)
    assert np.allclose(cyclic[5].values, found[1].values)


@pytest.mark.parametrize(("said", "shown"), [
    ("m s-1", "m/s"), ("m s**-1", "m/s"), ("km h-1", "km h-1"), ("knots", "knots"), ("", "the file's unit")])
def test_speeds_of_a_wind_are_the_datas_in_its_unit(said: str, shown: str) -> None:
    """Not those on the map, where what moves to the east is faster."""
    wind(land=False, unit=said)
    scene = netcdf_scene()
    found = motion(scene, [1, 2, 3])
    slow, between, fast = scene.coarse.speeds(found[n] for n in (1, 2, 3))
    assert scene.coarse.unit == shown
    assert np.allclose(slow, 3, rtol=1e-5) and np.allclose(fast, 6, rtol=1e-5)
    assert np.allclose(between, np.hypot(1.5, 3), rtol=1e-5)


def test_speeds_of_other_flows_are_in_heights_per_second() -> None:
    scene = tiny.scene(Path(), tiny.TEXTURE)
    L = motion(scene, [1])[1]
    assert scene.coarse.unit == "heights per second"
    np.testing.assert_allclose(next(scene.coarse.speeds([L])), np.hypot(L.values[..., 0], L.values[..., 1]), rtol=1e-6)


def test_a_wind_without_gaps_has_no_walls_but_those_of_obstacles() -> None:
    wind(land=False)
    scene = netcdf_scene("[texture]", f"{BALL}\n[texture]")
    bare = netcdf_scene()
    (artifact,) = flow.solid_artifacts(bare)
    ((_, far),) = computed(artifact, bare, tiny.Memory(Path()), [0])
    assert far.values.min() > 2
    (artifact,) = flow.solid_artifacts(scene)
    ((_, solid),) = computed(artifact, scene, tiny.Memory(Path()), [0])
    assert np.allclose(solid.values * 48, obstacle.ball((48, 64), (0, 0.5), 0.2).distance, atol=1e-5)
    assert {"shape", "border"} <= set(flow.coarse_artifact(scene).reads)
    found = motion(scene, [1], solid)[1]
    assert found.shape == (48, 64)
    assert np.sqrt(np.mean(divergence(found.per_frame(30).values, "open", solid.values * 48) ** 2)) < 1e-3


def test_land_and_obstacles_are_one_solid() -> None:
    wind()
    scene = netcdf_scene("[texture]", f"{BALL.replace('0.0, 0.5', '-0.4, 0.3')}\n[texture]")
    (artifact,) = flow.solid_artifacts(scene)
    ((_, solid),) = computed(artifact, scene, tiny.Memory(Path()), [0])
    ball = obstacle.ball((48, 64), (-0.4, 0.3), 0.2).solid
    assert np.array_equal(solid.values < 0, ball | np.kron(NORTH_EAST, np.ones((4, 4), bool)))


@pytest.mark.parametrize("method", ["carry", "paper"])
def test_there_is_no_texture_on_land(method: str) -> None:
    wind()
    graph = tiny.made(Path(), tiny.changed(BREEZE, "size = [64, 48]", f'size = [64, 48]\nmethod = "{method}"'))
    for frame in (1, 2, 3):
        picture = images.read_picture(graph.file("", "frames", frame))[::-1]
        land = np.kron(NORTH_EAST, np.ones((4, 4), bool))
        assert not picture[land].any()
        assert (picture[~land].max(-1) > 0).mean() > 0.98


def test_motion_fields_keep_out_of_land_too() -> None:
    wind()
    written("", coarse=WIND.replace("step = 2", "step = 2\nspeed = 1.0"))
    assert cli.run(["figure", "tiny.toml"]) == 0
    away = images.read_field(Path("out/tiny/fields/solid.exr")).values * 24
    L, H = (images.read_field(Path(f"out/tiny/fields/{name}.0002.exr")) for name in ("L", "H"))
    detail = to_world(H.values, axes_2d(upsampled(L, load(Path("tiny.toml")).variants[""])))
    near_land = np.abs(away) < 0.5
    assert near_land.any()
    through = np.sum(detail * obstacle.outward(away), -1)[near_land]
    assert np.sqrt(np.mean(through**2)) < 0.02 * np.sqrt(np.mean(H.values**2))


@pytest.mark.parametrize(("old", "new", "expected"), [
    ("step = 2", 'u = "uwnd"', "wind.nc: coarse.u: no variable 'uwnd'; the file has: u, v"),
    ("step = 2", "first = 2", "coarse.first: the file has 2 time steps, the last of which is number 1"),
    ("step = 2", "first = 1\nlast = 0", "coarse.last: is before coarse.first, 1"),
    ("step = 2", "window = [0, 5, 10, -5]", "coarse.window: has its south not below its north"),
    ("step = 2", "window = [-100, -5, 300, 5]", "coarse.window: is wider than the globe"),
    ("step = 2", "window = [12, 2, 28, 14]", "wind.nc: coarse.window: no place has values of both at all time steps"),
    ("step = 2", "step = 3", "wind.nc: coarse.file: u and v are 0 wherever they have values"),
    ("[16, 12]", "[16, 16]", "texture.size: 64×48 has not the shape of coarse.size, 16×16"),
])
def test_a_wind_that_does_not_fit_is_refused(capsys: pytest.CaptureFixture[str], old: str, new: str, expected: str,
                                             ) -> None:
    wind(speed=0 if "are 0" in expected else 3)
    Path("tiny.toml").write_text(tiny.changed(BREEZE, old, new))
    before = sorted(Path().rglob("*"))
    assert cli.run(["figure", "tiny.toml"]) == 2
    err = capsys.readouterr().err
    assert expected in err and err.count("\n") == 1, err
    assert sorted(Path().rglob("*")) == before


# -- the motion in a clip ---------------------------------------------------------------------------------------------


CLIP = tiny.changed(tiny.TEXTURE, 'kind = "analytic"\nflow = "rotation"\nsize = [16, 12]',
                    'kind = "clip"\nfile = "clip.mp4"\nsize = [16, 12]\nsmoothing = 0.0')
INNER = (slice(2, -2), slice(2, -2))
"""Away from the border, where what comes in is not seen before."""


def clip(steps: Sequence[tuple[float, float]] = ((3, -1), (3, -1), (3, -1))) -> Path:
    """clip.mp4, 160 × 96 pixels: a cloud that moves by `steps`, pixels to the right and up."""
    cloud = ndimage.gaussian_filter(np.random.default_rng(1).random((96, 160)), 2.5, mode="wrap")
    cloud = (cloud - cloud.min()) / np.ptp(cloud)
    places = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    moved = [ndimage.shift(cloud, (-up, right), order=3, mode="grid-wrap") for right, up in places]
    video.write(Path("clip.mp4"), [np.repeat(np.clip(frame, 0, 1)[..., None], 3, axis=2) for frame in moved], 25, crf=4)
    return Path("clip.mp4")


def test_a_clips_motion_is_that_of_the_scene() -> None:
    """3 of 96 pixels to the right in a frame of the clip: of a domain one height high, 3/96 in a frame of the scene."""
    clip()
    found = motion(tiny.scene(Path(), CLIP), [1, 2, 3])
    for frame in (1, 2, 3):
        assert found[frame].shape == (12, 16)
        per_frame = found[frame].values[INNER] / 30 * 96
        assert np.abs(per_frame.mean((0, 1)) - (3, -1)).max() < 0.05
        assert np.abs(per_frame - (3, -1)).max() < 0.35
    faster = motion(tiny.scene(Path(), tiny.changed(CLIP, "[texture]", "scale = 2.0\nstep = 4.0\n[texture]")), [1])[1]
    np.testing.assert_allclose(faster.values, found[1].values / 2, rtol=1e-5)


@pytest.mark.parametrize(("keys", "expected"), [
    ("smoothing = 0.0", [2, 3, 4, 4, 4]), ("smoothing = 0.0\ncyclic = true", [2, 3, 4, 2, 3]),
    ("smoothing = 0.0\nstep = 2.0", [1, 1.25, 1.5, 1.75, 2]),
    ("smoothing = 50.0\ncyclic = true", [3, 3, 3, 3, 3])])
def test_after_the_clips_end_its_motion_stays_or_comes_again(keys: str, expected: list[float]) -> None:
    clip([(2, 0), (3, 0), (4, 0)])
    text = tiny.changed(tiny.changed(CLIP, "frames = 3", "frames = 5"), "smoothing = 0.0", keys)
    found = motion(tiny.scene(Path(), text), [1, 2, 3, 4, 5])
    means = [found[frame].values[INNER].mean((0, 1))[0] / 30 * 96 for frame in range(1, 6)]
    assert np.allclose(means, expected, atol=0.06)


def test_a_texture_follows_a_clip_past_a_stone() -> None:
    clip()
    graph = tiny.made(Path(), CLIP)
    first, last = (graph.read("", "frames", frame) for frame in (1, 3))
    assert np.abs(last - first).mean() > 0.001
    graph = tiny.made(Path(), tiny.changed(CLIP, "[texture]", f"{BALL}\n[texture]"))
    solid, found = graph.read("", "solid", 0), graph.read("", "L", 1)
    assert np.sqrt(np.mean(divergence(found.per_frame(30).values, "open", solid.values * 48) ** 2)) < 1e-3


def test_elements_and_details_follow_a_clip() -> None:
    clip()
    for text, made in ((tiny.BEADS, "[16, 16]"), (tiny.SMOKE, "[8, 8]")):
        scene = tiny.scene(Path(), tiny.changed(text, f'kind = "analytic"\nflow = "rotation"\nsize = {made}',
                                                f'kind = "clip"\nfile = "clip.mp4"\nsize = {made}'))
        # square: the middle 96 of 160 columns
        assert np.abs(motion(scene, [1])[1].values[INNER].mean((0, 1)) * 96 / scene.fps - (3, -1)).max() < 0.1


@pytest.mark.parametrize(("given", "told"), [
    ("nothing moves", "clip.mp4: coarse.file: nothing moves in the clip"),
    ("one frame", "clip.mp4: coarse.file: 1 frames; motion needs two"),
    ("small", "clip.mp4: coarse.file: frame 1 of the clip of 6 x 6 is too small; at least 8 a side"),
    ("no clip", "clip.mp4: coarse.file: damaged")])
def test_a_clip_that_shows_no_motion_is_one_line_and_nothing_is_written(
        capsys: pytest.CaptureFixture[str], given: str, told: str) -> None:
    count, edge = (1 if given == "one frame" else 3), (6 if given == "small" else 32)
    video.write(Path("clip.mp4"), np.full((count, edge, edge, 3), 0.5), 25)
    if given == "no clip":
        Path("clip.mp4").write_text("none")
    Path("tiny.toml").write_text(CLIP)
    assert cli.run(["figure", "tiny.toml"]) == 2
    line = capsys.readouterr().err
    assert told in line and line.count("\n") == 1 and not Path("out").exists()


def test_a_clip_is_of_the_plane() -> None:
    clip()
    text = tiny.changed(tiny.SPACE, 'kind = "analytic"\nflow = "constant"', 'kind = "clip"\nfile = "clip.mp4"')
    assert tiny.complaint(tiny.written(Path(), text)) == (
        'coarse.kind: "clip" is a flow of the plane; detail.size is 16×8×16')


@pytest.mark.parametrize("coarse", ['kind = "clip"\nfile = "a.mp4"\nsize = [16, 12]', 'kind = "file"\nfile = "a.exr"',
                                    'kind = "netcdf"\nfile = "a.nc"\nsize = [16, 12]'])
def test_a_file_of_a_motion_past_an_obstacle_is_read_before_anything_is_written(
        capsys: pytest.CaptureFixture[str], coarse: str) -> None:
    for name in ("a.mp4", "a.exr", "a.nc"):
        Path(name).write_text("no such thing")
    text = tiny.changed(tiny.TEXTURE, 'kind = "analytic"\nflow = "rotation"\nsize = [16, 12]', coarse)
    Path("tiny.toml").write_text(tiny.changed(text, "[texture]", f"{BALL}\n[texture]"))
    assert cli.run(["figure", "tiny.toml"]) == 2
    line = capsys.readouterr().err
    assert "coarse.file: " in line and line.count("\n") == 1 and not Path("out").exists()
