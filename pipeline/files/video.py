"""H.264 in MP4 and animated WebP, by PyAV: a figure's animation; and clips whose motion is measured."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from fractions import Fraction
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pipeline.errors import StorageFailed
from pipeline.files import atomic, sandbox
from pipeline.files.pictures import LUMA, as_bytes

MOST_FRAMES = 1000  # of a user's clip
ANY_EDGE = 1 << 20  # pixels: a frame of any size is left as it is
MILLISECOND = Fraction(1, 1000)  # WebP's unit of time
WEBP_QUALITY = 90  # of 100: no blocks are seen at full size
_FORMAT = {"movflags": "+faststart", "fflags": "+bitexact"}
# mbtree: x264's AVX-512 code for it reads beside its rows, and makes other bytes from run to run
_CODEC = {"preset": "slow", "tune": "animation", "x264-params": "mbtree=0"}


def write(path: Path, frames: Iterable[np.ndarray], fps: float, *, crf: int = 16) -> int:
    """Encode sRGB pictures (h, w, 3), uint8 or floats from 0 to 1, of one size; returns how many there were.

    yuv420p in Rec.709, which every player shows; of an odd width or height the last column or row stands
    twice. One thread: the same frames give the same bytes. crf: 0 is lossless, 16 looks like it, 23 is small.
    Raises ValueError for no frame, another size, or crf outside 0 to 51; `StorageFailed` if the disk is full.
    """
    if not 0 <= crf <= 51:
        raise ValueError(f"crf is 0 to 51, not {crf}")
    return _written(path, frames, "H.264", lambda file, pictures, shape: _encode(file, pictures, shape, fps, crf),
                    lambda file, count: _counted(file) == count)


def write_webp(path: Path, frames: Iterable[np.ndarray], fps: float) -> int:
    """Encode the same pictures as animated WebP that repeats without end; returns how many there were.

    Lossy, at a quality that looks clean; of any size up to 16383 pixels a side. A frame begins within half a
    millisecond of its time, the format's unit being one; the last stands as long as the others do on the whole. A
    picture that is the one before it lets that stand longer; if all are one, the file is a still. One thread: the same
    frames give the same bytes. Raises ValueError for no frame or another size, `StorageFailed` if libwebp refuses or
    the disk is full.
    """
    rate = _rate(fps)
    return _written(path, frames, "WebP", lambda file, pictures, shape: _encode_webp(file, pictures, shape, rate),
                    lambda file, count: _stands(file, count / rate))


def _written(path: Path, frames: Iterable[np.ndarray], name: str,
             encode: Callable[[Path, Iterable[np.ndarray], tuple[int, ...]], int],
             is_whole: Callable[[Path, int], bool]) -> int:
    """Encode `frames` beside `path`, read back what was written, and put it in place; how many there were."""
    import av

    pictures = iter(frames)
    first = next(pictures, None)
    if first is None:
        raise ValueError("a video has at least one frame")
    with atomic.replacing(path) as temporary:
        try:
            count = encode(temporary, chain([first], pictures), first.shape)
            whole = is_whole(temporary, count)
        except av.error.FFmpegError as error:
            if isinstance(error, OSError) and error.errno:
                raise atomic.storage_failure(path, error) from error
            raise StorageFailed(path, f"{name}: {error}") from error
        if not whole:
            raise StorageFailed(path, f"does not hold its {count} frames; is the disk full?")
    return count


def _rate(fps: float) -> Fraction:
    return Fraction(fps).limit_denominator(1001)


def _alike(pictures: Iterable[np.ndarray], shape: tuple[int, ...]) -> Iterable[np.ndarray]:
    """The pictures as bytes. Raises ValueError for one of another shape."""
    for number, picture in enumerate(pictures, start=1):
        if picture.shape != shape:
            raise ValueError(f"frame {number} has shape {picture.shape}, the first {shape}")
        yield as_bytes(picture)


def _encode(path: Path, pictures: Iterable[np.ndarray], shape: tuple[int, ...], fps: float, crf: int) -> int:
    import av
    from av.video.reformatter import ColorRange, Colorspace

    height, width, _ = shape
    odd = ((0, height % 2), (0, width % 2), (0, 0))
    count = 0
    with av.open(str(path), "w", format="mp4", options=_FORMAT) as container:
        options = {**_CODEC, "crf": str(crf)}
        stream = container.add_stream("libx264", rate=_rate(fps), options=options)
        stream.pix_fmt = "yuv420p"
        stream.width, stream.height = width + width % 2, height + height % 2
        stream.thread_count = 1
        context = stream.codec_context
        context.colorspace, context.color_range = Colorspace.ITU709, ColorRange.MPEG
        context.color_primaries = context.color_trc = 1  # Rec.709
        for picture in _alike(pictures, shape):
            count += 1
            frame = av.VideoFrame.from_ndarray(np.pad(picture, odd, mode="edge"), format="rgb24")
            container.mux(stream.encode(frame.reformat(
                format="yuv420p", dst_colorspace=Colorspace.ITU709, dst_color_range=ColorRange.MPEG)))
        container.mux(stream.encode())
    return count


def _counted(path: Path) -> int:
    """Frames that the file really holds."""
    import av

    with av.open(str(path)) as container:
        return sum(packet.size > 0 for packet in container.demux(video=0))


def _encode_webp(path: Path, pictures: Iterable[np.ndarray], shape: tuple[int, ...], rate: Fraction) -> int:
    import av

    count = 0
    with av.open(str(path), "w", format="webp", options={"loop": "0"}) as container:
        stream = container.add_stream("libwebp_anim", rate=rate, options={"quality": str(WEBP_QUALITY)})
        stream.pix_fmt = "bgra"
        stream.height, stream.width, _ = shape
        stream.thread_count = 1
        stream.codec_context.time_base = MILLISECOND
        for picture in _alike(pictures, shape):
            frame = av.VideoFrame.from_ndarray(picture, format="rgb24").reformat(format="bgra")
            start, end = (round(1000 * (count + shown) / rate) for shown in (0, 1))
            frame.time_base, frame.pts, frame.duration = MILLISECOND, start, end - start
            container.mux(stream.encode(frame))
            count += 1
        container.mux(stream.encode())
    return count


def _stands(path: Path, seconds: Fraction) -> bool:
    """Whether a WebP is whole, and its frames together stand so long, within 2 ms; a still, as long as one likes.

    Read chunk by chunk (RIFF), since FFmpeg does not decode animated WebP.
    """
    content = path.read_bytes()
    if content[:4] + content[8:12] != b"RIFFWEBP" or int.from_bytes(content[4:8], "little") + 8 != len(content):
        return False
    times, at = [], 12
    while at < len(content):
        size = int.from_bytes(content[at + 4:at + 8], "little")
        if content[at:at + 4] == b"ANMF":
            times.append(int.from_bytes(content[at + 20:at + 23], "little"))
        at += 8 + size + size % 2
    return at == len(content) and (not times or abs(sum(times) - 1000 * seconds) <= 2)


def _upright(path: Path, most: int, edge: int) -> Iterator[tuple[np.ndarray, float | None]]:
    """The frames (h, w, 3) uint8 of a file as a player shows them, each with its time in seconds, if it has one; scaled
    down where a side is over `edge` pixels.

    Raises ValueError for a file without video, that is cut short, or of more than `most` frames.
    """
    import av

    try:
        container = av.open(str(path))
    except (av.error.InvalidDataError, av.error.EOFError) as error:
        raise ValueError("damaged, or no video") from error
    with container:
        if not container.streams.video:
            raise ValueError("no video in it")
        stream = container.streams.video[0]
        there, count = 0, 0
        try:
            for packet in container.demux(stream):
                there += packet.size > 0
                if packet.is_corrupt:
                    raise ValueError("damaged or cut short")
                for frame in packet.decode():
                    if count == most:
                        raise ValueError(f"more than {most} frames; cut the clip")
                    count += 1
                    yield _shown(frame, edge), frame.time
        except av.error.FFmpegError as error:
            raise ValueError("damaged or cut short") from error
        if there < stream.frames:
            raise ValueError(f"cut short: {there} of its {stream.frames} frames are there")


def _shown(frame: Any, edge: int) -> np.ndarray:
    """The pixels (h, w, 3) uint8 of a decoded frame, scaled down to `edge`, turned and mirrored by its display matrix
    (9 numbers, by rows; ISO 14496-12 §8.3.2), to a right angle."""
    scale = min(1.0, edge / max(frame.width, frame.height))
    width, height = (max(1, round(n * scale)) for n in (frame.width, frame.height))
    picture: np.ndarray = frame.to_ndarray(format="rgb24", width=width, height=height, interpolation="AREA")
    stored = frame.side_data.get("DISPLAYMATRIX")
    if stored is None:
        return picture
    matrix = np.frombuffer(bytes(stored), np.int32)
    (xx, yx), (xy, yy) = matrix[:2].tolist(), matrix[3:5].tolist()  # xy: how x of the shown depends on y of the stored
    if abs(xx) + abs(yy) < abs(xy) + abs(yx):
        picture, xx, yy = picture.swapaxes(0, 1), xy, yx
    return picture[:: -1 if yy < 0 else 1, :: -1 if xx < 0 else 1]


def _frames(path: Path) -> dict[str, Any]:
    """Runs in the child: the frames (N, h, w, 3) uint8."""
    frames = [frame for frame, _ in _upright(path, MOST_FRAMES, ANY_EDGE)]
    if len(frames) < 2:
        raise ValueError(f"{len(frames)} frames; motion needs two")
    return {"frames": np.stack(frames)}


def read_grey(path: Path, key: str) -> np.ndarray:
    """The grey values (N, Y, X) float32, 0 to 1, lowest row first, of a user's clip (in a child process).

    `key` is the scene's, for the error. Raises `BadInput` if it is missing or damaged, or has fewer than two
    frames.
    """
    frames = sandbox.read(_frames, path, key)["frames"]
    return np.ascontiguousarray((frames.astype(np.float32) / 255 @ LUMA)[:, ::-1])


class Timed(NamedTuple):
    """Frames (N, Y, X) uint8 grey, lowest row first, and when each begins, (N,) float64, seconds; NaN: not told."""

    luma: np.ndarray
    times: np.ndarray


def _timed(path: Path, most: int, edge: int) -> dict[str, Any]:
    """Runs in the child: grey frames (N, h, w) uint8 and their times (N,)."""
    read = [(np.rint(frame.astype(np.float32) @ LUMA).astype(np.uint8), np.nan if time is None else time)
            for frame, time in _upright(path, most, edge)]
    if not read:
        raise ValueError("no frame in it")
    return {"luma": np.stack([luma for luma, _ in read]), "times": np.array([time for _, time in read], np.float64)}


def read_timed(path: Path, key: str, most: int, edge: int) -> Timed:
    """The frames of a user's clip, at most so many, scaled down to `edge` pixels a side (in a child process).

    `key` is the scene's, for the error. Raises `BadInput` if it is missing, damaged or cut short, or has more frames.
    """
    found = sandbox.read(_timed, path, key, most, edge)
    return Timed(np.ascontiguousarray(found["luma"][:, ::-1]), found["times"])
