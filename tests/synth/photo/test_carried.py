"""Carried tiles: the kernel is its reference, a uniform flow carries exactly, T frames later all is the same."""

import numpy as np
import pytest

from synth import opencl
from synth.photo.carried import PHASES, carried, sampled, sampled_reference
from synth.photo.tiles import noise, rng

SHAPE = (21, 37)
FRAMES, PERIOD = 24, 8


def swirling(frame):
    """A flow that changes and repeats after FRAMES."""
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(np.float32)
    turn = 2 * np.pi * frame / FRAMES
    return np.stack([1.5 + np.sin(0.3 * y + turn), np.cos(0.2 * x - turn)], -1).astype(np.float32)


@pytest.mark.parametrize("phases", [1, 3])
def test_the_kernel_is_the_reference(phases):
    random = rng(1)
    tile = random.standard_normal((2, 13, 19)).astype(np.float32)
    displacement = random.normal(0, 30, (*SHAPE, 2 * phases)).astype(np.float32)
    table = random.normal(0, 5, (3, phases, 3)).astype(np.float32)
    A = np.array([[0.7, -0.4], [0.3, 1.2]])
    slices = np.array([1, 0, 1])
    found = sampled(opencl.to_device(tile), opencl.to_device(displacement), table, slices, A)
    # a place is rounded to 2^-17 texels
    np.testing.assert_allclose(found, sampled_reference(tile, displacement, table, slices, A), atol=2e-3)


def test_a_tile_lies_as_it_is_and_repeats():
    tile = rng(2).standard_normal((1, 8, 10)).astype(np.float32)
    phases = np.array([[[0, 0, 1]], [[3, -2, 1]]], np.float32)
    shown = sampled(opencl.to_device(tile), opencl.zeros((16, 20, 2)), phases, np.zeros(2))
    np.testing.assert_array_equal(shown[0], np.tile(tile[0], (2, 2)))
    np.testing.assert_array_equal(shown[1], np.roll(np.tile(tile[0], (2, 2)), (2, -3), (0, 1)))


def test_a_uniform_flow_carries_by_its_velocity():
    U = np.float32([2, -1])
    for state in carried(lambda t: np.broadcast_to(U, (*SHAPE, 2)), FRAMES, PERIOD):
        for i in range(PHASES):
            age = (state.frame - round(i * PERIOD / PHASES)) % PERIOD
            np.testing.assert_allclose(state.displacement.get()[..., 2 * i : 2 * i + 2],
                                       np.broadcast_to(-age * U, (*SHAPE, 2)), atol=1e-4)


def test_all_repeats_after_T_frames():
    """The flow of FRAMES frames, carried for twice as many: the second half is the first, bit for bit."""
    states = list(carried(lambda t: swirling(t % FRAMES), 2 * FRAMES, PERIOD))
    for first, second in zip(states[:FRAMES], states[FRAMES:], strict=True):
        np.testing.assert_array_equal(first.displacement.get(), second.displacement.get())
        np.testing.assert_array_equal(first.weights, second.weights)
    once = list(carried(swirling, FRAMES, PERIOD))
    for first, second in zip(states, once, strict=False):
        np.testing.assert_array_equal(first.displacement.get(), second.displacement.get())


def test_the_last_frame_leads_into_the_first():
    tile = opencl.to_device(noise((64, 64), rng(3), 12.0, falloff=2)[None])
    pictures = np.stack([state.picture(tile, 5) for state in carried(swirling, FRAMES, PERIOD)])
    steps = np.abs(np.diff(pictures, axis=0)).mean((1, 2))
    assert np.abs(pictures[0] - pictures[-1]).mean() < 1.1 * steps.max()
    assert np.abs(pictures[12] - pictures[0]).mean() > 1.5 * steps.max(), "it does not move"


def test_noise_keeps_its_deviation():
    tile = opencl.to_device(noise((256, 256), rng(4), 8.0, finest=6)[None])  # smooth between texels
    pictures = np.stack([state.picture(tile, 5) for state in carried(swirling, FRAMES, PERIOD)])
    assert np.sqrt((pictures**2).mean()) == pytest.approx(1, abs=0.08)  # of some 200 features


def test_a_period_divides_the_clip():
    with pytest.raises(ValueError, match="7 frames does not divide a clip of 24"):
        next(carried(swirling, FRAMES, 7))
