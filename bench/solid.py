"""Solid synthesis (ma09 §3.2): time, memory, how both grow with the voxels, and what k-coherence costs in quality.

`python -m bench.solid` prints one JSON object and draws out/bench-solid.svg, seconds over voxels. Exemplar 64² on three
views, 3 levels, 9², k-coherence, a constant flow: figure 9's.
"""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from bench import plot
from bench.machine import peak_memory
from bench.synthesis import timed
from pipeline.files import atomic
from synth.motion.exemplar import exemplar
from synth.motion.quality import measure_view
from synth.motion.synthesis_3d import Settings, Synthesis
from synth.motion.views import View

PLANES = {"front": ((1, 0, 0), (0, 1, 0)), "side": ((0, 0, 1), (0, 1, 0)), "top": ((1, 0, 0), (0, 0, 1))}
FIGURE_9 = (256, 64, 256)
EDGES = (64, 96, 128, 192, 256)
CURVE = Path("out/bench-solid.svg")


def flow(shape: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray]:
    """A constant flow along x, and the direction z: (Z, Y, X, 3) each."""
    L, towards = np.zeros((*shape, 3), np.float32), np.zeros((*shape, 3), np.float32)
    L[..., 0], towards[..., 2] = 1, 1
    return L, towards


def three_views(name: str, size: int, weights: tuple[float, float, float] = (1, 1, 1)) -> list[View]:
    I = exemplar(name, size)
    return [View(I, *plane, weight) for plane, weight in zip(PLANES.values(), weights, strict=True)]


def frames(shape: tuple[int, int, int], several: bool) -> dict[str, Any]:
    """Times of the first frame and, with `several`, of the next one."""
    synthesis = Synthesis(three_views("sinusoid", 64), shape, Settings(3), 1)
    L, towards = flow(shape)
    state, first = timed(lambda: synthesis.frame(L, towards, None))
    found = {"first": first}
    if several:
        found["next"] = timed(lambda: synthesis.frame(L, towards, state))[1]
    return found


def growth() -> dict[str, Any]:
    """Processor seconds of the first frame from 64³ to 256³, and the exponent in the number of voxels."""
    took = {edge: frames((edge,) * 3, False)["first"]["processor"] for edge in EDGES}
    exponent = np.polyfit(np.log([edge**3 for edge in took]), np.log(list(took.values())), 1)[0]
    curve = plot.Curve(np.array([edge**3 for edge in took]), np.array(list(took.values())), [f"{e}³" for e in took])
    atomic.write_text(CURVE, plot.svg(f"first frame: time ~ voxels^{exponent:.2f}", "voxels", "processor seconds",
                                      {"": curve}, log_x=True))
    return {"processor s": {f"{edge}³": round(s, 1) for edge, s in took.items()}, "exponent": round(float(exponent), 3)}


def quality() -> list[dict[str, Any]]:
    """The five numbers of each view, by exact search and by k-coherence, 64³."""
    rows = []
    for name, size, weights in (("sinusoid", 32, (1, 1, 1)), ("heart", 16, (1, 0.05, 0.05))):
        for search in ("exact", "k-coherence"):
            views = three_views(name, size, weights)
            widths = (17, 9) if name == "heart" else (9,)
            synthesis = Synthesis(views, (64, 64, 64), Settings(int(np.log2(size / 8)) + 1, widths, search=search), 1)
            L, towards = flow((64, 64, 64))
            state, took = timed(lambda: synthesis.frame(L, towards, None))  # noqa: B023  # called at once
            axes = np.broadcast_to(np.eye(3, dtype=np.float32), (64, 64, 64, 3, 3))
            for plane, view in list(zip(PLANES, views, strict=True))[: 3 if min(weights) == 1 else 1]:
                numbers = asdict(measure_view(synthesis.visible(state), axes, view))
                rows.append({"exemplar": name, "search": search, "view": plane,
                             **{key: round(value, 3) for key, value in numbers.items()},
                             "processor s": round(took["processor"], 1)})
    return rows


def main() -> None:
    frames((32, 32, 32), True)  # the kernels are built before they are timed
    found: dict[str, Any] = {"256²×64": frames(FIGURE_9, True), "peak memory MB": round(peak_memory())}
    print("... how it grows", file=sys.stderr, flush=True)
    found |= {"growth": growth(), "quality in three dimensions": quality()}
    print(json.dumps(found, indent=1, ensure_ascii=False))


if __name__ == "__main__":
    main()
