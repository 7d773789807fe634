"""Density: the exact identities of pseudocode 3 and 4, one step at a time against the NumPy reference, sources."""

import hashlib
import itertools

import numpy as np
import processes
import pytest
from scipy.ndimage import gaussian_filter

from synth.advect import advect_reference, displaced_reference
from synth.field import domain_origin
from synth.motion.coarse import upsample
from synth.motion.density import (
    THINNEST,
    Carried,
    Source,
    memory_needed,
    naive,
    riding_reference,
    window,
    windowed,
)


def flows(shape, n, seed=0, speed=1.5):
    rng = np.random.default_rng(seed)
    frames = rng.normal(size=(n, *shape, len(shape)))
    smooth = gaussian_filter(frames, (1, *(2,) * len(shape), 0), mode="wrap")
    return list((smooth * speed / smooth.std()).astype(np.float32))


def reference(F_frames, sources, start=None, before=0, border="zero"):
    """Pseudocode 3 in NumPy, from O_before on."""
    shape = F_frames[0].shape[:-1]
    density = np.zeros(shape, np.float32) if start is None else start
    for i, F in enumerate(F_frames, before + 1):
        density = density.copy()
        for source in sources:
            box, lowest, highest = source.bounds(shape, i)
            density[box] = np.minimum(np.maximum(density[box], lowest), highest)
        density = advect_reference(density, F, border=border)
        density[density < np.float32(THINNEST)] = 0
        yield density


SHAPES = [(20, 27), (7, 12, 9)]
SOURCES = [Source((0.1, 0.3), 0.2, streaks=0.7, streak_size=0.1),
           Source((-0.2, 0.6), (0.1, 0.2), "box", level=0.6, period=3, duty=0.4)]
BOTH = pytest.mark.parametrize("shape", SHAPES)


def equal(a, b, visible=0.1):
    a, b = list(a), list(b)
    assert len(a) == len(b) and len(a) > 0
    for x, y in zip(a, b, strict=True):
        np.testing.assert_array_equal(x, y)
    assert a[-1].max() >= visible


@BOTH
@pytest.mark.parametrize("border", ["zero", "clamp", "toroidal"])
def test_naive_equals_numpy_bit_for_bit(shape, border):
    F = flows(shape, 8)
    equal(naive(F, SOURCES, border=border), reference(F, SOURCES, border=border))


@pytest.mark.parametrize("border", ["zero", "clamp", "toroidal"])
@pytest.mark.parametrize("shape", [(30, 300), (9, 20, 150)])
def test_cells_without_smoke_are_left_out_without_a_trace(shape, border):
    """Small puffs cross a wide grid, leave it or come round again, and the next begin on an empty one."""
    F = [f + np.float32((17.0, *(4.0,) * (len(shape) - 1))) for f in flows(shape, 30)]
    puffs = [Source((-1.0, 0.3), 0.1, period=14, duty=0.08)]
    expected = list(reference(F, puffs, border=border))
    equal(naive(F, puffs, border=border), expected, 0.0)
    equal(windowed(F, F, puffs, 3, border=border), expected, 0.0)
    if border == "zero":
        assert not expected[12].any() and expected[14].any()


@BOTH
@pytest.mark.parametrize("m", [1, 2, 3, 4, 5, 8, 11, 16, 19, 40])
def test_with_f_equal_to_l_the_window_vanishes(shape, m):
    F = flows(shape, 22)
    equal(windowed(F, F, SOURCES, m), naive(F, SOURCES))


@BOTH
@pytest.mark.parametrize("m", [9, 12, 33])
def test_a_window_as_long_as_the_animation_is_naive(shape, m):
    F, L = flows(shape, 9), flows(shape, 9, seed=1)
    equal(windowed(L, F, SOURCES, m), naive(F, SOURCES))


