"""A stranger's PLY and OBJ files as they stand, points, lines and polygons, none of them split, merged or turned; and
how their vertices make elements.

What is read of a PLY file (ASCII, or binary of either order): `vertex` x, y, z; `face` vertex_indices; `edge` vertex1,
vertex2. Of an OBJ file: v, l and f. The rest of both is passed over.

All of this runs in a child process (`sandbox`) and raises ValueError with the reason.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field
from itertools import chain, pairwise
from pathlib import Path
from typing import Any

import numpy as np

FORMATS = ("ply", "obj")
LONGEST_HEADER = 1 << 16  # bytes
_TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4",
          "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
          "float32": "f4", "float64": "f8"}


@dataclass(frozen=True)
class Shape:
    """vertices (N, 3) float64; lines and faces, each a sequence of indices of vertices."""

    vertices: np.ndarray
    lines: list[tuple[int, ...]] = field(default_factory=list)
    faces: list[tuple[int, ...]] = field(default_factory=list)


def read(path: Path) -> Shape:
    """The shape in a PLY or OBJ file. Raises ValueError: another format, damaged, an index that is no vertex."""
    kind = path.suffix.lower().removeprefix(".")
    if kind not in FORMATS:
        raise ValueError("is no PLY or OBJ file")
    content = path.read_bytes()
    shape = _ply(content) if kind == "ply" else _obj(content)
    if not len(shape.vertices):
        raise ValueError("holds no vertices")
    for name, parts in (("line", shape.lines), ("face", shape.faces)):
        named = np.fromiter(chain.from_iterable(parts), np.int64)
        if len(named) and (named.min() < 0 or named.max() >= len(shape.vertices)):
            number = next(n for n, part in enumerate(parts, 1) if min(part) < 0 or max(part) >= len(shape.vertices))
            raise ValueError(f"{name} {number} names a vertex that does not exist")
        for number, part in enumerate(parts, 1):
            if len(set(part)) < len(part) - (name == "line" and part[0] == part[-1]):
                raise ValueError(f"{name} {number} names a vertex twice")
    return shape


def _obj(content: bytes) -> Shape:
    vertices: list[list[float]] = []
    parts: dict[bytes, list[tuple[int, ...]]] = {b"l": [], b"f": []}
    for number, line in enumerate(content.replace(b"\r", b"").replace(b"\\\n", b" ").splitlines(), 1):
        word, *rest = line.split() or (b"",)
        try:
            if word == b"v":
                x, y, z = map(float, rest[:3])
                vertices.append([x, y, z])
            elif word in parts and len(rest) > 1:
                told = [int(item.partition(b"/")[0]) for item in rest]
                # counted from 1; from the last one backwards where negative
                parts[word].append(tuple(i - 1 if i > 0 else len(vertices) + i if i else -1 for i in told))
        except ValueError:
            raise ValueError(f"damaged: line {number}") from None
    return Shape(np.array(vertices).reshape(-1, 3), parts[b"l"], parts[b"f"])


Properties = list[tuple[str, str, str]]  # name, type of the value, type of the count (of a list) or nothing


def _ply(content: bytes) -> Shape:
    order, elements, start = _header(content)
    source = _Text(content[start:]) if order == "ascii" else _Bytes(content[start:], order)
    found = {name: _rows(source, count, properties) for name, count, properties in elements}
    vertex = found.get("vertex", {})
    if not {"x", "y", "z"} <= vertex.keys():
        raise ValueError("its vertices have no x, y, z")
    vertices = np.stack([np.asarray(vertex[axis], float) for axis in "xyz"], axis=-1)
    face, edge = found.get("face", {}), found.get("edge", {})
    faces = face.get("vertex_indices", face.get("vertex_index", ()))
    ends = zip(edge.get("vertex1", ()), edge.get("vertex2", ()), strict=True)
    whole = faces.astype(np.int64).tolist() if isinstance(faces, np.ndarray) else (map(int, face) for face in faces)
    return Shape(vertices, [(int(a), int(b)) for a, b in ends], [face for face in map(tuple, whole) if face])


def _header(content: bytes) -> tuple[str, list[tuple[str, int, Properties]], int]:
    """"ascii", "<" or ">"; the elements with their counts and properties; where the data start."""
    head, end, _ = content[:LONGEST_HEADER].partition(b"end_header")
    newline = content.find(b"\n", len(head))
    if not end or newline < 0 or not head.startswith(b"ply"):
        raise ValueError("is no PLY file, or its header is damaged")
    order = ""
    elements: list[tuple[str, int, Properties]] = []
    for line in head.decode("latin-1").splitlines():
        words = line.split()
        match words:
            case ["format", kind, _]:
                order = {"ascii": "ascii", "binary_little_endian": "<", "binary_big_endian": ">"}.get(kind, "")
            case ["element", name, count] if count.isdigit() and len(count) < 12:
                elements.append((name, int(count), []))
            case ["property", "list", counts, kind, name] if elements and kind in _TYPES and counts in _TYPES:
                if _TYPES[counts][0] == "f":
                    raise ValueError(f"damaged: {line.strip()}")
                elements[-1][2].append((name, _TYPES[kind], _TYPES[counts]))
            case ["property", kind, name] if elements and kind in _TYPES:
                elements[-1][2].append((name, _TYPES[kind], ""))
            case ["ply"] | ["comment" | "obj_info", *_] | []:
                pass
            case _:
                raise ValueError(f"damaged: {line.strip()[:60]}")
    if not order:
        raise ValueError("damaged: its header names no format")
    return order, elements, newline + 1


class _Bytes:
    """Rows of records, one after the other, of binary data."""

    def __init__(self, content: bytes, order: str):
        self.content, self.order, self.at = content, order, 0

    def take(self, record: np.dtype, rows: int) -> np.ndarray:
        start, size = self.at, rows * record.itemsize
        if start + size > len(self.content):
            raise ValueError("damaged: cut short")
        self.at += size
        return np.frombuffer(self.content, record.newbyteorder(">" if self.order == ">" else "<"), rows, start)


class _Text:
    """The same of text: one number for each of a record's, whatever its type."""

    def __init__(self, content: bytes):
        try:
            self.numbers = np.array(content.split(), "S").astype(float) if content.strip() else np.zeros(0)
        except ValueError as error:
            raise ValueError(f"damaged: {error}") from None
        self.at = 0

    def take(self, record: np.dtype, rows: int) -> np.ndarray:
        names = record.names or ()
        wide = np.dtype([(name, float, record[name].shape) for name in names])
        start, size = self.at, rows * wide.itemsize // 8
        if start + size > len(self.numbers):
            raise ValueError("damaged: cut short")
        self.at += size
        return self.numbers[start:start + size].view(wide) if size else np.zeros(rows, wide)


