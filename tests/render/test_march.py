"""render.march: amounts of light known in advance, the kernels against NumPy, and the path tracer."""

import dataclasses

import numpy as np
import pytest

from render import march, smoke, studio
from render.march import EmptyStudio, Grid, Lamp, Medium
from synth import opencl

MEDIUM = Medium((0.9, 0.8, 0.95), 0.2)
KEY_EDGES = np.array([0.0, 1.0, 0.0]), np.array([0.4, 0.0, 0.8])
RIM_EDGES = np.array([0.0, 0.7, 0.0]), np.array([0.6, 0.0, 0.3])
KEY = Lamp(np.array([-3.0, 1.0, 0.3]), KEY_EDGES, (4.0, 3.0, 2.0))
RIM = Lamp(np.array([1.5, 1.5, -2.5]), RIM_EDGES, (1.0, 2.0, 3.0))
EYE = np.array([0.2, 0.9, 5.0])
DARK = np.zeros((6, 4, 3))
SHAPES = [(5, 7, 3), (2, 2, 2), (4, 9, 6)]


def random(*shape: int, seed: int = 1) -> np.ndarray:
    return np.random.Generator(np.random.Philox(key=seed)).random(shape)


def cloud(shape: tuple[int, int, int], voxel_size: float = 0.1) -> Grid:
    """Random smoke with holes in it, round (0, 0.5, 0)."""
    sigma = np.maximum(random(*shape) - 0.3, 0.0).astype(np.float32)
    return Grid(sigma, voxel_size, np.array([0.0, 0.5, 0.0]) - 0.5 * voxel_size * (np.array(shape[::-1]) - 1))


def slab(cells: int = 8) -> Grid:
    """Extinction 2 per world unit, cells of 0.25, from -1.125 to 0.875 along each axis."""
    return Grid(np.full((cells, cells, cells), 0.5, np.float32), 0.25, np.array([-1.0, -1.0, -1.0]))


def sources(sigma: np.ndarray, light: float) -> np.ndarray:
    """Cells (Z, Y, X, 4) that all send out `light`."""
    return np.stack([light * sigma] * 3 + [sigma], -1).astype(np.float32)


# what must hold


def test_the_directions_of_s4_are_even() -> None:
    """24 unit vectors whose mean is zero and whose mean square is a third along every axis."""
    vectors = march.directions().reshape(-1, 3)
    assert len(np.unique(vectors, axis=0)) == 24
    assert np.linalg.norm(vectors, axis=1) == pytest.approx(1.0, abs=1e-6)
    assert vectors.mean(axis=0) == pytest.approx(0.0, abs=1e-7)
    assert vectors.T @ vectors / 24 == pytest.approx(np.eye(3) / 3, abs=1e-6)


@pytest.mark.parametrize("shape", SHAPES)
def test_white_furnace(shape: tuple[int, int, int]) -> None:
    """Smoke that absorbs nothing, in a light of 1 from everywhere, cannot be seen."""
    grid = cloud(shape)
    made = march.source(grid, [], EYE, Medium((1.0, 1.0, 1.0), 0.2), np.ones((6, 4, 3)))
    assert made.get() == pytest.approx(sources(grid.sigma, 1.0), abs=1e-6)
    rays = through_all(grid, 40)
    marched = march.radiance(made, shape, rays, grid.cells(EYE))
    assert marched[:, :3] + marched[:, 3:] == pytest.approx(1.0, abs=1e-5)


def test_smoke_that_absorbs_is_never_brighter_than_the_furnace() -> None:
    grid = cloud((6, 9, 8))
    made = march.source(grid, [], EYE, MEDIUM, np.ones((6, 4, 3))).get()
    smoke_cells = grid.sigma > 0.0
    light = made[smoke_cells][:, :3] / made[smoke_cells][:, 3:]
    assert light.min() > 0.0 and (light < np.array(MEDIUM.albedo)).all()


def through_all(grid: Grid, count: int) -> np.ndarray:
    """Rays (count, 4) from EYE towards random points of a grid, some ending there, some going on."""
    points = grid.cells(grid.origin) + random(count, 3, seed=2) * np.array(grid.sigma.shape[::-1])
    offset = points - grid.cells(EYE)
    distance = np.linalg.norm(offset, axis=1)
    length = np.where(random(count, seed=3) < 0.5, distance, 1e5)
    return np.column_stack([offset / distance[:, None], length]).astype(np.float32)


