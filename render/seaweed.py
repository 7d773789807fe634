"""Seaweed under water: translucent blades on rippled sand, which fade into the water with distance.

`picture` path-traces one merged mesh with Mitsuba (llvm) through `render.water`, with caustics and light shafts, and
returns linear Rec.709 light (h, w, 3) float32, top row first; `render.tonemap` tone-maps it ("filmic").

World units: floor at y = 0, the bed about one unit high, centred on x = z = 0.
"""

from __future__ import annotations

import numpy as np

from render import backend, mitsuba_shapes, studio, water

CAMERA = studio.Camera(position=(0.35, 0.62, 3.4), target=(0.0, 0.37, 0.0), fov=26.0)
WATER = water.Water()


def picture(vertices: np.ndarray, faces: np.ndarray, colours: np.ndarray, shot: studio.Shot) -> np.ndarray:
    """The blades under water at the shot's time: linear light (height, width, 3).

    vertices (N, 3) float32, world units; faces (M, 3) int; colours (N, 3) uint8, sRGB
    """
    mi = backend.mitsuba("llvm_ad_rgb")
    leaf = {"type": "principledthin", "base_color": mitsuba_shapes.VERTEX_COLOUR, "roughness": 0.38,
            "diff_trans": 1.15, "eta": 1.25}
    sensor = mitsuba_shapes.sensor(mi, shot.camera or CAMERA, shot.width, shot.height, "independent")
    blades = mitsuba_shapes.painted(mi, "blades", vertices, faces, colours, leaf)
    return water.rendered(mi, sensor, {"blades": blades}, WATER, shot)
