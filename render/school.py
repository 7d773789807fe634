"""Fish in a cube of water: thousands of them, under a waving surface, over sand.

`picture` traces one merged mesh with Mitsuba (llvm) through `render.water` and returns linear Rec.709 light (h, w, 3)
float32, top row first; `inset` does the same with an exemplar. `render.tonemap` tones both
("filmic").

World units: floor at y = 0, the cube one unit high, centred on x = z = 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from render import backend, mitsuba_shapes, studio, tonemap, water

CAMERA = studio.Camera(position=(1.92, 0.34, 0.72), target=(0.0, 0.47, 0.0), fov=30.0)
WATER = water.Water(extinction=(0.52, 0.27, 0.22), above=(0.018, 0.155, 0.250), below=(0.001, 0.020, 0.047),
                    turn=(0.42, 1.3), zenith=(0.50, 1.00, 1.12), dim=(0.020, 0.085, 0.115), shafts=0.75,
                    lamp=(10.0, 7.2, 5.8))


@dataclass(frozen=True)
class Settings:
    """How `picture` looks at fish: size in pixels, paths per pixel, seed, and the time, in seconds, that the water's
    surface has waved."""

    width: int = 960
    height: int = 540
    spp: int = 64
    seed: int = 1
    time: float = 0.0
    camera: studio.Camera = CAMERA


def picture(vertices: np.ndarray, faces: np.ndarray, colours: np.ndarray, settings: Settings = Settings(),
            ) -> np.ndarray:
    """The fish in their water: linear light (height, width, 3).

    vertices (N, 3) float32, world units; faces (M, 3) int; colours (N, 3) uint8, sRGB.
    """
    mi = backend.mitsuba("llvm_ad_rgb")
    sunlight = water.caustics(settings.time, settings.seed)
    scene = mi.load_dict({
        "type": "scene",
        "sensor": mitsuba_shapes.sensor(mi, settings.camera, settings.width, settings.height),
        "sun": water.sun(mi, sunlight),
        "sky": water.sky(mi, WATER),
        "sand": water.floor(mi),
        "fish": mitsuba_shapes.shape(mi, "fish", vertices, faces, tonemap.from_srgb(colours / 255.0), {
            "type": "twosided", "bsdf": {
                "type": "principled", "base_color": {"type": "mesh_attribute", "name": "vertex_color"},
                "metallic": 0.25, "roughness": 0.33, "specular": 0.7}}),
    })
    light = mi.render(scene, integrator=water.through_water(mi, sunlight, WATER), spp=settings.spp, seed=settings.seed)
    return np.array(light, np.float32)


def inset(vertices: np.ndarray, faces: np.ndarray, colours: np.ndarray, low: np.ndarray, high: np.ndarray,
          settings: Settings = Settings()) -> np.ndarray:
    """An exemplar's fish, as `picture` shows them; the box from `low` to `high` (3,), which holds them in all frames,
    fills the picture."""
    placed = studio.placed(vertices, low, high, settings.camera, settings.width / settings.height)
    return picture(placed, faces, colours, settings)
