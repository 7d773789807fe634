"""Beads on paper: bits repeat, beads are in the right place, obstacles are raised and paper beyond is not."""

import numpy as np
import pytest

from render import beads, studio
from synth.elements import mesh

SMALL = studio.Shot(width=64, spp=9)
CELL = 0.02
AXIS = (np.arange(100) + 0.5) * CELL - 1.0
X, Y = np.meshgrid(AXIS, AXIS)
DISC_WITH_HOLE = np.minimum(0.9 - np.hypot(X, Y), np.hypot(X, Y) - 0.3).astype(np.float32)
"""Distance to the border of a disc with a round hole."""


def ground(inside: np.ndarray | None = None) -> beads.Ground:
    return beads.Ground((-1.0, -0.75), (1.0, 0.75), inside, CELL, (AXIS[0], AXIS[0]))


def red_bead(x: float, y: float) -> mesh.Mesh:
    return mesh.solids(np.array([[x, y]]), np.array([0.1]), np.array([[0.9, 0.1, 0.1]]))


def test_a_picture_repeats_and_a_bead_is_in_its_place() -> None:
    m = red_bead(0.5, 0.375)
    first = beads.picture(m.vertices, m.faces, m.colours, ground(), SMALL)
    assert first.shape == (48, 64, 3) and np.isfinite(first).all()
    assert np.array_equal(first, beads.picture(m.vertices, m.faces, m.colours, ground(), SMALL))
    red = first[..., 0] > 1.5 * first[..., 1]
    row, column = (np.flatnonzero(red.any(axis)).mean() + 0.5 for axis in (1, 0))
    assert (column / 64 * 2 - 1, 0.75 - row / 48 * 1.5) == pytest.approx((0.5, 0.375), abs=0.02)
    assert red.sum() * (2 / 64) ** 2 == pytest.approx(np.pi * 0.01, rel=0.25)


def test_a_bead_throws_a_shadow_away_from_the_lamp() -> None:
    m = red_bead(0.0, 0.0)
    seen = beads.picture(m.vertices, m.faces, m.colours, ground(), studio.Shot(width=64, spp=36))[..., 1]
    assert seen[27, 35] < 0.9 * seen[20, 28]  # below to the right, above to the left
    assert seen[:6].mean() == pytest.approx(seen[-6:].mean(), rel=0.05)  # lit evenly


def test_holes_are_obstacles_and_what_encloses_is_beyond() -> None:
    distance, hole = beads._distances(ground(DISC_WITH_HOLE), X, Y)
    assert distance == pytest.approx(DISC_WITH_HOLE, abs=1e-5)
    radius = np.hypot(X, Y)
    assert hole[radius < 0.28].all() and not hole[radius > 0.92].any()
    z, colour = beads.relief(distance, hole)
    assert (z[radius < 0.28] > 0.9 * beads.RISE).all() and (z[radius > 0.92] < 0).all()
    assert (z[(radius > 0.32) & (radius < 0.88)] == 0).all()
    assert (colour[radius < 0.28] == beads.OBSTACLE).all() and (colour[radius > 0.92] == beads.BEYOND).all()


def test_a_picture_shows_the_obstacle_dark_on_white() -> None:
    nothing = np.zeros((0, 3)), np.zeros((0, 3), int), np.zeros((0, 3))
    seen = beads.picture(*nothing, ground(DISC_WITH_HOLE), SMALL)
    assert seen[22:26, 30:34].mean() < 0.3 * seen[22:26, 48:52].mean()
    assert seen[0, 0].mean() < 0.8 * seen[22:26, 48:52].mean()


def test_level_paper_is_tiled_coarsely_and_nothing_is_left_out() -> None:
    rows, columns = 70, 99
    y, x = np.mgrid[:rows, :columns]
    z = np.where(np.hypot(x - 70, y - 30) < 9, 0.03, 0.0)
    faces = beads.tiled(z, np.where(z[..., None] > 0, 0.1, np.ones(3)))
    a, b, c = (np.stack([x.ravel()[faces[:, k]], y.ravel()[faces[:, k]]], 1) for k in range(3))
    area = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
    assert (area > 0).all() and area.sum() == (rows - 1) * (columns - 1)
    assert len(faces) < 0.6 * 2 * (rows - 1) * (columns - 1)
    high = z.ravel()[faces]
    assert (area[high.max(axis=1) > 0] == 0.5).all()
    assert (area[high.min(axis=1) != high.max(axis=1)] == 0.5).all()
