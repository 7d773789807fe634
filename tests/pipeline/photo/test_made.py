"""Targets that are made: their arrays, their place in the chain, scenes that ask for them."""

from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from tiny import PHOTO, changed, complaint, scene, written

from pipeline.errors import InvalidValue
from pipeline.photo.made import MAKES, SHAPE, SPP, STROKES, made_artifacts, size
from pipeline.photo.method import METHOD
from pipeline.photo.tables import Photo
from pipeline.photo.target import check_target, read_target

FILES = 'file = "assets/stream/image.jpg"\nmatte = "assets/stream/mask.png"\nstrokes = [[[490, 28], [487, 64]], ' \
        '[[305, 288], [245, 328]]]'
MADE = changed(PHOTO, FILES, 'made = "painting"')


def test_each_kind_has_all_it_needs() -> None:
    kinds = set(get_args(Photo.model_fields["made"].annotation)) - {""}
    assert kinds == MAKES.keys() == STROKES.keys() == SPP.keys() | {"painting"}
    for strokes in STROKES.values():
        points = np.concatenate([np.array(stroke) for stroke in strokes])
        assert (points > 0).all() and (points < SHAPE[::-1]).all()


def test_a_file_makes_nothing(tmp_path: Path) -> None:
    assert made_artifacts(scene(tmp_path, PHOTO)) == ()


def test_all_that_shows_the_target_is_made_from_it(tmp_path: Path) -> None:
    artifacts = {artifact.name: artifact for artifact in METHOD.artifacts(scene(tmp_path, MADE))}
    needing = {name for name, artifact in artifacts.items() if "made" in dict(artifact.inputs)}
    assert needing == {"assignment", "fluid", "mattes", "frames", "target-picture"}
    assert artifacts["made"].shared


@pytest.mark.parametrize("kind", ["fire", "smoke", "painting"])
def test_a_made_target_is_a_whole_target(tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(SPP, kind, 2)
    one = scene(tmp_path, changed(MADE, '"painting"', f'"{kind}"'))
    (artifact,) = made_artifacts(one)
    ((_, made),) = artifact.make(one, None, [0])
    rows, columns = size(one)
    assert (rows, columns) == (72, 96)
    target = read_target(one, made)
    assert target.picture.shape == (rows, columns, 3) and target.matte.shape == (rows, columns)
    assert target.picture.min() >= 0 and target.picture.max() <= 1
    assert 0.02 < target.matte.mean() < 0.5
    assert (target.background is None) == (kind == "painting") == ("motion" not in made)
    inside = target.matte > 0.5
    if "motion" in made:
        assert made["motion"][::-1][inside][:, 1].mean() > 0.1, "fire and smoke rise"
        wanted = target.wanted.orientation[inside].mean(axis=0)
        true = made["motion"][::-1][inside].mean(axis=0)
        assert wanted @ true > 0.7 * np.linalg.norm(wanted) * np.linalg.norm(true), "the strokes are along the motion"


def test_a_scene_may_give_its_own_strokes(tmp_path: Path) -> None:
    """They are in pixels of 640 x 480."""
    own = changed(MADE, '"painting"', '"painting"\nstrokes = [[[600, 100], [600, 300]]]')
    check_target(scene(tmp_path, own))
    made = {"picture": np.random.default_rng(1).random((72, 96, 3)), "matte": np.ones((72, 96), np.float32)}
    np.testing.assert_allclose(read_target(scene(tmp_path, own), made).wanted.orientation[40, 90], [0, -1], atol=1e-5)
    outside = scene(tmp_path, changed(own, "[600, 300]", "[700, 300]"))
    with pytest.raises(InvalidValue, match="leaves the picture of 640 x 480"):
        check_target(outside)


@pytest.mark.parametrize(("old", "new", "told"), [
    ('made = "painting"', 'made = "rain"', "photo.made: 'rain' is not one of them; known: , fire, smoke, painting"),
    ('made = "painting"', "carried = 0.5", "photo.file: is missing, and so is photo.made"),
    ('made = "painting"', 'made = "painting"\nfile = "assets/stream/image.jpg"',
     'photo.file: is given, and so is photo.made = "painting", which has its own'),
    ('made = "painting"', 'file = "assets/stream/image.jpg"', "photo.matte: is missing, and so is photo.made"),
])
def test_a_scene_has_one_target(tmp_path: Path, old: str, new: str, told: str) -> None:
    assert told in complaint(written(tmp_path, changed(MADE, old, new)))
