"""What `flowloom list` shows of a folder of scenes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from pipeline.errors import BadInput
from pipeline.scene import load
from pipeline.tables import PROJECT_SCENES


def project_scenes() -> list[Path]:
    """The project's scenes."""
    return sorted(PROJECT_SCENES.glob("*.toml"))


def lines(folder: Path | None, out: Path) -> Iterator[str]:
    """One line per scene: its name, its source, its title; a star if its figure is in `out`."""
    files = sorted((folder or PROJECT_SCENES).glob("*.toml"))
    if not files:
        raise BadInput(folder or PROJECT_SCENES, "", "holds no scenes")
    width = max(len(file.stem) for file in files)
    for file in files:
        try:
            scene = next(iter(load(file).variants.values()))
            mark = "*" if (out / file.stem / f"{file.stem}.png").exists() else " "
            yield f"{mark} {file.stem:{width}}  {scene.title}" + (f" ({scene.source})" if scene.source else "")
        except BadInput as error:
            yield f"! {file.stem:{width}}  {error}"
