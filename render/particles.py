"""Particles on a river, seen from straight above: short streaks of foam over dark water, around stones.

`riverbed` renders bed and stones once, with Mitsuba; `river` draws the particles of a frame on it. Both return linear
Rec.709 light (h, w, 3) float32, top row first, to be tone-mapped by `render.tonemap` ("filmic").
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import ndimage

from render import backend, lic, mitsuba_shapes, tonemap
from synth.noise import gradient_noise

# the stones; lengths in heights of the picture
SHOULDER = 0.12  # largest width of the rounded edge
RISE = 0.85  # height of the edge over its width
ROUGHNESS = 0.020  # height of the bumps
GRAIN = (0.13, 0.055, 0.024, 0.010)  # sizes of the bumps
STONE = np.array([0.165, 0.155, 0.145])
MOSS = np.array([0.070, 0.082, 0.040])
WATER = np.array([0.0075, 0.0210, 0.0330])
SHALLOW = np.array([0.012, 0.034, 0.036])  # added to the water beside a stone, where it is shallow
SHALLOW_WIDTH = 0.018  # distance over which that falls to 1/e
WATERLINE = 0.012  # width of a stone's wet edge
KEY = (-0.66, 0.50, 0.50)  # towards the sun: from the upper left
KEY_LIGHT = (3.4, 3.1, 2.7)
SKY_LIGHT = (0.34, 0.42, 0.55)
BOUNCES = 4

# the foam, from slow to fast in Oklab: from dark water to white
FOAM = np.array([[0.30, -0.030, -0.055], [0.50, -0.055, -0.065], [0.72, -0.055, -0.035], [0.90, -0.022, -0.012],
                 [0.985, -0.004, 0.002]])
FINE = 2  # supersampling along each axis
COVER = 0.62  # coverage of a pixel at a streak's head
FADE = 8.0  # frames over which a particle appears and vanishes
SHADE = 0.75  # strength of the stones' shadow on foam


def riverbed(distance: np.ndarray, width: int, spp: int, seed: int) -> np.ndarray:
    """Bed and stones without foam: light (h, w, 3), path-traced by Mitsuba with `spp` paths per pixel.

    distance  (Y, X) float32, cells to the boundary of the obstacles, negative inside
    """
    height = lic.height_for(distance.shape, width)
    mi = backend.mitsuba("scalar_rgb")
    aspect = distance.shape[1] / distance.shape[0]
    sun = np.array(KEY) / np.linalg.norm(KEY)
    loaded = mi.load_dict({
        "type": "scene",
        "integrator": {"type": "path", "max_depth": BOUNCES},
        "bed": _bed(mi, distance, height, seed),
        "sky": mitsuba_shapes.sky(SKY_LIGHT),
        "sun": {
            "type": "rectangle",
            "to_world": mi.ScalarTransform4f().look_at(
                origin=list(8 * sun + [0, 0.5, 0]), target=[0, 0.5, 0], up=[0, 0, 1]).scale([1.1, 1.1, 1]),
            "emitter": {"type": "area", "radiance": {"type": "rgb", "value": [13 * c for c in KEY_LIGHT]}},
        },
        "sensor": mitsuba_shapes.overhead(mi, 0.5, width, height, aspect, "independent"),
    })
    return np.array(mi.render(loaded, spp=spp, seed=seed), np.float32)


def _noise(x: np.ndarray, y: np.ndarray, size: float, seed: int) -> np.ndarray:
    """Gradient noise with features of `size` world units."""
    return gradient_noise([x / size, y / size], seed)


def relief(depth: np.ndarray, x: np.ndarray, y: np.ndarray, seed: int) -> np.ndarray:
    """Height of the stones above the water at depths (world units) inside their outline; 0 outside."""
    shoulder = min(SHOULDER, max(float(depth.max()), 1e-6))
    inside = np.clip(depth / shoulder, 0, 1)
    bumps = sum(size / GRAIN[0] * _noise(x, y, size, seed + i) for i, size in enumerate(GRAIN))
    return RISE * shoulder * np.sqrt(1 - (1 - inside) ** 2) + ROUGHNESS * np.clip(depth / 0.02, 0, 1) * bumps


def _bed(mi: Any, distance: np.ndarray, height: int, seed: int) -> Any:
    """Water and stones as one coloured relief, about one vertex per pixel, slightly larger than the picture."""
    rows, columns = distance.shape
    margin = max(2, height // 16)
    counts = height + 2 * margin + 1, round(height * columns / rows) + 2 * margin + 1
    y = (np.arange(counts[0]) - margin)[:, None] / height
    x = (np.arange(counts[1]) - margin)[None] / height - 0.5 * columns / rows
    at = np.broadcast_arrays(y * rows - 0.5, (x + 0.5 * columns / rows) * rows - 0.5)
    distance = ndimage.map_coordinates(distance, at, order=3, mode="nearest") / rows
    x, y = np.broadcast_arrays(x, y)
    depth = np.maximum(-distance, 0)
    z = relief(depth, x, y, seed)
    mottled = 0.5 + 0.9 * (_noise(x, y, 0.09, seed + 11) + 0.5 * _noise(x, y, 0.035, seed + 12))
    mossy = np.clip(1.6 * (_noise(x, y, 0.16, seed + 13) + 0.25 * _noise(x, y, 0.03, seed + 14)), 0, 1)[..., None]
    wet = np.clip(depth / WATERLINE, 0, 1)[..., None]
    stone = (STONE * (1 - mossy) + MOSS * mossy) * (0.7 + 0.5 * mottled[..., None]) * (0.42 + 0.58 * wet)
    water = WATER * (1 + 0.35 * (_noise(x, y, 0.4, seed + 15) + 0.5 * _noise(x, y, 0.17, seed + 16)))[..., None]
    water = water + SHALLOW * np.exp(-np.maximum(distance, 0) / SHALLOW_WIDTH)[..., None]
    colour = np.where(depth[..., None] > 0, stone, water)
    return _coloured(mi, np.stack([x, y, z], axis=-1), np.clip(colour, 0, 1))


def _coloured(mi: Any, points: np.ndarray, colour: np.ndarray) -> Any:
    """The Mitsuba shape of a grid of points (rows, columns, 3) with diffuse colours (rows, columns, 3)."""
    rows, columns = points.shape[:2]
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    faces = np.concatenate([np.stack([corner, corner + 1, corner + columns + 1], -1),
                            np.stack([corner, corner + columns + 1, corner + columns], -1)])
    dy, dx = np.gradient(points[..., 2], points[1, 0, 1] - points[0, 0, 1], points[0, 1, 0] - points[0, 0, 0])
    normal = np.stack([-dx, -dy, np.ones_like(dx)], -1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    diffuse = {"type": "diffuse", "reflectance": mitsuba_shapes.VERTEX_COLOUR}
    return mitsuba_shapes.shape(mi, "bed", points.reshape(-1, 3), faces, colour, {"type": "twosided", "bsdf": diffuse},
                                vertex_normals=normal)


def shown(distance: np.ndarray, width: int) -> np.ndarray:
    """Share (h, w) float32 of each pixel, top row first, that no obstacle covers; distance (Y, X) in cells."""
    height = lic.height_for(distance.shape, width)
    pixels = lic.resampled(distance, height, width)[::-1] * (height / distance.shape[0])
    return np.clip(pixels + 0.5, 0, 1).astype(np.float32)


def foam_colour(speed: np.ndarray) -> np.ndarray:
    """Linear Rec.709 (..., 3) of foam at a speed, given relative to the speed at which foam is white."""
    at = np.clip(speed, 0, 1) * (len(FOAM) - 1)
    low = np.minimum(at.astype(int), len(FOAM) - 2)
    oklab = FOAM[low] + (at - low)[..., None] * (FOAM[low + 1] - FOAM[low])
    return np.maximum(tonemap.oklab_to_linear(oklab), 0)


def river(position: np.ndarray, velocity: np.ndarray, age: np.ndarray, life: int, back: np.ndarray,
          open_water: np.ndarray, domain: tuple[float, float], streak: float, white: float) -> np.ndarray:
    """A frame: particles as streaks over the riverbed `back` (h, w, 3), visible where `open_water` (h, w) is 1.

    position  (N, 2) world units; velocity (N, 2) world units per second; age (N,) frames, out of `life`
    domain    width and height, world units, centred on x = 0, with its floor at y = 0
    streak    length of a streak, seconds
    white     speed at which foam is white, world units per second
    """
    height, width = back.shape[:2]
    scale = FINE * height / domain[1]
    head = np.stack([(position[:, 0] + 0.5 * domain[0]) * scale, (domain[1] - position[:, 1]) * scale], -1)
    displacement = velocity * np.array([1, -1]) * (streak * scale)
    length = np.linalg.norm(displacement, axis=-1)
    fade = np.clip((age + 1) / FADE, 0, 1) * np.clip((life - age) / FADE, 0, 1)
    colour = foam_colour(np.linalg.norm(velocity, axis=-1) / white)
    samples = int(np.clip(np.ceil(np.percentile(length, 99.5)) if len(length) else 1, 2, 96))
    size = (FINE * height, FINE * width)
    along = (np.arange(samples)[:, None] + 0.5) / samples
    at = (head - along[..., None] * displacement).reshape(-1, 2)
    # in proportion to the length of the streak: a still particle is a dot, not a spike
    weight = (COVER * fade * (1 - along) * np.maximum(length, 1.5) / samples).ravel()
    cover, light = _splatted(at, weight, np.tile(colour, (samples, 1)), size)
    mean_colour = light / np.maximum(cover, 1e-9)
    alpha = 1 - np.exp(-cover)
    foam = np.concatenate([mean_colour * alpha, alpha[None]]).reshape(4, height, FINE, width, FINE).mean((2, 4))
    opacity = foam[3] * open_water
    lit = 1 - SHADE * (1 - _sunlit(back, open_water))
    premultiplied = foam[:3] * open_water * lit
    return (back * (1 - opacity)[..., None] + np.moveaxis(premultiplied, 0, -1)).astype(np.float32)


def _sunlit(back: np.ndarray, open_water: np.ndarray) -> np.ndarray:
    """Share of the sun's light that falls on the water: green of the riverbed over the median of open water."""
    green = back[..., 1]
    free = green[open_water > 0.99]
    return np.clip(green / max(float(np.median(free)) if len(free) else 1.0, 1e-6), 0, 1)


def _splatted(at: np.ndarray, weight: np.ndarray, colour: np.ndarray,
              size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Sums over points `at` (P, 2), pixels, of weight, (pixels,), and of weight times colour (P, 3), (3, pixels).

    Each point is distributed bilinearly over four pixels, in the order of the points: the same bits each time.
    """
    x, y = at[:, 0] - 0.5, at[:, 1] - 0.5
    column, row = np.floor(x).astype(int), np.floor(y).astype(int)
    pixels = size[0] * size[1]
    sums = np.zeros((4, pixels))
    for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)):
        inside = np.flatnonzero((row + i >= 0) & (row + i < size[0]) & (column + j >= 0) & (column + j < size[1]))
        share = (weight * np.abs(1 - i - (y - row)) * np.abs(1 - j - (x - column)))[inside]
        place = (row[inside] + i) * size[1] + column[inside] + j
        sums[3] += np.bincount(place, share, pixels)
        for c in range(3):
            sums[c] += np.bincount(place, share * colour[inside, c], pixels)
    return sums[3], sums[:3]
