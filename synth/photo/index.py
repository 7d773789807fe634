"""What the database knows of a clip's pieces (okabe11 §4, fig. 2): their words, motion, textureness and brightness.

"We make a representative image by averaging the frames of each video example piece." A clip that is stationary has a
flat mean; a photograph was exposed for a moment. So each piece is described by EXPOSURES, means of all frames, of some
and of a few, which share its motion.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from synth.photo.motion import BANDS, CELL, LEVELS, Motion, motion, optical_flow, textureness
from synth.photo.pieces import (
    SCALES,
    VERSIONS,
    Cut,
    canvas,
    inside,
    of_scaled,
    shrunk,
    turned_vectors,
    warped,
)
from synth.photo.words import descriptors, histograms, nearest_words

EXPOSURES = (0, 16, 4)
"""Frames that are averaged; 0: all."""
CELLS = 6
"""Cells of a piece in each direction: neighbours overlap by half of them."""
MOVING = 0.25
"""The least share of a piece that moves; "any video example in which no pixel position has significant motion is
completely removed" (§4)."""
MEAN, BAND = slice(0, 2), slice(2, 2 + BANDS)
TEXTURE, DEVIATION = slice(2 + BANDS, 2 + BANDS + LEVELS), 2 + BANDS + LEVELS
FEATURES = DEVIATION + 1


@dataclass(frozen=True, eq=False)
class Index:
    """N pieces of one clip.

    version     (N,) uint8: which of VERSIONS
    corner      (N, 2) int16: row and column of the lowest left pixel, in the version
    histogram   (N, EXPOSURES, 5 words) uint8
    brightness  (N, EXPOSURES) float16: mean grey level, 0..255
    features    (N, CELLS, CELLS, FEATURES) float16: of each cell the mean velocity, the bands of motion, textureness
                in LEVELS, the deviation over time; pixels per frame and grey levels
    """

    version: np.ndarray
    corner: np.ndarray
    histogram: np.ndarray
    brightness: np.ndarray
    features: np.ndarray


class Described(NamedTuple):
    """A clip at one scale: what its versions are read from.

    exposures  of (Y, X) uint8 pictures, as EXPOSURES
    maps       (R, C, FEATURES + 1) float32 on cells of CELL pixels: features, with velocities of the clip itself, and
               the share that moves
    """

    exposures: tuple[np.ndarray, ...]
    maps: np.ndarray


def exposures(frames: np.ndarray) -> tuple[np.ndarray, ...]:
    """The pictures (Y, X) uint8 by which a clip (T, Y, X) uint8 is described, from its middle."""
    count = len(frames)
    found = []
    for length in EXPOSURES:
        length = min(length or count, count)
        start = (count - length) // 2
        found.append(np.rint(frames[start:start + length].mean(axis=0, dtype=np.float64)).astype(np.uint8))
    return tuple(found)


def described(frames: np.ndarray, moves: Motion, scale: float) -> Described:
    """A clip (T, Y, X) uint8 whose motion is `moves`, at one scale."""
    small = np.stack([shrunk(frame, scale) for frame in frames])
    texture = textureness(small)
    shape = texture.shape[:2]
    deviation = small.std(axis=0, dtype=np.float64).astype(np.float32)
    rows, columns = shape
    cells = deviation[:rows * CELL, :columns * CELL].reshape(rows, CELL, columns, CELL).mean(axis=(1, 3))
    motions = np.concatenate([moves.mean, moves.bands, moves.moving[..., None]], axis=2)
    motions = np.stack([_fitted(motions[..., k], shape) for k in range(motions.shape[2])], axis=2)
    return Described(exposures(small), np.concatenate(
        [motions[..., :-1], texture, cells[..., None], motions[..., -1:]], axis=2).astype(np.float32))


