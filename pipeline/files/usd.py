"""OpenUSD files: one `.usdc` of a whole animation, for Blender, Houdini and usdview. The home of pxr.

    /world           y up, one unit is one metre unless it is told otherwise, frame n at time code n
    /world/samples   the elements' samples: Points, BasisCurves or one Mesh of all sheets, with widths, displayColor and
                     the primvar `kind`; a guide where there are surfaces, which show the same
    /world/<name>    surfaces of the elements, a Mesh each, as many as are given

What moves is sampled at each frame, with its extent; what stays the same is stored once. Colours are sRGB in our arrays
and linear in the file, as USD has it. The same elements and surfaces give the same bytes.

Written frame by frame: what is in memory is PENDING bytes and the frame at hand. Not written: materials, normals (the
surfaces are smooth only as far as a program smooths them), velocities.
"""

from __future__ import annotations

import contextlib
import hashlib
import re
from collections.abc import Callable, Iterator, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from pipeline.errors import StorageFailed
from pipeline.files import atomic
from pipeline.files.format import Format
from synth.elements.samples import Elements

FORMATS = ("usdc", "usda", "usd")
PENDING = 32 << 20  # bytes of frames that are held before they go to the file
MOST_FRAMES = 100_000
NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


class Surface(Protocol):
    """A mesh of one frame: vertices (N, 3) float32, world units; faces (M, 3) or (M, 4) int32, counter-clockwise seen
    from outside; colours (N, 3) uint8, sRGB. Such as `synth.elements.mesh.Mesh`."""

    @property
    def vertices(self) -> np.ndarray: ...
    @property
    def faces(self) -> np.ndarray: ...
    @property
    def colours(self) -> np.ndarray: ...


def write(path: Path, elements: Elements, surfaces: Callable[[int], Mapping[str, Surface]] | None = None, *,
          metres: float = 1.0) -> None:
    """Write the animation of `elements` to `path`, a .usdc, read it back and compare, then rename it into place.

    surfaces  frame n, from 1, to the meshes of that frame by their names, the same names in each; called once a frame
    metres    in one world unit
    Raises ValueError: a name that is none in USD, or `samples`, other names in a later frame, a mesh with NaN or an
    index that is no vertex; `StorageFailed` if the file does not read back.
    """
    with atomic.replacing(path) as temporary:
        with _failing_as_storage(path):
            stage = _Stage(temporary, elements, metres, guide=surfaces is not None)
        names: set[str] = set()
        for frame in range(1, elements.frames + 1):
            found = surfaces(frame) if surfaces else {}
            if frame == 1:
                names = set(found)
            if set(found) != names:
                raise ValueError(f"frame {frame} has surfaces {sorted(found)}, frame 1 has {sorted(names)}")
            for name, surface in found.items():
                _require_surface(name, frame, surface)
            with _failing_as_storage(path):
                stage.add(frame, elements.positions[frame - 1], found)
        with _failing_as_storage(path):
            stage.save()
            fault = stage.difference(temporary)
        if fault:
            raise StorageFailed(path, f"{fault} did not read back as it was written; is the disk full?")


@contextlib.contextmanager
def _failing_as_storage(path: Path) -> Iterator[None]:
    """What USD reports while a sound scene is written is the file system's; a full disk it mostly does not report."""
    from pxr import Tf

    try:
        yield
    except Tf.ErrorException as error:
        reason = str(error).strip().splitlines()[-1].rpartition(": ")[2].strip("' ")
        raise StorageFailed(path, f"OpenUSD: {reason}; is the disk full?") from error


def _require_surface(name: str, frame: int, surface: Surface) -> None:
    if not NAME.fullmatch(name) or name == "samples":
        raise ValueError(f"{name!r} is no name of a surface")
    vertices, faces, colours = surface.vertices, surface.faces, surface.colours
    if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] not in (3, 4):
        raise ValueError(f"frame {frame}, {name}: vertices are (n, 3) and faces (m, 3 or 4), not {vertices.shape} and "
                         f"{faces.shape}")
    if colours.shape != vertices.shape or colours.dtype != np.uint8:
        raise ValueError(f"frame {frame}, {name}: colours are (n, 3) uint8 for n vertices, not {colours.dtype} "
                         f"{colours.shape}")
    if not len(vertices) or not len(faces) or not np.isfinite(vertices).all():
        raise ValueError(f"frame {frame}, {name}: no vertices or faces, NaN or infinity")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise ValueError(f"frame {frame}, {name}: a face names a vertex that does not exist")


