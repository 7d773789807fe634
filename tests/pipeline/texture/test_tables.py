"""The tables: defaults as the paper has them, and what the methods take of them."""

import math
from pathlib import Path

import pytest
from tiny import TEXTURE, changed, complaint, scene, written


def test_the_paper_is_the_default_of_its_own_table(tmp_path: Path) -> None:
    settings = scene(tmp_path, TEXTURE).paper.settings()
    assert (settings.n, settings.largest, settings.smallest, settings.D, settings.overblended) == (48, 32, 4, 4, 2.0)
    assert settings.validity == pytest.approx(math.radians(15))


def test_keys_reach_the_methods(tmp_path: Path) -> None:
    text = TEXTURE + "[carry]\nusage = 0.5\nradius = [7, 12]\n[paper]\nrotations = 24\nremove_blur = false\n"
    one = scene(tmp_path, text)
    assert (one.carry.settings().usage, one.carry.settings().radius) == (0.5, (7.0, 12.0))
    assert (one.paper.settings().n, one.paper.settings().remove_blur) == (24, False)


@pytest.mark.parametrize(("old", "new", "told"), [
    ("size = [64, 48]", "size = [64]", "texture.size[1]: is missing"),
    ("size = [64, 48]", "size = [64, 48]\npace = 0", "texture.pace: should be greater than 0"),
    ("panel = 32", "panel = 32\nmoments = [0]", "figure.moments[0]: should be greater than or equal to 1"),
])
def test_what_lies_outside_is_one_line(tmp_path: Path, old: str, new: str, told: str) -> None:
    assert complaint(written(tmp_path, changed(TEXTURE, old, new))).startswith(told)
