"""The initial output (ma13 §4.1, Initialization): patches of the exemplar, of whole elements over all frames, copied
into the domain, from the most to the least constrained region.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from synth.elements.constraints import Domain
from synth.elements.neighborhood import wrapped
from synth.elements.samples import Elements

TRIES = 24  # random patches compared for each place
GO_ON = 4  # nearest patches before it that a patch may continue
CONTINUE = 0.02  # handicap of a continuation: copying the whole exemplar gives no new arrangement
SAME = 0.15  # of the spacing: two elements nearer than this count as the same
CLOSE = 0.6  # of the spacing: an element of a patch nearer than this to another is left out
FILL_TRIES = 40  # points tried for each missing element
JUMP_BEFORE = 0.6  # share of the exemplar's frames before which a track that has reached the end continues


@dataclass(frozen=True)
class Copied:
    """An initial output.

    elements  T frames
    source    (T·E·S,) int32: the exemplar sample that each sample was copied from
    """

    elements: Elements
    source: np.ndarray


def points(exemplar: Elements, domain: Domain, frames: int, radius: float, spacing: float, seed: int,
           rotation: Callable[[np.ndarray], np.ndarray] | None = None, pins: np.ndarray | None = None,
           allowed: Callable[[np.ndarray], np.ndarray] | None = None,
           mismatch: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None, count: int | None = None) -> Copied:
    """Elements of one sample each, in a domain.

    1. Place an element at each hard position.
    2. For each place, the most constrained first: copy the best patch of the exemplar, without elements that lie
       outside the domain, are of a kind not allowed there, or are too close to elements placed before.
    3. Remove the most crowded elements or fill the widest gaps until the count is right.
    4. Continue each element over all frames as the one that it was copied from.

    radius    of the neighbourhood, the size of a patch; spacing: the exemplar's nearest distance, world units
    rotation  local axes (M, D, D) at points (M, D) of the first frame
    pins      (P, D) hard positions in the first frame
    allowed   bits of the kinds allowed at points (M, D)
    mismatch  of exemplar elements (M,) at points (M, D), from 0 to 1: the difference of a control map
    count     of the elements; None: as dense as the exemplar
    Raises ValueError for a domain smaller than a neighbourhood, or more pins than elements.
    """
    rng = np.random.Generator(np.random.Philox(key=seed))
    dims = exemplar.dimensions
    patches = _Patches(exemplar.positions[0, :, 0], _box(exemplar, spacing), exemplar.box is not None, radius, spacing,
                       domain, rotation, mismatch)
    volume = float((domain.inside > 0).sum()) * domain.cell**dims
    expected = count or as_dense(exemplar, domain, spacing)
    if volume < radius**dims:
        raise ValueError("the domain is smaller than a neighbourhood")
    # 1. hard positions
    placed = np.zeros((0, dims)) if pins is None else pins.astype(np.float64)
    if len(placed) > expected:
        raise ValueError(f"{len(placed)} hard positions are more than the {expected} elements the domain holds")
    source = rng.integers(0, exemplar.count, len(placed))
    # 2. patches
    cuts: list[Cut] = []
    for centre in _places(domain, radius, placed):
        patch, elements, cut = patches.best(centre, placed, cuts, rng)
        cuts.append(cut)
        good = domain.distance(patch) > 0 if len(patch) else np.zeros(0, bool)
        patch = domain.wrapped(patch)
        if allowed is not None and len(patch):
            good &= (allowed(patch) & (1 << (exemplar.kind[elements] % 31))) > 0
        patch, elements = patch[good], elements[good]
        if len(placed) and len(patch):
            far = _tree(domain, placed).query(_unit(domain, patch))[0] > CLOSE * spacing
            patch, elements = patch[far], elements[far]
        placed, source = np.vstack([placed, patch]), np.concatenate([source, elements])
    # 3. count
    placed, source = _counted(placed, source, expected, 0 if pins is None else len(pins), domain, exemplar, allowed,
                              rng)
    # 4. time
    return _over_time(exemplar, placed, source, frames, rotation)


def as_dense(exemplar: Elements, domain: Domain, spacing: float) -> int:
    """How many elements make a domain as dense as the exemplar, 2 or more."""
    low, high = _box(exemplar, spacing)
    volume = float((domain.inside > 0).sum()) * domain.cell**exemplar.dimensions
    return max(2, round(exemplar.count / float(np.prod(high - low)) * volume))


def _box(exemplar: Elements, spacing: float) -> np.ndarray:
    """The box that the exemplar fills in its first frame, (2, D): its own, or the bounds of its elements, at least one
    spacing along each axis (a flat exemplar is one layer)."""
    if exemplar.box is not None:
        return exemplar.box
    start = exemplar.positions[0, :, 0]
    low, high = start.min(axis=0), start.max(axis=0)
    missing = np.maximum(0, spacing - (high - low)) / 2
    return np.stack([low - missing, high + missing])


def _places(domain: Domain, radius: float, pins: np.ndarray) -> np.ndarray:
    """Centres of the patches, (P, D): squares of the neighbourhood's width, the most constrained first (those with
    hard positions, then by their distance to the border)."""
    shape = np.array(domain.inside.shape[::-1])
    low, high = domain.origin - domain.cell / 2, domain.origin + (shape - 0.5) * domain.cell
    counts = np.maximum(1, np.ceil((high - low) / (2 * radius)).astype(int))
    axes = [a + (np.arange(n) + 0.5) * (b - a) / n for a, b, n in zip(low, high, counts, strict=True)]
    centres = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(shape))
    distance = domain.distance(centres)
    near = distance > -radius * np.sqrt(len(shape))
    centres, distance = centres[near], distance[near]
    pinned = np.zeros(len(centres), bool)
    if len(pins):
        pinned = (np.abs(centres[:, None] - pins) <= radius).all(axis=2).any(axis=1)
    return centres[np.lexsort((np.arange(len(centres)), distance, ~pinned))]


def _unit(domain: Domain, points: np.ndarray) -> np.ndarray:
    """Points relative to the domain's lower corner, wrapped where it repeats: as SciPy's trees take them."""
    return wrapped(points - (domain.origin - domain.cell / 2), domain.period)


def _tree(domain: Domain, points: np.ndarray) -> cKDTree:
    return cKDTree(_unit(domain, points), boxsize=domain.period)


class Cut(NamedTuple):
    """Where a patch was placed, and the place in the exemplar that it was cut from, (D,) each."""

    placed_at: np.ndarray
    cut_from: np.ndarray


@dataclass(frozen=True)
class _Patches:
    """Patches of an exemplar, and how well they fit into a domain.

    start     (E, D) the exemplar's positions in its first frame
    box       (2, D) that they fill; toroidal: whether they repeat there
    radius    half the width of a patch; spacing: the exemplar's nearest distance, world units
    rotation, mismatch   as for `points`
    """

    start: np.ndarray
    box: np.ndarray
    toroidal: bool
    radius: float
    spacing: float
    domain: Domain
    rotation: Callable[[np.ndarray], np.ndarray] | None
    mismatch: Callable[[np.ndarray, np.ndarray], np.ndarray] | None

    def best(self, centre: np.ndarray, placed: np.ndarray, cuts: list[Cut], rng: np.random.Generator,
             ) -> tuple[np.ndarray, np.ndarray, Cut]:
        """The patch that fits best at `centre` (D,) beside the positions `placed` (P, D), after the patches `cuts`.

        1. Propose TRIES places in the exemplar at random, and those that continue the GO_ON nearest patches before.
        2. Cut a patch at each, rotated by the local axes at the centre.
        3. Take the one with the least misfit; a continuation is handicapped by CONTINUE.
        Returns positions (K, D), which elements of the exemplar they are (K,), and the cut.
        """
        R = np.eye(len(centre)) if self.rotation is None else self.rotation(centre[None])[0].astype(np.float64)
        tree = _tree(self.domain, placed) if len(placed) else None
        best, least = (np.zeros((0, len(centre))), np.zeros(0, int)), np.inf
        copies = self._copies()
        # 1. propose
        proposed = self._proposed(centre, R, cuts, rng)
        cut = Cut(centre, proposed[0][0])
        for middle, handicap in proposed:
            # 2. cut
            at = self.box[0] + np.mod(middle - self.box[0], self._period) if self.toroidal else middle
            away = (copies - at) @ R.T
            inside = (np.abs(away) <= self.radius).all(axis=1)
            patch, elements = centre + away[inside], np.nonzero(inside)[0] % len(self.start)
            # 3. compare
            misfit = self._misfit(patch, elements, tree, handicap)
            if misfit < least:
                least, best, cut = misfit, (patch, elements), Cut(centre, middle)
        return *best, cut

    @property
    def _period(self) -> np.ndarray:
        return self.box[1] - self.box[0]

    def _copies(self) -> np.ndarray:
        """The exemplar's positions, with copies all around if it repeats: a patch may be wider than the exemplar."""
        if not self.toroidal:
            return self.start
        dims = self.start.shape[1]
        steps = np.stack(np.meshgrid(*[(-1, 0, 1)] * dims, indexing="ij"), axis=-1).reshape(-1, dims)
        return (self.start + self._period * steps[:, None]).reshape(-1, dims)

    def _proposed(self, centre: np.ndarray, R: np.ndarray, cuts: list[Cut], rng: np.random.Generator,
                  ) -> list[tuple[np.ndarray, float]]:
        """Places (D,) in the exemplar to cut from, and the misfit that each starts with."""
        box = self.box
        room = self._period / 2 if self.toroidal else np.maximum(0, self._period / 2 - self.radius)
        tries = [(rng.uniform(-room, room) + (box[0] + box[1]) / 2, 0.0) for _ in range(TRIES)]
        nearest = sorted(cuts, key=lambda c: float(np.sum((c.placed_at - centre) ** 2)))[:GO_ON]
        going_on = [cut.cut_from + R.T @ (centre - cut.placed_at) for cut in nearest]
        return tries + [(middle, CONTINUE) for middle in going_on
                        if self.toroidal or ((middle > box[0]) & (middle < box[1])).all()]

    def _misfit(self, patch: np.ndarray, elements: np.ndarray, tree: cKDTree | None, misfit: float) -> float:
        """`misfit` and what a patch (K, D) of `elements` (K,) adds to it."""
        if not len(patch):
            return misfit + 10.0
        out = self.domain.distance(patch) < 0
        if self.mismatch is not None:
            misfit += float(self.mismatch(patch, elements).mean())
        if not self.toroidal:  # the borders of an exemplar that ends belong at those of the domain
            misfit += float(out.mean())
        if tree is not None and not out.all():
            distance = tree.query(_unit(self.domain, patch[~out]))[0]
            crowded = np.where(distance < SAME * self.spacing, 0.0, np.maximum(0, 1 - distance / self.spacing))
            misfit += float(np.sum(crowded**2)) / len(patch) * 2
        return misfit


