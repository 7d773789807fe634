"""Constraints: what lies outside is pulled in, and put on the border."""

import numpy as np

from synth.elements.constraints import Constraints, Domain


def disc() -> Domain:
    y, x = np.mgrid[0:64, 0:64] / 32.0 - 1 + 1 / 64
    return Domain((0.8 - np.hypot(x, y)).astype(np.float32), 1 / 32, np.array([-1 + 1 / 64] * 2))


def test_distance_and_slope() -> None:
    points = np.array([[0.5, 0.0], [0.0, -0.9]])
    assert np.allclose(disc().distance(points), [0.3, -0.1], atol=5e-3)
    assert np.allclose(disc().slope(points), [[-1, 0], [0, 1]], atol=0.05)


def test_what_is_outside_is_pulled_in_and_put_on_the_border() -> None:
    points = np.array([[0.1, 0.1], [0.9, 0.0], [0.0, 0.79]])
    constraints = Constraints(disc(), margin=0.05)
    anchors = constraints.anchors(points, first=10)
    assert anchors.sample.tolist() == [11, 12]
    enforced = constraints.enforced(points)
    assert (enforced[0] == points[0]).all()
    assert np.allclose(np.linalg.norm(enforced[1:], axis=1), 0.75, atol=0.01)
    assert np.allclose(anchors.target, enforced[1:], atol=1e-3)


def test_nothing_without_a_domain() -> None:
    points = np.array([[1e9, 0.0]])
    assert len(Constraints().anchors(points, 0).sample) == 0
    assert (Constraints().enforced(points) == points).all()
