"""Field: knows its grid, converts units, refuses what does not fit."""

import numpy as np
import pytest

from synth.field import Field, domain_origin


def vector(shape=(4, 6), seed=0):
    return np.random.default_rng(seed).normal(size=(*shape, len(shape))).astype(np.float32)


def test_a_domain_is_one_high_centred_and_stands_on_the_floor():
    field = Field.centred(np.zeros((5, 4, 6), np.float32), 3)
    assert field.voxel_size == 0.25
    assert field.origin == (-0.625, 0.125, -0.5)
    last = [o + (n - 1) * 0.25 for o, n in zip(field.origin, field.shape[::-1], strict=True)]
    assert last == [0.625, 0.875, 0.5]
    assert domain_origin((4, 6)) == (-0.625, 0.125)


def test_the_origin_tells_a_plane_of_vectors_from_a_volume_of_scalars():
    values = np.ones((2, 2, 2), np.float32)
    plane, volume = Field(values, 1.0, (0, 0)), Field(values, 1.0, (0, 0, 0))
    assert plane.is_vector and plane.shape == (2, 2)
    assert not volume.is_vector and volume.shape == (2, 2, 2)


def test_one_cell_per_frame_is_voxel_size_times_fps_per_second():
    field = Field.centred(np.ones((10, 8, 2), np.float32), 2)
    np.testing.assert_allclose(field.per_second(30).values, 3.0, rtol=1e-6)
    np.testing.assert_allclose(field.per_second(30).per_frame(30).values, field.values, rtol=1e-6)


def test_values_become_contiguous_float32():
    field = Field(np.arange(24.0).reshape(6, 4).T, 1.0, (0, 0))
    assert field.values.dtype == np.float32 and field.values.flags.c_contiguous
    assert field.values[1, 0] == 1.0


def test_addition_is_of_one_grid_only():
    a = Field.centred(vector(), 2)
    assert a + a == a * 2.0
    others = (Field(a.values, 0.5, a.origin), Field(a.values, a.voxel_size, (0.0, 0.0)),
              Field.centred(vector((6, 4)), 2))
    for other in others:
        with pytest.raises(ValueError, match="different grids"):
            a + other
    with pytest.raises(ValueError, match="scalar and a vector"):
        a + Field.centred(a.values[..., 0], 2)


@pytest.mark.parametrize("values, voxel_size, origin, reason", [
    (np.zeros((4, 4, 3)), 1.0, (0, 0), "no 2-D"),
    (np.zeros((4, 4, 4, 2)), 1.0, (0, 0, 0), "no 3-D"),
    (np.zeros((0, 4)), 1.0, (0, 0), "empty"),
    (np.zeros((4, 4)), 0.0, (0, 0), "voxel size"),
    (np.zeros((4, 4)), float("nan"), (0, 0), "voxel size"),
    (np.zeros((4, 4)), 1.0, (0, np.inf), "origin"),
    (np.zeros((4, 4)), 1.0, (0,), "2 or 3 dimensions"),
    (np.full((4, 4), np.nan), 1.0, (0, 0), "NaN or infinity"),
    (np.full((4, 4), np.inf), 1.0, (0, 0), "NaN or infinity"),
])
def test_refusals(values, voxel_size, origin, reason):
    with pytest.raises(ValueError, match=reason):
        Field(values, voxel_size, origin)


def test_other_values_must_fit_the_grid():
    with pytest.raises(ValueError, match="do not fit"):
        Field.centred(vector(), 2).with_values(np.zeros((4, 5), np.float32))
    with pytest.raises(ValueError, match="fps"):
        Field.centred(vector(), 2).per_second(0)
