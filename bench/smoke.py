"""A frame of smoke, 96² x 128 cells at 512 x 640 pixels: path-traced draft, march, and Blender's Cycles.

`python -m bench.smoke [--small]` prints one JSON object. The plume is simulated on 24² x 32 and carried on with curl
noise. Errors are root mean squares over the picture's mean, in linear light, at a quarter of the size, where many
paths are affordable; the noise of the path-traced truth is taken out of them. Cycles, where blender is on the PATH,
renders the same VDB under the same lights in an empty room; the noise of each renderer is measured between two
pictures with different seeds, and their costs are compared at equal noise: time × squared noise.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import re
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.files import images, volumes
from render import smoke, studio
from synth import noise
from synth import smoke as simulation
from synth.field import Field
from synth.motion.coarse import upsample
from synth.motion.density import Source, windowed

SHAPE = (96, 128, 96)
FRAMES = 40
DRAFT_SPP = 2
TRUTH_SPP = 64
CYCLES_SPP = 16


def plume(frames: int) -> np.ndarray:
    """A density (96, 128, 96) with fine detail."""
    L = [v for v, _ in simulation.simulate((24, 32, 24), frames, seed=1, radius=0.12, buoyancy=8e-4, warmup=20)]
    H = noise.curl_noise((24, 32, 24), frames, seed=5, length=0.12, octaves=2, speed=0.3)
    F = (upsample(l + h, SHAPE) for l, h in zip(L, H, strict=True))
    source = Source((0.0, 0.1, 0.0), (0.11, 0.07, 0.11), streaks=0.6, streak_size=0.025)
    *_, last = windowed(L, F, [source], 16)
    return last


def timed(work: Callable[[], Any]) -> tuple[Any, dict[str, float]]:
    """What `work` returns, and its wall and processor seconds."""
    start, busy = time.perf_counter(), time.process_time()
    result = work()
    return result, {"wall": round(time.perf_counter() - start, 2), "processor": round(time.process_time() - busy, 2)}


def rms(values: np.ndarray) -> float:
    return float(np.sqrt((values.astype(np.float64) ** 2).mean()))


CYCLES = """
import bpy, json, sys, time
told = json.loads(sys.argv[-1])
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.engine, scene.cycles.device = "CYCLES", "CPU"
bpy.ops.object.volume_import(filepath=told["vdb"])
volume = bpy.context.object
volume.location = [-0.5 * told["voxel"]] * 3  # Blender draws a voxel half a cell further than OpenVDB says
material = bpy.data.materials.new("smoke")
material.use_nodes = True
nodes, links = material.node_tree.nodes, material.node_tree.links
nodes.clear()
output, add = nodes.new("ShaderNodeOutputMaterial"), nodes.new("ShaderNodeAddShader")
density = nodes.new("ShaderNodeAttribute")
density.attribute_name = "density"
for number, (kind, share) in enumerate((("ShaderNodeVolumeScatter", told["albedo"]),
                                        ("ShaderNodeVolumeAbsorption", 1 - told["albedo"]))):
    shader, times = nodes.new(kind), nodes.new("ShaderNodeMath")
    times.operation = "MULTIPLY"
    times.inputs[1].default_value = told["extinction"] * share
    links.new(density.outputs["Fac"], times.inputs[0])
    links.new(times.outputs[0], shader.inputs["Density"])
    shader.inputs["Color"].default_value = (1, 1, 1, 1) if number == 0 else (0, 0, 0, 1)
    if number == 0:
        shader.inputs["Anisotropy"].default_value = told["forward"]
    links.new(shader.outputs[0], add.inputs[number])
links.new(add.outputs[0], output.inputs["Volume"])
volume.data.materials.append(material)
from mathutils import Vector

def aimed(thing, position, target):
    thing.location = position
    # the world's up is y here, as in the file
    ahead = (Vector(target) - Vector(position)).normalized()
    right = ahead.cross(Vector((0, 1, 0))).normalized()
    up = right.cross(ahead)
    thing.rotation_mode = "QUATERNION"
    from mathutils import Matrix
    thing.rotation_quaternion = Matrix((right, up, -ahead)).transposed().to_quaternion()
    scene.collection.objects.link(thing)

for lamp in told["lamps"]:
    light = bpy.data.lights.new("lamp", "AREA")
    light.shape, (light.size, light.size_y) = "RECTANGLE", lamp["size"]
    most = max(lamp["radiance"])
    light.color = [value / most for value in lamp["radiance"]]
    # radiance of a lamp of P watts: P / (pi area)
    light.energy = most * 3.14159265 * lamp["size"][0] * lamp["size"][1]
    aimed(bpy.data.objects.new("lamp", light), lamp["position"], lamp["target"])
