"""Whether a clip may enter a database: it moves, keeps its range, stays the same throughout, repeats without a jump,
its mean has detail, and its velocity is what is seen.

Pictures alone do not show a thin line at the edge where a fall should be; `faults` names what is wrong.
"""

from __future__ import annotations

import itertools

import numpy as np
from scipy import ndimage

from synth.photo.clip import Clip

MOVES = 2.0  # grey levels that a moving pixel deviates by
NEAR = 4  # frames on either side of the end of a loop
FINE = 6.0  # pixels: detail is what a blur of this deviation removes
LEAST_SPEED = 0.3  # pixels per frame; slower directions are not compared
LEAST_COVERAGE = 0.3

# what a clip may have at worst
LEAST_MOVING = 0.05
MOST_CLIPPED = 0.02
MOST_DRIFT = 0.15
MOST_JUMP = 1.05
LEAST_DETAIL = 0.3
MOST_TURN = 30.0
SHAKEN = 0.25  # pixels that the whole frame moves from one to the next: the camera moves

PAIRS = 12  # frames that are compared with their next, to know a camera that moves
BORDER = 8  # pixels that come into view
CUT = 1.5  # steps: one that is so many times the largest of those around it may be a cut
LASTING = 1.35  # if the means before and after it also differ so many times more than elsewhere: no frame was just lost
CALM = 0.5  # grey levels: the steps of the calmest clip in which cuts are told
EXPLAINED = 0.5  # of the change between two frames, what is left when a shift explains it


def moving(clip: Clip) -> float:
    """The share of pixels whose grey deviates by more than MOVES over time."""
    return float((_deviation(clip.luma) > MOVES).mean())


def clipped(clip: Clip) -> float:
    """The share of values, over all pixels and frames, that are black or white."""
    return float(((clip.luma == 0) | (clip.luma == 255)).mean())


