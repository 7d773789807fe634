"""What patches on a surface show: at the texels of an atlas, and at the places where a newborn is compared with them.

A patch covers and shows what it does in the plane (`patches`), by its axes s and m in its chart (`charts`). In each
triangle of the chart they are linear in barycentric coordinates.

Hot: `bake` is most of a frame; as `draw`, it is bound by the reads of the sample.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from synth import opencl
from synth.texture.atlas import LANES, Texels
from synth.texture.charts import Pieces
from synth.texture.patches import (
    BIAS,
    Painter,
    Pixels,
    blend_reference,
    mean_reference,
    remoteness,
    unbent,
)

EDGE = 1e-4
"""How far outside a triangle, in barycentric coordinates, a place still is in it: no gap is left between two."""


class Located(NamedTuple):
    """Where the places of queries lie.

    texels  the places that lie in a triangle, in blocks of one query and triangle, numbered by query, then place
    query   (B,) int64: of each block
    """

    texels: Texels
    query: np.ndarray


def _program(painter: Painter) -> opencl.Program:
    return painter.program(Path(__file__).with_suffix(".cl"), EDGE=f"{EDGE}f")


def bake(painter: Painter, values: np.ndarray, of: Pieces, texels: Texels, blend: float) -> np.ndarray:
    """The colours (M, 3) of texels, float32, linear light; zero where no patch reaches. `bake_reference` says which.

    values  (P, FIELDS) float32: the table of the patches
    """
    channels = painter.colour.shape[2]
    out = opencl.empty((len(texels.face), channels, LANES))
    _program(painter).bake((len(texels.face),), (1,), *_on_device(texels.face, texels.place, *of, values),
                           *painter.colour_on_device, painter.turn, painter.last, opencl.to_device(painter.tones),
                           np.float32(blend), out)
    return _rgb(texels.gathered(out.get()))


def bake_reference(painter: Painter, values: np.ndarray, of: Pieces, texels: Texels, blend: float) -> np.ndarray:
    """Specification of `bake`: the blend of patches as `draw_reference` has it, at texels of triangles."""
    out = np.zeros((len(texels.face), painter.colour.shape[2], LANES), np.float32)
    for block, face in enumerate(texels.face):
        members = slice(of.starts[face], of.starts[face + 1])
        pixels = _on_pieces(painter, values, of, members, texels.place[block])
        colour, covered = blend_reference(painter, pixels, values[of.patch[members]], blend, (LANES,))
        out[block] = np.where(covered, colour.T, np.float32(0))
    return _rgb(texels.gathered(out))


def show(painter: Painter, values: np.ndarray, of: Pieces, texels: Texels, without: np.ndarray, rank: np.ndarray,
         below: int) -> np.ndarray:
    """The luminance at texels, and 1 where there is any: (M, 2) float32; `show_reference` says which.

    without  (B,) int32: the patch that each block leaves out; -1: none
    rank     (P,) int32: of the patches, of which those with a rank below `below` are shown
    """
    out = opencl.empty((len(texels.face), 2, LANES))
    if len(texels.face):
        _program(painter).show((len(texels.face),), (1,), *_on_device(texels.face, texels.place, without, *of, rank),
                               np.int32(below), opencl.to_device(values), *painter.luminance_on_device, painter.turn,
                               painter.last, out)
    return texels.gathered(out.get())


def show_reference(painter: Painter, values: np.ndarray, of: Pieces, texels: Texels, without: np.ndarray,
                   rank: np.ndarray, below: int) -> np.ndarray:
    """Specification of `show`: the mean of patches as `rectify_reference` has it, at texels of triangles."""
    out = np.zeros((len(texels.face), 2, LANES), np.float32)
    for block, face in enumerate(texels.face):
        members = np.arange(of.starts[face], of.starts[face + 1])
        patch = of.patch[members]
        members = members[(rank[patch] < below) & (patch != without[block])]
        pixels = _on_pieces(painter, values, of, members, texels.place[block])
        light, covered = mean_reference(painter, pixels, values[of.patch[members]], (LANES,))
        out[block] = np.where(covered, [light, np.ones(LANES)], 0)
    return texels.gathered(out)


def _on_pieces(painter: Painter, values: np.ndarray, of: Pieces, members: slice | np.ndarray,
               place: np.ndarray) -> list[Pixels]:
    u, v = place
    found = []
    for p, c in zip(values[of.patch[members]], of.corners[members], strict=True):
        s, m = c[0] + u * c[2] + v * c[4], c[1] + u * c[3] + v * c[5]
        found.append(Pixels(remoteness(painter, s, m, p, p[BIAS]), s, m))
    return found


def locate(painter: Painter, values: np.ndarray, of: Pieces, who: np.ndarray) -> Located:
    """Where the painter's places round patches `who` (Q,) lie; `locate_reference` says where."""
    order, starts = _of_patches(of, who)
    blocks, count = painter.places.padded // LANES, len(who)
    found, out = opencl.empty((count, blocks * LANES), np.int32), opencl.empty((count, 2, blocks * LANES))
    places = np.zeros((2, blocks * LANES), np.float32)
    places[:, :len(painter.places.radii)] = painter.places.along.T
    if count:
        _program(painter).locate((blocks, count), (1, 1), *_on_device(who.astype(np.int32), starts, of.corners[order],
                                                                      values, places), found, out)
    return _located(painter, of, order, found.get(), out.get())


