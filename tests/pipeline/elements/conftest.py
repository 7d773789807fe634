"""What tests of scenes of elements share: a scene run where the user stands, and the files of tracks it names."""

from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
import pytest
import tiny

from pipeline import cli
from synth.elements.samples import Elements


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def refused(home: Path, capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """refused(text, *whole): the one line that running the scene ends with; nothing but the files `whole` may have
    been written."""

    def run(text: str, *whole: str) -> str:
        file = tiny.written(Path(), text)
        before = set(Path().rglob("*"))
        assert cli.run(["figure", str(file)]) == 2
        err = capsys.readouterr().err
        assert err.count("\n") == 1, err
        new = {path for path in set(Path().rglob("*")) - before if path.is_file()}
        assert {path.name for path in new if ".journal" not in path.parts} == set(whole)
        return err.rstrip()

    return run


@pytest.fixture
def synthesized(home: Path) -> Callable[[str], tuple[Elements, Elements]]:
    """Exemplar and output of a scene."""

    def run(text: str) -> tuple[Elements, Elements]:
        graph = tiny.made(home, text, "synth")
        return graph.read("", "exemplar", 0), graph.read("", "elements", 0)

    return run


class Tables:
    """Files of tracks as text."""

    grid = np.stack(np.meshgrid(np.arange(4.0), np.arange(4.0)), axis=-1).reshape(-1, 2)
    moved = grid + np.arange(6.0)[:, None, None] * [0.1, 0.0]
    """Sixteen points on a grid that move along x over six frames."""

    @staticmethod
    def wide(positions: np.ndarray) -> str:
        """(T, E, D) as a wide table."""
        return "".join(f"{frame}," + ",".join(f"{v:g}" for v in row.ravel()) + "\n"
                       for frame, row in enumerate(positions))

    @staticmethod
    def deep(positions: np.ndarray) -> np.ndarray:
        """Positions of the plane at depth 0."""
        return np.pad(positions, [(0, 0), (0, 0), (0, 1)])

    @staticmethod
    def long(rows: Iterable[tuple[float, ...]], names: str) -> str:
        """Rows as a long table."""
        return names + "\n" + "".join(",".join(map(str, row)) + "\n" for row in rows)

    @classmethod
    def threads(cls, count: int = 3, frames: int = 4, samples: int = 6) -> str:
        """Threads side by side that sway, as a long table."""
        return cls.long([(f, e, s, s, e + round(0.2 * np.sin(f + s), 3), 0) for f in range(frames)
                         for e in range(count) for s in range(samples)], "frame,element,sample,x,y,z")

    @classmethod
    def sheets(cls, count: int = 3, frames: int = 4, rows: int = 4, columns: int = 4,
               lost: tuple[int, ...] = ()) -> str:
        """Sheets above each other that sway, as a long table."""
        found = [(f, e, r, c, c, 3 * e + round(0.2 * np.sin(f + r), 3), r) for f in range(frames)
                 for e in range(count) for r in range(rows) for c in range(columns)]
        return cls.long([row for row in found if row[1:4] != lost], "frame,element,row,column,x,y,z")


@pytest.fixture(scope="session")
def tables() -> type[Tables]:
    """Files of tracks as text; in parameters, lambdas ask it for theirs."""
    return Tables
