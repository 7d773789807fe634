"""Smoke as a lit slab, as ink on paper, or as a volume in a studio.

`lit` and `ink` draw a 2-D density (Y, X); `volume` path-traces a 3-D one (Z, Y, X) with Mitsuba. All take y up (row 0
is the bottom), return linear Rec.709 light (h, w, 3) float32 with the top row first, and give the same bits each
time. `render.tonemap` turns light into display values: "filmic" for `lit` and `volume`, "straight" for `ink`.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import ndimage

from render import backend, denoise, lic, march, mitsuba_shapes, smoke_slab, studio

# The lit slab. Lengths are shares of the picture's height, so that a scene looks the same at any width.
THICKNESS = 0.075  # about the size of one motif
OPTICAL_DEPTH = 7.0  # through the slab where density and relief are 1
DENSITY_POWER = 1.3  # above 1: thin smoke becomes thinner and edges look finer
BODY = 0.035  # blur radius of the plume's body
DETAIL = ((0.006, 0.2), (0.02, 0.3))  # fine and coarse: blur radius, and the largest change of the relief
DETAIL_GAIN = 3.0  # relief per small difference of density
KEY = smoke_slab.Lamp(smoke_slab.directions(125.0, 12.0, 3), slope=2.2, density=1.6)  # from the upper left, in front
RIM = smoke_slab.Lamp(smoke_slab.directions(30.0, 12.0, 2), slope=1.2, density=0.8, behind=True)  # from the right
KEY_LIGHT = np.array([1.00, 0.92, 0.82], np.float32) * 1.36  # warm
RIM_LIGHT = np.array([0.45, 0.68, 1.00], np.float32) * 1.04  # cool
SKY_LIGHT = np.array([0.42, 0.50, 0.66], np.float32) * 0.16  # from the front, everywhere
BACKDROP_CENTRE = np.array([0.034, 0.044, 0.066], np.float32)
BACKDROP_EDGE = np.array([0.009, 0.012, 0.019], np.float32)

# Ink on paper: absorbance of each ink per unit of density, in red, green and blue.
INKS = {
    "indigo": (4.40, 3.30, 1.85),
    "sepia": (1.80, 2.90, 4.40),
    "black": (3.60, 3.52, 3.40),
}
PAPER = np.array([0.965, 0.952, 0.925], np.float32)
PAPER_GRAIN = 0.012  # standard deviation of the paper's brightness, relative

# The volume.
SMOKE_ALBEDO = (0.90, 0.905, 0.915)
SMOKE_FORWARD = 0.2  # mean cosine of the scattering angle
MAX_DEPTH = 32  # bounces; 3 % of the light is left after them
MOST_DENSITY = 1e3  # delta tracking steps by the largest extinction: one cell of 1e8 would never end
STUDIO_SPP = 128  # for each light of the empty studio: it must not be noisy
BORDER_PATHS = 256  # for the light that reaches the smoke from each direction
FARTHEST = 1e3  # distance of a ray that hits nothing
MOST_SAMPLES = 2**30  # in one pass; Mitsuba runs out of memory above 2^32


def checked_density(density: np.ndarray, dimensions: int) -> np.ndarray:
    """`density` as float32; ValueError unless it has that many dimensions and is finite and not negative."""
    density = np.asarray(density, np.float32)
    if density.ndim != dimensions or min(density.shape) < 2:
        axes = "(Y, X)" if dimensions == 2 else "(Z, Y, X)"
        raise ValueError(f"expected a density {axes} of at least 2 cells each way, got {density.shape}")
    if not np.isfinite(density).all():
        raise ValueError("the density holds NaN or infinity")
    if density.min() < 0.0:
        raise ValueError(f"the density is negative: {density.min():g}")
    return density


def _blurred(values: np.ndarray, sigma: float) -> np.ndarray:
    """`values` (Y, X) under a Gaussian of `sigma` pixels; a wide one works on block averages, with the same result."""
    factor = max(1, int(sigma / 5))
    rows, columns = (-n % factor for n in values.shape)
    averages = lic.averaged(np.pad(values, ((0, rows), (0, columns)), mode="edge"), factor)
    # averaging has already blurred with a variance of (factor^2 - 1) / 12
    soft = ndimage.gaussian_filter(averages, np.sqrt(sigma**2 - (factor**2 - 1) / 12) / factor, truncate=2.5)
    height, width = values.shape
    return lic.resampled(soft, height + rows, width + columns, order=3)[:height, :width] if factor > 1 else soft


def _relief(rho: np.ndarray) -> np.ndarray:
    """Half thickness (Y, X) of the slab, 1 = full: a rounded body plus the detail of the density.

    The body makes the plume look round; the detail turns small differences of density, which opaque smoke
    would hide, into slopes that catch the light.
    """
    def blurred(radius: float) -> np.ndarray:
        return _blurred(rho, radius * rho.shape[0])

    body = np.sqrt(np.clip(blurred(BODY), 0.0, 1.0)) * np.sqrt(np.clip(rho / 0.25, 0.0, 1.0))
    detail = sum(most * np.tanh(DETAIL_GAIN / most * (rho - blurred(radius))) for radius, most in DETAIL)
    return np.clip(0.66 * body + 0.12 * rho + detail, 0.0, 1.2).astype(np.float32)


def _in_plane(rho: np.ndarray, towards: Iterable[tuple[float, float]], density: float,
              least: float) -> np.ndarray:
    """Transmittance (Y, X) through the smoke in the slab's plane, at least `least`: the plume's shadow on itself."""
    sigma = rho * np.float32(density / rho.shape[0])
    shares = np.stack([np.exp(-smoke_slab.depth_towards(sigma, d)) for d in towards])
    return np.asarray(least + (1.0 - least) * shares.mean(axis=0))


@functools.lru_cache(maxsize=4)  # the same in every frame
def _backdrop(height: int, width: int) -> np.ndarray:
    """A pool of light (height, width, 3) on a dark wall, behind the middle of the picture."""
    y, x = np.mgrid[0:height, 0:width].astype(np.float32) / height
    radius = np.hypot((x - 0.5 * width / height) / 0.75, (y - 0.5) / 0.85)
    pool = np.exp(-2.2 * radius**2)[..., None]
    return BACKDROP_EDGE + (BACKDROP_CENTRE - BACKDROP_EDGE) * pool


def lit(density: np.ndarray, width: int) -> np.ndarray:
    """A slab of smoke (Y, X) with self-shadowing before a dark backdrop: linear light (h, width, 3).

    The slab has a thickness and is drawn in layers. A warm key light comes from the front left, a cool rim
    light from behind on the right, a dim sky from the front; the smoke in the slab's plane dims each of them
    as well. The smoke casts a shadow on the backdrop.
    """
    density = checked_density(density, 2)
    height = lic.height_for(density.shape, width)
    rho = lic.resampled(density, height, width)  # linear: cubic leaves dark halos
    layer = THICKNESS * height / smoke_slab.LAYERS
    seen = smoke_slab.light(OPTICAL_DEPTH * rho**np.float32(DENSITY_POWER), _relief(rho), layer, (KEY, RIM),
                            cone=round(0.006 * height))
    key = seen.lamps[0] * _in_plane(rho, smoke_slab.directions(125.0, 20.0, 3), 6.0, 0.12)
    rim = seen.lamps[1] * _in_plane(rho, smoke_slab.directions(30.0, 20.0, 3), 9.0, 0.05)
    sky = seen.sky * _in_plane(rho, smoke_slab.directions(90.0, 60.0, 3), 2.0, 0.3)
    shadow = _blurred(smoke_slab.moved(seen.passed, -0.05 * height, 0.06 * height, 1.0), 0.03 * height)
    light = seen.passed[..., None] * _backdrop(height, width) * (0.35 + 0.65 * shadow)[..., None]
    light += key[..., None] * KEY_LIGHT + rim[..., None] * RIM_LIGHT + sky[..., None] * SKY_LIGHT
    return light[::-1].copy()


def _paper(height: int, width: int, seed: int) -> np.ndarray:
    """Paper (height, width, 3): a warm white with a faint grain of two sizes."""
    white = np.random.Generator(np.random.Philox(key=seed)).standard_normal((height, width), dtype=np.float32)
    fine, coarse = (ndimage.gaussian_filter(white, radius, mode="wrap") for radius in (0.8, 6.0))
    grain = 0.5 * (fine / fine.std() + coarse / coarse.std())
    return PAPER * (1.0 + PAPER_GRAIN * np.clip(grain, -2.0, 2.0))[..., None]


def ink(density: np.ndarray, width: int, colour: str = "indigo", seed: int = 1) -> np.ndarray:
    """Ink (Y, X) on white paper by Beer-Lambert: light (h, width, 3) = paper * exp(-density * absorbance)."""
    if colour not in INKS:
        raise ValueError(f"unknown ink {colour!r}: one of {', '.join(INKS)}")
    density = checked_density(density, 2)
    height = lic.height_for(density.shape, width)
    rho = lic.resampled(density, height, width)
    absorbed = rho[..., None] * np.array(INKS[colour], np.float32)
    return (_paper(height, width, seed) * np.exp(-absorbed))[::-1].copy()


@dataclass(frozen=True)
class VolumeSettings:
    """How `volume` renders a density; lengths in world units.

    width, height  of the picture, pixels
    spp, seed      paths per pixel, and the seed of the sampler
    extinction     per world unit at density 1
    bowl           (radius, height) of the bowl that the plume rises from; None: no bowl
    method         "path": Mitsuba's volpath; "march": `render.march`, without noise
    denoised       of "path": whether `render.denoise` is applied
    """

    width: int = 512
    height: int = 640
    spp: int = 64
    seed: int = 1
    extinction: float = 110.0
    bowl: tuple[float, float] | None = None
    camera: studio.Camera = studio.CAMERA
    method: str = "path"
    denoised: bool = True


def active_box(density: np.ndarray) -> tuple[slice, slice, slice]:
    """The smallest box (z, y, x slices) around all smoke, one empty cell wider on each side where the grid allows."""
    occupied = density > 0.0
    box = []
    for axis in range(3):
        where = np.flatnonzero(occupied.any(axis=tuple(a for a in range(3) if a != axis)))
        box.append(slice(max(where[0] - 1, 0), min(where[-1] + 2, density.shape[axis])))
    return box[0], box[1], box[2]


def volume(density: np.ndarray, voxel_size: float, origin: tuple[float, float, float],
           settings: VolumeSettings = VolumeSettings()) -> np.ndarray:
    """A picture (height, width, 3) of a density (Z, Y, X) in the studio, linear light.

    voxel_size, origin: of the grid in world units; origin (x, y, z) is the centre of cell (0, 0, 0)
    Raises ValueError where Mitsuba would give a black picture, never end or run out of memory.
    """
    density = checked_density(density, 3)
    if density.max() > MOST_DENSITY:
        raise ValueError(f"a density of {density.max():g} is too much to render (at most {MOST_DENSITY:g})")
    if settings.method == "march":
        empty = empty_studio(settings)
        return marched(density, voxel_size, origin, settings, empty).picture(empty)
    mi = backend.mitsuba("scalar_rgb")
    scene = _studio(mi, settings.bowl)
    if density.any():
        scene["smoke"] = medium(mi, density, voxel_size, origin, settings.extinction, SMOKE_ALBEDO)
    light = _photographed(mi, scene, settings)
    if not settings.denoised:
        return light
    empty = empty_studio(settings)
    return denoise.denoised(light, settings.spp, marched(density, voxel_size, origin, settings, empty), empty)


def marched(density: np.ndarray, voxel_size: float, origin: tuple[float, float, float], settings: VolumeSettings,
            empty: march.EmptyStudio) -> march.Seen:
    """A density (Z, Y, X) as of `volume`, ray-marched."""
    box = active_box(density) if density.any() else (slice(0, 2),) * 3
    corner = np.array(origin) + voxel_size * np.array([side.start for side in box[::-1]])
    grid = march.Grid(density[box] * np.float32(settings.extinction * voxel_size), voxel_size, corner)
    lamps = [march.Lamp(np.array(box.position) - 0.5 * sum(box.edges), box.edges, box.radiance)
             for box in studio.LAMPS.values()]
    return march.seen(grid, lamps, march.Medium(SMOKE_ALBEDO, SMOKE_FORWARD), empty)


def empty_studio(settings: VolumeSettings) -> march.EmptyStudio:
    """The studio of `settings` without smoke, one layer per light; cached for all frames of an animation."""
    return _empty_studio(dataclasses.replace(settings, spp=STUDIO_SPP, seed=1, extinction=1.0, method="path",
                                            denoised=False))


def alone(density: np.ndarray, voxel_size: float, origin: tuple[float, float, float],
          settings: VolumeSettings) -> np.ndarray:
    """A density (Z, Y, X) as of `volume`, path-traced under the lights of the studio without backdrop and bowl."""
    mi = backend.mitsuba("scalar_rgb")
    scene = _studio(mi, None)
    del scene["backdrop"]
    scene["smoke"] = medium(mi, checked_density(density, 3), voxel_size, origin, settings.extinction, SMOKE_ALBEDO)
    return _photographed(mi, scene, settings)


@functools.lru_cache(maxsize=2)
def _empty_studio(settings: VolumeSettings) -> march.EmptyStudio:
    mi = backend.mitsuba("scalar_rgb")
    loaded = mi.load_dict({"type": "scene"} | _studio(mi, settings.bowl))
    # four rays per pixel: edges as smooth as the picture's
    rays = settings.camera.rays(2 * settings.width, 2 * settings.height)
    unit = rays.reshape(-1, 3) / np.linalg.norm(rays.reshape(-1, 3), axis=1, keepdims=True)
    start = mi.Point3f(list(settings.camera.position))
    hits = [loaded.ray_intersect(mi.Ray3f(start, mi.Vector3f(list(ray)))) for ray in unit]
    distance = lic.averaged(np.minimum([hit.t for hit in hits], FARTHEST).reshape(rays.shape[:2]), 2)
    bowl = [list(hit.sh_frame.n) if hit.is_valid() and hit.shape.id() == "bowl" else [0.0] * 3 for hit in hits]
    normals = lic.averaged(np.array(bowl).reshape(rays.shape), 2)
    layers = [denoise.quiet_studio(_photographed(mi, _studio(mi, settings.bowl, [name]), settings), distance, normals)
              for name in (*studio.LAMPS, "sky")]
    return march.EmptyStudio(np.array(settings.camera.position), settings.camera.rays(settings.width, settings.height),
                       distance, np.array(layers), _border(mi))


def _border(mi: Any) -> np.ndarray:
    """The light (6, 4, 3) that reaches the middle of the studio from each of `march.directions`, without what
    comes straight from the lamps."""
    light = np.zeros((6, 4, 3), np.float64)
    random = np.random.Generator(np.random.Philox(key=1))
    middle = mi.Point3f(0.0, 0.5, 0.0)
    for lights, hidden in ((list(studio.LAMPS), True), (["sky"], False)):
        scene = mi.load_dict({"type": "scene"} | _studio(mi, None, lights))
        integrator = mi.load_dict({"type": "path", "max_depth": MAX_DEPTH, "hide_emitters": hidden})
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(1)
        for place in np.ndindex(6, 4):
            for spread in 0.3 * random.standard_normal((BORDER_PATHS, 3)):
                towards = march.directions()[place] + spread
                ray = mi.RayDifferential3f(middle, mi.Vector3f(list(towards / np.linalg.norm(towards))))
                light[place] += np.array(integrator.sample(scene, sampler, ray)[0]).reshape(3) / BORDER_PATHS
    return light


def _photographed(mi: Any, scene: dict[str, Any], settings: VolumeSettings) -> np.ndarray:
    """The picture (height, width, 3) float32 of `scene`, the mean of passes of at most MOST_SAMPLES samples."""
    scene = scene | {
        "type": "scene",
        # Russian roulette would act at every null collision and make fireflies: off, up to the last bounce
        "integrator": {"type": "volpath", "max_depth": MAX_DEPTH, "rr_depth": MAX_DEPTH},
        "sensor": mitsuba_shapes.sensor(mi, settings.camera, settings.width, settings.height, "independent"),
    }
    loaded = mi.load_dict(scene)
    most = max(1, MOST_SAMPLES // (settings.width * settings.height))
    light, done = np.zeros((settings.height, settings.width, 3), np.float64), 0
    while done < settings.spp:
        count = min(most, settings.spp - done)
        light += count * np.array(mi.render(loaded, spp=count, seed=settings.seed + done), np.float64)
        done += count
    return (light / settings.spp).astype(np.float32)


def medium(mi: Any, density: np.ndarray, voxel_size: float, origin: tuple[float, float, float],
           extinction: float, albedo: tuple[float, float, float]) -> dict[str, Any]:
    """The smoke as a Mitsuba shape: a box without a surface, cropped to `active_box`."""
    box = active_box(density)
    cells = np.array([s.stop - s.start for s in box[::-1]], np.float64)  # x, y, z
    low = np.array(origin) + (np.array([s.start for s in box[::-1]]) - 0.5) * voxel_size
    size = cells * voxel_size
    transform = mi.ScalarTransform4f
    grid = mi.VolumeGrid(np.ascontiguousarray(density[box][..., None]))
    return {
        "type": "cube",
        "to_world": transform().translate(list(low + 0.5 * size)).scale(list(0.5 * size)),
        "bsdf": {"type": "null"},
        "interior": {
            "type": "heterogeneous",
            "sigma_t": {"type": "gridvolume", "grid": grid, "raw": True,
                        "to_world": transform().translate(list(low)).scale(list(size))},
            "scale": extinction,
            "albedo": mitsuba_shapes.rgb(albedo),
            "phase": {"type": "hg", "g": SMOKE_FORWARD},
        },
    }


def _studio(mi: Any, bowl: tuple[float, float] | None,
            lights: Sequence[str] = (*studio.LAMPS, "sky")) -> dict[str, Any]:
    """Backdrop, bowl and lights; `sampling_weight` sends most shadow rays to key and rim."""
    def flat(name: str, mesh: studio.Mesh, colour: studio.Point) -> Any:
        return mitsuba_shapes.plain(mi, name, mesh, mitsuba_shapes.matte(colour), smooth=False)

    scene: dict[str, Any] = {"backdrop": flat("backdrop", studio.backdrop(), studio.BACKDROP_COLOUR)}
    if "sky" in lights:
        scene["sky"] = mitsuba_shapes.sky(studio.SKY) | {"sampling_weight": studio.SKY_SHARE}
    scene |= {name: mitsuba_shapes.lamp(mi, box) for name, box in studio.LAMPS.items() if name in lights}
    if bowl:
        scene["bowl"] = flat("bowl", studio.bowl(*bowl), studio.BOWL_COLOUR)
    return scene
