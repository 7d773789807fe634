"""Loops of moving textures (wang05): how the last frame leads into the first, and how like the sample all of them stay.

`python -m bench.loops` prints one JSON object. Textures are those of `bench.texture`, 512² from samples of 128², each a
loop of 4 seconds.
"""

from __future__ import annotations

import json
import sys
from typing import Any

import numpy as np

from bench import texture
from bench.synthesis import median, timed
from synth.texture import carry, measures
from synth.texture.loop import Loop
from synth.texture.sample import luminance

PERIOD = 120
MOMENTS = (1, 41, 81)  # frames of which every number is taken
LOOPED = (*texture.FIGURES, *(f"{name} on noise" for name in texture.FOREIGN))


def run(name: str) -> dict[str, Any]:
    """All numbers of one loop."""
    of = texture.TEXTURES[f"{name}, carry"]
    given, v = of.read(), of.flow(texture.SIZE)
    reference = measures.Reference(given)
    loop = Loop(given, (texture.SIZE, texture.SIZE), carry.Settings(), 1)
    states, found = timed(lambda: loop.states(lambda frame: v, PERIOD))
    pictures, took = zip(*(timed(lambda state=state: loop.picture(state)) for state in states), strict=True)
    frames = [luminance(picture, given.white) for picture in pictures]
    steps = [float(np.sqrt(np.mean((frames[(k + 1) % PERIOD] - frame) ** 2))) for k, frame in enumerate(frames)]
    theta = texture.flow.angles(v)
    likeness = [measures.of_frame(frames[moment - 1], theta, reference) for moment in MOMENTS]
    anew = [loop.renewed(state) for state in states]
    return {"texture": name, "patches": round(float(np.mean([len(state.id) for state in states]))),
            "last to first": texture.rounded(steps[-1] / float(np.median(steps[:-1]))),
            "largest step": texture.rounded(max(steps) / float(np.median(steps))),
            **{f"{key}, {which.__name__}": texture.rounded(which(numbers[key] for numbers in likeness))
               for key, which in (("std", min), ("std", max), ("grad", min), ("grad", max), ("hist", max),
                                  ("bwd", max))},
            "synthesised anew, %": round(100 * float(np.mean(anew)), 2),
            "most in a frame, %": round(100 * max(anew), 2),
            "all patches, wall s": round(found["wall"], 1), "all patches, processor s": round(found["processor"], 1),
            "a picture, wall ms": round(1000 * median(list(took))["wall"])}


def main() -> None:
    rows = []
    for name in LOOPED:
        print(f"  {name}", file=sys.stderr, flush=True)
        rows.append(run(name))
    print(json.dumps({"period": PERIOD, "loops": rows}, indent=1, ensure_ascii=False))


if __name__ == "__main__":
    main()
