"""Arrangements: exemplars of points at rest in a unit that repeats (ma13 figure 8).

    poisson_disk     stochastic (a)
    drawn            the dots of an image (b)
    jittered_grid    a grid with each point shifted at random (c)
    hexagonal_grid   regular (d)

Each returns one frame of elements of one sample; their `box` is the unit, whose lower corner is the origin. The unit
repeats toroidally, and points lie in it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from synth.elements.samples import Elements

TRIES = 30  # darts around each point before it is inactive (Bridson 2007, "k = 30")
FINE = 24  # places per spacing and axis tried at the end in 2-D; a third of it in 3-D
MOST = 20_000  # points of a unit: an exemplar is small
RADIUS = 0.32  # of a point, in spacings
INK = 0.2  # least distance of a colour from the paper's, or from another kind's, to count as different: Euclidean, sRGB
LEAST_DOT = 4  # pixels; smaller ones are specks


def poisson_disk(size: Sequence[float], spacing: float = 1.0, seed: int = 0) -> Elements:
    """Points at random, no two nearer than `spacing`, and no room for another (ma13 figure 8a).

    size     extents x, y[, z] of the unit, world units: at least 2 spacings each
    Bridson's darts around the existing points, then all free places of a fine grid.
    Raises ValueError for a unit that is too small or holds more than MOST points.
    """
    extent = _extent(size, spacing)
    rng = np.random.Generator(np.random.Philox(key=seed))
    dimensions = len(extent)
    points = rng.uniform(0, 1, (1, dimensions)) * extent
    active = [0]
    while active:
        slot = int(rng.integers(len(active)))
        darts = points[active[slot]] + _shell(rng, TRIES, dimensions) * spacing
        free = darts[_clear(darts, points, extent, spacing)] % extent
        if len(free):
            active.append(len(points))
            points = np.concatenate([points, free[:1]])
        else:
            active[slot] = active[-1]
            active.pop()
    points = _saturated(points, extent, spacing, rng)
    return _points(points, extent, np.full(len(points), RADIUS * spacing))


def _shell(rng: np.random.Generator, count: int, dimensions: int) -> np.ndarray:
    """(count, dimensions) points, uniform between the spheres of radius 1 and 2."""
    direction = rng.normal(size=(count, dimensions))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return direction * rng.uniform(1, 2**dimensions, (count, 1)) ** (1 / dimensions)


def _clear(places: np.ndarray, points: np.ndarray, extent: np.ndarray, spacing: float) -> np.ndarray:
    """Which places (M,) bool have no point within the spacing, on the torus."""
    offset = places[:, None] - points[None]
    offset -= extent * np.rint(offset / extent)
    return (offset * offset).sum(-1).min(1) >= spacing * spacing


def _saturated(points: np.ndarray, extent: np.ndarray, spacing: float, rng: np.random.Generator) -> np.ndarray:
    """The points and those for which a fine grid of places still has room, in random order."""
    per_spacing = FINE if len(extent) == 2 else FINE // 3
    counts = np.ceil(extent / spacing * per_spacing).astype(int)
    axes = [np.arange(n) / n * side for n, side in zip(counts, extent, strict=True)]
    places = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, len(extent))
    distance, _ = cKDTree(points, boxsize=extent).query(places)
    places = rng.permutation(places[distance >= spacing])
    for place in places:
        if _clear(place[None], points, extent, spacing)[0]:
            points = np.concatenate([points, place[None]])
    return points


def jittered_grid(counts: Sequence[int], spacing: float = 1.0, jitter: float = 0.25, seed: int = 0) -> Elements:
    """Points of a square or cubic grid, each moved at random within its cell (ma13 figure 8c).

    counts   points along x, y[, z], at least 3 each; the unit is counts × spacing
    spacing  of the grid, world units
    jitter   largest shift along each axis, in spacings, from 0 to 0.5; no two points are nearer than 1 - 2 jitter
    Raises ValueError for other counts or another jitter.
    """
    extent = _counted(counts, spacing)
    if not 0 <= jitter <= 0.5:
        raise ValueError(f"jitter = {jitter} is not between 0 and half a spacing")
    rng = np.random.Generator(np.random.Philox(key=seed))
    places = np.stack(np.meshgrid(*(np.arange(n) + 0.5 for n in counts), indexing="ij"), -1).reshape(-1, len(counts))
    points = (places + rng.uniform(-jitter, jitter, places.shape)) * spacing
    return _points(points, extent, np.full(len(points), RADIUS * spacing))


def hexagonal_grid(counts: Sequence[int], spacing: float = 1.0) -> Elements:
    """Points each of which has 6 neighbours at the spacing, 12 in space (ma13 figure 8d).

    counts   points in a row along x, rows along y[, layers along z], at least 3 each; rows and layers are even,
             for every other one is shifted. The unit is x, y √3/2[, z √(2/3)] spacings.
    In space the layers are those of hexagonal close packing. Raises ValueError for other counts.
    """
    _counted(counts, spacing)
    if any(n % 2 for n in counts[1:]):
        raise ValueError(f"a hexagonal grid repeats after an even number of rows and layers, not {tuple(counts)}")
    place = np.stack(np.meshgrid(*(np.arange(n) for n in counts), indexing="ij"), -1).reshape(-1, len(counts))
    odd = place[:, 1:] % 2
    x, y = place[:, 0] + 0.25 + 0.5 * odd[:, 0], (place[:, 1] + 0.5) * np.sqrt(3) / 2
    axes, extent = [x, y], [counts[0], counts[1] * np.sqrt(3) / 2]
    if len(counts) == 3:  # the second layer lies in the hollows of the first
        row = place[:, 1] + odd[:, 1] / 3
        axes = [place[:, 0] + 0.25 + 0.5 * ((odd[:, 0] + odd[:, 1]) % 2), (row + 0.25) * np.sqrt(3) / 2,
                (place[:, 2] + 0.5) * np.sqrt(2 / 3)]
        extent.append(counts[2] * np.sqrt(2 / 3))
    points = np.stack(axes, 1) * spacing
    return _points(points, np.array(extent) * spacing, np.full(len(points), RADIUS * spacing))


def drawn(picture: np.ndarray, spacing: float = 1.0) -> Elements:
    """The dots of an image (ma13 figure 8b, "manual art"): each patch of ink is a point at its centroid.

    picture  (Y, X, 3) float from 0 to 1 or uint8, sRGB, bottom row first; the paper is its median colour. It is a
             tile: a dot may cross its border. Dots do not touch.
    spacing  world units: the median distance of a dot from its nearest neighbour after scaling
    Dots of nearly the same colour are of one kind, numbered by frequency, the commonest first; a dot's size
    is the radius of a disc of its area. Raises ValueError for an image without two dots.
    """
    _spacing(spacing)
    pixels = np.asarray(picture)
    if pixels.ndim != 3 or pixels.shape[2] != 3 or min(pixels.shape[:2]) < 8:
        raise ValueError(f"a drawn pattern is a picture (Y, X, 3) of 8 pixels or more a side, not {pixels.shape}")
    colours = pixels / 255.0 if pixels.dtype == np.uint8 else pixels.astype(np.float64)
    if not np.isfinite(colours).all():
        raise ValueError("the drawn pattern has colours that are not finite")
    paper = np.median(colours.reshape(-1, 3), axis=0)
    labels, count = _patches(np.linalg.norm(colours - paper, axis=-1) > INK)
    if not 2 <= count <= MOST:
        raise ValueError(f"{count} dots are found in the drawn pattern; an exemplar has 2 to {MOST}")
    extent = np.array(labels.shape[::-1], np.float64)
    members = np.split(np.argsort(labels, axis=None, kind="stable"), np.cumsum(np.bincount(labels.ravel()))[:-1])[1:]
    points = np.array([_middle(np.stack(np.unravel_index(m, labels.shape)[::-1], 1) + 0.5, extent) for m in members])
    area = np.array([len(m) for m in members])
    colour = np.array([np.median(colours.reshape(-1, 3)[m], axis=0) for m in members])  # not its rim's
    distance, _ = cKDTree(points, boxsize=extent).query(points, k=2)
    scale = spacing / np.median(distance[:, 1])
    return _points(points * scale, extent * scale, np.sqrt(area / np.pi) * scale, kind=_kinds(colour),
                   colour=colour)


def _patches(inked: np.ndarray) -> tuple[np.ndarray, int]:
    """Connected patches of a tile: their numbers from 1 (Y, X), and how many they are; specks are left out."""
    labels, count = ndimage.label(inked)
    same = np.arange(count + 1)
    for first, last in ((labels[0], labels[-1]), (labels[:, 0], labels[:, -1])):
        for a, b in np.unique(np.stack([first, last], 1)[(first > 0) & (last > 0)], axis=0):
            same[same == same[b]] = same[a]
    labels = same[labels]
    area = np.bincount(labels.ravel(), minlength=count + 1)
    whole = area >= LEAST_DOT
    whole[0] = False
    number = np.where(whole, np.cumsum(whole), 0)
    return number[labels], int(whole.sum())


def _middle(coordinates: np.ndarray, extent: np.ndarray) -> np.ndarray:
    """The mean (2,) of the coordinates (M, 2) of a patch on a torus."""
    offset = coordinates - coordinates[0]
    return (coordinates[0] + (offset - extent * np.rint(offset / extent)).mean(0)) % extent


def _kinds(colour: np.ndarray) -> np.ndarray:
    """The kind (M,) of each of M colours: that of the first colour within INK of it."""
    inks: list[np.ndarray] = []
    kind = np.empty(len(colour), np.int64)
    for number, one in enumerate(colour):
        near = [k for k, ink in enumerate(inks) if np.linalg.norm(one - ink) <= INK]
        kind[number] = near[0] if near else len(inks)
        if not near:
            inks.append(one)
    order = np.argsort(-np.bincount(kind), kind="stable")
    return np.argsort(order, kind="stable")[kind]


def _points(points: np.ndarray, extent: np.ndarray, size: np.ndarray, **looks: Any) -> Elements:
    """One frame of points (E, D) in the unit of these extents."""
    box = np.stack([np.zeros_like(extent), extent])
    return Elements(points[None, :, None].astype(np.float32), size=size, box=box, **looks)


def _spacing(spacing: float) -> None:
    if not (np.isfinite(spacing) and spacing > 0):
        raise ValueError(f"spacing = {spacing} is not a distance above 0")


def _extent(size: Sequence[float], spacing: float) -> np.ndarray:
    """The unit's extents (D,) float64, checked."""
    _spacing(spacing)
    extent = np.asarray(size, np.float64)
    if extent.shape not in ((2,), (3,)) or not np.isfinite(extent).all():
        raise ValueError(f"the size of a unit is its 2 or 3 extents, not {size}")
    if (extent < 2 * spacing).any():
        raise ValueError(f"a unit of {' × '.join(f'{side:g}' for side in extent)} is too small for points "
                         f"{spacing:g} apart: at least 2 spacings a side")
    if np.prod(extent / spacing) > MOST:
        raise ValueError(f"points {spacing:g} apart in a unit of {np.prod(extent):g} are more than {MOST}")
    return extent


def _counted(counts: Sequence[int], spacing: float) -> np.ndarray:
    """The extents (D,) of a grid of counts × spacing, checked."""
    _spacing(spacing)
    if len(counts) not in (2, 3) or any(n < 3 for n in counts):
        raise ValueError(f"a grid has 3 points or more along each of 2 or 3 axes, not {tuple(counts)}")
    if np.prod(np.asarray(counts, np.float64)) > MOST:
        raise ValueError(f"a grid of {tuple(counts)} points is more than {MOST}")
    return np.asarray(counts, np.float64) * spacing
