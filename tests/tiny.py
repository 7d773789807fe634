"""The tiny scenes of all tests, and what tests do with scenes. Imported as `tiny`."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from pipeline import stages
from pipeline.build.checkpoint import Checkpoint
from pipeline.build.graph import BuildGraph
from pipeline.errors import BadInput
from pipeline.progress import Progress
from pipeline.scene import load

SMOKE = """\
title = "A tiny circle"
source = "a test"
frames = 3
[exemplar]
kind = "circle"
size = 8
[coarse]
kind = "analytic"
flow = "rotation"
size = [8, 8]
[detail]
size = [16, 16]
iterations = 1
neighborhoods = [5]
[combine]
omega = 1.5
[density]
m = 2
scale = 1
[render]
kind = "lit"
width = 32
[figure]
panels = ["input", "coarse", "result"]
panel = 32
"""
"""A scene of motion fields that runs in a second."""
BEADS = """\
title = "Beads that turn"
frames = 3
[exemplar]
kind = "hexagonal-grid"
across = 6
[elements]
size = [32, 32]
spacing = 0.12
[coarse]
kind = "analytic"
flow = "rotation"
size = [16, 16]
[synthesis]
iterations = 2
[render]
kind = "beads"
width = 32
spp = 1
[figure]
panels = ["result"]
panel = 32
"""
FISH = """\
title = "A small school"
frames = 3
[exemplar]
kind = "school"
count = 12
frames = 8
[elements]
size = [16, 16, 16]
spacing = 0.3
[synthesis]
iterations = 1
[render]
kind = "school"
width = 32
height = 24
spp = 1
[figure]
panels = ["result"]
panel = 32
"""
NOODLES = """\
title = "A few noodles"
frames = 3
[exemplar]
kind = "noodles"
style = "jagged"
frames = 4
[elements]
count = 4
[coarse]
kind = "lifted"
[synthesis]
iterations = 1
[render]
kind = "noodles"
width = 32
height = 24
spp = 1
[figure]
panels = ["result"]
panel = 32
"""
PAPER = NOODLES.replace("noodles", "paper").replace("jagged", "folded").replace("lifted", "gust")
QUIET = Progress(quiet=True)


def changed(text: str, old: str, new: str) -> str:
    """`text` with the first `old`, which must be there, replaced."""
    assert old in text
    return text.replace(old, new, 1)


TRACKS = changed(BEADS, 'kind = "hexagonal-grid"\nacross = 6', 'kind = "tracks"\nfile = "FILE"')
"""Elements of the file that replaces FILE."""


RIVER = changed(changed(SMOKE, 'kind = "lit"\nwidth = 32', 'kind = "particles"\nwidth = 32\nspp = 1'), '"input", ', "")
RIVER += '[[obstacles]]\nkind = "ball"\ncentre = [0.0, 0.5]\nradius = 0.2\n[particles]\ncount = 20\n'
VOLUME = changed(changed(SMOKE, 'kind = "lit"\nwidth = 32', 'kind = "volume"\nwidth = 16\nheight = 16\nspp = 1'),
                 "m = 2\n", "m = 2\ndepth = { reach = 0.2 }\nsources = [{ centre = [0.0, 0.5], radius = 0.3 }]\n")
SPACE = SMOKE.replace("frames = 3", "frames = 2").replace("size = [8, 8]", "size = [8, 4, 8]").replace(
    "size = [16, 16]", 'size = [16, 8, 16]\nfacing = "density"').replace('"rotation"', '"constant"').replace(
    '["input", "coarse", "result"]', '["detail-arrows", "result"]').replace(
    'kind = "lit"\nwidth = 32',
    'kind = "seaweed"\nwidth = 32\nheight = 18\nspp = 1\n[blades]\nspacing = 0.4\nwindow = 2')
SPACE = SPACE.replace("m = 2\n", "m = 2\nsources = [{ centre = [0.0, 0.5, 0.0], radius = 0.3 }]\n")
POTENTIAL = changed(changed(SMOKE, "iterations = 1", 'iterations = 1\nsynthesize = "potential"'),
                    '"coarse", "result"', '"detail-divergence", "combined-colour"')
LAGRANGIAN = changed(SMOKE, "iterations = 1", 'iterations = 1\nsamples = "lagrangian"')
TEXTURE = """\
title = "Canes that turn"
frames = 3
[sample]
kind = "canes"
size = 32
[coarse]
kind = "analytic"
flow = "rotation"
size = [16, 16]
[texture]
size = [64, 48]
[figure]
panels = ["sample", "flow", "result"]
panel = 32
"""
TEXTURE = TEXTURE.replace("size = [16, 16]", "size = [16, 12]")
BY_PAPER = changed(TEXTURE, "size = [64, 48]", 'size = [64, 48]\nmethod = "paper"').replace(
    '"flow", "result"', '"holes", "result"').replace("panel = 32", "panel = 32\nmoments = [1, 3]")
LOOP = changed(changed(TEXTURE, "frames = 3", "frames = 6"), "size = [64, 48]",
               "size = [64, 48]\nloop = true\n[carry]\ngrowth = 2")
TINTED = changed(changed(TEXTURE, "size = [64, 48]", "size = [64, 48]\ndivergence_free = true"), "panel = 32",
                 'panel = 32\noverlay = "speed"\nwebp = true')
TEXTURE_ON_SURFACE = """\
title = "Canes round a ring"
seed = 3
frames = 3
[sample]
kind = "canes"
size = 32
[surface]
kind = "torus"
scale = 0.6
field = { kind = "around" }
[texture]
size = [256, 256]
[render]
kind = "ceramic"
width = 32
height = 24
spp = 1
[figure]
panels = ["sample", "result"]
panel = 32
"""
PHOTO = """\
title = "A stream"
frames = 8
[photo]
file = "assets/stream/image.jpg"
matte = "assets/stream/mask.png"
strokes = [[[490, 28], [487, 64]], [[305, 288], [245, 328]]]
width = 96
[clips]
count = 1
families = ["cloud"]
size = [64, 64]
length = 16
[assignment]
piece = 16
candidates = 20
[figure]
panels = ["target", "matte", "motion", "result"]
panel = 32
"""
SCENES = {"smoke": SMOKE, "river": RIVER, "volume": VOLUME, "space": SPACE, "potential": POTENTIAL,
          "lagrangian": LAGRANGIAN, "beads": BEADS, "fish": FISH, "noodles": NOODLES, "paper": PAPER,
          "texture": TEXTURE, "texture by the paper": BY_PAPER, "texture of true speed": TINTED,
          "texture that loops": LOOP, "texture on a surface": TEXTURE_ON_SURFACE,
          "photo": PHOTO}
"""Scenes that together have every stage, every look and every way to synthesize."""


def written(folder: Path, text: str = SMOKE, name: str = "tiny.toml") -> Path:
    """A scene file with `text`."""
    (folder / name).write_text(text)
    return folder / name


def scene(folder: Path, text: str = SMOKE) -> Any:
    """The one scene of a file with `text`."""
    return load(written(folder, text)).variants[""]


def graph(folder: Path, text: str = SMOKE, quick: bool = False) -> BuildGraph:
    """The build graph of a scene with `text`, in folder/out."""
    return stages.graph_of(load(written(folder, text), quick), folder / "out")


def made(folder: Path, text: str = SMOKE, stage: str = "figure", frames: Sequence[int] | None = None) -> BuildGraph:
    """The build graph after running a stage on a scene with `text`."""
    return stages.run(stage, load(written(folder, text)), folder / "out", QUIET, frames)


def contents(root: Path) -> dict[str, bytes]:
    """Every file under `root`, by its path."""
    return {file.relative_to(root).as_posix(): file.read_bytes() for file in sorted(root.rglob("*")) if file.is_file()}


def complaint(file: Path) -> str:
    """The line that loading `file` ends with, without its name."""
    with pytest.raises(BadInput) as caught:
        load(file)
    line = str(caught.value)
    assert line.startswith(f"{file}: ")
    assert "\n" not in line
    return line.removeprefix(f"{file}: ")


class Memory:
    """The inputs of an artifact in memory: values by (name, frame), or by name where it is of no frame.

    `work` is where its checkpoint goes; the key of every frame is the same.
    """

    def __init__(self, work: Path, **files: Any):
        self.files: dict[Any, Any] = dict(files)
        self.asked: list[tuple[str, int]] = []
        self.checkpoint = Checkpoint(work / "state.npz", lambda frame: "key")

    def __contains__(self, name: str) -> bool:
        return any(name in (key, key[0]) for key in self.files)

    def read(self, name: str, frame: int = 0) -> Any:
        self.asked.append((name, frame))
        found = self.files.get((name, frame), self.files.get(name))
        return found[frame - 1] if isinstance(found, list) else found
