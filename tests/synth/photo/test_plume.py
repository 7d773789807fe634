"""A plume: it leaves the stack, leans with the wind and carries its velocity along."""

import numpy as np
import pytest

from synth.photo.plume import LEAN, MOUTH, RADIUS, Plume, plume


@pytest.fixture(scope="module")
def smoke() -> Plume:
    return plume(1, 240)


def middle(smoke: Plume, height: float) -> float:
    """x of the smoke's middle at a height."""
    row = smoke.density[:, int(height * smoke.density.shape[1])].sum(axis=0)
    x = smoke.left + np.arange(len(row)) / smoke.density.shape[1]
    return float((row * x).sum() / row.sum())


def test_smoke_leaves_the_stack_and_leans(smoke: Plume) -> None:
    assert abs(middle(smoke, MOUTH + 0.02)) < 0.5 * RADIUS
    assert middle(smoke, 0.6) - middle(smoke, 0.3) > 0.25 * LEAN
    assert smoke.density.min() >= 0 and smoke.density.max() <= 1


def test_its_velocity_leans_as_it_does(smoke: Plume) -> None:
    """A plume that is bent by a wind moves along its axis."""
    rows = slice(int(0.45 * smoke.density.shape[1]), int(0.6 * smoke.density.shape[1]))
    weight = smoke.usual[:, rows]
    x, y = ((smoke.velocity[:, rows, :, c] * weight).sum() for c in (0, 1))
    assert y > 0 and 0.15 < x / y < 1.5