@BOTH
@pytest.mark.parametrize("m", [1, 2, 5, 8, 17])
def test_streaming_equals_pseudocode_4_as_written(shape, m):
    F, L = flows(shape, 21), flows(shape, 21, seed=1)
    streamed = list(windowed(L, F, SOURCES, m))
    O = [None, *reference(L, SOURCES)]
    for i in (*range(1, 6), 15, 17, 20, 21):
        start = max(0, i - m)
        *_, D = reference(F[start:i], SOURCES, O[start], start)
        np.testing.assert_array_equal(streamed[i - 1], D)
        np.testing.assert_array_equal(window(O[start], F[start:i], SOURCES, start + 1), D)
    assert any(not np.array_equal(a, b) for a, b in zip(streamed, naive(F, SOURCES), strict=True))


def test_old_detail_is_forgotten():
    """Frames of F that lie further back than m leave no trace."""
    shape = (16, 16)
    L, F = flows(shape, 12), flows(shape, 12, seed=1)
    other = [*flows(shape, 8, seed=2), *F[8:]]
    for m, same in ((4, True), (5, False)):
        last, of_other = (list(windowed(L, frames, SOURCES, m))[11] for frames in (F, other))
        assert np.array_equal(last, of_other) == same


def test_a_finer_density_moves_as_the_field_says():
    """One cell per frame of the field is `scale` cells of the density."""
    F = [np.full((8, 10, 2), (1.0, 0.0), np.float32)] * 3
    source = [Source((-0.2, 0.5), 0.2, period=9, duty=0.1)]
    first, second, third = naive(F, source, scale=4)
    assert first.shape == (32, 40)
    np.testing.assert_allclose(second[:, 4:], first[:, :-4], atol=THINNEST)
    np.testing.assert_allclose(third[:, 8:], first[:, :-8], atol=THINNEST)


def test_a_coarser_l_is_upsampled_as_f_was():
    shape = (8, 10)
    L = flows(shape, 6, speed=0.5)
    F = [upsample(v, (16, 20)) for v in L]
    equal(windowed(L, F, SOURCES, 3, scale=2), naive(F, SOURCES, scale=2))


@BOTH
def test_detail_that_is_nothing_rides_on_l_without_a_trace(shape):
    L = flows(shape, 8)
    equal(naive([Carried(v, v) for v in L], SOURCES), naive(L, SOURCES))


@pytest.mark.parametrize("shape", [(5, 7), (2, 2), (5, 7, 3), (2, 2, 2), (3, 9, 70)])
@pytest.mark.parametrize("border", ["zero", "clamp", "toroidal"])
def test_riding_detail_is_its_specification(shape, border):
    L, F, full = flows(shape, 2), flows(shape, 2, seed=1, speed=2.5), [Source((0.0, 0.5), 9.0, streaks=0.7)]
    density = np.zeros(shape, np.float32)
    found = naive([Carried(f, l) for l, f in zip(L, F, strict=True)], full, border=border)
    for i, (l, f, D) in enumerate(zip(L, F, found, strict=True), 1):
        box, lowest, highest = full[0].bounds(shape, i)
        density[box] = np.minimum(np.maximum(density[box], lowest), highest)
        way = riding_reference(l, f - l, border)
        density = displaced_reference(density[..., None], way, border)[..., 0]
        density[density < np.float32(THINNEST)] = 0
        np.testing.assert_array_equal(D, density)


