"""A bonfire at dusk: flames over logs in a ring of stones, before trees.

The flames are ray-marched (`render.march`): Mitsuba has no medium that emits. What is round them is path-traced with
lamps that are points drawn from the flames' own light: ground, stones and trees are lit as the fire lights them.

World units: the flames' domain is 1 high, and the ground is at y = 0.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import ndimage

from render import backend, lic, march, mitsuba_shapes, studio
from render.film import Photograph, developed
from synth import opencl
from synth.noise import gradient_noise

CAMERA = studio.Camera(position=(0.0, 0.52, 3.3), target=(0.0, 0.36, 0.0), fov=15.5)
APERTURE = 0.035  # radius of the lens: trees are out of focus
COLDEST, HOTTEST = 1000.0, 1900.0  # kelvin
WAVELENGTHS = (0.61, 0.55, 0.465)  # micrometres, of red, green, blue
SECOND_RADIATION = 14388.0  # Planck's second constant, micrometre kelvin
BRIGHTNESS = 62.0  # of the hottest soot, where it hides what is behind
SOOT = 14.0  # extinction of flames per world unit where glow is 1
LAMPS = 28  # points of light that stand for the flames
LIGHTS = 8.0  # how much more they light what is round them: a camera that shows both exposes between them
HIDES = 16.0  # how fast the matte rises with the light of flames: nearly all that is seen of them is theirs alone
FIREFLY = 1.8  # most light of a pixel, in medians of those round it
FARTHEST = 1e3
SUBPIXELS = 2  # rays per pixel along each axis
BED = 0.030  # level of the bed of embers


def black_body(heat: np.ndarray) -> np.ndarray:
    """Radiance (..., 3) of a black body, red 1 at heat 1, by Wien's approximation; heat 0..1 is COLDEST to HOTTEST."""
    kelvin = np.float32(COLDEST) + np.float32(HOTTEST - COLDEST) * heat
    made = [np.exp(np.float32(SECOND_RADIATION / wave) * (1 / np.float32(HOTTEST) - 1 / kelvin)) * np.float32(
        (WAVELENGTHS[0] / wave) ** 5 * np.exp(SECOND_RADIATION / HOTTEST * (1 / WAVELENGTHS[0] - 1 / wave)))
        for wave in WAVELENGTHS]
    return np.stack(made, -1).astype(np.float32)


def placed(shape: tuple[int, ...], ground: float) -> tuple[float, tuple[float, float, float]]:
    """Edge of a cell, and where the centre of cell (0, 0, 0) of flames (Z, Y, X) is, world units; `ground` as below."""
    voxel = 1 / shape[1]
    return voxel, (-0.5 * (shape[2] - 1) * voxel, 0.5 * voxel - ground + BED, -0.5 * (shape[0] - 1) * voxel)


def photograph(glow: np.ndarray, heat: np.ndarray, ground: float, shot: studio.Shot) -> Photograph:
    """A photograph of flames.

    glow, heat  (Z, Y, X) float32, as of `synth.photo.flames.Flames`
    ground      height of the bed of the fire, in heights of the domain
    """
    mi = backend.mitsuba("llvm_ad_rgb")
    camera = shot.camera or CAMERA
    voxel, corner = placed(glow.shape, ground)
    origin = np.array(corner)
    light = BRIGHTNESS * SOOT * glow[..., None] * black_body(heat)  # per world unit
    # 1. surroundings, lit by the flames
    scene = surroundings(mi, shot.seed) | _lamps(light, voxel, origin, shot.seed)
    scene["sensor"] = mitsuba_shapes.sensor(mi, camera, shot.width, shot.height) | {
        "type": "thinlens", "aperture_radius": APERTURE, "focus_distance": camera.distance}
    traced = mitsuba_shapes.rendered(mi, scene, mi.load_dict({"type": "path", "max_depth": 4}), shot)
    # a path that meets a lamp at close quarters leaves a lone bright pixel
    behind = np.minimum(traced, FIREFLY * ndimage.median_filter(traced, (3, 3, 1)))
    # 2. flames and embers, along more rays
    rays, hits, distance = _first_hits(mi, scene, camera, shot)
    source = np.concatenate([light * voxel, (SOOT * voxel * glow)[..., None]], -1)
    ends = np.column_stack([rays, distance / voxel])
    start = (np.array(camera.position) - origin) / voxel
    marched = march.radiance(opencl.to_device(source), glow.shape, ends, start)
    fine = (SUBPIXELS * shot.height, SUBPIXELS * shot.width)
    flame = lic.averaged(marched.reshape(*fine, 4), SUBPIXELS)
    behind = behind + lic.averaged(embers(hits, shot.seed).reshape(*fine, 3), SUBPIXELS)
    # 3. lens and film
    full = behind * flame[..., 3:] + flame[..., :3]
    seen = 1 - np.exp(-HIDES * flame[..., :3].mean(-1))
    return Photograph(developed(full, shot.seed), seen.astype(np.float32), developed(behind, shot.seed))


