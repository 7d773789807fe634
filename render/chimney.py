"""Smoke that leaves a brick stack in the low sun, before a soft sky.

The smoke is path-traced with Mitsuba and denoised with the ray march of the same smoke as its guide (`render.denoise`).
The march also says what passes it, which is its matte.

World units: the domain of the smoke is 1 high, and the mouth of the stack is at the origin.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from render import backend, denoise, march, mitsuba_shapes, smoke, studio
from render.film import Photograph, developed
from synth.noise import gradient_noise

CAMERA = studio.Camera(position=(0.0, -0.12, 4.6), target=(0.16, 0.27, 0.0), fov=13.6)
EXTINCTION = 70.0  # per world unit at density 1
ALBEDO = (0.966, 0.966, 0.970)
FORWARD = 0.2
SUN = (-0.90, 0.30, 0.10)  # towards it: low, from the left
SUNLIGHT = (4.6, 3.5, 2.3)  # irradiance on a surface that faces it
ZENITH, HORIZON, GLOW = (0.06, 0.115, 0.25), (0.29, 0.27, 0.29), (0.34, 0.18, 0.08)
SOFTNESS = 12.0  # concentration of the sun's glow
DISTANT = 40.0  # of the lamp that stands for the sun in the march
WINDOW = 2.6  # of the denoiser, pixels


def sky(directions: np.ndarray) -> np.ndarray:
    """Radiance (..., 3) of the sky without the sun's disc, in directions (..., 3): paler at the horizon, and warm
    around the sun; thin veils of cloud."""
    unit = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
    up = np.clip(unit[..., 1], 0, 1)
    share = np.clip(np.exp(-5.5 * up), 0, 1)[..., None]
    towards = np.array(SUN) / np.linalg.norm(SUN)
    warm = np.exp(SOFTNESS * 0.12 * (unit @ towards - 1))[..., None] * share
    x, y = unit[..., 0] / (up + 0.16), unit[..., 2] / (up + 0.16)
    veil = sum(0.5**k * gradient_noise([x * 1.1 * 2**k + 3.3, y * 3.0 * 2**k], 21 + k) for k in range(5))
    veil = (np.clip(0.5 * veil + 0.05, 0, 1) * np.clip(up * 9, 0, 1))[..., None]
    blue = np.array(ZENITH) * (1 - share) + np.array(HORIZON) * share + np.array(GLOW) * warm
    return np.asarray(blue * (1 - 0.8 * veil) + 0.8 * veil * (0.5 * blue + np.array([0.20, 0.165, 0.15])))


def placed(shape: tuple[int, ...], left: float, mouth: float) -> tuple[float, tuple[float, float, float]]:
    """Edge of a cell, and where the centre of cell (0, 0, 0) of smoke (Z, Y, X) is, world units; the rest as below."""
    voxel = 1 / shape[1]
    return voxel, (left, 0.5 * voxel - mouth, -0.5 * (shape[0] - 1) * voxel)


def photograph(density: np.ndarray, left: float, mouth: float, shot: studio.Shot) -> Photograph:
    """A photograph of smoke.

    density  (Z, Y, X) float32 in 0..1; left, mouth: as of `synth.photo.plume`
    """
    camera = shot.camera or CAMERA
    voxel, origin = placed(density.shape, left, mouth)
    # 1. what is there without smoke
    behind = _behind(camera, shot)
    # 2. the smoke alone, and what passes it
    traced = _traced(density, voxel, origin, camera, shot)
    marched = _marched(density, voxel, origin, camera, shot)
    passed = marched[..., 3]
    guides = np.concatenate([marched, (passed[..., None] * behind)], -1)
    light = denoise.regressed(traced, guides, WINDOW) * (passed < 0.9995)[..., None]
    # 3. film
    full = passed[..., None] * behind + light
    return Photograph(developed(full, shot.seed), (1 - passed).astype(np.float32), developed(behind, shot.seed))


def _environment(mi: Any) -> dict[str, Any]:
    """Sky and sun."""
    polar, angle = np.meshgrid(np.pi * (np.arange(512) + 0.5) / 512, 2 * np.pi * (np.arange(1024) + 0.5) / 1024,
                               indexing="ij")
    # Mitsuba's environment looks along -z in the middle of its bitmap
    directions = np.stack([np.sin(polar) * np.sin(angle), np.cos(polar), -np.sin(polar) * np.cos(angle)], -1)
    light = sky(np.where(directions[..., 1:2] < 0, [0.0, 0.02, 1.0], directions)).astype(np.float32)
    light[directions[..., 1] < 0] *= np.float32(0.22)  # the ground is darker
    return {"sky": {"type": "envmap", "bitmap": mi.Bitmap(light), "sampling_weight": 0.5},
            "sun": {"type": "directional", "direction": [-c for c in SUN], "irradiance": mitsuba_shapes.rgb(SUNLIGHT)}}


def _traced(density: np.ndarray, voxel: float, origin: tuple[float, float, float], camera: studio.Camera,
            shot: studio.Shot) -> np.ndarray:
    """Light (h, w, 3) of the smoke before black."""
    mi = backend.mitsuba("scalar_rgb")
    scene = _environment(mi) | {
        "smoke": smoke.medium(mi, density, voxel, origin, EXTINCTION, ALBEDO),
        "sensor": mitsuba_shapes.sensor(mi, camera, shot.width, shot.height, "independent")}
    integrator = mi.load_dict({"type": "volpath", "max_depth": 28, "rr_depth": 28, "hide_emitters": True})
    return mitsuba_shapes.rendered(mi, scene, integrator, shot)


def _marched(density: np.ndarray, voxel: float, origin: tuple[float, float, float], camera: studio.Camera,
             shot: studio.Shot) -> np.ndarray:
    """Light of the smoke and transmittance (h, w, 4) by the march, whose sun is a distant lamp."""
    towards = np.array(SUN) / np.linalg.norm(SUN)
    level = np.cross([0.0, 1.0, 0.0], towards)
    level *= 0.02 * DISTANT / np.linalg.norm(level)
    upright = np.cross(towards, level)
    red, green, blue = np.array(SUNLIGHT) * DISTANT**2 / np.linalg.norm(np.cross(level, upright))
    corner = DISTANT * towards - 0.5 * (level + upright)
    lamp = march.Lamp(corner, (level, upright), (float(red), float(green), float(blue)))
    grid = march.Grid(density * np.float32(EXTINCTION * voxel), voxel, np.array(origin))
    looking = march.directions()
    border = np.where(looking[..., 1:2] < 0, 0.22, 1.0) * sky(np.where(looking[..., 1:2] < 0, [0, 0.02, 1], looking))
    source = march.source(grid, [lamp], np.array(camera.position), march.Medium(ALBEDO, FORWARD), border)
    rays = camera.rays(shot.width, shot.height).reshape(-1, 3)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    ends = np.column_stack([rays, np.full(len(rays), 3 * camera.distance / voxel)])
    found = march.radiance(source, density.shape, ends, grid.cells(np.array(camera.position)))
    return found.reshape(shot.height, shot.width, 4)


def _behind(camera: studio.Camera, shot: studio.Shot) -> np.ndarray:
    """Stack, works and hills before the sky: light (h, w, 3)."""
    mi = backend.mitsuba("llvm_ad_rgb")
    scene = _environment(mi) | {"sensor": mitsuba_shapes.sensor(mi, camera, shot.width, shot.height)}
    for name, (mesh, colours) in {"stack": _stack(), "works": _works(), "hills": _hills()}.items():
        bsdf = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": mitsuba_shapes.VERTEX_COLOUR}}
        scene[name] = mitsuba_shapes.shape(mi, name, mesh.vertices, mesh.faces, colours, bsdf)
    return mitsuba_shapes.rendered(mi, scene, mi.load_dict({"type": "path", "max_depth": 3}), shot)


def _bricks(around: np.ndarray, up: np.ndarray, seed: int) -> np.ndarray:
    """Colours (N, 3) of brickwork at places (N,) in courses and bricks; weathered."""
    course = np.floor(up)
    along = around + 0.5 * (course % 2)
    brick = np.floor(along)
    joint = (np.abs(up - course - 0.5) > 0.42) | (np.abs(along - brick - 0.5) > 0.46)
    tone = 0.85 + 0.35 * gradient_noise([brick * 0.73 + 0.31, course * 0.61 + 0.17], seed)
    worn = 1 + 0.5 * gradient_noise([around / 9, up / 22], seed + 1)
    red = np.array([0.36, 0.17, 0.115]) * (tone * worn)[:, None]
    return np.clip(np.where(joint[:, None], np.array([0.33, 0.29, 0.25]) * worn[:, None], red), 0.02, 1)


def _stack() -> tuple[studio.Mesh, np.ndarray]:
    """A tapered stack of bricks with a collar, sooty at its mouth, which is at y = 0."""
    y = np.linspace(-0.9, 0.0, 900)
    collar = 0.010 * ((y > -0.055) & (y < -0.012)) + 0.006 * ((y > -0.012) | ((y > -0.066) & (y < -0.05)))
    outside = np.stack([0.053 - 0.035 * y + collar, y], -1)
    inside = np.array([[0.046, 0.0], [0.044, -0.12], [0.0, -0.12]])
    mesh = studio.revolved(np.concatenate([outside, inside]), segments=720)
    x, up, z = mesh.vertices.T
    turn = np.arctan2(z, x) / (2 * np.pi)
    colours = _bricks(44 * turn, up / 0.0085, 31)
    soot = np.clip(1 + up / 0.07 + 0.5 * gradient_noise([44 * turn / 2.5, up / 0.05], 33), 0, 0.75)[:, None]
    return mesh, colours * (1 - soot) + soot * np.array([0.03, 0.028, 0.027])


def _works() -> tuple[studio.Mesh, np.ndarray]:
    """The saw-tooth roof of the works at the foot of the stack."""
    x = np.linspace(-1.3, 1.3, 2081)
    tooth = ((x + 0.07) / 0.30) % 1.0
    ridge = -0.265 + 0.085 * np.where(tooth < 0.12, tooth / 0.12, (1 - tooth) / 0.88)
    rows = np.concatenate([[-1.0], np.linspace(-0.6, 0, 120)])
    y = np.where(rows[:, None] < -0.9, -0.9, ridge[None] + 0.12 * rows[:, None])
    z = np.full(y.shape, 0.3)
    xx = np.broadcast_to(x, y.shape)
    mesh = studio.Mesh(np.stack([xx, y, z], -1).reshape(-1, 3).astype(np.float32), studio.grid_faces(*y.shape))
    return mesh, _bricks(mesh.vertices[:, 0] / 0.028, mesh.vertices[:, 1] / 0.0095, 41) * 0.7


def _hills() -> tuple[studio.Mesh, np.ndarray]:
    """Wooded hills, pale with distance."""
    x = np.linspace(-14, 14, 900)
    meshes, colours, count = [], [], 0
    faces = []
    for z, height, pale in ((-26.0, 0.55, 0.75), (-16.0, -0.05, 0.5), (-9.0, -0.35, 0.2)):
        top = height + 0.55 * gradient_noise([x / 5 + z], 51) + sum(
            0.035 * 0.6**k * (gradient_noise([x * 4 * 2**k + z], 52 + k)) for k in range(4))
        row = np.stack([np.stack([x, np.full_like(x, -6), np.full_like(x, z)], -1),
                        np.stack([x, top, np.full_like(x, z)], -1)])
        meshes.append(row.reshape(-1, 3))
        faces.append(studio.grid_faces(2, len(x)) + count)
        count += 2 * len(x)
        tone = np.array([0.06, 0.075, 0.05]) * (1 - pale) + pale * np.array([0.42, 0.43, 0.47])
        colours.append(np.broadcast_to(tone, (2 * len(x), 3)))
    mesh = studio.Mesh(np.concatenate(meshes).astype(np.float32), np.concatenate(faces).astype(np.uint32))
    return mesh, np.concatenate(colours)
