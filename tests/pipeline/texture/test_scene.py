"""Scenes of moving textures: one line for what does not fit together."""

from pathlib import Path

import numpy as np
import pytest
from tiny import TEXTURE, changed, complaint, written

from pipeline.files import pictures
from pipeline.scene import load
from pipeline.tables import PROJECT_SCENES


def test_a_table_texture_makes_it_a_scene_of_them(tmp_path: Path) -> None:
    loaded = load(written(tmp_path, TEXTURE))
    one = loaded.variants[""]
    assert loaded.method.name == "wang05"
    assert (one.dimension, one.shape, one.texture.method, one.seed) == (2, (48, 64), "carry", 1)


@pytest.mark.parametrize(("old", "new", "told"), [
    ("size = 32\n", "size = 64\n", "sample.size: a sample of 64² is larger than the picture (64×48)"),
    ("size = [64, 48]", "size = [64, 48]\nslowest = 3.0", "texture.slowest: is above texture.fastest, 2.2"),
    ("size = [64, 48]", "size = [64, 48]\n[carry]\nradius = [9, 7]", "carry.radius: has its least after its largest"),
    ("size = [64, 48]", "size = [64, 48]\n[paper]\nsmallest = 40", "paper.smallest: is above paper.largest, 32"),
    ("size = [64, 48]", "size = [64, 64]", "texture.size: 64×64 has not the shape of coarse.size, 16×12"),
    ('"flow", "result"', '"holes", "result"', 'figure.panels: there are no "holes" with texture.method = "carry"'),
    ("size = [64, 48]", 'size = [64, 48]\nmethod = "paper"\nloop = true',
     'texture.loop: is of patches: there are none with method = "paper"'),
    ("size = [64, 48]", "size = [64, 48]\nloop = true",
     "frames: a loop of 3 is too short: patches that grow for 12 frames (carry.growth) need 36"),
    ("panel = 32", "panel = 32\nmoments = [4]", "figure.moments[0]: the animation has 3 frames"),
    ('[coarse]\nkind = "analytic"\nflow = "rotation"\nsize = [16, 12]\n', "",
     "coarse: is missing; so is [surface], the other ground of a texture"),
    ('"canes"', '"cane"', "sample.kind: unknown kind 'cane'; did you mean canes?"),
    ("[texture]", "[texture]\nmethod = \"papr\"", "texture.method: 'papr' is not one of them; did you mean paper?"),
])
def test_what_does_not_fit_is_one_line(tmp_path: Path, old: str, new: str, told: str) -> None:
    assert complaint(written(tmp_path, changed(TEXTURE, old, new))) == told


def test_the_readmes_example_is_a_whole_scene(tmp_path: Path) -> None:
    text = (PROJECT_SCENES / "README.md").read_text().split("## Scenes of moving textures\n")[1].split("\n## ")[0]
    lines = [line.removeprefix("    ") for line in text.splitlines() if line.startswith("    ")]
    example, surface = lines[:lines.index("[surface]")], lines[lines.index("[surface]"):]
    pictures.write(tmp_path / "bark.png", np.random.default_rng(1).random((80, 80, 3)))
    one = load(written(tmp_path, 'title = "Bark"\n' + "\n".join(example))).variants[""]
    assert (one.sample.kind, one.coarse.kind, one.texture.size) == ("picture", "analytic", (512, 512))
    (tmp_path / "jug.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    start, end = example.index("[coarse]"), example.index("[texture]")
    both = example[:start] + surface + example[end:]
    one = load(written(tmp_path, 'title = "Bark"\n' + "\n".join(both))).variants[""]
    assert (one.coarse, one.surface.kind, one.surface.field.rise) == (None, "file", 0.25)
