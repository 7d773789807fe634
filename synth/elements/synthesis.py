"""Synthesis of an output from an exemplar (ma13 §4.1, §4.2, figure 4): search, assignment, extra solver step.

`together` optimizes all frames at once, `by_frames` one after the other; both go the same steps (`_iterated`). The
energy of Eq. 5 after each search is given back: it falls, but where Θ pulls against the exemplar.
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
"""How far points (M, D) are carried from frame t (from 0) to the next: (M, D), world units."""

Turn = Callable[[int, np.ndarray], np.ndarray]
"""Local frames (M, D, D) at points (M, D) in frame t."""

SAME = 1e-6  # energy of a sample, in squared radii of its neighbourhood, below which it is as in the exemplar
STAYS = 1e-3  # share by which the energy falls when there is no more to gain


@dataclass(frozen=True)
class Settings:
    """How an output is optimized.

    iterations  of search and assignment, at most; all frames together, fewer where the energy stays
    n           matches that predict together (§4.2: 2; 1 is the basic synthesis of §4.1)
    coherent    k-coherence, else exhaustive search
    solver      "sparse": all positions at once; "local": each by its neighbours as constants, `sweeps` times
    centre      weight of anchored details' own place, in search and assignment
    inertia     weight of where a sample is carried from the frame before, frame by frame, in terms of what its
                neighbours say
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
    """What controls an output besides its exemplar: constraints, a global flow, an orientation field, maps.

    flow     none: elements are carried nowhere
    turn     none: the local axes of `coarse` elements are given in `axes` (T·E·S, D, D), or nothing is rotated
    control  at points (M, D) of frame t the control map's value (M,); allowed: bits of the kinds that may stand there
    period   (D,) of a toroidal output, 0 along axes that end
    """

    constraints: Constraints = field(default_factory=Constraints)
    flow: Flow | None = None
    turn: Turn | None = None
    axes: np.ndarray | None = None
    control: Callable[[int, np.ndarray], np.ndarray] | None = None
    allowed: Callable[[int, np.ndarray], np.ndarray] | None = None
    period: np.ndarray | None = None


