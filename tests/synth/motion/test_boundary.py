"""The soft boundary condition: the minimum of Eq. 3 by hand, on the device, and at the wall of a stone."""

import numpy as np
import pytest
from scipy import ndimage, optimize

from synth import obstacle, opencl, wake
from synth.motion.boundary import (
    LEAST,
    PEAK,
    WIDTH,
    Constraint,
    Walls,
    impose_reference,
    into_local,
    walls,
)
from synth.motion.detail import Settings, Synthesis, synthesize
from synth.motion.exemplar import exemplar
from synth.motion.local_axes import axes_2d, to_world


def drawn(*shape):
    return np.random.Generator(np.random.Philox(key=3)).standard_normal(shape).astype(np.float32)


def rotations(count, dimension):
    """Random right-handed frames, as axes (count, 2) or matrices (count, 3, 3)."""
    matrices = np.linalg.qr(drawn(count, dimension, dimension))[0]
    matrices[np.linalg.det(matrices) < 0, :, 0] *= -1
    return matrices[..., 0] if dimension == 2 else matrices


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_normal_of_the_domain_in_the_exemplars_coordinates(dimension):
    frame, normal, x = rotations(7, dimension), drawn(7, dimension), drawn(7, dimension)
    in_world = to_world(x, frame) if dimension == 2 else np.einsum("kij,kj->ki", frame, x)
    np.testing.assert_allclose(np.sum(into_local(normal, frame) * x, -1), np.sum(normal * in_world, -1), atol=1e-5)


def test_it_is_the_minimum_of_the_energy():
    mean, normal, hold, weight, b = np.array([0.7, -0.4]), np.array([0.6, 0.8]), 2.5, 4.0, 0.3
    one = Walls(np.zeros(1, np.int32), normal[None], np.full(1, b), np.full(1, weight))
    found = impose_reference(mean.reshape(1, 1, 2), one, normal[None], np.full((1, 1), hold))[0, 0]
    least = optimize.minimize(
        lambda x: (1 + hold) * np.sum((x - mean) ** 2) + weight * (normal @ x - b) ** 2, mean, tol=1e-12).x
    np.testing.assert_allclose(found, least, atol=1e-6)
    along = np.array([-0.8, 0.6])
    assert found @ along == pytest.approx(mean @ along)  # only the component along the normal is matched


@pytest.mark.parametrize("shape", [(5, 7), (2, 2), (13, 1), (3, 5, 7), (2, 2, 2)])
def test_the_kernel_is_its_reference(shape):
    dimension = len(shape)
    x, hold = drawn(*shape, dimension), np.abs(drawn(*shape))
    count = int(np.prod(shape))
    cells = np.flatnonzero(np.arange(count) % 3 != 1).astype(np.int32)
    normal = drawn(len(cells), dimension)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    near = Walls(cells, normal, drawn(len(cells)), np.abs(drawn(len(cells))) * 50)
    every = rotations(count, dimension)
    frame = every.reshape(*shape, *every.shape[1:])
    on_device = opencl.to_device(x)
    Constraint(near, frame).impose(on_device, opencl.to_device(hold))
    np.testing.assert_allclose(on_device.get(), impose_reference(x, near, into_local(normal, every[cells]), hold),
                               atol=2e-6)


def test_far_from_every_wall_nothing_happens():
    far = walls(np.full((9, 11), 40, np.float32), 1, 2)[0]
    assert len(far.cells) == 0
    x = opencl.to_device(drawn(13, 15, 2))
    before = x.get()
    Constraint(far, rotations(13 * 15, 2).reshape(13, 15, 2)).impose(x, opencl.zeros((13, 15)))
    np.testing.assert_array_equal(x.get(), before)


def test_lambda_is_a_gaussian_of_the_distance_wide_on_coarse_levels_and_strong_on_fine_ones():
    disc = obstacle.ball((64, 80), (0.0, 0.5), 0.2)
    coarse, middle, fine = walls(disc.distance, 3, 8)
    grown = np.pad(disc.distance, 8, mode="edge").ravel()[fine.cells]
    np.testing.assert_allclose(fine.weight, PEAK * np.exp(-0.5 * (grown / WIDTH) ** 2), rtol=1e-4)
    assert fine.weight.max() > middle.weight.max() > coarse.weight.max() > 1  # soft, and still felt
    wide = [np.sqrt(np.sum(w.weight * 4.0**k) / w.weight.max()) for k, w in enumerate((fine, middle, coarse))]
    assert wide[0] < wide[1] < wide[2]  # the area it acts on, in cells of the finest level
    assert (fine.weight > LEAST).all()


def test_a_moving_wall_is_followed():
    shape, push = (48, 48), 0.25
    box = obstacle.box(shape, (0.0, 0.5), (0.2, 0.2))
    level = walls(box.distance, 1, 0, np.full(shape, push, np.float32))[0]
    x = opencl.to_device(drawn(*shape, 2))
    frame = np.broadcast_to(np.float32([1, 0]), (*shape, 2))
    Constraint(level, frame).impose(x, opencl.zeros(shape))
    moved = np.sum(x.get().reshape(-1, 2)[level.cells] * level.normal, -1)
    side = (level.weight > 0.8 * PEAK) & (np.linalg.norm(level.normal, axis=-1) > 0.9)
    assert np.abs(moved - push)[side].max() < 0.03


def at_the_wall(F, centre, radius):
    """The component of F (Y, X, 2) along the normals of a disc, at 720 points of its wall."""
    angle = np.linspace(0, 2 * np.pi, 720, endpoint=False)
    normal = np.stack([np.cos(angle), np.sin(angle)], -1)
    rows, columns = F.shape[:2]
    x = (centre[0] + radius * normal[:, 0] + 0.5 * columns / rows) * rows - 0.5
    y = (centre[1] + radius * normal[:, 1]) * rows - 0.5
    there = np.stack([ndimage.map_coordinates(F[..., c], [y, x], order=1) for c in (0, 1)], -1)
    return np.sum(there * normal, -1)


def test_at_the_stone_of_figure_7_the_normal_component_falls_below_two_percent():
    shape, centre, radius = (96, 128), (1 / 30, 0.5), 0.12
    L = list(wake.wake(shape, 2, seed=1, centre=centre, radius=radius))
    distance = obstacle.ball(shape, centre, radius).distance
    share = {}
    for observed in (True, False):
        settings = Settings(2, iterations=2)
        frames = synthesize(exemplar("sinusoid", 16), L, shape, settings, 1, distance if observed else None)
        for motion, H in zip(L, frames, strict=True):
            world = to_world(H, axes_2d(motion))
            share[observed] = float(np.sqrt(np.mean(at_the_wall(world, centre, radius) ** 2) / np.mean(H**2)))
            assert not observed or share[True] <= 0.02
    assert share[False] > 0.2


def test_without_an_obstacle_near_the_bits_are_those_without_the_constraint():
    L = np.broadcast_to(np.float32([1, 0.3]), (32, 32, 2)).copy()
    with_wall, without = (Synthesis(exemplar("heart", 16), (32, 32), Settings(2, iterations=1), 1, d).frame(L, None)
                          for d in (np.full((32, 32), 60, np.float32), None))
    np.testing.assert_array_equal(with_wall.H[-1], without.H[-1])