world = bpy.data.worlds.new("sky")
world.use_nodes = True
world.node_tree.nodes["Background"].inputs["Color"].default_value = (*told["sky"], 1)
scene.world = world
camera = bpy.data.cameras.new("camera")
camera.sensor_fit, camera.angle_y = "VERTICAL", told["fov"] * 3.14159265 / 180
aimed(bpy.data.objects.new("camera", camera), told["eye"], told["target"])
scene.camera = scene.objects["camera"]
scene.render.resolution_x, scene.render.resolution_y = told["width"], told["height"]
cycles = scene.cycles
cycles.samples, cycles.use_adaptive_sampling, cycles.use_denoising = told["spp"], False, False
cycles.max_bounces = cycles.volume_bounces = told["depth"]
cycles.volume_step_rate, cycles.seed = 1.0, told["seed"]
cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
cycles.pixel_filter_type = "BOX"
scene.view_settings.view_transform = "Raw"
scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
scene.render.filepath = told["exr"]
start = time.time()
bpy.ops.render.render(write_still=True)
print("took", time.time() - start)
"""


def cycles(density: np.ndarray, voxel: float, origin: tuple[float, float, float], settings: smoke.VolumeSettings,
           spp: int, seed: int, folder: Path) -> tuple[np.ndarray, float]:
    """The density in Cycles under key, rim and sky, without a backdrop: linear light (h, w, 3), seconds."""
    vdb, exr, script = folder / "smoke.vdb", folder / f"{seed}.exr", folder / "cycles.py"
    volumes.write(vdb, {"density": Field(density, voxel, origin)})
    script.write_text(CYCLES)
    told = {"vdb": str(vdb), "exr": str(exr), "voxel": voxel, "extinction": settings.extinction, "spp": spp,
            "seed": seed, "albedo": float(np.mean(smoke.SMOKE_ALBEDO)), "forward": smoke.SMOKE_FORWARD,
            "depth": smoke.MAX_DEPTH,
            "lamps": [dataclasses.asdict(box) for box in studio.LAMPS.values()], "sky": studio.SKY,
            "eye": settings.camera.position, "target": settings.camera.target, "fov": settings.camera.fov,
            "width": settings.width, "height": settings.height}
    child = subprocess.run(["blender", "--background", "--factory-startup", "--python-exit-code", "3", "--python",
                            str(script), "--", json.dumps(told)], check=True, capture_output=True, text=True)
    found = re.search(r"^took (\S+)", child.stdout, re.MULTILINE)
    assert found, child.stdout
    return images.read_picture(exr), float(found[1])


def beside_cycles(density: np.ndarray, voxel: float, origin: tuple[float, float, float],
                  settings: smoke.VolumeSettings) -> dict[str, Any]:
    """Seconds and noise of both in the same empty room, and the ratio of their times at equal noise."""
    room = dataclasses.replace(settings, denoised=False, spp=CYCLES_SPP)
    with tempfile.TemporaryDirectory(prefix="flowloom-cycles-") as folder:
        theirs = [cycles(density, voxel, origin, room, CYCLES_SPP, seed, Path(folder)) for seed in (1, 2)]
    start = time.perf_counter()
    ours = [smoke.alone(density, voxel, origin, dataclasses.replace(room, seed=1000 * seed)) for seed in (1, 2)]
    seconds = 0.5 * (time.perf_counter() - start)
    row: dict[str, Any] = {"spp": CYCLES_SPP, "size": [room.width, room.height]}
    costs = {}
    for name, pictures, took in (("volpath", ours, seconds), ("Cycles", [p for p, _ in theirs],
                                                              0.5 * (theirs[0][1] + theirs[1][1]))):
        mean = 0.5 * (pictures[0] + pictures[1])
        level = float(mean.mean())
        relative = rms(pictures[0] - pictures[1]) / np.sqrt(2) / level
        costs[name] = took * relative**2
        row[name] = {"seconds": round(took, 2), "noise": round(float(relative), 4), "mean": round(level, 4)}
    row["times as efficient as volpath"] = round(costs["volpath"] / costs["Cycles"], 2)
    return row


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--small", action="store_true", help="128 x 160 pixels, a younger plume")
    small = options.parse_args().small
    density = plume(20 if small else FRAMES)
    voxel = 1 / SHAPE[1]
    origin = (0.5 * (voxel - SHAPE[2] * voxel), 0.5 * voxel, 0.5 * (voxel - SHAPE[0] * voxel))
    width, height = (128, 160) if small else (512, 640)
    settings = smoke.VolumeSettings(width=width, height=height, spp=DRAFT_SPP, bowl=(0.15, 0.085))
    marching = dataclasses.replace(settings, method="march")
    row: dict[str, Any] = {"what": f"smoke 96²×128 at {width}×{height}"}
    _, row["empty studio, once"] = timed(lambda: smoke.empty_studio(settings))
    smoke.volume(density, voxel, origin, marching)  # builds the kernels
    row["march"] = min((timed(lambda: smoke.volume(density, voxel, origin, marching))[1] for _ in range(3)),
                       key=lambda times: times["wall"])
    _, row["draft"] = timed(lambda: smoke.volume(density, voxel, origin, settings))
    row["draft, paths per pixel"] = DRAFT_SPP
    quarter = dataclasses.replace(settings, width=128, height=160)
    truths = [smoke.volume(density, voxel, origin,
                           dataclasses.replace(quarter, spp=TRUTH_SPP, seed=10000 * seed, denoised=False))
              for seed in (1, 2)]
    truth = 0.5 * (truths[0] + truths[1])
    left = rms(truths[0] - truths[1]) / 2
    for name, chosen in (
            ("march", dataclasses.replace(quarter, method="march")), ("draft", quarter),
            ("draft, not denoised", dataclasses.replace(quarter, denoised=False))):
        squared = rms(smoke.volume(density, voxel, origin, chosen) - truth) ** 2 - left**2
        row[f"error of the {name}"] = round(float(np.sqrt(max(squared, 0)) / truth.mean()), 4)
    if shutil.which("blender"):
        row["beside Cycles"] = beside_cycles(density, voxel, origin, quarter)
    print(json.dumps(row, indent=1, ensure_ascii=False))


if __name__ == "__main__":
    main()
