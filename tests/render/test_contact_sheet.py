"""A sheet of clips: each clip's frames where they belong, the right way up."""

import numpy as np
import pytest

from render.contact_sheet import GAP, contact_sheet, panels, thumbnails


def clip(frames=6, coloured=False):
    luma = np.zeros((frames, 12, 16), np.uint8)
    luma[:] = np.arange(frames)[:, None, None] * 30
    luma[:, 0] = 255  # the lowest row
    return np.stack([luma, luma // 2, luma // 4], -1) if coloured else luma


def test_panels_are_three_frames_and_the_mean():
    first, second, third, mean = (panel.picture for panel in panels("fall", clip(), 16))
    for picture, grey in ((first, 0), (second, 60), (third, 120), (mean, 75)):
        np.testing.assert_allclose(picture[0] * 255, grey, atol=0.01)
        np.testing.assert_allclose(picture[-1] * 255, 255, atol=0.01)


def test_colour_is_shown_where_there_is_some():
    picture = panels("fire", clip(coloured=True), 16)[1].picture
    np.testing.assert_allclose(picture[0, 0] * 255, [60, 30, 15], atol=0.01)


def test_a_sheet_has_a_place_for_every_clip():
    one, three = (contact_sheet([("fall", clip())] * count, 32) for count in (1, 3))
    assert three.shape[1] > 1.9 * one.shape[1] - 30 and three.shape[0] > 1.6 * one.shape[0] - 20
    assert one.dtype == np.uint8


def test_thumbnails_have_a_place_each_by_rows_the_right_way_up():
    frames = [np.full((30, 40), 20 + 30 * k, np.uint8) for k in range(8)]
    for frame in frames:
        frame[:10] = 255  # the lowest rows
    page = thumbnails(frames, 200, 1.5)
    assert page.shape[1] == 200
    wide = (200 + GAP) / 3
    for k in range(8):
        row, column = divmod(k, 3)
        left, top = round(column * wide) + 20, row * (len(page) + GAP) // 3
        assert abs(page[top + 10, left, 0] * 255 - (20 + 30 * k)) < 1
        assert page[top + (len(page) + GAP) // 3 - GAP - 4, left, 0] > 0.99
    np.testing.assert_array_equal(page[-20:, -60:], 1)


def test_a_sheet_of_thumbnails_has_few_empty_places():
    """24 of 4 : 3 for 3 : 2: 6 columns of 4, not 5 of 5."""
    page = thumbnails([np.zeros((30, 40), np.uint8)] * 24, 240, 1.5)
    assert len(page) == pytest.approx(4 * 30, abs=4)
    np.testing.assert_array_equal((page[:, :, 0] == 0).sum(axis=0).max(), (page[:, -20:, 0] == 0).sum(axis=0).max())


def test_a_sheet_of_thumbnails_has_about_the_proportions_it_should():
    for count in (1, 2, 24, 95):
        page = thumbnails([np.zeros((240, 320), np.uint8)] * count, 480, 1.5)
        assert 0.6 < page.shape[1] / len(page) / 1.5 < 1.8
