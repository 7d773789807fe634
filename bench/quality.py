"""How good the detail is: five numbers and whole motifs, for every built-in exemplar and size; and what helped.

`python -m bench.quality` prints one JSON object. Exemplars of 16² to 128², output four times as wide (at least 128,
at most 512), on a constant diagonal and on a curved flow; first frames, exact search, as many levels as "auto".
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict
from typing import Any
from unittest.mock import patch

import numpy as np

from bench.flows import FLOWS
from synth.motion import detail, initialize
from synth.motion.detail import Settings, enough_levels, synthesize
from synth.motion.exemplar import KINDS, exemplar
from synth.motion.local_axes import axes_2d
from synth.motion.quality import measure, whole_motifs

SIZES = (16, 32, 48, 64, 128)
CLOSED = ("circle", "square", "heart")


def row(kind: str, size: int, flow: str, levels: int | None = None, seed: int = 1, **settings: Any) -> dict[str, Any]:
    """The numbers of one synthesis; whole and motifs only where the motif is closed."""
    I, L = exemplar(kind, size), FLOWS[flow](min(max(128, 4 * size), 512))
    levels = levels or enough_levels(size)
    H = next(synthesize(I, [L], L.shape[:2], Settings(levels, **settings), seed))
    axes = axes_2d(L)
    numbers = {key: round(value, 3) for key, value in asdict(measure(H, axes, I)).items()}
    whole, motifs = whole_motifs(H, axes, I) if kind in CLOSED else (None, None)
    return {"exemplar": kind, "size": size, "flow": flow, **numbers, "whole": whole, "motifs": motifs}


def met(found: dict[str, Any]) -> bool:
    """85 to 115 % of the rms, 45 % used, and 9 in 10 motifs whole."""
    closed = found["motifs"] is None or (found["motifs"] > 0 and found["whole"] >= 0.9 * found["motifs"])
    return 0.85 <= found["rms"] <= 1.15 and found["used"] >= 0.45 and closed


def _random_starts(exemplar: np.ndarray, axes: np.ndarray, randoms: Sequence[np.random.Generator]) -> list[np.ndarray]:
    return [initialize.random_pixels(exemplar, axes.shape[:2], random) for random in randoms]


def _not_sown(H: np.ndarray, exemplar: np.ndarray, axes: np.ndarray) -> np.ndarray:
    return H


# what is taken away, and the settings it is tried with
WITHOUT: dict[str, tuple[Callable[[], AbstractContextManager[Any]], dict[str, Any]]] = {
    "all of it": (nullcontext, {}),
    "random pixels instead of mosaics (ma09 §3.4)": (lambda: patch.object(initialize, "mosaics", _random_starts), {}),
    "one mosaic instead of the best of eight": (lambda: patch.object(detail, "STARTS", 1), {}),
    "no exemplar sown where it is empty": (lambda: patch.object(initialize, "reseed", _not_sown), {}),
    "three levels (ma09 §4), not as many as bring it down to 8²": (nullcontext, {"levels": 3}),
    "two levels": (nullcontext, {"levels": 2}),
    "k-coherence instead of exact search": (nullcontext, {"search": "k-coherence"}),
    "none of it: random pixels, nothing sown, three levels": (
        lambda: patch.multiple(initialize, mosaics=_random_starts, reseed=_not_sown), {"levels": 3}),
}


def helped() -> list[dict[str, Any]]:
    """Each help taken away once: means over the closed motifs at 64² on both flows."""
    rows = []
    for without, (context, settings) in WITHOUT.items():
        with context():
            found = [row(kind, 64, flow, **settings) for kind in CLOSED for flow in FLOWS]
        means = {key: round(float(np.mean([r[key] for r in found])), 3)
                 for key in ("forward", "backward", "used", "rms", "gradient")}
        rows.append({"with": without, **means, "whole": sum(r["whole"] for r in found),
                     "motifs": sum(r["motifs"] for r in found)})
        print(f"  {without}", file=sys.stderr, flush=True)
    return rows


def main() -> None:
    rows = []
    for size in SIZES:
        for kind in KINDS:
            for flow in FLOWS:
                rows.append(row(kind, size, flow))
                rows[-1]["met"] = met(rows[-1])
        print(f"  quality at {size}² done", file=sys.stderr, flush=True)
    print(json.dumps({"quality": rows, "helped": helped()}, indent=1))


if __name__ == "__main__":
    main()
