"""Winds of NetCDF files that the tests write: where every value ends up, what is missing, and what is refused."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5netcdf
import numpy as np
import pytest
from scipy.io import netcdf_file

from pipeline.errors import BadInput
from pipeline.files import netcdf

LATITUDE, LONGITUDE = np.arange(-20.0, 21, 10), np.arange(100.0, 160, 10)
SHAPE = (3, 5, 6)


def wind(longitude: np.ndarray = LONGITUDE, latitude: np.ndarray = LATITUDE, times: int = 3) -> dict[str, np.ndarray]:
    """u: latitude + time; v: longitude."""
    t, y, x = np.meshgrid(np.arange(times), latitude, longitude, indexing="ij")
    return {"u": (y + t).astype(np.float32), "v": x.astype(np.float32)}


def written(fields: dict[str, np.ndarray] | None = None, *, version: int = 3, latitude: np.ndarray = LATITUDE,
            longitude: np.ndarray = LONGITUDE, names: tuple[str, ...] = ("time", "lat", "lon"),
            units: tuple[str, ...] = ("days since 2000-01-01", "degrees_north", "degrees_east"),
            unit: str = "", **attributes: Any) -> Path:
    """a.nc with fields (time, latitude, longitude); `unit` and `attributes` are those of each of them."""
    attributes |= {"units": unit} if unit else {}
    fields = wind(longitude, latitude) if fields is None else fields
    times = len(next(iter(fields.values())))
    axes = dict(zip(names, zip((np.arange(times, dtype=float), latitude, longitude), units, strict=True), strict=True))
    if version == 3:
        with netcdf_file("a.nc", "w") as file:
            for name, (values, unit) in axes.items():
                file.createDimension(name, len(values))
                file.createVariable(name, "f8", (name,))[:] = values
                file.variables[name].units = unit
            for name, values in fields.items():
                made = file.createVariable(name, values.dtype.str[1:], names[-values.ndim:])
                made[:] = values
                for attribute, value in attributes.items():
                    setattr(made, attribute, value)
    else:
        with h5netcdf.File("a.nc", "w") as file:
            file.dimensions = {name: len(values) for name, (values, _) in axes.items()}
            for name, (values, unit) in axes.items():
                file.create_variable(name, (name,), data=values).attrs["units"] = unit
            for name, values in fields.items():
                fill = attributes.get("_FillValue")
                made = file.create_variable(name, names[-values.ndim:], data=values, fillvalue=fill)
                for attribute, value in attributes.items():
                    if attribute != "_FillValue":
                        made.attrs[attribute] = value
    return Path("a.nc")


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    """A folder for each test. What a child would do is done in this process, without the half second it costs."""
    def called(function: Callable, path: Path, key: str, *arguments: object) -> object:
        try:
            return function(path, *arguments)
        except ValueError as error:
            raise BadInput(path, key, str(error)) from error

    monkeypatch.chdir(tmp_path)
    if "child" not in request.node.name:
        monkeypatch.setattr(netcdf.sandbox, "read", called)


def refused(**settings: Any) -> str:
    """The line that reading a.nc ends with."""
    with pytest.raises(BadInput) as caught:
        netcdf.read_foreign(Path("a.nc"), "coarse", **settings)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("version", [3, 4])
def test_values_come_back_through_the_child(version: int) -> None:
    fields = wind()
    found = netcdf.read_foreign(written(fields, version=version), "coarse")
    assert np.array_equal(found.u, fields["u"]) and np.array_equal(found.v, fields["v"]) and not found.missing.any()
    assert np.array_equal(found.latitude, LATITUDE) and np.array_equal(found.longitude, LONGITUDE)
    assert found.u.dtype == found.v.dtype == np.float32
    assert found.window == (95, -25, 155, 25)


@pytest.mark.parametrize("version", [3, 4])
def test_rows_from_north_to_south_and_columns_from_east_to_west_are_turned_over(version: int) -> None:
    turned = {name: values[:, ::-1, ::-1] for name, values in wind().items()}
    written(turned, version=version, latitude=LATITUDE[::-1], longitude=LONGITUDE[::-1])
    found = netcdf.read_foreign(Path("a.nc"), "coarse")
    assert np.array_equal(found.u, wind()["u"]) and np.array_equal(found.v, wind()["v"])
    assert np.array_equal(found.latitude, LATITUDE) and np.array_equal(found.longitude, LONGITUDE)
    part = netcdf.read_foreign(Path("a.nc"), "coarse", window=(110, 5, 130, 20))
    assert part.latitude[-1] == 20 and part.latitude[0] > -20
    assert np.array_equal(part.u[0, :, 0], part.latitude)


@pytest.mark.parametrize("version", [3, 4])
@pytest.mark.parametrize("how", ["_FillValue", "missing_value", "nan", "unsaid", "range"])
def test_what_is_missing_in_one_component_is_missing(version: int, how: str) -> None:
    fields = wind()
    hole = {"nan": np.nan, "unsaid": 9.96921e36, "range": 5000.0}.get(how, -999.0)
    fields["u"][1, 2, 3] = fields["v"][0, 0, 0] = np.float32(hole)
    said: dict[str, Any] = {"_FillValue": {"_FillValue": np.float32(-999)}, "missing_value": {"missing_value": -999.0},
                            "range": {"valid_range": np.array([-1000, 1000], np.float32)}}.get(how, {})
    found = netcdf.read_foreign(written(fields, version=version, **said), "coarse")
    assert np.argwhere(found.missing).tolist() == [[0, 0, 0], [1, 2, 3]]
    assert not found.u[found.missing].any() and not found.v[found.missing].any()
    assert np.array_equal(found.u[~found.missing], wind()["u"][~found.missing])


@pytest.mark.parametrize("version", [3, 4])
def test_packed_values_are_unpacked_and_their_fill_value_is_a_stored_one(version: int) -> None:
    packed = {name: np.round((values - 10) / 0.5).astype(np.int16) for name, values in wind().items()}
    packed["u"][0, 1, 1] = -32768
    written(packed, version=version, scale_factor=0.5, add_offset=10.0, _FillValue=np.int16(-32768))
    found = netcdf.read_foreign(Path("a.nc"), "coarse")
    assert np.argwhere(found.missing).tolist() == [[0, 1, 1]]
    assert np.array_equal(found.v[~found.missing], wind()["v"][~found.missing])


def test_time_steps_are_counted_from_nought() -> None:
    written()
    assert np.array_equal(netcdf.read_foreign(Path("a.nc"), "coarse", first=1, last=2).u, wind()["u"][1:])
    assert np.array_equal(netcdf.read_foreign(Path("a.nc"), "coarse", last=0).u, wind()["u"][:1])
    assert refused(first=3) == "a.nc: coarse.first: the file has 3 time steps, the last of which is number 2"
    assert refused(last=9) == "a.nc: coarse.last: the file has 3 time steps, the last of which is number 2"


def test_coordinates_are_known_by_their_units_and_else_by_their_names() -> None:
    written(names=("t", "row", "column"))
    assert np.array_equal(netcdf.read_foreign(Path("a.nc"), "coarse").u, wind()["u"])
    written(units=("", "", ""), names=("TIME", "Latitude", "Longitude"))
    assert np.array_equal(netcdf.read_foreign(Path("a.nc"), "coarse").u, wind()["u"])
    turned = {name: values.transpose(2, 0, 1) for name, values in wind().items()}  # any order of dimensions
    with netcdf_file("a.nc", "w") as file:
        for name, values in (("lon", LONGITUDE), ("time", np.arange(3)), ("lat", LATITUDE)):
            file.createDimension(name, len(values))
            file.createVariable(name, "f8", (name,))[:] = values
        for name, values in turned.items():
            file.createVariable(name, "f4", ("lon", "time", "lat"))[:] = values
    assert np.array_equal(netcdf.read_foreign(Path("a.nc"), "coarse").u, wind()["u"])


def test_one_moment_needs_no_time() -> None:
    written({name: values[0] for name, values in wind().items()}, latitude=LATITUDE)
    assert netcdf.read_foreign(Path("a.nc"), "coarse").u.shape == (1, 5, 6)


@pytest.mark.parametrize("start", [0.0, -180.0, 20.0])
def test_a_window_crosses_the_seam_of_the_globe(start: float) -> None:
    longitude = start + np.arange(0, 360, 10.0)
    fields = wind(longitude)
    fields["v"] = np.cos(np.radians(fields["v"])).astype(np.float32)
    written(fields, longitude=longitude)
    for window in ((170.0, -20.0, 200.0, 20.0), (170.0, -20.0, -160.0, 20.0), (-10.0, -20.0, 40.0, 20.0)):
        found = netcdf.read_foreign(Path("a.nc"), "coarse", window=window)
        assert np.allclose(np.diff(found.longitude), 10) and len(found.longitude) < 10
        assert (found.window[0] - window[0]) % 360 == 0 and found.longitude[0] < found.window[0]
        assert np.allclose(found.v[0, 0], np.cos(np.radians(found.longitude)), atol=1e-6)
    every = netcdf.read_foreign(Path("a.nc"), "coarse")
    assert every.window[2] - every.window[0] == 360
    assert np.allclose(every.v[0, 0], np.cos(np.radians(every.longitude)), atol=1e-6)


def test_longitudes_that_jump_go_on() -> None:
    longitude = np.array([160.0, 170, 180, -170, -160, -150])
    found = netcdf.read_foreign(written(longitude=longitude), "coarse")
    assert np.array_equal(found.longitude, [160, 170, 180, 190, 200, 210])


def test_a_field_linear_in_place_is_itself_on_the_cells() -> None:
    found = netcdf.read_foreign(written(), "coarse", window=(105, -20, 145, 20))
    values, share = found.on((8, 8))
    assert values.shape == (3, 8, 8, 2) and (share == 1).all()
    latitude = -17.5 + 5 * np.arange(8)
    assert np.allclose(values[1, :, 3, 0] * np.cos(np.radians(latitude)), latitude + 1)
    assert np.allclose(values[2, 5, :, 1], 107.5 + 5 * np.arange(8))
    wide = found.on((4, 16))[0]  # the middle of the window, 10 degrees high, a degree as long in both directions
    latitude = -3.75 + 2.5 * np.arange(4)
    assert np.allclose(wide[0, :, 0, 0] * np.cos(np.radians(latitude)), latitude)
    assert np.array_equal(found.places((4, 16))[0], latitude)
    assert np.allclose(wide[0, 0, :, 1], 106.25 + 2.5 * np.arange(16))


def test_what_is_missing_does_not_dilute_what_is_there() -> None:
    fields = wind()
    fields["u"][:], fields["v"][:] = 3, 4
    fields["u"][:, :, :3] = np.nan
    found = netcdf.read_foreign(written(fields), "coarse")
    values, share = found.on((20, 24))
    values[..., 0] *= netcdf.shrunk(found.places((20, 24))[0])[:, None]
    there = share >= 0.5
    assert np.allclose(values[:, there], (3, 4)) and not values[:, ~there].any()
    assert np.array_equal(there, np.broadcast_to(np.arange(24) >= 12, (20, 24)))  # half-way, at 125 degrees
    fields = wind()
    fields["u"][1, 2, 2] = np.nan  # missing once: it is missing
    assert netcdf.read_foreign(written(fields), "coarse").on((5, 6))[1][2, 2] == 0


def test_larger_cells_are_means() -> None:
    fields = wind(np.arange(0.0, 40), np.arange(0.0, 40))
    fields["u"][:] = np.where(np.arange(40) % 2, 1, -1) + 2.0  # a wind that changes from column to column
    found = netcdf.read_foreign(written(fields, latitude=np.arange(0.0, 40), longitude=np.arange(0.0, 40)), "coarse")
    east = found.on((5, 5))[0][..., 0] * netcdf.shrunk(found.places((5, 5))[0])[:, None]
    assert np.abs(east[..., 1:-1] - 2).max() < 0.2


def test_what_moves_on_the_map_moves_so_on_the_globe() -> None:
    """A place that moves for a second, at 4 and 3 degrees of a great circle a second, to the east and to the north."""
    latitude, longitude = np.arange(-80.0, 81, 2), np.arange(0.0, 161, 2)
    still = np.ones((1, len(latitude), len(longitude)), np.float32)
    written({"u": 4 * still, "v": 3 * still}, latitude=latitude, longitude=longitude)
    found = netcdf.read_foreign(Path("a.nc"), "coarse")
    values, (y, x) = found.on((162, 162))[0][0], found.places((162, 162))
    for row in (10, 40, 81, 125, 150):
        start = np.radians([y[row], x[7]])
        time = 1e-3
        moved = start + np.radians(values[row, 7, ::-1]) * time
        east, north = np.array([-np.sin(start[1]), np.cos(start[1]), 0]), np.array([
            -np.sin(start[0]) * np.cos(start[1]), -np.sin(start[0]) * np.sin(start[1]), np.cos(start[0])])
        on_globe = on_sphere(start) + np.radians(4 * east + 3 * north) * time
        assert np.linalg.norm(on_sphere(moved) - on_globe) < 1e-3 * np.radians(5) * time


def on_sphere(radians: np.ndarray) -> np.ndarray:
    """The point of the unit sphere at a latitude and a longitude."""
    (c, d), (s, t) = np.cos(radians), np.sin(radians)
    return np.array([c * d, c * t, s])


def test_at_a_pole_the_wind_on_the_map_stays_finite() -> None:
    latitude = np.arange(60.0, 91, 2)
    one = np.ones((1, len(latitude), 6), np.float32)
    found = netcdf.read_foreign(written({"u": one, "v": one}, latitude=latitude), "coarse")
    values, (y, _) = found.on((310, 100))[0][0], found.places((310, 100))
    assert y[-1] > 89.9 and np.allclose(values[..., 1], 1, atol=1e-6)
    assert np.allclose(values[y >= 85, :, 0], 1 / np.cos(np.radians(85)), rtol=1e-6)
    assert (np.diff(values[y < 85, 0, 0]) > 0).all()


@pytest.mark.parametrize("version", [3, 4])
def test_the_unit_is_the_files(version: int) -> None:
    assert netcdf.read_foreign(written(version=version), "coarse").unit == ""
    assert netcdf.read_foreign(written(version=version, unit="m s**-1"), "coarse").unit == "m s**-1"


def test_what_does_not_fit_is_said_in_a_line() -> None:
    written()
    assert refused(u="uwnd") == "a.nc: coarse.u: no variable 'uwnd'; the file has: u, v"
    assert refused(v="V") == "a.nc: coarse.v: no variable 'V'; the file has: u, v"
    assert refused(window=(0, -20, 10, 20)) == "a.nc: coarse.window: the file has longitudes 95 to 155"
    assert refused(window=(100, -40, 120, 20)) == "a.nc: coarse.window: the file has latitudes -25 to 25"
    written({"u": wind()["u"], "v": wind()["v"][0]})
    assert refused() == "a.nc: coarse.v: v (lat 5 × lon 6) has another shape than u (time 3 × lat 5 × lon 6)"
    written(names=("time", "y", "x"), units=("", "", ""))
    assert "u (time 3 × y 5 × x 6) has no latitude along a dimension" in refused()
    written(names=("depth", "lat", "lon"), units=("m", "", ""))
    assert "u (depth 3 × lat 5 × lon 6) has more than time, latitude and longitude" in refused()
    written({name: np.full(SHAPE, np.nan, np.float32) for name in "uv"})
    assert refused() == "a.nc: coarse.file: no place has values of both at all time steps"
    written(latitude=np.array([0, 10, 5, 20, 30.0]))
    assert "the latitudes in lat neither rise nor fall throughout" in refused()
    written(latitude=np.array([0, 30, 60, 90, 120.0]))
    assert "latitudes in lat reach 120 degrees" in refused()


@pytest.mark.parametrize("version", [3, 4])
@pytest.mark.parametrize("how", ["missing", "empty", "cut short", "text", "zeros"])
def test_a_spoilt_file_is_refused_by_the_child(version: int, how: str) -> None:
    content = written(version=version).read_bytes()
    Path("a.nc").unlink()
    if how != "missing":
        Path("a.nc").write_bytes({"empty": b"", "cut short": content[:2 * len(content) // 3], "text": b"nothing",
                                  "zeros": content[:8] + bytes(len(content) - 8)}[how])
    line = refused()
    assert line.startswith("a.nc: coarse.u: " if (how, version) == ("zeros", 3) else "a.nc: coarse.file: ")
    assert any(word in line for word in ("no such file", "is no NetCDF file", "damaged", "no variable")), line


def test_cdf_5_is_named() -> None:
    Path("a.nc").write_bytes(b"CDF\x05" + bytes(60))
    assert "nccopy -k nc4 converts it" in refused()
