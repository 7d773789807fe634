"""The paper's method: what must stay as it is, what must be found, and that kernels do what their references say."""

import hashlib
import itertools
from dataclasses import replace

import numpy as np
import processes
import pytest

from synth.texture.paper import (
    Canvas,
    Settings,
    State,
    Synthesis,
    best_fit_reference,
    blending,
    hole_cells,
    jobs,
    masks_reference,
    moved,
    moved_pixels,
    paste_reference,
)
from synth.texture.sample import rotated, sample

SMALL = Settings(n=8, largest=8, D=3, validity=float(np.deg2rad(30)))
READINGS = [{}, {"velocity_spread": "speeds"}, {"remainder": "place"}, {"refill_overlaps": False},
            {"resynthesis_blends": False}, {"first_frame_blends": True, "overblended": 4.0}, {"remove_blur": False}]


def noise(shape, seed=0):
    """A sample of coloured noise, each place of it like no other."""
    return sample(np.random.default_rng(seed).uniform(size=(*shape, 3)).astype(np.float32), direction=0.0)


def stripes(size=48):
    """A sample of stripes along x, of irregular width and brightness."""
    random = np.random.default_rng(3)
    rows = np.repeat(random.uniform(0.1, 0.9, size), random.integers(2, 6, size))[:size]
    grain = random.uniform(0.8, 1.2, (size, size // 4)).repeat(4, axis=1)
    return sample((rows[:, None] * grain)[..., None].repeat(3, -1).astype(np.float32), direction=0.0)


def constant(shape, x, y=0.0):
    return np.broadcast_to(np.float32([x, y]), (*shape, 2)).copy()


def circles(shape, turn=0.03):
    y, x = np.mgrid[: shape[0], : shape[1]]
    return turn * np.stack([(shape[0] - 1) / 2 - y, x - (shape[1] - 1) / 2], -1).astype(np.float32)


def sequence(synthesis, v, frames):
    state, states = None, []
    for _ in range(frames):
        state = synthesis.frame(v, state)
        states.append(state)
    return states


def seeds(seed=0):
    return np.random.Generator(np.random.Philox(key=seed))


def same(a, b):
    for name, values in a.arrays().items():
        np.testing.assert_array_equal(values, b.arrays()[name], err_msg=name)


# Equation 1


def test_equation_1():
    d = np.array([1, 2, 3, 4, 4.01, 9])
    np.testing.assert_allclose(blending(d, 4), [0.8, 0.6, 0.4, 0.2, 0, 0], rtol=1e-6)
    np.testing.assert_allclose(blending(np.array([np.sqrt(2)]), 1), [0])


# the method's invariants


@pytest.mark.parametrize("reading", READINGS)
def test_no_flow_gives_identical_frames(reading):
    synthesis = Synthesis(stripes(), (37, 53), replace(SMALL, **reading), seed=1)
    first, second, third = sequence(synthesis, constant((37, 53), 0), 3)
    for state in (second, third):
        same(replace(state, holes=first.holes, resynthesized=first.resynthesized, number=0), first)
        assert not state.holes.any() and state.resynthesized == 0


@pytest.mark.parametrize("remove_blur", [True, False])
@pytest.mark.parametrize(("x", "y"), [(2, 0), (1, 2), (-1, -1), (0, -3)])
def test_a_flow_of_whole_pixels_is_an_exact_shift_inside(x, y, remove_blur):
    """Only what flows in is drawn, and D pixels around it blended; or a cell, where it is over-blended."""
    settings, steps, shape = replace(SMALL, most=4.0, remove_blur=remove_blur), 3, (57, 70)
    first, *_, last = sequence(Synthesis(stripes(), shape, settings, seed=1), constant(shape, x, y), 1 + steps)
    margin = 3 * steps + settings.D + remove_blur * settings.largest
    here = np.s_[margin:-margin, margin:-margin]
    for name in ("colour", "luminance", "direction", "blendings", "remainder"):
        before, after = getattr(first, name), getattr(last, name)
        np.testing.assert_array_equal(after[here], np.roll(before, (steps * y, steps * x), (0, 1))[here])
    assert not last.holes[here].any()
    width, height = abs(x), abs(y)
    assert last.holes.sum() == shape[0] * shape[1] - (shape[0] - height) * (shape[1] - width)


@pytest.mark.parametrize("remainder", ["texture", "place"])
def test_slow_pixels_move_when_their_distance_is_enough(remainder):
    """§3: of 0.3 pixels a frame nothing is lost."""
    shape, settings = (24, 64), replace(SMALL, remainder=remainder)
    states = sequence(Synthesis(stripes(), shape, settings, seed=1), constant(shape, 0.3), 11)
    here = np.s_[8:-8, 24:-8]
    at = [round(float(s.remainder[here][..., 0].mean()), 4) for s in states[:5]]
    assert at == [0, 0.3, -0.4, -0.1, 0.2]
    for frame, whole in ((1, 0), (2, 1), (5, 2), (10, 3)):
        np.testing.assert_array_equal(states[frame].colour[here], np.roll(states[0].colour, whole, 1)[here])


def test_speeds_are_limited():
    shape = (24, 64)
    for v, speed in ((40.0, 3), (0.01, 1)):
        synthesis = Synthesis(stripes(), shape, replace(SMALL, least=1.0, most=3.0), seed=1)
        first, second = sequence(synthesis, constant(shape, v), 2)
        np.testing.assert_array_equal(second.colour[8:-8, 16:-8], np.roll(first.colour, speed, 1)[8:-8, 16:-8])


def test_what_moves_out_of_the_picture_at_once_is_replaced():
    shape = (24, 30)
    synthesis = Synthesis(stripes(), shape, replace(SMALL, most=5000.0), seed=1)
    _, second, third = sequence(synthesis, constant(shape, 3000, 1000), 3)
    assert second.holes.all() and second.resynthesized == 1 and (second.colour > 0.01).all()
    assert np.abs(third.colour - second.colour).mean() > 0.01


@pytest.mark.parametrize("k", range(8))
def test_the_first_frame_points_along_the_flow(k):
    angle = 2 * np.pi * k / 8
    state = Synthesis(stripes(), (20, 31), SMALL, seed=1).frame(constant((20, 31), np.cos(angle), np.sin(angle)))
    np.testing.assert_allclose(state.direction, angle, atol=1e-6)
    along = [np.abs(np.diff(state.luminance, axis=axis)).mean() for axis in (1, 0)]
    assert k % 2 or np.argmin(along) == k // 2 % 2


def test_the_first_frame_holds_whole_patches_of_the_sample():
    """Where one direction reigns, the middle of each cell of 32 is the sample's own, pixel for pixel."""
    source = noise((64, 64))
    state = Synthesis(source, (64, 64), Settings(n=4), seed=1).frame(constant((64, 64), 1))
    windows = np.lib.stride_tricks.sliding_window_view(source.luminance, (20, 20))
    for y, x in itertools.product((6, 38), repeat=2):
        patch = state.luminance[y : y + 20, x : x + 20]
        assert (np.abs(windows - patch).max(axis=(2, 3)) < 1e-5).sum() == 1


@pytest.mark.parametrize("shape", [(37, 53), (5, 70), (3, 3), (1, 1)])
@pytest.mark.parametrize("reading", READINGS)
def test_every_pixel_is_texture_in_every_frame(shape, reading):
    source = stripes()
    synthesis = Synthesis(source, shape, replace(SMALL, **reading), seed=1)
    for state in sequence(synthesis, circles(shape, 0.1), 4):
        assert state.texture.all() and state.colour.min() >= source.colour.min() and state.colour.shape == (*shape, 3)
        assert np.isfinite(state.colour).all() and state.colour.max() <= source.colour.max() * (1 + 1e-6)
        assert all(values.flags.c_contiguous for values in state.arrays().values())
        assert state.holes.mean() <= state.resynthesized <= 1


def test_a_mask_has_no_texture_and_nothing_comes_from_it():
    shape = (40, 50)
    land = np.zeros(shape, bool)
    land[10:22, 14:30] = True
    v = circles(shape)
    synthesis = Synthesis(stripes(), shape, SMALL, seed=1)
    one, other = None, None
    for _ in range(4):
        one = synthesis.frame(v, one, ~land)
        other = synthesis.frame(np.where(land[..., None], np.nan, v), other)
        same(one, other)
        assert (one.colour[land] == 0).all() and (one.colour[~land] > 0.01).all()
        assert not one.holes[land].any()


def test_what_is_blended_too_often_is_drawn_anew():
    shape = (64, 64)
    kept, renewed = (sequence(Synthesis(stripes(), shape, replace(SMALL, remove_blur=remove), seed=1),
                              circles(shape), 8)[-1] for remove in (False, True))
    assert kept.resynthesized == kept.holes.mean() and renewed.resynthesized > renewed.holes.mean()
    assert kept.blendings.mean() > renewed.blendings.mean()
    assert renewed.luminance.std() > 0.98 * kept.luminance.std()


# state


def test_a_second_synthesis_resumes_from_arrays():
    shape, v = (37, 53), circles((37, 53))
    uninterrupted = sequence(Synthesis(stripes(), shape, SMALL, seed=5), v, 4)
    state = None
    for expected in uninterrupted:
        state = Synthesis(stripes(), shape, SMALL, seed=5).frame(v, state)
        same(state, expected)
        state = State.of({name: values.copy() for name, values in state.arrays().items()})


def test_the_seed_decides():
    v = circles((24, 24))
    one, again, other = (Synthesis(noise((40, 40)), (24, 24), SMALL, seed).frame(v) for seed in (1, 1, 2))
    same(one, again)
    assert np.abs(one.colour - other.colour).mean() > 0.05


def digest():
    """SHA-256 of three frames: what the subprocesses below print."""
    found = hashlib.sha256()
    for state in sequence(Synthesis(stripes(), (61, 70), SMALL, seed=5), circles((61, 70)), 3):
        for values in state.arrays().values():
            found.update(values.tobytes())
    return found.hexdigest()


def test_the_same_bits_at_any_thread_count_and_from_a_cold_cache(tmp_path):
    assert processes.digests(__file__, tmp_path) == {digest()}


# §2.2.1 and §2.2.2


def still(shape, direction=0.0):
    """A state in which every pixel is told apart by its colour."""
    number = np.arange(shape[0] * shape[1], dtype=np.float32).reshape(shape)
    return State(np.stack([number, -number, number + 0.5], -1), number, np.full(shape, direction, np.float32),
                 np.zeros(shape, np.int32), np.zeros((*shape, 2), np.float32), np.zeros(shape, bool),
                 np.ones(shape, bool), 0.0, 0)


def test_pixels_covered_never_or_twice_are_invalid():
    """Two cells of 8 that move one toward the other: two rows of pixels are covered twice, two come free."""
    shape = (8, 16)
    v = constant(shape, 1)
    v[:, 8:, 0] = -1
    angles = np.zeros(shape)
    for refill in (True, False):
        result = moved(still(shape), v, angles, np.ones(shape, bool), replace(SMALL, refill_overlaps=refill))
        assert np.flatnonzero(result.holes.all(0)).tolist() == ([0, 7, 8, 15] if refill else [0, 15])
        assert np.flatnonzero(result.holes.any(0)).tolist() == ([0, 7, 8, 15] if refill else [0, 15])
        expected = [*range(6), *range(10, 16)]
        np.testing.assert_array_equal(result.picture[0, [*range(1, 7), *range(9, 15)], 3], expected)
    # column 7 holds the mean of what came from 6 and from 8
    np.testing.assert_array_equal(result.picture[0, 7:9, 3], [7, 8])
    np.testing.assert_array_equal(result.blendings[0], [*[0] * 7, 1, 1, *[0] * 7])


def test_texture_that_does_not_point_along_the_flow_is_invalid():
    shape, settings = (16, 16), replace(SMALL, validity=float(np.deg2rad(15)))
    angles = np.zeros(shape)
    angles[:, 8:] = np.deg2rad(14)
    angles[:8] += np.deg2rad(2)
    for turn in (0, 2 * np.pi):  # on the circle
        state = still(shape, turn)
        result = moved(state, constant(shape, 1e-3), angles, np.ones(shape, bool), settings)
        assert result.holes[:8, 8:].all() and result.holes.sum() == 64
        # what rests has no direction
        assert not moved(state, constant(shape, 0), angles, np.ones(shape, bool), settings).holes.any()


def test_a_cell_moves_by_the_average_of_its_velocities():
    shape = (8, 8)
    v = constant(shape, 1)
    v[:4, :, 0] = 2.4  # 1.7 on average: two pixels, 0.3 too far
    result = moved(still(shape), v, np.zeros(shape), np.ones(shape, bool), SMALL)
    np.testing.assert_array_equal(result.picture[:, 2:, 3], still(shape).luminance[:, :-2])
    np.testing.assert_array_equal(result.picture[:, 2:, :3], still(shape).colour[:, :-2])
    np.testing.assert_allclose(result.remainder[:, 2:, 0], -0.3, rtol=1e-5)
    assert result.holes[:, :2].all()


# figure 3


def test_pixels_moved_one_by_one():
    picture = np.random.default_rng(0).uniform(size=(20, 30, 3)).astype(np.float32)
    np.testing.assert_array_equal(moved_pixels(picture, constant((20, 30), 0), 20), picture)
    shifted = moved_pixels(picture, constant((20, 30), 2, -1), 3)
    np.testing.assert_array_equal(shifted[:-3, 6:], picture[3:, :-6])
    np.testing.assert_array_equal(shifted[:-3, :6], picture[3:, :1].repeat(6, axis=1))  # the border, drawn out


# §2.2.3: cells over holes, and what fills them


def some_holes(shape, seed=0):
    """Slivers, a block larger than any cell, and single pixels."""
    holes = np.random.default_rng(seed).uniform(size=shape) < 0.02
    holes[shape[0] // 3] = True
    holes[:, shape[1] // 2] = True
    holes[-12:, -11:] = True
    return holes


@pytest.mark.parametrize("shape", [(37, 53), (64, 64)])
def test_cells_over_holes_cover_each_and_obey_the_limits(shape):
    holes, v = some_holes(shape), circles(shape)
    angles = np.arctan2(v[..., 1], v[..., 0])
    cell = hole_cells(holes, angles, 48, 16, 4)
    np.testing.assert_array_equal(cell >= 0, holes)
    for number in range(cell.max() + 1):
        y, x = np.nonzero(cell == number)
        side = max(np.ptp(x), np.ptp(y)) + 1
        turn = angles[y, x] - angles[y[0], x[0]]
        turn -= 2 * np.pi * np.rint(turn / (2 * np.pi))
        assert len(x) and side <= 16 and (side <= 4 or np.ptp(turn) < 2 * np.pi / 48)


def test_a_hole_that_fits_is_one_cell():
    holes = np.zeros((40, 40), bool)
    holes[3:9, 4:20] = True
    holes[30, 30] = holes[31, 31] = True  # touching at a corner
    cell = hole_cells(holes, np.zeros((40, 40)), 48)
    assert cell.max() == 1 and len(set(cell[3:9, 4:20].ravel())) == 1 and cell[30, 30] == cell[31, 31]


@pytest.mark.parametrize("in_order", [False, True])
def test_cells_of_one_batch_do_not_meet(in_order):
    v = circles((64, 80))
    angles = np.arctan2(v[..., 1], v[..., 0])
    owner = hole_cells(some_holes((64, 80)), angles, 8, 8, 4)
    found = jobs(owner, angles, SMALL, seeds(), in_order=in_order)
    assert [first for first, _ in found.batches] == [0, *(last for _, last in found.batches[:-1])]
    assert found.batches[-1][1] == len(found.table) == owner.max() + 1
    np.testing.assert_array_equal(found.owner >= 0, owner >= 0)
    batch = np.repeat(np.arange(len(found.batches)), [last - first for first, last in found.batches])
    x0, y0, x1, y1 = found.table[:, :4].T
    meets = (x0[:, None] < x1) & (x0 < x1[:, None]) & (y0[:, None] < y1) & (y0 < y1[:, None])
    assert (batch[:, None] != batch)[meets & ~np.eye(len(x0), dtype=bool)].all()
    if in_order:
        corner = [np.min(np.nonzero(found.owner == job), axis=1) for job in range(len(x0))]
        earlier = np.array([[tuple(a) < tuple(b) for b in corner] for a in corner])
        assert (batch[:, None] < batch)[meets & earlier].all()


def test_nothing_to_fill_is_nothing_to_do():
    found = jobs(np.full((9, 9), -1), np.zeros((9, 9)), SMALL, seeds())
    assert found.table.shape == (0, 8) and not found.batches


def filled_reference(source, settings, picture, valid, found):
    """What `_fill` must give, one job after the other: picture, direction and how often each pixel was blended."""
    copies = rotated(source, settings.n)
    patches = np.concatenate([copies.colour, copies.luminance[..., None]], -1) * copies.valid[..., None]
    picture, valid = picture * valid[..., None], valid.copy()
    copy_of, blendings = np.zeros(valid.shape, int), np.zeros(valid.shape, int)
    for job in found.table:
        x0, y0, x1, y1, copy, number = job[:6]
        here = np.s_[y0:y1, x0:x1]
        weight, T = masks_reference(found.owner, valid, job, settings.D)
        _, u, v = best_fit_reference(patches[copy, ..., 3], copies.valid[copy], picture[here][..., 3], T, int(job[7]))
        patch, hole = patches[copy, v : v + y1 - y0, u : u + x1 - x0], found.owner[here] == number
        picture[here] = paste_reference(patch, hole, weight, picture[here])
        valid[here] |= hole
        blendings[here] = np.where(hole, 0, blendings[here] + (weight > 0))
        copy_of[here] = np.where(weight > 0.5, copy, copy_of[here])
    return picture, copy_of, blendings


@pytest.mark.parametrize("kind", ["holes", "whole", "first"])
@pytest.mark.parametrize(("shape", "size"), [((37, 53), (31, 27)), ((16, 23), (40, 33)), ((9, 5), (27, 27))])
def test_filling_does_what_its_reference_does(kind, shape, size):
    source, v = noise(size), circles(shape)
    angles = np.arctan2(v[..., 1], v[..., 0])
    synthesis = Synthesis(source, shape, SMALL, seed=1)
    s = synthesis.settings
    random = np.random.default_rng(2)
    picture = random.uniform(size=(*shape, 4)).astype(np.float32)
    holes = some_holes(shape) if kind != "first" else np.ones(shape, bool)
    owner = hole_cells(holes, angles, s.n, s.largest, s.smallest)
    found = jobs(owner, angles, s, seeds(), whole=kind == "whole", in_order=kind == "first")
    valid = ~holes | (kind == "whole")
    canvas = Canvas(picture, valid, np.zeros(shape, np.int32), np.zeros(shape, np.float32), s.n)
    synthesis._fill(canvas, found, blends=True)
    expected, direction, blendings = filled_reference(source, s, picture, valid, found)
    np.testing.assert_allclose(canvas.picture.get(), expected, atol=2e-6)
    np.testing.assert_array_equal(canvas.direction.get(), direction)
    np.testing.assert_array_equal(canvas.blendings.get(), blendings)
    assert canvas.valid.get().all()


@pytest.mark.parametrize("whole", [False, True])
def test_a_planted_patch_is_found(whole):
    """A picture cut out of a rotated copy, with a hole: the hole gets back what was there."""
    source = noise((48, 52))
    synthesis = Synthesis(source, (24, 24), SMALL, seed=1)
    copies = rotated(source, 8)
    for k, (u, v) in ((1, (28, 30)), (2, (18, 15)), (0, (12, 17))):
        planted = np.concatenate([copies.colour, copies.luminance[..., None]], -1)[k, v : v + 24, u : u + 24]
        assert copies.valid[k, v : v + 24, u : u + 24].all()
        holes = np.zeros((24, 24), bool)
        holes[9:15, 8:16] = holes[7, 10] = True
        angles = np.full((24, 24), 2 * np.pi * k / 8)
        found = jobs(hole_cells(holes, angles, 8, 8, 4), angles, synthesis.settings, seeds(), whole)
        canvas = Canvas(planted, ~holes | whole, np.zeros((24, 24), np.int32), angles, 8)
        synthesis._fill(canvas, found, blends=True)
        np.testing.assert_array_equal(canvas.picture.get()[holes], planted[holes])
        np.testing.assert_allclose(canvas.picture.get(), planted, atol=1e-6)


def test_the_result_does_not_depend_on_how_searches_are_dealt_out(monkeypatch):
    expected = sequence(Synthesis(stripes(), (37, 53), SMALL, seed=1), circles((37, 53)), 2)[-1]
    for items in (1, 500):
        monkeypatch.setattr("synth.texture.paper.ITEMS", items)
        same(sequence(Synthesis(stripes(), (37, 53), SMALL, seed=1), circles((37, 53)), 2)[-1], expected)


# bad input


def test_cells_are_as_large_as_the_sample_allows():
    assert Synthesis(stripes(24), (16, 16), Settings(n=8), seed=0).settings.largest == 8
    with pytest.raises(ValueError, match=r"a sample of 12 x 12 pixels is too small.* 4 \+ 2 x 4 pixels"):
        Synthesis(noise((12, 12)), (16, 16), Settings(n=8), seed=0)


def test_a_flow_of_another_size_is_refused():
    with pytest.raises(ValueError, match="a flow of shape"):
        Synthesis(stripes(), (16, 16), SMALL, seed=0).frame(constant((16, 17), 1))