def test_smoke_in_a_swirl_that_is_carried_on_turns_with_it():
    """A rigid swirl rides on a constant L: smoke at its centre keeps its place in it; standing still, it drifts out."""
    size, step = 48, 2.0
    y, x = np.mgrid[:size, :size].astype(np.float32)
    L = np.full((size, size, 2), (step, 0.0), np.float32)

    def swirl(frame):
        dx, dy = x - 8 - step * frame, y - 24
        falloff = 0.5 * np.exp(-(dx**2 + dy**2) / 40)
        return np.stack([-dy * falloff, dx * falloff], axis=-1).astype(np.float32)

    source = [Source(((8 - 23.5) / size, 24.5 / size), 3 / size, period=99, duty=0.01)]
    F = [L + swirl(frame) for frame in range(1, 13)]
    centred = {}
    for name, motion in (("rides", [Carried(v, L) for v in F]), ("stands", F)):
        *_, D = naive(motion, source)
        centre = np.array([(D * x).sum(), (D * y).sum()]) / D.sum()
        centred[name] = np.hypot(*(centre - (8 + step * 12, 24)))
    assert centred["rides"] < 0.35 < centred["stands"]


def test_frames_are_taken_one_by_one_and_memory_does_not_grow():
    taken = []

    def endless(field):
        for i in itertools.count():
            taken.append(i)
            yield field

    L, F = (f[0] for f in (flows((8, 8), 1), flows((8, 8), 1, seed=1)))
    frames = windowed(endless(L), endless(F), SOURCES, 4)
    for i in range(1, 8):
        next(frames)
        assert len(taken) == 2 * i


def test_frames_are_the_callers_own():
    frames = naive(flows((8, 8), 2), SOURCES)
    first = next(frames)
    kept = first.copy()
    next(frames)
    np.testing.assert_array_equal(first, kept)


def test_l_and_f_must_be_equally_long():
    with pytest.raises(ValueError, match=r"shorter|longer"):
        list(windowed(flows((8, 8), 2), flows((8, 8), 3), SOURCES, 2))


@BOTH
def test_density_stays_between_zero_and_the_level(shape):
    for D in naive(flows(shape, 12, speed=4.0), [Source((0.0, 0.3), 0.25, level=0.8)]):
        assert D.min() >= 0 and D.max() <= 0.8 + 1e-6


# Sources.


def whole(source, shape, frame=1):
    density = np.zeros(shape, np.float32)
    box, lowest, _ = source.bounds(shape, frame)
    density[box] = lowest
    return density


def test_a_ball_is_where_it_should_be_at_every_resolution():
    for shape in ((64, 64), (32, 48), (28, 64, 48)):
        density = whole(Source((0.1, 0.3), 0.2, softness=0.2), shape)
        axes = [o + np.arange(n) / shape[-2] for o, n in zip(domain_origin(shape), shape[::-1], strict=True)]
        grid = np.meshgrid(*axes[::-1], indexing="ij")[::-1]
        mean = [float((density * g).sum() / density.sum()) for g in grid]
        np.testing.assert_allclose(mean, [0.1, 0.3, 0.0][: len(shape)], atol=2e-3)
        volume = density.sum() / shape[-2] ** len(shape)
        expected = np.pi * 0.18**2 if len(shape) == 2 else 4 / 3 * np.pi * 0.18**3
        assert volume == pytest.approx(expected, rel=0.03)
        assert density.max() == 1.0


def test_an_ellipse_and_a_box_have_their_axes():
    ellipse = whole(Source((0.0, 0.5), (0.4, 0.1)), (64, 64)) > 0.5
    assert ellipse.any(0).sum() > 3 * ellipse.any(1).sum()
    box = whole(Source((0.0, 0.5), 0.25, "box", softness=0.0), (64, 64)) == 1.0
    assert box.sum() == 30**2 and box[17:47, 17:47].all()  # 32 cells wide, the outermost fade


def test_a_source_holds_its_pattern_and_lets_go_at_its_edge():
    source = Source((0.0, 0.5), 0.3, softness=0.5, level=0.7, streaks=0.5, streak_size=0.05)
    _, lowest, highest = source.bounds((64, 64), 1)
    assert (lowest <= highest + 1e-7).all() and lowest.min() == 0.0 and highest.max() == 1.0
    centre = (slice(15, 25), slice(15, 25))
    np.testing.assert_allclose(lowest[centre], highest[centre], atol=1e-6)
    assert lowest[centre].min() < 0.55 and 0.6 < lowest[centre].max() <= 0.7
    _, nothing, anything = Source((0.0, 0.5), 0.3, period=2, duty=0.5).bounds((64, 64), 2)
    assert not nothing.any() and (anything == 1).all()


