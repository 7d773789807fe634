"""A rising plume: stable fluids [Stam 1999] with buoyancy and vorticity confinement [Fedkiw et al. 2001].

The coarse motion of ma09 figures 1, 4, 5, 10 and 11. Velocity, density and temperature lie at cell centres;
walls all round. Meant for low resolutions (64^2, 24^2 x 32), where a frame takes milliseconds.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from synth.advect import advect
from synth.noise import gradient_noise
from synth.projection import project


def simulate(shape: tuple[int, ...], frames: int, *, seed: int, radius: float = 0.08, height: float = 0.1,
             buoyancy: float = 9.5e-4, confinement: float = 0.15, cooling: float = 0.01, sway: float = 2.0,
             sway_period: float = 20.0, warmup: int = 0) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Frames of a plume that rises from a hot ball above the floor.

    shape        (Y, X) or (Z, Y, X) cells
    radius       of the source, world units (the domain is 1 high)
    height       of the source's centre, world units
    buoyancy     upward acceleration of source-hot smoke, heights per frame^2
    confinement  epsilon of Fedkiw et al. eq. 11: how strongly vortices are kept from fading, per frame
    cooling      share of the temperature lost in a frame
    sway         sideways acceleration of the hot smoke by seeded gusts, in buoyancies: without, a plume rises
                 dead straight and mirror-symmetric
    sway_period  frames in which the gusts change direction
    warmup       frames to simulate before the first
    Yields per frame (velocity (*shape, D) float32 in cells per frame, density (*shape) float32 in [0, 1]).
    The velocity's `projection.divergence` is zero to rounding, and so is the flow through the walls.
    """
    if min(shape) < 4:
        raise ValueError(f"a smoke simulation needs at least 4 cells along each axis, not {shape}")
    if not (radius > 0 and 0 <= cooling < 1 and sway_period > 0 and warmup >= 0):
        raise ValueError("smoke needs radius > 0, 0 <= cooling < 1, sway_period > 0 and warmup >= 0")
    v = np.zeros((*shape, len(shape)), np.float32)
    density = np.zeros(shape, np.float32)
    temperature = np.zeros(shape, np.float32)
    source = _source(shape, radius, height)
    for frame in range(-warmup, frames):
        density = np.maximum(density, source)
        temperature = np.maximum(temperature, source)
        lift = np.float32(buoyancy * shape[-2]) * temperature
        v[..., 1] += lift
        gusts = (sway * _gusts(shape, frame, seed, sway_period)).astype(np.float32)
        for k, component in enumerate(range(0, len(shape), 2)):  # x, and z where there is one
            v[..., component] += lift * gusts[:, k, None]
        v += np.float32(confinement) * confining_force(v)
        carried = advect(np.concatenate([v, density[..., None], temperature[..., None]], -1), v)
        v = project(carried[..., : len(shape)], "wall")
        density = carried[..., -2]
        temperature = carried[..., -1] * np.float32(1 - cooling)
        if frame >= 0:
            yield v.copy(), density.copy()


def vorticity(v: np.ndarray) -> np.ndarray:
    """Curl by central differences, one-sided at the border: (Y, X, 2) -> (Y, X); (Z, Y, X, 3) -> the same shape."""
    dimension = v.ndim - 1

    def slope(component: int, along: int) -> np.ndarray:
        return np.gradient(v[..., component], axis=dimension - 1 - along)

    if dimension == 2:
        return slope(1, 0) - slope(0, 1)
    return np.stack([slope(2, 1) - slope(1, 2), slope(0, 2) - slope(2, 0), slope(1, 0) - slope(0, 1)], -1)


def confining_force(v: np.ndarray) -> np.ndarray:
    """N x vorticity, N the direction towards stronger vorticity [Fedkiw et al. 2001, eq. 9 to 11, without epsilon].

    (Y, X, 2) or (Z, Y, X, 3) float32 -> the same shape, per frame.
    """
    w = vorticity(v)
    strength = np.abs(w) if v.ndim == 3 else np.linalg.norm(w, axis=-1)
    towards = np.stack(np.gradient(strength)[::-1], -1)
    towards /= np.linalg.norm(towards, axis=-1, keepdims=True) + 1e-6 * max(float(strength.max()), 1e-12)
    if v.ndim == 3:  # in the plane, the vorticity points along z
        return np.stack([towards[..., 1] * w, -towards[..., 0] * w], -1).astype(np.float32)
    return np.cross(towards, w).astype(np.float32)


def _source(shape: tuple[int, ...], radius: float, height: float) -> np.ndarray:
    """The hot ball: 1 inside, with a soft edge of half its radius."""
    squared = np.zeros(shape)
    for axis, n in enumerate(shape):
        position = (np.arange(n) + 0.5) / shape[-2]
        centre = height if axis == len(shape) - 2 else 0.5 * n / shape[-2]
        squared += ((position - centre) ** 2).reshape([-1 if a == axis else 1 for a in range(len(shape))])
    inside = np.clip((radius - np.sqrt(squared)) / (0.5 * radius) + 0.5, 0, 1)
    return (inside * inside * (3 - 2 * inside)).astype(np.float32)


def _gusts(shape: tuple[int, ...], frame: int, seed: int, period: float) -> np.ndarray:
    """Sideways acceleration of the hot smoke, in buoyancies: noise over height and time, (Y, D - 1)."""
    up = (np.arange(shape[-2]) + 0.5) / shape[-2]
    time = np.full(1, frame / period)
    return np.stack([gradient_noise([3.0 * up + 0.5, time], seed * 2 + k) for k in range(len(shape) - 1)], -1)
