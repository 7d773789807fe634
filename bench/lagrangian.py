"""Detail at samples that move with the flow beside detail on a grid (ma09 §5): quality over time, and flicker.

`python -m bench.lagrangian` prints one JSON object: 32² to 128², exact search, as many levels as "auto". Quality of the
first frame and of the twentieth on the curved flow; flicker on a constant flow that moves half a cell a frame: the
change of the detail, where it has come to after four frames, over its rms.
"""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from typing import Any

import numpy as np

from bench.flows import wave
from bench.quality import CLOSED
from bench.synthesis import timed
from synth.motion import detail, lagrangian
from synth.motion.detail import Settings, enough_levels
from synth.motion.exemplar import exemplar
from synth.motion.local_axes import axes_2d
from synth.motion.quality import measure, whole_motifs

SIZE, OUTPUT, FRAMES = 32, 128, 20
EXEMPLARS = ("heart", "square", "sinusoid")
STEADY = (0.5, 0.25)  # cells per frame: four frames are whole cells, so that comparing resamples nothing
SAMPLES = {"grid": detail.Synthesis, "lagrangian": lagrangian.Synthesis}


def quality_rows(name: str, samples: str) -> list[dict[str, Any]]:
    """The numbers of the first frame and of the last one."""
    I, L = exemplar(name, SIZE), wave(OUTPUT)
    synthesis: Any = SAMPLES[samples](I, L.shape[:2], Settings(enough_levels(SIZE)), 1)
    axes, rows, state = axes_2d(L), [], None
    for number in range(1, FRAMES + 1):
        before = state
        state, took = timed(lambda before=before: synthesis.frame(L, before))
        if number in (1, FRAMES):
            H = synthesis.visible(state)
            numbers = {key: round(value, 3) for key, value in asdict(measure(H, axes, I)).items()}
            whole, motifs = whole_motifs(H, axes, I) if name in CLOSED else (None, None)
            rows.append({"exemplar": name, "samples": samples, "frame": number, **numbers, "whole": whole,
                         "motifs": motifs, "processor s": round(took["processor"], 2)})
    return rows


def flicker(name: str, samples: str) -> dict[str, Any]:
    """The change in four frames, mean over the last four, and how much of the rms twelve frames leave."""
    I, L = exemplar(name, SIZE), np.broadcast_to(np.float32(STEADY), (OUTPUT, OUTPUT, 2)).copy()
    synthesis: Any = SAMPLES[samples](I, L.shape[:2], Settings(enough_levels(SIZE)), 1)
    state, H = None, []
    for _ in range(12):
        state = synthesis.frame(L, state)
        H.append(synthesis.visible(state))
    dx, dy = (round(4 * s) for s in STEADY)
    inner = np.s_[OUTPUT // 4:-8, OUTPUT // 4:-8]  # what flowed in meanwhile is new
    changes = [np.sqrt(np.mean((H[n][inner] - np.roll(H[n - 4], (dy, dx), (0, 1))[inner]) ** 2) / np.mean(H[n] ** 2))
               for n in range(8, 12)]
    return {"exemplar": name, "samples": samples, "change in 4 frames": round(float(np.mean(changes)), 4),
            "rms left": round(float(np.sqrt(np.mean(H[-1][inner] ** 2) / np.mean(H[0][inner] ** 2))), 3)}


def main() -> None:
    rows, changes = [], []
    for samples in SAMPLES:  # the kernels are built before they are timed
        flicker(EXEMPLARS[0], samples)
    for name in EXEMPLARS:
        for samples in SAMPLES:
            rows += quality_rows(name, samples)
            changes.append(flicker(name, samples))
        print(f"  lagrangian samples of {name} done", file=sys.stderr, flush=True)
    print(json.dumps({"grid and moving samples": rows, "flicker": changes}, indent=1))


if __name__ == "__main__":
    main()
