"""The tables and keys of a scene: types, ranges, units, defaults, and what each is for.

A key's section (§) is ma09's. scenes/README.md shows all of them; tests/test_schema.py holds it to this file.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, Strict, ValidationInfo

PROJECT_SCENES = Path(__file__).resolve().parent.parent / "scenes"
LARGEST = 4096  # cells or pixels along an axis; beyond it a slip of the keyboard is likelier than a wish


def _inside(name: Path, info: ValidationInfo) -> Path:
    """The existing file `name`: relative, inside the scene's folder, or inside the project's scenes/assets."""
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
        if not found.is_file():
            raise ValueError(f"'{name}' is not a file")
        return found
    raise ValueError(f"no file '{name}' in the scene's folder or the project's scenes/assets")


class Table(BaseModel):
    """A table of a scene: unknown keys, other types and NaN or infinity are errors."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


def key(description: str, default: Any = ..., unit: str = "", **limits: Any) -> Any:
    """A key of a table with what scenes/README.md says of it."""
    return Field(default, description=description, json_schema_extra={"unit": unit}, **limits)


Asset = Annotated[Path, Strict(False), AfterValidator(_inside)]
Cells = Annotated[int, Field(ge=4, le=LARGEST)]
Cells2 = Annotated[tuple[Cells, Cells], Strict(False)]
Share2 = Annotated[tuple[float, float], Strict(False)]


class ProceduralExemplar(Table):
    """An exemplar made by procedure (§4, figures 1, 2, 4 and 9)."""

    kind: Literal["circle", "square", "heart", "stripes", "sinusoid"] = key("the shape its flow lines follow")
    size: int = key("edge; with detail.size it sets the texture scale", 64, "cells", ge=8, le=1024)


class FileExemplar(Table):
    """An exemplar from a file (§4): the curl of a bitmap's grey values, strokes of a drawing along their
    direction, a field (EXR or VDB), or the optical flow of a clip."""

    kind: Literal["bitmap", "drawing", "field", "clip"] = key("what the file holds")
    file: Asset = key("bitmap and drawing: PNG; field: EXR or VDB; clip: a video")
    size: int = key("edge, to which the file is resampled", 64, "cells", ge=8, le=1024)


class SmokeMotion(Table):
    """L by simulation: stable fluids with vorticity confinement (§4: [Fedkiw et al. 2001])."""

    kind: Literal["smoke"] = key("simulated smoke")
    size: Cells2 = key("columns and rows of L", (64, 64), "cells")


class NoiseMotion(Table):
    """L by curl noise (§4, figure 7: [Bridson et al. 2007])."""

    kind: Literal["curl-noise"] = key("the curl of a noise potential")
    size: Cells2 = key("columns and rows of L", (64, 64), "cells")


class AnalyticMotion(Table):
    """L by formula."""

    kind: Literal["analytic"] = key("a formula")
    size: Cells2 = key("columns and rows of L", (64, 64), "cells")


class FileMotion(Table):
    """L from a file."""

    kind: Literal["file"] = key("a field, the same in every frame")
    file: Asset = key("EXR (channels x, y) or VDB (grid vel), world units per second")


class Detail(Table):
    """The synthesis of H (§3.1, 3.3, 3.4, 3.7)."""

    size: Cells2 = key("columns and rows of H and F", (256, 256), "cells")
    levels: Annotated[int, Field(ge=1, le=10)] | Literal["auto"] = key(
        "of the image pyramid; \"auto\" brings the exemplar down to 8 cells", "auto")
    neighborhoods: Annotated[tuple[Annotated[int, Field(ge=3, le=33)], ...], Strict(False)] = key(
        "widths, odd, in the order used (§4: 17² followed by 9²)", (17, 9), "cells", min_length=1, max_length=4)
    iterations: int = key("of search and assignment with each width (§4: 3 to 5)", 4, ge=1, le=50)
    search: Literal["exact", "k-coherence"] = key("exact, or k-coherence (§3.7)", "exact")
    k: int = key("candidates of k-coherence", 4, ge=1, le=32)


class Combine(Table):
    """F = upsample(L) + ω H' (§3.5)."""

    omega: float = key("ω, the length of the exemplar's longest vector in F", ..., "cells per frame", ge=0, le=1000)
    weight: Literal["uniform", "kinetic-energy", "vorticity"] = key("what ω is proportional to in space", "uniform")
    project: bool = key("make F divergence-free (§3.6, incompressibility)", False)


class Source(Table):
    """Where smoke enters, in every frame."""

    centre: Share2 = key("share of the width and height", (0.5, 0.1), "share of the domain")
    radius: float = key("of the disc", 0.1, "share of the height", gt=0, le=1)


class Density(Table):
    """The smoke carried by F (supplement A)."""

    scheme: Literal["windowed", "naive"] = key("pseudocode 4 or 3", "windowed")
    m: int = key("frames of the window (supplement A: 10 to 20)", 16, "frames", ge=1, le=1000)
    scale: int = key("density cells per field cell, each way", 2, ge=1, le=8)
    source: Source = key("where smoke enters", Source())


class FlatRender(Table):
    """2-D smoke: lit in its plane, or ink on white paper."""

    kind: Literal["lit", "ink"] = key("lit by a key light in its plane, or ink on paper")
    width: int = key("of the picture", 1024, "pixels", ge=16, le=LARGEST)


class VolumeRender(Table):
    """A volume path-traced by Mitsuba."""

    kind: Literal["volume"] = key("a volume in a studio")
    width: int = key("of the picture", 1024, "pixels", ge=16, le=LARGEST)
    spp: int = key("samples per pixel", 64, ge=1, le=65536)


class NoRender(Table):
    """No smoke: a figure of fields alone; nothing is baked but F."""

    kind: Literal["none"] = key("fields only")
    width: int = key("of a panel", 1024, "pixels", ge=16, le=LARGEST)


class Figure(Table):
    """The panels of X.png and X.mp4."""

    panels: Annotated[tuple[str, ...], Strict(False)] = key("from left to right", ("result",), min_length=1)
    frame: int = key("the frame the still shows; 0 is the last", 0, ge=0)


class Scene(Table):
    """The scene itself: keys above the first table."""

    title: str = key("what the figure shows", min_length=1, max_length=200)
    source: str = key("the figure it reproduces or what it is made after", "", max_length=200)
    seed: int = key("of every random choice", 1, ge=0, le=2**63 - 1)
    frames: int = key("length of the animation", 90, "frames", ge=1, le=100000)
    fps: float = key("speed of the animation", 30, "frames per second", gt=0, le=1000)
    exemplar: ProceduralExemplar | FileExemplar = Field(discriminator="kind")
    coarse: SmokeMotion | NoiseMotion | AnalyticMotion | FileMotion = Field(discriminator="kind")
    detail: Detail = Detail()
    combine: Combine
    density: Density = Density()
    render: FlatRender | VolumeRender | NoRender = Field(discriminator="kind")
    figure: Figure = Figure()
