"""A volume from 2-D smoke, so that a 2-D result can be rendered as a true volume.

Carried straight through a volume by (F_x, F_y, 0), smoke keeps its pattern in every layer; only its depth is free.
With one depth for all it seems cut out of a board, and a body of revolution hides each motif behind the smoke in front
of it. Here each part is about as deep as it is wide: a filament becomes a round thread, a cloud a rounded body, and
the pattern is still visible from the front.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.ndimage import gaussian_filter

SHARPNESS = 4  # how fast a neighbourhood that is partly empty stops counting
OCCUPIED = 8.0  # even thin smoke fills its place: half full at a density of 0.09
FINEST = 0.5  # cells: the smallest neighbourhood
RELIEF = 1.2  # how far differences of density inside a body stand out of it
RIDGES = ((0.006, 0.2), (0.02, 0.3))  # their widths, world units, and the most each adds


def inflate(D: np.ndarray, reach: float = 0.06) -> np.ndarray:
    """A volume whose every layer is D, as far as the body of the smoke reaches there.

    With s(r) the occupied share of a Gaussian neighbourhood of radius r, the half depth is the integral of
    s(r)^4 over r from 0 to `reach`: a thread is 0.8 times as deep as wide whatever its width, wide smoke is
    2 reach deep, and depth thins out towards an edge. A cell is occupied as far as 1 - exp(-8 D).

    D      (Y, X) float32, density in [0, 1] on the domain, which is 1 high
    reach  world units, at least two cells
    Returns (Z, Y, X) float32 on the same voxels, Z = `layers`(Y, reach), mirror-symmetric in z.
    """
    if D.ndim != 2:
        raise ValueError(f"a density in the plane is (Y, X), not {D.shape}")
    depth = layers(D.shape[0], reach)
    D = np.asarray(D, np.float32)
    half = _half_depth(D, reach * D.shape[0])
    half = np.clip(half * _relief(D), 0, depth // 2 - 0.5)
    z = np.abs(np.arange(depth, dtype=np.float32) - (depth - 1) / 2)[:, None, None]
    inside = np.clip(0.5 * (half - z) + 0.5, 0, 1)  # the surface is two cells soft
    inside[depth // 2] = 1.0  # what is thinner than a cell is one cell thick
    inside *= D
    return inside


def layers(rows: int, reach: float) -> int:
    """How many layers `inflate` returns for `rows` cells along y: the deepest body and a margin."""
    if not 2 / rows <= reach <= 0.5:
        raise ValueError(f"the reach must lie between two cells ({2 / rows:g}) and 0.5, not at {reach}")
    return 2 * math.ceil(reach * rows + 1) + 1


def _relief(D: np.ndarray) -> np.ndarray:
    """The factor, about 1, by which dense ridges deepen a body and thin grooves flatten it.

    Without it dense smoke is one smooth body and hides the motifs in it. Densities are compared with the mean of the
    smoke around them, not with the air, so a thread of even density is unchanged.
    """
    occupied = -np.expm1(-np.float32(OCCUPIED) * D)
    factor = np.ones_like(D)
    for width, most in RIDGES:
        spread = width * D.shape[0]
        mean = gaussian_filter(D * occupied, spread, mode="nearest") / np.maximum(
            gaussian_filter(occupied, spread, mode="nearest"), 1e-6)
        factor += np.float32(RELIEF * most) * np.tanh(np.float32(3 / most) * (D - mean) * occupied)
    return factor


def _half_depth(D: np.ndarray, reach: float) -> np.ndarray:
    """Integral of s(r)^4 over r from 0 to reach, both in cells, by radii that grow by the square root of 2."""
    edges = [reach]
    while edges[-1] > FINEST:
        edges.append(edges[-1] / math.sqrt(2))
    occupied = -np.expm1(-np.float32(OCCUPIED) * D)
    half = np.zeros_like(D)
    for outer, inner in zip(edges, [*edges[1:], 0.0], strict=True):
        share = gaussian_filter(occupied, 0.5 * (outer + inner), mode="nearest", truncate=3.0)
        half += np.float32(outer - inner) * share**SHARPNESS
    return half
