"""The motion in a clip: known motions are found, on every grid."""

import numpy as np
import pytest
from scipy import ndimage

from synth.optical_flow import coarse_flow, optical_flow


def cloud(shape: tuple[int, int], seed: int = 1) -> np.ndarray:
    """Smooth noise from 0 to 1."""
    noise = ndimage.gaussian_filter(np.random.default_rng(seed).random(shape), 2.5, mode="wrap")
    return (noise - noise.min()) / np.ptp(noise)


def turned(picture: np.ndarray, radians: float) -> np.ndarray:
    """A picture turned counter-clockwise (row 0 the lowest) round its middle."""
    height, width = picture.shape
    y, x = np.mgrid[:height, :width] - np.array([height - 1, width - 1]).reshape(2, 1, 1) / 2
    c, s = np.cos(radians), np.sin(radians)
    back = [c * y - s * x + (height - 1) / 2, s * y + c * x + (width - 1) / 2]
    return ndimage.map_coordinates(picture, back, order=3, mode="mirror")


def test_a_translation_is_found_to_a_tenth_of_a_pixel() -> None:
    frames = [ndimage.shift(cloud((90, 130)), (-0.7 * n, 2.4 * n), order=3, mode="grid-wrap") for n in range(4)]
    found = list(optical_flow(frames))
    assert len(found) == 3
    for flow in found:
        assert flow.shape == (90, 130, 2) and flow.dtype == np.float32
        inner = flow[12:-12, 12:-12]
        assert np.abs(inner.mean((0, 1)) - (2.4, -0.7)).max() < 0.03
        assert np.sqrt(np.mean((inner - (2.4, -0.7)) ** 2)) < 0.1


def test_a_rotation_is_found_to_a_tenth_of_a_pixel() -> None:
    angle = 0.03
    still = cloud((121, 121))
    (flow,) = optical_flow([still, turned(still, angle)])
    y, x = np.mgrid[:121, :121] - 60.0
    meant = np.stack([(np.cos(angle) - 1) * x - np.sin(angle) * y, np.sin(angle) * x + (np.cos(angle) - 1) * y], -1)
    near = np.hypot(x, y) < 50
    assert np.sqrt(np.mean((flow - meant)[near] ** 2)) < 0.1  # of up to 1.5 pixels


@pytest.mark.parametrize("shape", [(12, 16), (30, 40), (120, 160)])
def test_on_cells_it_is_in_cells_and_of_the_middle(shape: tuple[int, int]) -> None:
    """Right of the middle third the clip stands still; cells of 4 : 3 see the middle 100 of 240 columns alone."""
    still = cloud((75, 240))
    frames = [ndimage.shift(still, (0, 2 * n), order=3, mode="grid-wrap") for n in range(3)]
    for frame in frames:
        frame[:, 200:] = still[:, 200:]
    found = coarse_flow(frames, shape)
    assert found.shape == (2, *shape, 2) and found.dtype == np.float32
    inner = found[:, shape[0] // 6:-(shape[0] // 6), shape[1] // 6:-(shape[1] // 6)] * 75 / shape[0]
    assert np.abs(inner - (2, 0)).max() < 0.2 and np.abs(inner.mean((0, 1, 2)) - (2, 0)).max() < 0.03


def test_smoothing_is_over_time_and_round_the_end_where_the_clip_is_cyclic() -> None:
    still = cloud((64, 64))
    frames = [ndimage.shift(still, (0, x), order=3, mode="grid-wrap") for x in (0, 3, 3, 3, 3, 3, 3)]
    plain, smooth, cyclic = (coarse_flow(frames, (8, 8), *how)[:, 2:-2, 2:-2, 0].mean((1, 2))
                             for how in ((0.0,), (0.7,), (0.7, True)))
    assert plain[0] > 0.3 and np.abs(plain[1:]).max() < 0.01
    assert smooth[-1] < 0.01 * plain[0] < 0.1 * plain[0] < smooth[1] < smooth[0] < plain[0]
    assert np.isclose(cyclic[-1], cyclic[1], atol=0.01) and np.isclose(cyclic.sum(), plain.sum(), rtol=1e-3)


@pytest.mark.parametrize(("frames", "reason"), [
    ([], "two frames"), ([np.eye(32)], "two frames"), ([np.eye(32), np.eye(33)], "frame 2 .* not of the size"),
    ([np.zeros((32, 32, 3))] * 2, "frame 1 .* 3 dimensions"), ([np.eye(7)] * 2, "frame 1 .* too small"),
    ([np.eye(32), np.full((32, 32), np.nan)], "frame 2 .*not finite")])
def test_what_is_no_clip_is_refused(frames: list[np.ndarray], reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        list(optical_flow(frames))


def test_a_clip_that_stands_still_is_refused() -> None:
    with pytest.raises(ValueError, match="nothing moves"):
        coarse_flow([np.full((32, 32), 0.5)] * 3, (8, 8))
