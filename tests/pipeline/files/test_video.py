"""Videos hold every frame, in its colours, and the same bytes for the same frames."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import av
import cv2
import footage
import numpy as np
import pytest

from pipeline.errors import BadInput, StorageFailed
from pipeline.files import video


def frames(count: int = 5, height: int = 66, width: int = 97) -> Iterator[np.ndarray]:
    """A red bar that grows to the right over a green floor."""
    y, x = np.mgrid[0:height, 0:width]
    for t in range(count):
        picture = np.zeros((height, width, 3), np.float32)
        picture[x < 10 + 10 * t] = (0.9, 0.1, 0.1)
        picture[y > height * 0.7] = (0.1, 0.7, 0.2)
        yield picture


def test_colours_and_places_come_back(tmp_path: Path) -> None:
    path = tmp_path / "a.mp4"
    assert video.write(path, frames(), 30.0) == 5
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        assert stream.codec_context.name == "h264" and stream.codec_context.pix_fmt == "yuv420p"
        assert (stream.codec_context.width, stream.codec_context.height) == (98, 66)
        assert stream.average_rate == 30
        assert stream.codec_context.colorspace == 1  # Rec.709
        shown = [frame.to_ndarray(format="rgb24") / 255 for frame in container.decode(video=0)]
    assert len(shown) == 5
    for seen, meant in zip(shown, frames(), strict=True):
        # away from the edges, where the eye's colours are stored at half the size
        assert np.abs(seen[5, 4] - meant[5, 4]).max() < 0.03
        assert np.abs(seen[60, 50] - meant[60, 50]).max() < 0.03
        assert np.median(np.abs(seen[:, :97] - meant)) < 0.02


def test_the_same_frames_are_the_same_bytes(tmp_path: Path) -> None:
    """Also of sizes that are no multiple of 16, where x264 as it comes makes other bytes each time."""
    kept, contents = [], set()
    for n in range(8):
        video.write(tmp_path / "a.mp4", frames(), 24.0)
        contents.add((tmp_path / "a.mp4").read_bytes())
        kept.append(np.full(50_000 * (n + 1), n, np.uint8))  # another state of the memory
    assert len(contents) == 1


@pytest.mark.parametrize("fps", [30.0, 24.0, 12.5, 1000.0, 0.5])
def test_a_webp_repeats_the_pictures_without_end_each_in_its_time(tmp_path: Path, fps: float) -> None:
    """Of an odd width. Decoded by OpenCV, which takes it as a viewer does."""
    assert video.write_webp(tmp_path / "a.webp", frames(7), fps) == 7
    read, shown = cv2.imreadanimation(str(tmp_path / "a.webp"))
    assert read and shown.loop_count == 0 and len(shown.frames) == 7
    ends = np.cumsum(shown.durations)
    np.testing.assert_allclose(ends[:-1], np.arange(1, 7) * 1000 / fps, atol=0.51)
    assert abs(ends[-1] - 7000 / fps) < 1.6  # libwebp takes the mean of the others for the last
    for seen, meant in zip(shown.frames, frames(7), strict=True):
        seen = seen[..., 2::-1] / 255
        assert seen.shape == meant.shape == (66, 97, 3)
        # away from the edges, where colours are stored at half the size
        assert np.abs(seen[5, 4] - meant[5, 4]).max() < 0.03
        assert np.abs(seen[60, 60] - meant[60, 60]).max() < 0.03
        assert np.abs(seen - meant).mean() < 0.01


def test_a_picture_that_stays_stands_longer_and_one_that_never_changes_is_a_still(tmp_path: Path) -> None:
    first, second, _ = frames(3)
    video.write_webp(tmp_path / "a.webp", [first, first, first, second], 10.0)
    shown = cv2.imreadanimation(str(tmp_path / "a.webp"))[1]
    assert list(shown.durations) == [300, 100]
    assert video.write_webp(tmp_path / "a.webp", [first] * 3, 10.0) == 3
    assert np.abs(cv2.imread(str(tmp_path / "a.webp"))[..., ::-1] / 255 - first).mean() < 0.01


def test_the_same_frames_are_the_same_bytes_of_webp(tmp_path: Path) -> None:
    kept, contents = [], set()
    for n in range(4):
        video.write_webp(tmp_path / "a.webp", frames(), 24.0)
        contents.add((tmp_path / "a.webp").read_bytes())
        kept.append(np.full(50_000 * (n + 1), n, np.uint8))  # another state of the memory
    assert len(contents) == 1


@pytest.mark.parametrize("damage", [lambda b: b[:-2], lambda b: b[:len(b) // 2], lambda b: b + b"\0\0",
                                    lambda b: b"", lambda b: b.replace(b"ANMF", b"XXXX", 1)])
def test_a_webp_that_does_not_read_back_whole_does_not_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                                             damage: Callable[[bytes], bytes]) -> None:
    encode = video._encode_webp

    def damaged(path: Path, *given: Any) -> int:
        count = encode(path, *given)
        path.write_bytes(damage(path.read_bytes()))
        return count

    monkeypatch.setattr(video, "_encode_webp", damaged)
    with pytest.raises(StorageFailed, match="does not hold its 5 frames"):
        video.write_webp(tmp_path / "a.webp", frames(), 30.0)
    assert list(tmp_path.iterdir()) == []


def test_a_picture_too_wide_for_webp_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(StorageFailed, match="WebP: ") as caught:
        video.write_webp(tmp_path / "a.webp", [np.zeros((2, 16400, 3), np.uint8)], 30.0)
    assert "\n" not in str(caught.value) and list(tmp_path.iterdir()) == []


def test_what_is_no_animation_is_refused(tmp_path: Path) -> None:
    for given, reason in (([], "at least one frame"), ([np.zeros((4, 4, 3)), np.zeros((4, 6, 3))], "frame 2 has")):
        with pytest.raises(ValueError, match=reason):
            video.write_webp(tmp_path / "a.webp", given, 30.0)
    assert list(tmp_path.iterdir()) == []


def test_a_clip_is_read_grey_with_the_lowest_row_first(tmp_path: Path) -> None:
    video.write(tmp_path / "a.mp4", frames(), 30.0, crf=0)
    grey = video.read_grey(tmp_path / "a.mp4", "exemplar.file")
    assert grey.shape == (5, 66, 98) and grey.dtype == np.float32
    floor, red = 0.2126 * 0.1 + 0.7152 * 0.7 + 0.0722 * 0.2, 0.2126 * 0.9 + (0.7152 + 0.0722) * 0.1
    assert abs(grey[0, 3, 50] - floor) < 0.02
    assert abs(grey[0, 60, 4] - red) < 0.02 and grey[0, 60, 80] < 0.02
    assert abs(grey[4, 60, 40] - red) < 0.02


@pytest.mark.parametrize(("given", "crf", "reason"), [
    ([], 16, "at least one frame"),
    ([np.zeros((4, 4, 3)), np.zeros((4, 6, 3))], 16, r"frame 2 has shape \(4, 6, 3\)"),
    ([np.full((4, 4, 3), np.nan)], 16, "NaN"),
    ([np.zeros((4, 4, 3))], 52, "crf"),
])
def test_what_is_no_video_is_refused(tmp_path: Path, given: list[np.ndarray], crf: int, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        video.write(tmp_path / "a.mp4", given, 30.0, crf=crf)
    assert list(tmp_path.iterdir()) == []


def test_damaged_clips_are_one_line(tmp_path: Path) -> None:
    video.write(tmp_path / "whole.mp4", frames(), 30.0)
    content, cut = (tmp_path / "whole.mp4").read_bytes(), tmp_path / "cut.mp4"
    for damaged in (b"", content[:40], content[: len(content) // 3], b"no video at all"):
        cut.write_bytes(damaged)
        with pytest.raises(BadInput, match=r"cut\.mp4: exemplar\.file: ") as caught:
            video.read_grey(cut, "exemplar.file")
        assert "\n" not in str(caught.value)
    video.write(tmp_path / "one.mp4", frames(1), 30.0)
    with pytest.raises(BadInput, match="motion needs two"):
        video.read_grey(tmp_path / "one.mp4", "exemplar.file")


def test_a_full_disk_is_noticed(tiny_disk: Path) -> None:
    draw = np.random.Generator(np.random.Philox(key=1))
    noise = (draw.random((240, 320, 3), np.float32) for _ in range(8))
    with pytest.raises(StorageFailed, match="disk"):
        video.write(tiny_disk / "a.mp4", noise, 30.0, crf=4)
    assert list(tiny_disk.iterdir()) == []


@pytest.mark.parametrize(("matrix", "top", "left"), [
    ((1, 0, 0, 1), "white", "black"), ((0, 1, -1, 0), "black", "grey"), ((-1, 0, 0, -1), "grey", "grey"),
    ((0, -1, 1, 0), "grey", "white"), ((-1, 0, 0, 1), "white", "grey")])
def test_a_clip_is_turned_as_a_player_shows_it(tmp_path: Path, matrix: tuple[int, ...], top: str, left: str) -> None:
    """By its display matrix, mirrors too. The stored picture is white above, black to the left, grey elsewhere."""
    picture = np.full((64, 96, 3), 128, np.uint8)
    picture[:, :24] = 0
    picture[:16] = 255
    path = tmp_path / "a.mp4"
    video.write(path, [picture] * 3, 24.0)
    footage.turn(path, matrix)
    grey = video.read_timed(path, "clips.files[0]", 10, 640).luma[1][::-1]
    assert grey.shape == ((96, 64) if matrix[0] == 0 else (64, 96))
    np.testing.assert_allclose(video.read_grey(path, "coarse.file")[1][::-1], grey / 255, atol=0.01)
    shown = {"white": 255, "black": 0, "grey": 128}
    assert abs(np.median(grey[3]) - shown[top]) < 6
    assert abs(np.median(grey[:, 3]) - shown[left]) < 6


def test_a_clip_of_too_many_frames_is_refused_and_a_large_one_scaled(tmp_path: Path) -> None:
    video.write(tmp_path / "a.mp4", frames(12), 30.0)
    with pytest.raises(BadInput, match=r"a\.mp4: clips: more than 11 frames; cut the clip"):
        video.read_timed(tmp_path / "a.mp4", "clips", 11, 640)
    read = video.read_timed(tmp_path / "a.mp4", "clips", 12, 49)
    assert read.luma.shape == (12, 33, 49)
    np.testing.assert_allclose(read.times, np.arange(12) / 30, atol=1e-3)


def test_a_clip_cut_short_is_told_wherever_it_ends(tmp_path: Path) -> None:
    path = tmp_path / "a.mp4"
    video.write(path, frames(12), 30.0)
    content = path.read_bytes()
    for share in (0.3, 0.5, 0.8, 0.99):
        path.write_bytes(content[:int(share * len(content))])
        with pytest.raises(BadInput, match=r"cut short|no video"):
            video.read_timed(path, "clips", 100, 640)
