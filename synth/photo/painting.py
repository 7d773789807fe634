"""A landscape in oils by program: a waterfall between autumn trees, painted in layers of brush strokes.

First the scene is laid out in flat colours, with the direction in which a brush follows each form. Then it is painted:
strokes from large to small [Hertzmann 1998], each in one colour of the scene under it [Haeberli 1990], where the canvas
differs from the scene by more than a layer tolerates; and the ridges of paint catch the light [Hertzmann 2002].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from synth.photo.tiles import noise, rng, smooth_step

LAYERS = ((1 / 14, 0.0, 0.8), (1 / 28, 0.035, 0.75), (1 / 55, 0.05, 0.8), (1 / 110, 0.07, 0.9))
"""Width of the strokes in heights of the picture, the difference from which they are set, how opaque they are."""
LENGTH = 4.2  # of a stroke, in widths
SPACING = 0.42  # of strokes, in widths
JITTER = (0.035, 0.05)  # of a stroke's colour: of its brightness, and between warm and cold
RELIEF = 0.32  # how strongly ridges of paint catch the light
GROUND = (0.46, 0.31, 0.20)  # of the canvas: burnt sienna


@dataclass(frozen=True, eq=False)
class Painting:
    """A painting, row 0 the lowest, display-encoded.

    picture     (Y, X, 3) float32 in 0..1
    matte       (Y, X) float32 in 0..1: the water
    """

    picture: np.ndarray
    matte: np.ndarray


@dataclass(eq=False)
class Layout:
    """What shall be painted: colours (Y, X, 3) float32, and the angle (Y, X) of the brush, radians from x."""

    colour: np.ndarray
    angle: np.ndarray

    def lay(self, where: np.ndarray, colour: np.ndarray, angle: np.ndarray | float) -> None:
        """A form over what is there; `where` (Y, X) in 0..1 is its soft mask."""
        self.colour = self.colour * (1 - where[..., None]) + where[..., None] * colour
        self.angle = np.where(where > 0.5, angle, self.angle)


def painting(seed: int, shape: tuple[int, int]) -> Painting:
    """A painting of `shape` (Y, X) pixels."""
    layout, matte = landscape(seed, shape)
    return Painting(painted(layout, seed), matte)


def painted(layout: Layout, seed: int) -> np.ndarray:
    """The layout as a painting (Y, X, 3) float32 in 0..1."""
    shape = layout.angle.shape
    canvas = np.broadcast_to(np.array(GROUND, np.float32), (*shape, 3)).copy()
    relief = np.zeros(shape, np.float32)
    for number, (share, tolerance, opacity) in enumerate(LAYERS):
        random = rng(seed, 91, number)
        width = max(share * shape[0], 2.0)
        wanted = ndimage.gaussian_filter(layout.colour, (0.3 * width, 0.3 * width, 0))
        for place in _places(canvas, wanted, width, tolerance, random):
            _stroke(canvas, relief, place, wanted, layout.angle, width, opacity, random)
    return _lit(canvas, relief, seed)


def _places(canvas: np.ndarray, wanted: np.ndarray, width: float, tolerance: float,
            random: np.random.Generator) -> np.ndarray:
    """Where a layer sets its strokes (N, 2), y and x, in random order: on a jittered lattice where the canvas is
    off."""
    step = SPACING * width
    rows, columns = (max(1, round(n / step)) for n in canvas.shape[:2])
    lattice = np.stack(np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij"), -1).reshape(-1, 2)
    places = (lattice + random.random(lattice.shape)) * np.array(canvas.shape[:2]) / [rows, columns]
    off = ndimage.gaussian_filter(np.abs(canvas - wanted).mean(axis=2), 0.35 * width)
    at = np.minimum(places.astype(int), np.array(canvas.shape[:2]) - 1)
    places = places[off[at[:, 0], at[:, 1]] >= tolerance]
    return places[random.permutation(len(places))]


def _stroke(canvas: np.ndarray, relief: np.ndarray, place: np.ndarray, wanted: np.ndarray, angles: np.ndarray,
            width: float, opacity: float, random: np.random.Generator) -> None:
    """One stroke of a bristle brush in one colour, bent as the form bends, onto canvas and relief."""
    y, x = place
    shape = angles.shape
    row, column = min(int(y), shape[0] - 1), min(int(x), shape[1] - 1)
    half = 0.5 * LENGTH * width * random.uniform(0.7, 1.2)
    angle = angles[row, column] + random.normal(0, 0.10)
    ahead = angles[int(np.clip(y + 0.7 * half * np.sin(angle), 0, shape[0] - 1)),
                   int(np.clip(x + 0.7 * half * np.cos(angle), 0, shape[1] - 1))]
    bend = np.clip(0.5 * np.sin(2 * (ahead - angle)), -0.5, 0.5) / half + random.normal(0, 0.06) / half
    tone, warmth = random.normal(0, JITTER[0]), random.normal(0, JITTER[1])
    colour = np.clip(wanted[row, column] * (1 + tone) * (1 + warmth * np.array([1.0, 0.1, -1.0])), 0, 1)
    # the patch of canvas under it, along and across the stroke
    reach = int(half + width) + 2
    top, left = max(row - reach, 0), max(column - reach, 0)
    patch = slice(top, min(row + reach + 1, shape[0])), slice(left, min(column + reach + 1, shape[1]))
    dy = np.arange(patch[0].start, patch[0].stop, dtype=np.float32)[:, None] - np.float32(y)
    dx = np.arange(patch[1].start, patch[1].stop, dtype=np.float32)[None] - np.float32(x)
    along = (np.cos(angle) * dx + np.sin(angle) * dy) / np.float32(half)
    across = np.cos(angle) * dy - np.sin(angle) * dx
    across = (across - np.float32(bend * half * half) * along**2) / np.float32(0.5 * width)
    bristles = _BRISTLES.take(np.clip((across * 0.5 + 0.5) * 63, 0, 63).astype(int)
                              + 64 * random.integers(0, 64), mode="wrap")
    ends = 1 - np.abs(along) - 0.22 * bristles * (along > 0)
    cover = np.clip(4 * ends, 0, 1) * np.clip(3.5 * (1 - across**2), 0, 1)
    alpha = (opacity * cover * np.clip(1.15 - 0.5 * bristles * np.clip(0.5 + along, 0, 1), 0, 1))[..., None]
    canvas[patch] += alpha * (colour.astype(np.float32) - canvas[patch])
    body = (0.55 - 0.45 * bristles + 0.5 * across**4) * np.float32(min(width, 14.0) ** 0.7)
    relief[patch] += cover * (body - relief[patch])


def _bristles() -> np.ndarray:
    """How dry the bristles of 64 brushes are: rows of 64, 0..1."""
    rows = noise((64, 64), rng(92), (5, 1), falloff=0.4, finest=1.5)
    return np.clip(0.5 + 0.35 * rows, 0, 1).ravel().astype(np.float32)


_BRISTLES = _bristles()


def _lit(canvas: np.ndarray, relief: np.ndarray, seed: int) -> np.ndarray:
    """The paint in light from the upper left, on the weave of the canvas: (Y, X, 3) float32 in 0..1."""
    y, x = np.mgrid[: relief.shape[0], : relief.shape[1]]
    weave = 0.12 * (np.sin(x * 2.1) * np.sin(y * 2.1)) + 0.08 * noise(relief.shape, rng(seed, 93), 3, falloff=0.0)
    height = ndimage.gaussian_filter(relief, 0.7) + weave
    slope = np.gradient(height)
    shade = np.clip(1 + RELIEF * 0.25 * (slope[1] - slope[0]), 0.75, 1.3)
    return np.clip(canvas * shade[..., None] + 0.05 * np.maximum(shade - 1.08, 0)[..., None], 0, 1).astype(np.float32)


def landscape(seed: int, shape: tuple[int, int]) -> tuple[Layout, np.ndarray]:
    """A waterfall between autumn trees below mountains, at evening: its layout, and the matte of its water (Y, X)."""
    random = rng(seed, 94)
    rows, columns = shape
    y = np.broadcast_to((np.arange(rows, dtype=np.float32)[:, None] + 0.5) / rows, shape)
    x = np.broadcast_to((np.arange(columns, dtype=np.float32)[None] + 0.5) / rows, shape)
    wide = columns / rows
    soft = 2.0 / rows

    def mixed(*stops: tuple[float, tuple[float, float, float]], by: np.ndarray) -> np.ndarray:
        places = [stop for stop, _ in stops]
        return np.stack([np.interp(by, places, [colour[c] for _, colour in stops]) for c in range(3)], -1)

    def texture(size: float | tuple[float, float], falloff: float = 1.0) -> np.ndarray:
        scaled = size * rows if isinstance(size, float) else (size[0] * rows, size[1] * rows)
        return noise(shape, random, scaled, falloff=falloff)

    def below(edge: np.ndarray) -> np.ndarray:
        return smooth_step(-soft, soft, np.broadcast_to(edge, shape) - y)

    def crest(level: float, roughness: float, size: float, falloff: float = 1.0) -> np.ndarray:
        line = noise((4, 2 * columns), random, (size * rows, 4), falloff=falloff, finest=1)[0][:columns]
        return level + roughness * line[None]

    # 1. sky: from blue above to gold at the horizon, clouds lit from below
    sky = mixed((0.45, (0.98, 0.83, 0.52)), (0.62, (0.95, 0.72, 0.50)), (0.78, (0.62, 0.62, 0.68)),
                (1.0, (0.27, 0.42, 0.62)), by=y + 0.02 * texture(0.3))
    layout = Layout(sky.astype(np.float32), 0.25 + 0.5 * texture(0.4, 1.6))
    bank = texture((0.55, 0.16), 0.9) + 1.6 * (y - 0.72)
    clouds = smooth_step(0.05, 0.9, bank)
    under = np.clip(0.5 + 0.6 * np.gradient(ndimage.gaussian_filter(bank, 0.008 * rows))[0] * rows * 0.06, 0, 1)
    layout.lay(0.85 * clouds, mixed((0.0, (0.56, 0.45, 0.50)), (0.5, (0.86, 0.64, 0.50)), (1.0, (1.0, 0.90, 0.70)),
                                    by=under), 0.3 + 0.7 * texture(0.3, 1.5))
    sun = np.exp(-((x - 0.30 * wide) ** 2 + (y - 0.60) ** 2) / 0.05)
    layout.colour = layout.colour + (1 - layout.colour) * 0.55 * sun[..., None] * np.array([1.0, 0.88, 0.55])
    # 2. mountains, the farther the bluer
    for level, rough, colour, light in ((0.60, 0.075, (0.40, 0.44, 0.60), (0.66, 0.58, 0.64)),
                                        (0.52, 0.06, (0.27, 0.34, 0.50), (0.52, 0.46, 0.52))):
        edge = crest(level, rough, 0.45)
        facets = texture((0.06, 0.14), 0.7) + 0.8 * texture(0.3, 1.2)
        haze = np.clip((edge - y) / 0.22, 0, 1)
        shade = np.clip(0.5 + 0.45 * facets, 0, 1)
        tones = mixed((0.35, colour), (0.85, light), by=shade) * (1 - 0.35 * haze[..., None]) + 0.35 * haze[
            ..., None] * np.array([0.86, 0.72, 0.58])
        layout.lay(below(edge), tones, -0.9 + 0.3 * np.sign(facets))
    # 3. the wood on the slopes, in the colours of autumn
    valley = 0.5 * wide + 0.05
    banks = 0.42 + 0.30 * np.abs((x - valley) / wide) ** 1.2
    for depth, lift in enumerate((0.045, 0.0, -0.06)):
        edge = banks + lift + crest(0.0, 0.018, 0.05, 0.4)
        foliage = texture(0.045, 0.5) + 0.5 * texture(0.2, 1.0) + 2.2 * (0.5 * wide - np.abs(x - 0.32 * wide)) * 0.4
        dim = (0.95, 0.8, 0.62)[depth]
        tones = dim * mixed((-1.5, (0.13, 0.16, 0.13)), (-0.5, (0.30, 0.26, 0.13)), (0.2, (0.62, 0.33, 0.12)),
                            (0.9, (0.88, 0.56, 0.16)), (1.8, (0.98, 0.80, 0.36)), by=foliage - 0.35 * depth)
        layout.lay(below(edge), tones, 0.9 + 1.1 * texture(0.06, 0.6))
    # 4. the cliff, and the fall over it
    lip = 0.47 + 0.012 * texture((0.1, 10.0), 0.7) - 0.5 * np.abs(x - valley) ** 2
    foot = 0.235 + 0.010 * texture((0.08, 10.0), 0.7)
    cliff_wide = 0.30 + 0.03 * texture((10.0, 0.05), 0.6)
    cliff = below(lip) * smooth_step(-soft, soft, cliff_wide - np.abs(x - valley))
    rock = 0.6 * texture((0.03, 0.10), 0.6) + 0.6 * texture((0.12, 0.05), 0.8) - 0.9 * (x - valley) / 0.3
    layout.lay(cliff, mixed((-1.6, (0.10, 0.09, 0.11)), (0.0, (0.29, 0.24, 0.22)), (1.2, (0.60, 0.46, 0.34)),
                            (2.2, (0.84, 0.66, 0.44)), by=rock), np.pi / 2 + 0.45 * texture(0.08, 0.7))
    middle = valley - 0.03 * np.sin(9 * (y - 0.2)) * np.clip((0.47 - y) / 0.3, 0, 1)
    half = 0.075 + 0.10 * np.clip((lip - y) / 0.25, 0, 1) ** 1.6 + 0.008 * texture((10.0, 0.04), 0.7)
    fall = smooth_step(-1.5 * soft, 1.5 * soft, half - np.abs(x - middle)) * below(lip) * (y > foot - 0.02)
    strands = texture((0.012, 0.35), 0.5) + 0.5 * texture((0.04, 0.2), 0.8)
    layout.lay(fall, mixed((-1.8, (0.36, 0.47, 0.56)), (-0.4, (0.72, 0.80, 0.83)), (0.6, (0.94, 0.94, 0.90)),
                           (1.8, (1.0, 0.98, 0.90)), by=strands - 0.6 * (x - middle) / 0.1),
               np.pi / 2 + 0.8 * (x - middle))
    # 5. the pool: the sky and the wood upside down, foam where the water falls in
    shore = 0.235 + 0.02 * np.abs(x - valley) + crest(0.0, 0.007, 0.12)
    pool = below(shore) * smooth_step(-soft, soft, y - (0.06 + 0.09 * np.abs((x - valley) / (0.5 * wide)) ** 3.0
                                                      + crest(0.0, 0.012, 0.2)))
    ripples = texture((0.16, 0.016), 0.6)
    near = np.clip((0.24 - y) / 0.2, 0, 1)
    glow = np.exp(-((x - 0.8 * valley) / 0.28) ** 2)
    deep = mixed((-1.6, (0.07, 0.15, 0.19)), (0.0, (0.16, 0.29, 0.34)), (1.0, (0.50, 0.50, 0.42)),
                 (2.0, (0.93, 0.76, 0.48)), by=ripples + 1.1 * glow - 0.4 - 0.5 * near)
    layout.lay(pool, deep, 0.03 * texture(0.1))
    spread = np.exp(-((x - valley) / (0.20 + 0.25 * near)) ** 2) * np.exp(-((0.225 - y) / 0.05) ** 2)
    foam = smooth_step(0.2, 0.9, spread * (1.3 + 0.5 * texture((0.07, 0.02), 0.6))) * np.maximum(pool, fall)
    layout.lay(0.9 * foam, np.broadcast_to(np.array([0.95, 0.95, 0.92]), (*shape, 3)), 0.1 * texture(0.1))
    water = np.clip(np.maximum(pool, fall), 0, 1)
    # 6. stones and grasses before us
    stones = np.zeros(shape, np.float32)
    for _ in range(16):
        side = random.choice([-1, 1])
        cx, cy = valley + side * random.uniform(0.22, 0.62), random.uniform(0.045, 0.20)
        size = random.uniform(0.018, 0.05) * (1.4 - 3 * cy)
        outline = 1 - ((x - cx) / (1.5 * size)) ** 2 - ((y - cy) / size) ** 2 + 0.25 * texture(0.03, 0.7)
        where = smooth_step(-0.06, 0.06, outline)
        lit = np.clip(0.45 - 0.5 * (x - cx) / size + 0.5 * (y - cy) / size + 0.25 * texture(0.02, 0.5), 0, 1)
        tones = mixed((0.0, (0.10, 0.09, 0.11)), (0.5, (0.34, 0.29, 0.27)), (1.0, (0.80, 0.64, 0.47)), by=lit)
        layout.lay(where, tones, 0.5 + 0.6 * texture(0.05))
        stones = np.maximum(stones, where)
    edge = 0.085 + 0.22 * np.abs((x - valley) / (0.62 * wide)) ** 3 + crest(0.0, 0.016, 0.04, 0.4)
    grass = texture((0.012, 0.07), 0.5) + 0.6 * texture(0.15, 1.0)
    turf = below(edge)
    layout.lay(turf, mixed((-1.6, (0.07, 0.08, 0.05)), (-0.2, (0.22, 0.22, 0.08)), (0.8, (0.50, 0.40, 0.12)),
                           (1.8, (0.84, 0.66, 0.26)), by=grass), np.pi / 2 + 0.5 * texture(0.05))
    matte = water * (1 - stones) * (1 - turf)
    return layout, matte.astype(np.float32)
