"""What a stranger's program makes of our volumes and stages: Blender, without a window, where it is installed.

BLENDER=… names another one than that on the PATH: a Blender, or a Python that has it as its module bpy.
"""

import json
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from pipeline.files import usd, volumes
from synth.elements import mesh
from synth.elements.samples import Elements
from synth.field import Field

BLENDER = os.environ.get("BLENDER") or shutil.which("blender")
pytestmark = pytest.mark.skipif(not BLENDER, reason="no blender on the PATH (apt-get install blender)")

SCRIPT = """
import bpy, json, sys
file, told = sys.argv[-2:]
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.object.volume_import(filepath=file)
volume = bpy.context.object
volume.data.grids.load()
corners = [list(corner) for corner in volume.bound_box]
mesh = bpy.data.objects.new("marked", bpy.data.meshes.new("marked"))
bpy.context.collection.objects.link(mesh)
surface = mesh.modifiers.new("surface", "VOLUME_TO_MESH")
surface.object, surface.threshold = volume, 0.5
shown = mesh.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
points = [list(mesh.matrix_world @ vertex.co) for vertex in shown.vertices]
json.dump({"grids": {grid.name: grid.data_type for grid in volume.data.grids}, "corners": corners,
           "matrix": [list(row) for row in volume.matrix_world], "points": points}, open(told, "w"))
"""


STAGE_SCRIPT = """
import bpy, json, sys
file, told = sys.argv[-2:]
bpy.ops.wm.read_factory_settings(use_empty=True)
answer = {"version": bpy.app.version_string, "usd": bpy.app.build_options.usd}
if answer["usd"]:
    bpy.ops.wm.usd_import(filepath=file)
    scene = bpy.context.scene
    answer |= {"range": [scene.frame_start, scene.frame_end], "frames": {}}
    for frame in range(scene.frame_start, scene.frame_end + 1):
        scene.frame_set(frame)
        graph = bpy.context.evaluated_depsgraph_get()
        answer["frames"][frame] = seen = {}
        for thing in bpy.data.objects:
            shown = thing.evaluated_get(graph)
            if thing.type == "MESH":
                points = [vertex.co for vertex in shown.data.vertices]
            elif thing.type == "CURVES":
                points = [point.position for point in shown.data.points]
            elif thing.type == "CURVE":
                points = [point.co.xyz for spline in shown.data.splines for point in spline.points]
            elif thing.type == "POINTCLOUD":
                points = [point.vector for point in shown.data.attributes["position"].data]
            else:
                continue
            seen[thing.name] = [list(shown.matrix_world @ point) for point in points]
json.dump(answer, open(told, "w"))
"""


def told(file: Path, folder: Path, question: str = SCRIPT) -> dict:
    """What Blender answers to `question`: of the grids in `file`, and of the surface where the density is 0.5."""
    script, answer = folder / "ask.py", folder / "answer.json"
    script.write_text(question)
    assert BLENDER
    command = [BLENDER, str(script), str(file), str(answer)]
    if "python" not in Path(BLENDER).name:
        command[1:2] = ["--background", "--factory-startup", "--python-exit-code", "3", "--python", str(script), "--"]
    quiet = {name: value for name, value in os.environ.items() if name != "DISPLAY"}
    subprocess.run(command, check=True, capture_output=True, timeout=300, env=quiet, cwd=folder)
    found: dict = json.loads(answer.read_text())
    return found


