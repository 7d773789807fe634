"""What a camera might have brought: water that falls before a wall, and videos of frames. Imported as `footage`."""

import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pipeline.files import video


def grain(seed: int, shape: tuple[int, ...]) -> np.ndarray:
    """Smooth noise from 0 to 1 that repeats."""
    from scipy import ndimage

    values = ndimage.gaussian_filter(np.random.default_rng(seed).random(shape), 2, mode="wrap")
    return (values - values.min()) / np.ptp(values)


def falling(frames: int = 24) -> np.ndarray:
    """Water that falls in the middle of a wall that stands: (frames, 96, 128)."""
    wall, water = grain(1, (96, 128)), grain(2, (96, 128))
    inside = np.zeros((96, 128), bool)
    inside[:, 48:80] = True
    return np.stack([np.where(inside, np.roll(water, 3 * k, axis=0), wall) for k in range(frames)])


def write(file: Path, frames: np.ndarray) -> Path:
    """An MP4 of grey frames (T, h, w), at 24 a second."""
    video.write(file, np.repeat(frames[..., None], 3, axis=3), 24, crf=4)
    return file


def write_timed(file: Path, frames: np.ndarray, milliseconds: Sequence[int]) -> Path:
    """A Matroska file of grey frames of any size, lossless (FFV1), each at its time."""
    import av

    with av.open(str(file), "w") as container:
        stream = container.add_stream("ffv1", rate=24)
        stream.pix_fmt, (stream.height, stream.width) = "gray", frames.shape[1:]
        stream.codec_context.time_base = video.MILLISECOND
        for picture, time in zip(np.rint(255 * frames).astype(np.uint8), milliseconds, strict=True):
            frame = av.VideoFrame.from_ndarray(picture, format="gray")
            frame.time_base, frame.pts = video.MILLISECOND, int(time)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return file


def turn(file: Path, matrix: Sequence[int]) -> Path:
    """Give an MP4 the display matrix a, b, c, d: x' = a x + c y, y' = b x + d y."""
    a, b, c, d = (65536 * value for value in matrix)
    content = file.read_bytes()
    at = content.find(b"tkhd") + 44
    file.write_bytes(content[:at] + struct.pack(">9i", a, b, 0, c, d, 0, 0, 0, 1 << 30) + content[at + 36:])
    return file
