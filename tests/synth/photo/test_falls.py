"""Falls: the motion is that of the droplets, water stays between lip and pool, ledges and directions are seen."""

import numpy as np
import pytest

from synth.photo import drops
from synth.photo.falls import START, Motion, bed, fall
from synth.photo.tiles import rng

FRAMES, SIZE = 32, (160, 120)


def test_the_table_of_a_fall_agrees_with_its_speed_and_with_a_droplet():
    motion = Motion(0.4, 0.1, 4.0)
    times, fallen = motion.table(200.0)
    np.testing.assert_allclose(np.gradient(fallen, times)[1:-1], motion.speed(times)[1:-1], rtol=1e-3)
    assert fallen[-1] >= 200 and motion.speed(np.zeros(1))[0] == pytest.approx(START * 4)
    droplet = drops.made(1, x=0, y=0, vx=0, vy=-START * 4, gx=0, gy=-0.4, drag=0.1, birth=0, life=1, weight=1, fade=1)
    np.testing.assert_allclose([-droplet.path(np.float32(t))[1][0] for t in times[::200]], fallen[::200], rtol=1e-4)


def test_a_ledge_begins_a_section_of_its_own():
    ground = bed((120, 160), rng(1), 2, 1.05, 0.1, 0.0)
    assert ground.section.max() == 2 and ground.section[-1].max() == 0
    lowest = ground.section[:20]
    assert (np.diff(ground.tops.mean(1)) < 0).all(), "tops descend"
    for k in range(1, 3):
        there = ground.section == k
        assert (ground.fallen[there] > 0).all()
        assert ground.fallen[there].min() < 3, "a section begins at its ledge"
    assert lowest.max() > 0


@pytest.fixture(scope="module")
def leaning():
    return fall(3, FRAMES, SIZE, width=0.5, ledges=1, lean=0.4, lip=0.9, foot=0.2)


def test_water_falls_along_its_lean(leaning):
    falling = (leaning.coverage > 0.4) & (np.arange(120) > 30)[:, None]
    v = leaning.velocity[falling]
    assert falling.sum() > 500 and (v[:, 1] < -1).all()
    assert np.median(v[:, 0] / -v[:, 1]) == pytest.approx(0.4, abs=0.08)
    assert -v[:, 1].min() <= 2.5, "the terminal speed, 5 pixels per frame at 240 rows"


def test_there_is_no_water_above_the_lip_and_none_that_moves(leaning):
    assert leaning.coverage[115:].max() < 0.05 and not leaning.velocity[115:].any()
    assert np.ptp(leaning.luma[:, 116:].astype(int), axis=0).max() <= 2


def test_foam_in_the_pool_comes_nearer(leaning):
    pool = leaning.velocity[5:15]
    assert (pool[..., 1] <= 0).all() and pool[..., 1].min() < -0.3


def test_more_water_covers_more():
    thin, thick = (fall(4, FRAMES, SIZE, density=density).coverage.mean() for density in (0.3, 0.8))
    assert thick > 1.5 * thin
