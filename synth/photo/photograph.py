"""The photograph carried along the motion (beyond okabe11): what the viewer knows of the picture, its streaks and
ripples, moves instead of being averaged away, and what stands in it stays: the steps of a stream, the shape of a fall.

    ground   what stands: an average along the motion that keeps edges (`standing`)
    detail   the rest, in units of its own local strength: where it comes to, it gets the strength of that place
    frame    ground + strength × carried detail

Carried for long, detail is torn, and comes where it does not belong. So two copies are carried, half a life apart;
each begins near where it lies in the photograph and has no weight when it begins and when it ends. A life ends where
the motion has led it as far as a feature is large: lives of different places have different lengths, each a whole part
of the loop, and begin at different times, a smooth noise apart. Each begins somewhere else, a feature or so away. So
nothing pulses, nothing repeats before the loop does, and the loop closes.

Squares of the weights add up to one; copies that come from nearly the same place are not counted twice.

Hot: `carried`, 16 pixels for each of up to four copies of each pixel of each frame; bound by arithmetic.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy import ndimage

from synth import opencl

LIFE = 24.0
"""The longest life, frames, about."""
HALVINGS = 2
"""The shortest life is the longest over 2 to this power."""
SCATTER = 6.0
"""σ of the noise by which lives begin at different times, in sizes of a feature: a smaller one would stretch detail."""
SPREAD = 1.0
"""Deviation of the times at which lives begin, in lives: all ages are then about as frequent."""
STEPS_A_PIXEL = 1.0
"""Steps of a path for each pixel of the fastest motion."""
KEPT = 0.2
"""σ of the Gaussian that shows what stands, in sizes of a feature."""
ALONG = 0.8
"""How far the average reaches along the motion, to either side, in sizes of a feature."""
EDGE = 0.06
"""A difference of display values that is an edge, over which is not averaged."""
STRENGTH = 0.5
"""σ of the Gaussian over which the strength of detail is taken, in sizes of a feature."""
FAINT = 0.004
"""Strength below which detail is noise."""
MOST = 4.0
"""The largest detail, in units of its strength."""
SAMPLES = 4
"""Frames whose power is measured."""
LOST = 1.6
"""The most that lost power is made up for."""
AWAY = 1.5
"""How far from its place detail may begin, in sizes of a feature."""
OWN = 0.2
"""How far apart two places of detail are unlike, in sizes of a feature."""
ROW = 64
"""Work-items of a group, along a row."""


class Split(NamedTuple):
    """A picture as what stands (Y, X, C), and its detail (Y, X, C) in units of its strength (Y, X)."""

    ground: np.ndarray
    detail: np.ndarray
    strength: np.ndarray


def split(picture: np.ndarray, motion: np.ndarray, feature: float, fluid: np.ndarray) -> Split:
    """What stands of a picture (Y, X, C) float32 that flows by motion (Y, X, 2), and what moves.

    feature  size of what moves, as streaks, ripples and billows, pixels
    fluid    (Y, X) bool: where the fluid is. Nothing else is averaged with it; detail goes on beyond it, mirrored, and
             fades over a feature
    """
    free = fluid.astype(np.float32)
    ground = standing(picture, motion, feature, free)
    detail = (picture - ground) * free[..., None]
    squares = (detail.mean(axis=2, dtype=np.float64) ** 2).astype(np.float32)
    strength = np.sqrt(np.maximum(_smooth(squares[..., None], STRENGTH * feature, free)[..., 0], 0)) + FAINT
    unit = np.clip(detail / strength[..., None], -MOST, MOST).astype(np.float32)
    beyond = mirrored(fluid)
    fades = np.exp(-((inland(~fluid) / np.float32(feature)) ** 2))
    return Split(ground, fades[..., None] * unit[beyond], strength[beyond])


def inland(fluid: np.ndarray) -> np.ndarray:
    """Pixels from each place of the fluid (Y, X) bool to its shore: (Y, X) float32, 0 outside; the picture's border is
    none."""
    return np.asarray(ndimage.distance_transform_edt(fluid), np.float32) if not fluid.all() else np.full(
        fluid.shape, max(fluid.shape), np.float32)


def mirrored(fluid: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where each pixel is read: itself in the fluid (Y, X) bool, beyond it what lies as far on the fluid's side of the
    shore: rows and columns (Y, X) int."""
    rows, columns = np.mgrid[:fluid.shape[0], :fluid.shape[1]]
    if not fluid.any():
        return rows, columns
    y, x = ndimage.distance_transform_edt(~fluid, return_distances=False, return_indices=True)
    behind = np.clip(2 * y - rows, 0, fluid.shape[0] - 1), np.clip(2 * x - columns, 0, fluid.shape[1] - 1)
    inside = fluid[behind]
    return np.asarray(np.where(inside, behind[0], y)), np.asarray(np.where(inside, behind[1], x))


