"""Assignment of pieces of clips to the pieces of a target (okabe11 §5).

    E = Σ_p V_p(l_p) + λ Σ W_pq(l_p, l_q)                             (Eq. 4)
    V = 1 - I + texture |Δ log T| + brightness |Δ grey|                 (Eq. 5, mended)
    W = smooth + ρ texture                                            (Eq. 6)

Eq. 5 as printed adds a similarity to a sum that is minimized; here it is 1 - I. SIFT sees neither contrast nor
brightness and puts white water into a dark pool; V has terms for both. Eq. 3 is a squared distance of features in units
of their own; here it is the distance, each feature divided by its deviation over the database, so that λ, σ and ρ are
plain numbers. Eqs. 2, 3 and 5 as they are printed are there to compare with (`Settings.energy`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from synth.photo.index import BAND, CELLS, DEVIATION, MEAN, TEXTURE, Index, described_by
from synth.photo.minimize import MINIMIZERS, Energy
from synth.photo.motion import CELL, textureness
from synth.photo.pieces import OVERLAP, Cut
from synth.photo.words import TOTAL, common

ANGLES = (45.0, 60.0, 90.0, 180.0)
"""Degrees between the wanted and a piece's motion: the first that leaves enough candidates."""
PARTED = 8
"""Of a small database one in so many pieces that move as wanted are enough."""
FASTER = 2.0
"""A piece may be so many times as fast or slow as wanted; twice as many, with each wider angle."""
PART = 0.02
"""Least share of a target's piece that the matte covers."""
AGAIN = 4.0
"""What it costs that neighbours show the same piece: it would be seen as a lattice."""
FLAT = 2.0
"""Grey levels added to textureness before its logarithm: below, differences are noise."""


@dataclass(frozen=True)
class Settings:
    """The open parameters of §5.

    candidates  of each node
    sigma       σ of Eq. 2: motion that changes, over its mean
    rho         ρ of Eq. 6: textureness over motion
    weight      λ of Eq. 4
    texture     weight of the difference of textureness in V
    brightness  weight of the difference of brightness in V
    of_one_clip share of a node's candidates that may come from one clip
    minimizer   "messages" (TRW-S), "expansion" (the paper's), "modes" or "data"
    energy      "mended", or "printed": V = I of the average image; d a squared difference of powers, of the mean motion
                too; in pixels, grey levels and cells
    """

    candidates: int = 100
    sigma: float = 0.7
    rho: float = 0.5
    weight: float = 0.15
    texture: float = 0.35
    brightness: float = 0.5
    of_one_clip: float = 0.25
    minimizer: str = "messages"
    energy: Literal["mended", "printed"] = "mended"

    def __post_init__(self) -> None:
        if self.candidates < 1 or not 0 < self.of_one_clip <= 1:
            raise ValueError("a node has one candidate or more, of one clip a share in (0, 1]")
        if min(self.sigma, self.rho, self.weight, self.texture, self.brightness) < 0:
            raise ValueError("weights of the energy are not negative")
        if self.minimizer not in MINIMIZERS:
            raise ValueError(f"there is no minimizer {self.minimizer!r}, only {', '.join(MINIMIZERS)}")


@dataclass(frozen=True, eq=False)
class Database:
    """The pieces of all clips, and the codebook they are described by.

    clip   (N,) int32: whose piece each is; then as in `Index`, joined
    words  (k, 128) uint8
    """

    clip: np.ndarray
    pieces: Index
    words: np.ndarray

    @classmethod
    def joined(cls, indices: list[Index], words: np.ndarray) -> Database:
        """Of clips 0, 1 …, each with its index. Raises ValueError if no clip has a piece."""
        clip = np.concatenate([np.full(len(of.version), k, np.int32) for k, of in enumerate(indices)])
        if not len(clip):
            raise ValueError("no clip of the database has a piece that moves")
        parts = {name: np.concatenate([getattr(of, name) for of in indices])
                 for name in ("version", "corner", "histogram", "brightness", "features")}
        return cls(clip, Index(**parts), words)


class Nodes(NamedTuple):
    """The pieces of a target that the matte covers.

    corner  (P, 2) int: row and column of the lowest left pixel, from the target's; negative before it begins
    edges   (E, 2) int: neighbours, p < q
    across  (E,) bool: q is to the right of p; else above it
    """

    corner: np.ndarray
    edges: np.ndarray
    across: np.ndarray


