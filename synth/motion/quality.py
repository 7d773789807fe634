"""The quality of a synthesized detail field: five numbers that detect blur and emptiness, and whole motifs.

All on H before the coordinate transformation, neighbourhoods oriented as in the search (ma09 §3.3), the exemplar
toroidal. Distances are rms over the neighbourhood, divided by the rms of the exemplar.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from synth import opencl
from synth.motion.neighborhood import Space, exemplar_patches
from synth.motion.search import Matcher
from synth.motion.views import View, ViewSearch, on_device, site_grid

RADIUS = 4
# exemplar neighbourhoods weaker than this share of the exemplar's rms do not count for `used`
FAINT = 0.05
# neighbourhoods that agree to this share of the exemplar's rms count as the same
SAME = 1e-3
# what a cell of a motif must have of the exemplar's largest magnitude
SUPPORT = 0.2
# pieces smaller than this share of a motif are dust, not a broken motif
DUST = 0.1
WHOLE = 0.8


@dataclass(frozen=True)
class Quality:
    """forward, backward: mean distances output -> exemplar and back; used: share of the exemplar's neighbourhoods
    that are the nearest of some output neighbourhood; rms, gradient: ratios of H's to the exemplar's."""

    forward: float
    backward: float
    used: float
    rms: float
    gradient: float


def _rms(field: np.ndarray) -> float:
    return float(np.sqrt(np.mean(field.astype(np.float64) ** 2)))


def _gradient(field: np.ndarray, toroidal: bool) -> float:
    x = (np.roll(field, -1, 1) if toroidal else field[:, 1:]) - (field if toroidal else field[:, :-1])
    y = (np.roll(field, -1, 0) if toroidal else field[1:]) - (field if toroidal else field[:-1])
    return (float(np.mean(np.linalg.norm(x, axis=-1))) + float(np.mean(np.linalg.norm(y, axis=-1)))) / 2


def _identical(patches: np.ndarray, step: float) -> np.ndarray:
    """A number for each of patches (E, C), equal where they agree to `step`: (E,) int.

    Along a stripe all neighbourhoods are the same, and which of them is found nearest is arbitrary.
    """
    rounded = np.ascontiguousarray(np.rint(patches / step).astype(np.int32))
    rows = rounded.view(np.dtype((np.void, rounded.dtype.itemsize * rounded.shape[1])))
    return np.unique(rows, return_inverse=True)[1].reshape(-1)


def _mean_distance(squared: np.ndarray, length: int) -> float:
    """Mean of the rms distances over `length` numbers, squared (S,) their squared sums."""
    return float(np.mean(np.sqrt(squared.astype(np.float64) / length)))


def _whole_space(patches: np.ndarray) -> Space:
    """The neighbourhoods (E, C) themselves as a space, only rotated so that the first dimensions vary most, by which
    the search can pass over many; zero columns up to a multiple of 16."""
    length = patches.shape[1]
    mean = patches.mean(axis=0)
    centred = (patches - mean).astype(np.float64)
    _, vectors = np.linalg.eigh(centred.T @ centred)
    basis = np.zeros((length, -(-length // 16) * 16), np.float32)
    basis[:, :length] = vectors[:, ::-1]
    return Space(RADIUS, mean, basis, (patches - mean) @ basis)


def measure(H: np.ndarray, axes: np.ndarray, exemplar: np.ndarray) -> Quality:
    """The five numbers of H (Y, X, 2) with local axes (Y, X, 2) against exemplar (N, M, 2), 9² neighbourhoods.

    Output neighbourhoods are those that lie wholly inside H. Raises ValueError where H is too small to hold one.
    """
    inset = int(np.ceil(RADIUS * np.sqrt(2)))
    if min(H.shape[:2]) <= 2 * inset:
        raise ValueError(f"a field of {H.shape[1]} x {H.shape[0]} cells holds no neighbourhood of 9 x 9")
    xs, ys = np.meshgrid(np.arange(inset, H.shape[1] - inset), np.arange(inset, H.shape[0] - inset))
    sites = np.stack([xs, ys], axis=-1).reshape(-1, 2).astype(np.int32)
    ours = exemplar_patches(exemplar, RADIUS)
    whole = _whole_space(ours)
    theirs = whole.project(opencl.to_device(H), opencl.to_device(sites),
                           opencl.to_device(axes[sites[:, 1], sites[:, 0]]))
    best, forward = Matcher(whole, exemplar.shape[:2], 1).exact(theirs)
    seen = Space(RADIUS, whole.mean, whole.basis, theirs.get())
    _, backward = Matcher(seen, H.shape[:2], 1).exact(opencl.to_device(whole.points))
    rms = max(_rms(exemplar), 1e-12)
    visible = np.sqrt(np.mean(ours.astype(np.float64) ** 2, axis=1)) > FAINT * rms
    same = _identical(ours, SAME * rms)
    nearest = np.isin(same, same[best.get()])

    length = ours.shape[1]
    return Quality(_mean_distance(forward.get(), length) / rms, _mean_distance(backward.get(), length) / rms,
                   float(nearest[visible].mean()) if visible.any() else 1.0, _rms(H) / rms,
                   _gradient(H, False) / max(_gradient(exemplar, True), 1e-12))


def measure_view(H: np.ndarray, axes: np.ndarray, view: View) -> Quality:
    """The five numbers of H (Z, Y, X, 3), local coordinates, as one view sees it; axes (Z, Y, X, 3, 3).

    9² neighbourhoods on every second cell, in the space of the exemplar's own; the gradients are along right and up.
    """
    width = 2 * RADIUS + 1
    search = ViewSearch(view, view.exemplar, view.projection.T, width)
    inset = int(np.ceil(RADIUS * np.sqrt(3)))
    if min(H.shape[:3]) <= 2 * inset:
        raise ValueError(f"a field of {H.shape[2]} x {H.shape[1]} x {H.shape[0]} cells holds no neighbourhood of 9³")
    local = axes[site_grid(H.shape[:3], width)]
    whole = np.zeros(local.shape[:3], bool)
    whole[(slice(inset // 2, -(inset // 2)),) * 3] = True
    queries = search.queries(on_device(H), search.basis_at(local), local.shape[:3], 0, whole.size).get()[whole.ravel()]
    space, length = search.matcher.space, search.matcher.space.length
    best, forward = search.matcher.exact(opencl.to_device(queries))
    theirs = Space(RADIUS, space.mean, space.basis, queries)
    _, backward = Matcher(theirs, (1, len(queries)), 1).exact(opencl.to_device(space.points))
    rms = max(_rms(view.exemplar), 1e-12)
    patches = exemplar_patches(view.exemplar, RADIUS)
    visible = np.sqrt(np.mean(patches.astype(np.float64) ** 2, axis=1)) > FAINT * rms
    same = _identical(patches, SAME * rms)
    seen = H @ view.projection.T.astype(np.float32)
    slopes = np.stack(np.gradient(seen, axis=(2, 1, 0)), -1) @ (axes @ view.basis[:2].T.astype(np.float32))
    continued = np.pad(view.exemplar, ((1, 1), (1, 1), (0, 0)), mode="wrap")
    ours = np.stack(np.gradient(continued, axis=(1, 0)), -1)[1:-1, 1:-1]

    def steepness(gradient: np.ndarray) -> float:
        return float(np.mean(np.linalg.norm(gradient, axis=-2)))

    return Quality(_mean_distance(forward.get(), length) / rms, _mean_distance(backward.get(), length) / rms,
                   float(np.isin(same, same[best.get()])[visible].mean()), _rms(seen) / rms,
                   steepness(slopes) / max(steepness(ours), 1e-12))


def oriented(H: np.ndarray, at: np.ndarray, e: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Windows of H (Y, X, 2) round positions at (K, 2) as x, y, rotated by e (K, 2): (K, rows, columns, 2)."""
    j, i = np.meshgrid(*(np.arange(n) - (n - 1) / 2 for n in size), indexing="ij")
    x = at[:, 0, None, None] + e[:, 0, None, None] * i - e[:, 1, None, None] * j
    y = at[:, 1, None, None] + e[:, 1, None, None] * i + e[:, 0, None, None] * j
    return np.stack([ndimage.map_coordinates(H[..., c], [y, x], order=1, mode="constant") for c in (0, 1)], axis=-1)


