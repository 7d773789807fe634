"""The paper's method (wang05 §2 and §3): cells of colour move with the flow, holes and blurred cells are filled anew.

    (1) `Synthesis.frame(v)`: the first frame, cell by cell from rotated copies of the sample          §2.1
    (2) `moved`: cells of like velocity move by whole pixels                                           §2.2.1
    (3) `moved` marks invalid pixels; `hole_cells` and `Synthesis._filled` fill them                   §2.2.2, §2.2.3
    (4) `Synthesis._resynthesized`: cells that were blended too often are drawn anew                   §2.3
    (5) the same for each later frame: `Synthesis.frame(v, state)`

Where the text leaves a reading open, `Settings` names it. `moved_pixels` is what the paper warns of (figure 3).

What it does not do: it carries colours, so each blending loses detail that only a new patch brings back. A fifth of
all pixels (canes on circles) to three fifths (straw on vortices) are drawn anew in each frame, and the texture boils.
Patches of least error are dull ones, so a sample of much contrast fades.

Hot: `best_fit` of paper.cl, Eq. 2 at every place of a rotated copy: two thirds of the 0.3 (canes) to 1.1 (straw) CPU
seconds of a frame of 512² from 128². The paper, too, spends "most time" of its 2 minutes a frame there. It is bound by
loads from cache; places whose error passes the least so far are given up early.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from scipy import ndimage

from synth import opencl
from synth.texture import flow
from synth.texture.cells import LARGEST, SMALLEST, Cells, Spread, by_direction, by_velocity, index
from synth.texture.kept import Kept
from synth.texture.sample import Sample, rotated

ROWS_TOGETHER = 4
BEYOND = 16
"""Columns at the right of a copy that are no sample: a vector reads sixteen places."""
ITEMS = 64
"""Work-items that a launch of `best_fit` should have at least: rows of places are dealt out to reach them."""


@dataclass(frozen=True)
class Settings:
    """What the paper sets, and what it leaves open (marked *) with the reading taken by default.

    n                    rotated copies; 24 or 48 in §2.1
    largest, smallest    cell sizes in pixels, §2.1; less than `largest` where the sample is too small for it
    D                    width of the boundary and of the image mask in pixels, Eq. 1
    velocity_factor      of the least speed, by which velocities in a cell may differ: "for example, twice", §2.2.1
    velocity_spread      * what differs: "vectors", or "speeds"
    least, most          * pixels per frame: "we limit the velocity of every pixel within a range", §3
    remainder            * what keeps the distance not yet moved (§3, the accumulated buffer): the moving "texture", or
                         the "place" it passes
    validity             * radians between flow and texture from which a pixel is invalid: "a threshold", §2.2.2
    refill_overlaps      * pixels covered twice are holes, and filled; False: the mean of what covers them
    overblended          mean count of blendings above which a cell is drawn anew, §2.3
    resynthesis_blends   * drawing a cell anew counts as a blending of the pixels around it
    first_frame_blends   * feather blending in the first frame counts
    remove_blur          §2.3 at all; False is figure 7 (a)
    """

    n: int = 48
    largest: int = LARGEST
    smallest: int = SMALLEST
    D: int = 4
    velocity_factor: float = 2.0
    velocity_spread: Spread = "vectors"
    least: float = 0.3
    most: float = 2.4
    remainder: Literal["texture", "place"] = "texture"
    validity: float = float(np.deg2rad(15))
    refill_overlaps: bool = True
    overblended: float = 2.0
    resynthesis_blends: bool = True
    first_frame_blends: bool = False
    remove_blur: bool = True


@dataclass
class State(Kept):
    """A frame, and all that the next one needs.

    colour        (Y, X, 3) float32, linear light; zero where there is no texture
    luminance     (Y, X) float32, what searches compare
    direction     (Y, X) float32, radians: where the texture at each pixel points
    blendings     (Y, X) int32: how often each pixel was blended since it came from the sample, §2.3
    remainder     (Y, X, 2) float32, pixels: distance not yet moved, §3
    holes         (Y, X) bool: what was invalid before it was filled, figure 5; all of the first frame
    texture       (Y, X) bool: where there is texture
    resynthesized share of the pixels that were drawn anew in this frame, as holes or as over-blended
    number        of the frame, 0 the first
    """

    colour: np.ndarray
    luminance: np.ndarray
    direction: np.ndarray
    blendings: np.ndarray
    remainder: np.ndarray
    holes: np.ndarray
    texture: np.ndarray
    resynthesized: float
    number: int


def blending(d: np.ndarray, D: int) -> np.ndarray:
    """Eq. 1: weight of what fills a hole, at distance d > 0 in pixels from it: 0 beyond D, else 1 − d/(D+1)."""
    return np.where(d > D, 0, 1 - d / (D + 1)).astype(np.float32)


# §2.2.3, cells that cover holes


@dataclass(frozen=True)
class Jobs:
    """Cells to fill, in an order in which all of a batch can be filled at once.

    owner   (Y, X) int32: the job whose hole a pixel lies in, -1 in none
    table   (J, 8) int32: x0, y0, x1, y1 of the hole and the boundary around it within the picture, the rotated copy,
            the job's number, 1 where the error is that of the whole cell (§2.3), a seed
    start   (J + 1,) int32: sums of the rectangles' areas
    batches first and last + 1 of jobs whose rectangles do not meet
    """

    owner: np.ndarray
    table: np.ndarray
    start: np.ndarray
    batches: list[tuple[int, int]]


def hole_cells(holes: np.ndarray, angles: np.ndarray, n: int, largest: int = LARGEST,
               smallest: int = SMALLEST) -> np.ndarray:
    """§2.2.3: the rectangular cell in which each pixel of a hole is filled: (Y, X) int32, -1 outside holes.

    1. A rectangle covers each hole (pixels that touch, at corners too).
    2. One that is larger than the largest size, or, while larger than the smallest, holds directions that differ by
       2π/n or more, is cut into four; each quarter shrinks to what of the hole it covers.
    """
    y, x = np.nonzero(holes)
    label, _ = ndimage.label(holes, np.ones((3, 3)))
    angle, label = angles[y, x].astype(np.float64), label[y, x]
    cell, found, pixels = np.full(holes.shape, -1, np.int32), 0, np.arange(len(y))
    while len(pixels):
        order = np.argsort(label[pixels], kind="stable")
        pixels = pixels[order]
        first, of = np.unique(label[pixels], return_index=True, return_inverse=True)[1:]
        turn = angle[pixels] - angle[pixels][first][of]
        turn -= 2 * np.pi * np.rint(turn / (2 * np.pi))
        low_x, high_x, low_y, high_y, low_turn, high_turn = (
            bound.reduceat(values, first) for values in (x[pixels], y[pixels], turn)
            for bound in (np.minimum, np.maximum))
        side = np.maximum(high_x - low_x, high_y - low_y) + 1
        cut = (side > largest) | ((side > smallest) & (high_turn - low_turn >= 2 * np.pi / n))
        number = found + np.cumsum(~cut) - 1
        done = pixels[~cut[of]]
        cell[y[done], x[done]] = number[of[~cut[of]]]
        found += int((~cut).sum())
        again, of = pixels[cut[of]], of[cut[of]]
        right = x[again] > (low_x + high_x)[of] // 2
        upper = y[again] > (low_y + high_y)[of] // 2
        label[again] = 4 * of + 2 * upper + right
        pixels = again
    return cell


def jobs(owner: np.ndarray, angles: np.ndarray, settings: Settings, seed: np.random.Generator, whole: bool = False,
         in_order: bool = False) -> Jobs:
    """What fills the holes `owner` (Y, X), -1 in none, for a flow with directions `angles` (Y, X).

    Each from the rotated copy nearest to the mean direction of its pixels. Batches hold cells of like size that do not
    meet, the largest first; or with `in_order` as many as depend on no earlier one, "from left to right and bottom to
    top" (§2.1).
    """
    y, x = np.nonzero(owner >= 0)
    numbers, of = np.unique(owner[y, x], return_inverse=True)
    order = np.argsort(of, kind="stable")
    first = np.searchsorted(of[order], np.arange(len(numbers)))
    x0, x1, y0, y1 = ((bound.reduceat(places[order], first) if len(first) else first)
                      for places in (x, y) for bound in (np.minimum, np.maximum))
    angle = angles[y, x].astype(np.float64)
    sine, cosine = (np.bincount(of, f(angle), len(numbers)) for f in (np.sin, np.cos))
    copy = np.rint(np.arctan2(sine, cosine) * settings.n / (2 * np.pi)).astype(int) % settings.n
    # left to right and bottom to top, also of cells whose hole covers a part of them
    rank = np.lexsort((x0, y0))
    batch = (_waves if in_order else _apart)(x0[rank], y0[rank], x1[rank], y1[rank], settings.D)
    rank = rank[(by_batch := np.argsort(batch, kind="stable"))]
    bounds = np.flatnonzero(np.diff(batch[by_batch], prepend=-1, append=-1)) if len(rank) else np.zeros(0, int)
    height, width = owner.shape
    D, J = settings.D, len(numbers)
    table = np.stack([np.maximum(x0 - D, 0), np.maximum(y0 - D, 0), np.minimum(x1 + D + 1, width),
                      np.minimum(y1 + D + 1, height), copy, np.zeros(J, int), np.full(J, whole),
                      seed.integers(2**31, size=J)], axis=1)[rank].astype(np.int32)
    table[:, 5] = np.arange(J)
    area = (table[:, 2] - table[:, 0]) * (table[:, 3] - table[:, 1])
    renumbered = np.empty(J, np.int32)
    renumbered[rank] = np.arange(J)
    job = np.full(owner.shape, -1, np.int32)
    job[y, x] = renumbered[of]
    return Jobs(job, table, np.append(0, np.cumsum(area)).astype(np.int32),
                list(zip(bounds[:-1].tolist(), bounds[1:].tolist(), strict=True)))


def _apart(x0: np.ndarray, y0: np.ndarray, x1: np.ndarray, y1: np.ndarray, D: int) -> np.ndarray:
    """For each rectangle a batch in which no other, D wider on each side, meets it: (J,) int.

    Rectangles of sides up to s lie, by their lower left corners, in squares of s + 2D pixels; squares that are two
    apart hold none that meet. Of the rectangles in a square each is in a batch of its own.
    """
    size = 1 << np.ceil(np.log2(np.maximum(np.maximum(x1 - x0, y1 - y0) + 1, 4))).astype(int)
    column, row = x0 // (size + 2 * D), y0 // (size + 2 * D)
    order = np.lexsort((column, row, size))
    square = np.stack([size, row, column])[:, order]
    begins = np.ones(len(order), bool)
    begins[1:] = (square[:, 1:] != square[:, :-1]).any(0)
    place = np.arange(len(order))
    within = np.empty(len(order), int)
    within[order] = place - np.maximum.accumulate(np.where(begins, place, 0))
    key = np.stack([-size, within, row % 2, column % 2])
    return np.unique(key, axis=1, return_inverse=True)[1].reshape(-1)


def _waves(x0: np.ndarray, y0: np.ndarray, x1: np.ndarray, y1: np.ndarray, D: int) -> np.ndarray:
    """For each rectangle the first batch after all of earlier rectangles that, D wider, meet it: (J,) int."""
    block = 4
    wave = np.zeros(len(x0), int)
    last = np.full(((int(y1.max(initial=0)) + D) // block + 1, (int(x1.max(initial=0)) + D) // block + 1), -1)
    bounds = (np.maximum(x0 - D, 0) // block, np.maximum(y0 - D, 0) // block, (x1 + D) // block + 1,
              (y1 + D) // block + 1)
    for job, (left, low, right, high) in enumerate(zip(*(b.tolist() for b in bounds), strict=True)):
        seen = last[low:high, left:right]
        wave[job] = seen.max() + 1
        seen[:] = wave[job]
    return wave


# References of the kernels


def masks_reference(owner: np.ndarray, valid: np.ndarray, job: np.ndarray, D: int) -> tuple[np.ndarray, np.ndarray]:
    """Specification of `masks`: of one job's rectangle, the weight of Eq. 1 (0 where nothing is written, 1 in the
    hole), and the characteristic function T of Eq. 2."""
    x0, y0, x1, y1, _, number, whole, _ = job.tolist()
    hole, known = owner[y0:y1, x0:x1] == number, valid[y0:y1, x0:x1].astype(bool)
    d = ndimage.distance_transform_edt(~hole)
    weight = np.where(hole, 1, np.where(known, blending(d, D), 0)).astype(np.float32)
    return weight, (weight > 0) & known & (bool(whole) | ~hole)


def best_fit_reference(luminance: np.ndarray, valid: np.ndarray, F: np.ndarray, T: np.ndarray,
                       seed: int) -> tuple[float, int, int]:
    """Specification of `best_fit` (Eq. 2): least E and its place (u, v) in a copy `luminance` (R, C).

    F, T (B2, B1): luminance in the rectangle, and the mask. Without a mask the place is random.
    """
    rows, columns = (n - b + 1 for n, b in zip(luminance.shape, F.shape, strict=True))
    missing = np.zeros((rows, columns), int)
    E = np.zeros((rows, columns))
    for j, i in np.ndindex(F.shape):
        missing += ~valid[j : j + rows, i : i + columns]
        if T[j, i]:
            E += (float(F[j, i]) - luminance[j : j + rows, i : i + columns].astype(np.float64)) ** 2
    if not T.any():
        at = np.arange(rows)[:, None] * luminance.shape[1] + np.arange(columns)
        E += _scrambled(at.astype(np.uint32) ^ np.uint32(seed)) >> 8
    E[missing > 0] = np.inf
    v, u = divmod(int(E.argmin()), columns)
    return float(E[v, u]), u, v


def _scrambled(h: np.ndarray) -> np.ndarray:
    h = (h ^ (h >> 16)) * np.uint32(0x7FEB352D)
    h = (h ^ (h >> 15)) * np.uint32(0x846CA68B)
    return h ^ (h >> 16)


def paste_reference(patch: np.ndarray, hole: np.ndarray, weight: np.ndarray, surroundings: np.ndarray) -> np.ndarray:
    """Specification of `paste`: the patch (B2, B1, 4) in the hole, and blended by Eq. 1 around it."""
    B = weight[..., None]
    return np.where(hole[..., None], patch, B * patch + (1 - B) * surroundings).astype(np.float32)


# §2.2.1 and §2.2.2


@dataclass(frozen=True)
class Moved:
    """What cells carried to each pixel, as in `State`; arbitrary in holes.

    picture (Y, X, 4) float32: colour and luminance.
    """

    picture: np.ndarray
    direction: np.ndarray
    blendings: np.ndarray
    remainder: np.ndarray
    holes: np.ndarray


def moved(state: State, v: np.ndarray, angles: np.ndarray, texture: np.ndarray, settings: Settings) -> Moved:
    """§2.2.1, moving patches, and §2.2.2, checking validity of pixels.

    v (Y, X, 2) pixels per frame within the limits of speed, angles (Y, X) its directions, texture (Y, X) bool where the
    new frame has texture.

    1. Cells under the velocity constraint.
    2. Each moves by whole pixels: its average velocity and what it has not yet moved, rounded; the rest is kept.
    3. Pixels covered by no cell, or by more than one, are invalid.
    4. So are those where the flow's direction and the mean direction of the covering cell's texture differ too much.
    """
    shape = v.shape[:2]
    # 1
    cell = index(by_velocity(v, settings.velocity_factor, settings.velocity_spread, settings.largest,
                             settings.smallest), shape)
    source = np.flatnonzero(state.texture)
    of = cell.ravel()[source]
    pixels = np.maximum(np.bincount(of, minlength=cell.max() + 1), 1)

    def mean(values: np.ndarray) -> np.ndarray:
        return np.bincount(of, values.ravel()[source], len(pixels)) / pixels

    # 2
    wanted = np.stack([mean(v[..., c] + state.remainder[..., c].astype(np.float64)) for c in (0, 1)], axis=-1)
    step = np.rint(wanted).astype(int)
    rest = (wanted - step).astype(np.float32)
    y, x = np.divmod(source, shape[1])
    y, x = y + step[of, 1], x + step[of, 0]
    inside = (y >= 0) & (y < shape[0]) & (x >= 0) & (x < shape[1])
    source, of, target = source[inside], of[inside], (y * shape[1] + x)[inside]
    # 3
    covers = np.bincount(target, minlength=cell.size)
    once = covers == 1

    def carried(values: np.ndarray) -> np.ndarray:
        """Each pixel's one source, or the mean of several."""
        return np.bincount(target, values, cell.size) / np.maximum(covers, 1)

    origin, by = np.rint(carried(source)).astype(int), np.rint(carried(of)).astype(int)
    picture = np.dstack([state.colour, state.luminance]).reshape(-1, 4)[origin]
    direction, blendings = state.direction.ravel()[origin], state.blendings.ravel()[origin]
    remainder = rest[by]
    turn = np.arctan2(mean(np.sin(state.direction)), mean(np.cos(state.direction)))[by]
    valid = once
    if not settings.refill_overlaps:
        several = covers > 1
        of_picture = np.dstack([state.colour, state.luminance]).reshape(-1, 4)[source]
        picture[several] = np.stack([carried(of_picture[:, c]) for c in range(4)], axis=-1)[several]
        of_direction = state.direction.ravel()[source]
        circular = np.arctan2(carried(np.sin(of_direction)), carried(np.cos(of_direction)))
        direction, turn = np.where(several, circular, direction), np.where(several, circular, turn)
        count = np.rint(carried(state.blendings.ravel()[source])).astype(np.int32)
        blendings = np.where(several, count + 1, blendings)
        for c in (0, 1):
            remainder[:, c] = np.where(several, carried(rest[of, c]), remainder[:, c])
        valid = covers > 0
    # 4
    off = angles.ravel() - turn
    off -= 2 * np.pi * np.rint(off / (2 * np.pi))
    # what rests has no direction
    valid = valid & ((np.abs(off) <= settings.validity) | (v == 0).all(-1).ravel())
    if settings.remainder == "place":
        remainder = rest[cell.ravel()]
    else:
        remainder[~valid] = 0
    return Moved(picture.reshape(*shape, 4), direction.reshape(shape).astype(np.float32),
                 blendings.reshape(shape).astype(np.int32), remainder.reshape(*shape, 2),
                 ~valid.reshape(shape) & texture)


