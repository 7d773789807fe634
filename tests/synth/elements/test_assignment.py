"""The assignment step: predictions of a true match, and the positions that minimize Eq. 7."""

import numpy as np
import pytest

from synth.elements import assignment, neighborhood, orientation, search
from synth.elements.assignment import Anchors, Predictions
from synth.elements.neighborhood import Shape
from synth.elements.samples import Elements


def problem(seed: int) -> tuple[np.ndarray, Predictions, Anchors, np.ndarray]:
    rng = np.random.Generator(np.random.Philox(key=seed))
    pairs = rng.integers(0, 12, (60, 2))
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    terms = Predictions(pairs[:, 0], pairs[:, 1], rng.normal(size=(len(pairs), 2)), rng.uniform(0.2, 1, len(pairs)))
    anchors = Anchors(np.array([0, 3]), rng.normal(size=(2, 2)), np.array([1.0, 2.0]))
    return rng.normal(size=(12, 2)), terms, anchors, np.arange(12) > 1


def energy(positions: np.ndarray, terms: Predictions, anchors: Anchors) -> float:
    away = positions[terms.to] - positions[terms.of] - terms.offset
    return float(np.sum(terms.weight[:, None] * away**2)
                 + np.sum(anchors.weight[:, None] * (positions[anchors.sample] - anchors.target) ** 2))


@pytest.mark.parametrize("seed", range(3))
def test_solved_is_the_least_squares_solution(seed: int) -> None:
    positions, terms, anchors, free = problem(seed)
    found = assignment.solved(positions, terms, anchors, free)
    assert (found[~free] == positions[~free]).all()
    rows = np.zeros((len(terms.to) + 2, 12))
    rows[np.arange(len(terms.to)), terms.to] = 1
    rows[np.arange(len(terms.to)), terms.of] -= 1
    rows[[-2, -1], anchors.sample] = 1
    root = np.sqrt(np.concatenate([terms.weight, anchors.weight]))[:, None]
    right = np.vstack([terms.offset, anchors.target]) - rows[:, ~free] @ positions[~free]
    best = np.linalg.lstsq(root * rows[:, free], root * right, rcond=None)[0]
    assert np.allclose(found[free], best, atol=0.02)  # each is held where it is by STAY
    assert energy(found, terms, anchors) < 1.001 * energy(np.where(free[:, None], 0, positions) + np.zeros((12, 2))
                                                           + _spread(best, free), terms, anchors) + 1e-6


def _spread(best: np.ndarray, free: np.ndarray) -> np.ndarray:
    result = np.zeros((len(free), 2))
    result[free] = best
    return result


def test_relaxed_lowers_the_energy_and_comes_to_the_same() -> None:
    positions, terms, anchors, free = problem(5)
    solved = assignment.solved(positions, terms, anchors, free)
    now = positions
    energies = [energy(now, terms, anchors)]
    for _ in range(300):
        now = 0.5 * now + 0.5 * assignment.relaxed(now, terms, anchors, free)
        energies.append(energy(now, terms, anchors))
    assert (np.diff(energies) < 1e-9).all()
    assert np.allclose(now, solved, atol=0.02)


def test_weights_of_matches() -> None:
    found = assignment.match_weights(np.array([[1.0, 3.0], [2.0, np.inf], [0.0, 0.0]]))
    assert np.allclose(found, [[0.75, 0.25], [1, 0], [1, 1]])


@pytest.mark.parametrize("grid", [(), (5,), (3, 4)])
def test_predictions_of_the_exemplar_itself_are_true(grid: tuple[int, ...]) -> None:
    """An output that is its exemplar, turned and moved as a whole, has nothing to change."""
    rng = np.random.Generator(np.random.Philox(key=7))
    samples = int(np.prod(grid))
    start = rng.uniform(0, 3, (1, 8, 1, 3)) + rng.normal(0, 0.2, (1, 8, samples, 3))
    positions = np.repeat(start, 3, axis=0) + np.cumsum(rng.normal(0, 0.05, (3, 8, samples, 3)), axis=0)
    coarse = np.repeat(start, 3, axis=0) if grid else None
    example = Elements(positions, grid, coarse=coarse)
    count = positions[..., 0].size
    turn = orientation.along_directions(np.array([[0.3, 0.2, -0.8]]))[0].astype(np.float64)
    frames = np.repeat(turn[None], count, axis=0).astype(np.float32)
    shape = Shape(1.5, before=1, after=1, along=1)
    within = search.exemplar(example, shape)
    turned = positions @ turn.T + [1, 2, 3]
    there = None if coarse is None else coarse @ turn.T + [1, 2, 3]
    output_elements = Elements(turned, grid, coarse=there)
    if coarse is None:
        detail = positions.reshape(-1, 3)
        carried = None
    else:
        detail = neighborhood.details(output_elements, frames)
        carried = there.reshape(-1, 3)
    output = search.Output(turned.astype(np.float32), detail.astype(np.float32), frames, 3, None,
                           np.zeros(count, np.float32), np.full(count, -1, np.int32))
    matches = search.Matches.none(count, 1, shape)
    search.Searcher(within, 1, coherent=False, centre=1.0).nearest(output, np.arange(3), matches)
    assert (matches.sample[:, 0] == np.arange(count)).all()
    terms = assignment.predictions(within, output, carried, matches, np.arange(3))
    flat = turned.reshape(-1, 3)
    assert len(terms.to) > count
    assert np.allclose(flat[terms.to] - flat[terms.of], terms.offset, atol=1e-4)
    if coarse is not None:
        anchors = assignment.centred(within, output, carried, matches, np.arange(3), 1.0)
        assert np.allclose(anchors.target, flat[anchors.sample], atol=1e-4)
