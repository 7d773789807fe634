"""Local frames: orthonormal, along what they should follow, without flips."""

import numpy as np
import pytest

from synth.elements import orientation


def orthonormal(frames: np.ndarray) -> bool:
    unit = np.einsum("nij,nik->njk", frames, frames)
    return np.allclose(unit, np.eye(frames.shape[-1]), atol=1e-5) and np.allclose(np.linalg.det(frames), 1, atol=1e-5)


def helix(turns: float) -> np.ndarray:
    """Two threads that wind and sway, (5, 2, 40, 3)."""
    s, t = np.linspace(0, 1, 40), np.linspace(0, 1, 5)[:, None]
    x, y = np.cos(2 * np.pi * turns * s + t), np.sin(2 * np.pi * turns * s + t)
    one = np.stack([x, y, np.broadcast_to(3 * s, x.shape)], axis=-1)
    return np.stack([one, one + np.array([3, 0, 0])], axis=1)


def test_along_threads() -> None:
    positions = helix(2)
    frames = orientation.along_threads(positions)
    assert orthonormal(frames)
    tangent = np.gradient(positions, axis=2).reshape(-1, 3)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    assert np.allclose(frames[:, :, 2], tangent, atol=1e-5)
    lines = frames.reshape(5, 2, 40, 3, 3)
    assert np.einsum("tesij,tesij->tes", lines[:, :, 1:], lines[:, :, :-1]).min() > 2.5  # a flip would give 1 or less
    assert np.einsum("tesij,tesij->tes", lines[1:], lines[:-1]).min() > 2.5


def test_a_straight_thread_has_the_axes() -> None:
    positions = np.zeros((2, 1, 6, 3))
    positions[..., 2] = np.arange(6)
    assert np.allclose(orientation.along_threads(positions), np.eye(3), atol=1e-6)


def test_on_sheets() -> None:
    rng = np.random.Generator(np.random.Philox(key=2))
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    v, u = np.meshgrid(np.arange(4), np.arange(5), indexing="ij")
    flat = np.stack([u, v, np.zeros_like(u)], axis=-1).reshape(-1, 3) @ turn.T
    frames = orientation.on_sheets(flat[None, None], (4, 5))
    assert orthonormal(frames) and np.allclose(frames, turn, atol=1e-5)


@pytest.mark.parametrize("dims", [2, 3])
def test_along_directions(dims: int) -> None:
    rng = np.random.Generator(np.random.Philox(key=3))
    direction = rng.normal(size=(50, dims))
    direction[0] = 0
    direction[1] = np.eye(dims)[1]
    frames = orientation.along_directions(direction)
    assert orthonormal(frames)
    length = np.linalg.norm(direction[1:], axis=1, keepdims=True)
    assert np.allclose(frames[1:, :, 0], direction[1:] / length, atol=1e-5)
    if dims == 3:
        assert (frames[2:, 1, 1] > 0).all(), "nothing stands on its head"
