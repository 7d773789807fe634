"""Smoke of a stack: what passes it, its lit and its dark side."""

import numpy as np
import pytest

from render import chimney
from render.film import Photograph
from render.studio import Shot


@pytest.fixture(scope="module")
def smoking() -> Photograph:
    z, y, x = (np.mgrid[:24, :40, :24] - np.array([11.5, 20, 11.5]).reshape(3, 1, 1, 1)) / 40
    density = (x**2 + y**2 + z**2 < 0.25**2).astype(np.float32)
    return chimney.photograph(density, -0.2875, 0.05, Shot(width=64, height=48, spp=8))


def test_the_matte_is_where_smoke_hides_the_sky(smoking: Photograph) -> None:
    assert smoking.matte.max() > 0.98 and smoking.matte.min() == 0
    outside = smoking.matte == 0
    np.testing.assert_allclose(smoking.picture[outside], smoking.background[outside], atol=0.06)


def test_smoke_is_bright_towards_the_sun(smoking: Photograph) -> None:
    """The sun is on the left."""
    columns = np.flatnonzero((smoking.matte > 0.95).any(axis=0))
    rows = np.flatnonzero((smoking.matte > 0.95).any(axis=1))
    middle = (rows[0] + rows[-1]) // 2
    third = len(columns) // 3
    lit, dark = smoking.picture[middle, columns[:third]], smoking.picture[middle, columns[-third:]]
    assert lit.mean() > 1.15 * dark.mean()


def test_the_sky_is_paler_below_and_bluer_above() -> None:
    low, high = chimney.sky(np.array([[0.1, 0.02, -1.0], [0.1, 1.0, -0.2]]))
    assert low.mean() > high.mean()
    assert high[2] / high[0] > low[2] / low[0]
