"""Neighbourhoods: who is in one, in which order, across borders and along elements."""

import numpy as np
import pytest

from synth.elements import neighborhood
from synth.elements.neighborhood import Shape
from synth.elements.samples import Elements


def line(count: int, dims: int = 2) -> np.ndarray:
    """Points at 0, 1, 2 … along x, (1, count, 1, dims)."""
    positions = np.zeros((1, count, 1, dims), np.float32)
    positions[0, :, 0, 0] = np.arange(count)
    return positions


def test_others_come_the_nearest_first_and_only_within_the_radius() -> None:
    found = neighborhood.others(line(5), Shape(2.5, most=4), np.arange(1))
    assert sorted(found[0][found[0] >= 0]) == [1, 2]
    assert found[0][0] == 1
    assert sorted(found[2][found[2] >= 0]) == [0, 1, 3, 4]
    assert set(found[2][:2]) == {1, 3}


def test_others_across_the_border_of_a_toroidal_domain() -> None:
    found = neighborhood.others(line(5), Shape(1.5, most=4), np.arange(1), np.array([5.0, 5.0]))
    assert set(found[0][found[0] >= 0]) == {1, 4}


def test_no_more_than_the_most() -> None:
    found = neighborhood.others(line(9), Shape(9.0, most=3), np.arange(1))
    assert found.shape == (9, 3) and set(found[4]) <= {2, 3, 5, 6}


def test_a_thread_beside_is_one_neighbour_by_its_nearest_sample() -> None:
    positions = np.zeros((1, 2, 4, 3), np.float32)
    positions[0, :, :, 2] = np.arange(4)
    positions[0, 1, :, 0] = 0.5
    found = neighborhood.others(positions, Shape(3.0, most=4), np.arange(1))
    assert (found[:4, 0] == [4, 5, 6, 7]).all() and (found[:4, 1:] == -1).all()


def test_whole_neighbourhoods_look_at_other_frames_and_compact_ones_do_not() -> None:
    positions = np.repeat(line(3), 3, axis=0)
    whole = neighborhood.others(positions, Shape(1.2, before=1, most=4, whole=True), np.array([1]))
    assert whole.shape == (3, 8)
    assert set(whole[1, :4][whole[1, :4] >= 0]) == {0, 2} and set(whole[1, 4:][whole[1, 4:] >= 0]) == {3, 5}
    assert neighborhood.others(positions, Shape(1.2, before=1, most=4), np.array([1])).shape == (3, 4)


@pytest.mark.parametrize(("grid", "count"), [((), 3), ((9,), 6 + 3), ((7, 7), 48 + 3)])
def test_tied_samples_are_those_of_the_topology_and_the_trail(grid: tuple[int, ...], count: int) -> None:
    offsets = neighborhood.tied(Shape(1.0, before=2, after=1), grid)
    assert len(offsets) == count and [0, 0, 0] not in offsets.tolist()
    assert [-2, 0, 0] in offsets.tolist() and [1, 0, 0] in offsets.tolist()


def test_falloff() -> None:
    assert Shape(1.0).falloff(4.0) == 1.0
    assert Shape(1.0, sigma=2.0, sigma_t=4.0).falloff(4.0, 2.0) == pytest.approx(np.exp(-2 - 1))


def test_spacing_of_a_grid_and_of_one_element() -> None:
    assert neighborhood.spacing(3.0 * line(6)) == pytest.approx(3.0)
    assert neighborhood.spacing(line(5), np.array([4.5, 9.0])) == pytest.approx(0.5, abs=0.3)
    with pytest.raises(ValueError, match="one element alone"):
        neighborhood.spacing(line(1))


def test_details_are_what_the_coarse_positions_do_not_explain() -> None:
    rng = np.random.Generator(np.random.Philox(key=1))
    coarse = rng.normal(size=(2, 3, 4, 3))
    q = rng.normal(size=(24, 3))
    turn = np.linalg.qr(rng.normal(size=(24, 3, 3)))[0]
    world = coarse + np.einsum("nij,nj->ni", turn, q).reshape(coarse.shape)
    found = neighborhood.details(Elements(world, (4,), coarse=coarse), turn)
    assert np.allclose(found, q, atol=1e-5)


@pytest.mark.parametrize("wrong", [{"radius": 0}, {"radius": 1, "before": -1}, {"radius": 1, "most": 33}])
def test_shapes_that_are_none(wrong: dict) -> None:
    with pytest.raises(ValueError, match="a neighbourhood has"):
        Shape(**wrong)
