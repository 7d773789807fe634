"""The boundary of ma09 figure 7: what flows through the stone's wall, and what observing it costs the texture.

`python -m bench.boundary` prints one JSON object. The scene's own sizes: exemplars of 64², the wake on 200 x 150, the
first frame and the fifth; and what remains of the divergence where F is projected past the stone, in 2-D and 3-D.
"""

from __future__ import annotations

import json
import sys
import time
from dataclasses import asdict
from typing import Any

import numpy as np

from bench.machine import ROOT
from pipeline.files import pictures
from synth import obstacle, wake
from synth.motion.detail import Settings, enough_levels, synthesize
from synth.motion.exemplar import exemplar, from_bitmap
from synth.motion.local_axes import axes_2d, to_world
from synth.motion.quality import measure
from synth.particles import sampled
from synth.projection import divergence, project

SHAPE, CENTRE, RADIUS = (150, 200), (1 / 30, 0.5), 0.12
FRAMES = (1, 5)


def through_the_wall(H: np.ndarray) -> np.ndarray:
    """The component of a field (Y, X, 2) along the normals of the stone at 1440 points of its wall."""
    angle = np.linspace(0, 2 * np.pi, 1440, endpoint=False)
    normal = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    rows, columns = SHAPE
    at = (np.array(CENTRE) + RADIUS * normal + np.array([0.5 * columns / rows, 0])) * rows - 0.5
    return np.asarray(np.sum(sampled(H, at.astype(np.float32)) * normal, axis=-1))


def texture() -> list[dict[str, Any]]:
    """Each exemplar with the boundary observed and not."""
    gravel = from_bitmap(pictures.read_grey(ROOT / "scenes" / "assets" / "gravel.png", "exemplar.file"), 64)
    distance = obstacle.ball(SHAPE, CENTRE, RADIUS).distance
    rows = []
    for name, I in {"gravel": gravel, "circle": exemplar("circle", 64), "sinusoid": exemplar("sinusoid", 64)}.items():
        for observed in (True, False):
            L = list(wake.wake(SHAPE, FRAMES[-1], seed=1, centre=CENTRE, radius=RADIUS))
            every = synthesize(I, L, SHAPE, Settings(enough_levels(64)), 1, distance if observed else None)
            for frame, H in enumerate(every, start=1):
                if frame in FRAMES:
                    axes = axes_2d(L[frame - 1])
                    rms = float(np.sqrt(np.mean(np.sum(H.astype(np.float64) ** 2, axis=-1))))
                    wall = through_the_wall(to_world(H, axes)) / rms
                    quality = {key: round(value, 3) for key, value in asdict(measure(H, axes, I)).items()}
                    rows.append({"exemplar": name, "boundary": "observed" if observed else "not", "frame": frame,
                                 "wall, rms": round(float(np.sqrt(np.mean(wall**2))), 4),
                                 "wall, largest": round(float(np.abs(wall).max()), 4), **quality})
            print(f"  {name}, boundary {'observed' if observed else 'not observed'}", file=sys.stderr, flush=True)
    return rows


def projection() -> list[dict[str, Any]]:
    """Noise projected past a ball: the divergence that remains over the rms gradient, and seconds."""
    rows = []
    for shape in ((150, 200), (256, 256), (64, 64, 64)):
        distance = obstacle.ball(shape, (0.03, 0.5, 0.0)[:len(shape)], 0.12).distance
        noise = np.random.Generator(np.random.Philox(key=1)).standard_normal((*shape, len(shape))).astype(np.float32)
        for border in ("wall", "open"):
            start = time.perf_counter()
            F = project(noise, border, distance)
            seconds = time.perf_counter() - start
            slope = np.sqrt(np.mean([np.gradient(F, axis=axis) ** 2 for axis in range(len(shape))]))
            left = np.sqrt(np.mean(divergence(F, border, distance) ** 2)) / slope
            rows.append({"cells": "x".join(map(str, shape[::-1])), "border": border, "divergence": float(f"{left:.1e}"),
                         "seconds": round(seconds, 2)})
    return rows


def main() -> None:
    print(json.dumps({"texture at the boundary": texture(), "projection past a ball": projection()}, indent=1))


if __name__ == "__main__":
    main()
