"""From linear light to display values: tone curve, sRGB transfer function, and eight bits without banding.

Renderers return linear Rec.709 light. Nothing is tone-mapped before this module, which a figure calls last.
"""

from __future__ import annotations

import functools
from typing import Literal

import numpy as np

Curve = Literal["filmic", "straight"]


def filmic(light: np.ndarray) -> np.ndarray:
    """Linear light tone-mapped to [0, 1]: a soft toe, a straight middle, a long shoulder.

    The rational fit of the ACES reference curve by Narkowicz (2015), as published.
    """
    x = np.maximum(light, 0.0)
    return np.clip(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14), 0.0, 1.0)


def to_srgb(linear: np.ndarray) -> np.ndarray:
    """The sRGB transfer function (IEC 61966-2-1) of linear values in [0, 1]; values outside are clipped."""
    x = np.clip(linear, 0.0, 1.0)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 1e-9) ** (1 / 2.4) - 0.055)


def from_srgb(display: np.ndarray) -> np.ndarray:
    """The inverse of `to_srgb`: the linear values of display values in [0, 1]."""
    return np.where(display <= 0.04045, display / 12.92, ((np.maximum(display, 0.04045) + 0.055) / 1.055) ** 2.4)


def to_display(light: np.ndarray, curve: Curve) -> np.ndarray:
    """Linear light (h, w, 3) as sRGB display values (h, w, 3) float32 in [0, 1].

    "filmic" for rendered scenes; "straight", without a tone curve, for ink, whose paper must stay white. Light with
    alpha (h, w, 4), by which its colours are multiplied, lies on white.
    """
    if light.shape[-1] == 4:
        light = light[..., :3] + (1 - light[..., 3:])
    return to_srgb(filmic(light) if curve == "filmic" else light).astype(np.float32)


def eight_bit(display: np.ndarray, seed: int = 0) -> np.ndarray:
    """Display values (h, w, 3) in [0, 1] as uint8, dithered with triangular noise of plus or minus one step.

    Without the noise a soft gradient would show banding. The noise depends on `seed` and shape only, so it
    does not flicker in an animation. Exact black and exact white stay exact.
    """
    display = np.clip(display, 0.0, 1.0)
    noise = np.where((display == 0.0) | (display == 1.0), np.float32(0.0), _triangular(display.shape, seed))
    return np.clip(np.rint(display * 255.0 + noise), 0, 255).astype(np.uint8)


@functools.lru_cache(maxsize=8)  # the same in every frame
def _triangular(shape: tuple[int, ...], seed: int) -> np.ndarray:
    """Noise between -1 and 1, the difference of two uniform numbers."""
    rng = np.random.Generator(np.random.Philox(key=seed))
    return np.asarray(rng.random(shape, dtype=np.float32) - rng.random(shape, dtype=np.float32))


_TO_CONES = np.array([[1.0, 0.3963377774, 0.2158037573],
                      [1.0, -0.1055613458, -0.0638541728],
                      [1.0, -0.0894841775, -1.2914855480]])
_TO_RGB = np.array([[4.0767416621, -3.3077115913, 0.2309699292],
                    [-1.2684380046, 2.6097574011, -0.3413193965],
                    [-0.0041960863, -0.7034186147, 1.7076147010]])


def oklab_to_linear(oklab: np.ndarray) -> np.ndarray:
    """Oklab (..., 3) (Ottosson 2020) as linear Rec.709, unclipped."""
    return (oklab @ _TO_CONES.T) ** 3 @ _TO_RGB.T


def linear_to_oklab(linear: np.ndarray) -> np.ndarray:
    """Linear Rec.709 (..., 3) as Oklab (..., 3), the inverse of `oklab_to_linear`: lightness, a and b, float64."""
    return np.asarray(np.cbrt(linear @ np.linalg.inv(_TO_RGB).T) @ np.linalg.inv(_TO_CONES).T)
