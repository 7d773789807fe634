"""Loops: the last frame leads into the first, bit for bit, and no frame has a hole."""

import functools
import hashlib

import numpy as np
import processes
import pytest
from strands import SHAPE, SMALL, strands, uniform, vortex, wall

from synth.texture.carry import State
from synth.texture.loop import SHORTEST, Loop
from synth.texture.sample import luminance

PERIOD = 18


def swinging(frame):
    """A uniform flow whose direction swings and is the same again after PERIOD frames."""
    angle = 0.8 * np.sin(2 * np.pi * frame / PERIOD)
    return uniform(1.3 * np.cos(angle), 1.3 * np.sin(angle))


def rightwards(frame):
    return uniform(1.5, 0.0)


def swirling(frame):
    return vortex()


FLOWS = pytest.mark.parametrize("flow", [rightwards, swirling, swinging])


@functools.cache
def looped(flow, period=PERIOD, masked=False, seed=4):
    loop = Loop(strands(), SHAPE, SMALL, seed)
    return loop, loop.states(flow, period, wall() if masked else None)


def row_of(state, number):
    return int(np.flatnonzero(state.id == number)[0])


@FLOWS
def test_every_frame_leads_into_the_next_and_the_last_into_the_first(flow):
    """What lives in both is where the flow takes it; what comes is a newborn; what goes has faded or left."""
    loop, states = looped(flow)
    for frame, after in enumerate(states, start=1):
        before = states[frame - 2]
        then = loop._followed(before, loop._ground(flow(frame), None))
        for number in after.id.tolist():
            new = row_of(after, number)
            if number not in then.id:
                assert after.age[new] == 0, f"patch {number} comes to frame {frame} from nowhere"
                continue
            old = row_of(then, number)
            for part in ("centre", "axis", "bend", "radius", "weight", "age", "anchor"):
                np.testing.assert_array_equal(getattr(after, part)[new], getattr(then, part)[old], err_msg=part)
            assert after.fading[new] or not then.fading[old], "a patch that fades does not grow again"
        assert set(then.id.tolist()) <= set(after.id.tolist()), f"a patch is gone in frame {frame}"


@FLOWS
def test_every_pixel_is_covered(flow):
    loop, states = looped(flow)
    for state in states:
        table, lists = loop._tables(state)
        assert loop.painter.owners(table, lists, None).min() >= 0


@FLOWS
def test_a_patch_lives_for_less_than_a_period(flow):
    _, states = looped(flow)
    for number in range(max(int(state.id.max()) for state in states) + 1):
        lives = [number in state.id for state in states]
        assert any(lives), f"patch {number} is never there"
        assert not all(lives), f"patch {number} is always there"
        births = sum(now and not before for before, now in zip(lives[-1:] + lives[:-1], lives, strict=True))
        assert births == 1, f"patch {number} is born {births} times"


def test_the_step_from_the_last_to_the_first_is_like_any_other():
    loop, states = looped(swirling, 30)
    pictures = np.stack([loop.picture(state) for state in states])
    steps = np.sqrt(((np.roll(pictures, -1, axis=0) - pictures) ** 2).mean(axis=(1, 2, 3)))
    assert steps[-1] <= 1.15 * np.median(steps)
    assert steps.min() > 0.3 * np.median(steps), "it moves in every frame"


def test_it_looks_like_the_sample():
    loop, states = looped(swirling, 30)
    for state in states[::7]:
        shown = luminance(loop.picture(state))
        assert 0.8 < shown.std() / loop.sample.luminance.std() < 1.2
        assert abs(shown.mean() - loop.sample.luminance.mean()) < 0.1


def test_newborns_continue_the_picture():
    """Their seams are better than those of patches with anchors at random."""
    loop, states = looped(rightwards, 30)
    random = np.random.Generator(np.random.Philox(5))
    matched, arbitrary = [], []
    for frame, state in enumerate(states, start=1):
        who = np.flatnonzero((state.weight == 1) & ~state.fading).astype(np.int32)
        ground = loop._ground(rightwards(frame), None)
        fits = np.argwhere(loop.painter.room >= loop.painter.needs(np.ones(1) * SMALL.radius[1])[0])[:, ::-1]
        anywhere = fits[random.integers(len(fits), size=len(state.id))].astype(np.float32)
        shuffled = State.of(state.arrays() | {"anchor": anywhere})
        matched.append(np.median(loop._seams(state, who, ground)))
        arbitrary.append(np.median(loop._seams(shuffled, who, ground)))
    assert np.median(matched) < 0.8 * np.median(arbitrary)


def test_there_is_no_texture_behind_a_mask():
    mask = wall()
    loop, states = looped(swirling, masked=True)
    for state in states:
        x, y = np.clip(np.rint(state.centre), 0, np.array(SHAPE[::-1]) - 1).astype(int).T
        assert mask[y, x].all()
        picture = loop.picture(state)
        assert not picture[~mask].any()
        table, lists = loop._tables(state)
        assert loop.painter.owners(table, lists, mask)[mask].min() >= 0


def test_a_loop_too_short_for_a_patch_is_refused():
    with pytest.raises(ValueError, match=f"11 frames is too short.* need {SHORTEST * SMALL.growth}"):
        looped(rightwards, SHORTEST * SMALL.growth - 1)
    _, states = looped(rightwards, SHORTEST * SMALL.growth)
    assert len(states) == SHORTEST * SMALL.growth


def test_the_seed_decides():
    pictures = []
    for seed in (4, 5):
        loop, states = looped(rightwards, seed=seed)
        pictures.append(loop.picture(states[3]))
    assert np.abs(pictures[0] - pictures[1]).mean() > 0.01


def digest():
    loop, states = looped(swirling)
    total = hashlib.sha256()
    for state in states:
        for values in state.arrays().values():
            total.update(np.ascontiguousarray(values).tobytes())
        total.update(loop.picture(state).tobytes())
    return total.hexdigest()


def test_the_same_bits_at_any_thread_count_and_from_a_cold_cache(tmp_path):
    assert processes.digests(__file__, tmp_path) == {digest()}


