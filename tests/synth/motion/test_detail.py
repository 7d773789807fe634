"""Detail synthesis: what must stay as it is, what must come out again, and what must not collapse."""

import hashlib
import itertools

import numpy as np
import processes
import pytest

from synth.advect import departure
from synth.motion.assignment import carry
from synth.motion.detail import (
    COARSEST,
    MARGIN,
    Level,
    Settings,
    State,
    Synthesis,
    deformation,
    distance_inland,
    enough_levels,
    synthesize,
)
from synth.motion.exemplar import KINDS, exemplar
from synth.motion.local_axes import axes_2d
from synth.motion.quality import measure, whole_motifs
from synth.pyramid import pyramid

CLOSED = ["circle", "square", "heart"]
SEARCHES = pytest.mark.parametrize("search", ["exact", "k-coherence"])


def rms(field):
    return float(np.sqrt(np.mean(field.astype(np.float64) ** 2)))


def constant(shape, x=1.0, y=0.0):
    return np.broadcast_to(np.float32([x, y]), (*shape, 2)).copy()


def wave(n):
    """A flow along x that swings up and down by 39 degrees, once over the domain."""
    swing = 0.8 * np.sin(2 * np.pi * np.arange(n) / n)
    return np.stack([np.ones((n, n)), np.broadcast_to(swing, (n, n))], -1).astype(np.float32)


def first_frame(I, L, **settings):
    size = I.shape[0]
    return next(synthesize(I, [L], L.shape[:2], Settings(enough_levels(size), **settings), seed=1))


def tiled(I, shape, origin):
    """The exemplar tiled over a grid whose first cell shows cell `origin` (x, y) of it."""
    y, x = np.mgrid[:shape[0], :shape[1]]
    return I[(y + origin[1]) % I.shape[0], (x + origin[0]) % I.shape[1]]


@pytest.mark.parametrize("kind", KINDS)
@SEARCHES
def test_the_exemplar_is_a_fixed_point(kind, search):
    """Tiled along a flow along x every neighbourhood is the exemplar's own: search and assignment leave it.

    The border's neighbourhoods see its cells repeated. An iteration carries that no further than what a
    neighbourhood there reads and writes, 16 cells and then 8, four times each.
    """
    I, reach = exemplar(kind, 16), 4 * (16 + 8)
    H = tiled(I, (2 * reach + 24, 2 * reach + 17), (3, 5))
    frame = constant(H.shape[:2])
    level = Level(I, rms(I), Settings(1, search=search))
    out, squared = level.optimize(H, frame, 4)
    inside = np.s_[reach:-reach, reach:-reach]
    np.testing.assert_allclose(out.get()[inside], H[inside], atol=1e-5)
    assert level.distance(squared) < 0.1


def test_the_exemplar_stays_itself_in_a_flow_of_whole_cells():
    """All levels, all steps of a later frame: the tiling is carried by four cells and nothing else happens."""
    I, shape = exemplar("heart", 16), (96, 96)
    synthesis = Synthesis(I, shape, Settings(2), seed=0)
    L = constant(shape, 4.0)
    levels = pyramid(I, 2, toroidal=True)
    H = [tiled(J, (n + 2 * MARGIN,) * 2, (-MARGIN, -MARGIN)) for J, n in zip(levels, (48, 96), strict=True)]
    state = State(H, [constant(level.shape[:2]) for level in H])
    out = synthesis.visible(synthesis.frame(L, state))
    expected = tiled(I, shape, (-4, 0))
    inside = np.s_[24:-24, 24:-24]
    np.testing.assert_allclose(out[inside], expected[inside], atol=1e-5)


@SEARCHES
def test_a_second_synthesis_resumes_from_a_state(search):
    """What a killed run left behind is all that the next frame needs."""
    I, L = exemplar("heart", 16), [wave(48) * speed for speed in (1, 1.5, 0.5)]
    settings = Settings(2, iterations=2, search=search)
    uninterrupted = list(synthesize(I, L, (48, 48), settings, seed=5))
    state = None
    for motion, expected in zip(L, uninterrupted, strict=True):
        afresh = Synthesis(I, (48, 48), settings, seed=5)
        if state is not None:
            state = State([H.copy() for H in state.H], [axes.copy() for axes in state.axes])
        state = afresh.frame(motion, state)
        np.testing.assert_array_equal(afresh.visible(state), expected)


