"""Synthesis of an output from an exemplar (ma13 §4.1, §4.2, figure 4): search, assignment, extra solver step.

`together` optimizes all frames at once, `by_frames` one after the other; both iterate the same step,
`Optimizer.iterate`, which returns the energy of Eq. 5. The energy falls, except where Θ conflicts with the exemplar.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from synth.elements import assignment, collision
from synth.elements.assignment import Anchors
from synth.elements.constraints import Constraints
from synth.elements.samples import Elements
from synth.elements.search import Exemplar, Matches, Output, Searcher

Flow = Callable[[int, np.ndarray], np.ndarray]
"""The displacement (M, D), world units, of points (M, D) from frame t (from 0) to the next."""

Rotation = Callable[[int, np.ndarray], np.ndarray]
"""Local axes (M, D, D) at points (M, D) in frame t."""

SAME = 1e-6  # energy per sample, in squared radii of the neighbourhood, below which the output equals the exemplar
STAYS = 1e-3  # share by which the energy falls in an iteration when it has converged


@dataclass(frozen=True)
class Settings:
    """How an output is optimized.

    iterations  of search and assignment; with all frames together at most, fewer if the energy converges
    n           matches that predict together (§4.2: 2; 1 is the basic synthesis of §4.1)
    coherent    k-coherence, else exhaustive search
    solver      "sparse": all positions at once; "local": each by its neighbours as constants, `sweeps` times
    centre      weight of the anchored details q themselves, in search and assignment
    inertia     frame by frame: weight of the position to which a sample is carried from the frame before, in units of
                the weight of its neighbours' predictions
    control     weight of the control map's difference in the search
    hybrid      resolve collisions: of points after each assignment, of threads at the end
    """

    iterations: int = 8
    n: int = 2
    coherent: bool = True
    solver: str = "sparse"
    sweeps: int = 6
    centre: float = 0.3
    inertia: float = 3.0
    control: float = 0.0
    hybrid: bool = False


@dataclass(frozen=True)
class Controls:
    """User controls of an output (§4.1): constraints, a global flow, an orientation field, maps.

    flow      None: there is no flow
    rotation  the local axes at points; None: `axes`
    axes      (T·E·S, D, D) local axes of elements with a coarse motion; None: those of the domain
    control   the control map's value (M,) at points (M, D) of frame t
    allowed   bits (M,) of the kinds allowed there
    period    (D,) of a toroidal output, 0 along axes that end
    """

    constraints: Constraints = field(default_factory=Constraints)
    flow: Flow | None = None
    rotation: Rotation | None = None
    axes: np.ndarray | None = None
    control: Callable[[int, np.ndarray], np.ndarray] | None = None
    allowed: Callable[[int, np.ndarray], np.ndarray] | None = None
    period: np.ndarray | None = None


class Optimizer:
    """The state of one output during its optimization: positions, matches and energies.

    exemplar  neighbourhoods of the exemplar
    start     the initial output, all its frames
    source    (T·E·S,) int32: the exemplar sample that each was copied from, -1: none
    """

    def __init__(self, exemplar: Exemplar, start: Elements, source: np.ndarray, controls: Controls, settings: Settings):
        self.exemplar, self.controls, self.settings = exemplar, controls, settings
        self.elements = start
        self.positions = start.positions.astype(np.float64)
        self.size = start.count * start.positions.shape[2]
        self.searcher = Searcher(exemplar, settings.n, settings.coherent, settings.centre, settings.control)
        self.matches = Matches.none(start.frames * self.size, settings.n, exemplar.shape)
        self.matches.sample[:, 0] = source
        self.radius = np.repeat(start.size, start.positions.shape[2]).astype(np.float64)
        self.element = np.repeat(np.arange(start.count), start.positions.shape[2])
        self.energies: list[float] = []
        self.carried: np.ndarray | None = None  # frame by frame: the positions at the start of a frame

    def iterate(self, active: np.ndarray, known: int) -> float:
        """One search and one assignment of the samples in the frames `active` (§4.1, figure 4).

        1. Search: find the matches of each active sample (Eq. 4).
        2. Collect the soft terms of Θ.
        3. Measure the energy per sample (Eq. 5), before the assignment.
        4. Collect what the matches predict (Eqs. 6, 11).
        5. Assignment: move all active samples but the pinned ones towards the minimum (Eq. 7).
        6. Correct: resolve collisions and enforce the hard constraints.

        Frames from `known` on do not exist yet. Returns the energy.
        """
        # 1. search
        output, coarse = self._output(active, known)
        self.searcher.nearest(output, active, self.matches)
        samples = self._samples(active)
        # 2. soft constraints
        anchors = Anchors.all(list(self._anchors(output, coarse, active)), output.positions.shape[3])
        flat = self.positions.reshape(-1, output.positions.shape[3])
        # 3. energy
        distance = self.matches.distance[samples, 0]
        misfit = anchors.weight[:, None] * (flat[anchors.sample] - anchors.target) ** 2
        energy = float((np.sum(distance[np.isfinite(distance)], dtype=np.float64) + misfit.sum()) / len(samples))
        # 4. predictions
        terms = assignment.predictions(self.exemplar, output, coarse, self.matches, active)
        # 5. assignment
        free = np.zeros(len(flat), bool)
        free[samples] = True
        free[self._pinned()] = False
        if self.settings.solver == "sparse":
            flat = assignment.solved(flat, terms, anchors, free)
        else:
            for _ in range(self.settings.sweeps):
                flat = assignment.relaxed(flat, terms, anchors, free)
        self.positions = flat.reshape(self.positions.shape)
        # 6. correct
        self.correct(active)
        self.energies.append(energy)
        return energy

    def _samples(self, active: np.ndarray) -> np.ndarray:
        return (active[:, None] * self.size + np.arange(self.size)).ravel()

    def _pinned(self) -> np.ndarray:
        pins = self.controls.constraints.pins
        return np.zeros(0, int) if pins is None else pins.frame * self.size + pins.sample

    def _output(self, active: np.ndarray, known: int) -> tuple[Output, np.ndarray | None]:
        """The output as the search reads it, and C of each sample (`_coarse`)."""
        controls, dims = self.controls, self.positions.shape[3]
        flat = self.positions.reshape(-1, dims)
        axes, control, allowed = controls.axes, np.zeros(len(flat), np.float32), np.full(len(flat), -1, np.int32)
        for t in active:
            part = slice(t * self.size, (t + 1) * self.size)
            if controls.rotation is not None:
                axes = np.zeros((len(flat), dims, dims), np.float32) if axes is None or t == active[0] else axes
                axes[part] = controls.rotation(int(t), flat[part])
            if controls.control is not None:
                control[part] = controls.control(int(t), flat[part])
            if controls.allowed is not None:
                allowed[part] = controls.allowed(int(t), flat[part])
        coarse = self._coarse(known)
        detail = flat if coarse is None else flat - coarse
        if axes is not None:
            if self.exemplar.anchored:
                detail = np.einsum("nji,nj->ni", axes, detail)
            else:
                # only their differences in time matter: each is rotated into the axes of its sample
                detail = self._in_local_axes(detail, axes)
        output = Output(self.positions.astype(np.float32), detail.astype(np.float32), axes, known, controls.period,
                        control, allowed)
        return output, coarse

    def _in_local_axes(self, detail: np.ndarray, axes: np.ndarray) -> np.ndarray:
        """Details whose differences from frame to frame are those of `detail`, in the local axes of each frame."""
        dims = detail.shape[1]
        steps = np.diff(detail.reshape(-1, self.size, dims), axis=0)
        rotated = np.einsum("tnji,tnj->tni", axes.reshape(-1, self.size, dims, dims)[:-1], steps)
        return np.concatenate([np.zeros((1, self.size, dims)), np.cumsum(rotated, axis=0)]).reshape(-1, dims)

    def _coarse(self, known: int) -> np.ndarray | None:
        """C of each sample, (M, D): given with the elements, or the distance the flow has carried it."""
        if self.elements.coarse is not None:
            return self.elements.coarse.reshape(-1, self.positions.shape[3]).astype(np.float64)
        if self.controls.flow is None:
            return None
        carried = np.zeros_like(self.positions)
        for t in range(1, known):
            before = self.positions[t - 1].reshape(-1, self.positions.shape[3])
            carried[t] = carried[t - 1] + self.controls.flow(t - 1, before).reshape(carried[t].shape)
        return carried.reshape(-1, self.positions.shape[3])

    def _anchors(self, output: Output, coarse: np.ndarray | None, active: np.ndarray) -> Iterator[Anchors]:
        """The soft terms of Θ."""
        dims = self.positions.shape[3]
        if self.carried is not None:
            samples = self._samples(active)
            weight = self.settings.inertia * self._prediction_weight()
            yield Anchors(samples, self.carried, np.full(len(samples), weight))
        for t in active:
            yield self.controls.constraints.anchors(self.positions[t].reshape(-1, dims), int(t) * self.size)
        if self.exemplar.anchored and coarse is not None and self.settings.centre > 0:
            yield assignment.centred(self.exemplar, output, coarse, self.matches, active, self.settings.centre)

    def _prediction_weight(self) -> float:
        """The mean weight of the predictions for a sample: the unit of other weights."""
        return max(1.0, 2.0 * float(self.exemplar.falloff.sum(axis=1).mean()))

    def correct(self, active: np.ndarray) -> None:
        """The extra solver step, and the hard constraints."""
        dims = self.positions.shape[3]
        for t in active:
            points = self.positions[t].reshape(-1, dims)
            if self.settings.hybrid and self.elements.topology == "none":
                points = collision.resolved(points, self.radius, self.element, self.controls.period)
            self.positions[t] = self.controls.constraints.enforced(points).reshape(self.positions[t].shape)
        self.positions.reshape(-1, dims)[self._pinned()] = (
            self.controls.constraints.pins.position if self.controls.constraints.pins else np.zeros((0, dims)))

    def finish(self) -> None:
        """Keep threads from passing through each other: once at the end, since it costs as much as a few iterations."""
        if self.settings.hybrid and self.elements.topology == "thread":
            assert self.elements.coarse is not None
            self.positions = collision.followed(self.elements.coarse, self.positions, self.elements.size)

    def result(self) -> Elements:
        """The output as it stands."""
        return replace(self.elements, positions=self.positions.astype(np.float32))

    def state(self) -> dict[str, np.ndarray]:
        """All that an interrupted run needs to continue from here with the same bits."""
        matches = {name: getattr(self.matches, name) for name in ("sample", "distance", "slot", "neighbors")}
        return {"positions": self.positions, "energies": np.array(self.energies), **matches}

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Continue from a `state`. Raises ValueError if it is of another output."""
        for name in ("sample", "distance", "slot", "neighbors"):
            array = getattr(self.matches, name)
            if state[name].shape != array.shape or state[name].dtype != array.dtype:
                raise ValueError("the state is of another output")
            setattr(self.matches, name, np.array(state[name]))
        self.positions = np.array(state["positions"], np.float64).reshape(self.positions.shape)
        self.energies = [float(energy) for energy in state["energies"]]


