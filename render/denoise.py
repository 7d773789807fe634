"""Denoising of path-traced smoke: each window of the picture is fitted to guides that have no noise.

The guides are a ray-marched picture of the same grid (`render.march`) and the studio without smoke. Within a
small window path-traced light is close to a linear function of them, so a weighted least-squares fit keeps
every edge that the guides show and averages the rest (first-order regression: Moon et al. 2014, Bitterli et
al. 2016). It is an approximation: what no guide shows is blurred to the size of the window.
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from render import march

SMOKE_WINDOW = 6.0  # standard deviation of the window where smoke is seen, pixels, at WINDOW_SPP paths
WINDOW_SPP = 8  # with more paths per pixel windows shrink: the picture tends to the path-traced one
SMALLEST_WINDOW = 2.0
FLOOR_WINDOW = 16.0  # where only the floor and its soft shadows are
BOWL_WINDOW = 3.0  # in the empty studio near the bowl, whose own shadow no guide shows
RIDGE = 1e-3  # of a guide's variance in the whole picture


def guides(seen: march.Seen, empty: march.EmptyStudio) -> np.ndarray:
    """The ray-marched guides of a picture, (h, w, 9) float32, without noise.

    The share of light that passes the smoke; the smoke's own light; the studio seen through it; for each
    lamp, the brightness of the studio in the smoke's shadow.
    """
    behind = seen.passed[..., None] * empty.light
    shaded = seen.shares * behind.mean(axis=-1)
    return np.concatenate([seen.passed[..., None], seen.smoke, behind, np.moveaxis(shaded, 0, -1)], -1,
                          dtype=np.float32)


def regressed(noisy: np.ndarray, guides: np.ndarray, window: float) -> np.ndarray:
    """`noisy` (h, w, 3), near each pixel, as a linear function of `guides` (h, w, G); (h, w, 3) float32.

    One fit for the whole picture; then the residual is fitted by least squares in a Gaussian window (`window` is its
    standard deviation in pixels) around each pixel. RIDGE keeps the second fit near zero where a guide hardly
    changes, so that it does not fit noise. Noise of a guide would remain in the result: guides must have none.
    """
    height, width, count = guides.shape
    spread = guides.std(axis=(0, 1), dtype=np.float64)
    scaled = ((guides - guides.mean(axis=(0, 1))) / np.maximum(spread, 1e-12)).astype(np.float64)
    # einsum, not matmul: a BLAS adds up in another order on another number of threads
    gram = np.einsum("hwi,hwj->ij", scaled, scaled) / (height * width) + 1e-6 * np.eye(count)
    global_slopes = np.linalg.solve(gram, np.einsum("hwi,hwc->ic", scaled, noisy) / (height * width))
    whole = np.einsum("hwi,ic->hwc", scaled, global_slopes)
    left = noisy - whole

    def near(values: np.ndarray) -> np.ndarray:
        return ndimage.gaussian_filter(values, window, mode="nearest", truncate=2.5)

    mean = np.stack([near(scaled[..., i]) for i in range(count)], axis=-1)
    level = np.stack([near(left[..., c]) for c in range(3)], axis=-1)
    square = np.empty((height, width, count, count))
    mixed = np.empty((height, width, count, 3))
    for i in range(count):
        for j in range(i, count):
            product = near(scaled[..., i] * scaled[..., j])
            square[..., i, j] = square[..., j, i] = product - mean[..., i] * mean[..., j]
        for c in range(3):
            mixed[..., i, c] = near(scaled[..., i] * left[..., c]) - mean[..., i] * level[..., c]
    square[..., range(count), range(count)] += RIDGE
    slopes = np.linalg.solve(square, mixed)
    fitted = whole + level + np.einsum("hwi,hwic->hwc", scaled - mean, slopes)
    return np.maximum(fitted, 0.0).astype(np.float32)


def quiet_studio(noisy: np.ndarray, distance: np.ndarray, bowl: np.ndarray) -> np.ndarray:
    """The light (h, w, 3) of the path-traced empty studio, denoised.

    distance  (h, w) to its surfaces
    bowl      (h, w, 3) the bowl's normals, zero where the backdrop is seen
    """
    guides = np.dstack([bowl, np.abs(bowl).sum(axis=2) > 0.0, np.log(distance)])
    share = _near(guides[..., 3], 8 * BOWL_WINDOW)
    light = share * regressed(noisy, guides, BOWL_WINDOW)
    light += (1.0 - share) * regressed(noisy, guides, FLOOR_WINDOW)
    return light


def _near(mask: np.ndarray, reach: float) -> np.ndarray:
    """1 (h, w, 1) where `mask` (h, w) is set or nearly so within `reach` pixels, fading to 0 beyond."""
    spread = ndimage.maximum_filter(mask, int(reach))
    return ndimage.gaussian_filter((spread > 0.01).astype(np.float32), 0.5 * reach)[..., None]


def denoised(noisy: np.ndarray, spp: int, seen: march.Seen, empty: march.EmptyStudio) -> np.ndarray:
    """`noisy` (h, w, 3), smoke in the studio path-traced with `spp` paths per pixel, denoised; float32.

    seen: the same smoke, ray-marched
    Windows are small where smoke is seen and large on the floor, where shadows are soft.
    """
    known = guides(seen, empty)
    shrunk = (WINDOW_SPP / max(spp, WINDOW_SPP)) ** 0.25  # half as wide for a quarter of the variance
    smoke = regressed(noisy, known, max(SMOKE_WINDOW * shrunk, SMALLEST_WINDOW))
    share = _near(1.0 - known[..., 0], 2 * SMOKE_WINDOW)
    return share * smoke + (1.0 - share) * regressed(noisy, known[..., 4:], FLOOR_WINDOW * shrunk)
