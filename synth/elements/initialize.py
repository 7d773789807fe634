"""The first guess of an output (ma13 §4.1, Initialization): patches of the exemplar, of whole elements over all
frames, copied into the domain, from the most to the least constrained region.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from synth.elements.constraints import Domain
from synth.elements.neighborhood import wrapped
from synth.elements.samples import Elements

TRIES = 24  # patches that are looked at for each place
GO_ON = 4  # of the nearest patches before it, which it may go on
CONTINUE = 0.02  # misfit by which chance must fit worse for that: a copy of the whole exemplar is no new arrangement
SAME = 0.15  # of the spacing: nearer than that, two elements are one and the same
CLOSE = 0.6  # of the spacing: nearer than that, an element of a patch is left out
FILL_TRIES = 40  # points tried, for each element that is missing
JUMP_WITHIN = 0.6  # of the exemplar's frames: a track that has come to its end goes on before this


@dataclass(frozen=True)
class Copied:
    """An output as it begins.

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

    radius    of the neighbourhood, the size of a patch; spacing: the exemplar's nearest distance, world units
    rotation  local frames (M, D, D) at points (M, D) of the first frame
    pins      (P, D) hard positions in the first frame
    allowed   bits of the kinds that may stand at points (M, D)
    mismatch  how little exemplar elements (M,) suit points (M, D), from 0 to 1: a control map's difference
    count     of the elements; None: as dense as the exemplar
    Raises ValueError for a domain smaller than a neighbourhood, or more pins than elements.
    """
    rng = np.random.Generator(np.random.Philox(key=seed))
    dims = exemplar.dimensions
    start = exemplar.positions[0, :, 0]
    toroidal = exemplar.box is not None
    box = _box(exemplar, spacing)
    volume = float((domain.inside > 0).sum()) * domain.cell**dims
    expected = count or as_dense(exemplar, domain, spacing)
    if volume < radius**dims:
        raise ValueError("the domain is smaller than a neighbourhood")
    placed = np.zeros((0, dims)) if pins is None else pins.astype(np.float64)
    if len(placed) > expected:
        raise ValueError(f"{len(placed)} hard positions are more than the {expected} elements the domain holds")
    source = rng.integers(0, exemplar.count, len(placed))
    cut: list[Cut] = []
    for centre in _places(domain, radius, placed):
        patch, elements, taken = _patch(start, box, toroidal, centre, radius, rng, placed, domain, rotation, spacing,
                                        cut, mismatch)
        cut.append(taken)
        good = domain.distance(patch) > 0 if len(patch) else np.zeros(0, bool)
        patch = domain.wrapped(patch)
        if allowed is not None and len(patch):
            good &= (allowed(patch) & (1 << (exemplar.kind[elements] % 31))) > 0
        patch, elements = patch[good], elements[good]
        if len(placed) and len(patch):
            far = _tree(domain, placed).query(_unit(domain, patch))[0] > CLOSE * spacing
            patch, elements = patch[far], elements[far]
        placed, source = np.vstack([placed, patch]), np.concatenate([source, elements])
    placed, source = _counted(placed, source, expected, 0 if pins is None else len(pins), domain, exemplar, allowed,
                              rng)
    return _over_time(exemplar, placed, source, frames, rotation)


def as_dense(exemplar: Elements, domain: Domain, spacing: float) -> int:
    """How many elements make a domain as dense as the exemplar, 2 or more."""
    low, high = _box(exemplar, spacing)
    volume = float((domain.inside > 0).sum()) * domain.cell**exemplar.dimensions
    return max(2, round(exemplar.count / float(np.prod(high - low)) * volume))


def _box(exemplar: Elements, spacing: float) -> np.ndarray:
    """What the exemplar fills in its first frame, (2, D): its unit, or what is round its elements, a spacing or more
    along each axis (one that is flat is a layer)."""
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
    """Points from the domain's lower corner on, in its one unit where it repeats: as SciPy's trees take them."""
    return wrapped(points - (domain.origin - domain.cell / 2), domain.period)


def _tree(domain: Domain, points: np.ndarray) -> cKDTree:
    return cKDTree(_unit(domain, points), boxsize=domain.period)


Cut = tuple[np.ndarray, np.ndarray]
"""Where a patch was put, and the place in the exemplar that it was cut from."""


def _patch(start: np.ndarray, box: np.ndarray, toroidal: bool, centre: np.ndarray, radius: float,
           rng: np.random.Generator, placed: np.ndarray, domain: Domain,
           rotation: Callable[[np.ndarray], np.ndarray] | None, spacing: float, cut: list[Cut],
           mismatch: Callable[[np.ndarray, np.ndarray], np.ndarray] | None) -> tuple[np.ndarray, np.ndarray, Cut]:
    """The patch of the exemplar that fits best at `centre`: least crowded against what is placed, and with the fewest
    elements out of the domain. Of TRIES at random, and of those that go on where the nearest patches before it end,
    which are taken where chance fits worse by CONTINUE. Positions (K, D), which elements they are, and its cut."""
    frame = np.eye(len(centre)) if rotation is None else rotation(centre[None])[0].astype(np.float64)
    tree = _tree(domain, placed) if len(placed) else None
    period = box[1] - box[0]
    room = period / 2 if toroidal else np.maximum(0, period / 2 - radius)
    tries = [(rng.uniform(-room, room) + (box[0] + box[1]) / 2, 0.0) for _ in range(TRIES)]
    nearest = sorted(cut, key=lambda c: float(np.sum((c[0] - centre) ** 2)))[:GO_ON]
    going_on = [middle + frame.T @ (centre - other) for other, middle in nearest]
    tries += [(middle, CONTINUE) for middle in going_on
              if toroidal or ((middle > box[0]) & (middle < box[1])).all()]
    best, least = (np.zeros((0, len(centre))), np.zeros(0, int), (centre, tries[0][0])), np.inf
    # a patch may be wider than the exemplar: it then holds elements more than once
    steps = np.stack(np.meshgrid(*[(-1, 0, 1)] * len(centre), indexing="ij"), axis=-1).reshape(-1, len(centre))
    copies = (start + period * steps[:, None]).reshape(-1, len(centre)) if toroidal else start
    for middle, misfit in tries:
        at = box[0] + np.mod(middle - box[0], period) if toroidal else middle
        away = (copies - at) @ frame.T
        inside = (np.abs(away) <= radius).all(axis=1)
        patch = centre + away[inside]
        if len(patch):
            out = domain.distance(patch) < 0
            if mismatch is not None:
                misfit += float(mismatch(patch, np.nonzero(inside)[0] % len(start)).mean())
            if not toroidal:  # an exemplar that ends has borders to put on the domain's
                misfit += float(out.mean())
            if tree is not None and not out.all():
                distance = tree.query(_unit(domain, patch[~out]))[0]
                crowded = np.where(distance < SAME * spacing, 0.0, np.maximum(0, 1 - distance / spacing))
                misfit += float(np.sum(crowded**2)) / len(patch) * 2
        else:
            misfit += 10.0
        if misfit < least:
            least, best = misfit, (patch, np.nonzero(inside)[0] % len(start), (centre, middle))
    return best


def _counted(placed: np.ndarray, source: np.ndarray, expected: int, held: int, domain: Domain, exemplar: Elements,
             allowed: Callable[[np.ndarray], np.ndarray] | None, rng: np.random.Generator,
             ) -> tuple[np.ndarray, np.ndarray]:
    """Exactly `expected` elements: the most crowded go, and the widest gaps are filled. The first `held` stay."""
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
    """The same with each element carried by a flow besides its own motion: flow(t, points) is the way of points (M, D)
    from frame t to the next."""
    own = start.elements.positions.astype(np.float64)
    positions = own.copy()
    for t in range(1, len(own)):
        before = positions[t - 1, :, 0]
        positions[t, :, 0] = before + flow(t - 1, before) + own[t, :, 0] - own[t - 1, :, 0]
    return replace(start, elements=replace(start.elements, positions=positions))


def tracks(exemplar: Elements, source: np.ndarray, frames: int, begin: np.ndarray | None = None,
           ) -> tuple[np.ndarray, np.ndarray]:
    """Which element in which frame of the exemplar each output element follows: two (T, E) int arrays.

    It follows its source from frame `begin` (E,), default 0; at the exemplar's end it goes on where an element moves
    most alike (position in details and its change), early enough to have frames ahead.
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
    if exemplar.coarse is None:  # a place in the plane is not a state: only the motion is
        state = state * 0.0
    pace = np.diff(moved.astype(np.float64), axis=0) * 3.0
    early = max(1, int(exemplar.frames * JUMP_WITHIN))
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