class Wanted(NamedTuple):
    """What the user says of the motion, each (Y, X, …) or None: unit vectors, and pixels per frame."""

    orientation: np.ndarray | None = None
    speed: np.ndarray | None = None


class Shown(NamedTuple):
    """What each of P nodes shows: the clip (P,), the version (P,) and the corner (P, 2) of its piece, the mean motion
    of its cells (P, CELLS, CELLS, 2), pixels per frame, and how it is fitted (P,), which of FITS."""

    clip: np.ndarray
    version: np.ndarray
    corner: np.ndarray
    motion: np.ndarray
    fit: np.ndarray


class Assigned(NamedTuple):
    """A piece of the database for each node.

    piece     (P,) int64: its row
    exposure  (P,) int64: by which of its exposures it was chosen
    angle     (P,) float64: degrees within which a node's candidates were looked for
    energies  of the data term alone, and of the result
    """

    piece: np.ndarray
    exposure: np.ndarray
    angle: np.ndarray
    energies: tuple[float, float]

    def shown(self, database: Database) -> Shown:
        """What the nodes show, not fitted yet."""
        pieces, row = database.pieces, self.piece
        return Shown(database.clip[row], pieces.version[row], pieces.corner[row].astype(np.int64),
                     pieces.features[row][..., MEAN].astype(np.float32), np.zeros(len(row), np.int64))


