"""Element tracks: our own `.npz` of `Elements`, and the tracks, curves and sheets that a user brings.

What a user may bring (`read_foreign`), in any unit, as it stands; y is up:

    fish.csv          a table, with commas, semicolons (then also decimal commas), tabs or blanks between its cells
                      wide: each row is a frame, its number and then x, y (or x, y, z) of each element; a line of names
                      may stand above it, and a name that starts or ends with z says that there are three
                      long: columns named frame, element, x, y and perhaps z, in any order, one row for each sample;
                      with a column sample the elements are threads, with row and column they are sheets; other
                      columns are passed over
    school/            a folder of one PLY or OBJ file per frame: points, threads or sheets (`polygons.elements` says
                      how); each frame holds the same vertices in the same order
    school.####.ply    the same by a name: # stands for digits, * for anything; the last number of a name is its frame
    school.ply         one frame
    noodles.usdc      OpenUSD (usd, usda, usdc): points, basis curves or meshes that are grids, over its time codes
    noodles.npz       our own

Refused, each in one line with the file, and the element and frame where there is one: fewer elements or frames than are
needed; elements of different numbers of samples; a gap, NaN or a position beyond LARGEST; a frame that is missing,
comes twice or out of order; a sheet that is not a grid; lines that close or branch. Elements of a wide table or a mesh
are counted from 1, those of a long table are called as they are there.
"""

from __future__ import annotations

import csv
import dataclasses
import re
from collections.abc import Iterable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import BadInput
from pipeline.files import arrays, polygons, sandbox, usd
from pipeline.files.format import Format
from synth.elements.samples import Elements

TABLES = ("csv", "tsv", "txt")
LARGEST = 1e9  # of a coordinate
SECONDS, SECONDS_PER_FILE = 60.0, 0.5  # that a sequence may take: far more than it does
_FIELDS = "flowloom_tracks"  # the names of the arrays: a damaged directory of a zip loses entries without a word
_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)(e[+-]?[0-9]+)?|[+-]?(nan|inf|infinity)", re.IGNORECASE)


def write(path: Path, elements: Elements, **beside: np.ndarray) -> None:
    """Write elements as one .npz, an array of each of their fields that is not None, and read it back.

    beside  arrays by other names, of numbers, that lie beside them: `read` passes over them
    numpy.load reads it without pickle. Raises `StorageFailed` if it does not read back.
    """
    fields = {field.name: getattr(elements, field.name) for field in dataclasses.fields(elements)}
    if fields.keys() & beside.keys():
        raise ValueError(f"a field of Elements cannot lie beside them: {', '.join(fields.keys() & beside.keys())}")
    arrays.write(path, {name: np.asarray(value) for name, value in (fields | beside).items() if value is not None},
                 _FIELDS)


def read(path: Path) -> Elements:
    """The elements of a file that `write` made. Raises `BadInput` if it is missing or damaged.

    Reads in this process, for files of our own; others by `read_foreign`.
    """
    if not path.is_file():
        raise BadInput(path, "", "no such file")
    try:
        return _elements(_arrays(path))
    except ValueError as error:
        raise BadInput(path, "", str(error)) from error


def _arrays(path: Path) -> dict[str, Any]:
    """The arrays of a .npz, or ValueError."""
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            found: dict[str, Any] = dict(stored)
    except MemoryError:
        raise
    except Exception as error:  # zipfile and numpy raise anything at a file cut short
        raise ValueError(f"damaged, cut short or no .npz file ({error or type(error).__name__})") from error
    if _FIELDS not in found or "positions" not in found:
        raise ValueError("holds no element tracks of flowloom")
    lost = set(np.ravel(found[_FIELDS]).tolist()) - found.keys()
    if lost:
        raise ValueError(f"damaged: {', '.join(map(str, lost))} is lost")
    return found


def _elements(arrays: dict[str, Any]) -> Elements:
    """Elements of the arrays that name their fields; unknown ones are passed over. ValueError if they do not fit."""
    known = {field.name: arrays[field.name] for field in dataclasses.fields(Elements) if field.name in arrays}
    try:
        known["grid"] = tuple(int(n) for n in np.ravel(known.get("grid", ())))
        known["rate"] = float(np.ravel(known.get("rate", 24.0)).reshape(1)[0])
        return Elements(**known)
    except (TypeError, OverflowError) as error:
        raise ValueError(f"damaged: {error}") from error


# --- a user's own ---

