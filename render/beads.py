"""Particles of the plane as beads on white paper with raised obstacles, seen from straight above.

`picture` path-traces beads with Mitsuba (llvm) and returns linear Rec.709 light (h, w, 3) float32, top row first. An
exemplar's inset is the same picture with the exemplar's ground. `render.tonemap` tone-maps it ("filmic").

World units; x to the right and y up in the picture, z towards the camera.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import ndimage

from render import backend, mitsuba_shapes, studio

SLANT = (-0.42, 0.62, 1.0)  # towards the lamp: from the upper left
LAMP = 0.34  # edge of the lamp over its distance: softness of the shadows
LAMP_DISTANCE = 18.0  # in heights of the picture: far enough to light the paper evenly
LAMP_LIGHT = (3.05, 2.93, 2.74)  # irradiance of a surface that faces it
AIR = (0.30, 0.315, 0.345)  # radiance from everywhere
PAPER = (0.80, 0.795, 0.78)
BEYOND = (0.46, 0.46, 0.455)  # paper outside the domain
OBSTACLE = (0.050, 0.058, 0.070)
RISE = 0.030  # of obstacles, in heights of the picture
BEVEL = 0.012
THICKNESS = 0.006  # of the domain's paper, which lies on the paper beyond
FINE = 2  # relief vertices per pixel along each axis
MOST_ROWS = 1100  # of relief vertices
TILE = 16  # cells
BOUNCES = 2


@dataclass(frozen=True)
class Ground:
    """The surface that particles lie on.

    low, high  (2,) corners of the picture, world units
    inside     (Y, X) float32, world units: distance to the border of the domain, positive inside, as in
               `synth.elements.constraints.Domain`; None: paper everywhere
    cell       edge of its cells, world units; origin (2,): centre of its first cell
    Holes in the domain are obstacles; the area that encloses it is paper beyond the domain.
    """

    low: tuple[float, float]
    high: tuple[float, float]
    inside: np.ndarray | None = None
    cell: float = 1.0
    origin: tuple[float, float] = (0.0, 0.0)


def picture(vertices: np.ndarray, faces: np.ndarray, colours: np.ndarray, ground: Ground,
            shot: studio.Shot) -> np.ndarray:
    """Particles on their ground from above: linear light (height, width, 3).

    vertices (N, 3) float32, world units, the plane at z = 0; faces (M, 3) int; colours (N, 3) uint8, sRGB
    The height of the picture follows from the ground; the shot's height, time and camera are not used.
    """
    mi = backend.mitsuba("llvm_ad_rgb")
    low, high = np.array(ground.low, float), np.array(ground.high, float)
    height = max(1, round(shot.width * (high[1] - low[1]) / (high[0] - low[0])))
    # scaled until the picture is one unit high: lamp, bevels and shadows are the same at any scale
    scale = 1 / (high[1] - low[1])
    middle = np.array([*(low + high) / 2, 0.0])
    toward = np.array(SLANT) / np.linalg.norm(SLANT)
    glossy = {"type": "principled", "base_color": mitsuba_shapes.VERTEX_COLOUR, "roughness": 0.42, "specular": 0.45,
              "clearcoat": 0.35, "clearcoat_gloss": 0.82}
    scene: dict[str, Any] = {
        "ground": _ground(mi, ground, height, scale, middle),
        "lamp": {
            "type": "rectangle",
            "to_world": mi.ScalarTransform4f().look_at(
                origin=list(LAMP_DISTANCE * toward), target=[0, 0, 0], up=[0, 1, 0]
            ).scale([0.5 * LAMP_DISTANCE * LAMP, 0.5 * LAMP_DISTANCE * LAMP, 1]),
            "emitter": {"type": "area", "radiance": {"type": "rgb", "value": [c / LAMP**2 for c in LAMP_LIGHT]}},
        },
        "air": mitsuba_shapes.sky(AIR),
        "sensor": mitsuba_shapes.overhead(mi, 0.0, shot.width, height, shot.width / height),
    }
    if len(faces):
        scene["particles"] = mitsuba_shapes.painted(mi, "particles", (vertices - middle) * scale, faces, colours,
                                                    glossy)
    return mitsuba_shapes.rendered(mi, scene, mitsuba_shapes.every_lamp(mi, BOUNCES), shot)


def _ground(mi: Any, ground: Ground, height: int, scale: float, middle: np.ndarray) -> Any:
    """The domain's paper, the obstacles and the paper beyond, as one relief slightly larger than the picture."""
    low, high = (np.array(corner, float) for corner in (ground.low, ground.high))
    margin = 0.06 * (high[1] - low[1])
    low, high = low - margin, high + margin
    rows = min(FINE * height, MOST_ROWS) if ground.inside is not None else 2
    columns = max(2, round(rows * (high[0] - low[0]) / (high[1] - low[1])))
    x, y = np.meshgrid(np.linspace(low[0], high[0], columns), np.linspace(low[1], high[1], rows))
    distance, hole = _distances(ground, x, y)
    z, colour = relief(distance * scale, hole)
    points = np.stack([(x - middle[0]) * scale, (y - middle[1]) * scale, z], -1).reshape(-1, 3)
    used, faces = np.unique(tiled(z, colour), return_inverse=True)
    points, colour, faces = points[used], colour.reshape(-1, 3)[used], faces.reshape(-1, 3)
    return mitsuba_shapes.shape(mi, "ground", points, faces, colour, {
        "type": "diffuse", "reflectance": mitsuba_shapes.VERTEX_COLOUR})


