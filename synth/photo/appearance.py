"""The look of the target (okabe11 §6, "Recovery of Color Appearance", "Appearance Matching").

"We can synthesize an image that corresponds to the average image and add it onto the integrated differences … by
applying image-based motion blur [BE01] and Gaussian blur to the target image." Then the differences are given the
target's own strength of detail, band by band, and added where there is room for them: in the logit of the grey level,
so that white water does not clip and a dark pool does not turn grey.

Pictures are (Y, X[, 3]) float32, display-encoded, 0..1.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import ndimage

from synth.photo.integrate import BANDS, bands

SHUTTER = 8.0
"""Frames that the average is blurred over along the motion."""
SOFTENED = 0.5
"""σ of the Gaussian blur over the pixels that the motion passes in a frame; at least SHARPEST."""
SHARPEST = 1.0
LOCAL = 16.0
"""σ, pixels: over what round the strength of detail is compared."""
MOST = 3.0
"""The largest gain: a clip without detail is not made to have some."""
COARSEST = 0.4
"""Of its gain, the coarsest band's: there, differences are blotches as large as a piece."""
ROOM = 0.12
"""The least a (1 - a) by which differences are scaled: a logit knows no black and no white."""
OCTAVES = 3
EVENED = 1.4
"""The most by which an octave of a frame is strengthened, or weakened."""
NOISE = 0.004
"""Deviation below which a target has no detail: its own noise is not animated."""


def extended(picture: np.ndarray, fluid: np.ndarray) -> np.ndarray:
    """The picture with the fluid's colours outside of it (Y, X) bool too: no blur then brings in the shore's."""
    if fluid.all() or not fluid.any():
        return picture
    nearest = ndimage.distance_transform_edt(~fluid, return_distances=False, return_indices=True)
    return picture[tuple(nearest)]


