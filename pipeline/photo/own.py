"""A user's own clips: read from videos, and checked, before they join the clips that are made."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from pipeline.errors import BadInput
from pipeline.files import video

LEAST, MOST = 8, 480
"""Frames of a clip."""
SMALLEST, LARGEST = 64, 640
"""Pixels: the least side of a clip, and the longer side to which larger ones are scaled; the paper's are 640 x 480."""
STILL = 0.25
"""Mean grey levels between the darkest and the brightest that a pixel becomes: of a picture, however it was coded."""
LASTS = 1.5
"""How many times longer or shorter than most a frame lasts that is out of time."""
OUT_OF_TIME = 0.05
"""Share of the frames that may be: cameras drop one now and then."""


class OwnClip(NamedTuple):
    """Frames (T, Y, X) uint8 of a user's clip, grey, lowest row first, and how many there are per second."""

    luma: np.ndarray
    fps: float


def read_own(file: Path, at: str) -> OwnClip:
    """A user's video, larger ones scaled down; its velocity is what its optical flow says (okabe11 §4).

    `at` is the key of the scene, for the error. Raises BadInput for one that is no use: too short or too small, of a
    frame rate that varies, where nothing moves, with a cut, by a camera that moves.
    """
    from synth.photo.checks import SHAKEN, camera, cut

    read = video.read_timed(file, at, MOST, LARGEST)
    count, rows, columns = read.luma.shape
    if count < LEAST:
        raise BadInput(file, at, f"has {count} frame{'s' if count > 1 else ''}; a clip has at least {LEAST}")
    if min(rows, columns) < SMALLEST:
        raise BadInput(file, at, f"has {columns} x {rows} pixels; a clip has at least {SMALLEST} a side")
    fps = _rate(file, at, read.times)
    if np.ptp(read.luma, axis=0).mean() <= STILL:
        raise BadInput(file, at, "nothing moves in it")
    before = cut(read.luma)
    if before:
        raise BadInput(file, at, f"has a cut after frame {before}")
    shift = camera(read.luma)
    if shift > SHAKEN:
        raise BadInput(file, at, f"the camera moves, by {shift:.1f} pixels a frame")
    return OwnClip(read.luma, fps)


def _rate(file: Path, at: str, times: np.ndarray) -> float:
    """Frames per second; 0 where the file does not tell."""
    if not np.isfinite(times).all():
        return 0.0
    steps = np.diff(times)
    usual = float(np.median(steps))
    if usual <= 0:
        return 0.0
    out = (steps > LASTS * usual) | (steps * LASTS < usual)
    if out.mean() > OUT_OF_TIME:
        raise BadInput(file, at, f"has a variable frame rate: frames last {1000 * steps.min():.0f} to "
                                 f"{1000 * steps.max():.0f} ms; convert it to a constant one")
    return round((len(times) - 1) / float(times[-1] - times[0]), 3)
