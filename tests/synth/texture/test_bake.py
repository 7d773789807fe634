"""What patches on a surface show: the kernels are their references, and on a plane they are those of the plane."""

import hashlib

import meshes
import numpy as np
import processes
import pytest

from synth.texture import bake
from synth.texture.atlas import LANES, Texels, atlas
from synth.texture.charts import Centres, Pieces, charts, pieces
from synth.texture.mesh import Mesh, dot, unit
from synth.texture.patches import (
    AX,
    AY,
    BEND_N,
    BEND_T,
    BIAS,
    FIELDS,
    INVERSE,
    NEAR,
    NEVER,
    RADIUS,
    STEEP,
    TX,
    TY,
    Painter,
    Table,
)
from synth.texture.procedural import DIRECTION, canes, straw
from synth.texture.sample import Sample, sample

SQUARE, SPHERE = meshes.square(12, 16), meshes.sphere(3)
SCALES = {len(SQUARE.faces): 0.25, len(SPHERE.faces): 0.05}
"""World units in a pixel, by the mesh."""
SAMPLES = {"colour": sample(canes(40, seed=2), direction=DIRECTION),
           "grey": sample(straw(33, seed=2).mean(axis=2, keepdims=True).repeat(3, axis=2), direction=DIRECTION)}


def painter(of: Sample, largest: float = 9.0) -> Painter:
    return Painter(of, (1, 1), 1.7, 1.5, largest)


def patches(of: Mesh, count: int = 6, seed: int = 3) -> tuple[np.ndarray, Pieces, np.ndarray, np.ndarray]:
    """A table of patches of all sorts, their triangles, their centres and axes."""
    random, scale = np.random.default_rng(seed), SCALES[len(of.faces)]
    face, place = random.integers(len(of.faces), size=count), random.dirichlet([1, 1, 1], count)
    normal = unit(of.at(of.normals, face, place))
    axis = random.normal(size=(count, 3))
    axis = unit(axis - dot(axis, normal)[:, None] * normal)
    values = np.zeros((count, FIELDS), np.float32)
    radius = random.uniform(6, 9, count).astype(np.float32)
    values[:, [BEND_T, BEND_N]] = random.uniform(-0.03, 0.03, (count, 2))
    values[:, [AX, AY]] = random.uniform(8, 24, (count, 2)).astype(int)
    values[:, INVERSE], values[:, RADIUS], values[:, STEEP] = 1 / radius**2, radius, 0.4 * radius
    values[:, BIAS] = np.where(random.random(count) < 0.3, 2.0, 0)
    values[:, NEAR] = NEVER
    found = charts(of, scale * 1.7 * 1.23 * 9)
    near = pieces(found, Centres(face, place, normal, axis), scale, 1.7 * radius, 1.5)
    return values, near, of.at(of.vertices, face, place), axis


@pytest.mark.parametrize("of", [SQUARE, SPHERE], ids=["square", "sphere"])
@pytest.mark.parametrize(("name", "blend"), [("colour", 0.0), ("colour", 0.7), ("grey", 1.0)])
def test_bake_is_its_reference(of: Mesh, name: str, blend: float) -> None:
    paint, (values, near, _, _) = painter(SAMPLES[name]), patches(of)
    texels = atlas(of, (75, 90)).texels()
    found = bake.bake(paint, values, near, texels, blend)
    assert found.shape == (len(texels.number), 3)
    assert (found > 0).mean() > 0.3 and (found == 0).any()
    np.testing.assert_array_equal(found, bake.bake_reference(paint, values, near, texels, blend))


@pytest.mark.parametrize("name", ["colour", "grey"])
def test_show_is_its_reference_and_heeds_rank_and_what_is_left_out(name: str) -> None:
    of = SPHERE
    paint, (values, near, _, _) = painter(SAMPLES[name]), patches(of, 3)
    texels = atlas(of, (75, 90)).texels()
    rank = np.arange(len(values), dtype=np.int32) % 3
    without = np.where(np.arange(len(texels.face)) % 2, 1, -1).astype(np.int32)
    found = bake.show(paint, values, near, texels, without, rank, 2)
    np.testing.assert_array_equal(found, bake.show_reference(paint, values, near, texels, without, rank, 2))
    all_ = bake.show(paint, values, near, texels, 0 * without - 1, 0 * rank, 1)
    assert 0 < found[:, 1].sum() < all_[:, 1].sum()
    assert not bake.show(paint, values, near, texels, without, rank, 0).any()