def drift(clip: Clip) -> float:
    """How far the halves of a clip differ, in mean and in deviation over pixels, in deviations of the whole."""
    luma = clip.luma
    first, second = luma[: len(luma) // 2].astype(np.float32), luma[len(luma) // 2 :].astype(np.float32)
    return float(max(abs(first.mean() - second.mean()), abs(first.std() - second.std())) / luma.std())


def jump(clip: Clip) -> float:
    """The mean difference of the last frame and the first, over the median of the NEAR steps before it and after it.

    Not of all steps: the pace of clouds and flames itself changes in the course of a clip.
    """
    around = np.roll(clip.luma, NEAR, axis=0)[: 2 * NEAR + 1].astype(np.int16)
    steps = np.abs(np.diff(around, axis=0)).mean((1, 2))
    others = np.delete(steps, NEAR - 1)
    return float(steps[NEAR - 1] / max(np.median(others), 1e-6))


def detail(clip: Clip) -> float:
    """The deviation of detail in the mean picture, over that in one frame."""
    mean = _fine(clip.luma.astype(np.float32).mean(0)).std()
    frames = [_fine(frame.astype(np.float32)).std() for frame in clip.luma[:: max(1, len(clip.luma) // 8)]]
    return float(mean / max(np.mean(frames), 1e-6))


def turn(clip: Clip, pairs: int = 16) -> float:
    """The median angle, degrees, between the velocity and what optical flow sees on the mean of `pairs` frames.

    Only where fluid covers LEAST_COVERAGE, moves at LEAST_SPEED and changes by MOVES; 180 where there is no such pixel.
    The flow is Dense Inverse Search [Kroeger et al. 2016].
    """
    flow = seen(clip, pairs)
    v = clip.velocity
    there = (clip.coverage > LEAST_COVERAGE) & (np.hypot(v[..., 0], v[..., 1]) > LEAST_SPEED)
    there &= _deviation(clip.luma) > MOVES
    if not there.any():
        return 180.0
    angle = np.arctan2(v[..., 0] * flow[..., 1] - v[..., 1] * flow[..., 0], (v * flow).sum(-1))
    return float(np.degrees(np.median(np.abs(angle[there]))))


def seen(clip: Clip, pairs: int) -> np.ndarray:
    """The mean optical flow of `pairs` pairs of successive frames, (Y, X, 2) float32, pixels per frame, y up."""
    import cv2

    search = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    total = np.zeros((*clip.luma.shape[1:], 2), np.float32)
    for t in np.linspace(0, len(clip.luma) - 2, pairs).astype(int):
        total += search.calc(clip.luma[t], clip.luma[t + 1], None)
    return total / pairs


def faults(clip: Clip) -> list[str]:
    """What keeps a clip from a database, one line each; empty for a good one."""
    measured = [(moving(clip), LEAST_MOVING, "moves: {:.3f} of the pixels, at least {}"),
                (-clipped(clip), -MOST_CLIPPED, "is clipped: {:.3f} of the values, at most {}"),
                (-drift(clip), -MOST_DRIFT, "changes: its halves differ by {:.3f} deviations, at most {}"),
                (-jump(clip), -MOST_JUMP, "jumps from its last frame to the first: {:.3f} steps, at most {}"),
                (detail(clip), LEAST_DETAIL, "has a flat mean: {:.3f} of a frame's detail, at least {}"),
                (-turn(clip), -MOST_TURN, "moves otherwise than its velocity: by {:.1f} degrees, at most {}")]
    return [text.format(abs(value), abs(bound)) for value, bound, text in measured if value < bound]


def _deviation(luma: np.ndarray) -> np.ndarray:
    return luma.astype(np.float32).std(0)


def _fine(picture: np.ndarray) -> np.ndarray:
    return picture - ndimage.gaussian_filter(picture, FINE)


def camera(luma: np.ndarray) -> float:
    """By how many pixels a moving camera moves the whole of a frame on, at the median: luma (T, Y, X) uint8.

    0 where no shift explains what changes: a river that fills the picture flows on all sides as a pan does, but it
    changes its shape, and its stones stay.
    """
    pairs = range(0, len(luma) - 1, max(1, (len(luma) - 1) // PAIRS))
    return float(np.median([_panned(luma[k], luma[k + 1]) for k in pairs]))


def _panned(one: np.ndarray, other: np.ndarray) -> float:
    """Length of the shift that turns one frame into the other; 0 if none does."""
    import cv2

    dis = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    x, y = np.median(dis.calc(one, other, None).reshape(-1, 2), axis=0)
    moved = ndimage.shift(one.astype(np.float32), (y, x), order=1, mode="nearest")
    inside = np.s_[BORDER:-BORDER, BORDER:-BORDER]
    left = np.abs(other - moved)[inside].mean()
    return float(np.hypot(x, y)) if left < EXPLAINED * np.abs(other - one.astype(np.float32))[inside].mean() else 0.0


def cut(luma: np.ndarray) -> int:
    """The frame, counted from 1, after which a clip (T, Y, X) uint8 shows something else; 0 where there is no cut.

    1. The step from each frame to the next, over the largest of NEAR steps on either side.
    2. Of the steps that stand out, one after which the mean of NEAR frames is another than before: of water and fire it
       hardly changes, however much of it a camera leaves out.
    """
    # 1. steps
    steps = np.array([np.abs(after - before.astype(np.int16)).mean() for before, after in itertools.pairwise(luma)])
    around = np.array([max(CALM, *steps[max(0, k - NEAR):k], *steps[k + 1:k + 1 + NEAR]) for k in range(len(steps))])
    # 2. what lasts
    changes = np.array([np.abs(_mean(luma, k + 1, k + 1 + NEAR) - _mean(luma, k + 1 - NEAR, k + 1)).mean()
                        for k in range(len(steps))])
    for k in np.argsort(-steps / around, kind="stable"):
        if steps[k] < CUT * around[k]:
            break
        elsewhere = np.delete(changes, np.s_[max(0, k - NEAR):k + NEAR + 1])
        if not len(elsewhere) or changes[k] > LASTING * np.median(elsewhere):
            return int(k) + 1
    return 0


def _mean(luma: np.ndarray, first: int, last: int) -> np.ndarray:
    return luma[max(0, first):last].mean(axis=0, dtype=np.float32)
