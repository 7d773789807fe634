"""Meshes, cameras and lights as Mitsuba takes them, and an integrator for rooms with few lamps."""

from __future__ import annotations

from typing import Any

import numpy as np

from render import backend, studio, tonemap

BRIGHTEST = 3.0  # largest radiance that one indirect bounce may add to a path
SAMPLER = "multijitter"  # a quarter of the variance of independent samples, and less where the light is even
VERTEX_COLOUR = {"type": "mesh_attribute", "name": "vertex_color"}


def rgb(colour: studio.Point) -> dict[str, Any]:
    """A linear colour, or a radiance."""
    return {"type": "rgb", "value": list(colour)}


def shape(mi: Any, name: str, vertices: np.ndarray, faces: np.ndarray, colours: np.ndarray | None,
          bsdf: dict[str, Any], smooth: bool = True, vertex_normals: np.ndarray | None = None,
          uv: np.ndarray | None = None) -> Any:
    """A mesh with a linear colour (N, 3) at each vertex, for VERTEX_COLOUR, and smooth or flat shading.

    vertex_normals  (N, 3) for smooth shading; None: `normals`
    uv              (N, 2) where each vertex is in a bitmap, 0 at its left and lower edge; None: nowhere
    """
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(bsdf)
    made = mi.Mesh(name, len(vertices), len(faces), props=properties, has_vertex_normals=smooth,
                   has_vertex_texcoords=uv is not None)
    if colours is not None:
        made.add_attribute("vertex_color", 3, np.ascontiguousarray(colours, np.float32).ravel())
    parameters = mi.traverse(made)
    parameters["vertex_positions"] = np.ascontiguousarray(vertices, np.float32).ravel()
    parameters["faces"] = np.ascontiguousarray(faces, np.uint32).ravel()
    if uv is not None:
        # a bitmap's v grows from its upper edge
        parameters["vertex_texcoords"] = np.stack([uv[:, 0], 1 - uv[:, 1]], -1).astype(np.float32).ravel()
    parameters.update()
    if smooth:
        # Mitsuba adds up its own normals in any order: other bits in each run
        given = normals(vertices, faces) if vertex_normals is None else vertex_normals
        parameters["vertex_normals"] = np.ascontiguousarray(given, np.float32).ravel()
        parameters.update()
    return made


def painted(mi: Any, name: str, vertices: np.ndarray, faces: np.ndarray, colours: np.ndarray,
            bsdf: dict[str, Any]) -> Any:
    """The mesh of a look: vertices (N, 3), faces (M, 3), colours (N, 3) uint8, sRGB."""
    return shape(mi, name, vertices, faces, tonemap.from_srgb(colours / 255.0), bsdf)


def plain(mi: Any, name: str, mesh: studio.Mesh, bsdf: dict[str, Any], smooth: bool = True) -> Any:
    """A mesh of the studio, in one colour."""
    return shape(mi, name, mesh.vertices, mesh.faces, None, bsdf, smooth)


def matte(colour: studio.Point) -> dict[str, Any]:
    """A diffuse surface, both sides alike."""
    return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": rgb(colour)}}


def normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Unit vertex normals (N, 3) float32: means of the triangles' normals, weighted by area."""
    a, b, c = (vertices[faces[:, corner]].astype(np.float64) for corner in range(3))
    of_face = np.cross(b - a, c - a)
    total = np.stack([np.bincount(faces.ravel(), np.repeat(along, 3), len(vertices)) for along in of_face.T], 1)
    return (total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-30)).astype(np.float32)


def sensor(mi: Any, camera: studio.Camera, width: int, height: int, sampler: str = SAMPLER) -> dict[str, Any]:
    """A perspective camera."""
    return {
        "type": "perspective", "fov": camera.fov, "fov_axis": "y",
        "to_world": mi.ScalarTransform4f().look_at(
            origin=list(camera.position), target=list(camera.target), up=[0, 1, 0]),
        **film(width, height, sampler),
    }


def overhead(mi: Any, middle: float, width: int, height: int, aspect: float, sampler: str = SAMPLER,
             ) -> dict[str, Any]:
    """An orthographic camera that looks along -z at x = 0, y = `middle` and sees one unit of y, `aspect` of x."""
    transform = mi.ScalarTransform4f
    return {
        "type": "orthographic", "near_clip": 0.1, "far_clip": 10.0,
        "to_world": transform().look_at(origin=[0, middle, 5], target=[0, middle, 0], up=[0, 1, 0]).scale(
            [0.5 * aspect, 0.5 * aspect, 1]),
        **film(width, height, sampler),
    }


