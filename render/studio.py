"""Camera, shot and lights, and the studio of volumes: a seamless backdrop and the bowl that smoke rises from.

Everything is plain numbers and vertex/face arrays in world units (y up, floor at y = 0, the subject about one
unit high, centred on x = z = 0). `render.mitsuba_shapes` turns them into Mitsuba's scene.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Point = tuple[float, float, float]


@dataclass(frozen=True)
class Mesh:
    """vertices (N, 3) float32 in world units; faces (M, 3) uint32, counter-clockwise seen from outside."""

    vertices: np.ndarray
    faces: np.ndarray

    def moved(self, x: float, y: float, z: float) -> Mesh:
        """The mesh translated by (x, y, z)."""
        return Mesh(self.vertices + np.array([x, y, z], np.float32), self.faces)


@dataclass(frozen=True)
class Camera:
    """A perspective camera, by default a long lens at the subject's height; `fov` is vertical, in degrees."""

    position: Point = (0.0, 0.92, 6.2)
    target: Point = (0.0, 0.475, 0.0)
    fov: float = 11.4

    @property
    def distance(self) -> float:
        """From the position to the target, world units."""
        return float(np.linalg.norm(np.array(self.target) - np.array(self.position)))

    @property
    def axes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Unit vectors (3,) to the right, upwards and ahead."""
        ahead = np.array(self.target) - np.array(self.position)
        ahead /= np.linalg.norm(ahead)
        right = np.cross(ahead, [0.0, 1.0, 0.0])
        right /= np.linalg.norm(right)
        return right, np.cross(right, ahead), ahead

    def rays(self, width: int, height: int) -> np.ndarray:
        """Directions (height, width, 3), not unit vectors, through the centres of the pixels, top row first."""
        right, up, ahead = self.axes
        half = np.tan(np.radians(self.fov) / 2)
        y = half * (1.0 - 2.0 * (np.arange(height) + 0.5) / height)
        x = half * (2.0 * (np.arange(width) + 0.5) / width - 1.0) * (width / height)
        return np.asarray(ahead + x[None, :, None] * right + y[:, None, None] * up)


@dataclass(frozen=True)
class Shot:
    """How a mesh is rendered.

    width, height  of the picture, pixels
    spp, seed      paths per pixel, and the seed of the sampler
    time           seconds, for the waves of the looks under water; the others do not use it
    camera         None: the CAMERA of the look
    """

    width: int = 960
    height: int = 540
    spp: int = 64
    seed: int = 1
    time: float = 0.0
    camera: Camera | None = None

    @property
    def aspect(self) -> float:
        """Width over height."""
        return self.width / self.height


@dataclass(frozen=True)
class Softbox:
    """A rectangular light of `size` (width, height) that faces `target`.

    radiance: red, green, blue; share: sampling weight relative to the other lights
    """

    position: Point
    target: Point
    size: tuple[float, float]
    radiance: Point
    share: float

    @property
    def edges(self) -> tuple[np.ndarray, np.ndarray]:
        """Two edges (3,) as vectors: the horizontal one, and the upright one."""
        facing = np.array(self.target) - np.array(self.position)
        level = np.cross([0.0, 1.0, 0.0], facing)
        level *= self.size[0] / np.linalg.norm(level)
        upright = np.cross(facing, level)
        return level, upright * (self.size[1] / np.linalg.norm(upright))


CAMERA = Camera()
SHOT = Shot()
KEY = Softbox((-3.3, 2.4, 0.9), (0.0, 0.4, 0.0), (1.5, 1.5), (44.0, 39.0, 33.0), 1.0)  # warm, raking
RIM = Softbox((2.5, 2.0, -2.2), (0.0, 0.5, 0.0), (1.0, 1.8), (14.0, 18.0, 24.0), 1.0)  # cool, from behind
LAMPS = {"key": KEY, "rim": RIM}
SKY: Point = (0.055, 0.066, 0.085)  # radiance of the dim light from all directions
SKY_SHARE = 0.15
FILLED = 0.80  # share of the picture that `framing` and `placed` fill
BACKDROP_COLOUR: Point = (0.085, 0.092, 0.105)
BOWL_COLOUR: Point = (0.085, 0.075, 0.070)


def raised(elevation: float) -> Camera:
    """CAMERA at `elevation` degrees above the horizon of its target, at the same distance."""
    x, y, z = CAMERA.target
    angle = float(np.radians(elevation))
    position = (x, y + CAMERA.distance * float(np.sin(angle)), z + CAMERA.distance * float(np.cos(angle)))
    return Camera(position, CAMERA.target, CAMERA.fov)


def framing(low: np.ndarray, high: np.ndarray, camera: Camera, aspect: float) -> Camera:
    """The camera translated, with the same direction and lens, until a box from `low` to `high` (3,) fills
    the middle of a picture of `aspect`, width over height."""
    low, high = np.asarray(low, float), np.asarray(high, float)
    right, up, ahead = camera.axes
    corners = 0.5 * (high - low) * (np.indices((2, 2, 2)).reshape(3, -1).T * 2 - 1)
    half = FILLED * np.tan(np.radians(camera.fov) / 2)
    distance = (np.maximum(np.abs(corners @ right) / aspect, np.abs(corners @ up)) / half - corners @ ahead).max()
    middle = (low + high) / 2
    x, y, z = (float(c) for c in middle - float(distance) * ahead)
    return Camera((x, y, z), (float(middle[0]), float(middle[1]), float(middle[2])), camera.fov)


def in_studio(vertices: np.ndarray, camera: Camera, usual: Camera) -> tuple[np.ndarray, Camera, float]:
    """Vertices (N, 3) and camera, scaled until the camera sees as much as the `usual` one and translated until
    its target is above x = z = 0; and the scale. So lamps and backdrop fit subjects of any size. The floor stays
    at y = 0."""
    extent, usual_extent = (c.distance * float(np.tan(np.radians(c.fov) / 2)) for c in (camera, usual))
    scale = usual_extent / extent
    shift = np.array([camera.target[0], 0.0, camera.target[2]])
    x, y, z = (float(c) for c in (np.array(camera.position) - shift) * scale)
    moved = Camera((x, y, z), (0.0, camera.target[1] * scale, 0.0), camera.fov)
    return ((vertices - shift) * scale).astype(np.float32), moved, scale


def placed(vertices: np.ndarray, low: np.ndarray, high: np.ndarray, camera: Camera, aspect: float) -> np.ndarray:
    """Vertices (N, 3) translated and scaled so that a box from `low` to `high` (3,) fills the middle of a picture.

    aspect  width of the picture over its height
    All frames of an animation with the same box are placed identically.
    """
    low, high = np.asarray(low, float), np.asarray(high, float)
    ahead = np.array(camera.target) - np.array(camera.position)
    right = np.cross(ahead, [0.0, 1.0, 0.0])  # not `axes`, which rounds differently: pictures keep their bits
    right /= np.linalg.norm(right)
    up = np.cross(right, ahead / camera.distance)
    view = 2 * camera.distance * np.tan(np.radians(camera.fov) / 2)
    # width and height of the box as the camera sees them
    wide, tall = (float(np.abs(axis) @ (high - low)) for axis in (right, up))
    scale = FILLED * view / max(wide / aspect, tall, 1e-9)
    return ((vertices - (low + high) / 2) * scale + np.array(camera.target)).astype(np.float32)


def extruded(profile: np.ndarray, half_width: float) -> Mesh:
    """The surface of a profile (N, 2) of (z, y), extruded from x = -half_width to half_width."""
    profile = np.asarray(profile, np.float32)
    count = len(profile)
    vertices = np.empty((2, count, 3), np.float32)
    vertices[0, :, 0], vertices[1, :, 0] = -half_width, half_width
    vertices[:, :, 1], vertices[:, :, 2] = profile[:, 1], profile[:, 0]
    left = np.arange(count - 1, dtype=np.uint32)
    right = left + count
    faces = np.concatenate([np.stack([left, right, right + 1], 1), np.stack([left, right + 1, left + 1], 1)])
    return Mesh(vertices.reshape(-1, 3), faces.astype(np.uint32))


def grid_faces(rows: int, columns: int) -> np.ndarray:
    """Triangles (M, 3) uint32 of a grid of vertices that are counted row by row."""
    row, column = np.meshgrid(np.arange(rows - 1), np.arange(columns - 1), indexing="ij")
    here = (row * columns + column).ravel()
    return np.concatenate([np.stack([here, here + columns, here + 1], 1),
                           np.stack([here + 1, here + columns, here + columns + 1], 1)]).astype(np.uint32)


def revolved(profile: np.ndarray, segments: int = 192) -> Mesh:
    """The surface of revolution of a profile (N, 2) of (radius, y) around the y axis, bottom outside first."""
    profile = np.asarray(profile, np.float32)
    count = len(profile)
    angle = np.arange(segments, dtype=np.float32) * np.float32(2.0 * np.pi / segments)
    vertices = np.empty((segments, count, 3), np.float32)
    vertices[..., 0] = profile[:, 0] * np.cos(angle)[:, None]
    vertices[..., 1] = profile[:, 1]
    vertices[..., 2] = profile[:, 0] * np.sin(angle)[:, None]
    ring, point = np.meshgrid(np.arange(segments), np.arange(count - 1), indexing="ij")
    here, there = (ring * count + point).ravel(), ((ring + 1) % segments * count + point).ravel()
    faces = np.concatenate([np.stack([here, here + 1, there + 1], 1), np.stack([here, there + 1, there], 1)])
    return Mesh(vertices.reshape(-1, 3), faces.astype(np.uint32))


def _arc(centre: tuple[float, float], radii: tuple[float, float], start: float, end: float,
         count: int = 24) -> np.ndarray:
    """Points (count, 2) of an elliptic arc from `start` to `end` degrees."""
    angle = np.deg2rad(np.linspace(start, end, count))
    return np.stack([centre[0] + radii[0] * np.cos(angle), centre[1] + radii[1] * np.sin(angle)], axis=1)


def backdrop() -> Mesh:
    """A cyclorama: floor, wide curve, wall; no horizon is visible."""
    curve = _arc((-2.2, 2.4), (2.4, 2.4), 270.0, 180.0, 48)
    return extruded(np.concatenate([[(9.0, 0.0)], curve, [(-4.6, 9.0)]]), half_width=14.0)


def bowl(radius: float, height: float) -> Mesh:
    """A thick-walled stone bowl on a foot, open at the top: inner `radius` of its mouth, `height` of its rim.

    It hides the source of the smoke, where the plume would otherwise begin with a flat cut.
    """
    wall = 0.16 * radius
    outer = radius + wall
    foot = [(0.0, 0.0), (0.60 * outer, 0.0), (0.62 * outer, 0.06 * height)]
    side = _arc((0.58 * outer, height - 0.5 * wall), (0.42 * outer, 0.88 * height - 0.5 * wall), -90.0, 0.0)
    lip = _arc((radius + 0.5 * wall, height - 0.5 * wall), (0.5 * wall, 0.5 * wall), 0.0, 180.0, 13)
    inside = _arc((0.0, height - 0.5 * wall), (radius, 0.72 * height - 0.5 * wall), 0.0, -90.0, 24)
    return revolved(np.concatenate([foot, side, lip[1:], inside[1:]]))
