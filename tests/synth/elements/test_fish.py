"""Fish: they swim head first and upright, bend to where they turn, and are closed but for their fins."""

import itertools

import numpy as np
import pytest
import trimesh

from synth.elements import fish
from synth.elements.mesh import Mesh


def straight(way: tuple[float, float, float], turn: float = 0.0, phase: float = 0.0, detail: int = 1) -> Mesh:
    return fish.bodies(np.zeros((1, 3)), np.array([way]), np.ones(1), np.full((1, 3), 0.5), np.array([phase]),
                     np.array([turn]), detail)


@pytest.mark.parametrize("way", [(1.0, 0.0, 0.0), (0.0, 0.0, -2.0), (-1.0, 0.4, 1.0)])
def test_a_fish_swims_head_first_and_upright(way: tuple[float, float, float]) -> None:
    seen = straight(way)
    eyes = seen.vertices[fish._template(1).paint[:, 4] > 0].mean(0)
    ahead = np.array(way) / np.linalg.norm(way)
    assert eyes @ ahead > 0.2
    assert (seen.vertices @ ahead).min() > -0.75 and (seen.vertices @ ahead).max() < 0.45
    body = slice(0, len(fish._body(1).points))
    back = fish._template(1).paint[body, 0] > 0.9
    belly = fish._template(1).paint[body, 2] > 0.9
    assert (seen.vertices[body][back].mean(0) - seen.vertices[body][belly].mean(0))[1] > 0.05
    assert seen.colours[body][back].mean() < seen.colours[body][belly].mean() - 60  # dark above, light below


def test_fish_stay_upright_and_do_not_flip_when_they_rise() -> None:
    rise = np.linspace(-50, 50, 101)
    heading = np.stack([np.ones(101), rise, np.zeros(101)], 1)
    ahead, left, up = fish._upright(heading, np.zeros(101))
    assert up[:, 1].min() > 0.7 and np.diff(ahead[:, 1]).min() > -1e-9
    assert left == pytest.approx(np.tile([0.0, 0.0, -1.0], (101, 1)))
    assert np.cross(ahead, left) == pytest.approx(up)
    assert np.isfinite(np.stack(fish._upright(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 0.0]]), np.zeros(2)))).all()


@pytest.mark.parametrize("turn", [-1.2, 0.0, 1.2])
def test_bending_does_not_change_length(turn: float) -> None:
    for phase in (0.0, 2.0, 4.0):
        spine, left = fish._bent(np.array([phase]), np.array([turn]))
        assert np.linalg.norm(np.diff(spine[0], axis=0), axis=1).sum() == pytest.approx(1)
        assert np.linalg.norm(left[0], axis=1) == pytest.approx(np.ones(fish.JOINTS), abs=0.02)
        chord = np.linalg.norm(spine[0, 0] - spine[0, -1])
        assert chord > 0.85
        straight_one, bent = (trimesh.Trimesh(*body_of(*how), process=False) for how in ((0.0, 0.0), (turn, phase)))
        assert bent.volume == pytest.approx(straight_one.volume, rel=0.1)


def body_of(turn: float, phase: float) -> tuple[np.ndarray, np.ndarray]:
    return straight((1.0, 0.0, 0.0), turn, phase).vertices, fish._body(1).faces


def test_a_fish_that_turns_left_bends_and_leans_to_the_left() -> None:
    spine, _ = fish._bent(np.zeros(1), np.ones(1))
    straight_spine, _ = fish._bent(np.zeros(1), np.zeros(1))
    inside = (spine - straight_spine)[0, :, 1]
    assert inside[0] > 0.03 and inside[-1] > 0.1  # both ends lie on the inner side
    _, left, up = fish._upright(np.array([[1.0, 0.0, 0.0]]), np.ones(1))
    assert up[0] @ [0.0, 0.0, -1.0] > 0.3 and left[0, 1] < -0.3


def test_the_tail_sways_most_and_the_wave_runs_backwards() -> None:
    phases = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    spine, _ = fish._bent(phases, np.zeros(64))
    sway = np.ptp(spine[..., 1], axis=0)
    assert sway[-1] > 3 * sway[0] and sway.min() < 0.05
    late = [int(np.argmax(spine[:, joint, 1])) for joint in (20, 26, 32)]
    assert all(0 < (b - a) % 64 < 32 for a, b in itertools.pairwise(late))


def test_a_fish_is_closed_but_for_its_fins_and_small_enough_for_a_school() -> None:
    body = fish._body(1)
    found = trimesh.Trimesh(straight((1.0, 0.0, 0.0)).vertices, body.faces, process=False)
    assert found.is_watertight and found.is_winding_consistent and found.volume > 0.005
    assert len(fish._template(1).faces) < 600


def test_eyes_look_outwards() -> None:
    seen = straight((1.0, 0.0, 0.0), detail=2)
    paint = fish._template(2).paint[:, 4]
    for side in (1, -1):
        own = (paint != 0) & (np.sign(-seen.vertices[:, 2]) == side)
        faces = seen.faces[own[seen.faces].all(1)]
        a, b, c = (seen.vertices[faces[:, k]] for k in range(3))
        assert (np.cross(b - a, c - a)[:, 2] * -side).sum() > 0


def test_a_gait_read_from_a_circle() -> None:
    """Counter-clockwise from above is to the left: one length of fish is 1/2 of the radius."""
    rate, frames = 24.0, 96
    angle = np.linspace(0, 2 * np.pi, frames)
    track = np.stack([np.cos(angle), np.zeros(frames), -np.sin(angle)], 1)[:, None]
    gait = fish.swimming(track, np.array([0.5]), rate)
    inner = slice(8, -8)
    assert gait.heading[inner, 0] == pytest.approx(
        np.stack([-np.sin(angle), np.zeros(frames), -np.cos(angle)], 1)[inner], abs=0.01)
    assert gait.turn[inner] == pytest.approx(np.full((frames - 16, 1), 0.5), rel=0.03)
    assert (np.diff(gait.phase, axis=0) > 0).all()


def test_a_fish_that_rests_keeps_its_heading() -> None:
    track = np.zeros((40, 1, 3))
    track[:20, 0, 0] = np.linspace(-1, 0, 20)
    gait = fish.swimming(track, np.array([0.2]), 24.0)
    assert gait.heading[:, 0] == pytest.approx(np.tile([1.0, 0.0, 0.0], (40, 1)), abs=1e-6)
    still = fish.swimming(np.zeros((5, 2, 3)), np.ones(2), 24.0)
    assert np.isfinite(still.heading).all() and np.linalg.norm(still.heading, axis=-1) == pytest.approx(np.ones((5, 2)))