def film(width: int, height: int, sampler: str = SAMPLER) -> dict[str, Any]:
    """The film and the sampler of a camera; with the box filter no two pixels share a path."""
    return {
        "film": {"type": "hdrfilm", "width": width, "height": height, "pixel_format": "rgb",
                 "component_format": "float32", "rfilter": {"type": "box"}},
        "sampler": {"type": sampler},
    }


def lamp(mi: Any, box: studio.Softbox) -> dict[str, Any]:
    """A rectangular area light."""
    return {
        "type": "rectangle",
        "to_world": mi.ScalarTransform4f().look_at(
            origin=list(box.position), target=list(box.target), up=[0, 1, 0]
        ).scale([0.5 * box.size[0], 0.5 * box.size[1], 1.0]),
        "emitter": {"type": "area", "radiance": rgb(box.radiance), "sampling_weight": box.share},
    }


def sky(radiance: studio.Point) -> dict[str, Any]:
    """The same light from all directions."""
    return {"type": "constant", "radiance": rgb(radiance)}


def rendered(mi: Any, scene: dict[str, Any], integrator: Any, shot: studio.Shot) -> np.ndarray:
    """Linear light (height, width, 3) float32 of a scene, which holds the sensor."""
    light = mi.render(mi.load_dict({"type": "scene", **scene}), integrator=integrator, spp=shot.spp, seed=shot.seed)
    return np.array(light, np.float32)


def every_lamp(mi: Any, bounces: int, split: int = 1) -> Any:
    """An integrator for scenes with few lamps: at every vertex of a path, every lamp is sampled.

    bounces  indirect bounces; split: paths that continue from the first surface a camera ray hits
    A path tracer picks one lamp at random at each vertex: more noise for the same number of rays. Environment
    light (a constant emitter) is found by BSDF sampling only.
    """
    dr = backend.drjit()
    context = mi.BSDFContext()

    class EveryLamp(mi.SamplingIntegrator):
        def sample(self, scene: Any, sampler: Any, ray: Any, medium: Any = None, active: Any = True) -> Any:
            first = scene.ray_intersect(ray, active)
            light = first.emitter(scene, active).eval(first, active)
            hit = active & first.is_valid()
            bsdf = first.bsdf(ray)
            light += self.direct(scene, sampler, first, bsdf, hit)
            for _ in range(split):
                light += self.indirect(scene, sampler, first, bsdf, hit) / split
            return light, mi.Bool(True), []

        def direct(self, scene: Any, sampler: Any, surface: Any, bsdf: Any, active: Any) -> Any:
            """Light of the lamps reflected along the ray; `indirect` finds the other share of the MIS weights."""
            light = mi.Color3f(0)
            for emitter in scene.emitters():
                if emitter.is_environment():
                    continue
                sample, incoming = emitter.sample_direction(surface, sampler.next_2d(active), active)
                lit = active & (sample.pdf > 0)
                reflected, pdf = bsdf.eval_pdf(context, surface, surface.to_local(sample.d), lit)
                lit &= ~scene.ray_test(surface.spawn_ray_to(sample.p), lit)
                light += dr.select(lit, reflected * incoming * self.balance(sample.pdf, pdf), 0)
            return light

        def balance(self, pdf: Any, other: Any) -> Any:
            """The balance heuristic: MIS weight of a sample by its two densities [Veach and Guibas 1995]."""
            weight = pdf / (pdf + other)
            return dr.select(dr.isfinite(weight), weight, 0)

        def indirect(self, scene: Any, sampler: Any, surface: Any, bsdf: Any, active: Any) -> Any:
            """Light from other surfaces, and lamps hit by BSDF samples."""
            light, throughput = mi.Color3f(0), mi.Color3f(1)
            for _ in range(bounces):
                sample, weight = bsdf.sample(context, surface, sampler.next_1d(active), sampler.next_2d(active), active)
                throughput = throughput * dr.select(active, weight, 0)
                following = scene.ray_intersect(surface.spawn_ray(surface.to_world(sample.wo)), active)
                hit = active & following.is_valid()
                emitter = following.emitter(scene, active)
                pdf = emitter.pdf_direction(surface, mi.DirectionSample3f(scene, following, surface), hit)
                mis = dr.select(hit, self.balance(sample.pdf, pdf), 1)
                light += dr.select(active, throughput * emitter.eval(following, active) * mis, 0)
                surface, active = following, hit
                bsdf = surface.bsdf()
                # clamped: a highlight seen in a highlight is found by few paths and makes fireflies
                light += dr.minimum(throughput * self.direct(scene, sampler, surface, bsdf, active), BRIGHTEST)
            return light

    return EveryLamp(mi.Properties())
