"""Fumes: labels of a flow that is known, shadow, colours of fire, and where smoke and cloud move."""

import numpy as np
import pytest

from synth.photo.fumes import billows, cloud, fire, labels, rising, shaded, smoke
from synth.photo.tiles import rng

FRAMES, SIZE = 32, (160, 120)


def test_labels_say_how_long_ago_and_from_where():
    """Air that rises at 2 and drifts at 1: at height h above the source it is h / 2 old and came from h / 2 left."""
    v = np.broadcast_to(np.float32([1, 2]), (40, 60, 2))
    for from_x, age in labels(lambda t: v, 8, 4.0, 16):
        height = np.arange(40) - 4.0
        known = np.minimum(height / 2, 16)
        np.testing.assert_allclose(age[:, 30], known, atol=0.02)
        seen = (height > 0) & (known < 15)
        np.testing.assert_allclose(from_x[seen, 30], -np.ceil(known[seen]), atol=1.01)


def test_air_speeds_up_as_it_rises():
    air = rising((60, 80), 16, 1.0, 3.0, 30.0, 1.0, 0.0, 20.0, 0.0, rng(1))
    up = air.steady[..., 1]
    np.testing.assert_allclose(up[0], 1.0, atol=0.01)
    np.testing.assert_allclose(up[40:], 3.0, atol=0.01)
    divergence = np.gradient(air.steady[..., 0], axis=1) + np.gradient(up, axis=0)
    assert np.abs(divergence).max() < 1e-4


def test_smoke_behind_smoke_is_darker():
    density = np.zeros((1, 80, 80), np.float32)
    alone = shaded(density, density, 1.0)
    density[0, 50:70, 10:40] = 3  # between the light, in the upper left, and the middle
    behind = shaded(density, np.zeros_like(density), 1.0)
    assert behind[0, 40, 36] < 0.8 * alone[0, 40, 36]
    assert behind[0, 75, 75] == pytest.approx(alone[0, 75, 75], rel=1e-3)


def test_billows_have_heads_and_creases():
    """Creases are sharper than heads; in noise they are alike."""
    tile = billows((128, 128), rng(2), (32, 32), 1)
    bend = sum(np.roll(tile, 1, axis) + np.roll(tile, -1, axis) - 2 * tile for axis in (0, 1))
    assert bend[tile < np.quantile(tile, 0.1)].mean() > 1.3 * -bend[tile > np.quantile(tile, 0.9)].mean() > 0


@pytest.fixture(scope="module")
def burning():
    return fire(3, FRAMES, SIZE)


def test_fire_is_red_before_it_is_white(burning):
    red, green, blue = np.moveaxis(burning.chroma.astype(int), -1, 0)
    assert (red >= green).all() and (green >= blue).all()
    assert (red > 200).mean() > 0.01 and (blue > 120).mean() < 0.05
    grey = burning.chroma @ np.array([0.2126, 0.7152, 0.0722])
    assert np.abs(grey - burning.luma).max() < 1


def test_flames_rise_and_end(burning):
    flames = burning.coverage > 0.1
    assert (burning.velocity[flames][:, 1] > 0.5).all()
    assert burning.coverage[10:40].mean() > 5 * burning.coverage[90:].mean()


def test_smoke_rises_and_leans_with_the_wind():
    clip = smoke(4, FRAMES, SIZE, wind=1.0, speed=2.0)
    middles = (clip.coverage * np.arange(160)).sum(1) / np.maximum(clip.coverage.sum(1), 1e-6)
    low, high = middles[25:40].mean(), middles[90:105].mean()
    assert high > low + 10
    assert (clip.velocity[clip.coverage > 0.3][:, 1] > 0.3).all()


def test_dark_smoke_is_darker_than_the_sky():
    clip = smoke(5, FRAMES, SIZE, dark=0.9)
    thick = clip.coverage > 0.8
    assert thick.sum() > 100 and clip.luma[:, thick].mean() < 0.6 * clip.luma[:, 60:, :10].mean()


def test_clouds_cover_what_they_are_told():
    few, many = (cloud(6, FRAMES, SIZE, cover=cover).coverage[60:].mean() for cover in (0.2, 0.8))
    assert few < 0.3 and many > 0.6