def test_blender_sees_the_box_and_a_marked_voxel_where_we_put_them(tmp_path: Path) -> None:
    """Three lengths, a negative origin, thin smoke and one dense voxel off every middle."""
    voxel, origin = 0.1, np.array([-0.75, 0.25, -1.5])  # x, y, z of the centre of cell (0, 0, 0)
    density = np.full((16, 24, 8), 0.2, np.float32)  # z, y, x: whole leaves, as Blender measures the box by leaves
    density[3, 5, 1] = 1.0
    volumes.write(tmp_path / "smoke.vdb", {"density": Field(density, voxel, tuple(origin.tolist()))})
    found = told(tmp_path / "smoke.vdb", tmp_path)
    assert found["grids"] == {"density": "FLOAT"}
    assert found["matrix"] == np.eye(4).tolist()  # it stands where the file says, unturned
    # OpenVDB puts a voxel's centre where its index is; Blender draws all voxels half a cell further on each axis
    # (its volume-to-mesh says so: "better align generated mesh with volume", T85312), whoever wrote the file
    marked = origin + voxel * (np.array([1, 5, 3]) + 0.5)
    points = np.array(found["points"])
    assert 0.5 * (points.min(axis=0) + points.max(axis=0)) == pytest.approx(marked, abs=0.1 * voxel)
    assert np.abs(points - marked).max() < voxel
    corners = np.array(found["corners"])
    assert corners.min(axis=0) == pytest.approx(origin, abs=1e-4)
    assert corners.max(axis=0) == pytest.approx(origin + voxel * (np.array([8, 24, 16]) - 1), abs=1e-4)


def test_blender_finds_the_velocities_beside_the_density(tmp_path: Path) -> None:
    velocity = np.zeros((4, 5, 6, 3), np.float32)
    velocity[1:3, 1:4, 1:5] = [1.0, 2.0, 3.0]
    fields = {"density": Field(velocity[..., 0].copy(), 0.05, (-0.1, 0.0, -0.2)),
              "vel": Field(velocity, 0.05, (-0.1, 0.0, -0.2))}
    volumes.write(tmp_path / "both.vdb", fields)
    assert told(tmp_path / "both.vdb", tmp_path)["grids"] == {"density": "FLOAT", "vel": "VECTOR_FLOAT"}


@pytest.mark.parametrize("grid", [(), (5,), (3, 4)])
def test_blender_sees_an_animation_frame_by_frame(tmp_path: Path, grid: tuple[int, ...]) -> None:
    """Count, frame range, bounding box at each frame, and the last vertex, which is where none other is."""
    samples = int(np.prod(grid))
    positions = np.random.Generator(np.random.Philox(key=1)).random((4, 6, samples, 3), np.float32)
    positions[:, -1, -1] = [[-2 - frame, 3, 0.5 * frame] for frame in range(4)]
    usd.write(tmp_path / "a.usdc", Elements(positions, grid))
    seen_as_they_were(tmp_path, "samples", positions.reshape(4, -1, 3))


def test_blender_sees_the_surfaces_and_no_guides(tmp_path: Path) -> None:
    positions = np.zeros((3, 2, 4, 3), np.float32)
    positions[..., 0] = 0.1 * np.arange(4)
    positions += np.arange(3)[:, None, None, None] + 0.5 * np.arange(2)[:, None, None]
    elements = Elements(positions, (4,), size=np.full(2, 0.02))
    tubes = [mesh.tubes(frame, elements.size, elements.colour) for frame in positions]
    usd.write(tmp_path / "a.usdc", elements, lambda frame: {"noodles": tubes[frame - 1]})
    seen_as_they_were(tmp_path, "noodles", np.stack([tube.vertices for tube in tubes]))


def seen_as_they_were(folder: Path, name: str, vertices: np.ndarray) -> None:
    """Vertices (T, N, 3), y up: Blender, where z is up, has one object, and it has them."""
    found = told(folder / "a.usdc", folder, STAGE_SCRIPT)
    if not found["usd"]:
        pytest.skip(f"this Blender {found['version']} is built without USD (Debian's is; set BLENDER to another)")
    assert found["range"] == [1, len(vertices)] and len(found["frames"]) == len(vertices)
    for frame, wanted in enumerate(vertices[..., [0, 2, 1]] * np.float32([1, -1, 1]), 1):
        (thing, points), = found["frames"][str(frame)].items()
        assert thing.startswith(name) and len(points) == len(wanted)
        assert np.min(points, axis=0) == pytest.approx(wanted.min(axis=0), abs=1e-5)
        assert np.max(points, axis=0) == pytest.approx(wanted.max(axis=0), abs=1e-5)
        assert points[-1] == pytest.approx(wanted[-1], abs=1e-5)
