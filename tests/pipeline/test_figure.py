"""The figure: how panels are laid out, what they are called, which frame the still shows."""

from pathlib import Path

import numpy as np
import pytest
import tiny

from pipeline.build.graph import BuildGraph
from pipeline.errors import BadInput
from pipeline.figure import Figure
from pipeline.files import pictures
from pipeline.motion.panels import LABELS
from render import layout

SCENE = tiny.changed(tiny.changed(tiny.changed(
    tiny.SMOKE, 'kind = "lit"\nwidth = 32', 'kind = "none"'), "panel = 32", "panel = 16"), "frames = 3", "frames = 2")
PANELS = 'panels = ["input", "coarse", "result"]\n'


def figure(folder: Path, panels: str, extra: str = "") -> BuildGraph:
    """The figure of a scene that shows `panels`, made."""
    return tiny.made(folder, tiny.changed(SCENE, PANELS, f"panels = {panels}\n") + extra)


@pytest.fixture
def laid(monkeypatch: pytest.MonkeyPatch) -> list[list[list[layout.Panel]]]:
    """The rows of each sheet that is laid out."""
    sheets: list[list[list[layout.Panel]]] = []
    complete = layout.figure

    def noted(rows: list[list[layout.Panel]]) -> np.ndarray:
        sheets.append(rows)
        return complete(rows)

    monkeypatch.setattr(layout, "figure", noted)
    return sheets


def labels(rows: list[list[layout.Panel]]) -> list[list[str]]:
    """The labels of a sheet's panels."""
    return [[panel.label for panel in row] for row in rows]


def test_panels_stand_in_rows_of_so_many_columns(tmp_path: Path, laid: list) -> None:
    figure(tmp_path, '["exemplar", "coarse", "detail"]', "columns = 2\n")
    assert labels(laid[0]) == [[LABELS["exemplar"], LABELS["coarse"]], [LABELS["detail"]]]
    assert all(panel.picture.shape[1] == 16 for row in laid[0] for panel in row)


def test_labels_are_the_scenes_own_where_it_has_some(tmp_path: Path, laid: list) -> None:
    figure(tmp_path, '["exemplar", "coarse"]', 'labels = ["this", "*that*"]\n')
    assert labels(laid[0]) == [["this", "*that*"]]


TWO = '[variants.a]\n[variants."*b*"]\n"exemplar.kind" = "square"\n'


def test_variants_of_one_panel_stand_side_by_side_under_their_names(tmp_path: Path, laid: list) -> None:
    figure(tmp_path, '["detail"]', TWO)
    assert labels(laid[0]) == [["a", "*b*"]]


def test_variants_of_several_panels_have_a_row_each(tmp_path: Path, laid: list) -> None:
    figure(tmp_path, '["exemplar", "detail"]', TWO)
    assert labels(laid[0]) == [["a", LABELS["detail"]], ["*b*", LABELS["detail"]]]
    assert not np.array_equal(laid[0][0][0].picture, laid[0][1][0].picture)


def test_the_still_shows_its_frame_and_the_animation_all(tmp_path: Path, laid: list) -> None:
    made = figure(tmp_path, '["coarse-colour"]', "frame = 1\n")
    assert len(laid) == 1 + 2
    shown = np.rint(pictures.read(made.root / "tiny.png") * 255)
    np.testing.assert_array_equal(shown, Figure(made).sheet(1, still=True))


def test_a_variant_that_is_shorter_stands_still_at_its_end(tmp_path: Path, laid: list) -> None:
    short = 'frames = 1\n"coarse.flow" = "shear"\n'
    made = figure(tmp_path, '["combined"]', f"[variants.a]\n[variants.b]\n{short}")
    still, *animation = laid
    assert len(animation) == 2 and (Figure(made).frame_of("a", "F", 2), Figure(made).frame_of("b", "F", 2)) == (2, 1)
    for rows in (still, *animation):
        np.testing.assert_array_equal(rows[0][1].picture, animation[0][0][1].picture)


def test_the_figure_is_made_again_where_what_it_shows_changes_and_not_otherwise(tmp_path: Path, laid: list) -> None:
    for extra, sheets in (("", 3), ("", 0), ('labels = ["another"]\n', 3), ("columns = 1\n", 3)):
        laid.clear()
        figure(tmp_path, '["coarse"]', extra)
        assert len(laid) == sheets, extra


def test_an_animated_webp_is_made_beside_the_video_and_removed_with_its_key(tmp_path: Path, laid: list) -> None:
    made = figure(tmp_path, '["coarse"]', "webp = true\n")
    root, files = made.root, {"tiny.png", "tiny.mp4", "tiny.webp"}
    assert len(laid) == 1 + 2 + 2
    assert files <= {file.name for file in root.iterdir()}
    video = (root / "tiny.mp4").stat().st_mtime_ns
    (root / "tiny.webp").unlink()
    laid.clear()
    figure(tmp_path, '["coarse"]', "webp = true\n")
    assert len(laid) == 2 and (root / "tiny.webp").is_file()
    laid.clear()
    figure(tmp_path, '["coarse"]')
    assert not laid and not (root / "tiny.webp").exists() and (root / "tiny.mp4").stat().st_mtime_ns == video


def test_a_webp_without_an_animation_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"figure.webp: there is no animation with figure.animation = false"):
        figure(tmp_path, '["coarse"]', "webp = true\nanimation = false\n")


def test_too_few_or_too_many_labels_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"figure.labels: 1 labels, but 2 panels"):
        figure(tmp_path, '["exemplar", "coarse"]', 'labels = ["one"]\n')


def test_without_an_animation_only_the_stills_frame_is_made(tmp_path: Path, laid: list) -> None:
    made = figure(tmp_path, '["combined"]', "frame = 2\nanimation = false\n")
    assert len(laid) == 1
    assert (made.root / "tiny.png").is_file() and not (made.root / "tiny.mp4").exists()
    assert [file.name for file in sorted((made.root / "geometry").glob("F.*"))] == ["F.0002.exr"]
    assert len(list((made.root / "fields").glob("H.*.exr"))) == 2


def test_a_still_of_its_own_stands_in_the_png_and_not_in_the_animation(tmp_path: Path, laid: list,
                                                                       monkeypatch: pytest.MonkeyPatch) -> None:
    from render import smoke

    def drawn(density: np.ndarray, voxel: float, origin: object, settings: smoke.VolumeSettings) -> np.ndarray:
        return np.full((16, 16, 3), {"path": 0.0, "march": 1.0}[settings.method], np.float32)

    monkeypatch.setattr(smoke, "volume", drawn)
    solid = SCENE.replace("[8, 8]", "[8, 8, 8]").replace("[16, 16]", "[8, 8, 8]")
    solid = tiny.changed(solid, 'kind = "none"', 'kind = "volume"\nmethod = "both"')
    solid = tiny.changed(solid, "scale = 1", "scale = 2")  # else no cell lies in the source
    made = tiny.made(tmp_path, tiny.changed(solid, PANELS, 'panels = ["result"]\nframe = 1\n'))
    assert [rows[0][0].picture.mean() < 0.5 for rows in laid] == [True, False, False]
    assert sorted(p.name for p in (made.root / "images").glob("*.exr")) == [
        "beauty.0001.exr", "beauty.0002.exr", "still.0001.exr"]
