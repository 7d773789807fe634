"""Bundles of threads: how they lie side by side, and go where one goes."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial import cKDTree

from synth.elements import bundle


@pytest.mark.parametrize("count", [2, 7, 14, 200])
def test_a_section_is_round_and_as_dense_as_can_be(count: int) -> None:
    places = bundle.section(count, 1.5)
    assert places.shape == (count, 2) and np.abs(places.mean(0)).max() < 1e-9
    distance, _ = cKDTree(places).query(places, k=2)
    assert distance[:, 1] == pytest.approx(1.5)
    assert np.linalg.norm(places, axis=1).max() < 1.5 * (0.6 * np.sqrt(count) + 0.6)


def arc(radius: float, samples: int = 40, frames: int = 3) -> np.ndarray:
    """A thread (frames, samples, 3) of length 60 that is bent to an arc, more in each frame."""
    along = np.linspace(0, 60, samples)
    bent = [radius * 4 / (frame + 1) for frame in range(frames)]
    return np.stack([np.stack([r * np.sin(along / r), r * np.cos(along / r) - r, 0 * along], 1) for r in bent])


def test_threads_of_a_straight_bundle_are_its_middle_moved() -> None:
    curve = np.stack([np.zeros(20), np.zeros(20), np.linspace(0, 30, 20)], 1)[None] + np.arange(4)[:, None, None]
    elements = bundle.duplicated(curve, 12, 1.2, 0.4, rate=30.0)
    assert (elements.topology, elements.grid, elements.rate) == ("thread", (20,), 30.0)
    offset = elements.positions - curve[:, None]
    assert offset == pytest.approx(np.broadcast_to(offset[:1, :, :1], offset.shape), abs=1e-5)
    distance, _ = cKDTree(offset[0, :, 0]).query(offset[0, :, 0], k=2)
    assert distance[:, 1] == pytest.approx(1.2, abs=1e-5)
    assert elements.coarse is not None and (elements.coarse == elements.positions).all()


def test_threads_of_a_bent_bundle_keep_their_distance_and_do_not_twist() -> None:
    curve = arc(12.0)
    positions = bundle.duplicated(curve, 19).positions.astype(float)
    for frame in positions:
        for i in range(19):
            others = np.delete(frame, i, 0)[:, 2:-2].reshape(-1, 3)
            assert cKDTree(others).query(frame[i, 2:-2])[0].min() > 0.97
    # a thread of a plane arc keeps its height over the plane
    assert np.ptp(positions[..., 2], axis=2) == pytest.approx(0, abs=1e-4)
    step = np.linalg.norm(np.diff(positions, axis=2), axis=-1)
    assert step.min() > 0


def test_where_a_bundle_is_bent_too_sharply_it_is_drawn_together() -> None:
    curve = arc(4.0, frames=4)
    wide, tight = bundle.duplicated(curve, 91).positions[[0, 3], :, 5:-5].astype(float) - curve[[0, 3], None, 5:-5]
    assert np.linalg.norm(tight, axis=-1).max() < 0.9 * np.linalg.norm(wide, axis=-1).max()
    assert np.linalg.norm(tight, axis=-1).max() >= 0.49 * np.linalg.norm(wide, axis=-1).max()


@pytest.mark.parametrize(("make", "told"), [
    (lambda: bundle.duplicated(np.zeros((2, 5)), 3), "3 samples or more"),
    (lambda: bundle.duplicated(np.zeros((2, 2, 3)), 3), "3 samples or more"),
    (lambda: bundle.duplicated(np.zeros((2, 5, 3)), 3), "in one place"),
    (lambda: bundle.duplicated(np.where(np.arange(120).reshape(1, 40, 3) == 33, np.nan, arc(9)), 3),
     "frame 1, sample 12 is not finite"),
    (lambda: bundle.duplicated(arc(9), 0), "one thread or more"),
    (lambda: bundle.duplicated(arc(9), 3, spacing=0), "above 0"),
])
def test_what_makes_no_bundle_is_said(make: Callable[[], object], told: str) -> None:
    with pytest.raises(ValueError, match=told):
        make()
