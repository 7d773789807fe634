"""A bed of seaweed: what no motion changes, what a known motion does, and that nothing jumps."""

import numpy as np
import pytest

from synth import seaweed
from synth.field import Field

PLANTS = seaweed.bed(2.0, 1.5, 0.8, 0.2, 0.7, seed=3)


def flow(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Field:
    """A motion that is the same everywhere."""
    return Field.centred(np.broadcast_to(np.array([x, y, z], np.float32), (6, 4, 8, 3)), 3)


def gusts(seed: int, size: float = 2.0) -> Field:
    """A motion that is another in every cell."""
    rng = np.random.Generator(np.random.Philox(key=seed))
    return Field.centred(size * rng.standard_normal((6, 4, 8, 3)).astype(np.float32), 3)


def lengths(points: np.ndarray) -> np.ndarray:
    return np.linalg.norm(np.diff(points, axis=1), axis=2).sum(axis=1)


def one(**changes: float) -> seaweed.Bed:
    """A bed of one upright blade of length 1 at the origin, without stiffness."""
    plain = dict.fromkeys(("ruffle", "stiffness", "twist", "phase"), 0.0) | {
        "length": 1.0, "half_width": 0.1, "belly": 0.5}
    return seaweed.Bed(root=np.zeros((1, 3)), lean=np.array([[0.0, 1, 0]]), side=np.array([[0.0, 0, 1]]),
                      colours=np.full((1, 2, 3), 0.5), **{name: np.array([changes.get(name, value)])
                                                          for name, value in plain.items()})


# the bed


def test_plants_stand_on_the_floor_apart_from_each_other() -> None:
    assert len(PLANTS.root) > 50
    assert (PLANTS.root[:, 1] == 0).all()
    assert np.abs(PLANTS.root[:, 0]).max() < 1.0 and np.abs(PLANTS.root[:, 2]).max() < 0.75
    apart = np.linalg.norm(PLANTS.root[:, None] - PLANTS.root[None], axis=2)
    of_one_plant, between = 0.04, 0.2 - 0.04  # a plant's blades stand within 0.018 of its middle
    assert ((apart < of_one_plant) | (apart > between)).all()


def test_what_each_blade_is_like() -> None:
    for name in ("lean", "side"):
        assert np.linalg.norm(getattr(PLANTS, name), axis=1) == pytest.approx(1)
    assert (PLANTS.lean * PLANTS.side).sum(axis=1) == pytest.approx(0, abs=1e-12)
    assert (PLANTS.lean[:, 1] > 0.5).all()
    assert 0.4 < PLANTS.length.max() <= 0.8
    assert len(np.unique(PLANTS.length)) == len(PLANTS.length)


def test_cover_and_spacing_say_how_many() -> None:
    def count(spacing: float, cover: float) -> int:
        return len(seaweed.bed(2.0, 2.0, 0.8, spacing, cover, seed=3).root)

    assert count(0.2, 0.3) < 0.5 * count(0.2, 0.9)
    assert count(0.4, 0.9) < 0.5 * count(0.2, 0.9)


def test_the_seed_makes_the_bed() -> None:
    again, other = seaweed.bed(2.0, 1.5, 0.8, 0.2, 0.7, seed=3), seaweed.bed(2.0, 1.5, 0.8, 0.2, 0.7, seed=4)
    assert np.array_equal(again.root, PLANTS.root) and np.array_equal(again.colours, PLANTS.colours)
    assert not np.array_equal(other.root[:10], PLANTS.root[:10])


def test_a_floor_without_room_is_refused() -> None:
    with pytest.raises(ValueError, match="no room"):
        seaweed.bed(0.2, 2.0, 0.8, 0.2, 0.7, seed=1)


# spines


def test_without_bend_or_motion_blades_are_straight() -> None:
    rest = PLANTS.root[:, None] + np.linspace(0, 1, seaweed.SAMPLES)[None, :, None] * (
        PLANTS.length[:, None] * PLANTS.lean)[:, None]
    assert seaweed.spines(PLANTS, [gusts(1)], 0.0) == pytest.approx(rest, abs=1e-12)
    assert seaweed.spines(PLANTS, [flow()], 5.0) == pytest.approx(rest, abs=1e-12)


@pytest.mark.parametrize("motion", [flow(x=3), flow(y=-9), gusts(1), gusts(2, 20.0)])
def test_roots_stay_lengths_stay_and_nothing_sinks_into_the_floor(motion: Field) -> None:
    points = seaweed.spines(PLANTS, [motion] * 3, 4.0)
    assert np.array_equal(points[:, 0], PLANTS.root)
    assert lengths(points) == pytest.approx(PLANTS.length, rel=1e-9)
    assert (points[:, 1:, 1] > 0).all()
    assert (points[:, -1, 1] >= seaweed.CLEARANCE - 1e-12).all()
    assert seaweed.ribbons(PLANTS, points)[0][:, 1].min() >= 0


def test_a_steady_flow_bends_by_the_angle_it_says() -> None:
    """The tangent at the share s of the length is bend · speed · s, each piece as at its middle."""
    pieces = np.diff(seaweed.spines(one(), [flow(x=0.5, z=-0.25)], 2.0)[0], axis=0)
    s = (np.arange(seaweed.SAMPLES - 1) + 0.5) / (seaweed.SAMPLES - 1)
    assert pieces[:, 0] / pieces[:, 1] == pytest.approx(1.0 * s, rel=1e-6)
    assert pieces[:, 2] / pieces[:, 1] == pytest.approx(-0.5 * s, rel=1e-6)


def test_each_blade_feels_the_motion_where_it_is() -> None:
    left_and_right = Field.centred(np.concatenate([np.full((6, 4, 4, 3), [-1, 0, 0]), np.full((6, 4, 4, 3), [1, 0, 0])],
                                                  axis=2).astype(np.float32), 3)
    tips = seaweed.spines(PLANTS, [left_and_right], 3.0)[:, -1] - seaweed.spines(PLANTS, [flow()], 3.0)[:, -1]
    away = np.abs(PLANTS.root[:, 0]) > 0.4
    assert (np.sign(tips[away, 0]) == np.sign(PLANTS.root[away, 0])).all()


def test_stiffness_lessens_the_bend() -> None:
    lean = [seaweed.spines(one(stiffness=stiffness), [flow(x=1)], 2.0)[0, -1, 0] for stiffness in (0.0, 0.7, 0.9)]
    assert lean[0] > lean[1] > lean[2] > 0


def test_a_tip_follows_later_than_a_root() -> None:
    """A flow that turns: the root knows at once, the tip by half the window."""
    before, after = flow(x=-1), flow(x=1)
    pieces = {new: np.diff(seaweed.spines(one(), [before] * (9 - new) + [after] * new, 1.0)[0], axis=0)[:, 0]
              for new in (0, 1, 4, 5, 9)}
    assert pieces[1][0] > 0 and pieces[1][-1] < 0.9 * pieces[0][-1] < 0
    assert pieces[4][-1] < 0 < pieces[5][-1]
    assert pieces[9] == pytest.approx(-pieces[0], rel=1e-6)


def test_a_small_change_of_the_motion_is_a_small_change_of_the_blades() -> None:
    """No popping: also where blades are pressed to the floor or bent over."""
    base = gusts(5, 3.0)
    nudged = base.with_values(base.values + 1e-4 * gusts(6, 1.0).values)
    before, after = (seaweed.ribbons(PLANTS, seaweed.spines(PLANTS, [m], 3.0))[0] for m in (base, nudged))
    assert np.abs(after - before).max() < 0.005


def test_a_motion_of_the_plane_or_none_is_refused() -> None:
    with pytest.raises(ValueError, match="3-D"):
        seaweed.spines(PLANTS, [Field.centred(np.zeros((4, 4, 2), np.float32), 2)], 1.0)
    with pytest.raises(ValueError, match="one or more"):
        seaweed.spines(PLANTS, [], 1.0)


# ribbons


def test_a_ribbon_lies_along_its_spine_and_is_as_wide_as_it_says() -> None:
    plant = one()
    points = seaweed.spines(plant, [flow(x=1)], 1.0)
    vertices, faces, colours = seaweed.ribbons(plant, points)
    n, m = seaweed.SAMPLES, len(seaweed.ACROSS)
    assert (vertices.dtype, faces.dtype, colours.dtype) == (np.float32, np.int32, np.uint8)
    assert vertices.shape == colours.shape == (n * m, 3) and faces.shape == (2 * (n - 1) * (m - 1), 3)
    rows = vertices.reshape(n, m, 3)
    assert rows[:, m // 2] == pytest.approx(points[0], abs=1e-6)
    width = np.linalg.norm(rows[:, -1] - rows[:, 0], axis=1)
    assert width.max() == pytest.approx(0.2, rel=0.02)
    assert width[0] < 0.05 and width[-1] < 0.01
    assert abs(width.argmax() - n / 2) < 2
    assert set(faces.ravel()) == set(range(n * m))


def test_a_blade_lies_across_the_side_it_is_given() -> None:
    rows = seaweed.ribbons(one(), seaweed.spines(one(), [flow(x=1)], 1.0))[0].reshape(seaweed.SAMPLES, -1, 3)
    across = rows[:, -1] - rows[:, 0]
    assert np.abs(across[:-1] / np.linalg.norm(across[:-1], axis=1, keepdims=True)) == pytest.approx(
        np.broadcast_to([0, 0, 1], (seaweed.SAMPLES - 1, 3)), abs=1e-5)
    vertices, _, _ = seaweed.ribbons(one(twist=np.pi / 2), seaweed.spines(one(), [flow()], 1.0))
    turned = vertices.reshape(seaweed.SAMPLES, -1, 3)
    middle = turned[-4, -1] - turned[-4, 0]
    assert abs(middle[0]) > 5 * abs(middle[2])