def linear(colours: np.ndarray) -> np.ndarray:
    """sRGB in 0..1, or 0..255 as uint8, as linear Rec.709 float32."""
    from render import tonemap

    scale = 255 if colours.dtype == np.uint8 else 1
    return tonemap.from_srgb(np.asarray(colours, np.float64) / scale).astype(np.float32)


class _Stage:
    """A USD file in the making. What has been set is in the file's layer, and its digest in `digests`."""

    def __init__(self, file: Path, elements: Elements, metres: float, guide: bool):
        from pxr import Sdf, Tf, Usd, UsdGeom

        # by its format: the temporary's name says nothing of it
        self.layer = Sdf.Layer.New(Sdf.FileFormat.FindById("usdc"), str(file))
        if not self.layer:
            raise Tf.ErrorException("the file could not be made")
        self.stage = Usd.Stage.Open(self.layer)
        self.digests: dict[tuple[str, int], bytes] = {}  # attribute and frame, 0 for always
        self.constant: dict[str, np.ndarray] = {}  # what each attribute is unless a frame says otherwise
        self.pending = 0
        UsdGeom.SetStageUpAxis(self.stage, UsdGeom.Tokens.y)
        UsdGeom.SetStageMetersPerUnit(self.stage, metres)
        self.stage.SetTimeCodesPerSecond(elements.rate)
        self.stage.SetFramesPerSecond(elements.rate)
        self.stage.SetStartTimeCode(1)
        self.stage.SetEndTimeCode(elements.frames)
        world = UsdGeom.Xform.Define(self.stage, "/world")
        self.stage.SetDefaultPrim(world.GetPrim())
        self.reach = elements.size[:, None] * (1.0 if elements.topology != "sheet" else 0.5)
        self.grid = elements.grid
        self.samples = self._samples(elements)
        if guide:
            self.samples.CreatePurposeAttr(UsdGeom.Tokens.guide)
        self.meshes: dict[str, Any] = {}

    def _samples(self, elements: Elements) -> Any:
        """The prim of the samples, with all that stays the same."""
        from pxr import Sdf, UsdGeom

        where, count, samples = "/world/samples", elements.count, elements.positions.shape[2]
        width = np.repeat(2 * elements.size, samples)
        colour = linear(elements.colour)
        each = UsdGeom.Tokens.uniform
        if elements.topology == "none":
            prim = UsdGeom.Points.Define(self.stage, where)
            self.always(prim.CreateIdsAttr(), np.arange(count, dtype=np.int64))
            each = UsdGeom.Tokens.vertex
        elif elements.topology == "thread":
            # a curve through the samples, from the first to the last
            prim = UsdGeom.BasisCurves.Define(self.stage, where)
            prim.CreateTypeAttr(UsdGeom.Tokens.cubic)
            prim.CreateBasisAttr(UsdGeom.Tokens.catmullRom)
            prim.CreateWrapAttr(UsdGeom.Tokens.pinned)
            self.always(prim.CreateCurveVertexCountsAttr(), np.full(count, samples, np.int32))
        else:
            prim = UsdGeom.Mesh.Define(self.stage, where)
            rows, columns = elements.grid
            corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).reshape(-1, 1)
            one = corner + np.array([0, 1, columns + 1, columns])
            faces = (one + samples * np.arange(count)[:, None, None]).reshape(-1, 4)
            self._mesh(prim, faces.astype(np.int32))
            prim.CreateDoubleSidedAttr(True)
            colour = np.repeat(colour, samples, axis=0)
        if elements.topology != "sheet":
            self.always(prim.CreateWidthsAttr(), width)
            prim.SetWidthsInterpolation(UsdGeom.Tokens.vertex)
        kinds = elements.kind
        if elements.topology == "sheet":
            each, kinds = UsdGeom.Tokens.vertex, np.repeat(kinds, samples)
        self.always(prim.CreateDisplayColorPrimvar(each).GetAttr(), colour)
        kind = UsdGeom.PrimvarsAPI(prim).CreatePrimvar("kind", Sdf.ValueTypeNames.IntArray, each)
        self.always(kind.GetAttr(), kinds)
        return prim

    def _mesh(self, prim: Any, faces: np.ndarray) -> None:
        from pxr import UsdGeom

        prim.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        self.always(prim.CreateFaceVertexCountsAttr(), np.full(len(faces), faces.shape[1], np.int32))
        self.always(prim.CreateFaceVertexIndicesAttr(), faces.reshape(-1).astype(np.int32))

    def add(self, frame: int, positions: np.ndarray, surfaces: Mapping[str, Surface]) -> None:
        """Set what moves: positions (E, S, D), and the surfaces."""
        from pxr import UsdGeom

        flat = np.zeros((*positions.shape[:2], 3), np.float32)
        flat[..., :positions.shape[2]] = positions
        self.at(frame, self.samples.GetPointsAttr(), flat.reshape(-1, 3))
        self.at(frame, self.samples.GetExtentAttr(), self._extent(flat))
        for name, surface in surfaces.items():
            vertices = np.asarray(surface.vertices, np.float32)
            if name not in self.meshes:
                self.meshes[name] = UsdGeom.Mesh.Define(self.stage, f"/world/{name}")
                self._mesh(self.meshes[name], surface.faces)
                colour = self.meshes[name].CreateDisplayColorPrimvar(UsdGeom.Tokens.vertex)
                self.always(colour.GetAttr(), linear(surface.colours))
            prim = self.meshes[name]
            self.at(frame, prim.GetPointsAttr(), vertices)
            self.at(frame, prim.GetExtentAttr(), np.stack([vertices.min(axis=0), vertices.max(axis=0)]))
            counts = np.full(len(surface.faces), surface.faces.shape[1], np.int32)
            self.unless_constant(frame, prim.GetFaceVertexCountsAttr(), counts)
            self.unless_constant(frame, prim.GetFaceVertexIndicesAttr(), surface.faces.reshape(-1).astype(np.int32))
            self.unless_constant(frame, prim.GetDisplayColorAttr(), linear(surface.colours))
        if self.pending > PENDING:
            self.save()

    def _extent(self, positions: np.ndarray) -> np.ndarray:
        """Two corners (2, 3) of a box round positions (E, S, 3): a Catmull-Rom curve may leave the hull of its samples,
        but not that of its Bézier points."""
        low, high = positions.min(axis=1), positions.max(axis=1)
        if len(self.grid) == 1 and positions.shape[1] > 1:
            padded = np.concatenate([2 * positions[:, :1] - positions[:, 1:2], positions,
                                     2 * positions[:, -1:] - positions[:, -2:-1]], axis=1)
            slope = (padded[:, 2:] - padded[:, :-2]) / 6
            low = np.minimum((positions - slope).min(axis=1), (positions + slope).min(axis=1))
            high = np.maximum((positions - slope).max(axis=1), (positions + slope).max(axis=1))
        reach = self.reach if len(self.grid) < 2 else 0 * self.reach
        return np.stack([(low - reach).min(axis=0), (high + reach).max(axis=0)]).astype(np.float32)

    # --- values ---

    def always(self, attribute: Any, values: np.ndarray) -> None:
        """Set what holds at each frame that says nothing else."""
        self.constant[str(attribute.GetPath())] = values
        self.at(0, attribute, values)

    def unless_constant(self, frame: int, attribute: Any, values: np.ndarray) -> None:
        """Set what holds from this frame on, if it is not what held before."""
        name = str(attribute.GetPath())
        before = self.constant[name]
        if np.array_equal(before, values):
            return
        # before its first sample an attribute has that one's value; between two, numbers are interpolated, indices held
        last = (attribute.GetTimeSamples() or [0])[-1]
        if not last:
            self.at(1, attribute, before)
        if values.dtype.kind == "f" and last < frame - 1:
            self.at(frame - 1, attribute, before)
        self.constant[name] = values
        self.at(frame, attribute, values)

    def at(self, frame: int, attribute: Any, values: np.ndarray) -> None:
        from pxr import Usd, Vt

        kind = {"point3f[]": Vt.Vec3fArray, "float3[]": Vt.Vec3fArray, "color3f[]": Vt.Vec3fArray, "int[]": Vt.IntArray,
                "int64[]": Vt.Int64Array, "float[]": Vt.FloatArray}[str(attribute.GetTypeName())]
        values = np.ascontiguousarray(values)
        attribute.Set(kind.FromNumpy(values), frame or Usd.TimeCode.Default())
        self.digests[str(attribute.GetPath()), frame] = _digest(values)
        self.pending += values.nbytes

    def save(self) -> None:
        """Move what has been set from memory to the file."""
        from pxr import Tf

        if not self.layer.Save():
            raise Tf.ErrorException("the file could not be written")
        self.pending = 0

    def difference(self, file: Path) -> str:
        """The first attribute that the file does not hold as it was set, or nothing."""
        from pxr import Sdf, Tf

        back = Sdf.Layer.CreateAnonymous("back.usdc")
        try:
            if not back.Import(str(file)):
                return "it"
        except Tf.ErrorException:
            return "it"
        for (name, frame), digest in self.digests.items():
            told = f"{name} at frame {frame}" if frame else name
            try:
                stored = back.GetAttributeAtPath(name)
                value = back.QueryTimeSample(name, frame) if frame else stored and stored.default
            except Tf.ErrorException:
                return told
            if value is None or _digest(np.asarray(value)) != digest:
                return told
        return ""


