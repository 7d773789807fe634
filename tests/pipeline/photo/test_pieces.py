"""Panels of pieces of clips: what is stored of each, and that each panel shows its own."""

from pathlib import Path
from typing import get_args

import numpy as np
import pytest
import tiny
from tiny import PHOTO, changed

from pipeline.build.graph import BuildGraph
from pipeline.photo.panels import panels
from pipeline.photo.pieces import piece_artifacts
from pipeline.photo.tables import OfPiece
from render import tonemap

NAMES = ", ".join(f'"{name}"' for name in get_args(OfPiece))
PIECES = changed(PHOTO, '["target", "matte", "motion", "result"]\npanel = 32',
                 f"[{NAMES}]\npanel = 64\nanimation = false\n"
                 'pieces = [["cloud-01", 0.5, 0.75], ["cloud-01", 0.25, 0.9]]')


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> BuildGraph:
    return tiny.made(tmp_path_factory.mktemp("photo"), PIECES, "render")


def test_a_piece_is_of_its_clip_and_place(made: BuildGraph) -> None:
    luma, piece = made.read("", "clip-cloud-01", 0)["luma"], made.read("", "piece-1", 0)
    np.testing.assert_array_equal(piece["corner"], [8, 24])  # round a quarter of 64 from below
    np.testing.assert_array_equal(piece["frames"], luma[:, 8:24, 24:40])
    np.testing.assert_array_equal(piece["clip"], luma[0])
    np.testing.assert_array_equal(made.read("", "piece-2", 0)["corner"], [0, 8])


def test_every_panel_has_its_picture_and_none_shows_the_other_piece(made: BuildGraph) -> None:
    found = {panel.artifact: made.read("", panel.artifact, 0) for panel in panels(made.variants[""])}
    assert len(found) == 2 * (len(get_args(OfPiece)) + 3)  # textureness has four levels
    for name, picture in found.items():
        assert picture.shape[1] == (96 if name.startswith("spectrum") else 64)
        if "-1" in name and not name.startswith("significant"):
            assert not np.array_equal(picture, found[name.replace("-1", "-2", 1)]), name


def test_a_difference_is_about_mid_grey_and_an_average_is_the_mean(made: BuildGraph) -> None:
    piece = made.read("", "piece-1", 0)
    average = tonemap.to_srgb(made.read("", "average-1-picture", 0))[..., 0]
    assert average.mean() * 255 == pytest.approx(piece["frames"].mean(), abs=1.5)
    difference = tonemap.to_srgb(made.read("", "difference-1-picture", 0))[..., 0]
    expected = (piece["frames"][0] - piece["average"]).mean()
    assert (difference.mean() - 0.5) * 220 == pytest.approx(expected, abs=1.5)


def test_textureness_of_all_pieces_has_one_scale(made: BuildGraph) -> None:
    stored = [made.read("", f"piece-{k}", 0)["texture"] for k in (1, 2)]
    most = max(values.max() for values in stored)
    for k, values in enumerate(stored, start=1):
        for level in range(4):
            shown = tonemap.to_srgb(made.read("", f"textureness-{k}-{level}-picture", 0))[..., 0]
            np.testing.assert_allclose(shown[::-1][8::16, 8::16], values[..., level] / most, atol=3e-3)


def test_a_figure_without_such_panels_needs_none(tmp_path: Path) -> None:
    text = changed(PHOTO, "panel = 32", 'panel = 32\npieces = [["cloud-01", 0.5, 0.5]]')
    assert piece_artifacts(tiny.scene(tmp_path, text)) == ()
