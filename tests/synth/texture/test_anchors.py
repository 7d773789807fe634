"""Anchors: use is counted round each, and dull or used places are dear."""

import numpy as np

from synth.texture.anchors import Anchors
from synth.texture.patches import SPREAD, Painter
from synth.texture.procedural import canes
from synth.texture.sample import sample


def anchors(usage: float = 0.6, colour: np.ndarray | None = None) -> Anchors:
    return Anchors(Painter(sample(canes(64) if colour is None else colour), (1, 1), 1.7, 1.5, 9.0), usage, 3)


def test_use_is_a_disc_round_each_anchor_and_goes_again() -> None:
    one, none = anchors(), np.zeros((64, 64), np.int32)
    used = one.used(none, np.array([[30, 20], [0, 63]]), 1)
    y, x = np.mgrid[:64, :64]
    expected = (np.hypot(x - 30, y - 20) <= SPREAD).astype(int) + (np.hypot(x, y - 63) <= SPREAD)
    np.testing.assert_array_equal(used, expected)
    assert not none.any()
    np.testing.assert_array_equal(one.used(used, np.array([[0, 63], [30, 20]]), -1), none)


def test_what_is_in_use_is_dearer_by_the_weight_of_use() -> None:
    usage = np.zeros((64, 64), np.int32)
    usage[:, :16] = 4  # four times the mean
    cheap, dear = anchors(0.0).dear(usage), anchors(0.5).dear(usage)
    np.testing.assert_allclose((1 + dear[:, :16]) / (1 + cheap[:, :16]), 1 + 0.5 * 4, rtol=1e-5)
    np.testing.assert_array_equal(dear[:, 16:], cheap[:, 16:])


def test_what_is_dull_is_dear() -> None:
    colour = canes(64)
    colour[:, :32] = colour.mean(axis=(0, 1))
    dear = anchors(0.6, colour).dear(np.zeros((64, 64), np.int32))
    assert dear[:, :16].min() > 0.5 > 0 > dear[:, 48:].mean()


def test_anywhere_has_room_and_differs_from_patch_to_patch() -> None:
    one, radius = anchors(), np.array([9], np.float32)
    found = np.array([one.anywhere(radius, 5, number) for number in range(40)])
    assert (one.painter.room[found[:, 1], found[:, 0]] >= one.painter.needs(radius)[0]).all()
    assert len(np.unique(found, axis=0)) > 30
    np.testing.assert_array_equal(found[7], one.anywhere(radius, 5, 7))
