"""A painting: strokes that follow forms, layers that come closer to the scene, the water's matte."""

import numpy as np
import pytest

from synth.photo import painting as module
from synth.photo.painting import LAYERS, Layout, Painting, landscape, painted, painting

SHAPE = (120, 160)


def halves(angle: float) -> Layout:
    """Dark below, light above."""
    colour = np.full((*SHAPE, 3), 0.2, np.float32)
    colour[60:] = 0.8
    return Layout(colour, np.full(SHAPE, angle, np.float32))


def test_a_painting_shows_its_scene() -> None:
    picture = painted(halves(0.0), 1)
    assert picture.shape == (*SHAPE, 3) and picture.dtype == np.float32
    assert picture[:50].mean() == pytest.approx(0.2, abs=0.06) and picture[70:].mean() == pytest.approx(0.8, abs=0.06)


def test_strokes_lie_along_the_form() -> None:
    """Level strokes change less along x than along y, upright ones the other way round."""
    def changes(angle: float) -> float:
        grey = painted(halves(angle), 1)[70:110].mean(axis=2)
        return float(np.abs(np.diff(grey, axis=0)).mean() / np.abs(np.diff(grey, axis=1)).mean())

    assert changes(0.0) > 1.15 > 0.87 > changes(np.pi / 2)


def test_small_strokes_come_closer(monkeypatch: pytest.MonkeyPatch) -> None:
    layout, _ = landscape(1, SHAPE)

    def off() -> float:
        return float(np.abs(painted(layout, 1) - layout.colour).mean())

    whole = off()
    monkeypatch.setattr(module, "LAYERS", LAYERS[:1])
    assert whole < 0.75 * off()


@pytest.fixture(scope="module")
def made() -> Painting:
    return painting(1, SHAPE)


def test_the_matte_is_water(made: Painting) -> None:
    assert made.matte.shape == SHAPE and made.matte.min() >= 0 and made.matte.max() <= 1
    assert 0.08 < made.matte.mean() < 0.35
    assert not made.matte[70:].any(), "the sky is no water"
    fall = made.picture[32:50, 83:89]
    assert made.matte[32:50, 83:89].min() > 0.9 and fall.mean() > made.picture[32:50].mean() + 0.15


def test_a_seed_is_a_painting(made: Painting) -> None:
    np.testing.assert_array_equal(made.picture, painting(1, SHAPE).picture)
    assert np.abs(landscape(1, SHAPE)[0].colour - landscape(2, SHAPE)[0].colour).mean() > 0.03
