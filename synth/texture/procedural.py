"""Samples by procedure: canes, straw, scales, in the manner of the paper's own (wang05 figures 8 to 10).

All lie along +y, so that their direction is DIRECTION. Scales have heads and tails: the head points to +y, the free
edges to -y; Tamura's measure finds no main direction in them, so give theirs to `sample`. A sample of 128 pixels is
drawn OVERSAMPLING times as large and averaged. They do not tile.
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage

DIRECTION = np.pi / 2
"""Of all samples here, radians."""
OVERSAMPLING = 4
SOFTNESS = 0.3
"""σ of the Gaussian before a picture is reduced, in pixels of the sample."""
LIGHT = np.array([-0.55, 0.25, 0.8]) / np.linalg.norm([-0.55, 0.25, 0.8])
"""Where the light comes from: left, a little from above, in front."""


def canes(size: int = 128, seed: int = 1) -> np.ndarray:
    """Stalks side by side, some before others, with nodes: (size, size, 3) float32, linear light.

    1. Stalks are cylinders about 9 pixels thick that sway a little; each pixel shows the foremost.
    2. Each is cut into internodes at random; a node is a ring, seen from above, with a groove below it.
    3. Colour by stalk and internode, from green to straw, with fibres along it.
    4. Light from the left, a shadow that falls to the right, dark gaps.
    """
    random, x, y = _generator(size, seed), *_pixels(size)
    front, along, across, green, tone = (np.full(x.shape, value) for value in (-9.0, 0.0, 0.0, 0.0, 0.0))
    place = -6.0
    while place < size + 6:
        radius, depth = random.uniform(3.6, 5.6), random.uniform(-1.6, 1.6)
        place += 0.86 * radius
        sway = random.uniform(0.2, 0.9) * np.sin(2 * np.pi * (y / random.uniform(70, 160) + random.random()))
        nodes = np.cumsum(random.uniform(15, 38, size // 12 + 6)) - 40
        u = (x - place - sway) / radius
        arc = np.sqrt(np.clip(1 - u * u, 0, 1))
        seen = y + 0.3 * radius * arc
        index = np.searchsorted(nodes, seen) - 1
        above = seen - nodes[np.clip(index, 0, None)]
        height = np.where(np.abs(u) < 1, depth + radius * arc, -9.0)
        shown = height > front
        age = random.uniform(0.15, 0.85) + random.normal(0, 0.2, len(nodes) + 1)
        values = (height, above, u, np.clip(age, 0, 1)[index], random.normal(0, 0.12, len(nodes) + 1)[index])
        for picture, value in zip((front, along, across, green, tone), values, strict=True):
            picture[shown] = value[shown]
        place += 0.86 * radius
    ring = np.exp(-((along - 0.5) / 0.55) ** 2)
    groove = np.exp(-((along - 1.9) / 0.6) ** 2) + 0.5 * np.exp(-((along + 0.2) / 0.5) ** 2)
    fibres = ndimage.gaussian_filter(random.normal(size=x.shape), (9 * OVERSAMPLING, 0.35 * OVERSAMPLING))
    colour = _mixed(green, [(0.74, 0.57, 0.24), (0.50, 0.46, 0.12), (0.17, 0.26, 0.05)])
    colour *= np.exp(tone + 0.08 * fibres / fibres.std() - 0.25 * np.exp(-along / 5))[..., None]
    colour += ring[..., None] * (0.5 * np.array([0.66, 0.58, 0.36]) - 0.2 * colour)
    facing = np.sqrt(np.clip(1 - across**2, 0, 1))
    diffuse = np.clip(LIGHT[0] * across + LIGHT[2] * facing + LIGHT[1] * 0.9 * ring, 0, None)
    shine = np.exp(-((across + 0.42) / 0.13) ** 2) * (1 - 0.6 * groove.clip(0, 1))
    light = (0.05 + 0.14 * facing + 0.98 * diffuse * _lit(front)) * facing**0.85 * (1 - 0.62 * groove.clip(0, 1))
    return _averaged(colour * light[..., None] + 0.10 * (shine * _lit(front))[..., None], size)


def straw(size: int = 128, seed: int = 1) -> np.ndarray:
    """Thousands of thin halms of many tones, piled up: (size, size, 3) float32, linear light.

    1. Halms of random place, length and thickness, within about 5° of +y, painted from the ground up: dark and brown
       ones below, pale ones above.
    2. Each is round, lit from the left, and shades what lies on its right.
    """
    random = _generator(size, seed)
    k, count = OVERSAMPLING, size * size // 6
    picture = np.full((size * k, size * k, 3), (0.030, 0.017, 0.006))
    depth = np.sort(random.random(count))
    middle = random.uniform(-20, size + 20, (count, 2)) * k
    half = random.uniform(7, 26, count) * k
    width = random.uniform(0.5, 1.05, count) * k
    lean, bend = random.normal(0, 0.075, count), random.normal(0, 0.0006, count) / k
    tone = np.clip(random.beta(1.1, 1.7, count) * 0.80 + 0.26 * depth - 0.06, 0, 1)
    colours = _mixed(tone, [(0.045, 0.024, 0.008), (0.20, 0.115, 0.033), (0.46, 0.30, 0.095), (0.80, 0.66, 0.36)])
    for n in range(count):
        reach = abs(lean[n]) * half[n] + abs(bend[n]) * half[n] ** 2 + 3 * width[n] + 2
        x0, x1 = (int(np.clip(middle[n, 0] + side * reach, 0, size * k)) for side in (-1, 1))
        y0, y1 = (int(np.clip(middle[n, 1] + side * half[n], 0, size * k)) for side in (-1, 1))
        if x0 >= x1 or y0 >= y1:
            continue
        t = np.arange(y0, y1)[:, None] - middle[n, 1]
        u = (np.arange(x0, x1) - middle[n, 0] - lean[n] * t - bend[n] * t * t) / width[n]
        ends = np.clip((half[n] - np.abs(t)) / (2 * k), 0, 1)
        window = picture[y0:y1, x0:x1]
        window *= 1 - (0.55 * ends * np.exp(-(((u - 1.3) / 0.9) ** 2)))[..., None]
        inside = np.clip((1 - np.abs(u)) * width[n], 0, 1) * (ends > 0.15 * np.abs(u))
        light = 0.30 + 0.95 * np.sqrt(np.clip(1 - (u + 0.3) ** 2 / 1.7, 0, 1)) - 0.10 * t / half[n]
        window += inside[..., None] * (light[..., None] * colours[n] - window)
    return _averaged(picture, size)


def scales(size: int = 128, seed: int = 1) -> np.ndarray:
    """Overlapping fish scales, heads up: (size, size, 3) float32, linear light.

    1. Rows from tail to head, each shifted by half a scale against the last; a scale covers the roots of those
       below it and shades them.
    2. A scale is dark at its root, ribbed like a fan, and has a pale rim.
    3. Colour changes slowly over the body, and a little from scale to scale.
    """
    random, x, y = _generator(size, seed), *_pixels(size)
    wide, high, long = 12.0, 7.2, 15.5
    body = ndimage.gaussian_filter(random.normal(size=(size, size)), 0.16 * size, mode="wrap")
    body = np.kron(body / body.std(), np.ones((OVERSAMPLING, OVERSAMPLING)))
    whole = np.zeros((*x.shape, 3))
    for row in range(-3, int(size / high) + 4):
        jitter = random.normal(0, 1, (4, int(size / wide) + 6))
        lowest, highest = (int(np.clip((high * row + z) * OVERSAMPLING, 0, len(y))) for z in (-3, long + 2))
        band = slice(lowest, highest)
        picture = whole[band]
        column = np.rint(x[band] / wide - 0.5 * (row % 2)).astype(int)
        tone, turn, reach, shift = jitter[:, column + 2]
        v = (high * row + long + 0.25 * shift - y[band]) / (long * (1 + 0.02 * reach))
        u = (x[band] - wide * (column + 0.5 * (row % 2))) / (0.5 * wide) + 0.05 * turn * v
        # how far inside the outline, in pixels: straight at the root, round at the free edge
        inside = np.where(v > 0, (1.02 - np.hypot(u, np.maximum(v - 0.48, 0) / 0.52)) * 0.5 * wide, -9.0)
        # a shadow on the scales below
        picture *= np.where((v > 0.3) & (inside <= 0), 1 - 0.72 * np.exp(-((inside / 1.5) ** 2)), 1)[..., None]
        fan = np.cos(11 * np.arctan2(u, v + 0.15)) * np.clip(2 * v - 0.7, 0, 1)
        light = 0.34 + 0.62 * np.clip(v - 0.38, 0, 1) - 0.26 * u + 0.09 * fan
        rim = np.exp(-(((inside - 0.9) / 0.7) ** 2)) * np.clip(0.75 - 0.5 * u, 0, 1)
        glint = np.exp(-(((u + 0.3) / 0.26) ** 2) - ((v - 0.72) / 0.10) ** 2)
        hue = np.clip(0.42 + 0.07 * body[band] + 0.17 * tone, 0, 1)
        colour = _mixed(hue, [(0.035, 0.11, 0.26), (0.05, 0.27, 0.30), (0.16, 0.36, 0.20), (0.50, 0.40, 0.13)])
        pale = 0.35 * np.array([0.80, 0.92, 0.86]) + 0.65 * colour / colour.max(axis=-1, keepdims=True)
        scale = colour * (1.35 * light * np.exp(0.15 * tone))[..., None] + pale * (0.34 * rim + 0.22 * glint)[..., None]
        picture += np.clip(inside * OVERSAMPLING / 2, 0, 1)[..., None] * (np.clip(scale, 0, None) - picture)
    return _averaged(whole, size)


def _generator(size: int, seed: int) -> np.random.Generator:
    if size < 8:
        raise ValueError(f"a sample is 8 pixels wide at least, not {size}")
    return np.random.Generator(np.random.Philox(key=seed))


def _pixels(size: int) -> tuple[np.ndarray, np.ndarray]:
    """Places x, y (n, n) in pixels of the sample, n = size · OVERSAMPLING."""
    y, x = (np.mgrid[:size * OVERSAMPLING, :size * OVERSAMPLING] + 0.5) / OVERSAMPLING
    return x, y


def _mixed(share: np.ndarray, colours: list[tuple[float, float, float]]) -> np.ndarray:
    """Colours (..., 3) at share (...) in [0, 1] of the way through evenly spaced colours."""
    stops = np.linspace(0, 1, len(colours))
    return np.stack([np.interp(share, stops, channel) for channel in zip(*colours, strict=True)], axis=-1)


def _lit(height: np.ndarray) -> np.ndarray:
    """Share of the light (n, n) that reaches a height field (n, n), in pixels of the sample: soft shadows to the
    right."""
    blocked = np.zeros_like(height)
    for step in range(1, 5):
        ahead = np.roll(height, step * OVERSAMPLING, axis=1) - height - 1.1 * step
        blocked = np.maximum(blocked, ahead)
    return 1 - 0.8 * np.clip(ndimage.gaussian_filter(blocked, 0.3 * OVERSAMPLING) / 1.5, 0, 1)


def _averaged(picture: np.ndarray, size: int) -> np.ndarray:
    """Means of OVERSAMPLING² pixels, a little soft, so that no detail is too fine to be moved: (size, size, 3)."""
    soft = ndimage.gaussian_filter(picture, (SOFTNESS * OVERSAMPLING, SOFTNESS * OVERSAMPLING, 0))
    blocks = soft.reshape(size, OVERSAMPLING, size, OVERSAMPLING, 3)
    return np.ascontiguousarray(np.clip(blocks.mean(axis=(1, 3)), 0, 1), np.float32)