def _fitted(values: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """values (R, C) on cells of another number, each the mean of what it covers."""
    import cv2

    return np.asarray(cv2.resize(values, shape[::-1], interpolation=cv2.INTER_AREA))


def index(frames: np.ndarray, words: np.ndarray, cut: Cut, velocity: np.ndarray | None = None) -> Index:
    """All pieces of a clip (T, Y, X) uint8 that move, described by the codebook `words`.

    velocity  (Y, X, 2): the true mean velocity, pixels per frame, where it is known

    1. The motion of the clip: once, since its versions move alike.
    2. Each scale: its exposures, textureness and deviation.
    3. Each version: turn, cut, describe.
    """
    # 1. motion
    moves = motion(optical_flow(frames), velocity)
    shape = (frames.shape[1], frames.shape[2])
    parts: list[Index] = []
    for scale in SCALES:
        # 2. scale
        of = described(frames, moves, scale)
        # 3. versions
        parts += [_of_version(of, shape, number, words, cut)
                  for number, version in enumerate(VERSIONS) if version.scale == scale]
    return Index(*(np.concatenate([getattr(part, name) for part in parts])
                   for name in ("version", "corner", "histogram", "brightness", "features")))


def _of_version(of: Described, shape: tuple[int, int], number: int, words: np.ndarray, cut: Cut) -> Index:
    version = VERSIONS[number]
    size, at = canvas(shape, version), of_scaled(shape, version)
    corners = cut.corners(size)
    corners = corners[inside(corners, cut, shape, version)]
    cells = _cells(of.maps, at, corners, cut)
    moving = cells[..., -1].mean(axis=(1, 2)) >= MOVING
    corners, cells = corners[moving], cells[moving, ..., :-1]
    cells[..., MEAN] = turned_vectors(cells[..., MEAN], version)
    cells[..., BAND] *= version.scale
    counts, light = [], []
    for picture in of.exposures:
        turned = warped(picture, size, at)
        counts.append(described_by(turned, corners, words, cut))
        light.append(_means(turned, corners, cut))
    return Index(np.full(len(corners), number, np.uint8), corners.astype(np.int16),
                 np.stack(counts, axis=1), np.stack(light, axis=1).astype(np.float16), cells.astype(np.float16))


def _cells(maps: np.ndarray, at: np.ndarray, corners: np.ndarray, cut: Cut) -> np.ndarray:
    """maps (R, C, K) read at the middles of the cells of pieces at corners (N, 2): (N, CELLS, CELLS, K)."""
    import cv2

    if not len(corners):
        return np.zeros((0, CELLS, CELLS, maps.shape[2]), np.float32)
    edge = cut.size / CELLS
    middles = (np.arange(CELLS) + 0.5) * edge - 0.5
    y = corners[:, 0, None, None] + middles[:, None] + np.zeros(CELLS)
    x = corners[:, 1, None, None] + np.zeros((CELLS, 1)) + middles
    points = np.stack([x, y, np.ones_like(x)], axis=-1) @ at.T
    # from pixels to cells of the map, averaged to the size of a piece's cells
    smooth = cv2.blur(maps, (max(1, round(edge / CELL)),) * 2)
    places = ((points + 0.5) / CELL - 0.5).astype(np.float32).reshape(len(corners), CELLS * CELLS, 2)
    read = [cv2.remap(np.ascontiguousarray(smooth[..., k]), places[..., 0], places[..., 1], cv2.INTER_LINEAR,
                      borderMode=cv2.BORDER_REPLICATE) for k in range(maps.shape[2])]
    return np.stack(read, axis=-1).reshape(len(corners), CELLS, CELLS, len(read))


def described_by(picture: np.ndarray, corners: np.ndarray, words: np.ndarray, cut: Cut) -> np.ndarray:
    """Histograms of words (N, 5 words) uint8 of the pieces at corners (N, 2) of a picture (Y, X) uint8."""
    if not len(corners):
        return np.zeros((0, 5 * len(words)), np.uint8)
    return histograms(nearest_words(descriptors(picture, cut.step), words), corners // cut.step, len(words))


def _means(picture: np.ndarray, corners: np.ndarray, cut: Cut) -> np.ndarray:
    sums = np.pad(picture.astype(np.int64).cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    (low, left), (high, right) = corners.T, (corners + cut.size).T
    return (sums[high, right] - sums[low, right] - sums[high, left] + sums[low, left]) / cut.size**2
