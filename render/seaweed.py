"""Seaweed under water: thin blades that let the sun through, on rippled sand, in water that takes the distance away.

`picture` path-traces one merged mesh with Mitsuba (llvm) and returns linear Rec.709 light (h, w, 3) float32, top row
first; `render.tonemap` tones it ("filmic"). The sun comes through a waving surface, so it falls in caustics; the water
between the eye and what it meets is a fog with the sun's shafts in it, reckoned for each ray.

World units: floor at y = 0, the bed about one unit high, centred on x = z = 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from render import backend, mitsuba_shapes, studio, tonemap, water

CAMERA = studio.Camera(position=(0.35, 0.62, 3.4), target=(0.0, 0.37, 0.0), fov=26.0)
WATER = water.Water()


@dataclass(frozen=True)
class Settings:
    """How `picture` looks at a mesh: size in pixels, paths per pixel, seed, and the time, in seconds, that the
    water's surface has waved."""

    width: int = 960
    height: int = 540
    spp: int = 64
    seed: int = 1
    time: float = 0.0
    camera: studio.Camera = CAMERA


def picture(vertices: np.ndarray, faces: np.ndarray, colours: np.ndarray, settings: Settings = Settings(),
            ) -> np.ndarray:
    """The blades under water: linear light (height, width, 3).

    vertices (N, 3) float32, world units; faces (M, 3) int; colours (N, 3) uint8, sRGB.
    """
    mi = backend.mitsuba("llvm_ad_rgb")
    sunlight = water.caustics(settings.time, settings.seed)
    scene = mi.load_dict({
        "type": "scene",
        "sensor": mitsuba_shapes.sensor(mi, settings.camera, settings.width, settings.height, "independent"),
        "sun": water.sun(mi, sunlight),
        "sky": water.sky(mi, WATER),
        "sand": water.floor(mi),
        "blades": mitsuba_shapes.shape(mi, "blades", vertices, faces, tonemap.from_srgb(colours / 255.0), {
            "type": "principledthin", "base_color": {"type": "mesh_attribute", "name": "vertex_color"},
            "roughness": 0.38, "diff_trans": 1.15, "eta": 1.25}),
    })
    light = mi.render(scene, integrator=water.through_water(mi, sunlight, WATER), spp=settings.spp, seed=settings.seed)
    return np.array(light, np.float32)