def _rows(source: _Bytes | _Text, count: int, properties: Properties) -> dict[str, Any]:
    """The values of `count` rows by the names of their properties; of a list, an array for each row."""
    if not count or not properties:
        return {}
    start, lists = source.at, any(counts for _, _, counts in properties)
    # mostly all rows are as long as the first one
    record, lengths = _record(source, properties)
    source.at = start
    try:
        rows = source.take(record, count)
    except ValueError:
        if not lists:
            raise
    else:
        if all((rows[f"length of {name}"] == length).all() for name, length in lengths.items()):
            return {name: rows[name] for name, _, _ in properties}
    source.at = start
    found: dict[str, list] = {name: [] for name, _, _ in properties}
    for _ in range(count):
        start = source.at
        record, _ = _record(source, properties)
        source.at = start
        row = source.take(record, 1)
        for name in found:
            found[name].append(row[name][0])
    return dict(found)


def _record(source: _Bytes | _Text, properties: Properties) -> tuple[np.dtype, dict[str, int]]:
    """How the next row lies, and the lengths of its lists."""
    items: list[tuple] = []
    lengths: dict[str, int] = {}
    for name, kind, counts in properties:
        if not counts:
            source.take(np.dtype([("value", kind)]), 1)
            items.append((name, kind))
            continue
        length = float(source.take(np.dtype([("value", counts)]), 1)["value"][0])
        if not (0 <= length < 1e9 and length == int(length)):
            raise ValueError(f"damaged: a list of {length:g} values")
        lengths[name] = int(length)
        items += [(f"length of {name}", counts), (name, kind, (int(length),))]
        source.take(np.dtype(items[-1:]), 1)
    return np.dtype(items), lengths


# --- elements ---