def nodes(matte: np.ndarray, cut: Cut) -> Nodes:
    """The nodes of a matte (Y, X) in 0..1: every pixel of it lies in OVERLAP² pieces.

    Raises ValueError for a matte that is empty.
    """
    rows, columns = (-(-n // cut.stride) + OVERLAP - 1 for n in matte.shape)
    corner = np.stack(np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij"), axis=-1) * cut.stride
    corner -= cut.stride * (OVERLAP - 1)
    part = np.array([[matte[max(y, 0):y + cut.size, max(x, 0):x + cut.size].sum() for y, x in row] for row in corner])
    used = part >= PART * cut.size**2
    if not used.any():
        raise ValueError("the matte is empty: there is nothing to animate")
    number = np.where(used, np.cumsum(used.ravel()).reshape(used.shape) - 1, -1)
    pairs = [np.stack([number[:, :-1].ravel(), number[:, 1:].ravel()], axis=1),
             np.stack([number[:-1].ravel(), number[1:].ravel()], axis=1)]
    kept = [pair[(pair >= 0).all(axis=1)] for pair in pairs]
    across = np.concatenate([np.ones(len(kept[0]), bool), np.zeros(len(kept[1]), bool)])
    return Nodes(corner[used], np.concatenate(kept), across)


def assign(picture: np.ndarray, matte: np.ndarray, database: Database, cut: Cut, wanted: Wanted,
           settings: Settings) -> tuple[Nodes, Assigned]:
    """Pieces for a target: picture (Y, X) uint8 grey, matte (Y, X) in 0..1.

    1. Nodes, described as the database's pieces are.
    2. Candidates of each node.
    3. The terms between neighbours.
    4. Minimize.
    """
    # 1. nodes
    of = nodes(matte, cut)
    target = _described(picture, of, database.words, cut)
    # 2. candidates
    piece, exposure, data, angle = _candidates(target, _at_nodes(wanted, of, cut, picture.shape), database, settings)
    # 3. neighbours
    between = _printed if settings.energy == "printed" else _between
    smooth = settings.weight * between(of, piece, database, settings)
    # 4. minimize
    energy = Energy(data, of.edges, smooth)
    found = MINIMIZERS[settings.minimizer](energy)
    row = np.arange(len(piece))
    alone = MINIMIZERS["data"](energy)
    return of, Assigned(piece[row, found.labels], exposure[row, found.labels], angle,
                        (float(alone.energy), float(found.energy)))


class _Target(NamedTuple):
    histogram: np.ndarray
    texture: np.ndarray
    brightness: np.ndarray


def _described(picture: np.ndarray, of: Nodes, words: np.ndarray, cut: Cut) -> _Target:
    """What nodes look like: (P, …), of a picture that is mirrored beyond its border."""
    margin = cut.size
    wide = np.pad(picture, margin, mode="symmetric")
    corner = of.corner + margin
    texture = textureness(wide[None]).astype(np.float64)
    strength, light = [], []
    for y, x in corner.tolist():
        part = texture[y // CELL:(y + cut.size) // CELL, x // CELL:(x + cut.size) // CELL]
        strength.append(np.sqrt((part * part).mean(axis=(0, 1))))
        light.append(wide[y:y + cut.size, x:x + cut.size].mean())
    return _Target(described_by(wide, corner, words, cut), np.array(strength), np.array(light))


def _at_nodes(wanted: Wanted, of: Nodes, cut: Cut, shape: tuple[int, ...]) -> Wanted:
    """What is wanted at the middle of each node: (P, 2) unit vectors and (P,) speeds, or None."""
    middle = np.clip(of.corner + cut.size // 2, 0, np.array(shape) - 1)
    y, x = middle.T
    return Wanted(None if wanted.orientation is None else wanted.orientation[y, x].astype(np.float64),
                  None if wanted.speed is None else wanted.speed[y, x].astype(np.float64))


def _candidates(target: _Target, wanted: Wanted, database: Database, settings: Settings,
                ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Of each node the pieces of least V: rows (P, L), exposures (P, L), V (P, L), and the angle that was needed.

    "We can narrow down candidates in advance by discarding video example pieces with motions that differ greatly from
    the user-specified motion field." Fewer than L are filled up with an infinite V.
    """
    pieces = database.pieces
    count, exposures = pieces.histogram.shape[:2]
    similar = common(target.histogram, pieces.histogram.reshape(count * exposures, -1)).reshape(-1, count, exposures)
    light = pieces.brightness.astype(np.float32)
    squares = pieces.features[..., TEXTURE].astype(np.float32) ** 2
    strength = np.log(np.sqrt(squares.mean(axis=(1, 2))) + np.float32(FLAT))
    mean = pieces.features[..., MEAN].astype(np.float32).mean(axis=(1, 2))
    limit = min(settings.candidates, count)
    piece, exposure = (np.zeros((len(target.brightness), limit), np.int64) for _ in range(2))
    data, angle = np.full(piece.shape, np.inf), np.zeros(len(piece))
    for p in range(len(piece)):
        allowed, angle[p] = _allowed(mean, _of_node(wanted, p), min(limit, max(1, count // PARTED)))
        if settings.energy == "printed":
            # candidates are chosen "based on their similar appearance"; of them, Eq. 5 prefers the least similar
            order = np.argsort(-similar[p, allowed, 0].astype(np.int64), kind="stable")[:limit]
            piece[p, :len(order)] = allowed[order]
            data[p, :len(order)] = similar[p, allowed[order], 0] / TOTAL
            continue
        texture = np.abs(strength[allowed] - np.log(target.texture[p] + FLAT).astype(np.float32)).mean(axis=1)
        value = (1 - similar[p, allowed] / np.float32(TOTAL) + np.float32(settings.texture) * texture[:, None]
                 + np.float32(settings.brightness / 255) * np.abs(light[allowed] - np.float32(target.brightness[p])))
        best = value.argmin(axis=1)
        order = _limited(value.min(axis=1), database.clip[allowed], limit, settings.of_one_clip)
        piece[p, :len(order)], exposure[p, :len(order)] = allowed[order], best[order]
        data[p, :len(order)] = value[order, best[order]]
    return piece, exposure, data, angle


def _of_node(wanted: Wanted, p: int) -> Wanted:
    return Wanted(*(None if part is None else part[p] for part in wanted))


def _allowed(mean: np.ndarray, wanted: Wanted, least: int) -> tuple[np.ndarray, float]:
    """Rows of pieces whose mean velocity (N, 2) is near what is wanted, at least `least`, and the angle it took."""
    speed = np.hypot(mean[:, 0], mean[:, 1])
    for step, degrees in enumerate(ANGLES):
        fits = np.ones(len(mean), bool)
        if wanted.orientation is not None and degrees < 180:
            # not a product of matrices: BLAS rounds by the number of its threads
            along = mean[:, 0] * wanted.orientation[0] + mean[:, 1] * wanted.orientation[1]
            fits &= along >= np.cos(np.radians(degrees)) * speed
        if wanted.speed is not None and degrees < 180:
            factor = FASTER * 2**step
            fits &= (speed * factor >= wanted.speed) & (speed <= wanted.speed * factor)
        if fits.sum() >= least:
            break
    return np.flatnonzero(fits), degrees


def _limited(value: np.ndarray, clip: np.ndarray, limit: int, share: float) -> np.ndarray:
    """The `limit` least of value (N,), of one clip no more than a share; what is lacking is filled up with the rest."""
    order = np.argsort(value, kind="stable")
    most = max(1, int(share * limit))
    # how many of its clip come before each
    by_clip = np.argsort(clip[order], kind="stable")
    sorted_clip = clip[order][by_clip]
    first = np.searchsorted(sorted_clip, sorted_clip)
    rank = np.empty(len(order), np.int64)
    rank[by_clip] = np.arange(len(order)) - first
    kept = order[rank < most]
    return np.concatenate([kept, order[rank >= most]])[:limit]


def _between(of: Nodes, piece: np.ndarray, database: Database, settings: Settings) -> np.ndarray:
    """W (E, L, L) float32: Eqs. 2, 3 and 6 over the cells that neighbours share.

    1. Features in units of their deviation over the database, weighted.
    2. Distances over the shared cells, as root means.
    3. More for the same piece again.
    """
    # 1. features
    features = database.pieces.features.astype(np.float32)[..., :DEVIATION].copy()
    features[..., TEXTURE] = np.log(features[..., TEXTURE] + np.float32(FLAT))
    for part, weight in ((MEAN, 1.0), (BAND, settings.sigma), (TEXTURE, settings.rho)):
        spread = float(np.sqrt(features[..., part].astype(np.float64).var(axis=(0, 1, 2)).mean()))
        features[..., part] *= np.float32(np.sqrt(weight) / max(spread, 1e-6))
    found = np.empty((len(of.edges), piece.shape[1], piece.shape[1]), np.float32)
    # BLAS rounds by the number of its threads
    with threadpool_limits(1, user_api="blas"):
        for edge, ((p, q), ours, theirs) in enumerate(_shared(of, piece, features)):
            # 2. distances
            found[edge] = np.sqrt(_squares(ours, theirs) / ours.shape[1])
            # 3. again
            found[edge] += AGAIN * (piece[p][:, None] == piece[q])
    return found


def _printed(of: Nodes, piece: np.ndarray, database: Database, settings: Settings) -> np.ndarray:
    """W (E, L, L) float32 as printed: σ and ρ weigh powers, also of the mean, squared, and textureness."""
    features = database.pieces.features.astype(np.float32)
    mean = (features[..., MEAN] ** 2).sum(axis=-1, keepdims=True)
    powers = np.concatenate([mean, np.sqrt(np.float32(settings.sigma)) * features[..., BAND] ** 2], axis=-1)
    found = np.empty((len(of.edges), piece.shape[1], piece.shape[1]), np.float32)
    with threadpool_limits(1, user_api="blas"):
        for edge, (_, ours, theirs) in enumerate(_shared(of, piece, powers)):
            found[edge] = _squares(ours, theirs)
        for edge, (_, ours, theirs) in enumerate(_shared(of, piece, features[..., TEXTURE])):
            found[edge] += np.float32(settings.rho) * np.sqrt(_squares(ours, theirs))
    return found


def _shared(of: Nodes, piece: np.ndarray, features: np.ndarray,
            ) -> Iterator[tuple[tuple[int, int], np.ndarray, np.ndarray]]:
    """Of each edge its nodes, and the features (L, cells, …) of the cells that they share, of both."""
    half = CELLS // OVERLAP
    for (p, q), across in zip(of.edges.tolist(), of.across, strict=True):
        ours, theirs = features[piece[p]], features[piece[q]]
        one, other = (ours[:, :, half:], theirs[:, :, :half]) if across else (ours[:, half:], theirs[:, :half])
        yield (p, q), one.reshape(len(one), half * CELLS, -1), other.reshape(len(other), half * CELLS, -1)


def _squares(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Squared distances between rows (L, …) of one and of the other: (L, L) float32."""
    a, b = one.reshape(len(one), -1), other.reshape(len(other), -1)
    return np.maximum((a * a).sum(axis=1)[:, None] + (b * b).sum(axis=1) - 2 * (a @ b.T), 0)