def test_beer_lambert_straight_and_slanted() -> None:
    """Rays through the middle of a slab 2 thick: exp(-2 * 2), less along a slanted ray; 1 beside it."""
    grid = slab()
    unit = np.array([[0.0, 0.0, -1.0], [0.1, 0.0, -1.0], [0.9, 0.0, -1.0]])
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    start = grid.cells(np.array([-0.5, -0.1, 5.0]))
    rays = np.column_stack([unit, np.full(3, 1e5)])
    marched = march.radiance(opencl.to_device(sources(grid.sigma, 3.0)), grid.sigma.shape, rays, start)
    passed = [np.exp(-4.0), np.exp(-4.0 * np.hypot(1.0, 0.1)), 1.0]
    assert marched[:, 3] == pytest.approx(passed, rel=1e-4)
    assert marched[:, 0] == pytest.approx(3.0 * (1.0 - np.array(passed)), rel=1e-4)


def test_rays_end_at_surfaces_and_begin_where_they_begin() -> None:
    grid = slab()
    sent = opencl.to_device(sources(grid.sigma, 1.0))
    ahead = np.array([[0.0, 0.0, -1.0, 5.0 / 0.25]])
    outside = march.radiance(sent, grid.sigma.shape, ahead, grid.cells(np.array([0.0, 0.0, 5.0])))
    assert outside[0, 3] == pytest.approx(np.exp(-2.0 * 0.875), rel=1e-4)
    inside = march.radiance(sent, grid.sigma.shape, ahead, grid.cells(np.array([0.0, 0.0, 0.1])))
    assert inside[0, 3] == pytest.approx(np.exp(-2.0 * 1.225), rel=1e-4)


@pytest.mark.parametrize("towards", [(9.0, 0.0, 0.0), (-9.0, 0.1, 0.0), (0.0, 9.0, 0.0), (0.0, -9.0, 0.2),
                                     (0.0, 0.0, 9.0), (0.1, 0.0, -9.0)])
def test_lamplight_fades_by_beer_lambert_from_every_side(towards: tuple[float, float, float]) -> None:
    """The mean light of a far small lamp: its solid angle over 4 pi, times exp(-depth), cell by cell."""
    grid = Grid(np.full((6, 6, 6), 0.1, np.float32), 0.01, np.zeros(3))
    middle = np.full(3, 0.025)
    point = middle + np.array(towards)
    facing = np.array(towards) / np.linalg.norm(towards)
    even = Medium((0.9, 0.9, 0.9), 0.0)
    sigma = opencl.to_device(grid.sigma)
    lamp, eye = grid.cells(point[None]), grid.cells(EYE)
    _, spread = march.arriving(sigma, grid.sigma.shape, lamp, facing, 1.0, eye, even)
    axis = int(np.argmax(np.abs(towards)))
    line = np.moveaxis(spread.get(), 2 - axis, 0)[:, 3, 3] * (np.linalg.norm(towards) / 0.01) ** 2
    cells = np.arange(6)[::-1] if towards[axis] > 0 else np.arange(6)
    assert line == pytest.approx(np.exp(-0.1 * cells), rel=0.01)  # the lamp is not quite infinitely far


def test_no_smoke_shows_the_empty_studio_exactly_and_full_light_falls_on_it() -> None:
    empty = small_studio()
    seen = march.seen(Grid(np.zeros((4, 5, 3), np.float32), 0.1, np.zeros(3)), [KEY, RIM], MEDIUM, empty)
    assert np.array_equal(seen.picture(empty), empty.light)
    assert (seen.shares == 1.0).all() and not seen.smoke.any()


def small_studio() -> EmptyStudio:
    rays = studio.Camera(position=(0.2, 0.9, 5.0), target=(0.0, 0.5, 0.0), fov=14.0).rays(6, 8)
    distance = 5.5 + random(8, 6, seed=5)
    layers = random(3, 8, 6, 3, seed=6).astype(np.float32)
    return EmptyStudio(EYE, rays, distance, layers, random(6, 4, 3, seed=7))


def test_a_mirrored_scene_gives_the_mirrored_picture() -> None:
    """x to -x: smoke, lamps, eye and light from outside."""
    def mirrored(lamp: Lamp) -> Lamp:
        flip = np.array([-1.0, 1.0, 1.0])
        return Lamp(flip * lamp.corner, (flip * lamp.edges[0], flip * lamp.edges[1]), lamp.radiance)

    def other(empty: EmptyStudio) -> EmptyStudio:
        flip = np.array([-1.0, 1.0, 1.0])
        vectors = march.directions().reshape(-1, 3)
        place = [int(np.abs(vectors - v).sum(1).argmin()) for v in vectors * flip]
        return EmptyStudio(flip * empty.eye, flip * empty.rays[:, ::-1], empty.distance[:, ::-1],
                           empty.layers[:, :, ::-1], empty.border.reshape(24, 3)[place].reshape(6, 4, 3))

    empty, grid = small_studio(), cloud((4, 8, 8))
    turned = Grid(grid.sigma[..., ::-1].copy(), grid.voxel_size, grid.origin)
    first = march.seen(grid, [KEY, RIM], MEDIUM, empty).picture(empty)
    second = march.seen(turned, [mirrored(KEY), mirrored(RIM)], MEDIUM, other(empty)).picture(other(empty))
    assert second[:, ::-1] == pytest.approx(first, rel=1e-4, abs=1e-5)
    assert np.abs(first - first[:, ::-1]).max() > 0.05


