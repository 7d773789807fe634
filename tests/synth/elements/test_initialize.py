"""Initialization: the count, whole elements, inside the domain, moving as those they copy."""

import numpy as np
import pytest

from synth.elements import arrangement, initialize, orientation
from synth.elements.constraints import Domain
from synth.elements.samples import Elements


def disc(radius: float = 12.0) -> Domain:
    y, x = np.mgrid[0:120, 0:120] / 4.0 - 15 + 0.125
    return Domain((radius - np.hypot(x, y)).astype(np.float32), 0.25, np.array([-14.875, -14.875]))


def test_as_many_as_the_density_says_and_all_inside() -> None:
    exemplar = arrangement.poisson_disk((10, 10))
    found = initialize.points(exemplar, disc(), 1, 2.0, 1.0, seed=1)
    points = found.elements.positions[0, :, 0]
    assert found.elements.count == pytest.approx(exemplar.count / 100 * np.pi * 144, rel=0.02)
    assert (disc().distance(points) > 0).all()
    assert (found.source < exemplar.count).all() and (found.source >= 0).all()
    again = initialize.points(exemplar, disc(), 1, 2.0, 1.0, seed=1)
    assert (again.elements.positions == found.elements.positions).all()


def test_hard_positions_are_taken_and_count_is_kept() -> None:
    pins = np.array([[0.0, 0.0], [3.0, 3.0]])
    found = initialize.points(arrangement.jittered_grid((8, 8)), disc(), 1, 2.0, 1.0, 1, pins=pins, count=50)
    assert found.elements.count == 50
    assert np.allclose(found.elements.positions[0, :2, 0], pins)
    with pytest.raises(ValueError, match="hard positions are more"):
        initialize.points(arrangement.jittered_grid((8, 8)), disc(), 1, 2.0, 1.0, 1, pins=pins, count=1)


def test_a_domain_smaller_than_a_neighbourhood() -> None:
    with pytest.raises(ValueError, match="smaller than a neighbourhood"):
        initialize.points(arrangement.jittered_grid((8, 8)), disc(0.5), 1, 3.0, 1.0, 1)


def test_only_kinds_that_may_stand_there() -> None:
    rng = np.random.Generator(np.random.Philox(key=1))
    exemplar = Elements(rng.uniform(0, 10, (1, 90, 1, 2)), kind=np.arange(90) % 2, box=np.array([[0, 0], [10, 10]]))
    found = initialize.points(exemplar, disc(), 1, 2.0, 0.5, 1, allowed=lambda p: np.where(p[:, 0] < 0, 1, 2))
    x = found.elements.positions[0, :, 0, 0]
    assert (found.elements.kind == (x >= 0)).mean() > 0.99


def moving(frames: int) -> Elements:
    t = np.arange(frames)[:, None, None, None] * 0.1
    rng = np.random.Generator(np.random.Philox(key=2))
    start = rng.uniform(0, 8, (1, 60, 1, 2))
    return Elements(start + t * np.array([1.0, 0.0]), box=np.array([[0, 0], [8, 8]]))


def test_elements_move_as_those_they_copy_past_the_exemplars_end() -> None:
    found = initialize.points(moving(10), disc(), 25, 2.0, 0.4, 1)
    steps = np.diff(found.elements.positions[:, :, 0], axis=0)
    assert np.allclose(steps, [0.1, 0.0], atol=1e-5)
    turned = initialize.points(moving(10), disc(), 25, 2.0, 0.4, 1, rotation=lambda p: orientation.along_directions(
        np.tile([0.0, 1.0], (len(p), 1))))
    assert np.allclose(np.diff(turned.elements.positions[:, :, 0], axis=0), [0.0, 0.1], atol=1e-5)


def test_carried_by_a_flow() -> None:
    still = initialize.points(moving(1), disc(), 5, 2.0, 0.4, 1)
    found = initialize.carried(still, lambda t, points: np.tile([0.0, 0.5], (len(points), 1)))
    assert np.allclose(np.diff(found.elements.positions[:, :, 0], axis=0), [0.0, 0.5], atol=1e-5)


def test_threads_take_the_details_of_whole_threads_in_their_own_frames() -> None:
    s = np.arange(12.0)
    coarse = np.zeros((6, 4, 12, 3))
    coarse[..., 2] = s
    coarse[..., 0] = np.arange(4)[:, None]
    wave = coarse.copy()
    wave[..., 0] += 0.3 * np.sin(s + np.arange(6)[:, None, None])
    exemplar = Elements(wave, (12,), coarse=coarse)
    # along x instead of z
    out = np.zeros((9, 7, 12, 3))
    out[..., 0] = s
    out[..., 1] = np.arange(7)[:, None]
    inner, outer = orientation.along_threads(coarse), orientation.along_threads(out)
    found = initialize.on_coarse(exemplar, out, inner, outer, 3, 1, 24.0)
    away = found.elements.positions - out
    assert np.abs(away[..., 0]).max() < 1e-5, "no detail along the thread"
    assert np.linalg.norm(away, axis=-1).max() == pytest.approx(0.3, abs=0.01)
    assert found.source.shape == (9 * 7 * 12,) and (found.source.reshape(9, 7, 12) % 12 == np.arange(12)).all()


def test_a_control_map_chooses_the_patches() -> None:
    """An exemplar of small elements on its left and large ones on its right, and a map that requires the opposite."""
    points = arrangement.poisson_disk((12, 12), seed=5)
    large = points.positions[0, :, 0, 0] > 6
    exemplar = Elements(points.positions, size=1.0 + large, box=points.box)

    def mismatch(at: np.ndarray, elements: np.ndarray) -> np.ndarray:
        return ((at[:, 0] < 0) - large[elements].astype(float)) ** 2

    found = initialize.points(exemplar, disc(), 1, 2.0, 1.0, 1, mismatch=mismatch)
    left = found.elements.positions[0, :, 0, 0] < 0
    assert found.elements.size[left].mean() > 1.8 and found.elements.size[~left].mean() < 1.2
    plain = initialize.points(exemplar, disc(), 1, 2.0, 1.0, 1).elements
    assert abs(plain.size[plain.positions[0, :, 0, 0] < 0].mean() - 1.5) < 0.25
