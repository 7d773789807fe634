"""Noodles and sheets by physical simulation (ma13 figures 10b, 13a): they keep their lengths and their bits."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial import cKDTree

from synth.elements import simulation
from synth.elements.samples import Elements


@pytest.fixture(scope="module")
def noodles() -> Elements:
    return simulation.noodles(7, 12)


@pytest.fixture(scope="module")
def sheets() -> Elements:
    return simulation.sheets(3, 24)


def lengths(elements: Elements, axis: int) -> np.ndarray:
    """Of the steps from sample to sample along an axis of the grid."""
    grid = elements.positions.reshape(*elements.positions.shape[:2], *elements.grid, 3)
    return np.linalg.norm(np.diff(grid, axis=2 + axis), axis=-1)


def detail(elements: Elements) -> np.ndarray:
    assert elements.coarse is not None and elements.coarse.shape == elements.positions.shape
    return elements.positions - elements.coarse


def test_noodles_hang_from_where_they_are_held(noodles: Elements) -> None:
    assert (noodles.topology, noodles.grid, noodles.positions.shape) == ("thread", (40,), (12, 7, 40, 3))
    assert np.abs(detail(noodles)[:, :, 0]).max() < 1e-5
    down = noodles.positions[:, :, -1, 2] - noodles.positions[:, :, 0, 2]
    assert (down > 0.9 * 80).all() and (down < 80).all(), "they are curly, and their weight stretches them"
    assert np.linalg.norm(detail(noodles), axis=-1)[:, :, 20:].mean() > 1, "and they move"


def test_noodles_keep_their_length(noodles: Elements) -> None:
    segment = lengths(noodles, 0)
    assert np.abs(segment / segment.mean() - 1).max() < 0.04
    assert segment.sum(2) == pytest.approx(80, rel=0.005)


def test_noodles_do_not_pass_through_one_another(noodles: Elements) -> None:
    for frame in noodles.positions[::4]:
        share = np.linspace(0, 1, 4, endpoint=False)[:, None]
        fine = frame[:, :-1, None] * (1 - share) + frame[:, 1:, None] * share
        points = fine.reshape(7, -1, 3)
        nearest = min(cKDTree(points[i]).query(points[j])[0].min() for i in range(7) for j in range(i))
        assert nearest > 0.8 * 2 * 0.38, "contacts give way a little, for a moment"


def test_noodles_and_sheets_move_smoothly(noodles: Elements, sheets: Elements) -> None:
    for elements, most in ((noodles, 1.8), (sheets, 0.6)):  # world units per frame², of a whipping end
        acceleration = np.linalg.norm(np.diff(elements.positions.astype(float), 2, axis=0), axis=-1)
        assert acceleration.max() < most
        assert np.sqrt((acceleration**2).mean()) < most / 6


def test_sheets_bend_and_do_not_stretch(sheets: Elements) -> None:
    assert (sheets.topology, sheets.grid) == ("sheet", (7, 7))
    for axis in (0, 1):
        assert np.abs(lengths(sheets, axis) - 1).max() < 0.08
    assert np.ptp(detail(sheets)[..., 2]) > 1, "by more than a sixth of their width"


def test_a_sheets_own_motion_is_taken_out(sheets: Elements) -> None:
    assert np.abs(detail(sheets).mean(2)).max() < 1e-4
    flat = sheets.coarse - sheets.coarse.mean(2, keepdims=True)  # type: ignore[union-attr, operator]
    torque = np.cross(flat, detail(sheets)).sum(2)
    assert np.abs(torque).max() < 1e-2, "none of what is left is a rotation"
    # rows along +y, columns along +x
    step = flat.reshape(24, 3, 7, 7, 3)
    assert (step[:, :, 1:] - step[:, :, :-1])[..., 1] == pytest.approx(1, abs=1e-5)
    assert (step[:, :, :, 1:] - step[:, :, :, :-1])[..., 0] == pytest.approx(1, abs=1e-5)


def test_in_still_air_a_sheet_stays_flat_and_a_noodle_straight() -> None:
    assert np.abs(detail(simulation.sheets(1, 4, wind=0))).max() < 0.15  # it falls, and its rim carries less weight
    still = simulation.noodles(2, 2, curl=0, shake=0)
    assert np.abs(detail(still)[..., :2]).max() < 1e-3


def test_a_triangulated_sheet_has_no_grain() -> None:
    triangles = simulation._triangles(7)
    assert len(triangles) == 72 and len(np.unique(np.sort(triangles, 1), axis=0)) == 72
    points = simulation._flat(7)[triangles]
    normal = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    assert normal == pytest.approx(np.tile([0.0, 0.0, 1.0], (72, 1)))


def test_turning_and_moving_a_sheet_is_undone() -> None:
    flat = simulation._flat(5)
    turn, _ = np.linalg.qr(np.random.Generator(np.random.Philox(key=1)).normal(size=(3, 3)))
    turn[:, 0] *= np.linalg.det(turn)
    assert simulation._fitted(flat @ turn + [3, -2, 5], flat) == pytest.approx(flat)


@pytest.fixture(scope="module")
def lifted() -> np.ndarray:
    return simulation.lifted(40, length=80.0, thick=6.0)


def test_a_lifted_noodle_keeps_its_length_and_lies_on_the_plate(lifted: np.ndarray) -> None:
    assert lifted.shape == (40, 40, 3) and lifted.dtype == np.float32
    segment = np.linalg.norm(np.diff(lifted, axis=1), axis=-1)
    assert np.abs(segment / (80 / 39) - 1).max() < 0.02
    assert lifted[..., 1].min() > 0.9 * 6, "the middle of a bundle of radius 6"
    assert np.ptp(lifted[0, :, 1]) < 0.5 and np.linalg.norm(lifted[0][:, [0, 2]], axis=1).max() < 40


def test_a_lifted_noodle_rises_at_its_first_sample_smoothly(lifted: np.ndarray) -> None:
    assert lifted[-1, 0, 1] == pytest.approx(0.8 * 80, abs=1)
    assert (np.diff(lifted[:, 0, 1]) > -0.1).all()
    acceleration = np.linalg.norm(np.diff(lifted.astype(float), 2, axis=0), axis=-1)
    assert acceleration.max() < 1.5  # world units per frame²: 64 in 26 frames, and it swings
    bend = np.degrees(np.arccos(np.clip(_turns(lifted), -1, 1)))
    assert bend.max() < 25, "from sample to sample: no kinks"


def _turns(curve: np.ndarray) -> np.ndarray:
    step = np.diff(curve.astype(float), axis=1)
    step /= np.linalg.norm(step, axis=-1, keepdims=True)
    return (step[:, 1:] * step[:, :-1]).sum(-1)


@pytest.mark.parametrize("made", [
    lambda seed: Elements(simulation.lifted(3, seed=seed)[:, None], (40,)),
    lambda seed: simulation.noodles(3, 3, seed=seed),
    lambda seed: simulation.sheets(1, 3, seed=seed),
])
def test_a_seed_gives_the_same_bits(made: Callable[[int], Elements]) -> None:
    assert made(1).positions.tobytes() == made(1).positions.tobytes() != made(2).positions.tobytes()


def test_what_comes_apart_is_said_and_leaves_no_file(monkeypatch: pytest.MonkeyPatch, tmp_path: object) -> None:
    monkeypatch.chdir(str(tmp_path))
    monkeypatch.setitem(simulation.NOODLE, "stiffness", 1e9)
    with pytest.raises(ValueError, match="the simulation of noodles came apart"):
        simulation.noodles(2, 2)
    assert not list(tmp_path.iterdir())  # type: ignore[attr-defined]


@pytest.mark.parametrize(("made", "told"), [
    (lambda: simulation.noodles(1), "2 to 31 noodles, not 1"),
    (lambda: simulation.noodles(40), "2 to 31 noodles, not 40"),
    (lambda: simulation.noodles(frames=1), "2 frames or more"),
    (lambda: simulation.noodles(rate=0), "rate above 0"),
    (lambda: simulation.noodles(samples=2), "4 samples or more"),
    (lambda: simulation.noodles(radius=0.6), "do not lie 1 apart"),
    (lambda: simulation.noodles(length=3), "do not lie 1 apart"),
    (lambda: simulation.noodles(shake=9), "shake = 9"),
    (lambda: simulation.lifted(height=3), "height = 3"),
    (lambda: simulation.lifted(length=50, thick=8), "10 times as long, not 50"),
    (lambda: simulation.lifted(1), "2 frames or more"),
    (lambda: simulation.sheets(0), "1 to 100 sheets"),
    (lambda: simulation.sheets(side=2), "3 × 3 to 15 × 15"),
    (lambda: simulation.sheets(wind=np.nan), "wind up to 3"),
    (lambda: simulation.sheets(pace=3), "pace from 0.1 to 1"),
])
def test_what_cannot_be_simulated_is_said(made: Callable[[], Elements], told: str) -> None:
    with pytest.raises(ValueError, match=told):
        made()
