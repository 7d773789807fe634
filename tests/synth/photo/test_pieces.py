"""Pieces: where a point of a version lies in its clip, and what a piece shows of it."""

import numpy as np
import pytest
from scipy import ndimage

from synth.photo.pieces import (
    VERSIONS,
    Cut,
    Version,
    canvas,
    inside,
    pixels,
    scaled,
    shrunk,
    to_clip,
    turned_vectors,
    warped,
)

SHAPE = (120, 160)
CUT = Cut(48)


def test_there_are_three_scales_three_turns_and_two_sides():
    assert len(set(VERSIONS)) == 18


@pytest.mark.parametrize("version", VERSIONS)
def test_the_middle_is_the_middle(version):
    height, width = canvas(SHAPE, version)
    found = to_clip(SHAPE, version) @ [(width - 1) / 2, (height - 1) / 2, 1]
    np.testing.assert_allclose(found, [(160 - 1) / 2, (120 - 1) / 2], atol=1e-9)


@pytest.mark.parametrize("version", VERSIONS)
def test_velocities_turn_as_points_do(version):
    """A point of the clip that moves by v moves in the version by what `turned_vectors` gives."""
    at = to_clip(SHAPE, version)
    moved = turned_vectors(np.array([[1.5, -0.7]]), version)[0]
    np.testing.assert_allclose(at[:, :2] @ moved, [1.5, -0.7], atol=1e-6)


def test_a_turn_is_counter_clockwise_and_a_flip_is_from_left_to_right():
    np.testing.assert_allclose(turned_vectors(np.array([1.0, 0.0]), Version(1, 90, False)), [0, 1], atol=1e-6)
    np.testing.assert_allclose(turned_vectors(np.array([1.0, 2.0]), Version(0.5, 0, True)), [-0.5, 1], atol=1e-6)


def test_corners_are_points_of_the_grid_and_pieces_overlap_by_half():
    corners = CUT.corners(SHAPE)
    assert CUT.step == 6 and CUT.stride == 24
    assert (corners % CUT.step == 0).all()
    assert corners.max(axis=0).tolist() == [48, 96]
    assert len(corners) == 3 * 5
    assert len(Cut(16).corners((16, 16))) == 0, "the grid of descriptors reaches one pixel past a piece"
    assert len(Cut(16).corners((17, 17))) == 1


def test_pieces_that_reach_outside_the_clip_are_none():
    straight, turned = Version(1, 0, False), Version(1, 22.5, False)
    corners = CUT.corners(SHAPE)
    assert inside(corners, CUT, SHAPE, straight).all()
    kept = inside(corners, CUT, SHAPE, turned)
    assert 0 < kept.sum() < len(corners)
    middle = np.array([[36, 56]])
    assert inside(middle, CUT, SHAPE, turned).all()
    assert not inside(np.array([[0, 0]]), CUT, SHAPE, turned).any()


def clip(frames=4):
    y, x = np.mgrid[:SHAPE[0], :SHAPE[1]]
    return np.stack([np.uint8(np.clip(30 + 1.1 * x + 0.2 * y + 5 * k, 0, 255)) for k in range(frames)])


def test_a_straight_piece_is_a_part_of_the_clip():
    frames = clip()
    found = pixels(frames, frames.shape[1:], (24, 48), CUT, Version(1, 0, False))
    np.testing.assert_array_equal(found, frames[:, 24:72, 48:96])


@pytest.mark.parametrize("version", [v for v in VERSIONS if v.scale == 1])
def test_a_piece_shows_what_its_map_says(version):
    frames, corner = clip(), (36, 56)
    at = to_clip(SHAPE, version)
    y, x = np.mgrid[:48, :48]
    points = at @ np.stack([x.ravel() + corner[1], y.ravel() + corner[0], np.ones(48 * 48)])
    expected = ndimage.map_coordinates(frames[2].astype(float), points[::-1], order=1).reshape(48, 48)
    # OpenCV places points to 1/32 of a pixel
    found = pixels(scaled(frames, version.scale), frames.shape[1:], corner, CUT, version)
    assert np.abs(found[2] - expected).max() < 1.2


def test_a_smaller_piece_shows_more():
    frames = clip()
    half = pixels(scaled(frames, 0.5), frames.shape[1:], (6, 6), CUT, Version(0.5, 0, False))
    assert half.shape == (4, 48, 48)
    np.testing.assert_allclose(half[0], frames[0, 12:108, 12:108].reshape(48, 2, 48, 2).mean(axis=(1, 3)), atol=1)


def test_pictures_of_many_channels_are_read_like_one():
    picture = np.random.Generator(np.random.Philox(1)).random((20, 30, 7)).astype(np.float32)
    at = to_clip((20, 30), Version(1, 22.5, True))
    found = warped(picture, (20, 30), at)
    assert found.shape == picture.shape
    np.testing.assert_array_equal(found[..., 5], warped(picture[..., 5], (20, 30), at))


def test_shrinking_keeps_the_mean():
    frame = clip()[0].astype(np.float32)
    for scale in (0.5, 0.75):
        assert shrunk(frame, scale).shape == canvas(SHAPE, Version(scale, 0, False))
        assert shrunk(frame, scale).mean() == pytest.approx(frame.mean(), rel=2e-3)
    assert shrunk(frame, 1.0) is frame


@pytest.mark.parametrize("size", [0, 15, 40, 272])
def test_sizes_that_do_not_fit_the_grid_are_refused(size):
    with pytest.raises(ValueError, match="whole steps of 16"):
        Cut(size)
