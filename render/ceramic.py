"""A glazed surface that shows a texture, on a table before a seamless backdrop, lit by soft boxes.

`picture` path-traces it with Mitsuba (llvm) and returns linear Rec.709 light (h, w, 3) float32, top row first.
`render.tonemap` tone-maps it ("filmic").

The table is where the surface's lowest point is; camera and lamps go with its size and place.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from render import backend, mitsuba_shapes, studio

CAMERA = studio.Camera(position=(0.0, 1.72, 5.4), target=(0.0, 0.5, 0.0), fov=12.6)
WINDOW = studio.Softbox((-3.0, 2.9, 1.5), (0.0, 0.5, 0.0), (1.9, 2.3), (17.5, 16.2, 14.6), 1.0)  # left, in front
RIM = studio.Softbox((2.9, 1.9, -2.2), (0.0, 0.55, 0.0), (1.0, 2.2), (15.0, 17.0, 20.0), 0.7)  # right, behind
AIR = (0.20, 0.205, 0.215)
BACKDROP = (0.245, 0.24, 0.235)
GLAZE = {"roughness": 0.42, "specular": 0.4, "clearcoat": 0.7, "clearcoat_gloss": 0.94}
BOUNCES = 1


def picture(vertices: np.ndarray, faces: np.ndarray, normals: np.ndarray, uv: np.ndarray, texture: np.ndarray,
            shot: studio.Shot) -> np.ndarray:
    """A textured surface on a table: linear light (height, width, 3).

    vertices, normals  (N, 3) float32
    faces              (M, 3) int
    uv                 (N, 2) float32, 0 at the texture's left and lower edge
    texture            (h, w, 3) float32, linear reflectance, top row first
    """
    mi = backend.mitsuba("llvm_ad_rgb")
    standing = vertices - np.array([0, vertices[:, 1].min(), 0], np.float32)
    low, high = standing.min(axis=0).astype(float), standing.max(axis=0).astype(float)
    camera = studio.framing(low, high, shot.camera or CAMERA, shot.aspect)
    own, camera, _ = studio.in_studio(standing, camera, CAMERA)
    scene = {
        "sensor": mitsuba_shapes.sensor(mi, camera, shot.width, shot.height),
        "window": mitsuba_shapes.lamp(mi, WINDOW), "rim": mitsuba_shapes.lamp(mi, RIM),
        "air": mitsuba_shapes.sky(AIR),
        "surface": mitsuba_shapes.shape(mi, "surface", own, faces, None, glazed(mi, texture), vertex_normals=normals,
                                        uv=uv),
        "backdrop": mitsuba_shapes.plain(mi, "backdrop", studio.backdrop(), mitsuba_shapes.matte(BACKDROP)),
    }
    return mitsuba_shapes.rendered(mi, scene, mitsuba_shapes.every_lamp(mi, BOUNCES), shot)


def glazed(mi: Any, texture: np.ndarray) -> dict[str, Any]:
    """The BSDF of a glaze over a texture (h, w, 3), both sides alike."""
    bitmap = mi.Bitmap(np.ascontiguousarray(texture, np.float32))
    colour = {"type": "bitmap", "bitmap": bitmap, "raw": True, "filter_type": "bilinear", "wrap_mode": "clamp"}
    return {"type": "twosided", "bsdf": {"type": "principled", "base_color": colour, **GLAZE}}
