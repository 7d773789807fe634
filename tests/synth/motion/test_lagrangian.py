"""Lagrangian samples: the kernels against their references, what moving keeps, and how good the detail is."""

import numpy as np
import pytest

from synth import opencl
from synth.motion import lagrangian
from synth.motion.assignment import falloff
from synth.motion.detail import Settings, enough_levels
from synth.motion.exemplar import exemplar
from synth.motion.lagrangian import (
    CROWDED,
    REACH,
    THIN,
    TOGETHER,
    Synthesis,
    assign,
    assign_reference,
    bins,
    carried,
    chosen,
    cloud,
    gather_reference,
    seeded,
    site_bins,
    thin,
)
from synth.motion.local_axes import axes_2d
from synth.motion.quality import measure, whole_motifs

SHAPES = [(5, 7), (2, 2), (1, 9), (9, 1), (1, 1), (21, 26)]


def drawn(*shape, seed=0):
    return np.random.default_rng(seed).normal(size=shape).astype(np.float32)


def turning(count, seed=1):
    angle = np.random.default_rng(seed).uniform(-np.pi, np.pi, count)
    return np.stack([np.cos(angle), np.sin(angle)], -1).astype(np.float32)


def scattered(shape, count, seed=0):
    return np.random.default_rng(seed).uniform(0, np.array(shape[::-1]) - 1, (count, 2)).astype(np.float32)


def followed(values):
    return opencl.to_device(np.pad(values, ((0, TOGETHER), (0, 0))))


def wave(n):
    swing = 0.8 * np.sin(2 * np.pi * np.arange(n) / n)
    return np.stack([np.ones((n, n)), np.ones((n, n)) * swing], -1).astype(np.float32)


@pytest.mark.parametrize("shape", SHAPES)
def test_bins_hold_every_point_once_where_it_lies(shape):
    at = scattered(shape, 50)
    found = bins(at, shape, 2.0)
    assert sorted(found.order.tolist()) == list(range(50)) and found.first[0] == 0 and found.first[-1] == 50
    for y, x in np.ndindex(found.count):
        number = y * found.count[1] + x
        inside = at[found.order[found.first[number]:found.first[number + 1]]]
        assert (np.floor(inside / 2) == (x, y)).all()


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("radius", [0, 1, 4])
def test_gather_equals_its_reference(shape, radius):
    samples, order = cloud(scattered(shape, shape[0] * shape[1] + 3), shape)
    value, sites, axis = drawn(len(order), 2), scattered(shape, 14, 2), turning(14)
    ours = samples.gather(followed(value), sites, axis, radius).get()[:14]
    np.testing.assert_allclose(ours, gather_reference(samples.at, value, sites, axis, radius, shape), atol=2e-4)


def test_the_fit_gives_a_constant_exactly_and_a_slope_nearly():
    shape = (12, 15)
    samples, _ = cloud(seeded(shape, np.random.default_rng(0)), shape)
    points = scattered((8, 11), 40, 3) + 2
    constant = np.full((len(samples.at), 2), (2, -3), np.float32)
    np.testing.assert_allclose(samples.values_at(constant, points), np.broadcast_to([2, -3], (40, 2)), rtol=1e-5)
    np.testing.assert_allclose(samples.values_at(samples.at, points), points, atol=0.1)


def test_far_from_all_samples_there_is_nothing():
    samples, _ = cloud(np.float32([[1, 1]]), (9, 9))
    np.testing.assert_array_equal(samples.values_at(np.float32([[5, 7]]), np.float32([[1 + REACH + 0.1, 1]])), 0)
    np.testing.assert_allclose(samples.values_at(np.float32([[5, 7]]), np.float32([[2, 2]])), [[5, 7]])


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize(("radius", "size"), [(1, (5, 7)), (4, (16, 16)), (8, (2, 2))])
def test_assign_equals_its_reference(shape, radius, size):
    samples, _ = cloud(scattered(shape, shape[0] * shape[1] + 3), shape)
    sites = scattered(shape, 9, 2)
    sites = sites[site_bins(sites, shape, radius).order]
    I, axis, prior = drawn(*size, 2), turning(9), drawn(len(samples.at), 2, seed=4)
    position, weight = scattered(size, 9, 5), np.abs(drawn(9, seed=6)) + 0.1
    coherence = np.abs(drawn(len(samples.at), seed=7))
    ours = assign(I, radius, sites, opencl.to_device(position), opencl.to_device(weight), axis, shape, samples,
                  followed(prior), opencl.to_device(coherence)).get()
    expected = assign_reference(I, radius, sites, position, weight, axis, samples.at, prior, coherence)
    np.testing.assert_allclose(ours[:-TOGETHER], expected, atol=5e-5)
    np.testing.assert_array_equal(ours[-TOGETHER:], 0)
    assert falloff(radius) > 0


def test_sites_are_a_share_of_the_samples_with_none_too_close():
    shape = (40, 50)
    at = seeded(shape, np.random.default_rng(0))
    rank = np.random.default_rng(1).random(len(at))
    for spacing in (2, 4):
        there = at[chosen(at, rank, spacing)]
        assert 0.6 < len(there) / (len(at) / spacing**2) < 1.6
        apart = np.linalg.norm(there[:, None] - there, axis=-1) + 1e9 * np.eye(len(there))
        assert apart.min() >= spacing / np.sqrt(np.pi)
    assert len(chosen(at, rank, 1)) == len(at)


