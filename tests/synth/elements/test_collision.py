"""Collisions: which elements interpenetrate, and pushing them apart."""

import numpy as np
import pytest

from synth.elements import collision


def test_pairs_of_different_elements_that_interpenetrate() -> None:
    points = np.array([[0, 0], [0.5, 0], [3, 0], [3.9, 0]], float)
    one, other, depth = collision.overlaps(points, np.full(4, 0.5), np.array([0, 1, 2, 2]))
    assert list(zip(one, other, strict=True)) == [(0, 1)] and np.allclose(depth, 0.5)


def test_across_a_border_that_repeats_and_not_across_one_that_ends() -> None:
    points = np.array([[0.1, 0.1], [9.9, 0.1], [0.1, 9.9]], float)
    one, other, _ = collision.overlaps(points, np.full(3, 0.3), np.arange(3), np.array([10.0, 0.0]))
    assert list(zip(one, other, strict=True)) == [(0, 1)]


def test_resolved_pushes_all_apart() -> None:
    rng = np.random.Generator(np.random.Philox(key=1))
    points = rng.uniform(0, 10, (120, 2))
    radius, element = np.full(120, 0.35), np.arange(120)
    before = len(collision.overlaps(points, radius, element)[0])
    after = collision.resolved(points, radius, element)
    _, _, depth = collision.overlaps(after, radius, element)
    assert before > 40 and (depth > 0.02).sum() < before / 10 and (not len(depth) or depth.max() < 0.1)


def test_points_in_one_place_come_apart() -> None:
    after = collision.resolved(np.zeros((2, 3)), np.ones(2), np.arange(2))
    assert np.linalg.norm(after[0] - after[1]) > 1.9


def two_threads(frames: int, apart: float) -> np.ndarray:
    """Two threads (frames, 2, 9, 3) along x, one over the other in y."""
    x = np.linspace(-2, 2, 9)
    one, other = (np.stack([x, np.full(9, y), np.zeros(9)], axis=-1) for y in (0.0, apart))
    return np.repeat(np.stack([one, other])[None], frames, axis=0)


@pytest.mark.parametrize(("frames", "way"), [(12, 2.0), (2, 8.0)])
def test_threads_that_want_to_change_places_do_not_pass_through_each_other(frames: int, way: float) -> None:
    """Slowly, and as fast as 26 radii from one frame to the next."""
    coarse = two_threads(frames, 1.0)
    wanted = coarse.copy()
    wanted[:, 1, :, 1] -= np.linspace(0, way, frames)[:, None]  # ends on the other side
    after = collision.followed(coarse, wanted, np.full(2, 0.3))
    away = after[:, 1, :, 1] - after[:, 0, :, 1]
    assert (wanted[-1, 1, :, 1] < wanted[-1, 0, :, 1]).all(), "pushing the last frame apart would leave it so"
    assert np.linalg.norm(after[:, 1] - after[:, 0], axis=-1).min() > 0.55 and (away > 0).all()


def test_threads_that_cross_between_their_samples_are_parted() -> None:
    coarse = two_threads(3, 1.5)
    wanted = coarse.copy()
    turned = np.stack([np.full(9, 0.25), np.linspace(-2, 2, 9), np.full(9, 0.05)], axis=-1)
    wanted[:, 1] = turned
    after = collision.followed(coarse, wanted, np.full(2, 0.2))
    assert collision.crossings(wanted[0], np.full(2, 0.2)) == 1
    assert [collision.crossings(threads, np.full(2, 0.2)) for threads in after] == [0, 0, 0]


def test_threads_that_touch_nothing_go_where_they_are_wanted_and_keep_their_segments_even() -> None:
    coarse = two_threads(8, 3.0)
    wanted = coarse + 0.3 * np.sin(np.arange(8) / 3)[:, None, None, None] * np.array([0.0, 1.0, 0.5])
    after = collision.followed(coarse, wanted, np.full(2, 0.2))
    assert np.allclose(after, wanted, atol=0.02)
    uneven = wanted.copy()
    uneven[:, :, 4, 0] += 0.3  # segments of 0.8 and 0.2
    lengths = np.linalg.norm(np.diff(collision.followed(coarse, uneven, np.full(2, 0.2)), axis=2), axis=-1)
    assert np.allclose(lengths, 0.5, atol=0.1)