def moved_pixels(picture: np.ndarray, v: np.ndarray, frames: int) -> np.ndarray:
    """Figure 3: "move all pixels in the previous frame following the vector field", `frames` times, and nothing else.

    picture (Y, X, C), v (Y, X, 2) pixels per frame, steady -> (Y, X, C) float32. Each pixel looks up where it came
    from, one frame after the other; a way from beyond the border begins at it.
    """
    y, x = np.mgrid[: v.shape[0], : v.shape[1]]
    places = np.stack([x.ravel(), y.ravel()], axis=-1).astype(np.float64)
    most = np.array([v.shape[1] - 1, v.shape[0] - 1])
    for _ in range(frames):
        places = np.clip(places - flow.at(v, places), 0, most)
    return flow.at(picture, places).reshape(picture.shape)


# the method


class Synthesis:
    """wang05 of one sample and one size of picture, `shape` (Y, X).

    Raises ValueError where a sample is too small for a cell with its boundary, in any rotated copy.
    """

    def __init__(self, sample: Sample, shape: tuple[int, int], settings: Settings, seed: int):
        self.shape, self.seed = shape, seed
        copies = rotated(sample, settings.n)
        valid = copies.valid
        self.rows, self.columns = valid.shape[1:]
        beyond = ((0, 0), (0, ROWS_TOGETHER), (0, BEYOND))
        missing = np.pad(~valid, beyond, constant_values=True)
        outside = np.pad(missing.cumsum(1, dtype=np.int32).cumsum(2, dtype=np.int32), ((0, 0), (1, 0), (1, 0)))
        self.settings = _fitting(settings, outside[:, : self.rows + 1, : self.columns + 1], sample)
        colours = np.concatenate([copies.colour, copies.luminance[..., None]], -1) * valid[..., None]
        colours = np.pad(colours, (*beyond, (0, 0))).astype(np.float32)
        self._copies, self._luminance = opencl.to_device(colours), opencl.to_device(colours[..., 3])
        self._outside = opencl.to_device(outside)
        d = np.sqrt(np.arange((settings.D + 1) ** 2 + 1))
        self._weights = opencl.to_device(blending(d, settings.D))
        self._program = opencl.program(Path(__file__).with_suffix(".cl"), REACH=settings.D, COLUMNS=self.columns,
                                       ROWS=self.rows, TOGETHER=ROWS_TOGETHER)

    def frame(self, v: np.ndarray, state: State | None = None, mask: np.ndarray | None = None) -> State:
        """The frame after `state`, or the first, in a flow v (Y, X, 2), pixels per frame.

        mask (Y, X) bool: where there is texture (everywhere); pixels at which v is no number have none.
        """
        if v.shape != (*self.shape, 2):
            raise ValueError(f"a flow of shape {v.shape} for a picture of {self.shape}")
        texture = np.isfinite(v).all(-1)
        if mask is not None:
            texture &= mask
        angles = flow.angles(np.where(texture[..., None], v, np.nan))
        if state is None:
            return self._first(angles, texture)
        # steps 2 and 3
        v = flow.limited(np.where(texture[..., None], v, 0), self.settings.least, self.settings.most)
        carried = moved(state, v, angles, texture, self.settings)
        canvas = Canvas(carried.picture, texture & ~carried.holes, carried.blendings, carried.direction,
                        self.settings.n)
        seeds = np.random.Generator(np.random.Philox(key=[self.seed, state.number + 1]))
        self._fill(canvas, self._hole_jobs(carried.holes, angles, seeds), blends=True)
        # step 4
        drawn = carried.holes | self._resynthesized(canvas, angles, texture, seeds)
        return canvas.state(carried.remainder, carried.holes, texture, float(drawn.mean()), state.number + 1)

    def picture(self, state: State) -> np.ndarray:
        """The frame: (Y, X, 3) float32, linear light."""
        return state.colour

    def holes(self, state: State) -> np.ndarray:
        """Figure 5: (Y, X) bool, the pixels that were invalid before they were filled."""
        return state.holes

    def _first(self, angles: np.ndarray, texture: np.ndarray) -> State:
        """§2.1: cells under the direction constraint, from left to right and bottom to top, each with the patch that
        fits what is already there best; feather blending by Eq. 1.

        The boundary is L-shaped where the neighbours at the left and below are there; where cells of other sizes came
        first, they are part of it too.
        """
        owner = np.where(texture, index(self._cells(angles), self.shape), -1)
        canvas = Canvas(np.zeros((*self.shape, 4), np.float32), np.zeros(self.shape, bool),
                        np.zeros(self.shape, np.int32), np.zeros(self.shape, np.float32), self.settings.n)
        seeds = np.random.Generator(np.random.Philox(key=[self.seed, 0]))
        self._fill(canvas, jobs(owner, angles, self.settings, seeds, in_order=True), self.settings.first_frame_blends)
        return canvas.state(np.zeros((*self.shape, 2), np.float32), texture, texture, float(texture.mean()), 0)

    def _cells(self, angles: np.ndarray) -> Cells:
        s = self.settings
        return by_direction(angles, s.n, s.largest, s.smallest)

    def _hole_jobs(self, holes: np.ndarray, angles: np.ndarray, seeds: np.random.Generator) -> Jobs:
        """§2.2.3: one job for each cell that covers a hole or a part of it."""
        s = self.settings
        return jobs(hole_cells(holes, angles, s.n, s.largest, s.smallest), angles, s, seeds)

    def _resynthesized(self, canvas: Canvas, angles: np.ndarray, texture: np.ndarray,
                       seeds: np.random.Generator) -> np.ndarray:
        """§2.3: draw anew the cells whose average count of blendings is above the threshold; (Y, X) bool, which.

        The error is "not defined within the boundary but in the whole cell": both count.
        """
        if not self.settings.remove_blur:
            return np.zeros(self.shape, bool)
        cell = index(self._cells(angles), self.shape)
        of, blendings = cell[texture], canvas.blendings.get()[texture]
        pixels = np.bincount(of, minlength=cell.max() + 1)
        over = (np.bincount(of, blendings, len(pixels)) > self.settings.overblended * pixels)[cell] & texture
        self._fill(canvas, jobs(np.where(over, cell, -1), angles, self.settings, seeds, whole=True),
                   self.settings.resynthesis_blends)
        return over

    def _fill(self, canvas: Canvas, jobs: Jobs, blends: bool) -> None:
        """§2.2.3: for each job its mask, its best fit by Eq. 2, and that pasted and blended by Eq. 1."""
        if not len(jobs.table):
            return
        table, start, owner = (opencl.to_device(a) for a in (jobs.table, jobs.start, jobs.owner))
        total = int(jobs.start[-1])
        weight, offset, value = opencl.empty(total), opencl.empty(total, np.int32), opencl.empty(total)
        length = opencl.empty(len(jobs.table), np.int32)
        launches = [(first, last, self._parts(last - first)) for first, last in jobs.batches]
        most = max((last - first) * parts for first, last, parts in launches)
        error, place = opencl.empty(most), opencl.empty(most, np.int32)
        shape = np.array(self.shape[::-1], np.int32)
        for first, last, parts in launches:
            count, begin = last - first, np.int32(first)
            self._program.masks((count,), (1,), owner, canvas.valid, canvas.picture, shape, table, start, begin,
                                self._weights, weight, offset, value, length)
            self._program.best_fit((parts, count), (1, 1), self._luminance, self._outside, table, start, begin, offset,
                                   value, length, error, place)
            self._program.paste((count,), (1,), self._copies, table, start, begin, weight, error, place,
                                np.int32(parts), np.int32(blends), shape, owner, canvas.picture, canvas.valid,
                                canvas.blendings, canvas.direction)

    def _parts(self, count: int) -> int:
        """Into how many parts the rows of each of `count` searches are dealt; the result is the same for any."""
        return min(-(-ITEMS // count), -(-self.rows // ROWS_TOGETHER))


class Canvas:
    """A frame in the making, on the device: picture (Y, X, 4), valid (Y, X) uint8, blendings and copy (Y, X) int32."""

    def __init__(self, picture: np.ndarray, valid: np.ndarray, blendings: np.ndarray, direction: np.ndarray, n: int):
        self.n = n
        self.picture = opencl.to_device(picture * valid[..., None].astype(np.float32))
        self.valid = opencl.to_device(valid.astype(np.uint8))
        self.blendings = opencl.to_device(blendings)
        self.direction = opencl.to_device(np.rint(direction * (n / (2 * np.pi))).astype(np.int32) % n)

    def state(self, remainder: np.ndarray, holes: np.ndarray, texture: np.ndarray, drawn: float, number: int) -> State:
        picture = self.picture.get()
        direction = (self.direction.get() * (2 * np.pi / self.n)).astype(np.float32)
        return State(np.ascontiguousarray(picture[..., :3]), np.ascontiguousarray(picture[..., 3]), direction,
                     self.blendings.get(), remainder, holes, texture, drawn, number)


def _fitting(settings: Settings, outside: np.ndarray, sample: Sample) -> Settings:
    """The settings with the largest size of cell of which, with its boundary, each copy holds one at least.

    outside (n, R + 1, C + 1): how many pixels below and left are no sample.
    """
    size = settings.largest
    while size >= settings.smallest:
        side = size + 2 * settings.D
        if side < min(outside.shape[1:]):
            missing = (outside[:, side:, side:] - outside[:, :-side, side:] - outside[:, side:, :-side]
                       + outside[:, :-side, :-side])
            if (missing == 0).any(axis=(1, 2)).all():
                return replace(settings, largest=size)
        size //= 2
    height, width = sample.shape
    raise ValueError(f"a sample of {width} x {height} pixels is too small: turned, it must hold whole squares of "
                     f"{settings.smallest} + 2 x {settings.D} pixels")
