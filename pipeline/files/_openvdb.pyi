"""The compiled binding of OpenVDB (openvdb.cpp). Raises RuntimeError with OpenVDB's words."""

from typing import Any

import numpy as np

version: str

def write(
    path: str,
    grids: list[tuple[str, np.ndarray, dict[str, str]]],
    voxel_size: float,
    origin: list[float],
    metadata: dict[str, str],
    half: bool,
) -> None: ...
def contents(path: str) -> tuple[list[dict[str, Any]], dict[str, str]]: ...
def values(path: str, name: str, size: list[int], most: int) -> tuple[list[int], np.ndarray]: ...
