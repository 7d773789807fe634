"""Light under water: the sun in caustics through a waving surface, fog that takes the distance away, a floor of sand.

    Water          what water looks like: how soon it takes light, which colour it has up and down
    caustics       how much sunlight falls where
    sun, sky       the lights; sand: the floor
    through_water  the integrator: what surfaces send back, and the water between them and the eye, with the sun's
                   shafts in it, reckoned for each ray

World units: floor at y = 0, what is looked at about one unit high, centred on x = z = 0.
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
    """How water looks, by red, green, blue."""

    extinction: Colour = (0.62, 0.30, 0.27)  # per world unit
    above: Colour = (0.030, 0.235, 0.285)  # what an endless depth of it looks like, upwards
    below: Colour = (0.004, 0.055, 0.078)  # and downwards
    turn: tuple[float, float] = (0.42, 1.5)  # from one to the other: share of `above` when level, and its slope
    zenith: Colour = (0.16, 0.62, 0.70)  # light from straight above
    dim: Colour = (0.010, 0.060, 0.075)  # light on what is not seen to be lit, among what is near
    shafts: float = 0.55  # contrast of the sun's shafts in it
    lamp: Colour = (0.0, 0.0, 0.0)  # irradiance from the eye's own lamp, as divers have them, where there is no water


FARTHEST = 40.0
LAMP_RISE = 0.35  # of the lamp over the eye, in distances to what it lights: too little for shadows to be seen
SHAFT_BLUR = 6.0  # pixels of the caustics
SHAFT_STEPS = 2  # places along each ray where it is asked whether a shaft passes

# The sun, through the surface.
SUN = np.array([-0.34, -0.86, 0.38])  # the way its light goes: from the left, a little from behind the bed
SUN_LIGHT = np.array([5.0, 5.2, 4.4])  # irradiance across its rays, the water's colour already in it
SUN_DISTANCE = 40.0
LIT = 11.0  # edge of the square that it lights, world units
CAUSTICS = 1024  # pixels along the square's edge
WAVES = 28
REACH = 1.7  # how far a ray lands from where it would, over the surface's slope there, world units
BRIGHTEST = 9.0  # that a caustic gets, in means

# The sand.
SAND = np.array([0.25, 0.225, 0.175])
SAND_CELLS = (560, 620)


def caustics(time: float, seed: int) -> np.ndarray:
    """How much sunlight falls where on the floor, (CAUSTICS, CAUSTICS) float32, 1 on average; rows along z, columns
    along x of the lit square.

    Rays through a surface of WAVES waves, each moving as waves in deep water do; where they crowd it is bright.
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
        # the sine of a sum, as products of a line and a row: no sine for each point
        line, row = np.exp(1j * kx * along), steep[n] * np.exp(1j * (kz * along + phase[n] - drift[n] * time))
        slope = row.real[:, None] * line.real - row.imag[:, None] * line.imag
        slopes += np.array([np.cos(heading[n]), np.sin(heading[n])])[:, None, None] * slope
    # four rays fall on each pixel's edge, and land where the slopes send them
    rays = 2 * CAUSTICS
    moved = ndimage.zoom(slopes, (1, 4, 4), order=1, mode="nearest", grid_mode=True) * (REACH * CAUSTICS / LIT)
    pixel = (np.arange(rays) + 0.5) / 2
    columns = np.floor(pixel[None, :] + moved[0]).astype(np.int64) % CAUSTICS
    rows = np.floor(pixel[:, None] + moved[1]).astype(np.int64) % CAUSTICS
    landed = np.bincount((rows * CAUSTICS + columns).ravel(), minlength=CAUSTICS**2) / 4
    light = ndimage.gaussian_filter(landed.reshape(CAUSTICS, CAUSTICS), 1.4, mode="wrap")
    light = light / (1 + light / BRIGHTEST)  # the sun is no point
    return (light / light.mean()).astype(np.float32)


def sun(mi: Any, sunlight: np.ndarray) -> dict[str, Any]:
    """The sun as a projector of the caustics, so far away that its rays are nearly parallel."""
    way = SUN / np.linalg.norm(SUN)
    picture = np.ascontiguousarray(sunlight[..., None] * SUN_LIGHT, np.float32)
    return {
        "type": "projector", "fov": float(2 * np.degrees(np.arctan(0.5 * LIT / SUN_DISTANCE))),
        "to_world": mi.ScalarTransform4f().look_at(
            origin=list(-way * SUN_DISTANCE), target=[0, 0, 0], up=[0, 0, -1]),
        "irradiance": {"type": "bitmap", "raw": True, "bitmap": mi.Bitmap(picture)},
        "scale": SUN_DISTANCE**2 / np.pi,
    }


def sky(mi: Any, water: Water) -> dict[str, Any]:
    """Light from all sides: much from above, little from below, in the water's colours."""
    share = (0.5 + 0.5 * np.cos(np.linspace(0, np.pi, 32)))[:, None, None] ** 2
    low = np.array(water.below)
    light = low + share * (np.array(water.zenith) - low)
    picture = np.ascontiguousarray(np.broadcast_to(light, (32, 64, 3)), np.float32)
    return {"type": "envmap", "bitmap": mi.Bitmap(picture)}