def test_samples_ride_on_a_constant_flow_with_their_detail_unchanged():
    shape = (20, 30)
    samples, _ = cloud(seeded(shape, np.random.default_rng(0)), shape)
    H, rank = drawn(len(samples.at), 2), np.arange(float(len(samples.at)))
    flow = np.broadcast_to(np.float32([0.5, 0.25]), (*shape, 2)).copy()
    after, carried_H, carried_rank = carried(samples.at, H, rank, flow, np.random.default_rng(1))
    old = carried_rank >= 1  # those put in have ranks below one
    by_rank = carried_rank[old].astype(int)
    np.testing.assert_array_equal(carried_H[old], H[by_rank])
    np.testing.assert_allclose(after.at[old], samples.at[by_rank] + [0.5, 0.25], atol=1e-5)


@pytest.mark.parametrize("squeeze", [-0.2, 0.2])
def test_where_a_flow_crowds_or_thins_samples_they_stay_even(squeeze):
    shape = (24, 24)
    samples, _ = cloud(seeded(shape, np.random.default_rng(0)), shape)
    at, H, rank = samples.at, drawn(len(samples.at), 2), np.random.default_rng(2).random(len(samples.at))
    flow = (squeeze * (np.stack(np.meshgrid(np.arange(24), np.arange(24)), -1) - 11.5)).astype(np.float32)
    for frame in range(8):
        samples, H, rank = carried(at, H, rank, flow, np.random.default_rng(frame))
        at = samples.at
        assert len(at) == len(H) == len(rank)
    assert 0.6 * 24**2 < len(at) < 2 * 24**2
    assert len(thin(at, shape)) < 0.02 * 24**2  # a new sample stands a little off its cell
    apart = np.linalg.norm(at[:, None] - at, axis=-1) + 1e9 * np.eye(len(at))
    assert np.mean(apart.min(axis=0) < CROWDED) < 0.05 and THIN > CROWDED


def test_the_exemplar_is_a_fixed_point():
    I, shape = exemplar("circle", 16), (48, 48)
    synthesis = Synthesis(I, shape, Settings(1, neighborhoods=(9,)), 1)
    samples, _ = cloud(np.stack(np.meshgrid(np.arange(48), np.arange(48)), -1).reshape(-1, 2).astype(np.float32), shape)
    H = I[samples.at[:, 1].astype(int) % 16, samples.at[:, 0].astype(int) % 16]
    ahead = np.broadcast_to(np.float32([1, 0]), (*shape, 2))
    rank = np.random.default_rng(0).random(len(H))
    after = lagrangian.optimize(synthesis.levels[0], samples, H, rank, ahead, 1)
    inner = ((samples.at > 8) & (samples.at < 40)).all(axis=1)
    assert np.sqrt(np.mean((after - H)[inner] ** 2)) < 0.06 * np.sqrt(np.mean(H**2))


def test_a_few_frames_are_as_good_as_on_a_grid():
    I, L = exemplar("circle", 16), wave(64)
    synthesis, state = Synthesis(I, (64, 64), Settings(enough_levels(16)), 1), None
    for _ in range(4):
        state = synthesis.frame(L, state)
        H = synthesis.visible(state)
        assert H.shape == (64, 64, 2) and H.dtype == np.float32 and np.isfinite(H).all()
        found = measure(H, axes_2d(L), I)
        assert found.used > 0.9 and 0.85 < found.rms < 1.15 and found.forward < 0.35
    whole, motifs = whole_motifs(H, axes_2d(L), I)
    assert motifs >= 5 and whole >= 0.8 * motifs
    at, values = synthesis.samples(state)
    assert len(at) == len(values) and 0.7 * 64**2 < len(at) < 2 * 64**2


def test_carried_samples_flicker_less_than_a_grid():
    """On a constant flow: the change of the detail where it has come to after four frames, over its rms."""
    from synth.motion import detail

    I, L = exemplar("heart", 16), np.broadcast_to(np.float32([0.5, 0.25]), (64, 64, 2)).copy()
    found = []
    for kind in (detail.Synthesis, Synthesis):
        synthesis, state, H = kind(I, (64, 64), Settings(2), 1), None, []
        for _ in range(7):
            state = synthesis.frame(L, state)
            H.append(synthesis.visible(state))
        found.append(np.sqrt(np.mean((H[6][20:-2, 20:-2] - H[2][19:-3, 18:-4]) ** 2)) / np.sqrt(np.mean(H[6] ** 2)))
    assert found[1] < 0.8 * found[0] and found[1] < 0.1, found


def test_a_flow_that_rests_keeps_the_detail():
    I, L = exemplar("circle", 16), np.zeros((40, 40, 2), np.float32)
    synthesis = Synthesis(I, (40, 40), Settings(2), 1)
    state = synthesis.frame(L, None)
    before, after = synthesis.visible(state), synthesis.visible(synthesis.frame(L, state))
    assert np.sqrt(np.mean((after - before) ** 2)) < 0.1 * np.sqrt(np.mean(before**2))


def test_the_same_seed_gives_the_same_bits_and_a_kept_state_goes_on_alike():
    I, L = exemplar("heart", 16), wave(40)
    first, again = (Synthesis(I, (40, 40), Settings(2), 5) for _ in range(2))
    state = first.frame(L, None)
    copy = again.frame(L, None)
    np.testing.assert_array_equal(first.visible(state), again.visible(copy))
    kept = lagrangian.State(*([a.copy() for a in getattr(copy, name)] for name in ("at", "H", "rank", "axes",
                                                                                    "number")))
    np.testing.assert_array_equal(first.visible(first.frame(L, state)),
                                  Synthesis(I, (40, 40), Settings(2), 5).visible(again.frame(L, kept)))


def test_k_coherence_is_refused():
    with pytest.raises(ValueError, match="no fixed neighbours"):
        Synthesis(exemplar("heart", 16), (40, 40), Settings(2, search="k-coherence"), 1)
