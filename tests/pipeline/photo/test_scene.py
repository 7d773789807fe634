"""Scenes of photographs: one line for what does not fit together."""

from pathlib import Path

import footage
import numpy as np
import pytest
from tiny import PHOTO, changed, complaint, written

from pipeline.files import pictures
from pipeline.photo import library
from pipeline.scene import load
from pipeline.tables import PROJECT_SCENES


def test_a_table_photo_makes_it_a_scene_of_them(tmp_path: Path) -> None:
    loaded = load(written(tmp_path, PHOTO))
    assert loaded.method.name == "okabe11"
    assert loaded.variants[""].assignment.settings().candidates == 20


@pytest.mark.parametrize(("old", "new", "told"), [
    ("count = 1", "count = 0", "clips.count: is 0, and there is neither clips.files nor clips.library: there is "
                                  "no clip"),
    ("piece = 16", "piece = 32", "assignment.piece: pieces of 32 pixels do not fit into clips of 64 x 64 at half their "
                                 "size"),
    ('["cloud"]', '["clouds"]', "clips.families: there is no family 'clouds', only fall, white-water, river, fire, "
                                "smoke, cloud, bay, shallow, lake"),
    ('["target"', '["piece"', 'figure.pieces: is empty, and the panel "piece" shows a piece'),
    ("panel = 32", 'panel = 32\npieces = [["fall-01", 0.5, 0.5]]', 'figure.pieces[0]: the scene has no clip "fall-01"'),
    ("panel = 32", "panel = 32\nmoments = [9]", "figure.moments[0]: the animation has 8 frames"),
    ("width = 96", "width = 20", "photo.width: should be greater than or equal to 64, not 20"),
    ("width = 96", "width = 96\ndynamics = 1.0", "photo.dynamics: should be less than 1, not 1.0"),
    ("width = 96", "width = 96\nspeeds = [1, 2, 3]", "photo.speeds: has 3 speeds, and there are 2 strokes"),
    ("width = 96", 'width = 96\nspeeds = [1, 2]\nspeed = "assets/stream/mask.png"',
     "photo.speeds: and photo.speed both say how fast it flows: leave out one"),
    ("piece = 16", "piece = 40", "assignment.piece: should be a multiple of 16, not 40"),
])
def test_what_does_not_fit_is_one_line(tmp_path: Path, old: str, new: str, told: str) -> None:
    assert complaint(written(tmp_path, changed(PHOTO, old, new))) == told


def test_the_readmes_example_is_a_whole_scene(tmp_path: Path) -> None:
    text = (PROJECT_SCENES / "README.md").read_text().split("## Scenes of photographs\n")[1]
    example = [line.removeprefix("    ") for line in text.split("\nThe clips are made")[0].splitlines()
               if line.startswith("    ")]
    for name in ("brook.jpg", "water.png"):
        pictures.write(tmp_path / name, np.full((340, 400, 3), 0.5, np.float32))
    library.add(footage.write(tmp_path / "pond.mp4", footage.falling()), tmp_path / "clips")
    one = load(written(tmp_path, 'title = "A brook"\n' + "\n".join(example))).variants[""]
    assert len(one.photo.strokes) == 2
    assert len(one.clips.recipes()) == 65
    assert [file.name for file in one.clips.kept] == ["pond.npz"]


@pytest.mark.parametrize("panel", ["strokes", "orientation"])
def test_panels_of_strokes_need_strokes(tmp_path: Path, panel: str) -> None:
    text = changed(PHOTO, "strokes = [[[490, 28], [487, 64]], [[305, 288], [245, 328]]]\n", "")
    assert complaint(written(tmp_path, changed(text, '["target"', f'["{panel}"'))) == (
        f'photo.strokes: is empty, and the panel "{panel}" shows the strokes')
