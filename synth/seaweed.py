"""A bed of seaweed bent by a motion field (ma09 figure 9).

"Use that to direct the movements of points on the seaweed polygonal models":

    bed      the places of plants and the shape of each blade: once per scene
    spines   the points of every blade, bent by the field: once per frame
    ribbons  the blades as one mesh

A blade is clamped at its root and keeps its length: its direction is found step by step from the root to the tip,
from the direction at rest and the motion at the current point, which counts more towards the tip. The
motion is that of a short window of frames (a blade follows the water with a lag, the tip with the longest), so a
frame's blades depend on no other frame's blades, and can be made alone.

World units: the floor is y = 0, the domain 1 high, centred on x = z = 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from scipy.stats import qmc

from synth.field import Field
from synth.noise import gradient_noise

SAMPLES = 28  # points of a spine
ACROSS = np.array([-1.0, -0.55, 0.0, 0.55, 1.0])  # points across a ribbon, in half widths
CLEARANCE = 0.02  # least height above the floor of a tip
PATCH = 0.95  # size of the patches that plants stand in, world units
KIN = 0.7  # and of those within them where one species is more common than others
BORDER = 0.12  # free of plants along the domain's sides: a bent blade stays in the field


@dataclass(frozen=True)
class Species:
    """What the blades of a plant have in common; lengths in shares of the tallest blade's."""

    share: float  # of the plants
    blades: tuple[int, int]  # of a plant: fewest, most
    length: tuple[float, float]  # shortest, longest
    width: float  # half the blade's width over its length
    spread: float  # lean of the outer blades at rest, from upright
    ruffle: float  # of the edges, in half widths
    stiffness: float  # share of its direction that a blade keeps from one point to the next
    belly: float  # where it is broadest: 0 at the root, 1 at the tip
    colours: tuple[tuple[float, float, float], tuple[float, float, float]]  # sRGB: at the root, at the tip


SPECIES = (
    Species(0.44, (6, 11), (0.40, 0.80), 0.017, 0.30, 0.20, 0.66, 0.40, ((0.22, 0.29, 0.10), (0.66, 0.74, 0.26))),
    Species(0.26, (2, 4), (0.62, 1.00), 0.045, 0.26, 0.55, 0.74, 0.55, ((0.34, 0.26, 0.10), (0.76, 0.60, 0.20))),
    Species(0.16, (5, 8), (0.20, 0.42), 0.060, 0.75, 0.50, 0.72, 0.66, ((0.40, 0.12, 0.13), (0.84, 0.30, 0.28))),
    Species(0.14, (10, 16), (0.16, 0.34), 0.016, 0.75, 0.15, 0.60, 0.40, ((0.14, 0.28, 0.15), (0.44, 0.66, 0.36))),
)
"""Eelgrass, kelp, red dulse, turf."""


@dataclass(frozen=True)
class Bed:
    """The blades at rest: arrays of one entry for each of B blades, float64; lengths in world units.

    root (B, 3); lean (B, 3), the unit direction at rest, upright or nearly; side (B, 3), unit, across the blade at
    its root; length, half_width, ruffle, stiffness, belly, twist (radians from root to tip), phase (B,);
    colours (B, 2, 3), sRGB in [0, 1] at root and tip.
    """

    root: np.ndarray
    lean: np.ndarray
    side: np.ndarray
    length: np.ndarray
    half_width: np.ndarray
    ruffle: np.ndarray
    stiffness: np.ndarray
    belly: np.ndarray
    twist: np.ndarray
    phase: np.ndarray
    colours: np.ndarray


def bed(width: float, depth: float, height: float, spacing: float, cover: float, seed: int) -> Bed:
    """Plants in patches on a floor of width × depth world units, the longest blade `height` long.

    spacing  least distance of two plants, world units (Poisson disc)
    cover    share of the floor that patches cover, in (0, 1]
    Raises ValueError if no plant finds room.
    """
    rng = np.random.Generator(np.random.Philox(seed))  # by its seed sequence, which PoissonDisk splits
    room = np.array([width, depth]) - 2 * BORDER
    if min(room) <= 0:
        raise ValueError(f"a floor of {width:g} × {depth:g} heights has no room for plants")
    disc = qmc.PoissonDisk(2, radius=spacing / max(room), rng=rng)
    ground = disc.fill_space() * max(room)
    ground = ground[(ground < room).all(axis=1)] - room / 2
    # few plants stand where the noise is low, and they are small there: patches with an edge
    patch = gradient_noise([ground[:, 0] / PATCH + 0.37, ground[:, 1] / PATCH + 0.71], seed)
    vigour = patch - np.quantile(patch, 1 - cover) if len(patch) else patch
    ground, vigour = ground[vigour >= 0], vigour[vigour >= 0]
    if not len(ground):
        raise ValueError(f"no plant finds room on a floor of {width:g} × {depth:g} heights, {spacing:g} apart")
    grown = np.clip(0.62 + 1.3 * vigour, 0, 1)
    # plants of a species grow together, roughly
    kin = gradient_noise([ground[:, 0] / KIN + 5.2, ground[:, 1] / KIN + 9.4], seed + 1)
    kin += rng.normal(0, 0.2, len(ground))
    rank = (np.argsort(np.argsort(kin)) + 0.5) / len(kin)
    kind = np.searchsorted(np.cumsum([s.share for s in SPECIES])[:-1], rank)
    blades = [_plant(SPECIES[k], place, height * size, rng) for k, place, size in zip(kind, ground, grown, strict=True)]
    return Bed(**{name: np.concatenate([getattr(b, name) for b in blades]) for name in Bed.__dataclass_fields__})


