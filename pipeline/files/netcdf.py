"""NetCDF 3 and 4: a wind or a current on latitude and longitude, of a user's file.

Read in a child process: NetCDF 3 by scipy, NetCDF 4 by h5netcdf. Values follow the CF conventions: fill values, packed
values, coordinates by their units.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import BadInput
from pipeline.files import sandbox

Window = tuple[float, float, float, float]
"""West, south, east, north; degrees."""

POLAR = 85.0  # degrees: towards a pole what moves to the east would become infinitely fast on a map
HUGE = 1e30  # floats beyond it are fill values, said or not: those of the library are about 1e37
FILLS = {"i2": -32767, "i4": -2147483647}  # the library's, where the file says none
NAMES = {"latitude": ("lat", "nav_lat"), "longitude": ("lon", "nav_lon")}
UNITS = {"latitude": ("degrees_north", "degree_north", "degree_n", "degrees_n", "degreen", "degreesn"),
         "longitude": ("degrees_east", "degree_east", "degree_e", "degrees_e", "degreee", "degreese")}
HEIGHTS = ("depth", "lev", "height", "plev", "z", "sigma", "isobaric")
EVEN = 0.02  # of a step: what longitudes all round the globe may lack to be 360 degrees


@dataclass(frozen=True, eq=False)
class Currents:
    """A velocity on latitude and longitude.

    u, v       (T, Y, X) float32: eastward and northward, in the file's unit; 0 where missing
    missing    (T, Y, X) bool: where one of the two has no value
    latitude   (Y,) float64, degrees, ascending
    longitude  (X,) float64, degrees, ascending; those all round the globe go on beyond their seam
    window     what was asked for, or all there is; latitude and longitude reach a little beyond it
    unit       the file's unit of u, as it is spelled there; "" if it says none
    """

    u: np.ndarray
    v: np.ndarray
    missing: np.ndarray
    latitude: np.ndarray
    longitude: np.ndarray
    window: Window
    unit: str

    def on(self, shape: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
        """On the cells `shape` (Y', X'): how fast places move on a map where a degree is as long in both directions,
        (T, Y', X', 2) float32, and the share of each cell that has values at all times, (Y', X') float32; where it is
        below a half, the velocity is 0.

        The velocity is (u / cos φ, v), φ the latitude, in the file's unit at the equator: what moves to the east passes
        more degrees where they are shorter. Bilinear between what has values; means where the cells are larger.
        """
        y, x = self.places(shape)
        known: Any = ~self.missing.any(axis=0)
        share = _bilinear(known.astype(np.float64), self.latitude, self.longitude, y, x)
        there = share >= 0.5
        values = np.zeros((len(self.u), *shape, 2), np.float32)
        for moment, components in enumerate(zip(self.u, self.v, strict=True)):
            for axis, component in enumerate(components):
                sums = _bilinear(np.where(known, component, 0), self.latitude, self.longitude, y, x)
                values[moment, ..., axis] = np.where(there, sums / np.where(there, share, 1), 0)
        values[..., 0] /= shrunk(y)[:, None]
        return values, share.astype(np.float32)

    def places(self, shape: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
        """Latitudes (Y',) and longitudes (X',) of the cells `shape` (Y', X'), degrees: of the window they cover the
        largest part of their proportions, in its middle, a degree as long in both directions."""
        rows, columns = shape
        west, south, east, north = self.window
        degree = min((east - west) / columns, (north - south) / rows)
        x: np.ndarray = (west + east) / 2 + degree * (np.arange(columns) - (columns - 1) / 2)
        y: np.ndarray = (south + north) / 2 + degree * (np.arange(rows) - (rows - 1) / 2)
        return y, x


def shrunk(latitude: np.ndarray) -> np.ndarray:
    """Length of a degree of longitude over that of one at the equator, float32; from POLAR on it shrinks no more."""
    return np.cos(np.radians(np.minimum(np.abs(latitude), POLAR))).astype(np.float32)


def _bilinear(values: np.ndarray, latitude: np.ndarray, longitude: np.ndarray, y: np.ndarray, x: np.ndarray,
              ) -> np.ndarray:
    """Values (Y, X) at the places y (Y',) by x (X',), (Y', X') float64; beyond the border as at the border."""
    from scipy import ndimage

    for axis, (at, to) in enumerate(((latitude, y), (longitude, x))):
        if len(at) == 1:
            values = np.repeat(values, len(to), axis)
            continue
        place = np.interp(to, at, np.arange(len(at)))
        merged = round(np.ptp(to) / max(len(to) - 1, 1) / (np.ptp(at) / (len(at) - 1)))
        if merged > 1:
            values = ndimage.uniform_filter1d(values.astype(np.float64), merged, axis, mode="nearest")
        below = np.minimum(place.astype(int), len(at) - 2)
        t = np.expand_dims(place - below, 1 - axis)
        values = np.take(values, below, axis) * (1 - t) + np.take(values, below + 1, axis) * t
    return values


def read_foreign(file: Path, table: str, u: str = "u", v: str = "v", first: int = 0, last: int | None = None,
                 window: Window | None = None) -> Currents:
    """Variables `u` and `v` of a user's file, their time steps `first` to `last` (from 0; None: the last there is), in
    a window or everywhere.

    Raises BadInput that names `table`.file, or the key there that does not fit the file: no such variable, another
    shape, no latitude or longitude, no such time step, a window beside the data, no values, a damaged file.
    """
    found = sandbox.read(_read, file, f"{table}.file", u, v, first, last, window)
    if "refused" in found:
        raise BadInput(file, f"{table}.{found['refused']}", found["reason"])
    return Currents(**found | {"window": tuple(found["window"])})


# -- in the child ---------------------------------------------------------------------------------------------------


class _Refused(Exception):
    """What does not fit the file: a key of the table, and the reason."""


@dataclass(frozen=True)
class _Variable:
    """A variable of either format; `read` gives the values of a slice for each dimension, as they are stored."""

    name: str
    dimensions: tuple[str, ...]
    shape: tuple[int, ...]
    attributes: dict[str, Any]
    read: Callable[[tuple[slice, ...]], np.ndarray]


def _read(path: Path, u: str, v: str, first: int, last: int | None, window: list[float] | None) -> dict[str, Any]:
    try:
        with _variables(path) as variables:
            return _currents(variables, u, v, first, last, window)
    except _Refused as refused:
        key, reason = refused.args
        return {"refused": key, "reason": reason}
    except MemoryError:
        raise
    except Exception as error:  # of a library that reads a damaged file
        words = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ValueError(f"damaged or cut short ({words})") from error


@contextmanager
def _variables(path: Path) -> Iterator[dict[str, _Variable]]:
    """The variables of a file by their names."""
    with path.open("rb") as opened:
        head = opened.read(8)
    if head[:4] in (b"CDF\x01", b"CDF\x02"):
        from scipy.io import netcdf_file

        def read(name: str, part: tuple[slice, ...]) -> np.ndarray:
            return np.array(file.variables[name].data[part])  # a copy: the file can be closed only without views

        with path.open("rb") as opened, netcdf_file(opened, "r", mmap=True) as file:
            yield {name: _Variable(name, one.dimensions, one.shape, one._attributes, functools.partial(read, name))
                   for name, one in file.variables.items()}
    elif head == b"\x89HDF\r\n\x1a\n":
        import h5netcdf

        with h5netcdf.File(str(path), "r", phony_dims="access") as file:
            yield {name: _Variable(name, one.dimensions, one.shape, dict(one.attrs), one.__getitem__)
                   for name, one in file.variables.items()}
    elif head[:4] == b"CDF\x05":
        raise _Refused("file", "is NetCDF of 64-bit data (CDF-5), which is not read; nccopy -k nc4 converts it")
    else:
        raise _Refused("file", "is no NetCDF file")


def _currents(variables: dict[str, _Variable], u: str, v: str, first: int, last: int | None,
              window: list[float] | None) -> dict[str, Any]:
    for key, name in (("u", u), ("v", v)):
        if name not in variables:
            fields = [n for n, one in variables.items() if len(one.shape) >= 2] or list(variables)
            raise _Refused(key, f"no variable '{name}'; the file has: {', '.join(fields) or 'none'}")
    one, other = variables[u], variables[v]
    if (one.dimensions, one.shape) != (other.dimensions, other.shape):
        raise _Refused("v", f"{_spelled(other)} has another shape than {_spelled(one)}")
    coordinates = {what: _coordinate(variables, one, what) for what in NAMES}
    names = {what: coordinate.name for what, coordinate in coordinates.items()}
    time = _time(variables, one, names)
    latitude, upside_down = _ascending("latitude", coordinates["latitude"])
    longitude, mirrored = _ascending("longitude", coordinates["longitude"])
    if np.abs(latitude).max() > 90.5:
        most = latitude[np.abs(latitude).argmax()]
        raise _Refused("file", f"latitudes in {names['latitude']} reach {most:g} degrees")
    steps = one.shape[one.dimensions.index(time)] if time else 1
    if first >= steps or (last is not None and last >= steps):
        key = "first" if first >= steps else "last"
        raise _Refused(key, f"the file has {steps} time steps, the last of which is number {steps - 1}")
    whole, columns, longitude = _columns(longitude, window)
    rows = _rows(latitude, whole)

    slices: dict[str, slice] = {names["latitude"]: _stored(rows, len(latitude), upside_down)}
    if time:
        slices[time] = slice(first, steps if last is None else last + 1)
    order = [one.dimensions.index(name) for name in (time, names["latitude"], names["longitude"]) if name]
    components = []
    for variable in (one, other):
        stored = np.asarray(variable.read(tuple(slices.get(name, slice(None)) for name in variable.dimensions)))
        values, missing = _unpacked(variable, stored)
        parts = []
        for part in (values, missing):
            part = part.transpose(*order, *(n for n in range(part.ndim) if n not in order))
            part = part.reshape(part.shape[:len(order)])  # the other dimensions have one place
            part = part if time else part[None]
            parts.append(part[:, ::-1 if upside_down else 1, ::-1 if mirrored else 1][..., columns])
        components.append(parts)
    missing = components[0][1] | components[1][1]
    if missing.any(axis=0).all():
        raise _Refused("window" if window else "file", "no place has values of both at all time steps")
    return {"u": np.where(missing, np.float32(0), components[0][0]),
            "v": np.where(missing, np.float32(0), components[1][0]), "missing": missing,
            "latitude": latitude[rows], "longitude": longitude, "window": list(whole), "unit": _said(one, "units")}


def _spelled(variable: _Variable) -> str:
    sizes = " × ".join(f"{name} {count}" for name, count in zip(variable.dimensions, variable.shape, strict=True))
    return f"{variable.name} ({sizes})"


def _text(variable: _Variable, attribute: str) -> str:
    return _said(variable, attribute).lower()


def _said(variable: _Variable, attribute: str) -> str:
    value = variable.attributes.get(attribute, "")
    return (value.decode(errors="replace") if isinstance(value, bytes) else str(value)).strip()


def _coordinate(variables: dict[str, _Variable], field: _Variable, what: str) -> _Variable:
    """The latitudes or longitudes of a field: told by what they say of themselves, else by their name."""
    along = [variables[name] for name in field.dimensions
             if name in variables and variables[name].dimensions == (name,)]
    for says in (lambda one: _text(one, "units") in UNITS[what] or _text(one, "standard_name") == what,
                 lambda one: one.name.lower().startswith(NAMES[what])):
        for one in along:
            if says(one):
                return one
    curved = any(len(one.shape) == 2 and _text(one, "units") in UNITS[what] for one in variables.values())
    raise _Refused("file", f"{_spelled(field)} has no {what} along a dimension" + (
        "; a curved grid is not read" if curved else ""))


def _time(variables: dict[str, _Variable], field: _Variable, names: dict[str, str]) -> str | None:
    """The dimension of time; None where there is none."""
    rest = [(name, count) for name, count in zip(field.dimensions, field.shape, strict=True)
            if name not in names.values()]
    said = [name for name, _ in rest if name in variables and (
        " since " in _text(variables[name], "units") or _text(variables[name], "standard_name") == "time")]
    said += [name for name, _ in rest if name.lower().startswith("time")]
    long = [name for name, count in rest if count > 1]
    if not said:
        said = [name for name in long if not name.lower().startswith(HEIGHTS)]
    if 0 in field.shape:
        raise _Refused("file", f"{_spelled(field)} is empty")
    if set(long) - set(said[:1]):
        raise _Refused("file", f"{_spelled(field)} has more than time, latitude and longitude")
    return said[0] if said else None


def _ascending(what: str, coordinate: _Variable) -> tuple[np.ndarray, bool]:
    """Degrees in ascending order, and whether they are stored the other way round."""
    degrees = np.asarray(coordinate.read((slice(None),)), np.float64)
    if what == "longitude" and np.isfinite(degrees).all():
        degrees = np.unwrap(degrees, period=360)
    mirrored = len(degrees) > 1 and degrees[0] > degrees[-1]
    if mirrored:
        degrees = degrees[::-1]
    if not np.isfinite(degrees).all() or (np.diff(degrees) <= 0).any():
        raise _Refused("file", f"the {what}s in {coordinate.name} neither rise nor fall throughout")
    return degrees, mirrored


def _columns(longitude: np.ndarray, window: list[float] | None) -> tuple[list[float], np.ndarray, np.ndarray]:
    """The window (NaN for south and north where none was asked for), the columns it needs and their longitudes."""
    step = np.ptp(longitude) / max(len(longitude) - 1, 1) or 1.0
    low, high = longitude[0] - step / 2, longitude[-1] + step / 2
    round_globe = abs(high - low - 360) < EVEN * step
    if window is None:
        west, east, south, north = low, high, np.nan, np.nan
    else:
        west, south, east, north = window
        east += 360 * np.ceil((west - east) / 360) if east <= west else 0
        turns = 360 * np.floor((west - low + 1e-6) / 360)  # the file's longitudes that the window starts in
        west, east = west - turns, east - turns
        if not round_globe and (west < low - 1e-6 or east > high + 1e-6):
            raise _Refused("window", f"the file has longitudes {low:g} to {high:g}")
    columns = np.arange(len(longitude))
    if round_globe:
        columns, longitude = np.tile(columns, 4), np.concatenate([longitude + turn for turn in (-360, 0, 360, 720)])
    needed = (longitude > west - 1.5 * step) & (longitude < east + 1.5 * step)
    return [float(west), float(south), float(east), float(north)], columns[needed], longitude[needed]


def _rows(latitude: np.ndarray, window: list[float]) -> slice:
    """The rows that the window needs. South and north are filled in where none were asked for."""
    step = np.ptp(latitude) / max(len(latitude) - 1, 1) or 1.0
    low, high = max(latitude[0] - step / 2, -90.0), min(latitude[-1] + step / 2, 90.0)
    if np.isnan(window[1]):
        window[1], window[3] = low, high
    if window[1] < low - 1e-6 or window[3] > high + 1e-6:
        raise _Refused("window", f"the file has latitudes {low:g} to {high:g}")
    needed = np.flatnonzero((latitude > window[1] - 1.5 * step) & (latitude < window[3] + 1.5 * step))
    return slice(int(needed[0]), int(needed[-1]) + 1)


def _stored(rows: slice, count: int, upside_down: bool) -> slice:
    """The rows as they are stored."""
    return slice(count - rows.stop, count - rows.start) if upside_down else rows


def _unpacked(variable: _Variable, stored: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The values as float32, and where they are missing."""
    if stored.dtype.kind not in "iuf":
        raise _Refused("file", f"{variable.name} holds no numbers")
    attributes = variable.attributes
    missing = np.zeros(stored.shape, bool)
    if stored.dtype.kind == "f":
        with np.errstate(invalid="ignore"):
            missing |= ~(np.abs(stored) < HUGE)
    fills = [np.ravel(attributes[name]) for name in ("_FillValue", "missing_value") if name in attributes]
    if not fills and stored.dtype.str[1:] in FILLS:
        fills = [np.array([FILLS[stored.dtype.str[1:]]])]
    for fill in (number for several in fills for number in several):
        missing |= stored == np.asarray(fill).astype(stored.dtype)
    lowest, highest = attributes.get("valid_min"), attributes.get("valid_max")
    if "valid_range" in attributes:
        lowest, highest = np.ravel(attributes["valid_range"])[:2]
    if lowest is not None:
        missing |= stored < np.ravel(lowest)[0]
    if highest is not None:
        missing |= stored > np.ravel(highest)[0]
    scale, offset = (float(np.ravel(attributes.get(name, default))[0])
                     for name, default in (("scale_factor", 1.0), ("add_offset", 0.0)))
    values = np.where(missing, 0, stored.astype(np.float64)) * scale + offset
    missing |= ~np.isfinite(values)
    return np.where(missing, 0, values).astype(np.float32), missing