def together(exemplar: Exemplar, start: Elements, source: np.ndarray, controls: Controls, settings: Settings,
             kept: Mapping[str, np.ndarray] | None = None) -> Iterator[Optimizer]:
    """All frames together, non-causal: the optimizer after each iteration; its `result` after the last.

    kept   the `state` of an interrupted run after some iteration: the first one yielded
    """
    optimizer = Optimizer(exemplar, start, source, controls, settings)
    every = np.arange(start.frames)
    if kept is None:
        optimizer.correct(every)
    else:
        optimizer.restore(kept)
        yield optimizer
    while len(optimizer.energies) < settings.iterations and not _is_settled(optimizer):
        optimizer.iterate(every, start.frames)
        yield optimizer
    optimizer.finish()


def _is_settled(optimizer: Optimizer) -> bool:
    """Whether the optimization has converged: the output equals the exemplar, or the energy no longer falls."""
    energies, radius = optimizer.energies, optimizer.exemplar.shape.radius
    if energies and energies[-1] < SAME * radius**2:
        return True
    return len(energies) > 1 and 0 <= energies[-2] - energies[-1] < STAYS * energies[-2]


def by_frames(exemplar: Exemplar, first: Elements, source: np.ndarray, frames: int, controls: Controls,
              settings: Settings, kept: Mapping[str, np.ndarray] | None = None) -> Iterator[Optimizer]:
    """Frame by frame, causal (§4.1, Sequencing): each frame starts from the one before, advected. Yields the optimizer
    after each frame; its `result` after the last.

    first   the initial output, one frame; source (E·S,): the exemplar sample that each was copied from
    kept    the `state` of an interrupted run after some frame: the first one yielded
    Raises ValueError for a neighbourhood with frames after its own.
    """
    if exemplar.shape.after:
        raise ValueError("frame by frame, a neighbourhood has no frames after its own")
    start = replace(first, positions=np.repeat(first.positions, frames, axis=0))
    sources = np.full(frames * first.count * first.positions.shape[2], -1, np.int32)
    sources[: len(source)] = source
    optimizer = Optimizer(exemplar, start, sources, controls, settings)
    if kept is not None:
        optimizer.restore(kept)
        yield optimizer
    for frame in range(len(optimizer.energies) // settings.iterations, frames):
        if frame:
            _advected(optimizer, frame)
            optimizer.carried = optimizer.positions[frame].reshape(-1, first.dimensions).copy()
        optimizer.correct(np.array([frame]))
        for _ in range(settings.iterations):
            optimizer.iterate(np.array([frame]), frame + 1)
        yield optimizer


def _advected(optimizer: Optimizer, frame: int) -> None:
    """A frame from the one before: carried by the flow, and by what the exemplar's matched samples do next."""
    dims, size = optimizer.positions.shape[3], optimizer.size
    before = optimizer.positions[frame - 1].reshape(-1, dims)
    step = np.zeros_like(before) if optimizer.controls.flow is None else optimizer.controls.flow(frame - 1, before)
    example = optimizer.exemplar.elements
    match = optimizer.matches.sample[(frame - 1) * size: frame * size, 0]
    many = example.count * example.positions.shape[2]
    following = np.where(match + many < example.frames * many, match + many, match)
    moved = optimizer.exemplar.detail[following] - optimizer.exemplar.detail[match]
    if optimizer.controls.rotation is not None:
        moved = np.einsum("nij,nj->ni", optimizer.controls.rotation(frame - 1, before), moved)
    optimizer.positions[frame] = (before + step + moved).reshape(optimizer.positions[frame].shape)
    optimizer.matches.sample[frame * size: (frame + 1) * size] = np.stack(
        [following, *optimizer.matches.sample[(frame - 1) * size: frame * size, 1:].T], axis=-1)
