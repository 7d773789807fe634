"""Bundles of threads: how they lie side by side."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from synth.elements import bundle


@pytest.mark.parametrize("count", [2, 7, 14, 200])
def test_a_section_is_round_and_as_dense_as_can_be(count: int) -> None:
    places = bundle.section(count, 1.5)
    assert places.shape == (count, 2) and np.abs(places.mean(0)).max() < 1e-9
    distance, _ = cKDTree(places).query(places, k=2)
    assert distance[:, 1] == pytest.approx(1.5)
    assert np.linalg.norm(places, axis=1).max() < 1.5 * (0.6 * np.sqrt(count) + 0.6)