def _counted(placed: np.ndarray, source: np.ndarray, expected: int, held: int, domain: Domain, exemplar: Elements,
             allowed: Callable[[np.ndarray], np.ndarray] | None, rng: np.random.Generator,
             ) -> tuple[np.ndarray, np.ndarray]:
    """Exactly `expected` elements: the most crowded are removed, or the widest gaps filled. The first `held` stay."""
    while len(placed) > expected:
        distance, index = _tree(domain, placed).query(_unit(domain, placed), k=2)
        crowd = np.where(np.arange(len(placed)) >= held, distance[:, 1], np.inf)
        # several at once, of which no two crowd each other
        going: list[int] = []
        for n in np.argsort(crowd, kind="stable")[: max(1, (len(placed) - expected) // 4)]:
            if index[n, 1] not in going:
                going.append(int(n))
        keep = np.setdiff1d(np.arange(len(placed)), going[: len(placed) - expected])
        placed, source = placed[keep], source[keep]
    shape = np.array(domain.inside.shape[::-1])
    low, high = domain.origin - domain.cell / 2, domain.origin + (shape - 0.5) * domain.cell
    while len(placed) < expected:
        tries = rng.uniform(low, high, (FILL_TRIES * 8, len(shape)))
        tries = tries[domain.distance(tries) > 0]
        if not len(tries):
            continue
        best = tries[np.argmax(_tree(domain, placed).query(_unit(domain, tries))[0])] if len(placed) else tries[0]
        kinds = np.arange(exemplar.count)
        if allowed is not None:
            fitting = (allowed(best[None])[0] & (1 << (exemplar.kind % 31))) > 0
            kinds = kinds[fitting] if fitting.any() else kinds
        placed, source = np.vstack([placed, best]), np.append(source, rng.choice(kinds))
    return placed, source


def _over_time(exemplar: Elements, placed: np.ndarray, source: np.ndarray, frames: int,
               rotation: Callable[[np.ndarray], np.ndarray] | None) -> Copied:
    """Each placed element moves as the one it was copied from."""
    element, frame = tracks(exemplar, source, frames)
    steps = np.zeros((frames, len(placed), exemplar.dimensions))
    if frames > 1 and exemplar.frames > 1:
        own = exemplar.positions[:, :, 0].astype(np.float64)
        steps[1:] = own[frame[1:], element[1:]] - own[np.maximum(frame[1:] - 1, 0), element[1:]]
        if rotation is not None:
            steps = np.einsum("nij,tnj->tni", rotation(placed), steps)
    positions = (placed + np.cumsum(steps, axis=0))[:, :, None]
    return Copied(
        Elements(positions, (), exemplar.rate, exemplar.size[source], exemplar.kind[source], exemplar.colour[source]),
        (frame * exemplar.count + element).ravel().astype(np.int32))


def carried(start: Copied, flow: Callable[[int, np.ndarray], np.ndarray]) -> Copied:
    """The same output with each element carried by a flow in addition to its own motion: flow(t, points) is the
    displacement of points (M, D) from frame t to the next."""
    own = start.elements.positions.astype(np.float64)
    positions = own.copy()
    for t in range(1, len(own)):
        before = positions[t - 1, :, 0]
        positions[t, :, 0] = before + flow(t - 1, before) + own[t, :, 0] - own[t - 1, :, 0]
    return replace(start, elements=replace(start.elements, positions=positions))


def tracks(exemplar: Elements, source: np.ndarray, frames: int, begin: np.ndarray | None = None,
           ) -> tuple[np.ndarray, np.ndarray]:
    """Which element in which frame of the exemplar each output element follows: two (T, E) int arrays.

    It follows its source from frame `begin` (E,), default 0; at the exemplar's end it continues where an element moves
    most similarly (position in details and its change), early enough to have frames left.
    """
    count = len(source)
    element, frame = np.zeros((frames, count), int), np.zeros((frames, count), int)
    element[0] = source
    frame[0] = 0 if begin is None else begin
    if exemplar.frames == 1:
        element[:] = source
        return element, frame
    moved = exemplar.positions if exemplar.coarse is None else exemplar.positions - exemplar.coarse
    state = moved.astype(np.float64)
    if exemplar.coarse is None:  # the position of a free element is not compared: only its motion is
        state = state * 0.0
    pace = np.diff(moved.astype(np.float64), axis=0) * 3.0
    early = max(1, int(exemplar.frames * JUMP_BEFORE))
    features = np.concatenate([state[:-1], pace], axis=3).reshape(exemplar.frames - 1, exemplar.count, -1)
    tree = cKDTree(features[:early].reshape(early * exemplar.count, -1))
    for t in range(1, frames):
        ended = frame[t - 1] + 1 >= exemplar.frames
        element[t], frame[t] = element[t - 1], np.where(ended, 0, frame[t - 1] + 1)
        if ended.any():
            # the last step is like the one from `alike` to the next frame: go on after that
            alike = np.asarray(tree.query(features[-1, element[t - 1, ended]])[1])
            element[t, ended] = alike % exemplar.count
            frame[t, ended] = np.minimum(alike // exemplar.count + 2, exemplar.frames - 1)
    return element, frame


def _section(coarse: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """The places of elements in the section (E, 3): their first samples in the first frame, in local axes."""
    first = coarse[0, :, 0].astype(np.float64)
    return (first - first.mean(axis=0)) @ axes[0].astype(np.float64)


def _side_by_side(own: np.ndarray, middle: np.ndarray, neighbours: int, rng: np.random.Generator) -> np.ndarray:
    """Which exemplar element, of middles `own`, each output element, of middles `middle`, is copied from (E,)."""
    source, tree = np.full(len(middle), -1), cKDTree(middle)
    for n in rng.permutation(len(middle)):
        if source[n] >= 0:
            continue
        first = int(rng.integers(len(own)))
        source[n], taken = first, [first]
        for m in np.ravel(tree.query(middle[n], k=min(neighbours, len(middle)))[1]).tolist():
            if source[m] >= 0 or len(taken) == len(own):
                continue
            distance = np.linalg.norm(own - (own[first] + middle[m] - middle[n]), axis=1)
            distance[taken] = np.inf
            source[m] = int(np.argmin(distance))
            taken.append(int(source[m]))
    return source


def on_coarse(exemplar: Elements, coarse: np.ndarray, axes_in: np.ndarray, axes_out: np.ndarray, neighbours: int,
              seed: int, rate: float) -> Copied:
    """Threads or sheets on given coarse positions: each takes the details of a whole element of the exemplar.

    coarse      (T, E, S, 3): C of the output
    axes_in     local axes of the exemplar's samples (T·E·S, 3, 3); axes_out: of the output's
    neighbours  number of elements copied as one patch: adjacent elements take adjacent exemplar elements, and all
                patches begin in the same frame, so that neighbours move together. 1: each element separately, from a
                frame of its own
    """
    rng = np.random.Generator(np.random.Philox(key=seed))
    total, count, samples = coarse.shape[:3]
    assert exemplar.coarse is not None
    latest = max(1, exemplar.frames - total + 1, exemplar.frames // 2 if neighbours == 1 else 1)
    if neighbours == 1:
        source = rng.integers(0, exemplar.count, (count,))
        begin = rng.integers(0, latest, (count,))
    else:
        source = _side_by_side(_section(exemplar.coarse, axes_in), _section(coarse, axes_out), neighbours, rng)
        begin = np.full(count, rng.integers(latest))
    element, at = tracks(exemplar, source, total, begin)
    q = np.einsum("nji,nj->ni", axes_in, (exemplar.positions - exemplar.coarse).reshape(-1, 3)).reshape(
        exemplar.positions.shape)
    details = q[at, element]
    positions = coarse + np.einsum("nij,nj->ni", axes_out, details.reshape(-1, 3)).reshape(coarse.shape)
    first_sample = (at * exemplar.count + element)[..., None] * samples
    return Copied(
        Elements(positions, exemplar.grid, rate, exemplar.size[source], exemplar.kind[source],
                 exemplar.colour[source], coarse), (first_sample + np.arange(samples)).ravel().astype(np.int32))
