"""A user's own clips: what is no use is told in one line, what is, is read as a player shows it."""

from pathlib import Path

import footage
import numpy as np
import pytest
from footage import falling, grain

from pipeline.errors import BadInput
from pipeline.photo.own import read_own

PAN = np.stack([np.roll(grain(3, (96, 256)), 2 * k, axis=1)[:, :128] for k in range(24)])


def test_a_clip_is_read_lowest_row_first_with_its_rate(tmp_path: Path) -> None:
    frames = falling()
    frames[:, :20] = 0.9
    read = read_own(footage.write(tmp_path / "c.mp4", frames), "clips.files[0]")
    assert read.luma.shape == (24, 96, 128) and read.luma.dtype == np.uint8
    assert read.luma[:, 80:].mean() > 200 > read.luma[:, :60].mean()
    assert read.fps == 24


@pytest.mark.parametrize(("frames", "told"), [
    (np.concatenate([falling(12), 1 - falling(12)]), "has a cut after frame 12"),
    (PAN, "the camera moves, by 2.0 pixels a frame"),
    (np.repeat(falling(1), 12, axis=0), "nothing moves in it"),
    (falling(4), "has 4 frames; a clip has at least 8"), (falling(1), "has 1 frame; a clip has at least 8"),
    (falling()[:, :40], "has 128 x 40 pixels; a clip has at least 64 a side")])
def test_what_is_no_use_is_told(tmp_path: Path, frames: np.ndarray, told: str) -> None:
    with pytest.raises(BadInput) as caught:
        read_own(footage.write(tmp_path / "c.mp4", frames), "clips.files[0]")
    assert str(caught.value) == f"{tmp_path}/c.mp4: clips.files[0]: {told}"


def test_a_frame_rate_may_stumble_and_not_vary(tmp_path: Path) -> None:
    """Of 24 frames one may be late."""
    late = [42 * k + (40 if k > 11 else 0) for k in range(24)]
    assert read_own(footage.write_timed(tmp_path / "c.mkv", falling(), late), "").fps == pytest.approx(22.8, abs=0.2)
    varying = np.cumsum([20, 20, 100] * 8)
    with pytest.raises(BadInput, match=r"c\.mkv: has a variable frame rate: frames last 20 to 100 ms; convert"):
        read_own(footage.write_timed(tmp_path / "c.mkv", falling(), varying), "")


def test_odd_sizes_are_kept_and_large_ones_scaled_down(tmp_path: Path) -> None:
    times = list(range(0, 24 * 42, 42))
    odd = read_own(footage.write_timed(tmp_path / "c.mkv", falling()[:, :95, :127], times), "")
    assert odd.luma.shape == (24, 95, 127)
    wide = np.repeat(np.repeat(falling(), 8, axis=1), 8, axis=2)
    assert read_own(footage.write(tmp_path / "c.mp4", wide), "").luma.shape == (24, 480, 640)
