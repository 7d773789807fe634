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
CREASE = np.cos(np.radians(65))
"""Cosine of the angle between triangles from which they meet in an edge: shaded as smooth it would be a black band. A
coarse mesh of something round, as a rolled lip, turns by less from one to the next."""


def picture(vertices: np.ndarray, faces: np.ndarray, uv: np.ndarray, texture: np.ndarray, shot: studio.Shot,
            ) -> np.ndarray:
    """A textured surface on a table: linear light (height, width, 3).

    vertices  (N, 3) float32
    faces     (M, 3) int
    uv        (N, 2) float32, 0 at the texture's left and lower edge
    texture   (h, w, 3) float32, linear reflectance, top row first
    """
    mi = backend.mitsuba("llvm_ad_rgb")
    standing = vertices - np.array([0, vertices[:, 1].min(), 0], np.float32)
    low, high = standing.min(axis=0).astype(float), standing.max(axis=0).astype(float)
    camera = studio.framing(low, high, shot.camera or CAMERA, shot.aspect)
    own, camera, _ = studio.in_studio(standing, camera, CAMERA)
    corners = np.asarray(faces).ravel()
    scene = {
        "sensor": mitsuba_shapes.sensor(mi, camera, shot.width, shot.height),
        "window": mitsuba_shapes.lamp(mi, WINDOW), "rim": mitsuba_shapes.lamp(mi, RIM),
        "air": mitsuba_shapes.sky(AIR),
        "surface": mitsuba_shapes.shape(mi, "surface", own[corners], np.arange(len(corners)).reshape(-1, 3), None,
                                        glazed(mi, texture), vertex_normals=creased(own, faces),
                                        uv=uv[corners]),
        "backdrop": mitsuba_shapes.plain(mi, "backdrop", studio.backdrop(), mitsuba_shapes.matte(BACKDROP)),
    }
    return mitsuba_shapes.rendered(mi, scene, mitsuba_shapes.every_lamp(mi, BOUNCES), shot)


def creased(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """The normal at each corner of each triangle: (3 M, 3) float32, unit vectors, 0 at triangles without area.

    The mean of the triangles round the place of the corner that turn no farther than a crease from its own, by their
    angle there. vertices (N, 3) may hold one place many times.
    """
    corners = vertices[faces].astype(np.float64)
    ahead, behind = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    flat = unit(np.cross(ahead[:, 0], behind[:, 0]))
    angle = np.arccos(np.clip((unit(ahead) * unit(behind)).sum(axis=2), -1, 1)).ravel()
    # all pairs of corners at one place
    _, place = np.unique(vertices[faces].reshape(-1, 3), axis=0, return_inverse=True)
    order = np.argsort(place.ravel(), kind="stable")
    count = np.bincount(place.ravel())
    first = np.repeat(np.cumsum(count) - count, count)
    many = np.repeat(count, count)
    one = np.repeat(order, many)
    other = order[np.repeat(first, many) + np.arange(len(one)) - np.repeat(np.cumsum(many) - many, many)]
    alike = (flat[one // 3] * flat[other // 3]).sum(axis=1) >= CREASE
    total = np.zeros((len(place.ravel()), 3))
    for axis in range(3):
        total[:, axis] = np.bincount(one[alike], angle[other[alike]] * flat[other[alike] // 3, axis],
                                     minlength=len(total))
    return unit(total).astype(np.float32)


def unit(vectors: np.ndarray) -> np.ndarray:
    """vectors (..., 3) of length 1, zero where they are."""
    size = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(size > 0, size, 1))


def glazed(mi: Any, texture: np.ndarray) -> dict[str, Any]:
    """The BSDF of a glaze over a texture (h, w, 3), both sides alike."""
    bitmap = mi.Bitmap(np.ascontiguousarray(texture, np.float32))
    colour = {"type": "bitmap", "bitmap": bitmap, "raw": True, "filter_type": "bilinear", "wrap_mode": "clamp"}
    return {"type": "twosided", "bsdf": {"type": "principled", "base_color": colour, **GLAZE}}