def digest():
    """SHA-256 of two frames by each search: what the subprocesses below print."""
    found = hashlib.sha256()
    for search in ("exact", "k-coherence"):
        settings = Settings(2, iterations=2, search=search)
        for H in synthesize(exemplar("heart", 16), [wave(48)] * 2, (48, 48), settings, seed=5):
            found.update(H.tobytes())
    return found.hexdigest()


def test_the_same_bits_at_any_thread_count_and_from_a_cold_cache(tmp_path):
    """One thread with a kernel cache that is empty, two with the one it left, and this process."""
    assert processes.digests(__file__, tmp_path) == {digest()}


def test_the_seed_decides():
    I, L = exemplar("heart", 16), [wave(48)]
    settings = Settings(2, iterations=1)
    one, same, other = (next(synthesize(I, L, (48, 48), settings, seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert rms(one - other) > 0.1 * rms(one)


@pytest.mark.parametrize("kind", ["heart", "sinusoid"])
def test_steady_under_a_constant_flow(kind):
    """No flicker: each frame warped by L is the next, to 2 % of its rms in the median."""
    L = constant((96, 96), 0.6, 0.37)
    frames = list(synthesize(exemplar(kind, 32), [L] * 10, (96, 96), Settings(3), seed=1))
    way = departure(L)
    inside = np.s_[4:-4, 4:-4]  # where something flows in there is nothing to compare with
    changes = [rms((carry(a, way) - b)[inside]) / rms(b[inside]) for a, b in itertools.pairwise(frames)]
    assert np.median(changes[2:]) < 0.02
    assert 0.85 < rms(frames[-1]) / rms(exemplar(kind, 32)) < 1.15


@pytest.mark.parametrize("size", [16, 32])
@pytest.mark.parametrize("kind", KINDS)
def test_nothing_collapses(kind, size):
    """85 to 115 % of the exemplar's rms, and at least 45 % of its neighbourhoods used, on a curved flow."""
    I, L = exemplar(kind, size), wave(128)
    H = first_frame(I, L)
    quality = measure(H, axes_2d(L), I)
    assert 0.85 <= quality.rms <= 1.15
    assert quality.used >= 0.45
    if kind in CLOSED:
        whole, total = whole_motifs(H, axes_2d(L), I)
        assert total >= 8 and whole >= 0.9 * total


def test_k_coherence_does_not_collapse_either():
    I, L = exemplar("heart", 16), wave(96)
    quality = measure(first_frame(I, L, search="k-coherence"), axes_2d(L), I)
    assert 0.85 <= quality.rms <= 1.15
    assert quality.used >= 0.45


@pytest.mark.parametrize(("width", "height"), [(37, 53), (21, 16), (17, 64)])
def test_odd_sizes(width, height):
    I = exemplar("circle", 16)
    L = [constant((height, width), 0.3, -1.2)] * 2
    for H in synthesize(I, L, (height, width), Settings(2, iterations=1), seed=0):
        assert H.shape == (height, width, 2) and H.dtype == np.float32 and H.flags.c_contiguous
        assert np.isfinite(H).all() and rms(H) > 0.4 * rms(I)


def test_a_resting_flow_synthesizes_along_the_domains_axes():
    I = exemplar("stripes", 16)
    L = np.zeros((48, 48, 2), np.float32)
    first, second = synthesize(I, [L, L], (48, 48), Settings(2, iterations=2), seed=0)
    assert np.abs(first[..., 1]).max() < 0.2 and rms(first[..., 0]) > 0.85 * rms(I[..., 0])
    assert rms(second - first) < 0.05 * rms(first)


def test_the_exemplars_other_axis_lies_along_the_flow():
    """Stripes run across a flow to the right where their y axis follows it: H is in their own coordinates."""
    I, L = exemplar("stripes", 16), constant((48, 48))
    across = next(synthesize(I, [L], (48, 48), Settings(2, along="y"), seed=0))
    assert rms(np.diff(across, axis=0)) < 0.2 * rms(np.diff(across, axis=1))


@pytest.mark.parametrize(("size", "levels"), [(8, 1), (16, 2), (31, 2), (32, 3), (48, 3), (64, 4), (128, 5), (4, 1)])
def test_enough_levels_bring_the_exemplar_down_to_eight(size, levels):
    assert enough_levels(size) == levels
    assert size / 2 ** (levels - 1) >= COARSEST or levels == 1


def test_an_empty_exemplar_is_refused():
    with pytest.raises(ValueError, match="zero everywhere"):
        Synthesis(np.zeros((16, 16, 2), np.float32), (48, 48), Settings(2), seed=0)


def test_nothing_flows_in_where_nothing_flows():
    assert (distance_inland(np.zeros((5, 7, 2), np.float32)) == np.inf).all()


def test_the_distance_inland_is_that_upstream():
    x = np.broadcast_to(np.arange(7), (5, 7))
    np.testing.assert_allclose(distance_inland(constant((5, 7), -2.0)), np.where(x < 2, 0, x))
    np.testing.assert_allclose(distance_inland(constant((5, 7), 2.0))[:, ::-1], np.where(x < 2, 0, x))
    aslant = distance_inland(constant((9, 9), -0.5, 0.5))  # came from the left and from above
    np.testing.assert_allclose(aslant[2], np.sqrt(2) * np.minimum(np.arange(9), 6), rtol=1e-6)


def test_what_flows_in_is_synthesized_and_not_drawn_out():
    """A flow to the right, twice the exemplar's width: the motifs that came in are no longer than the others."""
    I, shape = exemplar("circle", 16), (48, 48)
    L = constant(shape, 0.8)
    H = list(synthesize(I, [L] * 41, shape, Settings(2), seed=1))[-1]
    whole, total = whole_motifs(H[:, :32], axes_2d(L)[:, :32], I)
    assert total >= 2 and whole >= 0.7 * total
    # drawn out, rows would not change along x
    assert rms(np.diff(H[:, :32], axis=1)) > 0.85 * rms(np.diff(I, axis=1))


def test_a_shift_deforms_nothing():
    way = constant((9, 11), -1.3, 0.4)
    frame = constant((9, 11), 0.8, 0.6)
    np.testing.assert_array_equal(deformation(way, frame, frame) < 1e-6, np.ones((9, 11), bool))


@pytest.mark.parametrize("shape", [(1, 9), (9, 1), (1, 1)])
def test_a_field_one_cell_wide_deforms_nothing(shape):
    frame = constant(shape)
    np.testing.assert_allclose(deformation(constant(shape, 0.5, 0.2), frame, frame), 0, atol=1e-6)


@pytest.mark.parametrize("shear", [0.01, -0.2])
def test_a_shear_deforms_by_its_rate(shear):
    y = np.arange(12, dtype=np.float32)[:, None]
    way = np.stack([np.broadcast_to(-shear * y, (12, 9)), np.zeros((12, 9))], -1).astype(np.float32)
    frame = constant((12, 9))
    np.testing.assert_allclose(deformation(way, frame, frame), abs(shear), rtol=1e-4)


def test_a_rotation_deforms_only_what_does_not_turn_with_it():
    """Rigid rotation by a: nothing to first order in a frame that turns along, sqrt(2) a in one that does not."""
    angle = 0.02
    y, x = np.mgrid[:21, :21].astype(np.float32) - 10
    way = departure(np.stack([-angle * y, angle * x], -1))
    before = constant((21, 21), 0.6, 0.8)
    c, s = np.cos(angle), np.sin(angle)
    after = constant((21, 21), 0.6 * c - 0.8 * s, 0.6 * s + 0.8 * c)
    inside = np.s_[2:-2, 2:-2]
    assert deformation(way, before, after)[inside].max() < 2 * angle**2
    np.testing.assert_allclose(deformation(way, before, before)[inside], np.sqrt(2) * angle, rtol=0.03)
