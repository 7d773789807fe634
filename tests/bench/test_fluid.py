"""Each measure on cases whose answer is known."""

import numpy as np
import pytest
from scipy import ndimage

from bench import fluid

SHAPE, FRAMES = (120, 160), 12
INSIDE = np.zeros(SHAPE, np.float32)
INSIDE[20:100, 24:136] = 1


def grain(seed: int, sigma: float = 1.5, shape: tuple[int, ...] = SHAPE) -> np.ndarray:
    """Noise of deviation 1 that repeats beyond the border."""
    noise = np.random.Generator(np.random.Philox(seed)).standard_normal(shape)
    soft = ndimage.gaussian_filter(noise, (0,) * (len(shape) - 2) + (sigma, sigma), mode="wrap")
    return soft / soft.std()


TARGET = 0.5 + 0.08 * grain(1)


def still(count: int = FRAMES) -> np.ndarray:
    return np.repeat(TARGET[None], count, axis=0)


def moving(x: int, y: int, count: int = FRAMES) -> np.ndarray:
    return np.stack([np.roll(TARGET, (y * k, x * k), axis=(0, 1)) for k in range(count)])


def constant(x: float, y: float) -> np.ndarray:
    return np.broadcast_to(np.float64([x, y]), (*SHAPE, 2))


def test_a_picture_that_is_shown_as_it_is_has_the_best_of_all_looks() -> None:
    assert fluid.low_pass(still(), TARGET, INSIDE) == pytest.approx(0, abs=1e-9)
    assert fluid.contrast(still(), TARGET, INSIDE) == pytest.approx((1, 1, 1))
    assert fluid.edges(still(), TARGET, INSIDE > 0) == pytest.approx(1)


def test_brightness_counts_in_grey_levels_and_detail_that_averages_out_does_not() -> None:
    assert fluid.low_pass(still() + 7 / 255, TARGET, INSIDE) == pytest.approx(7)
    both = 0.05 * np.stack([grain(2), -grain(2)])
    assert fluid.low_pass(still(2) + both, TARGET, INSIDE) == pytest.approx(0, abs=1e-9)


def test_what_lies_outside_the_matte_changes_no_measure() -> None:
    frames = moving(1, 0) + 0.03 * grain(3, 1.0, (FRAMES, *SHAPE))
    changed = np.where(INSIDE > 0, frames, 1.0)
    target = np.where(INSIDE > 0, TARGET, 0.0)
    for measure in (fluid.low_pass, fluid.contrast):
        assert measure(changed, target, INSIDE) == pytest.approx(measure(frames, TARGET, INSIDE))
    assert fluid.loop(changed, INSIDE) == pytest.approx(fluid.loop(frames, INSIDE))
    assert fluid.lattice(changed, INSIDE, 8) == pytest.approx(fluid.lattice(frames, INSIDE, 8))
    assert (fluid.visible(target, INSIDE) == fluid.visible(TARGET, INSIDE))[INSIDE > 0].all()


@pytest.mark.parametrize("share", [0.5, 1.0, 1.4])
def test_contrast_is_that_of_the_detail(share: float) -> None:
    frames = 0.5 + share * (moving(3, 1) - 0.5)
    full = np.ones(SHAPE, np.float32)
    assert fluid.contrast(frames, TARGET, full) == pytest.approx([share] * 3, rel=0.06)  # what enters at the border


def test_a_blur_takes_from_the_finest_band_most() -> None:
    frames = ndimage.gaussian_filter(still(), (0, 1, 1))
    one, two, four = fluid.contrast(frames, TARGET, INSIDE)
    assert one < two < four < 1
    assert one < 0.7


@pytest.mark.parametrize(("x", "y"), [(2, 0), (0, -2), (1, 1), (-2, 1)])
def test_the_flow_of_frames_points_where_they_move(x: int, y: int) -> None:
    flow = fluid.mean_flow(moving(x, y))
    assert fluid.angle(flow, constant(x, y), INSIDE) < 3
    assert fluid.angle(flow, constant(-x, -y), INSIDE) > 177


def test_angles_are_of_places_where_something_is_wanted() -> None:
    half = constant(0, 1) * (np.arange(SHAPE[1]) < 80)[:, None]
    assert fluid.angle(constant(1, 0), constant(1, 1), INSIDE) == pytest.approx(45)
    assert fluid.angle(constant(-0.5, 0), constant(3, 0), INSIDE) == pytest.approx(180)
    assert fluid.angle(constant(0, 2), half, INSIDE) == pytest.approx(0)
    assert np.isnan(fluid.angle(constant(0, 2), constant(0, 0), INSIDE))


def test_what_stands_still_is_a_right_angle_off() -> None:
    assert fluid.angle(constant(0.01, 0), constant(1, 0), INSIDE) == 90
    assert fluid.angle(fluid.mean_flow(still()), constant(1, 0), INSIDE) == 90


def test_motion_is_looked_for_where_the_target_has_detail() -> None:
    half = np.where(np.arange(SHAPE[1]) < 80, TARGET, 0.5)
    seen = fluid.visible(half, np.ones(SHAPE))
    assert seen[:, :70].all()
    assert not seen[:, 100:].any()


