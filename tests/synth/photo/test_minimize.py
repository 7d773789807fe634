"""Minimizers beside exhaustive search: exact on trees, never worse than the data term alone, bounds that hold."""

import itertools

import numpy as np
import pytest

from synth.photo.minimize import (
    Energy,
    alpha_expansion,
    by_data,
    conditional_modes,
    sequential_messages,
)

CHAIN = [(0, 1), (1, 2), (2, 3), (3, 4)]
TREE = [(0, 1), (0, 2), (2, 3), (2, 4)]
GRID = [(0, 1), (1, 2), (3, 4), (4, 5), (0, 3), (1, 4), (2, 5)]


def energy(edges, labels=3, seed=1, metric=False):
    random = np.random.Generator(np.random.Philox(seed))
    nodes = max(max(e) for e in edges) + 1
    smooth = 2 * random.random((len(edges), labels, labels))
    if metric:
        place = np.arange(labels)
        smooth = np.broadcast_to(0.5 * np.abs(place[:, None] - place), smooth.shape).copy()
    return Energy(random.random((nodes, labels)), np.array(edges), smooth)


def exhaustive(of):
    nodes, labels = of.data.shape
    return min((np.array(one) for one in itertools.product(range(labels), repeat=nodes)), key=of.of)


@pytest.mark.parametrize("edges", [CHAIN, TREE])
@pytest.mark.parametrize("seed", range(4))
def test_messages_are_exact_on_trees_and_their_bound_is_tight(edges, seed):
    of = energy(edges, seed=seed)
    found, least = sequential_messages(of), of.of(exhaustive(of))
    assert found.energy == pytest.approx(least, abs=1e-9)
    assert found.bound == pytest.approx(least, abs=1e-9)


@pytest.mark.parametrize("seed", range(6))
def test_on_a_grid_the_bound_is_below_the_minimum_and_the_labels_are_near_it(seed):
    strong = energy(GRID, seed=seed)
    of = Energy(strong.data, strong.edges, 0.3 * strong.smooth)
    least = of.of(exhaustive(of))
    found = sequential_messages(of)
    assert found.bound <= least + 1e-9
    assert least - 1e-9 <= found.energy <= by_data(of).energy
    assert found.energy == pytest.approx(of.of(found.labels))
    assert found.energy <= 1.1 * least


@pytest.mark.parametrize("seed", range(6))
def test_expansion_of_two_labels_of_a_metric_is_exact(seed):
    of = energy(GRID, labels=2, seed=seed, metric=True)
    found = alpha_expansion(of)
    assert found.energy == pytest.approx(of.of(exhaustive(of)), abs=1e-6)
    assert found.truncated == 0


def test_expansion_of_a_metric_truncates_nothing_and_is_near_the_minimum():
    of = energy(GRID, labels=4, seed=3, metric=True)
    found, least = alpha_expansion(of), of.of(exhaustive(of))
    assert found.truncated == 0
    assert least - 1e-9 <= found.energy <= least + 0.05


def test_expansion_says_how_many_terms_it_truncates_and_never_makes_it_worse():
    of = energy(GRID, labels=4, seed=5)
    found = alpha_expansion(of)
    assert 0.1 < found.truncated < 0.9
    assert found.energy <= by_data(of).energy
    assert found.energy == pytest.approx(of.of(found.labels))


@pytest.mark.parametrize("seed", range(4))
def test_modes_end_where_no_single_label_is_better(seed):
    of = energy(GRID, seed=seed)
    found = conditional_modes(of)
    for p, label in itertools.product(range(6), range(3)):
        other = found.labels.copy()
        other[p] = label
        assert of.of(other) >= found.energy - 1e-12


@pytest.mark.parametrize("minimize", [sequential_messages, alpha_expansion, conditional_modes, by_data])
def test_a_label_that_a_node_does_not_have_is_never_taken(minimize):
    of = energy(GRID, labels=4, seed=2)
    data = of.data.copy()
    data[::2, 2:] = np.inf
    data[1, :3] = np.inf
    found = minimize(Energy(data, of.edges, of.smooth))
    assert np.isfinite(found.energy)
    assert (found.labels[::2] < 2).all()
    assert found.labels[1] == 3


def test_without_edges_it_is_the_data_term():
    of = Energy(np.array([[1.0, 0.5], [0.2, 0.9]]), np.zeros((0, 2), int), np.zeros((0, 2, 2)))
    for minimize in (sequential_messages, alpha_expansion, conditional_modes):
        np.testing.assert_array_equal(minimize(of).labels, [1, 0])


@pytest.mark.parametrize(("data", "edges", "smooth", "told"), [
    (np.zeros((3, 2)), [(1, 0)], np.zeros((1, 2, 2)), "p < q"),
    (np.zeros((3, 2)), [(0, 3)], np.zeros((1, 2, 2)), "of 0 to 2"),
    (np.zeros((3, 2)), [(0, 1)], np.zeros((1, 2, 3)), "terms"),
    (np.full((3, 2), np.inf), [(0, 1)], np.zeros((1, 2, 2)), "no label")])
def test_what_is_no_energy_is_refused(data, edges, smooth, told):
    with pytest.raises(ValueError, match=told):
        Energy(data, np.array(edges), smooth)