def standing(picture: np.ndarray, motion: np.ndarray, feature: float, free: np.ndarray) -> np.ndarray:
    """The average of a picture along the motion that keeps edges: (Y, X, C) float32.

    free  (Y, X) float32: 1 where it may be read, 0 where not
    A bilateral filter along the streamlines: a place counts by how near its grey is, both without their finest detail.
    """
    import cv2

    soft = _smooth(picture, KEPT * feature, free)
    grey = np.ascontiguousarray(soft.mean(axis=2))
    height, width = grey.shape
    speed = np.maximum(np.hypot(motion[..., 0], motion[..., 1]), 1e-3)
    u, v = (np.ascontiguousarray(motion[..., c] / speed, np.float32) for c in (0, 1))

    def at(field: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.asarray(cv2.remap(field, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))

    total, share = soft.copy(), np.ones_like(grey)
    for sign in (np.float32(1), np.float32(-1)):
        y, x = np.mgrid[:height, :width].astype(np.float32)
        for _ in range(max(1, round(ALONG * feature))):
            x, y = x + sign * at(u, x, y), y + sign * at(v, x, y)
            weight = at(free, x, y) * np.exp(-0.5 * ((at(grey, x, y) - grey) / np.float32(EDGE)) ** 2)
            total += weight[..., None] * at(soft, x, y).reshape(total.shape)
            share += weight
    return np.where(free[..., None] > 0, total / share[..., None], picture).astype(np.float32)


def _smooth(picture: np.ndarray, sigma: float, free: np.ndarray) -> np.ndarray:
    """picture (Y, X, C) by a Gaussian, read only where it is free; as it is where nothing free is near: float32."""
    share = ndimage.gaussian_filter(free, sigma, mode="nearest")
    sums = np.stack([ndimage.gaussian_filter(picture[..., c] * free, sigma, mode="nearest")
                     for c in range(picture.shape[2])], axis=-1)
    return np.where(share[..., None] > 1e-3, sums / np.maximum(share, 1e-3)[..., None], picture).astype(np.float32)


def lives(length: int) -> np.ndarray:
    """Lives, frames, that fill a loop of `length` frames a whole number of times, falling: (K,) float32, K >= 2."""
    wanted = length / LIFE * 2 ** (0.5 * np.arange(2 * HALVINGS + 1))
    times = np.unique(np.maximum(np.rint(wanted), 1).astype(int))
    if len(times) == 1:
        times = np.array([times[0], times[0] + 1])
    return (length / times).astype(np.float32)


def places(speed: np.ndarray, lived: np.ndarray, feature: float) -> np.ndarray:
    """Which of the lives (K,) each pixel has, as a number 0 … K - 1 and between: (Y, X) float32.

    The life in which the motion, of a speed (Y, X), passes a feature.
    """
    wanted = feature / np.maximum(speed, 1e-3)
    return np.interp(np.log(wanted), np.log(lived[::-1]), np.arange(len(lived))[::-1]).astype(np.float32)


def paths(motion: np.ndarray, life: int) -> np.ndarray:
    """Where what lies at a pixel was, 0 to `life` frames ago: (life + 1, Y, X, 2) float32, x and y in pixels.

    motion (Y, X, 2), pixels per frame. Backward along the motion by the midpoint rule; within the picture.
    """
    import cv2

    height, width = motion.shape[:2]
    y, x = np.mgrid[:height, :width].astype(np.float32)
    u, v = (np.ascontiguousarray(motion[..., c], np.float32) for c in (0, 1))
    steps = max(1, int(np.ceil(np.hypot(u, v).max() * STEPS_A_PIXEL)))
    h = np.float32(1 / steps)

    def at(field: np.ndarray, px: np.ndarray, py: np.ndarray) -> np.ndarray:
        return np.asarray(cv2.remap(field, px, py, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))

    found = [np.stack([x, y], axis=-1)]
    for _ in range(life):
        for _ in range(steps):
            mx, my = x - h / 2 * at(u, x, y), y - h / 2 * at(v, x, y)
            x, y = x - h * at(u, mx, my), y - h * at(v, mx, my)
        np.clip(x, 0, width - 1, out=x)
        np.clip(y, 0, height - 1, out=y)
        found.append(np.stack([x, y], axis=-1))
    return np.stack(found)


def turns(shape: tuple[int, int], feature: float, seed: int) -> np.ndarray:
    """How many of its lives the first copy of each pixel has lived at frame 0: (Y, X) float32, smooth, from 0 on.

    A whole number more is another life, which begins elsewhere: so it is a number, not an angle.
    """
    random = np.random.Generator(np.random.Philox(key=[seed, 1]))
    width = SCATTER * feature
    # any other border would repeat single numbers of the noise
    smooth = ndimage.gaussian_filter(random.standard_normal(shape), width, mode="wrap")
    # such a noise deviates by 1 / (2 √π width)
    turn = SPREAD * 2 * np.sqrt(np.pi) * width * smooth
    return (turn - np.floor(turn.min())).astype(np.float32)


def starts(lived: np.ndarray, length: int, seed: int) -> np.ndarray:
    """Where to, from its place, detail begins: (K, 2, N, 2) float32, of each of the lives (K,), of both copies and of
    each of its lives in a loop of `length` frames. A sunflower's seeds in a circle of radius 1, turned at random."""
    times = np.rint(length / lived)
    number = np.arange(times.max())
    random = np.random.Generator(np.random.Philox(key=[seed, 2]))
    angle = number * np.pi * (3 - np.sqrt(5)) + 2 * np.pi * random.random((len(lived), 2, 1))
    away = np.sqrt(np.minimum((number + 0.5) / times[:, None, None], 1))
    return np.stack([away * np.cos(angle), away * np.sin(angle)], axis=-1).astype(np.float32)


def flowing(picture: np.ndarray, motion: np.ndarray, length: int, seed: int, feature: float, fluid: np.ndarray,
            ) -> Callable[[int], np.ndarray]:
    """A picture (Y, X, 3) float32 carried along motion (Y, X, 2): of a frame 0 … `length` - 1 of a loop the picture
    (Y, X, 3) float32.

    feature  size of what moves, as streaks, ripples and billows, pixels: what is larger stands
    fluid    (Y, X) bool: where the fluid is; nothing is read from the rest

    1. What stands and what moves.
    2. Where each pixel was; when its life begins, how long it is, where detail begins.
    3. The carried detail of a frame, on what stands.
    """
    # 1. split
    of = split(picture, motion, feature, fluid)
    # 2. paths and lives
    lived = lives(length)
    speed = ndimage.gaussian_filter(np.hypot(motion[..., 0], motion[..., 1]), STRENGTH * feature, mode="nearest")
    place = places(speed, lived, feature)
    # what stands begins where it is, and nothing beyond the shore
    far = np.minimum(AWAY * np.minimum(speed * np.interp(place, np.arange(len(lived)), lived), feature), inland(fluid))
    carry = Carrying(
        np.pad(of.detail, ((0, 0), (0, 0), (0, 1))), paths(motion, int(np.ceil(lived[0]))),
        np.stack([turns(motion.shape[:2], feature, seed), place, far, np.zeros_like(far)], axis=-1).astype(np.float32),
        lived, starts(lived, length, seed), length, OWN * feature)
    device = carry.on_device()
    scale = _restored(of, [carried(device, length * k // SAMPLES) for k in range(SAMPLES)], feature)[..., None]
    # 3. frames
    return lambda frame: of.ground + scale * carried(device, frame)


def _restored(of: Split, moved: list[np.ndarray], feature: float) -> np.ndarray:
    """The strength (Y, X) that gives carried detail the power of the photograph's: mixing and reading between pixels
    take some of it."""
    width = 2 * STRENGTH * feature
    before = ndimage.gaussian_filter(of.strength**2 * of.detail.mean(axis=2) ** 2, width, mode="nearest")
    after = np.mean([ndimage.gaussian_filter(of.strength**2 * detail.mean(axis=2) ** 2, width, mode="nearest")
                     for detail in moved], axis=0)
    return of.strength * np.clip(np.sqrt(before / np.maximum(after, 1e-12)), 1, LOST).astype(np.float32)


@dataclass(frozen=True, eq=False)
class Carrying:
    """What a carried frame is made of, float32, here or on the device.

    detail  (Y, X, 4), the last 0
    where   (ages, Y, X, 2), as `paths`: one age more than the longest life
    pixels  (Y, X, 4): as `turns`, as `places`, how far from its place detail begins, 0
    lived   (K,), as `lives`
    starts  (K, 2, N, 2), as `starts`
    length  frames of the loop
    own     pixels over which detail is like itself
    """

    detail: Any
    where: Any
    pixels: Any
    lived: Any
    starts: Any
    length: int
    own: float

    def on_device(self) -> Carrying:
        """The same on the device."""
        return Carrying(opencl.to_device(self.detail), opencl.to_device(self.where), opencl.to_device(self.pixels),
                        opencl.to_device(self.lived), opencl.to_device(self.starts), self.length, self.own)


def carried(of: Carrying, frame: int) -> np.ndarray:
    """One frame of carried detail: (Y, X, 3) float32. `of` is on the device."""
    height, width = of.detail.shape[:2]
    out = opencl.empty((height, width, 4))
    program = opencl.program(Path(__file__).with_suffix(".cl"), LIVES=of.lived.shape[0], STARTS=of.starts.shape[2])
    program.carried((-(-width // ROW) * ROW, height), (ROW, 1), of.detail, of.where, of.pixels, of.lived, of.starts,
                    out, np.float32(frame), np.float32(of.length), np.float32(of.own), np.int32(width),
                    np.int32(height))
    return np.ascontiguousarray(out.get()[..., :3])


def carried_reference(of: Carrying, frame: int) -> np.ndarray:
    """`carried` in NumPy: its specification."""
    rows, columns = np.mgrid[:of.detail.shape[0], :of.detail.shape[1]]
    turn, place, far = (of.pixels[..., k] for k in range(3))
    longer = np.minimum(place.astype(int), len(of.lived) - 2)
    part = place - longer
    total, copies = np.zeros_like(of.detail), []
    for c in range(4):
        life = of.lived[longer + c // 2]
        age = turn + np.float32(frame) / life + np.float32(0.5 * (c % 2))
        number = age.astype(int) % np.rint(of.length / life).astype(int)
        age = age % np.float32(1)
        low = (age * life).astype(int)
        t = (age * life - low)[..., None]
        at = (1 - t) * of.where[low, rows, columns] + t * of.where[low + 1, rows, columns]
        at = at + far[..., None] * of.starts[longer + c // 2, c % 2, number]
        rise = 1 - np.abs(2 * age - 1)
        weight = np.sqrt((1 - part if c < 2 else part) * rise * rise * (3 - 2 * rise))
        total += weight[..., None] * _between(of.detail, at)
        copies.append((at, weight))
    power = np.zeros(turn.shape, np.float32)
    for at, weight in copies:
        for other, also in copies:
            apart = ((at - other) / np.float32(of.own)).astype(np.float32)
            power += weight * also / (1 + (apart * apart).sum(axis=2)) ** 2
    return (total / np.sqrt(power)[..., None])[..., :3]


def _between(values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """values (Y, X, C) at points (Y, X, 2), by Catmull-Rom's spline; the border's pixels go on beyond it."""
    low = np.floor(at).astype(int)
    height, width = values.shape[:2]
    total = np.zeros_like(values)
    for j in range(-1, 3):
        for i in range(-1, 3):
            weight = _cubic(at[..., 1] - low[..., 1] - j) * _cubic(at[..., 0] - low[..., 0] - i)
            total += weight[..., None] * values[np.clip(low[..., 1] + j, 0, height - 1),
                                                np.clip(low[..., 0] + i, 0, width - 1)]
    return total


def _cubic(t: np.ndarray) -> np.ndarray:
    """Catmull-Rom's weight at distance t from a pixel."""
    t = np.abs(t)
    return np.where(t < 1, (1.5 * t - 2.5) * t * t + 1, np.where(t < 2, ((2.5 - 0.5 * t) * t - 4) * t + 2, 0))