def pieces(stride: int, root: bool) -> np.ndarray:
    """Independent noise in pieces of two strides, blended with linear ramps; squares of the weights or their sums are
    one."""
    frames = 240
    total, share = np.zeros((frames, *SHAPE)), np.zeros(SHAPE)
    ramp = 1 - np.abs((np.arange(2 * stride) + 0.5) / stride - 1)
    window = np.multiply.outer(ramp, ramp)
    for k, (y, x) in enumerate(np.ndindex(SHAPE[0] // stride - 1, SHAPE[1] // stride - 1)):
        part = np.s_[y * stride:(y + 2) * stride, x * stride:(x + 2) * stride]
        total[(slice(None), *part)] += window * grain(10 + k, 1.0, (frames, 2 * stride, 2 * stride))
        share[part] += window ** (2 if root else 1)
    return 0.5 + 0.05 * total / np.maximum(np.sqrt(share) if root else share, 1e-9)


def test_pieces_without_seams_show_no_lattice() -> None:
    frames = 0.5 + 0.05 * grain(4, 1.0, (240, *SHAPE))
    assert fluid.lattice(frames, INSIDE, 20) == pytest.approx((1, 1), abs=0.03)


def test_weights_that_add_to_one_are_seen_between_pieces_and_their_roots_are_not() -> None:
    sums, roots = (fluid.lattice(pieces(20, root), INSIDE, 20) for root in (False, True))
    assert sums.deviation < 0.8  # 0.71 midway between two, 0.5 between four
    assert roots.deviation == pytest.approx(1, abs=0.05)


def test_regions_of_unlike_brightness_are_seen_at_their_lines() -> None:
    frames = 0.5 + 0.05 * grain(5, 1.0, (60, *SHAPE))
    tile = np.random.Generator(np.random.Philox(6)).standard_normal((6, 8))
    hard = frames + 0.05 * np.kron(tile, np.ones((20, 20)))
    assert fluid.lattice(hard, INSIDE, 20).gradient > 1.3
    # lines elsewhere are not those of pieces
    assert fluid.lattice(np.roll(hard, (10, 10), axis=(1, 2)), INSIDE, 20).gradient < 1


def test_edges_that_move_are_lost() -> None:
    assert fluid.edges(moving(1, 0), TARGET, INSIDE > 0) < 0.5
    assert fluid.edges(1 - still(), TARGET, INSIDE > 0) == pytest.approx(-1)
    # half of the power is the target's, half another's
    assert fluid.edges(still() + 0.08 * grain(7), TARGET, INSIDE > 0) == pytest.approx(np.sqrt(0.5), abs=0.05)


def test_a_loop_that_closes_and_one_that_jumps() -> None:
    period = np.array([0.5 + 0.1 * np.cos(2 * np.pi * k / 16) * grain(8) for k in range(16)])
    closed = np.stack([np.roll(TARGET, k, axis=1) for k in range(SHAPE[1])])
    assert fluid.loop(closed, np.ones(SHAPE)) == pytest.approx(1)
    assert fluid.loop(moving(1, 0, 20), np.ones(SHAPE)) > 1.5
    assert fluid.loop(period, INSIDE) == pytest.approx(fluid.loop(period, np.ones(SHAPE)), rel=1e-6)


def test_the_power_of_a_cosine_lies_at_its_frequency() -> None:
    cosine = 0.5 + (10 / 255) * np.cos(2 * np.pi * 5 * np.arange(48) / 48)[:, None, None] * np.ones(SHAPE)
    power = fluid.spectrum(cosine, INSIDE)
    assert power.shape == (24,)
    assert power[4] == pytest.approx(10**2 / 4, rel=1e-3)  # half at the negative frequency, and its root mean square
    assert power[np.arange(24) != 4].max() < 0.01


def test_spectra_are_compared_by_their_ratio() -> None:
    one, other = (0.5 + 0.05 * grain(seed, 1.0, (48, *SHAPE)) for seed in (20, 21))
    ours, theirs = (fluid.spectrum(frames, INSIDE) for frames in (one, other))
    assert fluid.spectrum_distance(ours, theirs) < 0.03
    louder = fluid.spectrum(0.5 + 2 * (one - 0.5), INSIDE)
    assert fluid.spectrum_distance(louder, theirs) == pytest.approx(np.log10(4), abs=0.03)
    # what repeats has lines only
    again = fluid.spectrum(np.tile(one[:12], (4, 1, 1)), INSIDE)
    assert fluid.spectrum_distance(again, theirs) > 1


def test_a_measure_of_nothing_is_no_number() -> None:
    nothing = np.zeros(SHAPE)
    flat = np.full((FRAMES, *SHAPE), 0.5)
    for value in (fluid.low_pass(still(), TARGET, nothing), fluid.loop(still(), INSIDE),
                  fluid.edges(flat, flat[0], INSIDE > 0), *fluid.contrast(still(), flat[0], INSIDE),
                  *fluid.lattice(still(), nothing, 20)):
        assert np.isnan(value)
