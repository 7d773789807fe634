"""Noodles and sheets by hand (ma13 figures 10d, 13b): exact lengths, loops without a seam."""

from collections.abc import Callable

import numpy as np
import pytest

from synth.elements import keyframed
from synth.elements.samples import Elements

MADE: dict[str, Callable[..., Elements]] = {
    "jagged": keyframed.jagged, "folded": keyframed.folded, "fluttering": keyframed.fluttering}


@pytest.fixture(scope="module", params=MADE)
def made(request: pytest.FixtureRequest) -> Elements:
    return MADE[request.param]()


def steps(elements: Elements) -> list[np.ndarray]:
    """Lengths from sample to sample along each axis of the grid."""
    grid = elements.positions.reshape(*elements.positions.shape[:2], *elements.grid, 3).astype(float)
    return [np.linalg.norm(np.diff(grid, axis=2 + axis), axis=-1) for axis in range(len(elements.grid))]


def test_elements_keep_their_lengths(made: Elements) -> None:
    # the chord of a bent sheet is shorter than the way along it
    least = 1 - 1e-4 if made.topology == "thread" else 0.96
    for length in steps(made):
        share = length / (80 / 39 if made.topology == "thread" else 1)
        assert least < share.min() and share.max() < 1 + 1e-4


def test_coarse_is_flat_or_straight_and_has_the_mean(made: Elements) -> None:
    assert made.coarse is not None and made.coarse.shape == made.positions.shape
    assert (made.coarse == made.coarse[:1]).all()
    detail = made.positions - made.coarse
    if made.topology == "sheet":
        assert np.ptp(made.coarse[..., 2]) == 0 and np.abs(detail.mean(2)).max() < 1e-4
    else:
        assert np.diff(made.coarse, axis=2)[..., :2] == pytest.approx(0) and np.abs(detail[..., 2]).max() < 2
        assert np.diff(made.coarse[..., 2], axis=2) == pytest.approx(made.coarse[0, 0, 1, 2], abs=1e-4)


def test_a_loop_has_no_seam(made: Elements) -> None:
    twice = np.concatenate([made.positions, made.positions[:2]]).astype(float)
    acceleration = np.abs(np.diff(twice, 2, axis=0)).max((1, 2, 3))
    assert acceleration[-2:].max() < 1.3 * acceleration[:-2].max() < 0.05
    assert np.abs(np.diff(made.positions, axis=0)).max() > 0.03, "and it moves"


def test_jagged_noodles_have_sharp_corners_at_samples_and_straight_legs() -> None:
    noodles = keyframed.jagged(leg=3)
    step = np.diff(noodles.positions.astype(float), axis=2)
    step /= np.linalg.norm(step, axis=-1, keepdims=True)
    turn = np.degrees(np.arccos(np.clip((step[:, :, 1:] * step[:, :, :-1]).sum(-1), -1, 1)))
    corner = np.arange(1, 39) % 3 == 0
    assert turn[..., corner].min() > 50 and turn[..., ~corner].max() < 6


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_jagged_noodles_do_not_touch(seed: int) -> None:
    noodles = keyframed.jagged(7, 12, seed=seed)
    share = np.linspace(0, 1, 6, endpoint=False)[:, None]
    for frame in noodles.positions.astype(float):
        fine = (frame[:, :-1, None] * (1 - share) + frame[:, 1:, None] * share).reshape(7, -1, 3)
        for i in range(7):
            for j in range(i):
                nearest = np.sqrt(((fine[i, ::3, None] - fine[None, j]) ** 2).sum(-1).min())
                assert nearest > 2 * 0.33 * 0.98  # measured between points that are up to 0.17 apart


def test_creases_lie_on_samples_and_panels_are_flat() -> None:
    for sheet, parts in enumerate((6, 3, 2)):
        grid = keyframed.folded().positions[:, sheet].reshape(60, 7, 7, 3).astype(float)
        step = np.diff(grid, axis=2)
        turn = np.linalg.norm(np.diff(step, axis=2), axis=-1)  # 0 where two steps lie in one panel
        crease = np.arange(1, 6) % (6 // parts) == 0
        assert turn[:, :, ~crease].size == 0 or turn[:, :, ~crease].max() < 1e-4
        assert turn[:, :, crease].min() > 0.1 and turn.max() > 1.5, "it folds, opens, and is never quite flat"


@pytest.mark.parametrize("make", MADE.values(), ids=MADE)
def test_a_seed_gives_the_same_bits_and_a_spacing_scales_sheets(make: Callable[..., Elements]) -> None:
    assert make(4, 9, seed=3).positions.tobytes() == make(4, 9, seed=3).positions.tobytes()
    assert make(4, 9, seed=3).positions.tobytes() != make(4, 9, seed=4).positions.tobytes()
    if make is not keyframed.jagged:
        assert make(2, 3, spacing=2.0).positions == pytest.approx(2 * make(2, 3).positions, abs=1e-5)


@pytest.mark.parametrize(("make", "told"), [
    (lambda: keyframed.jagged(0), "one element or more"),
    (lambda: keyframed.jagged(leg=30), "legs of 30"),
    (lambda: keyframed.jagged(angle=50), "angle = 50"),
    (lambda: keyframed.jagged(radius=0.4), "a spacing of 1.1"),
    (lambda: keyframed.folded(angle=89), "between 5 and 80"),
    (lambda: keyframed.folded(0), "one element or more"),
    (lambda: keyframed.folded(frames=1), "2 frames or more"),
    (lambda: keyframed.folded(side=2), "3 samples or more"),
    (lambda: keyframed.fluttering(waves=5), "waves = 5"),
    (lambda: keyframed.fluttering(thickness=0), "thickness above 0"),
])
def test_what_cannot_be_made_is_said(make: Callable[[], Elements], told: str) -> None:
    with pytest.raises(ValueError, match=told):
        make()
