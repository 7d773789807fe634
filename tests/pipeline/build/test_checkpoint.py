"""Checkpoints: a state comes back as it was, and no state of anything else is gone on from."""

from pathlib import Path

import numpy as np
import pytest

from pipeline.build.checkpoint import Checkpoint


def checkpoint(folder: Path, keys: str = "abc") -> Checkpoint:
    return Checkpoint(folder / "x.state.npz", lambda frame: keys[frame] if frame < len(keys) else "")


def test_a_state_comes_back_with_its_frame_and_in_its_order(tmp_path: Path) -> None:
    state = {"b": np.arange(3.0), "a.0": np.ones((2, 2), np.float32), "a.1": np.array(5)}
    checkpoint(tmp_path).save(2, state)
    kept = checkpoint(tmp_path).load(before=3)
    assert kept is not None and kept[0] == 2
    assert list(kept[1]) == list(state)
    for name, values in state.items():
        np.testing.assert_array_equal(kept[1][name], values)
        assert kept[1][name].dtype == values.dtype


def test_there_is_none_at_first_and_none_at_or_after_the_frame_in_work(tmp_path: Path) -> None:
    assert checkpoint(tmp_path).load() is None
    checkpoint(tmp_path).save(2, {})
    assert checkpoint(tmp_path).load(before=2) is None
    assert checkpoint(tmp_path).load(before=3) == (2, {})


def test_a_state_of_work_without_frames_is_of_frame_0(tmp_path: Path) -> None:
    checkpoint(tmp_path).save(0, {"a": np.zeros(1)})
    assert checkpoint(tmp_path).load() is not None
    assert checkpoint(tmp_path).load(before=5) is None


def test_a_state_of_another_key_is_left_alone(tmp_path: Path) -> None:
    checkpoint(tmp_path).save(1, {"a": np.zeros(1)})
    assert checkpoint(tmp_path, "axc").load() is None
    assert checkpoint(tmp_path).load() is not None


@pytest.mark.parametrize("keep", [0, 10, 200])
def test_a_damaged_state_is_none(tmp_path: Path, keep: int) -> None:
    checkpoint(tmp_path).save(1, {"a": np.arange(1000.0)})
    file = tmp_path / "x.state.npz"
    file.write_bytes(file.read_bytes()[:keep])
    assert checkpoint(tmp_path).load() is None
