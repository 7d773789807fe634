"""The smoke simulation: exact projection, rising, alive, repeatable; the vortex operators on known flows."""

import itertools

import numpy as np
import pytest

from synth.projection import divergence
from synth.smoke import confining_force, simulate, vorticity


def rotation(shape):
    axes = [np.arange(n) - (n - 1) / 2 for n in shape]
    grid = np.meshgrid(*axes, indexing="ij")[::-1]
    v = np.zeros((*shape, len(shape)), np.float32)
    v[..., 0], v[..., 1] = -grid[1], grid[0]
    return v


def test_vorticity_of_a_unit_rotation_is_two_about_z():
    np.testing.assert_allclose(vorticity(rotation((6, 7))), 2.0, rtol=1e-6)
    np.testing.assert_allclose(vorticity(rotation((5, 6, 7))), np.broadcast_to([0, 0, 2.0], (5, 6, 7, 3)),
    rtol=1e-6)


@pytest.mark.parametrize("turn", [1.0, -1.0])
@pytest.mark.parametrize("shape", [(33, 33), (5, 33, 33)])
def test_confinement_spins_a_vortex_the_way_it_turns(shape, turn):
    v = turn * rotation(shape)
    hump = np.exp(-(v[..., :2] ** 2).sum(-1, keepdims=True) / 30)
    force = confining_force((v * hump).astype(np.float32))
    assert (force * v).sum(-1)[..., 14:19, 14:19].min() > -1e-4
    assert (force * v)[..., 14:19, 14:19, :].sum() > 1


def test_the_plume_is_divergence_free_rises_and_stays_inside():
    frames = list(simulate((32, 32), 90, seed=1))
    tops = []
    for v, density in frames:
        assert v.dtype == density.dtype == np.float32
        assert np.sqrt(np.mean(divergence(v, "wall") ** 2)) < 1e-7
        assert density.min() >= 0 and density.max() <= 1
        tops.append(np.nonzero((density > 0.1).any(1))[0].max() / 32)
    assert all(b >= a - 1 / 16 for a, b in itertools.pairwise(tops))
    assert tops[0] < 0.25 and 0.7 < tops[-1] < 0.97
    assert 0.5 < max(np.abs(v).max() for v, _ in frames) < 3.0


def test_the_plume_sways_but_not_without_sway():
    _, density = list(simulate((32, 32), 50, seed=1))[-1]
    assert np.abs(density - density[:, ::-1]).max() > 0.2
    _, density = list(simulate((32, 32), 50, seed=1, sway=0.0))[-1]
    np.testing.assert_allclose(density, density[:, ::-1], atol=2e-3)  # rounding, which the flow amplifies


def test_in_three_dimensions():
    frames = list(simulate((12, 16, 12), 40, seed=2, radius=0.15))
    v, density = frames[-1]
    assert v.shape == (12, 16, 12, 3)
    assert np.sqrt(np.mean(divergence(v, "wall") ** 2)) < 1e-7
    first, last = (float((np.arange(16)[:, None] * d).sum() / d.sum()) for d in (frames[0][1], density))
    assert last > first + 1
    assert np.abs(v[..., 2]).max() > 0.05


def test_repeatable_seeded_and_warmup_shifts_time():
    def run(frames=12, **settings):
        return np.stack([v for v, _ in simulate((16, 16), frames, **settings)])

    np.testing.assert_array_equal(run(seed=1), run(seed=1))
    assert not np.array_equal(run(seed=1), run(seed=2))
    assert np.abs(run(seed=1, warmup=20)[0]).max() > 2 * np.abs(run(seed=1)[0]).max()


@pytest.mark.parametrize("wrong", [{"radius": 0.0}, {"cooling": 1.0}, {"sway_period": 0.0}, {"warmup": -1}])
def test_refusals(wrong):
    with pytest.raises(ValueError, match="smoke needs"):
        next(simulate((8, 8), 1, seed=0, **wrong))
    with pytest.raises(ValueError, match="at least 4"):
        next(simulate((8, 3), 1, seed=0))
