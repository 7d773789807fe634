"""What rises: labels of where and when, textures of them, enlarging."""

import numpy as np
import pytest

from synth.photo.rising import LARGEST, Rising, Texture, rising, simulated
from synth.photo.tiles import rng

SHAPE = (16, 32, 20)
PLUME = {"radius": 0.15, "height": 0.1, "buoyancy": 2e-3}


@pytest.fixture(scope="module")
def risen() -> Rising:
    return rising(SHAPE, 1, frames=24, ground=0.1, averaged=6, **PLUME)


def test_what_is_on_the_ground_left_it_now_where_it_is(risen: Rising) -> None:
    rows = slice(0, 3)  # below 0.1 of 32 cells
    assert not risen.age[:, rows].any()
    x = (np.arange(20) - 9.5) / 32
    np.testing.assert_allclose(risen.place[0][:, rows], np.broadcast_to(x, (16, 3, 20)), atol=1e-6)


def test_the_higher_the_longer_ago_and_never_longer_than_it_lasts(risen: Rising) -> None:
    middle = risen.age[8, :, 10]
    assert 0 < middle[4] < middle[8] <= middle[-1] <= risen.oldest == 24


def test_an_updraught_alone_makes_air_as_old_as_its_speed_says() -> None:
    """Far above the ground it rises at `draught`: between two heights there are their distance over the speed."""
    risen = rising((16, 40, 20), 1, frames=60, ground=0.1, draught=0.05, radius=0.1, height=0.1, buoyancy=0.0)
    speed = np.gradient(risen.age[8, :, 10])[24:34]
    np.testing.assert_allclose(1 / speed, 40 * 0.05, rtol=0.1)
    np.testing.assert_allclose(risen.place[0][8, :34, 10], 0.5 / 40, atol=2e-3)


def test_the_motion_is_upward_where_smoke_is(risen: Rising) -> None:
    assert (risen.velocity[..., 1] * risen.usual).sum() > 0.2 * risen.usual.sum()
    assert risen.density.max() <= 1 and risen.usual.shape == SHAPE


def test_enlarged_keeps_values_and_doubles_speeds(risen: Rising) -> None:
    fine = risen.enlarged(2)
    assert fine.age.shape == (32, 64, 40) and fine.place.shape == (2, 32, 64, 40)
    blocks = fine.density.reshape(16, 2, 32, 2, 20, 2).mean(axis=(1, 3, 5))
    np.testing.assert_allclose(blocks.sum(), risen.density.sum(), rtol=0.01)
    assert np.abs(fine.velocity).max() == pytest.approx(2 * np.abs(risen.velocity).max(), rel=0.2)


def test_a_texture_repeats_and_is_of_unit_deviation() -> None:
    texture = Texture(rng(1), size=0.25, lasts=12.0)
    period = texture.tile.shape[0] * 0.25 / LARGEST
    still = np.zeros((1, 1, 400), np.float32)
    x = np.linspace(-1, 1, 400, dtype=np.float32)[None, None]
    here, there = (texture.left(Rising(np.stack([x + off, still]), still, 9.0, still, still, still[..., None]))
                   for off in (0, period))
    np.testing.assert_allclose(here, there, atol=1e-3)
    assert texture.tile.std() == pytest.approx(1, abs=1e-5)


def test_small_pictures_take_fewer_cells() -> None:
    assert simulated((64, 144, 96), 480) == simulated((64, 144, 96), 2000) == (64, 144, 96)
    assert simulated((64, 144, 96), 240) == (32, 72, 48)
    assert simulated((64, 144, 96), 1) == (32, 72, 48)
    assert simulated((64, 144, 96), 360) == (48, 108, 72)
