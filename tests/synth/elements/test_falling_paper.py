"""Scraps of paper in a gust (ma13 figure 13c): rigid, smooth, from a heap into the air."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from synth.elements import falling_paper
from synth.elements.samples import Elements


@pytest.fixture(scope="module")
def tossed() -> Elements:
    return falling_paper.tossed()


def test_a_scrap_is_flat_and_rigid(tossed: Elements) -> None:
    assert (tossed.topology, tossed.grid, tossed.count, tossed.frames) == ("sheet", (7, 7), 300, 60)
    assert tossed.coarse is not None and (tossed.coarse == tossed.positions).all()
    grid = tossed.positions[::6].reshape(10, 300, 7, 7, 3).astype(float)
    for axis in (2, 3):
        assert np.linalg.norm(np.diff(grid, axis=axis), axis=-1) == pytest.approx(1, abs=1e-4)
        assert np.abs(np.diff(grid, 2, axis=axis)).max() < 1e-4
    across, down = grid[:, :, 0, 1] - grid[:, :, 0, 0], grid[:, :, 1, 0] - grid[:, :, 0, 0]
    assert np.abs((across * down).sum(-1)).max() < 1e-4


def test_the_heap_lies_about_rises_and_turns(tossed: Elements) -> None:
    centre = tossed.positions.mean(2).astype(float)
    assert np.ptp(centre[0, :, 1]) < 25 and centre[..., 1].min() > 0
    assert centre[45, :, 1].mean() > 2 * centre[0, :, 1].mean(), "it is in the air"
    x, z = centre[0, :, 0], centre[0, :, 2]
    velocity = centre[24] - centre[16]
    assert (x * velocity[:, 2] - z * velocity[:, 0] < 0).mean() > 0.85, "round the axis, nearly all one way"
    normal = np.cross(tossed.positions[0, :, 1] - tossed.positions[0, :, 0],
                      tossed.positions[0, :, 7] - tossed.positions[0, :, 0])
    assert np.quantile(normal[:, 1], 0.1) > 0.6, "at first they lie flat, or nearly"


def test_motion_is_smooth_and_begins_at_rest(tossed: Elements) -> None:
    points = tossed.positions[:, :, ::12].astype(float)
    assert np.linalg.norm(points[1] - points[0], axis=-1).max() < 0.3
    acceleration = np.linalg.norm(np.diff(points, 2, axis=0), axis=-1)
    assert acceleration.max() < 0.7  # world units per frame²; a scrap is 6 wide
    jolt = np.linalg.norm(np.diff(points, 3, axis=0), axis=-1)
    assert jolt.max() < 0.25


def test_scraps_keep_apart(tossed: Elements) -> None:
    for centre in tossed.positions.mean(2)[::10]:
        assert cKDTree(centre).query(centre, k=2)[0][:, 1].min() > 0.7 * 6


@pytest.mark.parametrize("count", [1, 2, 40])
def test_few_scraps_fly_too(count: int) -> None:
    elements = falling_paper.tossed(count, 20, side=3)
    assert elements.positions.shape == (20, count, 9, 3) and elements.positions[-1, ..., 1].mean() > 1


def test_quaternions_turn_as_matrices_do() -> None:
    rng = np.random.Generator(np.random.Philox(key=2))
    a, b = falling_paper._quaternions(rng.normal(size=(5, 3))), falling_paper._quaternions(rng.normal(size=(5, 3)))
    expected = falling_paper._matrices(a) @ falling_paper._matrices(b)
    assert falling_paper._matrices(falling_paper._product(a, b)) == pytest.approx(expected)
    quarter = falling_paper._matrices(falling_paper._quaternions(np.array([[0, 0, np.pi / 2]])))[0]
    assert quarter @ [1, 0, 0] == pytest.approx([0, 1, 0])


def test_a_seed_gives_the_same_bits() -> None:
    one = falling_paper.tossed(50, 12, seed=1).positions.tobytes()
    assert one == falling_paper.tossed(50, 12, seed=1).positions.tobytes()
    assert one != falling_paper.tossed(50, 12, seed=2).positions.tobytes()


@pytest.mark.parametrize(("settings", "told"), [
    ({"count": 0}, "1 to 5000 scraps"), ({"count": 6000}, "1 to 5000 scraps"), ({"frames": 1}, "2 frames or more"),
    ({"side": 1}, "2 × 2 samples"), ({"spacing": 0}, "above 0"), ({"rate": np.nan}, "above 0"),
])
def test_what_cannot_be_tossed_is_said(settings: dict, told: str) -> None:
    with pytest.raises(ValueError, match=told):
        falling_paper.tossed(**settings)