def _lamps(light: np.ndarray, voxel: float, origin: np.ndarray, seed: int) -> dict[str, Any]:
    """Points of light drawn from the flames' own: each gives the same share of it, in the colour of all."""
    strength = light.sum(axis=-1, dtype=np.float64).ravel()
    red, green, blue = LIGHTS * light.reshape(-1, 3).sum(axis=0, dtype=np.float64) * voxel**3 / LAMPS
    random = np.random.Generator(np.random.Philox(key=[seed, 82]))
    steps = (np.arange(LAMPS) + random.random(LAMPS)) / LAMPS
    chosen = np.searchsorted(np.cumsum(strength) / strength.sum(), steps)
    z, y, x = np.unravel_index(np.minimum(chosen, strength.size - 1), light.shape[:3])
    places = origin + voxel * np.stack([x, y, z], -1)
    return {f"lamp-{number}": {"type": "point", "position": [float(c) for c in place],
                               "intensity": mitsuba_shapes.rgb((float(red), float(green), float(blue)))}
            for number, place in enumerate(places)}


def _first_hits(mi: Any, scene: dict[str, Any], camera: studio.Camera, shot: studio.Shot,
                ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unit rays (N, 3) through the subpixels, where each meets the surroundings (N, 3), and how far away (N,)."""
    rays = camera.rays(SUBPIXELS * shot.width, SUBPIXELS * shot.height).reshape(-1, 3)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    loaded = mi.load_dict({"type": "scene", **scene})
    hit = loaded.ray_intersect(mi.Ray3f(mi.Point3f(list(camera.position)), mi.Vector3f(rays.T.astype(np.float32))))
    distance = np.minimum(np.nan_to_num(np.array(hit.t), posinf=FARTHEST), FARTHEST)
    return rays, np.array(camera.position) + distance[:, None] * rays, distance


def embers(places: np.ndarray, seed: int) -> np.ndarray:
    """Light (N, 3) of what glows at places (N, 3) on logs and in the bed between them."""
    x, y, z = places.T
    near = np.clip(1.25 - np.hypot(x, z) / 0.17, 0, 1) * np.clip(1.4 - y / 0.10, 0, 1)
    glow = np.zeros(len(places))
    inside = near > 0
    points = places[inside]
    patches = gradient_noise([*(points.T / 0.035)], seed + 5) + 0.5 * gradient_noise([*(points.T / 0.012)], seed + 6)
    glow[inside] = near[inside] * np.clip(0.45 + 1.1 * patches, 0, 1)
    return 0.25 * BRIGHTNESS * black_body(0.62 * glow) * np.clip(3 * glow, 0, 1)[:, None]


def surroundings(mi: Any, seed: int) -> dict[str, Any]:
    """Ground, logs, stones, trees and the last light of the sky."""
    random = np.random.Generator(np.random.Philox(key=[seed, 83]))
    bark = {"type": "twosided", "bsdf": {"type": "principled", "base_color": mitsuba_shapes.VERTEX_COLOUR,
                                         "roughness": 0.8, "specular": 0.25}}

    def shape(name: str, mesh: studio.Mesh, colours: np.ndarray) -> Any:
        return mitsuba_shapes.shape(mi, name, mesh.vertices, mesh.faces, colours, bark)

    made = {"ground": shape("ground", *_ground(seed))}
    for number in range(LOGS):
        made[f"log-{number}"] = shape(f"log-{number}", *_log(number, random, seed))
    for number in range(STONES):
        made[f"stone-{number}"] = shape(f"stone-{number}", *_stone(number, random, seed))
    for number in range(TREES):
        made[f"tree-{number}"] = shape(f"tree-{number}", *_tree(random, seed))
    made["sky"] = {"type": "envmap", "bitmap": mi.Bitmap(_dusk()), "scale": 1.0}
    return made


LOGS, STONES, TREES = 8, 17, 16


def _fractal(points: np.ndarray, size: float, octaves: int, seed: int) -> np.ndarray:
    """Noise (N,) at points (N, D) of octaves that fall by half."""
    return np.sum([0.5**k * gradient_noise([*(points.T * (2**k / size))], seed + k) for k in range(octaves)], axis=0)


def _ground(seed: int) -> tuple[studio.Mesh, np.ndarray]:
    """Trodden earth with litter, ash in the middle: finer where the camera is near."""
    share = np.linspace(-1, 1, 420)
    x = 2.2 * np.sign(share) * np.abs(share) ** 1.6
    z = np.concatenate([-9 + 7.6 * np.linspace(0, 1, 60)[:-1], np.linspace(-1.4, 1.9, 460)])
    zz, xx = np.meshgrid(z, x, indexing="ij")
    xx = xx * np.where(zz < -1.4, 1 + 0.7 * (-1.4 - zz), 1)
    flat = np.stack([xx.ravel(), zz.ravel()], -1)
    lumps = _fractal(flat, 0.5, 3, seed + 11)
    litter = np.abs(_fractal(flat, 0.05, 3, seed + 21))
    y = 0.02 * lumps + 0.022 * litter
    off = np.hypot(flat[:, 0], flat[:, 1])
    y = np.where(off < 0.35, y * 0.5, y)
    tone = np.clip(0.55 + 0.5 * _fractal(flat, 0.11, 4, seed + 31) + 1.2 * (litter - 0.25), 0.12, 1.3)[:, None]
    earth = tone * np.array([0.34, 0.25, 0.17])
    grass = np.clip(0.6 * _fractal(flat, 0.6, 3, seed + 41) + 0.9 * (off - 0.75), 0, 1)[:, None]
    earth = earth * (1 - grass) + grass * tone * np.array([0.16, 0.18, 0.08])
    ash = np.clip(1.3 - off / 0.3, 0, 1)[:, None]
    colours = earth * (1 - ash) + ash * tone * np.array([0.16, 0.15, 0.145])
    vertices = np.stack([flat[:, 0], y, flat[:, 1]], -1).astype(np.float32)
    return studio.Mesh(vertices, studio.grid_faces(len(z), len(x))), colours


def _log(number: int, random: np.random.Generator, seed: int) -> tuple[studio.Mesh, np.ndarray]:
    """A log that leans on the others, charred where the fire is."""
    turn = 2 * np.pi * (number + 0.30 * random.uniform(-1, 1)) / LOGS + 0.35
    radius = random.uniform(0.026, 0.042)
    outer = random.uniform(0.30, 0.40)
    foot = np.array([outer * np.cos(turn), radius + 0.012, outer * np.sin(turn)])
    turned = turn + np.pi + 0.35 * random.uniform(-1, 1)
    head = np.array([0.06 * np.cos(turned), random.uniform(0.07, 0.15), 0.06 * np.sin(turned)])
    mesh, along = _trunk(foot, head, radius, 90, 64, seed + 100 * number)
    rough = _fractal(mesh.vertices, 0.03, 3, seed + 7)
    off = np.hypot(mesh.vertices[:, 0], mesh.vertices[:, 2])
    charred = np.clip(1.6 - off / 0.17 + 0.5 * rough, 0, 1)[:, None]
    wood = np.array([0.34, 0.24, 0.16]) * (0.75 + 0.6 * rough)[:, None]
    sawn = (along < -0.5)[:, None] * np.array([0.42, 0.30, 0.17]) * (0.9 + 0.4 * rough)[:, None]
    colours = np.where(sawn > 0, sawn, wood)
    return mesh, np.clip(colours * (1 - charred) + charred * np.array([0.012, 0.011, 0.010]), 0.004, 1)


def _trunk(foot: np.ndarray, head: np.ndarray, radius: float, rows: int, columns: int,
           seed: int) -> tuple[studio.Mesh, np.ndarray]:
    """A rough cylinder with a face at each end, and where its vertices are: -1 on the faces, else 0 to 1 along it."""
    axis = head - foot
    length = float(np.linalg.norm(axis))
    axis = axis / length
    side = np.cross(axis, [0.3, 0.2, 0.93])
    side /= np.linalg.norm(side)
    other = np.cross(axis, side)
    angle = np.linspace(0, 2 * np.pi, columns)
    share = np.concatenate([[0, 0, 0], np.linspace(0, 1, rows), [1, 1, 1]])
    wide = np.concatenate([[0, 0.5, 0.97], np.ones(rows), [0.97, 0.5, 0]])
    face = np.concatenate([[-1, -1, -1], np.linspace(0, 1, rows), [-1, -1, -1]])
    round_ = np.cos(angle)[None, :, None] * side + np.sin(angle)[None, :, None] * other
    centre = foot + share[:, None] * length * axis
    points = np.broadcast_to(round_ * radius + centre[:, None], (len(share), columns, 3)).reshape(-1, 3)
    # bark runs along the trunk
    along = points @ axis
    stretched = np.concatenate([points - along[:, None] * axis, 0.25 * along[:, None]], -1)
    furrow = 1 - 0.30 * np.abs(_fractal(stretched, 0.55 * radius, 3, seed)) + 0.06 * gradient_noise(
        [*(points.T / (3 * radius))], seed + 9)
    reach = (wide[:, None] * furrow.reshape(len(share), columns))[..., None]
    vertices = round_ * radius * reach + centre[:, None]
    return (studio.Mesh(vertices.reshape(-1, 3).astype(np.float32), studio.grid_faces(len(share), columns)),
            np.repeat(face, columns))


def _stone(number: int, random: np.random.Generator, seed: int) -> tuple[studio.Mesh, np.ndarray]:
    """A field stone of the ring."""
    turn = 2 * np.pi * (number + 0.2 * random.uniform(-1, 1)) / STONES
    size = random.uniform(0.05, 0.078)
    middle = 0.46 * np.array([np.cos(turn), 0, np.sin(turn)]) + [0, 0.35 * size, 0]
    polar, angle = np.meshgrid(np.linspace(0, np.pi, 48), np.linspace(0, 2 * np.pi, 64), indexing="ij")
    unit = np.stack([np.sin(polar) * np.cos(angle), np.cos(polar), np.sin(polar) * np.sin(angle)], -1).reshape(-1, 3)
    shape = 1 + 0.35 * _fractal(unit, 1.1, 2, seed + 300 + number) + 0.12 * _fractal(unit, 0.3, 3, seed + 400 + number)
    flat = np.array([random.uniform(0.9, 1.2), random.uniform(0.6, 0.85), random.uniform(0.8, 1.1)])
    grey = random.uniform(0.25, 0.45) * (1 + 0.5 * _fractal(unit, 0.25, 4, seed + 500 + number))
    colours = np.clip(grey, 0.02, 1)[:, None] * np.array([1.0, 0.95, 0.88])
    vertices = (middle + size * flat * unit * shape[:, None]).astype(np.float32)
    return studio.Mesh(vertices, studio.grid_faces(48, 64)), colours


def _tree(random: np.random.Generator, seed: int) -> tuple[studio.Mesh, np.ndarray]:
    """A trunk in the dark behind."""
    z = -random.uniform(1.6, 6.5)
    x = random.uniform(-1, 1) * (0.75 - 0.24 * z)
    radius = random.uniform(0.05, 0.11)
    foot, head = np.array([x, -0.05, z]), np.array([x + random.uniform(-0.3, 0.3), 4.0, z])
    mesh, _ = _trunk(foot, head, radius, 200, 48, seed + 900)
    return mesh, np.full((len(mesh.vertices), 3), 1.0) * np.array([0.30, 0.24, 0.18])


def _dusk() -> np.ndarray:
    """The sky after sunset over a dark wood, an environment (256, 512, 3) float32, linear light."""
    up = np.cos(np.pi * (np.arange(256) + 0.5) / 256)[:, None]
    columns = np.arange(512)[None]
    tops = 0.12 + 0.05 * gradient_noise([columns / 9.0], 3) + 0.03 * gradient_noise([columns / 3.0], 4)
    sky = np.clip((up - tops) / 0.05, 0, 1)[..., None]
    low = np.clip(1 - up / 0.5, 0, 1)[..., None]
    blue = np.array([0.022, 0.036, 0.075]) + low**2 * np.array([0.06, 0.055, 0.06])
    return np.asarray(sky * blue + (1 - sky) * np.array([0.0012, 0.0014, 0.0018]), np.float32)
