"""Inner steps of the method, as figures show them: a piece of a clip (okabe11 §4, §5, figs. 5 to 7), and two neighbours
before and after integration (§6, fig. 9).

Pictures are (Y, X), row 0 the lowest; velocities are pixels per frame.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from synth.photo.assign import Nodes, Shown
from synth.photo.integrate import Frames, differences, looped, phases, read
from synth.photo.motion import CELL, SIGNIFICANT, optical_flow, spectrum, textureness
from synth.photo.pieces import Cut


class Piece(NamedTuple):
    """What the database finds out about a piece of a clip as it is, neither scaled nor turned.

    corner       (2,) int64: row and column of its lowest left pixel
    frames       (T, size, size) uint8
    flow         (size, size, 2) float32: the optical flow from the first frame to the next (fig. 5 b)
    mean         (size, size, 2) float32: the mean motion (fig. 5 c)
    significant  (size, size) bool: where the mean motion is used (fig. 5 d)
    average      (size, size) float32: A of §6, grey levels
    spectrum     (T // 2 + 1,) float64: amplitude of the motion at each frequency (fig. 6)
    texture      (size // CELL, size // CELL, LEVELS) float32: textureness, grey levels (fig. 7)
    """

    corner: np.ndarray
    frames: np.ndarray
    flow: np.ndarray
    mean: np.ndarray
    significant: np.ndarray
    average: np.ndarray
    spectrum: np.ndarray
    texture: np.ndarray


def piece(frames: np.ndarray, velocity: np.ndarray | None, place: tuple[float, float], cut: Cut) -> Piece:
    """The piece of a clip (T, Y, X) uint8 round a place, x and y in pixels; at the border it is moved inwards.

    velocity  (Y, X, 2): the true mean velocity, where it is known
    """
    # cells of textureness begin at whole numbers of them
    y, x = (int(np.clip(round((at - cut.size / 2) / CELL), 0, (n - cut.size) // CELL)) * CELL
            for at, n in zip(place[::-1], frames.shape[1:], strict=True))
    inside = (slice(y, y + cut.size), slice(x, x + cut.size))
    flow = optical_flow(frames)
    mean = flow.mean(axis=0) if velocity is None else velocity
    cells = tuple(slice(part.start // CELL, part.stop // CELL) for part in inside)
    shown = frames[(slice(None), *inside)]
    return Piece(np.array([y, x]), shown, flow[(0, *inside)], mean[inside],
                 np.hypot(mean[..., 0], mean[..., 1])[inside] >= SIGNIFICANT,
                 shown.mean(axis=0, dtype=np.float64).astype(np.float32),
                 spectrum(flow[(slice(None), *inside)], mean[inside]), textureness(frames)[cells])


class Neighbours(NamedTuple):
    """Two neighbours p and q, q to the right of p, at the first frame of an animation; W = size + stride.

    corner       (2, 2) int64: row and column of the lowest left pixel of each, on the target
    pieces       (2, size, size) uint8
    differences  (2, size, size) float32, grey levels
    shares       (size, W) float32: their differences with weights that add up to one, as in the paper
    roots        (size, W) float32: with weights whose squares add up to one
    deviation    (2, W) float64: deviation over time of each column of `shares` and of `roots`, grey levels
    """

    corner: np.ndarray
    pieces: np.ndarray
    differences: np.ndarray
    shares: np.ndarray
    roots: np.ndarray
    deviation: np.ndarray


def nearest_edge(of: Nodes, place: tuple[float, float], cut: Cut) -> int:
    """The pair of neighbours beside each other whose common part is nearest to a place, x and y in pixels.

    Raises ValueError if no two nodes lie beside each other.
    """
    if not of.across.any():
        raise ValueError("no two pieces lie beside each other in the matte")
    corner = of.corner[of.edges].mean(axis=1)
    distance = ((corner + cut.size / 2 - np.array(place[::-1])) ** 2).sum(axis=1)
    return int(np.where(of.across, distance, np.inf).argmin())


def neighbours(of: Nodes, shown: Shown, frames: Frames, edge: int, cut: Cut, length: int, seed: int) -> Neighbours:
    """The two nodes of an edge that lie beside each other, integrated alone (fig. 9), as `differences` does with all.

    1. Their pieces and differences, each from its own phase.
    2. Blended by shares, as in the paper, and by roots.
    """
    rows = of.edges[edge]
    pair = Nodes(of.corner[rows] - of.corner[rows[0]], np.array([[0, 1]]), np.array([True]))
    two = Shown(*(part[rows] for part in shown))
    # 1. pieces
    start = phases(pair, two, seed)
    averages, first = (np.empty((2, cut.size, cut.size), np.float32) for _ in range(2))
    for p, piece in read(two, frames, cut):
        averages[p] = piece.mean(axis=0)
        first[p] = looped(piece - averages[p], length, int(start[p]))[0]
    # 2. blended
    shape = (cut.size, cut.size + cut.stride)
    shares, roots = (differences(pair, two, frames, shape, cut, length, seed, blending).bands.sum(axis=0)
                     for blending in ("shares", "roots"))
    deviation = [np.sqrt((values.astype(np.float64) ** 2).mean(axis=(0, 1))) for values in (shares, roots)]
    pieces = np.clip(np.rint(averages + first), 0, 255).astype(np.uint8)
    return Neighbours(of.corner[rows], pieces, first, shares[0], roots[0], np.stack(deviation))