def _digest(values: np.ndarray) -> bytes:
    return hashlib.blake2b(np.ascontiguousarray(values).tobytes(), digest_size=16).digest()


# --- a user's own ---

def geometry(path: Path, prim: str) -> tuple[np.ndarray, list[tuple[int, ...]], list[tuple[int, ...]], float]:
    """What a USD file shows at or below `prim`: vertices (T, N, 3) float32, y up, at each whole time code; lines and
    faces of indices of them; frames per second. Runs in a child process (`sandbox`).

    Points and point instancers have neither lines nor faces; curves are lines of their control points. Units stay as
    they are; a scene that is z up is turned. Raises ValueError: no such prim, nothing of these or several kinds of
    them, references to other files, vertices that come and go.
    """
    from pxr import Sdf, Usd, UsdGeom

    layer = Sdf.Layer.FindOrOpen(str(path))
    if not layer:
        raise ValueError("damaged, or no USD file")
    if layer.GetCompositionAssetDependencies():
        raise ValueError(f"refers to other files ({next(iter(layer.GetCompositionAssetDependencies()))}); flatten it")
    stage = Usd.Stage.Open(layer)
    if not Sdf.Path.IsValidPathString(prim) or not stage.GetPrimAtPath(prim):
        raise ValueError(f"holds no prim {prim}")
    kinds = {"points": (UsdGeom.Points, UsdGeom.PointInstancer), "curves": (UsdGeom.BasisCurves,),
             "meshes": (UsdGeom.Mesh,)}
    shown: dict[str, list[Any]] = {}
    for found in Usd.PrimRange(stage.GetPrimAtPath(prim), Usd.TraverseInstanceProxies()):
        for kind, schemas in kinds.items():
            if any(found.IsA(schema) for schema in schemas):
                shown.setdefault(kind, []).append(found)
    if len(shown) != 1:
        what = " and ".join(f"{kind} ({prims[0].GetPath()})" for kind, prims in shown.items())
        raise ValueError(f"holds {what or 'no points, curves or meshes'}" + ("; name one of them" if what else ""))
    (kind, prims), = shown.items()
    times = _times(stage, prims)
    parts: list[np.ndarray] = []
    lines: list[tuple[int, ...]] = []
    faces: list[tuple[int, ...]] = []
    start = 0
    for found in prims:
        points, joined = _one(found, kind, times)
        (lines if kind == "curves" else faces).extend(tuple(start + i for i in line) for line in joined)
        parts.append(points)
        start += points.shape[1]
    vertices = np.concatenate(parts, axis=1)
    if not vertices.shape[1]:
        raise ValueError("holds no vertices")
    if UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z:
        vertices = np.stack([vertices[..., 0], vertices[..., 2], -vertices[..., 1]], axis=-1)
    with np.errstate(over="ignore"):
        return vertices.astype(np.float32), lines, faces, float(stage.GetFramesPerSecond())