def elements(shape: Shape) -> tuple[np.ndarray, tuple[int, ...]]:
    """Which vertices are the samples of which element, (E, S) indices, and how they lie (`Elements.grid`).

    Points   where there are neither lines nor faces, each vertex is an element.
    Threads  each line is an element, from its first vertex to its last. Lines that share ends are joined, as exporters
             write a curve edge by edge; a joined thread starts at the end that comes first in the file.
    Sheets   each connected part is an element, a grid of quads or of quads halved into triangles. Its rows run as the
             file counts the vertices; where that is not row by row, from the corner that comes first, along the side
             whose next vertex comes first.
    Raises ValueError: lines and faces in one file; lines that close or branch; a part that is no grid; elements of
    different numbers of samples. Elements are counted from 1, in the order of their first vertices.
    """
    if shape.lines and shape.faces:
        raise ValueError("holds lines and faces; flowloom reads one kind from a file")
    if not shape.lines and not shape.faces:
        return np.arange(len(shape.vertices))[:, None], ()
    found: list[tuple[list[int], tuple[int, ...]]]
    if shape.lines:
        found = [(thread, (len(thread),)) for thread in _threads(shape.lines)]
    else:
        found = [*(_sheet(number, part, shape.vertices) for number, part in enumerate(_parts(shape.faces), 1))]
    grid = found[0][1]
    for number, (order, other) in enumerate(found, 1):
        if other != grid and other == grid[::-1]:  # the same, read along the other side
            found[number - 1] = ([order[r * other[1] + c] for c in range(other[1]) for r in range(other[0])], grid)
        elif other != grid:
            raise ValueError(f"element {number} has {' x '.join(map(str, other))} samples, element 1 has "
                             f"{' x '.join(map(str, grid))}")
    return np.array([order for order, _ in found]), grid


def _threads(lines: list[tuple[int, ...]]) -> list[list[int]]:
    """The threads that lines make, by their first vertices."""
    used = [v for line in lines for v in line]
    if len(set(used)) == len(used):  # none of them touch
        return sorted((list(line) for line in lines), key=min)
    beside: dict[int, list[int]] = defaultdict(list)
    for line in lines:
        for a, b in pairwise(line):
            beside[a].append(b)
            beside[b].append(a)
    for vertex, others in beside.items():
        if len(others) > 2:
            raise ValueError(f"a thread branches at vertex {vertex + 1}")
    threads, seen = [], set()
    for start in sorted(v for v, others in beside.items() if len(others) == 1):
        if start in seen:
            continue
        thread, before = [start], -1
        while len(ahead := [v for v in beside[thread[-1]] if v != before]) == 1:
            before = thread[-1]
            thread.append(ahead[0])
        seen.update(thread)
        threads.append(thread)
    closed = beside.keys() - seen
    if closed:
        raise ValueError(f"the thread through vertex {min(closed) + 1} is closed; flowloom reads open ones")
    return sorted(threads, key=min)


