"""Noodles on a plate in window light: round, glossy, a little translucent.

`picture` path-traces tubes with Mitsuba (llvm) and returns linear Rec.709 light (h, w, 3) float32, top row first;
`inset` does the same with an exemplar, on the table without a plate. `render.tonemap` tone-maps both ("filmic").

There is no subsurface scattering. Instead a part of the light is transmitted diffusely by the wall of a tube,
into it and out on the other side, and takes the colour of dough each time: thin parts and edges against the
light glow, and the inside of a heap is warm instead of black.

World units: the plate's well is at y = 0, a plate of noodles about one unit wide, centred on x = z = 0.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from render import backend, mitsuba_shapes, studio

CAMERA = studio.Camera(position=(0.0, 2.15, 4.7), target=(0.0, 0.125, 0.0), fov=13.2)
WINDOW = studio.Softbox((-3.1, 2.8, -1.7), (0.0, 0.1, 0.0), (2.4, 2.0), (22.0, 19.8, 17.0), 1.0)  # left, behind
FILL = studio.Softbox((3.6, 2.2, 2.4), (0.0, 0.1, 0.0), (3.0, 2.6), (3.6, 3.45, 3.3), 0.6)  # a white wall opposite
AIR = (0.17, 0.17, 0.175)
TABLE = (0.068, 0.078, 0.088)
TABLE_LEVEL = -0.052  # y, below the plate's well
GLAZE = (0.70, 0.685, 0.66)
PLATE = 0.86  # radius
MARGIN = 1.45  # radius of a plate over the extent of the noodles
BOUNCES = 2

# dough
TRANSLUCENCY = 0.30  # weight of the translucent part of the BSDF
GLOSS = {"roughness": 0.30, "specular": 0.5, "clearcoat": 1.0, "clearcoat_gloss": 0.93}  # oil


def picture(vertices: np.ndarray, faces: np.ndarray, colours: np.ndarray,
            shot: studio.Shot = studio.SHOT, plate: float = PLATE) -> np.ndarray:
    """Noodles on a plate on a table: linear light (height, width, 3).

    vertices (N, 3) float32, world units; faces (M, 3) int, closed tubes; colours (N, 3) uint8, sRGB
    plate    radius of the plate, world units; 0: no plate
    """
    own = shot.camera or CAMERA
    vertices, camera, scale = studio.in_studio(vertices, own, CAMERA)
    at = (-own.target[0] * scale, -own.target[2] * scale)
    return _traced(vertices, faces, colours, shot, camera, TABLE_LEVEL, plate * scale, at)


def view(low: np.ndarray, high: np.ndarray, aspect: float) -> tuple[studio.Camera, float]:
    """The camera, and the radius of the plate, for noodles within a box from `low` to `high` (3,) in all frames.

    aspect  width of the picture over its height
    The plate is centred on x = z = 0, and all of it is in the picture.
    """
    low, high = np.asarray(low, float), np.asarray(high, float)
    radius = MARGIN * float(np.abs(np.stack([low, high])[:, [0, 2]]).max())
    dish = np.array([[-radius, TABLE_LEVEL, -radius], [radius, 0.1 * radius, radius]])
    camera = studio.framing(np.minimum(low, dish[0]), np.maximum(high, dish[1]), CAMERA, aspect)
    return camera, radius


def inset(vertices: np.ndarray, faces: np.ndarray, colours: np.ndarray, low: np.ndarray, high: np.ndarray,
          shot: studio.Shot) -> np.ndarray:
    """An exemplar's noodles on the table without a plate, lit as in `picture`; the box from `low` to `high`
    (3,), which contains them in all frames, fills the picture."""
    camera = shot.camera or CAMERA
    level = float(studio.placed(np.stack([low, high]), low, high, camera, shot.aspect)[0, 1])
    placed = studio.placed(vertices, low, high, camera, shot.aspect)
    return _traced(placed, faces, colours, shot, camera, level, 0.0)


def _traced(vertices: np.ndarray, faces: np.ndarray, colours: np.ndarray, shot: studio.Shot,
            camera: studio.Camera, level: float, radius: float, at: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    """Noodles over a table at y = level, and on a plate centred on `at` (x, z) unless its radius is 0."""
    mi = backend.mitsuba("llvm_ad_rgb")
    scene = {
        "sensor": mitsuba_shapes.sensor(mi, camera, shot.width, shot.height),
        "window": mitsuba_shapes.lamp(mi, WINDOW), "fill": mitsuba_shapes.lamp(mi, FILL),
        "air": mitsuba_shapes.sky(AIR),
        "noodles": mitsuba_shapes.painted(mi, "noodles", vertices, faces, colours, dough()),
        "table": mitsuba_shapes.plain(mi, "table", studio.backdrop().moved(0.0, level, 0.0), {
            "type": "twosided", "bsdf": {"type": "principled", "base_color": mitsuba_shapes.rgb(TABLE),
                                         "roughness": 0.55, "specular": 0.35}}),
    }
    if radius:
        scene["plate"] = mitsuba_shapes.plain(mi, "plate", plate_mesh(radius).moved(at[0], 0.0, at[1]), {
            "type": "principled", "base_color": mitsuba_shapes.rgb(GLAZE), "roughness": 0.42,
            "specular": 0.5, "clearcoat": 0.5, "clearcoat_gloss": 0.9})
    return mitsuba_shapes.rendered(mi, scene, mitsuba_shapes.every_lamp(mi, BOUNCES), shot)


def dough() -> dict[str, Any]:
    """The BSDF of noodles, in the colours of the vertices."""
    colour = mitsuba_shapes.VERTEX_COLOUR
    return {
        "type": "blendbsdf", "weight": TRANSLUCENCY,
        "outside": {"type": "twosided", "bsdf": {"type": "principled", "base_color": colour, **GLOSS}},
        "through": {"type": "principledthin", "base_color": colour, "roughness": 0.4, "diff_trans": 1.7, "eta": 1.3},
    }


def plate_mesh(radius: float) -> studio.Mesh:
    """A shallow plate: foot, underside, lip, slope and a flat well at y = 0."""
    r, low = radius, TABLE_LEVEL
    wall = 0.020
    lip = np.array([[np.cos(a), np.sin(a)] for a in np.linspace(-0.4, 0.7, 14) * np.pi]) * 0.5 * wall
    share = np.linspace(0, 1, 24)
    ease = share * share * (3 - 2 * share)
    well, rise = 0.60 * r, 0.105 * r
    # outside first, bottom to top, then down into the well
    outside = np.stack([0.52 * r + (0.985 - 0.52) * r * share, low + 0.012 + (rise - 0.02 - low) * share**1.6], 1)
    inside = np.stack([0.975 * r + (well - 0.975 * r) * share, rise * (1 - ease) ** 1.25], 1)
    foot = np.array([[0.0, low + 0.002], [0.46 * r, low + 0.002], [0.50 * r, low], [0.515 * r, low + 0.004]])
    return studio.revolved(np.concatenate([foot, outside, np.array([[0.985 * r, rise - 0.004]]) + lip, inside,
                                           [[0.3 * r, 0.0], [0.0, 0.0]]]), segments=256)
