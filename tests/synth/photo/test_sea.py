"""Waves: their dispersion, their direction, and their return after T frames."""

import numpy as np
import pytest

from synth.photo.sea import Sea, dispersion, sea
from synth.photo.tiles import rng

FRAMES = 48


def test_the_square_of_the_frequency_is_g_k():
    k = np.linspace(0.05, 2, 50)
    omega = dispersion(k, 0.3, 10000)
    np.testing.assert_allclose(omega**2, 0.3 * k, rtol=0.01)
    turns = dispersion(k, 0.3, FRAMES) * FRAMES / (2 * np.pi)
    np.testing.assert_allclose(turns, np.rint(turns), atol=1e-9)


def test_a_single_wave_travels_at_its_phase_velocity():
    """Four turns in 48 frames of a wave of 16 texels: 4/3 texels per frame; four texels in three frames."""
    amplitude = np.zeros((32, 17), complex)
    amplitude[0, 2] = 1
    kx, ky = np.meshgrid(2 * np.pi * np.fft.rfftfreq(32), 2 * np.pi * np.fft.fftfreq(32))
    wave = Sea(amplitude, np.full_like(kx, 2 * np.pi * 4 / FRAMES), kx, ky)
    np.testing.assert_allclose(wave.slopes(3)[0], np.roll(wave.slopes(0)[0], 4, axis=1), atol=1e-6)
    np.testing.assert_allclose(wave.travel(), [4 / 3, 0], atol=1e-9)


@pytest.mark.parametrize("wind", [0.4, 2.2, -1.3])
def test_a_sea_travels_along_the_wind_and_returns(wind):
    waves = sea(64, FRAMES, rng(1), length=20.0, wind=wind, gravity=0.3, slope=0.2)
    first = waves.slopes(0)
    assert np.sqrt((first**2).sum(0).mean()) == pytest.approx(0.2, rel=1e-4)
    np.testing.assert_allclose(waves.slopes(FRAMES), first, atol=1e-5)
    assert np.abs(waves.slopes(5) - first).mean() > 0.05
    along = waves.travel()
    assert np.hypot(*along) > 0.3
    assert np.cos(np.arctan2(along[1], along[0]) - wind) > 0.9
