"""PLY files: triangle meshes and points in world units, as arrays; users' meshes as voxels. The home of trimesh."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import BadInput, StorageFailed
from pipeline.files import atomic, sandbox
from pipeline.files.format import Format


def write(path: Path, vertices: np.ndarray, faces: np.ndarray, colours: np.ndarray | None = None) -> None:
    """Write vertices (N, 3) float32, world units, and triangles (M, 3) of indices into them, as binary PLY; with
    the vertices' colours (N, 3) uint8, sRGB, if they have any.

    Raises ValueError for other shapes, NaN or infinity, or an index that is no vertex; `StorageFailed` if the
    file does not read back.
    """
    import trimesh

    _require_mesh(vertices, faces)
    if colours is not None and (colours.shape != vertices.shape or colours.dtype != np.uint8):
        raise ValueError(f"colours are (n, 3) uint8 for n vertices, not {colours.dtype} {colours.shape}")
    mesh = trimesh.Trimesh(vertices.astype(np.float32), faces.astype(np.int32), process=False, vertex_colors=colours)
    with atomic.replacing(path) as temporary:
        temporary.write_bytes(mesh.export(file_type="ply", vertex_normal=False))
        try:
            back = _parsed(temporary)
        except Exception as error:  # trimesh raises anything at a file cut short
            raise StorageFailed(path, f"did not read back ({error}); is the disk full?") from error
        written = {"vertices": vertices.astype(np.float32), "faces": faces}
        if colours is not None:
            written["colours"] = colours
        if not all(np.array_equal(back[name], array) for name, array in written.items()):
            raise StorageFailed(path, "did not read back as it was written; is the disk full?")


def write_points(path: Path, position: np.ndarray, attributes: Mapping[str, np.ndarray]) -> None:
    """Write points (N, 3) float32, world units, each with attributes (N,) float32 or int32, as binary PLY.

    Raises ValueError for other shapes, NaN or infinity; `StorageFailed` if the file does not read back.
    """
    import trimesh

    for name, values in {"positions": position, **attributes}.items():
        if len(values) != len(position) or not len(values) or not np.isfinite(values).all():
            raise ValueError(f"{name} of points are finite and as many as these, {len(position)}; not {values.shape}")
    cloud = trimesh.Trimesh(position, process=False, vertex_attributes=dict(attributes))
    with atomic.replacing(path) as temporary:
        temporary.write_bytes(cloud.export(file_type="ply", vertex_normal=False))
        try:
            back = read_points(temporary)
        except BadInput as error:
            raise StorageFailed(path, f"did not read back ({error.reason}); is the disk full?") from error
        written = {"position": position, **attributes}
        if not all(np.array_equal(back[name], values) for name, values in written.items()):
            raise StorageFailed(path, "did not read back as it was written; is the disk full?")


def write_surface(path: Path, vertices: np.ndarray, faces: np.ndarray, attributes: Mapping[str, np.ndarray]) -> None:
    """Write vertices (N, 3) float32, world units, each with attributes (N,) float32 or int32, and triangles (M, 3), as
    binary PLY. Programs know `s` and `t` as places in a texture and `nx`, `ny`, `nz` as normals.

    Raises ValueError for other shapes, NaN or infinity; `StorageFailed` if the file does not read back.
    """
    import trimesh

    _require_mesh(vertices, faces)
    for name, values in attributes.items():
        if values.shape != (len(vertices),) or not np.isfinite(values).all():
            raise ValueError(f"{name} of vertices are finite and as many as these, {len(vertices)}; not {values.shape}")
    mesh = trimesh.Trimesh(vertices, faces, process=False, vertex_attributes=dict(attributes))
    with atomic.replacing(path) as temporary:
        temporary.write_bytes(mesh.export(file_type="ply", vertex_normal=False))
        try:
            back = read_surface_file(temporary)
        except BadInput as error:
            raise StorageFailed(path, f"did not read back ({error.reason}); is the disk full?") from error
        written = {"vertices": vertices, "faces": faces, **attributes}
        if not all(np.array_equal(back[name], values) for name, values in written.items()):
            raise StorageFailed(path, "did not read back as it was written; is the disk full?")


def read_surface_file(path: Path) -> dict[str, np.ndarray]:
    """What `write_surface` wrote: "vertices" (N, 3) float32, "faces" (M, 3) int32, and the attributes by their names.

    Reads in this process, for files of our own. Raises `BadInput` if it is missing or damaged.
    """
    try:
        vertices, faces, attributes = _triangles(path, "ply")
    except (ValueError, OSError) as error:
        raise BadInput(path, "", str(error)) from error
    kept = {name: values for name, values in attributes.items() if name not in "xyz"}
    return {"vertices": vertices.astype(np.float32), "faces": faces.astype(np.int32), **kept}


def read_points(path: Path) -> dict[str, np.ndarray]:
    """What `write_points` wrote: "position" (N, 3) float32, and the attributes by their names.

    Reads in this process, for files of our own. Raises `BadInput` if it is missing or damaged.
    """
    import trimesh

    try:
        with path.open("rb") as file:
            stored = trimesh.load(file, file_type="ply", process=False).metadata["_ply_raw"]["vertex"]["data"]
    except Exception as error:  # trimesh raises anything at a file cut short
        raise BadInput(path, "", f"damaged: {error}") from error
    found = {name: np.ascontiguousarray(stored[name]) for name in stored.dtype.names}
    return {"position": np.stack([found.pop(axis) for axis in "xyz"], axis=-1), **found}


def _require_mesh(vertices: np.ndarray, faces: np.ndarray) -> None:
    for name, array in (("vertices", vertices), ("faces", faces)):
        if array.ndim != 2 or array.shape[1] != 3 or not len(array):
            raise ValueError(f"{name} have shape (n, 3) with n > 0, not {array.shape}")
    if not np.isfinite(vertices).all():
        raise ValueError("the vertices hold NaN or infinity")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise ValueError(f"a face names a vertex that does not exist (0 to {len(vertices) - 1})")


def _parsed(path: Path) -> dict[str, Any]:
    import trimesh

    with path.open("rb") as file:
        mesh = trimesh.load_mesh(file, file_type="ply", process=False)
    found = {"vertices": np.asarray(mesh.vertices, np.float32), "faces": np.asarray(mesh.faces, np.int32)}
    if mesh.visual.kind == "vertex":
        found["colours"] = np.asarray(mesh.visual.vertex_colors)[:, :3]
    return found


def read_own(path: Path) -> dict[str, np.ndarray]:
    """The arrays of a file that `write` wrote, by the names of its arguments; its checksum vouches for it."""
    return _parsed(path)


def read(path: Path, key: str) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (N, 3) float32 and triangles (M, 3) int32 of a user's PLY file, read in a child process.

    `key` is the scene's, for the error. Raises `BadInput` if the file is missing or damaged or holds no mesh.
    """
    found = sandbox.read(_parsed, path, key)
    try:
        _require_mesh(found["vertices"], found["faces"])
    except ValueError as error:
        raise BadInput(path, key, str(error)) from error
    return found["vertices"], found["faces"]


