"""Pieces of clips and of the target (okabe11 §4, fig. 4): where they lie, and what their pixels are.

"We flip each video example horizontally …; we also make three versions of each video example by scaling them to 50,
75, and 100% of their original size. We also make three versions … by rotating the original by -22.5, 0.0, and +22.5
degrees. Each version is then cut into smaller pieces with a resolution of 48×48 pixels, allowing neighboring pieces
to overlap."

A piece is a clip, a version and the corner of a square in it. Its pixels are never kept: they are read from the clip
by one affine map when they are wanted. Points are x, y in pixels, row 0 the lowest; a pixel's centre is a whole
number.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np

from synth.photo.words import GRID

SCALES = (0.5, 0.75, 1.0)
TURNS = (-22.5, 0.0, 22.5)
OVERLAP = 2
"""Pieces in each direction that cover a pixel."""


class Version(NamedTuple):
    """A clip scaled, turned counter-clockwise by degrees, and then, if flipped, mirrored left to right."""

    scale: float
    turn: float
    flipped: bool


class Fit(NamedTuple):
    """A piece turned in its place counter-clockwise by degrees and enlarged, beyond its version."""

    turn: float
    zoom: float


FITS = (Fit(0.0, 1.0), *(Fit(*of) for of in product((-11.25, 0.0, 11.25), (0.85, 1.0, 1.18)) if of != (0.0, 1.0)))
"""How a piece may be fitted to the target; the first changes nothing."""
VERSIONS = tuple(Version(*of) for of in product(SCALES, TURNS, (False, True)))


@dataclass(frozen=True)
class Cut:
    """How pictures are cut into pieces.

    size  edge of a piece, pixels: a multiple of 2 GRID, so that pieces begin at points of the grid of descriptors
    """

    size: int = 48

    def __post_init__(self) -> None:
        if self.size % (2 * GRID) or not 16 <= self.size <= 256:
            raise ValueError(f"a piece has 16 to 256 pixels in whole steps of {2 * GRID}, not {self.size}")

    @property
    def step(self) -> int:
        """Pixels between points of the grid of descriptors."""
        return self.size // GRID

    @property
    def stride(self) -> int:
        """Pixels from a piece to the next."""
        return self.size // OVERLAP

    def corners(self, shape: tuple[int, int]) -> np.ndarray:
        """The lowest left pixels of all pieces of a picture of `shape` (Y, X): (N, 2) int, row and column, by rows."""
        rows, columns = (np.arange(0, n - self.size, self.stride) for n in shape)
        return np.stack(np.meshgrid(rows, columns, indexing="ij"), axis=-1).reshape(-1, 2)


def canvas(shape: tuple[int, int], version: Version) -> tuple[int, int]:
    """The shape (Y, X) of a version of a clip of `shape`: that of the scaled clip, turned in its place."""
    return max(1, round(shape[0] * version.scale)), max(1, round(shape[1] * version.scale))


def to_clip(shape: tuple[int, int], version: Version) -> np.ndarray:
    """The map (2, 3) float64 from points of a version to points of its clip of `shape` (Y, X)."""
    height, width = canvas(shape, version)
    angle = np.radians(version.turn)
    cos, sin = np.cos(angle), np.sin(angle)
    # mirror, turn back, scale up: about the middles
    back = np.array([[cos, sin], [-sin, cos]]) / version.scale
    if version.flipped:
        back = back @ np.diag([-1.0, 1.0])
    middle = np.array([shape[1] - 1, shape[0] - 1]) / 2
    return np.concatenate([back, (middle - back @ [(width - 1) / 2, (height - 1) / 2])[:, None]], axis=1)


def turned_vectors(vectors: np.ndarray, version: Version) -> np.ndarray:
    """Velocities (..., 2) of a clip, in pixels of the version: float32."""
    found = version.scale * _rotated(vectors, version.turn)
    return (found * [-1 if version.flipped else 1, 1]).astype(np.float32)


def fitted_vectors(vectors: np.ndarray, fit: Fit) -> np.ndarray:
    """Velocities (..., 2) of a piece, when it is fitted: float32."""
    return (fit.zoom * _rotated(vectors, fit.turn)).astype(np.float32)


def _rotated(vectors: np.ndarray, degrees: float) -> np.ndarray:
    cos, sin = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.stack([cos * vectors[..., 0] - sin * vectors[..., 1], sin * vectors[..., 0] + cos * vectors[..., 1]], -1)


def inside(corners: np.ndarray, cut: Cut, shape: tuple[int, int], version: Version) -> np.ndarray:
    """Which pieces of a version at corners (N, 2), row and column, lie wholly in the clip: (N,) bool."""
    last = cut.size - 1
    offsets = np.array([[0, 0], [last, 0], [0, last], [last, last]])
    points = np.concatenate([corners[:, None, ::-1] + offsets, np.ones((len(corners), 4, 1))], axis=2)
    found = points @ to_clip(shape, version).T
    limit = np.array([shape[1] - 1, shape[0] - 1]) + 1e-6
    return np.asarray(((found >= -1e-6) & (found <= limit)).all(axis=(1, 2)))


def warped(picture: np.ndarray, shape: tuple[int, int], at: np.ndarray) -> np.ndarray:
    """`picture` (Y, X[, C]) read at the points that the map `at` (2, 3) gives for pixels of a picture of `shape`.

    Bilinear; the border's pixels go on beyond it. At most 4 channels at a time, of uint8 or float32.
    """
    import cv2

    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    channels = picture.reshape(*picture.shape[:2], -1)
    parts = [cv2.warpAffine(np.ascontiguousarray(channels[..., k:k + 4]), at, shape[::-1], flags=flags,
                            borderMode=cv2.BORDER_REPLICATE).reshape(*shape, -1)
             for k in range(0, channels.shape[2], 4)]
    return np.concatenate(parts, axis=2).reshape(*shape, *picture.shape[2:])


def shrunk(picture: np.ndarray, scale: float) -> np.ndarray:
    """`picture` (Y, X) at a scale of at most 1, each pixel the mean of what it covers."""
    import cv2

    if scale == 1:
        return picture
    shape = canvas((picture.shape[0], picture.shape[1]), Version(scale, 0, False))
    return np.asarray(cv2.resize(picture, shape[::-1], interpolation=cv2.INTER_AREA))


def of_scaled(shape: tuple[int, int], version: Version) -> np.ndarray:
    """The map (2, 3) from points of a version to those of the scaled clip, which is only turned and mirrored."""
    return to_clip(canvas(shape, version), Version(1.0, version.turn, version.flipped))


def scaled(frames: np.ndarray, scale: float) -> np.ndarray:
    """The frames of a clip (T, Y, X) uint8 at a scale of at most 1."""
    return frames if scale == 1 else np.stack([shrunk(frame, scale) for frame in frames])


def pixels(small: np.ndarray, shape: tuple[int, int], corner: tuple[int, int], cut: Cut, version: Version,
           fit: Fit = FITS[0]) -> np.ndarray:
    """The frames of one piece: (T, size, size) uint8, turned, mirrored and fitted.

    small  (T, y, x) uint8: the clip of `shape` (Y, X), `scaled` as the version is
    """
    at = of_scaled(shape, version)
    cos, sin = np.cos(np.radians(fit.turn)) / fit.zoom, np.sin(np.radians(fit.turn)) / fit.zoom
    middle = np.full(2, (cut.size - 1) / 2)
    back = np.array([[cos, sin], [-sin, cos]])
    start = np.array(corner[::-1], np.float64) + middle - back @ middle
    at = np.concatenate([at[:, :2] @ back, (at[:, :2] @ start + at[:, 2])[:, None]], axis=1)
    return np.moveaxis(warped(np.moveaxis(small, 0, -1), (cut.size, cut.size), at), -1, 0)
