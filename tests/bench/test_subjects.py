"""Targets of the bench: strokes that run along the flow, mattes that hold the fluid, seeds that no database has."""

import numpy as np
import pytest

from bench import subjects
from synth.photo.clips import FAMILIES, catalogue

SIZE, FRAMES = (96, 64), 16


@pytest.fixture(scope="module")
def river() -> subjects.Subject:
    return subjects.of_clip("river", FRAMES, SIZE)


def test_strokes_run_along_a_flow_that_turns() -> None:
    y, x = np.mgrid[:60, :80].astype(np.float64)
    turning = np.stack([-(y - 30), x - 40], axis=-1) / 10
    lines = subjects.strokes(turning, np.ones((60, 80), bool))
    assert len(lines) == subjects.ACROSS * subjects.ALONG
    for line in lines:
        steps, at = np.diff(line, axis=0), line[:-1] - [40, 30]
        np.testing.assert_allclose(np.hypot(*steps.T), 1, atol=1e-9)
        across = (steps * at).sum(axis=1) / np.hypot(*at.T)
        assert np.abs(across).max() < 0.1  # round the middle, none towards it


def test_strokes_stay_in_the_fluid() -> None:
    where = np.zeros((60, 80), bool)
    where[:, 30:50] = True
    for line in subjects.strokes(np.broadcast_to(np.float64([2, 0]), (60, 80, 2)), where):
        assert (line[:, 0] >= 29.5).all() and (line[:, 0] < 50).all()
    with pytest.raises(ValueError, match="nothing flows"):
        subjects.strokes(np.zeros((60, 80, 2)), where)


def test_a_clip_s_target_is_one_of_its_frames_and_its_stones_are_frozen(river: subjects.Subject) -> None:
    np.testing.assert_allclose(river.target.picture[..., 1], river.frames[FRAMES // 2], atol=1e-6)
    assert river.target.wanted.orientation is None
    assert river.guided.wanted.orientation is river.orientation
    frozen = river.target.frozen
    assert frozen is not None and 0.002 < frozen.mean() < 0.5
    assert not river.flows[frozen].any()
    assert (river.target.matte[frozen] > 0.3).all()


def test_the_orientation_of_a_clip_s_strokes_is_its_velocity_s(river: subjects.Subject) -> None:
    truth = river.truth
    assert truth is not None
    speed = np.hypot(*np.moveaxis(truth.velocity, -1, 0))
    along = (truth.velocity * river.orientation).sum(axis=-1) / np.maximum(speed, 1e-6)
    assert np.degrees(np.arccos(np.clip(along[river.flows], -1, 1))).mean() < 15


def test_a_photograph_keeps_its_strokes_apart_from_its_target() -> None:
    stream = subjects.photograph(96)
    assert stream.target.picture.shape == (81, 96, 3)
    assert stream.target.wanted.orientation is None and stream.target.wanted.speed is None
    np.testing.assert_allclose(np.hypot(*np.moveaxis(stream.orientation, -1, 0)), 1, atol=1e-4)


def test_every_family_is_a_target_and_no_database_has_it() -> None:
    assert {family for family, _ in subjects.CLIPS.values()} == set(FAMILIES)
    assert subjects.SEED not in {recipe.seed for recipe in catalogue()}
    assert len(subjects.CLIPS) + 1 > 12