def sources(path: Path, key: str) -> list[Path]:
    """The files that `read_foreign` reads for `path`, in the order of their frames.

    Raises `BadInput(path, key, …)`: no file; names without a number; a frame missing or twice.
    """
    if path.is_dir():
        files = [f for f in path.iterdir() if f.suffix.lower().removeprefix(".") in polygons.FORMATS]
        what = "holds no PLY or OBJ file"
    elif "#" in path.name or "*" in path.name:
        pattern = re.sub(r"(\\#)+", "[0-9]+", re.escape(path.name)).replace(r"\*", ".*")
        inside = path.parent.iterdir() if path.parent.is_dir() else ()
        files = [f for f in inside if re.fullmatch(pattern, f.name)]
        what = "no file has such a name"
    else:
        if not path.is_file():
            raise BadInput(path, key, "no such file")
        return [path]
    if not files:
        raise BadInput(path, key, what)
    numbered: dict[int, Path] = {}
    for file in sorted(files):
        number = re.findall(r"\d+", file.stem)
        if not number:
            raise BadInput(file, key, "has no frame number in its name")
        frame = int(number[-1][-18:])
        if frame in numbered:
            raise BadInput(file, key, f"frame {frame} is there twice, also as {numbered[frame].name}")
        numbered[frame] = file
    _require_all(path, key, sorted(numbered))
    return [numbered[frame] for frame in sorted(numbered)]


def _require_all(path: Path, key: str, frames: list[int]) -> None:
    for one, other in pairwise(frames):
        if other != one + 1:
            raise BadInput(path, key, f"frame {one + 1} is missing")


def read_foreign(path: Path, key: str, *, rate: float | None = None, otherwise: float = 24.0, dimensions: int = 2,
                 prim: str = "/", fewest_elements: int = 2, fewest_frames: int = 1) -> Elements:
    """The elements of a user's file, folder or sequence, see above; read in a child process.

    key         the scene's, for the error
    rate        frames per second; none: what the file says, `otherwise` if it says nothing
    dimensions  2 or 3: of a wide table whose names do not say it
    prim        of a USD file: only what is at or below this path
    Positions are 3-D, but 2-D from a table without z. Raises `BadInput`.
    """
    files = sources(path, key)
    kind = files[0].suffix.lower().removeprefix(".")
    size = sum(file.stat().st_size for file in files)
    if kind in polygons.FORMATS:
        names = [str(file.resolve()) for file in files]
        seconds = SECONDS + SECONDS_PER_FILE * len(files) + size / 1e6
        found = sandbox.read(_sequence, files[0], key, names, seconds=seconds)
    elif len(files) > 1:
        raise BadInput(path, key, "a sequence is of PLY or OBJ files")
    elif kind in TABLES:
        found = sandbox.read(_table, path, key, dimensions, seconds=SECONDS + size / 2e5)
    elif kind in usd.FORMATS:
        found = sandbox.read(_stage, path, key, prim)
    elif kind == "npz":
        found = sandbox.read(_arrays, path, key)
    else:
        formats = ", ".join((*TABLES, *polygons.FORMATS, *usd.FORMATS))
        raise BadInput(path, key, f"is no file of element tracks: {formats} or npz")
    if "fault" in found:
        raise BadInput(found["file"], key, found["fault"])
    try:
        elements = _elements({**found, "rate": rate or found.get("rate", otherwise)})
        if not 0 < elements.rate < 1e5:
            raise ValueError(f"a rate of {elements.rate:g} frames per second")
    except ValueError as error:
        raise BadInput(path, key, str(error)) from error
    if not float(np.abs(elements.positions).max()) <= LARGEST:
        frame, element = np.argwhere(np.abs(elements.positions) > LARGEST)[0][:2] + 1
        raise BadInput(path, key, f"frame {frame}, element {element}: a position beyond {LARGEST:g}")
    if elements.count < fewest_elements:
        raise BadInput(path, key, f"holds {_counted(elements.count, 'element')}; it takes {fewest_elements} or more")
    if elements.frames < fewest_frames:
        raise BadInput(path, key, f"holds {_counted(elements.frames, 'frame')}; it takes {fewest_frames} or more")
    return elements


