"""The coarse motion L (ma09 §3 step 1): simulated, procedural or analytic; and its upsampling (pseudocode 1)."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from synth import noise, smoke, wake
from synth.advect import velocity_field


def coarse(kind: str, shape: tuple[int, ...], frames: int, seed: int = 0,
           **settings: Any) -> Iterator[np.ndarray]:
    """Frames of a coarse motion L on `shape`, (Y, X) or (Z, Y, X) cells.

    kind "smoke"       a rising plume; settings as `synth.smoke.simulate`
         "curl-noise"  a random divergence-free flow; settings as `synth.noise.curl_noise`
         "wake"        a river past a round stone; settings as `synth.wake.wake`
         "analytic"    a steady flow; settings: flow (a key of FLOWS), speed (largest, cells per frame),
                       angle (degrees, rotates the whole pattern)
    Yields (*shape, D) float32, cells per frame. Raises ValueError for an unknown kind or setting, at once.
    """
    if kind not in KINDS:
        raise ValueError(f"coarse motion {kind!r} is none of {', '.join(KINDS)}")
    if len(shape) not in (2, 3):
        raise ValueError(f"a coarse motion has 2 or 3 dimensions, not a shape of {shape}")
    known = settings_of(kind)
    for name in settings:
        if name not in known:
            raise ValueError(f"coarse motion {kind!r} has no setting {name!r}; it has {', '.join(known)}")
    return KINDS[kind](shape, frames, seed=seed, **settings)


def settings_of(kind: str) -> dict[str, Any]:
    """The settings of a kind of coarse motion and their defaults."""
    function = smoke.simulate if kind == "smoke" else KINDS[kind]
    parameters = inspect.signature(function).parameters.values()
    return {p.name: p.default for p in parameters if p.kind is p.KEYWORD_ONLY and p.name != "seed"}


def _smoke(shape: tuple[int, ...], frames: int, **settings: Any) -> Iterator[np.ndarray]:
    return (v for v, _ in smoke.simulate(shape, frames, **settings))


# Steady flows over coordinates x, y measured from the centre, where the domain's half height is 1.
FLOWS: dict[str, Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]] = {
    "constant": lambda x, y: (np.ones_like(x), np.zeros_like(x)),
    "diagonal": lambda x, y: (np.full_like(x, np.sqrt(0.5)), np.full_like(x, np.sqrt(0.5))),
    "rotation": lambda x, y: (-y, x),
    "shear": lambda x, y: (y, np.zeros_like(x)),
    "saddle": lambda x, y: (x, -y),
    "vortex-pair": lambda x, y: _difference(_vortex(x + 0.4, y), _vortex(x - 0.4, y)),
}
"""The analytic flows, by name. All are free of divergence."""


def _vortex(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A Gaussian vortex at the origin, counter-clockwise."""
    strength = np.exp(-(x * x + y * y) / (2 * 0.25**2))
    return -y * strength, x * strength


def _difference(a: tuple[np.ndarray, np.ndarray], b: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    return a[0] - b[0], a[1] - b[1]


def _analytic(shape: tuple[int, ...], frames: int, *, seed: int = 0, flow: str = "constant",
              speed: float = 1.0, angle: float = 0.0) -> Iterator[np.ndarray]:
    """A steady flow in the x-y plane (seed plays no part); the fastest cell moves at `speed`."""
    if flow not in FLOWS:
        raise ValueError(f"flow {flow!r} is none of {', '.join(FLOWS)}")
    half = shape[-2] / 2
    rows = (np.arange(shape[-2]) + 0.5) / half - 1
    columns = (np.arange(shape[-1]) + 0.5) / half - shape[-1] / shape[-2]
    y, x = np.meshgrid(rows, columns, indexing="ij")
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    along, across = FLOWS[flow](c * x + s * y, c * y - s * x)
    v = np.zeros((*shape, len(shape)), np.float32)
    v[..., 0], v[..., 1] = c * along - s * across, s * along + c * across
    v *= np.float32(speed / np.linalg.norm(v, axis=-1).max())
    return (v.copy() for _ in range(frames))


KINDS: dict[str, Callable[..., Iterator[np.ndarray]]] = {
    "smoke": _smoke, "curl-noise": noise.curl_noise, "wake": wake.wake, "analytic": _analytic}
"""The kinds of coarse motion that `coarse` makes."""


def upsample(v: np.ndarray, shape: tuple[int, ...], kernel: str = "linear") -> np.ndarray:
    """`v` on the cells `shape` of the same domain (ma09 pseudocode 1, Upsample).

    v       (Y, X, 2) or (Z, Y, X, 3) float32, cells per frame of its own grid
    shape   (Y', X') or (Z', Y', X') cells; each component is scaled by its axis's ratio, so that the motion stays the
            same in world units
    kernel  "linear", or "cubic": interpolating and smooth (Catmull and Rom), which leaves no facets in what the flow
            carries when the ratio is large
    Returns (*shape, D) float32, cells per frame of the new grid. The same shape returns v exactly.
    """
    v = velocity_field(v)
    if len(shape) != v.ndim - 1:
        raise ValueError(f"a field of {v.ndim - 1} dimensions cannot fill {shape}")
    if kernel not in ("linear", "cubic"):
        raise ValueError(f"kernel {kernel!r} is neither linear nor cubic")
    if v.shape[:-1] == tuple(shape):
        return v
    ratio = [new / old for new, old in zip(shape, v.shape, strict=False)]
    for axis in reversed(range(len(shape))):  # x first: the last, largest pass then copies whole rows
        v = _resample(v, axis, shape[axis], kernel)
    return v * np.array(ratio[::-1], np.float32)


def _resample(a: np.ndarray, axis: int, n: int, kernel: str) -> np.ndarray:
    """`a` with n cells along an axis; beyond its border it goes on as its outermost cell."""
    old = a.shape[axis]
    if n == old:
        return a
    position = (np.arange(n) + 0.5) * old / n - 0.5
    base = np.floor(position).astype(int)
    t = position - base
    if kernel == "linear":
        weights = {0: 1 - t, 1: t}
    else:
        weights = {-1: 0.5 * t * (-1 + t * (2 - t)), 0: 1 + 0.5 * t * t * (3 * t - 5),
                   1: 0.5 * t * (1 + t * (4 - 3 * t)), 2: 0.5 * t * t * (t - 1)}
    column = [-1 if i == axis else 1 for i in range(a.ndim)]
    total = np.zeros((*a.shape[:axis], n, *a.shape[axis + 1 :]), np.float32)
    for step, weight in weights.items():
        taken = np.take(a, np.clip(base + step, 0, old - 1), axis)
        taken *= weight.astype(np.float32).reshape(column)
        total += taken
    return total
