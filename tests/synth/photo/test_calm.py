"""Calm water: waves travel where they are said to, a bed stays where it is, a lake foreshortens."""

import numpy as np
import pytest

from synth.photo.calm import bay, lake, shallow, waves

FRAMES, SIZE = 32, (160, 120)


def plane(height=96, width=128):
    y, x = np.mgrid[:height, :width].astype(np.float32)
    return np.stack([x, y], -1)


def test_waves_move_by_their_travel():
    """The slopes of a frame, put back by the travel of two frames, fit those of the frame better than unmoved."""
    made = waves(plane(), FRAMES, 1, direction=0.0, length=40.0, gravity=0.5, slope=0.2, spread=20.0)
    assert made.travel[0] > 0.8 and abs(made.travel[1]) < 0.3 * made.travel[0]
    moved = round(2 * made.travel[0])
    before, after = made.slopes[0, 0], made.slopes[0, 2]
    assert np.corrcoef(before[:, :-moved].ravel(), after[:, moved:].ravel())[0, 1] > 0.85
    assert np.corrcoef(before.ravel(), after.ravel())[0, 1] < 0.8


def test_slopes_are_those_of_one_height():
    """Their curl vanishes, whatever the turn of the tiles."""
    sx, sy = waves(plane(), 16, 2, direction=0.7, length=40.0, gravity=0.5, slope=0.2).slopes[:, 3]
    curl = np.gradient(sy, axis=1) - np.gradient(sx, axis=0)
    wrong = np.gradient(sy, axis=1) + np.gradient(sx, axis=0)
    assert curl.std() < 0.35 * wrong.std()  # tiles are read between texels, linearly


def test_a_bed_of_pebbles_stays_where_it_is():
    clip = shallow(3, FRAMES, SIZE)
    frames = clip.luma.astype(np.float32)
    mean = frames.mean(0)
    assert min(np.corrcoef(frame.ravel(), mean.ravel())[0, 1] for frame in frames) > 0.7
    assert frames.std(0).mean() > 4, "nothing moves"


def test_rocks_of_a_bay_are_dry():
    clip = bay(4, FRAMES, SIZE, stones=3)
    dry = clip.coverage < 0.02
    assert dry.sum() > 100 and clip.luma[:, dry].std(0).mean() < 0.3 * clip.luma[:, ~dry].std(0).mean()


@pytest.mark.parametrize("direction", [0.5, 2.5, -1.5])
def test_the_velocity_of_a_bay_is_along_its_waves(direction):
    v = bay(5, 16, SIZE, direction=direction).velocity
    v = v[np.hypot(v[..., 0], v[..., 1]) > 0].mean(0)
    assert np.cos(np.arctan2(v[1], v[0]) - direction) > 0.9


def test_far_waves_of_a_lake_look_slower():
    v = lake(6, 16, SIZE).velocity
    speed = np.hypot(v[..., 0], v[..., 1]).mean(1)
    assert (np.diff(speed) < 0).all() and speed[0] > 3 * speed[-1]
