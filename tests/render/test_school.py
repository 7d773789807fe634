"""A school: bits repeat, fish are visible and fade with distance."""

from dataclasses import replace

import numpy as np
import pytest

from render import school, studio
from synth.elements import fish
from synth.elements.mesh import Mesh

SMALL = studio.Shot(width=64, height=36, spp=4)


def shown(distance: float, count: int = 5) -> Mesh:
    """Large fish side by side, at a multiple of the distance from the camera to its target."""
    eye, target = np.array(school.CAMERA.position), np.array(school.CAMERA.target)
    middle = eye + distance * (target - eye)
    spread = np.linspace(-0.2, 0.2, count)[:, None] * [0.0, distance, 0.0]
    ahead = np.cross(target - eye, [0.0, 1.0, 0.0])
    return fish.bodies(middle + spread, np.tile(ahead, (count, 1)), np.full(count, 0.35 * distance),
                       np.full((count, 3), 0.9), np.zeros(count), np.zeros(count))


def test_a_picture_repeats_and_the_distance_fades() -> None:
    near, far = shown(0.6), shown(3.0)
    first = school.picture(near.vertices, near.faces, near.colours, SMALL)
    assert first.shape == (36, 64, 3) and np.isfinite(first).all() and first.min() >= 0
    assert np.array_equal(first, school.picture(near.vertices, near.faces, near.colours, SMALL))
    gone = shown(-50.0)
    water = school.picture(gone.vertices, gone.faces, gone.colours, SMALL)
    second = school.picture(far.vertices, far.faces, far.colours, SMALL)
    upper = np.s_[:20]  # no sand
    assert np.abs(first - water)[upper].mean() > 1.5 * np.abs(second - water)[upper].mean()
    assert np.abs(first - water)[upper].max() > 0.1


def test_the_lamp_lights_what_is_near_the_eye_and_not_the_water(monkeypatch: pytest.MonkeyPatch) -> None:
    near, gone = shown(0.6), shown(-50.0)
    lit = school.picture(near.vertices, near.faces, near.colours, SMALL)
    water = school.picture(gone.vertices, gone.faces, gone.colours, SMALL)
    monkeypatch.setattr(school, "WATER", replace(school.WATER, lamp=(0.0, 0.0, 0.0)))
    unlit = school.picture(near.vertices, near.faces, near.colours, SMALL)
    upper = np.s_[:18]  # no sand
    assert np.array_equal(water[upper], school.picture(gone.vertices, gone.faces, gone.colours, SMALL)[upper])
    assert (lit >= unlit - 1e-6).all() and (lit - unlit)[upper].max() > 0.3
