"""Points at rest in a unit that repeats (ma13 figure 8): how near, how dense, and the same at every border."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from synth.elements import arrangement
from synth.elements.samples import Elements

ASSETS = Path(__file__).parents[3] / "scenes" / "assets"


def nearest(elements: Elements, k: int = 1) -> np.ndarray:
    """(E, k) distances of each point from its nearest others, on the torus."""
    points = elements.positions[0, :, 0].astype(np.float64)
    assert elements.period is not None and elements.box is not None
    distance, _ = cKDTree(points - elements.box[0], boxsize=elements.period).query(points - elements.box[0], k=k + 1)
    return distance[:, 1:]


@pytest.mark.parametrize("size", [(8.0, 5.0), (2.0, 2.0), (4.0, 3.5, 5.0)])
def test_no_two_poisson_points_are_too_near_and_no_other_fits(size: tuple[float, ...]) -> None:
    spacing = 0.7
    elements = arrangement.poisson_disk(size, spacing, seed=3)
    assert nearest(elements).min() >= spacing * (1 - 1e-6)
    points = elements.positions[0, :, 0].astype(np.float64)
    axes = [np.linspace(0, side, 30, endpoint=False) for side in size]
    places = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, len(size))
    gap, _ = cKDTree(points % np.array(size), boxsize=size).query(places)
    assert gap.max() <= spacing * 1.13, "half the diagonal of the finest places that were tried, and no more"


def test_poisson_points_are_as_dense_as_bridsons() -> None:
    count = arrangement.poisson_disk((20, 20)).count
    assert 0.62 < count / 400 < 0.75  # 0.7 per squared spacing is where maximal sets end


def test_poisson_points_do_not_stand_at_the_border_more_than_elsewhere() -> None:
    points = np.concatenate([arrangement.poisson_disk((4, 4), seed=s).positions[0, :, 0, 0] for s in range(40)])
    counts = np.histogram(points, bins=8, range=(0, 4))[0]
    assert abs(counts / counts.mean() - 1).max() < 0.3


@pytest.mark.parametrize("counts", [(6, 9), (3, 4, 5)])
def test_a_jittered_point_stays_in_its_cell(counts: tuple[int, ...]) -> None:
    elements = arrangement.jittered_grid(counts, spacing=2.0, jitter=0.3, seed=5)
    cells = np.floor(elements.positions[0, :, 0] / 2.0).astype(int)
    assert len(np.unique(cells, axis=0)) == np.prod(counts)
    assert nearest(elements).min() >= 2.0 * (1 - 2 * 0.3)
    assert arrangement.jittered_grid(counts, jitter=0.0).period == pytest.approx(counts)
    assert nearest(arrangement.jittered_grid(counts, jitter=0.0)) == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize(("counts", "neighbours"), [((5, 4), 6), ((8, 10), 6), ((4, 4, 4), 12), ((5, 6, 4), 12)])
def test_a_hexagonal_grid_has_its_neighbours_everywhere(counts: tuple[int, ...], neighbours: int) -> None:
    elements = arrangement.hexagonal_grid(counts, spacing=1.5)
    distance = nearest(elements, neighbours + 1)
    assert distance[:, :neighbours] == pytest.approx(1.5, abs=1e-5)
    assert (distance[:, neighbours] > 1.5 * 1.2).all()
    assert elements.count == np.prod(counts)


def picture(dots: list[tuple[int, int, int, tuple[float, float, float]]], side: int = 60) -> np.ndarray:
    """White paper (side, side, 3) with square dots: x, y, half width, colour; across the borders of the tile."""
    paper = np.ones((side, side, 3))
    for x, y, half, colour in dots:
        reach = np.arange(-half, half + 1)
        paper[np.ix_((y + reach) % side, (x + reach) % side)] = colour
    return paper


RED, BLUE = (0.8, 0.1, 0.1), (0.1, 0.2, 0.8)


def test_dots_are_found_with_their_kind_colour_and_size() -> None:
    shown = picture([(10, 20, 2, RED), (40, 20, 2, RED), (10, 40, 4, BLUE)])
    for drawn in (shown, np.rint(shown * 255).astype(np.uint8)):
        elements = arrangement.drawn(drawn, spacing=2.0)
        scale = 2.0 / 20  # the nearest are 20, 20 and 30 pixels away
        wanted = np.array([[10.5, 20.5], [40.5, 20.5], [10.5, 40.5]]) * scale
        assert elements.positions[0, :, 0] == pytest.approx(wanted)
        assert elements.kind.tolist() == [0, 0, 1]
        assert elements.colour == pytest.approx(np.array([RED, RED, BLUE]), abs=0.003)
        assert elements.size == pytest.approx(np.sqrt(np.array([25, 25, 81]) / np.pi) * scale)
        assert elements.period == pytest.approx([6, 6])


def test_a_dot_across_a_border_or_a_corner_is_one() -> None:
    elements = arrangement.drawn(picture([(0, 30, 3, RED), (59, 0, 3, BLUE), (30, 30, 3, BLUE)]), spacing=1.0)
    assert elements.count == 3
    found = elements.positions[0, :, 0] / elements.period * 60
    wanted = np.array([[59.5, 0.5], [0.5, 30.5], [30.5, 30.5]])
    for place in wanted:
        apart = found - place
        assert np.abs(apart - 60 * np.rint(apart / 60)).max(1).min() < 1e-3


def test_the_pattern_of_the_project() -> None:
    import cv2

    # rows upwards, RGB from OpenCV's BGR
    tile = cv2.imread(str(ASSETS / "rosettes.png"))[::-1, :, ::-1].astype(np.float32) / 255
    elements = arrangement.drawn(tile)
    assert np.bincount(elements.kind).tolist() == [48, 40, 24, 12]
    gold = elements.positions[0, elements.kind == 3, 0] / elements.period
    petals = elements.positions[0, (elements.kind == 0) | (elements.kind == 2), 0] / elements.period
    distance, _ = cKDTree(petals % 1, boxsize=1).query(gold, k=7)
    assert (distance[:, 5] < 1.1 / 12).all() and (distance[:, 6] > 1.4 / 12).all(), "six petals round each"


@pytest.mark.parametrize("made", [
    lambda seed: arrangement.poisson_disk((5, 6), seed=seed),
    lambda seed: arrangement.poisson_disk((3, 3, 3), seed=seed),
    lambda seed: arrangement.jittered_grid((5, 6), seed=seed),
])
def test_a_seed_gives_the_same_bits(made: Callable[[int], Elements]) -> None:
    assert made(4).positions.tobytes() == made(4).positions.tobytes() != made(5).positions.tobytes()


@pytest.mark.parametrize(("made", "told"), [
    (lambda: arrangement.poisson_disk((1.5, 8)), "too small for points 1 apart"),
    (lambda: arrangement.poisson_disk((4,)), "2 or 3 extents"),
    (lambda: arrangement.poisson_disk((4, np.nan)), "2 or 3 extents"),
    (lambda: arrangement.poisson_disk((4, 4), spacing=0), "not a distance above 0"),
    (lambda: arrangement.poisson_disk((1e3, 1e3)), "more than"),
    (lambda: arrangement.jittered_grid((2, 5)), "3 points or more"),
    (lambda: arrangement.jittered_grid((5, 5), jitter=0.6), "half a spacing"),
    (lambda: arrangement.hexagonal_grid((5, 5)), "even number of rows"),
    (lambda: arrangement.hexagonal_grid((4, 4, 3)), "even number of rows"),
    (lambda: arrangement.drawn(np.ones((20, 20, 3))), "0 dots are found"),
    (lambda: arrangement.drawn(picture([(5, 5, 2, RED)])), "1 dots are found"),
    (lambda: arrangement.drawn(np.ones((20, 20))), "a picture"),
    (lambda: arrangement.drawn(np.full((20, 20, 3), np.nan)), "not finite"),
])
def test_what_makes_no_arrangement_is_said(made: Callable[[], Elements], told: str) -> None:
    with pytest.raises(ValueError, match=told):
        made()
