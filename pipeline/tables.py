"""What every scene is written in: tables, keys, the types of their values, and the tables that all scenes have.

Units and ranges stand in the keys. scenes/README.md shows all of them (`flowloom schema --write`).
"""

from __future__ import annotations

import importlib.metadata
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, Strict, ValidationInfo

PROJECT_SCENES = Path(__file__).resolve().parent.parent / "scenes"
LARGEST = 4096  # cells or pixels along an axis; a larger number is most likely a typing error


def _inside(name: Path, info: ValidationInfo) -> Path:
    """The existing file `name`: relative, inside the scene's folder, or inside the project's scenes/assets."""
    found = _there(name, info)
    if not found.is_file():
        raise ValueError(f"'{name}' is not a file")
    return found


def _inside_or_folder(name: Path, info: ValidationInfo) -> Path:
    """The same, or a folder there, whose files are links to none outside it."""
    found = _there(name, info)
    if not found.is_dir():
        return _inside(name, info)
    for file in found.iterdir():
        if not file.resolve().is_relative_to(found):
            raise ValueError(f"'{name}/{file.name}' is a link that leaves its folder")
    return found


def _inside_folder(name: Path, info: ValidationInfo) -> Path:
    """The existing folder `name`, as `_inside_or_folder`."""
    found = _inside_or_folder(name, info)
    if not found.is_dir():
        raise ValueError(f"'{name}' is not a folder")
    return found


def _there(name: Path, info: ValidationInfo) -> Path:
    if name.is_absolute() or ".." in name.parts:
        raise ValueError(f"'{name}' leaves the scene's folder; write a path relative to it, without ..")
    folder: Path = info.context["folder"] if info.context else Path()
    for start, home in ((folder, folder), (PROJECT_SCENES, PROJECT_SCENES / "assets")):
        try:
            found = (start / name).resolve()
            if not found.exists():
                continue
        except (OSError, ValueError, RuntimeError) as error:
            raise ValueError(f"'{name}' cannot be a file ({error})") from error
        if not found.is_relative_to(home.resolve()):
            raise ValueError(f"'{name}' is a link that leaves the scene's folder")
        return found
    raise ValueError(f"no file '{name}' in the scene's folder or the project's scenes/assets")


class Table(BaseModel):
    """A table of a scene: unknown keys, other types and NaN or infinity are errors."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


def key(description: str, default: Any = ..., unit: str = "", **limits: Any) -> Any:
    """A key of a table with what scenes/README.md says of it. A default that depends on other keys is a function
    of those before it; its description says what it gives."""
    kind = "default_factory" if callable(default) else "default"
    return Field(**{kind: default}, description=description, json_schema_extra={"unit": unit}, **limits)


Asset = Annotated[Path, Strict(False), AfterValidator(_inside)]
Folder = Annotated[Path, Strict(False), AfterValidator(_inside_folder)]
AssetOrFolder = Annotated[Path, Strict(False), AfterValidator(_inside_or_folder)]


def _odd(width: int) -> int:
    if width % 2 == 0:
        raise ValueError(f"should be odd, not {width}")
    return width


def _several(value: object) -> object:
    return [value] if isinstance(value, int | float) else value


Extent = Annotated[float, Field(gt=0, le=10)]
Radius = Annotated[tuple[Extent, ...], Strict(False), BeforeValidator(
    _several, json_schema_input_type=Extent | Annotated[list[Extent], Field(min_length=1, max_length=3)])]
"""One number, or one for each axis."""


Width = Annotated[int, Field(ge=3, le=33), AfterValidator(_odd)]
Cells = Annotated[int, Field(ge=4, le=LARGEST)]
Share = Annotated[float, Field(gt=0, le=1)]
Vector = Annotated[tuple[Annotated[float, Field(ge=-1000, le=1000)], ...], Strict(False)]


def grid(description: str, default: Any) -> Any:
    """The key `size` of a field: two numbers in the plane, three in space."""
    return key(f"{description}; in 3-D layers (z) too", default, "cells", min_length=2, max_length=3)


Grid = Annotated[tuple[Cells, ...], Strict(False)]


class SceneTables(Table):
    """The scene itself: keys above the first table."""

    title: str = key("what the figure shows", min_length=1, max_length=200)
    source: str = key("the figure it reproduces or what it is made after", "", max_length=200)
    seed: int = key("seed of every random choice", 1, ge=0, le=2**31 - 1)
    frames: int = key("length of the animation", 90, "frames", ge=1, le=100000)
    fps: float = key("speed of the animation", 30, "frames per second", gt=0, le=1000)

    cells_key: ClassVar[str] = ""
    """The key that says the cells."""

    @property
    def cells(self) -> tuple[int, ...]:
        """Of the grid that the scene is synthesized on, x first."""
        raise NotImplementedError

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return len(self.cells)

    @property
    def shape(self) -> tuple[int, ...]:
        """The cells as arrays count them, (Y, X) or (Z, Y, X)."""
        return self.cells[::-1]


class FigureTable(Table):
    """The panels of X.png and X.mp4."""

    labels: Annotated[tuple[str, ...], Strict(False)] = key(
        "below the panels, *italics* between asterisks; none: their usual ones", ())
    columns: int = key("panels in a row; 0: all", 0, ge=0, le=64)
    panel: int = key("width of a panel", 512, "pixels", ge=16, le=LARGEST)
    frame: int = key("the frame the still shows; 0: the last", 0, ge=0, le=100000)
    animation: bool = key("make X.mp4 too; else bake and render the still's frame alone", True)
    webp: bool = key("make X.webp beside X.mp4: the same pictures as animated WebP that repeats without end, which web "
                     "pages show as a picture", False)

    def shown(self, frames: int) -> list[int]:
        """The frames of an animation of so many that the still shows, ascending."""
        return [self.frame or frames]


PROOF_WIDTH, PROOF_SAMPLES = 96, 8


class Look(Table):
    """What is drawn, and how: the base of all [render] tables. A look is one class: its keys, what it draws, its
    pictures."""

    if TYPE_CHECKING:
        width: int

    path_traced: ClassVar[bool] = True
    """Whether Mitsuba renders it."""

    def proof(self) -> Self:
        """The same look for a proof: small, with few paths."""
        width = min(PROOF_WIDTH, self.width)
        small: dict[str, Any] = {"width": width}
        if hasattr(self, "height"):
            small["height"] = round(self.height * width / self.width)
        if hasattr(self, "spp"):
            small["spp"] = PROOF_SAMPLES
        return self.model_copy(update=small)

    def made_with(self) -> dict[str, str]:
        """The versions of what renders it."""
        if not self.path_traced:
            return {name: importlib.metadata.version(name) for name in ("numpy", "scipy")}
        from render import backend

        return {"llvm": "none", **backend.versions("scalar_rgb")}  # a scalar variant does without


class Framed(Table):
    """The keys of a look that a camera frames."""

    width: int = key("width of the picture", 960, "pixels", ge=16, le=LARGEST)
    height: int = key("height of the picture", 540, "pixels", ge=16, le=LARGEST)
    spp: int = key("paths per pixel", 64, ge=1, le=65536)


def listed(size: Sequence[int]) -> str:
    """A size as the user reads it: 96×128×96."""
    return "×".join(map(str, size))