@pytest.mark.parametrize("of", [SQUARE, SPHERE], ids=["square", "sphere"])
def test_locate_is_its_reference(of: Mesh) -> None:
    paint, (values, near, _, _) = painter(SAMPLES["grey"]), patches(of)
    who = np.array([0, 3, 5], np.int32)
    found, expected = bake.locate(paint, values, near, who), bake.locate_reference(paint, values, near, who)
    for one, other in zip((*vars(found.texels).values(), found.query),
                          (*vars(expected.texels).values(), expected.query), strict=True):
        np.testing.assert_array_equal(one, other)
    assert len(np.unique(found.texels.number)) == len(found.texels.number) > len(paint.places.radii)


def test_places_are_found_where_the_patch_has_them() -> None:
    """The chart of a patch, read at the triangle and the coordinates that were found, gives the unbent place."""
    of = SPHERE
    paint, (values, near, _, _) = painter(SAMPLES["grey"]), patches(of)
    found = bake.locate(paint, values, near, np.array([2, 4], np.int32))
    face = np.repeat(found.texels.face, LANES)[found.texels.slot]
    query = np.repeat(found.query, LANES)[found.texels.slot]
    u, v = found.texels.place.transpose(0, 2, 1).reshape(-1, 2)[found.texels.slot].T
    for q, patch in enumerate((2, 4)):
        for k in np.flatnonzero(query == q)[::17]:
            c = near.corners[(near.face == face[k]) & (near.patch == patch)][0]
            s, m = c[0] + u[k] * c[2] + v[k] * c[4], c[1] + u[k] * c[3] + v[k] * c[5]
            p = values[patch]
            bent = (s + p[BEND_T] * s * m + p[BEND_N] * m * m / 2, m - p[BEND_T] * s * s / 2 - p[BEND_N] * s * m)
            place = found.texels.number[k] - q * paint.places.padded
            np.testing.assert_allclose(bent, paint.places.along[place], atol=0.02)  # four steps of the inverse


def test_on_a_flat_square_it_is_the_picture_of_the_plane() -> None:
    """The same patches, drawn by `patches` on pixels and by `bake` at the same places of triangles."""
    of, scale = SQUARE, SCALES[len(SQUARE.faces)]
    values, near, centre, axis = patches(of, 25)
    rows, columns = 40, 56
    plane = Painter(SAMPLES["colour"], (rows, columns), 1.7, 1.5, 9.0)
    pixels = centre[:, :2] / scale
    table = Table(np.floor(pixels).astype(np.int32), values.copy())
    table.values[:, :2] = pixels - table.cells
    table.values[:, [TX, TY]] = axis[:, :2]
    expected = plane.draw(table, plane.reaching(table), 0.5, None)
    y, x = (a.ravel() * scale for a in np.mgrid[:rows, :columns])
    cell = np.minimum(y.astype(int), 11) * 16 + np.minimum(x.astype(int), 15)
    fx, fy = x - cell % 16, y - cell // 16
    lower = fx >= fy  # of the two triangles of a cell the first has corners (0, 0), (1, 0), (1, 1)
    face = np.where(lower, cell, cell + 12 * 16)
    place = np.where(lower[:, None], np.stack([fx - fy, fy], -1), np.stack([fx, fy - fx], -1)).astype(np.float32)
    order = np.argsort(face, kind="stable")
    texels = Texels.blocks(face[order], order, place[order])
    found = np.zeros((rows * columns, 3), np.float32)
    found[texels.number] = bake.bake(plane, values, near, texels.of(texels.face), 0.5)
    difference = np.abs(found.reshape(rows, columns, 3) - expected)
    assert expected.mean() > 0.05
    assert np.median(difference) < 1e-5
    assert (difference.max(axis=-1) > 0.01).mean() < 0.01  # where a patch ends, and at its steep edges


def test_nothing_is_asked_of_no_patches() -> None:
    of, paint = meshes.square(3, 3), painter(SAMPLES["grey"])
    none = Pieces(np.zeros(len(of.faces) + 1, np.int32), np.zeros(0, np.int32), np.zeros((0, 6), np.float32))
    table, rank = np.zeros((0, FIELDS), np.float32), np.zeros(0, np.int32)
    texels = atlas(of, (60, 60)).texels()
    assert not bake.bake(paint, table, none, texels, 0.0).any()
    assert not bake.show(paint, table, none, texels, np.zeros(len(texels.face), np.int32), rank, 1).any()
    assert len(bake.locate(paint, table, none, rank).query) == 0


def digest() -> str:
    of = SPHERE
    paint, (values, near, _, _) = painter(SAMPLES["colour"]), patches(of)
    texels = atlas(of, (75, 90)).texels()
    drawn = bake.bake(paint, values, near, texels, 0.6)
    located = bake.locate(paint, values, near, np.arange(6, dtype=np.int32))
    return hashlib.sha256(drawn.tobytes() + located.texels.place.tobytes()).hexdigest()


def test_the_same_bits_at_any_number_of_threads(tmp_path: object) -> None:
    assert len(processes.digests(__file__, tmp_path)) == 1