def test_the_shadow_lies_away_from_the_lamp_and_is_soft() -> None:
    """A dense block under a lamp: dark below it, light far off, and a penumbra between."""
    grid = Grid(np.full((4, 4, 4), 3.0, np.float32), 0.05, np.array([-0.075, 0.5, -0.075]))
    edges = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
    points = Lamp(np.array([-0.5, 3.0, -0.5]), edges, (1.0,) * 3).points(6)
    places = np.zeros((41, 3))
    places[:, 0] = np.linspace(-0.5, 0.5, 41)
    sigma = opencl.to_device(grid.sigma)
    share = march.shade(sigma, grid.sigma.shape, grid.cells(places), grid.cells(points))
    assert share[20] < 0.01 and share[0] == share[-1] == 1.0
    assert ((share > 0.05) & (share < 0.95)).sum() >= 4
    assert share == pytest.approx(share[::-1], abs=1e-5)


def test_the_same_bits_each_time() -> None:
    empty, grid = small_studio(), cloud((5, 9, 7))
    first, again = (march.seen(grid, [KEY, RIM], MEDIUM, empty).picture(empty) for _ in range(2))
    assert np.array_equal(first, again)


def test_a_lamp_inside_the_smoke_is_refused() -> None:
    inside = dataclasses.replace(KEY, corner=np.array([0.0, 0.5, 0.0]) - 0.5 * sum(KEY.edges))
    with pytest.raises(ValueError, match="a lamp is inside the smoke"):
        march.source(cloud((5, 7, 6)), [inside], EYE, MEDIUM, DARK)


# the kernels, against NumPy


@pytest.mark.parametrize("shape", SHAPES)
def test_source_equals_its_reference(shape: tuple[int, int, int]) -> None:
    """All light transport before the rays: both lamps, halving, the bounces at both sizes, refining."""
    grid, border = cloud(shape), random(6, 4, 3, seed=4)
    made = march.source(grid, [KEY, RIM], EYE, MEDIUM, border).get()
    expected = march.source_reference(grid, [KEY, RIM], EYE, MEDIUM, border)
    assert made == pytest.approx(expected, rel=1e-4, abs=1e-7)


@pytest.mark.parametrize("shape", SHAPES)
def test_radiance_and_shade_equal_their_references(shape: tuple[int, int, int]) -> None:
    grid = cloud(shape)
    values = (random(*shape, 4, seed=8) * (grid.sigma > 0)[..., None]).astype(np.float32)
    rays = through_all(grid, 70)
    marched = march.radiance(opencl.to_device(values), shape, rays, grid.cells(EYE))
    assert marched == pytest.approx(march.radiance_reference(values, rays, grid.cells(EYE)), abs=2e-5)
    places = grid.cells(random(70, 3, seed=9) * [2.0, 0.5, 2.0] - [1.0, 0.2, 1.0])
    points = grid.cells(KEY.points(2))
    shares = march.shade(opencl.to_device(grid.sigma), shape, places, points)
    assert shares == pytest.approx(march.shade_reference(grid.sigma, places, points), abs=2e-5)
    assert shares.min() < 0.99


# and against the path tracer


def test_a_march_comes_near_many_paths() -> None:
    """The studio with a cloud of large cells: means of smoke and picture within 6 %, pixels correlated.

    What is left is the size of the cells and the light that the smoke throws on the studio.
    """
    z, y, x = np.mgrid[-1:1:14j, -1:1:24j, -1:1:16j]
    body = np.clip(1.2 - np.hypot(np.hypot(x, y), z) + 0.3 * np.sin(7 * x) * np.cos(6 * y), 0.0, 1.0)
    placed = (body.astype(np.float32), 0.035, (-0.26, 0.13, -0.23))
    many = smoke.VolumeSettings(width=40, height=50, spp=64, extinction=5.0, denoised=False)
    truth = smoke.volume(*placed, many)
    picture = smoke.volume(*placed, dataclasses.replace(many, method="march"))
    thick = np.abs(picture - smoke.empty_studio(many).light).max(axis=-1) > 0.1
    assert 0.1 < thick.mean() < 0.5
    assert picture[thick].mean() == pytest.approx(truth[thick].mean(), rel=0.06)
    assert picture.mean() == pytest.approx(truth.mean(), rel=0.06)
    assert np.corrcoef(picture.ravel(), truth.ravel())[0, 1] > 0.97
