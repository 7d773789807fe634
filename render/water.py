"""Light under water: caustics of the sun below a wavy surface, fog with light shafts, a floor of sand.

    Water          the optical properties of the water
    caustics       the sunlight on the floor
    sun, sky       the lights; sand, floor: the floor
    through_water  the integrator: light reflected by surfaces, and the water in front of them with the sun's
                   shafts, computed per ray
    rendered       the picture of shapes under water

World units: floor at y = 0, the subject about one unit high, centred on x = z = 0.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import ndimage

from render import backend, mitsuba_shapes, studio
from synth.noise import gradient_noise

Colour = tuple[float, float, float]


@dataclass(frozen=True)
class Water:
    """The optical properties of water, in red, green and blue."""

    extinction: Colour = (0.62, 0.30, 0.27)  # per world unit
    above: Colour = (0.030, 0.235, 0.285)  # radiance of infinitely deep water, looking up
    below: Colour = (0.004, 0.055, 0.078)  # and looking down
    blend: tuple[float, float] = (0.42, 1.5)  # between them: share of `above` when looking level, and its slope
    zenith: Colour = (0.16, 0.62, 0.70)  # radiance from straight above
    ambient: Colour = (0.010, 0.060, 0.075)  # light on the second surface of a path, instead of further bounces
    shafts: float = 0.55  # contrast of the sun's shafts
    lamp: Colour = (0.0, 0.0, 0.0)  # irradiance from a diver's lamp above the camera, before the water absorbs any


FARTHEST = 40.0
LAMP_RISE = 0.35  # height of the lamp above the camera over the distance it lights: too low for visible shadows
SHAFT_BLUR = 6.0  # pixels of the caustics
SHAFT_STEPS = 2  # samples along each ray

# The sun, through the surface.
SUN = np.array([-0.34, -0.86, 0.38])  # direction in which its light travels
SUN_LIGHT = np.array([5.0, 5.2, 4.4])  # irradiance normal to its rays, coloured by the water
SUN_DISTANCE = 40.0
LIT = 11.0  # edge of the square that it lights, world units
CAUSTICS = 1024  # pixels along the square's edge
WAVES = 28
REFRACTION = 1.7  # displacement of a ray on the floor per slope of the surface, world units
BRIGHTEST = 9.0  # limit of a caustic, relative to the mean

# The sand.
SAND = np.array([0.25, 0.225, 0.175])
SAND_CELLS = (560, 620)


def caustics(time: float, seed: int) -> np.ndarray:
    """Sunlight on the floor, (CAUSTICS, CAUSTICS) float32, 1 on average; rows along z, columns along x of the
    lit square; time in seconds.

    Rays are refracted by WAVES waves, which move as deep-water waves; the light is the density of rays on the floor.
    """
    rng = np.random.Generator(np.random.Philox(key=seed))
    length = np.exp(rng.uniform(np.log(0.30), np.log(1.5), WAVES))
    heading = rng.uniform(0, 2 * np.pi, WAVES)
    phase = rng.uniform(0, 2 * np.pi, WAVES)
    k = 2 * np.pi / length
    steep = 0.020 * length**0.35  # slope of each wave
    drift = 0.55 * np.sqrt(9.8 * k) / 3
    along = ((np.arange(CAUSTICS // 2) + 0.5) / (CAUSTICS // 2) - 0.5) * LIT
    slopes = np.zeros((2, CAUSTICS // 2, CAUSTICS // 2))
    for n in range(WAVES):
        kx, kz = k[n] * np.cos(heading[n]), k[n] * np.sin(heading[n])
        # the cosine of a sum as an outer product: no cosine per point
        line, row = np.exp(1j * kx * along), steep[n] * np.exp(1j * (kz * along + phase[n] - drift[n] * time))
        slope = row.real[:, None] * line.real - row.imag[:, None] * line.imag
        slopes += np.array([np.cos(heading[n]), np.sin(heading[n])])[:, None, None] * slope
    # two rays along each edge of a pixel
    rays = 2 * CAUSTICS
    moved = ndimage.zoom(slopes, (1, 4, 4), order=1, mode="nearest", grid_mode=True) * (REFRACTION * CAUSTICS / LIT)
    pixel = (np.arange(rays) + 0.5) / 2
    columns = np.floor(pixel[None, :] + moved[0]).astype(np.int64) % CAUSTICS
    rows = np.floor(pixel[:, None] + moved[1]).astype(np.int64) % CAUSTICS
    landed = np.bincount((rows * CAUSTICS + columns).ravel(), minlength=CAUSTICS**2) / 4
    light = ndimage.gaussian_filter(landed.reshape(CAUSTICS, CAUSTICS), 1.4, mode="wrap")
    light = light / (1 + light / BRIGHTEST)  # the sun is not a point
    return (light / light.mean()).astype(np.float32)


def sun(mi: Any, sunlight: np.ndarray) -> dict[str, Any]:
    """The sun as a projector of the caustics, so far away that its rays are nearly parallel."""
    direction = SUN / np.linalg.norm(SUN)
    picture = np.ascontiguousarray(sunlight[..., None] * SUN_LIGHT, np.float32)
    return {
        "type": "projector", "fov": float(2 * np.degrees(np.arctan(0.5 * LIT / SUN_DISTANCE))),
        "to_world": mi.ScalarTransform4f().look_at(
            origin=list(-direction * SUN_DISTANCE), target=[0, 0, 0], up=[0, 0, -1]),
        "irradiance": {"type": "bitmap", "raw": True, "bitmap": mi.Bitmap(picture)},
        "scale": SUN_DISTANCE**2 / np.pi,
    }


def sky(mi: Any, water: Water) -> dict[str, Any]:
    """Environment light: bright from above, dim from below, in the water's colours."""
    share = (0.5 + 0.5 * np.cos(np.linspace(0, np.pi, 32)))[:, None, None] ** 2
    low = np.array(water.below)
    light = low + share * (np.array(water.zenith) - low)
    picture = np.ascontiguousarray(np.broadcast_to(light, (32, 64, 3)), np.float32)
    return {"type": "envmap", "bitmap": mi.Bitmap(picture)}