def _plant(species: Species, place: np.ndarray, height: float, rng: np.random.Generator) -> Bed:
    """The blades of one plant, which fan out from its root."""
    n = int(rng.integers(species.blades[0], species.blades[1] + 1))
    azimuth = rng.uniform(0, 2 * np.pi) + (np.arange(n) + rng.uniform(-0.4, 0.4, n)) * 2.39996  # the golden angle
    out = np.sqrt((np.arange(n) + 0.5) / n)  # the last one leans most
    lean = species.spread * out * rng.uniform(0.6, 1.2, n)
    outward = np.stack([np.cos(azimuth), np.zeros(n), np.sin(azimuth)], 1)
    up = np.array([0.0, 1.0, 0.0])
    direction = np.cos(lean)[:, None] * up + np.sin(lean)[:, None] * outward
    angle = azimuth + np.pi / 2 + rng.normal(0, 0.5, n)
    side = np.stack([np.cos(angle), np.zeros(n), np.sin(angle)], 1)
    side -= (side * direction).sum(1, keepdims=True) * direction
    length = height * rng.uniform(*species.length, n) * (1 - 0.3 * out * rng.uniform(0, 1, n))
    root = np.array([place[0], 0.0, place[1]]) + 0.018 * out[:, None] * outward
    tone = np.exp(rng.normal(0, 0.16) + rng.normal(0, 0.12, n))[:, None, None] * np.exp(rng.normal(0, 0.06, (n, 1, 3)))
    return Bed(root, direction, side / np.linalg.norm(side, axis=1, keepdims=True), length,
               species.width * height * rng.uniform(0.8, 1.25, n), species.ruffle * rng.uniform(0.6, 1.3, n),
               np.clip(species.stiffness + rng.normal(0, 0.04, n), 0, 0.95), np.full(n, species.belly),
               rng.normal(0, 1.1, n), rng.uniform(0, 2 * np.pi, n), np.clip(np.array(species.colours) * tone, 0, 1))


def spines(plants: Bed, motion: Sequence[Field], bend: float) -> np.ndarray:
    """The points (B, SAMPLES, 3) of every blade, world units, root first.

    motion  F of the frames of the window, oldest first, the last one this frame's: 3-D, world units per second
    bend    how far a flow of one height per second bends a tip that is upright at rest: the tangent of its angle
    A tip follows the motion with a lag of half the window, a root without lag.
    """
    if not motion or any(field.dimension != 3 or not field.is_vector for field in motion):
        raise ValueError("blades are bent by 3-D motion fields, one or more")
    count = len(plants.root)
    step = plants.length[:, None] / (SAMPLES - 1)
    points = np.empty((count, SAMPLES, 3))
    points[:, 0] = plants.root
    direction = plants.lean
    # the floor, as a slope: from its root a blade may always rise to the clearance of its tip
    floor = CLEARANCE * np.linspace(0, 1, SAMPLES)
    for k in range(1, SAMPLES):
        s = (k - 0.5) / (SAMPLES - 1)
        here = points[:, k - 1] + 0.5 * step * direction
        target = plants.lean + bend * s * _felt(motion, here, s)
        target /= np.linalg.norm(target, axis=1, keepdims=True)
        # stiffness per segment: a spine of more points has the same shape
        keep = plants.stiffness[:, None] ** (24 / (SAMPLES - 1))
        direction = keep * direction + (1 - keep) * target
        direction = direction / np.linalg.norm(direction, axis=1, keepdims=True)
        direction = _above(direction, (floor[k] - points[:, k - 1, 1]) / step[:, 0])
        points[:, k] = points[:, k - 1] + step * direction
    return points


def _felt(motion: Sequence[Field], points: np.ndarray, s: float) -> np.ndarray:
    """The motion (B, 3) that acts on blades at `points`: a smooth mean over part of the window, at the tip all."""
    frames = len(motion)
    reach = 1 + s * (frames - 1)  # frames that count, back from this one
    age = (np.arange(frames)[::-1] + 0.5) / reach
    weight = np.where(age < 1, np.sin(np.pi * np.minimum(age, 1)) ** 2, 0) + 1e-9 * (np.arange(frames) == frames - 1)
    total = np.zeros_like(points)
    for share, field in zip(weight / weight.sum(), motion, strict=True):
        if share > 1e-12:
            total += share * _sampled(field, points)
    return total


def _sampled(field: Field, points: np.ndarray) -> np.ndarray:
    """The field (B, 3) at world points, linear between cells; edges repeat."""
    cells = ((points - np.array(field.origin)) / field.voxel_size).T[::-1]
    return np.stack([ndimage.map_coordinates(field.values[..., axis], cells, np.float64, 1, mode="nearest")
                     for axis in range(3)], 1)