def _parts(faces: list[tuple[int, ...]]) -> list[list[tuple[int, ...]]]:
    """The faces of each connected part, by its first vertex."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    sides = np.array([(face[0], v) for face in faces for v in face])
    size = int(sides.max()) + 1
    _, label = connected_components(coo_array((np.ones(len(sides)), sides.T), (size, size)), directed=False)
    parts: dict[int, list[tuple[int, ...]]] = defaultdict(list)
    for face in faces:
        parts[label[face[0]]].append(face)
    return sorted(parts.values(), key=lambda part: min(map(min, part)))


def _sheet(number: int, faces: list[tuple[int, ...]], vertices: np.ndarray) -> tuple[list[int], tuple[int, int]]:
    """The vertices of a sheet, row by row, and its rows and columns."""
    if not {len(face) for face in faces} <= {3, 4}:
        raise ValueError(f"element {number}: a sheet that is not a grid: a face of "
                         f"{max(len(face) for face in faces)} vertices")
    order = sorted({v for face in faces for v in face})
    columns = _columns(order, faces)
    if columns:
        return order, (len(order) // columns, columns)
    walked = _walked(_quads(faces, vertices))
    if walked is None:
        raise ValueError(f"element {number}: a sheet that is not a grid: its {len(faces)} faces do not lie in rows and "
                         "columns")
    return [v for row in walked for v in row], (len(walked), len(walked[0]))


def _columns(order: list[int], faces: list[tuple[int, ...]]) -> int:
    """How many columns there are if `order` is row by row, 0 if it is not."""
    local = {v: k for k, v in enumerate(order)}
    triangles = np.array([[local[v] for v in face] for face in faces if len(face) == 3], int).reshape(-1, 3)
    quads = np.array([[local[v] for v in face] for face in faces if len(face) == 4], int).reshape(-1, 4)
    cells = len(triangles) / 2 + len(quads)
    for columns in range(2, len(order) // 2 + 1):
        rows, rest = divmod(len(order), columns)
        if rest or (rows - 1) * (columns - 1) != cells:
            continue
        # per cell: triangles count once, quads twice; the corners of both halves add up to (3, 3), a quad's to (2, 2)
        share, sums = np.zeros(rows * columns), np.zeros((rows * columns, 2))
        fits = True
        for corners in (triangles, quads):
            place = np.stack(np.divmod(corners, columns), axis=-1)
            low = place.min(axis=1, initial=rows * columns)
            within = place - low[:, None]
            fits &= bool((within.max(axis=1, initial=0) == 1).all()) if len(corners) else True
            if corners.shape[1] == 4:  # side by side: each corner differs from the next in one of the two
                fits &= bool((np.abs(np.diff(within, axis=1)).sum(axis=-1) == 1).all())
                within = within * 1.5
            cell = low[:, 0] * columns + low[:, 1]
            if fits:
                np.add.at(share, cell, corners.shape[1] - 2)
                np.add.at(sums, cell, within.sum(axis=1))
        inside = np.zeros((rows, columns), bool)
        inside[:-1, :-1] = True
        if fits and (share == 2 * inside.ravel()).all() and (sums == 3 * inside.ravel()[:, None]).all():
            return columns
    return 0


def _quads(faces: list[tuple[int, ...]], vertices: np.ndarray) -> list[tuple[int, ...]]:
    """The faces, with each two triangles that share their longest side made one quad."""
    quads: list[tuple[int, ...]] = [face for face in faces if len(face) == 4]
    halves: dict[tuple[int, int], int] = {}
    for a, b, c in (face for face in faces if len(face) == 3):
        turns = [(a, b, c), (b, c, a), (c, a, b)]
        p, q, tip = max(turns, key=lambda t: float(np.square(vertices[t[0]] - vertices[t[1]]).sum()))
        side = (min(p, q), max(p, q))
        if side in halves:
            quads.append((p, halves.pop(side), q, tip))
        else:
            halves[side] = tip
    return [] if halves else quads


def _walked(quads: list[tuple[int, ...]]) -> list[list[int]] | None:
    """The rows of vertices of a grid of quads in any order; None if they are no grid."""
    of_side: dict[frozenset[int], list[int]] = defaultdict(list)
    for k, quad in enumerate(quads):
        for j in range(4):
            of_side[frozenset((quad[j], quad[j - 1]))].append(k)
    members: dict[int, set[int]] = defaultdict(set)
    for k, quad in enumerate(quads):
        for v in quad:
            members[v].add(k)
    corners = {v for v, inside in members.items() if len(inside) == 1}
    if len(corners) != 4:
        return None
    rim: dict[int, list[int]] = defaultdict(list)
    for side, inside in of_side.items():
        if len(inside) == 1:
            a, b = side
            rim[a].append(b)
            rim[b].append(a)
    start = min(corners)
    row = [start, min(rim[start])]
    while row[-1] not in corners and len(row) <= len(members):
        row.append(next((v for v in rim[row[-1]] if v != row[-2]), start))
    rows = [row]
    used: set[int] = set()
    while len(used) < len(quads):
        below: list[int] = []
        for a, b in pairwise(rows[-1]):
            free = [k for k in of_side.get(frozenset((a, b)), ()) if k not in used]
            if len(free) != 1:
                return None
            used.add(free[0])
            quad = quads[free[0]]
            at = quad.index(a)
            # round the quad away from b: what is beside a, then what is beside b
            step = 1 if quad[at - 1] == b else -1
            c, d = quad[(at + step) % 4], quad[(at + 2 * step) % 4]
            if below and below[-1] != c:
                return None
            below += [c, d] if not below else [d]
        rows.append(below)
    flat = [v for row in rows for v in row]
    return rows if len(flat) == len(set(flat)) == len(members) else None