def _section(coarse: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """How elements lie beside each other (E, 3): their first samples in the first frame, in the local frame there."""
    first = coarse[0, :, 0].astype(np.float64)
    return (first - first.mean(axis=0)) @ frames[0].astype(np.float64)


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
            apart = np.linalg.norm(own - (own[first] + middle[m] - middle[n]), axis=1)
            apart[taken] = np.inf
            source[m] = int(np.argmin(apart))
            taken.append(int(source[m]))
    return source


def on_coarse(exemplar: Elements, coarse: np.ndarray, frames_in: np.ndarray, frames_out: np.ndarray, neighbours: int,
              seed: int, rate: float) -> Copied:
    """Threads or sheets on given coarse positions: each takes the details of a whole element of the exemplar.

    coarse      (T, E, S, 3): C of the output
    frames_in   local frames of the exemplar's samples (T·E·S, 3, 3), frames_out of the output's
    neighbours  how many elements are copied as one patch: those side by side take exemplar elements side by side, and
                all patches begin in the same frame, so that what lies side by side moves together. 1: each element by
                itself, from a frame of its own
    """
    rng = np.random.Generator(np.random.Philox(key=seed))
    total, count, samples = coarse.shape[:3]
    assert exemplar.coarse is not None
    latest = max(1, exemplar.frames - total + 1, exemplar.frames // 2 if neighbours == 1 else 1)
    if neighbours == 1:
        source = rng.integers(0, exemplar.count, (count,))
        begin = rng.integers(0, latest, (count,))
    else:
        source = _side_by_side(_section(exemplar.coarse, frames_in), _section(coarse, frames_out), neighbours, rng)
        begin = np.full(count, rng.integers(latest))
    element, at = tracks(exemplar, source, total, begin)
    q = np.einsum("nji,nj->ni", frames_in, (exemplar.positions - exemplar.coarse).reshape(-1, 3)).reshape(
        exemplar.positions.shape)
    details = q[at, element]
    positions = coarse + np.einsum("nij,nj->ni", frames_out, details.reshape(-1, 3)).reshape(coarse.shape)
    first_sample = (at * exemplar.count + element)[..., None] * samples
    return Copied(
        Elements(positions, exemplar.grid, rate, exemplar.size[source], exemplar.kind[source],
                 exemplar.colour[source], coarse), (first_sample + np.arange(samples)).ravel().astype(np.int32))