def floor(mi: Any) -> Any:
    """The sand, as a shape."""
    paint = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": mitsuba_shapes.VERTEX_COLOUR}}
    return mitsuba_shapes.shape(mi, "sand", *sand(), paint)


def rendered(mi: Any, sensor: dict[str, Any], subject: dict[str, Any], look: Water, shot: studio.Shot) -> np.ndarray:
    """Shapes under water over sand: linear light (height, width, 3) float32."""
    sunlight = caustics(shot.time, shot.seed)
    scene = {"sensor": sensor, "sun": sun(mi, sunlight), "sky": sky(mi, look), "sand": floor(mi), **subject}
    return mitsuba_shapes.rendered(mi, scene, through_water(mi, sunlight, look), shot)


@functools.cache
def sand() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A floor of ripples and low mounds that ends in the blue: vertices, faces, linear colours.

    Its mean height is 0, and it stays below the clearance of blades.
    """
    columns, rows = SAND_CELLS
    # close to the eye the cells are small
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
    """The integrator: sun and sky on what a ray meets, and the sun on what that sees; all of it through water.

    Two bounces of light and a guess at the rest, every one of them sampled for each ray: less noise for its rays
    than path tracing, which would draw lots between sun and sky. The water between is reckoned, not scattered in.
    """
    dr = backend.drjit()
    shafts = ndimage.gaussian_filter(sunlight, SHAFT_BLUR, mode="wrap")[::4, ::4]
    texture = mi.Texture2f(mi.TensorXf(np.ascontiguousarray(shafts[..., None])))
    extinction, above, below, dim = (
        mi.Color3f(np.array(colour)) for colour in (look.extinction, look.above, look.below, look.dim))
    right, upward = _across(SUN)

    class Through(mi.SamplingIntegrator):
        def sample(self, scene: Any, sampler: Any, ray: Any, medium: Any = None, active: Any = True) -> Any:
            first = scene.ray_intersect(ray, active)
            hit = active & first.is_valid()
            bsdf = first.bsdf(ray)
            light = self.sun(scene, sampler, first, bsdf, hit)
            if any(look.lamp):
                way = dr.normalize(mi.Vector3f(0, LAMP_RISE, 0) - ray.d)
                lit = mi.Color3f(np.array(look.lamp)) * dr.exp(-extinction * first.t)
                light += lit * bsdf.eval(mi.BSDFContext(), first, first.to_local(way), hit)
            chosen, share = bsdf.sample(mi.BSDFContext(), first, sampler.next_1d(hit), sampler.next_2d(hit), hit)
            second = scene.ray_intersect(first.spawn_ray(first.to_world(chosen.wo)), hit)
            found = hit & second.is_valid()
            colour = second.shape.eval_attribute_3("vertex_color", second, found)
            seen = self.sun(scene, sampler, second, second.bsdf(), found) + colour * dim
            seen *= dr.exp(-extinction * second.t)
            sky = scene.environment().eval(second, hit & ~found)
            light += share * dr.select(found, seen, sky)
            far = dr.select(hit, first.t, FARTHEST)
            through = dr.exp(-extinction * far)
            water = self.water(ray.d.y) * (1 + look.shafts * (self.shaft(ray, far, sampler) - 1))
            return dr.select(hit, light, 0) * through + water * (1 - through), mi.Bool(True), []

        def sun(self, scene: Any, sampler: Any, met: Any, bsdf: Any, active: Any) -> Any:
            """Its light that a surface sends back along the ray."""
            way, light = scene.emitters()[0].sample_direction(met, sampler.next_2d(active), active)
            light &= ~scene.ray_test(met.spawn_ray_to(way.p), active)
            return bsdf.eval(mi.BSDFContext(), met, met.to_local(way.d), active) * light

        def water(self, up: Any) -> Any:
            """What an endless depth of water looks like in a direction."""
            share = dr.clip(look.turn[0] + look.turn[1] * up, 0, 1)
            return dr.lerp(below, above, share * share * (3 - 2 * share))

        def shaft(self, ray: Any, far: Any, sampler: Any) -> Any:
            """How much sunlight there is in the water along a ray up to `far`, 1 on average."""
            total = mi.Float(0)
            for step in range(SHAFT_STEPS):
                # more of the light comes from near the eye than from far
                share = (step + sampler.next_1d()) / SHAFT_STEPS * (1 - dr.exp(-extinction[1] * far))
                place = ray(-dr.log(1 - share) / extinction[1])
                where = mi.Point2f(dr.dot(place, mi.Vector3f(right)), -dr.dot(place, mi.Vector3f(upward)))
                total += texture.eval(where / LIT + 0.5)[0] / SHAFT_STEPS
            return total

    return Through(mi.Properties())


def _across(way: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The directions in which columns of the sun's picture go and rows come back: `look_at`'s, with -z up."""
    way = way / np.linalg.norm(way)
    left = np.cross([0.0, 0.0, -1.0], way)
    left /= np.linalg.norm(left)
    return -left, np.cross(way, left)
