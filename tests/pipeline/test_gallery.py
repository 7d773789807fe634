"""The page of all figures."""

from pathlib import Path

import pytest

from pipeline import gallery
from pipeline.errors import BadInput


def test_it_shows_the_figures_there_are_and_no_others(tmp_path: Path) -> None:
    (tmp_path / "ma09-fig01").mkdir()
    (tmp_path / "ma09-fig01" / "ma09-fig01.png").touch()
    page = gallery.write(tmp_path)
    text = page.read_text()
    assert page == tmp_path / "gallery.html"
    assert 'src="ma09-fig01/ma09-fig01.png"' in text
    assert 'src="ma09-fig01/ma09-fig01.mp4"' in text
    assert "ma09 figure 1" in text
    assert "ma09-fig04" not in text


def test_without_a_figure_it_says_what_to_type(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="make figures"):
        gallery.write(tmp_path)
