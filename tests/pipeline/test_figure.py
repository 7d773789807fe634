"""The figure: how panels are laid out, what they are called, which frame the still shows."""

from pathlib import Path

import numpy as np
import pytest

from pipeline import figure, stages
from pipeline.files import pictures
from pipeline.progress import Progress
from pipeline.scene import load
from render import layout

SCENE = """\
title = "Layout"
frames = 2
[exemplar]
kind = "circle"
size = 8
[coarse]
kind = "analytic"
size = [8, 8]
[detail]
size = [8, 8]
iterations = 1
neighborhoods = [5]
[combine]
omega = 0.0
[render]
kind = "none"
[figure]
panel = 16
"""


def works(folder: Path, panels: str, extra: str = "") -> stages.Works:
    """The works of a scene that shows `panels`, run to the end."""
    file = folder / "tiny.toml"
    file.write_text(f"{SCENE}panels = {panels}\n{extra}")
    stages.run("figure", load(file), folder / "out", Progress(quiet=True))
    return stages.Works(load(file), folder / "out")


@pytest.fixture
def laid(monkeypatch: pytest.MonkeyPatch) -> list[list[list[layout.Panel]]]:
    """The rows of each sheet that is laid out."""
    sheets: list[list[list[layout.Panel]]] = []
    whole = layout.figure

    def noted(rows: list[list[layout.Panel]]) -> np.ndarray:
        sheets.append(rows)
        return whole(rows)

    monkeypatch.setattr(layout, "figure", noted)
    return sheets


def labels(rows: list[list[layout.Panel]]) -> list[list[str]]:
    """The labels of a sheet's panels."""
    return [[panel.label for panel in row] for row in rows]


def test_panels_stand_in_rows_of_so_many_columns(tmp_path: Path, laid: list) -> None:
    works(tmp_path, '["exemplar", "coarse", "detail"]', "columns = 2\n")
    assert labels(laid[0]) == [[figure.LABELS["exemplar"], figure.LABELS["coarse"]], [figure.LABELS["detail"]]]
    assert all(panel.picture.shape[1] == 16 for row in laid[0] for panel in row)


def test_labels_are_the_scenes_own_where_it_has_some(tmp_path: Path, laid: list) -> None:
    works(tmp_path, '["exemplar", "coarse"]', 'labels = ["this", "*that*"]\n')
    assert labels(laid[0]) == [["this", "*that*"]]


TWO = '[variants.a]\n[variants."*b*"]\n"exemplar.kind" = "square"\n'


def test_variants_of_one_panel_stand_side_by_side_under_their_names(tmp_path: Path, laid: list) -> None:
    works(tmp_path, '["detail"]', TWO)
    assert labels(laid[0]) == [["a", "*b*"]]


def test_variants_of_several_panels_have_a_row_each(tmp_path: Path, laid: list) -> None:
    works(tmp_path, '["exemplar", "detail"]', TWO)
    assert labels(laid[0]) == [["a", figure.LABELS["detail"]], ["*b*", figure.LABELS["detail"]]]
    assert not np.array_equal(laid[0][0][0].picture, laid[0][1][0].picture)


def test_the_still_shows_its_frame_and_the_animation_all(tmp_path: Path, laid: list) -> None:
    made = works(tmp_path, '["coarse-colour"]', "frame = 1\n")
    assert len(laid) == 1 + 2
    np.testing.assert_array_equal(np.rint(pictures.read(made.root / "tiny.png") * 255), figure.sheet(made, 1))


def test_too_few_or_too_many_labels_are_refused(tmp_path: Path) -> None:
    from pipeline.errors import BadInput

    with pytest.raises(BadInput, match=r"figure.labels: 1 labels for 2 panels"):
        works(tmp_path, '["exemplar", "coarse"]', 'labels = ["one"]\n')


def test_without_an_animation_only_the_stills_frame_is_made(tmp_path: Path, laid: list) -> None:
    made = works(tmp_path, '["combined"]', "frame = 2\nanimation = false\n")
    assert len(laid) == 1
    assert (made.root / "tiny.png").is_file() and not (made.root / "tiny.mp4").exists()
    assert [file.name for file in sorted((made.root / "geometry").glob("F.*"))] == ["F.0002.exr"]
    assert len(list((made.root / "fields").glob("H.*.exr"))) == 2


def test_an_exemplar_is_no_higher_than_a_result_that_is_wider_than_high() -> None:
    from types import SimpleNamespace

    from pipeline.panels import Shown

    def width(panel: str, **render: int) -> int:
        shown = SimpleNamespace(panels=("exemplar", "coarse", "result"), panel=320)
        return figure._width(SimpleNamespace(figure=shown, render=SimpleNamespace(**render)), Shown(panel))

    wide = {"width": 960, "height": 540}
    assert (width("exemplar", **wide), width("coarse", **wide), width("result", **wide)) == (180, 320, 320)
    assert width("exemplar", width=512, height=640) == 320
    assert width("exemplar", width=512) == 320


def test_a_still_of_its_own_stands_in_the_png_and_not_in_the_animation(tmp_path: Path, laid: list,
                                                                       monkeypatch: pytest.MonkeyPatch) -> None:
    from render import smoke

    def drawn(density: np.ndarray, voxel: float, origin: object, settings: smoke.VolumeSettings) -> np.ndarray:
        return np.full((16, 16, 3), {"path": 0.0, "march": 1.0}[settings.method], np.float32)

    monkeypatch.setattr(smoke, "volume", drawn)
    file = tmp_path / "tiny.toml"
    solid = SCENE.replace("[8, 8]", "[8, 8, 8]").replace('kind = "none"', 'kind = "volume"\nmethod = "both"')
    file.write_text(f'{solid}panels = ["result"]\nframe = 1\n')
    stages.run("figure", load(file), tmp_path / "out", Progress(quiet=True))
    assert [rows[0][0].picture.mean() < 0.5 for rows in laid] == [True, False, False]
    assert sorted(p.name for p in (tmp_path / "out" / "tiny" / "images").glob("*.exr")) == [
        "beauty.0001.exr", "beauty.0002.exr", "still.0001.exr"]
