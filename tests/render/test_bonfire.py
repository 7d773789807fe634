"""A bonfire: black bodies, embers, what lights what."""

import numpy as np
import pytest

from render import bonfire
from render.studio import Shot

SHOT = Shot(width=64, height=48, spp=4)


def test_a_black_body_is_the_whiter_the_hotter() -> None:
    cold, warm, hot = bonfire.black_body(np.array([0.2, 0.6, 1.0], np.float32))
    assert hot[0] == pytest.approx(1.0)
    for light in (cold, warm, hot):
        assert light[0] > light[1] > light[2] > 0
    assert cold[0] < warm[0] < hot[0]
    assert cold[1] / cold[0] < warm[1] / warm[0] < hot[1] / hot[0]


def test_embers_glow_in_the_middle_alone() -> None:
    inside = np.random.Generator(np.random.Philox(key=1)).uniform(-0.1, 0.1, (200, 3)) * [1, 0, 1] + [0, 0.03, 0]
    light = bonfire.embers(inside, 1)
    assert light.max() > 0.5 and (light[:, 0] >= light[:, 2]).all()
    for away in np.eye(3)[:2]:
        assert not bonfire.embers(inside + away, 1).any()


@pytest.fixture(scope="module")
def burning() -> bonfire.Photograph:
    glow, heat = np.zeros((2, 24, 48, 32), np.float32)
    glow[8:16, 4:24, 12:20], heat[8:16, 4:24, 12:20] = 1.0, 0.8
    return bonfire.photograph(glow, heat, 0.06, SHOT)


def test_the_flames_are_where_the_matte_is(burning: bonfire.Photograph) -> None:
    assert burning.picture.shape == burning.background.shape == (48, 64, 3)
    inside, outside = burning.matte > 0.8, burning.matte == 0
    assert inside.any() and outside.any()
    assert burning.picture[inside].mean() > 0.4
    np.testing.assert_allclose(burning.picture[outside].mean(), burning.background[outside].mean(), atol=0.05)
    assert burning.background[inside].mean() < 0.5 * burning.picture[inside].mean()


def test_the_ground_is_lit_by_the_flames(burning: bonfire.Photograph) -> None:
    """In the colour of fire; the sky alone would light it blue."""
    ground = burning.background[34:]
    assert ground[..., 0].mean() > 1.2 * ground[..., 2].mean() > 0