def locate_reference(painter: Painter, values: np.ndarray, of: Pieces, who: np.ndarray) -> Located:
    """Specification of `locate`: each place, unbent, in the first triangle of its patch's chart that holds it."""
    order, starts = _of_patches(of, who)
    padded = painter.places.padded
    found, out = np.full((len(who), padded), -1, np.int32), np.zeros((len(who), 2, padded), np.float32)
    places = np.zeros((2, padded), np.float32)
    places[:, :len(painter.places.radii)] = painter.places.along.T
    edge, one = np.float32(EDGE), np.float32(1)
    for q, patch in enumerate(who):
        s, m = unbent(places[0], places[1], values[patch])
        for k in range(starts[q], starts[q + 1]):
            c = of.corners[order[k]]
            area, x, y = c[2] * c[5] - c[3] * c[4], s - c[0], m - c[1]
            b, d = (x * c[5] - y * c[4]) / area, (y * c[2] - x * c[3]) / area
            holds = (found[q] < 0) & (b >= -edge) & (d >= -edge) & (b + d <= one + edge)
            found[q, holds], out[q][:, holds] = k, np.stack([b, d])[:, holds]
    return _located(painter, of, order, found, out)


def _of_patches(of: Pieces, who: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The pieces of patches `who` (Q,), ascending, by patch, then by triangle: where they are in `of`, and where each
    patch's begin (Q + 1,)."""
    member = np.searchsorted(who, of.patch)
    own = np.flatnonzero(np.append(who, -1)[member] == of.patch)
    order = own[np.argsort(of.patch[own], kind="stable")]
    starts = np.searchsorted(of.patch[order], np.append(who, who[-1:] + 1)).astype(np.int32)
    return order, starts


def _located(painter: Painter, of: Pieces, order: np.ndarray, found: np.ndarray, out: np.ndarray) -> Located:
    found[:, len(painter.places.radii):] = -1
    query, place = np.nonzero(found >= 0)
    faces = len(of.starts) - 1
    key = query * faces + of.face[order[found[query, place]]]
    turn = np.argsort(key, kind="stable")
    query, place = query[turn], place[turn]
    texels = Texels.blocks(key[turn], query * found.shape[1] + place, out[query, :, place])
    return Located(texels.of(texels.face % faces), texels.face // faces)


def _on_device(*arrays: np.ndarray) -> tuple[object, ...]:
    return tuple(opencl.to_device(a if a.size else np.zeros((1, *a.shape[1:]), a.dtype)) for a in arrays)


def _rgb(colour: np.ndarray) -> np.ndarray:
    return colour if colour.shape[1] == 3 else np.repeat(colour, 3, axis=1)