def _counted(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


# --- meshes; what follows runs in the child ---

def _sequence(path: Path, names: Sequence[str]) -> dict[str, Any]:
    """Positions and grid of one PLY or OBJ file per frame; a fault is told with its file."""
    positions: list[np.ndarray] = []
    first = order = grid = None
    for name in names:
        try:
            shape = polygons.read(Path(name))
            if first is None or order is None:
                first = shape
                order, grid = polygons.elements(shape)
            if len(shape.vertices) != len(first.vertices):
                raise ValueError(f"{len(shape.vertices)} vertices, and {len(first.vertices)} in {Path(names[0]).name}")
            if shape.lines != first.lines or shape.faces != first.faces:
                raise ValueError(f"its vertices are joined otherwise than in {Path(names[0]).name}")
            lost = np.argwhere(~(np.abs(shape.vertices[order]) <= LARGEST))
            if len(lost):
                raise ValueError(f"element {lost[0][0] + 1}: NaN or a position beyond {LARGEST:g}")
            positions.append(shape.vertices[order].astype(np.float32))
        except ValueError as error:
            return {"file": name, "fault": str(error).splitlines()[0]}
    return {"positions": np.stack(positions), "grid": grid}


def _stage(path: Path, prim: str) -> dict[str, Any]:
    """The same of a USD file, and its rate."""
    vertices, lines, faces, rate = usd.geometry(path, prim)
    order, grid = polygons.elements(polygons.Shape(vertices[0], lines, faces))
    return {"positions": vertices[:, order], "grid": grid, "rate": rate}


# --- tables ---

Row = tuple[int, list[str]]  # number of the line in the file, cells


def _table(path: Path, dimensions: int) -> dict[str, Any]:
    """Positions and grid of a wide or a long table."""
    rows = _cells(path.read_bytes())
    names: list[str] = []
    if rows and not _is_number(rows[0][1][0]):
        names = [cell.lower() for cell in rows.pop(0)[1]]
    if not rows:
        raise ValueError("holds no rows of numbers")
    if {"frame", "element"} <= set(names):
        return _long(names, rows)
    if any(name[:1] == "z" or name[-1:] == "z" for name in names[1:]):
        dimensions = 3
    return {"positions": _wide(rows, dimensions)}


def _cells(content: bytes) -> list[Row]:
    """The cells of each line that is not empty."""
    try:
        text = content.decode("utf-16" if content[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(f"is no text (byte {error.start})") from None
    if "\0" in text:
        raise ValueError("is no text (it holds a zero byte)")
    lines = [(number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip(" \t,;")]
    if not lines:
        raise ValueError("is empty")
    between = next((mark for mark in ";\t," if mark in lines[0][1]), None)
    rows = []
    for number, line in lines:
        try:
            cells = line.split() if between is None else next(csv.reader([line], delimiter=between))
        except csv.Error as error:
            raise ValueError(f"line {number}: {error}") from None
        if between == ";":
            cells = [cell.replace(",", ".") for cell in cells]
        rows.append((number, [cell.strip() for cell in cells]))
    return rows


def _is_number(cell: str) -> bool:
    return _NUMBER.fullmatch(cell) is not None


def _whole(cell: str, what: str, line: int) -> int:
    """The whole number in a cell."""
    value = float(cell) if _is_number(cell) else np.nan
    if not (abs(value) < 1e9 and value == int(value)):
        raise ValueError(f"line {line}: {what} is {cell[:20]!r}, no whole number")
    return int(value)


def _coordinate(cell: str, place: str) -> float:
    """The number in a cell; `place` says where it is, if it is none."""
    if not cell or cell.lower() in ("nan", "na", "none", "null", "-"):
        raise ValueError(f"{place}: a gap, no position")
    value = float(cell) if _is_number(cell) else np.nan
    if np.isnan(value):
        raise ValueError(f"{place}: {cell[:20]!r} is no number")
    if abs(value) > LARGEST:
        raise ValueError(f"{place}: a position beyond {LARGEST:g}")
    return value


def _wide(rows: list[Row], dimensions: int) -> np.ndarray:
    """(T, E, 1, D) of rows of a frame and the positions of all elements."""
    width = len(rows[0][1])
    if width < 1 + dimensions or (width - 1) % dimensions:
        raise ValueError(f"line {rows[0][0]}: {_counted(width, 'cell')}; a row is a frame and then "
                         f"{', '.join('xyz'[:dimensions])} of each element")
    positions = np.empty((len(rows), width - 1), np.float64)
    before: int | None = None
    for n, (line, cells) in enumerate(rows):
        frame = _whole(cells[0], "the frame", line)
        _require_next(frame, before, line)
        if len(cells) != width:
            raise ValueError(f"frame {frame} (line {line}): {len(cells) - 1} numbers, and {width - 1} in the first row")
        for k, cell in enumerate(cells[1:]):
            positions[n, k] = _coordinate(cell, f"frame {frame}, element {k // dimensions + 1} (line {line})")
        before = frame
    return positions.reshape(len(rows), -1, 1, dimensions)


def _require_next(frame: int, before: int | None, line: int, of: str = "") -> None:
    if before is None or frame == before + 1:
        return
    if frame == before:
        raise ValueError(f"frame {frame}{of} is there twice (line {line})")
    if frame < before:
        raise ValueError(f"frame {frame}{of} is out of order, after frame {before} (line {line})")
    raise ValueError(f"frame {before + 1}{of} is missing (line {line})")


def _long(names: list[str], rows: list[Row]) -> dict[str, Any]:
    """Positions and grid of rows of one sample each."""
    axes = [axis for axis in "xyz" if axis in names]
    within = [name for name in ("sample", "row", "column") if name in names]
    if axes[:2] != ["x", "y"] or within not in ([], ["sample"], ["row", "column"]):
        raise ValueError("its columns are not frame, element, x, y and perhaps z, sample or row and column, but "
                         + ", ".join(names)[:80])
    wanted = ["frame", "element", *within, *axes]
    if any(names.count(name) > 1 for name in wanted):
        raise ValueError(f"a column is named twice: {', '.join(names)[:80]}")
    columns = [names.index(name) for name in wanted]
    place: dict[tuple[int, ...], dict[int, list[float]]] = {}  # element and sample: frame: position
    last: dict[tuple[int, ...], int] = {}
    for line, cells in rows:
        if len(cells) < len(names):
            raise ValueError(f"line {line}: {_counted(len(cells), 'cell')}, and {len(names)} names")
        picked = [cells[column] for column in columns]
        numbers = [_whole(picked[k], f"the {name}", line) for k, name in enumerate(wanted[:2 + len(within)])]
        frame, sample = numbers[0], tuple(numbers[1:])
        told = f", element {sample[0]}" + "".join(f", {n} {k}" for n, k in zip(within, sample[1:], strict=True))
        _require_next(frame, last.get(sample), line, told)
        last[sample] = frame
        at = f"frame {frame}{told} (line {line})"
        place.setdefault(sample, {})[frame] = [_coordinate(cell, at) for cell in picked[2 + len(within):]]
    order, grid = _samples(place.keys(), within)
    frames = sorted({frame for found in place.values() for frame in (min(found), max(found))})
    for sample, found in place.items():  # each is without gaps between its first and last
        for frame in (frames[0], frames[-1]):
            if frame not in found:
                raise ValueError(f"frame {frame}, element {sample[0]}: a gap, no position")
    positions = np.array([[list(place[s].values()) for s in element] for element in order])
    return {"positions": positions.transpose(2, 0, 1, 3), "grid": grid}


def _samples(found: Iterable[tuple[int, ...]],
             within: Sequence[str]) -> tuple[list[list[tuple[int, ...]]], tuple[int, ...]]:
    """The samples of each element in their order, and the grid."""
    elements: dict[int, list[tuple[int, ...]]] = {}
    for sample in sorted(found):
        elements.setdefault(sample[0], []).append(sample)
    grids: dict[int, tuple[int, ...]] = {}
    for element, samples in elements.items():
        sides = [sorted({sample[k] for sample in samples}) for k in range(1, 1 + len(within))]
        grids[element] = tuple(map(len, sides))
        if len(within) == 2 and len(samples) != len(sides[0]) * len(sides[1]):
            there = set(samples)
            r, c = next((r, c) for r in sides[0] for c in sides[1] if (element, r, c) not in there)
            raise ValueError(f"element {element}: a sheet that is not a grid: row {r}, column {c} is missing")
    first, grid = next(iter(grids.items()))
    if grid == (1,):
        grids, grid = {}, ()  # a thread of one sample is a point
    if len(grid) == 2 and 1 in grid:
        raise ValueError(f"element {first}: a sheet that is not a grid: {grid[0]} x {grid[1]} samples")
    for element, other in grids.items():
        if other != grid:
            raise ValueError(f"element {element} has {' x '.join(map(str, other))} samples, element {first} has "
                             f"{' x '.join(map(str, grid))}")
    return list(elements.values()), grid


def _write_with_energy(path: Path, output: tuple[Elements, np.ndarray]) -> None:
    """Elements, and beside their tracks the array `energy`."""
    write(path, output[0], energy=output[1])


TRACKS = Format("npz", write, read)
OUTPUT = Format("npz", _write_with_energy, read)
"""Written as (elements, energy after each search), read as the elements."""
