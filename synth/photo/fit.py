"""Pieces fitted to the target's edges (beyond okabe11, whose §7.2 wishes for less noise where no piece fits well).

A database has each clip in a few versions. Once a piece is chosen, it is turned and enlarged a little more, as far as
its edges then lie more like those of the target: the edge of a fall, the direction of its streaks.
"""

from __future__ import annotations

import numpy as np

from synth.photo.assign import Nodes, Shown
from synth.photo.index import CELLS, exposures
from synth.photo.integrate import Frames, by_clip
from synth.photo.pieces import FITS, VERSIONS, Cut, fitted_vectors, pixels

GAINED = 0.03
"""By how much edges must be more alike for a fit to be taken."""


def fitted(grey: np.ndarray, of: Nodes, shown: Shown, exposure: np.ndarray, frames: Frames, cut: Cut) -> Shown:
    """What nodes show, each fitted to the target grey (Y, X) uint8. exposure (P,) int: which each is compared by."""
    margin = cut.size
    wide = np.pad(grey, margin, mode="symmetric")
    fit, motion = shown.fit.copy(), shown.motion.copy()
    pictures: dict[tuple[int, int], np.ndarray] = {}
    for p, small, shape in by_clip(shown, frames):
        clip, version = int(shown.clip[p]), VERSIONS[int(shown.version[p])]
        key = (clip, small.shape[1])
        if key not in pictures:
            pictures = {key: np.stack(exposures(small))}
        picture = pictures[key][int(exposure[p])][None]
        y, x = (of.corner[p] + margin).tolist()
        wanted = edges(wide[y:y + cut.size, x:x + cut.size])
        corner = (int(shown.corner[p, 0]), int(shown.corner[p, 1]))
        alike = np.array([(wanted * edges(pixels(picture, shape, corner, cut, version, of_)[0])).sum() for of_ in FITS])
        if alike.max() > alike[0] + GAINED:
            fit[p] = alike.argmax()
            motion[p] = fitted_vectors(motion[p], FITS[int(fit[p])])
    return shown._replace(fit=fit, motion=motion)


def edges(picture: np.ndarray) -> np.ndarray:
    """How strong edges are and where they lead, in CELLS² cells of a picture (size, size) uint8: (CELLS, CELLS, 2).

    The two parts of its structure tensor that turn with it, of length 1 in all: the scalar product of two is how much
    edges are alike, in -1..1, whatever the contrast and whichever side is bright.
    """
    import cv2

    soft = cv2.GaussianBlur(picture.astype(np.float32), (0, 0), 1.0)
    dy, dx = np.gradient(soft)
    found = cv2.resize(np.stack([dx * dx - dy * dy, 2 * dx * dy], axis=-1), (CELLS, CELLS),
                       interpolation=cv2.INTER_AREA)
    return np.asarray(found / max(float(np.sqrt((found.astype(np.float64) ** 2).sum())), 1e-6))
