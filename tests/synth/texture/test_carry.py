"""Carried coordinates: what must stay as it is, what must come out again, and what must not reach across."""

import hashlib
import io
from dataclasses import fields, replace
from itertools import pairwise

import numpy as np
import processes
import pytest
from strands import SHAPE, SMALL, strands, uniform, vortex, wall

from synth.texture import measures
from synth.texture.carry import PATCHES, SWAY, Settings, State, Synthesis
from synth.texture.patches import Painter
from synth.texture.procedural import straw
from synth.texture.sample import Sample, luminance


def frames(v, count, settings=SMALL, state=None, mask=None, of=None, seed=4):
    synthesis = Synthesis(of or strands(), v.shape[:2], settings, seed)
    states = []
    for _ in range(count):
        state = synthesis.frame(v, state, mask)
        states.append(state)
    return synthesis, states


def assert_same(one, other):
    for name, values in one.arrays().items():
        np.testing.assert_array_equal(values, other.arrays()[name], err_msg=name)


@pytest.mark.parametrize("v", [uniform(0, 0), 1e-12 * vortex(), np.full((*SHAPE, 2), np.nan, np.float32)],
                         ids=["none", "hardly any", "unknown"])
def test_no_flow_gives_identical_frames(v):
    synthesis, states = frames(v, 14)
    first = synthesis.picture(states[0])
    assert luminance(first).std() > 0.5 * synthesis.sample.luminance.std()
    for state in states[1:]:
        np.testing.assert_array_equal(synthesis.picture(state), first)
        np.testing.assert_array_equal(state.id, states[0].id)
        assert synthesis.renewed(state) == 0


def test_a_still_flow_comes_to_rest():
    """After a flow has stopped patches grow and fade to the end, and then nothing changes any more.

    A repair may tear a neighbour's seam, which then is repaired: here that ends within 45 frames.
    """
    synthesis, states = frames(vortex(), 20)
    state, still = states[-1], 1e-12 * vortex()
    for _ in range(60):
        state = synthesis.frame(still, state)
    settled = synthesis.picture(state)
    for _ in range(SMALL.growth + 2):
        state = synthesis.frame(still, state)
        np.testing.assert_array_equal(synthesis.picture(state), settled)


@pytest.mark.parametrize("step", [(1, 0), (0, -2), (2, 1)])
def test_a_flow_of_whole_pixels_is_an_exact_shift(step):
    """Inside, where nothing that was born at the border reaches."""
    settings = Settings(radius=(12, 12), growth=4)
    synthesis, states = frames(uniform(*step, (128, 128)), 7, settings, of=strands(64))
    first, last = synthesis.picture(states[0]), synthesis.picture(states[-1])
    moved = np.roll(first, (6 * step[1], 6 * step[0]), axis=(0, 1))
    # births lie outside the picture, within 12 pixels; a patch reaches 1.7 radii, and its move
    inside = np.s_[36:-36, 36:-36]
    np.testing.assert_array_equal(last[inside], moved[inside])
    assert states[-1].born > states[0].born


def test_a_patch_turns_no_faster_than_its_picture_can_follow():
    """The flow turns by a right angle from one frame to the next: patches follow over frames, and then are there."""
    _, states = frames(uniform(0.5, 0), 2)
    turning = [*states[-1:], *frames(uniform(0, 0.5), 30, state=states[-1])[1]]
    for before, after in pairwise(turning):
        kept, now = np.isin(before.id, after.id), np.isin(after.id, before.id)
        cos = (before.axis[kept] * after.axis[now]).sum(axis=1)
        assert (np.arccos(np.clip(cos, -1, 1)) <= SWAY / after.radius[now] + 1e-3).all()  # float32 axes near 1
    settled = np.isin(turning[-1].id, states[-1].id)
    assert settled.sum() > 20
    np.testing.assert_array_equal(turning[-1].axis[settled], np.broadcast_to(np.float32([0, 1]), (settled.sum(), 2)))


@pytest.mark.parametrize("masked", [False, True])
@pytest.mark.parametrize("elongation", [1.0, 1.7])
def test_every_pixel_is_covered(masked, elongation):
    mask = wall() if masked else None
    if mask is not None:
        mask[20:40:2, 60:80] = False  # corridors one pixel wide
    synthesis, states = frames(vortex(), 40, replace(SMALL, elongation=elongation), mask=mask)
    for state in states:
        table, lists = synthesis._tables(state)
        owner = synthesis.painter.owners(table, lists, mask)
        assert (owner[mask if masked else ...] >= 0).all()


def test_one_colour_stays_one_colour():
    """Weights are 1 together in every frame, with any blend."""
    strand = strands()
    plain = Sample(np.full_like(strand.colour, 0.3), strand.luminance, strand.direction, strand.share)
    for blend in (0.0, 1.0):
        synthesis, states = frames(vortex(), 12, replace(SMALL, blend=blend), of=plain)
        for state in states:
            np.testing.assert_array_equal(synthesis.picture(state), np.float32(0.3))


