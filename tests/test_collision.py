"""Collisions: which elements interpenetrate, and pushing them apart."""

import numpy as np

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


def test_threads_are_parted_between_their_samples_too() -> None:
    """Two that cross in the middle of a segment, in a clip in which nothing moves."""
    one = np.stack([np.linspace(-2, 2, 5), np.zeros(5), np.zeros(5)], axis=-1)
    other = np.stack([np.full(5, 0.5), np.linspace(-2, 2, 5), np.full(5, 0.05)], axis=-1)
    clip = np.repeat(np.stack([one, other])[None], 4, axis=0)
    after = collision.parted(clip, np.full(2, 0.2), (5,))
    assert after[0, 1, 2, 2] - (after[0, 0, 2, 2] + after[0, 0, 3, 2]) / 2 > 0.36
    assert np.allclose(after, after[:1]), "what does not move does not come to move"
    assert np.allclose(after[0, 0, 0], one[0], atol=0.01), "far from the crossing nothing is changed"
