"""Atlas of a mesh: a place in one picture for each triangle, with texels round it that belong to it.

Two triangles share a square of the picture, each a right triangle in a corner of it with legs along its sides: as many
texels long as its longest edge asks for. Where a renderer reads the picture by linear interpolation anywhere in a
triangle, all texels it reads are the triangle's own, those beyond its edges by coordinates that go on.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from synth.texture.mesh import Mesh, length

MARGIN = 1
"""Texels between a leg and the side of the square."""
BETWEEN = 2
"""Texels, along a side, that separate the two triangles of a square beside their margins."""
SHORTEST = 1
"""Texels: the least length of a leg."""
LANES = 16


@dataclass(frozen=True, eq=False)
class Atlas:
    """Where triangles lie in a picture of `shape` (rows, columns), row 0 the lowest.

    corner  (F, 2) int64: column and row, in texels, of the first corner of each triangle
    leg     (F,) int64: texels from there to the two others, to the right and upwards; negative: to the left and down
    """

    shape: tuple[int, int]
    corner: np.ndarray
    leg: np.ndarray

    @property
    def uv(self) -> np.ndarray:
        """(F, 3, 2) float32: the corners, from 0 at the picture's left and lower edge to 1."""
        steps = np.array([[0, 0], [1, 0], [0, 1]]) * self.leg[:, None, None]
        return ((self.corner[:, None] + steps) / np.array(self.shape[::-1])).astype(np.float32)

    @classmethod
    def of_uv(cls, uv: np.ndarray, shape: tuple[int, int]) -> Atlas:
        """The atlas that gave `uv`."""
        texels = np.rint(uv.astype(np.float64) * np.array(shape[::-1])).astype(np.int64)
        return cls(shape, texels[:, 0], texels[:, 1, 0] - texels[:, 0, 0])

    def texels(self) -> Texels:
        """The texels of all triangles."""
        side = np.abs(self.leg) + 2 * MARGIN + BETWEEN
        side -= 1  # the diagonal itself is neither's
        rows = side - np.arange(int(side.max()))[:, None]  # of row j of a square, its texels below the diagonal
        count = np.maximum(rows, 0).sum(axis=0)
        face = np.repeat(np.arange(len(side)), count)
        number = np.arange(len(face)) - np.repeat(np.cumsum(count) - count, count)
        # number of a texel in a triangle of side, side - 1, ... texels
        n = side[face]
        j = np.floor(n + 0.5 - np.sqrt((n + 0.5) ** 2 - 2 * number)).astype(np.int64)
        j -= number < j * n - j * (j - 1) // 2
        j += number >= (j + 1) * n - (j + 1) * j // 2
        i = number - (j * n - j * (j - 1) // 2)
        turn, away = np.sign(self.leg[face]), np.stack([i, j], axis=-1) - MARGIN
        # a square's texels start at its side, which lies a margin from the corner; the other triangle's at the other
        at = self.corner[face] + turn[:, None] * away - (turn < 0)[:, None]
        place = ((away + 0.5) / np.abs(self.leg[face])[:, None]).astype(np.float32)
        texels = Texels.blocks(face, at[:, 1] * self.shape[1] + at[:, 0], place)
        return texels.of(texels.face)


@dataclass(frozen=True, eq=False)
class Texels:
    """Places in triangles, in blocks of 16 of one triangle each.

    face    (B,) int32: the triangle
    place   (B, 2, 16) float32: barycentric coordinates of the second and third corner; the last block of a triangle is
            filled up with its last place
    number  (M,) int64: what each place was numbered by
    slot    (M,) int64: where it is among the 16 B
    """

    face: np.ndarray
    place: np.ndarray
    number: np.ndarray
    slot: np.ndarray

    def of(self, face: np.ndarray) -> Texels:
        """The same blocks of triangles `face` (B,)."""
        return replace(self, face=face.astype(np.int32))

    def gathered(self, blocks: np.ndarray) -> np.ndarray:
        """Values (M, C) of the places, of values (B, C, 16) of the blocks."""
        return np.ascontiguousarray(blocks.transpose(0, 2, 1)).reshape(-1, blocks.shape[1])[self.slot]

    @classmethod
    def blocks(cls, face: np.ndarray, number: np.ndarray, place: np.ndarray) -> Texels:
        """The blocks of places (M, 2) in triangles (M,), which ascend; `number` (M,) is kept."""
        starts = np.flatnonzero(np.diff(face, prepend=-1))
        count = np.diff(starts, append=len(face))
        blocks = -(-count // LANES)
        before = np.cumsum(blocks) - blocks
        slot = np.arange(len(face)) + np.repeat(before * LANES - starts, count)
        full = np.zeros((int(blocks.sum()) * LANES, 2), np.float32)
        full[slot] = place
        # the lanes after a triangle's last place repeat it
        last = np.repeat(slot[starts + count - 1] if len(starts) else slot[:0], blocks * LANES - count)
        free = np.ones(len(full), bool)
        free[slot] = False
        full[free] = full[last]
        lanes = np.ascontiguousarray(full.reshape(-1, LANES, 2).transpose(0, 2, 1))
        return cls(np.repeat(face[starts], blocks), lanes, number, slot)


def atlas(of: Mesh, shape: tuple[int, int]) -> Atlas:
    """The atlas of a mesh in a picture of `shape` (rows, columns), with texels as small as fit in.

    Raises ValueError where not even legs of one texel fit in.
    """
    edge = length(np.roll(of.corners, -1, axis=1) - of.corners).max(axis=1)
    low, high = 0.0, max(shape) / float(edge.min())  # texels per world unit
    found = _packed(edge * low, shape)
    if found is None:
        raise ValueError(f"{len(edge)} triangles do not fit into {shape[1]}×{shape[0]} texels")
    for _ in range(24):
        middle = (low + high) / 2
        packed = _packed(edge * middle, shape)
        if packed is None:
            high = middle
        else:
            low, found = middle, packed
    return found


def _packed(edge: np.ndarray, shape: tuple[int, int]) -> Atlas | None:
    """Triangles with edges of so many texels, in squares on shelves, the largest first; None if they do not fit."""
    wanted = np.maximum(np.floor(edge).astype(np.int64), SHORTEST)
    order = np.argsort(-wanted, kind="stable")
    # two of about one size share a square, of the larger one's
    leg = np.repeat(wanted[order][::2], 2)[:len(order)]
    side = leg[::2] + 2 * MARGIN + BETWEEN
    if side[0] > min(shape):
        return None
    place, x, y, shelf = np.zeros((len(side), 2), np.int64), 0, 0, int(side[0])
    for k, size in enumerate(side.tolist()):
        if x + size > shape[1]:
            x, y, shelf = 0, y + shelf, size
        if y + size > shape[0]:
            return None
        place[k] = x, y
        x += size
    first = np.arange(len(order)) % 2 == 0
    square = np.repeat(place, 2, axis=0)[:len(order)]
    far = square + np.repeat(side, 2)[:len(order), None] - MARGIN
    corner, turned = np.zeros((len(order), 2), np.int64), np.zeros(len(order), np.int64)
    corner[order] = np.where(first[:, None], square + MARGIN, far)
    turned[order] = np.where(first, leg, -leg)
    return Atlas(shape, corner, turned)