def test_a_frame_can_be_drawn_from_its_maps():
    """From the two strongest patches alone, where no third has a share, with the plain blend: by whoever reads EXR."""
    # seams are wide for patches as small as these: sharper ones leave more places to two
    synthesis, states = frames(vortex(), 10, replace(SMALL, blend=0.0, sharpness=0.4))
    picture, maps = synthesis.picture(states[-1]), synthesis.maps(states[-1])
    assert maps.shape == (*SHAPE, 6)
    assert (maps >= 0).all() and (maps <= 1 + 1e-6).all()
    height, width = synthesis.sample.shape
    drawn = np.zeros_like(picture)
    for u, v, w in (np.moveaxis(maps[..., :3], -1, 0), np.moveaxis(maps[..., 3:], -1, 0)):
        x, y = 3 * (u * width - 0.5), 3 * (v * height - 0.5)
        fine = synthesis.painter.colour
        i, j = np.minimum(x.astype(int), fine.shape[1] - 2), np.minimum(y.astype(int), fine.shape[0] - 2)
        fx, fy = (x - i)[..., None], (y - j)[..., None]
        low = fine[j, i] * (1 - fx) + fine[j, i + 1] * fx
        drawn += w[..., None] * (low * (1 - fy) + (fine[j + 1, i] * (1 - fx) + fine[j + 1, i + 1] * fx) * fy)
    two = maps[..., 2] + maps[..., 5] > 1 - 1e-6
    assert two.mean() > 0.3
    np.testing.assert_allclose(drawn[two], picture[two], atol=1e-4)


def test_an_interrupted_run_goes_on_with_the_same_bits():
    """What is kept in a file is all that the next frame needs, in another process too."""
    v = vortex()
    _, states = frames(v, 12)
    kept = io.BytesIO()
    np.savez(kept, **states[5].arrays())
    kept.seek(0)
    with np.load(kept) as arrays:
        again = State.of(arrays)
    assert {part.name for part in fields(State)} == set(again.arrays())
    synthesis, resumed = frames(v, 6, state=again)
    assert_same(resumed[-1], states[-1])
    np.testing.assert_array_equal(synthesis.picture(resumed[-1]), synthesis.picture(states[-1]))


def digest():
    """SHA-256 of states and pictures, with and without a mask: what the subprocesses below print."""
    found = hashlib.sha256()
    for mask in (None, wall()):
        synthesis, states = frames(vortex(), 12, mask=mask)
        for state in (states[0], states[-1]):
            for values in state.arrays().values():
                found.update(values.tobytes())
            found.update(synthesis.picture(state).tobytes())
            found.update(synthesis.maps(state).tobytes())
    return found.hexdigest()


def test_the_same_bits_at_any_thread_count_and_from_a_cold_cache(tmp_path):
    """One thread with a kernel cache that is empty, two with the one it left, and this process."""
    assert processes.digests(__file__, tmp_path) == {digest()}


def test_the_seed_decides():
    one, same, other = (frames(vortex(), 3, seed=seed)[1][-1] for seed in (1, 1, 2))
    assert_same(one, same)
    assert len(one.id) != len(other.id) or (one.centre != other.centre).any()


def test_masked_pixels_are_zero():
    mask = wall()
    synthesis, states = frames(vortex(), 12, mask=mask)
    for state in states:
        picture, maps = synthesis.picture(state), synthesis.maps(state)
        assert (picture[~mask] == 0).all() and (maps[~mask] == 0).all()
        assert (picture[mask] > 0).any(axis=1).all()


def test_nothing_reaches_across_a_wall():
    """Other places of the sample on the right: not a bit of the left changes, in this frame or after births."""
    mask = wall()
    # how often the sample is used is counted over the whole picture: births on the right would be felt
    synthesis, states = frames(vortex(), 10, replace(SMALL, usage=0.0), mask=mask)
    before = states[-1]
    right = before.centre[:, 0] > 51
    anchor = before.anchor.copy()
    anchor[right] = anchor[right][::-1]
    changed = replace(before, anchor=anchor)
    left, far = np.s_[:, :50], np.s_[:, 53:]
    for _ in range(6):
        one, other = synthesis.picture(before), synthesis.picture(changed)
        np.testing.assert_array_equal(one[left], other[left])
        assert (one[far] != other[far]).any()
        before, changed = (synthesis.frame(vortex(), state, mask) for state in (before, changed))
    assert before.born > states[-1].born


def test_the_flow_on_masked_pixels_is_not_read():
    mask, v = wall(), vortex()
    _, clean = frames(v, 6, mask=mask)
    v[~mask] = np.nan
    _, other = frames(v, 6, mask=mask)
    assert_same(clean[-1], other[-1])


def test_a_mask_without_any_pixel_of_texture():
    synthesis, states = frames(vortex(), 2, mask=np.zeros(SHAPE, bool))
    assert not len(states[-1].id) and not synthesis.picture(states[-1]).any()