def motif(exemplar: np.ndarray) -> np.ndarray:
    """The bounding box of a closed motif in its exemplar (N, N, 2): (rows, columns, 2).

    Raises ValueError if the exemplar is not a single motif on an empty background.
    """
    support = np.linalg.norm(exemplar, axis=-1) > SUPPORT / 4 * np.linalg.norm(exemplar, axis=-1).max()
    if support[[0, -1]].any() or support[:, [0, -1]].any():
        raise ValueError("the exemplar's motif reaches its border: it is not closed")
    rows, columns = np.flatnonzero(support.any(1)), np.flatnonzero(support.any(0))
    return exemplar[rows[0]:rows[-1] + 1, columns[0]:columns[-1] + 1]


def whole_motifs(H: np.ndarray, axes: np.ndarray, exemplar: np.ndarray) -> tuple[int, int]:
    """(whole, all): motifs of H (Y, X, 2) not cut by the border, and those of them that are whole.

    A connected piece of H counts as its area over the motif's, rounded, and as one at least; a motif is whole
    where some place in the piece correlates >= 0.8 with the exemplar's motif in its local axes.
    """
    template = motif(exemplar)
    strong = SUPPORT * np.linalg.norm(exemplar, axis=-1).max()
    area = int((np.linalg.norm(template, axis=-1) > strong).sum())
    # closing: a swirl's still centre does not cut it in two
    reach = max(1, min(template.shape[:2]) // 16)
    padded = np.pad(np.linalg.norm(H, axis=-1) > strong, reach, mode="edge")
    support = ndimage.binary_closing(padded, iterations=reach)[reach:-reach, reach:-reach]
    pieces = ndimage.label(support, np.ones((3, 3)))[0]
    whole = total = 0
    for label, box in enumerate(ndimage.find_objects(pieces), start=1):
        cells = int((pieces[box] == label).sum())
        touches = any(s.start == 0 or s.stop == n for s, n in zip(box, H.shape[:2], strict=True))
        if touches or cells < DUST * area:
            continue
        expected = max(1, round(cells / area))
        total += expected
        whole += min(expected, _peaks(H, axes, template, box))
    return whole, total


def _peaks(H: np.ndarray, axes: np.ndarray, template: np.ndarray, box: tuple[slice, ...]) -> int:
    """How many separate places in a box of H correlate with the template to WHOLE or more."""
    step = max(1, min(template.shape[:2]) // 24)
    ys, xs = (grid.ravel() for grid in np.mgrid[box[0].start:box[0].stop:step, box[1].start:box[1].stop:step])
    at = np.stack([xs, ys], axis=-1).astype(float)
    windows = oriented(H, at, axes[ys, xs], template.shape[:2]).reshape(len(at), -1)
    norm = np.linalg.norm(windows, axis=1) * np.linalg.norm(template)
    correlation = windows @ template.reshape(-1) / np.maximum(norm, 1e-12)
    found: list[np.ndarray] = []
    for k in np.argsort(-correlation, kind="stable"):
        if correlation[k] < WHOLE:
            break
        if all(np.linalg.norm(at[k] - other) > min(template.shape[:2]) / 2 for other in found):
            found.append(at[k])
    return len(found)
