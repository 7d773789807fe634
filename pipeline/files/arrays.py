"""Named arrays as one `.npz`: what our artifacts hand to each other that is no picture, volume or mesh."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from pipeline.errors import BadInput, StorageFailed
from pipeline.files import atomic
from pipeline.files.format import Format

_NAMES = "flowloom_arrays"  # the names of all: a damaged directory of a zip loses entries without a word
_LONG_AGO = (1980, 1, 1, 0, 0, 0)  # the same arrays give the same bytes
Arrays = Mapping[str, np.ndarray]


def write(path: Path, arrays: Arrays, names: str = _NAMES) -> None:
    """Write arrays of numbers, beside a list of all under `names`, and read them back.

    Raises `StorageFailed` if they do not read back.
    """
    with atomic.replacing(path) as temporary:
        with zipfile.ZipFile(temporary, "w") as archive:
            for name, array in {names: np.array(list(arrays)), **arrays}.items():
                with archive.open(zipfile.ZipInfo(f"{name}.npy", _LONG_AGO), "w", force_zip64=True) as entry:
                    np.lib.format.write_array(entry, np.asarray(array, order="C"), allow_pickle=False)
        try:
            back = read(temporary, names)
        except BadInput as error:
            raise StorageFailed(path, f"did not read back ({error.reason}); is the disk full?") from error
        for name, array in arrays.items():
            if not np.array_equal(back[name], array):
                raise StorageFailed(path, f"'{name}' did not read back as it was written; is the disk full?")


def read(path: Path, names: str = _NAMES) -> dict[str, np.ndarray]:
    """The arrays that `write` wrote. Raises `BadInput` for a file that is missing or damaged."""
    if not path.is_file():
        raise BadInput(path, "", "no such file")
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            found = dict(stored)
    except MemoryError:
        raise
    except Exception as error:  # zipfile and numpy raise anything at a file cut short
        raise BadInput(path, "", f"damaged or cut short ({error or type(error).__name__})") from error
    lost = set(np.ravel(found.pop(names, np.array([""]))).tolist()) - found.keys()
    if lost:
        raise BadInput(path, "", f"damaged: {', '.join(map(str, lost)) or 'its list of arrays'} is lost")
    return found


ARRAYS = Format("npz", write, read)