def surface(path: Path, primvar: str) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """The meshes of a USD file: vertices (N, 3) float64, y up, of its first frame, and triangles (M, 3) int64; and the
    vectors (N, 3) that a primvar of this name, of type vector3f[] or the like, has at the vertices: None without a name
    or where a mesh has none.

    Runs in a child process (`sandbox`). Raises ValueError as `geometry` does, and for vectors that are not as many as
    the vertices.
    """
    from pxr import Usd, UsdGeom

    vertices, _, polygons, _ = geometry(path, "/")
    faces = [(face[0], one, other) for face in polygons for one, other in pairwise(face[1:])]
    stage = Usd.Stage.Open(str(path))
    parts: list[np.ndarray] = []
    for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()):
        if prim.IsA(UsdGeom.Mesh) and primvar:
            count = len(UsdGeom.Mesh(prim).GetPointsAttr().Get(Usd.TimeCode.EarliestTime()) or ())
            value = UsdGeom.PrimvarsAPI(prim).GetPrimvar(primvar)
            if not value:
                return vertices[0].astype(np.float64), np.array(faces).reshape(-1, 3), None
            vectors = np.asarray(value.ComputeFlattened(Usd.TimeCode.EarliestTime()), np.float64)
            if vectors.shape != (count, 3):
                raise ValueError(f"{prim.GetPath()} has {count} vertices, and {primvar} is of shape {vectors.shape}")
            turn = np.array(UsdGeom.XformCache(Usd.TimeCode.EarliestTime()).GetLocalToWorldTransform(prim))
            parts.append(vectors @ turn[:3, :3])
    found = np.concatenate(parts) if parts else None
    if found is not None and UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z:
        found = np.stack([found[:, 0], found[:, 2], -found[:, 1]], axis=-1)
    return vertices[0].astype(np.float64), np.array(faces).reshape(-1, 3), found


