"""Paper: bits repeat, a sheet is translucent and creates no light."""

import numpy as np
import pytest

from render import backend, mitsuba_shapes, paper, studio
from synth.elements import mesh

SMALL = studio.Shot(width=64, height=36, spp=9)


def flying(count: int = 6) -> mesh.Mesh:
    r, c = np.meshgrid(np.linspace(-0.12, 0.12, 7), np.linspace(-0.12, 0.12, 7), indexing="ij")
    sheet = np.stack([c, r, 2 * c**2], -1)
    place = np.stack([np.linspace(-0.7, 0.7, count), np.full(count, 0.5), np.zeros(count)], 1)
    colours = np.array(paper.PALETTE)[np.arange(count) % len(paper.PALETTE)]
    return mesh.sheets(place[:, None, None] + sheet, colours)


def test_a_picture_repeats_and_sheets_throw_shadows() -> None:
    m = flying()
    first = paper.picture(m.vertices, m.faces, m.colours, SMALL)
    assert first.shape == (36, 64, 3) and np.isfinite(first).all() and first.min() >= 0
    assert np.array_equal(first, paper.picture(m.vertices, m.faces, m.colours, SMALL))
    nothing = paper.picture(m.vertices[:3] - 50, m.faces[:1] * 0, m.colours[:3], SMALL)
    assert first[28:].mean() < 0.99 * nothing[28:].mean()


def test_an_inset_shows_the_exemplar_large() -> None:
    m = flying(2)
    low, high = m.vertices.min(0), m.vertices.max(0)
    seen = paper.inset(m.vertices, m.faces, m.colours, low, high, SMALL)
    plain = paper.inset(m.vertices[:3] - 50, m.faces[:1] * 0, m.colours[:3], low, high, SMALL)
    changed = np.abs(seen - plain).max(-1) > 0.05
    assert 0.75 < np.ptp(np.flatnonzero(changed.any(0))) / 64 < 0.9


def test_the_studio_is_as_large_as_what_it_shows() -> None:
    m = flying()
    first = paper.picture(m.vertices, m.faces, m.colours, SMALL)
    large = studio.Camera((2.0, 3 * 0.74, 3 * 5.4 + 1), (2.0, 3 * 0.46, 1.0), paper.CAMERA.fov)
    moved = (3 * m.vertices + [2.0, 0.0, 1.0]).astype(np.float32)
    second = paper.picture(moved, m.faces, m.colours, studio.Shot(64, 36, 9, camera=large))
    assert np.abs(first - second).mean() < 0.01 * first.mean()  # but for rounding


@pytest.mark.parametrize("behind", [True, False])
def test_a_sheet_transmits_and_reflects(behind: bool) -> None:
    """A white sheet lit from behind or from the camera's side: both bright, reflection brighter."""
    mi = backend.mitsuba("llvm_ad_rgb")
    wall = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32)
    camera = studio.Camera(position=(0.0, 0.0, 5.0), target=(0.0, 0.0, 0.0), fov=4.0)
    position = (0.0, 1.0, -3.0 if behind else 3.0)
    lamp = studio.Softbox(position, (0.0, 0.0, 0.0), (1.0, 1.0), (9.0, 9.0, 9.0), 1.0)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    scene = {"sensor": mitsuba_shapes.sensor(mi, camera, 8, 8), "lamp": mitsuba_shapes.lamp(mi, lamp),
             "wall": mitsuba_shapes.shape(mi, "wall", wall, faces, np.ones((4, 3)), paper.paper())}
    seen = mitsuba_shapes.rendered(mi, scene, mi.load_dict({"type": "path", "max_depth": 2}), studio.Shot())
    irradiance = 9.0 / 10.0 * np.cos(np.arctan2(1.0, 3.0))
    share = seen.mean() * np.pi / irradiance
    assert 0.35 < share < 0.50 if behind else 0.45 < share < 0.70
