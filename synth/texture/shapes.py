"""Surfaces by procedure, and fields on any surface.

World units: a surface stands on y = 0, is about one unit high or wide, and its axis is x = z = 0.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import PchipInterpolator

from synth.texture.mesh import Mesh, dot, length, mesh

PROFILE = np.array([
    (0.185, 0.000), (0.196, 0.012), (0.176, 0.036), (0.168, 0.060), (0.196, 0.130), (0.262, 0.250), (0.316, 0.385),
    (0.335, 0.500), (0.316, 0.612), (0.258, 0.712), (0.185, 0.790), (0.138, 0.850), (0.126, 0.900), (0.146, 0.945),
    (0.180, 0.966), (0.202, 0.984), (0.206, 1.004), (0.194, 1.020), (0.174, 1.018), (0.158, 1.000), (0.146, 0.972),
    (0.126, 0.935), (0.110, 0.895), (0.120, 0.850), (0.160, 0.790)])
"""Of the vase, radius and height: foot, belly, shoulder, neck, lip, and down its inside."""
RING, TUBE = 0.35, 0.15
"""Radii of the torus."""
LOST = 1e-6
"""Of a field's length: a tangent part of no more is none."""


def vase(edge: float) -> Mesh:
    """A vase, open at its foot, with edges of about `edge`, world units."""
    along = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(PROFILE, axis=0).T))])
    curve = PchipInterpolator(along, PROFILE, axis=0)
    fine = curve(np.linspace(0, along[-1], 4096))
    way = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(fine, axis=0).T))])
    even = np.linspace(0, way[-1], max(round(way[-1] / edge), 8) + 1)
    profile = np.stack([np.interp(even, way, fine[:, k]) for k in range(2)], axis=-1)
    return _revolved(profile, max(round(2 * np.pi * float(PROFILE[:, 0].max()) / edge), 8), closed=False)


def torus(edge: float) -> Mesh:
    """A torus that lies on y = 0, with edges of about `edge`, world units."""
    angle = np.linspace(0, 2 * np.pi, max(round(2 * np.pi * TUBE / edge), 8), endpoint=False)
    profile = np.stack([RING + TUBE * np.cos(angle), TUBE + TUBE * np.sin(angle)], axis=-1)
    return _revolved(profile, max(round(2 * np.pi * (RING + TUBE) / edge), 8), closed=True)


def _revolved(profile: np.ndarray, segments: int, closed: bool) -> Mesh:
    """A profile (N, 2), radius and height, turned about the axis; upwards it shows its outside. `closed`: its last
    point is joined with its first. Every second row is turned by half a segment, so that triangles are even."""
    count = len(profile)
    half = np.arange(count) % 2 / 2 if not closed or count % 2 == 0 else np.zeros(count)
    angle = 2 * np.pi * (np.arange(segments)[:, None] + half) / segments
    vertices = np.stack([profile[:, 0] * np.cos(angle), np.broadcast_to(profile[:, 1], angle.shape),
                         -profile[:, 0] * np.sin(angle)], axis=-1)
    ring, row = (a.ravel() for a in np.mgrid[:segments, :count if closed else count - 1])
    after, above = (ring + 1) % segments, (row + 1) % count
    here, right, up, far = ring * count + row, after * count + row, ring * count + above, after * count + above
    # the diagonal that is the shorter one
    shifted = (half[row] > 0)[:, None]
    one = np.where(shifted, np.stack([here, right, far], -1), np.stack([here, right, up], -1))
    other = np.where(shifted, np.stack([here, far, up], -1), np.stack([right, far, up], -1))
    return mesh(vertices.reshape(-1, 3), np.concatenate([one, other]))


def around(of: Mesh, axis: np.ndarray, rise: float) -> np.ndarray:
    """The field (V, 3) of a screw about an axis (3,) through the middle of a mesh's box: in a turn it rises along the
    axis by 2π `rise` longest sides of the box."""
    low, high = of.vertices.min(axis=0), of.vertices.max(axis=0)
    axis = np.asarray(axis, np.float64) / length(np.asarray(axis, np.float64))
    return np.asarray(np.cross(axis, of.vertices - (low + high) / 2) + rise * float((high - low).max()) * axis)


def tangent(of: Mesh, field: np.ndarray) -> np.ndarray:
    """The part of a field (V, 3) that is tangent to a surface.

    Raises ValueError: as many vectors as vertices, finite, and somewhere a tangent part that is not zero are needed.
    """
    if field.shape != of.vertices.shape:
        raise ValueError(f"has {len(field)} vectors for {len(of.vertices)} vertices")
    if not np.isfinite(field).all():
        raise ValueError("holds NaN or infinity")
    size = float(length(field).max())
    if not size:
        raise ValueError("is zero everywhere")
    along = field - dot(field, of.normals)[:, None] * of.normals
    along[length(along) <= LOST * size] = 0
    if not along.any():
        raise ValueError("is normal to the surface everywhere")
    return np.asarray(along)


def paced(field: np.ndarray, least: float, most: float) -> np.ndarray:
    """A field (V, 3) scaled so that its greatest length is `most`, and lengthened to `least` where it is shorter, but
    not where it is zero."""
    size = length(field)
    speed = np.where(size > 0, np.maximum(size * (most / float(size.max())), least), 0)
    return np.asarray(field * (speed / np.where(size > 0, size, 1))[:, None])