def _times(stage: Any, prims: list[Any]) -> list[float]:
    """The time codes of the frames: as far as the stage says, else as far as its prims move."""
    step = stage.GetTimeCodesPerSecond() / stage.GetFramesPerSecond() if stage.GetFramesPerSecond() > 0 else 0.0
    first, last = stage.GetStartTimeCode(), stage.GetEndTimeCode()
    if not stage.HasAuthoredTimeCodeRange():
        samples = [time for prim in prims for attribute in prim.GetAttributes() for time in attribute.GetTimeSamples()]
        first, last = min(samples, default=0.0), max(samples, default=0.0)
    if not (np.isfinite([first, last, step]).all() and step > 0 and 0 <= (last - first) / step < MOST_FRAMES):
        raise ValueError(f"time codes from {first:g} to {last:g} at a step of {step:g}")
    return [first + step * k for k in range(int((last - first) / step + 1e-6) + 1)]


def _one(prim: Any, kind: str, times: list[float]) -> tuple[np.ndarray, list[tuple[int, ...]]]:
    """Points (T, N, 3) of a prim in the world, and its curves or faces."""
    from pxr import UsdGeom

    def arrays(attribute: Any, time: float) -> np.ndarray:
        value = attribute.Get(time)
        return np.zeros(0, int) if value is None else np.asarray(value)

    instancer = prim.IsA(UsdGeom.PointInstancer)
    where = UsdGeom.PointInstancer(prim).GetPositionsAttr() if instancer else UsdGeom.PointBased(prim).GetPointsAttr()
    if kind == "curves":
        curves = UsdGeom.BasisCurves(prim)
        if curves.GetWrapAttr().Get() == UsdGeom.Tokens.periodic:
            raise ValueError(f"{prim.GetPath()} holds closed curves; flowloom reads open ones")
        counting = [curves.GetCurveVertexCountsAttr()]
    elif kind == "meshes":
        mesh = UsdGeom.Mesh(prim)
        counting = [mesh.GetFaceVertexCountsAttr(), mesh.GetFaceVertexIndicesAttr()]
    else:
        counting = []
    first = [arrays(attribute, times[0]) for attribute in counting]
    points: list[np.ndarray] = []
    for time in times:
        here = arrays(where, time).reshape(-1, 3).astype(float)
        if points and len(here) != len(points[0]):
            raise ValueError(f"frame {time:g}: {prim.GetPath()} has {len(here)} vertices, and {len(points[0])} before")
        if any(not np.array_equal(arrays(a, time), b) for a, b in zip(counting, first, strict=True)):
            raise ValueError(f"frame {time:g}: the vertices of {prim.GetPath()} are joined otherwise than before")
        turn = np.array(UsdGeom.XformCache(time).GetLocalToWorldTransform(prim))
        points.append(here @ turn[:3, :3] + turn[3, :3])
    if not counting:
        return np.stack(points), []
    counts, indices = first[0], first[1] if kind == "meshes" else np.arange(len(points[0]))
    least = 2 if kind == "curves" else 3
    if len(counts) and (counts.min() < least or counts.sum() != len(indices)):
        raise ValueError(f"{prim.GetPath()} counts {counts.sum()} vertices of its {kind}, and has {len(indices)}")
    if len(indices) and (indices.min() < 0 or indices.max() >= len(points[0])):
        raise ValueError(f"{prim.GetPath()} names a vertex that does not exist")
    return np.stack(points), [tuple(part.tolist()) for part in np.split(indices, np.cumsum(counts)[:-1])]


def _write_animation(path: Path, animation: tuple[Elements, Callable[[int], Mapping[str, Surface]] | None]) -> None:
    """Elements and their surfaces, as `write` takes them."""
    write(path, *animation)


ANIMATION = Format("usdc", _write_animation, Path.read_bytes)