def test_puffs():
    source = Source((0.0, 0.5), 0.2, period=4, duty=0.5)
    assert [bool(whole(source, (16, 16), i).any()) for i in range(1, 9)] == [True, True, False, False] * 2


def test_streaks_run_along_y_and_are_seeded():
    plain, streaked, other = (whole(Source((0.0, 0.5), 0.4, "box", softness=0.1, streaks=s,
    streak_size=0.05, seed=n),
                                    (64, 64)) for s, n in ((0.0, 0), (0.9, 0), (0.9, 1)))
    ratio = streaked[20:44, 10:54] / plain[20:44, 10:54]
    np.testing.assert_allclose(ratio, np.broadcast_to(ratio[0], ratio.shape), rtol=1e-5)
    assert ratio.min() < 0.4 and ratio.max() > 0.9 and ratio.min() >= 0.1 - 1e-6
    assert not np.array_equal(streaked, other)
    assert whole(Source((0.0, 0.5), 0.4, streaks=0.9), (16, 64, 64)).std(0).max() > 0.2  # across z as well


def test_a_source_partly_or_wholly_outside():
    assert whole(Source((0.0, 0.0), 0.2), (32, 32))[0].max() == 1.0
    assert not whole(Source((0.0, 5.0), 0.2), (32, 32)).any()


@pytest.mark.parametrize("wrong", [
    {"kind": "cone"}, {"radius": 0.0}, {"softness": 2.0}, {"level": -0.1}, {"duty": 1.5}, {"period": 0},
    {"centre": (0.0,)}, {"centre": (0.0, np.nan)}, {"streak_size": 0.0}])
def test_source_refusals(wrong):
    with pytest.raises(ValueError, match="source"):
        Source(**{"centre": (0.0, 0.5), "radius": 0.2, **wrong})


def test_refusals():
    F = flows((8, 8), 2)
    with pytest.raises(ValueError, match="at least 1"):
        next(windowed(F, F, SOURCES, 0))
    with pytest.raises(ValueError, match="scale"):
        next(naive(F, SOURCES, scale=0))
    with pytest.raises(ValueError, match="border"):
        next(naive(F, SOURCES, border="mirror"))
    with pytest.raises(ValueError, match="O has shape"):
        window(np.zeros((4, 4), np.float32), F, SOURCES, 1)
    with pytest.raises(ValueError, match="at least one"):
        window(None, [], SOURCES, 1)
    with pytest.raises(ValueError, match="NaN"):
        list(naive([F[0], F[1] * np.nan], SOURCES))


def test_the_memory_it_says_grows_with_cells_and_with_the_window():
    one = memory_needed((16, 64, 64), 16)
    assert memory_needed((32, 64, 64), 16) == pytest.approx(2 * one)
    assert one < memory_needed((16, 64, 64), 17) < 1.5 * one  # a second group of lanes
    assert memory_needed((16, 64, 64), 16, scale=2) > 4 * one
    assert memory_needed((4096, 4096, 4096), 16) > 1e13


# Repeatability: another process, one thread, cold kernel cache.

def digest():
    """SHA-256 of densities in two and in three dimensions: what the subprocesses below print."""
    found = hashlib.sha256()
    for shape in ((20, 70), (7, 12, 9)):
        for D in windowed(flows(shape, 9), flows(shape, 9, seed=1), SOURCES, 4, scale=1.5):
            found.update(D.tobytes())
    return found.hexdigest()


def test_the_same_bits_with_one_thread_and_two_in_a_cold_and_a_warm_cache(tmp_path):
    (found,) = processes.digests(__file__, tmp_path)
    assert len(found) == 64