def tiled(z: np.ndarray, colour: np.ndarray) -> np.ndarray:
    """Triangles (M, 3) of a relief with heights z (Y, X) and colours (Y, X, 3), as indices of vertices row by row.

    Two per cell, but only two per tile of TILE × TILE cells where the tile and its neighbours are level and of one
    colour, as most of the paper is: to build a tree over millions of triangles would take longer than the picture.
    """
    rows, columns = np.array(z.shape) - 1
    of_vertex = np.concatenate([z[..., None], colour], axis=-1)
    same_row = (np.diff(of_vertex, axis=0) == 0).all(axis=-1)
    same_column = (np.diff(of_vertex, axis=1) == 0).all(axis=-1)
    level = same_row[:, :-1] & same_row[:, 1:] & same_column[:-1] & same_column[1:]
    level = ndimage.minimum_filter(level, 3, mode="nearest")
    tiles = rows // TILE, columns // TILE
    flat = level[: tiles[0] * TILE, : tiles[1] * TILE].reshape(tiles[0], TILE, tiles[1], TILE).all(axis=(1, 3))
    fine = np.ones((rows, columns), bool)
    fine[: tiles[0] * TILE, : tiles[1] * TILE] = ~flat.repeat(TILE, axis=0).repeat(TILE, axis=1)
    found = []
    for (y, x), edge in ((np.nonzero(fine), 1), (np.array(np.nonzero(flat)) * TILE, TILE)):
        corner = y * (columns + 1) + x
        right, up = edge, edge * (columns + 1)
        found += [np.stack([corner, corner + right, corner + up + right], 1),
                  np.stack([corner, corner + up + right, corner + up], 1)]
    return np.concatenate(found)


def _distances(ground: Ground, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distance of points to the domain's border, positive inside; and whether the nearest area outside is a hole."""
    if ground.inside is None:
        return np.full(x.shape, np.inf), np.zeros(x.shape, bool)
    at = np.array([(y - ground.origin[1]) / ground.cell, (x - ground.origin[0]) / ground.cell])
    distance = ndimage.map_coordinates(ground.inside.astype(float), at, order=3, mode="nearest")
    # an area that touches the grid's edge encloses the domain; the others are holes in it
    padded = np.pad(ground.inside < 0, 1, mode="edge")
    parts, _ = ndimage.label(padded, np.ones((3, 3)))
    edge = np.unique(np.concatenate([parts[0], parts[-1], parts[:, 0], parts[:, -1]]))
    holes = ((parts > 0) & ~np.isin(parts, edge))[1:-1, 1:-1]
    near_hole = ndimage.distance_transform_edt(~holes) if holes.any() else np.full(holes.shape, 1e9)
    rim = (parts > 0)[1:-1, 1:-1] & ~holes
    near_rim = ndimage.distance_transform_edt(~rim) if rim.any() else np.full(holes.shape, 1e9)
    nearer = (near_hole < near_rim).astype(float)
    return distance, ndimage.map_coordinates(nearer, at, order=0, mode="nearest") > 0.5


def relief(distance: np.ndarray, hole: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Height (Y, X) and linear colour (Y, X, 3) of the ground at distances (Y, X) from the domain's border.

    Lengths in heights of the picture. Obstacles have a round edge, and the domain's paper lies on the paper beyond.
    """
    depth = np.maximum(-distance, 0)
    round_edge = np.sqrt(1 - (1 - np.clip(depth / BEVEL, 0, 1)) ** 2)
    z = np.where(hole, RISE * round_edge, -THICKNESS * np.clip(depth / 0.004, 0, 1))
    inside = (distance > 0)[..., None]
    return z, np.where(inside, PAPER, np.where(hole[..., None], OBSTACLE, BEYOND))