def read_surface(path: Path, key: str, names: Sequence[str], names_key: str,
                 ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices (N, 3) float64, triangles (M, 3) int64 and vectors (N, 3) float64 of a user's PLY, OBJ, STL or USD mesh,
    read in a child process; y is upwards, vertices at one place are one.

    names  of the vectors: three properties of a PLY file, one primvar of a USD file; none: the vectors are zero
    `key` and `names_key` are the scene's, for errors. Raises `BadInput` if the file is missing or damaged, holds no
    mesh, or no such vectors.
    """
    found = sandbox.read(_surface, path, key, list(names))
    if found["told"]:
        raise BadInput(path, names_key, found["told"])
    return found["vertices"], found["faces"], found["vectors"]


def _surface(path: Path, names: list[str]) -> dict[str, Any]:
    """Runs in the child: see `read_surface`."""
    from pipeline.files import usd

    kind = path.suffix.lower().removeprefix(".")
    vectors: np.ndarray | None = None
    if kind in usd.FORMATS:
        vertices, faces, vectors = usd.surface(path, names[0] if len(names) == 1 else "")
        told = f"its meshes have no primvar {names[0]}" if len(names) == 1 else "is one name in a USD file, a primvar's"
    elif kind in FORMATS:
        vertices, faces, attributes = _triangles(path, kind)
        if len(names) == 3 and set(names) <= attributes.keys():
            vectors = np.stack([attributes[name].astype(np.float64) for name in names], axis=-1)
        told = f"its vertices have no {', '.join(names)}" + (f", but {', '.join(attributes)}" if attributes else "")
    else:
        raise ValueError(f"is no {', '.join(FORMATS).upper()} or USD file")
    if not np.isfinite(vertices).all():
        raise ValueError("the vertices hold NaN or infinity")
    if names and vectors is None:
        return {"told": told}
    return {"told": "", **_welded(vertices, faces, np.zeros(vertices.shape) if vectors is None else vectors)}


def _triangles(path: Path, kind: str) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """Vertices (N, 3), triangles (M, 3) and, of a PLY file, the attributes (N,) of its vertices.

    Not by `trimesh.load_mesh`, which needs a library of pictures where vertices have places in a texture. Raises
    ValueError where there is no triangle.
    """
    from trimesh import geometry
    from trimesh.exchange import obj, ply, stl

    attributes: dict[str, np.ndarray] = {}
    try:
        with path.open("rb") as file:
            if kind == "obj":
                parts = list(obj.load_obj(file, skip_materials=True)["geometry"].values())
            elif kind == "stl":
                parts = [stl.load_stl(file)]
            else:
                parts = [ply.load_ply(file, fix_texture=False, skip_materials=True)]
                raw = parts[0]["metadata"]["_ply_raw"].get("vertex", {}).get("data", {})
                names = getattr(getattr(raw, "dtype", None), "names", None) or tuple(raw)
                attributes = {name: np.asarray(raw[name]).ravel() for name in names}
    except Exception as error:  # trimesh raises anything at a file cut short
        raise ValueError(f"damaged: {error}") from error
    parts = [part for part in parts if len(part.get("vertices", ())) and len(part.get("faces", ()))]
    if not parts:
        raise ValueError("holds no mesh")
    starts = np.cumsum([0, *(len(part["vertices"]) for part in parts)])
    faces = [geometry.triangulate_quads(part["faces"]) + start for part, start in zip(parts, starts, strict=False)]
    return np.concatenate([part["vertices"] for part in parts]), np.concatenate(faces), attributes


def _welded(vertices: np.ndarray, faces: np.ndarray, vectors: np.ndarray) -> dict[str, np.ndarray]:
    """The mesh with one vertex at a place, whose vector is the mean, without triangles that are none any more."""
    # + 0.0: -0 and 0 are one place
    places, which, count = np.unique(vertices.astype(np.float64) + 0.0, axis=0, return_inverse=True, return_counts=True)
    which = which.ravel()
    sums = [np.bincount(which, along, len(places)) for along in vectors.T.astype(np.float64)]
    faces = which[faces.astype(np.int64)]
    whole = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    if not whole.any():
        raise ValueError("its triangles have no area")
    return {"vertices": places, "faces": faces[whole], "vectors": np.stack(sums, -1) / count[:, None]}


FORMATS = ("ply", "obj", "stl")
MOST_VOXELS = 320**3
SECONDS = 120.0  # to fill them


def read_solid(path: Path, key: str, pitch: float, centre: Sequence[float] | None = None,
               height: float | None = None) -> tuple[np.ndarray, tuple[float, ...]]:
    """The voxels that a user's PLY, OBJ or STL mesh fills, read in a child process: (Z, Y, X) bool, and where the
    first one's centre lies, world units.

    pitch   edge of a voxel
    centre  (x, y, z) where the middle of its bounding box is moved to; none: where it is
    height  of its bounding box, to which it is scaled; none: as it is
    A mesh that is not watertight is repaired. `key` is the scene's, for the error. Raises `BadInput` if the file is
    missing or damaged, holds no mesh or one that encloses nothing, or would fill more than MOST_VOXELS voxels.
    """
    found = sandbox.read(_voxels, path, key, pitch, centre, height, seconds=SECONDS)
    return found["voxels"].astype(bool), tuple(found["origin"])


def _voxels(path: Path, pitch: float, centre: Sequence[float] | None, height: float | None) -> dict[str, Any]:
    """Runs in the child: see `read_solid`."""
    import trimesh

    from pipeline.files import mesh_repair

    kind = path.suffix.lower().removeprefix(".")
    if kind not in FORMATS:
        raise ValueError(f"is no {', '.join(FORMATS[:-1]).upper()} or {FORMATS[-1].upper()} file")
    vertices, faces, _ = _triangles(path, kind)
    _require_mesh(vertices, faces)
    mesh = trimesh.Trimesh(vertices, faces)
    if not mesh.is_watertight:
        mesh = trimesh.Trimesh(*mesh_repair.closed(mesh.vertices, mesh.faces))
    volume = float(np.abs(np.einsum("ij,ij->i", *_corners(mesh)).sum())) / 6 if len(mesh.faces) > 3 else 0.0
    if not mesh.is_watertight or not volume > 1e-9 * float(np.prod(mesh.extents)):
        raise ValueError("is not watertight and cannot be repaired: it encloses nothing")
    scale = height / mesh.extents[1] if height else 1.0
    middle = mesh.bounds.mean(axis=0)
    mesh.apply_translation(-middle)
    mesh.apply_scale(scale)
    mesh.apply_translation(middle if centre is None else centre)
    voxels = float(np.prod(mesh.extents / pitch + 2))
    if voxels > MOST_VOXELS:
        size = " x ".join(f"{e:.3g}" for e in mesh.extents)
        raise ValueError(f"is {size} world units large, {voxels:.2g} voxels; give it a height")
    filled = mesh.voxelized(pitch).fill()
    # trimesh counts voxels along x, y, z
    return {"voxels": np.ascontiguousarray(filled.matrix.transpose(2, 1, 0)).astype(np.uint8),
            "origin": [float(o) for o in filled.transform[:3, 3]]}


def _corners(mesh: Any) -> tuple[np.ndarray, np.ndarray]:
    """First corners of the triangles, and the cross products of the two others: for the volume."""
    a, b, c = mesh.triangles.transpose(1, 0, 2)
    return a, np.cross(b, c)


Mesh = dict[str, np.ndarray]
"""A mesh by the names of the arguments of `write`; points by "position" and the names of their attributes."""


def _write_mesh(path: Path, mesh: Mesh) -> None:
    write(path, **mesh)


def _write_points(path: Path, points: Mesh) -> None:
    write_points(path, points["position"], {name: values for name, values in points.items() if name != "position"})


def _write_surface(path: Path, mesh: Mesh) -> None:
    attributes = {name: values for name, values in mesh.items() if name not in ("vertices", "faces")}
    write_surface(path, mesh["vertices"], mesh["faces"], attributes)


MESH = Format("ply", _write_mesh, read_own)
SURFACE = Format("ply", _write_surface, read_surface_file)
POINTS = Format("ply", _write_points, read_points)
