"""The verdict of `flowloom diff`: what it must not miss, what it must let pass, what FLIP would miss."""

import numpy as np
import pytest

from pipeline.diff import compared_light, compared_sums, compared_values
from pipeline.files import pictures
from pipeline.references import sums
from render import smoke, tonemap
from synth.advect import advect
from synth.motion.exemplar import exemplar

USUAL_FLIP_THRESHOLD = 0.05  # mean FLIP that image tests commonly allow


def swirled(frames=12):
    """A disc of smoke (64, 64) stirred by a heart, on the OpenCL device: a scene in small."""
    v = 2 * exemplar("heart", 64)
    y, x = np.mgrid[:64, :64]
    disc = np.exp(-((x - 30.0) ** 2 + (y - 26.0) ** 2) / 120).astype(np.float32)
    for _ in range(frames):
        disc = advect(disc, v)
    return disc


def half_voxel_right(density):
    """The density seen half a voxel off, as a lost cell-centre convention would make it."""
    return (density + np.roll(density, 1, axis=-1)) / 2


def plume():
    """A small volume (24, 32, 24) of smoke."""
    z, y, x = np.mgrid[:24, :32, :24]
    away = ((x - 11.5) ** 2 + (z - 11.5) ** 2) / 30 + ((y - 14) / 9.0) ** 2
    return np.exp(-away).astype(np.float32) * (away < 3)


def small_volume(density, seed=1):
    settings = smoke.VolumeSettings(width=48, height=60, spp=8, extinction=40, seed=seed, denoised=False)
    return smoke.volume(density, 1 / 32, (-11.5 / 32, 0.5 / 32, -11.5 / 32), settings)


def mean_flip(new, old):
    return pictures.flip(tonemap.to_display(old, "filmic"), tonemap.to_display(new, "filmic")).mean()


@pytest.fixture(scope="module")
def density():
    return swirled()


@pytest.fixture(scope="module")
def light(density):
    return smoke.lit(density, 96)


@pytest.fixture(scope="module")
def volume_light():
    return small_volume(plume())


def test_twenty_unchanged_runs_pass(density, light):
    for _ in range(20):
        again = swirled()
        assert not compared_sums("density", sums(again), sums(density)).fault
        assert not compared_values("density", again, density).fault
        assert not compared_light("proof", smoke.lit(again, 96), light).fault


def test_twenty_unchanged_volume_proofs_pass(volume_light):
    for _ in range(20):
        assert not compared_light("proof", small_volume(plume()), volume_light).fault


def test_denser_smoke_fails_by_sum_values_and_pixels_but_not_by_flip(density, light):
    """One per cent: each comparison alone tells it; the mean FLIP is a fifth of the usual threshold."""
    denser = density * np.float32(1.01)
    assert "sums 0.01 apart" in compared_sums("density", sums(denser), sums(density)).fault
    assert "largest difference 0.01" in compared_values("density", denser, density).fault
    now = smoke.lit(denser, 96)
    assert compared_light("proof", now, light).fault
    assert 0 < mean_flip(now, light) < USUAL_FLIP_THRESHOLD / 5


def test_denser_volume_fails_but_not_by_flip(volume_light):
    """Of a path trace FLIP sees the noise of its few samples: a threshold above that is blind to the smoke."""
    now = small_volume(plume() * np.float32(1.01))
    assert compared_light("proof", now, volume_light).fault
    noise = mean_flip(small_volume(plume(), seed=2), volume_light)
    assert 0 < mean_flip(now, volume_light) < noise


def test_half_voxel_fails_though_the_sum_stays(density, light):
    shifted = half_voxel_right(density)
    assert not compared_sums("density", sums(shifted), sums(density)).fault
    assert "largest difference" in compared_values("density", shifted, density).fault
    assert compared_light("proof", smoke.lit(shifted, 96), light).fault


def test_half_voxel_fails_in_a_volume(volume_light):
    assert compared_values("density", half_voxel_right(plume()), plume()).fault
    assert compared_light("proof", small_volume(half_voxel_right(plume())), volume_light).fault


@pytest.mark.parametrize(("factor", "fails"), [(1 + 3e-7, False), (1 + 3e-6, True), (1 - 3e-6, True)])
def test_sums_are_told_to_a_millionth(density, factor, fails):
    scaled = density.astype(np.float64) * factor
    assert bool(compared_sums("density", sums(scaled), sums(density.astype(np.float64))).fault) == fails


@pytest.mark.parametrize(("step", "fails"), [(0.8e-5, False), (1.3e-5, True), (-1.3e-5, True)])
def test_one_value_is_told_to_a_hundred_thousandth(step, fails):
    old = np.ones((50, 40, 2))
    old[0] = -1  # signed: the sum alone is small, the scale is not
    new = old.copy()
    new[7, 7, 1] += step
    assert bool(compared_values("H", new, old).fault) == fails


@pytest.mark.parametrize(("steps", "fails"), [(1, False), (-1, False), (2, True)])
def test_a_value_of_a_picture_may_round_to_the_half_float_beside_it(steps, fails):
    old = np.full((60, 40, 3), 0.75, np.float16)
    new = old.copy()
    new[7, 7, 1] += np.float16(steps * 2.0**-11)  # between 0.5 and 1 half floats are so far apart
    found = compared_values("frames", new.astype(np.float32), old.astype(np.float32), is_light=True)
    assert ("largest difference" in found.fault) == fails


@pytest.mark.parametrize(("pixels", "fails"), [(0, False), (10, False), (11, True)])
def test_a_thousandth_of_the_pixels_may_differ(pixels, fails):
    old = np.full((100, 100, 3), 0.5, np.float32)
    new = old.copy()
    new.reshape(-1, 3)[:pixels, 1] *= 1.002
    assert bool(compared_light("proof", new, old).fault) == fails
    assert not compared_light("proof", old * np.float32(1.0009), old).fault


def test_dark_pixels_are_compared_with_a_floor_and_no_number_is_no_equal():
    old = np.full((10, 10, 3), 1e-9, np.float32)
    old[:5] = 1
    new = old.copy()
    new[5:] = 2e-9  # twice nothing
    assert not compared_light("proof", new, old).fault
    assert compared_light("proof", np.where(old < 1, np.float32(0.01), old), old).fault
    new[0, 0] = np.nan
    assert compared_light("proof", new, old).fault
    assert compared_values("density", new, old).fault


def test_other_shapes_are_faults():
    old = np.zeros((4, 4))
    assert "was [4, 4]" in compared_values("density", np.zeros((4, 5)), old).fault
    assert "was [4, 4, 3]" in compared_light("proof", np.zeros((4, 5, 3)), np.zeros((4, 4, 3))).fault


def test_nothing_against_nothing_is_the_same():
    assert not compared_values("density", np.zeros((4, 4)), np.zeros((4, 4))).fault
    assert compared_values("density", np.full((4, 4), 1e-3), np.zeros((4, 4))).fault
    assert not compared_light("proof", np.zeros((4, 4, 3)), np.zeros((4, 4, 3))).fault
