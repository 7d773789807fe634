"""What a stranger's program makes of our volumes: Blender, without a window, where it is installed."""

import json
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from pipeline.files import volumes
from synth.field import Field

BLENDER = shutil.which("blender")
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


def told(file: Path, folder: Path) -> dict:
    """What Blender says of the grids in `file`, and of the surface where the density is 0.5."""
    script, answer = folder / "ask.py", folder / "answer.json"
    script.write_text(SCRIPT)
    assert BLENDER
    command = [BLENDER, "--background", "--factory-startup", "--python-exit-code", "3", "--python", str(script),
               "--", str(file), str(answer)]
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
