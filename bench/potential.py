"""Potential synthesis beside the synthesis of the motion itself (ma09 §3.6, Discussion): what it gains and loses.

`python -m bench.potential` prints one JSON object: 64² to 256² on the curved flow, first frames, exact search, as many
levels as "auto"; exemplars by procedure and from a bitmap.
"""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from typing import Any

import numpy as np

from bench.flows import wave
from bench.machine import ROOT
from bench.quality import CLOSED
from bench.synthesis import timed
from pipeline.files import pictures
from synth.motion import detail, potential
from synth.motion.detail import Settings, enough_levels
from synth.motion.exemplar import exemplar, from_bitmap
from synth.motion.local_axes import axes_2d, to_world
from synth.motion.quality import measure, whole_motifs
from synth.projection import divergence

SIZE, OUTPUT = 64, 256
EXEMPLARS = ("heart", "square", "stripes", "sinusoid", "brick")
VARIANTS = {"motion": detail.Synthesis, "potential": potential.Synthesis}


def relative_divergence(world: np.ndarray) -> float:
    """rms divergence of H' (Y, X, 2), by central differences, border left out, over the rms of its gradient."""
    slopes = sum(np.mean(np.gradient(world[..., c], axis=axis) ** 2) for c in (0, 1) for axis in (0, 1))
    return float(np.sqrt(np.mean(divergence(world)[1:-1, 1:-1] ** 2) / slopes))


def row(name: str, variant: str) -> dict[str, Any]:
    """The numbers of one synthesis."""
    if name == "brick":
        grey = pictures.read_grey(ROOT / "scenes" / "assets" / "brick.png", "exemplar.file")
        I = from_bitmap(grey, SIZE)
    else:
        I = exemplar(name, SIZE)
    L = wave(OUTPUT)
    synthesis = VARIANTS[variant](I, L.shape[:2], Settings(enough_levels(SIZE)), 1)
    state, first = timed(lambda: synthesis.frame(L, None))
    _, after = timed(lambda: synthesis.frame(L, state))
    H, axes = synthesis.visible(state), axes_2d(L)
    numbers = {key: round(value, 3) for key, value in asdict(measure(H, axes, I)).items()}
    whole, motifs = whole_motifs(H, axes, I) if name in CLOSED else (None, None)
    return {"exemplar": name, "synthesized": variant, "lost": round(potential.potential(I)[1], 3), **numbers,
            "whole": whole, "motifs": motifs, "divergence": float(f"{relative_divergence(to_world(H, axes)):.1e}"),
            "first, processor s": round(first["processor"], 2), "next": round(after["processor"], 2)}


def main() -> None:
    rows = []
    for variant in VARIANTS:  # the kernels are built before they are timed
        row(EXEMPLARS[0], variant)
    for name in EXEMPLARS:
        rows += [row(name, variant) for variant in VARIANTS]
        print(f"  potential of {name} done", file=sys.stderr, flush=True)
    print(json.dumps({"motion and potential": rows}, indent=1))


if __name__ == "__main__":
    main()
