"""The atlas: every texel that a renderer reads in a triangle is that triangle's own."""

import meshes
import numpy as np
import pytest

from synth.texture.atlas import LANES, Atlas, Texels, atlas
from synth.texture.mesh import refined

SHAPE = (70, 90)
UNEVEN = refined(meshes.cylinder(1, 6, 9, 2), np.zeros((27, 0)), 1.3)[0]


@pytest.mark.parametrize("of", [meshes.square(3, 4), UNEVEN, meshes.sphere(2)], ids=["square", "uneven", "sphere"])
def test_interpolation_never_reads_another_triangles_texel(of) -> None:
    made = atlas(of, SHAPE)
    texels = made.texels()
    owner = np.full(SHAPE, -1)
    face = np.repeat(texels.face, LANES)[texels.slot]
    assert len(np.unique(texels.number)) == len(texels.number)
    owner.ravel()[texels.number] = face
    random = np.random.default_rng(1)
    asked = random.integers(len(of.faces), size=5000)
    place = random.dirichlet([0.3] * 3, 5000)  # many at edges and corners
    uv = (made.uv.astype(np.float64)[asked] * place[..., None]).sum(axis=1)
    at = uv * SHAPE[::-1] - 0.5
    low, share = np.floor(at).astype(int), at - np.floor(at)
    for dx in (0, 1):
        for dy in (0, 1):
            read = (share[:, 0] > 1e-4 if dx else share[:, 0] < 1 - 1e-4) & (
                share[:, 1] > 1e-4 if dy else share[:, 1] < 1 - 1e-4)
            assert (owner[low[read, 1] + dy, low[read, 0] + dx] == asked[read]).all()


def test_texels_know_their_place() -> None:
    """What is linear over a triangle comes back exactly by interpolation, padding and all."""
    of = meshes.sphere(1)
    made = atlas(of, SHAPE)
    texels = made.texels()
    face = np.repeat(texels.face, LANES)[texels.slot]
    u, v = texels.place.transpose(0, 2, 1).reshape(-1, 2)[texels.slot].T
    corner = made.uv.astype(np.float64)[face]
    here = corner[:, 0] + u[:, None] * (corner[:, 1] - corner[:, 0]) + v[:, None] * (corner[:, 2] - corner[:, 0])
    row, column = np.divmod(texels.number, SHAPE[1])
    np.testing.assert_allclose(here * SHAPE[::-1], np.stack([column, row], -1) + 0.5, atol=1e-4)


def test_it_is_told_by_its_places() -> None:
    made = atlas(UNEVEN, SHAPE)
    again = Atlas.of_uv(made.uv, SHAPE)
    np.testing.assert_array_equal(again.corner, made.corner)
    np.testing.assert_array_equal(again.leg, made.leg)


def test_larger_triangles_have_more_texels_and_most_of_the_picture_is_used() -> None:
    of, _ = refined(meshes.cylinder(1, 6, 9, 2), np.zeros((27, 0)), 2.5)
    made = atlas(of, (300, 300))
    edge = np.linalg.norm(np.roll(of.corners, -1, axis=1) - of.corners, axis=-1).max(axis=1)
    assert (np.abs(made.leg) >= np.floor(edge / edge.max() * np.abs(made.leg).max()) - 1).all()
    assert len(made.texels().number) > 0.75 * 300 * 300


def test_triangles_that_do_not_fit_are_told() -> None:
    with pytest.raises(ValueError, match="2048 triangles do not fit into 90×70 texels"):
        atlas(meshes.sphere(4), SHAPE)


def test_blocks_hold_one_triangle_each_and_repeat_its_last_place() -> None:
    face = np.repeat([2, 5], [18, 3])
    place = np.arange(42, dtype=np.float32).reshape(21, 2)
    made = Texels.blocks(face, np.arange(21), place)
    np.testing.assert_array_equal(made.face, [2, 2, 5])
    flat = made.place.transpose(0, 2, 1).reshape(-1, 2)
    np.testing.assert_array_equal(flat[made.slot], place)
    np.testing.assert_array_equal(flat[18:32], np.broadcast_to(place[17], (14, 2)))
    np.testing.assert_array_equal(made.gathered(made.place), place)
