"""Waves of deep water: a sum of sines with random phases, each with the frequency of its length [Tessendorf 2001].

Frequencies are rounded to whole turns in T frames, so frame T is frame 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import fft


@dataclass(frozen=True, eq=False)
class Sea:
    """amplitude (n, n // 2 + 1) complex of waves that travel along their k; omega (same) float, radians per frame;
    kx, ky radians per texel."""

    amplitude: np.ndarray
    omega: np.ndarray
    kx: np.ndarray
    ky: np.ndarray

    def slopes(self, frame: int) -> np.ndarray:
        """Slopes along x and y in a frame, (2, n, n) float32."""
        now = self.amplitude * np.exp(-1j * self.omega * frame)
        both = np.stack([1j * self.kx * now, 1j * self.ky * now])
        return fft.irfft2(both, s=(len(self.amplitude),) * 2).astype(np.float32)

    def travel(self) -> np.ndarray:
        """The velocity (2,) of the waves' pattern, texels per frame: phase velocities, weighted by squared slope."""
        k2 = self.kx**2 + self.ky**2
        weight = np.abs(self.amplitude) ** 2 * k2
        over = self.omega / np.maximum(k2, 1e-12)
        return np.array([(weight * over * self.kx).sum(), (weight * over * self.ky).sum()]) / weight.sum()


def dispersion(k: np.ndarray, gravity: float, frames: int) -> np.ndarray:
    """omega = sqrt(g k), radians per frame, rounded to whole turns in T frames."""
    step = 2 * np.pi / frames
    return np.rint(np.sqrt(gravity * k) / step) * step


def sea(n: int, frames: int, random: np.random.Generator, *, length: float, wind: float, gravity: float,
        slope: float, spread: float = 3.0, shortest: float = 3.0) -> Sea:
    """Waves on a tile of n texels.

    length    of the longest waves, texels: the spectrum of Phillips falls off beyond it
    wind      direction they travel, radians
    gravity   texels per frame^2
    slope     rms slope
    spread    power of the cosine of the angle to the wind
    shortest  waves in texels; shorter ones are left out
    """
    kx = 2 * np.pi * np.fft.rfftfreq(n)[None]
    ky = 2 * np.pi * np.fft.fftfreq(n)[:, None]
    k = np.hypot(kx, ky)
    k[0, 0] = 1
    omega = dispersion(k, gravity, frames)
    facing = (kx * np.cos(wind) + ky * np.sin(wind)) / k
    peak = 2 * np.pi / length
    spectrum = np.exp(-0.5 * (peak / k) ** 2) / k**2 * np.abs(facing) ** spread * np.exp(
        -(k * shortest / 2 / np.pi) ** 2)
    spectrum[omega == 0] = 0
    # the other half of the spectrum is the conjugate: a wave against the wind here is one along it there
    omega = omega * np.where(facing >= 0, 1, -1)
    draws = random.standard_normal((2, *k.shape))
    amplitude = spectrum * (draws[0] + 1j * draws[1])
    amplitude[:, [0, -1]] = 0  # these columns would have to agree with their own conjugates
    made = Sea(amplitude, omega, np.broadcast_to(kx, k.shape), np.broadcast_to(ky, k.shape))
    rms = np.sqrt(np.square(made.slopes(0)).sum(0).mean())
    return Sea(amplitude * slope / rms, omega, made.kx, made.ky)
