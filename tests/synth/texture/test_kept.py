"""States as arrays and back."""

from __future__ import annotations

import io
from dataclasses import dataclass

import numpy as np
import pytest

from synth.texture.kept import Kept


@dataclass(frozen=True, eq=False)
class Some(Kept):
    frame: int
    share: float
    place: np.ndarray
    fading: np.ndarray


ONE = Some(7, 0.25, np.arange(6.0).reshape(3, 2), np.array([True, False, True]))


def test_what_lay_in_a_file_is_the_same_with_its_types():
    kept = io.BytesIO()
    np.savez(kept, **ONE.arrays())
    kept.seek(0)
    with np.load(kept) as arrays:
        back = Some.of(arrays)
    assert (back.frame, back.share) == (7, 0.25)
    assert type(back.frame) is int and type(back.share) is float
    for name in ("place", "fading"):
        np.testing.assert_array_equal(getattr(back, name), getattr(ONE, name))
        assert getattr(back, name).dtype == getattr(ONE, name).dtype


def test_a_part_that_is_missing_is_noticed():
    arrays = ONE.arrays()
    del arrays["fading"]
    with pytest.raises(KeyError, match="fading"):
        Some.of(arrays)
