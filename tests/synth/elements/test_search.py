"""The search step: the kernel against NumPy and SciPy, the exemplar as its own match, and k-coherence."""

import numpy as np
import pytest

from synth.elements import neighborhood, orientation, search
from synth.elements.neighborhood import Shape
from synth.elements.samples import Elements


def cloud(seed: int, frames: int, count: int, grid: tuple[int, ...], dims: int) -> Elements:
    """Elements at random, drifting a little from frame to frame."""
    rng = np.random.Generator(np.random.Philox(key=seed))
    samples = int(np.prod(grid))
    start = rng.uniform(0, 4, (1, count, 1, dims)) + rng.normal(0, 0.3, (1, count, samples, dims))
    moved = np.cumsum(rng.normal(0, 0.1, (frames, count, samples, dims)), axis=0)
    coarse = None if not grid else np.broadcast_to(start, (frames, count, samples, dims))
    return Elements(start + moved, grid, kind=np.arange(count) % 3, coarse=coarse)


def output_of(elements: Elements, frames: np.ndarray | None, period: np.ndarray | None, known: int,
              ) -> search.Output:
    many = int(np.prod(elements.positions.shape[:3]))
    return search.Output(elements.positions, neighborhood.details(elements, frames).astype(np.float32), frames, known,
                         period, np.linspace(0, 1, many, dtype=np.float32), np.full(many, 0b011, np.int32))


CASES = {
    "static points in the plane": (Shape(1.5), (), 2, 1, 1, False),
    "points that move, compact": (Shape(1.6, before=1, after=1, sigma=2.0), (), 3, 4, 3, False),
    "points that move, whole": (Shape(1.4, before=1, most=6, whole=True, sigma=3.0, sigma_t=4.0), (), 2, 3, 3, True),
    "threads": (Shape(1.5, before=1, along=2, most=5), (5,), 3, 3, 3, True),
    "sheets": (Shape(1.0, before=1, along=1, most=1), (3, 4), 3, 3, 2, True),
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("coherent", [False, True])
def test_the_kernel_finds_what_the_reference_finds(name: str, coherent: bool) -> None:
    shape, grid, dims, in_frames, frames, turned = CASES[name]
    example, result = cloud(1, in_frames, 7, grid, dims), cloud(2, frames, 6, grid, dims)
    rng = np.random.Generator(np.random.Philox(key=3))

    def turns(elements: Elements) -> np.ndarray | None:
        many = int(np.prod(elements.positions.shape[:3]))
        return orientation.along_directions(rng.normal(size=(many, dims))) if turned else None

    period = np.full(dims, 4.0) if not grid else None
    within = search.exemplar(example, shape, turns(example), period, np.linspace(0, 1, 7))
    searcher = search.Searcher(within, 2, coherent, centre=0.5, control=0.3)
    frames_out = turns(result)
    known = max(1, frames - 1) if "whole" in name else frames
    output = output_of(result, frames_out, period, known)
    active = np.arange(known)
    matches = search.Matches.none(len(output.detail), 2, shape)
    if coherent:  # from a guess for each sample
        matches.sample[:] = rng.integers(0, len(within.detail), matches.sample.shape)
        matches.neighbors[:] = search.found_others(result, shape, np.arange(frames), period)
        matches.slot[:] = 0
    candidates = None
    searcher.nearest(output, active, matches)
    samples = np.arange(known * result.positions.shape[1] * result.positions.shape[2])
    if coherent:
        assert (matches.sample[samples, 0] >= -1).all()
        candidates = matches.sample[samples]
    centre = searcher.centre
    found, distance, slot = search.nearest_reference(
        within, output, samples, matches.neighbors[samples], 2, candidates, centre, 0.3, searcher.missing)
    assert np.allclose(distance, matches.distance[samples], rtol=1e-4, atol=1e-5)
    same = found == matches.sample[samples]
    assert same.mean() > 0.98
    assert (slot == matches.slot[samples]).all(axis=2)[same].mean() > 0.98


def test_an_exemplar_matches_itself() -> None:
    example = cloud(4, 3, 9, (), 3)
    shape = Shape(2.0, before=1, after=1)
    within = search.exemplar(example, shape)
    matches = search.Matches.none(27, 1, shape)
    searcher = search.Searcher(within, 1, coherent=False)
    output = output_of(example, None, None, 3)
    output.allowed[:] = -1
    searcher.nearest(output, np.arange(3), matches)
    assert (matches.sample[:, 0] == np.arange(27)).all()
    assert matches.distance.max() < 1e-8


@pytest.mark.parametrize("seed", range(6))
def test_matching_with_samples_left_over(seed: int) -> None:
    """Rectangular, with points that are better alone: the padded square of SciPy is the judge."""
    rng = np.random.Generator(np.random.Philox(key=seed))
    n, m = rng.integers(1, 6, 2)
    cost, alone, lone = rng.uniform(0, 2, (n, m)), rng.uniform(0, 1, n), rng.uniform(0, 1, m)
    least, partner = search.matched(cost, alone, lone)
    told = sum(alone[j] if k < 0 else cost[j, k] for j, k in enumerate(partner))
    told += sum(lone[k] for k in range(m) if k not in partner)
    assert least == pytest.approx(told)


def test_a_sample_coming_in_over_the_rim_changes_nothing_at_once() -> None:
    shape = Shape(1.0)
    distance = []
    for x in (0.999, 1.001):
        positions = np.array([[0, 0], [0.5, 0], [x, 0.01]], np.float32)[None, :, None]
        within = search.exemplar(Elements(np.array([[0, 0], [0, 0.6]], np.float32)[None, :, None]), shape)
        matches = search.Matches.none(3, 1, shape)
        search.Searcher(within, 1, coherent=False).nearest(
            search.Output(positions, np.zeros((3, 2), np.float32), None, 1, None, np.zeros(3, np.float32),
                          np.ones(3, np.int32)), np.arange(1), matches)
        distance.append(matches.distance[0, 0])
    assert abs(distance[0] - distance[1]) < 1e-3