def test_usage_counts_the_anchors_of_living_patches():
    synthesis, states = frames(vortex(), 30)
    state = states[-1]
    np.testing.assert_array_equal(state.usage, synthesis.anchors.used(np.zeros_like(state.usage), state.anchor, 1))
    assert state.born > len(state.id) and (np.diff(state.id) > 0).all()
    assert {len(getattr(state, name)) for name in PATCHES} == {len(state.id)}


def test_torn_seams_are_repaired():
    """In shear neighbours slide past each other; repair replaces some, at most so many a frame."""
    y = np.arange(SHAPE[0], dtype=np.float32)[:, None]
    v = np.stack([np.broadcast_to(0.03 * (y - 40), SHAPE), np.full(SHAPE, 1e-3)], axis=-1).astype(np.float32)
    settings = replace(SMALL, repair=0.5, torn=0.6, repairs=2)
    born = [frames(v, 40, s)[1][-1].born for s in (settings, replace(settings, repair=0.0))]
    assert born[1] < born[0] <= born[1] + 2 * 40


def test_the_blend_is_chosen_by_the_gradient():
    """The first frame's mean squared gradient comes nearer to the sample's than by either blend."""
    ways, chosen = {}, []
    for blend in ("auto", 0.0, 1.0):
        synthesis, states = frames(vortex(), 1, replace(SMALL, blend=blend))
        ways[blend] = measures.gradient(luminance(synthesis.picture(states[0])), measures.Reference(synthesis.sample))
        chosen.append(states[0].blend)
    assert 0 <= chosen[0] <= 1
    assert abs(ways["auto"] - 1) <= min(abs(ways[0.0] - 1), abs(ways[1.0] - 1)) + 0.01  # linear between them


def test_nothing_collapses():
    """Forty frames of straw in a vortex with a sink: the sample's contrast, gradient and histogram."""
    v, shape = vortex((160, 160)), (160, 160)
    of = strands(96, straw)
    synthesis, states = frames(v, 40, Settings(), of=of)
    reference = measures.Reference(of)
    for state in (states[0], states[-1]):
        frame = luminance(synthesis.picture(state), of.white)
        assert 0.85 < measures.contrast(frame, reference) < 1.15
        assert 0.75 < measures.gradient(frame, reference) < 1.15
        assert measures.histogram(frame, reference) < 0.15
    assert all(synthesis.renewed(state) < 0.05 for state in states[1::7])
    assert synthesis.painter.shape == shape


@pytest.mark.parametrize("shape", [(17, 64), (1, 40), (33, 1)])
def test_odd_sizes(shape):
    synthesis, states = frames(uniform(0.7, 0.3, shape), 3)
    picture = synthesis.picture(states[-1])
    assert picture.shape == (*shape, 3) and (picture > 0).any(axis=2).all()


def test_a_sample_smaller_than_the_radius():
    """Radii shrink to what has room in the sample."""
    synthesis, states = frames(vortex(), 4, Settings(), of=strands(20))
    assert states[-1].radius.max() < 20
    assert (synthesis.picture(states[-1]) > 0).any(axis=2).all()


@pytest.mark.parametrize(("wrong", "named"), [
    ({"radius": (1, 5)}, "radii"), ({"radius": (9, 7)}, "radii"), ({"elongation": 0.5}, "elongation"),
    ({"death": 1.1}, "death"), ({"window": 1.2}, "gaps"), ({"growth": 0}, "grow"), ({"usage": -1}, "usage"),
    ({"blend": 1.5}, "blend"), ({"blend": "none"}, "blend"), ({"repair": 2}, "repair"), ({"sharpness": 0}, "sharpness"),
])
def test_settings_that_make_no_sense(wrong, named):
    with pytest.raises(ValueError, match=named):
        Settings(**wrong)


def test_arrays_of_other_sizes_are_refused():
    synthesis = Synthesis(strands(), SHAPE, SMALL, 1)
    with pytest.raises(ValueError, match="flow"):
        synthesis.frame(uniform(1, 0, (5, 5)), None)
    with pytest.raises(ValueError, match="mask"):
        synthesis.frame(uniform(1, 0), None, np.ones((5, 5), bool))
    with pytest.raises(ValueError, match="no room"):
        opaque = np.zeros((48, 48), bool)
        opaque[::2] = True
        Synthesis(replace(strands(), opaque=opaque), SHAPE, SMALL, 1)


def test_a_transparent_part_of_the_sample_is_not_matched():
    opaque = np.ones((48, 48), bool)
    opaque[:12, :20] = False
    synthesis, states = frames(vortex(), 8, of=replace(strands(), opaque=opaque))
    anchor = states[-1].anchor.astype(int)
    room = synthesis.painter.room[anchor[:, 1], anchor[:, 0]]
    assert isinstance(synthesis.painter, Painter) and (room >= 1.25 * SMALL.radius[0]).all()