def average(picture: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """The target's average image: picture (Y, X, C) blurred along motion (Y, X, 2), pixels per frame, then softened.

    "Kernel size is determined in proportion to the magnitude of the motion field."
    """
    import cv2

    u, v = (np.ascontiguousarray(motion[..., c], np.float32) for c in (0, 1))
    height, width = u.shape
    y, x = np.mgrid[:height, :width].astype(np.float32)
    half = SHUTTER / 2
    steps = max(1, int(np.ceil(half * float(np.hypot(u, v).max(initial=0)))))
    total = picture.astype(np.float32).copy()
    for sign in (1.0, -1.0):
        px, py = x.copy(), y.copy()
        for _ in range(steps):
            h = np.float32(sign * half / steps)
            du, dv = (cv2.remap(c, px, py, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE) for c in (u, v))
            px, py = px + h * du, py + h * dv
            total += cv2.remap(picture, px, py, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT).reshape(total.shape)
    blurred = total / np.float32(2 * steps + 1)
    # a Gaussian whose width changes from place to place: between three of fixed widths
    wanted = np.maximum(SOFTENED * np.hypot(u, v), SHARPEST)
    widths = [SHARPEST, max(2 * SHARPEST, float(wanted.max()) / 2), max(3 * SHARPEST, float(wanted.max()))]
    soft = [np.stack([ndimage.gaussian_filter(blurred[..., c], s, mode="nearest") for c in range(blurred.shape[2])], -1)
            for s in widths]
    at = np.interp(wanted, widths, [0, 1, 2])[..., None].astype(np.float32)
    return np.where(at < 1, soft[0] + at * (soft[1] - soft[0]), soft[1] + (at - 1) * (soft[2] - soft[1]))


def gains(target: np.ndarray, differences: np.ndarray, matte: np.ndarray) -> np.ndarray:
    """What makes differences (BANDS, T, Y, X) as strong as the detail of target (Y, X), in its units: (BANDS, Y, X).

    Deviations are local, of the fluid alone (matte (Y, X)), and of the differences over all time: their brightness may
    wander. Where the target is flat it is 0.
    """
    found = np.zeros((BANDS, *target.shape), np.float32)
    wanted = bands(target[None].astype(np.float32))
    wanted[-1] = wanted[-1] - ndimage.gaussian_filter(wanted[-1], (0, LOCAL, LOCAL), mode="nearest")
    for band in range(BANDS):
        ours = _local(wanted[band][0] ** 2, matte)
        theirs = _local((differences[band].astype(np.float64) ** 2).mean(axis=0), matte)
        flat = ours <= NOISE**2
        gain = np.where(flat, 0, np.sqrt(ours / np.maximum(theirs, 1e-12)))
        # differences are grey levels of 255
        found[band] = np.minimum(gain, MOST / 255) * (COARSEST if band == BANDS - 1 else 1)
    return found


def _local(values: np.ndarray, matte: np.ndarray) -> np.ndarray:
    """Means of values (Y, X) round each pixel, weighted by the matte."""
    share = ndimage.gaussian_filter(matte.astype(np.float64), LOCAL, mode="nearest")
    sums = ndimage.gaussian_filter(values * matte, LOCAL, mode="nearest")
    return np.asarray(sums / np.maximum(share, 1e-6))


def greys(picture: np.ndarray) -> np.ndarray:
    """The grey level of colours (..., 3): their mean. A reduction over so few takes NumPy five times as long."""
    return np.asarray((picture[..., 0] + picture[..., 1] + picture[..., 2]) / 3)


def added(ground: np.ndarray, more: np.ndarray) -> np.ndarray:
    """Pictures ground (..., 3) with `more` (...,), a change of the grey level, added where there is room: float32.

    In the logit of the grey level, and so never below 0 or above 1. Colours by one power each: what becomes darker
    becomes deeper, as flames do, and what becomes brighter whiter, as foam does.
    """
    grey = np.clip(greys(ground), 1e-4, 1 - 1e-4)
    room = np.maximum(grey * (1 - grey), ROOM)
    changed = 1 / (1 + np.exp(-(np.log(grey / (1 - grey)) + more / room)))
    # foam and dark water keep half of their hue, flames, which are saturated, redden and pale as a whole
    most = np.maximum(np.maximum(ground[..., 0], ground[..., 1]), ground[..., 2])
    least = np.minimum(np.minimum(ground[..., 0], ground[..., 1]), ground[..., 2])
    saturated = np.clip((most - least) / np.maximum(most, 1e-4), 0, 1)
    power = (np.log(changed) / np.log(grey)) ** (0.5 + 0.5 * saturated)
    coloured = np.clip(ground, 1e-4, 1) ** power[..., None]
    return np.clip(coloured * (changed / greys(coloured))[..., None], 0, 1).astype(np.float32)


def evening(frames: Sequence[np.ndarray], target: np.ndarray, fluid: np.ndarray) -> np.ndarray:
    """Gains (OCTAVES,) float64 that give frames, each (Y, X), the deviation of the target's octaves, where the fluid
    (Y, X) is: within EVENED of 1."""
    inside = fluid > 0.5

    def deviations(picture: np.ndarray) -> np.ndarray:
        return np.array([band[inside].std(dtype=np.float64) for band in octaves(picture)])

    ours = np.mean([deviations(frame) for frame in frames], axis=0)
    return np.clip(deviations(target) / np.maximum(ours, 1e-6), 1 / EVENED, EVENED)


def evened(picture: np.ndarray, gain: np.ndarray) -> np.ndarray:
    """A picture (Y, X, C) with the octaves of its grey level scaled by gains (OCTAVES,): float32."""
    bands_ = octaves(greys(picture))
    return added(picture, np.sum([(g - 1) * band for g, band in zip(gain, bands_, strict=True)], axis=0))


def octaves(picture: np.ndarray) -> list[np.ndarray]:
    """Differences of Gaussians of σ 0, 1, 2, 4 of a picture (Y, X): OCTAVES of (Y, X) float32, without what is left."""
    import cv2

    found, before = [], np.ascontiguousarray(picture, np.float32)
    for octave in range(OCTAVES):
        sigma = 1.0 if octave == 0 else np.sqrt(3.0) * 2 ** (octave - 1)
        after = cv2.GaussianBlur(before, (0, 0), sigma, borderType=cv2.BORDER_REFLECT)
        found.append(before - after)
        before = after
    return found


def matched(frame: np.ndarray, target: np.ndarray, matte: np.ndarray, region: int, overlapping: bool = True,
            ) -> np.ndarray:
    """A frame (Y, X) with the target's (Y, X) histograms of bands and values, region by region [Heeger, Bergen 1995].

    "We divide the image space into regular grids and apply the process to each region independently." Regions of
    `region` pixels overlap by half with windows that add up to one, or their lattice would show, as the paper's does.
    """
    ours, theirs = bands(frame[None].astype(np.float32)), bands(target[None].astype(np.float32))
    total, share = np.zeros(frame.shape), np.zeros(frame.shape)
    ramp, step = (np.sin(np.pi * (np.arange(region) + 0.5) / region) ** 2, region // 2) if overlapping else (
        np.ones(region), region)
    for y in range(step - region, frame.shape[0], step):
        for x in range(step - region, frame.shape[1], step):
            low, left = max(y, 0), max(x, 0)
            part = np.s_[low:y + region, left:x + region]
            inside = matte[part] > 0.5
            if not inside.any():
                continue
            window = np.multiply.outer(ramp[low - y:], ramp[left - x:])[:inside.shape[0], :inside.shape[1]]
            parts = [_equalized(a[0][part], b[0][part], inside) for a, b in zip(ours, theirs, strict=True)]
            values = _equalized(np.sum(parts, axis=0), target[part], inside)
            total[part] += window * values
            share[part] += window
    return np.where(share > 0, total / np.maximum(share, 1e-12), frame).astype(np.float32)


def _equalized(values: np.ndarray, wanted: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """values with the distribution of wanted, both of `inside` alone; outside as they are."""
    mine, theirs = values[inside], np.sort(wanted[inside])
    rank = np.empty(len(mine), np.int64)
    rank[np.argsort(mine, kind="stable")] = np.arange(len(mine))
    found = values.copy()
    found[inside] = theirs[rank]
    return found