def _above(direction: np.ndarray, least: np.ndarray) -> np.ndarray:
    """Unit directions (B, 3) raised, where need be, until their y is `least` (B,)."""
    rise = np.clip(least, -1, 0.999)
    low = direction[:, 1] < rise
    flat = direction[:, [0, 2]]
    run = np.sqrt(1 - rise**2) / np.maximum(np.linalg.norm(flat, axis=1), 1e-12)
    raised = np.stack([flat[:, 0] * run, rise, flat[:, 1] * run], 1)
    return np.where(low[:, None], raised, direction)


def ribbons(plants: Bed, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The blades as one mesh: vertices (N, 3) float32, world units; triangles (M, 3) int32; colours (N, 3) uint8, sRGB.

    points  (B, n, 3): the spines, root first; any n
    A blade is a ribbon of one layer, to be drawn from both sides: creased along its mid-rib, its edges ruffled.
    """
    count, n = points.shape[:2]
    tangent = np.diff(points, axis=1)
    tangent /= np.linalg.norm(tangent, axis=2, keepdims=True)
    tangent = np.concatenate([tangent[:, :1], tangent[:, :-1] + tangent[:, 1:], tangent[:, -1:]], axis=1)
    tangent /= np.linalg.norm(tangent, axis=2, keepdims=True)
    s = np.linspace(0, 1, n)
    across = _carried_along(plants.side, tangent)
    face = np.cross(across, tangent)
    angle = (plants.twist[:, None] * s)[..., None]
    across, face = np.cos(angle) * across + np.sin(angle) * face, np.cos(angle) * face - np.sin(angle) * across

    half = plants.half_width[:, None] * _outline(s, plants.belly[:, None])
    edge = np.abs(ACROSS)
    waves = 2 * np.pi * (1.5 + 3.0 * plants.ruffle[:, None, None]) * s[:, None] + plants.phase[:, None, None]
    ruffle = plants.ruffle[:, None, None] * np.sin(waves + 1.9 * np.sign(ACROSS)) * edge**2
    lift = 0.22 * edge + 0.8 * ruffle  # the crease, and the waves of the edges
    vertices = (points[:, :, None] + (half[..., None] * ACROSS)[..., None] * across[:, :, None]
                + (half[..., None] * lift)[..., None] * face[:, :, None])
    vertices[..., 1] = np.maximum(vertices[..., 1], 0.0)
    return vertices.reshape(-1, 3).astype(np.float32), _strips(count, n), _painted(plants, s)


def _carried_along(side: np.ndarray, tangent: np.ndarray) -> np.ndarray:
    """Unit vectors (B, n, 3) across the tangents: `side` (B, 3), with the least rotation along the blade."""
    across = np.empty_like(tangent)
    here = side
    for k in range(tangent.shape[1]):
        here = here - (here * tangent[:, k]).sum(1, keepdims=True) * tangent[:, k]
        here = here / np.linalg.norm(here, axis=1, keepdims=True)
        across[:, k] = here
    return across


def _outline(s: np.ndarray, belly: np.ndarray) -> np.ndarray:
    """Half width of a blade along s in [0, 1], 1 where it is broadest: a narrow stalk, a belly, a pointed tip."""
    rise = np.clip(s / belly, 0, 1)
    fall = np.clip((s - belly) / (1 - belly), 0, 1)
    stalk, tip = 0.16 + 0.84 * np.sin(0.5 * np.pi * rise) ** 1.3, np.sqrt(np.maximum(1 - fall**2.2, 1e-4))
    return np.where(s < belly, stalk, tip)


def _strips(count: int, n: int) -> np.ndarray:
    """Triangles (M, 3) int32 of `count` ribbons of n points along and as many as ACROSS across."""
    m = len(ACROSS)
    along, across = np.meshgrid(np.arange(n - 1), np.arange(m - 1), indexing="ij")
    corner = (along * m + across).ravel()
    quads = np.stack([corner, corner + 1, corner + m + 1, corner, corner + m + 1, corner + m], 1).reshape(-1, 3)
    return (quads[None] + (np.arange(count) * n * m)[:, None, None]).reshape(-1, 3).astype(np.int32)


def _painted(plants: Bed, s: np.ndarray) -> np.ndarray:
    """Colours (N, 3) uint8 of the vertices: from root to tip, lighter along the mid-rib, blotched."""
    root, tip = plants.colours[:, 0], plants.colours[:, 1]
    tone = root[:, None] + (tip - root)[:, None] * (s**0.8)[:, None]
    rib = 1 + 0.22 * np.exp(-((ACROSS / 0.3) ** 2)) - 0.10 * np.abs(ACROSS)
    number = np.arange(len(root), dtype=float)[:, None, None]
    blotch = 1 + 0.30 * gradient_noise([s[:, None] * 9 + 0.3, ACROSS * 1.1 + 0.2, number + 0.5], 7)
    painted = tone[:, :, None] * (rib * blotch)[..., None]
    return np.rint(np.clip(painted, 0, 1) * 255).astype(np.uint8).reshape(-1, 3)
