"""A sheet of clips: each clip's frames where they belong, the right way up."""

import numpy as np

from render.contact_sheet import contact_sheet, panels


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
