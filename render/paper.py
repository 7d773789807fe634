"""Sheets of paper in the air and on the floor: translucent, with soft shadows.

`picture` path-traces sheets with Mitsuba (llvm) and returns linear Rec.709 light (h, w, 3) float32, top row first;
`inset` does the same with an exemplar in the middle of the picture. `render.tonemap` tone-maps both ("filmic").

World units: floor at y = 0, the scene about one unit high, centred on x = z = 0.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from render import backend, mitsuba_shapes, studio

CAMERA = studio.Camera(position=(0.0, 0.74, 5.4), target=(0.0, 0.46, 0.0), fov=12.2)
SUN = studio.Softbox((-3.4, 3.0, -0.9), (0.0, 0.4, 0.0), (1.2, 1.2), (94.0, 84.0, 70.0), 1.0)  # high, left, behind
FILL = studio.Softbox((3.4, 1.6, 3.4), (0.0, 0.4, 0.0), (3.2, 2.8), (1.3, 1.45, 1.7), 0.5)
AIR = (0.22, 0.23, 0.25)  # radiance from everywhere
BACKDROP = (0.355, 0.36, 0.365)
CLEARANCE = 0.2  # between an inset's sheets and its floor
BOUNCES = 1
PALETTE = ((0.965, 0.955, 0.930), (0.925, 0.905, 0.850), (0.905, 0.430, 0.330), (0.970, 0.780, 0.380),
           (0.330, 0.560, 0.620))
"""sRGB: white, cream, vermilion, amber, petrol."""


def picture(vertices: np.ndarray, faces: np.ndarray, colours: np.ndarray, shot: studio.Shot) -> np.ndarray:
    """Sheets of paper before a pale backdrop: linear light (height, width, 3).

    vertices (N, 3) float32, world units; faces (M, 3) int, one layer for each sheet; colours (N, 3) uint8, sRGB
    """
    vertices, camera, _ = studio.in_studio(vertices, shot.camera or CAMERA, CAMERA)
    return _traced(vertices, faces, colours, shot, camera, 0.0)


def inset(vertices: np.ndarray, faces: np.ndarray, colours: np.ndarray, low: np.ndarray, high: np.ndarray,
          shot: studio.Shot) -> np.ndarray:
    """An exemplar's sheets in the air, lit as in `picture`; the box from `low` to `high` (3,), which contains
    them in all frames, fills the picture."""
    camera = shot.camera or CAMERA
    box = studio.placed(np.stack([low, high]), low, high, camera, shot.aspect)
    placed = studio.placed(vertices, low, high, camera, shot.aspect)
    return _traced(placed, faces, colours, shot, camera, min(0.0, float(box[0, 1]) - CLEARANCE))


def _traced(vertices: np.ndarray, faces: np.ndarray, colours: np.ndarray, shot: studio.Shot,
            camera: studio.Camera, level: float) -> np.ndarray:
    """Sheets over a floor at y = level."""
    mi = backend.mitsuba("llvm_ad_rgb")
    ground = studio.backdrop().moved(0.0, level, 0.0)
    scene = {
        "sensor": mitsuba_shapes.sensor(mi, camera, shot.width, shot.height),
        "sun": mitsuba_shapes.lamp(mi, SUN), "fill": mitsuba_shapes.lamp(mi, FILL),
        "air": mitsuba_shapes.sky(AIR),
        "paper": mitsuba_shapes.painted(mi, "paper", vertices, faces, colours, paper()),
        "backdrop": mitsuba_shapes.plain(mi, "backdrop", ground, mitsuba_shapes.matte(BACKDROP)),
    }
    return mitsuba_shapes.rendered(mi, scene, mitsuba_shapes.every_lamp(mi, BOUNCES), shot)


def paper() -> dict[str, Any]:
    """A thin sheet; a third of the light that it does not absorb passes through it."""
    return {"type": "principledthin", "base_color": mitsuba_shapes.VERTEX_COLOUR,
            "roughness": 0.65, "diff_trans": 0.92, "eta": 1.35, "spec_trans": 0.0}
