"""The wake behind a round stone: the river scene of [Bridson et al. 2007, figure 3], L of ma09 figure 7.

The curl of one potential: a background flow, ramped down to zero on the disc, so that it passes round it (their
§2.4), plus octaves of noise, each ramped within its own length of the disc, in a wake that widens downstream.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from synth.field import domain_origin
from synth.noise import gradient_noise

# half the distance between the two potentials of a difference, heights; Bridson's
STEP = 1e-4
# the wake begins this wide, in radii to each side; Bridson's
BEGINNING = 1.5


def ramp(r: np.ndarray) -> np.ndarray:
    """From -1 to 1 with r from -1 to 1, level beyond, smooth to the second derivative [Bridson et al. 2007, §2.4]."""
    r = np.clip(r, -1, 1)
    return (15 * r - 10 * r**3 + 3 * r**5) / 8


def smooth_step(r: np.ndarray) -> np.ndarray:
    """From 0 to 1 with r from 0 to 1, level beyond, smooth to the second derivative."""
    r = np.clip(r, 0, 1)
    return r**3 * (10 - 15 * r + 6 * r * r)


def potential(x: np.ndarray, y: np.ndarray, time: float, *, seed: int, centre: Sequence[float], radius: float,
              flow: float, influence: float, expansion: float, lengths: Sequence[float],
              gains: Sequence[float]) -> np.ndarray:
    """psi, whose curl (d psi / dy, -d psi / dx) is the flow, at points x, y (world units) and a time in periods.

    Settings as `wake`. Constant, zero, on the disc.
    """
    from_x, from_y = x - centre[0], y - centre[1]
    distance = np.hypot(from_x, from_y) - radius
    psi = flow * from_y * ramp(distance / influence)
    downstream = from_x * np.sign(flow)
    share = np.minimum(1, ramp(1 + downstream / radius)) * smooth_step(
        1 - np.abs(from_y) / (BEGINNING * radius + expansion * np.maximum(downstream, 0)))
    reached = share > 0
    if reached.any():
        octaves = sum(gain * ramp(distance[reached] / length) * gradient_noise(
            [x[reached] / length, y[reached] / length, np.full(1, time)], seed * len(lengths) + number)
            for number, (length, gain) in enumerate(zip(lengths, gains, strict=True)))
        psi[reached] += share[reached] * octaves
    return psi


def velocity(x: np.ndarray, y: np.ndarray, time: float, **settings: object) -> np.ndarray:
    """The flow (..., 2) float64 at points x, y, heights per unit of time; arguments as `potential`."""
    at = [potential(x + i * STEP, y + j * STEP, time, **settings)  # type: ignore[arg-type]
          for i, j in ((0, 1), (0, -1), (1, 0), (-1, 0))]
    return np.stack([at[0] - at[1], at[3] - at[2]], axis=-1) / (2 * STEP)


def wake(shape: tuple[int, ...], frames: int, *, seed: int, centre: tuple[float, float] = (1 / 30, 0.5),
         radius: float = 0.12, flow: float = -0.25, influence: float = 0.25, expansion: float = 0.3,
         lengths: tuple[float, ...] = (0.1, 0.06, 0.026), gains: tuple[float, ...] = (0.03, 0.0105, 0.003),
         step: float = 0.04, period: float = 25.0) -> Iterator[np.ndarray]:
    """Frames of the flow on the cells `shape` (Y, X); the defaults are Bridson's.

    centre, radius  of the disc, world units
    flow            speed of the river along x, heights per unit of time
    influence       distance from the disc within which the flow is deflected, world units
    expansion       how much the wake widens, to each side, per height downstream
    lengths, gains  of the octaves of noise: size of their features (world units), amplitude of their potential
    step            units of time in a frame
    period          frames in which the noise changes completely
    Yields (Y, X, 2) float32, cells per frame. Raises ValueError for another dimension, or for numbers of lengths and
    gains that differ.
    """
    if len(shape) != 2:
        raise ValueError(f"the wake is a flow of the plane, not of a shape of {shape}")
    if len(lengths) != len(gains):
        raise ValueError(f"the wake has {len(lengths)} lengths and {len(gains)} gains of octaves")
    first_x, first_y = domain_origin(shape)
    rows, columns = (first + np.arange(n) / shape[0] for first, n in zip((first_y, first_x), shape, strict=True))
    y, x = np.meshgrid(rows, columns, indexing="ij")
    for frame in range(frames):
        v = velocity(x, y, frame / period, seed=seed, centre=centre, radius=radius, flow=flow, influence=influence,
                     expansion=expansion, lengths=lengths, gains=gains)
        yield (v * step * shape[0]).astype(np.float32)