class Optimizer:
    """One output under way: positions, matches and energies.

    within    the exemplar
    start     the output as it is initialized, all its frames
    source    (T·E·S,) int32: the exemplar sample that each was copied from, -1: from none
    """

    def __init__(self, within: Exemplar, start: Elements, source: np.ndarray, controls: Controls, settings: Settings):
        self.within, self.controls, self.settings = within, controls, settings
        self.elements = start
        self.positions = start.positions.astype(np.float64)
        self.size = start.count * start.positions.shape[2]
        self.searcher = Searcher(within, settings.n, settings.coherent, settings.centre, settings.control)
        self.matches = Matches.none(start.frames * self.size, settings.n, within.shape)
        self.matches.sample[:, 0] = source
        self.radius = np.repeat(start.size, start.positions.shape[2]).astype(np.float64)
        self.element = np.repeat(np.arange(start.count), start.positions.shape[2])
        self.energies: list[float] = []
        self.carried: np.ndarray | None = None  # where a frame's samples begin, frame by frame

    def iterate(self, active: np.ndarray, known: int) -> float:
        """One search and one assignment of the samples in the frames `active`; returns the energy (Eq. 5) per sample
        before the assignment. Frames from `known` on are not there yet."""
        output, coarse = self._output(active, known)
        self.searcher.nearest(output, active, self.matches)
        samples = self._samples(active)
        anchors = Anchors.all(list(self._anchors(output, coarse, active)), output.positions.shape[3])
        flat = self.positions.reshape(-1, output.positions.shape[3])
        apart = self.matches.apart[samples, 0]
        misfit = anchors.weight[:, None] * (flat[anchors.sample] - anchors.target) ** 2
        energy = float((np.sum(apart[np.isfinite(apart)], dtype=np.float64) + misfit.sum()) / len(samples))
        terms = assignment.predictions(self.within, output, coarse, self.matches, active)
        free = np.zeros(len(flat), bool)
        free[samples] = True
        free[self._pinned()] = False
        if self.settings.solver == "sparse":
            flat = assignment.solved(flat, terms, anchors, free)
        else:
            for _ in range(self.settings.sweeps):
                flat = assignment.relaxed(flat, terms, anchors, free)
        self.positions = flat.reshape(self.positions.shape)
        self.correct(active)
        self.energies.append(energy)
        return energy

    def _samples(self, active: np.ndarray) -> np.ndarray:
        return (active[:, None] * self.size + np.arange(self.size)).ravel()

    def _pinned(self) -> np.ndarray:
        pins = self.controls.constraints.pins
        return np.zeros(0, int) if pins is None else pins.frame * self.size + pins.sample

    def _output(self, active: np.ndarray, known: int) -> tuple[Output, np.ndarray | None]:
        """What the search looks at, and how far the coarse motion has carried each sample."""
        controls, dims = self.controls, self.positions.shape[3]
        flat = self.positions.reshape(-1, dims)
        frames, control, allowed = controls.axes, np.zeros(len(flat), np.float32), np.full(len(flat), -1, np.int32)
        for t in active:
            part = slice(t * self.size, (t + 1) * self.size)
            if controls.turn is not None:
                frames = np.zeros((len(flat), dims, dims), np.float32) if frames is None or t == active[0] else frames
                frames[part] = controls.turn(int(t), flat[part])
            if controls.control is not None:
                control[part] = controls.control(int(t), flat[part])
            if controls.allowed is not None:
                allowed[part] = controls.allowed(int(t), flat[part])
        coarse = self._coarse(known)
        detail = flat if coarse is None else flat - coarse
        if frames is not None:
            if self.within.anchored:
                detail = np.einsum("nji,nj->ni", frames, detail)
            else:
                # only differences in time are asked of these: each is turned as its sample is
                detail = self._turned_trails(detail, frames)
        output = Output(self.positions.astype(np.float32), detail.astype(np.float32), frames, known, controls.period,
                        control, allowed)
        return output, coarse

    def _turned_trails(self, detail: np.ndarray, frames: np.ndarray) -> np.ndarray:
        """Details whose differences from frame to frame are those of `detail`, in the local frames on the way."""
        dims = detail.shape[1]
        steps = np.diff(detail.reshape(-1, self.size, dims), axis=0)
        turned = np.einsum("tnji,tnj->tni", frames.reshape(-1, self.size, dims, dims)[:-1], steps)
        return np.concatenate([np.zeros((1, self.size, dims)), np.cumsum(turned, axis=0)]).reshape(-1, dims)

    def _coarse(self, known: int) -> np.ndarray | None:
        """C of each sample, (M, D): given with the elements, or how far the flow has carried it until its frame."""
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
            yield Anchors(samples, self.carried, np.full(len(samples), self.settings.inertia * self._said()))
        for t in active:
            yield self.controls.constraints.anchors(self.positions[t].reshape(-1, dims), int(t) * self.size)
        if self.within.anchored and coarse is not None and self.settings.centre > 0:
            yield assignment.centred(self.within, output, coarse, self.matches, active, self.settings.centre)

    def _said(self) -> float:
        """The weight of what neighbours say of a sample, on average: what other terms are measured by."""
        return max(1.0, 2.0 * float(self.within.falloff.sum(axis=1).mean()))

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
        """Keep threads from passing through each other: once, since it costs as much as a few iterations."""
        if self.settings.hybrid and self.elements.topology == "thread":
            assert self.elements.coarse is not None
            self.positions = collision.followed(self.elements.coarse, self.positions, self.elements.size)

    def result(self) -> Elements:
        """The output as it stands."""
        return replace(self.elements, positions=self.positions.astype(np.float32))

    def state(self) -> dict[str, np.ndarray]:
        """What an interrupted run needs to go on from here with the same bits."""
        matches = {name: getattr(self.matches, name) for name in ("sample", "apart", "slot", "neighbors")}
        return {"positions": self.positions, "energies": np.array(self.energies), **matches}

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Go on from a `state`. Raises ValueError if it is of another output."""
        for name in ("sample", "apart", "slot", "neighbors"):
            array = getattr(self.matches, name)
            if state[name].shape != array.shape or state[name].dtype != array.dtype:
                raise ValueError("the state is of another output")
            setattr(self.matches, name, np.array(state[name]))
        self.positions = np.array(state["positions"], np.float64).reshape(self.positions.shape)
        self.energies = [float(energy) for energy in state["energies"]]


def together(within: Exemplar, start: Elements, source: np.ndarray, controls: Controls, settings: Settings,
             kept: Mapping[str, np.ndarray] | None = None) -> Iterator[Optimizer]:
    """All frames together, non-causal: the optimizer after each iteration; its `result` when there are no more.

    kept   the `state` of an interrupted run after some iteration, which comes first then
    """
    optimizer = Optimizer(within, start, source, controls, settings)
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
    """Whether another iteration would find the same: the matches are the exemplar's own, or the energy stays."""
    energies, radius = optimizer.energies, optimizer.within.shape.radius
    if energies and energies[-1] < SAME * radius**2:
        return True
    return len(energies) > 1 and 0 <= energies[-2] - energies[-1] < STAYS * energies[-2]


def by_frames(within: Exemplar, first: Elements, source: np.ndarray, frames: int, controls: Controls,
              settings: Settings, kept: Mapping[str, np.ndarray] | None = None) -> Iterator[Optimizer]:
    """Frame by frame, causal (§4.1, Sequencing): each begins as the one before, carried on. The optimizer after each
    frame; its `result` after the last.

    first   one frame: the output as it is initialized; source (E·S,) what each sample was copied from
    kept    the `state` of an interrupted run after some frame, which comes first then
    Raises ValueError for a neighbourhood with frames after its own.
    """
    if within.shape.after:
        raise ValueError("frame by frame, a neighbourhood has no frames after its own")
    start = replace(first, positions=np.repeat(first.positions, frames, axis=0))
    sources = np.full(frames * first.count * first.positions.shape[2], -1, np.int32)
    sources[: len(source)] = source
    optimizer = Optimizer(within, start, sources, controls, settings)
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
    example = optimizer.within.elements
    match = optimizer.matches.sample[(frame - 1) * size: frame * size, 0]
    many = example.count * example.positions.shape[2]
    following = np.where(match + many < example.frames * many, match + many, match)
    moved = optimizer.within.detail[following] - optimizer.within.detail[match]
    if optimizer.controls.turn is not None:
        moved = np.einsum("nij,nj->ni", optimizer.controls.turn(frame - 1, before), moved)
    optimizer.positions[frame] = (before + step + moved).reshape(optimizer.positions[frame].shape)
    optimizer.matches.sample[frame * size: (frame + 1) * size] = np.stack(
        [following, *optimizer.matches.sample[(frame - 1) * size: frame * size, 1:].T], axis=-1)
