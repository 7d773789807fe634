"""A loop: the patches of `carry` with lives that repeat, so that the last frame leads into the first (beyond wang05).

Where a patch lies and when it fades does not depend on what it shows, but for the repair of seams, and a loop repairs
none. So the lives of all patches are found first, and then what each shows. Every frame is drawn from patches whose
lives repeat after `period` frames: frame period + 1 would be frame 1, bit for bit.

Nothing in a loop can last: each patch lives for less than one period. A longer period renews less in a frame.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from synth.texture import carry
from synth.texture.carry import PATCHES, Ground, State

LAPS = 2
"""Times that each patch is matched: those born early in a loop have neighbours that are matched later."""
SHORTEST = 3
"""The least period, in times in which a patch grows: it grows, is there, and fades."""

Grounds = Callable[[int], Ground]
"""The ground of a frame, counted from 1 through all laps."""


@dataclass(frozen=True, eq=False)
class Births:
    """The patches that live at the end of the first lap, numbered from 0 in the order of their birth.

    frame   (P,) int: the frame in which each is born
    centre  (P, 2) float64: where
    fades   (P,) int: the frame from which it fades, of those that do so before the end; else past it
    """

    frame: np.ndarray
    centre: np.ndarray
    fades: np.ndarray


class Loop(carry.Synthesis):
    """Draws a sample on a flow that repeats, as a steady flow does."""

    def states(self, flow: Callable[[int], np.ndarray], period: int, mask: np.ndarray | None = None) -> list[State]:
        """The state after each of frames 1 to `period`.

        flow(frame)  (Y, X, 2), pixels per frame; after that of frame `period` comes that of frame 1
        mask         (Y, X) bool, as `frame` takes it
        Raises ValueError for a period in which a patch cannot grow and fade.

        1. First lap: as without a loop, but each patch fades before it is a period old.
        2. Second lap: what lives at the end of the first is born again, where and when it was, and none of it gives
           way to others; newborns fill what is bare. At its end, the patches of its beginning are there again.
        3. Third lap: the newborns of the second that outlive it fade where they are in the way.
        4. Each frame has the patches of the second lap and what the third adds. Match them.
        """
        self._check(period)
        ground = self._grounds(flow, period, mask)
        # 1. first lap
        lasting, births = self._first_lap(ground, period)
        # 2. second lap
        second = self._second_lap(lasting, births, ground, period)
        # 3. third lap
        third = self._third_lap(second, len(births.frame), ground, period)
        # 4. together
        together = [_in_order(_joined(a, b)) for a, b in zip(second, third, strict=True)]
        return self._all_matched(together, ground)

    def _check(self, period: int) -> None:
        least = SHORTEST * self.settings.growth
        if period < least:
            raise ValueError(f"a loop of {period} frames is too short: patches that grow for {self.settings.growth} "
                             f"frames need {least}")

    def _grounds(self, flow: Callable[[int], np.ndarray], period: int, mask: np.ndarray | None) -> Grounds:
        """What a frame goes by; of a steady flow it is found once."""
        kept: list[tuple[np.ndarray, Ground]] = []

        def ground(frame: int) -> Ground:
            v = flow((frame - 1) % period + 1)
            if not kept or not np.array_equal(kept[0][0], v, equal_nan=True):
                kept[:] = [(v, self._ground(v, mask))]
            return kept[0][1]

        return ground

    # 1. first lap

    def _first_lap(self, ground: Grounds, period: int) -> tuple[State, Births]:
        """The state after frame `period`, and how its patches came to be there.

        The patches of the first frame fade at frames at random, and are gone before the end.
        """
        state = self._born(self._empty(1, ground(1)), ground(1))
        random = np.random.Generator(np.random.Philox(key=[self.seed, 0], counter=[0, 0, 2, 0]))
        first = random.integers(2, self._oldest(period) + 1, len(state.id))
        born: dict[int, tuple[int, np.ndarray]] = {}
        fades: dict[int, int] = {}
        for frame in range(2, period + 1):
            state = self._followed(state, ground(frame))
            over = state.age >= self._oldest(period)
            known = state.id < len(first)
            over[known] = first[state.id[known]] <= frame
            state = self._crowded(replace(state, fading=state.fading | over), ground(frame))
            state = self._born(state, ground(frame))
            for row in np.flatnonzero(state.age == 0):
                born[int(state.id[row])] = frame, state.centre[row].copy()
            for number in state.id[state.fading].tolist():
                fades.setdefault(number, frame)
        living = state.id.tolist()
        births = Births(np.array([born[k][0] for k in living], int), np.array([born[k][1] for k in living]),
                        np.array([fades.get(k, period + 1) for k in living], int))
        return replace(state, id=np.arange(len(living)), born=len(living)), births

    def _oldest(self, period: int) -> int:
        """The age at which a patch fades, so that it is gone before it is a period old."""
        return period - self.settings.growth - 1

    # 2. second lap

    def _second_lap(self, state: State, births: Births, ground: Grounds, period: int) -> list[State]:
        """The states of the second lap.

        Their rows are in the order in which patches go before each other: those born again, those of the first lap,
        newborns.
        """
        states = []
        for frame in range(1, period + 1):
            state = self._followed(state, ground(period + frame))
            over = state.age >= self._oldest(period)
            again = _again(state, births, frame)
            over[again] = births.fades[state.id[again]] <= frame
            state = replace(state, fading=state.fading | over)
            state = self._born_again(state, births, frame, ground(period + frame))
            state = self._born(self._crowded(state, ground(period + frame)), ground(period + frame))
            states.append(state)
        return states

    def _born_again(self, state: State, births: Births, frame: int, ground: Ground) -> State:
        """The patches and those that are born again in this frame of the lap, before those that were not."""
        who = np.flatnonzero(births.frame == frame)
        more = self._with_newborns(state, births.centre[who], ground)
        more = replace(more, id=np.concatenate([state.id, who]), born=state.born)
        last = more.id >= len(births.frame)
        return carry.chosen(more, np.lexsort([more.id, last, ~_again(more, births, frame)]))

    # 3. third lap

    def _third_lap(self, second: list[State], first: int, ground: Grounds, period: int) -> list[State]:
        """What is left, in each frame, of the newborns (their numbers begin at `first`) that outlive the second lap."""
        left, states = carry.chosen(second[-1], second[-1].id >= first), []
        for frame, there in enumerate(second, start=1):
            left = self._followed(left, ground(2 * period + frame))
            left = replace(left, fading=left.fading | (left.age >= self._oldest(period)))
            crowded = self._crowded(_joined(there, left), ground(2 * period + frame))
            left = carry.chosen(crowded, np.arange(len(there.id), len(crowded.id)))
            states.append(left)
        return states

    # 4. together

    def _all_matched(self, states: list[State], ground: Grounds) -> list[State]:
        """The states with the anchors of all patches, and the blend.

        1. LAPS times through the loop, each patch is matched with the picture in which it is born; the first time all
           those of the first frame.
        2. The anchors of the last time, in every frame.
        """
        anchor = np.full((max(int(state.id.max(initial=-1)) for state in states) + 1, 2), -1, np.float32)
        usage, before = np.zeros(self.sample.shape, np.int32), np.zeros(0, np.int64)
        # 1. match
        for _ in range(LAPS):
            for frame, state in enumerate(states, start=1):
                usage = self.anchors.used(usage, anchor[np.setdiff1d(before, state.id)], -1)
                now = replace(state, usage=usage, anchor=anchor[state.id])
                now.anchor[state.age == 0] = -1
                now = self._matched(now, {}, ground(frame))
                anchor[state.id], usage, before = now.anchor, now.usage, state.id
        # 2. all frames
        states = [replace(state, frame=frame, anchor=anchor[state.id]) for frame, state in enumerate(states, start=1)]
        blend = self._blended(states[0]).blend
        return [replace(state, blend=blend) for state in states]


def _again(state: State, births: Births, frame: int) -> np.ndarray:
    """Which patches, at a frame of the second lap, have been born again in it."""
    return (state.id < len(births.frame)) & (state.age < frame)


def _joined(first: State, more: State) -> State:
    """The patches of both."""
    rows: dict[str, Any] = {name: np.concatenate([getattr(first, name), getattr(more, name)]) for name in PATCHES}
    return replace(first, **rows)


def _in_order(state: State) -> State:
    return carry.chosen(state, np.argsort(state.id))
