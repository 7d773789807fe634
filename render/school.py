"""A school of fish in a cube of water, under a wavy surface, over sand.

`picture` path-traces one merged mesh with Mitsuba (llvm) through `render.water` and returns linear Rec.709 light
(h, w, 3) float32, top row first; `inset` does the same with an exemplar. `render.tonemap` tone-maps both ("filmic").

World units: floor at y = 0, the cube one unit high, centred on x = z = 0.
"""

from __future__ import annotations

import numpy as np

from render import backend, mitsuba_shapes, studio, water

CAMERA = studio.Camera(position=(1.92, 0.34, 0.72), target=(0.0, 0.47, 0.0), fov=30.0)
WATER = water.Water(extinction=(0.52, 0.27, 0.22), above=(0.018, 0.155, 0.250), below=(0.001, 0.020, 0.047),
                    blend=(0.42, 1.3), zenith=(0.50, 1.00, 1.12), ambient=(0.020, 0.085, 0.115), shafts=0.75,
                    lamp=(10.0, 7.2, 5.8))


def picture(vertices: np.ndarray, faces: np.ndarray, colours: np.ndarray, shot: studio.Shot) -> np.ndarray:
    """The fish in their water at the shot's time: linear light (height, width, 3).

    vertices (N, 3) float32, world units; faces (M, 3) int; colours (N, 3) uint8, sRGB
    """
    mi = backend.mitsuba("llvm_ad_rgb")
    skin = {"type": "twosided", "bsdf": {"type": "principled", "base_color": mitsuba_shapes.VERTEX_COLOUR,
                                         "metallic": 0.25, "roughness": 0.33, "specular": 0.7}}
    sensor = mitsuba_shapes.sensor(mi, shot.camera or CAMERA, shot.width, shot.height)
    fish = mitsuba_shapes.painted(mi, "fish", vertices, faces, colours, skin)
    return water.rendered(mi, sensor, {"fish": fish}, WATER, shot)


def inset(vertices: np.ndarray, faces: np.ndarray, colours: np.ndarray, low: np.ndarray, high: np.ndarray,
          shot: studio.Shot) -> np.ndarray:
    """An exemplar's fish, lit as in `picture`; the box from `low` to `high` (3,), which contains them in all
    frames, fills the picture."""
    placed = studio.placed(vertices, low, high, shot.camera or CAMERA, shot.aspect)
    return picture(placed, faces, colours, shot)
