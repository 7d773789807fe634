"""Meshes, cameras and lamps as Mitsuba takes them, for the pictures of surfaces."""

from __future__ import annotations

from typing import Any

import numpy as np

from render import studio

SAMPLER = "multijitter"  # a quarter of the variance of independent paths, and less on what is lit evenly


def shape(mi: Any, name: str, vertices: np.ndarray, faces: np.ndarray, colours: np.ndarray,
          bsdf: dict[str, Any]) -> Any:
    """A Mitsuba mesh with smooth normals and a colour (N, 3), linear, at each vertex."""
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(bsdf)
    made = mi.Mesh(name, len(vertices), len(faces), props=properties, has_vertex_normals=True)
    made.add_attribute("vertex_color", 3, np.ascontiguousarray(colours, np.float32).ravel())
    parameters = mi.traverse(made)
    parameters["vertex_positions"] = np.ascontiguousarray(vertices, np.float32).ravel()
    parameters["faces"] = np.ascontiguousarray(faces, np.uint32).ravel()
    parameters.update()
    # Mitsuba's own are summed in any order: other bits in each run
    parameters["vertex_normals"] = normals(vertices, faces).ravel()
    parameters.update()
    return made


def plain(mi: Any, name: str, mesh: studio.Mesh, bsdf: dict[str, Any]) -> Any:
    """A mesh of the studio, in one colour."""
    return shape(mi, name, mesh.vertices, mesh.faces, np.ones((len(mesh.vertices), 3)), bsdf)


def normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Unit normals (N, 3) float32 of the vertices: of the triangles round each, by their area."""
    a, b, c = (vertices[faces[:, corner]].astype(np.float64) for corner in range(3))
    of_face = np.cross(b - a, c - a)
    total = np.stack([np.bincount(faces.ravel(), np.repeat(along, 3), len(vertices)) for along in of_face.T], 1)
    return (total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-30)).astype(np.float32)


def sensor(mi: Any, camera: studio.Camera, width: int, height: int, sampler: str = SAMPLER) -> dict[str, Any]:
    """The camera, a long lens."""
    return {
        "type": "perspective", "fov": camera.fov, "fov_axis": "y",
        "to_world": mi.ScalarTransform4f().look_at(
            origin=list(camera.position), target=list(camera.target), up=[0, 1, 0]),
        **film(width, height, sampler),
    }


def film(width: int, height: int, sampler: str = SAMPLER) -> dict[str, Any]:
    """What a camera holds: a film with the box filter, so that pixels share no paths, and a sampler of paths."""
    return {
        "film": {"type": "hdrfilm", "width": width, "height": height, "pixel_format": "rgb",
                 "component_format": "float32", "rfilter": {"type": "box"}},
        "sampler": {"type": sampler},
    }


def lamp(mi: Any, box: studio.Softbox) -> dict[str, Any]:
    """A soft light."""
    return {
        "type": "rectangle",
        "to_world": mi.ScalarTransform4f().look_at(
            origin=list(box.position), target=list(box.target), up=[0, 1, 0]
        ).scale([0.5 * box.size[0], 0.5 * box.size[1], 1.0]),
        "emitter": {"type": "area", "radiance": {"type": "rgb", "value": list(box.radiance)},
                    "sampling_weight": box.share},
    }