def floor(mi: Any) -> Any:
    """The sand as a Mitsuba shape."""
    diffuse = {"type": "diffuse", "reflectance": mitsuba_shapes.VERTEX_COLOUR}
    return mitsuba_shapes.shape(mi, "sand", *sand(), {"type": "twosided", "bsdf": diffuse})


def rendered(mi: Any, sensor: dict[str, Any], subject: dict[str, Any], look: Water, shot: studio.Shot) -> np.ndarray:
    """Shapes under water over sand: linear light (height, width, 3) float32."""
    sunlight = caustics(shot.time, shot.seed)
    scene = {"sensor": sensor, "sun": sun(mi, sunlight), "sky": sky(mi, look), "sand": floor(mi), **subject}
    return mitsuba_shapes.rendered(mi, scene, through_water(mi, sunlight, look), shot)


@functools.cache
def sand() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A floor of ripples and low mounds that reaches beyond visibility: vertices, faces, linear colours.

    Its mean height is 0; it stays below `synth.seaweed.CLEARANCE`.
    """
    columns, rows = SAND_CELLS
    # cells are smaller near the camera
    x, z = np.meshgrid(np.linspace(-6.5, 6.5, columns), 4.2 - 11.0 * np.linspace(0, 1, rows) ** 1.35)

    def noise(size: float, seed: int) -> np.ndarray:
        return gradient_noise([x / size, z / size], seed)

    ripple = np.sin(2 * np.pi * (0.94 * x + 0.35 * z + 0.28 * noise(1.3, 11)) / 0.105 + 2.2 * noise(0.4, 12))
    strength = np.clip(0.6 + 0.7 * noise(0.9, 13), 0.1, 1)
    # crests are sharper than troughs
    height = 0.0042 * strength * (ripple + 0.5 * ripple**2 - 0.25) + 0.010 * noise(0.8, 14) + 0.0012 * noise(0.03, 15)
    grain = 1 + 0.10 * noise(0.02, 16) + 0.16 * noise(0.6, 17) + 9.0 * height
    vertices = np.stack([x, height, z], -1).reshape(-1, 3).astype(np.float32)
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    faces = np.stack([corner, corner + 1, corner + columns + 1, corner, corner + columns + 1, corner + columns], 1)
    return vertices, faces.reshape(-1, 3), np.clip(SAND * grain[..., None], 0.02, 0.9).reshape(-1, 3)


def through_water(mi: Any, sunlight: np.ndarray, look: Water) -> Any:
    """The integrator: sun and sky on the first surface of a path, sun and ambient light on the second, in water.

    Every term is sampled for each ray, with less noise than a path tracer that picks sun or sky at random.
    The light of the water itself is a formula per ray; there is no scattering in it.
    """
    dr = backend.drjit()
    shafts = ndimage.gaussian_filter(sunlight, SHAFT_BLUR, mode="wrap")[::4, ::4]
    texture = mi.Texture2f(mi.TensorXf(np.ascontiguousarray(shafts[..., None])))
    extinction, above, below, ambient = (
        mi.Color3f(np.array(colour)) for colour in (look.extinction, look.above, look.below, look.ambient))
    right, upward = _across(SUN)

    class Through(mi.SamplingIntegrator):
        def sample(self, scene: Any, sampler: Any, ray: Any, medium: Any = None, active: Any = True) -> Any:
            first = scene.ray_intersect(ray, active)
            hit = active & first.is_valid()
            bsdf = first.bsdf(ray)
            light = self.sun(scene, sampler, first, bsdf, hit)
            if any(look.lamp):
                to_lamp = dr.normalize(mi.Vector3f(0, LAMP_RISE, 0) - ray.d)
                lit = mi.Color3f(np.array(look.lamp)) * dr.exp(-extinction * first.t)
                light += lit * bsdf.eval(mi.BSDFContext(), first, first.to_local(to_lamp), hit)
            sample, weight = bsdf.sample(mi.BSDFContext(), first, sampler.next_1d(hit), sampler.next_2d(hit), hit)
            second = scene.ray_intersect(first.spawn_ray(first.to_world(sample.wo)), hit)
            found = hit & second.is_valid()
            colour = second.shape.eval_attribute_3("vertex_color", second, found)
            indirect = self.sun(scene, sampler, second, second.bsdf(), found) + colour * ambient
            indirect *= dr.exp(-extinction * second.t)
            sky = scene.environment().eval(second, hit & ~found)
            light += weight * dr.select(found, indirect, sky)
            distance = dr.select(hit, first.t, FARTHEST)
            passed = dr.exp(-extinction * distance)
            water = self.water(ray.d.y) * (1 + look.shafts * (self.shaft(ray, distance, sampler) - 1))
            return dr.select(hit, light, 0) * passed + water * (1 - passed), mi.Bool(True), []

        def sun(self, scene: Any, sampler: Any, surface: Any, bsdf: Any, active: Any) -> Any:
            """Sunlight reflected along the ray."""
            sample, light = scene.emitters()[0].sample_direction(surface, sampler.next_2d(active), active)
            light &= ~scene.ray_test(surface.spawn_ray_to(sample.p), active)
            return bsdf.eval(mi.BSDFContext(), surface, surface.to_local(sample.d), active) * light

        def water(self, up: Any) -> Any:
            """Radiance of infinitely deep water in a direction with this y."""
            share = dr.clip(look.blend[0] + look.blend[1] * up, 0, 1)
            return dr.lerp(below, above, share * share * (3 - 2 * share))

        def shaft(self, ray: Any, distance: Any, sampler: Any) -> Any:
            """Sunlight in the water along a ray up to `distance`, 1 on average."""
            total = mi.Float(0)
            for step in range(SHAFT_STEPS):
                # sampled in proportion to transmittance
                share = (step + sampler.next_1d()) / SHAFT_STEPS * (1 - dr.exp(-extinction[1] * distance))
                place = ray(-dr.log(1 - share) / extinction[1])
                where = mi.Point2f(dr.dot(place, mi.Vector3f(right)), -dr.dot(place, mi.Vector3f(upward)))
                total += texture.eval(where / LIT + 0.5)[0] / SHAFT_STEPS
            return total

    return Through(mi.Properties())


def _across(direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The vectors along the columns of the sun's bitmap and against its rows: those of `look_at` with -z up."""
    direction = direction / np.linalg.norm(direction)
    left = np.cross([0.0, 0.0, -1.0], direction)
    left /= np.linalg.norm(left)
    return -left, np.cross(direction, left)
